"""How regular a clock is: rate, jitter, gaps, repeated stamps and stamps that go back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.recordings.integrity.issue import Fault, Severity
from hapticeval.recordings.stretches import GAP_STEPS
from hapticeval.types import Array, BoolArray, IntArray

CATCH_UP = 3
"""A late row is no gap where the clock is on its grid again after as many rows: nothing is missing then."""

HALF = 0.5
"""Half a sampling time decides whether a row is missing or late."""

BRIDGED = f"no longer than {GAP_STEPS} steps, so checks, replays and comparisons go on across it as over one long step"
PARTED = "checks, replays and comparisons end before it and begin anew after it"
"""What becomes of a gap: see `stretches`."""

SETTING = 0.01
"""A quartz is within 1e-4 of its rate, so one per cent is another setting than the declared one."""


@dataclass(frozen=True)
class Timing:
    """Of `rows` stamps: the median step (s), the mean rate (Hz) of cycles, and the deviation of steps from the median,
    s, at 50, 95, 99 and 100 per cent; `missing` rows and the seconds that they would have taken."""

    rows: int
    step: float
    rate: float
    jitter: tuple[float, float, float, float]
    missing: int
    missing_seconds: float


def examine_timing(
    stamps: IntArray,
    *,
    start: int = 0,
    declared_step: float | None = None,
    valid: BoolArray | None = None,
    sequence: IntArray | None = None,
    joined: BoolArray | None = None,
) -> tuple[Timing, list[Fault]]:
    """The timing of stamps (n,), ns, in the order in which they were recorded, and what is wrong with it.

    Times in findings count from `start` (ns). `declared_step` (s) is what the loop was meant to take. A gap beside rows
    that are not `valid` is a note. `joined` (n - 1,) says over which steps readers of the recording go on, as
    `stretches.joined` does; the advice tells it, and so does "bridged" in the measures. How many rows are missing is
    told by the cycle numbers `sequence` (n,), where there are any, or else by how long the gap is; the rate is that of
    all cycles, or else that of the rows between gaps.
    """
    seconds: Array = (stamps - start) / 1e9
    steps = np.diff(stamps)
    rising = steps[steps > 0]
    if rising.size == 0:
        return Timing(int(stamps.size), 0.0, 0.0, (0.0,) * 4, 0, 0.0), []
    median = float(np.median(rising))
    faults = []
    for row in np.flatnonzero(steps <= 0) + 1:
        again = steps[row - 1] == 0
        faults.append(
            Fault(
                "duplicate" if again else "reversal",
                Severity.FAULT,
                f"the time repeats that of row {row - 1}"
                if again
                else f"the time goes back by {-1e-9 * steps[row - 1]:.6g} s",
                "it is marked as no measurement already, and left out"
                if valid is not None and not valid[row]
                else 'convert with [time] disorder = "mask", which marks the row as no measurement; or mend the file',
                "time",
                int(row),
                int(row) + 1,
                (float(seconds[row]),) * 2,
            )
        )
    cycle = median if sequence is None else _cycle(sequence, steps, median)
    gaps = _gaps(stamps, steps, median) if sequence is None else _counted(sequence, steps, cycle)
    for place, count in gaps.items():
        lost = 1e-9 * count * cycle
        beside = valid is None or bool(valid[place : place + 2].all())
        bridged = beside and joined is not None and bool(joined[place])
        faults.append(
            Fault(
                "gap",
                Severity.SUSPICIOUS if beside else Severity.NOTE,
                f"{'about ' * (sequence is None)}{count} row{'s' * (count != 1)} missing ({lost:.4g} s)",
                f"{BRIDGED if bridged else PARTED}; see whether the loop or the logger was late",
                "time",
                place,
                place + 2,
                (float(seconds[place]), float(seconds[place + 1])),
                {"missing": count, "bridged": bridged},
            )
        )
    missing = sum(gaps.values())
    lost = 1e-9 * missing * cycle
    regular = np.delete(steps, list(gaps))
    regular = regular[regular > 0]
    off = np.abs(regular - median) * 1e-9 if regular.size else np.zeros(1)
    jitter = tuple(float(value) for value in np.percentile(off, [50, 95, 99, 100]))
    mean = 1e-9 * float(np.mean(regular)) if regular.size else 1e-9 * median
    if sequence is not None and sequence[-1] > sequence[0] and stamps[-1] > stamps[0]:
        # A row after a gap is late as a rule, and the next step short: only all cycles together have no bias.
        mean = 1e-9 * float(stamps[-1] - stamps[0]) / float(sequence[-1] - sequence[0])
    timing = Timing(int(stamps.size), median * 1e-9, 1.0 / mean, jitter, missing, lost)  # type: ignore[arg-type]
    if declared_step is not None and abs(mean - declared_step) > SETTING * declared_step:
        faults.append(
            Fault(
                "rate",
                Severity.SUSPICIOUS,
                f"the loop was meant to take {1e3 * declared_step:.6g} ms, its rows are {1e3 * mean:.6g} ms apart",
                "see whether every cycle was logged, and whether the unit of time is right",
                "time",
                measures={"declared": declared_step, "found": mean},
            )
        )
    return timing, faults


def _gaps(stamps: IntArray, steps: IntArray, median: float) -> dict[int, int]:
    """Rows after which some are missing, and how many, by the length of the steps."""
    late = np.flatnonzero(steps > (1.0 + HALF) * median)
    return {int(row): round(float(steps[row]) / median) - 1 for row in late if not _caught_up(stamps, int(row), median)}


def _cycle(sequence: IntArray, steps: IntArray, median: float) -> float:
    """What a cycle of the loop takes, ns: where most cycles have no row, the step from row to row is longer."""
    jumps = np.diff(sequence)
    return float(np.median(steps[jumps > 0] / jumps[jumps > 0])) if np.any(jumps > 0) else median


def _counted(sequence: IntArray, steps: IntArray, cycle: float) -> dict[int, int]:
    """The same by the numbers of the cycles, which know: a row that is only late is there."""
    jumps = np.diff(sequence)
    return {int(row): int(jumps[row]) - 1 for row in np.flatnonzero((jumps > 1) & (steps > (1.0 + HALF) * cycle))}


def _caught_up(stamps: IntArray, row: int, median: float) -> bool:
    """Whether the rows after a long step make up for it: then it was late, and nothing is missing."""
    last = min(row + 1 + CATCH_UP, stamps.size - 1)
    after = np.arange(row + 2, last + 1)
    return bool(np.any(stamps[after] - stamps[row] < (after - row + HALF) * median))
