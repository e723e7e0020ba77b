"""A force that pulls, that is renewed too seldom, or that answers a missing position: what users report, by numbers."""

from __future__ import annotations

import numpy as np
import pytest
from made import FAIL, NO, PASS, UNDECIDED, changed, found, outcome, recorded
from test_helpers_by_definition import LINE, slide

from hapticeval.geometry.catalogue import from_vertices, line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.update_rate import calls_for_another_force
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Level
from hapticeval.quantity import format_number
from hapticeval.scene import Scene

IN_AND_OUT = 0.004 * np.sin(np.linspace(-0.3, np.pi + 0.3, 200))
PLAYED = {"source": "playback"}
TICKS = np.arange(200)


def pressed(depths=IN_AND_OUT, *, damping=0.0, least=-np.inf, meta=None):
    """A hand over a line, at some depths (n,), m, with a spring and a damper across, and no less force than `least`."""
    speed = np.diff(depths, prepend=depths[0]) / 1e-3
    force = np.where(depths > 0.0, np.maximum(1000.0 * depths + damping * speed, least), 0.0)
    aside = np.zeros_like(depths)
    hip = np.column_stack([aside, -depths])
    return recorded(hip, np.maximum(hip, 0.0), np.column_stack([aside, force]), meta=meta)


@pytest.mark.parametrize(
    ("damping", "least", "expected"), [(0.0, -np.inf, PASS), (5.0, 0.0, PASS), (5.0, -np.inf, FAIL)]
)
def test_a_damper_that_pulls_is_named_and_one_that_is_clipped_does_not(damping, least, expected):
    finding = found("never-pulls", pressed(damping=damping, least=least), LINE)
    assert finding.outcome is expected, finding.message
    assert ("leaves at" in finding.message) is (expected is FAIL)
    assert finding.evidence.get("cause") == ("leaving" if expected is FAIL else None)


@pytest.mark.parametrize(("asked", "expected"), [(5.0, PASS), (0.0, FAIL)])
@pytest.mark.parametrize("least", [0.0, -np.inf])
def test_a_damper_is_right_where_the_scene_asks_for_it_clipped_or_not(asked, expected, least):
    """|max(K d - K_d v, 0) - K d| <= K_d |v|: the bound of a damper holds for a clipped one."""
    run = pressed(damping=5.0, least=least)
    finding = found("force-magnitude", run, Scene(model=line(), damping=asked))
    assert finding.outcome is expected, finding.message


def test_who_declares_a_spring_must_not_pull_and_a_hand_that_only_goes_in_shows_no_pull():
    assert found("never-pulls", pressed(damping=5.0), LINE).level is None
    assert found("never-pulls", pressed(damping=5.0, meta={"spring": "error"}), LINE).level is Level.MUST
    assert outcome("never-pulls", pressed(np.linspace(-0.001, 0.004, 100)), LINE) is UNDECIDED


@pytest.mark.parametrize(
    ("force", "expected"),
    [([0.1, 0.03], PASS), ([-0.1, 0.03], PASS), ([0.0, 0.06], PASS), ([0.0, -0.06], FAIL), ([0.02, -0.1], FAIL)],
)
def test_a_rigid_tool_in_a_notch_may_be_pushed_by_either_face(force, expected):
    """Its faces are 147 degrees apart: what one of them pushes is drawn in across the other."""
    outline = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [0.03, 0.1], [0.0, 0.0], [-0.03, 0.1], [-0.1, 0.1]]
    # At rest in the notch, inside by rounding, and out of it.
    height = np.where(TICKS < 100, -1e-14, 1e-4 * (TICKS - 100.0))
    hip = np.column_stack([np.zeros(200), height])
    run = recorded(hip, hip, np.where(TICKS[:, np.newaxis] < 100, force, 0.0))
    finding = found("never-pulls", run, Scene(model=from_vertices(outline)))
    assert finding.outcome is expected, finding.message


