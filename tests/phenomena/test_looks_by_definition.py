"""Closer looks at a jump, places of corners, and relations of two runs, on each side of what decides in them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from made import FAIL, PASS, changed, found, recorded
from scipy.signal import lti, step
from test_helpers_by_definition import LINE, slide

from hapticeval.geometry.catalogue import circle, from_vertices, line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.relations import relation_finding
from hapticeval.phenomena.decisions import HOLD_TICKS
from hapticeval.phenomena.inherent import nearest_jump
from hapticeval.phenomena.measures.crossings import length_to_next_corner
from hapticeval.phenomena.measures.jumps import with_steps_of_pieces
from hapticeval.phenomena.measures.restated import answers_apart
from hapticeval.phenomena.measures.surface_motion import SurfaceMotion, decay_rate
from hapticeval.phenomena.observed import Observed
from hapticeval.recordings.recording import OWN_TOOL
from hapticeval.scene import Scene


class TestContinuity:
    @pytest.mark.parametrize("depth", [0.02, 0.05])
    def test_under_a_bend_of_one_sampling_alone_steps_are_stretched_by_the_depth(self, depth):
        """Under 0.1 m of radius a step h of the hand moves the nearest point by h / (1 - d / 0.1)."""
        angle = 1e-3 * np.arange(20)
        out = np.column_stack([np.cos(angle), np.sin(angle)])
        base = recorded((0.1 - depth) * out, 0.1 * out, meta={"source": "playback"})
        scene = Scene(model=circle(size=0.2), stiffness=1000.0, mass=0.1)
        finding = found("continuous-contact", base, scene)
        step, stretch = 2.0 * (0.1 - depth) * math.sin(5e-4), 1.0 / (1.0 - depth / 0.1)
        assert finding.outcome is PASS
        assert finding.bound == pytest.approx(3.0 * step + (stretch - 1.0) * 3.0 * step, rel=1e-3)
        assert finding.metric.value == pytest.approx(2.0 * 0.1 * math.sin(5e-4), rel=1e-6)


class TestStepsOfPieces:
    """Under an octagon of 0.1 m, from a corner to where a face is nearest to a hand 2 mm on, 1 mm deep."""

    TURN = 2.0 * np.pi * np.arange(8) / 8.0
    MODEL = from_vertices((0.1 * np.column_stack([np.cos(TURN), np.sin(TURN)])).tolist())
    CORNER = np.array([0.1, 0.0])
    ALONG = np.array([math.cos(0.625 * math.pi), math.sin(0.625 * math.pi)])
    OUT = np.array([ALONG[1], -ALONG[0]])
    BOUND = 1e-4

    def raised(self, *, late=0, share=1.0, aside=0.0):
        """Whether the step is raised by which the tool gets so much of the way in tick 6; the hand is there for one."""
        rows = np.arange(10)[:, np.newaxis]
        hip = np.where(rows != 6 - late, self.CORNER - [1e-3, 0.0], self.CORNER + 2e-3 * self.ALONG - 1e-3 * self.OUT)
        ihip = np.where(rows < 6, self.CORNER, self.CORNER + share * 2e-3 * self.ALONG + aside * self.OUT)
        base = Observed(recorded(hip, ihip), Scene(model=self.MODEL, stiffness=1000.0))
        bounds = np.full(10, self.BOUND)
        raised = with_steps_of_pieces(base, bounds, self.MODEL.boundary)
        expected = np.where(np.arange(10) == 6, np.linalg.norm(ihip[6] - self.CORNER), self.BOUND)
        assert np.array_equal(raised, expected) or np.array_equal(raised, bounds)
        return not np.array_equal(raised, bounds)

    @pytest.mark.parametrize(("late", "expected"), [(-1, False), (0, True), (1, True), (3, True), (4, False)])
    def test_a_tool_slides_to_a_hand_of_up_to_three_ticks_ago(self, late, expected):
        assert self.raised(late=late) is expected

    @pytest.mark.parametrize(
        ("share", "aside", "expected"),
        [(0.5, 0.0, True), (1.0, 0.0, True), (-1.0, 0.0, False), (1.0, 1e-3, False), (2.0, 0.0, False)],
    )
    def test_it_may_end_on_the_way_and_not_off_it(self, share, aside, expected):
        assert self.raised(share=share, aside=aside) is expected


class TestCorners:
    @pytest.mark.parametrize(("place", "length"), [(0.0, 0.5), (2.0, 2.0), (9.5, 0.5)])
    def test_the_next_corner_may_lie_over_the_seam(self, place, length):
        corners = [SimpleNamespace(s=s) for s in (0.0, 2.0, 9.5)]
        boundary = SimpleNamespace(corners=corners, girth=10.0)
        (corner,) = (corner for corner in corners if corner.s == place)
        assert length_to_next_corner(boundary, corner) == length
        assert length_to_next_corner(SimpleNamespace(corners=[corner], girth=10.0), corner) == 10.0

    @pytest.mark.parametrize(("tick", "jump"), [(0, 0.0), (1, 1e-3), (2, 2e-3), (3, 7e-3)])
    def test_the_nearest_point_moves_since_the_tick_before(self, tick, jump):
        hip = np.column_stack([[0.0, 1e-3, 3e-3, 1e-2], [-1e-3] * 4])
        assert nearest_jump(Observed(recorded(hip), LINE), tick) == pytest.approx(jump)


class TestRelations:
    def test_a_force_is_a_length_by_the_stiffness_or_by_what_an_event_moves_the_tool(self):
        soft = Scene(model=line(), stiffness=0.5, mass=2e-6)
        base = slide()
        other = changed(base, force=base.force + np.array([0.6, 0.8]))
        # 1 N over 0.5 N/m; of a tool that moves by itself over m / dt^2 = 2 N/m
        assert answers_apart(Observed(base, soft), Observed(other, soft)) == pytest.approx(2.0)
        own = Observed(changed(base, meta={OWN_TOOL: True}), soft)
        assert answers_apart(own, Observed(other, soft)) == pytest.approx(0.5)
        assert not answers_apart(own, Observed(other, soft), forces=False).any()

    @pytest.mark.parametrize(
        ("change", "allowed", "exempt", "tick"),
        [
            ([1e-3, 2e-3], [0.0, 2.5e-3], [False, False], 0),
            ([1e-3, 2e-3], [3e-3, 2.5e-3], [False, False], 1),
            ([1e-3, 2e-3], [3e-3, 0.0], [False, True], 0),
            ([1e-3, 2e-3], [0.0, 0.0], [True, True], 0),
        ],
    )
    def test_the_row_that_is_off_by_most_is_told_and_without_one_that_changes_most(self, change, allowed, exempt, tick):
        base = changed(slide(), rows=slice(0, 2))
        finding = relation_finding(
            Observed(base, LINE),
            Observed(base, LINE),
            np.array(change),
            np.array(allowed),
            np.array(exempt),
            "with other vertices",
        )
        excess = [
            0.0 if skip else max(much - granted, 0.0)
            for much, granted, skip in zip(change, allowed, exempt, strict=True)
        ]
        assert finding.metric.value == pytest.approx(max(excess) / 0.2)
        assert finding.evidence["tick"] == tick
        assert finding.evidence["rows_off"] == sum(much > 0.0 for much in excess)
        assert finding.evidence["rows_exempt"] == sum(exempt)

    @pytest.mark.parametrize(("off", "outcome"), [(0.9e-3, PASS), (1.1e-3, FAIL)])
    def test_beside_another_renderer_what_is_declared_to_scatter_is_granted(self, off, outcome):
        base = slide()
        for name, scatter in (("ihip", 1e-3), ("force", 1.0)):
            declares = changed(base, meta={f"{name}_scatter": scatter})
            other = changed(base, ihip=base.ihip + np.array([off, 0.0]), force=base.force)
            assert found("two-at-once", Runs(declares, in_turns=lambda other=other: other), LINE).outcome is outcome


def test_a_held_force_lets_a_perfect_law_drift_by_its_turn_and_the_overshoot():
    """Round 0.1 m at 5 rad/s the force of 0.25 N turns by 5 mrad in a tick; a step overshoots by up to twice."""
    angle = 5e-3 * np.arange(20)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    base = recorded(0.1 * out, velocity=0.5 * np.column_stack([-out[:, 1], out[:, 0]]))
    turn = 0.25 * 2.0 * math.sin(2.5e-3)
    for damping in (0.0, 0.5, 2.0, 2.0 * math.sqrt(50.0 * 0.1)):
        # n'' = -(K_p / m) n - (K_d / m) n' + F / m answers a step of F = K_p by its overshoot.
        _, answer = step(lti([500.0], [1.0, 10.0 * damping, 500.0]), T=np.linspace(0.0, 2.0, 20001))
        overshoot = max(answer.max(), 1.0)
        scene = Scene(model=circle(size=0.2), stiffness=50.0, mass=0.1, damping=damping, bilateral=True)
        motion = SurfaceMotion(Observed(base, scene))
        assert motion.held_distance() == pytest.approx(HOLD_TICKS * turn * overshoot / 50.0, rel=1e-3)
        assert motion.held_distance(19) == 0.0


@pytest.mark.parametrize("damping", [0.0, 0.5, 4.4, 4.5, 20.0])
def test_the_assigned_dynamics_die_out_by_the_slower_root(damping):
    scene = Scene(model=LINE.model, stiffness=50.0, mass=0.1, damping=damping, bilateral=True)
    slower = -np.roots([0.1, damping, 50.0]).real.max()
    assert decay_rate(scene) == pytest.approx(slower, rel=1e-12, abs=1e-12)
