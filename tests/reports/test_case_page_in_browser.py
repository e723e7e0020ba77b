"""The page of a case in a real browser: the slider, the plots, the solid that turns, and the page without script."""

from __future__ import annotations

import json

import numpy as np
import pytest
from chromium import AXE, AXE_FINDINGS, SMALL_TEXT, Chromium
from reports_synthetic import jump_tick, lobe_recording, synthetic_run, verdicts

from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.world import pose_channels
from hapticeval.reports.case_page import write_assets, write_case_page
from hapticeval.reports.templates import case_file
from hapticeval.stimulus.motions import Spin

pytestmark = pytest.mark.browser
READY = "document.documentElement.dataset.ready"
TURNING = Spin(rate=0.25, centre=(0.3, 0.1))


def round_a_sphere():
    """Once round a sphere under its surface, and the tool on it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 1200)
    hip = 0.095 * np.column_stack([np.cos(angle), np.sin(angle), 0.3 * np.sin(3.0 * angle)])
    ihip = make_model("sphere").boundary.closest_point(hip).foot
    return Recording(
        np.arange(1200) * 1e-3, {"hip": hip, "ihip": ihip, "force": 1e3 * (ihip - hip)}, {"source": "playback"}
    )


@pytest.fixture(scope="module")
def browser():
    with Chromium() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A case in the plane, of two renderers, and one in space."""
    folder = tmp_path_factory.mktemp("report")
    plane = lobe_recording()
    other = Recording(plane.time, {**plane.channels, "ihip": 1.02 * plane.ihip}, plane.meta)
    given = {name: verdicts("lobe", name, plane) for name in ("plain", "other")}
    runs = [synthetic_run("lobe", name, "cassinian") for name in ("plain", "other")]
    space = [synthetic_run("ball", "plain", "sphere")]
    lobe, ball = ("synthetic", "lobe"), ("synthetic", "ball")
    write_case_page(folder, runs, {"plain": plane, "other": other}, verdicts=given)
    write_case_page(folder, space, {"plain": round_a_sphere()}, verdicts={})
    resting = Recording(
        0.001 * np.arange(50),
        {name: np.tile([[0.1, 0.0, 0.0]], (50, 1)) for name in ("hip", "ihip", "force")},
        {"source": "playback"},
    )
    rest = ("synthetic", "rest")
    write_case_page(folder, [synthetic_run("rest", "plain", "sphere")], {"plain": resting}, verdicts={})
    turned = Recording(plane.time, {**plane.channels, **pose_channels(TURNING.pose(plane.time))}, plane.meta)
    moving = ("synthetic", "moving")
    write_case_page(folder, [synthetic_run("moving", "plain", "cassinian")], {"plain": turned}, verdicts={})
    names = ["plain", "other", "third", "fourth", "fifth"]
    many, five = ("synthetic", "many"), [synthetic_run("many", name, "cassinian") for name in names]
    given = {name: verdicts("many", name, plane) for name in names}
    write_case_page(folder, five, dict.fromkeys(names, plane) | {"other": other}, verdicts=given)
    write_assets(folder)
    cases = {"plane": lobe, "space": ball, "rest": rest, "many": many, "moving": moving}
    return {name: folder / case_file(*case) for name, case in cases.items()}


@pytest.fixture
def opened(browser, pages):
    def opened(name, **how):
        browser.open(pages[name], **how)
        browser.until(READY)
        return browser

    yield opened
    assert browser.problems == []


TIME = "Number(document.querySelector('.track input').value)"


def to_start(browser):
    """Move the slider to the start, as Home does."""
    browser.run("document.querySelector('.track input').focus()")
    browser.page.keyboard.press("Home")
    assert browser.run(TIME) == 0.0


PLOT_ENDS = """(() => { const boxes = [...document.querySelectorAll('.plots .chart:first-of-type .grid-line')]
    .map(line => line.getBoundingClientRect()).filter(box => box.width > 50);
    return [boxes[0].left, boxes[0].right]; })()"""
"""Where the first plot against time begins and ends, px."""

PLOT_HEIGHT = "(b => b.top + 0.4 * b.height)(document.querySelector('.plots .chart').getBoundingClientRect())"

TIME_NUMBERS = """[...document.querySelectorAll('.plots .plot-box:last-child .chart > text[text-anchor=middle]')]
    .map(text => text.textContent).filter(text => /^[0-9.]+$/.test(text)).map(Number)"""
