"""How regular a clock is: rate, jitter, gaps, repeated stamps and stamps that go back; and rows that are not there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hapticeval.quantity import plural
from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.integrity.issue import ADVICE, Issue, Severity, make_issue
from hapticeval.recordings.provenance import describe_losses, describe_warnings
from hapticeval.recordings.quantization import coarsest
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import GAP_STEPS, continuing_steps
from hapticeval.types import IntArray

CATCH_UP_ROWS = 3
"""A late row is not a gap where the clock is on its grid again after as many rows: nothing is missing then."""

DROPPED_STEP, DROPPED_TOLERANCE = 2.0, 0.15
"""A hand's step over one row that is missing is so many times those beside it, which agree: each within that share."""

DROPPED_QUANTA, FEWEST_DROPPED = 10.0, 10
"""Steps of fewer quanta are too coarse to tell, and fewer such places may be chance."""

HALF_STEP = 0.5
"""Half a sampling time decides whether a row is missing or late."""

RATE_TOLERANCE = 0.01
"""A quartz is within 1e-4 of its rate, so one per cent is another setting than the declared one."""

BRIDGED = f"no longer than {GAP_STEPS} steps, so checks, replays and comparisons go on across it as over one long step"
PARTED = "checks, replays and comparisons end before it and begin anew after it"
"""What becomes of a gap: see `stretches`."""


@dataclass(frozen=True)
class Timing:
    """The median step (s), the mean rate (Hz) of cycles, and the deviation of steps from the median, s, at 50, 95, 99
    and 100 per cent; `missing` rows and the seconds that they would have taken."""

    step: float = 0.0
    rate: float = 0.0
    jitter: tuple[float, ...] = (0.0,) * 4
    missing: int = 0
    missing_seconds: float = 0.0


def examine_timing(recording: Recording) -> tuple[Timing, list[Issue]]:
    """Return the timing of a recording's stamps, in the order in which they were recorded, and what is wrong with it.

    A gap beside rows that are not a measurement is a note. "bridged" in its measures and its advice follow from
    `stretches.continuing_steps`. How many rows are missing follows from the cycle numbers, where there are any, or else
    from how long the gap is; the rate is that of all cycles, or else that of the rows between gaps.
    """
    stamps, measured, bridges = recording.nanoseconds, recording.measured, continuing_steps(recording)
    sequence = None if recording.clock is None else recording.clock.sequence
    # ns, in the order of the rows: zero repeats a stamp, a negative one goes back.
    steps = np.diff(stamps)
    rising = steps[steps > 0]
    if rising.size == 0:
        return Timing(), list(_stated_issues(recording))
    median = float(np.median(rising))
    issues = []
    for row in np.flatnonzero(steps <= 0).tolist():
        kind, message = "duplicate", f"the time repeats that of row {row}"
        if steps[row] < 0:
            kind, message = "reversal", f"the time goes back by {-1e-9 * steps[row]:.6g} s"
        todo = None if measured[row + 1] else "it is marked as no measurement already, and left out"
        issues.append(make_issue(recording, kind, message, "time", (row + 1, row + 2), todo=todo))
    # `cycle` is in ns; `gaps` gives for each row how many are missing after it.
    cycle, gaps = _gaps(stamps, steps, sequence, median)
    for row, count in gaps.items():
        between_measurements = bool(measured[row : row + 2].all())
        bridged = between_measurements and bool(bridges[row])
        message = f"{'about ' if sequence is None else ''}{plural(count, 'row')} missing ({1e-9 * count * cycle:.4g} s)"
        issues.append(
            make_issue(
                recording, "gap", message, "time", (row, row + 2),
                severity=None if between_measurements else Severity.NOTE,
                todo=f"{BRIDGED if bridged else PARTED}; {ADVICE['gap']}", missing=count, bridged=bridged,
            )
        )  # fmt: skip
    missing = sum(gaps.values())
    # Jitter and rate are those of the clock between gaps.
    regular = np.delete(steps, list(gaps))
    regular = regular[regular > 0]
    off = np.abs(regular - median) * 1e-9 if regular.size else np.zeros(1)
    mean = 1e-9 * float(np.mean(regular)) if regular.size else 1e-9 * median
    if sequence is not None and sequence[-1] > sequence[0] and stamps[-1] > stamps[0]:
        # A row after a gap is late as a rule, and the next step short: only all cycles together have no bias.
        mean = 1e-9 * float(stamps[-1] - stamps[0]) / float(sequence[-1] - sequence[0])
    jitter = tuple(np.percentile(off, [50, 95, 99, 100]).tolist())
    timing = Timing(median * 1e-9, 1.0 / mean, jitter, missing, 1e-9 * missing * cycle)
    declared_step = recording.meta.get("dt")
    if isinstance(declared_step, int | float) and abs(mean - declared_step) > RATE_TOLERANCE * declared_step:
        message = f"the loop was meant to take {1e3 * declared_step:.6g} ms, its rows are {1e3 * mean:.6g} ms apart"
        issues.append(make_issue(recording, "rate", message, "time"))
    return timing, [*issues, *_stated_issues(recording)]


