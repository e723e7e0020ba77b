"""The summary table (Table 6.3): Yes or No for each row and renderer, computed from verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.results import SuiteEntry, Table, VerdictEntry
from hapticeval.suite.suite import Suite


def cells_of(suite: Suite) -> dict[str, list[str]]:
    """Return for each row of a suite the `case/check` that decide it."""
    return {
        row.title: [
            f"{case.name}/{check}"
            for case in suite.cases
            if case.judged and any(fnmatchcase(case.name, pattern) for pattern in row.cases)
            for check in row.checks
            if check in case.checks
        ]
        for row in suite.rows
    }


def fill_table(suites: Sequence[SuiteEntry], verdicts: Sequence[VerdictEntry]) -> Table:
    """Return Yes or No for each row and renderer: No where a check of the row fails, Yes where all pass.

    A renderer without a failure is left out of a row where a verdict is missing, undecided or an error: the table never
    says Yes for what was not seen.
    """
    outcome_by_cell = {
        (verdict.suite, verdict.renderer, f"{verdict.case}/{verdict.check}"): verdict.outcome for verdict in verdicts
    }
    renderers = dict.fromkeys(verdict.renderer for verdict in verdicts)
    table: Table = {}
    for suite in suites:
        for title, places in suite.cells.items():
            cells = table.setdefault(title, {})
            for renderer in renderers:
                # None stands for a verdict that is missing: with it among them there is no Yes.
                outcomes = {outcome_by_cell.get((suite.name, renderer, place)) for place in places}
                if Outcome.FAIL in outcomes:
                    cells[renderer] = "No"
                elif outcomes == {Outcome.PASS}:
                    cells[renderer] = "Yes"
    return table
