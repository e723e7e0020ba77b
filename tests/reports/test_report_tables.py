import pytest
from reports_synthetic import HOSTILE, synthetic_results

from hapticeval.quantity import quantity
from hapticeval.reports import markdown, matrix, summary
from hapticeval.reports.junit import measured
from hapticeval.reports.table import renderers


def test_every_verdict_has_a_cell_where_it_belongs(results):
    rows = matrix(results)
    names = renderers(results)
    assert names == ["plain", "broken", HOSTILE]
    cells = [
        (row.suite, row.case, row.check, name, cell.outcome)
        for row in rows
        for name, cell in zip(names, row.cells, strict=True)
        if cell
    ]
    given = [
        (each["suite"], each["case"], each["check"], each["renderer"], each["outcome"]) for each in results.verdicts
    ]
    assert sorted(cells) == sorted(given)


@pytest.mark.parametrize(
    ("check", "standing"),
    [
        ("continuous-contact", "as known"),
        ("contact-normal-force", "differs"),
        ("broken-contact", "unexpected"),
        ("memoryless", ""),
        ("centripetal-force", "warning"),
    ],
)
def test_a_cell_says_how_it_compares(results, check, standing):
    (row,) = [row for row in matrix(results) if (row.case, row.check) == ("lobe", check)]
    assert row.cells[0].standing == standing
    assert row.cells[2] is None


def test_the_summary_puts_the_published_values_beside(results):
    rows = {row.title: row.cells for row in summary(results)}
    assert rows["Resists <Pop>"] == (("No", "No"), (None, None), ("Yes", "No"))
    assert rows["Suitable for LUT"] == (("Yes", None), (None, None), (None, None))


def test_markdown_shows_both_tables_and_cannot_be_broken_out_of(results):
    text = markdown(results)
    assert "13 of 13 planned verdicts ran; seed 3." in text
    assert "**Yes** (published: No)" in text
    assert "**✓ pass** (published: fail)" in text
    assert "✗ fail (as known)" in text
    assert "<script>" not in text
    assert "- plain on synthetic/tip: it raised" in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    widths = {len(line) for line in tables}
    assert len(widths) == 2
    hostile = markdown(synthetic_results(table={"a | b\n| c": {"plain": "Yes"}}))
    assert "| a \\| b \\| c " in hostile


def test_an_incomplete_run_says_so():
    results = synthetic_results(planned=40, complete=False, reason="interrupted by the user")
    assert "13 of 40 planned verdicts ran: incomplete, interrupted by the user" in markdown(results)


def test_a_run_without_verdicts_has_no_empty_tables():
    empty = synthetic_results(planned=0, ran=0, runs=[], verdicts=[], table={}, published_table={})
    assert "|" not in markdown(empty)


def test_quantities_read_well():
    assert quantity(0.00083, "m") == "0.83 mm"
    assert quantity(12.3456, "N") == "12.35 N"
    assert quantity(0.5, "") == "0.5"
    assert quantity(None, "m") == "not finite"
    verdict = {"metric": {"name": "jump", "value": 0.004, "unit": "m"}, "bound": 1e-4}
    assert measured(verdict) == "jump 4 mm, bound 0.1 mm"
    assert measured({"metric": None, "bound": None}) == ""
