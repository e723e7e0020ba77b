"""The page: everything that ran is on it, nothing that anyone wrote becomes markup, and it needs no network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser

import pytest
from reports_synthetic import HOSTILE, synthetic_results, synthetic_run, verdict
from result_entries import changed

from hapticeval.errors import InputError
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome
from hapticeval.recordings.compare.difference import Apart, Difference
from hapticeval.replay import OPEN_LOOP
from hapticeval.reports import markdown, render_html, write_reports
from hapticeval.reports.canvas import THEME, classed
from hapticeval.reports.page import Drawing
from hapticeval.runner.results import Replay, SuiteEntry, write_results
from hapticeval.study.bench.document import (
    Answer,
    BenchResults,
    Change,
    OrderEntry,
    ReferenceEntry,
    SettingEntry,
    Times,
)

VOID = {"meta", "br", "input", "link", "img"}


class Page(HTMLParser):
    """Collects ids, links, tags and text, and sees that tags are closed in order."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.tags, self.text, self.open = [], [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.tags.append((tag, given))
        self.ids += [given["id"]] if "id" in given else []
        self.links += [given["href"]] if tag == "a" else []
        self.text.append(" ")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.ids += [value for name, value in attrs if name == "id"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)

    @property
    def words(self):
        return " ".join("".join(self.text).split())


def words(results, drawings=None):
    return Page(render_html(results, drawings or {})).words


@pytest.fixture
def page(folder):
    write_reports(folder, workers=1)
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def test_the_page_tells_what_ran_and_what_was_found(page, results):
    for text in (
        "13 of 13 planned",
        "3× real time",  # noqa: RUF001
        "5 verdicts not as expected",
        "2 runs broke",
        "published: No",
        "differs: published fail",
        "as published",
        "IHIP jump 40 mm",
        "bound 1 mm, margin -39 mm",
        "The renderer broke: it raised <ValueError> at tick 7",
        "What to do: mend it",
        "Experiment, closed loop",
        "Playback, open loop",
        "mark 1 in the figure, t = 1 s",
    ):
        assert text in page.words, text
    assert sum(tag == "svg" for tag, _ in page.tags) == 2
    assert len(page.ids) == len(set(page.ids))
    anchors = {link.removeprefix("#") for link in page.links}
    assert anchors <= set(page.ids)
    assert {f"v{index}" for index in range(len(results.verdicts))} <= anchors


def test_nothing_that_a_renderer_says_becomes_markup_and_no_network_is_needed(page, folder):
    assert HOSTILE in page.words
    assert not {"script", "link", "iframe"} & {tag for tag, _ in page.tags}
    assert not any(name.startswith("on") for _, given in page.tags for name in given)
    text = (folder / "report.html").read_text(encoding="utf-8").replace('xmlns="http://www.w3.org/2000/svg"', "")
    assert not re.search(r"https?://|url\((?!#)|@import|src=", text)
    assert all(f"--fig-{role}:" in text for role in THEME), "the page defines every colour of the figures"


def test_the_top_says_how_complete_and_how_good_the_run_was(results):
    top = words(synthetic_results(planned=40, complete=False, reason="interrupted <by> the user"))
    assert "incomplete: interrupted <by> the user" in top
    assert "every verdict as expected" not in top
    good = [each for each in results.verdicts if each.as_expected]
    assert "every verdict as expected" in words(
        synthetic_results(verdicts=good, runs=[run for run in results.runs if not run.error])
    )
    empty = {"runs": [], "verdicts": [], "table": {}, "published_table": {}}
    assert "No verdict was given" in words(
        synthetic_results(planned=3, ran=0, complete=False, reason="interrupted", **empty)
    )


def test_what_cannot_be_drawn_costs_only_its_figure(folder, results):
    (folder / results.runs[0].recording).unlink()
    damaged = folder / results.runs[2].recording
    damaged.write_bytes(damaged.read_bytes()[:3000])
    write_reports(folder, workers=1)
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    for text in ("No figure: cannot read plain.h5", "is cut short or damaged", "pop-through <here>"):
        assert text in page.words
    assert str(folder) not in page.words


