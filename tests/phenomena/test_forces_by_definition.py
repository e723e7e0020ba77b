"""What the checks of the force are made of, term by term: stiffness, what is allowed of it, causes, friction's laws."""

from __future__ import annotations

import math
from types import MappingProxyType

import numpy as np
import pytest
from made import changed, found, recorded
from scipy.integrate import solve_ivp

from hapticeval.effects.friction import Friction
from hapticeval.effects.lugre import LuGre
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.geometry.catalogue import circle, line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.force_magnitude import judge_stiffness, misfit_of
from hapticeval.phenomena.checks.friction_work import dissipated_work, stored_energy
from hapticeval.phenomena.checks.passivity import explained_work
from hapticeval.phenomena.decisions import LAG_STEPS, LAG_TICKS, TWO_FORCES_ROWS
from hapticeval.phenomena.measures.lugre_force import lugre_force
from hapticeval.phenomena.measures.stiffness import (
    ApparentStiffness,
    find_pressed_ticks,
    force_coarseness,
    largest_other_force,
    measure_stiffness,
)
from hapticeval.phenomena.measures.surface_force import surface_force_of
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.recordings.recording import SINGLE
from hapticeval.renderer import Spring
from hapticeval.scene import Scene

LINE = Scene(model=line(), stiffness=1000.0, mass=0.1)
COUNT, STEP, DT = 40, 1e-4, 1e-3


def stiffness_of(base, spring):
    return measure_stiffness(base, find_pressed_ticks(base), spring)


def moving(scene, *, depth=2e-3, sink=0.0, gain=1.0, extra=None, **more):
    """A hand along the line, deeper by `sink` (m) in each tick, with a spring of `gain` times the scene's stiffness."""
    ticks = np.arange(COUNT)
    hip = np.column_stack([STEP * ticks, -depth - sink * ticks])
    ihip = np.column_stack([STEP * ticks, np.zeros(COUNT)])
    force = gain * scene.stiffness * (ihip - hip)
    simulated = {"source": "playback", **more.pop("meta", {})}
    return recorded(hip, ihip, force if extra is None else force + extra, meta=simulated, **more)


def round_circle(radius=0.1, depth=2e-3, speed=0.1):
    """A hand that goes round under a circle, and a tool above it."""
    angle = speed / radius * DT * np.arange(COUNT)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    hip, ihip = (radius - depth) * out, radius * out
    return Scene(model=circle(size=2.0 * radius), stiffness=1000.0, mass=0.1), recorded(hip, ihip)


