"""The tables of the page on the field's renderers: counts of verdicts, rows of the suites, their place in the page."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from hapticeval.examples.studies.field_tables import PAGE, TABLES, plate_words, table_lines, with_table

# A program of the examples, tried before, may have left for another folder.
ROOT = Path(__file__).parents[2]


def verdict(renderer: str, outcome: str, level: str = "must"):
    return SimpleNamespace(renderer=renderer, check="passivity", level=level, outcome=outcome)


def test_a_table_counts_what_decides_and_has_the_rows_that_the_run_judged():
    results = SimpleNamespace(
        verdicts=[
            verdict("a", "pass"), verdict("a", "fail", "should"), verdict("a", "fail", "info"),
            verdict("b", "inconclusive"), verdict("b", "error"), verdict("c", "pass"),
        ],
        table={"Holds": {"a": "Yes"}, "Other": {"c": "No"}},
    )  # fmt: skip
    lines = table_lines(results, ("a", "b"), {"a": "5.2", "b": "-"})
    assert lines == [
        "| | `a` | `b` |",
        "| --- | --- | --- |",
        "| [passivity](checks/passivity.md) | 1/2 | -, 1 in error |",
        "| Holds | Yes | - |",
        "| thinnest plate held at 1 m/s and 10 N, mm | 5.2 | - |",
    ]


def test_a_renderer_of_the_plane_has_no_plate():
    assert plate_words("mapping") == "-"
    assert plate_words("constraint") == "0.1 or less"
    assert plate_words("minimum-distance") == "over 10"


def test_the_page_has_the_place_of_every_table_and_what_is_written_there_again_is_the_same():
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    for name, columns in TABLES.items():
        table = text.split(f"<!-- table {name} -->\n\n")[1].split("\n\n<!-- end")[0].splitlines()
        assert table[0] == f"| | {' | '.join(f'`{column}`' for column in columns)} |"
        assert with_table(text, name, table) == text
