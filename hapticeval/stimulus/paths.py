"""HIP trajectories of the suites: built from a surface and a few numbers, or read from a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path as FilePath
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct, field

from hapticeval.errors import InputError, at
from hapticeval.files import file_below
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve, as_curve
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array

WAYPOINTS = 32_768
"""Points on a built path: four a tick for eight seconds at 1 kHz, so that refined runs see its true shape."""

LAP_POINTS = 4096
"""Points on a circle that the hand is led round."""

Positive = Annotated[float, Meta(gt=0)]
Point = Annotated[list[float], Meta(min_length=2, max_length=3)]
"""Coordinates in m."""


class Trajectory(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind"):
    """Base of what a suite's `trajectory` table may be, by its `kind`."""

    def path(self, surface: Boundary, folder: FilePath) -> Path:
        """Return the path on a `surface`; files count from `folder`.

        Raises `InputError` for a kind that is built on a plane curve where the surface is in space, and for what cannot
        be built or read.
        """
        raise NotImplementedError


class OnCurve(Trajectory, frozen=True, kw_only=True):
    """Base of trajectories that are built on a plane curve and run through in `duration` (s) at constant speed."""

    duration: Positive

    def path(self, surface: Boundary, folder: FilePath) -> Path:  # noqa: ARG002 - as every trajectory
        """Return the path; see `Trajectory.path`."""
        curve = as_curve(surface)
        if curve is None:
            raise InputError(
                f"a trajectory of kind '{self.__struct_config__.tag}' is built on a plane curve, and the model is a "
                "surface in space",
                todo="use kind = 'points' or 'file'",
            )
        return _path_on(curve, self)

    def points_on(self, curve: Curve) -> Array:
        """Return the points (n, 2), m, that the path goes through."""
        raise NotImplementedError


@lru_cache(maxsize=32)
def _path_on(curve: Curve, trajectory: OnCurve) -> Path:
    """Build the path: the same for each renderer of a case that is led along the model itself."""
    return _at_constant_speed(trajectory.points_on(curve), trajectory.duration)


class Scaled(OnCurve, frozen=True, kw_only=True, tag="scaled"):
    """The model's outline drawn smaller about the origin, between two polar angles (degrees).

    It is (1 - depth / R) y(s), with R the surface's largest radius about the origin: `depth` (m) under the tips, less
    in the valleys.
    """

    from_angle: float
    to_angle: float
    depth: Positive | None = None

    def points_on(self, curve: Curve) -> Array:
        """Return the points (n, 2), m, of the scaled outline between the two angles."""
        u, outline = self._outline(curve)
        angle = np.unwrap(np.arctan2(outline[:, 1], outline[:, 0]))
        # the polar angle must rise all the way round for u to be a function of it
        if np.any(np.diff(angle) <= 0.0):
            raise InputError(
                "a 'scaled' trajectory needs a model that every ray from the origin meets once",
                todo="use kind = 'points' or 'file'",
            )
        # each angle brought into the turn that the outline covers
        inside = angle[0] + (self._angles() - angle[0]) % (2.0 * np.pi)
        position = np.asarray(curve.position(np.interp(inside, angle, u)))
        radius, depth = self._radius(outline)
        return (1.0 - depth / radius) * position

    def _angles(self) -> Array:
        """Return the polar angles (n,), rad, of the path's points."""
        return np.linspace(math.radians(self.from_angle), math.radians(self.to_angle), WAYPOINTS)

    def _outline(self, curve: Curve) -> tuple[Array, Array]:
        """Return parameters (n,) once round the surface, and its points (n, 2), m."""
        if not curve.closed:
            kind = self.__struct_config__.tag
            raise InputError(
                f"a trajectory of kind '{kind}' needs a closed model", todo="use kind = 'points' on a line"
            )
        u = np.linspace(*curve.u_range, 4 * WAYPOINTS)
        return u, np.asarray(curve.position(u))

    def _radius(self, outline: Array) -> tuple[float, float]:
        """Return the outline's largest distance from the origin, and the depth, m.

        Raises `InputError` where the depth does not fit in.
        """
        radius = float(np.max(np.linalg.norm(outline, axis=1)))
        if self.depth is None:
            raise InputError(
                f"a '{self.__struct_config__.tag}' trajectory needs a depth", todo="give depth, or a sweep"
            )
        if self.depth >= radius:
            raise InputError(
                f"a trajectory of depth {self.depth} m", why=f"the surface's largest radius is {radius:.4g} m"
            )
        return radius, self.depth


