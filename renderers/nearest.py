"""The minimum distance projection (4.2): the hand goes to the closest surface point, without memory.

It is on curves and polygons, on level sets, the representation that the thesis runs it on (4.1.1), and on surfaces in
space; in contact while the hand is inside, or, in a bilateral scene, anywhere.

On a level set it goes to the zero contour of a bilinear interpolant, exactly: an arc of a hyperbola in each cell that
it passes.

A contour program joins the crossings of the cell sides, where the interpolant is linear, by straight edges. Between
them the contour is a hyperbola with axis-parallel asymptotes.

It rises or falls throughout, so that it is a graph over its own chord: the point at t is that on the normal of the
chord at its share t.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hapticeval.compiled import borrowing, compiled, for_kernels
from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.kernels import evaluate
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import closest_on_mesh
from hapticeval.geometry.model import GRID_NODES, VERTICES, Model
from hapticeval.geometry.polygon_kernels import nearest_kernel
from hapticeval.geometry.representations import LevelSet, Polygon
from hapticeval.geometry.surface import apply_matrix, closest_on_surface, shape_operator
from hapticeval.geometry.triples import dot
from hapticeval.laws import EMPTY_TABLE, LawData
from hapticeval.records import as_record, record_type
from hapticeval.renderers.outline import frame, is_clear_of, nearest_on, outline_in, representation_of
from hapticeval.renderers.projective import Projection, once
from hapticeval.renderers.regulation import PP_PD_C
from hapticeval.renderers.regulation_kernel import GAINS, PAST, regulate, release
from hapticeval.scene import Scene
from hapticeval.types import Array

SEARCH = record_type("triangle", base=PAST)
"""The `state` on a mesh: with the closest triangle of the last tick, at which the search for the next begins."""


def nearest(scene: Scene, representation: str, *, vertices: float = VERTICES, grid: float = GRID_NODES) -> Projection:
    """Return the projection on a representation of the scene's model; in space on the exact surface.

    A mesh is its own polygon.
    """
    model = scene.model
    if isinstance(model.boundary, Mesh) and representation in ("curve", "polygon"):
        mesh, (faces, corners, tree) = model.boundary, model.boundary.tables
        return Projection(
            on_mesh, mesh, bilateral=scene.bilateral, state=SEARCH, pieces=faces, vertices=corners, tree=tree
        )
    if model.dimension == 3 and representation == "curve":
        row = model.surface.row[np.newaxis]
        return Projection(in_space, model.surface, bilateral=scene.bilateral, exact=True, pieces=row)
    if representation == "level-set" and model.curve.closed:
        return nearest_on_level_set(model, (int(grid), int(grid)), bilateral=scene.bilateral)
    shape = representation_of(model, representation, int(vertices))
    exact = representation == "curve"
    return Projection(in_plane, shape.surface, bilateral=scene.bilateral, exact=exact, **shape.tables)


@borrowing
def in_plane(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of minimum distance on a curve or a polygon, of signature `LAW`: (4.2), then the scheme's force.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    outline, params, state, gains = outline_in(data), data.params, data.state, as_record(data.params, GAINS)
    x, y, normal = hip[0], hip[1], as_record(state, PAST).normal
    bilateral = gains.bilateral != 0.0
    if not bilateral and outline.stray > 0.0 and is_clear_of(outline, x, y):  # without the exact search: it costs more
        return release(state, hip, ihip, force)
    piece, u, _, side = nearest_on(outline, x, y)
    if not (bilateral or side < 0.0):
        return release(state, hip, ihip, force)
    ihip[0], ihip[1], normal[0], normal[1] = frame(outline.pieces, outline.joins, piece, u, x, y)
    centripetal = 0.0
    if gains.scheme == PP_PD_C:
        # κ (t·ẏ)^2: how fast the curve bends away from under the hand
        _, _, dx, dy, ddx, ddy = evaluate(outline.pieces[piece], u)
        speed = math.hypot(dx, dy)
        tangential_velocity = (dx * velocity[0] + dy * velocity[1]) / speed
        centripetal = (dx * ddy - dy * ddx) / (speed * speed * speed) * (tangential_velocity * tangential_velocity)
    return regulate(params, state, hip, velocity, centripetal, 0.0, dt, ihip, force)


@borrowing
def in_space(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of minimum distance on a sphere or an ellipsoid, whose row `pieces` holds, of signature `LAW`: (4.2).

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    surface, params, state, gains = data.pieces[0], data.params, data.state, as_record(data.params, GAINS)
    foot, normal, distance = closest_on_surface(surface, (hip[0], hip[1], hip[2]))
    if gains.bilateral == 0.0 and not distance < 0.0:
        return release(state, hip, ihip, force)
    past = as_record(state, PAST)
    for i in range(3):
        ihip[i], past.normal[i] = foot[i], normal[i]
    centripetal = 0.0
    if gains.scheme == PP_PD_C:
        # v.W v with the shape operator W: κ v_t^2 along the motion, m/s^2
        v = (velocity[0], velocity[1], velocity[2])
        centripetal = dot(v, apply_matrix(shape_operator(surface, foot, normal), v))
    return regulate(params, state, hip, velocity, centripetal, 0.0, dt, ihip, force)


@borrowing
def on_mesh(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of minimum distance on a triangle mesh, of signature `LAW`: (4.2). Flat faces have no curvature.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's; `ihip` (3,), m, and `force` (3,), N, are written.
    """
    params, state, search = data.params, data.state, as_record(data.state, SEARCH)
    p, last = (hip[0], hip[1], hip[2]), int(search.triangle)
    k, foot, normal, distance = closest_on_mesh(data.pieces, data.vertices, data.tree, p, last)
    search.triangle = k  # the hand is near it at the next tick: the search begins there
    if as_record(params, GAINS).bilateral == 0.0 and not distance < 0.0:
        return release(state, hip, ihip, force)
    for i in range(3):
        ihip[i], search.normal[i] = foot[i], normal[i]
    return regulate(params, state, hip, velocity, 0.0, 0.0, dt, ihip, force)


