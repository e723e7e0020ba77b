"""HIP trajectories of the suites: built from a surface and a few numbers, or read from a file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve, as_curve
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array

WAYPOINTS = 32_768
"""Points on a built path: four a tick for eight seconds at 1 kHz, so that refined runs see its true shape."""


def build_path(spec: Mapping[str, Any], surface: Boundary, folder: FilePath) -> Path:
    """The path that a suite's `trajectory` table asks for.

    `kind` is one of

    - `scaled`: (1 - depth / R) y(s) with R the surface's largest radius about the origin, between the polar angles
      `from_angle` and `to_angle` (degrees): `depth` (m) under the tips, less in the valleys;
    - `arc`: round the origin, `depth` (m) inside the surface's largest radius, between two polar angles (degrees);
    - `corner`: parallel to the faces of the surface's corner number `corner`, `depth` (m) under them, from `before`
      to `after` metres from the corner; round a concave corner on an arc, straight on past a convex one;
    - `points`: straight lines between `points` (m);
    - `loop`: from `start` (m) straight to the circle of `radius` (m) about `centre` (m), `laps` times round it
      anticlockwise and as often clockwise, each in `lap` seconds, and straight back: `approach` seconds each way;
    - `file`: a CSV file or a recording, see `read_path`, relative to the suite's folder.

    Those with a `duration` are run through in so many seconds at constant speed. Raises `InputError` for a kind that
    is built on a plane curve and a surface in space, and for what cannot be built or read.
    """
    kind = spec["kind"]
    if kind == "file":
        return read_path(below(folder, str(spec["path"])))
    if kind == "points":
        return _at_constant_speed(np.array(spec["points"], dtype=np.float64), spec["duration"])
    if kind == "loop":
        return _loop(**{name: value for name, value in spec.items() if name != "kind"})
    curve = as_curve(surface)
    if curve is None:
        raise InputError(
            f"a trajectory of kind '{kind}' is built on a plane curve, and the model is a surface in space",
            todo="use kind = 'points' or 'file'",
        )
    if kind == "scaled":
        points = _scaled(curve, spec["depth"], spec["from_angle"], spec["to_angle"])
    elif kind == "arc":
        points = _arc(curve, spec["depth"], spec["from_angle"], spec["to_angle"])
    else:
        points = _past_corner(curve, spec["corner"], spec["depth"], spec["before"], spec["after"])
    return _at_constant_speed(points, spec["duration"])


def below(folder: FilePath, name: str) -> FilePath:
    """The file that a suite names. Raises `InputError` unless it lies below the suite's folder, links followed."""
    file = folder / name
    if not file.resolve().is_relative_to(folder.resolve()):
        raise InputError(
            f"the file '{name}' is not below the suite's folder {folder}",
            why="a suite may come from anyone, and reads no other files of this machine",
            todo="copy the file beside the suite",
        )
    return file


def read_path(file: FilePath) -> Path:
    """A HIP trajectory from CSV with the header `t,x,y` or `t,x,y,z`, seconds and metres, or the HIP of a recording.

    A recording is a file whose name ends in `.h5`; straight over the rows of it that are not valid. Raises
    `InputError`, naming file and row, for a missing file, other columns, text among the numbers, fewer than two rows,
    NaN, and times that do not increase, and as `read_recording` does.
    """
    if file.suffix == ".h5":
        from hapticeval.recordings.hdf5 import read_recording

        recording = read_recording(file, channels=["hip"])
        rows = slice(None) if recording.valid is None else recording.valid
        time, points = recording.time[rows], recording.hip[rows]
    else:
        values = read_rows(file, "trajectory", "a time in seconds and positions in metres", ("t", "x", "y", "z"))
        time, points = values[:, 0], values[:, 1:]
    if time.size < 2:
        raise InputError(f"{file} has {time.size} rows", why="a trajectory needs at least two")
    try:
        return Path(time, points)
    except InputError as error:
        raise InputError(f"{file}: {error.what}", why=error.why, todo=error.todo) from None


