"""Renderers that show effects by code of their own: right ones as real ones differ, and ones with a fault each.

`HONEST` no check of the effect may blame, and `BROKEN` says what stops the others, in the cases of the suites `CASES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import rubbing
from honest import Spring, factory
from latecomers import late
from msgspec import structs
from outsiders import Outsider

from hapticeval.effects.friction import Friction
from hapticeval.effects.lugre import LuGre
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.renderer import Response, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import Affected
from hapticeval.stimulus.paths import Loop, Points
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

RELIEFS = ("height-map-line", "height-map-circle", "height-map-sphere", "bump-map-line", "height-map-drawn")


POINTS = {"height-map-sphere": 6, "lugre-plane": 5}
"""Points of a path that show a fault, of many laps: those of the first."""


def _asked(suite: str, names: tuple[str, ...], checks: tuple[str, ...]) -> dict[str, Case]:
    """Return cases of a suite with these checks of theirs; loops and laps as far as they show a fault."""
    cases = {}
    for name in names:
        case = load_suite(suite).case(name)
        if isinstance(case.trajectory, Loop):
            case = structs.replace(case, trajectory=structs.replace(case.trajectory, laps=1, lap=0.5, radius=0.0005))
        elif isinstance(case.trajectory, Points) and name in POINTS:
            case = structs.replace(case, trajectory=_begin(case.trajectory, POINTS[name]))
        cases[name] = structs.replace(case, checks=tuple(check for check in case.checks if check in checks))
    return cases


def _begin(path: Points, count: int) -> Points:
    """Return the first `count` points of a path, at the same speed."""
    lengths = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    share = float(lengths[: count - 1].sum() / lengths.sum())
    return structs.replace(path, points=path.points[:count], duration=share * path.duration)


DRY = ("plane-to-and-fro", "plane-literal", "plane-drawn-robot", "circle-to-and-fro", "sphere-slide")
LOOSE = tuple(name for name in DRY if name != "circle-to-and-fro")
"""Those in which a tool breaks loose with mu_k F_n too."""

BRAKED = ("viscous-plane", "lugre-plane", "lugre-textbook")
RUBBED = ("friction-cone", "friction-break-away", "friction-sliding", "friction-energy", "friction-force")

TOGETHER = ("friction-on-bumps", "grit-on-friction")

CASES = {
    **_asked("effects-texture", RELIEFS, ("texture-relief",)),
    **_asked("effects-friction", (*DRY, *BRAKED), RUBBED),
    **_asked("effects-texture", ("ribbed-rest",), ("texture-rest",)),
    **_asked("effects-together", TOGETHER, ("effects-order",)),
}


class Carved:
    """A relief by its formulas, round a spring to the nearest point of a line, a circle or a sphere.

    The sine is `high` times as high as the scene's and `long` times as long.
    """

    supports = frozenset({"height-map", "bump-map"})

    def __init__(self, scene: Scene, *, high: float = 1.0, long: float = 1.0) -> None:
        self.scene, self.boundary = scene, scene.model.boundary
        self.relief: Any = scene.effects[0] if scene.effects else None
        if self.relief is not None:
            self.high = high * self.relief.amplitude
            self.wave = long * self.relief.wavelength
            if scene.model.name == "circle":
                girth = np.pi * scene.model.size
                self.wave = girth / round(girth / self.wave)

    def reset(self, hip: np.ndarray) -> None:
        pass

    def phase(self, foot: np.ndarray, normal: np.ndarray) -> tuple[float, np.ndarray]:
        """Return how far along the waves a foot is, m, and the way along which they run there."""
        if foot.size == 3:
            unit = np.array(self.relief.direction) / np.linalg.norm(self.relief.direction)
            return float(foot @ unit), unit - (unit @ normal) * normal
        along = np.array([-normal[1], normal[0]])
        if self.scene.model.name == "line":
            return -float(foot[0]), along
        return float(np.arctan2(foot[1], foot[0]) % (2.0 * np.pi)) * 0.5 * self.scene.model.size, along

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        frame = self.boundary.closest_point(np.asarray(hip, dtype=float)[np.newaxis])
        foot, normal, depth = frame.foot[0], frame.normal[0], -float(frame.distance[0])
        stiffness, height, slope = self.scene.stiffness, 0.0, np.zeros_like(foot)
        if self.relief is not None:
            at, along = self.phase(foot, normal)
            turn = 2.0 * np.pi / self.wave
            height = self.high * np.sin(turn * at)
            slope = self.high * turn * np.cos(turn * at) * along
            if self.relief.kind == "bump-map":
                tilted = (normal - slope) / np.linalg.norm(normal - slope)
                return Response(foot, stiffness * depth * tilted) if depth > 0.0 else Response(hip, 0.0 * normal)
            # Round surfaces shrink towards their middle.
            slope = slope / (1.0 - depth * (2.0 / self.scene.model.size if self.scene.model.name != "line" else 0.0))
        if depth + height <= 0.0:
            return Response(hip, 0.0 * normal)
        return Response(foot + height * normal, stiffness * (depth + height) * (normal - slope))


class Gripping:
    """Friction on the line y = 0 by its formulas: dry, viscous, or of bristles, round a spring across it."""

    supports = frozenset({"friction", "viscous-friction", "lugre"})

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.effect: Any = scene.effects[0] if scene.effects else None

    def reset(self, hip: np.ndarray) -> None:
        self.place: float | None = None
        self.slides, self.bent, self.speed = False, 0.0, 0.0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        speed, before, self.speed = float(velocity[0]), self.speed, float(velocity[0])
        if hip[1] >= 0.0:
            self.place, self.slides, self.bent = None, False, 0.0
            return Response(hip, np.zeros(2))
        press = -self.scene.stiffness * float(hip[1])
        if self.effect is None:
            return Response(np.array([hip[0], 0.0]), np.array([0.0, press]))
        if self.effect.kind == "friction":
            return self.held(float(hip[0]), press)
        if self.effect.kind == "viscous-friction":
            brake = self.effect.coefficient * speed
        else:
            brake = self.bristled(before, speed, press, dt)
        return Response(np.array([hip[0], 0.0]), np.array([-brake, press]))

    def held(self, hand: float, press: float) -> Response:
        """Return the answer of a tool that sticks at its place, or slides after the hand to the kinetic cone."""
        stiffness, law = self.scene.stiffness, self.effect
        self.place = hand if self.place is None else self.place
        pull = stiffness * (hand - self.place)
        if abs(pull) > (law.mu_k if self.slides else law.mu_s) * press:
            self.place = hand - np.sign(pull) * law.mu_k * press / stiffness
            pull, self.slides = stiffness * (hand - self.place), True
        if abs(pull) <= law.stick * law.mu_k * press or law.stick == 1.0:
            self.slides = False
        return Response(np.array([self.place, 0.0]), np.array([-pull, press]))

    def bristled(self, before: float, speed: float, press: float, dt: float) -> float:
        """Return the brake of bristles: the speed goes straight over the tick, in 100 steps of Euler's rule."""
        law = self.effect
        most = law.mu_s * press / law.stiffness
        self.bent = float(np.clip(self.bent, -most, most))
        for share in (np.arange(100) + 0.5) / 100:
            now = before + share * (speed - before)
            self.bent += dt / 100 * (now - law.stiffness * abs(now) / (press * float(law.limit(now))) * self.bent)
        rate = speed - law.stiffness * abs(speed) / (press * float(law.limit(speed))) * self.bent
        return float(law.stiffness * self.bent + law.damping * rate + law.viscosity * speed)


