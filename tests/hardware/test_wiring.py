"""What a robot's raw numbers mean, there and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.devices.catalogue import make_device
from hapticeval.devices.parallelogram import MOTOR_TORQUE
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.hardware.wiring import Wiring, read_wiring

OFFSETS = st.floats(-1e6, 1e6).map(round).map(float)


@st.composite
def wirings(draw, counts=True):
    dimension = draw(st.sampled_from((2, 3)))
    each = {"min_size": dimension, "max_size": dimension}
    return Wiring(
        device=make_device(f"parallelogram-{dimension}dof"),
        counts_per_turn=draw(st.sampled_from((4096.0, 262_144.0, 1e7))) if counts else None,
        offsets=tuple(draw(st.lists(OFFSETS if counts else st.floats(-3.0, 3.0), **each))),
        directions=tuple(draw(st.lists(st.sampled_from((1, -1)), **each))),
        torque_per_command=draw(st.floats(1e-3, 1e3)),
        torque_limit=draw(st.floats(0.1, 10.0)),
    )


@given(wirings(), wirings(counts=False), st.data())
def test_counts_angles_and_torques_come_back(wiring, plain, data):
    def drawn(each, limit):
        size = each.device.dimension
        return np.array(data.draw(st.lists(st.floats(-limit, limit), min_size=size, max_size=size)))

    joints = drawn(wiring, math.pi)
    raw = wiring.raw(joints)
    assert np.array_equal(raw, np.rint(raw))
    # An offset of 1e6 counts costs 1e6 * 2^-52 counts of rounding beside the half count of the encoder.
    np.testing.assert_allclose(wiring.joints(raw), joints, rtol=0.0, atol=(0.5 + 1e-9) * wiring.step)
    np.testing.assert_array_equal(wiring.raw(wiring.joints(raw)), raw)
    joints, torques = drawn(plain, math.pi), drawn(wiring, 10.0)
    np.testing.assert_allclose(plain.joints(plain.raw(joints)), joints, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(wiring.torques(wiring.commands(torques)), torques, rtol=1e-15, atol=1e-300)


@given(wirings(), st.booleans())
def test_a_description_makes_the_same_wiring(wiring, counted):
    if not counted:
        wiring = Wiring(device=wiring.device, offsets=wiring.offsets)
    assert Wiring.described(wiring.description()) == wiring


def test_a_direction_turns_encoder_and_motor_alike():
    straight, turned = (
        Wiring(device=make_device("parallelogram-2dof"), counts_per_turn=1000, directions=(1, sign)) for sign in (1, -1)
    )
    raw, command = np.array([10.0, 20.0]), np.array([1.0, 2.0])
    np.testing.assert_array_equal(turned.joints(raw), straight.joints(raw) * [1, -1])
    np.testing.assert_array_equal(turned.torques(command), [1.0, -2.0])


def test_limits_are_those_of_the_print_unless_a_user_states_others():
    robot, mass = ({"kind": "parallelogram-3dof"}, {"kind": "point-mass", "mass": 0.1, "force_limit": 4.0})
    assert Wiring.described(robot).torque_limit == (MOTOR_TORQUE,) * 3
    assert Wiring.described({**robot, "torque_limit": 1.5}).torque_limit == (1.5,) * 3
    assert Wiring.described({**robot, "torque_limit": [1.5, 1.0, 2.0]}).torque_limit == (1.5, 1.0, 2.0)
    assert Wiring.described(mass).torque_limit == (4.0, 4.0)


def test_parameters_of_the_device_are_overridden():
    wiring = Wiring.described({"kind": "parallelogram-2dof", "l1": 0.31, "counts_per_turn": 4096})
    assert (wiring.device.constants.l1, wiring.device.constants.l4, wiring.counts_per_turn) == (0.31, 0.346, 4096)


@pytest.mark.parametrize(
    ("table", "error"),
    [
        ({"offsets": [0, 0]}, InputError),
        ({"kind": "parallelogramm"}, UnknownNameError),
        ({"kind": "parallelogram-2dof", "l7": 0.3}, UnknownNameError),
        ({"kind": "parallelogram-2dof", "offsets": [0, 0, 0]}, InputError),
        ({"kind": "parallelogram-2dof", "offsets": [0, math.nan]}, InputError),
        ({"kind": "parallelogram-2dof", "directions": [1, 0]}, InputError),
        ({"kind": "parallelogram-2dof", "counts_per_turn": 0}, InputError),
        ({"kind": "parallelogram-2dof", "counts_per_turn": "many"}, InputError),
        ({"kind": "parallelogram-2dof", "torque_per_command": -1.0}, InputError),
        ({"kind": "parallelogram-2dof", "torque_limit": [0.3, 0.0]}, InputError),
        ({"kind": "parallelogram-2dof", "torque_limit": [0.3]}, InputError),
        ({"kind": "parallelogram-2dof", "force_limit": 0}, InputError),
        ({"kind": "parallelogram-2dof", "soft_start": -0.1}, InputError),
        ({"kind": "parallelogram-2dof", "speed_limit": math.inf}, InputError),
        ({"kind": "parallelogram-2dof", "silent_cycles": 3}, InputError),
    ],
)
def test_a_table_that_does_not_fit_says_so(refused, table, error):
    with refused(error):
        Wiring.described(table)


@pytest.mark.parametrize(
    "text",
    [
        "[device",
        "[motor]\nkind = 1",
        '[device]\nkind = "point-mass"',
    ],
)
def test_a_file_that_is_no_wiring_is_named(refused, tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with refused(InputError):
        read_wiring(path)


def test_a_file_that_is_not_there_is_named(refused, tmp_path):
    with refused(InputError):
        read_wiring(tmp_path / "rig.toml")
