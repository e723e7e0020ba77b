"""The energy that crosses a port, compared with what a passive environment may have stored.

What a passive environment gives to the hand it was given before, or had stored. With F the force on the hand, which is
at x, it has given by t1, since t0,

    W = integral of F . dx  <=  S(t0) - S(t1)        S >= 0: what springs, masses and weights in it have stored.

Two kinds of t0 and t1 bound the right side without knowing what is behind the port.

    From rest to rest   nothing moves at either end, so S is of springs and weights alone, and would be the same if the
                        hand went straight from x1 back to x0. No force on that path is larger than the largest that was
                        felt in the run, so that this takes no more than max |F| |x1 - x0|. That closes the loop:
                        W <= max |F| |x1 - x0|. The forces at the ends alone say less: a latch lies between them, and
                        a hand that turns round feels a mass beside the spring.
    From free space on  where the force is zero for long and to the bit, it is computed, and no spring is loaded in it:
                        S(t0) = 0, and W <= 0 at every t1.

W is the trapezoid: over a linear spring that is exact, so that what a sampled wall gives away by holding its force
(half a step's worth) does not count as the environment's. A force may come up to `LAG_TICKS` late, as a proxy's does:
it is judged at every such lag, and the least counts.

What is beyond these bounds has to be beyond what the numbers resolve, too: `Port.open` has the terms of rounding,
noise and delay, `Port.kinetic` that of a rest which is not quite one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hapticeval.recordings.quantization import coarsest, noise_deviation
from hapticeval.recordings.recording import runs_of
from hapticeval.recordings.stretches import LAG_TICKS
from hapticeval.types import Array, IntArray

# Why these numbers: `phenomena/decisions.py`.
REST_SPEED = 0.03  # of the largest speed: below it the hand is at rest, with a thousandth of its kinetic energy
REST_WINDOW = 10e-3  # s over which a speed is taken: short against a hand's turn, long against a tick
DELAY_SHARE = 0.1  # of all that crossed: less than that is the delay of a loop
NOISE_DEVIATIONS = 5.0  # standard deviations of the noise
FREE_ROWS = 20  # so many rows of no force at all are no passage through zero
MOST_RESTS = 300  # rests that are looked at, spread over the run


@dataclass(frozen=True)
class EnergyGift:
    """The most that an environment would have given (J), over rows [first, last], beyond what it may have stored.

    `open` (J) is what of that the numbers leave open. `how` says what the ends are.
    """

    energy: float
    open: float
    first: int
    last: int
    how: str

    @property
    def excess(self) -> float:
        """How far the energy is beyond what is open, J."""
        return self.energy - self.open

    @property
    def explained(self) -> bool:
        """Whether a passive environment may have given it: the energy is within what is open."""
        return not self.energy > self.open


def balance(place: Array, force: Array, time: Array) -> tuple[EnergyGift, ...]:
    """Return the largest gift over a stretch without gaps, at each lag that a force on the hand may have.

    `place` (n, N), m, `force` (n, N), N, and `time` (n,), s, are of a stretch. Empty where no two rows bound what is
    stored.
    """
    if len(time) < 2:
        return ()
    steps = coarsest(place), coarsest(force)
    rests, share = find_rests(place, time, steps[0])
    free = [end - 1 for first, end in runs_of(~np.any(force != 0.0, axis=1)) if end - first >= FREE_ROWS]
    free = free[:: max(1, -(-len(free) // MOST_RESTS))]
    gifts = []
    # Shifted by each lag that a proxy may have: the force at row k + lag belongs to the place at row k.
    for lag in range(LAG_TICKS + 1):
        end = len(time) - lag
        port = Port(place[:end], force[lag:], steps, share)
        gift = port.largest(rests[rests < end], [row - lag for row in free if row >= lag])
        if gift is None:
            return ()
        gifts.append(gift)
    return tuple(gifts)


class Port:
    """Sums along a stretch: what crossed, and what of it rounding and noise leave open."""

    def __init__(self, place: Array, force: Array, steps: tuple[float, float], share: float) -> None:
        moved, turned = np.diff(place, axis=0), np.diff(force, axis=0)
        # Trapezoid of F . dx over each step, J: exact over a linear spring.
        work = 0.5 * np.sum((force[1:] + force[:-1]) * moved, axis=1)
        self.place, self.size = place, np.linalg.norm(force, axis=1)
        self.work, self.crossed = _summed(work), _summed(np.abs(work))
        self.path, self.steps_squared = _summed(np.linalg.norm(moved, axis=1)), _summed(np.sum(moved**2, axis=1))
        self.force_path = _summed(np.linalg.norm(turned, axis=1))
        # J: a rest's speed, a share r of the largest, leaves r^2 of the kinetic energy, and W spans all of that.
        self.kinetic = share**2 * float(np.ptp(self.work))
        # Half a quantum in each of N directions.
        rounding = 0.5 * math.sqrt(place.shape[1])
        self.position, self.reading = rounding * steps[0], rounding * steps[1]
        self.noise = NOISE_DEVIATIONS * noise_deviation(force, order=2)

    def open(self, first: IntArray | int, last: IntArray | slice) -> Array:
        """Return what of the work between rows `first` and `last`, (k,) each, rounding and noise leave open: J."""
        return np.asarray(
            # Position: a rounding of q / 2 makes (q / 2) (sum of |dF| + |F0| + |F1|), by summation by parts.
            self.position * (self.force_path[last] - self.force_path[first] + self.size[first] + self.size[last])
            # Force: a rounding of f / 2, times the path.
            + self.reading * (self.path[last] - self.path[first])
            # White noise of deviation s makes `NOISE_DEVIATIONS` s sqrt(sum of dx^2).
            + self.noise * np.sqrt(np.maximum(self.steps_squared[last] - self.steps_squared[first], 0.0))
            # A loop late by tau gives pi / 2 sin(w tau) of all that crossed away at a frequency w, which is less than
            # a tenth up to 10 Hz and a tau of 1 ms, or 2 Hz and 5 ms.
            + DELAY_SHARE * (self.crossed[last] - self.crossed[first])
        )

    def largest(self, rests: IntArray, free: list[int]) -> EnergyGift | None:
        """Return the gift that is the furthest beyond what is open; None where no two rows bound what is stored.

        `rests` (k,) are rows at rest, `free` rows without a force. The energies are in J, of forces in N.
        """
        return max([*self._rests(rests), *self._free(free)], key=lambda gift: gift.excess, default=None)

    def _rests(self, rests: IntArray) -> Iterator[EnergyGift]:
        """Yield the largest gift between two rows at rest, in J: W - max |F| |x1 - x0| against what is open."""
        if rests.size < 2:
            return
        a, b = (rests[indices] for indices in np.triu_indices(rests.size, 1))
        # J: no force larger than the largest that was felt can be taken on the straight path back from b to a.
        back = float(self.size.max()) * np.linalg.norm(self.place[b] - self.place[a], axis=1)
        energy, left = self.work[b] - self.work[a] - back, self.open(a, b) + self.kinetic
        best = int(np.argmax(energy - left))
        yield EnergyGift(float(energy[best]), float(left[best]), int(a[best]), int(b[best]), "at rest at both")

    def _free(self, free: list[int]) -> Iterator[EnergyGift]:
        """Yield the largest gift from a row free of force on, in J: W against what is open."""
        # But for the noise what is open adds up, and its best row is one for all that begin before it: no gift is
        # further beyond than that, and those are looked at in turn until no other could be.
        sums = self.work - self.position * self.force_path - self.reading * self.path - DELAY_SHARE * self.crossed
        # The best end for each begin: the running maximum from the right.
        ends = np.maximum.accumulate((sums - self.position * self.size)[::-1])[::-1]
        upper_bounds = {
            first: float(ends[first + 1] - sums[first] - self.position * self.size[first])
            for first in free
            if first + 1 < len(sums)
        }
        best: EnergyGift | None = None
        for first in sorted(upper_bounds, key=upper_bounds.__getitem__, reverse=True):
            if best is not None and upper_bounds[first] <= best.excess:
                break
            rows = slice(first + 1, None)
            energy, left = self.work[rows] - self.work[first], self.open(first, rows)
            row = int(np.argmax(energy - left))
            last, how = first + 1 + row, "free of force at the first"
            gift = EnergyGift(float(energy[row]), float(left[row]), first, last, how)
            best = max(best or gift, gift, key=lambda gift: gift.excess)
        if best is not None:
            yield best


def find_rests(place: Array, time: Array, step: float) -> tuple[IntArray, float]:
    """Return a row of each rest, and the share of the largest speed that a rest may have.

    The hand is at `place` (n, N), m, at `time` (n,), s, known to a `step` (m).
    """
    # Rows on either side over which a speed is taken.
    half = max(1, round(0.5 * REST_WINDOW / float(np.median(np.diff(time)))))
    middle = np.arange(half, len(time) - half)
    moved = np.linalg.norm(place[middle + half] - place[middle - half], axis=1)
    speed = moved / (time[middle + half] - time[middle - half])
    fastest = float(speed.max(initial=0.0))
    if len(time) < 4 * half or fastest == 0.0:
        return middle[:0], 0.0
    # Not below what two quanta within the window make of rest: an encoder dithers.
    share = max(REST_SPEED, 2.0 * step / (REST_WINDOW * fastest))
    # The slowest row of each rest.
    rows = np.array([first + np.argmin(speed[first:end]) for first, end in runs_of(speed <= share * fastest)], np.intp)
    if rows.size > MOST_RESTS:
        rows = rows[np.linspace(0, rows.size - 1, MOST_RESTS).astype(int)]
    return middle[rows], share


def _summed(steps: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(steps)])
