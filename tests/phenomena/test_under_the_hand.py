"""Where a contact point is under the hand: of any projection, by either face of an edge, and not when it is astray."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made import recorded
from misplaced import ASTRAY
from msgspec.structs import replace
from outsiders import CASES

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import cube, ellipse, line, make_model
from hapticeval.phenomena.measures.under_the_hand import find_aside, followed_rows, may_begin_at_ihip
from hapticeval.phenomena.observed import Observed
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.moves import Move, Moves
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.reading import load_suite

STEP = 1e-4
LINE = Scene(model=line(), stiffness=1000.0, mass=0.1)


class TestUnderTheHand:
    """A hand that goes along a line and comes in before row 3, by `depth` steps; feet are given by hand."""

    def followed(self, *, depth=1.0, feet=(), first=3, source="playback"):
        count = 14
        # Down by a step in each tick, up to the depth.
        hip = STEP * np.column_stack([np.arange(count), np.maximum(first - np.arange(count), 0.0) - depth])
        ihip = np.where(np.arange(count)[:, np.newaxis] < first, hip, hip * [1.0, 0.0])
        contact = (np.arange(count) >= first).astype(float)
        base = recorded(hip, ihip, 0.0 * hip, contact=contact, meta={"source": source})
        foot = hip * [1.0, 0.0]
        for row, jump in feet:
            foot[row:, 0] += jump
        rows, doubt = followed_rows(Observed(base, LINE), foot, hip[:, 1])
        return np.flatnonzero(rows).tolist(), doubt

    @pytest.mark.parametrize(("jump", "last"), [(0.9 * STEP, 13), (1.1 * STEP, 7)])
    def test_up_to_where_the_nearest_point_jumps_by_more_than_twice_the_hand_s_step(self, jump, last):
        rows, doubt = self.followed(feet=[(8, jump)])
        assert rows == list(range(3, last + 1))
        if last == 13:
            # A shorter step may have hidden as much, from then on.
            np.testing.assert_allclose(doubt, np.where(np.arange(14) >= 8, jump, 0.0), atol=1e-12)

    @pytest.mark.parametrize(("outside", "begins"), [(0.9, True), (1.1, False)])
    def test_a_tool_that_came_in_with_the_hand_has_moved_no_farther_than_that(self, outside, begins):
        """Outside in row 2, three steps before the contact is seen: so far may the tool be from there."""
        hip = np.column_stack([STEP * np.arange(8), [STEP, STEP, STEP, -STEP, -STEP, -STEP, -STEP, -STEP]])
        ways = np.linalg.norm(np.diff(hip, axis=0), axis=1)[2:5].sum()
        ihip = np.array(hip)
        ihip[5] = hip[2] + np.array([outside * ways, 0.0])
        base = recorded(hip, ihip, meta={"source": "playback"})
        assert may_begin_at_ihip(Observed(base, LINE), hip[:, 1], 5) is begins
        assert not may_begin_at_ihip(Observed(base, LINE), np.full(8, -STEP), 5), "the hand was never outside"


@pytest.mark.parametrize("name", ASTRAY)
def test_nor_is_it_on_the_paths_that_are_drawn_and_where_a_hand_presses(name):
    """A check that finds it fails; what looks for jumps there besides takes its time."""
    for suite, case in (("generated", "line-hand"), ("thesis", "plane-press")):
        judged_in = load_suite(suite).case(case)
        assert "continuous-contact" in judged_in.checks
        judged = judge(ASTRAY[name], name, suite, replace(judged_in, checks=("contact-kept",)))
        aside = find_aside(Observed(judged.recording, judged_in.build_scene()))
        assert aside is not None or (case == "plane-press" and name != "creeps"), (
            "a hand that presses stays in its place"
        )


@settings(max_examples=15)
@given(
    depths=st.lists(st.integers(-5, 30), min_size=1, max_size=4),
    ways=st.lists(st.integers(-60, 60), min_size=6, max_size=6),
    ratio=st.sampled_from([1.0, 2.0, 5.0]),
    name=st.sampled_from(["minimum-distance", "constraint@curve", "homothetic", "conformal", "combescure"]),
)
def test_any_projection_is_under_the_hand(depths, ways, ratio, name):
    """In and out of an ellipse, along it at any depth, over its medial axis and past its tips."""
    scene = Scene(model=ellipse(ratio=ratio))
    curve = scene.model.curve
    under = np.array([-5, *depths, -5]) / 1000.0
    s = np.cumsum(ways[: under.size]) / 1000.0
    u = curve.parameter(s)
    points = np.asarray(curve.position(u)) - under[:, np.newaxis] * np.asarray(curve.normal(u))
    times = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1) / 0.2 + 0.01)])
    recording = play(resolve(name)(scene), Path(times, points), 1e-3, scene=scene)
    finding = find_aside(Observed(recording, scene))
    assert finding is None, finding.message


def test_beside_a_convex_edge_the_tool_may_be_on_the_face_that_the_hand_came_through():
    """In at the top of a cube just under its side, down along that side, and out of it: a rigid tool stays on top."""
    scene = Scene(model=cube())
    points = np.array([[49.7, 0, 55], [49.7, 0, 49], [49.7, 0, 0], [51.0, 0, 0]]) / 1000.0
    recording = play(resolve("constraint")(scene), Path(np.array([0.0, 0.01, 0.6, 0.7]), points), 1e-3, scene=scene)
    assert find_aside(Observed(recording, scene)) is None
    # The same, creeping along the edge besides: neither under the hand nor where a rigid tool is.
    ihip = recording.ihip.copy()
    touches = np.any(ihip != recording.hip, axis=1)
    ihip[touches, 1] += np.linspace(0.0, 0.03, int(touches.sum()))
    aside = find_aside(Observed(recorded(recording.hip, ihip), scene))
    assert aside is not None
    assert aside.metric.value == pytest.approx(0.03, rel=0.2)


def test_a_hand_that_comes_in_through_an_edge_itself_enters_by_either_face():
    """In the plane of a plate's top to its edge, under the top, and up and out: a god-object is still on the side."""
    scene = Scene(model=make_model("box", x=0.1, y=0.4, z=0.01))
    moves = (
        Move(to=[0.05, -0.178251, 0.005], seconds=0.401),
        Move(to=[0.041669, 0.017789, 0.003678], seconds=0.43),
        Move(to=[0.041669, 0.017789, 0.092], seconds=0.401),
    )
    trajectory = Moves(start=[0.096, -0.180958, 0.005], moves=moves)
    path = replace(CASES["slide"], trajectory=trajectory).build_stimulus(scene, None)
    recording = play(resolve("constraint")(scene), path, 1e-3, scene=scene)
    on_side = (recording.ihip[:, 0] == 0.05) & (recording.hip[:, 0] < 0.042)
    assert on_side.any()
    assert find_aside(Observed(recording, scene)) is None
    # Of a hand that comes in through the top, 1 mm from the edge, it is not where a rigid tool is.
    through_top = recording.hip - np.array([1e-3, 0.0, -1e-6])
    inside = (through_top[:, 2] < 0.005) & (recording.ihip[:, 0] != recording.hip[:, 0])
    ihip = np.where(inside[:, np.newaxis], recording.ihip, through_top)
    assert find_aside(Observed(recorded(through_top, ihip, meta={"source": "playback"}), scene)) is not None
