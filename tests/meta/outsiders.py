"""Renderers as outsiders write them, plain classes with `reset` and `step`: each with one fault, or honest and odd.

All are a spring between the hand and the nearest point of the surface. `BROKEN` says of each fault which checks stop it
and why; `HONEST` are those that no check may blame.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.suite.case import Case


class Spring:
    """The nearest point of the surface while the hand is inside, and a spring to it."""

    def __init__(self, scene: Scene) -> None:
        self.boundary = scene.model.boundary
        self.stiffness = scene.stiffness

    def reset(self, hip: np.ndarray) -> None:
        self.ticks, self.time = 0, 0.0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.ticks, self.time = self.ticks + 1, self.time + dt
        return self.contact(hip, velocity, dt)

    def contact(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip = self.nearest(hip) if self.inside(hip) else hip
        return Response(ihip, self.stiffness * (ihip - hip))

    def inside(self, hip: np.ndarray) -> bool:
        return float(self.boundary.signed_distance(hip[None])[0]) < 0.0

    def nearest(self, hip: np.ndarray) -> np.ndarray:
        return self.boundary.frame(hip[None]).foot[0]

    def pressed(self, hip: np.ndarray, ihip: np.ndarray) -> Response:
        """The spring's force along the normal at an IHIP that may lie anywhere on the surface."""
        return Response(ihip, self.stiffness * float(np.linalg.norm(hip - self.nearest(hip))) * self.normal(ihip))

    def normal(self, hip: np.ndarray) -> np.ndarray:
        return self.boundary.frame(hip[None]).normal[0]


class LetsGo(Spring):
    """Calls the hand free after 0.3 s."""

    def inside(self, hip):
        return self.time < 0.3 and super().inside(hip)


class FallsThrough(Spring):
    """Loses the surface at one place, as a proxy does at the edge of two triangles, until the hand enters anew."""

    def reset(self, hip):
        super().reset(hip)
        self.fallen = False

    def inside(self, hip):
        inside = super().inside(hip)
        self.fallen = inside and (self.fallen or 0.03 < hip[1] < 0.031)
        return inside and not self.fallen


class FinePop(Spring):
    """Pops through 10 mm at the base rate; at finer rates it falls through at the same place instead."""

    def contact(self, hip, velocity, dt):
        ihip, force = super().contact(hip, velocity, dt)
        if force.any() and hip[1] > 0.03:
            if dt < 0.9e-3:
                return Response(hip, 0.0 * hip)
            return self.pressed(hip, self.nearest(_turned(hip, 0.1)))
        return Response(ihip, force)


class RatePop(Spring):
    """The IHIP jumps 10 mm to and fro every 200 ticks at 1 kHz, and at no other rate."""

    def contact(self, hip, velocity, dt):
        ihip, force = super().contact(hip, velocity, dt)
        if dt > 0.9e-3 and force.any() and self.ticks // 200 % 2:
            return self.pressed(hip, self.nearest(_turned(hip, 0.1)))
        return Response(ihip, force)


class Trails(Spring):
    """In free space the IHIP follows the hand with a time constant of 0.2 s."""

    def reset(self, hip):
        super().reset(hip)
        self.ihip = hip

    def contact(self, hip, velocity, dt):
        ihip, force = super().contact(hip, velocity, dt)
        self.ihip = ihip if force.any() else self.ihip + (hip - self.ihip) * dt / 0.2
        return Response(self.ihip, force)


class Strays(Spring):
    """The IHIP lies 1 mm under the surface, and jumps 10 mm along it halfway."""

    def contact(self, hip, velocity, dt):
        ihip, force = super().contact(hip, velocity, dt)
        if not force.any():
            return Response(ihip, force)
        ihip, force = self.pressed(hip, self.nearest(_turned(hip, 0.1)) if hip[1] > 0.03 else ihip)
        return Response(ihip - 0.001 * self.normal(ihip), force)


