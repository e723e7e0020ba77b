"""Energy that crosses the port between hand and environment, and which sign of a force no passive environment has.

What a passive environment gives to the hand it was given before, or had stored. With F the force on the hand, which is
at x, it has given by t1, since t0,

    W = integral of F . dx  <=  S(t0) - S(t1)        S >= 0: what springs, masses and weights in it have stored.

Two kinds of t0 and t1 bound the right side without knowing what is behind the port.

    From rest to rest   nothing moves at either end, so S is of springs and weights alone, and would be the same if the
                        hand went straight from x1 back to x0. No force on the way is larger than the largest that was
                        felt in the run, so that this takes no more than max |F| |x1 - x0|. That closes the loop:
                        W <= max |F| |x1 - x0|. The forces at the ends alone say less: a latch lies between them, and
                        a hand that turns round feels a mass beside the spring.
    From free space on  where the force is zero for long and to the bit, it is computed, and no spring is loaded in it:
                        S(t0) = 0, and W <= 0 at every t1. (A magnet that begins at a distance has stored energy there,
                        and gives it first: that is taken for a wrong sign where the hand does not pull it out again.)

W is the trapezoid: over a linear spring that is exact, so that what a sampled wall gives away by holding its force
(half a step's worth) does not count as the environment's. A force may come up to `LAG` ticks late, as a proxy's does:
it is judged at every such lag, and all must agree.

What is beyond these bounds has to be beyond what the numbers tell, too:

    position    a rounding of q / 2 makes (q / 2) (sum of |dF| + |F0| + |F1|), by summation by parts
    force       a rounding of f / 2 makes (f / 2) times the path; white noise of deviation s makes `SURE` s sqrt(sum of
                dx^2); and a declared `force_floor`, the reading that free motion may have, that times the path
    rest        a speed below a share r of the largest leaves r^2 of the largest kinetic energy, which is no more than
                all that W spans
    the law     a tenth of all that crossed in either direction (`SHARE`): a loop late by tau gives pi / 2 sin(w tau) of
                it away at a frequency w, which is less than that up to 10 Hz and a tau of 1 ms, or 2 Hz and 5 ms

Now hold both signs against that. Where one of them makes the environment give energy, and the other does not, the
environment is passive with the other. Where both do, it is active (a motor or another hand is in it); where neither
does, it is lossless, or too little happened, and energy does not tell.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hapticeval.recordings.grain import grain
from hapticeval.recordings.stretches import LAG
from hapticeval.types import Array, BoolArray, IntArray

REST = 0.03
"""Of the largest speed: below it the hand is at rest, with a thousandth of its kinetic energy."""

WINDOW = 10e-3
"""Seconds over which a speed is taken: short against a hand's turn, long against a tick."""

SHARE = 0.1
"""Of all that crossed: less than that is the delay of a loop."""

SURE = 5.0
"""Standard deviations of the noise."""

FREE_ROWS = 20
"""So many rows of no force at all are no passage through zero."""

MOST = 300
"""Rests that are looked at, spread over the run."""


@dataclass(frozen=True)
class Gift:
    """What an environment would have given (J) over rows [first, last] beyond what it may have stored, and what of that
    the numbers leave open (J); `passive` where the first is within the second. `how` says what the ends are."""

    energy: float
    open: float
    first: int
    last: int
    how: str

    @property
    def passive(self) -> bool:
        """Whether a passive environment may have done so."""
        return not self.energy > self.open


@dataclass(frozen=True)
class Balance:
    """The largest gifts with the force as it is and with its sign turned, over a stretch; None where no two rows bound
    what is stored."""

    given: Gift
    turned: Gift

    @property
    def sign(self) -> int:
        """1 where only this sign is of a passive environment, -1 where only the other is, 0 where energy does not
        tell."""
        return int(self.given.passive) - int(self.turned.passive)


def balance(place: Array, force: Array, time: Array, *, floor: float = 0.0) -> tuple[Balance, ...]:
    """The balances of a stretch without gaps, at each lag that a force on the hand may have: `place` and `force`
    (n, N), `time` (n,), `floor` N. Empty where no two rows bound what is stored."""
    if len(time) < 2:
        return ()
    steps = max(map(grain, place.T)), max(map(grain, force.T))
    resting, share = _resting(place, time, steps[0])
    free = _free(force)
    found = []
    for lag in range(LAG + 1):
        end = len(time) - lag
        if end < 2:
            break
        port = _Port(place[:end], force[lag:], steps, floor, share)
        rests = np.array([row for row in resting if row < end], dtype=np.intp)
        both = [port.largest(sign, rests, [row - lag for row in free if row >= lag]) for sign in (1.0, -1.0)]
        if both[0] is None or both[1] is None:
            return ()
        found.append(Balance(both[0], both[1]))
    return tuple(found)


