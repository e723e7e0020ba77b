"""Set stabilisation on a surface in space without charts, a tick at a time (thesis chapter 7 and 8.2.2).

With the foot p of y = p + n ν, the shape operator W there and w = P_T ẏ = (I + nW) ṗ, the acceleration is

    P_T ÿ = (I + nW) a + 2 ṅ W ṗ + n (∇_ṗ W) ṗ          ν·ÿ = n̈ - <W ṗ, w>

where a is the covariant acceleration of the foot. So the force F_r = m ÿ - F_o, with v⊥ and a assigned, makes the
motions across and along the surface independent of each other, with no coordinates on the surface and so without the
singularities of charts. F_o is the hand's force as sensed (8.6), zero without a sensor. v⊥ = -(K_p n + K_d ṅ) / m is
(7.14) with its signs corrected.

A bilateral constraint has a = (P_T F_o - b_d ṗ) / m of (7.17), (7.18) with its sign corrected, and (8.9): without
either the foot runs along a geodesic at constant speed.

A unilateral contact has the a that takes no force along the surface but the viscosity's, as for plane curves, where
`curve_law` says how that bounds what energy switching can give:

    F_r = N ν - b_d w,    N = max(0, -K_p n - K_d ṅ - F_o·ν - C),    C = m <W ṗ, w>

On the surface both are (7.17), (7.18). The contact begins where the hand is inside, n <= 0, and ends outside where
N = 0, see `unilateral`; without pressure there is no friction. It never pulls.
"""

from __future__ import annotations

import math

from hapticeval.compiled import LawData, compiled
from hapticeval.geometry.surface_kernels import REALS, Triple, bend, bend_change, dot, place, times
from hapticeval.renderers.unilateral import TOUCHES, ends
from hapticeval.types import Array

STIFFNESS, DAMPING, MASS, VISCOSITY, BILATERAL = range(REALS, REALS + 5)
"""Where the gains are in `reals`, after the surface's row: N/m, N s/m, kg, kg/s, and 1.0 for a bilateral constraint."""

BEYOND = 1
"""The refusal: at or beyond a centre of curvature of the foot."""

FOCAL = 1e-9
"""The least eigenvalue of I + nW. So near to a focal point many surface points are nearest to within rounding."""


@compiled
def answer(
    data: LawData,
    hip: Array,
    velocity: Array,
    push: Array,
    dt: float,  # noqa: ARG001 - every law has it
    ihip: Array,
    force: Array,
) -> int:
    """One tick, of signature `LAW`; `reals` as `Surface.row` and the gains."""
    reals, memory = data.params, data.state
    foot, normal, n = place(reals, (hip[0], hip[1], hip[2]))
    bilateral = reals[BILATERAL] != 0.0
    if not bilateral and n > 0.0 and memory[TOUCHES] == 0.0:
        return release(hip, ihip, force)
    rate, push_across = _along(normal, velocity), _along(normal, push)
    first, second = tangents(normal)
    w = bend(reals, foot, normal)
    turned = times(w, second)
    w11, w12, w22 = dot(first, times(w, first)), dot(first, turned), dot(second, turned)
    middle, apart = 0.5 * (w11 + w22), math.hypot(0.5 * (w11 - w22), w12)
    if not 1.0 + n * middle - abs(n) * apart > FOCAL:
        return BEYOND
    a1, a2 = _along(first, velocity), _along(second, velocity)
    stretch = (1.0 + n * w11) * (1.0 + n * w22) - (n * w12) ** 2
    p1 = ((1.0 + n * w22) * a1 - n * w12 * a2) / stretch
    p2 = ((1.0 + n * w11) * a2 - n * w12 * a1) / stretch
    b1, b2 = w11 * p1 + w12 * p2, w12 * p1 + w22 * p2
    mass = reals[MASS]
    damper = reals[DAMPING] * rate
    press = -reals[STIFFNESS] * n - damper - push_across
    centripetal = mass * (b1 * a1 + b2 * a2)
    pressing, friction = press - centripetal, reals[VISCOSITY]
    if not bilateral:
        if ends(memory, n, pressing, pressing + damper):
            return release(hip, ihip, force)
        if pressing <= 0.0:
            pressing, friction = 0.0, 0.0
    s1, s2 = -friction * a1, -friction * a2
    if bilateral:
        foot_rate = _combined(p1, first, p2, second)
        change = bend_change(reals, foot, normal, foot_rate, foot_rate)
        f1, f2 = _along(first, push), _along(second, push)
        s1 += mass * (2.0 * rate * b1 + n * dot(first, change)) + n * (w11 * f1 + w12 * f2)
        s2 += mass * (2.0 * rate * b2 + n * dot(second, change)) + n * (w12 * f1 + w22 * f2)
    sliding = _combined(s1, first, s2, second)
    for i in range(3):
        ihip[i], force[i] = foot[i], pressing * normal[i] + sliding[i]
    return 0


@compiled
def release(hip: Array, ihip: Array, force: Array) -> int:
    """Free space: the IHIP is the HIP and the force zero."""
    for i in range(3):
        ihip[i], force[i] = hip[i], 0.0
    return 0


@compiled
def tangents(normal: Triple) -> tuple[Triple, Triple]:
    """Two unit vectors that make a right-handed frame with the unit normal (Duff and others, 2017)."""
    x, y, z = normal
    side = math.copysign(1.0, z)
    a = -1.0 / (side + z)
    b = x * y * a
    return (1.0 + side * x * x * a, side * b, -side * x), (b, side + y * y * a, -y)


@compiled
def _along(direction: Triple, v: Array) -> float:
    return dot(direction, (v[0], v[1], v[2]))


@compiled
def _combined(f: float, a: Triple, g: float, b: Triple) -> Triple:
    return f * a[0] + g * b[0], f * a[1] + g * b[1], f * a[2] + g * b[2]
