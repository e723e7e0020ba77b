"""Judge the field's renderers beside the thesis's, and write docs/renderers-of-the-field.md's tables: `make field`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import hapticeval
from hapticeval.discovery import resolve
from hapticeval.errors import RefusalError
from hapticeval.examples.studies.plates import CITED, THICKEST_PLATE, THINNEST_PLATE, find_thinnest
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.results import ResultsDocument, VerdictEntry, read_results

SUITES = ("thesis", "solids", "seams", "field")
PAGE, RESULTS = Path("docs/renderers-of-the-field.md"), Path("results/field")

THESIS = ("minimum-distance", "constraint", "mapping", "conformal", "set-stabilisation")
FIELD = (
    "virtual-proxy", "local-plane", "local-plane+recovery", "coupled", "neighbourhood", "implicit", "implicit@grid",
    "implicit+normal@grid", "implicit+gradient@grid", "mapping+pc", "conformal+pc",
)  # fmt: skip
PLANES = (
    "local-plane@30hz", "local-plane", "local-plane@100hz",
    "local-plane+recovery@30hz", "local-plane+recovery", "local-plane+recovery@100hz",
)  # fmt: skip
TABLES: Mapping[str, Sequence[str]] = {"all": (*THESIS, *FIELD), "rates": PLANES}
"""The columns of each table of the page, by the name that its markers have."""


def count_words(entries: Sequence[VerdictEntry]) -> str:
    """Return how many verdicts pass, of how many that decide."""
    outcomes = Counter(entry.outcome for entry in entries)
    passed, stopped = outcomes[Outcome.PASS], outcomes[Outcome.ERROR]
    decided = passed + outcomes[Outcome.FAIL]
    return (f"{passed}/{decided}" if decided else "-") + (f", {stopped} in error" if stopped else "")


def count_lines(entries: Sequence[VerdictEntry], columns: Mapping[str, str]) -> list[str]:
    """Return a table's lines: a column for each title, whose value is the renderer's name, and a row for each check.

    Counted are verdicts of level must and should.
    """
    asked = [entry for entry in entries if entry.level in ("must", "should")]
    lines = [f"| | {' | '.join(f'`{title}`' for title in columns)} |", "| --- " * (len(columns) + 1) + "|"]
    for check in dict.fromkeys(entry.check for entry in asked):
        of_check = [entry for entry in asked if entry.check == check]
        cells = [count_words([entry for entry in of_check if entry.renderer == name]) for name in columns.values()]
        if set(cells) != {"-"}:
            lines.append(f"| [{check}](checks/{check}.md) | {' | '.join(cells)} |")
    return lines


def plate_words(name: str) -> str:
    """Return the thinnest plate (mm) that a renderer holds at the cited speed and push; a dash where it has none."""
    try:
        thinnest = find_thinnest(resolve(name), *CITED)
    except RefusalError:  # a renderer for the plane alone
        return "-"
    if thinnest is None:
        return f"over {1e3 * THICKEST_PLATE:g}"
    return f"{1e3 * thinnest:.2g}{' or less' if thinnest == THINNEST_PLATE else ''}"


def table_lines(results: ResultsDocument, names: Sequence[str], plates: Mapping[str, str]) -> list[str]:
    """Return the lines of a table: verdicts by check, the suites' rows as they are judged, and the plate."""
    lines = count_lines(results.verdicts, {name: name for name in names})
    for title, cells in results.table.items():
        if any(name in cells for name in names):
            lines.append(f"| {title} | {' | '.join(cells.get(name, '-') for name in names)} |")
    speed, push = CITED
    row = " | ".join(plates[name] for name in names)
    return [*lines, f"| thinnest plate held at {speed:g} m/s and {push:g} N, mm | {row} |"]


def with_table(text: str, name: str, lines: Sequence[str]) -> str:
    """Return a page with other lines between the markers of a table."""
    opening, closing = f"<!-- table {name} -->", f"<!-- end of table {name} -->"
    return re.sub(
        f"{opening}.*?{closing}", lambda _: "\n".join([opening, "", *lines, "", closing]), text, flags=re.DOTALL
    )


def main() -> None:
    """Judge, and write the page's tables."""
    names = tuple(dict.fromkeys(name for columns in TABLES.values() for name in columns))
    hapticeval.run(names, suites=SUITES, output=RESULTS)
    results, text = read_results(RESULTS), PAGE.read_text(encoding="utf-8")
    plates = {name: plate_words(name) for name in names}
    for name, columns in TABLES.items():
        text = with_table(text, name, table_lines(results, columns, plates))
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
