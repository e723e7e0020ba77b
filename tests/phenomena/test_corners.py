"""Broken contact and abrupt switch on recordings made by hand, with the fault's size known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import circle, star
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

SCENE = Scene(model=star())
TIP, NOTCH = SCENE.model.curve.corners[0], SCENE.model.curve.corners[1]
STEP = 2e-5


def over_the_tip(*, early=0.0, late=0.0, backwards=False, step=STEP):
    """5 mm under a face towards the tip; the force turns `early` metres before it or stays `late` metres after."""
    ahead, normal = (-TIP.tangent_post, TIP.normal_post) if backwards else (TIP.tangent_pre, TIP.normal_pre)
    other = TIP.normal_pre if backwards else TIP.normal_post
    x = np.arange(-0.02, 0.02, step) + step / 3
    hip = TIP.position + x[:, None] * ahead - 5e-3 * normal
    touching = x <= late
    ihip = np.where(touching[:, None], hip + 5e-3 * normal, hip)
    force = np.where(touching[:, None], 5.0 * normal, 0.0)
    if early:
        force[(x > -early) & (x < 0)] = 5.0 * other
    return Recording(np.arange(x.size) * 1e-3, {"hip": hip, "ihip": ihip, "force": force})


@pytest.mark.parametrize("backwards", [False, True])
def test_a_force_that_keeps_to_the_corner_and_is_gone_passes(backwards):
    assert CHECKS["broken-contact"](Runs(over_the_tip(backwards=backwards)), SCENE).outcome is Outcome.PASS


@given(distance=st.floats(2e-4, 0.015), backwards=st.booleans())
@settings(max_examples=30)
def test_how_far_too_early_or_too_late_is_measured(distance, backwards):
    early = CHECKS["broken-contact"](Runs(over_the_tip(early=distance, backwards=backwards)), SCENE)
    late = CHECKS["broken-contact"](Runs(over_the_tip(late=distance, backwards=backwards)), SCENE)
    for finding in (early, late):
        assert finding.outcome is Outcome.FAIL
        assert finding.metric.value == pytest.approx(distance, abs=1.1 * STEP)
    assert "before" in early.message
    assert "past" in late.message


def test_three_ticks_of_lag_are_granted_and_five_are_not():
    assert CHECKS["broken-contact"](Runs(over_the_tip(late=2.5 * STEP)), SCENE).outcome is Outcome.PASS
    assert CHECKS["broken-contact"](Runs(over_the_tip(late=5 * STEP)), SCENE).outcome is Outcome.FAIL


def test_a_path_that_turns_back_before_the_corner_decides_nothing():
    base = over_the_tip()
    keep = slice(0, 500)
    short = Recording(base.time[keep], {name: values[keep] for name, values in base.channels.items()})
    assert CHECKS["broken-contact"](Runs(short), SCENE).outcome is Outcome.INCONCLUSIVE


def test_a_smooth_model_has_no_corners_to_judge():
    scene = Scene(model=circle())
    base = over_the_tip()
    assert CHECKS["broken-contact"](Runs(base), scene).outcome is Outcome.NOT_APPLICABLE
    assert CHECKS["abrupt-switch"](Runs(base), scene).outcome is Outcome.NOT_APPLICABLE


def round_the_notch(*, depth, spread, backwards=False):
    """Along the faces of the notch `depth` under them, the force turning over a `spread` of the arc below."""
    turn = NOTCH.turn
    first = np.arctan2(NOTCH.normal_pre[1], NOTCH.normal_pre[0])
    arc = np.arange(0.0, abs(turn), STEP / depth) / abs(turn)
    x = np.arange(-0.02, 0.0, STEP)
    before = NOTCH.position + x[:, None] * NOTCH.tangent_pre - depth * NOTCH.normal_pre
    after = NOTCH.position - x[::-1, None] * NOTCH.tangent_post - depth * NOTCH.normal_post

    def direction(share):
        angle = first + np.asarray(share) * turn
        return np.column_stack([np.cos(angle), np.sin(angle)])

    hip = np.vstack([before, NOTCH.position - depth * direction(arc), after])
    turned = np.clip((arc - 0.5) / spread + 0.5, 0.0, 1.0) if spread else (arc > 0.5).astype(float)
    share = np.concatenate([np.zeros(len(before)), turned, np.ones(len(after))])
    force = 1e3 * depth * direction(share)
    ihip = np.vstack([before + depth * NOTCH.normal_pre, np.tile(NOTCH.position, (arc.size, 1)), after])
    ihip[-len(after) :] += depth * NOTCH.normal_post
    order = slice(None, None, -1 if backwards else 1)
    channels = {"hip": hip[order], "ihip": ihip[order], "force": force[order]}
    return Recording(np.arange(len(hip)) * 1e-3, channels)


@given(depth=st.floats(2e-3, 0.012), spread=st.floats(0.2, 1.0), backwards=st.booleans())
@settings(max_examples=30)
def test_the_travel_of_the_switch_is_measured_in_depths(depth, spread, backwards):
    finding = CHECKS["abrupt-switch"](Runs(round_the_notch(depth=depth, spread=spread, backwards=backwards)), SCENE)
    assert finding.outcome is Outcome.FAIL
    wanted = 0.9 * spread * abs(NOTCH.turn)
    assert finding.metric.value == pytest.approx(wanted, abs=4 * STEP / depth)
    assert finding.evidence["switch_takes_s"] == pytest.approx(wanted * depth / STEP * 1e-3, abs=5e-3)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_switch_at_one_point_passes(backwards):
    finding = CHECKS["abrupt-switch"](Runs(round_the_notch(depth=5e-3, spread=0.0, backwards=backwards)), SCENE)
    assert finding.outcome is Outcome.PASS


def test_a_path_along_one_face_decides_nothing():
    base = round_the_notch(depth=5e-3, spread=1.0)
    keep = slice(0, 800)
    short = Recording(base.time[keep], {name: values[keep] for name, values in base.channels.items()})
    assert CHECKS["abrupt-switch"](Runs(short), SCENE).outcome is Outcome.INCONCLUSIVE


def changed(recording, **arrays):
    return Recording(recording.time, {**recording.channels, **arrays})


def test_a_force_that_fades_before_the_corner_is_not_kept():
    base = over_the_tip()
    x = (base.hip - TIP.position) @ TIP.tangent_pre
    fading = changed(base, force=base.force * np.clip(-x / 0.02, 1e-4, 1.0)[:, None])
    finding = CHECKS["broken-contact"](Runs(fading), SCENE)
    assert finding.outcome is Outcome.FAIL
    assert "lost" in finding.message


def test_a_force_that_comes_back_from_the_face_that_was_left_fails():
    base = over_the_tip()
    x = (base.hip - TIP.position) @ TIP.tangent_pre
    back = (x > 2e-3) & (x < 6e-3)
    force, ihip = np.array(base.force), np.array(base.ihip)
    force[back], ihip[back] = 5.0 * TIP.normal_pre, base.hip[back] + 5e-3 * TIP.normal_pre
    finding = CHECKS["broken-contact"](Runs(changed(base, force=force, ihip=ihip)), SCENE)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(6e-3, abs=1e-4)


def test_a_face_touched_on_the_way_is_not_taken_for_the_face_before_the_corner():
    """Along a face, round the notch and on over the next tip: the corner before the notch is none of its business."""
    notch = round_the_notch(depth=2e-3, spread=0.0)
    tip = SCENE.model.curve.corners[2]
    start = notch.hip[-1]
    along = np.arange(0.0, float((tip.position - start) @ tip.tangent_pre) + 0.01, STEP) + STEP / 3
    hip = start + along[:, None] * tip.tangent_pre
    ahead = (hip - tip.position) @ tip.tangent_pre <= 0.0
    ihip = np.where(ahead[:, None], hip + 2e-3 * tip.normal_pre, hip)
    force = np.where(ahead[:, None], 2.0 * tip.normal_pre, 0.0)
    whole = {
        "hip": np.vstack([notch.hip, hip]),
        "ihip": np.vstack([notch.ihip, ihip]),
        "force": np.vstack([notch.force, force]),
    }
    recording = Recording(np.arange(len(whole["hip"])) * 1e-3, whole)
    assert CHECKS["broken-contact"](Runs(recording), SCENE).outcome is Outcome.PASS
    assert CHECKS["abrupt-switch"](Runs(recording), SCENE).outcome is Outcome.PASS


def test_a_force_that_flickers_between_the_faces_is_no_abrupt_switch():
    base = round_the_notch(depth=5e-3, spread=0.0)
    force = np.array(base.force)
    flicker = slice(600, 900, 2)
    force[flicker] = 5.0 * NOTCH.normal_post
    finding = CHECKS["abrupt-switch"](Runs(changed(base, force=force)), SCENE)
    assert finding.outcome is Outcome.FAIL


def test_no_force_at_a_corner_decides_nothing():
    base = over_the_tip()
    nothing = changed(base, force=np.zeros_like(base.force), ihip=base.hip)
    assert CHECKS["broken-contact"](Runs(nothing), SCENE).outcome is Outcome.INCONCLUSIVE
    assert CHECKS["abrupt-switch"](Runs(nothing), SCENE).outcome is Outcome.INCONCLUSIVE