class TestStiffness:
    @pytest.mark.parametrize("spring", list(Spring))
    def test_a_spring_is_measured_as_what_it_is_within_what_rounding_leaves_open(self, spring):
        base = moving(LINE, gain=1.3, meta={"spring": spring.value})
        measured = stiffness_of(Observed(base, LINE), spring)
        # In the last three rows a late IHIP would be missing: the force may be that of any depth within a lag.
        assert np.flatnonzero(measured.begins).tolist() == [COUNT - 3, COUNT - 2, COUNT - 1]
        within, ends = slice(0, COUNT - 3), slice(COUNT - 3, None)
        np.testing.assert_allclose(measured.ratio[within], 1.3)
        np.testing.assert_allclose(measured.ratio[ends], 1.3 * 2e-3 / math.hypot(2e-3, 3.0 * STEP))
        np.testing.assert_allclose(measured.depth[within], 2e-3)
        ends_of_share = np.array([measured.low[within], measured.high[within]])
        farthest = 1.0 + (3.0 * STEP / 2e-3) ** 2  # three ticks aside
        if spring is Spring.ERROR:
            np.testing.assert_allclose(ends_of_share[0, 3:], 1.3 / farthest, rtol=1e-6)
            np.testing.assert_allclose(ends_of_share[1], 1.3, rtol=1e-6)
        else:
            np.testing.assert_allclose(ends_of_share, 1.3, rtol=1e-6)
        assert np.isinf(measured.high[ends]).all()
        open_depth = 4.0 * SINGLE * (np.abs(base.hip).max() + measured.depth)
        np.testing.assert_allclose(measured.allowed, open_depth / measured.depth, rtol=1e-6)

    @pytest.mark.parametrize("sink", [0.0, 5e-5])
    def test_a_damper_may_make_its_share_along_the_depth_and_at_any_speed_within_a_lag(self, sink):
        scene = Scene(model=line(), stiffness=1000.0, mass=0.1, damping=2.0)
        measured = stiffness_of(Observed(moving(scene, sink=sink, meta={"spring": "error"}), scene), Spring.ERROR)
        row = 20
        rounding = 4.0 * SINGLE * (STEP * (COUNT - 1) + measured.depth[row])
        depth = 2e-3 + sink * row
        damped = (2.0 * sink / DT + 1000.0 * rounding) / (1000.0 * depth)
        assert measured.allowed[row] == pytest.approx(damped, rel=1e-3)
        in_lag = (2.0 * math.hypot(STEP, sink) / DT + 1000.0 * rounding) / (1000.0 * depth)
        assert measured.allowed_in_lag[row] == pytest.approx(in_lag, rel=1e-3)
        assert measured.rate[row] == pytest.approx(sink / DT, rel=1e-6, abs=1e-12)

    @pytest.mark.parametrize(
        ("sink", "gain", "may"), [(5e-5, 0.95, False), (5e-5, 1.05, True), (-5e-5, 0.95, True), (-5e-5, 1.05, False)]
    )
    def test_a_damper_brakes_and_explains_no_force_that_speeds_up(self, sink, gain, may):
        """It adds on the way in, and takes on the way out: at 50 mm/s and 2 N s/m, 0.1 N."""
        scene = Scene(model=line(), stiffness=1000.0, mass=0.1, damping=2.0)
        base = moving(scene, depth=6e-3, sink=sink, gain=gain, meta={"spring": "error"})
        measured = stiffness_of(Observed(base, scene), Spring.ERROR)
        row = 20
        rounding = measured.allowed[row] * measured.depth[row] * 1000.0 - (0.1 if may else 0.0)
        assert 0.0 < rounding < 0.01

    def test_the_curvature_may_make_what_it_calls_for_of_one_who_declares_no_spring(self):
        scene, base = round_circle()
        measured = stiffness_of(Observed(base, scene), Spring.ERROR)
        rounding = 4.0 * SINGLE * (np.abs(base.hip).max() + 2e-3)
        step = np.linalg.norm(np.diff(base.ihip, axis=0), axis=1)[0]
        bending = 0.1 * (step / DT) ** 2 / 0.1
        assert measured.allowed[20] == pytest.approx((bending + 1000.0 * rounding) / 2.0, rel=1e-3)
        np.testing.assert_allclose(largest_other_force(Observed(base, scene))[20], bending, rtol=1e-3)
        declared = changed(base, meta={"spring": "error"})
        np.testing.assert_allclose(largest_other_force(Observed(declared, scene)), 0.0)
        assert stiffness_of(Observed(declared, scene), Spring.ERROR).allowed[20] == pytest.approx(
            rounding / 2e-3, rel=1e-3
        )

    @pytest.mark.parametrize(("declared", "coarse"), [(0.01, 0.01), (1.0, 0.05 * 2.0)])
    def test_a_force_is_as_coarse_as_declared_up_to_a_twentieth_of_the_largest(self, declared, coarse):
        base = moving(LINE, meta={"spring": "error", "force_resolution": declared})
        rounding = 4.0 * SINGLE * (np.abs(base.hip).max() + 2e-3)
        measured = stiffness_of(Observed(base, LINE), Spring.ERROR)
        assert measured.allowed[20] == pytest.approx((coarse + 1000.0 * rounding) / 2.0, rel=1e-6)

    @pytest.mark.parametrize(("every", "coarse"), [(2, 0.01), (1, 0.0)])
    def test_a_force_that_stands_is_as_coarse_as_its_least_change(self, every, coarse):
        """One that changes in every tick is not; neither lies on a lattice."""
        ticks = np.arange(COUNT)
        changes = np.where(ticks % every, 0.0, 0.01 * np.sqrt(1.0 + ticks / 7.0))
        force = np.outer(1.5 + np.cumsum(changes), [0.0, 1.0])
        base = changed(moving(LINE), force=force, meta={"spring": "error", "force_resolution": 1.0})
        assert force_coarseness(Observed(base, LINE)) == pytest.approx(coarse and changes[every])

    def test_a_log_is_as_coarse_as_half_the_steps_of_its_numbers(self):
        """Steps of 10 mm of the depth and so of 10 N, and of 0.1 mm along the line."""
        base = moving(LINE, sink=1e-2, meta={"spring": "error"})
        logged = changed(base, meta={"source": "log"})
        simulated, measured = (stiffness_of(Observed(run, LINE), Spring.ERROR) for run in (base, logged))
        # Along the line HIP and IHIP go, in depth the HIP alone.
        coarse = 0.5 * 1000.0 * math.hypot(STEP, STEP, 1e-2) + 0.5 * 10.0
        depth = 2e-3 + 1e-2 * 20
        more = measured.allowed[20] - simulated.allowed[20]
        assert more == pytest.approx(coarse / (1000.0 * depth), rel=1e-3)

    def test_a_tool_that_stands_off_may_be_pulled_from_the_surface_or_from_where_it_is(self):
        base = moving(LINE)
        off = changed(base, ihip=base.ihip + np.array([0.0, 5e-4]), meta={"standoff": 1e-3})
        measured = stiffness_of(Observed(off, LINE), Spring.ERROR)
        # 2 N over 2.5 mm, of which half a millimetre may be the standoff
        inner = ~measured.begins
        farthest = 1.0 + (3.0 * STEP / 2.5e-3) ** 2
        np.testing.assert_allclose(measured.low[inner][3:], 0.8 / farthest * 2.5 / 3.0, rtol=1e-6)
        np.testing.assert_allclose(measured.high[inner], 0.8 * 2.5 / 2.0, rtol=1e-6)

    def test_what_is_told_of_the_deepest_is_of_one_tick(self):
        """A hand that dips to 30 mm at once, within a lag of where its contact begins and again later."""
        ticks = np.arange(COUNT)
        depth = np.where(ticks < 5, -1e-2, np.where((ticks == 7) | (ticks == 20), 3e-2, 1e-2))
        hip = np.column_stack([STEP * ticks, -depth])
        ihip = np.column_stack([hip[:, 0], np.maximum(hip[:, 1], 0.0)])
        finding = found("force-magnitude", recorded(hip, ihip), LINE)
        assert finding.outcome is Outcome.PASS
        assert finding.evidence["depth_m"] == pytest.approx(3e-2)
        assert finding.evidence["force_N"] == pytest.approx(30.0)

    @pytest.mark.parametrize(
        ("declares", "silent", "outcome"),
        [
            ("none", False, Outcome.PASS),
            ("none", True, Outcome.FAIL),
            (None, False, Outcome.INCONCLUSIVE),
            (None, True, Outcome.INCONCLUSIVE),
        ],
    )
    def test_who_declares_a_force_alone_gives_one_at_every_depth(self, declares, silent, outcome):
        """A press to 4 mm, of which 52 rows are inside; of another a tool may be where no force comes."""
        depth = 5e-3 * np.sin(np.linspace(0.0, np.pi, 60)) - 1e-3
        hip = np.column_stack([np.zeros(60), -depth])
        force = np.column_stack([np.zeros(60), 1000.0 * np.maximum(depth, 0.0)])
        force[25:40] *= not silent
        meta = {"source": "playback"} | ({} if declares is None else {"contact_point": declares})
        finding = found("force-magnitude", recorded(hip, None, force, meta=meta), LINE)
        assert finding.outcome is outcome
        assert finding.evidence["samples"] == 52 - 15 * (silent and declares is None)


