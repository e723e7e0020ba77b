"""Where on a model something happens, in classes: what a corner breaks is another fault than what a face does."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.observed import Observed


class Region(StrEnum):
    """A class of places of the hand."""

    FREE = "free space"
    CONVEX = "convex corner"
    CONCAVE = "concave corner"
    MEDIAL = "medial axis"
    """Where the model's own nearest point jumps."""
    SURFACE = "surface"


def region_of(recording: Observed, tick: int) -> Region:
    """Return where the HIP is at a tick, by the model alone, whatever the renderer answers.

    As near as a contact point can be placed at all, three HIP steps and the standoff, counts as there; corners are
    those of a model in the plane. The nearest point jumps where it moves farther than that since the tick before.
    """
    boundary = recording.boundary
    # Nothing finer can be placed on the surface than a lag's way and the standoff.
    near = LAG_TICKS * recording.hip_step + recording.believed_standoff
    frame = boundary.closest_point(recording.hip[max(tick - 1, 0) : tick + 1])
    if frame.distance[-1] > near:
        return Region.FREE
    # The model's own nearest point jumps, be it from notch to notch: what a renderer does here is about two branches.
    if np.linalg.norm(frame.foot[-1] - frame.foot[0]) > near:
        return Region.MEDIAL
    for corner in boundary.corners:
        if np.linalg.norm(frame.foot[-1] - corner.position) <= near:
            return Region.CONVEX if corner.convex else Region.CONCAVE
    return Region.SURFACE


def nearest_jump(recording: Observed, tick: int) -> float:
    """Return how far the nearest point of the surface as it is rendered moves from the tick before to `tick`, m."""
    points = recording.nearest_as_rendered(slice(max(tick - 1, 0), tick + 1))
    return float(np.linalg.norm(points[-1] - points[0]))
