"""The force of all regulation schemes as one kernel: see `regulation` for what each is."""

from __future__ import annotations

import math

from hapticeval.compiled import inner
from hapticeval.records import as_record, numbers_of, record_type, room_for
from hapticeval.renderers.regulation import (
    GRADIENT,
    PP,
    PP_D,
    PP_PD,
    PP_PD_C,
    PP_V,
    SQUARE_ROOT,
    TRANSVERSAL,
    Regulation,
)
from hapticeval.scene import Scene
from hapticeval.types import Array

REFERENCE_DEPTH = 1e-3
"""Depth (m) at which the square-root spring gives the linear spring's force."""

REFERENCE_RATE = 0.1
"""Speed of penetration (m/s) at which, at the reference depth, the square-root damper gives the linear one's force."""

GAINS = record_type("scheme", "bilateral", "stiffness", "damping", "mass", "spring", "damper")
"""What the `params` of a law begin with: N/m, N s/m, kg; `spring` and `damper` are those of the square root."""

FIRST_OWN = room_for(GAINS)
"""Where in `params` a projection's own numbers begin."""

PAST = record_type("in_contact", error=3, normal=3)
"""What the `state` of a law begins with: whether there was contact at the tick before, its position error (m), and the
outward unit normal at the IHIP, which a projection writes before it regulates."""


def gains_of(regulation: Regulation, scene: Scene) -> Array:
    """Return the `GAINS` of a law (7,), which its `params` begin with."""
    # k_p = K_p e_0^(1/2) and k_d = K_d (rate_0 / e_0)^(1/2), see `regulation` on the square root
    spring = scene.stiffness * REFERENCE_DEPTH**0.5
    damper = scene.damping * (REFERENCE_RATE / REFERENCE_DEPTH) ** 0.5
    return numbers_of(
        GAINS, scheme=regulation.number, bilateral=scene.bilateral, stiffness=scene.stiffness, damping=scene.damping,
        mass=scene.mass, spring=spring, damper=damper,
    )  # fmt: skip


@inner
def release(state: Array, hip: Array, ihip: Array, force: Array) -> int:
    """Answer in free space: `ihip` (N,) is the HIP, `hip` (N,), m, and `force` (N,), N, zero. Returns 0."""
    as_record(state, PAST).in_contact = 0.0
    for i in range(hip.shape[0]):
        ihip[i], force[i] = hip[i], 0.0
    return 0


@inner
def regulate(
    params: Array, state: Array, hip: Array, velocity: Array, centripetal: float, stretch: float, dt: float,
    ihip: Array, force: Array,
) -> int:  # fmt: skip
    """Write the regulation scheme's force (N,), N, on a hand in contact: the table in `regulation`. Returns 0.

    `hip` and `ihip` (N,), m, are the hand and the tool, `velocity` (N,), m/s, the hand's; the outward unit normal at
    the IHIP stands in `state`.

    What only the projection knows: `centripetal` is κ v_t^2 (m/s^2), for `pp-pd-c`, and `stretch` p (m), for
    `gradient`.
    """
    count, gains, past = hip.shape[0], as_record(params, GAINS), as_record(state, PAST)
    scheme, stiffness, damping, normal = gains.scheme, gains.stiffness, gains.damping, past.normal
    was_in_contact = past.in_contact != 0.0
    normal_velocity, normal_error, depth_squared, error_dot_rate = 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        # (4.5), and its difference backwards: zero in the first tick of contact, which has no error before it
        error = hip[i] - ihip[i]
        rate = (error - past.error[i]) / dt if was_in_contact else 0.0
        past.error[i] = error
        depth_squared += error * error
        error_dot_rate += error * rate
        force[i] = -stiffness * error  # (4.8)
        if scheme == PP_D:  # (4.12)
            force[i] = force[i] - damping * rate
    past.in_contact = 1.0
    if scheme == PP:
        return 0
    for i in range(count):
        normal_velocity += normal[i] * velocity[i]
        normal_error += normal[i] * past.error[i]
        if scheme == PP_V:  # (4.10)
            force[i] = force[i] - damping * velocity[i]
    if scheme in (TRANSVERSAL, GRADIENT):
        if gains.bilateral == 0.0:
            normal_error = min(normal_error, 0.0)  # a hand above the tangent at a distant foot is not pulled to it
        # (5.21) with its signs corrected, or K_p p n - K_d (n.v) n
        size = (-stiffness * normal_error if scheme == TRANSVERSAL else stiffness * stretch) - damping * normal_velocity
        for i in range(count):
            force[i] = size * normal[i]
    elif scheme == SQUARE_ROOT:
        # section 4.2: F = k_p e^(1/2) + k_d e^(1/2) e'^(1/2) from HIP to IHIP, e' with its sign
        depth = math.sqrt(depth_squared)
        safe = depth if depth > 0.0 else 1.0  # on the surface the error is zero, and so is the force
        error_rate = error_dot_rate / safe  # of the error's length, m/s
        size = math.sqrt(depth) * (gains.spring + gains.damper * math.copysign(math.sqrt(abs(error_rate)), error_rate))
        for i in range(count):
            force[i] = -size * (past.error[i] / safe)
    elif scheme in (PP_PD, PP_PD_C):
        size = damping * normal_velocity
        for i in range(count):
            force[i] = force[i] - size * normal[i]  # (4.14): damp along the normal only
            if scheme == PP_PD_C:  # (3.8): -m κ v_t^2 n
                force[i] = force[i] - gains.mass * centripetal * normal[i]
    return 0
