"""What is sent to the motors: within the limits, in the same direction, from zero on, never of a doubtful reading."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from robots import DT, recorded, scene_of, twin_of, wired

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.hardware.safety import Limiter, Watchdog, WatchdogError
from hapticeval.hardware.wiring import FORCE_LIMIT, SPEED_LIMIT, Kinematics
from hapticeval.recordings.integrity.consistency import TORQUE_RELATION, inverse_checks

JOINTS = {2: np.array([0.3, -0.2]), 3: np.array([0.1, 0.3, -0.2])}
OWN = {"torque_limit": (), "force_limit": FORCE_LIMIT}
"""The limits that a wiring has where a user states none."""


def limited(wiring, force, *, inner=InnerLoop.STATIC, resumed=False, refusing=False):
    """What one cycle sends at `JOINTS`, and the limiter."""
    limiter, joints = Limiter(wiring, DT, refusing=refusing), JOINTS[wiring.device.dimension]

    def torque_of(asked):
        return inner.torque(wiring.device, joints, np.full(joints.size, 0.4), asked, mass=0.1)

    return limiter.limit(force, torque_of, resumed=resumed), limiter


FORCES = st.floats(-1e4, 1e4).map(lambda force: round(force, 6))


@st.composite
def limits(draw):
    dimension = draw(st.sampled_from((2, 3)))
    motors = tuple(draw(st.lists(st.floats(0.05, 5.0), min_size=dimension, max_size=dimension)))
    return wired(dimension, torque_limit=motors, force_limit=draw(st.floats(0.5, 50.0)))


@given(limits(), st.data())
def test_what_is_sent_is_within_the_limits_and_keeps_its_direction(wiring, data):
    size = wiring.device.dimension
    force = np.array(data.draw(st.lists(FORCES, min_size=size, max_size=size)))
    sent, limiter = limited(wiring, force)
    assert np.all(np.abs(sent.torque) <= np.array(wiring.torque_limit) * (1.0 + 1e-12))
    assert np.linalg.norm(sent.force) <= wiring.force_limit * (1.0 + 1e-12)
    # The static relation (2.8) holds for what is sent, and for what was commanded.
    jacobian = wiring.device.jacobian(JOINTS[size])
    scale = np.abs(force).max()
    np.testing.assert_allclose(sent.torque, jacobian.T @ sent.force, rtol=1e-9, atol=1e-12 * scale)
    np.testing.assert_allclose(sent.commanded, jacobian.T @ force, rtol=1e-9, atol=1e-12 * scale)
    # Scaled by one number from 0 to 1, which is 1 where no limit is passed.
    share = float(sent.force @ force) / float(force @ force) if np.any(force) else 1.0
    np.testing.assert_allclose(sent.force, share * force, rtol=1e-9, atol=1e-12 * scale)
    within = np.linalg.norm(force) <= wiring.force_limit and np.all(np.abs(sent.commanded) <= wiring.torque_limit)
    assert limiter.scaled == (not within)
    assert share == 1.0 if within else 0.0 < share < 1.0
    # No smaller than it must be: one of the limits is reached.
    reached = max(
        np.linalg.norm(sent.force) / wiring.force_limit, np.max(np.abs(sent.torque) / np.array(wiring.torque_limit))
    )
    assert within or reached == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("inner", list(InnerLoop))
def test_no_inner_loop_passes_the_limits_of_the_motors(inner):
    wiring = wired(2, torque_limit=0.01)
    sent, _ = limited(wiring, np.array([3.0, -4.0]), inner=inner)
    assert np.max(np.abs(sent.torque)) == pytest.approx(0.01)


def test_a_run_that_begins_in_contact_begins_with_no_force(tmp_path):
    """And its force grows evenly, over the time that is stated: the hand is inside the model from the first cycle."""
    wiring = wired(2, soft_start=0.2)
    hardware = twin_of(wiring)
    hardware.joints[:] = wiring.device.joints(np.array([0.095, 0.0]))
    done, run = recorded(tmp_path, hardware, wiring, cycles=400)
    force, sent = np.linalg.norm(run.force, axis=1), np.linalg.norm(run.channels["sent_force"], axis=1)
    assert force[0] > 1.0
    growing = np.clip(np.arange(400) * DT / 0.2, 0.0, 1.0)
    np.testing.assert_allclose(sent, growing * force, rtol=1e-12)
    np.testing.assert_allclose(
        run.channels["joint_torque"], growing[:, None] * run.channels["commanded_torque"], rtol=1e-12
    )
    assert any("soft start scaled the force in 200 cycles" in note for note in done.notes)


def test_a_run_that_begins_outside_is_felt_at_once(tmp_path):
    done, run = recorded(tmp_path, twin_of(wired(soft_start=0.5)), wired(soft_start=0.5), cycles=300)
    assert not np.any(run.force[0])
    np.testing.assert_array_equal(run.channels["sent_force"], run.force)
    assert np.any(run.force)
    assert done.notes == ()


@pytest.mark.parametrize(("pause", "grows"), [(9, False), (40, True)])
def test_after_many_missed_cycles_the_force_grows_anew(tmp_path, pause, grows):
    class Pausing:
        def __init__(self):
            self.twin, self.count = twin_of(wired()), 0

        def read(self):
            self.count += 1
            for _ in range(pause if self.count == 250 else 0):
                self.twin.read()
            return self.twin.read()

        def write(self, command):
            self.twin.write(command)

        def close(self):
            pass

    done, run = recorded(tmp_path, Pausing(), wired(soft_start=0.05), cycles=400)
    assert done.missed == pause
    assert np.any(run.force[249])
    np.testing.assert_array_equal(np.any(run.channels["sent_force"][249]), not grows)
    np.testing.assert_array_equal(run.channels["sent_force"][310:], run.force[310:])


def test_the_relation_of_torque_and_force_is_asked_of_what_was_sent(tmp_path):
    """With the motors that the print has, at a stiffness that asks for more: the twin's saturation takes nothing."""
    wiring = wired(2, **OWN)
    scene = scene_of(wiring, stiffness=2000.0)
    done, run = recorded(tmp_path, twin_of(wiring), wiring, cycles=600, scene=scene)
    sent, commanded = run.channels["joint_torque"], run.channels["commanded_torque"]
    assert np.max(np.abs(commanded)) > 2.0 * wiring.torque_limit[0]
    assert np.max(np.abs(sent)) <= wiring.torque_limit[0]
    scaled = np.any(np.abs(commanded) > wiring.torque_limit[0], axis=1)
    assert f"limits scaled the force in {np.count_nonzero(scaled)} cycles" in done.notes[0]
    relation = next(test for test in inverse_checks(run, device=wiring.device) if test.name == TORQUE_RELATION)
    assert relation.made
    assert not relation.issues
    # Of the force that was asked for it does not hold.
    channels = {name: values for name, values in run.channels.items() if name != "sent_force"}
    asked = type(run)(run.time, channels, run.meta, signals={"raw": run.signals["raw"]})
    relation = next(test for test in inverse_checks(asked, device=wiring.device) if test.name == TORQUE_RELATION)
    assert relation.issues


