"""Faults that show only where a hand goes for it: at a second contact, in a hole, after a reset, after a rest.

Each is round a right renderer, a spring to the nearest point, and is not to be told from it elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from broken import Fault, Tick, free, spoiled
from honest import Spring
from outsiders import ThriceAsStiff
from rubbing import Creeps, Rubbing, in_place_of
from textured import Louder, Textured

from hapticeval.effects.friction import Friction
from hapticeval.renderer import Response
from hapticeval.scene import Scene

SMALL = 0.158e-6
"""Area (m^2) under which a library that was judged ignored triangles."""


def second_falls_through(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """From the second contact on the hand falls through."""
    before = tick.memory.get("inside", False)
    tick.memory["inside"] = tick.inside
    tick.memory["contacts"] = tick.memory.get("contacts", 0) + (tick.inside and not before)
    return free(tick) if tick.memory["contacts"] > 1 else (tick.ihip, tick.force)


def haunts(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """Five seconds after a contact has ended the last force is felt once more, for a tenth of a second."""
    if tick.inside:
        tick.memory |= {"force": tick.force, "since": tick.time}
        return tick.ihip, tick.force
    if "since" in tick.memory and 5.0 < tick.time - tick.memory["since"] < 5.1:
        return tick.ihip, tick.memory["force"]
    return tick.ihip, tick.force


def lingers(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """Where a contact has ended IHIP and force stay for 30 ticks."""
    if tick.inside:
        tick.memory |= {"last": (tick.ihip, tick.force), "left": tick.number}
    elif tick.number - tick.memory.get("left", tick.number - 100) <= 30:
        return tick.memory["last"]
    return tick.ihip, tick.force


def holds_after_a_leap(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """Once the hand moves by over 2 mm in a tick, the plane of the last contact stays until the hand is above it."""
    hip = tick.hip.copy()
    leapt = bool(np.linalg.norm(hip - tick.memory.get("hip", hip)) > 2e-3)
    point, normal, held = tick.memory.get("plane", (hip, np.zeros(hip.size), False))
    depth = float((point - hip) @ normal)
    tick.memory["hip"] = hip
    if (leapt or held) and depth > 0.0:
        tick.memory["plane"] = point, normal, True
        return hip + depth * normal, tick.scene.stiffness * depth * normal
    size = float(np.linalg.norm(tick.force))
    tick.memory["plane"] = (tick.ihip, tick.force / size, False) if size > 0.0 else (hip, np.zeros(hip.size), False)
    return tick.ihip, tick.force


class Holes:
    """Triangles of a mesh that a renderer does not see, `unseen` (t,); a tool that comes to one falls through."""

    def __init__(self, scene: Scene, unseen: Callable[[np.ndarray], np.ndarray]) -> None:
        from scipy.spatial import cKDTree

        boundary: Any = scene.model.boundary
        self.corners = boundary.vertices[boundary.triangles]
        self.unseen = unseen(self.corners)
        self.centres = cKDTree(self.corners.mean(axis=1))

    def at(self, point: np.ndarray) -> bool:
        """Whether the triangle with the point (3,) on it is unseen: of the nearest, that with all weights positive."""
        nearest = self.centres.query(point, k=12)[1]
        edges = self.corners[nearest] - point
        weights = [
            np.einsum("ti,ti->t", self._normals(nearest), np.cross(edges[:, k], edges[:, (k + 1) % 3]))
            for k in range(3)
        ]
        return bool(self.unseen[nearest[np.argmax(np.min(weights, axis=0))]])

    def _normals(self, triangles: np.ndarray) -> np.ndarray:
        first, second, third = self.corners[triangles].swapaxes(0, 1)
        return np.cross(second - first, third - first)


def falls_in(unseen: Callable[[np.ndarray], np.ndarray]) -> Fault:
    """Return a fault: at an unseen triangle the tool falls through, until the hand is outside again."""

    def fault(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
        holes = tick.memory.setdefault("holes", None) or Holes(tick.scene, unseen)
        tick.memory["holes"] = holes
        fallen = tick.inside and (tick.memory.get("fallen", False) or holes.at(tick.ihip))
        tick.memory["fallen"] = fallen
        return free(tick) if fallen else (tick.ihip, tick.force)

    return fault


def one_in_200(corners: np.ndarray) -> np.ndarray:
    return np.random.default_rng(5).random(len(corners)) < 1.0 / 200.0


def small(corners: np.ndarray) -> np.ndarray:
    sides = corners[:, 1:] - corners[:, :1]
    return np.asarray(0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) < SMALL)


class AboutOrigin(Spring):
    """Takes the middle of the mesh for the origin."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        vertices = scene.model.boundary.vertices  # type: ignore[attr-defined]
        self.middle = 0.5 * (vertices.max(axis=0) + vertices.min(axis=0))

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        ihip, force = super().step(hip + self.middle, velocity, dt)
        return Response(ihip - self.middle, force)


class Damped(Spring):
    """With a weak damper across the surface, 1 N s/m, on a velocity that it filters itself in 10 ms: right."""

    def reset(self, hip: np.ndarray) -> None:
        self.filtered = np.zeros(hip.size)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        self.filtered = self.filtered + dt / (dt + 0.01) * (velocity - self.filtered)
        ihip, force = super().step(hip, velocity, dt)
        size = float(np.linalg.norm(force))
        normal = force / size if size > 0.0 else np.zeros(hip.size)
        return Response(ihip, force - min(float(self.filtered @ normal), size) * normal)