class TestTwoForces:
    """A hand along the line, 5 mm deep, there and back, of a renderer whose stiffness may be half or twice."""

    VARIES = MappingProxyType({"spring": "error", "stiffness_least": 0.5, "stiffness_largest": 2.0})
    LAG_KNOWN_TO = LAG_TICKS / LAG_STEPS * STEP

    def way(self, *, share=1.0, off=0.0, rows=slice(None), backwards=False):
        run = moving(LINE, depth=5e-3, gain=share, meta=self.VARIES)
        force = np.array(run.force)
        force[rows, 1] += off
        order = slice(None, None, -1 if backwards else 1)
        channels = {name: values[order] for name, values in {**run.channels, "force": force}.items()}
        return changed(run, **channels)

    def found(self, share=1.0, **back):
        back = self.way(share=share, backwards=True, **back)
        return found("force-magnitude", Runs(self.way(share=share), reverse=lambda: back), LINE)

    @pytest.mark.parametrize("share", [0.5, 1.0, 1.6])
    def test_they_differ_by_more_than_rounding_and_what_a_lag_is_known_to(self, share):
        """With K s between them, s the largest share that either run shows, and the scene's at the least."""
        open_of_one = LINE.stiffness * (self.LAG_KNOWN_TO + Observed(self.way(), LINE).rounding)
        allowed = 2.0 * max(share, 1.0) * open_of_one
        assert self.found(share, off=0.9 * allowed).outcome is Outcome.PASS
        finding = self.found(share, off=1.1 * allowed)
        assert finding.outcome is Outcome.FAIL
        assert finding.level is Level.MUST
        assert finding.metric.value == pytest.approx(1.1 * allowed)
        assert finding.bound == pytest.approx(allowed, rel=0.01)
        assert finding.evidence["force_N"] == pytest.approx(share * 5.0)
        assert finding.evidence["other_force_N"] == pytest.approx(share * 5.0 + 1.1 * allowed)

    @pytest.mark.parametrize(
        ("rows", "outcome"),
        [
            # Between two ticks a lag leaves the first and the last of them open.
            (range(10, 12 + TWO_FORCES_ROWS), Outcome.FAIL),
            (range(10, 9 + TWO_FORCES_ROWS), Outcome.PASS),
            ([*range(8, 14), *range(24, 30)], Outcome.PASS),
        ],
    )
    def test_they_differ_in_half_of_the_rows_of_a_stretch(self, rows, outcome):
        assert self.found(off=1.0, rows=list(rows)).outcome is outcome


