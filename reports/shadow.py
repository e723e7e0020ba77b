"""What is drawn of a run in space: its shadow on the plane of the two axes along which the hand moves most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array

if TYPE_CHECKING:
    from shapely import Geometry

POINTS = 4000


def shown_axes(hips: Array) -> tuple[int, int]:
    """The two coordinates of (n, N) in which the HIP moves most, in order."""
    if hips.shape[1] == 2:
        return 0, 1
    first, second = sorted(np.argsort(np.ptp(hips, axis=0))[-2:].tolist())
    return int(first), int(second)


def axis_labels(shown: tuple[int, int], dimension: int) -> tuple[str, str]:
    """What stands along the two axes of a picture, and from where a run in space is seen."""
    first, second = ("₁₂₃"[axis] for axis in shown)
    along = f", seen along y{'₁₂₃'[3 - sum(shown)]}" if dimension == 3 else ""
    return f"y{first} (mm){along}", f"y{second} (mm)"


def shadow(recording: Recording, axes: tuple[int, int]) -> Recording:
    """HIP, IHIP and force in these two coordinates only."""
    columns = list(axes)
    channels = {name: getattr(recording, name)[:, columns] for name in ("hip", "ihip", "force")}
    return Recording(recording.time, channels, recording.meta)


def shadow_of(model: Model, axes: tuple[int, int], scale: float) -> Geometry:
    """The outline that a model in space casts: all of ours are round enough for the hull of their points."""
    import shapely

    hull: Geometry = shapely.MultiPoint(scale * model.boundary.points(POINTS)[:, list(axes)]).convex_hull
    return hull
