"""Whether a recording can be trusted: one report of its clock, its columns, and what has to follow from what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings import frozen, relations
from hapticeval.recordings.finding import Fault, Severity
from hapticeval.recordings.inverse import Check, Kinematics
from hapticeval.recordings.inverse_checks import inverse_checks
from hapticeval.recordings.losses import told_losses, told_warnings
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.rows import runs_of
from hapticeval.recordings.signal_faults import examine_column, examine_numbers, quantum
from hapticeval.recordings.signs import Sign, force_signs
from hapticeval.recordings.stretches import joined, stretches
from hapticeval.recordings.time_unit import time_unit
from hapticeval.recordings.timing import Timing, examine_timing
from hapticeval.recordings.wall import LINE, before_the_wall
from hapticeval.types import Array, BoolArray

HELD = ("N", "N m")
"""Units of what jumps by nature: forces and torques."""

LEFT_OUT = ("stuck", "spike", "jump")
"""Findings whose rows are no measurement of the hand, though they are valid: checks leave them out."""


@dataclass(frozen=True)
class ColumnFacts:
    """A column at a glance: unit, range over the valid rows, and the quantum of its lattice, if it has one."""

    unit: str
    low: float
    high: float
    quantum: float | None


@dataclass(frozen=True)
class Interval:
    """Rows [first, end) and their times, s."""

    first: int
    end: int
    time: tuple[float, float]


@dataclass(frozen=True)
class Soundness:
    """What checks may use, and what was left out and why."""

    sound: tuple[Interval, ...]
    left_out: tuple[tuple[Interval, str], ...]

    def rows(self, count: int) -> BoolArray:
        """True where a row is sound, (count,)."""
        mask = np.zeros(count, dtype=bool)
        for interval in self.sound:
            mask[interval.first : interval.end] = True
        return mask


@dataclass(frozen=True)
class Integrity:
    """The report: what the clock and the columns are like, the findings, worst and earliest first, what is known of the
    signs of the forces, and the inverse checks that were made, or asked for and not made."""

    rows: int
    valid_rows: int
    duration: float
    timing: Timing
    columns: Mapping[str, ColumnFacts]
    faults: tuple[Fault, ...] = field(default=())
    signs: tuple[Sign, ...] = ()
    checks: tuple[Check, ...] = ()

    @property
    def suspicious(self) -> bool:
        """Whether anything was found that a person should look at."""
        return any(fault.severity is not Severity.NOTE for fault in self.faults)


def examine(
    recording: Recording,
    *,
    device: Kinematics | None = None,
    model: Model | None = None,
    stiffness: float | None = None,
    others: Mapping[str, Recording] | None = None,
) -> Integrity:
    """Examine a recording. With a `device`, a `model` or a `stiffness` K_p (N/m, where K_d = 0) also the inverse checks
    of thesis (2.28), (2.8) and (6.1); with `others`, runs by name, whether it shares a signal with one of them.
    """
    stamps = recording.nanoseconds
    start = 0 if recording.clock is None or recording.clock.start is None else recording.clock.start
    declared = recording.meta.get("dt")
    ordered = recording.measured
    timing, faults = examine_timing(
        stamps,
        start=start,
        declared_step=float(declared) if isinstance(declared, int | float) else None,
        valid=recording.valid,
        sequence=None if recording.clock is None else recording.clock.sequence,
        joined=joined(recording),
    )
    faults += _counted(recording)
    columns = {}
    parts: dict[str, dict[str, Array]] = {}
    for name, values in relations.columns_of(recording).items():
        channel = name if name in recording.signals else name.rpartition(".")[0]
        parts.setdefault(channel, {})[name] = values
        unit = recording.signals[channel].unit
        kept = values[ordered & np.isfinite(values)]
        if kept.size:
            columns[name] = ColumnFacts(unit, float(kept.min()), float(kept.max()), quantum(kept))
        faults += examine_column(
            name,
            values,
            recording.time,
            ordered,
            held=unit in HELD,
            rests=channel == "ihip",
            place=unit in ("m", "rad") and channel != "ihip",
        )
    for channel, each in parts.items():
        faults += examine_numbers(channel, each, recording.time)
    faults += frozen.frozen(recording, faults) + frozen.repeated_rows(recording)
    faults += relations.copies(recording)
    faults += relations.velocities(recording)
    faults += relations.force_lag(recording)
    faults += relations.units(recording) + time_unit(recording)
    signs, turned = force_signs(recording)
    faults += turned
    for name, other in (others or {}).items():
        faults += relations.of_another_run(recording, other, name)
    walled = model is not None and model.name == LINE and recording.dimension == 1
    placed = before_the_wall(recording) if walled else recording
    checks = inverse_checks(placed, device=device, model=model, stiffness=stiffness)
    faults += [fault for check in checks for fault in check.faults]
    order = list(Severity)
    faults.sort(key=lambda fault: (order.index(fault.severity), fault.first if fault.first is not None else -1))
    times = recording.time[ordered]
    return Integrity(
        rows=len(recording),
        valid_rows=int(np.sum(ordered)),
        duration=float(times[-1] - times[0]) if times.size else 0.0,
        timing=timing,
        columns=columns,
        faults=tuple(faults),
        signs=signs,
        checks=checks,
    )


def sound_intervals(recording: Recording, report: Integrity | None = None) -> Soundness:
    """The stretches that checks may use, of two rows or more: valid, without a hole in the clock that no late answer
    reaches over (`GAP_STEPS`), and without the rows of a finding that is no measurement. And what was left out, and
    why.
    """
    report = examine(recording) if report is None else report
    keep = recording.measured.copy()
    left = [(span, "no measurement") for span in runs_of(~keep)]
    for fault in report.faults:
        if fault.first is None or fault.end is None or fault.kind not in LEFT_OUT:
            continue
        if keep[fault.first : fault.end].any():
            keep[fault.first : fault.end] = False
            left.append(((fault.first, fault.end), f"{fault.kind} in {fault.channel}"))
    sound = [(stretch.first, stretch.end) for stretch in stretches(recording, keep)]
    for first, end in sound:
        keep[first:end] = False
    left += [(span, "a row by itself") for span in runs_of(keep)]
    return Soundness(
        tuple(_interval(recording.time, *span) for span in sound),
        tuple((_interval(recording.time, *span), why) for span, why in sorted(left)),
    )


def _counted(recording: Recording) -> list[Fault]:
    """What the clock counted, and what the import said."""
    faults = []
    missed = None if recording.clock is None else recording.clock.missed
    if missed:
        faults.append(
            Fault("missed", Severity.SUSPICIOUS, f"{missed} cycles of the loop have no row", "see the logger", "time")
        )
    for event in recording.events:
        if event.kind == "ended":
            faults.append(Fault("ended", Severity.NOTE, event.text))
    for kind, texts in (("lost", told_losses(recording)), ("import", told_warnings(recording))):
        faults += [Fault(kind, Severity.SUSPICIOUS, text, "copy or record the file again") for text in texts]
    declared = recording.meta.get("rows")
    if isinstance(declared, int) and declared != len(recording):
        message = f"{declared} rows are declared, {len(recording)} are there"
        faults.append(Fault("rows", Severity.SUSPICIOUS, message, "copy or record the file again"))
    return faults


def _interval(time: Array, first: int, end: int) -> Interval:
    return Interval(first, end, (float(time[first]), float(time[end - 1])))