def _gaps(stamps: IntArray, steps: IntArray, sequence: IntArray | None, median: float) -> tuple[float, dict[int, int]]:
    """Return what a cycle takes, ns, and the rows after which some are missing, with how many.

    Cycle numbers know which rows are missing, and which are only late. Where most cycles have no row, a cycle is
    shorter than the step from row to row.
    """
    if sequence is None:
        late = np.flatnonzero(steps > (1.0 + HALF_STEP) * median).tolist()
        gap_rows = [row for row in late if not _caught_up(stamps, row, median)]
        return median, {row: round(float(steps[row]) / median) - 1 for row in gap_rows}
    jumps = np.diff(sequence)
    # ns a cycle, where rows are several cycles apart.
    counted = jumps > 0
    cycle = float(np.median(steps[counted] / jumps[counted])) if counted.any() else median
    skipped = np.flatnonzero((jumps > 1) & (steps > (1.0 + HALF_STEP) * cycle)).tolist()
    return cycle, {row: int(jumps[row]) - 1 for row in skipped}


def dropped_rows(recording: Recording) -> Iterator[Issue]:
    """Yield an issue where single steps of the hand are twice those beside them: the times do not show that rows lack.

    A hand has mass: its steps change by little from row to row. A rate that is stated in place of a clock hides gaps.
    """
    if recording.meta.get("source") in SIMULATED or "hip" not in recording.channels or len(recording) < 4:
        return
    moved = np.diff(recording.hip, axis=0)
    moved[~(recording.measured[1:] & recording.measured[:-1])] = np.nan
    seconds = np.diff(recording.time)
    before, step, after = moved[:-2], moved[1:-1], moved[2:]
    usual_step = 0.5 * (before + after)
    size = np.linalg.norm(usual_step, axis=1)
    agree = np.linalg.norm(after - before, axis=1) < DROPPED_TOLERANCE * size
    double = np.linalg.norm(step - DROPPED_STEP * usual_step, axis=1) < DROPPED_TOLERANCE * size
    even = np.abs(seconds[1:-1] - np.median(seconds)) < HALF_STEP * np.median(seconds)
    clear = agree & even & (size > DROPPED_QUANTA * coarsest(recording.hip))
    places = np.flatnonzero(clear & double)
    if places.size >= FEWEST_DROPPED:
        share = 100.0 * places.size / max(int(np.count_nonzero(clear)), 1)
        message = (
            f"at {places.size} places the hand goes twice as far in a row as in those beside it, first at row "
            f"{places[0] + 2}: about {share:.2g} % of the rows are missing, and the times do not show it"
        )
        yield make_issue(recording, "dropped rows", message, "time", rows=int(places.size))


def _caught_up(stamps: IntArray, row: int, median: float) -> bool:
    """Return whether the rows after a long step make up for it: then it was late, and nothing is missing."""
    # Row `row + i` is back on the clock's grid where it is no more than i + 1/2 medians later.
    after = np.arange(row + 2, min(row + 1 + CATCH_UP_ROWS, stamps.size - 1) + 1)
    return bool(np.any(stamps[after] - stamps[row] < (after - row + HALF_STEP) * median))


def _stated_issues(recording: Recording) -> Iterator[Issue]:
    """Yield what the clock counted, what the run's events and its import state, and a number of rows that differs."""
    missed = None if recording.clock is None else recording.clock.missed
    if missed:
        yield make_issue(recording, "missed", f"{missed} cycles of the loop have no row", "time")
    for event in recording.events:
        if event.kind == "ended":
            yield make_issue(recording, "ended", event.text)
    for kind, texts in (("lost", describe_losses(recording)), ("import", describe_warnings(recording))):
        yield from (make_issue(recording, kind, text) for text in texts)
    declared = recording.meta.get("rows")
    if isinstance(declared, int) and declared != len(recording):
        yield make_issue(recording, "rows", f"{declared} rows are declared, {len(recording)} are there")
