"""Renderers that show friction themselves: the effect round the nearest point, and the same with one fault each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from msgspec import structs
from outsiders import Outsider

from hapticeval.discovery import resolve
from hapticeval.effects.friction import Friction
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.renderer import Response, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import with_effects
from hapticeval.suite.reading import load_suite


class Rubbing:
    """Friction as the effect makes it."""

    supports = frozenset({"friction", "viscous-friction", "lugre"})

    def __init__(self, scene: Scene) -> None:
        self.scene = self.meant(scene)
        self.inner = with_effects(wrapped(resolve("minimum-distance")(scene)), self.scene)

    def meant(self, scene: Scene) -> Scene:
        return scene

    def reset(self, hip: np.ndarray) -> None:
        self.before = self.tool = np.array(hip)
        self.ticks, self.slid, self.time = 0, False, 0.0
        self.inner.reset(hip)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        answer = self.inner.step(hip, velocity, dt)
        touching = bool(np.any(answer.force))
        moved = touching and self.ticks > 0 and bool(np.any(answer.ihip != self.tool))
        self.slid = touching and (self.slid or moved)
        self.stuck = 0.0 if moved or not touching else (self.stuck + dt if self.ticks else 0.0)
        self.ticks = self.ticks + 1 if touching else 0
        self.tool = answer.ihip
        spoiled = self.spoiled(hip, *answer) if touching else answer
        self.before, self.time = np.array(hip), self.time + dt
        return spoiled

    def spoiled(self, hip: np.ndarray, ihip: np.ndarray, force: np.ndarray) -> Response:
        return Response(ihip, force)


def in_place_of(scene: Scene, kind: type, **numbers: float) -> Scene:
    found = scene.effect(kind)
    return scene if found is None else scene.with_effects(replace(found, **numbers))


class Grips(Rubbing):
    """A static friction a tenth above the scene's."""

    def meant(self, scene: Scene) -> Scene:
        friction = scene.effect(Friction)
        return scene if friction is None else in_place_of(scene, Friction, mu_s=1.1 * friction.mu_s)


class Creeps(Rubbing):
    """A tool that has stuck for 1.5 s creeps from then on, by 2 um a second, in the force too."""

    def spoiled(self, hip: np.ndarray, ihip: np.ndarray, force: np.ndarray) -> Response:
        along = 2e-6 * max(self.stuck - 1.5, 0.0) * np.eye(hip.size)[0]
        return Response(ihip + along, force + self.scene.stiffness * along)


class Chatters(Rubbing):
    """In the first half second a tool that slides has a fifth more friction and a fifth less in turns."""

    def spoiled(self, hip: np.ndarray, ihip: np.ndarray, force: np.ndarray) -> Response:
        normal = self.scene.model.boundary.closest_point(ihip[np.newaxis]).normal[0]
        along = force - (force @ normal) * normal
        slides = self.slid and self.stuck == 0.0 and self.time < 0.5
        return Response(ihip, force + (0.2 if self.ticks % 2 else -0.2) * along * slides)


class Gives(Rubbing):
    """Until the tool slides the force is a third larger on the hand's way out."""

    def spoiled(self, hip: np.ndarray, ihip: np.ndarray, force: np.ndarray) -> Response:
        out = not self.slid and float((hip - self.before) @ force) > 0.0
        return Response(ihip, force * (4.0 / 3.0 if out else 1.0))


class Thins(Rubbing):
    """A viscous friction a hundredth below the scene's."""

    def meant(self, scene: Scene) -> Scene:
        viscous = scene.effect(ViscousFriction)
        return scene if viscous is None else in_place_of(scene, ViscousFriction, coefficient=0.99 * viscous.coefficient)


SHOWN = ("plane-to-and-fro", "plane-press", "circle-to-and-fro", "corner-inner", "viscous-plane")
HELD = "plane-held"
"""Eleven seconds, in which only the one that creeps does."""

CASES = {
    each.name: structs.replace(each, checks=tuple(check for check in each.checks if check.startswith("friction-")))
    for each in load_suite("effects-friction").cases
    if each.name in (*SHOWN, HELD)
}
"""The cases of the suite that show the faults, with the checks of friction alone: the others refine, in Python."""

BROKEN: Mapping[str, Outsider] = {
    "grips": Outsider(Grips, {"friction-cone": "a tenth more than the cone holds"}, SHOWN),
    "creeps": Outsider(Creeps, {"friction-sticking": "2 um a second"}, (*SHOWN, HELD)),
    "chatters": Outsider(
        Chatters,
        {"friction-sliding": "a fifth more and less in turns", "friction-force": "of viscous friction too"},
        SHOWN,
    ),
    "gives": Outsider(Gives, {"friction-energy": "a third more on the way out"}, SHOWN),
    "thins": Outsider(
        Thins, {"friction-work": "a hundredth less of viscous friction", "friction-force": "in every tick"}, SHOWN
    ),
}
"""What each fault fails, and why."""

HONEST: Mapping[str, Outsider] = {"rubbing": Outsider(Rubbing, cases=(*SHOWN, HELD))}
"""The effect itself."""
