"""Reports on recordings as text: what was examined, what was found, what was left out."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hapticeval.recordings.finding import Severity, plural
from hapticeval.recordings.impact import Impacts
from hapticeval.recordings.integrity import Integrity, Interval, Soundness
from hapticeval.recordings.losses import told_losses, told_warnings
from hapticeval.recordings.recording import Recording

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
