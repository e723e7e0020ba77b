"""How the tool moves between events: free flight in closed form, and sliding on the boundary.

The operator's force on the tool is, within one stretch of time,

    F_o = g0 + g1 tau - k y - d y',      tau from the start of the stretch,

and k and d are

- zero in an experiment without a hand;
- those of the hand's own spring in one with a hand;
- a critically damped spring's, d = 2 sqrt(k m), when the hand is led along a path.

A stretch's numbers are an array `load`, see the names of its places.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import evaluate
from hapticeval.types import Array

G0X, G0Y, G1X, G1Y, SPRING, DAMPER, MASS, RESTITUTION, BILATERAL, BEGAN = range(10)
"""Places in a `load` (10,).

g0 (N) and g1 (N/s) by axis, the spring's k (N/m), the damper's d (N s/m), the tool's mass (kg), the coefficient of
restitution, 1 if the boundary holds the tool from both sides, and when the stretch began (s).
"""
LOAD_SIZE = 10

Slide: TypeAlias = tuple[float, float, float]
"""A slide under way: u where it began, how much u has grown since, and w = ds/dt (m/s)."""

LONGEST_STEP = 0.1
"""Longest step of the sliding motion, in units of its own pace.

That is the spring's 1 / omega, or the time in which the boundary changes its direction by one radian. The order of the
method (six) then leaves errors of some 1e-12 m and 1e-10 m/s on a 0.2 m model.
"""


@compiled
def surface_frame(piece: Array, u: float) -> tuple[float, float, float, float, float, float]:
    """Return point (x, y), m, unit tangent (tx, ty), |dc/du| and curvature (1/m) at u of a piece (9,).

    The outward normal is (ty, -tx).
    """
    x, y, dx, dy, ddx, ddy = evaluate(piece, u)
    speed = math.sqrt(dx * dx + dy * dy)
    return x, y, dx / speed, dy / speed, speed, (dx * ddy - dy * ddx) / (speed * speed * speed)


@compiled
def operator_force(load: Array, tau: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
    """Return the operator's force (N) on a tool at (x, y), m, with velocity (vx, vy), m/s.

    `tau` (s) is the time since the beginning of the stretch that `load` (10,) describes.
    """
    return (
        load[G0X] + load[G1X] * tau - load[SPRING] * x - load[DAMPER] * vx,
        load[G0Y] + load[G1Y] * tau - load[SPRING] * y - load[DAMPER] * vy,
    )


@compiled
def contact_force(piece: Array, u: float, w: float, tau: float, load: Array) -> tuple[float, float]:
    """Return the contact force N (N) along the outward normal and the tangential operator's force (N).

    For sliding at w = ds/dt (m/s) at u of a piece (9,), `tau` (s) into a `load` (10,). N = -F.nu - m kappa w^2: thesis
    (3.3) and (3.8) with the inward centripetal force.
    """
    # the normal is (ty, -tx), so that F.nu = fx ty - fy tx
    x, y, tx, ty, _, curvature = surface_frame(piece, u)
    fx, fy = operator_force(load, tau, x, y, w * tx, w * ty)
    return -(fx * ty - fy * tx) - load[MASS] * curvature * w * w, fx * tx + fy * ty


STAGES = np.array(
    [
        # what earlier rates count for, and what their sum is divided by; then the time, as a fraction
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0],
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 1.0, 3.0],
        [0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 3.0, 2.0, 3.0],
        [1.0, 4.0, -1.0, 0.0, 0.0, 0.0, 12.0, 1.0, 3.0],
        [-1.0, 18.0, -3.0, -6.0, 0.0, 0.0, 16.0, 1.0, 2.0],
        [0.0, 9.0, -3.0, -6.0, 4.0, 0.0, 8.0, 1.0, 2.0],
        [9.0, -36.0, 63.0, 72.0, 0.0, -64.0, 44.0, 1.0, 1.0],
    ]
)
"""Butcher's sixth-order method, a row a stage."""


@compiled
def slide_for(piece: Array, slide: Slide, tau: float, h: float, load: Array) -> tuple[float, float, float, float]:
    """Return (du, w) after h seconds of sliding by thesis (3.1), and the contact impulse (N s) meanwhile.

    On a piece (9,) from `slide`, `tau` (s) into the stretch of `load` (10,): one step of Butcher's method.
    """
    u, grown, w = slide
    rates, totals = np.empty((7, 4)), np.empty(4)  # du/dt, dw/dt and the contact force
    for k in range(7):
        du, dw = 0.0, 0.0
        for i in range(k):
            du += STAGES[k, i] * rates[i, 0]
            dw += STAGES[k, i] * rates[i, 1]
        # ds/dt at this stage
        pace = w + h * dw / STAGES[k, 6]
        x, y, tx, ty, speed, curvature = surface_frame(piece, u + (grown + h * du / STAGES[k, 6]))
        fx, fy = operator_force(load, tau + STAGES[k, 7] * h / STAGES[k, 8], x, y, pace * tx, pace * ty)
        # the contact force, as in `contact_force`
        contact = -(fx * ty - fy * tx) - load[MASS] * curvature * pace * pace
        # du/dt = w / |c'(u)|, dw/dt = F_o.t / m
        rates[k, 0], rates[k, 1] = pace / speed, (fx * tx + fy * ty) / load[MASS]
        # the impulse grows by N nu
        rates[k, 2], rates[k, 3] = contact * ty, -contact * tx
    for c in range(4):
        r = rates[:, c]
        # the method's weights: 11, 0, 81, 81, -32, -32, 11 over 120
        totals[c] = h * (11.0 * (r[0] + r[6]) + 81.0 * (r[2] + r[3]) - 32.0 * (r[4] + r[5])) / 120.0
    return grown + totals[0], w + totals[1], totals[2], totals[3]


