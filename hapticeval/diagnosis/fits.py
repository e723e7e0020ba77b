"""Fits of one signal to another that the causes share: a delay, a filter, a hold, a level, an interval, and noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from hapticeval.types import Array, BoolArray, IntArray

NORMAL_MEDIAN = 0.6745
"""Median of |x| of a normal distribution of deviation one."""

THIRD_DIFFERENCES = 20.0
"""Variance of a third difference of white noise of variance one: 1 + 9 + 9 + 1."""

NEXT_TO_NOTHING = 1e-12
"""Share of a signal's power that is its rounding."""

KNOTS = 12
"""Knots of a gain that varies with something; *chosen*: twelve see a wave and a half."""

BINS = 48
"""Edges at which an interval may begin or end at first, before it is placed to the tick; *chosen*."""


def power(vectors: Array) -> float:
    """Return the sum of squares of `vectors` (n, N)."""
    return float(np.einsum("ij,ij->", vectors, vectors))


def delayed(signal: Array, ticks: float, first: Array | None = None) -> Array:
    """Return `signal` (n, N) so many ticks later, a fraction between two rows; earlier where negative.

    What came before the first row is `first` (N,), or the first row itself.
    """
    full_ticks = int(np.floor(ticks))
    share = ticks - full_ticks
    late = _shifted(signal, full_ticks, first)
    return late if share == 0.0 else (1.0 - share) * late + share * _shifted(signal, full_ticks + 1, first)


def _shifted(signal: Array, ticks: int, first: Array | None) -> Array:
    if ticks == 0:
        return signal
    if ticks < 0:
        return np.concatenate([signal[-ticks:], np.repeat(signal[-1:], -ticks, axis=0)])
    before = signal[0] if first is None else first
    return np.concatenate([np.repeat(before[None], ticks, axis=0), signal[:-ticks]])


class Delay(NamedTuple):
    """A signal that is another one `ticks` later, times `gain`; `left` is the sum of squares that this leaves."""

    ticks: float
    gain: float
    left: float


def fit_delay(signal: Array, source: Array, *, max_ticks: int, early: bool, free_gain: bool) -> Delay:
    """Return the delay of `signal` behind `source` (n, N) that leaves least, up to `max_ticks`, between ticks too.

    All whole delays at once by the Fourier transform, then between the best one and its neighbours.
    """
    count = len(signal)
    size = 1 << (2 * count - 1).bit_length()
    spectra = np.fft.rfft(signal, size, axis=0) * np.conj(np.fft.rfft(source, size, axis=0))
    common = np.fft.irfft(spectra.sum(axis=1), size)
    ticks = np.arange(-max_ticks if early else 0, max_ticks + 1)
    # What is shifted in at an end is the row there: its share of the common power and of the source's own.
    sums = np.concatenate([np.zeros((1, signal.shape[1])), np.cumsum(signal, axis=0)])
    own = np.concatenate([[0.0], np.cumsum(np.einsum("ij,ij->i", source, source))])
    away = np.abs(ticks)
    at_first = ticks >= 0
    shared = common[ticks] + np.where(at_first, sums[away] @ source[0], (sums[-1] - sums[count - away]) @ source[-1])
    source_power = np.where(at_first, own[count - away], own[-1] - own[away])
    source_power = source_power + away * np.where(at_first, source[0] @ source[0], source[-1] @ source[-1])
    # Delayed so far that nothing of the source is left, it has no gain.
    some_left = source_power > NEXT_TO_NOTHING * own[-1]
    gain = (
        np.where(some_left, shared / np.where(some_left, source_power, 1.0), 0.0) if free_gain else np.ones(len(ticks))
    )
    best = int(ticks[np.argmin(source_power * gain**2 - 2.0 * gain * shared)])
    return min((_between(signal, source, start, free_gain) for start in (best - 1, best)), key=lambda fit: fit.left)


