"""HIPs at which geometry is hard: on vertices and edges, an ulp beside the surface, where two feet are as near."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.mesh import Mesh
from hapticeval.stimulus.paths import Positive, Trajectory
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array

Kind = Literal["vertices", "surface", "centre", "medial", "focal", "far", "tiny-steps", "teleports"]

PLACES_PER_KIND = 12
"""Places of a kind, spread over the boundary."""


class HardPlaces(Trajectory, frozen=True, kw_only=True, tag="hard-places"):
    """HIPs in ticks of `tick` (s): at the places named in `of`, `rest` ticks each, and in free space between most.

    - `vertices`: on the corners of a plane model or a mesh, else on boundary points, and one rounding inside;
    - `surface`: on boundary points, and one rounding in and out;
    - `centre`: the middle of the bounds;
    - `medial`: where two boundary points are as near;
    - `focal`: centres of curvature;
    - `far`: ten model sizes away and back inside;
    - `tiny-steps`: 1e-15 m each, from a point inside;
    - `teleports`: to and fro across the model.
    """

    of: Annotated[list[Kind], Meta(min_length=1)]
    tick: Positive = 1e-3
    rest: Annotated[int, Meta(ge=1)] = 2

    def path(self, surface: Boundary, folder: FilePath) -> Path:  # noqa: ARG002 - as every trajectory
        """Return the path: it has a time a tick, at which playback takes the places as they are."""
        # `rest` ticks at each stop, so that a tool may come to rest there
        points = np.vstack([np.repeat(_stops_of_kind(surface, kind), self.rest, axis=0) for kind in self.of])
        return Path(self.tick * np.arange(len(points), dtype=np.float64), points)


WITHOUT_RETREAT = ("far", "tiny-steps", "teleports")
"""Kinds whose places are gone to one after the other; to the others the hand comes from free space, and leaves."""


def _stops_of_kind(surface: Boundary, kind: Kind) -> Array:
    """Return where the hand goes (n, N), m: to each place along the normal of its foot, and round the model between.

    So a tool that was caught at one place is free again at the next, where rounding decided how it fared.
    """
    places = PLACES_OF_KIND[kind](surface)
    lows, highs = np.array(surface.bounds).reshape(2, -1)
    # two extents from the centre: clear of the model in every direction
    centre, radius = 0.5 * (lows + highs), 2.0 * float(np.max(highs - lows))
    frame = surface.closest_point(places)
    # in free space beside the place: half an extent along the normal of its foot
    outs = frame.foot + 0.25 * radius * frame.normal
    if kind in WITHOUT_RETREAT:
        return np.vstack([outs[:1], places, outs[-1:]])
    turns = _unit(outs - centre)
    stops: list[Array] = []
    for k, place in enumerate(places):
        turn = turns[k]
        for share in np.linspace(0.25, 1.0, 4):  # steps of at most 45 degrees, which keep clear of the model
            before = turns[k - 1] if k else turn
            # nearly opposite directions have no middle: any direction aside will do
            middle = before + turn if before @ turn > -0.9 else np.roll(before, 1) * np.resize([1.0, -1.0], lows.size)
            # half way to the middle direction, then on to the next place's
            first, last, part = (before, middle, 2.0 * share) if share <= 0.5 else (middle, turn, 2.0 * share - 1.0)
            stops.append(centre + radius * _unit((1.0 - part) * _unit(first) + part * _unit(last)))
        stops += [outs[k], place, outs[k], centre + radius * turn]
    return np.array(stops)


def _unit(vectors: Array) -> Array:
    """Return vectors (..., N) of length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _boundary_points(surface: Boundary) -> tuple[Array, Array, Array]:
    """Return boundary points (n, N), outward normals there, and the largest curvature (n,), 1/m."""
    points = surface.points(PLACES_PER_KIND + 1)[:PLACES_PER_KIND]
    frame = surface.closest_point(points)
    return frame.foot, frame.normal, np.asarray(np.linalg.eigvalsh(frame.shape)[:, -1], dtype=np.float64)


