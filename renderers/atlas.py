"""Set stabilisation on the sphere by its atlas of two charts and the switching law (thesis 7.4.1, (7.45) to (7.67)).

Chart 1 has the azimuth about the third axis and the angle from it, chart 2 the same about the first axis:

    t̂_(1) = (atan2(y_2, y_1), arccos(y_3 / |y|))     t̂_(2) = (atan2(y_3, y_2), arccos(y_1 / |y|))

(7.54), (7.55) with atan2 for their arctan, which gives the range that the thesis states. So chart 2 is chart 1 of the
turned vector (y_2, y_3, y_1), and ψ_2 of (7.66) has the sine and cosine of its first coordinate the other way round
than printed.

The virtual output σ = (|y| - r_c, t̂) of (7.58), (7.59) is made linear: σ̈ = v, that is

    (∂σ/∂y) ÿ = v - (d/dt ∂σ/∂y) ẏ

with the Jacobian (7.60), v⊥ of (7.14) and v∥ of (7.67), or (8.9) with the hand's force as sensed; the force is
F_r = m ÿ - F_o.

Both charts give the same force where both are defined, and so does `on_surface` without charts. In a unilateral contact
the foot's acceleration that `on_surface` assigns is (7.67) with b_d + 2 m |y|˙/|y| for b_d.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.surface import SURFACE, closest_on_surface
from hapticeval.geometry.triples import Triple, dot, plus
from hapticeval.laws import LawData
from hapticeval.records import as_record
from hapticeval.renderers.law_renderer import as_rows
from hapticeval.renderers.regulation_kernel import PAST, release
from hapticeval.renderers.stabilisation_laws import BEYOND, FOCAL, SET_GAINS, contact_ends
from hapticeval.types import Array, BoolArray, IntArray

SINGULAR_SINE = 1e-9
"""Sine of the angle from a chart's axis up to which the chart counts as singular: it loses nine digits there."""

SWITCH = math.sqrt(0.5)
"""Cosine of the angles pi/4 and 3 pi/4 between which (7.56) uses chart 1."""


class ChartAnswer(NamedTuple):
    """What one chart gives for n states, for pictures such as Figures 7.7 and 7.8.

    `defined` (n,): not at the chart's singularity, its axis; elsewhere `eta` (n, 4) is (t̂_1, t̂_1 rate, t̂_2, t̂_2 rate)
    of (7.10), rad and rad/s, and `force` (n, 3), N, that of the bilateral constraint. Zero where it is not defined.
    """

    defined: BoolArray
    eta: Array
    force: Array


def charts(data: LawData, y: Array, yd: Array, push: Array | None = None) -> tuple[ChartAnswer, ChartAnswer]:
    """Return what charts 1 and 2 each answer at positions `y` (n, 3), m, with velocities `yd` (n, 3), m/s.

    `data` is that of the law; `push` (n, 3), N, is the hand's force as sensed, None without a sensor.
    """
    rows = [as_rows(vectors) for vectors in (y, yd, np.zeros_like(y) if push is None else push)]
    one, two = (ChartAnswer(*_chart_many(number, data.params, data.pieces[0], *rows)) for number in (1, 2))
    return one, two


def active_charts(y: Array) -> IntArray:
    """Return the chart that the switching law (7.56) uses at each of the positions `y` (n, 3), m: 1 or 2, (n,)."""
    y = np.asarray(y, dtype=np.float64)
    return np.where(np.abs(y[:, 2]) <= SWITCH * np.linalg.norm(y, axis=1), 1, 2)


@compiled
def active_chart(y: Triple) -> int:
    """(7.56): chart 1 while the angle from the third axis is between pi/4 and 3 pi/4, else 2."""
    return 1 if abs(y[2]) <= SWITCH * math.sqrt(dot(y, y)) else 2


@compiled
def to_chart_axes(chart: int, v: Triple) -> Triple:
    """Return a vector in the coordinates of a chart, whose third axis is the chart's own."""
    return v if chart == 1 else (v[1], v[2], v[0])


@compiled
def from_chart_axes(chart: int, v: Triple) -> Triple:
    """Return a vector of a chart's coordinates in those of space: the inverse of `to_chart_axes`."""
    return v if chart == 1 else (v[2], v[0], v[1])


@compiled
def jacobian(q: Triple) -> tuple[Triple, Triple, Triple]:
    """The rows of ∂σ/∂y (7.60) at a turned position off the axis: of |y|, of t̂_1 and of t̂_2."""
    across, length = math.hypot(q[0], q[1]), math.sqrt(dot(q, q))  # from the chart's axis, and from the centre, m
    length_squared = length * length
    return (
        (q[0] / length, q[1] / length, q[2] / length),
        (-q[1] / (across * across), q[0] / (across * across), 0.0),
        (q[2] * q[0] / (length_squared * across), q[2] * q[1] / (length_squared * across), -across / length_squared),
    )


