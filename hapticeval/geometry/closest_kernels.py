"""The closest point of a boundary as one compiled function, of signature `hapticeval.compiled.CLOSEST`."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hapticeval.compiled import FOOT, NORMAL, SHAPE, Closest, LawData, compiled, law_data
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve_kernels import locate_on_outline, project, speed_integral
from hapticeval.geometry.kernels import KIND, U0, U1, UNBOUNDED, evaluate, piece_index
from hapticeval.geometry.mesh_kernels import closest_on_mesh as nearest_on_mesh
from hapticeval.geometry.surface_kernels import apply_matrix, closest_on_surface, shape_operator
from hapticeval.types import Array


def closest_of(boundary: Boundary) -> Closest | None:
    """Return the closest point of a boundary as compiled code; None for one that has none, such as one in Python.

    A boundary offers it as `compiled_closest`, with a function made by `hapticeval.compiled`.
    """
    return getattr(boundary, "compiled_closest", None)


def closest_in_python(boundary: Boundary) -> Callable[[object, Array, Array], float]:
    """Return what a boundary answers from Python in the form of `CLOSEST`; the data is not used. No arc length."""

    def closest(_data: object, point: Array, frame: Array) -> float:
        """Answer `CLOSEST` for a point (N,), m, into the rows of `frame` (k, N)."""
        closest_point = boundary.closest_point(point[np.newaxis])
        rows = np.vstack(
            [closest_point.foot, closest_point.normal, *closest_point.shape, np.full_like(closest_point.foot, np.nan)]
        )
        frame[:] = rows[: frame.shape[0]]
        return float(closest_point.distance[0])

    return closest


def closest_of_curve(pieces: Array, samples: Array, vertices: Array, tree: Array) -> Closest:
    """Return the compiled closest point of a plane curve, given what `curve_kernels.locate_point` looks a point up in.

    `pieces` (n, 9), `samples` (m, 8), `vertices` (v, 2), m, and `tree` (k, 6): tables that do not apply are empty.
    """
    closest = closest_on_curve if tree.shape[0] == 0 else closest_on_outline
    return Closest(closest, law_data(segments=pieces, lookup=samples, vertices=vertices, tree=tree))


def closest_of_surface(row: Array) -> Closest:
    """Return the compiled closest point of a surface, given its row (4,) of `surface_kernels`: lengths in m."""
    return Closest(closest_in_space, law_data(segments=row[np.newaxis]))


@compiled
def closest_on_curve(data: LawData, point: Array, frame: Array) -> float:
    """Answer `CLOSEST` for a point (2,), m, on a curve, into rows of `frame` (k, 2)."""
    u, distance, side = project(data.segments, data.lookup, point[0], point[1])
    _write_frame(data, u, frame)
    return distance * side


@compiled
def closest_on_outline(data: LawData, point: Array, frame: Array) -> float:
    """Answer `CLOSEST` for a point (2,), m, on a curve of straight edges by its tree, into rows of `frame` (k, 2)."""
    u, distance, side = locate_on_outline(data.segments, data.vertices, data.tree, point[0], point[1])
    _write_frame(data, u, frame)
    return distance * side


@compiled
def _write_frame(data: LawData, u: float, frame: Array) -> None:
    """Write the rows of `frame` (k, 2), see `CLOSEST`, at the parameter u of a curve."""
    pieces = data.segments
    # the end of a closed curve is its start
    if pieces[0, KIND] != UNBOUNDED and not u < pieces[pieces.shape[0] - 1, U1]:
        u = pieces[0, U0]
    k = piece_index(pieces, u)
    x, y, dx, dy, ddx, ddy = evaluate(pieces[k], u)
    speed = math.hypot(dx, dy)
    tx, ty = dx / speed, dy / speed
    # outward normal: the tangent turned clockwise, as curves run anticlockwise
    frame[FOOT, 0], frame[FOOT, 1], frame[NORMAL, 0], frame[NORMAL, 1] = x, y, ty, -tx
    if frame.shape[0] > SHAPE:
        # W = kappa t t^T
        curvature = (dx * ddy - dy * ddx) / math.pow(speed, 3.0)
        frame[SHAPE, 0], frame[SHAPE, 1] = curvature * tx * tx, curvature * tx * ty
        frame[SHAPE + 1, 0], frame[SHAPE + 1, 1] = curvature * ty * tx, curvature * ty * ty
    if frame.shape[0] > SHAPE + 2:
        # arc length: u itself on lines and arcs, else from the row of the table before u
        along = u if pieces[0, KIND] == UNBOUNDED else u - pieces[0, U0]
        if data.lookup.shape[0] > 0:
            i = max(int(np.searchsorted(data.lookup[:, 0], u, side="right")) - 1, 0)
            along = data.lookup[i, 1] + speed_integral(pieces[0], data.lookup[i, 0], u)
        frame[SHAPE + 2, 0], frame[SHAPE + 2, 1] = along, 0.0


@compiled
def closest_in_space(data: LawData, point: Array, frame: Array) -> float:
    """Answer `CLOSEST` for a point (3,), m, on a surface in space, into `frame` (k, 3); there is no arc length."""
    row = data.segments[0]
    foot, normal, distance = closest_on_surface(row, (point[0], point[1], point[2]))
    for i in range(3):
        frame[FOOT, i], frame[NORMAL, i] = foot[i], normal[i]
    if frame.shape[0] > SHAPE:
        w = shape_operator(row, foot, normal)
        for i in range(3):
            unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
            frame[SHAPE + i, 0], frame[SHAPE + i, 1], frame[SHAPE + i, 2] = apply_matrix(w, unit)
    if frame.shape[0] > SHAPE + 3:
        for i in range(3):
            # the row of the arc length
            frame[SHAPE + 3, i] = np.nan
    return distance


def closest_of_mesh(faces: Array, vertices: Array, tree: Array) -> Closest:
    """Return the compiled closest point of a triangle mesh, given its tables of `mesh_kernels`, which are shared.

    `faces` (t, 9), `vertices` (v, 6), m, and `tree` (k, 11). Its state is the triangle of the last answer.
    """
    return Closest(closest_on_mesh, law_data(segments=faces, vertices=vertices, tree=tree, state=1))


@compiled
def closest_on_mesh(data: LawData, point: Array, frame: Array) -> float:
    """Answer `CLOSEST` for a point (3,), m, on a triangle mesh, into `frame` (k, 3).

    A mesh bends in no face, and has no arc length.
    """
    p = (point[0], point[1], point[2])
    k, foot, normal, distance = nearest_on_mesh(data.segments, data.vertices, data.tree, p, int(data.state[0]))
    # the next point is looked for from here: it saves time and changes no answer
    data.state[0] = k
    for i in range(3):
        frame[FOOT, i], frame[NORMAL, i] = foot[i], normal[i]
        for row in range(SHAPE, min(frame.shape[0], SHAPE + 3)):
            frame[row, i] = 0.0
        if frame.shape[0] > SHAPE + 3:
            frame[SHAPE + 3, i] = np.nan
    return distance