class Scaled(Spring):
    """The force is another than the spring's by a factor that may depend on anything."""

    def __init__(self, scene: Scene, factor: Callable[[Scaled, np.ndarray, np.ndarray], float]) -> None:
        super().__init__(scene)
        self.factor = factor
        self.resets = 0

    def reset(self, hip):
        super().reset(hip)
        self.resets += 1

    def contact(self, hip, velocity, dt):
        ihip, force = super().contact(hip, velocity, dt)
        return Response(ihip, self.factor(self, force, velocity) * force)


def scaled(factor: Callable[[Scaled, np.ndarray, np.ndarray], float]) -> Callable[[Scene], Scaled]:
    return lambda scene: Scaled(scene, factor)


def one_newton(renderer: Scaled, force: np.ndarray, velocity: np.ndarray) -> float:
    return 1.0 / float(np.linalg.norm(force)) if force.any() else 1.0


class RunsApart(Spring):
    """The batch answer lies 0.1 mm off the single steps'."""

    def run(self, hips, dt):
        self.reset(hips[0])
        answers = [self.step(hip, 0.0 * hip, dt) for hip in hips]
        ihips, forces = (np.array(part) for part in zip(*answers, strict=True))
        touching = forces.any(axis=1)
        ihips[touching] += 1e-4 * self.boundary.frame(ihips[touching]).normal
        return ihips, forces


class Late(Spring):
    """Answers what it would have answered some ticks ago."""

    def __init__(self, scene: Scene, ticks: int) -> None:
        super().__init__(scene)
        self.lag = ticks

    def reset(self, hip):
        super().reset(hip)
        self.answers = deque([Response(hip, 0.0 * hip)], maxlen=self.lag + 1)

    def contact(self, hip, velocity, dt):
        self.answers.append(super().contact(hip, velocity, dt))
        return self.answers[0]


class Single(Spring):
    """Works in single precision, as a renderer on a graphics card does."""

    def contact(self, hip, velocity, dt):
        ihip, force = super().contact(hip, velocity, dt)
        return Response(ihip.astype(np.float32), force.astype(np.float32))


class Lists(Spring):
    """Answers lists."""

    def contact(self, hip, velocity, dt):
        ihip, force = super().contact(hip, velocity, dt)
        return ihip.tolist(), force.tolist()


class StandsOff(Spring):
    """The surface with a skin of 0.1 mm, as it declares."""

    standoff = 1e-4

    def inside(self, hip):
        return float(self.boundary.signed_distance(hip[None])[0]) < self.standoff

    def nearest(self, hip):
        return super().nearest(hip) + self.standoff * self.normal(hip)


class ForceOnly(Spring):
    """Knows no contact point: the IHIP is the hand's place throughout."""

    def contact(self, hip, velocity, dt):
        return Response(hip, super().contact(hip, velocity, dt).force)


def _turned(hip: np.ndarray, angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ hip


def case(name: str, model: Mapping[str, Any], checks: tuple[str, ...], **stimulus: Any) -> Case:
    return Case(
        name=name,
        title=name,
        shows="",
        citation="",
        model=model,
        depth_of="model",
        scene=stimulus.pop("scene", {}),
        trajectory=stimulus.get("trajectory"),
        experiment=stimulus.get("experiment"),
        checks=checks,
        judged=True,
        published={},
        closed_form={},
        folder=Path(),
    )


def _round(start: float, stop: float, depth: float) -> list[list[float]]:
    """Points from free space on to a circle of 0.1 m, round it `depth` deep, and off it."""
    angles = np.linspace(start, stop, 200)
    radii = np.full(angles.size, 0.1 - depth)
    angles = np.concatenate([angles[:1], angles, angles[-1:]])
    radii = np.concatenate([[0.105], radii, [0.105]])
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]).tolist()


LED = ("continuous-contact", "contact-normal-force", "memoryless")

