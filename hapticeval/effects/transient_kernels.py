"""What is added to the force when a contact begins: changes of answers, of signature `hapticeval.laws.CHANGE`.

All keep the same state (STATE, N), and end with the contact: in free space there is no force. What a cap holds back
goes into the ticks that follow.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import borrowing, compiled, compiled_on_demand
from hapticeval.devices import parallelogram
from hapticeval.laws import NORMAL, ChangeData, Closest
from hapticeval.records import as_record, record_type
from hapticeval.types import Array

inverse, kinematics2, kinematics3, dynamics2, dynamics3 = map(
    compiled_on_demand,
    (
        parallelogram.inverse,
        parallelogram.kinematics2,
        parallelogram.kinematics3,
        parallelogram.dynamics2,
        parallelogram.dynamics3,
    ),
)


@compiled
def linkage_mass(parameters: Array, point: Array, normal: Array) -> float:
    """Return the mass (kg) that a blow along a unit `normal` (N,) meets at `point` (N,), m, on a parallelogram.

    That is what `device.apparent_mass` returns; zero where the device does not reach. `parameters` (k,) are its own.
    """
    dimension = point.shape[0]
    rows = np.zeros((5, dimension))
    joints, rates, position, velocity, drift = rows[0], rows[1], rows[2], rows[3], rows[4]
    jacobian, inertia = np.zeros((dimension, dimension)), np.zeros((dimension, dimension))
    sine = inverse(parameters, point, joints)  # of the linkage's fold: beyond ±1 the links do not reach there
    if not -1.0 <= sine <= 1.0:
        return 0.0
    if dimension == 2:
        kinematics2(parameters, joints, rates, position, velocity, jacobian, drift)
        dynamics2(parameters, joints, rates, inertia, drift)
    else:
        kinematics3(parameters, joints, rates, position, velocity, jacobian, drift)
        dynamics3(parameters, joints, rates, inertia, drift)
    mobility = 0.0  # n' J M⁻¹ J' n, 1/kg; M is diagonal
    for k in range(dimension):
        joint_normal = 0.0
        for i in range(dimension):
            joint_normal += jacobian[i, k] * normal[i]
        mobility += joint_normal * joint_normal / inertia[k, k]
    return 1.0 / mobility


START_NORMAL, CONTACT_ROW, PULSE_ROW, STATE = 2, 3, 4, 5
"""Rows of a state beside those of a closest point's frame: the normal along which the contact began, and the two
records below; and how many rows there are."""

CONTACT_CLOCK, PULSE = record_type("phase", "time"), record_type("held_back", "speed")
"""Whether there is contact and the seconds since it began; what a cap holds back (N s) and the speed (m/s) of the
approach."""

UNKNOWN_PHASE, FREE_PHASE, TOUCHING_PHASE = 0.0, 1.0, 2.0
"""Phases of a contact. A run that begins in contact has no beginning of it."""

CAPPED = record_type("cap")
"""What the `params` of all begin with: the cap (N)."""

SPENT = 40.0
"""Decay times after which a vibration is below the rounding of its integral."""

SAME_TICK_SHARE = 1e-9
"""Share by which two sampling times may differ and be the same."""


@borrowing
def contact_phase(state: Array, closest: Closest, hip: Array, velocity: Array, ihip: Array, force: Array) -> float:
    """Return what a transient has to know of a tick: whether a contact begins in it, goes on, or there is none.

    That is FREE_PHASE in the tick in which one begins, TOUCHING_PHASE after that, and UNKNOWN_PHASE without contact.
    Contact is a force, or a tool apart from a hand that is inside: one that lags behind it in free space is not.

    `hip` and `ihip` (N,), m, `velocity` (N,), m/s, and `force` (N,), N, are the answer's. When a contact begins
    direction, time and speed are written to `state` (STATE, N), the speed zero where the hand does not approach.
    """
    touches, lags = False, False
    for i in range(hip.shape[0]):
        touches = touches or force[i] != 0.0
        lags = lags or ihip[i] != hip[i]
    if lags and not touches:
        touches = closest.function(closest.data, hip, state[:START_NORMAL]) < 0.0
    contact, pulse = as_record(state, CONTACT_CLOCK, CONTACT_ROW), as_record(state, PULSE, PULSE_ROW)
    previous = contact.phase
    contact.phase = TOUCHING_PHASE if touches else FREE_PHASE
    if not touches:
        return UNKNOWN_PHASE
    if previous == TOUCHING_PHASE:
        return TOUCHING_PHASE
    speed = 0.0
    contact.time, pulse.held_back = 0.0, 0.0
    if previous == FREE_PHASE:  # else the run began in contact, and nobody saw the approach
        closest.function(closest.data, ihip, state[:START_NORMAL])
        direction, normal = state[START_NORMAL], state[NORMAL]
        for i in range(hip.shape[0]):
            direction[i] = normal[i]
            speed -= normal[i] * velocity[i]
    pulse.speed = max(speed, 0.0)
    return FREE_PHASE


@borrowing
def add_capped_force(data: ChangeData, requested: float, dt: float, force: Array) -> None:
    """Add a transient's force to the renderer's, along the direction, and keep for later what is above the cap.

    `requested` (N) is the transient's at this tick of `dt` s, and `force` (N,), N, is changed in place.
    """
    pulse, direction, cap = (
        as_record(data.state, PULSE, PULSE_ROW),
        data.state[START_NORMAL],
        as_record(data.params, CAPPED).cap,
    )
    total = requested + pulse.held_back / dt
    given_force = min(max(total, -cap), cap)
    pulse.held_back = (total - given_force) * dt  # an impulse, N s: no momentum is lost to the cap
    for i in range(force.shape[0]):
        force[i] += given_force * direction[i]


def give_impulse(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:
    """Take a collision's momentum out of the device in its first tick: the impulse (1 + c_r) m_n v along n of (4.21).

    The signature is that of `Effect.change`: `hip` and `ihip` (N,), m, `velocity` (N,), m/s, `force` (N,), N.
    `data.params` are the cap (N), 1 + c_r, and a point's mass (kg) or a parallelogram's constants. Returns 1 where
    the device does not reach, and else 0.
    """
    state, params = data.state, data.params
    phase = contact_phase(state, closest, hip, velocity, ihip, force)
    if phase == UNKNOWN_PHASE:
        return 0
    requested, speed = 0.0, as_record(state, PULSE, PULSE_ROW).speed
    if phase == FREE_PHASE and speed > 0.0:
        # m_n = 1 / (n' J M^-1 J' n), kg; (4.21) as printed, without n, would stop the sliding too
        mass = params[2] if params.shape[0] == 3 else linkage_mass(params[2:], hip, state[START_NORMAL])
        if not mass > 0.0:
            return 1
        requested = params[1] * mass * speed / dt  # all of it in one tick
    add_capped_force(data, requested, dt, force)
    return 0


@borrowing
def ringing_integral(decay: float, omega: float, time: float) -> float:
    """Return the integral of e^(-Bt) sin(wt), s, up to `time` (s), less that over all time; B and w in 1/s."""
    oscillation = decay * math.sin(omega * time) + omega * math.cos(omega * time)
    return -math.exp(-decay * time) * oscillation / (decay * decay + omega * omega)


def ring(data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array) -> int:
    """Let the surface ring: add the tick's mean of L v e^(-Bt) sin(wt), t s after the contact began.

    The signature is that of `Effect.change`: `hip` and `ihip` (N,), m, `velocity` (N,), m/s, `force` (N,), N.
    `data.params` (4,) are the cap (N), L (N s/m), B (1/s) and w (rad/s). Returns 0: it is defined everywhere.
    """
    state, params = data.state, data.params
    if contact_phase(state, closest, hip, velocity, ihip, force) == UNKNOWN_PHASE:
        return 0
    contact, speed = as_record(state, CONTACT_CLOCK, CONTACT_ROW), as_record(state, PULSE, PULSE_ROW).speed
    time, decay, omega = contact.time, params[2], params[3]
    requested = 0.0
    if decay * time < SPENT and speed > 0.0:
        # the mean over the tick, so that the impulse is the integral's whatever the sampling time
        area = ringing_integral(decay, omega, time + dt) - ringing_integral(decay, omega, time)
        requested = params[1] * speed * area / dt
    contact.time = time + dt
    add_capped_force(data, requested, dt, force)
    return 0


@borrowing
def impulse_until(pulse: Array, step: float, time: float) -> float:
    """Return the impulse (N s) that a pulse has given up to `time` (s) after it began.

    `pulse` (2, n) has its samples, N, each held for `step` s, and their sums before each.
    """
    whole_samples = int(np.floor(time / step))
    last_sample = pulse.shape[1] - 1
    if whole_samples >= last_sample:  # over: the last sample is a zero
        return float(pulse[1, last_sample] * step)
    return float((pulse[1, whole_samples] + (time / step - whole_samples) * pulse[0, whole_samples]) * step)


def replay(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:
    """Replay a measured pulse from the tick on in which a contact begins: `RecordedImpulse`.

    At the pulse's own sampling time it is given sample by sample, and at another one by its mean over each tick.

    The signature is that of `Effect.change`: `hip` and `ihip` (N,), m, `velocity` (N,), m/s, `force` (N,), N.
    `data.params` (2,) are the cap (N) and the sampling time (s); `data.samples` (2, n) the pulse (N) with a zero
    at its end, and its sums.

    Returns 0: it is defined everywhere.
    """
    state, pulse, step = data.state, data.samples, data.params[1]
    if contact_phase(state, closest, hip, velocity, ihip, force) == UNKNOWN_PHASE:
        return 0
    contact, requested = as_record(state, CONTACT_CLOCK, CONTACT_ROW), 0.0
    time = contact.time
    if as_record(state, PULSE, PULSE_ROW).speed > 0.0:  # a hand that approaches, at whatever speed
        tick = int(np.rint(time / step))
        if abs(dt - step) <= SAME_TICK_SHARE * step and abs(time - tick * step) <= SAME_TICK_SHARE * (time + step):
            requested = pulse[0, min(tick, pulse.shape[1] - 1)]
        else:
            requested = (impulse_until(pulse, step, time + dt) - impulse_until(pulse, step, time)) / dt
    contact.time = time + dt
    add_capped_force(data, requested, dt, force)
    return 0
