"""Models in space: meshes (solids of the catalogue, extruded polygons, hulls, nuts, pebbles) and smooth surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry import catalogue
from hapticeval.geometry.model import Model
from hapticeval.geometry.solids import icosphere
from hapticeval.strategies.numbers import share, signed, sizes
from hapticeval.strategies.plane import named, of_kinds, patchwork, star_shaped


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
