"""What the checks of motion are made of, term by term: the centripetal share, starts, strikes, a spring that is off."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made import FAIL, changed, found, recorded

from hapticeval.geometry.catalogue import circle, line
from hapticeval.phenomena.checks.centripetal_force import (
    fit_share,
    force_off_spring,
    missing_at_zero_error,
    regression_terms,
)
from hapticeval.phenomena.checks.tangential_dynamics import (
    apparent_viscosity,
    describe_unexplained,
    unexplained_velocity,
)
from hapticeval.phenomena.decisions import BLOCK_TICKS, EXPLAINING_PUSH, HOLD_TICKS
from hapticeval.phenomena.measures.surface_motion import SurfaceMotion
from hapticeval.phenomena.observed import Observed
from hapticeval.scene import Scene

LINE = Scene(model=line(), stiffness=1000.0, mass=0.1)
ROUND = Scene(model=circle(), stiffness=50.0, mass=0.1, bilateral=True)
"""A circle of 0.1 m: at 0.5 m/s the normal turns by 5 rad/s, and m kappa v^2 is 0.25 N."""
SPEED, TURNING, CENTRIPETAL = 0.5, 5.0, 0.25


def on_circle(count, *, share=0.0, off=0.0, push=(0.0, 0.0), **more):
    """Round the circle, with `share` of the centripetal force lacking, and a `push` outwards and along, N."""
    angle = TURNING * 1e-3 * np.arange(count)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    ahead = np.column_stack([-out[:, 1], out[:, 0]])
    pushed = push[0] * out + push[1] * ahead
    force = -(1.0 - np.broadcast_to(share, count))[:, np.newaxis] * CENTRIPETAL * out - push[0] * out
    return recorded((0.1 + off) * out, 0.1 * out, force, velocity=SPEED * ahead, operator_force=pushed, **more)


class TestForceAtZeroError:
    @pytest.mark.parametrize("push", [(0.0, 4.0), (-3.0, 0.0), (3.0, 4.0)])
    def test_a_push_counts_and_leaves_open_what_the_normal_turns_of_it_while_a_force_is_held(self, push):
        open_ = HOLD_TICKS * 1e-3 * TURNING * math.hypot(*push) / CENTRIPETAL
        assert missing_at_zero_error(Observed(on_circle(8, share=0.5, push=push), ROUND)) == pytest.approx(0.5 - open_)
        assert missing_at_zero_error(Observed(on_circle(8, share=0.5 * open_, push=push), ROUND)) == 0.0


class TestForceOffTheSpring:
    def sinking(self, gain, *, speed=0.0, deep=slice(None), meta=None):
        """A tool 2 mm deep in rows `deep` and free elsewhere, with the line's spring times `gain`."""
        hip = np.column_stack([np.zeros(6), np.full(6, 1e-3)])
        hip[deep, 1] = -2e-3
        ihip = np.maximum(hip, 0.0)
        velocity = np.tile([0.0, -speed], (6, 1))
        meta = {"spring": "error"} if meta is None else meta
        return recorded(hip, ihip, gain * 1000.0 * (ihip - hip), velocity=velocity, meta=meta)

    @pytest.mark.parametrize(("gain", "off"), [(0.49, True), (0.51, False), (1.99, False), (2.01, True)])
    def test_a_stiffness_is_off_by_a_factor_of_two(self, gain, off):
        ratio = force_off_spring(Observed(self.sinking(gain, deep=slice(3, None)), LINE))
        assert ratio == (pytest.approx(gain) if off else None)


class TestRegression:
    def test_of_a_surface_that_only_pushes_what_comes_after_the_strike_counts(self):
        one_sided = Scene(model=circle(), stiffness=50.0, mass=0.1)
        base = on_circle(12, share=2.0, off=-1e-3)
        force = np.array(base.force)
        force[:3] = 0.0
        ticks = regression_terms(Observed(changed(base, force=force), one_sided))[0]
        assert ticks.tolist() == list(range(7, 12))

    @pytest.mark.parametrize("blocks", [1, 2, 3, 20])
    @pytest.mark.parametrize("pushed", [0.9, 1.1])
    def test_a_share_has_the_error_of_its_residual_counted_in_blocks(self, blocks, pushed):
        count = int(blocks * BLOCK_TICKS)
        cost = np.linspace(1e-3, 2e-3, count)
        wave = np.cos(math.pi * np.arange(count))
        # A push that does not go with the cost, and explains nothing of what is left, as a parabola does.
        bow = np.linspace(-1.0, 1.0, count) ** 2
        push = pushed * EXPLAINING_PUSH * 2e-3 * bow / np.ptp(bow)
        share, deviation = fit_share(0.3 * cost + 1e-4 + 1e-6 * wave, push, cost, np.zeros((count, 0)))
        assert share == pytest.approx(0.3, abs=1e-3)
        free = max(blocks - (3 if pushed > 1.0 else 2), 1)
        assert deviation == pytest.approx(1e-6 / math.sqrt(np.var(cost) * free), rel=3e-2)


class TestComingHome:
    def test_a_run_that_ended_is_told_at_its_last_row(self):
        ended = {"time": 0.004, "what": "the loop ran away"}
        base = recorded(1e-3 * np.arange(10.0).reshape(5, 2), velocity=np.ones((5, 2)), meta={"ended": ended})
        finding = found("constraint-stability", changed(base, meta={"source": "experiment"}), ROUND)
        assert (finding.outcome, finding.evidence["tick"]) == (FAIL, 4)
        assert "ended at t = 0.004 s: the loop ran away" in finding.message


class TestSliding:
    SCENE = Scene(model=line(), stiffness=1000.0, mass=0.1, bilateral=True)

    def sliding(self, viscosity, *, push=0.0, count=400, scene=SCENE):
        """A tool on the line that a viscosity, kg/s, slows from 0.5 m/s, and a push, N, drives on."""
        time = 1e-3 * np.arange(count)
        decay = viscosity / scene.mass
        steady = push / viscosity if viscosity else 0.0
        speed = steady + (0.5 - steady) * np.exp(-decay * time)
        way = np.cumsum(speed) * 1e-3
        hip, still = np.column_stack([way, 0.0 * way]), np.zeros(count)
        pushes = np.column_stack([np.full(count, push), np.full(count, -3.0)])
        return SurfaceMotion(
            Observed(recorded(hip, hip, velocity=np.column_stack([speed, still]), operator_force=pushes), scene)
        )

    def test_what_is_unexplained_is_told_as_another_viscosity_or_as_a_drive(self):
        motion = self.sliding(0.2)
        unexplained = unexplained_velocity(Observed(motion.base.recording, self.SCENE))
        words = describe_unexplained(motion, unexplained, apparent_viscosity(motion), 399)
        assert words == ", as if the surface had a viscosity of 0.2 kg/s instead of 0"
        moved = motion.components(motion.foot_velocity)
        for sign, verb in ((1.0, "driven on"), (-1.0, "braked")):
            kicked = np.where(np.arange(400)[:, np.newaxis] > 200, sign * 0.1 * moved / np.abs(moved), 0.0)
            assert describe_unexplained(motion, kicked, 0.0, 250) == f": by t = 0.25 s the tool is {verb}"
