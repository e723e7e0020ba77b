"""The clock of a recording as it was: stretches without gaps, and the step that each sample took."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.types import Array, BoolArray

LAG_TICKS = 3
"""A proxy may answer up to so many ticks late without being wrong."""

GAP_STEPS = LAG_TICKS + 1
"""A hole longer than so many sampling times ends a stretch: no answer before it, however late, reaches over it."""

STAMP_SECONDS = 1e-9
"""Seconds to which recorded times are stamped: steps that differ by no more are the same."""


@dataclass(frozen=True)
class Stretch:
    """Rows `first` to `end` (exclusive) of a recording, without a gap between them."""

    first: int
    end: int

    @property
    def rows(self) -> slice:
        """The rows as a slice."""
        return slice(self.first, self.end)

    def times(self, recording: Recording) -> str:
        """The times of its first and last row, as in `0.1 to 0.2 s`."""
        begin, end = recording.time[[self.first, self.end - 1]]
        return f"{begin:.6g} to {end:.6g} s"

    def __len__(self) -> int:
        return self.end - self.first


def stretches(recording: Recording, sound: BoolArray | None = None) -> tuple[Stretch, ...]:
    """The stretches of two rows or more over which `sound` (n,) holds and the clock has no gap.

    A gap is a step (s) longer than `GAP_STEPS` nominal ones. Without `sound`, the rows that the recording holds valid
    are.
    """
    if sound is None:
        sound = recording.measured
    return tuple(
        # A run of k steps joins k + 1 rows.
        Stretch(first, end + 1)
        for first, end in runs_of(sound[1:] & sound[:-1] & continuing_steps(recording))
    )


def continuing_steps(recording: Recording) -> BoolArray:
    """Return over which steps of the clock, (n - 1,), whatever reads the recording goes on: `GAP_STEPS` and shorter.

    Seconds are made of stamps, and a hole of exactly so many steps is none, however its seconds were rounded.
    """
    return np.asarray(np.diff(recording.time) <= GAP_STEPS * nominal_step(recording) + _stamp_tolerance(recording))


def nominal_step(recording: Recording) -> float:
    """Return the sampling time, s: the declared one where the median of the steps bears it out, else that, in whole ns.

    Where the cycles are numbered it is that of a cycle: of a log that lacks most of them, rows are further apart.
    """
    median = _median_cycle(recording)
    declared = recording.meta.get("dt")
    if isinstance(declared, int | float) and abs(declared - median) <= _stamp_tolerance(recording):
        return float(declared)
    # Stamps are whole ns: a median that is off by their rounding alone is a whole number of them.
    rounded = round(median, 9)
    return rounded if abs(rounded - median) <= _stamp_tolerance(recording) else median


def _median_cycle(recording: Recording) -> float:
    """Return the median time of a cycle, s: by the cycle numbers where they are counted, else from row to row."""
    if recording.clock is None or recording.clock.sequence is None:
        return recording.dt
    # Cycles and seconds from row to row: their quotient is a cycle's time, also where rows are missing.
    jumps, durations = np.diff(recording.clock.sequence), np.diff(recording.time)
    counted = (jumps > 0) & (durations > 0.0)
    return float(np.median(durations[counted] / jumps[counted])) if counted.any() else recording.dt


def steps(recording: Recording, stretch: Stretch) -> float | Array:
    """What each sample of a stretch took, s: one number where the clock is regular to its stamps, else (n,).

    The first sample of a stretch has none before it and is given the nominal step.
    """
    nominal = nominal_step(recording)
    durations = np.diff(recording.time[stretch.rows])
    if np.all(np.abs(durations - nominal) <= _stamp_tolerance(recording)):
        return nominal
    return np.concatenate([[nominal], durations])


def describe_clock(recording: Recording, parts: tuple[Stretch, ...]) -> str:
    """Describe the clock in words, for the report."""
    steps_of_parts = [steps(recording, stretch) for stretch in parts]
    if all(isinstance(step, float) for step in steps_of_parts):
        return f"regular, {1e3 * nominal_step(recording):.6g} ms"
    durations = np.concatenate([np.diff(recording.time[stretch.rows]) for stretch in parts])
    return (
        f"irregular, {1e3 * float(durations.min()):.4g} to {1e3 * float(durations.max()):.4g} ms "
        f"(median {1e3 * float(np.median(durations)):.4g} ms): each sample is played at its recorded time with its "
        "own step"
    )


def _stamp_tolerance(recording: Recording) -> float:
    # s: a nanosecond, and the spacing of doubles at the largest time, four times for the differences.
    time = recording.time if recording.valid is None else recording.time[recording.valid]
    return STAMP_SECONDS + 4.0 * float(np.spacing(np.max(np.abs(time), initial=0.0)))
