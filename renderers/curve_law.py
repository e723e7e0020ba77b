"""Set stabilisation on a plane curve, a tick at a time (thesis chapter 7 in the coordinates of the curve, 8.2.2).

With y = c(s) + n ν, κ the curvature at the foot, κ' = dκ/ds and w = t·ẏ = (1 + n κ) ṡ:

    t·ÿ = (1 + n κ) s̈ + 2 κ ṅ ṡ + n κ' ṡ^2          ν·ÿ = n̈ - κ (1 + n κ) ṡ^2

so that the force F_r = m ÿ - F_o, with v⊥ and v∥ for n̈ and s̈, makes the coordinates linear and independent of each
other. F_o is the hand's force as sensed (8.6), zero without a sensor. v⊥ = -(K_p n + K_d ṅ) / m is (7.14) with its
signs corrected.

A bilateral constraint has v∥ = (F_o·t - b_d ṡ) / m of (7.17), (7.18) with its sign corrected, and (8.9): the speed of
the foot is kept. Off the surface that takes a force along it, 2 m κ ṅ ṡ + m n κ' ṡ^2.

A unilateral contact has the v∥ that takes none, but for the viscosity, since a surface without friction gives none:

    F_r = N ν - b_d w t,    N = max(0, -K_p n - K_d ṅ - F_o·ν - C),    C = m κ (1 + n κ) ṡ^2

On the surface both are (7.17). The contact begins where the hand is inside, n <= 0, and ends outside where N = 0: not
where n = 0, which a tool that slides over a concave surface crosses at every disturbance. In between it is a damped
spring at rest at n = -C / K_p, and never pulls. Nor does its damper push away from outside a tool that leaves, as one
of a filtered velocity would: see `unilateral`. Without a sensor, with S = -K_p n - C where that is positive, else 0,

    F_r·ẏ <= -d/dt (S^2 / 2 K_p) - b_d w^2 - (S / K_p) dC/dt

so that, where the surface is flat or convex, it gives no more than it took while C stays, however it is switched: S is
zero at n = 0. On a concave surface the spring is loaded there by C^2 / 2 K_p, what a touch can give at the most.
"""

from __future__ import annotations

import math

from hapticeval.compiled import LawData, compiled
from hapticeval.geometry.curve_kernels import foot
from hapticeval.geometry.kernels import curvature_rate
from hapticeval.renderers.unilateral import TOUCHES, ends
from hapticeval.types import Array

STIFFNESS, DAMPING, MASS, VISCOSITY, BILATERAL = range(5)
"""Where the gains are in `reals`: N/m, N s/m, kg, kg/s, and 1.0 for a bilateral constraint."""

BEYOND = 1
"""The refusal: at or beyond the centre of curvature of the foot."""

FOCAL = 1e-9
"""The least 1 + n κ. So near to a centre of curvature many points of the curve are nearest to within rounding."""


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
    """One tick, of signature `LAW`; `pieces` and `samples` are the curve's, see `geometry.curve_kernels`."""
    reals, pieces, samples, memory = data.params, data.segments, data.lookup, data.state
    bilateral = reals[BILATERAL] != 0.0
    k, u, distance, side, (px, py, dx, dy, ddx, ddy) = foot(pieces, samples, hip[0], hip[1])
    n = side * distance
    if not bilateral and n > 0.0 and memory[TOUCHES] == 0.0:
        ihip[0], ihip[1], force[0], force[1] = hip[0], hip[1], 0.0, 0.0
        return 0
    speed = math.hypot(dx, dy)
    tx, ty = dx / speed, dy / speed
    bend = (dx * ddy - dy * ddx) / (speed * speed * speed)
    stretch = 1.0 + n * bend
    if not stretch > FOCAL:
        return BEYOND
    mass = reals[MASS]
    along, across = tx * velocity[0] + ty * velocity[1], ty * velocity[0] - tx * velocity[1]
    foot_speed = along / stretch
    push_along, push_across = tx * push[0] + ty * push[1], ty * push[0] - tx * push[1]
    damper = reals[DAMPING] * across
    press = -reals[STIFFNESS] * n - damper - push_across
    centripetal = mass * bend * along * foot_speed
    if bilateral:
        turning = 2.0 * bend * across + n * curvature_rate(pieces[k], u) * foot_speed
        sliding = mass * turning * foot_speed - reals[VISCOSITY] * along + n * bend * push_along
        pressing = press - centripetal
    else:
        pressing = max(press - centripetal, 0.0)
        if ends(memory, n, pressing, press - centripetal + damper):
            ihip[0], ihip[1], force[0], force[1] = hip[0], hip[1], 0.0, 0.0
            return 0
        sliding = -reals[VISCOSITY] * along if pressing > 0.0 else 0.0
    ihip[0], ihip[1] = px, py
    force[0] = pressing * ty + sliding * tx
    force[1] = sliding * ty - pressing * tx
    return 0