ARC_CHORDS = 8
"""Chords that an arc is cut into in the outline from which the nearest point is looked for."""


class Contour(NamedTuple):
    """The arcs, in anticlockwise order, and what is looked for in them.

    - `arcs` (n, 4): arc k runs from arcs[k, :2] to arcs[k + 1, :2] (m), in the cell at column arcs[k, 2] and row
      arcs[k, 3] of the grid.
    - `values` (ny, nx): the signed distances (m) at the grid's nodes, from (x0, y0) on in steps dx and dy, m.
    - `vertices` (ARC_CHORDS n, 2): the ends of equal shares of every arc's chord, m; `tree` is their polygon's.
    """

    arcs: Array
    values: Array
    vertices: Array
    tree: Array
    x0: float
    y0: float
    dx: float
    dy: float


GRID_GAINS = record_type("x0", "y0", "dx", "dy", base=GAINS)
"""The `params` of the law: with the first node of the grid and its steps (m)."""


@compiled
def contour_in(data: LawData) -> Contour:
    """Return the contour that a law works on, of the fields of its data; lengths in m."""
    grid = as_record(data.params, GRID_GAINS)
    return Contour(data.pieces, data.lookup, data.vertices, data.tree, grid.x0, grid.y0, grid.dx, grid.dy)


def contour_of(level_set: LevelSet) -> tuple[Contour, Polygon]:
    """Return a level set's zero contour as arcs, without islands, and the polygon of its cut arcs.

    Raises `InputError` as `LevelSet.contour` does.
    """
    level_set = level_set.without_islands()
    ends = level_set.contour().vertices
    x, y = level_set.x, level_set.y
    origin = np.array([x[0], y[0]])
    cell = np.array([(x[-1] - x[0]) / (x.size - 1), (y[-1] - y[0]) / (y.size - 1)])
    # the middle of an arc's chord is inside the cell that the arc passes
    middles = 0.5 * (ends + np.roll(ends, -1, axis=0))
    cells = np.clip(np.floor((middles - origin) / cell), 0, np.array([x.size - 2, y.size - 2]))
    arcs_only = Contour(
        np.hstack([ends, cells]), for_kernels(level_set.values), EMPTY_TABLE, EMPTY_TABLE, *origin, *cell
    )
    outline = Polygon(_cut_arcs(arcs_only))
    return arcs_only._replace(vertices=for_kernels(outline.vertices), tree=for_kernels(outline.tree)), outline


@compiled
def value_at(c: Contour, x: float, y: float) -> float:
    """Return the interpolated signed distance (m) at (x, y), m; infinite off the grid, which covers the model."""
    across, up = (x - c.x0) / c.dx, (y - c.y0) / c.dy
    rows, columns = c.values.shape
    if not (0.0 <= across <= columns - 1 and 0.0 <= up <= rows - 1):
        return math.inf
    value, _, _ = _bilinear_at(c, min(int(across), columns - 2), min(int(up), rows - 2), x, y)
    return value


