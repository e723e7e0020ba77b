"""A renderer moves with its model: what it answers does not depend on where the origin is, or how the axes lie.

Every built-in renderer is asked along a path on a model, and along the same path, turned, mirrored, shifted or scaled,
on the model so moved. The answers differ by rounding alone: 1e-9 of the size, the rounding of the coordinates, and what
the renderer declares of a grid or table (`resolution`, `standoff`). Where a rounding of the hand alone moves the answer
by more than that, beside a discontinuity or where a map is steep, the answer may differ by as much.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import cassinian, dumbbell, from_vertices, star
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import ARC, KIND, U0, U1, A, B, C, D
from hapticeval.geometry.model import Model
from hapticeval.scene import Scene
from hapticeval.types import Array

L_SHAPE = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.03], [0.04, 0.03], [0.04, 0.1], [0.0, 0.1]]
WEDGE = [[-0.06, -0.02], [0.09, -0.03], [0.01, 0.07]]
STRAIGHT = {
    "star": star(),
    "L": from_vertices(L_SHAPE),
    "triangle": from_vertices(WEDGE),
    "40-gon": from_vertices(cassinian(lobes=3).polygon(40).vertices),
}
ROUND = {"dumbbell": dumbbell(), "narrow dumbbell": dumbbell(neck=0.2)}
EXACT = ["minimum-distance", "minimum-distance@polygon", "constraint", "constraint@curve", "conformal"]


class Motion(NamedTuple):
    """x -> scale R (±x) + shift: R turns by `turn` (rad), `mirror` changes the sign of y first."""

    turn: float
    mirror: bool
    scale: float
    shift: tuple[float, float]

    def matrix(self) -> Array:
        c, s = math.cos(self.turn), math.sin(self.turn)
        return np.array([[c, -s], [s, c]]) @ np.diag([1.0, -1.0 if self.mirror else 1.0])

    def __call__(self, points: Array) -> Array:
        return np.asarray(self.scale * points @ self.matrix().T + np.array(self.shift))


def polygonal(model: Model, motion: Motion, first: int) -> Model:
    """A model of straight edges, moved, its vertices counted from another."""
    vertices = motion(model.polygon().vertices)
    return from_vertices(np.roll(vertices[::-1] if motion.mirror else vertices, first, axis=0))


def rounded(model: Model, motion: Motion) -> Model:
    """A model of lines and arcs, turned, shifted and scaled."""
    pieces = np.array(model.curve.pieces)
    arcs = pieces[:, KIND] == ARC
    pieces[:, [U0, U1]] *= motion.scale
    pieces[:, [A, B]] = motion(pieces[:, [A, B]])
    pieces[arcs, C] *= motion.scale
    pieces[arcs, D] += motion.turn
    pieces[~arcs, C : D + 1] = pieces[~arcs, C : D + 1] @ motion.matrix().T
    return Model("moved", {}, Curve("moved", pieces, True))


def path(model: Model, seed: int, count: int = 120) -> Array:
    """A smooth walk in and out of the model."""
    rng = np.random.default_rng(seed)
    bounds = np.array(model.boundary.bounds).reshape(2, -1)
    knots = rng.uniform(-0.1, 1.1, (8, bounds.shape[1])) * (bounds[1] - bounds[0]) + bounds[0]
    share = np.linspace(0.0, 7.0, count)
    return np.column_stack([np.interp(share, np.arange(8), column) for column in knots.T])


def answers(name: str, model: Model, hips: Array) -> tuple[Array, Array, float]:
    """IHIPs, forces, and what the renderer declares (m)."""
    renderer = resolve(f"hapticeval.renderers:{name}" if ":" in name else name)(Scene(model=model))
    if hasattr(renderer, "run"):
        ihips, forces = renderer.run(hips, 1e-3)
    else:
        renderer.reset(hips[0])
        velocities = np.vstack([np.zeros((1, 2)), np.diff(hips, axis=0) / 1e-3])
        steps = [renderer.step(hip, velocity, 1e-3) for hip, velocity in zip(hips, velocities, strict=True)]
        ihips, forces = (np.array(column) for column in zip(*steps, strict=True))
    on_grid = name == "conformal" or name.endswith("level-set")
    return ihips, forces, renderer.resolution + renderer.standoff if on_grid else 0.0


def compare(name: str, before: Model, after: Model, hips: Array, motion: Motion) -> float:
    """Assert that the answers move with the model; returns the share of ticks at which none was exempt."""
    ihips, forces, declared = answers(name, before, hips)
    moved = motion(hips)
    found, pushed, declared_after = answers(name, after, moved)
    size = before.size
    rounding = 4.0 * np.finfo(float).eps * np.max(np.abs(moved)) / motion.scale
    declared = max(declared, declared_after / motion.scale)
    allowed = 1e-9 * size + rounding + declared
    off = np.hypot(*(found - motion(ihips)).T) / motion.scale
    turned = np.hypot(*(pushed / motion.scale - forces @ motion.matrix().T).T) / 1000.0
    steep = np.zeros(len(hips))
    reach = rounding + 1e-16 * size + (declared if name.endswith("level-set") else 0.0)
    for way in np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]) * reach:
        near, push, _ = answers(name, before, hips + way)
        steep = np.maximum(steep, np.hypot(*(near - ihips).T) + np.hypot(*(push - forces).T) / 1000.0)
    assert np.all(np.maximum(off, turned) <= allowed + 10.0 * steep)
    return float(np.mean(steep <= allowed))


def motion_of(seed: int) -> Motion:
    """Any turn, mirror image or not, a size from a hundredth to a hundred times, and a shift of up to 100 m."""
    rng = np.random.default_rng(seed)
    shift = rng.uniform(-100.0, 100.0, 2)
    return Motion(rng.uniform(-math.pi, math.pi), bool(seed % 2), 10.0 ** rng.uniform(-2.0, 2.0), (shift[0], shift[1]))


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("model", STRAIGHT.values(), ids=STRAIGHT)
@pytest.mark.parametrize("seed", range(3))
def test_on_polygons(name: str, model: Model, seed: int) -> None:
    motion = motion_of(seed)
    assert compare(name, model, polygonal(model, motion, seed), path(model, seed), motion) > 0.5


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("model", ROUND.values(), ids=ROUND)
@pytest.mark.parametrize("seed", range(3))
def test_on_lines_and_arcs(name: str, model: Model, seed: int) -> None:
    """Shifts grow with the size: rounding moves the joints of arcs off each other, which crowding magnifies."""
    motion = motion_of(seed)._replace(mirror=False)
    motion = motion._replace(shift=(motion.scale * motion.shift[0], motion.scale * motion.shift[1]))
    assert compare(name, model, rounded(model, motion), path(model, seed), motion) > 0.5


@pytest.mark.parametrize("model", ROUND.values(), ids=ROUND)
@pytest.mark.parametrize("seed", range(3))
def test_set_stabilisation(model: Model, seed: int) -> None:
    """Near the surface, where it is defined, and without a change of size: its force holds a tool of given mass."""
    motion = motion_of(seed)._replace(mirror=False, scale=1.0)
    u = np.linspace(0.0, 0.8 * model.curve.length, 120)
    hips = model.curve.position(u) - 1e-3 * (1.0 + np.sin(9.0 * u))[:, np.newaxis] * model.curve.normal(u)
    assert compare("set-stabilisation", model, rounded(model, motion), hips, motion) > 0.5


@pytest.mark.parametrize("model", [STRAIGHT["star"], STRAIGHT["L"], STRAIGHT["40-gon"]], ids=["star", "L", "40-gon"])
def test_level_sets_to_their_cells(model: Model) -> None:
    """Not the triangle: its tips, once turned, leave islands on the grid, which is refused."""
    motion = motion_of(1)
    compare("minimum-distance@level-set", model, polygonal(model, motion, 1), path(model, 1), motion)