class Arc(Scaled, frozen=True, kw_only=True, tag="arc"):
    """Round the origin, `depth` (m) inside the surface's largest radius, between two polar angles (degrees)."""

    def points_on(self, curve: Curve) -> Array:
        """Return the points (n, 2), m, of the arc."""
        angle = self._angles()
        radius, depth = self._radius(self._outline(curve)[1])
        return (radius - depth) * np.column_stack([np.cos(angle), np.sin(angle)])


class PastCorner(OnCurve, frozen=True, kw_only=True, tag="corner"):
    """Parallel to the faces of the surface's corner number `corner`, `depth` (m) under them.

    From `before` to `after` metres from the corner: round a concave one on an arc, straight on past a convex one.
    """

    corner: Annotated[int, Meta(ge=0)]
    depth: Positive
    before: Positive
    after: Positive

    def points_on(self, curve: Curve) -> Array:
        """Return the points (n, 2), m, past the corner."""
        if self.corner >= len(curve.corners):
            raise InputError(
                f"the model has no corner {self.corner}",
                why=f"it has {len(curve.corners)}",
                todo="count corners from 0 along the curve",
            )
        corner, depth = curve.corners[self.corner], self.depth
        start = corner.position - self.before * corner.tangent_pre - depth * corner.normal_pre
        # straight on: the hand is led out past the corner, and lets go of the first face
        if corner.convex:
            return np.array([start, corner.position + self.after * corner.tangent_pre - depth * corner.normal_pre])
        # round a concave corner at `depth` from it: from one inward normal to the other
        first = math.atan2(-corner.normal_pre[1], -corner.normal_pre[0])
        angles = np.linspace(first, first + corner.turn, 2048)
        arc = corner.position + depth * np.column_stack([np.cos(angles), np.sin(angles)])
        end = corner.position + self.after * corner.tangent_post - depth * corner.normal_post
        return np.vstack([start, arc, end])


class Points(Trajectory, frozen=True, kw_only=True, tag="points"):
    """Straight lines between `points` (m), in `duration` (s) at constant speed."""

    points: Annotated[list[Point], Meta(min_length=2)]
    duration: Positive

    def path(self, surface: Boundary, folder: FilePath) -> Path:  # noqa: ARG002 - as every trajectory
        """Return the path; see `Trajectory.path`."""
        return _at_constant_speed(as_array(self.points, "the points of the trajectory"), self.duration)


class Loop(Trajectory, frozen=True, kw_only=True, tag="loop"):
    """From `start` (m) to the circle of `radius` (m) about `centre` (m), round it, and back.

    In space the circle lies square to `axis`, a direction.

    - `laps` times anticlockwise, seen from where the axis points, and as often clockwise, as only one way may gain
      energy;
    - each in `lap` seconds, a whole number of ticks, so that laps pass the same HIPs again;
    - straight there and back in `approach` seconds each.
    """

    start: Point
    centre: Point
    radius: Positive
    laps: Annotated[int, Meta(ge=2)]
    lap: Positive
    approach: Positive
    axis: Point | None = None

    def path(self, surface: Boundary, folder: FilePath) -> Path:  # noqa: ARG002 - as every trajectory
        """Return the path; see `Trajectory.path`."""
        start, centre, radius = np.array(self.start), np.array(self.centre), self.radius
        ahead, across, away = self._circle_plane(start, centre)
        # the circle begins at its point nearest to the start
        turn = math.atan2(*away[::-1]) + np.linspace(0.0, 2.0 * np.pi, LAP_POINTS, endpoint=False)
        circle = centre + radius * (np.outer(np.cos(turn), ahead) + np.outer(np.sin(turn), across))
        # one more point at the end: the last lap is closed
        laps_forward = np.vstack([np.tile(circle, (self.laps, 1)), circle[:1]])
        # back over the same points, the last of them not twice
        points = np.vstack([laps_forward, laps_forward[-2::-1]])
        time = self.approach + np.arange(len(points)) * (self.lap / LAP_POINTS)
        return Path(np.concatenate([[0.0], time, [time[-1] + self.approach]]), np.vstack([start, points, start]))

    def _circle_plane(self, start: Array, centre: Array) -> tuple[Array, Array, tuple[float, float]]:
        """Return two unit vectors (N,) in the plane of the circle, and where along them the start lies, m."""
        if (
            start.size != centre.size
            or (self.axis is None) is (start.size == 3)
            or len(self.axis or start) != start.size
        ):
            raise InputError(
                f"a loop from {list(self.start)} m round {list(self.centre)} m with axis {self.axis}",
                why="a circle in space lies square to an axis, and one in the plane has none",
                todo="give start and centre as many numbers each, and in space an axis of three",
            )
        away = start - centre
        ahead, across = np.eye(2)
        if self.axis is not None:
            axis = np.array(self.axis)
            # square to the axis and to the start's direction: anticlockwise seen from its tip
            across = np.cross(axis, away)
            # on the axis no direction of the plane is the start's
            if not np.linalg.norm(across) > 0.0:
                raise InputError(
                    f"a loop with axis {self.axis}", why="it points from the centre to the start, or nowhere"
                )
            ahead, across = (vector / np.linalg.norm(vector) for vector in (np.cross(across, axis), across))
        if not np.linalg.norm(away) > self.radius:
            raise InputError(
                f"a loop from {list(self.start)} m round {list(self.centre)} m with a radius of {self.radius:g} m",
                why="its start lies outside of its circle",
                todo="start in free space, and put the circle inside the model",
            )
        return ahead, across, (float(away @ ahead), float(away @ across))


