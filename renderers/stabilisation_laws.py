"""Set stabilisation without charts, a tick at a time (thesis chapter 7 and 8.2.2): on plane curves and on surfaces.

On a plane curve, y = c(s) + n ν, with κ the curvature at the foot, κ' = dκ/ds and w = t·ẏ = (1 + n κ) ṡ:

    t·ÿ = (1 + n κ) s̈ + 2 κ ṅ ṡ + n κ' ṡ^2          ν·ÿ = n̈ - κ (1 + n κ) ṡ^2

On a surface in space, y = p + n ν, with the shape operator W at the foot p and w = P_T ẏ = (I + nW) ṗ:

    P_T ÿ = (I + nW) a + 2 ṅ W ṗ + n (∇_ṗ W) ṗ       ν·ÿ = n̈ - <W ṗ, w>

where a is the covariant acceleration of the foot. So the force F_r = m ÿ - F_o, with v⊥ for n̈ and v∥ for s̈ or a,
makes the motions across and along the surface linear and independent of each other, with no coordinates on the surface
and so without the singularities of charts.

F_o is the hand's force as sensed (8.6), zero without a sensor. v⊥ = -(K_p n + K_d ṅ) / m is (7.14) with its signs
corrected.

A bilateral constraint has v∥ = (F_o·t - b_d ṡ) / m, or a = (P_T F_o - b_d ṗ) / m, of (7.17), (7.18) with its sign
corrected, and (8.9): without either the speed of the foot is kept, in space along a geodesic.

Off the surface that takes a force along it, 2 m κ ṅ ṡ + m n κ' ṡ^2.

A unilateral contact has the v∥ that takes none, but for the viscosity, since a surface without friction gives none:

    F_r = N ν - b_d w,    N = max(0, -K_p n - K_d ṅ - F_o·ν - C),    C = m κ (1 + n κ) ṡ^2, or m <W ṗ, w>

On the surface both are (7.17), (7.18). The contact begins where the hand is inside, n <= 0, and ends outside where
N = 0: not where n = 0, which a tool that slides over a concave surface crosses at every disturbance.

In between it is a damped spring at rest at n = -C / K_p, and never pulls; without pressure there is no friction.
Without a sensor, with S = -K_p n - C where that is positive, else 0,

    F_r·ẏ <= -d/dt (S^2 / 2 K_p) - b_d w^2 - (S / K_p) dC/dt

so that, where the surface is flat or convex, it gives no more than it took while C stays, however it is switched: S is
zero at n = 0. On a concave surface the spring is loaded there by C^2 / 2 K_p, what a touch can give at the most.

No lag of the velocity lets the contact push the tool away from outside. It gives N = max(0, S - K_d ṅ) with
S = -K_p n - F_o·ν - C what is left without the damper.

It ends outside, n > 0, where N = 0; and where S <= 0 unless the tool has come nearer since the tick before, that is,
where nothing but the damper pushes a tool that leaves.

With the true ṅ the damper does not: -K_d ṅ < 0. With a velocity v that is filtered, v̇ = a (ṅ - v), it would for some
1/a longer, and gives energy.

With it no such filter makes a contact give energy, however fast the tool comes. Let S = -K_p n, which is so without a
sensor and at C = 0, n <= 0 while the contact lasts, and v_0 <= 0 at the touch.

What it takes is

    -∫ N ṅ dt = [K_p n^2 / 2 + K_d w^2 / 2a] + K_d ∫ w^2 dt + K_d [c n] + K_d a ∫ c n dt    while N > 0,

with v = w + c and c = v_0 e^(-a t) what the filter brought along; the last two terms are not negative, as c <= 0 and
n <= 0.

Where N vanishes, K_d v = S >= 0: all of U = S^2 / 2 K_p + S^2 / 2 K_d a has been taken, since w >= v there. And until
it presses again, -(K_p + K_d a) Δn + K_d a ∫ v dt = 0 with v >= 0: the tool is no deeper, and U no larger.

So at n = 0 it has given nothing on balance. A touch with v_0 > 0, of a tool that was about to leave, may give what the
spring takes in unfelt, at the most U with S = K_p K_d v_0 / (K_p + K_d a).

A sampled loop is late. Its force is held for a tick T and comes after a delay d, so that it acts h = T/2 + d after its
sample in the mean, and a filter shows the velocity of τ before. On a circle of radius r a tool of angular speed ω is
then seen to leave by v τ ω, which the spring balances, n = -(K_d/K_p) v τ ω; and 2 m κ ṅ ṡ makes of it 2 τ m v ω^2
along the circle. The centripetal force is turned by ω h besides, which adds h m v ω^2. So

    ω̇ = c ω^3,    c = 2 τ + T/2 + d,

and ω grows without end within 1 / (2 c ω_0^2). The predicted laws evaluate the same force where the tool will be,

    v̂ = v + (τ + h) (F_prev + F_o) / m,    ŷ = y + h v̂,

with F_prev the force of the tick before. Both errors are of the second order in h and τ, and so c is zero to the first.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.curve_kernels import nearest_with_values
from hapticeval.geometry.kernels import curvature_rate
from hapticeval.geometry.surface import apply_matrix, closest_on_surface, shape_operator, shape_operator_change
from hapticeval.geometry.triples import Triple, dot
from hapticeval.laws import LawData
from hapticeval.records import as_record, record_type
from hapticeval.renderers.regulation_kernel import PAST, release
from hapticeval.types import Array

SET_GAINS = record_type("stiffness", "damping", "mass", "viscosity", "bilateral")
"""The `params`: N/m, N s/m, kg, kg/s, and 1.0 for a bilateral constraint."""

TOUCH = record_type("n", base=PAST)
"""The `state`: with where the tool touched at the tick before, n in m."""

PREDICTION = record_type("cutoff", "delay", base=SET_GAINS)
"""The `params` of a predicted law: with the cutoff of the velocity's low-pass, Hz, 0 where velocity is exact, and the
delay of the motors, s."""

PREDICTED_STATE = record_type(base=TOUCH, last_force=3)
"""The `state` of a predicted law: with the force of the tick before, N."""

BEYOND = 1
"""The number of a domain exit: at or beyond the centre of curvature of the foot."""

FOCAL = 1e-9
"""The least 1 + n κ, or eigenvalue of I + nW: nearer to a focal point many points are nearest to within rounding."""


@compiled
def contact_ends(state: Array, n: float, pressing: float, spring: float) -> bool:
    """Return whether a contact is over at `n` (m), with N = `pressing` and S = `spring` (N); else note that it lasts.

    `state` (k,) is the law's; why both N and S count stands in the module.
    """
    past = as_record(state, TOUCH)
    if n > 0.0 and (pressing <= 0.0 or (spring <= 0.0 and n >= past.n)):
        return True
    past.in_contact, past.n = 1.0, n
    return False


@compiled
def on_curve(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of set stabilisation on a plane curve, of signature `LAW`: the module's force in the plane.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's, `push` (2,), N, its force as sensed; `ihip` (2,), m, and
    `force` (2,), N, are written. `pieces` and `lookup` are those of `geometry.curve_kernels`. Returns BEYOND at the
    centre of curvature, and else 0.
    """
    gains, state, pieces = as_record(data.params, SET_GAINS), data.state, data.pieces
    bilateral = gains.bilateral != 0.0
    k, u, distance, side, (px, py, dx, dy, ddx, ddy) = nearest_with_values(pieces, data.lookup, hip[0], hip[1])
    n = side * distance
    if not bilateral and n > 0.0 and as_record(state, PAST).in_contact == 0.0:
        return release(state, hip, ihip, force)
    speed = math.hypot(dx, dy)
    tx, ty = dx / speed, dy / speed
    curvature = (dx * ddy - dy * ddx) / (speed * speed * speed)
    stretch = 1.0 + n * curvature  # how far the hand moves for a metre of its foot
    if not stretch > FOCAL:
        return BEYOND
    mass = gains.mass
    tangential_velocity, normal_velocity = tx * velocity[0] + ty * velocity[1], ty * velocity[0] - tx * velocity[1]
    foot_speed = tangential_velocity / stretch  # ṡ
    push_along, push_across = tx * push[0] + ty * push[1], ty * push[0] - tx * push[1]
    damper = gains.damping * normal_velocity
    unbent_press = -gains.stiffness * n - damper - push_across
    centripetal = mass * curvature * tangential_velocity * foot_speed  # m κ (1 + n κ) ṡ^2
    if bilateral:
        # t·F_r = m (2 κ ṅ ṡ + n κ' ṡ^2) - b_d w + n κ F_o·t, with v∥ = (F_o·t - b_d ṡ) / m
        curve_turning = 2.0 * curvature * normal_velocity + n * curvature_rate(pieces[k], u) * foot_speed
        sliding = mass * curve_turning * foot_speed - gains.viscosity * tangential_velocity + n * curvature * push_along
        pressing = unbent_press - centripetal
    else:
        pressing = max(unbent_press - centripetal, 0.0)
        if contact_ends(state, n, pressing, unbent_press - centripetal + damper):
            return release(state, hip, ihip, force)
        sliding = -gains.viscosity * tangential_velocity if pressing > 0.0 else 0.0
    ihip[0], ihip[1] = px, py
    # the outward normal is (t_y, -t_x)
    force[0] = pressing * ty + sliding * tx
    force[1] = sliding * ty - pressing * tx
    return 0