@pytest.mark.parametrize(
    ("limit", "force"),
    [({"force_limit": 4.9}, [3.0, -4.0]), ({"torque_limit": 0.5}, [3.0, -4.0])],
    ids=["hand", "motor"],
)
def test_what_is_above_a_limit_is_refused_where_that_is_asked_for(refused, limit, force):
    with refused(WatchdogError):
        limited(wired(2, **limit), np.array(force), refusing=True)
    limited(wired(2), np.array(force), refusing=True)


def test_a_torque_that_is_no_number_is_not_sent(refused):
    with refused(WatchdogError):
        Limiter(wired(), DT).limit(np.ones(2), lambda force: force * math.nan, resumed=False)


@pytest.mark.parametrize("counts", [None, 400.0])
def test_a_hand_may_be_as_fast_as_stated_and_a_count_besides(counts):
    wiring = wired() if counts is None else type(wired())(device=wired().device, counts_per_turn=counts)
    kinematics = Kinematics(wiring.device)
    kinematics.hand(np.zeros(2), np.zeros(2))
    granted = SPEED_LIMIT * DT + wiring.step * kinematics.reach()

    def step(length):
        watchdog = Watchdog(wiring, kinematics)
        watchdog.check_hand(np.zeros(2), DT)
        watchdog.check_hand(np.array([0.0, length]), DT)

    step(0.999 * granted)
    with pytest.raises(WatchdogError, match="jumped"):
        step(1.001 * granted)
    with pytest.raises(WatchdogError, match="jumped"):
        step(math.nan)


@pytest.mark.parametrize(("force", "grows"), [(0.099, False), (0.101, True)])
def test_a_force_that_no_hand_feels_is_none_to_begin_with(force, grows):
    sent, limiter = limited(wired(2, soft_start=0.5), np.array([force, 0.0]), resumed=True)
    assert limiter.started == grows
    assert np.any(sent.torque) != grows
