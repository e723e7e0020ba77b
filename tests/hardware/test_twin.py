"""The simulated robot against the closed loop that it was taken from."""

from __future__ import annotations

import numpy as np
import pytest
from robots import DT, REAL, RENDERER, hand_of, recorded, scene_of, twin_of, wired

from hapticeval.devices.parallelogram import ENCODER_STEP
from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import read_effects
from hapticeval.errors import HapticevalError
from hapticeval.hardware.twin import Twin, demonstration
from hapticeval.hardware.wiring import VELOCITY_CUTOFF
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment

CYCLES = 600


@pytest.mark.parametrize(
    ("dimension", "effects"),
    [(3, REAL), (2, {**REAL, "delay": DT}), (3, {**REAL, "delay": 2.3e-3, "torque_limit": 0.3})],
    ids=["real", "a tick late", "weak and late"],
)
def test_it_is_the_closed_loop(tmp_path, dimension, effects):
    wiring = wired(dimension)
    seen = read_effects(
        {"imperfections": {"encoder_step": ENCODER_STEP, "velocity_cutoff": VELOCITY_CUTOFF, **effects}}
    )[1]
    scene = scene_of(wiring, effects=seen)
    hand, still = hand_of(dimension), np.zeros(dimension)
    experiment = Experiment((CYCLES - 1) * DT, hand.path.points[0], still, np.zeros(1), still[None], hand)
    loop = simulate_closed_loop(resolve(RENDERER)(scene), experiment, scene, DT)
    _, run = recorded(tmp_path, twin_of(wiring, effects=effects), wiring, cycles=CYCLES, scene=scene)
    assert len(run) == len(loop) == CYCLES
    assert np.any(run.force != 0.0)
    for ours, theirs in (("hip", "measured_hip"), ("velocity", "measured_velocity"), ("ihip",) * 2, ("force",) * 2):
        np.testing.assert_array_equal(run.channels[ours], loop.channels[theirs], err_msg=ours)


def test_turned_and_shifted_joints_make_no_difference(tmp_path):
    straight, turned = wired(), wired(offsets=(1210.0, -340.0), directions=(1, -1), torque_per_command=0.35)
    runs = [
        recorded(tmp_path, twin_of(each), each, cycles=300, name=name)[1]
        for name, each in (("straight", straight), ("turned", turned))
    ]
    # Half a count is rounded to the even one, and so to the other side in turned counts: a count apart here and there.
    np.testing.assert_allclose(runs[1].hip, runs[0].hip, rtol=0.0, atol=0.3 * 2.0 * ENCODER_STEP)
    assert not np.array_equal(runs[1].channels["raw"], runs[0].channels["raw"])


def test_it_says_that_it_hit_a_joint_limit(refused):
    wiring = wired()
    twin = Twin(wiring, (), position=np.array([0.1, 0.0]), hand=None, dt=DT)

    def pushed():
        for _ in range(3000):
            twin.read()
            twin.write(np.array([1.0, -1.0]))

    with refused(HapticevalError):
        pushed()


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_demonstration_touches_the_model(tmp_path, dimension):
    wiring = wired(dimension)
    scene = scene_of(wiring)
    _, run = recorded(tmp_path, demonstration(wiring, scene), wiring, cycles=500, scene=scene)
    assert np.mean(run.contact) > 0.5
    assert np.ptp(run.hip, axis=0).max() > 0.01
