"""A renderer moves with its model: what it answers does not depend on where the origin is, or how the axes lie.

Every built-in renderer is asked along a path on a model, and along the same path, turned, mirrored, shifted or scaled,
on the model so moved. A model that is bound to the origin and the axes, a Cassinian or a surface in space, is moved by
its symmetries alone, and scaled. The answers differ by rounding alone: 1e-9 of the size, the rounding of the
coordinates, and what the renderer declares of a grid or table (`resolution`, `standoff`). Where a change of the hand by
its rounding (on a grid or table by what is declared) moves the answer by more than that, beside a discontinuity or
where a map is steep, the answer may differ by as much.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from leading import led

from hapticeval.discovery import resolve
from hapticeval.geometry import kernels as pieces
from hapticeval.geometry.catalogue import cassinian, dumbbell, ellipse, ellipsoid, from_vertices, sphere, star, torus
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import ARC, ARC_PIECE, LINE_PIECE
from hapticeval.geometry.model import Model
from hapticeval.records import as_record
from hapticeval.renderer import configured
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
WIDE = dumbbell(neck=0.9)
EXACT = ["minimum-distance", "minimum-distance@polygon", "constraint", "constraint@curve", "conformal"]
PASSIVE = ["homothetic", "homothetic@polygon", "combescure"]
CELLS = {"lut": 2e-3, "mapping": 60.0}
"""Side of a cell of a table (m) of a model that is not scaled; cells of a flow along the model."""


class Motion(NamedTuple):
    """x -> scale matrix x + shift, with an orthogonal matrix (N, N)."""

    matrix: Array
    scale: float
    shift: Array

    def __call__(self, points):
        return np.asarray(self.scale * points @ self.matrix.T + self.shift)

    @property
    def mirrors(self):
        return bool(np.linalg.det(self.matrix) < 0.0)


def turn(angle, *, mirror=False):
    """The matrix of a turn, after a change of the sign of y if `mirror`."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]]) @ np.diag([1.0, -1.0 if mirror else 1.0])


def motion_of(seed):
    """Any turn, mirror image or not, a size from a hundredth to a hundred times, and a shift of up to 100 m."""
    rng = np.random.default_rng(seed)
    shift = rng.uniform(-100.0, 100.0, 2)
    return Motion(turn(rng.uniform(-math.pi, math.pi), mirror=bool(seed % 2)), 10.0 ** rng.uniform(-2.0, 2.0), shift)


def shifted_by_size(motion):
    """Shifts grow with the size: rounding moves the joints of arcs off each other, which crowding magnifies."""
    return motion._replace(shift=motion.scale * motion.shift)


def polygonal(model, motion, first):
    """A model of straight edges, moved, its vertices counted from another."""
    vertices = motion(model.polygon().vertices)
    return from_vertices(np.roll(vertices[::-1] if motion.mirrors else vertices, first, axis=0))


def rounded(model, motion):
    """A model of lines and arcs, moved: a mirror image runs through them backwards."""
    c, s = motion.matrix[:, 0]
    way, rows = (-1.0 if motion.mirrors else 1.0), []
    for row in model.curve.pieces:
        line = as_record(row, LINE_PIECE)
        length = line.u1 - line.u0
        centre = motion(np.array([line.x, line.y]))
        if line.kind == ARC:
            arc = as_record(row, ARC_PIECE)
            sweep = arc.sense * length / arc.radius
            angle = math.atan2(s, c) + way * (arc.angle if way > 0.0 else arc.angle + sweep)
            rows.append(pieces.arc_piece(centre, motion.scale * arc.radius, angle, sweep))
        else:
            end = motion(np.array([line.x + length * line.dx, line.y + length * line.dy]))
            rows.append(pieces.line_piece(centre, end) if way > 0.0 else pieces.line_piece(end, centre))
    return Model("moved", {}, Curve("moved", pieces.concatenate_segments(rows if way > 0.0 else rows[::-1]), True))


def path(model, seed, count=120):
    """A smooth walk in and out of the model."""
    rng = np.random.default_rng(seed)
    bounds = np.array(model.boundary.bounds).reshape(2, -1)
    knots = rng.uniform(-0.1, 1.1, (8, bounds.shape[1])) * (bounds[1] - bounds[0]) + bounds[0]
    share = np.linspace(0.0, 7.0, count)
    return np.column_stack([np.interp(share, np.arange(8), column) for column in knots.T])


