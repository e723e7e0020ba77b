"""The section of closed forms shows the evidence of the verdicts, digit for digit."""

from __future__ import annotations

from reports_synthetic import run_document, synthetic_results

from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.reports import render_html
from hapticeval.reports.closed_form_section import closed_form_tables
from hapticeval.runner.results import verdict_document

MOMENTS = [
    {
        "time": 0.5 * index,
        "measured": [1.0, 0.1 * index],
        "closed_form": [1.0, 0.1 * index + 1e-9],
        "measured_distance": -0.04394 * index,
        "closed_form_distance": -0.04394 * index - 3e-9,
    }
    for index in range(3)
]


def verdict(case, renderer, law="6.24", outcome=Outcome.PASS, moments=MOMENTS):
    evidence = {"law": law, "sampled_apart_m": 2e-3, "moments": moments} if moments else {}
    metric = Metric("distance", 3.25e-9, "m") if moments else None
    finding = Finding(outcome, "why <not>", metric, 4.5e-7 if moments else None, evidence)
    return verdict_document(Verdict(renderer, "synthetic", case, "closed-form", Level.MUST, finding))


def tables(*verdicts, citations=None):
    names = list(dict.fromkeys(each["renderer"] for each in verdicts))
    runs = [
        {**run_document(each["case"], each["renderer"], "circle"), "citation": (citations or {}).get(each["case"], "")}
        for each in verdicts
    ]
    return closed_form_tables(runs, verdicts, names, {id(each): f"v{i}" for i, each in enumerate(verdicts)})


def test_values_are_those_of_the_evidence():
    (table,) = tables(verdict("circle", "pp"))
    (row,) = table.rows
    assert row.times == ["0 s", "0.5 s", "1 s"]
    assert row.measured == ["0.000000", "−43.940000", "−87.880000"]  # noqa: RUF001
    assert row.expected == ["−0.000003", "−43.940003", "−87.880003"]  # noqa: RUF001
    assert row.places[1] == ("0.5 s", "(1000.000000, 100.000000)", "(1000.000000, 100.000001)")
    assert (row.apart, row.tolerance, row.sampled) == ("3.25 nm", "450 nm", "2 mm")
    assert row.formula[0].startswith("r″ = −k (r − R)")  # noqa: RUF001
    assert "radius" in table.letters
    assert (table.met, table.unfolded) == (1, False)


def test_cases_that_cite_a_table_come_first_in_its_order_and_are_unfolded():
    given = tables(
        verdict("sphere", "a"), verdict("circle", "a"), verdict("line", "a"),
        citations={"circle": "6.3.3, Table 6.2, Figure 6.22", "line": "Table 6.1"},
    )  # fmt: skip
    assert [(table.case["case"], table.unfolded) for table in given] == [
        ("line", True),
        ("circle", True),
        ("sphere", False),
    ]


def test_a_verdict_without_moments_says_why_and_one_that_does_not_apply_is_left_out():
    (table,) = tables(
        verdict("circle", "a", outcome=Outcome.INCONCLUSIVE, moments=None),
        verdict("circle", "b", outcome=Outcome.NOT_APPLICABLE, moments=None),
    )
    (row,) = table.rows
    assert (row.message, row.times, row.apart, table.met) == ("why <not>", [], "", 0)


def test_a_law_of_a_later_version_costs_only_its_formula():
    (table,) = tables(verdict("circle", "a", law="9.99"))
    assert (table.rows[0].formula, table.letters) == ((), "")


def test_the_page_has_the_section_only_where_there_are_closed_forms():
    assert 'id="closed-forms"' not in render_html(synthetic_results(), {})
    given = [verdict("lobe", "plain", outcome=Outcome.FAIL)]
    page = render_html(synthetic_results(verdicts=given, planned=1, ran=1), {})
    for text in ('id="closed-forms"', "−43.940003", "3.25 nm", "450 nm", "0 of 1 as the closed form", "θ″"):  # noqa: RUF001
        assert text in page, text