@compiled
def longest_slide_step(pace: float, w: float, along: float, load: Array, longest: float) -> float:
    """Return how long (s) a sliding step may be: `pace` (1/m) is the boundary's, `along` the tangential force (N).

    w is in m/s; `load` (10,). LONGEST_STEP says in what units, `longest` (s) is what is left.
    """
    h = longest
    omega = math.sqrt(load[SPRING] / load[MASS])
    if h * omega > LONGEST_STEP:
        h = LONGEST_STEP / omega
    # radians per second, at the speed that the force may have given the tool by the end
    turning = pace * (abs(w) + abs(along) / load[MASS] * h)
    if h * turning > LONGEST_STEP:
        h = LONGEST_STEP / turning
    return h


@compiled
def guess_between(low: float, high: float, a: float, b: float, i: int) -> float:
    """Return where to look next for the change of sign of a number that is a at `low` and b at `high`.

    By the chord, and by halves at every fourth `i`. The result is not between the two if no number lies there.
    """
    middle = low + 0.5 * (high - low)
    if i % 4 != 3 and a != b:
        # regula falsi; every fourth guess halves the bracket, so that it shrinks in any case
        by_chord = high - b * (high - low) / (b - a)
        if low < by_chord < high:
            return by_chord
    return middle


@compiled
def damped_oscillation(omega: float, half: float, h: float) -> tuple[float, float]:
    """Return e^(-at) cos(bt) and e^(-at) sin(bt) / b at t = h (s): the two solutions of a damped oscillator.

    a is `half` and b^2 = omega^2 - a^2, of either sign or zero.
    """
    square = omega * omega - half * half
    # critically damped, to rounding: sin(bt) / b becomes t
    if abs(square) <= 1e-12 * omega * omega:
        decay = math.exp(-half * h)
        return decay, h * decay
    # underdamped
    if square > 0.0:
        b, decay = math.sqrt(square), math.exp(-half * h)
        return decay * math.cos(b * h), decay * math.sin(b * h) / b
    # overdamped: two exponentials in place of cosh and sinh, which would overflow
    b = math.sqrt(-square)
    slow, fast = math.exp((b - half) * h), math.exp((-b - half) * h)
    return 0.5 * (slow + fast), 0.5 * (slow - fast) / b


@compiled
def fly_for(
    x: float, y: float, vx: float, vy: float, tau: float, h: float, load: Array
) -> tuple[float, float, float, float]:
    """Return position (m) and velocity (m/s) after h seconds of free flight, in closed form.

    The flight begins `tau` (s) into the stretch of `load` (10,).
    """
    mass, spring = load[MASS], load[SPRING]
    gx, gy = load[G0X] + load[G1X] * tau, load[G0Y] + load[G1Y] * tau
    # a force linear in time: a cubic in time
    if spring == 0.0:
        ax, ay = gx / mass, gy / mass
        jx, jy = load[G1X] / mass, load[G1Y] / mass
        return (
            x + h * (vx + h * (ax / 2.0 + h * jx / 6.0)),
            y + h * (vy + h * (ay / 2.0 + h * jy / 6.0)),
            vx + h * (ax + h * jx / 2.0),
            vy + h * (ay + h * jy / 2.0),
        )
    omega = math.sqrt(spring / mass)
    # the point at which spring and push balance moves at this velocity: g1 / k
    drift_x, drift_y = load[G1X] / spring, load[G1Y] / spring
    # where it is at tau, less what the damper lags behind
    base_x = (gx - load[DAMPER] * drift_x) / spring
    base_y = (gy - load[DAMPER] * drift_y) / spring
    # the oscillation about that point: p'' + 2 half p' + omega^2 p = 0
    half = load[DAMPER] / (2.0 * mass)
    even, odd = damped_oscillation(omega, half, h)
    px, py = x - base_x, y - base_y
    wx, wy = vx - drift_x, vy - drift_y
    square = omega * omega
    return (
        base_x + drift_x * h + px * even + (wx + half * px) * odd,
        base_y + drift_y * h + py * even + (wy + half * py) * odd,
        drift_x + wx * even - (half * wx + square * px) * odd,
        drift_y + wy * even - (half * wy + square * py) * odd,
    )
