"""All that a suite's `trajectory` table may be. A further kind is a class in a file of its own, and a name here."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

from hapticeval.documents import convert
from hapticeval.geometry.boundary import Boundary
from hapticeval.stimulus.hard_places import HardPlaces
from hapticeval.stimulus.moves import Moves
from hapticeval.stimulus.paths import Arc, FromFile, Loop, PastCorner, Points, Scaled
from hapticeval.stimulus.stimulus import Path

AnyTrajectory = Scaled | Arc | PastCorner | Points | Loop | FromFile | HardPlaces | Moves


def build_path(spec: Mapping[str, Any], surface: Boundary, folder: FilePath) -> Path:
    """Return the path of a `trajectory` table as a suite has it; see `Trajectory.path`."""
    return convert(spec, AnyTrajectory, "trajectory").path(surface, folder)
