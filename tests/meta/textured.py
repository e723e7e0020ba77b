"""Renderers that claim to show textures, and show them wrong: each with one fault.

Each is a spring to the nearest point with the package's own effect on it, whose answer the fault replaces. `BROKEN` and
`HONEST` are as in `outsiders`, and led along `CASES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import honest
import numpy as np
from msgspec import structs
from outsiders import Outsider

from hapticeval.discovery import resolve
from hapticeval.effects.stochastic_texture import StochasticTexture
from hapticeval.renderer import Response, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import with_effects
from hapticeval.stimulus.paths import Loop
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

SHOWN = {
    "height-map-circle": ("texture-work",),
    "gritty-stroke": ("texture-spectrum", "texture-stationary"),
    "woven-strokes": ("texture-amplitude", "texture-spectrum", "texture-stationary"),
}
"""Cases of the suite, and the checks of textures that are asked there."""

SHORTER = {"radius": 0.0005, "laps": 2, "lap": 1.0}
"""What of a loop is enough to show a fault: each lap of the suite's is refined in Python."""


def _shorter(case: Case) -> Case:
    loops = isinstance(case.trajectory, Loop)
    trajectory = structs.replace(case.trajectory, **SHORTER) if loops else case.trajectory
    return structs.replace(case, checks=SHOWN[case.name], trajectory=trajectory)


CASES = {each.name: _shorter(each) for each in load_suite("effects-texture").cases if each.name in SHOWN}
STROKES = ("gritty-stroke", "woven-strokes")


class Textured:
    """A spring to the nearest point that shows the scene's texture by itself."""

    supports = frozenset({"height-map", "stochastic-texture"})

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.bare = resolve("minimum-distance")(scene)
        self.right = with_effects(wrapped(resolve("minimum-distance")(scene)), scene)

    def reset(self, hip: np.ndarray) -> None:
        self.time = 0.0
        self.bare.reset(hip)
        self.right.reset(hip)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        plain = np.array(self.bare.step(hip, velocity, dt).force)
        ihip, force = self.right.step(hip, velocity, dt)
        self.time += dt
        return Response(
            ihip, plain + self.spoiled(hip, plain, np.array(force) - plain) if self.scene.effects else plain
        )

    def spoiled(self, hip: np.ndarray, plain: np.ndarray, texture: np.ndarray) -> np.ndarray:
        """Return what is added to the bare force in place of what the texture adds."""
        return texture


class Flattens(Textured):
    """A height map whose slope along a curve is not enlarged by 1 / (1 - kappa d)."""

    def spoiled(self, hip: np.ndarray, plain: np.ndarray, texture: np.ndarray) -> np.ndarray:
        frame = self.scene.model.boundary.closest_point(hip[np.newaxis])
        normal = frame.normal[0]
        across = (texture @ normal) * normal
        return across + (1.0 + frame.distance[0] * np.trace(frame.shape[0])) * (texture - across)


class Louder(Textured):
    """One decibel too much throughout."""

    def spoiled(self, hip: np.ndarray, plain: np.ndarray, texture: np.ndarray) -> np.ndarray:
        return 10.0 ** (1.0 / 20.0) * texture


class Swells(Textured):
    """Power that swells and fades by six tenths every five seconds."""

    def spoiled(self, hip: np.ndarray, plain: np.ndarray, texture: np.ndarray) -> np.ndarray:
        return np.sqrt(1.0 + 0.6 * np.sin(2.0 * np.pi * self.time / 5.0)) * texture


class Deaf(Textured):
    """Vibrations of one filter whatever speed and force are: that of 0.1 m/s and 1 N."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        effect = scene.effect(StochasticTexture)
        if effect is not None:
            one = effect.model.between(0.1, 1.0)
            places = ((0.0, 0.0), (1.0, 0.0), (0.0, 10.0))
            same = tuple(structs.replace(one, speed=speed, force=force) for speed, force in places)
            texture = structs.replace(effect.model, filters=same, triangles=())
            inner = wrapped(resolve("minimum-distance")(scene))
            self.right = with_effects(inner, scene.with_effects(replace(effect, texture=texture)))


FAILS: Mapping[str, tuple[type[Textured], dict[str, str], tuple[str, ...]]] = {
    "flattens": (Flattens, {"texture-work": "the slope of the bare surface"}, ("height-map-circle",)),
    "louder": (Louder, {"texture-spectrum": "1 dB too much"}, STROKES),
    "swells": (Swells, {"texture-stationary": "power that comes and goes"}, ("gritty-stroke",)),
    "deaf": (Deaf, {"texture-amplitude": "the same whatever speed and force are"}, ("woven-strokes",)),
}
BROKEN: Mapping[str, Outsider] = {name: Outsider(make, fails, cases) for name, (make, fails, cases) in FAILS.items()}
"""Those that claim a texture and show it wrong: what stops each, and why."""

HONEST: Mapping[str, Outsider] = {
    "textured": Outsider(Textured, cases=tuple(SHOWN)),
    "late-textured": Outsider(honest.factory("late-3", Textured), cases=tuple(SHOWN)),
}
"""Those that show it right, and late: no check may blame them."""


def variance_of_mean_square(covariance: np.ndarray, count: int) -> float:
    """Return that of `count` samples of a Gaussian process over its mean squared: 2 / n^2 times the sum over all pairs.

    Isserlis's theorem; `covariance` (k,) has no more lags than matter.
    """
    shares = (covariance / covariance[0]) ** 2
    pairs = (shares[abs(lag)] * (count - abs(lag)) for lag in range(1 - count, count) if abs(lag) < shares.size)
    return 2.0 * float(sum(pairs)) / count**2