class TestCauses:
    def measured(self, ratio, *, low=None, high=None, allowed=1e-3, rate=0.0, depth=2e-3, begins=False, ticks=None):
        """What was measured at so many ticks; the ends of the share are the share where they are not given."""
        ratio = np.asarray(ratio, dtype=float)
        rows = np.arange(ratio.size) if ticks is None else np.asarray(ticks)
        full = (np.array(np.broadcast_to(values, ratio.size), dtype=float) for values in (allowed, depth, rate))
        allowed, depth, rate = full
        low, high = (ratio if end is None else np.asarray(end, dtype=float) for end in (low, high))
        begins = np.array(np.broadcast_to(begins, ratio.size))
        return ApparentStiffness(rows, ratio, low, high, allowed, allowed, depth, rate, begins)

    def test_the_law_that_fits_better_is_within_the_range_then_clear_then_off_in_fewer_ticks_and_by_less(self):
        base = Observed(moving(LINE), LINE)
        misfits = [
            misfit_of(self.measured(ratio, allowed=allowed), base)
            for ratio, allowed in (
                ([1.0] * 4, 1e-3),
                ([1.0, 1.0, 1.0, 1.05], 1e-3),
                ([1.0, 1.0, 1.0, 1.06], 1e-3),
                ([1.0, 1.0, 1.02, 1.02], 1e-3),
                ([1.0] * 4, 0.11),
                ([1.0, 1.0, 1.0, 2.1], 1e-3),
            )
        ]
        assert misfits == sorted(misfits)
        assert len(set(misfits)) == len(misfits)
        assert misfits[0] == (0.0, False, 0.0, 0.0)
        assert misfits[1] == (0.0, False, 0.25, pytest.approx(0.049))
        assert misfits[4] == (0.0, True, 0.0, 0.0), "a damper may make a tenth"
        assert misfits[5][0] == pytest.approx(2.1 - 1.8 - 1e-3)

    @pytest.mark.parametrize(("share", "bound"), [(2.5, 0.8), (0.2, 0.45)])
    def test_a_stiffness_outside_of_what_is_not_declared_is_off_the_nearer_end(self, share, bound):
        """Undeclared it may be 0.55 to 1.8 of the scene's: 1.1 / 2 and 0.9 * 2."""
        finding = judge_stiffness(
            Observed(moving(LINE, gain=share), LINE), self.measured([share] * COUNT), Level.SHOULD
        )
        assert (finding.level, finding.outcome) == (Level.MUST, Outcome.FAIL)
        assert finding.bound == pytest.approx(bound + 1e-3)
        assert finding.metric.value == pytest.approx(abs(share - 1.0))