class FromFile(Trajectory, frozen=True, kw_only=True, tag="file"):
    """A CSV file or a recording below the suite's folder: see `read_path`."""

    file: str = field(name="path")

    def path(self, surface: Boundary, folder: FilePath) -> Path:  # noqa: ARG002 - as every trajectory
        """Return the path; see `Trajectory.path`."""
        return read_path(file_below(folder, self.file))


def as_array(rows: Sequence[Sequence[float]], what: str) -> Array:
    """Return rows of numbers (n, k). Raises `InputError`, naming `what`, where they differ in length."""
    try:
        return np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{what} differ in dimension", why="all have as many numbers as the first") from error


def read_path(file: FilePath) -> Path:
    """Return a HIP trajectory from CSV with the header `t,x,y` or `t,x,y,z`, or the HIP of a recording: s and m.

    A recording is a file whose name ends in `.h5`; the path runs straight over the rows of it that are not valid.

    Raises `InputError`, naming file and row, for a missing file, other columns, text among the numbers, fewer than two
    rows, NaN, and times that do not increase, and as `read_recording` does.
    """
    if file.suffix == ".h5":
        from hapticeval.recordings.hdf5 import read_recording

        recording = read_recording(file, channels=["hip"])
        # invalid rows are left out: the path runs straight over them
        rows = slice(None) if recording.valid is None else recording.valid
        time, points = recording.time[rows], recording.hip[rows]
    else:
        values = read_rows(file, "trajectory", "a time in seconds and positions in metres", ("t", "x", "y", "z"))
        time, points = values[:, 0], values[:, 1:]
    if time.size < 2:
        raise InputError(f"{file} has {time.size} rows", why="a trajectory needs at least two")
    with at(str(file)):
        return Path(time, points)


def read_rows(file: FilePath, what: str, meaning: str, header: tuple[str, str, str, str]) -> Array:
    """Return the numbers (n, 3 or 4) of a CSV file with a given header, in the plane without its last name.

    Raises `InputError`, naming file and row, for a missing file, other columns, and text among the numbers; an empty
    cell is NaN. `what` names the rows, which are `meaning`.
    """
    import pandas as pd

    plane = ",".join(header[:3])
    try:
        table = pd.read_csv(file)
    except FileNotFoundError:
        raise InputError(f"no {what} file {file}", todo="check the path; it counts from the suite's folder") from None
    except (ValueError, UnicodeDecodeError) as error:
        raise InputError(
            f"{file} is not a CSV table", why=str(error), todo=f"write a header {plane} and rows of numbers"
        ) from error
    columns = tuple(str(name).strip() for name in table.columns)
    if columns not in (header[:3], header):
        raise InputError(
            f"{file} has the columns {', '.join(columns)}",
            why=f"a {what} is {meaning}",
            todo=f"give it the header {plane} (or {','.join(header)})",
        )
    for name in table.columns:
        numbers = pd.to_numeric(table[name], errors="coerce")
        # an empty cell stays NaN; a word is an error
        text = numbers.isna() & table[name].notna()
        if text.any():
            row = int(np.argmax(text.to_numpy()))
            raise InputError(f"{file}, row {row}, column {name}: {table[name].iloc[row]!r} is not a number")
        table[name] = numbers
    return table.to_numpy(dtype=np.float64)


def _at_constant_speed(points: Array, duration: float) -> Path:
    """Return the path through points (n, N), m, in `duration` (s) at constant speed.

    Raises `InputError` for points that are all one.
    """
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    # points that do not move take no time, and would repeat an instant
    keep = np.concatenate([[True], np.diff(along) > 0.0])
    along, points = along[keep], points[keep]
    if along.size < 2:
        raise InputError("a trajectory that stays at one point", todo="give it two different points")
    return Path(along * (duration / along[-1]), points)
