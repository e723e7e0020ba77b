"""The closed loop of Figure 6.17 as compiled code: sensing, inner loop, motors and motion, tick by tick.

A tick is `sense`, the renderer's answer, `act`. `run` is all ticks, with the renderer's compiled law; a renderer in
Python is asked between the other two, and the numbers are the same.

What a scene does not call for is None in `Loop`. Each such field has a kernel of its own that tests its argument for
None: numba then leaves the rest of it out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from hapticeval.compiled import FirstClass, borrowing, compiled_on_demand, first_class, inner
from hapticeval.devices.inner_loop_kernels import Inner, torque
from hapticeval.devices.motion_kernels import DRIFT, JACOBIAN, Grip, Motion, push_at
from hapticeval.laws import EFFECT
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.effects.effect import Part

DONE, OUTSIDE, RAN_AWAY, NOT_FINITE, LEFT_DOMAIN, BROKE = range(6)
"""How a run ends: LEFT_DOMAIN where the law is not defined at the hand, which its number above 0 tells, and BROKE where
the law returned a number below 0."""


class Attached(NamedTuple):
    """An effect in a loop: its `Part`, with the function as compiled code."""

    function: FirstClass
    params: Array
    samples: Array
    state: Array


Hook: TypeAlias = "tuple[Attached, ...]"
"""The effects of one stage of a tick, in order."""


class LoopState(NamedTuple):
    """What a tick leaves to the next, (N,) each: the joints are in rad or m, their rates per s.

    - `joints` and `rates` are the true ones, `measured_joints` and `measured_rates` those that the controller is given;
    - `previous_torque` (N m, N) is what the motors gave before;
    - `place` (m) and `place_rate` (m/s) are the tool's at the end of a part of a tick, `position_integral` (m s) is the
      integral of its place over the tick;
    - `start`: the joints at the start of the run.
    """

    joints: Array
    rates: Array
    measured_joints: Array
    measured_rates: Array
    previous_torque: Array
    place: Array
    place_rate: Array
    position_integral: Array
    start: Array


class LoopChannels(NamedTuple):
    """All that a run keeps, (ticks, N) each, in m, s, N and rad, by the names of a recording's channels.

    `operator_force` is the mean over the tick that follows, and so is `joint_torque` where a delay changes it within.
    `contact` has its first column only.
    """

    hip: Array
    ihip: Array
    force: Array
    velocity: Array
    operator_force: Array
    measured_hip: Array
    measured_velocity: Array
    measured_force: Array
    joint_position: Array
    joint_velocity: Array
    joint_torque: Array
    contact: Array


class Loop(NamedTuple):
    """A closed loop, ready to run.

    The device moves by `advance`, see `motion_kernels.advance_of`. `reach` (rad, m) is how far a joint may go from
    where it started. `state` is what a tick leaves to the next, and `out` all that a run keeps. `reported` is the
    `contact` of a `CompiledStep`.
    """

    motion: Motion
    servo: Inner
    sensors: Hook | None
    feeling: Hook | None
    motors: Hook | None
    advance: FirstClass
    reach: float
    state: LoopState
    out: LoopChannels
    reported: Array | None = None


def hook_of(parts: Iterable[Part]) -> Hook | None:
    """Return the effects of a stage as kernels take them, each compiled at its first use; None for no effects."""
    attached = tuple(
        Attached(first_class(compiled_on_demand(function), EFFECT), *arrays)
        for function, *arrays in parts
        if function is not None
    )
    return attached or None


@borrowing
def apply_effects(hook: Hook | None, tick: int, dt: float, first: Array, second: Array) -> float:
    """Let the effects of a stage change its vectors `first` and `second` (N,).

    They are joints and rates for the sensors (rad, rad/s), torques of this and the last tick for the motors (N m). What
    the hand is felt to push has one vector (N), which is both.

    Returns the last of the times (s) that they give, zero for no effects.
    """
    latest = 0.0
    if hook is None:
        return latest
    for k in range(len(hook)):  # all entries have one type, for their functions are values: numba may index the tuple
        effect = hook[k]
        latest = max(latest, effect.function(effect.params, effect.samples, effect.state, tick, dt, first, second))
    return latest


@inner
def grip_force(grip: Grip | None, tick: int, i: int, dt: float, hip: Array, velocity: Array) -> float:
    """Return the force with which the hand draws along axis `i`, N, at the sample: k (x_d - y) + b (ẋ_d - ẏ).

    `hip` (N,), m, and `velocity` (N,), m/s, are the device's.
    """
    if grip is None:
        return 0.0
    path_velocity = (grip.path[tick + 1, i] - grip.path[tick, i]) / dt
    return float(grip.gains[0] * (grip.path[tick, i] - hip[i]) + grip.gains[1] * (path_velocity - velocity[i]))


@inner
def measure_force(feeling: Hook | None, loop: Loop, tick: int) -> None:
    """Write what the force sensor gives at the sample, N: the hand's push and grip, through the sensor's effects."""
    if feeling is None:
        return
    load, force = loop.motion.load, loop.out.measured_force[tick]
    for i in range(force.shape[0]):
        # what is prescribed, and what the grip adds, before the sensor makes of it what it can
        force[i] = push_at(load.push, tick, i, 0.0, load.dt)
        force[i] += grip_force(load.grip, tick, i, load.dt, loop.out.hip[tick], loop.out.velocity[tick])
    apply_effects(feeling, tick, load.dt, force, force)


@inner
def measure_state(sensors: Hook | None, loop: Loop, tick: int) -> None:
    """Write what the controller is given of joints, rates, HIP and velocity at the sample, through the sensors."""
    state, out, motion = loop.state, loop.out, loop.motion
    seen_joints, seen_rates = state.measured_joints, state.measured_rates
    for i in range(seen_joints.shape[0]):
        seen_joints[i], seen_rates[i] = state.joints[i], state.rates[i]
        out.measured_hip[tick, i], out.measured_velocity[tick, i] = out.hip[tick, i], out.velocity[tick, i]
    if sensors is None:
        return
    apply_effects(sensors, tick, motion.load.dt, seen_joints, seen_rates)
    # HIP and velocity, J and J̇ q̇ anew, of the joints as they are measured
    motion.plant.kinematics(
        motion.plant.parameters, seen_joints, seen_rates, out.measured_hip[tick], out.measured_velocity[tick],
        motion.scratch.squares[JACOBIAN], motion.scratch.rows[DRIFT],
    )  # fmt: skip


@borrowing
def sense(loop: Loop, tick: int) -> int:
    """Begin a tick: write the device's true state and what the sensors give of it; return OUTSIDE or DONE.

    OUTSIDE is a device beyond its functional configuration space, where it is not defined.
    """
    state, out, plant, scratch = loop.state, loop.out, loop.motion.plant, loop.motion.scratch
    joints, rates = state.joints, state.rates
    if not plant.margin(plant.parameters, joints) > 0.0:  # beyond a limit, or not finite
        return OUTSIDE
    plant.kinematics(
        plant.parameters, joints, rates, out.hip[tick], out.velocity[tick], scratch.squares[JACOBIAN],
        scratch.rows[DRIFT],
    )  # fmt: skip
    for i in range(joints.shape[0]):
        out.joint_position[tick, i], out.joint_velocity[tick, i] = joints[i], rates[i]
    measure_force(loop.feeling, loop, tick)
    measure_state(loop.sensors, loop, tick)
    return DONE


@inner
def write_torques(feeling: Hook | None, loop: Loop, tick: int) -> None:
    """Write the torques that the inner loop makes of the renderer's force, and of the hand's where it is measured."""
    state, motion = loop.state, loop.motion
    seen_joints, seen_rates, force = state.measured_joints, state.measured_rates, loop.out.force[tick]
    torques = loop.out.joint_torque[tick]
    if feeling is None:
        torque(loop.servo, motion.plant, seen_joints, seen_rates, force, None, motion.scratch, torques)
    else:
        push = loop.out.measured_force[tick]
        torque(loop.servo, motion.plant, seen_joints, seen_rates, force, push, motion.scratch, torques)


@inner
def move_device(loop: Loop, tick: int, begin: float, end: float, torques: Array) -> bool:
    """Move the device from `begin` to `end` s into the tick under `torques` (N,), N m or N.

    Returns False where it has no finite state at the end.
    """
    joints, rates = loop.state.joints, loop.state.rates
    # with h = end - begin: h/2 (y_0 + h/6 ẏ_0) at the start, h/2 (y_1 - h/6 ẏ_1) at the end
    add_to_position_integral(loop.motion.load.grip, loop, 0.5 * (end - begin), (end - begin) / 6.0)
    if loop.advance(loop.motion, tick, begin, end, joints, rates, torques) == 0:
        return False
    add_to_position_integral(loop.motion.load.grip, loop, 0.5 * (end - begin), -(end - begin) / 6.0)
    return True


@inner
def add_to_position_integral(grip: Grip | None, loop: Loop, weight: float, lever: float) -> None:
    """Add this end's part to the integral of the position (m s) over the tick: Hermite's rule, from values and rates.

    `weight` and `lever` are in s. Only the grip's mean force needs that integral: without a grip it is left out.
    """
    if grip is None:
        return
    state, plant, scratch = loop.state, loop.motion.plant, loop.motion.scratch
    plant.kinematics(
        plant.parameters, state.joints, state.rates, state.place, state.place_rate, scratch.squares[JACOBIAN],
        scratch.rows[DRIFT],
    )  # fmt: skip
    for i in range(state.joints.shape[0]):
        state.position_integral[i] += weight * (state.place[i] + lever * state.place_rate[i])


@inner
def mean_push(push: Array, tick: int, i: int) -> float:
    """Return the mean over the tick of the prescribed force along axis `i`, N; `push` (n, N), N, is at the samples."""
    return float(0.5 * (push[tick, i] + push[tick + 1, i]))


@inner
def mean_hand_force(grip: Grip | None, loop: Loop, tick: int, i: int) -> float:
    """Return the hand's mean force over the tick along axis `i`, N: of what is prescribed, and of the grip.

    The grip's is of the place and its integral that the tick's last `move_device` leaves in the loop's state.
    """
    mean = mean_push(loop.motion.load.push, tick, i)
    if grip is None:
        return mean
    path, dt = grip.path, loop.motion.load.dt
    # the means of k (x_d - y) and of b (ẋ_d - ẏ)
    mean += grip.gains[0] * (0.5 * (path[tick, i] + path[tick + 1, i]) - loop.state.position_integral[i] / dt)
    hand_step = loop.state.place[i] - loop.out.hip[tick, i]
    return float(mean + grip.gains[1] * (path[tick + 1, i] - path[tick, i] - hand_step) / dt)


@borrowing
def act(loop: Loop, tick: int) -> int:
    """End a tick: go from the renderer's force in out.force[tick] to the device's state at the next sample.

    Returns DONE, or RAN_AWAY where a joint is not finite or farther than `Loop.reach` from the start.
    """
    state, out, load = loop.state, loop.out, loop.motion.load
    dt, torques, previous_torques = load.dt, out.joint_torque[tick], state.previous_torque
    write_torques(loop.feeling, loop, tick)
    # until `switch` seconds into the tick a delay lets the motors give the torques of before
    switch = apply_effects(loop.motors, tick, dt, torques, previous_torques)
    for i in range(torques.shape[0]):
        state.position_integral[i] = 0.0
    for part in range(2):  # one place that calls: it is compiled once
        begin, end = (switch, dt) if part else (0.0, switch)
        if end > begin:
            acting_torques = torques if part else previous_torques
            if not move_device(loop, tick, begin, end, acting_torques):
                return RAN_AWAY
    for i in range(torques.shape[0]):
        if switch > 0.0:  # the channel holds the tick's mean
            torques[i] = (switch * previous_torques[i] + (dt - switch) * torques[i]) / dt
        out.operator_force[tick, i] = mean_hand_force(load.grip, loop, tick, i)
    for i in range(torques.shape[0]):
        if not abs(state.joints[i] - state.start[i]) < loop.reach:  # also for nan
            return RAN_AWAY
    return DONE


@inner
def note_contact(reported: Array | None, loop: Loop, tick: int) -> None:
    """Keep whether the law reports contact, `reported` (1,), at the tick: 1 or 0, beside vectors in m and N."""
    if reported is None:
        return
    loop.out.contact[tick, 0] = reported[0]


@borrowing
def act_and_sense(loop: Loop, tick: int) -> int:
    """Act in a tick and sense the next one, where there is one: what lies between two answers of a renderer in Python.

    In one call, for it takes longer to hand a loop over than to carry it on.
    """
    status = act(loop, tick)
    if status != DONE or tick + 1 == loop.out.hip.shape[0]:
        return status
    return sense(loop, tick + 1)


@borrowing
def run(law: Callable[..., Any], data: Any, loop: Loop) -> tuple[int, int, int]:
    """Run all ticks with a compiled law; return the tick that the run ended at, how, and the law's number there."""
    out, dt = loop.out, loop.motion.load.dt
    for tick in range(out.hip.shape[0]):
        status = sense(loop, tick)
        if status != DONE:
            return tick, status, 0
        # the law knows only what the sensors give
        number = law(
            data, out.measured_hip[tick], out.measured_velocity[tick], out.measured_force[tick], dt, out.ihip[tick],
            out.force[tick],
        )  # fmt: skip
        if number != 0:
            return tick, LEFT_DOMAIN if number > 0 else BROKE, number
        for i in range(out.hip.shape[1]):
            # no number that is not finite reaches the motors
            if not math.isfinite(out.ihip[tick, i]) or not math.isfinite(out.force[tick, i]):
                return tick, NOT_FINITE, 0
        note_contact(loop.reported, loop, tick)
        status = act(loop, tick)
        if status != DONE:
            return tick, status, 0
    return out.hip.shape[0], DONE, 0
