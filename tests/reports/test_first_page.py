"""The pages: everything that ran is on them, nothing that anyone wrote becomes markup, and they need no network."""

from __future__ import annotations

import os
import re
import shutil
from html.parser import HTMLParser

import pytest
from reports_synthetic import HOSTILE, synthetic_results, synthetic_run, verdict
from result_entries import changed

from hapticeval.errors import InputError
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome
from hapticeval.recordings.difference import Apart, Difference
from hapticeval.replay import OPEN_LOOP
from hapticeval.reports import ReportView, markdown, render_pages, write_reports
from hapticeval.reports.bench_figure import cheapest_by_renderer
from hapticeval.reports.canvas import THEME
from hapticeval.reports.cards import accuracy_card, cases_by_effect, effects_card
from hapticeval.reports.pages import worst_words
from hapticeval.reports.templates import GLOSSARY, anchor, case_file, explain_terms
from hapticeval.runner.folder import REPORTS
from hapticeval.runner.results import Replay, SuiteEntry, write_results
from hapticeval.runner.standing import Standing
from hapticeval.study.bench.document import (
    Answer,
    BenchResults,
    Change,
    OrderEntry,
    ReferenceEntry,
    SettingEntry,
    Times,
    Uncalled,
)

VOID = {"meta", "br", "input", "link", "img"}
IMPLIED = {"p", "li", "tr", "th", "td"}
"""Elements whose end HTML knows by what follows."""


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
        while self.open[-1] != tag:
            assert self.open.pop() in IMPLIED
        self.open.pop()

    def handle_data(self, data):
        self.text.append(data)

    @property
    def words(self):
        return " ".join("".join(self.text).replace("\u200b", "").split())


def render(results, page="index", **options):
    """One of the pages; empty where there is none."""
    return render_pages(ReportView(results, **options)).get(f"{page}.html", "")


def words(results, page="index", **options):
    return Page(render(results, page, **options)).words


def read(file):
    return Page(file.read_text(encoding="utf-8"))


