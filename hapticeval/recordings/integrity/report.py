"""Whether a recording can be trusted: the examination of clock, columns and relations, and its report as text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.integrity.columns import examine_column, examine_numbers, frozen, repeated_rows
from hapticeval.recordings.integrity.consistency import Check, Kinematics, inverse_checks
from hapticeval.recordings.integrity.contacts import Impacts
from hapticeval.recordings.integrity.force_sign import Sign, force_signs
from hapticeval.recordings.integrity.issue import Fault, Severity, plural
from hapticeval.recordings.integrity.relations import (
    copies,
    force_lag,
    of_another_run,
    time_unit,
    units,
    velocities,
)
from hapticeval.recordings.integrity.timing import Timing, examine_timing
from hapticeval.recordings.provenance import LINE, before_the_wall
from hapticeval.recordings.quantization import quantum
from hapticeval.recordings.recording import Recording, columns_of, runs_of
from hapticeval.recordings.salvage import told_losses, told_warnings
from hapticeval.recordings.stretches import joined, stretches
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
    for name, (channel, unit, values) in columns_of(recording).items():
        parts.setdefault(channel, {})[name] = values
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
    faults += frozen(recording, faults) + repeated_rows(recording)
    faults += copies(recording)
    faults += velocities(recording)
    faults += force_lag(recording)
    faults += units(recording) + time_unit(recording)
    signs, turned = force_signs(recording)
    faults += turned
    for name, other in (others or {}).items():
        faults += of_another_run(recording, other, name)
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


MOST = 5
"""Findings of one kind and channel beyond so many are counted, not listed."""


def summary(report: Integrity, soundness: Soundness, *, title: str) -> str:
    """The whole report: clock, columns, findings, and the intervals that checks may use."""
    timing = report.timing
    jitter = ", ".join(f"{1e6 * value:.4g}" for value in timing.jitter)
    lines = [
        f"{title}: {report.valid_rows} of {report.rows} rows are measurements, over {report.duration:.6g} s",
        f"clock: {timing.rate:.6g} Hz, median step {1e3 * timing.step:.6g} ms, between gaps off by {jitter} us "
        "(50, 95, 99, 100 % of the steps)"
        if timing.step > 0.0
        else "clock: no two rows follow each other, which tell no rate",
    ]
    if timing.missing:
        lines.append(f"       in gaps about {plural(timing.missing, 'row')} missing, {timing.missing_seconds:.4g} s")
    lines += ["", *_aligned([
        ("column", "unit", "lowest", "highest", "quantum"),
        *((name, facts.unit, f"{facts.low:.6g}", f"{facts.high:.6g}",
           "-" if facts.quantum is None else f"{facts.quantum:.6g}") for name, facts in report.columns.items()),
    ])]  # fmt: skip
    lines += ["", *_faults(report), "", *_checks(report)]
    lines += ["", *(f"sign of {each.channel}: {each.words}" for each in report.signs), *_intervals(report, soundness)]
    return "\n".join(lines)


def _faults(report: Integrity) -> list[str]:
    if not report.faults:
        open_ = sum(not check.made for check in report.checks)
        return ["nothing found" + f"; what {open_} of the inverse checks would tell is open: see below" * (open_ > 0)]
    lines = []
    counts: dict[tuple[str, str], int] = {}
    advised: set[tuple[str, str, str]] = set()
    for fault in report.faults:
        key = (fault.kind, fault.channel)
        counts[key] = counts.get(key, 0) + 1
        if counts[key] > MOST:
            continue
        name = " ".join(part for part in (fault.kind, fault.channel) if part)
        lines.append(f"{fault.severity}: {name} ({fault.place}): {fault.message}")
        if fault.todo and fault.severity is not Severity.NOTE and (*key, fault.todo) not in advised:
            advised.add((*key, fault.todo))
            lines.append(f"  what to do: {fault.todo}")
    lines += [
        f"and {count - MOST} more, marked in the picture: {kind} {channel}".rstrip()
        for (kind, channel), count in counts.items()
        if count > MOST
    ]
    return lines


def _checks(report: Integrity) -> list[str]:
    """Which inverse checks were made, with their residuals, and which were not."""
    made = [check for check in report.checks if check.made]
    lines = _aligned([
        ("inverse check", "what should hold", "largest residual", "in quanta", "rows", "found"),
        *((check.name, check.relation, f"{check.largest:.3g} {check.unit}",
           f"{check.largest / check.quantum:.3g}" if check.quantum > 0.0 else "-", f"{check.rows}",
           "contradicted" if check.faults else "holds") for check in made),
    ]) if made else []  # fmt: skip
    lines += [f"not checked: {check.name}: {check.why}" for check in report.checks if not check.made]
    return lines or ["inverse checks: none, as no device, model or stiffness is given or told by the recording"]


def _intervals(report: Integrity, soundness: Soundness) -> list[str]:
    spans = soundness.sound
    shown = ", ".join(f"{span.time[0]:.6g} to {span.time[1]:.6g} s{_lacking(report, span)}" for span in spans[:MOST])
    more = f" and {len(spans) - MOST} more, shown in the picture" if len(spans) > MOST else ""
    lines = [f"sound: {shown}{more}" if spans else "sound: nothing"]
    reasons: dict[str, list[int]] = {}
    for span, why in soundness.left_out:
        reasons.setdefault(why, []).append(span.end - span.first)
    lines += [
        f"left out: {plural(sum(rows), 'row')} in {plural(len(rows), 'place')}: {why}" for why, rows in reasons.items()
    ]
    return lines


def _lacking(report: Integrity, span: Interval) -> str:
    """How many rows a sound stretch lacks in gaps that checks go across."""
    counts = [
        int(fault.measures["missing"])
        for fault in report.faults
        if fault.kind == "gap" and fault.first is not None and span.first <= fault.first < span.end - 1
    ]
    return f" (but for {plural(sum(counts), 'row')} missing in {plural(len(counts), 'short gap')})" if counts else ""


def contacts(found: Impacts) -> str:
    """The contacts of a recording in one dimension, each with its standard errors, and their means with 95 per cent
    intervals: how far the contacts differ, which may be more than the error of any one of them."""
    lines = [
        f"contacts above {found.floor:.4g} N: {len(found.contacts)}"
        + (
            f"; at {_times(found.unexplained)} a force rose though the tool was not moving into the wall"
            if found.unexplained
            else ""
        )
    ]
    if not found.contacts:
        return lines[0]
    rows: list[Sequence[str]] = [
        (
            "begin s",
            "for ms",
            "peak N",
            "depth mm",
            "impulse N s",
            "stiffness N/m",
            "std. error",
            "in m/s",
            "out m/s",
            "restitution",
            "std. error",
        )
    ]
    rows += [
        (
            f"{each.begin:.4f}",
            f"{1e3 * each.duration:.3g}",
            f"{each.peak:.3g}",
            f"{1e3 * each.depth:.3g}",
            f"{each.impulse:.3g}",
            _known(each.stiffness),
            _known(each.stiffness_error, 2),
            f"{each.speed_before:.3g}",
            _known(each.speed_after),
            _known(each.restitution),
            _known(each.restitution_error, 2),
        )
        for each in found.contacts
    ]
    lines += _aligned(rows)
    lines.append("peak, impulse and stiffness are above what the sensor read just before each touch")
    for measure, unit in (("impulse", "N s"), ("stiffness", "N/m"), ("restitution", "")):
        mean, half = found.mean(measure)
        if math.isfinite(mean):
            interval = f" ± {_number(half, 2)}" if math.isfinite(half) else ""
            lines.append(f"{measure}: {_number(mean)}{interval} {unit}".rstrip() + " (mean, 95 %)" * bool(interval))
        else:
            lines.append(f"{measure}: none, as the contacts last so long that the hand pushes through them")
    return "\n".join(lines)


def converted(recording: Recording) -> str:
    """What a conversion made: rows, channels, and which rows are no measurement."""
    said = recording.meta.get("import", {})
    missed = None if recording.clock is None else recording.clock.missed
    lines = [
        f"{len(recording)} rows, {recording.time[-1] - recording.time[0]:.6g} s: {', '.join(recording.channels)}",
        *(f"no measurement: {plural(count, 'row')} {why}" for why, count in said.get("left out", {}).items()),
        *(f"remark: {text}" for text in said.get("cells", ())),
        *([f"missed: {plural(missed, 'cycle')} of the loop without a row"] if missed else []),
        *(f"ended: {event.text}" for event in recording.events if event.kind == "ended"),
        *(f"suspicious: {text}" for text in told_losses(recording) + told_warnings(recording)),
    ]
    return "\n".join(lines)


def _known(value: float, digits: int = 3) -> str:
    return _number(value, digits) if math.isfinite(value) else "-"


def _number(value: float, digits: int = 3) -> str:
    """Significant digits without an exponent."""
    return f"{float(f'{value:.{digits}g}'):g}"


def _times(times: Sequence[float]) -> str:
    return ", ".join(f"{time:.4g} s" for time in times)


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
