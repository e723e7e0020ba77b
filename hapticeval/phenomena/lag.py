"""The one lag that each channel of a run has: how many ticks late its IHIPs and its forces are, whole or between."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from hapticeval.phenomena.decisions import (
    BETWEEN_TICKS,
    LAG_HALVINGS,
    LAG_ROWS,
    LAG_STEPS,
    LAG_TICKS,
    LAW_RANK,
    LIKELY_SHARE,
    TELLING_SHARE,
    WHOLE_LAG,
)
from hapticeval.phenomena.sampling import lengths_of, rounding
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray

KINDS_OF_LAG = np.array([(1.0, 0.0), (1.0, 1.0), (0.0, -1.0)])
"""How late a force is behind HIP and IHIP in units of one lag: all of the answer late, the force, the IHIP alone."""

TINY = float(np.finfo(float).tiny)
"""The least length that is divided by: a column of zeros stays one."""


class Lag(NamedTuple):
    """How many ticks late the channels of a run are, one number each for all of it, 0 where none is seen.

    - `ihip`: the IHIP of a row answers the HIP of so many ticks before.
    - `force_hip`, `force_ihip`: the force of a row pulls the HIP of so many ticks before to the IHIP that was recorded
      so many ticks before. The second is negative where the IHIP was recorded later than the force that is made of it.

    All lie within `LAG_TICKS`.
    """

    ihip: float
    force_hip: float
    force_ihip: float

    @property
    def force(self) -> float:
        """Ticks since the oldest HIP that a force is made of."""
        return max(self.force_hip, self.force_ihip + self.ihip, 0.0)


def find_lag(recording: Recording, scene: Scene, contact: BoolArray, pressed: BoolArray | None) -> Lag:
    """Return the lags of a run in `contact` (n,), with a force where it is `pressed` (n,); None without forces.

    It is 0 for a channel that was not recorded. A lag is believed where it explains nine tenths of what is off without
    it (`TELLING_SHARE`); what is explained without one has none, and neither has what no single lag explains: a latency
    that changes from tick to tick.
    """
    if "ihip" not in recording.channels:
        return Lag(0.0, 0.0, 0.0)
    exact = scene.stiffness * rounding(scene)
    force_hip, force_ihip = (0.0, 0.0) if pressed is None else _find_force_lag(recording, pressed, exact)
    return Lag(_find_ihip_lag(recording, scene, contact), force_hip, force_ihip)


def between_ticks(*lags: float) -> bool:
    """Return whether one of some lags is no whole number of ticks."""
    return any(abs(lag - round(lag)) > WHOLE_LAG for lag in lags)


def delayed(values: Array, rows: IntArray, ticks_before: float = 0.0) -> Array:
    """Return `values` (n, N), as m or N, so many `ticks_before` each of `rows` (k,): between two on the straight line.

    Rows before the first are the first, and rows after the last the last.
    """
    place = np.clip(rows - ticks_before, 0.0, len(values) - 1.0)
    before = place.astype(np.int64)
    after = np.minimum(before + 1, len(values) - 1)
    # v = (1 - s) v_before + s v_after; in full, for numpy is slow along an axis of two or three numbers
    share = np.repeat(place - before, values.shape[1]).reshape(-1, values.shape[1])
    return np.asarray((1.0 - share) * values.take(before, axis=0) + share * values.take(after, axis=0))


def _spread_rows(rows: IntArray) -> IntArray:
    """Return `LAG_ROWS` of the rows at the most, spread over all."""
    return rows[:: -(-rows.size // LAG_ROWS) or 1]


def resting_ticks(values: Array) -> IntArray:
    """Return how many ticks each of `values` (n, N), as m or N, has stood still, (n,), at most `LAG_TICKS`.

    A proxy that moves in every second tick only is a tick later where it rests, and shows it.
    """
    # The first row counts as moved: it differs from a row of NaN.
    moved = np.any(np.diff(values, axis=0, prepend=np.nan) != 0.0, axis=1)
    rows = np.arange(len(values))
    return np.asarray(np.minimum(rows - np.maximum.accumulate(np.where(moved, rows, 0)), LAG_TICKS))


def over_lag(values: Array, rows: IntArray) -> Array:
    """Return `values` (n,), m, at `rows` (k,) and at the ticks before that an answer may be late: (lags, k)."""
    return np.array([values[np.maximum(rows - lag, 0)] for lag in range(LAG_TICKS + 1)])


def largest_in_lag(values: Array, *, earlier: int = 0) -> Array:
    """Return the largest (n,) of `values` (n,), N or m, within the lag of each, and so many ticks `earlier` too."""
    padded = np.pad(values, (LAG_TICKS + earlier, LAG_TICKS), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * LAG_TICKS + 1 + earlier)
    return np.asarray(windows.max(axis=1))


def beside_straight(values: Array) -> Array:
    """Return how far (n,) `values` (n, N), as m or N, may be off the straight line between two ticks."""
    aside = np.pad(np.linalg.norm(np.diff(values, 2, axis=0), axis=1), 1, mode="edge")
    return np.asarray(BETWEEN_TICKS * largest_in_lag(aside))


def least_misfit(misfit: Callable[[float], float]) -> float:
    """Return the lag within [0, `LAG_TICKS`] ticks with the least `misfit`, to 2e-9 ticks.

    Of several that fit alike, within the rounding of doubles, it is the least.
    """
    lags = np.linspace(0.0, LAG_TICKS, LAG_STEPS + 1)
    misfits = np.array([misfit(float(lag)) for lag in lags])
    best = int(np.argmin(misfits))
    low, high = float(lags[max(best - 1, 0)]), float(lags[min(best + 1, LAG_STEPS)])
    # Golden section: of the two inner points one is kept at each narrowing, and one misfit is new.
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    left, right = high - golden * (high - low), low + golden * (high - low)
    at_left, at_right = misfit(left), misfit(right)
    for _ in range(LAG_HALVINGS):
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - golden * (high - low)
            at_left = misfit(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + golden * (high - low)
            at_right = misfit(right)
    # A whole quarter of a tick that fits as well is the lag: rounding would move it.
    between = 0.5 * (low + high)
    return float(lags[best]) if misfits[best] <= misfit(between) else float(between)


def believed_lag(misfit: Callable[[float], float], exact: float) -> tuple[float, float]:
    """Return the lag that explains nine tenths of the misfit without one, else 0; and the misfit with it.

    A misfit without a lag of up to `exact` is none.
    """
    without = misfit(0.0)
    if without <= exact:
        return 0.0, without
    lag = least_misfit(misfit)
    # The share of the misfit that the lag does not explain decides whether it is one.
    remaining = misfit(lag)
    return (lag, remaining) if remaining <= TELLING_SHARE * without else (0.0, without)


def _find_ihip_lag(recording: Recording, scene: Scene, contact: BoolArray) -> float:
    """Find how late the IHIP is: in free space it is the HIP, and in `contact` (n,) the displacement to it is normal.

    The misfit is the mean of what is left of that displacement: all of it in free space, and its part along the surface
    in contact. A map that has its contact point elsewhere fits at no lag.

    A tool may be late in contact alone, where a slow thread moves it: rows in which it is with the hand tell nothing.
    """
    # A queue that starts with the run is not filled before.
    rows = np.arange(LAG_TICKS, len(recording), dtype=np.int64)
    rows = _spread_rows(rows[(contact | recording.apart)[LAG_TICKS:]])
    if rows.size == 0:
        return 0.0
    ihip = recording.ihip[rows]
    inside = np.flatnonzero(contact[rows])
    angle_outside = scene.model.boundary.normal_cone(ihip[inside], np.full(inside.size, rounding(scene)))

    def misfit(lag: float, since: IntArray) -> float:
        """Return the mean displacement (m) from IHIPs (k, N) to the HIPs `lag` ticks before the rows `since` (k,)."""
        errors = ihip - delayed(recording.hip, since, lag)
        distances = lengths_of(errors)
        # In contact only what leans out of the normal cone counts: the depth is not a misfit.
        angles = angle_outside(errors[inside])
        if scene.bilateral:
            angles = np.minimum(angles, angle_outside(-errors[inside]))
        distances[inside] *= np.sin(np.minimum(angles, 0.5 * np.pi))
        return float(distances.mean())

    exact = rounding(scene)
    if misfit(0.0, rows) <= exact:
        return 0.0
    # A proxy that rests answers the HIP of the tick in which it last moved.
    since = rows - resting_ticks(recording.ihip)[rows]
    return believed_lag(lambda lag: misfit(lag, since), exact)[0]


def _find_force_lag(recording: Recording, pressed: BoolArray, exact: float) -> tuple[float, float]:
    """Find how late the force is behind the HIP and behind the IHIP: as a spring between them, linear or a root of it.

    It is asked where there is a force, `pressed` (n,); a misfit of up to `exact` (N) is none.

    Three kinds are told apart, and of those that fit alike the first counts: the whole answer is late, the force alone
    is, or it is made of an IHIP that is recorded late.
    """
    rows = _rows_with_force(pressed)
    if rows.size == 0:
        return 0.0, 0.0
    return lags_of_kinds(_spring_misfit(recording, rows), exact)


def lags_of_kinds(misfit: Callable[[float, float], float], exact: float) -> tuple[float, float]:
    """Return how many ticks ago the HIP and the IHIP are that forces are made of, of `KINDS_OF_LAG`.

    `misfit(hip, ihip)` (N) is what a law leaves of the forces with these lags; up to `exact` (N) it is none. Of kinds
    that fit alike the first counts.
    """
    if misfit(0.0, 0.0) <= exact:
        return 0.0, 0.0

    def fit(kind: Array) -> tuple[float, float]:
        """Return lag (ticks) and misfit (N) of a `kind` (2,): what the HIP's and the IHIP's lags are in units of it."""
        return believed_lag(lambda lag: misfit(*(lag * kind)), exact)

    fits = np.array([fit(kind) for kind in KINDS_OF_LAG])
    alike = fits[:, 1] <= (1.0 + TELLING_SHARE) * max(float(fits[:, 1].min()), exact)
    first = int(np.argmax(alike))
    hip, ihip = (fits[first, 0] * KINDS_OF_LAG[first]).tolist()
    return hip, ihip


def likely_force_lags(recording: Recording, pressed: BoolArray) -> list[tuple[float, float]]:
    """Return the lags (ticks) behind HIP and IHIP that explain half of what is off a spring, of each of `KINDS_OF_LAG`.

    The rows with a force (N) are `pressed` (n,). For a law that is not a spring in every tick: whether it keeps one of
    these lags has to be asked then. Half is `LIKELY_SHARE`.
    """
    rows = _rows_with_force(pressed)
    if rows.size == 0:
        return []
    misfit = _spring_misfit(recording, rows)
    best = [least_misfit(lambda lag, kind=kind: misfit(*(lag * kind))) * kind for kind in KINDS_OF_LAG]  # type: ignore[misc]
    without = misfit(0.0, 0.0)
    return [(float(hip), float(ihip)) for hip, ihip in best if misfit(hip, ihip) <= LIKELY_SHARE * without]


def _rows_with_force(pressed: BoolArray) -> IntArray:
    """Return the rows, spread over all, with a force above the floor, `pressed` (n,), and three ticks around them."""
    ends = np.arange(LAG_TICKS, pressed.size - LAG_TICKS, dtype=np.int64)
    return _spread_rows(ends[pressed[ends]])


def _spring_misfit(recording: Recording, rows: IntArray) -> Callable[[float, float], float]:
    """Return the mean force (N) at `rows` (k,) that a spring does not explain, by the lags (ticks) of HIP and IHIP."""
    force = recording.force[rows]
    # one of the two has the same lag in many of the pairs
    hips, ihips = (cache(partial(delayed, values, rows)) for values in (recording.hip, recording.ihip))

    def misfit(hip: float, ihip: float) -> float:
        """Return the mean force (N) that the spring between HIP and IHIP of these lags (ticks) does not explain."""
        errors = ihips(ihip) - hips(hip)
        depth = lengths_of(errors)[:, np.newaxis]
        # Two laws: F ~ e, a linear spring, and F ~ e / sqrt|e|, a root of the depth.
        roots = np.divide(errors, np.sqrt(depth), out=np.zeros_like(errors), where=depth > 0.0)
        # Normal equations of F = g1 e + g2 e / sqrt|e|, on columns of unit length.
        laws = np.column_stack([_unit(errors.ravel()), _unit(roots.ravel())])
        gains = np.linalg.lstsq(laws.T @ laws, laws.T @ force.ravel(), rcond=LAW_RANK)[0]
        return float(lengths_of(force - (laws @ gains).reshape(force.shape)).mean())

    return misfit


def _unit(column: Array) -> Array:
    """Return numbers (n,) divided by the root of the sum of their squares, or by the least number where that is 0."""
    # one after the other, and not by halves as np.sum: a search down to the last digit follows the rounding
    return np.asarray(column / max(math.sqrt(np.cumsum(np.square(column))[-1]), TINY))


def force_only_lag(recording: Recording, pressed: BoolArray) -> int:
    """Return how many whole ticks late a force is at the most that comes with IHIPs of `Observed.with_nearest_points`.

    That of the spring from there, linear or a root, that fits best where the force (N) is `pressed` (n,); between two
    ticks the later one, for a field need not be such a spring.
    """
    rows = _rows_with_force(pressed)
    if rows.size == 0:
        return 0
    misfit = _spring_misfit(recording, rows)
    return math.ceil(least_misfit(lambda lag: misfit(lag, lag)) - WHOLE_LAG)