class _Port:
    """Sums along a stretch: what crossed, and what of it rounding and noise leave open."""

    def __init__(self, place: Array, force: Array, steps: tuple[float, float], floor: float, share: float) -> None:
        moved, turned = np.diff(place, axis=0), np.diff(force, axis=0)
        work = 0.5 * np.sum((force[1:] + force[:-1]) * moved, axis=1)
        self.place, self.size = place, np.linalg.norm(force, axis=1)
        self.work = _summed(work)
        self.crossed = _summed(np.abs(work))
        self.path = _summed(np.linalg.norm(moved, axis=1))
        self.square = _summed(np.sum(moved**2, axis=1))
        self.turned = _summed(np.linalg.norm(turned, axis=1))
        self.kinetic = share**2 * float(np.ptp(self.work))
        rounding = 0.5 * math.sqrt(place.shape[1])
        self.position, self.reading = rounding * steps[0], floor + rounding * steps[1]
        self.noise = SURE * _noise(force)

    def open(self, first: IntArray | int, last: IntArray | slice) -> Array:
        """What of the work between rows is open, J."""

        def over(sums: Array) -> Array:
            return np.asarray(sums[last] - sums[first])

        return np.asarray(
            self.position * (over(self.turned) + self.size[first] + self.size[last])
            + self.reading * over(self.path)
            + self.noise * np.sqrt(np.maximum(over(self.square), 0.0))
            + SHARE * over(self.crossed)
        )

    def largest(self, sign: float, rests: IntArray, free: list[int]) -> Gift | None:
        """The gift that is the furthest beyond what is open; None where no two rows bound what is stored."""
        found = [*self._rests(sign, rests), *self._free(sign, free)]
        return max(found, key=lambda each: each.energy - each.open) if found else None

    def _rests(self, sign: float, rests: IntArray) -> Iterator[Gift]:
        if rests.size < 2:
            return
        a, b = (rests[each] for each in np.triu_indices(rests.size, 1))
        back = float(self.size.max()) * np.linalg.norm(self.place[b] - self.place[a], axis=1)
        given, left = sign * (self.work[b] - self.work[a]) - back, self.open(a, b) + self.kinetic
        best = int(np.argmax(given - left))
        yield Gift(float(given[best]), float(left[best]), int(a[best]), int(b[best]), "at rest at both")

    def _free(self, sign: float, free: list[int]) -> Iterator[Gift]:
        # But for the noise what is open adds up, and its best row is one for all that begin before it: no gift is
        # further beyond than that, and those are looked at in turn until no other could be.
        sums = sign * self.work - self.position * self.turned - self.reading * self.path - SHARE * self.crossed
        ends = np.maximum.accumulate((sums - self.position * self.size)[::-1])[::-1]
        most = {
            first: float(ends[first + 1] - sums[first] - self.position * self.size[first])
            for first in free
            if first + 1 < len(sums)
        }
        best: Gift | None = None
        for first in sorted(most, key=most.__getitem__, reverse=True):
            if best is not None and most[first] <= best.energy - best.open:
                break
            rows = slice(first + 1, None)
            given, left = sign * (self.work[rows] - self.work[first]), self.open(first, rows)
            row = int(np.argmax(given - left))
            gift = Gift(float(given[row]), float(left[row]), first, first + 1 + row, "free of force at the first")
            best = max(best or gift, gift, key=lambda each: each.energy - each.open)
        if best is not None:
            yield best


def _resting(place: Array, time: Array, step: float) -> tuple[IntArray, float]:
    """A row of each rest, and the share of the largest speed that a rest may have."""
    half = max(1, round(0.5 * WINDOW / float(np.median(np.diff(time)))))
    if len(time) < 4 * half:
        return np.zeros(0, dtype=np.intp), 0.0
    middle = np.arange(half, len(time) - half)
    moved = np.linalg.norm(place[middle + half] - place[middle - half], axis=1)
    speed = moved / (time[middle + half] - time[middle - half])
    fastest = float(speed.max())
    if fastest == 0.0:
        return np.zeros(0, dtype=np.intp), 0.0
    share = max(REST, 2.0 * step / (WINDOW * fastest))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], speed <= share * fastest, [False]]).astype(np.int8)))
    rows = [int(first + np.argmin(speed[first:end])) for first, end in zip(edges[::2], edges[1::2], strict=True)]
    if len(rows) > MOST:
        rows = [rows[k] for k in np.linspace(0, len(rows) - 1, MOST).astype(int)]
    return middle[rows] if rows else np.zeros(0, dtype=np.intp), share


def _free(force: Array) -> list[int]:
    """The last row of each long stretch of no force."""
    none: BoolArray = ~np.any(force != 0.0, axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], none, [False]]).astype(np.int8)))
    long = [int(end) - 1 for first, end in zip(edges[::2], edges[1::2], strict=True) if end - first >= FREE_ROWS]
    return long[:: max(1, -(-len(long) // MOST))]


def _noise(force: Array) -> float:
    """The deviation of white noise, from the second differences: six of its variances make one of theirs."""
    if len(force) < 3:
        return 0.0
    bend = np.abs(np.diff(force, n=2, axis=0))
    return float(np.max(np.median(bend, axis=0))) / 0.6745 / math.sqrt(6.0)


def _summed(steps: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(steps)])
