"""Models in the plane: those of the catalogue, and polygons made in four ways."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry import catalogue
from hapticeval.geometry.model import Model
from hapticeval.strategies.numbers import share, signed, sizes
from hapticeval.types import Array


def plane_models(*, kinds: Sequence[str] | None = None) -> st.SearchStrategy[Model]:
    """Draw models in the plane of the `kinds` of `PLANE_MODELS`, all if none are given; 5 to 40 cm, about the origin.

    Raises `UnknownNameError` for an unknown kind, and `InputError` for none.
    """
    return of_kinds(PLANE_MODELS, kinds)


def of_kinds(
    known: Mapping[str, Callable[[], st.SearchStrategy[Model]]], kinds: Sequence[str] | None
) -> st.SearchStrategy[Model]:
    """Draw a model of one of the `kinds` that are `known`, of any where none are given."""
    chosen = tuple(known if kinds is None else kinds)
    if isinstance(kinds, str) or not chosen:
        raise InputError(f"kinds = {kinds!r}", why="it is a list of one kind or more")
    for kind in chosen:
        if kind not in known:
            raise UnknownNameError("kind of drawn model", str(kind), known)
    return st.one_of([known[kind]() for kind in chosen])


def _polygon(points: Array) -> Model:
    """Return the polygon of points (n, 2), m, to the micrometre; hypothesis drops an outline that crosses itself."""
    try:
        return catalogue.from_vertices(np.round(points, 6).tolist())
    except InputError:
        assume(False)
        raise


@st.composite
def _angles_and_radii(draw: st.DrawFn) -> tuple[Array, Array]:
    """Draw angles (n,), rad, once round, and a radius at each, as a share of the largest."""
    count = draw(st.integers(3, 14))
    steps = np.array([1.0 + draw(share()) for _ in range(count)])
    radii = np.array([0.2 + 0.8 * draw(share()) for _ in range(count)])
    # Gaps of 1 to 2 parts each, which add up to a turn.
    return np.cumsum(steps) * (2.0 * math.pi / steps.sum()), radii


def _polar_points(angle: Array, radius: Array) -> Array:
    """Return the points (n, 2) at angles (n,), rad, and radii (n,)."""
    return np.asarray(radius[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)]))


@st.composite
def star_shaped(draw: st.DrawFn) -> Model:
    """Draw a polygon that is star-shaped about the origin: arms, notches and slivers."""
    angles, radii = draw(_angles_and_radii())
    return _polygon(0.5 * draw(sizes()) * _polar_points(angles, radii))


@st.composite
def _spline(draw: st.DrawFn) -> Model:
    """Draw a closed cubic spline as 96 edges: facets of a smooth outline."""
    from scipy.interpolate import CubicSpline

    angles, radii = draw(_angles_and_radii())
    # The first knot again a turn later, as a periodic spline needs it.
    knots = np.concatenate([angles - angles[0], [2.0 * math.pi]])
    # Between the knots a spline swings past them: half of the radius of a circle keeps it from the origin.
    spline = CubicSpline(knots, np.append(0.5 + 0.5 * radii, 0.5 + 0.5 * radii[0]), bc_type="periodic")
    turn = np.linspace(0.0, 2.0 * math.pi, 96, endpoint=False)
    radius = np.asarray(spline(turn))
    assume(radius.min() > 0.1)
    return _polygon(0.5 * draw(sizes()) * _polar_points(turn, radius))


@st.composite
def patchwork(draw: st.DrawFn) -> Model:
    """Draw a polygon of adjoining squares in a sheared lattice: arms, hooks and rings with a gap."""
    import shapely

    cells = [(0, 0)]
    for _ in range(draw(st.integers(1, 9))):
        x, y = cells[-1] if draw(st.booleans()) else cells[draw(st.integers(0, len(cells) - 1))]
        dx, dy = draw(st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1)]))
        cells.append((x + dx, y + dy))
    # Overlapping a little, so that squares that meet at a corner make no outline that touches itself.
    squares = [shapely.box(x - 0.55, y - 0.55, x + 0.55, y + 0.55) for x, y in cells]
    points = _outline(shapely.union_all(squares))
    # Sheared along both axes by up to 0.6.
    shear = np.array([[1.0, 0.6 * draw(signed())], [0.6 * draw(signed()), 1.0]])
    return _polygon(_scaled(points @ shear.T, draw(sizes())))


@st.composite
def _union(draw: st.DrawFn) -> Model:
    """Draw a union of discs, bars and wedges, each placed on the outline of those before."""
    import shapely
    from shapely.affinity import rotate

    shape: Any = shapely.Point(0.0, 0.0).buffer(1.0, quad_segs=8)
    for _ in range(draw(st.integers(1, 3))):
        # Each part is placed on the outline so far, so that the union stays in one piece.
        outline_point = shape.exterior.interpolate(draw(share()), normalized=True)
        x, y, size = outline_point.x, outline_point.y, 0.2 + 0.8 * draw(share())
        kind, turn = draw(st.sampled_from(["disc", "bar", "wedge"])), 360.0 * draw(share())
        part: Any = outline_point.buffer(size, quad_segs=6)
        if kind == "bar":
            part = shapely.box(x - 1.5 * size, y - 0.2, x + 1.5 * size, y + 0.2)
        elif kind == "wedge":
            part = shapely.Polygon([(x - size, y - 0.3 * size), (x + size, y), (x - size, y + 0.3 * size)])
        shape = shape.union(rotate(part, turn, origin=(x, y)))
        assume(isinstance(shape, shapely.Polygon))
    return _polygon(_scaled(_outline(shape.simplify(1e-4)), draw(sizes())))


def _outline(shape: Any) -> Array:
    """Return the outer ring (n, 2), m, of a shapely polygon, anticlockwise; its first point is not repeated."""
    import shapely

    assume(isinstance(shape, shapely.Polygon))
    return shapely.get_coordinates(shapely.geometry.polygon.orient(shape).exterior)[:-1]


def _scaled(points: Array, size: float) -> Array:
    """Return points (n, 2) about the origin, moved and scaled so that their largest extent is `size` m."""
    low, high = points.min(axis=0), points.max(axis=0)
    # x = (p - (low + high) / 2) size / max(high - low)
    return np.asarray((points - 0.5 * (low + high)) * (size / float(np.max(high - low))))


def named(kind: str, **numbers: st.SearchStrategy[Any]) -> Callable[[], st.SearchStrategy[Model]]:
    """Return the function that makes a strategy for models of a kind, from strategies for its parameters."""
    return lambda: st.builds(lambda **values: catalogue.make_model(kind, **values), **numbers)


PLANE_MODELS: dict[str, Callable[[], st.SearchStrategy[Model]]] = {
    "circle": named("circle", size=sizes()),
    "ellipse": named("ellipse", ratio=st.sampled_from([2.0, 1.2, 5.0, 20.0]), size=sizes()),
    "star": named("star", points=st.integers(5, 9), tip_angle=st.sampled_from([60.0, 20.0, 5.0, 90.0]), size=sizes()),
    "cassinian": named("cassinian", lobes=st.integers(2, 7), a_n=st.sampled_from([2.0, 1.1, 1.5, 4.0]), size=sizes()),
    "dumbbell": named("dumbbell", neck=st.sampled_from([0.5, 0.3, 0.1, 0.8]), size=sizes()),
    "star-shaped": star_shaped,
    "spline": _spline,
    "patchwork": patchwork,
    "union": _union,
}
"""Kinds of models that are drawn: those of the catalogue, and polygons made in four ways."""
