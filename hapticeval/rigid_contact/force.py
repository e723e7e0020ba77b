"""What the operator does to the tool in one stretch of time, in the plane and in space, and how it flies under that.

The operator's force on the tool is, within one stretch of time,

    F_o = g0 + g1 tau - k y - d y',      tau from the start of the stretch,

and k and d are

- zero in an experiment without a hand;
- those of the hand's own spring in one with a hand;
- a critically damped spring's, d = 2 sqrt(k m), when the hand is led along a path.

A stretch's numbers are an array `load` (6 + 2 N,) in N dimensions, see the names of its places.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hapticeval.compiled import compiled, inner
from hapticeval.types import Array, IntArray

SPRING, DAMPER, MASS, RESTITUTION, BILATERAL, BEGAN, PUSH = range(7)
"""Places in a `load` (6 + 2 N,).

The spring's k (N/m), the damper's d (N s/m), the tool's mass (kg), the coefficient of restitution, 1 if the boundary
holds the tool from both sides, and when the stretch began (s); from PUSH on g0 (N) by axis, then g1 (N/s) by axis.
"""

FLIGHT, SLIDE, REST = 0.0, 1.0, 2.0
"""What the tool does: it flies, slides on the boundary, or is at rest in a corner."""

IMPACT, LEAVE, CORNER, STOP = range(4)
EVENT_KINDS = ("impact", "leave", "corner", "rest")
"""Kinds of events, and their names in a recording."""

CONTACT_HOP = 1e-12
"""Longest hop (m) that is taken as contact: well above the rounding of positions, and the impulse that it leaves
out, below m sqrt(8 a CONTACT_HOP), is 1e-6 of that of a metre's fall."""

ALIGNED_SHARE = 1e-12
"""Share of the speed below which a velocity across a face is rounding."""

MOST_CORNER_HITS = 100_000
"""Most hits of one visit to a corner: in a sharp notch they all come at once, and each takes a small share of the
speed. A tool that loses some at each is then at rest."""

SEAM_REACH = 1e-9
"""How far (m) a piece of the boundary, a cell of a curve or a triangle, reaches beyond its ends that are not convex, so
that no path slips through between two."""

SKIN_DEPTH = 1e-13
"""Depth (m) from which a tool in flight counts as inside: above the rounding of positions up to 100 m.

So a tool that has just left the surface, or bounced, does not collide with it again. The collision itself is located
where the depth is zero.
"""

FLIGHT_STEP = 2e-3
"""Longest step of a flight (s): within it the height over a cell has one extremum at the most."""

LONGEST_STEP = 0.1
"""Longest step of the sliding motion, in units of its own pace.

That is the spring's 1 / omega, or the time in which the boundary changes its direction by one radian. The order of the
method (six) then leaves errors of some 1e-12 m and 1e-10 m/s on a 0.2 m model.
"""


MOST_GUESSES = 120
"""Most guesses at a change of sign: every fourth halves what is left, and rounding ends it before."""


class Stretches(NamedTuple):
    """Stretches of time in which the operator's force is linear: where they `began` and how long each `lasts` (s,), s.

    `forces` (s, 2 N) is g0 and g1 of a stretch; `samples` (s,) the sample interval that it belongs to.
    """

    began: Array
    lasts: Array
    forces: Array
    samples: IntArray


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
def narrow_bracket(
    low: float, high: float, a: float, b: float, side_kept: int, middle: float, value: float, positive: bool
) -> tuple[float, float, float, float, int]:
    """Return `low`, `high`, their values a and b, and the side kept, after the `value` at `middle` was looked at.

    `positive` says whether the value at the first `low` was. By the Illinois rule the value of an end that is kept
    twice is halved, so that the chord leaves it; `side_kept` is 1 where `high` was kept last, 2 for `low`, 0 at first.
    """
    if (value > 0.0) == positive:
        return middle, high, value, b * (0.5 if side_kept == 1 else 1.0), 1
    return low, middle, a * (0.5 if side_kept == 2 else 1.0), value, 2


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
def oscillation_of(load: Array, h: float) -> tuple[float, float]:
    """Return `damped_oscillation` of the spring in a `load` (6 + 2 N,) after h seconds; without a spring 1 and h."""
    if load[SPRING] == 0.0:
        return 1.0, h
    return damped_oscillation(math.sqrt(load[SPRING] / load[MASS]), load[DAMPER] / (2.0 * load[MASS]), h)


@inner
def fly_along_axis(
    x: float, v: float, push: float, rate: float, h: float, load: Array, even: float, odd: float
) -> tuple[float, float]:
    """Return position (m) and velocity (m/s) along one axis after h seconds of free flight, in closed form.

    `push` (N) and `rate` (N/s) are the prescribed force at the flight's start and how fast it grows; `even` and `odd`
    are `oscillation_of` the `load` (6 + 2 N,) for h.
    """
    mass, spring = load[MASS], load[SPRING]
    # a force linear in time: a cubic in time
    if spring == 0.0:
        a, j = push / mass, rate / mass
        return x + h * (v + h * (a / 2.0 + h * j / 6.0)), v + h * (a + h * j / 2.0)
    # the point at which spring and push balance moves at this velocity: g1 / k
    drift = rate / spring
    # where it is at the start, less what the damper lags behind
    base = (push - load[DAMPER] * drift) / spring
    # the oscillation about that point: p'' + 2 half p' + omega^2 p = 0
    half, omega = load[DAMPER] / (2.0 * mass), math.sqrt(spring / mass)
    p, w = x - base, v - drift
    return (
        base + drift * h + p * even + (w + half * p) * odd,
        drift + w * even - (half * w + omega * omega * p) * odd,
    )


@compiled
def longest_flight_step(load: Array, time_left: float) -> float:
    """Return how long (s) a step of flight may be under a `load` (6 + 2 N,), at most `time_left`."""
    h = min(time_left, FLIGHT_STEP)
    # a fifth of a radian of the spring's oscillation
    if load[SPRING] > 0.0:
        h = min(h, 0.2 * math.sqrt(load[MASS] / load[SPRING]))
    return h
