"""Renderers that claim to show force shading, or what begins with a contact, and show it wrong: each with one fault.

Each is a spring to the nearest point with the package's own effect on it, whose answer the fault replaces. `BROKEN` and
`HONEST` are as in `outsiders`, and led along `CASES`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from felt import changed
from outsiders import Outsider, case

from hapticeval.discovery import resolve
from hapticeval.effects.shading import facets
from hapticeval.effects.shading_kernels import SHADED_FACET
from hapticeval.records import as_record, as_records
from hapticeval.renderer import Renderer, Response, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import with_effects

MIDDLE = 0.1 * math.cos(math.pi / 8)
"""Distance (m) of an octagon's facets from its centre."""

EDGE = 3e-3
"""Where a facet's ends begin (m): no loop comes so far."""


def _octagon() -> dict[str, Any]:
    angle = np.pi / 8 + np.arange(8) * np.pi / 4
    return {"kind": "polygon", "vertices": (0.1 * np.column_stack([np.cos(angle), np.sin(angle)])).tolist()}


def _loop(laps: int) -> list[list[float]]:
    """Points from free space round under the upper facet, in steps of a whole number of ticks at 0.1 m/s."""
    shallow, deep = MIDDLE - 0.5e-3, MIDDLE - 1.5e-3
    lap = [[-0.03, shallow], [-0.03, deep], [0.0, deep], [0.0, shallow]]
    return [[0.0, MIDDLE + 0.0095], [0.0, shallow], *lap * laps]


SHADING = ("shading-direction", "shading-magnitude", "shading-work")
STRUCK = ("transient-onset", "transient-impulse", "transient-vibration")
DOWN = [[0.0, 0.005], [0.0, -0.002]]

CASES = {
    each.name: each
    for each in (
        case(
            "facet-loop",
            _octagon(),
            SHADING[1:],
            scene={"effects": [{"kind": "shading"}]},
            trajectory={"kind": "points", "points": _loop(3), "duration": (0.01 + 3 * 0.062) / 0.1},
        ),
        case(
            "facet-slide",
            _octagon(),
            SHADING[:2],
            scene={"effects": [{"kind": "shading"}]},
            trajectory={"kind": "scaled", "depth": 0.001, "from_angle": 35, "to_angle": 100, "duration": 1.0},
        ),
        case(
            "tap",
            {"kind": "line"},
            STRUCK,
            scene={"effects": [{"kind": "contact-transient", "material": "aluminium"}]},
            trajectory={"kind": "points", "points": [*DOWN, [0.058, -0.002]], "duration": 0.325},
        ),
        case(
            "stop",
            {"kind": "line"},
            STRUCK[:2],
            scene={"effects": [{"kind": "contact-impulse", "cap": 10.0}]},
            trajectory={"kind": "points", "points": [*DOWN, [0.012, -0.002]], "duration": 0.095},
        ),
    )
}


@dataclass
class Tick:
    """What a fault sees: the scene, the hand, the tool, the time (s) in contact, the force without and with effects.

    `speed` (m/s) is that of the approach, and `normal` the surface's where the contact began. `memory` is kept.
    """

    scene: Scene
    dt: float = 1e-3
    hip: np.ndarray = field(default_factory=lambda: np.zeros(2))
    ihip: np.ndarray = field(default_factory=lambda: np.zeros(2))
    contact: int = -1
    speed: float = 0.0
    plain: np.ndarray = field(default_factory=lambda: np.zeros(2))
    shown: np.ndarray = field(default_factory=lambda: np.zeros(2))
    memory: dict[str, Any] = field(default_factory=dict)


Fault = Callable[[Tick], np.ndarray]


class Showing:
    """A spring to the nearest point that shows the scene's effects by itself, with a fault."""

    supports = frozenset({"shading", "contact-impulse", "contact-transient", "recorded-impulse"})

    def __init__(self, scene: Scene, fault: Fault) -> None:
        self.scene, self.fault = scene, fault
        self.bare: Renderer = resolve("minimum-distance")(scene)
        self.right: Any = with_effects(wrapped(resolve("minimum-distance")(scene)), scene)

    def reset(self, hip: np.ndarray) -> None:
        self.bare.reset(hip)
        self.right.reset(hip)
        self.tick = Tick(self.scene)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        tick = self.tick
        tick.hip, tick.dt = hip, dt
        tick.ihip, tick.plain = self.bare.step(hip, velocity, dt)
        tick.shown = np.array(self.right.step(hip, velocity, dt).force)
        if not self.scene.effects:
            return Response(tick.ihip, tick.plain)
        touches = bool(np.any(tick.ihip != hip))
        tick.contact = tick.contact + 1 if touches else -1
        if tick.contact == 0:
            tick.speed = -float(velocity[1])
            tick.memory = {}
        return Response(tick.ihip, self.fault(tick))


def on_facet(tick: Tick) -> tuple[Any, float]:
    """The facet under the tool, a `SHADED_FACET`, and how far along it the tool is, m."""
    curve = tick.scene.model.curve
    table = facets(curve, 60.0)
    assert table is not None
    along = float(curve.arc_length(curve.nearest(tick.ihip[np.newaxis]))[0])
    facet = as_record(
        table, SHADED_FACET, np.searchsorted(as_records(table, SHADED_FACET).start, along, side="right") - 1
    )
    return facet, along - float(facet.start)


