"""The closed loop of Figure 6.17 as compiled code: sensing, inner loop, motors and motion, tick by tick.

A tick is `sense`, the renderer's answer, `act`. `run` is all ticks, with the renderer's compiled law; a renderer in
Python is asked between the other two, and the numbers are the same. Imperfections that are off are None, and their
branches are then gone from the compiled code.

What a run keeps lies in `out` (PLANES, ticks, N), one plane a channel. The other arguments, throughout:

- `kinematics`, `dynamics`, `margin`, `parameters`: the device, see `hapticeval.devices.device`;
- `settings` (4,): which inner loop, mass of the virtual tool (kg), dt (s), and how far a joint may go from where it
  started (rad, m);
- `exact` (1,): the mass (kg) of a point mass that moves by its exact integral;
- `push` (ticks + 1, N): the operator's prescribed force at the samples; `path` (ticks + 1, N) and `grip` (2,): where
  the hand draws to at the samples, and its stiffness and damping;
- `sensing` (2,): encoder step (0: exact), blend of the velocity filter (0: exact);
- `actuation` (3,): torque limit, whole ticks and seconds of delay;
- `friction` (N,): of each joint;
- `noise` (ticks, N) and `feeling` (2,): the force sensor's noise at each sample, its step (0: none) and blend (1:
  none).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from hapticeval.compiled import LawData, compiled
from hapticeval.devices.dynamics_kernels import JACOBIAN, torque
from hapticeval.devices.integration_kernels import advance, fall_free
from hapticeval.types import Array

(
    HIP, IHIP, FORCE, SPEED, OPERATOR, MEASURED_HIP, MEASURED_SPEED, MEASURED_FORCE, JOINT, RATE, TORQUE, COMMAND,
    PLANES,
) = range(13)  # fmt: skip

JOINTS, RATES, SEEN, SEEN_RATES, FELT, DRIFT, ROW_A, ROW_B, ROW_C, ROW_D, START, ROWS = range(12)
"""Rows of `state` (ROWS, N): true joints and rates, those that the controller believes in, filtered force; scratch;
joints at the start."""

LOOP, TOOL, DT, REACH = range(4)

DONE, OUTSIDE, RAN_AWAY, NOT_FINITE, REFUSED = range(5)
"""How a run ends; REFUSED and above is REFUSED - 1 plus the law's own number."""


@compiled
def rounded(value: float, quantum: float) -> float:
    """The multiple of `quantum` nearest to `value`."""
    return quantum * float(np.rint(value / quantum))


@compiled
def sense(
    tick: int,
    kinematics: Callable[..., Any],
    margin: Callable[..., Any],
    parameters: Array,
    settings: Array,
    push: Array | None,
    path: Array | None,
    grip: Array | None,
    sensing: Array | None,
    noise: Array | None,
    feeling: Array | None,
    state: Array,
    squares: Array,
    out: Array,
) -> int:
    """Write what is and what the sensors say at the sample `tick`; OUTSIDE where the device is not defined."""
    joints, rates, seen, seen_rates, felt = state[JOINTS], state[RATES], state[SEEN], state[SEEN_RATES], state[FELT]
    size, jacobian = joints.shape[0], squares[JACOBIAN]
    if not margin(parameters, joints) > 0.0:
        return OUTSIDE
    hip, speed = out[HIP, tick], out[SPEED, tick]
    kinematics(parameters, joints, rates, hip, speed, jacobian, state[DRIFT])
    for i in range(size):
        out[JOINT, tick, i], out[RATE, tick, i] = joints[i], rates[i]
    if feeling is not None and noise is not None:
        for i in range(size):
            force = 0.0
            if push is not None:
                force += push[tick, i]
            if path is not None and grip is not None:
                pace = (path[tick + 1, i] - path[tick, i]) / settings[DT]
                force += grip[0] * (path[tick, i] - hip[i]) + grip[1] * (pace - speed[i])
            felt[i] = force if tick == 0 else felt[i] + feeling[1] * (force - felt[i])
            force = felt[i] + noise[tick, i]
            out[MEASURED_FORCE, tick, i] = rounded(force, feeling[0]) if feeling[0] > 0.0 else force
    if sensing is None:
        for i in range(size):
            seen[i], seen_rates[i] = joints[i], rates[i]
            out[MEASURED_HIP, tick, i], out[MEASURED_SPEED, tick, i] = hip[i], speed[i]
        return DONE
    for i in range(size):
        now = rounded(joints[i], sensing[0]) if sensing[0] > 0.0 else joints[i]
        if sensing[1] == 0.0 or tick == 0:
            seen_rates[i] = rates[i]
        else:
            seen_rates[i] += sensing[1] * ((now - seen[i]) / settings[DT] - seen_rates[i])
        seen[i] = now
    kinematics(parameters, seen, seen_rates, out[MEASURED_HIP, tick], out[MEASURED_SPEED, tick], jacobian, state[DRIFT])
    return DONE