"""What stands at the axis of the time."""

PICTURE = "document.querySelector('.live-canvas').toDataURL()"


def test_a_page_opens_at_the_place_of_its_worst_verdict(opened):
    browser = opened("plane")
    recording = lobe_recording()
    assert browser.run(TIME) == pytest.approx(float(recording.time[jump_tick(recording)]), abs=1e-9)
    assert browser.run("document.querySelector('.check li.current').id") == browser.run(
        "document.querySelector('.one-case').dataset.worst"
    )


def test_a_link_jumps_to_the_place_of_its_verdict(opened):
    browser = opened("plane")
    recording = lobe_recording()
    to_start(browser)
    browser.page.click("[data-run='0'] a.jump")
    time = float(recording.time[jump_tick(recording)])
    assert browser.run(TIME) == pytest.approx(time, abs=1e-9)
    shown = browser.run("[...document.querySelectorAll('.now tbody tr')].map(row => row.innerText.split('\\t'))")
    hip = 1e3 * recording.hip[jump_tick(recording)]
    assert [each[0].strip() for each in shown] == ["plain", "other"]
    assert [float(each.replace("\N{MINUS SIGN}", "-")) for each in shown[0][3].split(",")] == pytest.approx(
        hip, abs=0.01
    )


def test_an_address_opens_the_page_at_its_verdict(opened):
    browser = opened("plane", fragment="other/broken-contact")
    assert browser.run(TIME) > 0.5
    assert browser.run("document.querySelector('.check li.current').id") == "other/broken-contact"


def test_the_slider_is_worked_by_keys_from_sample_to_sample(opened):
    browser = opened("plane")
    to_start(browser)
    before = browser.run(PICTURE)
    browser.page.keyboard.press("ArrowRight")
    first = browser.run(TIME)
    assert first > 0.0
    browser.page.keyboard.press("ArrowLeft")
    assert browser.run(TIME) == 0.0
    browser.page.keyboard.press("End")
    assert browser.run(TIME) == pytest.approx(1.999)
    assert browser.run("document.querySelector('.track input').getAttribute('aria-valuetext')") == "1.999 s"
    assert browser.run(PICTURE) != before
    browser.page.keyboard.press("PageUp")
    browser.page.keyboard.press("Home")
    assert browser.run(TIME) == 0.0


def test_a_renderer_that_is_alone_shows_its_components(opened):
    browser = opened("plane")
    before = browser.run(PICTURE)
    assert browser.run("document.querySelectorAll('.keys > span').length") == 0
    browser.page.click(".runs-shown input[data-run='1']")
    assert browser.run("document.querySelector('.keys').innerText").split() == ["|F|", "F₁", "F₂"]
    assert browser.run(PICTURE) != before


def test_a_click_into_a_plot_goes_to_its_time(opened):
    browser = opened("plane")
    left, right = browser.run(PLOT_ENDS)
    browser.page.mouse.click(0.5 * (left + right), browser.run(PLOT_HEIGHT))
    assert browser.run(TIME) == pytest.approx(1.0, abs=0.01)


def test_a_drag_over_a_plot_enlarges_that_part_of_the_time_in_all_plots(opened):
    browser = opened("plane")
    left, right = browser.run(PLOT_ENDS)
    height, mouse = browser.run(PLOT_HEIGHT), browser.page.mouse
    mouse.move(left + 0.25 * (right - left), height)
    mouse.down()
    mouse.move(left + 0.5 * (right - left), height, steps=4)
    mouse.up()
    assert browser.run(TIME_NUMBERS)[0] == pytest.approx(0.5, abs=0.1)
    assert browser.run(TIME_NUMBERS)[-1] == pytest.approx(1.0, abs=0.1)
    mouse.dblclick(0.5 * (left + right), height)
    assert browser.run(TIME_NUMBERS)[0] == 0.0
    assert browser.run(TIME_NUMBERS)[-1] >= 1.5


def test_a_plot_has_the_focus_and_is_read_and_moves_by_keys(opened):
    browser = opened("plane", width=390)
    browser.page.focus(".plots .chart")
    browser.page.keyboard.press("Home")
    text = "document.querySelector('.plots .chart').getAttribute('aria-valuetext')"
    assert browser.run(text) == "0.000 s: plain 19.3, other 19.3"
    browser.page.keyboard.press("End")
    assert browser.run(TIME) == pytest.approx(1.999)