@cache
def rendered(name, model, scale=1.0):
    """The renderer of that name; the cells of a table are scaled with the model."""
    knobs = {}
    if name.endswith("@lut"):
        knobs["cell"] = CELLS["lut"] * scale
    if name == "mapping":
        knobs["cells"] = CELLS["mapping"]
    return configured(resolve(name), knobs, name=name)(Scene(model=model))


def answers(renderer, hips):
    """IHIPs and forces."""
    if hasattr(renderer, "run"):
        ihips, forces = led(renderer, hips, 1e-3)
        return ihips, forces
    renderer.reset(hips[0])
    velocities = np.vstack([np.zeros((1, hips.shape[1])), np.diff(hips, axis=0) / 1e-3])
    steps = [renderer.step(hip, velocity, 1e-3) for hip, velocity in zip(hips, velocities, strict=True)]
    return np.array([each.ihip for each in steps]), np.array([each.force for each in steps])


def compare(name, before, after, hips, motion):
    """Assert that the answers move with the model; returns the share of ticks in contact that need no exemption."""
    here, there = rendered(name, before), rendered(name, after, motion.scale)
    on_grid = name == "mapping" or name.endswith(("level-set", "lut"))
    declared = 0.0
    if on_grid or name == "conformal":
        declared = max(here.resolution + here.standoff, (there.resolution + there.standoff) / motion.scale)
    ihips, forces = answers(here, hips)
    moved = motion(hips)
    found, pushed = answers(there, moved)
    size = before.size
    rounding = 4.0 * np.finfo(float).eps * np.max(np.abs(moved)) / motion.scale
    allowed = 1e-9 * size + rounding + declared
    off = np.linalg.norm(found - motion(ihips), axis=1) / motion.scale
    turned_by = np.linalg.norm(pushed / motion.scale - forces @ motion.matrix.T, axis=1) / 1000.0
    steep = np.zeros(len(hips))
    reach = rounding + 1e-16 * size + (declared if on_grid else 0.0)
    for way in np.vstack([np.eye(hips.shape[1]), -np.eye(hips.shape[1])]) * reach:
        near, push = answers(here, hips + way)
        change = np.linalg.norm(near - ihips, axis=1) + np.linalg.norm(push - forces, axis=1) / 1000.0
        steep = np.maximum(steep, change)
    off = np.maximum(off, turned_by)
    assert np.all(off <= allowed + (2.0 if on_grid else 10.0) * steep)
    contact = np.any(forces != 0.0, axis=1)
    assert np.count_nonzero(contact) > 20
    return float(np.mean(off[contact] <= allowed))


@pytest.mark.parametrize("name", [*EXACT, *PASSIVE])
@pytest.mark.parametrize("model", STRAIGHT.values(), ids=STRAIGHT)
@pytest.mark.parametrize("seed", range(2))
def test_on_polygons(name, model, seed):
    motion = motion_of(seed)
    assert compare(name, model, polygonal(model, motion, seed), path(model, seed), motion) > 0.95


@pytest.mark.parametrize(
    ("name", "model"),
    [(name, model) for name in EXACT for model in ROUND.values()]
    # not on 40 vertices, which no mirror image of its curve keeps
    + [(name, WIDE) for name in PASSIVE if name != "homothetic@polygon"],
)
@pytest.mark.parametrize("seed", range(2))
def test_on_lines_and_arcs(name, model, seed):
    motion = shifted_by_size(motion_of(seed))
    assert compare(name, model, rounded(model, motion), path(model, seed), motion) > 0.95


def around(model):
    """A slow walk along a curve, up to 2 mm inside: where set stabilisation is defined, and holds."""
    u = np.linspace(0.0, 0.1 * model.curve.u_range[1], 120)
    return model.curve.position(u) - 1e-3 * (1.0 + np.sin(0.9 * np.arange(120)))[:, np.newaxis] * model.curve.normal(u)


@pytest.mark.parametrize("model", ROUND.values(), ids=ROUND)
@pytest.mark.parametrize("seed", range(2))
def test_set_stabilisation(model, seed):
    motion = shifted_by_size(motion_of(seed))
    assert compare("set-stabilisation", model, rounded(model, motion), around(model), motion) > 0.95