@compiled
def nearest_on_contour(c: Contour, x: float, y: float) -> tuple[float, float, float, float]:
    """Return the nearest point (m) of the contour, and the outward unit normal that holds the hand (x, y), m, there.

    Between points of the cut outline that are equally near to a thousandth of a cell, either may be taken. At a join
    of two arcs every direction between their normals is one: there it is the direction between the two points.
    """
    count = c.arcs.shape[0]
    edge, along, _ = nearest_kernel(c.vertices, c.tree, x, y)
    arc = edge // ARC_CHORDS
    t = _foot_share(c, arc, (edge % ARC_CHORDS + along) / ARC_CHORDS, x, y)
    px, py, nx, ny = _arc_point(c, arc, t)
    distance = math.hypot(x - px, y - py)
    if t == 0.0 or t == 1.0:  # at a join: the nearest point may be inside of the next arc
        other = (arc - 1) % count if t == 0.0 else (arc + 1) % count
        s = _foot_share(c, other, 1.0 - t, x, y)
        qx, qy, mx, my = _arc_point(c, other, s)
        other_distance = math.hypot(x - qx, y - qy)
        if 0.0 < s < 1.0 and other_distance < distance:
            return qx, qy, mx, my
        if distance > 1e-9 * c.dx:
            signed_distance = distance if (x - px) * (nx + mx) + (y - py) * (ny + my) > 0.0 else -distance
            nx, ny = (x - px) / signed_distance, (y - py) / signed_distance
    return px, py, nx, ny


@compiled
def _bilinear_at(c: Contour, i: int, j: int, x: float, y: float) -> tuple[float, float, float]:
    """The bilinear function of cell (i, j), continued beyond it: value and gradient."""
    a = (x - c.x0) / c.dx - i
    b = (y - c.y0) / c.dy - j
    v00, v10, v01, v11 = c.values[j, i], c.values[j, i + 1], c.values[j + 1, i], c.values[j + 1, i + 1]
    low, high = v00 + a * (v10 - v00), v01 + a * (v11 - v01)  # on the cell's lower and upper side
    gx = ((1.0 - b) * (v10 - v00) + b * (v11 - v01)) / c.dx
    return low + b * (high - low), gx, (high - low) / c.dy


@compiled
def _arc_point(c: Contour, arc: int, t: float) -> tuple[float, float, float, float]:
    """The point of an arc over the share t of its chord, and the outward unit normal there."""
    next_arc = arc + 1 if arc + 1 < c.arcs.shape[0] else 0
    i, j = int(c.arcs[arc, 2]), int(c.arcs[arc, 3])
    ax, ay = c.arcs[arc, 0], c.arcs[arc, 1]
    dx, dy = c.arcs[next_arc, 0] - ax, c.arcs[next_arc, 1] - ay
    x, y = ax + t * dx, ay + t * dy
    length = math.hypot(dx, dy)
    mx, my = dy / length, -dx / length  # the chord's unit normal
    if 0.0 < t < 1.0:  # the ends are on the contour as they are
        value, gx, gy = _bilinear_at(c, i, j, x, y)
        slope = gx * mx + gy * my
        # along the line the function is quadratic: its bend is the cell's one mixed difference
        mixed = c.values[j, i] - c.values[j, i + 1] - c.values[j + 1, i] + c.values[j + 1, i + 1]
        bend = mixed / (c.dx * c.dy) * mx * my
        # value + slope d + bend d^2 = 0: the smaller root, in the form that does not cancel
        root = math.sqrt(max(slope * slope - 4.0 * bend * value, 0.0))
        offset = -2.0 * value / (slope + math.copysign(root, slope))
        x, y = x + offset * mx, y + offset * my
    _, gx, gy = _bilinear_at(c, i, j, x, y)
    size = math.hypot(gx, gy)
    return x, y, gx / size, gy / size


@compiled
def _onwards(c: Contour, arc: int, t: float, x: float, y: float) -> float:
    """Positive where the distance to (x, y) falls as t grows."""
    px, py, nx, ny = _arc_point(c, arc, t)
    # (p - y).tangent, with the tangent (-n_y, n_x) of a contour that runs anticlockwise
    return (y - py) * nx - (x - px) * ny


