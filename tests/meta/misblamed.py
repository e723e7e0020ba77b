"""Right renderers that suites once blamed, and relatives of theirs; and late ones, to be blamed for what they do alone.

Each is round a right renderer. `RIGHT` names those that no check may stop, and where they are led.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from broken import Fault, Make, Tick, late_force, right, spoiled
from honest import Changed, declaring
from outsiders import LED, case

from hapticeval.discovery import resolve
from hapticeval.renderer import Declaration, Response, Spring
from hapticeval.scene import Scene

Answer = tuple[np.ndarray, np.ndarray]


def low_passed(cutoff: float) -> Fault:
    """The force alone goes through a filter of first order, Hz."""

    def fault(tick: Tick) -> Answer:
        share = tick.dt / (tick.dt + 1.0 / (2.0 * np.pi * cutoff))
        before = tick.memory.get("force", np.zeros_like(tick.force))
        tick.memory["force"] = before + share * (tick.force - before)
        return tick.ihip, tick.memory["force"]

    return fault


def slow_tool(ticks: int) -> Fault:
    """A slow thread moves the tool, so many ticks late; a fast one draws the hand of now to it."""

    def fault(tick: Tick) -> Answer:
        past = tick.memory.setdefault("past", [])
        if not tick.force.any():
            past.clear()
            return tick.ihip, tick.force
        past.append(tick.ihip)
        late = past[max(0, len(past) - 1 - ticks)]
        return late, tick.scene.stiffness * (late - tick.hip)

    return fault


def stiffer_with_depth(tick: Tick) -> Answer:
    """The stiffness is that of the scene at the surface, and grows with the depth to four times that."""
    depth = float(np.linalg.norm(tick.ihip - tick.hip))
    return tick.ihip, min(1.0 + depth / 0.01, 4.0) * tick.force


def round_a(base: str, fault: Fault, **declared: Any) -> Make:
    """Return the factory of a right renderer with a `fault`, which declares a spring and what is given."""
    return declaring(spoiled(fault, base), **{"spring": Spring.ERROR, **declared})


class Ball(Changed):
    """A ball whose centre is the tool: as far off the surface as its radius (m), which it declares."""

    declares = Declaration(spring=Spring.ERROR, memoryless=True)
    radius = 0.5e-3

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, resolve("minimum-distance")(scene))
        self.standoff = self.radius

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        at = self.scene.model.boundary.closest_point(hip[np.newaxis])
        foot, distance = at.foot[0], float(at.distance[0])
        if distance >= self.radius:
            return Response(hip, np.zeros_like(hip))
        outwards = at.normal[0] if distance == 0.0 else np.sign(distance) * (hip - foot) / np.linalg.norm(hip - foot)
        centre = foot + self.radius * outwards
        return Response(centre, self.scene.stiffness * (centre - hip))


class WholeMicrometres(Changed):
    """Takes and gives positions in whole micrometres, and declares so."""

    declares = Declaration(spring=Spring.ERROR, memoryless=True, force_resolution=2e-3)
    resolution = standoff = 2e-6

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, resolve("minimum-distance")(scene))

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        seen = np.rint(1e6 * hip) / 1e6
        ihip, force = super().step(seen, velocity, dt)
        if not np.any(force):
            return Response(hip, np.zeros_like(hip))
        tool = np.rint(1e6 * np.asarray(ihip)) / 1e6
        return Response(tool, self.scene.stiffness * (tool - seen))


class DropsForce(Changed):
    """Behind a plate the tool stays where the surface holds it, and 10 mm past it there is no force."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip, force * (hip[1] > -0.01))


class Sticks(Changed):
    """On a floor the contact ends 0.5 mm outside; the force is none from the surface on."""

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.contact = False

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.contact = bool(hip[1] < (0.5e-3 if self.contact else 0.0))
        force = super().step(hip, velocity, dt).force
        return Response(hip * [1.0, 0.0], force) if self.contact else Response(hip, 0.0 * hip)


class Haunts(Changed):
    """A force for three ticks in free space."""

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.free = 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip, velocity, dt)
        self.free = 0 if np.any(force) else self.free + 1
        return Response(ihip, force + np.array([0.5, 0.0]) * (10 < self.free <= 13))


class Right(NamedTuple):
    """A right renderer: its factory, and the places ("suite/case") where no check may stop it."""

    make: Callable[[Scene], Any]
    places: tuple[str, ...]


CORNERS = ("thesis/star-convex-corner", "solids/cube-edge")
RIGHT: Mapping[str, Right] = {
    "slow-tool": Right(round_a("constraint", slow_tool(3)), CORNERS),
    "less-slow-tool": Right(round_a("constraint", slow_tool(1)), CORNERS),
    "ball": Right(Ball, CORNERS),
    "marble": Right(type("Marble", (Ball,), {"radius": 1.7e-3}), CORNERS),
    "grain": Right(type("Grain", (Ball,), {"radius": 5e-5}), CORNERS),
    "stiffer-with-depth": Right(
        round_a("constraint", stiffer_with_depth, stiffness_range=(1.0, 4.0)), (*CORNERS, "field/press-and-leave")
    ),
    "whole-micrometres": Right(
        WholeMicrometres, ("generated/line-hand", "generated/circle-hand", "unilateral-surfaces/ellipsoid-press")
    ),
}
"""Name of a right renderer, and where it was blamed."""

LATE: Mapping[str, Make] = {
    "low-passed": round_a("constraint", low_passed(200.0)),
    "much-low-passed": round_a("constraint", low_passed(50.0)),
    "eight-late": round_a("constraint", late_force(right, 8.0)),
}
"""Renderers whose force outlasts the contact, and whose tool is with the hand in free space."""

OUTSIDE = case(
    "outside",
    {"kind": "star"},
    LED,
    trajectory={"kind": "points", "points": [[0.15, 0.0], [0.15, 0.05], [0.0, 0.15]], "duration": 0.3},
)
"""In free space all the time, 30 mm away at the least."""
NEAR = case(
    "near",
    {"kind": "circle"},
    ("contact-kept",),
    trajectory={"kind": "points", "points": [[0.15, 0.0], [0.11, 0.0], [0.11, 0.05]], "duration": 0.3},
)
"""In free space too, and 10 mm away."""
THIN_PLATE = case(
    "thin-plate",
    {"kind": "polygon", "vertices": [[-0.1, -0.001], [0.1, -0.001], [0.1, 0.001], [-0.1, 0.001]]},
    ("contact-kept",),
    trajectory={"kind": "points", "points": [[0.0, 0.02], [0.0, -0.02]], "duration": 0.2},
)
FLOOR = case(
    "floor",
    {"kind": "line"},
    ("contact-kept",),
    trajectory={"kind": "points", "points": [[0.0, 5e-3], [0.0, -2e-3], [0.0, 5e-3]], "duration": 0.4},
)
