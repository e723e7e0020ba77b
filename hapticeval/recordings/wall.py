"""Recordings in one dimension against a wall, as recordings in the plane against the model `line`.

A device with one degree of freedom presses along a line. In the plane that line is the y axis and the wall the half
plane y < 0, with its outward normal along +y: a place x becomes (0, s (x - x0)) and a force f becomes (0, s f), with
x0 the wall's place and s = 1 or -1 its outward direction on the recorded axis. Both stand in `meta["wall"]`; without
it the wall is at 0 and free space on the positive side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array

LINE = "line"
"""The model that a wall is."""


def before_the_wall(recording: Recording) -> Recording:
    """The same run in the plane, with every channel of the world's frame (n, 1) as (n, 2).

    Raises `InputError` for a recording that is not in one dimension, and for a `wall` that does not give its place as
    `at` (m) and its outward direction as `outward` (1 or -1).
    """
    if recording.dimension != 1:
        raise InputError(f"the recording is in {recording.dimension} dimensions, and not in one")
    at, outward = _wall(recording.meta.get("wall", {}))
    channels = dict(recording.channels)
    for name, values in recording.channels.items():
        if recording.signals[name].frame == "world":
            channels[name] = _upright(values, at if recording.signals[name].unit == "m" else 0.0, outward)
    return Recording(
        recording.time,
        channels,
        recording.meta,
        clock=recording.clock,
        valid=recording.valid,
        signals=recording.signals,
        events=recording.events,
    )


def _upright(values: Array, at: float, outward: float) -> Array:
    along = outward * (values[:, 0] - at)
    # beside the line nothing happens; a row without a number has none in either direction
    return np.column_stack([np.where(np.isfinite(along), 0.0, np.nan), along])


def _wall(given: Any) -> tuple[float, float]:
    table = given if isinstance(given, Mapping) else {"": given}
    at, outward = table.get("at", 0.0), table.get("outward", 1)
    numbers = all(isinstance(each, int | float) and math.isfinite(each) for each in (at, outward))
    if not numbers or outward not in (1, -1) or table.keys() - {"at", "outward"}:
        raise InputError(
            f"the recording's wall is {given!r}",
            why="it is the wall's place on the axis, m, and the direction out of it",
            todo="in the mapping: [meta] wall = { at = 0.0, outward = 1 }, or -1 where positive points into the wall",
        )
    return float(at), float(outward)