def read_rows(file: FilePath, what: str, meaning: str, header: tuple[str, str, str, str]) -> Array:
    """The numbers (n, 3 or 4) of a CSV file whose header is `header`, or that without its last name, in the plane.

    Raises `InputError`, naming file and row, for a missing file, other columns, and text among
    the numbers; an empty cell is NaN. `what` names the rows, which are `meaning`.
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
        text = numbers.isna() & table[name].notna()
        if text.any():
            row = int(np.argmax(text.to_numpy()))
            raise InputError(f"{file}, row {row}, column {name}: {table[name].iloc[row]!r} is not a number")
        table[name] = numbers
    return table.to_numpy(dtype=np.float64)


def _scaled(surface: Curve, depth: float, from_angle: float, to_angle: float) -> Array:
    u, outline = _outline(surface, "scaled")
    angle = np.unwrap(np.arctan2(outline[:, 1], outline[:, 0]))
    if np.any(np.diff(angle) <= 0.0):
        raise InputError(
            "a 'scaled' trajectory needs a model that every ray from the origin meets once",
            todo="use kind = 'points' or 'file'",
        )
    start, stop = math.radians(from_angle), math.radians(to_angle)
    wanted = np.linspace(start, stop, WAYPOINTS)
    turn = 2.0 * np.pi
    inside = angle[0] + (wanted - angle[0]) % turn
    position = np.asarray(surface.position(np.interp(inside, angle, u)))
    return (1.0 - depth / _radius(outline, depth)) * position


def _arc(surface: Curve, depth: float, from_angle: float, to_angle: float) -> Array:
    _, outline = _outline(surface, "arc")
    angle = np.linspace(math.radians(from_angle), math.radians(to_angle), WAYPOINTS)
    return (_radius(outline, depth) - depth) * np.column_stack([np.cos(angle), np.sin(angle)])


def _outline(surface: Curve, kind: str) -> tuple[Array, Array]:
    """Parameters (n,) once round the surface, and its points (n, 2), m."""
    if not surface.closed:
        raise InputError(f"a trajectory of kind '{kind}' needs a closed model", todo="use kind = 'points' on a line")
    u = np.linspace(*surface.u_range, 4 * WAYPOINTS)
    return u, np.asarray(surface.position(u))


def _radius(outline: Array, depth: float) -> float:
    """The outline's largest distance from the origin, m, refused if `depth` does not fit into it."""
    radius = float(np.max(np.linalg.norm(outline, axis=1)))
    if depth >= radius:
        raise InputError(f"a trajectory of depth {depth} m", why=f"the surface's largest radius is {radius:.4g} m")
    return radius


def _past_corner(surface: Curve, number: int, depth: float, before: float, after: float) -> Array:
    corners = surface.corners
    if not 0 <= number < len(corners):
        raise InputError(
            f"the model has no corner {number}",
            why=f"it has {len(corners)}",
            todo="count corners from 0 along the curve",
        )
    corner = corners[number]
    start = corner.position - before * corner.tangent_pre - depth * corner.normal_pre
    if corner.convex:
        return np.array([start, corner.position + after * corner.tangent_pre - depth * corner.normal_pre])
    first = math.atan2(-corner.normal_pre[1], -corner.normal_pre[0])
    angles = np.linspace(first, first + corner.turn, 2048)
    arc = corner.position + depth * np.column_stack([np.cos(angles), np.sin(angles)])
    end = corner.position + after * corner.tangent_post - depth * corner.normal_post
    return np.vstack([start, arc, end])


LAP_POINTS = 4096
"""Points on a circle that the hand is led round."""


def _loop(
    start: Sequence[float], centre: Sequence[float], radius: float, laps: int, lap: float, approach: float
) -> Path:
    """Laps of whole ticks pass the same HIPs again, which is how they are told; both ways, as only one may gain."""
    away = np.subtract(start, centre)
    if away.size != 2 or not np.linalg.norm(away) > radius:
        raise InputError(
            f"a loop from {list(start)} m round {list(centre)} m with a radius of {radius:g} m",
            why="its start lies outside of its circle, in the plane",
            todo="start in free space, and put the circle inside the model",
        )
    turn = math.atan2(away[1], away[0]) + np.linspace(0.0, 2.0 * np.pi, LAP_POINTS, endpoint=False)
    circle = np.asarray(centre) + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    there = np.vstack([np.tile(circle, (laps, 1)), circle[:1]])
    points = np.vstack([there, there[-2::-1]])
    time = approach + np.arange(len(points)) * (lap / LAP_POINTS)
    return Path(np.concatenate([[0.0], time, [time[-1] + approach]]), np.vstack([start, points, start]))


def _at_constant_speed(points: Array, duration: float) -> Path:
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(along) > 0.0])
    along, points = along[keep], points[keep]
    if along.size < 2:
        raise InputError("a trajectory that stays at one point", todo="give it two different points")
    return Path(along * (duration / along[-1]), points)
