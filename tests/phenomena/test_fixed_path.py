"""What the checks say of a recording that cannot be had anew: no finer samples, no other speed, perhaps no push."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

SCENE = Scene(model=make_model("line"), mass=1.0)


def slide(along, *, hip_step=1e-4, source="file"):
    """A tool on the line y = 0 whose IHIP is at `along` (n,), m, while the HIP goes on evenly below it."""
    count = along.size
    hip = np.column_stack([hip_step * np.arange(count), np.full(count, -1e-3)])
    ihip = np.column_stack([along, np.zeros(count)])
    return Recording(
        1e-3 * np.arange(count),
        {"hip": hip, "ihip": ihip, "force": 1000.0 * (ihip - hip), "velocity": 0.0 * hip},
        {"source": source},
    )


def outcome(along):
    return CHECKS["continuous-contact"](Runs(slide(along)), SCENE).outcome


STEP = 1e-4 * np.arange(200.0)


@pytest.mark.parametrize("stretch", [0.0, 1.0, 2.5])
def test_a_jump_between_two_samples_is_pop_through(stretch):
    """However the tool moves beside it: samples left out make the jump no longer."""
    jump = np.where(np.arange(200) < 100, 0.0, 0.02)
    assert outcome(stretch * STEP + jump) is Outcome.FAIL


@pytest.mark.parametrize("width", [8, 20])
@pytest.mark.parametrize("power", [1.0, 1.0 / 3.0])
def test_a_steep_stretch_over_several_samples_is_left_open(width, power):
    ramp = np.clip((np.arange(200) - 100) / width, -1.0, 1.0)
    assert outcome(STEP + 0.02 * np.sign(ramp) * np.abs(ramp) ** power) is Outcome.INCONCLUSIVE


def test_a_path_without_long_steps_passes():
    assert outcome(2.0 * STEP) is Outcome.PASS


def test_a_jump_at_the_very_end_is_seen():
    jump = np.where(np.arange(200) < 199, 0.0, 0.02)
    assert outcome(STEP + jump) is Outcome.FAIL


@pytest.mark.parametrize("judge", [CHECKS["impulsive-collision"], CHECKS["centripetal-force"]])
@pytest.mark.parametrize(("source", "words"), [("replay", "does not answer"), ("file", "was not recorded")])
def test_without_the_hands_answer_nothing_is_said_of_momentum(judge, source, words):
    finding = judge(Runs(slide(STEP, source=source)), SCENE)
    assert finding.outcome is Outcome.INCONCLUSIVE
    assert words in finding.message


@pytest.mark.parametrize("judge", [CHECKS["impulsive-collision"], CHECKS["centripetal-force"]])
def test_a_recorded_push_lets_the_check_go_on(judge):
    recording = slide(STEP)
    pushed = {**recording.channels, "operator_force": -recording.force}
    finding = judge(Runs(Recording(recording.time, pushed, recording.meta)), SCENE)
    assert "was not recorded" not in finding.message
