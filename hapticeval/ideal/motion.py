"""How the tool moves between events: free flight in closed form, and sliding on the boundary.

The operator's force on the tool is, within one stretch of time,

    F_o = g0 + g1 tau - k y - d y',      tau from the start of the stretch,

with k = d = 0 in an experiment without a hand, the hand's own spring in one with a hand, and a critically damped one,
d = 2 sqrt(k m), when the hand is led along a path.
A stretch's numbers are an array `load` (see the column names below).
"""

from __future__ import annotations

import math

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import evaluate
from hapticeval.types import Array

G0X, G0Y, G1X, G1Y, SPRING, DAMPER, MASS, RESTITUTION, BILATERAL, BEGAN = range(10)
LOADS = 10

STEP = 0.1
"""Longest step of the sliding motion, in units of its own pace: the spring's 1 / omega, or the time in which the
boundary changes its direction by one radian. The order of the method (six) then leaves errors of some 1e-12 m
and 1e-10 m/s on a 0.2 m model."""


@compiled
def surface(piece: Array, u: float) -> tuple[float, float, float, float, float, float]:
    """Point (x, y), unit tangent (tx, ty), |dc/du| and curvature at u; the outward normal is (ty, -tx)."""
    x, y, dx, dy, ddx, ddy = evaluate(piece, u)
    speed = math.sqrt(dx * dx + dy * dy)
    return x, y, dx / speed, dy / speed, speed, (dx * ddy - dy * ddx) / (speed * speed * speed)