class VelocityLeft(Damped):
    """The same, and a reset leaves the filtered velocity as it was."""

    def reset(self, hip: np.ndarray) -> None:
        if not hasattr(self, "filtered"):
            super().reset(hip)


AXIS = np.array([0.2, 1.0, 0.5]) / np.linalg.norm([0.2, 1.0, 0.5])
ACROSS = np.cross(AXIS, np.eye(3)).T
"""The vector product with the axis, as a matrix: `np.cross` takes half of the time of a tick."""


def swirls(tick: Tick) -> tuple[np.ndarray, np.ndarray]:
    """In space a fifth of the force comes on top across it, round an axis: it drives the hand round one way."""
    return tick.ihip, tick.force + 0.2 * (ACROSS @ tick.force)


class Slippery(Rubbing):
    """A kinetic friction a thirtieth below the scene's."""

    def meant(self, scene: Scene) -> Scene:
        friction = scene.effect(Friction)
        return scene if friction is None else in_place_of(scene, Friction, mu_k=friction.mu_k * 29.0 / 30.0)


class OverShaded(Textured):
    """Turns the force half as far again as unit normals do, at its length."""

    supports = frozenset({"shading"})

    def spoiled(self, hip: np.ndarray, plain: np.ndarray, texture: np.ndarray) -> np.ndarray:
        shaded = plain + 1.5 * texture
        size = float(np.linalg.norm(shaded))
        return shaded * (np.linalg.norm(plain) / size) - plain if size > 0.0 else texture


class AlongX(Textured):
    """Vibrations as strong as the hand's speed along x makes them, as on a line, and not that along the surface."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        speed = float(np.linalg.norm(velocity))
        self.share = abs(float(velocity[0])) / speed if speed > 0.0 else 1.0
        return super().step(hip, velocity, dt)

    def spoiled(self, hip: np.ndarray, plain: np.ndarray, texture: np.ndarray) -> np.ndarray:
        return self.share * texture


class Flat(Textured):
    """Claims shading and shows none."""

    supports = frozenset({"shading"})

    def spoiled(self, hip: np.ndarray, plain: np.ndarray, texture: np.ndarray) -> np.ndarray:
        return 0.0 * texture


class Rings(Textured):
    """Vibrations of a contact that are a fifth stronger than the scene's."""

    supports = frozenset({"contact-transient"})

    def spoiled(self, hip: np.ndarray, plain: np.ndarray, texture: np.ndarray) -> np.ndarray:
        return 1.2 * texture


class Unvisited(NamedTuple):
    """A renderer, the cases (suite/case) that visit its fault, and the check, a must, that stops it there."""

    make: Callable[[Scene], Any]
    cases: tuple[str, ...]
    check: str


MESH_HOLES = ("solids/fine-ball",)
UNVISITED: Mapping[str, Unvisited] = {
    "holds-after-a-leap": Unvisited(spoiled(holds_after_a_leap, Spring), ("solids/cube-leaps",), "continuous-contact"),
    "second-falls-through": Unvisited(spoiled(second_falls_through, Spring), ("solids/cube-again",), "contact-kept"),
    "one-triangle-in-200": Unvisited(spoiled(falls_in(one_in_200), Spring), MESH_HOLES, "contact-kept"),
    "small-triangles": Unvisited(
        spoiled(falls_in(small), Spring), (*MESH_HOLES, "hard-cases-places/l-block-1e-4-m"), "contact-kept"
    ),
    "about-origin": Unvisited(AboutOrigin, ("solids/box-off-origin",), "contact-kept"),
    "velocity-left": Unvisited(VelocityLeft, ("solids/cube-cut-off", "hard-cases-loops/cut-off"), "reset-clears"),
    "haunts": Unvisited(
        spoiled(haunts, Spring), ("solids/cube-again", "hard-cases-loops/left-for-12-s"), "contact-kept"
    ),
    "lingers": Unvisited(
        spoiled(lingers, "constraint"),
        tuple(f"dynamics-unilateral/{place}{robot}" for place in ("star-tip", "cube-edge") for robot in ("", "-robot")),
        "broken-contact",
    ),
    "swirls-in-space": Unvisited(
        spoiled(swirls, Spring), ("hard-cases-loops/laps-torus", "hard-cases-loops/laps-niche"), "passivity"
    ),
    "stiff-in-space": Unvisited(
        ThriceAsStiff, ("hard-cases-loops/loop-torus", "hard-cases-loops/loop-niche"), "comes-to-rest"
    ),
    "shares-in-space": Unvisited(spoiled("shares", Spring), ("generated/l-block-restated",), "two-at-once"),
    "creeps-in-space": Unvisited(
        Creeps, ("effects-friction/sphere-held", "effects-friction/sphere-held-robot"), "friction-sticking"
    ),
    "slippery-in-space": Unvisited(
        Slippery, ("effects-friction/sphere-to-and-fro", "effects-friction/box-to-and-fro"), "friction-work"
    ),
    "over-shaded-in-space": Unvisited(OverShaded, ("effects-shading/icosphere-loop",), "shading-work"),
    "textured-along-x": Unvisited(
        AlongX,
        ("effects-texture/ribbed-circle-stroke", "effects-texture/ribbed-sphere-stroke"),
        "texture-spectrum",
    ),
    "louder-in-a-loop": Unvisited(Louder, ("effects-texture/gritty-loop-stroke",), "texture-spectrum"),
    "flat-in-a-loop": Unvisited(Flat, ("effects-shading/icosagon-drawn",), "shading-direction"),
    "rings-in-a-loop": Unvisited(Rings, ("effects-transient/thrown-aluminium",), "transient-impulse"),
}
"""Fault: where and by what it is stopped."""
