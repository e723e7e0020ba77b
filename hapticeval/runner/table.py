"""The summary table (Table 6.3): Yes or No a row and renderer, computed from verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase

from hapticeval.phenomena.verdict import Outcome, Verdict
from hapticeval.suite.suite import Row, Suite


def fill_table(suites: Sequence[Suite], verdicts: Iterable[Verdict]) -> Mapping[str, Mapping[str, str]]:
    """For each row, the renderers that its cases have decided: No where one of its checks fails, Yes where all pass.

    A renderer that has not run in every case of the row, or has an inconclusive or erroneous verdict there and no
    failure, is left out: the table never says Yes for what was not seen.
    """
    found = list(verdicts)
    table: dict[str, dict[str, str]] = {}
    for suite in suites:
        for row in suite.rows:
            cells = table.setdefault(row.title, {})
            wanted = {
                (case.name, check)
                for case in suite.cases
                if case.judged and _in(row, case.name)
                for check in row.checks
                if check in case.checks
            }
            for renderer in dict.fromkeys(verdict.renderer for verdict in found):
                outcomes = {
                    (verdict.case, verdict.check): verdict.outcome
                    for verdict in found
                    if verdict.renderer == renderer
                    and verdict.suite == suite.name
                    and (verdict.case, verdict.check) in wanted
                }
                if Outcome.FAIL in outcomes.values():
                    cells[renderer] = "No"
                elif wanted and set(outcomes) == wanted and set(outcomes.values()) == {Outcome.PASS}:
                    cells[renderer] = "Yes"
    return table


def _in(row: Row, case: str) -> bool:
    return any(fnmatchcase(case, pattern) for pattern in row.cases)