@compiled
def push(load: Array, tau: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
    """The operator's force (N) on a tool at (x, y) with velocity (vx, vy)."""
    return (
        load[G0X] + load[G1X] * tau - load[SPRING] * x - load[DAMPER] * vx,
        load[G0Y] + load[G1Y] * tau - load[SPRING] * y - load[DAMPER] * vy,
    )


@compiled
def hold(piece: Array, u: float, w: float, tau: float, load: Array) -> tuple[float, float]:
    """Contact force N along the outward normal and tangential operator's force (N), sliding at w = ds/dt.

    N = -F.nu - m kappa w^2: thesis (3.3) and (3.8) with the inward centripetal force.
    """
    x, y, tx, ty, _, bend = surface(piece, u)
    fx, fy = push(load, tau, x, y, w * tx, w * ty)
    return -(fx * ty - fy * tx) - load[MASS] * bend * w * w, fx * tx + fy * ty


@compiled
def rates(piece: Array, u: float, w: float, tau: float, load: Array) -> tuple[float, float, float, float]:
    """(du/dt, dw/dt, contact force): thesis (3.1) along the boundary, and what the boundary answers."""
    x, y, tx, ty, speed, bend = surface(piece, u)
    fx, fy = push(load, tau, x, y, w * tx, w * ty)
    mass = load[MASS]
    answer = -(fx * ty - fy * tx) - mass * bend * w * w
    return w / speed, (fx * tx + fy * ty) / mass, answer * ty, -answer * tx


@compiled
def slid(piece: Array, u: float, w: float, tau: float, h: float, load: Array) -> tuple[float, float, float, float]:
    """(u, w) after h seconds of sliding, and the contact impulse (N s) meanwhile: Butcher's sixth-order step."""
    a1, b1, x1, y1 = rates(piece, u, w, tau, load)
    a2, b2, _, _ = rates(piece, u + h * a1 / 3.0, w + h * b1 / 3.0, tau + h / 3.0, load)
    a3, b3, x3, y3 = rates(piece, u + h * 2.0 * a2 / 3.0, w + h * 2.0 * b2 / 3.0, tau + 2.0 * h / 3.0, load)
    a4, b4, x4, y4 = rates(
        piece,
        u + h * (a1 + 4.0 * a2 - a3) / 12.0,
        w + h * (b1 + 4.0 * b2 - b3) / 12.0,
        tau + h / 3.0,
        load,
    )
    a5, b5, x5, y5 = rates(
        piece,
        u + h * (-a1 + 18.0 * a2 - 3.0 * a3 - 6.0 * a4) / 16.0,
        w + h * (-b1 + 18.0 * b2 - 3.0 * b3 - 6.0 * b4) / 16.0,
        tau + h / 2.0,
        load,
    )
    a6, b6, x6, y6 = rates(
        piece,
        u + h * (9.0 * a2 - 3.0 * a3 - 6.0 * a4 + 4.0 * a5) / 8.0,
        w + h * (9.0 * b2 - 3.0 * b3 - 6.0 * b4 + 4.0 * b5) / 8.0,
        tau + h / 2.0,
        load,
    )
    a7, b7, x7, y7 = rates(
        piece,
        u + h * (9.0 * a1 - 36.0 * a2 + 63.0 * a3 + 72.0 * a4 - 64.0 * a6) / 44.0,
        w + h * (9.0 * b1 - 36.0 * b2 + 63.0 * b3 + 72.0 * b4 - 64.0 * b6) / 44.0,
        tau + h,
        load,
    )
    return (
        u + h * (11.0 * (a1 + a7) + 81.0 * (a3 + a4) - 32.0 * (a5 + a6)) / 120.0,
        w + h * (11.0 * (b1 + b7) + 81.0 * (b3 + b4) - 32.0 * (b5 + b6)) / 120.0,
        h * (11.0 * (x1 + x7) + 81.0 * (x3 + x4) - 32.0 * (x5 + x6)) / 120.0,
        h * (11.0 * (y1 + y7) + 81.0 * (y3 + y4) - 32.0 * (y5 + y6)) / 120.0,
    )


@compiled
def slide_step(pace: float, w: float, along: float, load: Array, most: float) -> float:
    """How long a sliding step may be: `pace` (1/m) is the boundary's, `along` the tangential force (N)."""
    h = most
    omega = math.sqrt(load[SPRING] / load[MASS])
    if h * omega > STEP:
        h = STEP / omega
    turning = pace * (abs(w) + abs(along) / load[MASS] * h)
    if h * turning > STEP:
        h = STEP / turning
    return h


@compiled
def ringing(omega: float, half: float, h: float) -> tuple[float, float]:
    """e^(-at) cos(bt) and e^(-at) sin(bt) / b at t = h; a is `half` and b^2 = omega^2 - a^2, of either sign or zero."""
    square = omega * omega - half * half
    if abs(square) <= 1e-12 * omega * omega:
        decay = math.exp(-half * h)
        return decay, h * decay
    if square > 0.0:
        b, decay = math.sqrt(square), math.exp(-half * h)
        return decay * math.cos(b * h), decay * math.sin(b * h) / b
    b = math.sqrt(-square)
    slow, fast = math.exp((b - half) * h), math.exp((-b - half) * h)
    return 0.5 * (slow + fast), 0.5 * (slow - fast) / b


@compiled
def flown(
    x: float, y: float, vx: float, vy: float, tau: float, h: float, load: Array
) -> tuple[float, float, float, float]:
    """Position and velocity after h seconds of free flight, in closed form."""
    mass, spring = load[MASS], load[SPRING]
    gx, gy = load[G0X] + load[G1X] * tau, load[G0Y] + load[G1Y] * tau
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
    drift_x, drift_y = load[G1X] / spring, load[G1Y] / spring
    base_x = (gx - load[DAMPER] * drift_x) / spring
    base_y = (gy - load[DAMPER] * drift_y) / spring
    half = load[DAMPER] / (2.0 * mass)
    even, odd = ringing(omega, half, h)
    px, py = x - base_x, y - base_y
    wx, wy = vx - drift_x, vy - drift_y
    square = omega * omega
    return (
        base_x + drift_x * h + px * even + (wx + half * px) * odd,
        base_y + drift_y * h + py * even + (wy + half * py) * odd,
        drift_x + wx * even - (half * wx + square * px) * odd,
        drift_y + wy * even - (half * wy + square * py) * odd,
    )
