"""How far two runs over the same samples are apart, in contact point and force, and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.recording import Recording


@dataclass(frozen=True)
class Apart:
    """How far two runs are apart in one channel: root mean square and maximum of the distance (m or N).

    `time` (s) and `row` of the reference are those of the maximum.
    """

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
    """Return the distance of `recording` from `reference`, sample by sample.

    Raises `InputError` where they have no samples in common times: nothing is interpolated.
    """
    # Only samples at bit-equal times are compared: `mine` and `theirs` are their rows in either recording.
    time, mine, theirs = np.intersect1d(recording.time, reference.time, assume_unique=True, return_indices=True)
    if mine.size == 0:
        raise InputError(
            "the two recordings have no sample at the same time",
            why="runs are compared sample by sample, and nothing is interpolated",
            todo="compare a run with its own replay: hapticeval replay",
        )
    distances: dict[str, Apart | None] = {"ihip": None, "force": None}
    for name in distances.keys() & recording.channels.keys() & reference.channels.keys():
        distance = np.linalg.norm(recording.channels[name][mine] - reference.channels[name][theirs], axis=1)
        at = int(np.argmax(distance))
        rms = float(np.sqrt(np.mean(distance**2)))
        distances[name] = Apart(rms, float(distance[at]), float(time[at]), int(theirs[at]))
    both = all(value is not None for value in distances.values())
    # A share of rows: where one run touches and the other does not.
    contact = float(np.mean(recording.contact[mine] != reference.contact[theirs])) if both else None
    return Difference(distances["ihip"], distances["force"], mine.size, contact)