def lobed(scale):
    return cassinian(lobes=3, size=0.2 * scale)


def flat(scale):
    return ellipse(size=0.2 * scale)


@pytest.mark.parametrize("name", [*EXACT, *PASSIVE, "set-stabilisation"])
@pytest.mark.parametrize(("make", "turns"), [(lobed, 3), (flat, 2)], ids=["cassinian", "ellipse"])
@pytest.mark.parametrize("mirror", [False, True], ids=["turned", "mirrored"])
def test_on_curves_about_the_origin(name, make, turns, *, mirror):
    """Scaled, and by their symmetries: a turn by a lobe, and the mirror image."""
    motion = Motion(turn(math.tau / turns, mirror=mirror), 37.0 if mirror else 0.03, np.zeros(2))
    model = make(1.0)
    hips = around(model) if name == "set-stabilisation" else path(model, turns)
    if name.endswith("@polygon") or name == "constraint":  # a polygon of 40 vertices has no symmetry of order 3
        motion = motion._replace(matrix=turn(math.tau if turns == 3 else math.pi, mirror=mirror))
    assert compare(name, model, make(motion.scale), hips, motion) > 0.95


def round_about(scale):
    return torus(0.07 * scale, 0.03 * scale)


def ball(scale):
    return sphere(0.2 * scale)


def egg(scale):
    return ellipsoid(0.1 * scale, 0.07 * scale, 0.05 * scale)


def tall_egg(scale):
    return ellipsoid(0.05 * scale, 0.1 * scale, 0.07 * scale)


SPIN = np.array([[math.cos(1.0), -math.sin(1.0), 0.0], [math.sin(1.0), math.cos(1.0), 0.0], [0.0, 0.0, 1.0]])
ROLL = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
ANYHOW = SPIN @ ROLL @ SPIN @ ROLL
FLIP = np.diag([-1.0, 1.0, -1.0])
SPACE = {
    "a sphere turned": (ball, ball, ANYHOW),
    "a sphere mirrored": (ball, ball, -ANYHOW),
    "a torus turned": (round_about, round_about, SPIN @ FLIP),
    "a torus mirrored": (round_about, round_about, -SPIN),
    "an ellipsoid rolled": (egg, tall_egg, ROLL @ FLIP),
    "an ellipsoid mirrored": (egg, tall_egg, -ROLL),
}


@pytest.mark.parametrize(
    ("name", "case"),
    [(name, case) for case in SPACE for name in ("minimum-distance", "set-stabilisation")]
    + [("set-stabilisation@atlas", case) for case in SPACE if "sphere" in case]
    + [(name, case) for case in SPACE if "torus" not in case for name in ("homothetic", "combescure")],
)
@pytest.mark.parametrize("scale", [0.02, 50.0])
def test_in_space(name, case, scale):
    make, made, matrix = SPACE[case]
    model, motion = make(1.0), Motion(matrix, scale, np.zeros(3))
    hips = path(model, 4)
    if name.startswith("set-stabilisation"):
        t = np.linspace(0.0, 0.6, 120)
        frame = model.surface.closest_point(0.1 * np.column_stack([np.cos(t), np.sin(t), 0.5 * np.sin(3.0 * t)]))
        hips = frame.foot - 1e-3 * (1.0 + np.sin(60.0 * t))[:, np.newaxis] * frame.normal
    assert compare(name, model, made(scale), hips, motion) > 0.95


@pytest.mark.parametrize("model", [STRAIGHT["L"], STRAIGHT["triangle"]], ids=["L", "triangle"])
def test_level_sets_to_their_cells(model):
    motion = motion_of(1)
    hips = path(model, 6)
    assert compare("minimum-distance@level-set", model, polygonal(model, motion, 1), hips, motion) > 0.8


@pytest.mark.parametrize("name", ["minimum-distance@lut", "conformal@lut", "mapping"])
@pytest.mark.parametrize("model", ["star", "40-gon"])
def test_tables_and_flows_to_their_cells(name, model):
    motion = motion_of(1)
    before, after = STRAIGHT[model], polygonal(STRAIGHT[model], motion, 1)
    assert compare(name, before, after, path(before, 1), motion) > 0.8
