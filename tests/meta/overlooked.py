"""Wrong renderers that suites once let pass or named wrongly, and relatives: a contact of nothing, a broken promise.

Each is round a right renderer. `OVERLOOKED` says where which check stops it, and in what words.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from broken import Fault, Make, Spoiled, Tick, spoiled
from honest import Spring as Nearest
from honest import declaring

from hapticeval.discovery import resolve
from hapticeval.renderer import Response, Spring
from hapticeval.scene import Scene

Answer = tuple[np.ndarray, np.ndarray]


def near_surface(tick: Tick) -> tuple[np.ndarray, np.ndarray, float]:
    """The surface point nearest to the hand, the outward normal there, and the hand's distance (m)."""
    at = tick.scene.model.boundary.closest_point(tick.hip[np.newaxis])
    return at.foot[0], at.normal[0], float(at.distance[0])


def pushes_outside(tick: Tick) -> Answer:
    """Within 8 mm of the surface the tool stands on it, and a force pushes the hand away that grows towards it."""
    foot, normal, distance = near_surface(tick)
    if not 0.0 <= distance < 8e-3:
        return tick.ihip, tick.force
    return foot, tick.scene.stiffness * (8e-3 - distance) * normal


def pulls_from_outside(tick: Tick) -> Answer:
    """Within 4 mm of the surface the tool stands on it, and the spring to it draws the hand in."""
    foot, _, distance = near_surface(tick)
    return (foot, tick.scene.stiffness * (foot - tick.hip)) if 0.0 < distance < 4e-3 else (tick.ihip, tick.force)


def pushes_from_afar(tick: Tick) -> Answer:
    """From 30 mm on the tool leaps to the far side of the model, so that the solid bars its way to the hand."""
    foot, normal, distance = near_surface(tick)
    if not 0.0 < distance < 0.03:
        return tick.ihip, tick.force
    return foot - 1.5 * tick.scene.model.size * normal, 3.0 * normal


def touches_outside(tick: Tick) -> Answer:
    """A tool above the surface, 2 mm from the hand and 6 mm from the model, pushes it."""
    _, normal, distance = near_surface(tick)
    if not 5e-3 < distance < 7e-3:
        return tick.ihip, tick.force
    return tick.hip + 2e-3 * normal, 2.0 * normal


def promising(fault: Fault, **declared: Any) -> Make:
    """Return the factory of a nearest point with a fault, which declares what is given."""
    return declaring(spoiled(fault), **declared)


def one_way(going_in: float, going_out: float) -> Fault:
    """So many times the force while the depth grows, and while it shrinks."""

    def fault(tick: Tick) -> Answer:
        depth = float(np.linalg.norm(tick.ihip - tick.hip))
        grows = depth >= tick.memory.get("depth", 0.0)
        tick.memory["depth"] = depth
        return tick.ihip, (going_in if grows else going_out) * tick.force

    return fault


def by_turns(tick: Tick) -> Answer:
    """One stiffness in even ticks, another in odd ones."""
    return tick.ihip, (0.57 if tick.number % 2 else 1.75) * tick.force


def by_place(tick: Tick) -> Answer:
    """The stiffness leaps between two numbers every two millimetres."""
    return tick.ihip, (1.7 if 1e3 * tick.ihip[0] % 4.0 < 2.0 else 0.6) * tick.force


def by_depth(tick: Tick) -> Answer:
    """The stiffness grows with the depth."""
    return tick.ihip, min(0.6 + 200.0 * float(np.linalg.norm(tick.ihip - tick.hip)), 1.8) * tick.force


def wears_off(tick: Tick) -> Answer:
    """The stiffness falls by a tenth in 100 ms."""
    return tick.ihip, max(1.75 - tick.time, 0.57) * tick.force


def drags(tick: Tick) -> Answer:
    """A twentieth of the force along the surface, against the motion."""
    speed = float(np.linalg.norm(tick.velocity))
    if not tick.force.any() or speed == 0.0:
        return tick.ihip, tick.force
    return tick.ihip, tick.force - 0.049 * np.linalg.norm(tick.force) * tick.velocity / speed


