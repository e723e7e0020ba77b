"""Renderers that answer step by step, as those of other people do: each with one fault, or honest and odd.

All are a spring between the hand and the nearest point of the surface. `BROKEN` says of each fault which checks stop it
and why; `HONEST` are those that no check may blame. They are led along `CASES`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import honest
import jumping
import numpy as np
from broken import RELATIONS, spoiled
from honest import Spring

from hapticeval.discovery import resolve
from hapticeval.documents import convert
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.suite.case import Case


def case(name: str, model: Mapping[str, Any], checks: tuple[str, ...], **stimulus: Any) -> Case:
    return convert({"name": name, "title": name, "model": model, "checks": checks, **stimulus}, Case, name)


def _round(start: float, stop: float, depth: float) -> list[list[float]]:
    """Points from free space on to a circle of 0.1 m, round it `depth` deep, and off it."""
    angles = np.linspace(start, stop, 200)
    radii = np.full(angles.size, 0.1 - depth)
    angles = np.concatenate([angles[:1], angles, angles[-1:]])
    radii = np.concatenate([[0.105], radii, [0.105]])
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]).tolist()


LED = (
    "contact-kept",
    "continuous-contact",
    "contact-normal-force",
    "memoryless",
    "force-magnitude",
    "passivity",
    "reset-clears",
)

CASES = {
    each.name: each
    for each in (
        case(
            "slide",
            {"kind": "circle"},
            LED,
            trajectory={"kind": "points", "points": _round(0.0, 0.55, 0.002), "duration": 0.45},
        ),
        case(
            "press",
            {"kind": "line"},
            ("contact-kept", "continuous-contact", "contact-normal-force", "force-magnitude", "reset-clears"),
            scene={"mass": 1.0},
            experiment={"duration": 1.0, "position": [0.0, 0.0], "force": [[0.0, 0.0, 0.0], [0.5, 0.0, -2.0]]},
        ),
        case(
            "plate",
            {"kind": "polygon", "vertices": [[-0.1, -0.0005], [0.1, -0.0005], [0.1, 0.0005], [-0.1, 0.0005]]},
            ("contact-kept",),
            trajectory={"kind": "points", "points": [[0.0, 0.021], [0.001, -0.019]], "duration": 0.02},
        ),
        case(
            "rest",
            {"kind": "circle"},
            ("comes-to-rest", "contact-kept"),
            experiment={
                "duration": 2.0,
                "position": [0.0, 0.11],
                "hand": {"stiffness": 50, "damping": 1, "path": {"points": [[0, 0.08], [0, 0.08]], "duration": 1}},
            },
        ),
        case(
            "laps",
            {"kind": "circle"},
            ("drift",),
            trajectory={
                "kind": "loop",
                "start": [0.11, 0.0],
                "centre": [0.08, 0.0],
                "radius": 0.01,
                "laps": 4,
                "lap": 0.1,
                "approach": 0.1,
            },
        ),
        case(
            "moved",
            {"kind": "star"},
            ("numerical-stability",),
            trajectory={"kind": "hard-places", "of": ["vertices", "medial", "teleports"]},
        ),
        case(
            "restated",
            {"kind": "star"},
            ("mirror-image", "vertex-order", "time-subdivision", "two-at-once"),
            trajectory={"kind": "generated", "seed": 3, "examples": 2, "parts": ["slide"], "most": 1},
        ),
        case(
            "pushed",
            {"kind": "line"},
            ("constraint-distance",),
            scene={"stiffness": 50.0, "damping": 4.47, "mass": 0.1, "bilateral": True},
            experiment={
                "duration": 2.0,
                "position": [0.0, 0.0],
                "force": [
                    [0.0, 0.0, 0.0],
                    [0.1, 0.0, 1.0],
                    [0.2, 0.0, 0.0],
                    [0.9, 0.0, 0.0],
                    [1.0, 0.5, 0.0],
                    [1.1, 0, 0],
                ],
            },
        ),
    )
}
"""What the outsiders are led along: each begins in free space, and is the shortest that shows the faults."""


@dataclass(frozen=True)
class Outsider:
    """A renderer that these tests judge, right or broken.

    - `make`: its factory.
    - `fails`: the checks that it fails in one of its cases, each with the cause; none of one that is right. A new
      check of these cases has its line here too, where it stops the renderer rightly.
    - `cases`: the names of those that it is judged in, of the `CASES` of its module.
    - `breaks`: why one that breaks the contract is not judged. Every verdict is an error then, whose message has this.
    - `reported`: where its fault was, by users of a renderer or an engine.
    """

    make: Callable[[Scene], Any]
    fails: Mapping[str, str] = field(default_factory=dict)
    cases: tuple[str, ...] = ("slide",)
    breaks: str = ""
    reported: str = ""


class ThriceAsStiff(Spring):
    """The same with thrice the scene's stiffness."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.stiffness *= 3.0