@compiled
def _foot_share(c: Contour, arc: int, t: float, x: float, y: float) -> float:
    """The share at which the distance to an arc has the local minimum that is nearest to the share t."""
    low, high = max(t - 1.0 / ARC_CHORDS, 0.0), min(t + 1.0 / ARC_CHORDS, 1.0)
    # widen the bracket to where the distance falls towards the inside at both ends, or to the end of the arc
    at_low, at_high = _onwards(c, arc, low, x, y), _onwards(c, arc, high, x, y)
    while at_low <= 0.0 and low > 0.0:
        low = max(low - 1.0 / ARC_CHORDS, 0.0)
        at_low = _onwards(c, arc, low, x, y)
    while at_high >= 0.0 and high < 1.0:
        high = min(high + 1.0 / ARC_CHORDS, 1.0)
        at_high = _onwards(c, arc, high, x, y)
    if at_low <= 0.0:
        return low
    if at_high >= 0.0:
        return high
    for round_ in range(200):
        # the secant, and every third time the middle, so that the bracket always shrinks
        t = low + (high - low) * at_low / (at_low - at_high)
        if round_ % 3 == 2 or not (low < t < high):
            t = 0.5 * (low + high)
        at_t = _onwards(c, arc, t, x, y)
        if at_t > 0.0:
            low, at_low = t, at_t
        else:
            high, at_high = t, at_t
        if high - low <= 1e-15 or at_t == 0.0:
            break
    return t


@compiled
def _cut_arcs(c: Contour) -> Array:
    count = c.arcs.shape[0]
    out = np.empty((ARC_CHORDS * count, 2))
    for arc in range(count):
        for k in range(ARC_CHORDS):
            out[ARC_CHORDS * arc + k, 0], out[ARC_CHORDS * arc + k, 1], _, _ = _arc_point(c, arc, k / ARC_CHORDS)
    return out


MOST_CELLS_OFF = 3.0
"""Cells by which the contour may be off the surface.

In a wedge with the angle a, the part that is narrower than a cell's diagonal may lie between the nodes: sqrt(2) / (2
tan(a / 2)) cells, which is 1.2 at 60 degrees and 2.6 at 30. What is missing beyond that is a part of the model.
"""

REFINE = "refine the grid, or use minimum-distance on the curve or the polygon"


def nearest_on_level_set(model: Model, shape: tuple[int, int], *, bilateral: bool) -> Projection:
    """Return the projection to the nearest point of the zero contour, in contact while the interpolant is negative.

    Islands of the contour, which tips and slits narrower than a cell may leave, are not part of it: how far its surface
    is off the model decides whether that is refused. Its surface is the contour cut into straight edges, eight per
    cell. With `bilateral` the hand is projected from outside too. Raises `RefusalError`.
    """
    return once(model, ("level-set", shape, bilateral), lambda: _build_projection(model, shape, bilateral=bilateral))


def _build_projection(model: Model, shape: tuple[int, int], *, bilateral: bool) -> Projection:
    level_set = model.level_set(shape)
    try:
        c, outline = contour_of(level_set)
    except InputError as error:
        raise RefusalError(
            f"model '{model.name}' cannot be held as a level set of {shape[0]} by {shape[1]} nodes",
            why=f"of its zero contour: {error.what}; {error.why}",
            todo=REFINE,
        ) from error
    standoff = outline.standoff_from(model.curve)
    if standoff > MOST_CELLS_OFF * level_set.cell:
        raise RefusalError(
            f"model '{model.name}' loses a part on a level set of {shape[0]} by {shape[1]} nodes: the contour is "
            f"up to {standoff * 1e3:.3g} mm off the surface, with cells of {level_set.cell * 1e3:.3g} mm",
            why="a tip, slit or neck narrower than a cell has no node inside, or none that is joined to the rest",
            todo=REFINE,
        )
    return Projection(
        on_level_set, outline, bilateral=bilateral, own=(c.x0, c.y0, c.dx, c.dy), pieces=c.arcs,
        lookup=c.values, vertices=c.vertices, tree=c.tree, resolution=level_set.cell, standoff=standoff,
    )  # fmt: skip


@compiled
def on_level_set(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of minimum distance on a level set's contour, of signature `LAW`: (4.2), then the scheme's force.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    c, params, state = contour_in(data), data.params, data.state
    x, y = hip[0], hip[1]
    if as_record(params, GAINS).bilateral == 0.0 and not value_at(c, x, y) < 0.0:
        return release(state, hip, ihip, force)
    normal = as_record(state, PAST).normal
    ihip[0], ihip[1], normal[0], normal[1] = nearest_on_contour(c, x, y)
    return regulate(params, state, hip, velocity, 0.0, 0.0, dt, ihip, force)
