"""How far two runs over the same samples are apart, in contact point and force, and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array, IntArray


@dataclass(frozen=True)
class Apart:
    """Root mean square and maximum of a distance (m or N); time (s) and the reference's row of the maximum."""

    rms: float
    max: float
    time: float
    row: int


@dataclass(frozen=True)
class Difference:
    """One run against another: distances of their IHIPs (m) and forces (N).

    A channel that either of them lacks is None. `rows` were compared, and in `contact` (a share of them) one run
    touches where the other does not.
    """

    ihip: Apart | None
    force: Apart | None
    rows: int
    contact: float | None


def difference(recording: Recording, reference: Recording) -> Difference:
    """The distance of `recording` from `reference`, sample by sample.

    Raises `InputError` where they have no samples in common times: nothing is interpolated.
    """
    rows = _same_times(recording, reference)
    found: dict[str, Apart | None] = {}
    for name in ("ihip", "force"):
        if any(name not in each.channels for each in (recording, reference)):
            found[name] = None
            continue
        values, others = recording.channels[name][rows[0]], reference.channels[name][rows[1]]
        found[name] = _apart(values, others, reference.time[rows[1]], rows[1])
    contact = None
    if all(value is not None for value in found.values()):
        contact = float(np.mean(recording.contact[rows[0]] != reference.contact[rows[1]]))
    return Difference(found["ihip"], found["force"], rows[0].size, contact)


def _same_times(recording: Recording, reference: Recording) -> tuple[IntArray, IntArray]:
    _, mine, theirs = np.intersect1d(recording.time, reference.time, assume_unique=True, return_indices=True)
    if mine.size == 0:
        raise InputError(
            "the two recordings have no sample at the same time",
            why="runs are compared sample by sample, and nothing is interpolated",
            todo="compare runs of different hands with `hapticeval compare`, by angle or arc length",
        )
    return mine, theirs


def _apart(values: Array, others: Array, time: Array, rows: IntArray) -> Apart:
    distance = np.linalg.norm(values - others, axis=1)
    at = int(np.argmax(distance))
    return Apart(float(np.sqrt(np.mean(distance**2))), float(distance[at]), float(time[at]), int(rows[at]))
