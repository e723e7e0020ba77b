"""Which corner a recording runs over, and from which face to which."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.geometry.boundary import Boundary, Corner
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array, BoolArray


@dataclass(frozen=True)
class Crossing:
    """A corner with its faces in the order of travel.

    `normal_pre`, `normal_post` (2,): outward unit normals; `ahead` (2,): unit direction of travel along the first
    face; `turn` rad, unsigned. The recording is near the corner from tick `first` up to, not including, `end`, and no
    other corner is.
    """

    corner: Corner
    normal_pre: Array
    normal_post: Array
    ahead: Array
    turn: float
    first: int
    end: int


def find_crossing(recording: Recording, boundary: Boundary, strong: BoolArray, *, convex: bool) -> Crossing | None:
    """The corner of the wanted kind that the HIP comes closest to, and its stay there; None if there is none.

    Near means nearer than half of the way to the next corner. The face that the tool comes from is the one whose
    normal the first force above the floor has in that stay; None also if there is no force.
    """
    wanted = [corner for corner in boundary.corners if corner.convex == convex]
    if not wanted or not strong.any():
        return None
    corner = min(wanted, key=lambda c: float(np.min(np.linalg.norm(recording.hip - c.position, axis=1))))
    distance = np.linalg.norm(recording.hip - corner.position, axis=1)
    near = distance <= 0.5 * _to_next(boundary, corner)
    closest = int(np.argmin(distance))
    near[closest] = True
    away = np.flatnonzero(~near)
    before, after = away[away < closest], away[away > closest]
    start = int(before[-1]) + 1 if before.size else 0
    end = int(after[0]) if after.size else len(recording)
    pressed = np.flatnonzero(strong[start:end])
    if pressed.size == 0:
        return None
    first = start + int(pressed[0])
    force = recording.force[first : first + 1]
    turn = abs(corner.turn)
    if angle_between(force, corner.normal_pre)[0] <= angle_between(force, corner.normal_post)[0]:
        return Crossing(corner, corner.normal_pre, corner.normal_post, corner.tangent_pre, turn, first, end)
    return Crossing(corner, corner.normal_post, corner.normal_pre, -corner.tangent_post, turn, first, end)


def _to_next(boundary: Boundary, corner: Corner) -> float:
    """Arc length from a corner to the nearest other one, m; once round where it is the only one."""
    gaps = [abs(other.s - corner.s) for other in boundary.corners if other is not corner]
    return min((min(gap, boundary.girth - gap) for gap in gaps), default=boundary.girth)


def angle_between(vectors: Array, direction: Array) -> Array:
    """Unsigned angle of each of `vectors` (n, 2) to `direction` (2,), rad; zero vectors give zero."""
    cross = vectors[:, 0] * direction[1] - vectors[:, 1] * direction[0]
    return np.asarray(np.abs(np.arctan2(cross, vectors @ direction)))