def test_only_renderers_that_differ_are_ticked_and_all_are_one_click_away(opened):
    browser = opened("many")
    ticked = "document.querySelectorAll('.runs-shown input:checked').length"
    assert browser.run(ticked) == 2
    rows = "document.querySelectorAll('.now tbody tr').length"
    assert browser.run(rows) == 2
    browser.page.click(".runs-shown button")
    assert browser.run(ticked) == browser.run(rows) == 5


def test_playing_moves_the_hand_and_stops_at_the_end(opened):
    browser = opened("plane")
    browser.run("document.querySelector('.transport select').value = 20")
    browser.page.click(".play")
    browser.until(f"{TIME} >= 1.999")
    browser.until("document.querySelector('.play').getAttribute('aria-label') === 'play'")


def test_a_solid_turns_where_it_is_dragged(opened):
    browser = opened("space")
    to_start(browser)
    before = browser.run(PICTURE)
    x, y = browser.run(
        "(b => [b.x + b.width / 2, b.y + b.height / 2])(document.querySelector('.live-canvas').getBoundingClientRect())"
    )
    mouse = browser.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 60, y, steps=5)
    mouse.up()
    turned = browser.run(PICTURE)
    assert turned != before
    browser.page.click(".zoom button[title='show everything']")
    assert browser.run(PICTURE) == before


def test_a_solid_turns_with_the_tool_until_it_is_turned_by_hand(opened):
    browser = opened("space")
    to_start(browser)
    pressed = "document.querySelector('.zoom [aria-pressed]').getAttribute('aria-pressed')"
    assert browser.run(pressed) == "true"
    axes = """(() => { const c = document.querySelector('.live-canvas'), r = 80 * devicePixelRatio;
        return [...c.getContext('2d').getImageData(c.width - r, c.height - r, r, r).data].join() })()"""
    drawn = set()
    for _ in range(5):
        drawn.add(browser.run(axes))
        for _ in range(4):
            browser.page.keyboard.press("PageUp")
    assert len(drawn) > 1, "the arrows of the coordinates turn with the solid"
    browser.page.click(".zoom button[title='turn to the left']")
    assert browser.run(pressed) == "false"
    browser.page.click(".zoom button[title='show everything']")
    assert browser.run(pressed) == "true"


def test_a_tool_at_rest_is_seen_on_the_whole_solid(opened):
    """The scale that is written in the picture is of millimetres, not of the micrometre that nothing goes beyond."""
    browser = opened("rest")
    browser.run("""(() => { const picture = CanvasRenderingContext2D.prototype, write = picture.fillText;
        globalThis.written = [];
        picture.fillText = function (text, ...at) { written.push(text); return write.call(this, text, ...at); };
        return 0; })()""")
    browser.page.click(".zoom button[title='show everything']")
    assert [text for text in browser.run("globalThis.written") if text.endswith("m")] == ["50 mm"]


@pytest.mark.parametrize("name", ["plane", "space", "many"])
@pytest.mark.parametrize("width", [1440, 390])
def test_no_text_is_smaller_than_eleven_pixels(opened, name, width):
    assert json.loads(opened(name, width=width).run(SMALL_TEXT)) == []


@pytest.mark.parametrize("name", ["plane", "space"])
@pytest.mark.parametrize("width", [1440, 390])
@pytest.mark.parametrize("dark", [False, True])
def test_no_page_overflows_and_axe_finds_nothing(opened, name, width, dark):
    browser = opened(name, width=width, dark=dark)
    assert browser.run("document.documentElement.scrollWidth") == width
    if not AXE.exists():
        pytest.skip("needs axe-core: make browser installs it")
    browser.run(AXE.read_text(encoding="utf-8") + ";0")
    assert json.loads(browser.run(AXE_FINDINGS)) == []


def test_without_script_verdicts_and_numbers_are_there_and_the_command_that_draws(browser, pages):
    browser.open(pages["plane"], script=False)
    text = browser.page.inner_text("body")
    assert "hapticeval figure synthetic/lobe --from ." in text
    for words in ("pop-through <here>", "40 mm", "stiffness"):
        assert words in text
    assert browser.run("document.querySelector('canvas, .chart')") is None