def test_a_model_that_is_not_known_costs_only_its_figure(folder, results):
    teapot = changed(results.runs[0], model={"kind": "teapot"})
    write_results(folder, synthetic_results(runs=[teapot, *results.runs[1:]]))
    write_reports(folder, workers=1)
    assert "No figure: unknown model &#39;teapot&#39;" in (folder / "report.html").read_text(encoding="utf-8")


def test_any_number_of_processes_draws_the_same_page_and_progress_is_told(folder):
    told = []
    written = write_reports(folder, progress=lambda done, total: told.append((done, total)), workers=1)
    assert [path.name for path in written] == ["table.md", "junit.xml", "report.html"]
    assert told == [(0, 2), (1, 2), (2, 2)]
    alone = (folder / "report.html").read_bytes()
    write_reports(folder, workers=2)
    assert (folder / "report.html").read_bytes() == alone


def test_a_figure_whose_process_dies_costs_only_itself(folder, monkeypatch):
    from hapticeval.reports import write

    draw, told = write.draw, []

    def dying(order):
        if order.prefix == "f0":
            os._exit(9)
        return draw(order)

    monkeypatch.setattr(write, "draw", dying)
    write_reports(folder, progress=lambda done, total: told.append((done, total)), workers=2)
    page = (folder / "report.html").read_text()
    assert page.count("the process that drew this figure has ended") == 1
    assert page.count("<svg") == 1
    assert told == [(0, 2), (1, 2), (2, 2)]


def test_a_folder_without_results_is_an_error(tmp_path):
    with pytest.raises(InputError, match=r"holds no results\.json"):
        write_reports(tmp_path)