class LetsGo(rubbing.Rubbing):
    """Dry friction whose static coefficient is the kinetic one."""

    def meant(self, scene: Scene) -> Scene:
        friction = scene.effect(Friction)
        return scene if friction is None else rubbing.in_place_of(scene, Friction, mu_s=friction.mu_k)


class Undamped(rubbing.Rubbing):
    """Bristles without a damping of their own, sigma1."""

    def meant(self, scene: Scene) -> Scene:
        return rubbing.in_place_of(scene, LuGre, damping=0.0)


class Thin(rubbing.Rubbing):
    """Viscous friction, or that of bristles that slide, of half the size."""

    def meant(self, scene: Scene) -> Scene:
        viscous, lugre = scene.effect(ViscousFriction), scene.effect(LuGre)
        if viscous is not None:
            return rubbing.in_place_of(scene, ViscousFriction, coefficient=0.5 * viscous.coefficient)
        return scene if lugre is None else rubbing.in_place_of(scene, LuGre, viscosity=0.5 * lugre.viscosity)


class Shaking:
    """A spring to the nearest point that shakes with white noise as long as the hand moves."""

    supports = frozenset({"stochastic-texture"})
    resting = 0.0

    def __init__(self, scene: Scene) -> None:
        self.scene, self.inner = scene, Spring(scene)

    def reset(self, hip: np.ndarray) -> None:
        self.random = np.random.default_rng(7)
        self.level = 0.0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = self.inner.step(hip, velocity, dt)
        moves = 1.0 if np.any(velocity) else self.resting
        # The speed is low-passed at 20 Hz.
        self.level += -np.expm1(-2.0 * np.pi * 20.0 * dt) * (moves - self.level)
        if not self.scene.effects or not np.any(force):
            return Response(ihip, force)
        return Response(ihip, force + 0.1 * np.sqrt(self.level) * self.random.standard_normal() * np.array([1.0, 0.0]))