def buzzes(tick: Tick) -> Answer:
    """A twentieth of the force to and fro across it, at a quarter of the sampling rate."""
    if not tick.force.any():
        return tick.ihip, tick.force
    across = np.cross(tick.force, [0.0, 0.0, 1.0]) if tick.hip.size == 3 else np.array([-tick.force[1], tick.force[0]])
    return tick.ihip, tick.force + 0.049 * np.sin(0.5 * np.pi * tick.number + 0.3) * across


def reversed_far_away(tick: Tick) -> Answer:
    """The force is reversed more than 100 m from the origin."""
    return tick.ihip, -tick.force if np.linalg.norm(tick.hip) > 100.0 else tick.force


def strong_on_large_models(tick: Tick) -> Answer:
    """The force is ten times too large on models of over half a metre."""
    return tick.ihip, 10.0 * tick.force if tick.scene.model.size > 0.5 else tick.force


def of_one_rate(tick: Tick) -> Answer:
    """The force is right at 1 kHz alone: it is multiplied by dt / 1 ms."""
    return tick.ihip, tick.force * (tick.dt / 1e-3)


def weak_when_fast(tick: Tick) -> Answer:
    """Below 0.4 ms a tick there is a tenth of the force."""
    return tick.ihip, 0.1 * tick.force if tick.dt < 4e-4 else tick.force


def turned_when_slow(tick: Tick) -> Answer:
    """From 2 ms a tick on the force is turned by 30 degrees."""
    if tick.dt < 2e-3 or tick.hip.size != 2:
        return tick.ihip, tick.force
    turn = np.array([[np.sqrt(0.75), -0.5], [0.5, np.sqrt(0.75)]])
    return tick.ihip, turn @ tick.force


def trails_and_lets_go(tick: Tick) -> Answer:
    """In free space the tool goes a tenth of the way to the hand in a tick, and 3.8 mm inside contact is lost."""
    before = tick.memory.setdefault("tool", tick.hip)
    if not tick.force.any():
        tick.memory["tool"] = before + 0.1 * (tick.hip - before)
        return tick.memory["tool"], tick.force
    tick.memory["tool"] = tick.ihip
    if np.linalg.norm(tick.ihip - tick.hip) < 3.8e-3:
        return tick.ihip, tick.force
    return tick.hip, np.zeros_like(tick.hip)


def lingers_past_corners(tick: Tick) -> Answer:
    """Tool and force of the last contact stay for 8 ticks."""
    if tick.force.any():
        tick.memory |= {"last": (tick.ihip, tick.force), "at": tick.number}
        return tick.ihip, tick.force
    recent = "at" in tick.memory and tick.number - tick.memory["at"] < 9
    return tick.memory["last"] if recent else (tick.ihip, tick.force)


def one_triangle(tick: Tick) -> Answer:
    """The force is reversed on one triangle of two of a face: that of +x where y is above z."""
    if tick.force.size < 3 or not tick.force.any():
        return tick.ihip, tick.force
    _, y, z = tick.ihip
    reversed_there = tick.force[0] > 0.99 * np.linalg.norm(tick.force) and y > z
    return tick.ihip, -tick.force if reversed_there else tick.force


def both_late(tick: Tick) -> Answer:
    """Tool and force come 20 ticks late."""
    past = tick.memory.setdefault("past", [])
    past.append((tick.ihip, tick.force))
    return past[max(0, len(past) - 21)]


def soft_in_notches(tick: Tick) -> Answer:
    """Half of the force where two faces hold the tool."""
    if not tick.force.any():
        return tick.ihip, tick.force
    normal = tick.force / np.linalg.norm(tick.force)
    beside = 1e-4 * np.array([-normal[1], normal[0]])
    normals = tick.scene.model.boundary.closest_point(np.array([tick.ihip + beside, tick.ihip - beside])).normal
    return tick.ihip, (0.5 if abs(normals[0] @ normals[1]) < 0.9 else 1.0) * tick.force


def dragged(tick: Tick) -> Answer:
    """2 N s/m against the motion along the surface."""
    if not tick.force.any():
        return tick.ihip, tick.force
    normal = tick.force / np.linalg.norm(tick.force)
    return tick.ihip, tick.force - 2.0 * (tick.velocity - (tick.velocity @ normal) * normal)