@compiled
def on_surface(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of set stabilisation on a surface in space, whose row `pieces` holds, of signature `LAW`.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's, `push` (3,), N, its force as sensed; `ihip` (3,), m, and
    `force` (3,), N, are written. Returns BEYOND at a focal point of the surface, and else 0.
    """
    gains, state, surface = as_record(data.params, SET_GAINS), data.state, data.pieces[0]
    foot, normal, n = closest_on_surface(surface, (hip[0], hip[1], hip[2]))
    bilateral = gains.bilateral != 0.0
    if not bilateral and n > 0.0 and as_record(state, PAST).in_contact == 0.0:
        return release(state, hip, ihip, force)
    normal_velocity, push_across = _component(normal, velocity), _component(normal, push)
    # W in an orthonormal basis of the tangent plane, [[w11, w12], [w12, w22]], 1/m
    first, second = tangents(normal)
    w = shape_operator(surface, foot, normal)
    w_second = apply_matrix(w, second)
    w11, w12, w22 = dot(first, apply_matrix(w, first)), dot(first, w_second), dot(second, w_second)
    # the principal curvatures are their mean plus and minus this: the least eigenvalue of I + nW
    mean_curvature, half_difference = 0.5 * (w11 + w22), math.hypot(0.5 * (w11 - w22), w12)
    if not 1.0 + n * mean_curvature - abs(n) * half_difference > FOCAL:
        return BEYOND
    v1, v2 = _component(first, velocity), _component(second, velocity)
    # ṗ = (I + nW)^-1 w by Cramer's rule, with w = (v1, v2), and W ṗ = (bent1, bent2)
    stretch = (1.0 + n * w11) * (1.0 + n * w22) - (n * w12) ** 2
    foot_rate1 = ((1.0 + n * w22) * v1 - n * w12 * v2) / stretch
    foot_rate2 = ((1.0 + n * w11) * v2 - n * w12 * v1) / stretch
    bent1, bent2 = w11 * foot_rate1 + w12 * foot_rate2, w12 * foot_rate1 + w22 * foot_rate2
    mass = gains.mass
    damper = gains.damping * normal_velocity
    unbent_press = -gains.stiffness * n - damper - push_across
    centripetal = mass * (bent1 * v1 + bent2 * v2)
    pressing, friction = unbent_press - centripetal, gains.viscosity
    if not bilateral:
        if contact_ends(state, n, pressing, pressing + damper):
            return release(state, hip, ihip, force)
        if pressing <= 0.0:
            pressing, friction = 0.0, 0.0
    slide1, slide2 = -friction * v1, -friction * v2  # the force along the surface: -b_d w
    if bilateral:
        # and m (2 ṅ W ṗ + n (∇_ṗ W) ṗ) + n W F_o, with a = (P_T F_o - b_d ṗ) / m
        foot_rate = _combination(foot_rate1, first, foot_rate2, second)
        w_change = shape_operator_change(surface, foot, normal, foot_rate, foot_rate)
        push1, push2 = _component(first, push), _component(second, push)
        slide1 += mass * (2.0 * normal_velocity * bent1 + n * dot(first, w_change)) + n * (w11 * push1 + w12 * push2)
        slide2 += mass * (2.0 * normal_velocity * bent2 + n * dot(second, w_change)) + n * (w12 * push1 + w22 * push2)
    sliding = _combination(slide1, first, slide2, second)
    for i in range(3):
        ihip[i], force[i] = foot[i], pressing * normal[i] + sliding[i]
    return 0


@compiled
def velocity_lag(cutoff: float, dt: float) -> float:
    """Return how late a velocity from differences is in the mean, τ, s, behind a low-pass of `cutoff` (Hz); 0 without.

    A difference is dt/2 late. The low-pass has the weights (1 - q) q^j, q = e^(-2π f dt), whose mean lag is
    dt q / (1 - q).
    """
    if cutoff == 0.0:
        return 0.0
    decay = math.exp(-2.0 * math.pi * cutoff * dt)
    return 0.5 * dt + dt * decay / (1.0 - decay)


@compiled
def predict(data: LawData, hip: Array, velocity: Array, push: Array, dt: float, place: Array, motion: Array) -> None:
    """Write where the tool will be when the force acts, `place` (N,), m, and how fast, `motion` (N,), m/s.

    `hip` (N,), m, `velocity` (N,), m/s, `push` (N,), N, and `dt`, s, are those of the law.
    """
    numbers, past = as_record(data.params, PREDICTION), as_record(data.state, PREDICTED_STATE)
    ahead = 0.5 * dt + numbers.delay  # h
    late = velocity_lag(numbers.cutoff, dt) + ahead
    for i in range(hip.shape[0]):
        motion[i] = velocity[i] + late * (past.last_force[i] + push[i]) / numbers.mass
        place[i] = hip[i] + ahead * motion[i]


@compiled
def on_curve_predicted(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array
) -> int:
    """One tick of `on_curve`, `hip` (2,), m, and `velocity` (2,), m/s, at the predicted place: its foot is the IHIP."""
    place, motion = np.empty_like(hip), np.empty_like(hip)
    predict(data, hip, velocity, push, dt, place, motion)
    number = on_curve(data, place, motion, push, dt, ihip, force)
    past = as_record(data.state, PREDICTED_STATE)
    for i in range(2):
        past.last_force[i] = force[i]
    return number


@compiled
def on_surface_predicted(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array
) -> int:
    """One tick of `on_surface`, `hip` (3,), m, `velocity` (3,), m/s, at the predicted place: its foot is the IHIP."""
    place, motion = np.empty_like(hip), np.empty_like(hip)
    predict(data, hip, velocity, push, dt, place, motion)
    number = on_surface(data, place, motion, push, dt, ihip, force)
    past = as_record(data.state, PREDICTED_STATE)
    for i in range(3):
        past.last_force[i] = force[i]
    return number


@compiled
def tangents(normal: Triple) -> tuple[Triple, Triple]:
    """Two unit vectors that make a right-handed frame with the unit normal (Duff and others, 2017)."""
    x, y, z = normal
    side = math.copysign(1.0, z)
    a = -1.0 / (side + z)
    b = x * y * a
    return (1.0 + side * x * x * a, side * b, -side * x), (b, side + y * y * a, -y)


@compiled
def _component(direction: Triple, v: Array) -> float:
    return dot(direction, (v[0], v[1], v[2]))


@compiled
def _combination(f: float, a: Triple, g: float, b: Triple) -> Triple:
    return f * a[0] + g * b[0], f * a[1] + g * b[1], f * a[2] + g * b[2]
