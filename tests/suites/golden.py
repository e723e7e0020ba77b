"""Recorded verdicts of a suite: outcome and metric of every check of every case, a column a renderer.

They stand in `SUITE_verdicts.csv` beside this file. Where a change means to change one of them, write all anew with

    HAPTICEVAL_PUBLISH=1 .venv/bin/pytest -m '' tests/suites/test_golden.py tests/suites/test_thesis.py -k recorded

and look at the difference.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from hapticeval.phenomena.verdict import Verdict
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


def publishing() -> bool:
    """Whether tables are to be written."""
    return bool(os.environ.get("HAPTICEVAL_PUBLISH"))


def cell(verdict: Verdict) -> str:
    metric = verdict.finding.metric
    number = "" if metric is None else f"{metric.value:.4g} {metric.unit}"
    return f"{verdict.outcome.value} {number}".strip()


def publish(suite: Suite, renderers: Sequence[str], name: str, verdicts: Sequence[Verdict]) -> None:
    """Replace one renderer's column, and leave out what the suite has no more."""
    before = recorded(suite.name)
    table = {(case.name, check): {} for case in suite.cases for check in case.checks}
    for place, row in table.items():
        row.update({each: text for each, text in before.get(place, {}).items() if each in renderers})
    for verdict in verdicts:
        table[verdict.case, verdict.check][name] = cell(verdict)
    with table_of(suite.name).open("w", newline="") as file:
        writer = csv.DictWriter(file, ["case", "check", *renderers], lineterminator="\n")
        writer.writeheader()
        writer.writerows({"case": case, "check": check, **cells} for (case, check), cells in table.items())


def compare(suite: Suite, renderers: Sequence[str], name: str, verdicts: Sequence[Verdict]) -> None:
    """Assert that each verdict is the recorded one; or record them, where that is asked for."""
    if publishing():
        publish(suite, renderers, name, verdicts)
    table = recorded(suite.name)
    assert {(verdict.case, verdict.check) for verdict in verdicts} == set(table)
    for verdict in verdicts:
        outcome, *number = table[verdict.case, verdict.check][name].split()
        assert verdict.outcome == outcome, (verdict.case, verdict.check, verdict.finding.message)
        metric = verdict.finding.metric
        assert (metric is None) == (not number)
        if metric is not None:
            near = pytest.approx(float(number[0]), rel=CLOSE, abs=CLOSE * (verdict.finding.bound or 0.0))
            assert metric.value == near, (verdict.case, verdict.check)