def remembers(tick: Tick) -> Answer:
    """The contact point is dragged 3 mm behind where it came from."""
    speed = float(np.linalg.norm(tick.velocity))
    if not tick.inside or speed == 0.0:
        return tick.ihip, tick.force
    behind = tick.ihip - 3e-3 * tick.velocity / speed
    return tick.scene.model.boundary.closest_point(behind[np.newaxis]).foot[0], tick.force


def jumps_to_a_third_face(tick: Tick) -> Answer:
    """Across the medial axis of a star's tip the contact point goes on to a third face."""
    if not tick.inside or tick.ihip[0] >= 0.0:
        return tick.ihip, tick.force
    away = tick.scene.model.boundary.closest_point(np.array([[tick.ihip[0], -tick.ihip[1] - 0.1]])).foot[0]
    return away, tick.scene.stiffness * (away - tick.hip)


def pops_beside(tick: Tick) -> Answer:
    """Beside the medial axis the contact point is rounded to 2 mm: pops that are shorter than the honest one."""
    ihip = tick.ihip
    if tick.inside and tick.hip[0] > 2e-3:
        ihip = tick.scene.model.boundary.closest_point(2e-3 * np.round(ihip[np.newaxis] / 2e-3)).foot[0]
    return ihip, tick.scene.stiffness * (ihip - tick.hip)


def wanders(tick: Tick) -> Answer:
    """The tool's place on the surface wanders by a micrometre a second; the force, which moves the hand, does not."""
    return tick.ihip + 1e-6 * tick.time * tick.inside * np.eye(tick.hip.size)[0], tick.force


def trembles(tick: Tick) -> Answer:
    """In contact the force swings along x, by half a newton and ten times a second."""
    return tick.ihip, tick.force + 0.5 * np.sin(20.0 * np.pi * tick.time) * tick.inside * np.eye(tick.hip.size)[0]