def test_importing_the_reports_costs_no_heavy_library():
    code = (
        "import sys, hapticeval.reports; "
        "print([m for m in ('matplotlib', 'numba', 'scipy', 'h5py') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


# Suites, cases and their variants.

SUITES = [
    SuiteEntry(name="synthetic", title="The <first>", citation="thesis 6.3", rows=["Resists <Pop>"]),
    SuiteEntry(name="second", title="The second", citation="", rows=["Suitable for LUT", "never ran"]),
]


@pytest.fixture
def two_suites(results):
    """A second suite of one renderer, with a case that is shown twice: as it is, and with an effect, not judged."""
    case = synthetic_run("slide", "plain", "line", recording=False, suite="second", title="Slide")
    effect = changed(case, case="slide-delay", title="Slide, with a delay", judged=False)
    given = changed(results.verdicts[0], suite="second", case="slide")
    aside = changed(given, case="slide-delay", level=Level.INFO)
    return synthetic_results(
        runs=[*results.runs, case, effect], verdicts=[*results.verdicts, given, aside], suites=SUITES
    )


def test_a_suite_has_the_columns_of_its_own_renderers_and_what_is_not_judged_stands_apart(two_suites):
    page = render_html(two_suites, {})
    checks = page[page.index('id="checks"') : page.index('class="wide suite"')]
    first, second = checks.split('<table class="matrix">')[1], checks.split('<table class="matrix">')[2]
    assert [name in first for name in ("plain", "broken", "alert(1)")] == [True] * 3
    assert [name in second for name in ("plain</th>", "broken</th>", "alert(1)")] == [True, False, False]
    assert "shown, not judged: 1 rows" in words(two_suites)
    assert "Table 6.3" not in page[: page.index("How to read this</h2>")], "no table that its suites do not cite"


def test_a_variant_stands_under_its_case_in_the_contents(two_suites):
    assert "The second Slide with a delay" in words(two_suites)


def test_the_summary_is_grouped_and_no_row_is_lost(two_suites, results):
    text = markdown(two_suites)
    assert text.index("### The &lt;first>") < text.index("Resists &lt;Pop>") < text.index("### The second")
    assert text.index("### The second") < text.index("Suitable for LUT")
    assert "###" not in markdown(results)
    assert all(title in markdown(results) for title in ("Resists &lt;Pop>", "Suitable for LUT"))


def test_the_runs_of_an_effect_are_folded_where_one_figure_shows_them_all(two_suites):
    figure = Drawing(svg='<svg class="figure"></svg>')
    assert "each renderer by itself" not in words(two_suites)
    assert words(two_suites, {("second", "slide-delay", ""): figure}).count("each renderer by itself") == 1
    assert "each renderer by itself" not in words(two_suites, {("second", "slide", ""): figure})


def test_styles_become_classes_of_the_page():
    given = [
        '<svg class="figure" aria-label="a &quot;b&quot;"><path d="M 0 0" style="fill:none"/>',
        '<g style="fill:none"><text style="x:1"> style="y" </text></g>',
    ]
    (first, second), rules = classed(given)
    assert first == '<svg class="figure" aria-label="a &quot;b&quot;"><path d="M 0 0" class="z0"/>'
    assert second == '<g class="z0"><text class="z1"> style="y" </text></g>'
    assert rules == ".z0 {fill:none}\n.z1 {x:1}"


# Closed forms: the evidence of the verdicts, digit for digit.

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


def closed_form(case, renderer="plain", law="6.24", outcome=Outcome.PASS, moments=MOMENTS):
    evidence = {"law": law, "sampled_apart_m": 2e-3, "moments": moments} if moments else {}
    metric = Metric("distance", 3.25e-9, "m") if moments else None
    finding = Finding(outcome, "why <not>", metric, 4.5e-7 if moments else None, evidence)
    return verdict(case, renderer, "closed-form", finding)


def closed_forms(*verdicts, citations=None):
    runs = [
        synthetic_run(
            each.case, each.renderer, "circle", recording=False, title=each.case,
            citation=(citations or {}).get(each.case),
        )
        for each in verdicts
    ]  # fmt: skip
    page = render_html(synthetic_results(verdicts=verdicts, runs=runs), {})
    return page[page.index('id="closed-forms"') : page.index('id="checks"')]


def test_values_are_those_of_the_evidence():
    section = closed_forms(closed_form("circle"))
    text = " ".join(re.sub(r"<[^>]*>", " ", section).split())
    for expected in (
        "0 s 0.5 s 1 s",
        "measured 0.000000 −43.940000 −87.880000 3.25 nm 2 mm",  # noqa: RUF001
        "closed form −0.000003 −43.940003 −87.880003 450 nm",  # noqa: RUF001
        "0.5 s (1000.000000, 100.000000) (1000.000000, 100.000001)",
        "r″ = −k (r − R)",  # noqa: RUF001
        "radius",
        "1 of 1 as the closed form",
    ):
        assert expected in text, expected
    assert '<details class="law">' in section
    assert 'id="closed-forms"' not in render_html(synthetic_results(), {})


def test_cases_that_cite_a_table_come_first_in_its_order_and_are_unfolded():
    section = closed_forms(
        *(closed_form(case) for case in ("sphere", "circle", "line")),
        citations={"circle": "6.3.3, Table 6.2, Figure 6.22", "line": "Table 6.1"},
    )
    found = re.findall(r'<details class="law"( open)?><summary><b>(\w+)</b>', section)
    assert found == [(" open", "line"), (" open", "circle"), ("", "sphere")]


def test_a_verdict_without_moments_says_why_and_one_that_does_not_apply_is_left_out():
    section = closed_forms(
        closed_form("circle", "a", outcome=Outcome.INCONCLUSIVE, moments=None),
        closed_form("circle", "b", outcome=Outcome.NOT_APPLICABLE, moments=None),
    )
    assert "why &lt;not&gt;" in section
    assert "0 of 1 as the closed form" in section
    assert "(9.99)" in closed_forms(closed_form("circle", law="9.99")), "a later version's law has only its name"


# What accuracy costs, where a bench lies beside the results.


def setting(renderer, **changes):
    seconds = Times(median=2e-6, p99=3e-6, p999=4e-6, max=5e-6, tick_share=4e-3)
    errors = {name: {"rms": 1e-5, "p99": 2e-5, "max": 3e-5} for name in ("ihip", "normal", "force")}
    given = {
        "renderer": renderer, "model": "circle", "settings": {"vertices": 40.0}, "label": f"{renderer} vertices 40",
        "errors": errors, "claims": errors, "proven": True, "step": seconds, "batch": None, "memory_bytes": 1_200_000,
        "build_seconds": [0.2, 0.1], "key": renderer, "front": ["step"], "problem": None,
    }  # fmt: skip
    return SettingEntry(**{**given, **changes})


def test_a_bench_is_shown_with_its_front_its_answers_and_what_is_not_proven(results):
    none = {"claims": None, "errors": None, "step": None}
    bench = BenchResults(
        complete=False, reason="interrupted <by> the user", quick=True, seed=1, rounds=8,
        environment={"python": "3.11", "versions": {"numpy": "2", "gone": None}},
        machine={"cores": 2, "clock_ns": 40.0}, command={}, timing={},
        references=[ReferenceEntry(name, "circle", "the exact curve", None) for name in "ab"],
        settings=[setting("a"), setting("b", proven=False), setting("c", **none, problem="no <room>")],
        orders=[OrderEntry("a", "circle", "vertices", {}, [40.0, 80.0], {"ihip": 2.0, "force": None})],
        answers=[
            Answer("circle", "step", 1e-4, 1e-5, "a", "a vertices 40"),
            Answer("circle", "batch", 1e-9, None, None, None),
        ],
        comparison=[Change("circle", "a", "step", 1.5, 1.4, 1.6, 0.01, "worse")],
    )  # fmt: skip
    page = Page(render_html(results, {}, bench=bench)).words
    for expected in (
        "Incomplete: interrupted <by> the user.",
        "circle one step at a time, from Python 0.1 mm within 10 µs a vertices 40 20 µm in 2 µs",
        "circle a whole trajectory at once 1 nm no setting",
        "b vertices 40 ≤ 20 µm ≤ 30 µm 2e-05° 2e-05 N 2 µs 4 µs 0.4 % – 1.2 MB 100 ms",  # noqa: RUF001
        "worse: a on the circle, step, 1.5 times what it was",
        "a on the circle, by vertices: ihip 2.00",
        "the exact curve: a on the circle, b on the circle",
        "left out c vertices 40 on the circle: no <room>",
        "2 cores, Python 3.11, numpy 2, reading the clock takes 40 ns, which is in every step, 8 rounds, seed 1.",
        "Pareto front",
        "least time to build (s)",
        "time now / time then",
    ):
        assert expected in page, expected


# Replays: the differences, the clock, and that the hand would have reacted.

APART = Apart(rms=1e-4, max=2.5e-3, time=1.25, row=1250)


def replay(note, difference):
    return Replay(
        file="run<7>.h5", note=note, clock="irregular, 7 to 8 ms", stretches=3, rows=4000, rows_left_out=20,
        left_out=["spike in hip.x, 1.2 to 1.3 s"], suspicious=["sign of <force>"], seconds=4.0, difference=difference,
    )  # fmt: skip


def replayed(*differences):
    notes = ["as it was", *[OPEN_LOOP] * len(differences)]
    runs = [
        synthetic_run(
            "lobe", f"r{index}", "cassinian", recording=False, replay=replay(note, difference)
        )
        for index, (note, difference) in enumerate(zip(notes, [None, *differences], strict=True))
    ]  # fmt: skip
    return synthetic_results(runs=runs)


def test_the_page_tells_how_far_each_renderer_is_and_that_it_is_open_loop():
    results = replayed(
        Difference(APART, None, 4000, None), Difference(Apart(0.0, 0.0, 0.0, 0), APART, 9, 0.1)
    )  # fmt: skip
    page = words(results)
    for expected in (
        "r1 0.1 mm 2.5 mm t = 1.25 s, row 1250 not recorded",
        "r2 equal to the last bit 0.0001 N 0.0025 N t = 1.25 s, row 1250 differs in 10 %",
        f"Replay of run<7>.h5. {OPEN_LOOP}",
        "4000 samples, 4 s, in 3 stretches, the renderer reset at the start of each",
        "20 rows are left out (spike in hip.x, 1.2 to 1.3 s). Clock: irregular, 7 to 8 ms.",
        "The recording is suspicious",
        "sign of <force>",
        "as it was Left out: spike in hip.x, 1.2 to 1.3 s.",
    ):
        assert expected in page, expected


def test_where_nothing_was_compared_there_is_no_table(results):
    for none in (results, replayed(), replayed(Difference(None, None, 4000, None))):
        assert "Distance from the recorded run" not in words(none)
