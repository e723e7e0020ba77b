"""Which corner a recording runs over, and from which face to which."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.geometry.curve import Corner
from hapticeval.phenomena.normal_cone import angle_between
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array, BoolArray


@dataclass(frozen=True)
class Crossing:
    """A corner with its faces in the order of travel.

    `normal_pre`, `normal_post` (2,): outward unit normals; `ahead` (2,): unit direction of travel along the first
    face; `turn` rad, unsigned.
    """

    corner: Corner
    normal_pre: Array
    normal_post: Array
    ahead: Array
    turn: float


def find_crossing(
    recording: Recording, corners: tuple[Corner, ...], strong: BoolArray, *, convex: bool
) -> Crossing | None:
    """The corner of the wanted kind that the HIP comes closest to while it is pressed on a face.

    The face that it comes from is the one whose normal the first force above the floor has; None if there is no
    such corner or no force.
    """
    wanted = [corner for corner in corners if corner.convex == convex]
    first = np.flatnonzero(strong)
    if not wanted or first.size == 0:
        return None
    corner = min(wanted, key=lambda c: float(np.min(np.linalg.norm(recording.hip - c.position, axis=1))))
    force = recording.force[first[:1]]
    turn = abs(corner.turn)
    if angle_between(force, corner.normal_pre)[0] <= angle_between(force, corner.normal_post)[0]:
        return Crossing(corner, corner.normal_pre, corner.normal_post, corner.tangent_pre, turn)
    return Crossing(corner, corner.normal_post, corner.normal_pre, -corner.tangent_post, turn)