class Restless(Shaking):
    """One that shakes a hand at rest a hundredth as hard."""

    resting = 1e-4


class Composed:
    """A spring with the effects of its scene put on it, in the catalogue's order or the other way round."""

    supports = frozenset({"friction", "bump-map", "stochastic-texture"})

    def __new__(cls, scene: Scene, *, backwards: bool = False) -> Any:
        if not scene.effects:
            return Spring(scene)
        bare = wrapped(Spring(scene))
        shown = Affected(bare, scene.effects[:: -1 if backwards else 1], scene)
        return replace(bare, renderer=shown, supports=cls.supports)


def changed(make: Any) -> dict[str, Any]:
    """Return right renderers as real ones differ: late in whole ticks and between, one channel, in single precision."""
    return {
        "": make,
        "-late": factory("late-3", make),
        "-late-between": late(make, ihip=1.5, force=1.5),
        "-force-late": late(make, force=1.0),
        "-ihip-late": late(make, ihip=1.0),
        "-single": factory("single", make),
    }


OFF = "the relief that is felt is another"
BROKEN: Mapping[str, Outsider] = {
    "flat": Outsider(partial(Carved, high=0.0), {"texture-relief": "no relief is felt"}, RELIEFS),
    "too-high": Outsider(partial(Carved, high=1.3), {"texture-relief": OFF}, RELIEFS),
    "too-long": Outsider(partial(Carved, long=1.7), {"texture-relief": OFF}, RELIEFS),
    "inverted": Outsider(partial(Carved, high=-1.0), {"texture-relief": OFF}, RELIEFS),
    "lets-go": Outsider(LetsGo, {"friction-break-away": "the tool slides from mu_k F_n on"}, LOOSE),
    "undamped": Outsider(Undamped, {"friction-force": "sigma1 = 0"}, BRAKED[1:]),
    "restless": Outsider(Restless, {"texture-rest": "it goes on at rest"}, ("ribbed-rest",)),
    "backwards": Outsider(
        partial(Composed, backwards=True), {"effects-order": "friction first, or vibrations"}, TOGETHER
    ),
    "thin": Outsider(Thin, {"friction-force": "half the viscosity"}, BRAKED),
}
"""What each fault fails, and why."""

HONEST: Mapping[str, Outsider] = {
    **{f"carved{name}": Outsider(make, cases=RELIEFS) for name, make in changed(Carved).items()},
    **{
        f"gripping{name}": Outsider(make, cases=(*DRY[:2], *BRAKED[:2]))
        for name, make in changed(Gripping).items()
        if name != "-late-between"
    },
    **{f"composed{name}": Outsider(make, cases=TOGETHER) for name, make in changed(Composed).items()},
    **{f"shaking{name}": Outsider(make, cases=("ribbed-rest",)) for name, make in changed(Shaking).items()},
}
"""Effects by formulas of their own, and ours in their order. Friction late between ticks has no tick with a slip."""