def test_with_script_nothing_says_that_it_is_lacking(opened):
    assert "JavaScript" not in opened("plane").page.inner_text("body")


def test_what_is_printed_is_what_the_browser_drew(opened, tmp_path):
    browser = opened("plane")
    browser.page.emulate_media(media="print")
    hidden = "getComputedStyle(document.querySelector('%s')).display"
    assert browser.run(hidden % ".transport .play") == browser.run(hidden % ".zoom") == "none"
    assert browser.run(hidden % ".live-canvas") == browser.run(hidden % ".chart") == "block"
    # Nobody can scroll on paper, and of verdicts in columns Chromium lost the last.
    evidence = "getComputedStyle(document.querySelector('.check details')).overflowX"
    assert browser.run(evidence) == "visible"
    assert browser.run("getComputedStyle(document.querySelector('.found')).columnCount") == "auto"
    browser.page.pdf(path=tmp_path / "page.pdf", print_background=True)
    assert (tmp_path / "page.pdf").read_bytes().startswith(b"%PDF")


def test_on_paper_a_dark_page_is_light(opened):
    browser = opened("plane", dark=True)
    dark = browser.run(PICTURE)
    browser.run("dispatchEvent(new Event('beforeprint'))")
    paper = browser.run(PICTURE)
    assert paper != dark
    assert browser.run("getComputedStyle(document.documentElement).getPropertyValue('--fig-ink').trim()") == "#1c1f23"
    browser.run("dispatchEvent(new Event('afterprint'))")
    assert browser.run(PICTURE) == dark


def test_the_ticks_round_the_evidence_stand_below_the_values(opened):
    browser = opened("plane")
    recording = lobe_recording()
    at = float(recording.time[jump_tick(recording)])
    assert f"20 ticks to either side of t = {at:g} s" in browser.run("document.querySelector('.closeup').textContent")
    assert browser.run("document.querySelectorAll('.closeup .chart').length") == 2
    place = "document.querySelector('.closeup .chart').getBoundingClientRect()"
    browser.run("document.querySelector('.closeup').scrollIntoView({ block: 'center' })")
    x, y = browser.run(f"(b => [b.left + 0.75 * b.width, b.top + 0.5 * b.height])({place})")
    browser.page.mouse.click(x, y)
    assert at < browser.run(TIME) < at + 0.02
    assert not opened("rest").run("document.querySelectorAll('.closeup .chart').length"), "a run of 50 ticks has none"


def test_what_is_taller_than_the_window_can_be_read_to_its_end(opened):
    browser = opened("many", width=1440, height=700)
    browser.run("scrollTo(0, document.querySelector('.stage').offsetHeight)")
    browser.until("document.querySelector('.closeup').getBoundingClientRect().bottom <= innerHeight")


def test_on_a_phone_the_values_are_whole(opened):
    browser = opened("plane", width=390, height=844)
    cells = browser.run("JSON.stringify([...document.querySelectorAll('.now td')].map(c => c.getBoundingClientRect()))")
    assert all(box["right"] <= 390 and box["width"] > 0 for box in json.loads(cells))
    heading = "getComputedStyle(document.querySelector('.now td'), '::before').content"
    assert "IHIP" in browser.run(heading)


HAND = (
    "[...document.querySelectorAll('.now tbody td')][2].textContent.replaceAll('\\u2212', '-').split(', ').map(Number)"
)
"""Where the table of values has the hand, mm."""


def test_of_a_body_that_moves_the_world_is_shown_and_by_a_button_the_body(opened):
    browser = opened("moving")
    recording = lobe_recording()
    browser.page.locator(".track input").focus()
    browser.page.keyboard.press("End")
    last, pose = recording.hip[-1], TURNING.pose(recording.time[-1])
    assert browser.run(HAND) == pytest.approx(list(1e3 * pose.to_world(last)), abs=0.01)
    world = browser.run(PICTURE)
    button = browser.page.get_by_title("hold the body still")
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    body = browser.run(PICTURE)
    assert body != world
    assert browser.run(HAND) == pytest.approx(list(1e3 * last), abs=0.01)
    button.click()
    assert browser.run(HAND) == pytest.approx(list(1e3 * pose.to_world(last)), abs=0.01)
    assert browser.run(PICTURE) != body


def test_a_body_at_rest_has_no_such_button(opened):
    assert opened("plane").page.get_by_title("hold the body still").count() == 0
