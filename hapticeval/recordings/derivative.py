"""Whether a velocity is the derivative of its position: compared as increments, which filters leave alone.

Differences from row to row are no fair measure. An encoder's quantum q makes them noisy by about q / dt, and the
low-pass that every controller puts on them takes away what is fast. What a filtered velocity still owes is its
integral. With the filter's weights h_j, which sum to one,

    v_k = sum_j h_j (p_{k-j} - p_{k-j-1}) / dt      so that      sum of v dt over W rows = increment of h * p over them

and h * p is the position itself, late by the filter's mean lag L = sum_j j h_j, with an error of the second order in
the ratio of L to the time in which the motion changes. Both increments carry encoder noise of q / sqrt(6) at most,
from the rounding at either end, whatever W is, while the motion in them grows with W. So for windows from `SHORTEST`
rows on, in octaves, the integral of the velocity is regressed on the increment of the position, at the lag that fits
best. A wrong sign or unit is the same factor in every window, and a shift the same lag; what a filter does to a
shaking hand is gone in long windows, where strokes are the most of an increment. So the longest window in which the
two are alike is judged; where there is none, the one that comes nearest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hapticeval.recordings.signal_faults import stretches
from hapticeval.types import Array, BoolArray

LAGS = 20
"""Ticks over which a lag is looked for."""

SHORTEST = 8
"""Rows of the shortest window."""

LIKE = 0.8
"""Correlation below which a velocity is not the derivative of its position."""

INDEPENDENT = 10
"""So many windows that do not overlap are the fewest that a correlation is taken from."""

ENOUGH = 20_000
"""About so many windows are looked at, spread over the stretch."""

NOISY = 3.0
"""Increments that vary by less than so many times their encoder noise, q / sqrt(6), tell nothing. Of a position that is
made of several encoders q is the usual step from row to row, where it steps at all: at rest that is their dither."""


ALIKE = 1.1
"""Lags that leave up to so many times as much unexplained as the best one explain a velocity as well."""


class Fit(NamedTuple):
    """A velocity on its position's derivative: the `ratio` of their increments over windows of `window` rows, their
    `correlation` (0 to 1), the velocity's `lag` in ticks, and the `rows` that were looked at."""

    ratio: float
    correlation: float
    lag: int
    window: int
    rows: int


def derivative_fit(position: Array, speed: Array, time: Array, sound: BoolArray) -> Fit | None:
    """How a velocity (n,) follows its position (n,) over the longest stretch of `sound` rows without a gap.

    None where too little moves above the noise of the position.
    """
    found = stretches(sound, time)
    if not found:
        return None
    first, end = max(found, key=lambda each: each[1] - each[0])
    first += 2 * LAGS  # a filter that starts there knows nothing of what was before
    position, speed, time = position[first:end], speed[first:end], time[first:end]
    if position.size < INDEPENDENT * SHORTEST + LAGS:
        return None
    steps = np.abs(np.diff(position))
    noise = float(np.median(steps[steps > 0.0])) / np.sqrt(6.0) if np.any(steps > 0.0) else 0.0
    # The speed at a row is that of the step that led there.
    integral = np.concatenate([[0.0], np.cumsum(speed[1:] * np.diff(time))])
    best: Fit | None = None
    window = SHORTEST
    while position.size >= INDEPENDENT * window + LAGS:
        moved, made = position[window:] - position[:-window], integral[window:] - integral[:-window]
        if np.std(moved) > NOISY * noise:
            ratio, like, lag = _regressed(moved, made, max(window // SHORTEST, moved.size // ENOUGH, 1))
            if best is None or like >= LIKE or like > best.correlation:
                best = Fit(ratio, like, lag, window, position.size)
        window *= 2
    return best


def _regressed(moved: Array, made: Array, stride: int) -> tuple[float, float, int]:
    """Slope of `made` on `moved`, their correlation without its sign, and the lag (of the least size) where it is
    best; of one window in `stride`, since they overlap."""
    lags = sorted(range(-LAGS, LAGS + 1), key=abs)
    likes = np.array([correlation(*_shifted(moved, made, lag, stride)) for lag in lags])
    # What noise leaves unexplained hardly depends on the lag: the least lag that explains as much as any.
    unexplained = 1.0 - np.abs(likes)
    place = int(np.argmax(unexplained <= ALIKE * unexplained.min() + 1e-12))
    best, at = float(likes[place]), lags[place]
    x, y = _shifted(moved, made, at, stride)
    x, y = x - x.mean(), y - y.mean()
    return float(np.dot(x, y) / np.dot(x, x)) if np.any(x) else float("inf"), abs(best), at


def _shifted(x: Array, y: Array, lag: int, stride: int) -> tuple[Array, Array]:
    """What `y` is `lag` rows after `x`, at one row in `stride`."""
    a, b = (x[: x.size - lag], y[lag:]) if lag >= 0 else (x[-lag:], y[: y.size + lag])
    return a[::stride], b[::stride]


def correlation(x: Array, y: Array) -> float:
    """Pearson's, 0 where one of them does not vary."""
    x, y = x - x.mean(), y - y.mean()
    scale = float(np.sqrt(np.dot(x, x) * np.dot(y, y)))
    return float(np.dot(x, y)) / scale if scale > 0.0 else 0.0
