"""The page by suites: contents, summary and matrix."""

from __future__ import annotations

from reports_synthetic import HOSTILE, run_document, synthetic_results

from hapticeval.reports import markdown, render_html
from hapticeval.reports.groups import shown_suites, shown_summary
from hapticeval.reports.shown import Drawing, shown_cases
from hapticeval.reports.svg import classed
from hapticeval.reports.table import renderers

SUITES = [
    {"name": "synthetic", "title": "The <first>", "citation": "thesis 6.3", "rows": ["Resists <Pop>"]},
    {"name": "second", "title": "The second", "citation": "", "rows": ["Suitable for LUT", "never ran"]},
]


def with_second_suite(**changes):
    """A second suite of one renderer, with a case that is shown twice: as it is, and with an effect, not judged."""
    base = synthetic_results()
    case = {**run_document("slide", "plain", "line", recording=False), "suite": "second", "title": "Slide"}
    effect = {**case, "case": "slide-delay", "title": "Slide, with a delay", "judged": False}
    verdict = {**base.verdicts[0], "suite": "second"}
    verdicts = [*base.verdicts, {**verdict, "case": "slide"}, {**verdict, "case": "slide-delay", "level": "info"}]
    count = len(verdicts)
    return synthetic_results(
        runs=[*base.runs, case, effect], verdicts=verdicts, planned=count, ran=count, suites=SUITES, **changes
    )


def suites_of(results, drawings):
    anchors = {id(each): f"v{index}" for index, each in enumerate(results.verdicts)}
    return shown_suites(results, shown_cases(results, renderers(results), drawings, anchors))


def test_a_suite_has_the_columns_of_its_own_renderers():
    first, second = suites_of(with_second_suite(), {})
    assert [name for _, name in first.columns] == ["plain", "broken", HOSTILE]
    assert second.columns == [(0, "plain")]
    assert (first.title, second.citation) == ("The <first>", "")


def test_what_is_not_judged_stands_apart():
    _, second = suites_of(with_second_suite(), {})
    assert [row.case for row in second.judged] == ["slide"]
    assert [row.case for row in second.shown] == ["slide-delay"]


def test_a_variant_stands_under_its_case_in_the_contents():
    _, second = suites_of(with_second_suite(), {})
    (entry,) = second.contents
    assert entry.case.document["title"] == "Slide"
    assert [words for words, _ in entry.variants] == ["with a delay"]


def test_the_summary_is_grouped_and_no_row_is_lost():
    groups = shown_summary(with_second_suite())
    assert [(group.title, [row.title for row in group.rows]) for group in groups] == [
        ("The <first>", ["Resists <Pop>"]),
        ("The second", ["Suitable for LUT"]),
    ]
    (alone,) = shown_summary(synthetic_results())
    assert (alone.title, len(alone.rows)) == ("", 2)
    text = markdown(with_second_suite())
    assert text.index("### The &lt;first>") < text.index("Resists &lt;Pop>") < text.index("### The second")


def test_the_runs_of_an_effect_are_folded_where_one_figure_shows_them_all():
    figure = Drawing(svg='<svg class="figure"></svg>')
    key = ("second", "slide-delay", "")
    results = with_second_suite()
    assert "each renderer by itself" not in render_html(results, {})
    assert render_html(results, {key: figure}).count("each renderer by itself") == 1
    assert "each renderer by itself" not in render_html(results, {("second", "slide", ""): figure})


def test_the_page_claims_no_table_that_its_suites_do_not_cite():
    page = render_html(with_second_suite(), {})
    assert "Table 6.3" not in page[: page.index("How to read this</h2>")]


def test_styles_become_classes_of_the_page():
    given = ['<svg class="figure" aria-label="a &quot;b&quot;"><path d="M 0 0" style="fill:none"/>', '<g style="fill:none"><text style="x:1"> style="y" </text></g>']  # fmt: skip # noqa: E501
    (first, second), rules = classed(given)
    assert first == '<svg class="figure" aria-label="a &quot;b&quot;"><path d="M 0 0" class="z0"/>'
    assert second == '<g class="z0"><text class="z1"> style="y" </text></g>'
    assert rules == ".z0 {fill:none}\n.z1 {x:1}"