def read_files(folder):
    """Return the bytes of every file below a folder by its path there."""
    return {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture(scope="module")
def pages(reported):
    report = reported / "report"
    return {str(file.relative_to(report)): read(file) for file in sorted(report.rglob("*.html"))}


def test_the_first_page_tells_what_ran_and_what_was_found(pages):
    page = pages["index.html"]
    for text in (
        "4 of 13 verdicts are not as expected, broken and plain broke in 2 runs, which lost 1 verdict",
        "3 renderers in 2 cases, 13 verdicts",
        "1 in error",
        "2 failed",
        "2 differ from what is published",
        "2 failed as known",
        "3× real time",  # noqa: RUF001
        "Not as expected, worst first",
        "IHIP jump 40 mm, bound 1 mm, margin -39 mm",
        "it raised <ValueError> at tick 7",
        "What to do: mend it",
        "hapticeval 0.1.0",
    ):
        assert text in page.words, text
    assert "published: No" in page.words


def test_each_card_has_the_figure_of_its_own_verdict(pages, results):
    worst = ReportView(results).worst
    assert len({shown.verdict.key for shown in worst}) < len(worst), "two of them are of one run"
    drawable = {run.key for run in results.runs if run.recording}
    drawn = sum(shown.verdict.key in drawable for shown in worst)
    assert sum(tag == "figure" for tag, _ in pages["index.html"].tags) == drawn > 1


def test_each_case_has_a_page_with_a_place_for_each_verdict_and_every_link_leads_somewhere(pages, results):
    beside = {"index.html", "checks.html", "reading.html"}
    assert set(pages) == beside | {case_file(run.suite, run.case) for run in results.runs}
    for each in results.verdicts:
        page = pages[case_file(each.suite, each.case)]
        assert anchor(each.renderer, each.check) in page.ids
    for name, page in pages.items():
        assert len(page.ids) == len(set(page.ids))
        for link in page.links:
            file, _, place = link.partition("#")
            target = os.path.normpath(os.path.join(os.path.dirname(name), file)) if file else name  # noqa: PTH118, PTH120
            assert target in pages, (name, link)
            assert not place or place in pages[target].ids, (name, link)


def test_nothing_that_a_renderer_says_becomes_markup_and_no_network_is_needed(pages, reported):
    report = reported / "report"
    assert HOSTILE in pages["index.html"].words
    for file in report.rglob("*.html"):
        page = read(file)
        assert not {"iframe", "object"} & {tag for tag, _ in page.tags}
        assert not any(name.startswith("on") for _, given in page.tags for name in given)
        text = file.read_text(encoding="utf-8")
        assert not re.search(r"https?://|url\((?!#)|@import|<script>alert", text)
        for tag, given in page.tags:
            for name in {"src", "href"} & set(given):
                assert tag == "a" or (file.parent / given[name]).exists() or given[name].startswith("#"), given
    style = (report / "assets" / "report.css").read_text()
    assert all(f"--fig-{role}:" in style for role in THEME), "the style defines every colour of the figures"
    assert all(f'.{each} {{ --sign: "{each.symbol}"; }}' in style for each in Standing)


def test_a_word_is_explained_where_it_first_stands_and_nowhere_else():
    page = '<h1 title="HIP">The IHIP</h1><svg><text>HIP</text></svg><p>IHIP and <code>HIP</code> HIPs, HIP; a HIP</p>'
    assert explain_terms(page) == (
        f'<h1 title="HIP">The <abbr title="{GLOSSARY["IHIP"]}">IHIP</abbr></h1><svg><text>HIP</text></svg>'
        f'<p>IHIP and <code>HIP</code> HIPs, <abbr title="{GLOSSARY["HIP"]}">HIP</abbr>; a HIP</p>'
    )


def test_every_word_of_the_glossary_is_told_on_the_page_that_says_how_to_read(pages):
    assert all(f"{word} {meaning}" in pages["reading.html"].words for word, meaning in GLOSSARY.items())


def test_the_next_run_removes_all_that_a_report_leaves(folder, reported):
    left = {path.name for path in reported.iterdir()} - {path.name for path in folder.iterdir()}
    assert left <= {*REPORTS}, "what write_reports writes stands in runner/folder.py: REPORTS"


def test_one_file_holds_all_pages_and_needs_nothing_else(folder, results):
    written = write_reports(folder, single_file=True, workers=0)
    assert [path.name for path in written] == ["table.md", "junit.xml", "report.html", "tables"]
    assert not (folder / "report").exists()
    text = (folder / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert len(page.ids) == len(set(page.ids))
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    for each in results.verdicts:
        assert anchor(each.suite, each.case, each.renderer, each.check) in page.ids
    assert not any({"src", "href"} & set(given) for tag, given in page.tags if tag not in ("a", "use"))


def test_the_top_says_how_complete_and_how_good_the_run_was(results):
    top = words(synthetic_results(planned=40, complete=False, reason="interrupted <by> the user"))
    assert "Incomplete: interrupted <by> the user" in top
    assert "Every verdict is as expected" not in top
    good = [each for each in results.verdicts if each.as_expected]
    fine = synthetic_results(verdicts=good, runs=[run for run in results.runs if not run.error])
    assert "✓ Every verdict is as expected" in words(fine)
    assert "Known failures, worst first" not in words(fine), "a warning comes before what is known"
    strict = words(synthetic_results(strict=True, verdicts=good, runs=fine.runs))
    assert "✗ 2 of 8 verdicts are not as expected (by --strict: 2 warn)" in strict
    known = [each for each in good if each.published is not None]
    assert "Known failures, worst first" in words(synthetic_results(verdicts=known, runs=fine.runs))
    empty = {"runs": [], "verdicts": [], "table": {}, "published_table": {}}
    assert "No verdict was given" in words(synthetic_results(**empty))


def test_a_report_is_dated_and_names_the_commit_of_each_renderer(results):
    dated = synthetic_results(date="2026-11-22T10:47:21+00:00", commits={"plain": "0123456789abcdef-dirty"})
    title = re.search("<title>(.*)</title>", render(dated))[1]
    for text in ("2026-11-22 10:47 UTC", "hapticeval", "0.1.0", "plain at commit 0123456789ab-dirty"):
        assert text in title
    assert "Commit 0123456789abcdef-dirty: plain." in words(dated, "reading")
    same = dict.fromkeys(results.renderers, "a" * 40)
    assert "UTC, commit aaaaaaaaaaaa</title>" in render(synthetic_results(date=dated.date, commits=same))


def test_what_cannot_be_drawn_costs_only_its_figure(folder, results):
    (folder / results.runs[0].recording).unlink()
    damaged = folder / results.runs[2].recording
    damaged.write_bytes(damaged.read_bytes()[:3000])
    write_reports(folder, workers=0)
    found = {name: read(folder / "report" / name) for name in ("index.html", case_file("synthetic", "lobe"))}
    for page in found.values():
        assert "cannot read plain.h5" in page.words
        assert "pop-through <here>" in page.words
        assert str(folder) not in page.words
    assert "is cut short or damaged" in read(folder / "report" / case_file("synthetic", "tip")).words


def test_of_a_model_that_is_not_known_the_paths_are_drawn(folder, results):
    teapot = changed(results.runs[0], model={"kind": "teapot"})
    write_results(folder, synthetic_results(runs=[teapot, *results.runs[1:]]))
    write_reports(folder, workers=0)
    for page in (folder / "report" / "index.html", folder / "report" / case_file("synthetic", "lobe")):
        text = page.read_text(encoding="utf-8")
        assert '"model":null' in text
        assert "pop-through <here>" in Page(text).words


@pytest.mark.system
def test_any_number_of_processes_draws_the_same_pages_and_progress_is_told(folder, reported):
    told = []
    written = write_reports(folder, progress=lambda done, total: told.append((done, total)), workers=2)
    assert [path.name for path in written] == ["table.md", "junit.xml", "index.html", "tables"]
    assert told == [(done, total) for total in [told[0][1]] for done in range(total + 1)]
    assert read_files(folder / "report") == read_files(reported / "report")


def test_a_page_whose_process_dies_costs_only_its_figures(folder, monkeypatch):
    from hapticeval.reports import write

    draw, told = write.draw, []

    def dying(order):
        if isinstance(order, write.Page) and order.runs[0].case == "lobe":
            os._exit(9)
        return draw(order)

    monkeypatch.setattr(write, "draw", dying)
    write_reports(folder, progress=lambda done, total: told.append((done, total)), workers=2)
    page = read(folder / "report" / case_file("synthetic", "lobe")).words
    assert "the process that drew this figure has ended" in page
    assert "pop-through <here>" in page
    assert told[-1][0] == told[-1][1]


def test_a_report_that_is_given_up_leaves_the_one_before(reported, tmp_path):
    folder = shutil.copytree(reported, tmp_path / "copy")
    before = read_files(folder)
    with pytest.raises(KeyboardInterrupt):
        write_reports(folder, workers=0, stopped=lambda: True)
    assert before == read_files(folder)


def test_a_folder_without_results_is_an_error(refused, tmp_path):
    with refused(InputError):
        write_reports(tmp_path)


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
    given = changed(results.verdicts[0], suite="second", case="slide", known=None)
    aside = changed(given, case="slide-delay", level=Level.INFO, published=None)
    return synthetic_results(
        runs=[*results.runs, case, effect], verdicts=[*results.verdicts, given, aside], suites=SUITES
    )


def test_a_suite_has_the_columns_of_its_own_renderers_and_what_is_not_judged_is_named(two_suites):
    page = render(two_suites)
    first, second = page[page.index('id="cases"') :].split('<table class="grid small">')[1:]
    assert [name in first for name in ("plain", "broken", "alert(1)")] == [True] * 3
    assert [name in second for name in ("plain</span>", "broken</span>", "alert(1)")] == [True, False, False]
    assert "slide-delay · shown, not judged" in Page(page).words
    assert '"tile standing not-judged"' in second
    assert "Table 6.3" not in Page(page).words, "no table that its suites do not cite"


def test_the_summary_is_grouped_and_no_row_is_lost(two_suites, results):
    text = markdown(two_suites)
    assert text.index("### The &lt;first>") < text.index("Resists &lt;Pop>") < text.index("### The second")
    assert text.index("### The second") < text.index("Suitable for LUT")
    assert "###" not in markdown(results)
    assert all(title in markdown(results) for title in ("Resists &lt;Pop>", "Suitable for LUT"))


def test_published_answers_stand_beside_those_of_a_renderer_that_nobody_has_published(results):
    mine = {"table": {"Resists <Pop>": {"plain": "No"}}, "published_table": {"Resists <Pop>": {"theirs": "Yes"}}}
    page = words(synthetic_results(**mine))
    assert "plain theirs in print Resists <Pop> No Yes" in page
    assert "theirs (in print)" in markdown(synthetic_results(**mine))


@pytest.mark.parametrize(
    ("states", "title"),
    [
        ({Standing.KNOWN}, "Known failures"),
        ({Standing.KNOWN, Standing.WARNING}, "Warnings"),
        ({Standing.WARNING, Standing.FAIL}, "Not as expected"),
    ],
)
def test_a_warning_alone_is_not_called_unexpected_where_the_headline_calls_all_expected(states, title):
    assert worst_words(states) == title


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
    return render(synthetic_results(verdicts=verdicts, runs=runs), "closed-forms")


def test_values_are_those_of_the_evidence():
    section = closed_forms(closed_form("circle"))
    text = " ".join(re.sub(r"<[^>]*>", " ", section).split())
    for expected in (
        "0 s 0.5 s 1 s",
        "measured 0.000000 −43.940000 −87.880000 3.25 nm 2 mm",  # noqa: RUF001
        "closed form −0.000003 −43.940003 −87.880003 450 nm",  # noqa: RUF001
        "r″ = −k (r − R)",  # noqa: RUF001
        "radius",
        "1 of 1 as the closed form",
    ):
        assert expected in text, expected
    assert '<details class="law">' in section
    assert not render(synthetic_results(), "closed-forms")


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
    seconds = Times(median=2e-6, p99=3e-6, rounds=[2e-6])
    errors = {name: {"rms": 1e-5, "p99": 2e-5, "max": 3e-5} for name in ("ihip", "normal", "force")}
    given = {
        "renderer": renderer, "model": "circle", "settings": {"vertices": 40.0}, "label": f"{renderer} vertices 40",
        "errors": errors, "claims": errors, "proven": True, "step": seconds, "memory_bytes": 1_200_000,
        "build_seconds": [0.2, 0.1], "key": renderer, "front": True, "problem": None,
    }  # fmt: skip
    return SettingEntry(**{**given, **changes})


def test_a_bench_is_shown_with_its_front_its_answers_and_what_is_not_proven(results):
    none = {"claims": None, "errors": None, "step": None}
    bench = BenchResults(
        complete=False, reason="interrupted <by> the user", quick=True, seed=1, rounds=8,
        environment={"python": "3.11", "versions": {"numpy": "2", "gone": None}},
        machine={"cores": 2}, command={}, timing={}, empty=Times(median=4e-8, p99=5e-8, rounds=[4e-8]),
        references=[ReferenceEntry(name, "circle", "the exact curve", None) for name in "ab"],
        settings=[
            setting("a"), setting("b", proven=False, worst_at=[1e-3, -2e-3]), setting("c", **none, problem="no <room>"),
        ],
        orders=[OrderEntry("a", "circle", "vertices", {}, [40.0, 80.0], {"ihip": 2.0, "force": None})],
        answers=[
            Answer("circle", 1e-4, 1e-5, "a", "a vertices 40", "a on the exact curve"),
            Answer("circle", 1e-9, None, None, None),
        ],
        comparison=[Change("circle", "a", "step", 1.5, "worse")],
    )  # fmt: skip
    page = words(results, "costs", bench=bench)
    for expected in (
        "Incomplete: interrupted <by> the user.",
        "b vertices 40 ≤ 30 µm at (1, -2) mm ≤ 20 µm 2e-5° 2e-5 N 2 µs 0.2 % 1.2 MB 3 µs 100 ms",
        "worse: a on the circle, step, 1.5 times what it was",
        "a on the circle by vertices (ihip 2.00)",
        "the exact curve: a on the circle, b on the circle",
        "Not measured c vertices 40 on the circle: no <room>",
        "2 cores, Python 3.11, numpy 2, a call that does nothing takes 40 ns, 99 % of them at most 50 ns, "
        "which is in every step, 8 rounds, seed 1.",
        "a vertices 40 ★ 2 µs 30 µm 1.2 MB 100 ms",
        "tick of 1 ms",
    ):
        assert expected in page, expected


def test_the_first_card_names_the_quickest_setting_within_a_tenth_of_a_millimetre(results):
    def entry(renderer, time, error, **changes):
        errors = {name: {"rms": error, "p99": error, "max": error} for name in ("ihip", "normal", "force")}
        names = {"key": f"{renderer}{time}", "label": f"{renderer} {error:g}"}
        times = Times(median=time, p99=time, rounds=[time])
        return setting(renderer, claims=errors, step=times, **names, **changes)

    slow, quick, off = entry("a@curve", 9e-6, 0.0), entry("a@polygon", 3e-6, 9e-5), entry("a@polygon", 1e-6, 2e-4)
    far, farther = entry("b", 8e-6, 4e-4), entry("b", 1e-6, 8e-4)
    settings = [slow, off, quick, farther, far]
    assert cheapest_by_renderer(settings) == {"a": quick, "b": far}
    assert cheapest_by_renderer(settings, group=str) == {"a@polygon": quick, "a@curve": slow, "b": far}
    bench = BenchResults(
        complete=True, reason=None, quick=True, seed=1, rounds=1, environment={}, machine={}, command={}, references=[],
        settings=settings, orders=[], answers=[], timing={}, uncalled=Uncalled("a@curve", True, 1.004),
    )  # fmt: skip
    card = accuracy_card(bench)
    assert card.sentence == (
        "1 of 2 renderers come within 0.1 mm of what they aim at, in 3 µs to 3 µs a step: 0.3 % of a tick. "
        "b is off by 0.4 mm at its best."
    )
    page = render(results, "costs", bench=bench)
    assert page.count("★") == 2, "in the words above and at one setting"
    assert '"title":"a"' in page
    assert '"title":"b"' in page
    first = render(results, bench=bench)
    assert first.index('id="summary"') < first.index(card.sentence) < first.index('id="phenomena"')


def test_a_card_tells_which_cases_call_for_effects_and_what_an_uncalled_one_costs():
    friction = {"kind": "friction", "mu_s": 0.5, "mu_k": 0.3}
    runs = [synthetic_run(case, "plain", "line") for case in ("a", "b", "c")]
    runs[2] = changed(runs[2], scene=changed(runs[2].scene, effects=[friction]))
    cases = cases_by_effect(synthetic_results(runs=runs, verdicts=[]))
    assert cases == {"none": [("synthetic", "a"), ("synthetic", "b")], "friction": [("synthetic", "c")]}
    assert effects_card(cases, None).sentence.startswith("2 of 3 cases call for no effect, and run the renderer as its")
    assert effects_card({"none": cases["none"]}, None) is None


def test_the_table_has_the_columns_of_print_first_and_leads_to_the_worst_behind_an_answer(results):
    suite = SuiteEntry(
        name="synthetic", title="The <first>", citation="thesis 6.3, Table 6.3", rows=["Resists <Pop>"],
        cells={"Resists <Pop>": ["lobe/continuous-contact"]},
    )  # fmt: skip
    mine = {
        "table": {"Resists <Pop>": {"plain": "No", "broken": "No"}},
        "published_table": {"Resists <Pop>": {"broken": "No"}},
    }
    view = ReportView(changed(synthetic_results(**mine), suites=[suite]))
    summary = view.first_summary
    assert summary.number == "Table 6.3"
    assert summary.renderers == ("broken", "plain")
    link = view.answer_link(summary, "Resists <Pop>", "plain")
    assert link == f"{case_file('synthetic', 'lobe')}#{anchor('plain', 'continuous-contact')}"
    page = render_pages(view)["index.html"]
    assert f'<a class="answer no" href="{link}">No</a>' in page
    assert "as published" in page


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
    page = words(results, "replay")
    for expected in (
        "r1 0.1 mm 2.5 mm t = 1.25 s, row 1250 not recorded",
        "r2 equal to the last bit 0.0001 N 0.0025 N t = 1.25 s, row 1250 differs in 10 %",
        f"Replay of run<7>.h5 {OPEN_LOOP}",
        "4000 samples, 4 s, in 3 stretches, the renderer reset at the start of each",
        "20 rows are left out (spike in hip.x, 1.2 to 1.3 s). Clock: irregular, 7 to 8 ms.",
        "The recording is suspicious",
        "sign of <force>",
        "as it was Left out: spike in hip.x, 1.2 to 1.3 s.",
    ):
        assert expected in page, expected


def test_where_nothing_was_compared_there_is_no_table(results):
    for none in (results, replayed(), replayed(Difference(None, None, 4000, None))):
        page = render(none, "replay")
        assert "Distance from the recorded run" not in page
        assert bool(page) is any(run.replay for run in none.runs)


def test_a_suite_stands_on_the_first_page_with_its_version():
    suite = SuiteEntry(name="synthetic", title="The first", citation="", rows=[], version="1.2")
    assert (
        ">synthetic 1.2</span>" in render_pages(ReportView(changed(synthetic_results(), suites=[suite])))["index.html"]
    )


@pytest.mark.parametrize("single_file", [False, True])
def test_what_the_thesis_shows_is_linked_where_it_lies_beside(tmp_path, undrawn, single_file):
    write_results(tmp_path, synthetic_results())
    page = tmp_path / ("report.html" if single_file else "report/index.html")
    write_reports(tmp_path, single_file=single_file, workers=0)
    assert not any("thesis/" in link for link in Page(page.read_text(encoding="utf-8")).links)
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "index.html").write_text("<!doctype html>")
    write_reports(tmp_path, single_file=single_file, workers=0)
    (link,) = [link for link in Page(page.read_text(encoding="utf-8")).links if "thesis/" in link]
    assert (page.parent / link).exists()
