"""The first page, and the page that holds all, in a real browser: for everyone's eyes, on a phone, and on paper."""

from __future__ import annotations

import base64
import io
import json
import re

import matplotlib.image
import numpy as np
import pytest
from chromium import AXE, AXE_FINDINGS, SMALL_TEXT, Chromium
from reports_synthetic import lobe_recording, synthetic_results, tip_recording, verdicts
from result_entries import changed

from hapticeval.recordings.hdf5 import write_recording
from hapticeval.reports import write_reports
from hapticeval.runner.results import write_results

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def browser():
    with Chromium() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A run with every state, and with digits of hard cases."""
    folder = tmp_path_factory.mktemp("results")
    digits = changed(verdicts("lobe", "plain", lobe_recording())[1], check="numerical-stability", published=None)
    given = changed(digits, as_expected=True, evidence={"digits": 12.3})
    results = synthetic_results()
    results = synthetic_results(verdicts=[*results.verdicts, given], date="2026-11-22T10:47:21+00:00")
    write_results(folder, results)
    write_recording(folder / results.runs[0].recording, lobe_recording())
    write_recording(folder / results.runs[2].recording, tip_recording())
    write_reports(folder, workers=0)
    write_reports(folder, single_file=True, workers=0)
    beside = {name: folder / "report" / f"{name}.html" for name in ("hard-cases", "reading", "checks")}
    return {"first": folder / "report" / "index.html", "single": folder / "report.html", **beside}


@pytest.fixture
def opened(browser, report):
    def opened(name, **how):
        browser.open(report[name], **how)
        return browser

    yield opened
    assert browser.problems == []


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1440, 390])
@pytest.mark.parametrize("name", ["first", "single", "hard-cases", "reading", "checks"])
def test_it_has_no_fault_for_people_who_do_not_see_or_point_well(opened, name, width, dark):
    browser = opened(name, width=width, dark=dark)
    browser.run(AXE.read_text(encoding="utf-8") + ";0")
    assert json.loads(browser.run(AXE_FINDINGS)) == []


@pytest.mark.parametrize("width", [1440, 390])
def test_nothing_reaches_beyond_the_window(opened, width):
    browser = opened("first", width=width)
    assert browser.run("document.documentElement.scrollWidth") == width
    assert browser.run(
        "[...document.querySelectorAll('#phenomena .tile')].every(tile => tile.scrollWidth <= tile.clientWidth + 1)"
    )


@pytest.mark.parametrize("width", [1440, 390])
@pytest.mark.parametrize("name", ["first", "hard-cases", "reading", "checks"])
def test_no_text_is_smaller_than_eleven_pixels(opened, name, width):
    assert json.loads(opened(name, width=width).run(SMALL_TEXT)) == []


@pytest.mark.parametrize("name", ["reading"])
def test_a_page_s_first_words_stand_clear_of_its_header(opened, name):
    bottom, top = "document.querySelector('header').getBoundingClientRect().bottom", "p.getBoundingClientRect().top"
    assert opened(name).run(f"(p => {top} - {bottom})(document.querySelector('main p'))") >= 15


def test_a_card_has_a_close_up_beside_each_plot(opened):
    browser = opened("first")
    shown = browser.run("[...document.querySelectorAll('.still .pairs .chart')].map(c => c.getAttribute('aria-label'))")
    assert [text.endswith(", close up") for text in shown[:4]] == [False, True, False, True]
    assert "20 ticks to either side of t = " in browser.run("document.querySelector('.close-words').textContent")


def test_on_a_phone_the_table_is_whole(opened):
    browser = opened("first", width=390, height=844)
    cells = "[...document.querySelectorAll('#summary td')].map(cell => cell.getBoundingClientRect())"
    boxes = json.loads(browser.run(f"JSON.stringify({cells})"))
    assert boxes
    assert all(box["right"] <= 390 for box in boxes)


def test_on_a_phone_the_whole_grid_is_in_sight(opened):
    browser = opened("first", width=390, height=844)
    tiles = "[...document.querySelectorAll('#phenomena .tile')]"
    boxes = json.loads(browser.run(f"JSON.stringify({tiles}.map(tile => tile.getBoundingClientRect()))"))
    assert boxes
    assert all(box["right"] <= 390 and box["width"] >= 24 and box["height"] >= 24 for box in boxes)


SHOWN = "[...document.querySelectorAll('#cases tbody tr')].filter(row => row.offsetParent).length"


def test_a_search_and_filters_leave_rows_out_and_stand_in_the_address(opened):
    browser = opened("first")
    assert browser.run(SHOWN) == 2
    browser.page.fill("[name=words]", "lobe")
    assert browser.run(SHOWN) == 1
    browser.page.fill("[name=words]", "")
    browser.page.select_option("[name=check]", "continuous-contact")
    browser.page.select_option("[name=renderer]", "plain")
    browser.page.select_option("[name=outcome]", "known")
    assert browser.run(SHOWN) == 1
    assert browser.run("document.querySelector('.filter output').textContent") == "1 of 2 cases"
    tile = "document.querySelector('#cases tbody tr:not([hidden]) td:not([hidden]) .tile')"
    assert browser.run(f"{tile}.getAttribute('href')").endswith("lobe.html#plain/continuous-contact")
    assert browser.run("location.search") == "?renderer=plain&check=continuous-contact&outcome=known"
    browser.page.reload()
    assert browser.run(SHOWN) == 1
    browser.page.click("[type=reset]")
    browser.until(f"{SHOWN} === 2")
    assert browser.run("location.search") == ""


def test_without_script_every_case_is_there_and_no_filter(browser, report):
    browser.open(report["first"], script=False)
    assert browser.run(SHOWN) == 2
    assert browser.run("document.querySelector('.filter').offsetParent") is None


EYES = ("none", "protanopia", "deuteranopia", "tritanopia", "achromatopsia")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_a_failure_stands_out_for_colour_blind_eyes(opened, dark):
    """The ground of a tile that failed differs in lightness from that of every state that needs no attention."""
    browser = opened("first", dark=dark)
    for eyes in EYES:
        browser.call("Emulation.setEmulatedVisionDeficiency", type=eyes)
        grounds = {}
        for state in ("fail", "pass", "known", "not-judged"):
            found = f"const e = document.querySelector('.legend .standing.{state}'); if (!e) return null;"
            place = "const b = e.getBoundingClientRect(); return [b.x + scrollX, b.y + scrollY];"
            if (box := browser.run(f"(() => {{ {found} {place} }})()")) is not None:
                clip = {"x": box[0] + 3, "y": box[1] + 3, "width": 2, "height": 2, "scale": 1}
                grounds[state] = ground(browser.call("Page.captureScreenshot", format="png", clip=clip)["data"])
        assert {"fail", "known"} <= set(grounds)
        fail = grounds.pop("fail")
        for state, other in grounds.items():
            low, high = sorted((fail, other))
            assert (high + 0.05) / (low + 0.05) > 2.0, (eyes, state)
    browser.call("Emulation.setEmulatedVisionDeficiency", type="none")


def ground(png):
    """Relative luminance of a picture of one colour."""
    colour = np.mean(matplotlib.image.imread(io.BytesIO(base64.b64decode(png)))[..., :3], axis=(0, 1))
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("name", ["first", "single"])
def test_it_prints(opened, tmp_path, name):
    opened(name).page.pdf(path=tmp_path / "page.pdf", print_background=True)
    content = (tmp_path / "page.pdf").read_bytes()
    count = len(re.findall(rb"/Type\s*/Page\b", content))
    assert 2 <= count <= 20


@pytest.mark.parametrize("name", ["first", "single"])
def test_a_tile_leads_to_its_verdict(opened, name):
    browser = opened(name)
    href = browser.run("document.querySelector('#phenomena .tile').getAttribute('href')")
    browser.page.click("#phenomena .tile")
    place = json.dumps(href.partition("#")[2])
    browser.until(f"document.readyState === 'complete' && document.getElementById({place}) !== null")
    assert browser.run("decodeURIComponent(location.hash.slice(1))") == href.partition("#")[2]


def test_in_one_file_a_case_moves_once_it_is_in_sight(opened):
    browser = opened("single")
    assert browser.run("document.querySelectorAll('.one-case').length") == 2
    browser.run("[...document.querySelectorAll('.one-case')].at(-1).scrollIntoView()")
    browser.until("[...document.querySelectorAll('.one-case')].at(-1).querySelector('.track input') !== null")


DRAWN = """[...document.querySelectorAll('%s canvas')].map(canvas => new Set(
    canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data).size)"""
"""How many values the colours of each canvas have."""


def test_each_card_is_drawn_with_its_plots(opened):
    browser = opened("first")
    count = browser.run("document.querySelectorAll('figure.still').length")
    assert count > 1
    drawn = browser.run(DRAWN % "figure.still")
    assert len(drawn) == count
    assert all(values > 10 for values in drawn)
    counts = browser.run("[...document.querySelectorAll('.still')].map(f => f.querySelectorAll('.chart').length)")
    assert set(counts) == {2, 4}, "a close-up beside each where the verdict has a time"


def test_for_paper_all_cases_of_the_one_file_are_drawn(opened):
    browser = opened("single")
    browser.run("dispatchEvent(new Event('beforeprint'))")
    drawn = browser.run(DRAWN % ".one-case")
    assert len(drawn) == 2
    assert all(values > 10 for values in drawn)
