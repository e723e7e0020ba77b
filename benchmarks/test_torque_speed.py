"""The joint torque of set stabilisation on the Cassinian with the 2-DOF robot, against what sympy writes for it.

sympy derives (7.11) from the definitions and writes it by `lambdify` with common subexpressions. It is given the foot
on the curve, which has no closed form; the package finds that too. Both give the same numbers.

The yardstick is sympy's function compiled by numba, in a loop as compiled closed loops run the package's: alike in
kind, so that their ratio hardly depends on the machine. It was measured as 3.5, of which the projection is the most;
twice that is allowed. `extra_info` also has the ratios to sympy's function in plain Python floats.
"""

import sys
import time
from pathlib import Path

import numba
import numpy as np
import pytest

from hapticeval.compiled import compiled
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.motion_kernels import solve
from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.geometry.catalogue import cassinian
from hapticeval.geometry.curve_kernels import project
from hapticeval.records import as_record
from hapticeval.renderers import set_stabilisation
from hapticeval.renderers.stabilisation_laws import SET_GAINS, on_curve
from hapticeval.scene import Scene

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "renderers"))
from torque_by_sympy import GAIN_D, GAIN_P, on_the_cassinian

ALLOWED = 7.0
TOOL = 0.1
COUNT = 2000
ROBOT = Parallelogram2().parameters.size
kinematics2, dynamics2, _ = Parallelogram2().kernels


@compiled
def torque_of(state, out, room, data):
    """The torque (6.7) at a state (4,), into `out` (2,); `room` has the numbers of robot and law, and room to work in.

    As the inner loop's own kernel, which is given the robot's dynamics: a call from Python would be slow for that.
    """
    joints, rates, parameters, gains = state[:2], state[2:], room[:ROBOT], as_record(data.params, SET_GAINS)
    rows, squares = room[ROBOT : ROBOT + 18].reshape((9, 2)), room[ROBOT + 18 :].reshape((2, 2, 2))
    hip, velocity, drift, ihip, force, push = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    goal, bias, jacobian, inertia = rows[7], rows[8], squares[0], squares[1]
    kinematics2(parameters, joints, rates, hip, velocity, jacobian, drift)
    refusal = on_curve(data, hip, velocity, push, 1e-3, ihip, force)
    dynamics2(parameters, joints, rates, inertia, bias)
    for i in range(2):
        goal[i] = force[i] / gains.mass - drift[i]
    solve(jacobian, goal)
    for i in range(2):
        out[i] = inertia[i, 0] * goal[0] + inertia[i, 1] * goal[1] + bias[i]
    return refusal


@compiled
def torques_of(states, outs, room, data):
    """The torque at each of states (n, 4), as a compiled closed loop asks for them."""
    for i in range(states.shape[0]):
        torque_of(states[i], outs[i], room, data)


@pytest.fixture(scope="module")
def case():
    scene = Scene(
        model=cassinian(), stiffness=GAIN_P * TOOL, damping=GAIN_D * TOOL, mass=TOOL, bilateral=True,
        device=Parallelogram2(), inner_loop=InnerLoop.LINEARISED,
    )  # fmt: skip
    curve, robot, law = scene.model.curve, scene.robot, set_stabilisation(scene).law
    rng = np.random.default_rng(7)
    u = rng.uniform(0.0, 2.0 * np.pi, COUNT)
    points = curve.position(u) + rng.uniform(-0.01, 0.01, COUNT)[:, None] * curve.normal(u)
    states = np.column_stack([[robot.joints(point) for point in points], rng.normal(size=(COUNT, 2))])
    rooms = (np.concatenate([robot.parameters, np.zeros(26)]), law.data)
    hips = [robot.position(state[:2]).tolist() for state in states]
    return states, hips, curve.nearest(hips), rooms


def best(*runs, rounds=15):
    """The shortest of some rounds of each, s, in turns: what the machine's other work disturbs least."""
    times = np.empty((rounds, len(runs)))
    for i in range(rounds):
        for j, run in enumerate(runs):
            start = time.perf_counter()
            run()
            times[i, j] = time.perf_counter() - start
    return times.min(axis=0)


def test_set_stabilisation_on_the_cassinian(benchmark, case):
    benchmark.group = "torque of set stabilisation, Cassinian, 2-DOF robot"
    states, hips, feet, rooms = case
    outs, expected, one = np.empty((COUNT, 2)), np.empty((COUNT, 2)), np.empty(2)
    rows, points = [tuple(row) for row in np.column_stack([states, feet]).tolist()], list(states)
    pieces, samples = rooms[1].pieces, rooms[1].lookup
    sympy = on_the_cassinian()
    formula = numba.njit(sympy)

    @numba.njit
    def formulas(states, feet, outs):
        for i in range(states.shape[0]):
            outs[i, 0], outs[i, 1] = formula(states[i, 0], states[i, 1], states[i, 2], states[i, 3], feet[i])

    def by_sympy():
        return [sympy(*row) for row in rows]

    def by_sympy_that_projects():
        return [sympy(*row[:4], project(pieces, samples, x, y)[0]) for row, (x, y) in zip(rows, hips, strict=True)]

    def by_compiled_sympy():
        formulas(states, feet, expected)

    def by_call():
        for state in points:
            torque_of(state, one, *rooms)

    def in_a_loop():
        torques_of(states, outs, *rooms)

    in_a_loop()
    by_compiled_sympy()
    for torques in (by_sympy(), expected):
        np.testing.assert_allclose(outs, torques, rtol=1e-9, atol=1e-9 * np.abs(outs).max())
    by_call()
    plain, yardstick, projecting, called, looped = best(
        by_sympy, by_compiled_sympy, by_sympy_that_projects, by_call, in_a_loop
    )
    benchmark.extra_info["microseconds: sympy, sympy compiled, called, in a loop"] = [
        round(seconds / COUNT * 1e6, 3) for seconds in (plain, yardstick, called, looped)
    ]
    benchmark.extra_info["times sympy compiled"] = looped / yardstick
    benchmark.extra_info["times faster than sympy, in a loop"] = plain / looped
    benchmark.extra_info["times faster than sympy, called"] = plain / called
    benchmark.extra_info["times faster than sympy with the projection, called"] = projecting / called
    benchmark.pedantic(in_a_loop, rounds=10, warmup_rounds=1)
    assert benchmark.disabled or looped < ALLOWED * yardstick
