"""Models of the catalogue and random ones, how their bodies move, and scenes on them: gains, a mass, effects.

In the plane there are polygons made in four ways. In space there are meshes (solids of the catalogue, extruded
polygons, hulls, nuts, pebbles) and smooth surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from hapticeval.effects.catalogue import EFFECTS, make_effect
from hapticeval.effects.effect import Effect
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry import catalogue
from hapticeval.geometry.model import Model
from hapticeval.geometry.solids import icosphere
from hapticeval.scene import Scene
from hapticeval.stimulus.motions import AnyMotion, Slide, Spin
from hapticeval.strategies.place import check_model
from hapticeval.strategies.seeded import rounded, share, signed, sizes
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


def meshes(*, kinds: Sequence[str] | None = None) -> st.SearchStrategy[Model]:
    """Draw closed triangle meshes of the `kinds` of `MESHES`, all if none are given; 5 to 40 cm, about the origin.

    Raises `UnknownNameError` for an unknown kind, and `InputError` for none.
    """
    return of_kinds(MESHES, kinds)


def surfaces(*, kinds: Sequence[str] | None = None) -> st.SearchStrategy[Model]:
    """Draw smooth surfaces in space of the `kinds` of `SURFACES`, all if none are given; 5 to 40 cm, about the origin.

    Raises `UnknownNameError` for an unknown kind, and `InputError` for none.
    """
    return of_kinds(SURFACES, kinds)


@st.composite
def _prism(draw: st.DrawFn) -> Model:
    """Draw an extruded polygon: arms, notches and slivers with flat ends."""
    outline = draw(st.one_of(star_shaped(), patchwork()))
    return catalogue.make_model("extruded", model=outline.table, length=draw(sizes()))


@st.composite
def _hull(draw: st.DrawFn) -> Model:
    """Draw the convex hull of 5 to 20 points: faces, edges and corners of every angle."""
    from scipy.spatial import ConvexHull, QhullError

    count = draw(st.integers(5, 20))
    points = 0.5 * draw(sizes()) * np.array([[draw(signed()) for _ in range(3)] for _ in range(count)])
    points = np.round(points, 6)
    try:
        hull = ConvexHull(points)
    except QhullError:
        assume(False)
        raise
    corners = points[np.sort(hull.vertices)]
    # Triangles by the row of their corner among those of the hull alone.
    rows = np.searchsorted(np.sort(hull.vertices), hull.simplices)
    # det [a b c] < 0 about the middle: seen from outside a, b, c run clockwise, and are turned round.
    inward = np.linalg.det(corners[rows] - corners.mean(axis=0)) < 0.0
    rows[inward] = rows[inward][:, ::-1]
    assume(np.ptp(corners, axis=0).max() >= 0.01)
    try:
        return catalogue.mesh(corners.tolist(), rows.tolist())
    except InputError:  # points in one plane
        assume(False)
        raise


@st.composite
def _nut(draw: st.DrawFn) -> Model:
    """Draw a nut of 3 to 8 flats: convex rims, and a hole with concave edges inside."""
    sides, radius, half = draw(st.integers(3, 8)), 0.5 * draw(sizes()), 0.5 * draw(sizes())
    # The hole's corners lie over those of the flats.
    bore = radius * (0.2 + 0.7 * draw(share()))
    angles = np.arange(sides) * (2.0 * math.pi / sides)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])
    # Four rings of corners, one after the other round the nut's section: outside up, inside down.
    rings = ((radius, -half), (radius, half), (bore, half), (bore, -half))
    corners = np.concatenate([r * circle + [0.0, 0.0, z] for r, z in rings])
    number, next_on_ring = (
        np.arange(4 * sides),
        (np.arange(4 * sides) + 1) % sides + np.arange(4 * sides) // sides * sides,
    )
    # A quadrilateral between two rings is two triangles.
    above, next_above = (number + sides) % (4 * sides), (next_on_ring + sides) % (4 * sides)
    rows = np.concatenate(
        [np.column_stack([number, next_on_ring, next_above]), np.column_stack([number, next_above, above])]
    )
    return catalogue.mesh(np.round(corners, 6).tolist(), rows.tolist())


@st.composite
def _pebble(draw: st.DrawFn) -> Model:
    """Draw a pebble: an ellipsoid of many triangles, dented twice or more round its longest axis."""
    points, rows = icosphere(draw(st.integers(1, 3)), 0.5 * draw(sizes()))
    waves, depth = draw(st.integers(2, 5)), 0.2 * draw(share())
    # From 0.8 to 1.2 of the radius where the dents are deepest; a dent of the half circle ends at both tips.
    swell = 1.0 + depth * np.cos(waves * np.arctan2(points[:, 1], points[:, 2]))
    axes = np.array([1.0, 0.5 + 0.5 * draw(share()), 0.3 + 0.5 * draw(share())])
    axes = axes * np.column_stack([np.ones_like(swell), swell, swell])
    return catalogue.mesh(np.round(points * axes, 6).tolist(), rows.tolist())


MESHES: dict[str, Callable[[], st.SearchStrategy[Model]]] = {
    "cube": named("cube", size=sizes()),
    "box": named("box", x=sizes(), y=sizes(), z=st.sampled_from([0.05, 0.2, 0.01, 0.001])),
    "wedge": named("wedge", angle=st.sampled_from([60.0, 20.0, 5.0, 120.0]), size=sizes(), length=sizes()),
    "l-block": named("l-block", size=sizes(), thickness=st.sampled_from([0.02, 0.04, 0.005]), length=sizes()),
    "icosphere": named("icosphere", subdivisions=st.integers(0, 3), size=sizes()),
    "cylinder": named("cylinder", size=sizes(), length=sizes(), sides=st.sampled_from([3, 6, 12, 64])),
    "prism": _prism,
    "hull": _hull,
    "nut": _nut,
    "pebble": _pebble,
}
"""Kinds of meshes that are drawn: solids of the catalogue, extruded polygons, convex hulls of points, nuts, pebbles."""

SURFACES: dict[str, Callable[[], st.SearchStrategy[Model]]] = {
    "sphere": named("sphere", size=sizes()),
    "ellipsoid": named(
        "ellipsoid",
        a=st.sampled_from([0.1, 0.05, 0.2]),
        b=st.sampled_from([0.07, 0.03, 0.1]),
        c=st.sampled_from([0.05, 0.02, 0.1]),
    ),
    "torus": named("torus", major=st.sampled_from([0.07, 0.1, 0.15]), minor=st.sampled_from([0.03, 0.01, 0.06])),
}
"""Kinds of smooth surfaces that are drawn, those of the catalogue."""


def scenes(
    models: st.SearchStrategy[Model] | None = None,
    *,
    bilateral: bool | None = None,
    called: st.SearchStrategy[tuple[Effect, ...]] | None = None,
) -> st.SearchStrategy[Scene]:
    """Draw scenes on `models` (those of `plane_models` if none are given), with the effects that are `called` for.

    Stiffness is 50 to 4000 N/m, damping (N s/m) from none to critical, and the tool's mass 50 g to 1 kg. Where
    `bilateral` is None, some surfaces hold the tool from both sides and some do not.
    """
    for what, strategy in (("models", models), ("called", called)):
        if strategy is not None and not isinstance(strategy, st.SearchStrategy):
            raise InputError(
                f"{what} = {strategy!r}", why="it is not a strategy", todo="use hypothesis.strategies.just(...)"
            )
    return _scenes(plane_models() if models is None else models, bilateral, st.just(()) if called is None else called)


@st.composite
def _scenes(
    draw: st.DrawFn,
    models: st.SearchStrategy[Model],
    bilateral: bool | None,
    called: st.SearchStrategy[tuple[Effect, ...]],
) -> Scene:
    stiffness = draw(st.sampled_from([1000.0, 50.0, 200.0, 4000.0]))
    mass = draw(st.sampled_from([0.1, 0.05, 0.3, 1.0]))
    ratio = draw(st.sampled_from([0.0, 0.3, 1.0]))
    return Scene(
        model=draw(models),
        stiffness=stiffness,
        # b = 2 zeta sqrt(k m), N s/m, with the damping ratio zeta from 0 to 1, the critical one
        damping=round(2.0 * ratio * math.sqrt(stiffness * mass), 3),
        mass=mass,
        bilateral=draw(st.booleans()) if bilateral is None else bilateral,
        effects=draw(called),
    )


def effects(kind: str, **numbers: st.SearchStrategy[Any]) -> st.SearchStrategy[Effect]:
    """Draw an effect of the catalogue: its `kind`, and a strategy for each of its numbers that it is to have.

    `st.tuples(effects("viscosity", coefficient=st.sampled_from([0.1, 1.0])))` is what `scenes(called=...)` takes.
    Raises `UnknownNameError` for an unknown kind; what the numbers may be is checked when they are drawn.
    """
    if kind not in EFFECTS:
        raise UnknownNameError("effect", kind, EFFECTS)
    return st.fixed_dictionaries({"kind": st.just(kind), **numbers}).map(make_effect)


FASTEST_SLIDE = 2.0
"""m/s, *chosen*: a body that comes onto a hand faster is thrown, not moved."""

FASTEST_SPIN = 2.0
"""Turns a second, *chosen*: twice what demonstrations turn at."""

AXES = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (1.0, 2.0, 3.0))
"""Directions that a body in space spins about: two of the axes, and one that no symmetry of a model shares."""


def motions(model: Model) -> st.SearchStrategy[AnyMotion]:
    """Draw motions of a `model`'s body: it slides at up to 2 m/s, or spins at up to 2 turns a second about some point.

    The path is given in the frame of the body. The simplest one rests. Raises `InputError` for what is not a model.
    """
    check_model(model)
    return _motions(model.dimension, model.size)


@st.composite
def _motions(draw: st.DrawFn, dimension: int, size: float) -> AnyMotion:
    if draw(st.booleans()):
        centre = tuple(rounded(size * draw(signed()), size) for _ in range(dimension))
        axis = draw(st.sampled_from(AXES)) if dimension == 3 else None
        return Spin(rate=round(FASTEST_SPIN * draw(signed()), 3), centre=centre, axis=axis)
    # each component no more than its share of the fastest
    largest = FASTEST_SLIDE / dimension**0.5
    return Slide(velocity=tuple(round(largest * draw(signed()), 3) for _ in range(dimension)))
