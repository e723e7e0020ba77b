"""Closed triangle meshes: the solids of the catalogue, drawn polygons extruded, and convex hulls of points."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry import catalogue
from hapticeval.geometry.model import Model
from hapticeval.strategies.numbers import signed, sizes
from hapticeval.strategies.plane import named, of_kinds, patchwork, star_shaped


def meshes(*, kinds: Sequence[str] | None = None) -> st.SearchStrategy[Model]:
    """Draw closed triangle meshes of the `kinds` of `MESHES`, all if none are given; 5 to 40 cm, about the origin.

    Raises `UnknownNameError` for an unknown kind, and `InputError` for none.
    """
    return of_kinds(MESHES, kinds)


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


MESHES: dict[str, Callable[[], st.SearchStrategy[Model]]] = {
    "cube": named("cube", size=sizes()),
    "box": named("box", x=sizes(), y=sizes(), z=st.sampled_from([0.05, 0.2, 0.01, 0.001])),
    "wedge": named("wedge", angle=st.sampled_from([60.0, 20.0, 5.0, 120.0]), size=sizes(), length=sizes()),
    "l-block": named("l-block", size=sizes(), thickness=st.sampled_from([0.02, 0.04, 0.005]), length=sizes()),
    "icosphere": named("icosphere", subdivisions=st.integers(0, 3), size=sizes()),
    "cylinder": named("cylinder", size=sizes(), length=sizes(), sides=st.sampled_from([3, 6, 12, 64])),
    "prism": _prism,
    "hull": _hull,
}
"""Kinds of meshes that are drawn: the solids of the catalogue, drawn polygons extruded, and convex hulls of points."""