def fit_delay_within(signal: Array, source: Array, rows: BoolArray, *, max_ticks: int) -> int:
    """Return the whole delay, up to `max_ticks`, of `signal` behind `source` (n, N) that leaves least in `rows` (n,).

    Sum over rows of |f(t) - s(t - k)|^2, of which two terms depend on k: both by the Fourier transform.
    """
    size = 1 << (2 * len(signal) - 1).bit_length()
    masked = signal * rows[:, None]
    spectra = np.fft.rfft(masked, size, axis=0) * np.conj(np.fft.rfft(source, size, axis=0))
    common = np.fft.irfft(spectra.sum(axis=1), size)[: max_ticks + 1]
    own = np.fft.rfft(rows.astype(float), size) * np.conj(np.fft.rfft(np.einsum("ij,ij->i", source, source), size))
    return int(np.argmin(np.fft.irfft(own, size)[: max_ticks + 1] - 2.0 * common))


def _between(signal: Array, source: Array, start: int, free_gain: bool) -> Delay:
    """Return the best delay from `start` to the next tick: `signal` = gain (late + share (later - late))."""
    late = _shifted(source, start, None)
    change = _shifted(source, start + 1, None) - late
    if free_gain:
        # linear in gain and gain * share
        basis = np.stack([late.ravel(), change.ravel()])
        size = float(np.trace(basis @ basis.T))
        if size == 0.0:
            return Delay(start, 0.0, power(signal))
        normal = basis @ basis.T + 1e-14 * size * np.eye(2)
        gain, shared = np.linalg.solve(normal, basis @ signal.ravel())
        share = float(np.clip(shared / gain, 0.0, 1.0)) if gain else 0.0
        model = late + share * change
        gain = float(np.sum(signal * model)) / max(power(model), 1e-300)
    else:
        gain = 1.0
        share = float(np.clip(np.sum((signal - late) * change) / max(power(change), 1e-300), 0.0, 1.0))
        model = late + share * change
    # A share that rounding alone has made is none.
    share = round(share, 9)
    return Delay(start + share, gain, power(signal - gain * model))


def low_passed(signal: Array, share: float, first: Array | None = None) -> Array:
    """Return `signal` (n, N) behind a first-order filter y += share (x - y), from `first` (N,) or its first row."""
    begin = signal[0] if first is None else first
    return np.asarray(lfilter([share], [1.0, share - 1.0], signal, axis=0, zi=(1.0 - share) * begin[None])[0])


class LowPass(NamedTuple):
    """A first-order filter y += share (gain x - y), with a constant `bias` (N,) beside, and what it leaves."""

    share: float
    gain: float
    bias: Array
    left: float


def fit_low_pass(
    signal: Array, source: Array, *, exact: bool, free_gain: bool = False, biased: bool = False
) -> LowPass:
    """Return the filter behind which `signal` (n, N) is the `source`, with a gain and a constant where asked for.

    Where numbers are `exact` by least squares of the filter's own equation; else by a search for the share.
    """
    dimension, still = signal.shape[1], np.zeros(signal.shape[1])
    if exact:
        # y' - y = share (gain x' + bias - y), of which share, share gain and share bias are linear
        change, before, driven = np.diff(signal, axis=0), signal[:-1], source[1:]
        axes = [np.broadcast_to(axis, change.shape) for axis in np.eye(dimension)] if biased else []
        columns = [driven, -before, *axes] if free_gain else [driven - before, *axes]
        basis = np.stack([column.ravel() for column in columns], axis=1)
        numbers = np.linalg.lstsq(basis, change.ravel(), rcond=1e-13)[0]
        share = float(np.clip(numbers[1 if free_gain else 0], 1e-4, 1.0))
        gain = float(numbers[0]) / share if free_gain else 1.0
        bias = np.asarray(numbers[-dimension:] / share, dtype=np.float64) if biased else still
        begin = signal[0] - bias
        model = np.concatenate([signal[:1] - bias, low_passed(gain * driven, share, begin)])
        return LowPass(share, gain, bias, power(signal - model - bias))
    aim = signal - signal.mean(axis=0) if biased else signal

    def modelled(share: float) -> tuple[float, Array]:
        model = low_passed(source, share)
        model = model - model.mean(axis=0) if biased else model
        return (float(np.sum(aim * model)) / max(power(model), 1e-300) if free_gain else 1.0), model

    def left(share: float) -> float:
        gain, model = modelled(share)
        return power(aim - gain * model)

    share = search(left, 1e-3, 0.999)
    gain, _ = modelled(share)
    bias = (signal - gain * low_passed(source, share)).mean(axis=0) if biased else still
    return LowPass(share, gain, bias, left(share))


