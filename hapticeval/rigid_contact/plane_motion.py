"""How the tool moves between events in the plane: free flight, and sliding on the boundary.

What the operator does to it, and how it flies along an axis, stands in `force`.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.kernels import evaluate
from hapticeval.rigid_contact.force import LONGEST_STEP, STAGES, fly_along_axis, gained_in_step, oscillation_of
from hapticeval.types import Array

Slide: TypeAlias = tuple[float, float, float]
"""A slide under way: u where it began, how much u has grown since, and w = ds/dt (m/s)."""


@compiled
def surface_frame(piece: Array, u: float) -> tuple[float, float, float, float, float, float]:
    """Return point (x, y), m, unit tangent (tx, ty), |dc/du| and curvature (1/m) at u of a piece (9,).

    The outward normal is (ty, -tx).
    """
    x, y, dx, dy, ddx, ddy = evaluate(piece, u)
    speed = math.sqrt(dx * dx + dy * dy)
    return x, y, dx / speed, dy / speed, speed, (dx * ddy - dy * ddx) / (speed * speed * speed)


@compiled
def operator_force(load: Any, tau: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
    """Return the operator's force (N) on a tool at (x, y), m, with velocity (vx, vy), m/s.

    `tau` (s) is the time since the beginning of the stretch that `load` describes.
    """
    return (
        load.g0[0] + load.g1[0] * tau - load.spring * x - load.damper * vx,
        load.g0[1] + load.g1[1] * tau - load.spring * y - load.damper * vy,
    )


@compiled
def contact_force(piece: Array, u: float, w: float, tau: float, load: Any) -> tuple[float, float]:
    """Return the contact force N (N) along the outward normal and the tangential operator's force (N).

    For sliding at w = ds/dt (m/s) at u of a piece (9,), `tau` (s) into a `load`. N = -F.nu - m kappa w^2: thesis
    (3.3) and (3.8) with the inward centripetal force.
    """
    # the normal is (ty, -tx), so that F.nu = fx ty - fy tx
    x, y, tx, ty, _, curvature = surface_frame(piece, u)
    fx, fy = operator_force(load, tau, x, y, w * tx, w * ty)
    return -(fx * ty - fy * tx) - load.mass * curvature * w * w, fx * tx + fy * ty


@compiled
def slide_for(piece: Array, slide: Slide, tau: float, h: float, load: Any) -> tuple[float, float, float, float]:
    """Return (du, w) after h seconds of sliding by thesis (3.1), and the contact impulse (N s) meanwhile.

    On a piece (9,) from `slide`, `tau` (s) into the stretch of `load`: one step of Butcher's method.
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
        contact = -(fx * ty - fy * tx) - load.mass * curvature * pace * pace
        # du/dt = w / |c'(u)|, dw/dt = F_o.t / m
        rates[k, 0], rates[k, 1] = pace / speed, (fx * tx + fy * ty) / load.mass
        # the impulse grows by N nu
        rates[k, 2], rates[k, 3] = contact * ty, -contact * tx
    for c in range(4):
        totals[c] = gained_in_step(rates, c, h)
    return grown + totals[0], w + totals[1], totals[2], totals[3]


@compiled
def longest_slide_step(pace: float, w: float, along: float, load: Any, longest: float) -> float:
    """Return how long (s) a sliding step may be: `pace` (1/m) is the boundary's, `along` the tangential force (N).

    w is in m/s; `load`. LONGEST_STEP says in what units, `longest` (s) is what is left.
    """
    h = longest
    omega = math.sqrt(load.spring / load.mass)
    if h * omega > LONGEST_STEP:
        h = LONGEST_STEP / omega
    # radians per second, at the speed that the force may have given the tool by the end
    turning = pace * (abs(w) + abs(along) / load.mass * h)
    if h * turning > LONGEST_STEP:
        h = LONGEST_STEP / turning
    return h


@compiled
def fly_for(
    x: float, y: float, vx: float, vy: float, tau: float, h: float, load: Any
) -> tuple[float, float, float, float]:
    """Return position (m) and velocity (m/s) after h seconds of free flight, in closed form.

    The flight begins `tau` (s) into the stretch of `load`.
    """
    even, odd = oscillation_of(load, h)
    x, vx = fly_along_axis(x, vx, load.g0[0] + load.g1[0] * tau, load.g1[0], h, load, even, odd)
    y, vy = fly_along_axis(y, vy, load.g0[1] + load.g1[1] * tau, load.g1[1], h, load, even, odd)
    return x, y, vx, vy
