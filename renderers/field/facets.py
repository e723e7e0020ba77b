"""Edges in the plane and triangles in space as rows of one kind, and a grid that tells which of them are near."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import inner
from hapticeval.geometry.triples import Triple, dot, plus, triple_of
from hapticeval.laws import law_data
from hapticeval.records import as_record, numbers_of, record_type
from hapticeval.renderer import CompiledStep, Declaration, Spring
from hapticeval.renderers.law_renderer import LawRenderer
from hapticeval.renderers.projective import once
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.geometry.representations import Facets
    from hapticeval.scene import Scene

FINE = 1e-5
"""Share of the model's size by which facets lie off a smooth surface at the most."""

FACET = record_type("reach", a=3, b=3, c=3, middle=3, normal=3)
"""A facet's row: its corners, m (an edge repeats its second), their middle, how far they lie from it, and the outward
unit normal. In the plane z = 0."""


class OnFacets(LawRenderer):
    """A spring on the facets of a scene's model, by the compiled `law`: its parameters begin with the stiffness."""

    declares = Declaration(spring=Spring.ERROR)

    def __init__(
        self,
        law: Callable[..., Any],
        scene: Scene,
        *,
        own: ArrayLike = (),
        state: int,
        standoff: float = 0.0,
        **tables: ArrayLike,
    ) -> None:
        facets, rows = facets_of(scene)
        data = law_data(np.append(scene.stiffness, own), pieces=rows, state=state, **tables)
        super().__init__(
            CompiledStep(law, data, domain_exits={}), facets.boundary, standoff=standoff + facets.chord_error
        )
        if facets.chord_error > 0.0:  # the facets of a smooth model are not its fault
            self.pieces = facets.boundary
            self.resolution = float(2.0 * rows.view(FACET)["reach"].max())


def facets_of(scene: Scene) -> tuple[Facets, Array]:
    """Return the model's facets, and their rows (c, 16), each a `FACET`, in m."""
    model = scene.model
    facets = once(model, ("facets", FINE), lambda: model.mesh(max_error=FINE * model.size))
    return facets, once(model, ("facet rows", FINE), lambda: _rows(facets))


CELL_GRID = record_type("low_x", "low_y", "low_z", "side", "across", "up", "deep")
"""A grid of cubes: its lowest corner (m), the side of a cube (m), and the cubes along x, y and z."""

LISTED_EACH = 32
"""Cubes in which a facet is listed at the most, on average: where facets are of very different sizes cubes grow."""


class FacetGrid(NamedTuple):
    """Which facets come near a point, by the cube of a grid that it lies in.

    - `grid`: the numbers of a `CELL_GRID`;
    - `cubes` (2, c + 1): the numbers of the cubes that have facets, increasing, and where their lists begin;
    - `facets` (entries, 1): the lists, each increasing.
    """

    grid: Array
    cubes: Array
    facets: Array


def facet_grid(rows: Array, margin: float) -> FacetGrid:
    """Return a grid of which each cube lists the `rows` (n, 16), m, that come within a `margin` (m) of a point in it.

    A cube is as wide as half of the facets with their margins: it lists some ten, however many there are in all.
    """
    facets = rows.view(FACET)[:, 0]
    corners = np.stack([facets["a"], facets["b"], facets["c"]])
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    side = float(np.median((high - low).max(axis=1)))
    start = low.min(axis=0)
    while True:
        first, last = (np.floor((ends - start) / side).astype(np.int64) for ends in (low, high))
        spans = last - first + 1
        counts = spans.prod(axis=1)
        if counts.sum() <= LISTED_EACH * len(rows):
            break
        side *= 1.5
    across, up, deep = (int(count) for count in last.max(axis=0) + 1)
    facet = np.repeat(np.arange(len(rows)), counts)
    # the n-th cube of a facet, by its place along x, y and z
    number = np.arange(len(facet)) - np.repeat(np.cumsum(counts) - counts, counts)
    x = first[facet, 0] + number % spans[facet, 0]
    y = first[facet, 1] + number // spans[facet, 0] % spans[facet, 1]
    z = first[facet, 2] + number // (spans[facet, 0] * spans[facet, 1])
    cubes = x + across * (y + up * z)
    order = np.argsort(cubes, kind="stable")
    numbers, heads = np.unique(cubes[order], return_index=True)
    return FacetGrid(
        numbers_of(
            CELL_GRID, low_x=start[0], low_y=start[1], low_z=start[2], side=side, across=across, up=up, deep=deep
        ),
        np.array([[*numbers, across * up * deep], [*heads, len(facet)]], dtype=np.float64),
        facet[order, np.newaxis].astype(np.float64),
    )


