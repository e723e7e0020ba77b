"""Compare two benches setting by setting: a rank test on blocks of the raw samples.

Samples that follow one another are not independent: a slow stretch of the machine is slow for all of them. A round,
in which every setting is measured once and in another order, is therefore one block, its median one observation.

- Mann and Whitney's test is then exact at any number of rounds.
- Hodges and Lehmann's estimate, with its own interval, says by how much the times differ.
- Holm's correction holds the chance of even one false alarm among all settings to five per cent.

What no number of rounds can see is what differs from process to process, such as where arrays lie in memory. A shift
must also be larger than two benches of the same code were found to differ by.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from hapticeval.study.bench.document import BenchResults, Change, Samples, SettingEntry
from hapticeval.types import Array

SIGNIFICANCE = 0.05
ERROR_WORTH = 1e-6  # errors are not random: they have changed where they differ by more than this share
WORTH = {"step": 0.10, "batch": 0.25}
"""A ratio of times closer to one than this is not called better or worse: the same code reached 0.03 and 0.22."""


class Shift(NamedTuple):
    """The ratio of times, now over before, with its 95 per cent interval, and the chance of one as far off by luck."""

    ratio: float
    low: float
    high: float
    p: float


def estimate_shift(now: Array, before: Array) -> Shift:
    """Estimate by what factor times have changed, from the medians of rounds `now` (n,) and `before` (m,), in any unit.

    With very few blocks no interval of 95 per cent exists: it is then unbounded, and `p` cannot be small either.
    """
    from scipy.stats import mannwhitneyu

    # Logarithms: the shift of two samples is then the ratio of the times.
    a, b = np.log(now), np.log(before)
    p = float(mannwhitneyu(a, b, alternative="two-sided", method="auto").pvalue)
    # Hodges and Lehmann: the median of all pairwise differences.
    apart = np.sort(np.subtract.outer(a, b).ravel())
    outside = _outside_count(a.size, b.size)
    # The interval leaves out as many of the sorted differences at each end.
    low = float(np.exp(apart[outside - 1])) if outside else 0.0
    high = float(np.exp(apart[apart.size - outside])) if outside else math.inf
    return Shift(float(np.exp(np.median(apart))), low, high, p)


def _outside_count(n: int, m: int) -> int:
    """Count the n m ordered differences that lie beyond each end of the 95 per cent interval.

    The largest c with P(U <= c - 1) <= 0.025 under the hypothesis of no shift, from the exact distribution of U.
    """
    counts = np.zeros(n * m + 1)
    counts[0] = 1.0
    for k in range(1, n + 1):  # Gaussian binomial coefficients: multiply by 1 - q^(m + k), divide by 1 - q^k
        counts[m + k :] -= counts[: -(m + k)].copy() if m + k <= n * m else 0.0
        for j in range(k, n * m + 1):
            counts[j] += counts[j - k]
    # P(U <= c): the counts over all (n + m choose n) orders.
    below = np.cumsum(counts) / math.comb(n + m, n)
    return int(np.searchsorted(below, SIGNIFICANCE / 2.0, side="right"))


def holm(ps: Sequence[float]) -> list[float]:
    """Return Holm's adjusted p values: below `SIGNIFICANCE` for shifts that are significant among all tested."""
    # Holm: the smallest p is multiplied by the number of tests, the next by one less, and so on; never falling.
    order = sorted(range(len(ps)), key=lambda index: ps[index])
    adjusted = [1.0] * len(ps)
    largest = 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, (len(ps) - rank) * ps[index]))
        adjusted[index] = largest
    return adjusted


def judge_shift(estimate: Shift, adjusted: float, *, worth: float) -> Literal["better", "worse", "not significant"]:
    """Return `better`, `worse` or `not significant` for a shift of times; `worth` is the least share that counts."""
    # Significant, and larger than the same code differs from itself: |log ratio| > log(1 + worth).
    if adjusted >= SIGNIFICANCE or abs(math.log(estimate.ratio)) <= math.log1p(worth):
        return "not significant"
    return "better" if estimate.ratio < 1.0 else "worse"


def compare_benches(now: BenchResults, samples: Samples, before: BenchResults, earlier: Samples) -> list[Change]:
    """Compare two benches, setting by setting: have times or errors changed?

    Returns one change per setting and kind of time present in both, plus one per setting whose error has changed.
    """
    past = {(setting.model, setting.label): setting for setting in before.settings if setting.problem is None}
    pairs = [
        (setting, past[setting.model, setting.label])
        for setting in now.settings
        if setting.problem is None and (setting.model, setting.label) in past
    ]
    shifts: list[tuple[SettingEntry, str, Shift]] = []
    for setting, old in pairs:
        for kind in WORTH:
            blocks = [_round_medians(some, one.key, kind) for some, one in ((samples, setting), (earlier, old))]
            # One round is no sample.
            if blocks[0].size >= 2 and blocks[1].size >= 2:
                shifts.append((setting, kind, estimate_shift(blocks[0], blocks[1])))
    # All shifts of the two benches are tested together: one family.
    adjusted = holm([some.p for _, _, some in shifts])
    times = [
        Change(
            model=setting.model,
            label=setting.label,
            what=kind,
            ratio=some.ratio,
            low=some.low,
            high=some.high if math.isfinite(some.high) else None,
            p=p,
            verdict=judge_shift(some, p, worth=WORTH[kind]),
        )
        for (setting, kind, some), p in zip(shifts, adjusted, strict=True)
    ]
    return times + [changed for setting, old in pairs for changed in _error_change(setting, old)]


def _round_medians(samples: Samples, key: str, kind: str) -> Array:
    """Return the median time of each round of a setting, (rounds,), in ns or ps; empty where it was not measured."""
    rounds = samples.get(f"{key}/{kind}")
    # At least 1 unit of the clock: a logarithm is taken of it.
    return np.empty(0) if rounds is None else np.maximum(np.median(rounds, axis=1), 1.0)


def _error_change(now: SettingEntry, before: SettingEntry) -> Iterator[Change]:
    if now.errors is None or before.errors is None:
        return
    new, old = now.errors["ihip"]["max"], before.errors["ihip"]["max"]
    # Errors are deterministic: a difference beyond rounding is a change, no test is needed.
    if abs(new - old) > ERROR_WORTH * max(new, old) + 1e-12:
        ratio = new / old if old > 0.0 else None
        yield Change(
            model=now.model, label=now.label, what="IHIP error", ratio=ratio, low=None, high=None, p=None,
            verdict="better" if new < old else "worse",
        )  # fmt: skip
