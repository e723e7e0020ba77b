"""Why force and position of a log are not those of a contact: the cause behind what the inverse checks complain of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from hapticeval.geometry.model import Model
from hapticeval.recordings.integrity.consistency import CONTACT_RELATION, IMPLIED_RELATION, SPRING_RELATION
from hapticeval.recordings.integrity.issue import Issue, no_measurement
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import stretches

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
    # Of a gain alone one wants to know the stiffness: the gain's number is what it is more than one.
    if diagnosis.cause is not None and diagnosis.kind == "gain":
        remedy = f", as of {stiffness * (1.0 + diagnosis.cause.numbers['gain'][0]):.6g} N/m{remedy}"
    return replace(
        issue,
        message=f"{diagnosis.sentence}{remedy}: {issue.message}",
        measures={**issue.measures, "cause": diagnosis.kind},
    )