class TestEnergy:
    @pytest.mark.parametrize("lag", [0.0, 0.5, 3.0])
    def test_a_held_and_late_spring_explains_its_share_of_the_squared_steps(self, lag):
        base = moving(LINE, meta={"spring": "error"})
        explained = explained_work(Observed(base, LINE), lag)
        np.testing.assert_allclose(np.diff(explained), (0.5 + lag) * 1000.0 * STEP**2, rtol=1e-9)
        assert explained[0] == 0.0

    @pytest.mark.parametrize("lag", [1.2, 2.0])
    def test_the_longest_step_within_the_lag_counts(self, lag):
        """Of two whole ticks for any part of the second."""
        base = moving(LINE, meta={"spring": "error"})
        hip, ihip = np.array(base.hip), np.array(base.ihip)
        hip[20:, 0], ihip[20:, 0] = hip[20:, 0] + STEP, ihip[20:, 0] + STEP  # one step is twice as long
        explained = np.diff(explained_work(Observed(recorded(hip, ihip, meta=base.meta), LINE), lag))
        expected = np.where((np.arange(COUNT - 1) >= 19) & (np.arange(COUNT - 1) <= 21), 4.0, 1.0)
        np.testing.assert_allclose(explained, (0.5 + lag) * 1000.0 * STEP**2 * expected, rtol=1e-9)

    def test_what_changes_beside_the_spring_counts_up_to_what_a_damper_may_give(self):
        scene = Scene(model=line(), stiffness=1000.0, mass=0.1, damping=1.0)
        extra = np.zeros((COUNT, 2))
        extra[20:, 0] = 0.05  # along the surface; the damper may give 1 N s/m * 0.1 m/s
        for size, counts in ((0.05, 0.05), (0.5, 0.1)):
            base = moving(scene, extra=extra * size / 0.05, meta={"spring": "error"})
            explained = np.diff(explained_work(Observed(base, scene), 0.0))
            spring = 0.5 * 1000.0 * STEP**2
            assert explained[19] == pytest.approx(spring + 0.5 * counts * STEP, rel=1e-6)
            assert explained[25] == pytest.approx(spring, rel=1e-6)

    def test_a_declared_range_adds_its_change_over_the_depth_and_in_free_space_nothing_is_held(self):
        gain = np.where(np.arange(COUNT) < 20, 1.0, 1.5)[:, np.newaxis]
        base = moving(LINE, gain=gain, meta={"spring": "error", "stiffness_least": 0.5, "stiffness_largest": 2.0})
        explained = np.diff(explained_work(Observed(base, LINE), 0.0))
        assert explained[10] == pytest.approx(0.5 * 1000.0 * STEP**2, rel=1e-6)
        changed_force = 0.5 * 1000.0 * 2e-3
        assert explained[19] == pytest.approx(0.5 * (1500.0 * STEP**2 + changed_force * STEP), rel=1e-6)
        assert explained[30] == pytest.approx(0.5 * 1500.0 * STEP**2, rel=1e-6)
        free = recorded(np.column_stack([STEP * np.arange(COUNT), np.full(COUNT, 1e-3)]))
        np.testing.assert_array_equal(explained_work(Observed(free, LINE), 3.0), 0.0)

    def test_a_force_that_rests_is_as_much_later(self):
        base = moving(LINE, sink=5e-5)
        assert Observed(base, LINE).force_lag == 0.0
        held = np.array(base.force)[np.arange(COUNT) // 2 * 2]
        assert Observed(changed(base, force=held), LINE).force_lag == pytest.approx(0.5, abs=0.05)


class TestFriction:
    SCENE = LINE.with_effects(Friction(mu_s=0.5, mu_k=0.3))

    def test_a_force_s_parts_are_across_and_along_the_surface(self):
        base = moving(self.SCENE, extra=np.array([0.4, 0.0]), velocity=np.tile([0.1, -0.02], (COUNT, 1)))
        surface_force = surface_force_of(Observed(base, self.SCENE))
        np.testing.assert_allclose(surface_force.normal_force, 2.0)
        np.testing.assert_allclose(surface_force.tangential_force, np.tile([0.4, 0.0], (COUNT, 1)), atol=1e-12)
        np.testing.assert_allclose(surface_force.tangential_size, 0.4)
        np.testing.assert_allclose(surface_force.velocity, np.tile([0.1, 0.0], (COUNT, 1)), atol=1e-12)
        reach = 1000.0 * np.abs(base.hip).max() + math.hypot(2.0, 0.4)
        np.testing.assert_allclose(surface_force.open_force, 16.0 * 2.0**-52 * reach, rtol=1e-6)
        damped = Scene(model=line(), stiffness=1000.0, damping=3.0, effects=(ViscousFriction(2.0),))
        np.testing.assert_allclose(surface_force_of(Observed(base, damped)).open_force, 5.0 * 0.1, rtol=1e-6)
        lifted = changed(base, force=np.zeros((COUNT, 2)))
        assert not surface_force_of(Observed(lifted, self.SCENE)).pressed.any()

    def test_a_pull_on_a_constraint_that_holds_from_both_sides_presses(self):
        scene = Scene(model=line(), stiffness=1000.0, bilateral=True, effects=(Friction(mu_s=0.5, mu_k=0.3),))
        base = moving(scene, depth=-2e-3)
        np.testing.assert_allclose(surface_force_of(Observed(base, scene)).normal_force, 2.0)
        np.testing.assert_allclose(surface_force_of(Observed(base, self.SCENE)).normal_force, -2.0)

    def test_a_lap_takes_the_slip_s_friction_and_what_the_spring_relaxes(self):
        """The tool follows the hand by steps of its own, held back by mu_k F_n."""
        base = moving(self.SCENE, extra=np.array([-0.6, 0.0]))
        behind = changed(base, ihip=base.ihip - np.array([6e-4, 0.0]))
        moved = np.diff(behind.hip, axis=0)
        surface_force = surface_force_of(Observed(behind, self.SCENE))
        work, doubt = dissipated_work(Observed(behind, self.SCENE), surface_force, moved)
        # mu_k F_n ds, and K ds . (ds - dx) / 2 = 0 for a tool that moves as the hand does
        np.testing.assert_allclose(work, 0.3 * 2.0 * STEP, rtol=1e-6)
        np.testing.assert_allclose(doubt, 2.0 * STEP * surface_force.rounding[1:])
        np.testing.assert_allclose(stored_energy(Observed(behind, self.SCENE), surface_force), (4.0 + 0.36) / 2e3)
        halves = changed(
            behind, ihip=behind.ihip + 0.5 * STEP * np.column_stack([np.arange(COUNT) % 2, np.zeros(COUNT)])
        )
        relaxed = dissipated_work(Observed(halves, self.SCENE), surface_force_of(Observed(halves, self.SCENE)), moved)[
            0
        ]
        slip = np.diff(halves.ihip, axis=0)[:, 0]
        beside_spring = (1000.0 * (halves.ihip - halves.hip) - halves.force)[1:, 0] * slip
        np.testing.assert_allclose(
            relaxed, 0.6 * np.abs(slip) - beside_spring + 500.0 * slip * (slip - STEP), rtol=1e-6, atol=1e-12
        )

    @pytest.mark.parametrize("speed", [1e-3, 2e-2])
    def test_the_bristles_bend_as_their_equation_has_it(self, speed):
        """z' = v - sigma0 |v| z / g(v), at a constant speed and press, by an integrator of its own."""
        law = LuGre(0.5, 0.3, stribeck=5e-3, stiffness=2e4, damping=5.0, viscosity=4.0)
        scene = LINE.with_effects(law)
        count = 60
        hip = np.column_stack([speed * DT * np.arange(count), np.full(count, -2e-3)])
        base = recorded(hip, hip * [1.0, 0.0], velocity=np.tile([speed, 0.0], (count, 1)))
        surface_force = surface_force_of(Observed(base, scene))
        force = lugre_force(law, surface_force, DT, 1)[:, 0]
        limit = float(law.limit(np.array([[speed]]))[0, 0]) * 2.0
        rate = lambda _, z: speed - 2e4 * speed * z / limit  # noqa: E731
        # A tick of bending is over in the first row already.
        z = solve_ivp(rate, (0.0, DT * count), [0.0], t_eval=DT * (1.0 + np.arange(count)), rtol=1e-10, atol=1e-14).y[0]
        damping = float(np.ravel(law.damping_at(np.array([[speed]])))[0])
        expected = 2e4 * z + damping * np.array([rate(0.0, bent) for bent in z]) + 4.0 * speed
        np.testing.assert_allclose(force, expected, rtol=1e-5)
        np.testing.assert_allclose(lugre_force(law, surface_force, DT, 8)[2:, 0], expected[2:], rtol=1e-5)

    def test_bristles_turn_back_with_the_hand_and_let_go_without_a_press(self):
        law = LuGre(0.5, 0.3, stribeck=5e-3, stiffness=2e4, damping=0.0, viscosity=0.0)
        scene = LINE.with_effects(law)
        there = np.concatenate([np.arange(30), np.arange(30, 0, -1)])
        hip = np.column_stack([STEP * there, np.full(60, -2e-3)])
        base = recorded(hip, hip * [1.0, 0.0])
        force = lugre_force(law, surface_force_of(Observed(base, scene)), DT, 1)[:, 0]
        assert force[28] > 0.0 > force[58]
        assert force[28] == pytest.approx(-force[58], rel=1e-3)
        lifted = np.array(base.force)
        lifted[15:20] = 0.0
        gap = lugre_force(law, surface_force_of(Observed(changed(base, force=lifted), scene)), DT, 1)[:, 0]
        np.testing.assert_array_equal(gap[15:20], 0.0)
        np.testing.assert_allclose(gap[20:29], force[1:10], rtol=1e-6)

    def test_bristles_under_a_hand_that_speeds_up_bend_as_their_equation_has_it(self):
        law = LuGre(0.5, 0.3, stribeck=5e-3, stiffness=2e4, damping=5.0, viscosity=4.0)
        scene = LINE.with_effects(law)
        speeds = np.concatenate([np.full(3, 1e-3), 1e-3 + 2e-3 * np.arange(1, 12)])
        hip = np.column_stack([np.zeros(speeds.size), np.full(speeds.size, -2e-3)])
        base = recorded(hip, hip * [1.0, 0.0], velocity=np.column_stack([speeds, np.zeros(speeds.size)]))
        force = lugre_force(law, surface_force_of(Observed(base, scene)), DT, 64)[:, 0]

        def speed(time):
            """The tick of row k ends at k ticks: in the first the speed is what it is at its end."""
            return np.interp(time, DT * np.arange(speeds.size), speeds)

        def rate(time, bent):
            v = speed(time)
            return v - 2e4 * v * bent / (2.0 * law.limit(np.array([[v]]))[0, 0])

        times = DT * np.arange(speeds.size)
        z = solve_ivp(rate, (-DT, times[-1]), [0.0], t_eval=times, rtol=1e-9, atol=1e-15, max_step=1e-4).y[0]
        damping = law.damping_at(speeds[:, np.newaxis])[:, 0]
        expected = 2e4 * z + damping * np.array([rate(*at) for at in zip(times, z, strict=True)]) + 4.0 * speeds
        np.testing.assert_allclose(force, expected, rtol=1e-4)
