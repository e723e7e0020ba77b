"""Tables 6.1 and 6.2 with numbers: for each case, the closed loop as a formula, as it was measured, and as it follows.

All numbers are those of the verdicts' evidence; nothing is computed again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hapticeval.quantity import quantity
from hapticeval.reports.table import Cell, cell_of
from hapticeval.runner.results import RunEntry, VerdictEntry

if TYPE_CHECKING:
    from hapticeval.closed_forms.form import ClosedForm

CHECK = "closed-form"


@dataclass(frozen=True)
class Measured:
    """One renderer: `measured` and `expected` have an entry a moment, the distance off the surface in mm.

    `formula` and `letters` are those of the closed form. `places` has for each moment the time and both positions, as
    text. Without moments `message` says why.
    """

    renderer: str
    column: int
    anchor: str
    law: str
    formula: Sequence[str]
    letters: str
    times: Sequence[str]
    measured: Sequence[str]
    expected: Sequence[str]
    places: Sequence[tuple[str, str, str]]
    apart: str
    tolerance: str
    sampled: str
    message: str
    cell: Cell


@dataclass(frozen=True)
class CaseTable:
    """One case; `table` is the number of the thesis's, `letters` says what all the formulas mean."""

    case: RunEntry
    letters: str
    times: Sequence[str]
    rows: Sequence[Measured]
    table: str

    @property
    def unfolded(self) -> bool:
        """Whether the thesis has such a table."""
        return bool(self.table)

    @property
    def met(self) -> int:
        """How many renderers move as their closed forms say."""
        return sum(row.cell.outcome == "pass" for row in self.rows)


def closed_form_tables(
    runs: Sequence[RunEntry],
    verdicts: Sequence[VerdictEntry],
    names: Sequence[str],
    anchors: Mapping[int, str],
) -> list[CaseTable]:
    """A table for each case that has verdicts of the check; those that cite a table come first, by its number."""
    cases = {(run.suite, run.case): run for run in runs}
    grouped: dict[tuple[str, str], list[Measured]] = {}
    for verdict in verdicts:
        if verdict.check == CHECK and verdict.outcome != "not-applicable":
            row = _measured(verdict, names.index(verdict.renderer), anchors[id(verdict)])
            grouped.setdefault((verdict.suite, verdict.case), []).append(row)
    tables = []
    for key, rows in grouped.items():
        run = cases[key]
        meanings = dict.fromkeys(filter(None, (row.letters for row in rows)))
        times = next((row.times for row in rows if row.times), ())
        cited = re.search(r"Table (\d+\.\d+)", run.citation or "")
        tables.append(CaseTable(run, " ".join(meanings), times, rows, cited[1] if cited else ""))
    return sorted(tables, key=lambda table: (not table.table, table.table))


def _measured(verdict: VerdictEntry, column: int, anchor: str) -> Measured:
    evidence, metric = verdict.evidence, verdict.metric
    moments = evidence.get("moments", ())
    law = evidence.get("law", "")
    form = _form(law)
    return Measured(
        renderer=verdict.renderer,
        column=column,
        anchor=anchor,
        law=law,
        formula=() if form is None else form.formula,
        letters="" if form is None else form.letters,
        times=[f"{moment['time']:.4g} s" for moment in moments],
        measured=[_nanometres(moment["measured_distance"]) for moment in moments],
        expected=[_nanometres(moment["closed_form_distance"]) for moment in moments],
        places=[
            (f"{moment['time']:.4g} s", _place(moment["measured"]), _place(moment["closed_form"])) for moment in moments
        ],
        apart="" if metric is None else _small(metric.value),
        tolerance="" if verdict.bound is None else _small(verdict.bound),
        sampled=_small(evidence["sampled_apart_m"]) if "sampled_apart_m" in evidence else "",
        message="" if moments else verdict.message,
        cell=cell_of(verdict),
    )


def _form(name: str) -> ClosedForm | None:
    """The closed form of that name; None for one of another version."""
    # Loads geometry, and compiles: not for a page without closed forms.
    from hapticeval.closed_forms.form import CLOSED_FORMS

    return CLOSED_FORMS.get(name)


def _nanometres(metres: float | None) -> str:
    """In mm, to a nanometre; what rounds to zero has no sign."""
    if metres is None:
        return "not finite"
    text = f"{1e3 * metres:.6f}"
    return text.removeprefix("-") if not float(text) else text.replace("-", "−")  # noqa: RUF001


def _place(metres: Sequence[float | None]) -> str:
    return f"({', '.join(_nanometres(each) for each in metres)})"


def _small(metres: float | None) -> str:
    """A length for which millimetres may be far too much."""
    if metres is None or not 0.0 < metres < 1e-4:
        return quantity(metres, "m")
    for factor, unit in ((1e6, "µm"), (1e9, "nm")):
        if metres * factor >= 1.0:
            return quantity(metres * factor, unit)
    return quantity(metres * 1e12, "pm")