def search(left: Callable[[float], float], low: float, high: float, points: int = 13) -> float:
    """Return the positive number at which `left` is least: on a grid of powers, then by Brent's method."""
    grid = np.geomspace(low, high, points)
    best = int(np.argmin([left(float(value)) for value in grid]))
    lowest, highest = (float(np.log(grid[end])) for end in (max(best - 1, 0), min(best + 1, points - 1)))

    def left_at(logarithm: float) -> float:
        return left(float(np.exp(logarithm)))

    return float(
        np.exp(minimize_scalar(left_at, bounds=(lowest, highest), method="bounded", options={"xatol": 1e-4}).x)
    )


def fit_hold(signal: Array, source: Array, around: int | None = None) -> tuple[int, Array] | None:
    """Return every how many ticks `signal` (n, N) is renewed from `source`, and the source so held; None if it is not.

    By the gaps between its changes where it repeats exactly while the source moves, else from two thirds of `around`
    ticks to three halves. From renewal to renewal the signal is compared with one row: its sum there is all that
    counts.
    """
    if around is None:
        moves = np.any(np.diff(source, axis=0) != 0.0, axis=1)
        changes = np.any(np.diff(signal, axis=0) != 0.0, axis=1)
        if np.count_nonzero(moves & ~changes) < 0.3 * np.count_nonzero(moves):
            return None
        gaps = np.diff(np.flatnonzero(changes))
        if gaps.size == 0:
            return None
        periods = range(max(int(np.median(gaps)) - 1, 2), int(np.median(gaps)) + 2)
    else:
        periods = range(max(2 * around // 3, 2), 3 * around // 2 + 2)
    sums = np.concatenate([np.zeros((1, signal.shape[1])), np.cumsum(signal, axis=0)])
    squares = np.einsum("ij,ij->i", source, source)
    fits = []
    for period in periods:
        for phase in range(period):
            # The first row stands until the first renewal.
            renewals = np.arange(phase, len(source), period) if phase == 0 else np.r_[0, phase : len(source) : period]
            ends = np.append(renewals[1:], len(source))
            common = np.einsum("ij,ij->", source[renewals], sums[ends] - sums[renewals])
            fits.append((float(squares[renewals] @ (ends - renewals) - 2.0 * common), period, phase))
    _, period, phase = min(fits)
    rows = np.arange(len(source))
    return period, source[np.maximum((rows - phase) // period * period + phase, 0)]


def fit_level(along: Array, size: Array) -> float:
    """Return the level L at which `along` = min(size, L) leaves least, for numbers (n,) of any unit.

    Exact: between two neighbouring sizes the squares that L leaves are a parabola, whose least value lies at the mean
    of `along` over the rows above, or at the nearer of the two sizes.
    """
    order = np.argsort(-size)
    sizes, values = size[order], along[order]
    count = np.arange(1, len(sizes) + 1)
    sums, squares = np.cumsum(values), np.cumsum(values**2)
    below = np.cumsum(((values - sizes) ** 2)[::-1])[::-1]
    levels = np.clip(sums / count, np.r_[sizes[1:], 0.0], sizes)
    left = squares - 2.0 * levels * sums + count * levels**2 + np.r_[below[1:], 0.0]
    return float(levels[np.argmin(left)])


class Interval(NamedTuple):
    """An interval of a quantity in which a gain differs from that outside: its ends, and where it is (n,)."""

    low: float
    high: float
    inside: BoolArray


def fit_interval(values: Array, common: Array, own: Array) -> Interval | None:
    """Return the interval of `values` (n,) within which another gain explains most; None where there is none.

    A gain g leaves sum |f|^2 - 2 g f.s + g^2 |s|^2: `common` is f.s and `own` is |s|^2, (n,) each. Sorted by value both
    are running sums, and what two gains save is read off their differences.
    """
    order = np.argsort(values, kind="stable")
    placed = values[order]
    common_sum, own_sum = (np.concatenate([[0.0], np.cumsum(part[order])]) for part in (common, own))
    edges = np.linspace(0, len(values), BINS + 1).astype(int)[1:-1]
    # never between equal values
    ends = [np.searchsorted(placed, placed[edges], side) for side in ("left", "right")]
    edges = np.unique(np.concatenate([[0], *ends, [len(values)]]))
    if len(edges) < 3:
        return None

    def saved(low: IntArray | int, high: IntArray | int) -> Array:
        """Return the squares (k,), N^2, that a gain of its own from edge `low` (k,) to edge `high` (k,) explains."""
        inner, inner_own = common_sum[high] - common_sum[low], own_sum[high] - own_sum[low]
        outer, outer_own = common_sum[-1] - inner, own_sum[-1] - inner_own
        return np.asarray(
            np.where(inner_own > 0.0, inner**2 / np.maximum(inner_own, 1e-300), 0.0)
            + np.where(outer_own > 0.0, outer**2 / np.maximum(outer_own, 1e-300), 0.0)
        )

    starts, stops = np.triu_indices(len(edges), 1)
    best = int(np.argmax(saved(edges[starts], edges[stops])))
    low, high = int(edges[starts[best]]), int(edges[stops[best]])
    # To the tick, in the bins beside.
    width = len(values) // BINS + 2
    for _ in range(2):
        if low > 0:
            tried = np.arange(max(low - width, 0), min(low + width, high))
            low = int(tried[np.argmax(saved(tried, high))])
        if high < len(values):
            tried = np.arange(max(high - width, low + 1), min(high + width, len(values)) + 1)
            high = int(tried[np.argmax(saved(low, tried))])
    inside = np.zeros(len(values), dtype=bool)
    inside[order[low:high]] = True
    if inside.all() or not inside.any():
        return None
    return Interval(float(placed[low]), float(placed[high - 1]), inside)


def fit_curve(values: Array, common: Array, own: Array) -> Array:
    """Return the gain at each of `values` (n,) that a polyline of `KNOTS` knots fits best: (n,), see `fit_interval`."""
    knots = np.linspace(values.min(), values.max(), KNOTS)
    hats = np.stack([np.interp(values, knots, row) for row in np.eye(KNOTS)], axis=1)
    gains = np.linalg.lstsq((hats * own[:, None]).T @ hats, hats.T @ common, rcond=1e-9)[0]
    return np.asarray(hats @ gains)


def white_noise(channel: Array) -> Array:
    """Return the deviation (N,) of what is white in a `channel` (n, N): by third differences, so that a path drops out.

    By the median, which kinks and edges leave alone.
    """
    differences = np.diff(channel, 3, axis=0)
    moving = np.any(differences != 0.0, axis=1)
    if not moving.any():
        return np.zeros(channel.shape[1])
    return np.asarray(np.median(np.abs(differences[moving]), axis=0) / NORMAL_MEDIAN / np.sqrt(THIRD_DIFFERENCES))


def rounding_variance(channel: Array) -> float:
    """Return the variance that a step of rounding q brings, q^2 / 12 a column, where a fifth of the steps repeat.

    The `channel` is (n, N), m or N; the variance is in its unit squared, m^2 or N^2.
    """
    steps = np.abs(np.diff(channel, axis=0))
    quanta = [
        column[column > 1e-15].min() for column in steps.T if np.mean(column == 0.0) > 0.2 and (column > 1e-15).any()
    ]
    return float(sum(np.square(quanta)) / 12.0)