def at_ends(otherwise: Fault) -> Fault:
    """At the ends of the facets what `otherwise` gives, and elsewhere what is right."""

    def fault(tick: Tick) -> np.ndarray:
        facet, since = on_facet(tick)
        return otherwise(tick) if min(since, facet.length - since) < EDGE else tick.shown

    return fault


def mixed(tick: Tick, share: Callable[[float], float]) -> np.ndarray:
    facet, since = on_facet(tick)
    weight = share(since / facet.length)
    first, last = np.array([facet.first_x, facet.first_y]), np.array([facet.last_x, facet.last_y])
    return np.asarray((1.0 - weight) * first + weight * last)


def softens(tick: Tick) -> np.ndarray:
    """(4.15) as it is printed: the mean of unit normals is shorter than one."""
    return np.asarray(float(np.linalg.norm(tick.plain)) * mixed(tick, lambda share: share))


def eases(tick: Tick) -> np.ndarray:
    """The share along a facet is eased in and out, as in drawing: unit normals, and without a jump."""
    normal = mixed(tick, lambda share: share * share * (3.0 - 2.0 * share))
    return np.asarray(float(np.linalg.norm(tick.plain)) * normal / np.linalg.norm(normal))


def rings(tick: Tick, wave: Callable[[float, float, float, float], float]) -> np.ndarray:
    """A wave (time, dt, decay, omega) of its own in place of the sinusoid's mean over the tick."""
    effect: Any = tick.scene.effects[0]
    if tick.contact < 0:
        return tick.plain
    omega = 2.0 * math.pi * effect.frequency
    size = effect.amplitude * tick.speed * wave(tick.contact * tick.dt, tick.dt, effect.decay, omega)
    return tick.plain + np.array([0.0, size])


def sampled(time: float, dt: float, decay: float, omega: float) -> float:
    """The sinusoid at the tick, not its mean."""
    return math.exp(-decay * time) * math.sin(omega * time)


def detuned(time: float, dt: float, decay: float, omega: float) -> float:
    """A tenth too high, and as much impulse."""
    from hapticeval.effects.transient_kernels import ringing_integral

    high = 1.1 * omega
    share = omega / (decay**2 + omega**2) * (decay**2 + high**2) / high
    return share * (ringing_integral(decay, high, time + dt) - ringing_integral(decay, high, time)) / dt


def late(tick: Tick) -> np.ndarray:
    """What it adds comes three ticks later."""
    held = tick.memory.setdefault("held", [])
    held.append(tick.shown - tick.plain)
    return tick.plain + (held[-4] if tick.contact >= 3 else 0.0)


def repeats(tick: Tick) -> np.ndarray:
    """The blow comes once more ten ticks later."""
    held = tick.memory.setdefault("held", [])
    held.append(tick.shown - tick.plain)
    return tick.shown + (held[-11] if tick.contact >= 10 else 0.0)


def uncapped(tick: Tick) -> np.ndarray:
    """All of the impulse comes in one tick, whatever the cap."""
    blow = tick.scene.mass * tick.speed / tick.dt if tick.contact == 0 else 0.0
    return tick.plain + np.array([0.0, blow])


def broken(fault: Fault, *cases: str, **fails: str) -> Outsider:
    return Outsider(
        lambda scene: Showing(scene, fault), {name.replace("_", "-"): why for name, why in fails.items()}, cases
    )


ROUND = "facet-loop", "facet-slide"

BROKEN: Mapping[str, Outsider] = {
    "flat-ends": broken(at_ends(lambda tick: tick.plain), *ROUND, shading_direction="no shading next to the edges"),
    "weak-ends": broken(at_ends(lambda tick: 0.98 * tick.shown), *ROUND, shading_magnitude="softer next to the edges"),
    "eases": broken(eases, *ROUND, shading_work="normals turn faster in the middle of a facet"),
    "softens": broken(
        softens,
        *ROUND,
        shading_magnitude="normals are not of unit length",
        shading_work="and less of it gives less",
    ),
    "late-ringing": broken(late, "tap", transient_onset="three ticks late"),
    "samples": broken(lambda tick: rings(tick, sampled), "tap", transient_impulse="samples lose 3.4 % of 100 Hz"),
    "detuned": broken(lambda tick: rings(tick, detuned), "tap", transient_vibration="a tenth too high"),
    "strikes-twice": broken(repeats, "stop", transient_impulse="twice the impulse"),
    "uncapped": broken(uncapped, "stop", transient_impulse="20 N for a cap of 10 N"),
}
"""What each fault fails, and why."""


def right(tick: Tick) -> np.ndarray:
    return tick.shown


def interpolates(tick: Tick) -> np.ndarray:
    """(4.15) with a normal of unit length, by its own formula."""
    normal = mixed(tick, lambda share: share)
    return np.asarray(float(np.linalg.norm(tick.plain)) * normal / np.linalg.norm(normal))


HONEST: Mapping[str, Outsider] = {
    "shaded": Outsider(resolve("minimum-distance"), cases=ROUND),
    "struck": Outsider(resolve("minimum-distance"), cases=("tap", "stop")),
    **{
        f"interpolates{name}": Outsider(make, cases=ROUND)
        for name, make in changed(lambda scene: Showing(scene, interpolates)).items()
    },
    **{
        f"strikes{name}": Outsider(make, cases=("tap", "stop"))
        for name, make in changed(lambda scene: Showing(scene, right)).items()
    },
}
"""The right ones: a spring with the effect put on it, one with shading of its own, and either as real ones differ."""