class Wandering(Spring):
    """The same, with an IHIP that is off by a nanometre more with each tick."""

    def reset(self, hip: np.ndarray) -> None:
        self.ticks = 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.ticks += 1
        ihip, force = super().step(hip, velocity, dt)
        return Response(ihip + 1e-9 * self.ticks if force.any() else ihip, force)


MEMORY = "the IHIP depends on more than the HIP"
ASIDE = {"contact-normal-force": "the spring pulls to an IHIP 10 mm aside", "memoryless": MEMORY}

FAILS: Mapping[str, Mapping[str, str]] = {
    "drops": {"contact-kept": "free after 0.3 s", "memoryless": MEMORY},
    "falls-through": {"contact-kept": "free beyond one place", "memoryless": MEMORY},
    "trails": {"contact-kept": "off the hand in free space"},
    "strays": {
        "continuous-contact": "a jump of 10 mm, 1 mm under the surface",
        "force-magnitude": "a force of the depth, and an IHIP elsewhere",
        "passivity": "the force's direction jumps with the IHIP",
    },
    "third": {"force-magnitude": "a third of the stiffness"},
    "half": {"force-magnitude": "half of the stiffness"},
    "stiffer": {"force-magnitude": "5 % stiffer"},
    "one-newton": {"force-magnitude": "1 N at any depth"},
    "spikes": {"force-magnitude": "ten times the force in every 50th tick"},
    "kicks": {"passivity": "10 % more on the way out", "force-magnitude": "than the spring has"},
    "drifts": {"force-magnitude": "5 % more a second", "passivity": "more when it is let out"},
    "wears": {"reset-clears": "3 % softer after every reset"},
    "swirls": {
        "passivity": "a force across that drives the hand round",
        "contact-normal-force": "11 degrees aside",
    },
}
"""Faults of `broken.FAULTS`: the checks that stop each, and why."""

OF_A_SPRING = ("drops", "falls-through", "trails", "strays")
"""Those judged round `Spring`, which declares nothing; the others are round `minimum-distance`."""

BROKEN: Mapping[str, Outsider] = {
    **{
        name: Outsider(spoiled(name, Spring if name in OF_A_SPRING else "minimum-distance"), fails)
        for name, fails in FAILS.items()
    },
    **{
        name: Outsider(spoiled(name, Spring), {check: (fault.__doc__ or "a hundredth more").strip()}, ("restated",))
        for name, (check, fault) in RELATIONS.items()
    },
    "tunnels": Outsider(Spring, {"contact-kept": "a hand that passes a plate of 1 mm in a tick is free"}, ("plate",)),
    "fine-pop": Outsider(
        jumping.factory("fine-pop"),
        {
            "continuous-contact": "finer runs lose the jump with the contact",
            "passivity": "the spring pulls along, at one rate",
            **ASIDE,
        },
    ),
    "rate-pop": Outsider(
        jumping.factory("rate-pop"),
        {
            "continuous-contact": "a jump at one sampling rate",
            "passivity": "the spring pulls along, at that rate",
            **ASIDE,
        },
    ),
    "seven-digits": Outsider(
        honest.SevenDigits, {"numerical-stability": "seven digits, and none declared"}, ("moved",)
    ),
    "snaps": Outsider(honest.Snapping, {"numerical-stability": "a grid of 1 um that nobody declared"}, ("moved",)),
    "thrice-as-stiff": Outsider(
        ThriceAsStiff, {"comes-to-rest": "3,000 N/m, and a hand whose damping allows 2,000"}, ("rest",)
    ),
    "wanders": Outsider(Wandering, {"drift": "the IHIP wanders by a nanometre a tick"}, ("laps",)),
    "law-apart": Outsider(jumping.LawApart, breaks="law and step() differ"),
    "tires": Outsider(
        jumping.LetsGo,
        {"contact-kept": "after 64 ticks its step lets go of a hand inside", "memoryless": MEMORY},
    ),
    "swinging": Outsider(
        resolve("minimum-distance+pp"),
        {"constraint-distance": "nothing damps what a push across has begun"},
        ("pushed",),
    ),
}
"""Every broken renderer that is written from the protocol: what stops it, and why."""

IN_A_LOOP = ("late-3", "standoff")
"""The changes that alter the motion of a loop."""

HONEST: Mapping[str, Outsider] = {
    "spring": Outsider(Spring, cases=("slide", "press", "rest", "laps", "moved", "restated")),
    "held": Outsider(resolve("constraint"), cases=("plate",)),
    "damped-spring": Outsider(resolve("minimum-distance+pp-d"), cases=("pushed",)),
    **{
        name: Outsider(honest.factory(name, Spring), cases=("slide", "press") if name in IN_A_LOOP else ("slide",))
        for name in sorted(honest.HONEST)
    },
}
"""A right renderer in the ways in which real ones differ: no check may blame it."""