@compiled
def act(
    tick: int,
    kinematics: Callable[..., Any],
    dynamics: Callable[..., Any],
    parameters: Array,
    settings: Array,
    exact: Array | None,
    push: Array | None,
    path: Array | None,
    grip: Array | None,
    actuation: Array | None,
    friction: Array | None,
    feeling: Array | None,
    table: Array,
    control: Array,
    pace: Array,
    state: Array,
    squares: Array,
    rows: Array,
    stages: Array,
    out: Array,
) -> int:
    """From the renderer's force in out[FORCE, tick] to the device's state at the next sample."""
    joints, rates = state[JOINTS], state[RATES]
    size, dt, command = joints.shape[0], settings[DT], out[COMMAND, tick]
    if feeling is None:
        torque(
            int(settings[LOOP]), settings[TOOL], dynamics, parameters, state[SEEN], state[SEEN_RATES],
            squares[JACOBIAN], state[DRIFT], out[FORCE, tick], None, squares[1:], state[ROW_A:], command,
        )  # fmt: skip
    else:
        torque(
            int(settings[LOOP]), settings[TOOL], dynamics, parameters, state[SEEN], state[SEEN_RATES],
            squares[JACOBIAN], state[DRIFT], out[FORCE, tick], out[MEASURED_FORCE, tick], squares[1:], state[ROW_A:],
            command,
        )  # fmt: skip
    held, before, switch = out[TORQUE, tick], state[ROW_C], 0.0
    for i in range(size):
        held[i] = command[i]
    if actuation is not None:
        whole, switch = int(actuation[1]), actuation[2]
        for i in range(size):
            command[i] = min(max(command[i], -actuation[0]), actuation[0])
            held[i] = out[COMMAND, tick - whole, i] if tick >= whole else 0.0
            before[i] = out[COMMAND, tick - whole - 1, i] if tick > whole else 0.0
    if path is not None:
        for i in range(size):
            state[ROW_D, i] = 0.0
    for part in range(2):
        if part == 0 and switch == 0.0:
            continue
        begin, end = (0.0, switch) if part == 0 else (switch, dt)
        force = before if part == 0 else held
        if exact is not None:
            for i in range(size):
                state[ROW_A, i], state[ROW_B, i] = 0.0, 0.0
                if push is not None:
                    slope = (push[tick + 1, i] - push[tick, i]) / dt
                    state[ROW_A, i] = push[tick, i] + begin * slope if begin > 0.0 else push[tick, i]
                    state[ROW_B, i] = push[tick, i] + end * slope if end < dt else push[tick + 1, i]
            fall_free(exact[0], joints, rates, force, state[ROW_A], state[ROW_B], end - begin)
        else:
            if path is not None:
                kinematics(parameters, joints, rates, state[ROW_A], state[ROW_B], squares[JACOBIAN], state[DRIFT])
                for i in range(size):
                    state[ROW_D, i] += 0.5 * (end - begin) * (state[ROW_A, i] + (end - begin) / 6.0 * state[ROW_B, i])
            steps = advance(
                kinematics, dynamics, parameters, joints, rates, begin, end, dt, force,
                None if push is None else push[tick:], None if path is None else path[tick:], grip, friction, table,
                control, pace, rows, squares, stages,
            )  # fmt: skip
            if steps == 0:
                return RAN_AWAY
            if path is not None:
                kinematics(parameters, joints, rates, state[ROW_A], state[ROW_B], squares[JACOBIAN], state[DRIFT])
                for i in range(size):
                    state[ROW_D, i] += 0.5 * (end - begin) * (state[ROW_A, i] - (end - begin) / 6.0 * state[ROW_B, i])
    for i in range(size):
        if switch > 0.0:
            held[i] = (switch * before[i] + (dt - switch) * held[i]) / dt
        mean = 0.0
        if push is not None:
            mean = 0.5 * (push[tick, i] + push[tick + 1, i])
        if path is not None and grip is not None:
            # Hermite's rule gives the mean position from its values and rates at the ends.
            mean += grip[0] * (0.5 * (path[tick, i] + path[tick + 1, i]) - state[ROW_D, i] / dt)
            mean += grip[1] * (path[tick + 1, i] - path[tick, i] - (state[ROW_A, i] - out[HIP, tick, i])) / dt
        out[OPERATOR, tick, i] = mean
    for i in range(size):
        if not abs(joints[i] - state[START, i]) < settings[REACH]:
            return RAN_AWAY
    return DONE


@compiled
def run(
    law: Callable[..., Any],
    data: LawData,
    kinematics: Callable[..., Any],
    dynamics: Callable[..., Any],
    margin: Callable[..., Any],
    parameters: Array,
    settings: Array,
    exact: Array | None,
    push: Array | None,
    path: Array | None,
    grip: Array | None,
    sensing: Array | None,
    actuation: Array | None,
    friction: Array | None,
    noise: Array | None,
    feeling: Array | None,
    table: Array,
    control: Array,
    pace: Array,
    state: Array,
    squares: Array,
    rows: Array,
    stages: Array,
    out: Array,
) -> tuple[int, int]:
    """All ticks with a compiled law: the tick that the run ended at, and how."""
    count, size = out.shape[1], out.shape[2]
    for tick in range(count):
        status = sense(
            tick, kinematics, margin, parameters, settings, push, path, grip, sensing, noise, feeling, state, squares,
            out,
        )  # fmt: skip
        if status != DONE:
            return tick, status
        number = law(
            data, out[MEASURED_HIP, tick], out[MEASURED_SPEED, tick], out[MEASURED_FORCE, tick], settings[DT],
            out[IHIP, tick], out[FORCE, tick],
        )  # fmt: skip
        if number != 0:
            return tick, REFUSED - 1 + number
        for i in range(size):
            if not math.isfinite(out[IHIP, tick, i]) or not math.isfinite(out[FORCE, tick, i]):
                return tick, NOT_FINITE
        status = act(
            tick, kinematics, dynamics, parameters, settings, exact, push, path, grip, actuation, friction, feeling,
            table, control, pace, state, squares, rows, stages, out,
        )  # fmt: skip
        if status != DONE:
            return tick, status
    return count, DONE
