"""Recorded verdicts of a suite: outcome, metric and bound of every check of every case, a column a renderer.

They stand in `SUITE_verdicts.csv` beside this file. Where a change means to change one of them, write all anew with

    HAPTICEVAL_PUBLISH=1 .venv/bin/pytest -m '' tests/suites/test_golden.py tests/suites/test_thesis.py -k recorded

and look at the difference. A cell that says the same stays as it is, to the digit.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import measured
import pytest
from publishing import concerned, publishing

from hapticeval.files import replacing
from hapticeval.phenomena.verdict import Outcome, Verdict
from hapticeval.runner.known import Known
from hapticeval.runner.results import VerdictEntry
from hapticeval.suite.suite import Suite

CLOSE = 1e-3
"""Share of a metric, or of its bound, by which two machines may differ."""

Place = tuple[str, str]
"""Case and check."""


def table_of(suite: str) -> Path:
    return Path(__file__).with_name(f"{suite}_verdicts.csv")


def recorded(suite: str) -> dict[Place, dict[str, str]]:
    """What is recorded of a suite, by place and renderer."""
    file = table_of(suite)
    rows = csv.DictReader(file.read_text().splitlines()) if file.exists() else []
    return {(row.pop("case"), row.pop("check")): row for row in rows}


class Cell(NamedTuple):
    """What is recorded of a verdict; numbers in the metric's unit, None where the check gives none."""

    outcome: str
    value: float | None
    bound: float | None
    unit: str

    @classmethod
    def of_verdict(cls, verdict: Verdict) -> Cell:
        finding = verdict.finding
        metric = finding.metric
        return cls(
            verdict.outcome.value,
            None if metric is None else float(f"{metric.value:.4g}"),
            None if metric is None or finding.bound is None else float(f"{finding.bound:.4g}"),
            "" if metric is None else metric.unit,
        )

    @classmethod
    def read(cls, text: str) -> Cell:
        outcome, _, numbers = text.partition(" ")
        measured, _, bound = numbers.partition(" of ")
        value, _, unit = measured.partition(" ")
        return cls(outcome, float(value) if value else None, float(bound) if bound else None, unit)

    @property
    def text(self) -> str:
        words = [self.outcome]
        if self.value is not None:
            words += [f"{self.value:.4g}", self.unit]
        if self.bound is not None:
            words += ["of", f"{self.bound:.4g}"]
        return " ".join(word for word in words if word)

    def agrees(self, other: Cell) -> bool:
        """Whether another cell says the same, as closely as two machines do."""
        slack = CLOSE * abs(self.bound or 0.0)
        return (
            (self.outcome, self.unit) == (other.outcome, other.unit)
            and _close(self.value, other.value, slack)
            and _close(self.bound, other.bound, 0.0)
        )


def _close(one: float | None, other: float | None, slack: float) -> bool:
    if one is None or other is None:
        return one is other
    return one == pytest.approx(other, rel=CLOSE, abs=slack)


def unexpected(verdicts: Iterable[Verdict]) -> list[VerdictEntry]:
    """What would stop the gate of a run, with what the renderers' package lists as known."""
    known = Known().with_shipped()
    entries = [known.marked(VerdictEntry.of(verdict)) for verdict in verdicts]
    return [entry for entry in entries if entry.standing.unexpected]


def publish(suite: Suite, renderers: Sequence[str], name: str, verdicts: Sequence[Verdict]) -> None:
    """Replace what changed in one renderer's column, and leave out what the suite has no more."""
    before = recorded(suite.name)
    table = {(case.name, check): {} for case in suite.cases for check in case.checks}
    for place, row in table.items():
        row.update({column: text for column, text in before.get(place, {}).items() if column in renderers})
    for verdict in verdicts:
        row, cell = table[verdict.case, verdict.check], Cell.of_verdict(verdict)
        if name not in row or not cell.agrees(Cell.read(row[name])):
            row[name] = cell.text
    with replacing(table_of(suite.name)) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, ["case", "check", *renderers], lineterminator="\n")
        writer.writeheader()
        writer.writerows({"case": case, "check": check, **cells} for (case, check), cells in table.items())


def compare(suite: Suite, renderers: Sequence[str], name: str, verdicts: Sequence[Verdict]) -> None:
    """Assert that each verdict is the recorded one; or record them, where that is asked for."""
    if publishing():
        publish(suite, renderers, name, verdicts)
    table = recorded(suite.name)
    asked = {(case.name, check) for case in concerned(suite.cases) for check in case.checks}
    cases = {verdict.case for verdict in verdicts}
    places = {(verdict.case, verdict.check) for verdict in verdicts}
    assert places == {place for place in table if place in asked and place[0] in cases}
    for verdict in verdicts:
        assert len(verdict.finding.message) <= measured.LONGEST_MESSAGE, verdict.finding.message
        place = verdict.case, verdict.check
        cell, text = Cell.of_verdict(verdict), table[place][name]
        if verdict.check == measured.CHAOTIC and cell.outcome == Cell.read(text).outcome == Outcome.FAIL:
            continue
        assert cell.agrees(Cell.read(text)), (place, f"recorded: {text}", f"now: {cell.text}", verdict.finding.message)
