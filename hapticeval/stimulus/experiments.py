"""Experiments as suite files write them: where the tool starts, and who pushes it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, Struct

from hapticeval.documents import convert
from hapticeval.errors import InputError
from hapticeval.files import file_below
from hapticeval.geometry.boundary import Boundary
from hapticeval.stimulus.hard_places import HardPlaces
from hapticeval.stimulus.moves import Moves
from hapticeval.stimulus.paths import (
    Arc,
    FromFile,
    Loop,
    PastCorner,
    Point,
    Points,
    Positive,
    Scaled,
    as_array,
    read_path,
    read_rows,
)
from hapticeval.stimulus.stimulus import Experiment, Hand, Path
from hapticeval.types import Array


class HandPath(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A hand's path: `points` (m) at even times over `duration` (s), or a `file` that `read_path` reads."""

    points: Annotated[list[Point], Meta(min_length=2)] | None = None
    duration: Positive | None = None
    file: str | None = None

    def __post_init__(self) -> None:
        absent = (self.points is None, self.duration is None, self.file is None)
        # points and a duration, or a file and neither of them
        if absent not in ((False, False, True), (True, True, False)):
            raise ValueError("a hand's path has points and a duration, or a file")

    def path(self, folder: FilePath) -> Path:
        """Return the path; a file counts from `folder`."""
        if self.file is not None:
            return read_path(file_below(folder, self.file))
        # see __post_init__: there is no file, so there are both
        assert self.points is not None
        assert self.duration is not None
        points = as_array(self.points, "the points of the hand's path")
        return Path(np.linspace(0.0, self.duration, len(points)), points)


class HandTable(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A hand that draws the tool along a path: see `Hand`."""

    stiffness: float
    path: HandPath
    damping: float = 0.0


class ExperimentTable(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a suite's `experiment` table holds: see `Experiment`.

    The operator's force comes from rows `force` (s, N, N[, N]), or from a CSV file `force_file` with the header
    `t,fx,fy[,fz]`. `phases` are rows of a time (s) and what begins then.
    """

    duration: Positive
    position: Point
    velocity: Point | None = None
    force: Annotated[list[Annotated[list[float], Meta(min_length=3, max_length=4)]], Meta(min_length=1)] | None = None
    force_file: str | None = None
    hand: HandTable | None = None
    phases: tuple[tuple[float, str], ...] = ()

    def experiment(self, folder: FilePath) -> Experiment:
        """Return the experiment; files count from `folder`.

        Raises `InputError`, naming file and row, for what cannot be read, and as `Experiment` and `Hand` do.
        """
        rows = self._force(folder)
        hand = self.hand
        return Experiment(
            duration=self.duration,
            position=np.array(self.position, dtype=np.float64),
            velocity=np.array(self.velocity or [0.0] * len(self.position), dtype=np.float64),
            force_time=rows[:, 0],
            force=rows[:, 1:],
            hand=None
            if hand is None
            else Hand(path=hand.path.path(folder), stiffness=hand.stiffness, damping=hand.damping),
            phases=self.phases,
        )

    def _force(self, folder: FilePath) -> Array:
        """Return the rows of force (s, 1 + N): a time (s), and the force (N) from then on to the next."""
        if self.force_file is None:
            # nobody pushes: one row of zeros, held all the time
            return as_array(self.force or [[0.0] * (len(self.position) + 1)], "the rows of force")
        if self.force is not None:
            raise InputError("both force and force_file are given", why="they say the same", todo="leave one out")
        file = file_below(folder, self.force_file)
        return read_rows(file, "force", "a time in seconds and newtons", ("t", "fx", "fy", "fz"))


AnyTrajectory = Scaled | Arc | PastCorner | Points | Loop | FromFile | HardPlaces | Moves


def build_path(spec: Mapping[str, Any], surface: Boundary, folder: FilePath) -> Path:
    """Return the path of a `trajectory` table as a suite has it; see `Trajectory.path`."""
    return convert(spec, AnyTrajectory, "trajectory").path(surface, folder)