CASES = {
    each.name: each
    for each in (
        case(
            "slide",
            {"kind": "circle"},
            LED,
            trajectory={"kind": "points", "points": _round(0.0, 1.0, 0.002), "duration": 0.8},
        ),
        case(
            "press",
            {"kind": "line"},
            ("contact-normal-force", "continuous-contact"),
            scene={"mass": 1.0},
            experiment={"duration": 1.0, "position": [0.0, 0.0], "force": [[0.0, 0.0, 0.0], [0.5, 0.0, -2.0]]},
        ),
        case(
            "plate",
            {"kind": "polygon", "vertices": [[-0.1, -0.0005], [0.1, -0.0005], [0.1, 0.0005], [-0.1, 0.0005]]},
            ("continuous-contact",),
            trajectory={"kind": "points", "points": [[0.0, 0.02], [0.001, -0.02]], "duration": 0.04},
        ),
    )
}
"""What the outsiders are led along: each begins in free space, and is the shortest that shows the faults."""


@dataclass(frozen=True)
class Outsider:
    """A renderer, the cases that it is judged in, and the checks that it fails, each with the cause."""

    make: Callable[[Scene], Any]
    fails: Mapping[str, str] = field(default_factory=dict)
    cases: tuple[str, ...] = ("slide",)


BROKEN: Mapping[str, Outsider] = {
    "lets go": Outsider(LetsGo, {"contact-kept": "the hand is inside, and free"}),
    "falls through": Outsider(FallsThrough, {"contact-kept": "the hand is inside, and free"}),
    "tunnels": Outsider(Spring, {"contact-kept": "the hand passes a plate of 1 mm in a tick"}, ("plate",)),
    "fine pop": Outsider(FinePop, {"continuous-contact": "a jump that finer runs lose with the contact"}),
    "rate pop": Outsider(RatePop, {"continuous-contact": "a jump that depends on the sampling rate"}),
    "trails": Outsider(Trails, {"continuous-contact": "an IHIP off the HIP in free space"}),
    "strays": Outsider(Strays, {"continuous-contact": "a jump of 10 mm, off the surface"}),
    "third": Outsider(scaled(lambda *_: 1 / 3), {"force-magnitude": "a third of the stiffness"}),
    "half": Outsider(scaled(lambda *_: 1 / 2), {"force-magnitude": "half of the stiffness"}),
    "stiffer": Outsider(scaled(lambda *_: 1.05), {"force-magnitude": "5 % more than the stiffness"}),
    "one newton": Outsider(scaled(one_newton), {"force-magnitude": "1 N at any depth"}),
    "spikes": Outsider(
        scaled(lambda self, *_: 1.0 if self.ticks % 50 else 10.0), {"force-magnitude": "ten times the force"}
    ),
    "gives back": Outsider(
        scaled(lambda self, force, velocity: 1.1 if force @ velocity > 0.0 else 1.0),
        {"passivity": "a tenth more force on the way out", "force-magnitude": "which the spring does not have"},
    ),
    "softens": Outsider(scaled(lambda self, *_: 0.97**self.resets), {"reset-clears": "3 % less after every reset"}),
    "drifts": Outsider(scaled(lambda self, *_: 1.0 + 0.1 * self.time), {"force-magnitude": "10 % more a second"}),
    "runs apart": Outsider(RunsApart, {"run": "run() and step() are 0.1 mm apart"}),
}

HONEST: Mapping[str, Outsider] = {
    "spring": Outsider(Spring, cases=("slide", "press")),
    **{
        f"{ticks} late": Outsider(lambda scene, ticks=ticks: Late(scene, ticks), cases=("slide", "press"))
        for ticks in (1, 2, 3)
    },
    "single": Outsider(Single, cases=("slide", "press")),
    "lists": Outsider(Lists, cases=("slide", "press")),
    "stands off": Outsider(StandsOff, cases=("slide", "press")),
    "force only": Outsider(ForceOnly, cases=("slide", "press")),
}
