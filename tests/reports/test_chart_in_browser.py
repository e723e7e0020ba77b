"""Charts of plain data in a real browser: every kind of axis and curve lies in its picture, and words are words."""

from __future__ import annotations

import numpy as np
import pytest
from chromium import Chromium

from hapticeval.reports.case_page import write_assets
from hapticeval.reports.chart import Axis, Chart, Curve, Note, Rule, charts_data

pytestmark = pytest.mark.browser

TIME = np.linspace(0.0, 2.0, 50)
CHARTS = {
    "lines": Chart(
        title="lines",
        x=Axis(label="time (s)", tight=True),
        y=Axis(label="left (N)", zero=True),
        right=Axis(label="right (mm)"),
        curves=[
            Curve(x=TIME, y=np.where(TIME < 1.0, np.sin(TIME), np.nan), role="hip", label="one", steps=True),
            Curve(x=TIME, y=1e3 * TIME, role="ihip", label="two", dash=(6, 2), right=True),
        ],
        shades=[(0.5, 1.0)],
        rules=[Rule(x=1.5, role="quiet", text="here"), Rule(y=0.5, role="mark", text="half")],
    ),
    "powers": Chart(
        title="powers",
        x=Axis(label="time (us)", log=True),
        y=Axis(label="error (mm)", log=True),
        curves=[Curve(x=[1.0, 10.0, 100.0], y=[1.0, 1e-3, 1e-6], role="one", marker="s", hollow=True, faint=True)],
        notes=[
            *(Note(1.0 + 0.01 * k, 1.0, text) for k, text in enumerate(("first", "below", "lowest", "covered"))),
            Note(100.0, 1e-6, "last, at the right edge"),
        ],
    ),
    "names": Chart(
        title="names",
        x=Axis(label="memory (MB)", log=True),
        y=Axis(label="", names=["upper", "lower"]),
        curves=[Curve(x=[1.0], y=[row], role="one", marker="D", line=False) for row in (0, 1)],
    ),
    "empty": Chart(title="empty", x=Axis(label="x"), y=Axis(label="y"), curves=[]),
    "constant": Chart(
        title="flat", x=Axis(label="x"), y=Axis(label="y"), curves=[Curve(x=TIME, y=0 * TIME, role="one")]
    ),
}


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    folder = tmp_path_factory.mktemp("charts")
    write_assets(folder)
    figures = "".join(
        f'<figure class="drawn" id="{name}"><script type="application/json">{charts_data([chart])}</script></figure>'
        for name, chart in CHARTS.items()
    )
    head = (
        '<meta charset="utf-8"><link rel="stylesheet" href="assets/report.css"><script src="assets/draw.js"></script>'
    )
    (folder / "page.html").write_text(f"<!doctype html><html><head>{head}</head><body>{figures}</body></html>")
    with Chromium() as chromium:
        chromium.open(folder / "page.html")
        yield chromium


def words(browser, name):
    return browser.run(f"[...document.querySelectorAll('#{name} .chart > text')].map(text => text.textContent)")


@pytest.mark.parametrize("name", CHARTS)
def test_a_chart_lies_in_its_picture_and_has_the_words_of_its_data(browser, name):
    assert browser.problems == []
    chart = CHARTS[name]
    inside = """(() => { const box = document.querySelector('#%s .chart').getBoundingClientRect();
        return [...document.querySelectorAll('#%s .chart text')].map(text => text.getBoundingClientRect())
            .every(b => b.left >= box.left - 1 && b.right <= box.right + 1 && b.bottom <= box.bottom + 1) })()"""
    assert browser.run(f"document.querySelector('#{name} .chart').getBoundingClientRect().height") == chart.height
    assert browser.run(inside % (name, name))
    texts = words(browser, name)
    assert {chart.x.label, chart.y.label} - {""} <= set(texts)
    assert not any("NaN" in text or "undefined" in text for text in texts)
    attributes = f"[...document.querySelectorAll('#{name} .chart *')].flatMap(e => [...e.attributes]).map(a => a.value)"
    assert not any("NaN" in value or "undefined" in value for value in browser.run(attributes))


def test_a_line_is_broken_where_a_number_is_none(browser):
    path = browser.run("document.querySelector('#lines .chart g path[stroke*=\"--fig-hip\"]').getAttribute('d')")
    assert path.count("M") == 1
    # Of 50 samples in 2 s those before 1 s.
    assert path.count("H") == 24


def test_axes_of_powers_have_powers_and_words_cover_no_others(browser):
    texts = words(browser, "powers")
    assert {"1", "10", "100", "first", "last, at the right edge"} <= set(texts)
    assert "10⁻⁶" in texts
    assert "covered" not in texts, "above, below and farther below are taken"
    boxes = "[...document.querySelectorAll('#powers .note-text')].map(text => text.getBoundingClientRect().top)"
    tops = browser.run(f"{boxes}.slice(0, 3)")
    assert tops == sorted(tops)
    assert min(np.diff(tops)) > 12.0


def test_rows_of_names_go_from_the_top(browser):
    tops = "[...document.querySelectorAll('#names .chart text')].filter(t => /er$/.test(t.textContent))"
    assert (
        browser.run(
            f"{tops}.map(t => [t.textContent, t.getBoundingClientRect().top]).sort((a, b) => a[1] - b[1])[0][0]"
        )
        == "upper"
    )