@compiled
def chart_acceleration(
    radius: float, q: Triple, u: Triple, v_across: float, brake_rate: float, pushed: Triple
) -> Triple:
    """Return the hand's acceleration with which the sphere's coordinates move as they should: ÿ for which σ̈ = v.

    All is in a chart's coordinates: position `q` (m) and velocity `u` (m/s), off the axis.

    `v_across` is v⊥; `brake_rate` b_d / m (1/s) and `pushed` F_o / m (m/s^2) make v∥.
    """
    across, length = math.hypot(q[0], q[1]), math.sqrt(dot(q, q))
    rows = jacobian(q)
    radius_rate, turn_rate, tilt_rate = dot(rows[0], u), dot(rows[1], u), dot(rows[2], u)
    sin, cos = across / length, q[2] / length  # of t̂_2, the angle from the axis
    # (7.67); the hand's force enters by (dψ/dt̂ᵀ dψ/dt̂)^-1 dψ/dt̂ᵀ, which is |y|/r_c times these rows
    share = length / radius
    v_turn = -(brake_rate * sin + 2.0 * cos * tilt_rate) * turn_rate / sin + share * dot(rows[1], pushed)
    v_tilt = cos * sin * turn_rate * turn_rate - brake_rate * tilt_rate + share * dot(rows[2], pushed)
    # (d/dt ∂σ/∂y) ẏ: what σ̈ is without acceleration
    drift_radius = (dot(u, u) - radius_rate * radius_rate) / length
    drift_turn = -2.0 * turn_rate * (q[0] * u[0] + q[1] * u[1]) / (across * across)
    drift_tilt = cos * sin * turn_rate * turn_rate - 2.0 * tilt_rate * radius_rate / length
    # the rows are perpendicular: the inverse of the Jacobian has them as columns, over their lengths squared
    a = v_across - drift_radius
    b = (v_turn - drift_turn) * across * across
    c = (v_tilt - drift_tilt) * length * length
    return plus(plus((a * rows[0][0], a * rows[0][1], a * rows[0][2]), b, rows[1]), c, rows[2])


@compiled
def by_charts(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick through the active chart, of signature `LAW`, with the data of `stabilisation_laws.on_surface`.

    `hip` (3,), m, and `velocity` (3,), m/s, are the hand's, `push` (3,), N, its force as sensed; `ihip` (3,), m, and
    `force` (3,), N, are written. Returns BEYOND at the sphere's centre, and else 0.
    """
    gains, state, surface = as_record(data.params, SET_GAINS), data.state, data.pieces[0]
    y, yd, pushed = (hip[0], hip[1], hip[2]), (velocity[0], velocity[1], velocity[2]), (push[0], push[1], push[2])
    foot, normal, n = closest_on_surface(surface, y)
    bilateral = gains.bilateral != 0.0
    if not bilateral and n > 0.0 and as_record(state, PAST).in_contact == 0.0:
        return release(state, hip, ihip, force)
    radius, mass, rate = as_record(surface, SURFACE).lengths[0], gains.mass, dot(normal, yd)
    length = radius + n
    if not length / radius > FOCAL:  # 1 + n κ of a sphere
        return BEYOND
    damper = gains.damping * rate
    press = -gains.stiffness * n - damper - dot(normal, pushed)  # m v⊥ - F_o·ν
    # a unilateral contact: (7.67) with b_d + 2 m |y|˙ / |y| for b_d, so that no force acts along the surface
    brake_rate, foot_share = gains.viscosity / mass, 1.0
    if not bilateral:
        brake_rate, foot_share = brake_rate + 2.0 * rate / length, radius / length
    chart, force_share = active_chart(y), foot_share / mass
    v_across = (press + dot(normal, pushed)) / mass
    push_on_tool = to_chart_axes(chart, (force_share * pushed[0], force_share * pushed[1], force_share * pushed[2]))
    acceleration = from_chart_axes(
        chart,
        chart_acceleration(
            radius, to_chart_axes(chart, y), to_chart_axes(chart, yd), v_across, brake_rate, push_on_tool
        ),
    )
    # F_r = m ÿ - F_o
    response = (
        mass * acceleration[0] - pushed[0],
        mass * acceleration[1] - pushed[1],
        mass * acceleration[2] - pushed[2],
    )
    if not bilateral:
        pressing = dot(normal, response)
        if contact_ends(state, n, pressing, pressing + damper):
            return release(state, hip, ihip, force)
        if pressing <= 0.0:  # it never pulls
            response = (0.0, 0.0, 0.0)
    for i in range(3):
        ihip[i], force[i] = foot[i], response[i]
    return 0


@compiled
def _chart_many(
    number: int, params: Array, surface: Array, y: Array, yd: Array, push: Array
) -> tuple[BoolArray, Array, Array]:
    gains, radius, count = as_record(params, SET_GAINS), as_record(surface, SURFACE).lengths[0], y.shape[0]
    mass = gains.mass
    defined, eta, force = np.zeros(count, np.bool_), np.zeros((count, 4)), np.zeros((count, 3))
    for i in range(count):
        q = to_chart_axes(number, (y[i, 0], y[i, 1], y[i, 2]))
        u = to_chart_axes(number, (yd[i, 0], yd[i, 1], yd[i, 2]))
        pushed = (push[i, 0] / mass, push[i, 1] / mass, push[i, 2] / mass)
        length, across = math.sqrt(dot(q, q)), math.hypot(q[0], q[1])
        defined[i] = across > SINGULAR_SINE * length
        if not defined[i]:
            continue
        rows = jacobian(q)
        eta[i, 0], eta[i, 1] = math.atan2(q[1], q[0]), dot(rows[1], u)
        eta[i, 2], eta[i, 3] = math.atan2(across, q[2]), dot(rows[2], u)
        v_across = -(gains.stiffness * (length - radius) + gains.damping * dot(rows[0], u)) / mass
        acceleration = chart_acceleration(radius, q, u, v_across, gains.viscosity / mass, to_chart_axes(number, pushed))
        acceleration = from_chart_axes(number, acceleration)
        for k in range(3):
            force[i, k] = mass * acceleration[k] - push[i, k]
    return defined, eta, force