def sinking(rows, *, follows=False):
    """A hand that sinks by 0.1 mm in each of 200 ticks, and a force that is that of `rows` (n,)."""
    depth = 1e-3 + 1e-4 * TICKS
    aside = np.zeros(200)
    ihip = np.column_stack([aside, 1e-3 - depth if follows else aside])
    return recorded(np.column_stack([aside, -depth]), ihip, np.column_stack([aside, 1000.0 * depth[rows]]), meta=PLAYED)


def test_no_other_force_is_called_for_along_a_face_nor_where_the_tool_goes_along():
    along, alone = changed(slide(), PLAYED), changed(slide(), PLAYED, ihip=slide().hip)  # a force, and no contact point
    for quiet in (along, alone, sinking(TICKS, follows=True)):
        assert not calls_for_another_force(Observed(quiet, LINE)).any()
    assert outcome("update-rate", along, LINE) is UNDECIDED, "rightly constant is not stale"


def test_a_tool_that_goes_along_calls_for_none_though_it_was_free_before():
    follows = sinking(TICKS, follows=True)
    free_first = np.where(TICKS[:, np.newaxis] < 5, follows.hip, follows.ihip)
    calls = calls_for_another_force(Observed(changed(follows, ihip=free_first), LINE))
    assert np.flatnonzero(calls).tolist() == [5]


@pytest.mark.parametrize(("every", "expected"), [(1, PASS), (2, FAIL), (3, FAIL), (16, FAIL)])
def test_a_force_stands_for_the_ticks_until_it_is_renewed(every, expected):
    finding = found("update-rate", sinking(TICKS // every * every), LINE)
    assert finding.outcome is expected
    assert finding.metric.value == pytest.approx(1e-3 * every)
    assert finding.bound == pytest.approx(1.5e-3)
    assert finding.evidence["rate_Hz"] == pytest.approx(1e3 / every)
    assert f"renewed at {format_number(1e3 / every, 3)} Hz" in finding.message
    assert finding.evidence["ticks_called_for"] == 199
    assert ("the scene's loop runs at 1000 Hz" in finding.message) is (expected is FAIL)


def test_one_late_answer_is_no_slow_loop():
    assert outcome("update-rate", sinking(TICKS - (TICKS == 25)), LINE) is PASS


@pytest.mark.parametrize(
    ("answer", "after", "expected", "words"),
    [
        (None, [0.0, 1.0], PASS, "is refused"),
        ([0.0, 0.0], [0.0, 1.0], PASS, "gets no force"),
        ([0.0, 3.0], [0.0, 1.0], FAIL, "gets 3 N"),
        ([np.nan, 0.0], [0.0, 1.0], FAIL, "gets a force that is no number"),
        (None, [0.0, np.nan], FAIL, "any more"),
        ([0.0, 0.0], [0.0, np.inf], FAIL, ""),
        (None, None, FAIL, "the next one is refused"),
        ([0.0, 0.0], None, FAIL, "the next one is refused"),
    ],
)
def test_what_a_missing_position_gets(answer, after, expected, words):
    """The hand is pushed hardest, by 3 N, in row 5: the HIP of the next one is missing."""
    base, asked = slide(), []
    force = np.array(base.force)
    force[5, 1] = 3.0

    def dropped_out(tick):
        asked.append(tick)
        return tuple(None if each is None else np.array(each) for each in (answer, after))

    finding = found("drop-out", Runs(changed(base, force=force), dropped_out=dropped_out), LINE)
    assert asked == [6], "the last row has none after it"
    assert finding.outcome is expected
    assert words in finding.message
    assert finding.evidence.get("refused", False) is (answer is None)
    if answer is None and after is not None and np.isfinite(after).all():
        assert finding.metric.value == 0.0, "a refusal leaves no force"


def test_a_drop_out_is_asked_only_where_a_renderer_can_be():
    assert outcome("drop-out", slide(), LINE) is NO