class Lost(Spoiled):
    """1 kN on a hand that is not a number."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        if not np.isfinite(hip).all():
            return Response(np.zeros_like(hip), np.full_like(hip, 1e3))
        return super().step(hip, velocity, dt)


def lost(scene: Scene) -> Lost:
    return Lost(scene, resolve("minimum-distance")(scene), lambda tick: (tick.ihip, tick.force))


class Claiming(Nearest):
    """The nearest point, which pops, and claims a standoff of 0.5 mm that it does not have."""

    standoff = 5e-4


class Raised(Nearest):
    """The nearest point 0.5 mm in front of the surface, as declared: it pops from face to face inside of the solid."""

    standoff = 5e-4

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        near = self.boundary.closest_point(hip[np.newaxis])
        raised = near.foot[0] + self.standoff * near.normal[0]
        ihip = raised if near.distance[0] < self.standoff else hip
        return Response(ihip, self.stiffness * (ihip - hip))


def endowed(scene: Scene) -> Any:
    """A passivity controller that begins with a joule which no hand has put in."""
    renderer: Any = resolve("conformal+pc")(scene)
    controlled = renderer.renderer
    reset = controlled.reset

    def reset_with_gift(hip: np.ndarray) -> None:
        reset(hip)
        controlled.energy = 1.0

    controlled.reset = reset_with_gift
    return renderer


@dataclass(frozen=True)
class Overlooked:
    """A wrong renderer: its factory, the places ("suite/case") where it is stopped, by which check, in what words."""

    make: Callable[[Scene], Any]
    places: tuple[str, ...]
    check: str
    words: str


PRESSES = ("field/press-and-leave",)
VARIES: Mapping[str, Any] = {"stiffness_range": (0.55, 1.8), "memoryless": True}
WIDE: Mapping[str, Any] = {"stiffness_range": (1 / 32, 32.0), "memoryless": True}
FREE = "N in free space: it is"

OVERLOOKED: Mapping[str, Overlooked] = {
    "pushes-outside": Overlooked(spoiled(pushes_outside), PRESSES, "contact-kept", FREE),
    "pulls-from-outside": Overlooked(spoiled(pulls_from_outside), PRESSES, "contact-kept", FREE),
    "draws-in-from-outside": Overlooked(spoiled(pulls_from_outside), PRESSES, "never-pulls", "draws the hand in by"),
    "pushes-from-afar": Overlooked(spoiled(pushes_from_afar), PRESSES, "contact-kept", FREE),
    "touches-outside": Overlooked(
        spoiled(touches_outside), PRESSES, "contact-kept", FREE + ".* outside of .*, with the tool 2 mm away from it"
    ),
    "one-way": Overlooked(
        promising(one_way(0.57, 1.75), **VARIES),
        (*PRESSES, "solids/nut-rim", "solids/pebble"),
        "force-magnitude",
        "one HIP has two forces",
    ),
    "one-way-wide": Overlooked(
        promising(one_way(1 / 31, 31.0), **WIDE), PRESSES, "force-magnitude", "one HIP has two forces"
    ),
    "one-way-gives-energy": Overlooked(
        promising(one_way(0.57, 1.75), **VARIES),
        ("solids/nut-rim", "solids/pebble", "dynamics-unilateral/cube-pressed-robot"),
        "passivity",
        "creates energy",
    ),
    "by-turns": Overlooked(promising(by_turns, **VARIES), PRESSES, "force-magnitude", "one HIP has two forces"),
    "wears-off": Overlooked(promising(wears_off, **VARIES), ("solids/pebble",), "force-magnitude", "one HIP has two"),
    **{
        f"{name}-{declared:g}-N": Overlooked(
            promising(fault, spring=Spring.ERROR, force_resolution=declared),
            ("unilateral-surfaces/torus-slide", "solids/cube-edge"),
            "contact-normal-force",
            " N .*off every true normal",
        )
        for name, fault in {"drags": drags, "buzzes": buzzes}.items()
        for declared in (0.2, 1e3)
    },
    "reversed-far-away": Overlooked(
        spoiled(reversed_far_away),
        tuple(f"hard-cases-places/slide-{place}" for place in ("1e3-m-away", "1e6-m-away", "1e9-m-away", "star-1e3-m")),
        "contact-normal-force",
        "the force is reversed",
    ),
    "strong-on-large-models": Overlooked(
        spoiled(strong_on_large_models), ("hard-cases-places/slide-star-1e3-m",), "force-magnitude", "10 times"
    ),
    "of-one-rate": Overlooked(
        spoiled(of_one_rate),
        ("hard-cases-places/sampled-10-us", "hard-cases-places/sampled-10-ms"),
        "force-magnitude",
        "times",
    ),
    "weak-when-fast": Overlooked(
        spoiled(weak_when_fast), ("hard-cases-places/sampled-10-us",), "force-magnitude", "0.1 times"
    ),
    "turned-when-slow": Overlooked(
        spoiled(turned_when_slow), ("hard-cases-places/sampled-10-ms",), "contact-normal-force", "turned by 30 degrees"
    ),
    "trails-and-lets-go": Overlooked(
        spoiled(trails_and_lets_go), PRESSES, "contact-kept", r"gets 6 mm past the surface.*besides, the IHIP is"
    ),
    "lingers-past-corners": Overlooked(
        spoiled(lingers_past_corners), ("solids/cube-edge",), "broken-contact", "a force remains .*besides, n_pre is"
    ),
    "one-triangle": Overlooked(
        spoiled(one_triangle),
        ("solids/cube-all-round", "solids/l-block-all-round"),
        "contact-normal-force",
        "the force pulls",
    ),
    "both-late": Overlooked(
        spoiled(both_late, "constraint"), ("thesis/star-convex-corner",), "contact-kept", r"20 ms late \(20 ticks\)"
    ),
    "soft-in-notches": Overlooked(
        spoiled(soft_in_notches, "constraint"),
        ("thesis/star-concave-corner",),
        "force-magnitude",
        "0.5 times what is asked .*where two faces hold the tool",
    ),
    "dragged": Overlooked(
        spoiled(dragged), ("unilateral-surfaces/torus-slide",), "contact-normal-force", "drags .*by 2 N s/m"
    ),
    "millimetres": Overlooked(
        spoiled(lambda tick: (tick.ihip, 1e3 * tick.force)), ("solids/cube-edge",), "force-magnitude", "unit is wrong"
    ),
    "lost": Overlooked(lost, PRESSES, "drop-out", "gets 1.73e"),
}
"""Name: where and by what it is stopped."""
