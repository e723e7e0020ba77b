import os
import re
import subprocess
import sys
from html.parser import HTMLParser

import pytest
from reports_synthetic import HOSTILE, synthetic_results

from hapticeval.errors import InputError
from hapticeval.reports import render_html, write_reports
from hapticeval.reports.svg import THEME
from hapticeval.runner.results import write_results

VOID = {"meta", "br", "input", "link", "img"}


class Page(HTMLParser):
    """Collects ids, links, classes and text, and sees that tags are closed in order."""

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


@pytest.fixture
def page(folder):
    write_reports(folder, workers=1)
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def test_every_link_in_the_matrix_leads_to_its_verdict(page, results):
    assert len(page.ids) == len(set(page.ids))
    anchors = [link.removeprefix("#") for link in page.links]
    assert set(anchors) <= set(page.ids)
    assert {f"v{index}" for index in range(len(results.verdicts))} <= set(anchors)


def test_the_page_tells_what_ran_and_what_was_found(page):
    for text in (
        "13 of 13 planned",
        "16× real time",  # noqa: RUF001
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


def test_nothing_that_a_renderer_says_becomes_markup(page):
    assert HOSTILE in page.words
    assert not {"script", "link", "iframe"} & {tag for tag, _ in page.tags}
    assert not any(name.startswith("on") for _, given in page.tags for name in given)


def test_the_page_needs_no_network(folder):
    write_reports(folder, workers=1)
    text = (folder / "report.html").read_text(encoding="utf-8").replace('xmlns="http://www.w3.org/2000/svg"', "")
    assert not re.search(r"https?://|url\((?!#)|@import|src=", text)


def test_the_page_defines_every_colour_of_the_figures(results):
    text = render_html(results, {})
    for role in THEME:
        assert f"--fig-{role}:" in text


def test_an_incomplete_run_is_told_at_the_top():
    text = render_html(synthetic_results(planned=40, complete=False, reason="interrupted <by> the user"), {})
    top = Page(text).words
    assert "incomplete: interrupted <by> the user" in top
    assert "every verdict as expected" not in top


def test_a_good_run_says_that_all_is_as_expected(results):
    verdicts = [each for each in results.verdicts if each["as_expected"]]
    runs = [run for run in results.runs if not run["error"]]
    good = synthetic_results(verdicts=verdicts, runs=runs, planned=len(verdicts), ran=len(verdicts))
    assert "every verdict as expected" in Page(render_html(good, {})).words


def test_an_empty_run_is_a_page_too():
    empty = synthetic_results(
        planned=3, ran=0, complete=False, reason="interrupted", runs=[], verdicts=[], table={}, published_table={}
    )
    assert "No verdict was given" in Page(render_html(empty, {})).words


def test_a_missing_or_damaged_recording_is_told_in_its_place(folder, results):
    (folder / results.runs[0]["recording"]).unlink()
    damaged = folder / results.runs[2]["recording"]
    damaged.write_bytes(damaged.read_bytes()[:3000])
    write_reports(folder, workers=1)
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    assert "No figure: cannot read the recording" in page.words
    assert "is cut short or damaged" in page.words
    assert str(folder) not in page.words
    assert "pop-through <here>" in page.words


def test_a_model_that_is_not_known_costs_only_its_figure(folder, results):
    runs = [dict(run) for run in results.runs]
    runs[0]["model"] = {"kind": "teapot"}
    write_results(folder, synthetic_results(runs=runs))
    write_reports(folder, workers=1)
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    assert "No figure: unknown model 'teapot'" in page.words


def test_three_files_are_written_and_progress_is_told(folder):
    told = []
    written = write_reports(folder, progress=lambda done, total: told.append((done, total)), workers=1)
    assert [path.name for path in written] == ["table.md", "junit.xml", "report.html"]
    assert all(path.stat().st_size > 0 for path in written)
    assert told == [(0, 2), (1, 2), (2, 2)]


def test_any_number_of_processes_draws_the_same_page(folder, results):
    write_reports(folder, workers=1)
    alone = (folder / "report.html").read_bytes()
    write_reports(folder, workers=2)
    assert (folder / "report.html").read_bytes() == alone


def test_a_figure_whose_process_dies_costs_only_itself(folder, results, monkeypatch):
    from hapticeval.reports import write

    draw, told = write.draw, []
    write_reports(folder, workers=1)
    first = (folder / "report.html").read_text()

    def dying(order):
        if order.prefix == "f0":
            os._exit(9)
        return draw(order)

    monkeypatch.setattr(write, "draw", dying)
    write_reports(folder, progress=lambda done, total: told.append((done, total)), workers=2)
    page = (folder / "report.html").read_text()
    assert page.count("the process that drew this figure has ended") == 1
    assert page.count("<svg") == first.count("<svg") - 1
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