@inner
def cubes_between(grid: Array, p: Triple, q: Triple) -> tuple[int, int, int, int, int, int]:
    """Return the first and the last cube along x, y and z of the box that p (3,) and q (3,), m, span.

    Cubes outside the `grid` are left out.
    """
    cells = as_record(grid, CELL_GRID)
    return (
        max(math.floor((min(p[0], q[0]) - cells.low_x) / cells.side), 0),
        min(math.floor((max(p[0], q[0]) - cells.low_x) / cells.side), int(cells.across) - 1),
        max(math.floor((min(p[1], q[1]) - cells.low_y) / cells.side), 0),
        min(math.floor((max(p[1], q[1]) - cells.low_y) / cells.side), int(cells.up) - 1),
        max(math.floor((min(p[2], q[2]) - cells.low_z) / cells.side), 0),
        min(math.floor((max(p[2], q[2]) - cells.low_z) / cells.side), int(cells.deep) - 1),
    )


@inner
def listed_in(grid: Array, cubes: Array, x: int, y: int, z: int) -> tuple[int, int]:
    """Return from where to where the facets of the cube (x, y, z) of `cubes` (2, n) are listed; (0, 0) where none is.

    The `grid` (k,) has the corner (m) and the side (m) of the cubes.
    """
    cells = as_record(grid, CELL_GRID)
    number = float(x + int(cells.across) * (y + int(cells.up) * z))
    numbers = cubes[0]
    place = np.searchsorted(numbers, number)
    if numbers[place] != number:
        return 0, 0
    return int(cubes[1, place]), int(cubes[1, place + 1])


def _rows(facets: Facets) -> Array:
    cell_corners = facets.vertices[facets.cells]
    corners, plane = np.zeros((len(cell_corners), 3, 3)), cell_corners.shape[1] == 2
    corners[:, : cell_corners.shape[1], : cell_corners.shape[2]] = cell_corners
    if plane:
        corners[:, 2] = corners[:, 1]
    middle = 0.5 * (corners[:, 0] + corners[:, 1]) if plane else corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, np.newaxis], axis=2).max(axis=1)
    along, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(along, [0.0, 0.0, 1.0] if plane else other)  # the inside is on the left of an edge
    normal /= np.linalg.norm(normal, axis=1)[:, np.newaxis]
    return np.column_stack([reach, corners.reshape(-1, 9), middle, normal])


@inner
def _on_edge(a: Triple, b: Triple, p: Triple) -> tuple[float, Triple]:
    """Return the squared distance (m^2) of p from an edge, and the vector (m) from its closest point."""
    ab, ap = plus(b, -1.0, a), plus(p, -1.0, a)
    from_edge = plus(ap, -min(max(dot(ap, ab) / dot(ab, ab), 0.0), 1.0), ab)
    return dot(from_edge, from_edge), from_edge


@inner
def away_from_facet(facets: Array, k: int, p: Triple) -> tuple[float, Triple]:
    """Return the distance (m) of p from facet k of (c, 16), and the unit vector from its closest point.

    On it that is the normal.
    """
    facet = as_record(facets, FACET, k)
    a, b_corner, c_corner = triple_of(facet.a), triple_of(facet.b), triple_of(facet.c)
    ab, ac, ap = plus(b_corner, -1.0, a), plus(c_corner, -1.0, a), plus(p, -1.0, a)
    out = triple_of(facet.normal)
    n = (ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0])
    normal_squared = dot(n, n)  # twice the area, squared, m^4
    # shares of b and c in the foot on the plane, times normal_squared; an edge has none
    b = dot((ap[1] * ac[2] - ap[2] * ac[1], ap[2] * ac[0] - ap[0] * ac[2], ap[0] * ac[1] - ap[1] * ac[0]), n)
    c = dot((ab[1] * ap[2] - ab[2] * ap[1], ab[2] * ap[0] - ab[0] * ap[2], ab[0] * ap[1] - ab[1] * ap[0]), n)
    # the foot on the plane is inside of the triangle
    if normal_squared > 0.0 and b >= 0.0 and c >= 0.0 and b + c <= normal_squared:
        height = dot(ap, out)
        side = 1.0 if height >= 0.0 else -1.0
        return abs(height), (side * out[0], side * out[1], side * out[2])
    nearest_squared, from_edge = _on_edge(a, b_corner, p)
    if normal_squared > 0.0:
        for first, second in ((b_corner, c_corner), (c_corner, a)):
            distance_squared, other = _on_edge(first, second, p)
            if distance_squared < nearest_squared:
                nearest_squared, from_edge = distance_squared, other
    distance = math.sqrt(nearest_squared)
    if distance == 0.0:
        return 0.0, out
    return distance, (from_edge[0] / distance, from_edge[1] / distance, from_edge[2] / distance)
