"""Whether a recording can be trusted: the examination of clock, columns and relations, and its report as text.

Where a relation to the model does not hold, the diagnosis names the cause behind it, see `explained`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.quantity import align_columns, format_number, plural
from hapticeval.recordings.integrity import columns, relations
from hapticeval.recordings.integrity.consistency import (
    CONTACT_RELATION,
    IMPLIED_RELATION,
    SPRING_RELATION,
    ConsistencyTest,
    Kinematics,
    inverse_checks,
)
from hapticeval.recordings.integrity.contacts import Impact, Impacts
from hapticeval.recordings.integrity.issue import Issue, Severity, no_measurement
from hapticeval.recordings.integrity.timing import Timing, dropped_rows, examine_timing
from hapticeval.recordings.provenance import LINE_MODEL, before_the_wall, describe_losses, describe_warnings
from hapticeval.recordings.quantization import numeric_step
from hapticeval.recordings.recording import Recording, columns_of, runs_of
from hapticeval.recordings.stretches import Stretch, stretches
from hapticeval.types import BoolArray

DETECTORS: tuple[Callable[[Recording], Iterable[Issue]], ...] = (
    columns.repeated_rows,
    columns.still_hand,
    dropped_rows,
    relations.copies,
    relations.velocities,
    relations.force_lag,
    relations.units,
    relations.time_unit,
)
"""What looks for issues in a whole recording; clock, single columns and inverse checks come beside them."""


class ColumnFacts(NamedTuple):
    """A column at a glance: unit, range over the valid rows, and the quantum of its lattice, if it has one."""

    unit: str
    low: float
    high: float
    quantum: float | None


@dataclass(frozen=True)
class Soundness:
    """What checks may use of a recording, and what was left out and why."""

    recording: Recording
    sound: tuple[Stretch, ...]
    left_out: tuple[tuple[Stretch, str], ...]

    def rows(self, count: int) -> BoolArray:
        """Return a mask, True where a row is sound, (count,)."""
        mask = np.zeros(count, dtype=bool)
        for stretch in self.sound:
            mask[stretch.rows] = True
        return mask


@dataclass(frozen=True)
class Integrity:
    """What an examination of a recording found.

    - `timing` and `columns`: what the clock and the columns are like;
    - `issues`: what is wrong or good to know, worst and earliest first;
    - `checks`: the inverse checks that were made, or asked for and not made.
    """

    rows: int
    valid_rows: int
    duration: float
    timing: Timing
    columns: Mapping[str, ColumnFacts]
    issues: tuple[Issue, ...] = ()
    checks: tuple[ConsistencyTest, ...] = ()

    @property
    def suspicious(self) -> bool:
        """Whether anything was found that a person should look at."""
        return any(issue.severity is not Severity.NOTE for issue in self.issues)


def examine(
    recording: Recording,
    *,
    device: Kinematics | None = None,
    model: Model | None = None,
    stiffness: float | None = None,
    others: Mapping[str, Recording] | None = None,
) -> Integrity:
    """Examine a recording: its clock, its columns, and how they relate.

    With a `device`, a `model` or a `stiffness` K_p (N/m, where K_d = 0) also the inverse checks of thesis (2.28), (2.8)
    and (6.1); with `others`, runs by name, whether it shares a signal with one of them.
    """
    ordered = recording.measured
    facts = {}
    for name, column in columns_of(recording).items():
        numbers = column.values[ordered & np.isfinite(column.values)]
        if numbers.size:
            # A column without a single number has no range, and an issue says so.
            facts[name] = ColumnFacts(column.unit, float(numbers.min()), float(numbers.max()), numeric_step(numbers))
    timing, issues = examine_timing(recording)
    issues += [*columns.issues_of_values(recording), *columns.issues_of_numbers(recording)]
    # Rows that are found to be stuck already need no second one.
    issues += columns.issues_of_rest(recording, list(issues))
    for detect in DETECTORS:
        issues += detect(recording)
    for name, other in (others or {}).items():
        issues += relations.of_another_run(recording, other, name)
    # A run in one dimension is held against the wall in the plane: see `before_the_wall`.
    walled = model is not None and model.name == LINE_MODEL and recording.dimension == 1
    placed = before_the_wall(recording) if walled else recording
    checks = inverse_checks(placed, device=device, model=model, stiffness=stiffness)
    issues = list(
        explained(placed, [*issues, *(issue for check in checks for issue in check.issues)], model, stiffness)
    )
    # Worst first, then by row; what concerns the whole recording stands before the rows.
    order = list(Severity)
    issues.sort(key=lambda issue: (order.index(issue.severity), issue.first if issue.first is not None else -1))
    duration = float(np.ptp(recording.time[ordered])) if ordered.any() else 0.0
    return Integrity(len(recording), int(np.sum(ordered)), duration, timing, facts, tuple(issues), checks)


def sound_intervals(recording: Recording, report: Integrity | None = None) -> Soundness:
    """Return the stretches that checks may use, of two rows or more, and what was left out, and why.

    They are valid, without a hole in the clock that no late answer reaches over (`GAP_STEPS`), and without the rows of
    an issue that is not a measurement.
    """
    report = examine(recording) if report is None else report
    keep = recording.measured.copy()
    # Why rows are left out: marked as no measurement, named by an issue, or alone between others.
    left = [(span, "no measurement") for span in runs_of(~keep)]
    for issue in report.issues:
        if no_measurement(issue) and keep[issue.first : issue.end].any():
            keep[issue.first : issue.end] = False
            left.append(((issue.first or 0, issue.end or 0), f"{issue.kind} in {issue.channel}"))
    sound = stretches(recording, keep)
    for stretch in sound:
        keep[stretch.rows] = False
    # What is kept now lies in no stretch of two rows: nothing can be differenced there.
    left += [(span, "a row by itself") for span in runs_of(keep)]
    return Soundness(recording, sound, tuple((Stretch(*span), why) for span, why in sorted(left)))


MOST_LISTED_ISSUES = 5
"""Issues of one kind and channel beyond so many are counted, not listed."""


def describe_report(report: Integrity, soundness: Soundness, *, title: str) -> str:
    """Describe the whole report: clock, columns, issues, and the intervals that checks may use."""
    timing = report.timing
    jitter = ", ".join(f"{1e6 * value:.4g}" for value in timing.jitter)
    lines = [
        f"{title}: {report.valid_rows} of {report.rows} rows are measurements, over {report.duration:.6g} s",
        f"clock: {timing.rate:.6g} Hz, median step {1e3 * timing.step:.6g} ms, between gaps off by {jitter} us "
        "(50, 95, 99, 100 % of the steps)"
        if timing.step > 0.0
        else "clock: no two rows follow each other, so it has no known rate",
    ]
    if timing.missing:
        lines.append(f"       in gaps about {plural(timing.missing, 'row')} missing, {timing.missing_seconds:.4g} s")
    lines += ["", *align_columns([
        ("column", "unit", "lowest", "highest", "quantum"),
        *((name, unit, f"{low:.6g}", f"{high:.6g}", "-" if step is None else f"{step:.6g}")
          for name, (unit, low, high, step) in report.columns.items()),
    ])]  # fmt: skip
    lines += ["", *_issues(report), "", *_checks(report)]
    lines += ["", *_intervals(report, soundness)]
    return "\n".join(lines)


def _issues(report: Integrity) -> list[str]:
    """Return the issues as lines: the first few of a kind and channel, with advice, and how many more there are."""
    if not report.issues:
        open_ = sum(not check.made for check in report.checks)
        is_open = f"; what {open_} of the inverse checks would find is open: see below" if open_ else ""
        return [f"nothing found{is_open}"]
    lines = []
    counts: dict[tuple[str, str], int] = {}
    advised: set[tuple[str, str, str]] = set()
    for issue in report.issues:
        key = (issue.kind, issue.channel)
        # The first few of one kind and channel say it all: count the others.
        counts[key] = counts.get(key, 0) + 1
        if counts[key] > MOST_LISTED_ISSUES:
            continue
        lines.append(f"{issue.severity}: {' '.join(key).rstrip()} ({issue.place}): {issue.message}")
        if issue.todo and issue.severity is not Severity.NOTE and (*key, issue.todo) not in advised:
            # The same advice is given once for a kind and channel.
            advised.add((*key, issue.todo))
            lines.append(f"  what to do: {issue.todo}")
    more = {key: count - MOST_LISTED_ISSUES for key, count in counts.items() if count > MOST_LISTED_ISSUES}
    return lines + [f"and {count} more, marked in the picture: {' '.join(key)}".rstrip() for key, count in more.items()]


def _checks(report: Integrity) -> list[str]:
    """Describe which inverse checks were made, with their residuals, and which were not."""
    checks_made = [check for check in report.checks if check.made]
    lines = align_columns([
        ("inverse check", "what should hold", "largest residual", "in quanta", "rows", "found"),
        *((check.name, check.relation, f"{check.largest:.3g} {check.unit}",
           format_number(check.largest / check.quantum, 3) if check.quantum > 0.0 else "-", f"{check.rows}",
           "contradicted" if check.issues else "holds" + check.noisy * " but for noise") for check in checks_made),
    ]) if checks_made else []  # fmt: skip
    lines += [f"{check.name}: {note}" for check in checks_made for note in check.notes]
    lines += [f"not checked: {check.name}: {check.why}" for check in report.checks if not check.made]
    return lines or ["inverse checks: none, as no device, model or stiffness is given or stated by the recording"]


def _intervals(report: Integrity, soundness: Soundness) -> list[str]:
    """Return which stretches are sound, and how many rows are left out for which reason."""
    spans = soundness.sound
    listed = ", ".join(
        f"{span.times(soundness.recording)}{_lacking(report, span)}" for span in spans[:MOST_LISTED_ISSUES]
    )
    more = (
        f" and {len(spans) - MOST_LISTED_ISSUES} more, shown in the picture" if len(spans) > MOST_LISTED_ISSUES else ""
    )
    reasons: dict[str, list[int]] = {}
    for span, why in soundness.left_out:
        reasons.setdefault(why, []).append(len(span))
    return [f"sound: {listed}{more}" if spans else "sound: nothing"] + [
        f"left out: {plural(sum(rows), 'row')} in {plural(len(rows), 'place')}: {why}" for why, rows in reasons.items()
    ]


def _lacking(report: Integrity, span: Stretch) -> str:
    """Describe how many rows a sound stretch lacks in gaps that checks go across."""
    gaps = (issue for issue in report.issues if issue.kind == "gap" and issue.first is not None)
    # Only gaps within the stretch: a gap that parts it lies between two of them.
    counts = [int(gap.measures["missing"]) for gap in gaps if span.first <= (gap.first or 0) < span.end - 1]
    return f" (but for {plural(sum(counts), 'row')} missing in {plural(len(counts), 'short gap')})" if counts else ""


CONTACT_COLUMNS: Mapping[str, Callable[[Impact], str]] = {
    "begin s": lambda contact: f"{contact.begin:.4f}",
    "for ms": lambda contact: f"{1e3 * contact.duration:.3g}",
    "peak N": lambda contact: f"{contact.peak:.3g}",
    "depth mm": lambda contact: f"{1e3 * contact.depth:.3g}",
    "impulse N s": lambda contact: f"{contact.impulse:.3g}",
    "stiffness N/m": lambda contact: _known(contact.stiffness),
    "std. error": lambda contact: _known(contact.stiffness_error, 2),
    "in m/s": lambda contact: f"{contact.speed_before:.3g}",
    "out m/s": lambda contact: _known(contact.speed_after),
    "restitution": lambda contact: _known(contact.restitution),
    "std. error ": lambda contact: _known(contact.restitution_error, 2),
}
"""The columns of the table of contacts."""


def describe_contacts(impacts: Impacts) -> str:
    """Describe the contacts of a recording in one dimension, each with its standard errors, and their means with 95 per
    cent intervals: how far the contacts differ, which may be more than the error of any one of them."""
    lines = [f"contacts above {impacts.floor:.4g} N: {len(impacts.contacts)}"]
    if impacts.unexplained:
        times = ", ".join(f"{time:.4g} s" for time in impacts.unexplained)
        lines[0] += f"; at {times} a force rose though the tool was not moving into the wall"
    if not impacts.contacts:
        return lines[0]
    rows = [[text_of(contact) for text_of in CONTACT_COLUMNS.values()] for contact in impacts.contacts]
    lines += align_columns([list(CONTACT_COLUMNS), *rows])
    lines.append("peak, impulse and stiffness are above what the sensor read just before each touch")
    for measure, unit in (("impulse", " N s"), ("stiffness", " N/m"), ("restitution", "")):
        # Half the 95 % interval; NaN where one contact alone leaves no scatter to take it from.
        mean, half = impacts.mean(measure)
        interval = f" ± {_known(half, 2)}{unit} (mean, 95 %)" if math.isfinite(half) else unit
        none = "none, as the contacts last so long that the hand pushes through them"
        lines.append(f"{measure}: {_known(mean)}{interval}" if math.isfinite(mean) else f"{measure}: {none}")
    return "\n".join(lines)


def describe_conversion(recording: Recording) -> str:
    """Describe what a conversion made: rows, channels, and which rows are not a measurement."""
    notes = recording.meta.get("import", {})
    missed = None if recording.clock is None else recording.clock.missed
    return "\n".join([
        f"{len(recording)} rows, {recording.time[-1] - recording.time[0]:.6g} s: {', '.join(recording.channels)}",
        *(f"no measurement: {plural(count, 'row')} {why}" for why, count in notes.get("left out", {}).items()),
        *(f"remark: {text}" for text in notes.get("cells", ())),
        *([f"missed: {plural(missed, 'cycle')} of the loop without a row"] if missed else []),
        *(f"ended: {event.text}" for event in recording.events if event.kind == "ended"),
        *(f"suspicious: {text}" for text in describe_losses(recording) + describe_warnings(recording)),
    ])  # fmt: skip


def _known(value: float, digits: int = 3) -> str:
    """Write significant digits without an exponent, `-` for what is not known."""
    # Rounded by its significant digits, then written without an exponent.
    return f"{float(f'{value:.{digits}g}'):g}" if math.isfinite(value) else "-"


EXPLAINED_RELATIONS = (SPRING_RELATION, IMPLIED_RELATION, CONTACT_RELATION)
"""The relations whose issues have a cause in the force, or in where the hand is."""

MOST_ROWS = 20_000
"""Rows from which a cause is sought, *chosen*: 20 s at 1 kHz, in which a hand presses and slides often enough."""


def explained(
    recording: Recording, issues: Iterable[Issue], model: Model | None, stiffness: float | None
) -> tuple[Issue, ...]:
    """Return the issues, the first one of `EXPLAINED_RELATIONS` with the cause that the diagnosis names.

    It is sought in the longest stretch without a gap and without rows that another issue takes for no measurement:
    with the `model` and K_p, its `stiffness` in N/m, or of a logged IHIP with the latter alone.
    """
    listed = tuple(issues)
    first = next((at for at, issue in enumerate(listed) if issue.kind in EXPLAINED_RELATIONS), None)
    if first is None or stiffness is None or (model is None and listed[first].kind != SPRING_RELATION):
        return listed
    issue = _explained(recording, listed[first], listed, model, stiffness)
    return (*listed[:first], issue, *listed[first + 1 :])


def _explained(
    recording: Recording, issue: Issue, others: Sequence[Issue], model: Model | None, stiffness: float
) -> Issue:
    # Few logs ask for it: what imports an examination loads none of it.
    from hapticeval.diagnosis import diagnose, right_contact

    sound = recording.measured.copy()
    for other in others:
        if no_measurement(other):
            sound[other.first : other.end] = False
    longest = max(stretches(recording, sound), key=lambda stretch: stretch.end - stretch.first, default=None)
    if longest is None:
        return issue
    rows = slice(longest.first, min(longest.end, longest.first + MOST_ROWS))
    place = recording.channels.get("measured_hip", recording.hip)[rows]
    contact = right_contact(
        None if model is None else model.boundary,
        recording.time[rows],
        place,
        recording.channels["velocity"][rows] if "velocity" in recording.channels else None,
        stiffness=stiffness,
        points=recording.ihip[rows] if issue.kind == SPRING_RELATION else None,
    )
    diagnosis = diagnose(
        contact,
        recording.force[rows],
        noisy=True,
        tolerance=recording.standoff + recording.resolution,
        boundary=None if model is None or issue.kind == SPRING_RELATION else model.boundary,
    )
    # A jump or a stuck sensor is the cause itself, where nothing else is found.
    if not diagnosis.off or (diagnosis.cause is None and any(map(no_measurement, others))):
        return issue
    remedy = f" ({diagnosis.remedy})" if diagnosis.remedy else ""
    # A gain alone is told as a stiffness: its number is what it is more than one.
    if diagnosis.cause is not None and diagnosis.kind == "gain":
        remedy = f", as of {stiffness * (1.0 + diagnosis.cause.numbers['gain'][0]):.6g} N/m{remedy}"
    return replace(
        issue,
        message=f"{diagnosis.sentence}{remedy}: {issue.message}",
        measures={**issue.measures, "cause": diagnosis.kind},
    )
