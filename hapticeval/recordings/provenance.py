"""How a recording was made, as its metadata and events state it: model, scene, gains, losses, the wall of a 1-DOF run.

A device with one degree of freedom presses along a line. In the plane that line is the y axis and the wall the half
plane y < 0, with its outward normal along +y:

    a place x becomes (0, s (x - x0)), and a force f becomes (0, s f)

with x0 the wall's place, m, and s = 1 or -1 its outward direction on the recorded axis. Both stand in `meta["wall"]`;
without it the wall is at 0 and free space on the positive side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.hdf5 import LOST_EVENT
from hapticeval.recordings.recording import Recording

MISSING_ROWS = ("time out of order", "without a number")
"""Of what an import leaves out, the rows that the file should have had: gaps are as they were meant."""

LINE_MODEL = "line"
"""The model that the wall of a recording in one dimension is."""


def model_of(recording: Recording) -> dict[str, Any] | None:
    """Return the model that was touched, as a suite gives it (`kind` and parameters): in the scene, or beside it."""
    # Beside the scene is where a mapping's [meta] may give it.
    for place in (recording.meta.get("scene"), recording.meta):
        model = place.get("model") if isinstance(place, Mapping) else None
        if isinstance(model, Mapping) and "kind" in model:
            return dict(model)
    return None


def scene_of(recording: Recording) -> dict[str, Any]:
    """Return the entries of the scene, and the gains that stand beside it, without those that are None."""
    entries: dict[str, Any] = {}
    for table in (recording.meta.get("gains"), recording.meta.get("scene")):
        if isinstance(table, Mapping):
            entries |= {str(key): value for key, value in table.items() if value is not None}
    return entries


def spring_of(recording: Recording) -> tuple[float | None, str]:
    """Return K_p, N/m, where the force is that of a spring alone; else None, and in words what else it is, if known."""
    # What the renderer declared: a force along the normal, or a stiffness that varies, is not K_p (IHIP - HIP).
    if recording.meta.get("spring", "error") != "error" or "stiffness_least" in recording.meta:
        return None, "the renderer declares a force along the normal, or a stiffness that varies"
    why = ""
    for table in (recording.meta.get("gains"), recording.meta.get("scene")):
        if isinstance(table, Mapping) and "stiffness" in table:
            if not table.get("damping"):
                return float(table["stiffness"]), ""
            why = f"the recording has a damping K_d of {table['damping']:.6g} N s/m"
    return None, why


def is_bilateral(recording: Recording) -> bool:
    """Return whether the scene holds the tool from both sides."""
    return bool(scene_of(recording).get("bilateral"))


def declared_floor(recording: Recording) -> float | None:
    """Return the force that the sensor may read in free motion, N; None where it is not declared."""
    declared = recording.meta.get("force_floor")
    return float(declared) if isinstance(declared, int | float) else None


def describe_losses(recording: Recording) -> tuple[str, ...]:
    """Return what is lost of the file that a recording was made of, in words."""
    return tuple(event.text for event in recording.events if event.kind == LOST_EVENT)


def describe_warnings(recording: Recording) -> tuple[str, ...]:
    """Return the warnings of the import of a foreign file: rows that are cut off, cells without a number."""
    return tuple(str(text) for text in recording.meta.get("import", {}).get("warnings", ()))


def incomplete(recording: Recording) -> bool:
    """Return whether rows are lost or masked, cycles have no row, the run ended early, or the import warned."""
    # Rows that a mapping declared as gaps are not missing: only those of `MISSING_ROWS` count.
    left_out = recording.meta.get("import", {}).get("left out", {})
    ended = any(event.kind == "ended" for event in recording.events)
    missed = recording.clock is not None and recording.clock.missed
    return bool(
        missed
        or ended
        or describe_losses(recording)
        or describe_warnings(recording)
        or left_out.keys() & set(MISSING_ROWS)
    )


def before_the_wall(recording: Recording) -> Recording:
    """Return the same run in the plane, with every channel of the world's frame (n, 1) as (n, 2).

    Raises `InputError` for a `wall` that does not give its place as `at` (m) and its outward direction as `outward` (1
    or -1).
    """
    wall = recording.meta.get("wall", {})
    at, outward = wall.get("at", 0.0), wall.get("outward", 1)
    numbers = all(isinstance(number, int | float) and math.isfinite(number) for number in (at, outward))
    if not numbers or outward not in (1, -1) or wall.keys() - {"at", "outward"}:
        raise InputError(
            f"the recording's wall is {wall!r}",
            why="it is the wall's place on the axis, m, and the direction out of it",
            todo="in the mapping: [meta] wall = { at = 0.0, outward = 1 }, or -1 where positive points into the wall",
        )
    channels = dict(recording.channels)
    for name, values in recording.channels.items():
        if recording.signals[name].frame == "world":
            # Only a position is measured from the wall, (x - x0) outward; forces and velocities keep their zero.
            along = float(outward) * (values[:, 0] - (at if recording.signals[name].unit == "m" else 0.0))
            # beside the line nothing happens; a row without a number has none in either direction
            channels[name] = np.column_stack([np.where(np.isfinite(along), 0.0, np.nan), along])
    return replace(recording, channels=channels)