def _vertices(surface: Boundary) -> Array:
    """Return corners, and points one rounding inside of them (2 n, N), m."""
    corners = np.array([corner.position for corner in surface.corners]) if surface.dimension == 2 else None
    if corners is None and isinstance(surface, Mesh):
        corners = surface.vertices
    vertices = (
        # every so many of many corners: PLACES_PER_KIND of them, or up to twice that
        _boundary_points(surface)[0]
        if corners is None or not corners.size
        else corners[:: max(1, len(corners) // PLACES_PER_KIND)]
    )
    middle = np.array(surface.bounds).reshape(2, -1).mean(axis=0)
    # and one rounding inside: towards the middle of the bounds
    return np.vstack([vertices, np.nextafter(vertices, middle)])


def _surface(surface: Boundary) -> Array:
    """Return boundary points, and those one rounding inside and outside of them (3 n, N), m."""
    feet, normals, _ = _boundary_points(surface)
    # a rounding in, on the surface, and a rounding out
    return np.vstack([np.nextafter(feet, feet - normals), feet, np.nextafter(feet, feet + normals)])


def _centre(surface: Boundary) -> Array:
    """Return the middle of the bounds (1, N), m."""
    return np.asarray(np.array(surface.bounds).reshape(2, -1).mean(axis=0, keepdims=True))


def _medial(surface: Boundary) -> Array:
    """Return the inner ends (n, N), m, of the normals along which the foot is the nearest point, by bisection."""
    feet, normals, _ = _boundary_points(surface)
    size = float(np.ptp(np.array(surface.bounds).reshape(2, -1), axis=0).max())
    low, high = np.zeros(len(feet)), np.full(len(feet), size)
    for _ in range(60):
        middle = 0.5 * (low + high)
        foot_error = np.linalg.norm(surface.closest_point(feet - middle[:, np.newaxis] * normals).foot - feet, axis=1)
        # is the foot still where the normal began, to the rounding of a foot?
        nearest = foot_error <= 1e-7 * size
        low, high = np.where(nearest, middle, low), np.where(nearest, high, middle)
    return np.asarray(feet - low[:, np.newaxis] * normals)


def _focal(surface: Boundary) -> Array:
    """Return the centres of curvature (n, N), m, of convex boundary points."""
    feet, normals, curvature = _boundary_points(surface)
    bent = curvature > 0.0
    # no convex part has a centre of curvature inside
    if not bent.any():
        return _medial(surface)
    return np.asarray(feet[bent] - normals[bent] / curvature[bent][:, np.newaxis])


def _far_away(surface: Boundary) -> Array:
    """Return a place inside, one ten model sizes away, and the first again (3, N), m."""
    lows, highs = np.array(surface.bounds).reshape(2, -1)
    # in, ten sizes out along the diagonal of the bounds, and in again
    return np.vstack(
        [_half_way_to_medial(surface)[:1], highs + 10.0 * (highs - lows), _half_way_to_medial(surface)[:1]]
    )


def _tiny_steps(surface: Boundary) -> Array:
    """Return places (n, N), m, one 1e-15 m from the next, from one inside."""
    return np.asarray(_half_way_to_medial(surface)[:1] + 1e-15 * np.arange(PLACES_PER_KIND)[:, np.newaxis])


def _teleports(surface: Boundary) -> Array:
    """Return places inside (n, N), m, in an order that leads to and fro across the model."""
    inside = _half_way_to_medial(surface)
    # an order in which neighbours are far apart
    return np.asarray(inside[np.argsort(np.arange(len(inside)) * 5 % len(inside))])


def _half_way_to_medial(surface: Boundary) -> Array:
    """Return places inside (n, N), m: half way from boundary points to the medial axis."""
    return np.asarray(0.5 * (_boundary_points(surface)[0] + _medial(surface)))


PLACES_OF_KIND: Mapping[str, Callable[[Boundary], Array]] = {
    "vertices": _vertices,
    "surface": _surface,
    "centre": _centre,
    "medial": _medial,
    "focal": _focal,
    "far": _far_away,
    "tiny-steps": _tiny_steps,
    "teleports": _teleports,
}
"""What gives the places (n, N), m, of each kind."""
