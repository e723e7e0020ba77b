"""What the operator does to the tool in one stretch of time, in the plane and in space, and how it flies under that.

How slides are integrated, and in what steps, stands here too.

The operator's force on the tool is, within one stretch of time,

    F_o = g0 + g1 tau - k y - d y',      tau from the start of the stretch,

and k and d are

- zero in an experiment without a hand;
- those of the hand's own spring in one with a hand;
- a critically damped spring's, d = 2 sqrt(k m), when the hand is led along a path.

A stretch's numbers are the record `LOAD`, in the plane and in space.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hapticeval.compiled import compiled, inner
from hapticeval.records import record_type
from hapticeval.types import Array, IntArray

LOAD = record_type(
    "spring", "damper", "mass", "restitution", "bilateral", "hop", "skin", "rounding", "began", g0=3, g1=3
)
"""The spring's k (N/m), the damper's d (N s/m), the tool's mass (kg), the coefficient of restitution, 1 if the boundary
holds the tool from both sides; the longest hop that is contact, the depth that is inside and the rounding of positions
(m); when the stretch began (s); then g0 (N) and g1 (N/s) by axis."""

FLIGHT, SLIDE, REST = 0.0, 1.0, 2.0
"""What the tool does: it flies, slides on the boundary, or is at rest in a corner."""

IMPACT, LEAVE, CORNER, STOP = range(4)
EVENT_KINDS = ("impact", "leave", "corner", "rest")
"""Kinds of events, and their names in a recording."""

PLACE_REACH = 1e-12
"""How far (m) a tool may be off an edge or a corner that it has come to: well above the rounding of positions."""

HOP_SHARE = 5e-12
"""Longest hop that is taken as contact, as a share of the model's size: 1 pm of 200 mm, well above the rounding of
positions. The impulse that it leaves out, below m sqrt(8 a hop), is 1e-6 of that of a fall from five times the size.

A share and no length, so that a scene that is scaled moves alike; so is `SKIN_SHARE`.
"""

ALIGNED_SHARE = 1e-12
"""Share of the speed below which a velocity across a face is rounding."""

MOST_CORNER_HITS = 100_000
"""Most hits of one visit to a corner: in a sharp notch they all come at once, and each takes a small share of the
speed. A tool that loses some at each is then at rest."""

MOST_SAMPLE_STEPS = 100_000
"""Most steps within one sample, after which a run is given up. *Chosen*: as many as one visit to a corner may take
hits, and of the shortest steps, 0.02 rad of a turn or an oscillation, 318 turns: no sample shows these.
"""

SEAM_REACH = 1e-9
"""How far (m) a cell of a curve reaches beyond its ends that are not convex, and a triangle beyond its concave edges:
no path slips through between two."""

OFF_CUBIC_SHARE = 0.05
"""Share of its extent by which a path may leave the hull of its control polygon. *Chosen*: the hull holds a cubic, and
the spring's exponential differs from one by far less."""

POSITION_ROUNDING = 1e-15
"""Share of the model's farthest coordinate that is above the rounding of positions."""

SKIN_SHARE = 5e-13
"""Depth from which a tool in flight counts as inside: beside `POSITION_ROUNDING` a share of the model's size, 0.1 pm of
200 mm.

So a tool that has just left the surface, or bounced, does not collide with it again. The collision itself is located
where the depth is zero. A slide that begins at an edge is put onto it, so that rounding alone tells it from there: up
one face it may go less far than a skin, and back, while on the other it goes far.
"""

FLIGHT_STEP = 2e-3
"""Longest step of a flight (s): within it the height over a cell bends the other way once at the most."""

LONGEST_STEP = 0.1
"""Longest step of the sliding motion, in units of its own pace.

That is the spring's 1 / omega, or the time in which the boundary changes its direction by one radian. The order of the
method (six) then leaves errors of some 1e-12 m and 1e-10 m/s on a 0.2 m model.
"""


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


class Stretches(NamedTuple):
    """Stretches of time in which the operator's force is linear: where they `began` and how long each `lasts` (s,), s.

    `forces` (s, 2 N) is g0 and g1 of a stretch; `samples` (s,) the sample interval that it belongs to.
    """

    began: Array
    lasts: Array
    forces: Array
    samples: IntArray


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
def oscillation_of(load: Any, h: float) -> tuple[float, float]:
    """Return `damped_oscillation` of the spring in a `LOAD` after h seconds; without a spring 1 and h."""
    if load.spring == 0.0:
        return 1.0, h
    return damped_oscillation(math.sqrt(load.spring / load.mass), load.damper / (2.0 * load.mass), h)


@inner
def fly_along_axis(
    x: float, v: float, push: float, rate: float, h: float, load: Any, even: float, odd: float
) -> tuple[float, float]:
    """Return position (m) and velocity (m/s) along one axis after h seconds of free flight, in closed form.

    `push` (N) and `rate` (N/s) are the prescribed force at the flight's start and how fast it grows; `even` and `odd`
    are `oscillation_of` the `LOAD` for h.
    """
    mass, spring = load.mass, load.spring
    # a force linear in time: a cubic in time
    if spring == 0.0:
        a, j = push / mass, rate / mass
        return x + h * (v + h * (a / 2.0 + h * j / 6.0)), v + h * (a + h * j / 2.0)
    # the point at which spring and push balance moves at this velocity: g1 / k
    drift = rate / spring
    # where it is at the start, less what the damper lags behind
    base = (push - load.damper * drift) / spring
    # the oscillation about that point: p'' + 2 half p' + omega^2 p = 0
    half, omega = load.damper / (2.0 * mass), math.sqrt(spring / mass)
    p, w = x - base, v - drift
    return (
        base + drift * h + p * even + (w + half * p) * odd,
        drift + w * even - (half * w + omega * omega * p) * odd,
    )


@inner
def gained_in_step(rates: Array, column: int, h: float) -> float:
    """Return what a quantity, such as a place in m, gains in h seconds, by its `rates` (7, k) at `STAGES`."""
    r = rates[:, column]
    # the method's weights: 11, 0, 81, 81, -32, -32, 11 over 120
    return float(h * (11.0 * (r[0] + r[6]) + 81.0 * (r[2] + r[3]) - 32.0 * (r[4] + r[5])) / 120.0)


@compiled
def longest_flight_step(load: Any, time_left: float) -> float:
    """Return how long (s) a step of flight may be under a `LOAD`, at most `time_left`."""
    h = min(time_left, FLIGHT_STEP)
    # a fifth of a radian of the spring's oscillation
    if load.spring > 0.0:
        h = min(h, 0.2 * math.sqrt(load.mass / load.spring))
    return h
