"""Whether a force has the sign that its channel states: by energy, by direction in contact, by when a wall pushes.

Nothing here changes a sign, and nothing but physics is taken for granted: that the environment of the hand is passive
(see below), that a surface pushes towards the tool that is on it, and that a wall pushes what moves into it.

1.  Energy decides where it can: one sign is of a passive environment, and the other is not.
2.  Else, of a recording with an IHIP: a rigid surface pushes outwards, and so does friction on it (at an angle to that)
    and damping (which may not pull). So F . (IHIP - HIP) >= 0 in all of contact, and with the wrong sign it is negative
    in all of it. A sum within a twentieth of either extreme, -|F| |IHIP - HIP| or the other, tells. (The tool of a
    teleoperator that lags or leads is no such IHIP, and its sum is in between, unless its energy has told already. A
    surface that holds from both sides may pull, too: a scene that is `bilateral` is left out.)
3.  Of the wall of `contacts`, whose sensor may read as much in free motion as to hide its energy: a force can rise only
    while the tool moves in. Were the sign left to chance, each rise would come in either way with the same
    probability; where as few of them come on the way in as has a probability below `LEVEL`, the sign is suspected.
    Rises at which the tool moves by no more than its quantum do not count.

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

from hapticeval.errors import InputError
from hapticeval.recordings.integrity.contacts import impacts, wall_channel
from hapticeval.recordings.integrity.issue import Fault, Severity
from hapticeval.recordings.provenance import declared_floor, is_bilateral
from hapticeval.recordings.quantization import grain, resolution
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import LAG, Stretch, stretches
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


PORTS = (("force", "hip", 1.0), ("operator_force", "hip", -1.0), ("wall_force", "ihip", 1.0))
"""A force, the place where it acts, and whether it acts on what is there, or is that which acts."""

EXTREME = 0.95
"""Of the sum of the sizes: how near the sum of F . (IHIP - HIP) is to it where all of a force points one way."""

QUANTA = 3.0
"""A tool that is nearer to the HIP than so many times what the numbers resolve is in no direction of it."""

LEVEL = 0.05

ADVICE = "see its sign in the mapping, and what the sensor calls positive; no sign was changed"


@dataclass(frozen=True)
class Sign:
    """What is known of the sign of a force `channel`: 1 as it is, -1 the other, 0 not told; and why, in `words`."""

    channel: str
    sign: int
    words: str


def force_signs(recording: Recording) -> tuple[tuple[Sign, ...], list[Fault]]:
    """What tells the sign of each force of a recording, and a suspicion of each that seems to have the wrong one."""
    signs, faults = [], []
    for channel, place, sense in PORTS:
        if not {channel, place} <= recording.channels.keys() or _twice(recording, channel):
            continue
        told, fault = _energy(recording, channel, place, sense)
        if told.sign == 0 and channel == "force":
            told, fault = _pointing(recording, told)
        if told.sign == 0 and recording.dimension == 1:
            told, fault = _approach(recording, told)
        signs.append(told)
        faults += [] if fault is None else [fault]
    return tuple(signs), faults


def _twice(recording: Recording, channel: str) -> bool:
    """Whether it is the force on the hand, turned: one column, mapped to both."""
    force = recording.channels.get("force")
    return channel == "operator_force" and force is not None and np.array_equal(recording.channels[channel], -force)


def _energy(recording: Recording, channel: str, place: str, sense: float) -> tuple[Sign, Fault | None]:
    """By the stretch that tells the most."""
    floor = _floor(recording, channel)
    found: list[tuple[Stretch, Balance]] = []
    unclear: list[Balance] = []
    for stretch in stretches(recording):
        rows = stretch.rows
        force = sense * recording.channels[channel][rows]
        lags = balance(recording.channels[place][rows], force, recording.time[rows], floor=floor)
        if lags and abs(sum(each.sign for each in lags)) == len(lags):
            found.append((stretch, min(lags, key=_margin)))
        elif lags:
            unclear.append(lags[0])
    if not found:
        return Sign(channel, 0, _unclear(unclear)), None
    if len({each.sign for _, each in found}) > 1:
        return Sign(channel, 0, "energy tells one sign in one part of the run and the other in another"), None
    stretch, best = max(found, key=lambda each: _margin(each[1]))
    active = best.turned if best.sign > 0 else best.given
    first, last = stretch.first + active.first, stretch.first + active.last
    times = float(recording.time[first]), float(recording.time[last])
    would = f"the environment would have given {active.energy:.3g} J to the hand"
    if channel == "wall_force":
        would = f"the wall would have given {active.energy:.3g} J to the tool"
    where = (
        f"between {times[0]:.4g} and {times[1]:.4g} s ({active.how}), and noise, rounding and delay explain "
        f"no more than {active.open:.2g} J of it"
    )
    if best.sign > 0:
        return Sign(channel, 1, f"right: with the opposite sign {would} {where}"), None
    fault = Fault(
        "force sign",
        Severity.SUSPICIOUS,
        f"the sign seems wrong: with it {would} {where}; with the opposite sign it takes energy",
        f"{ADVICE}. A motor, a magnet or another hand behind it may give energy, too",
        channel,
        first,
        last + 1,
        times,
        {"energy": active.energy, "open": active.open},
    )
    return Sign(channel, -1, f"seems wrong: {would}"), fault


def _margin(balance: Balance) -> float:
    """How far the active one of both signs is beyond what is open."""
    active: Gift = balance.turned if balance.sign > 0 else balance.given
    return active.energy - active.open


def _unclear(found: list[Balance]) -> str:
    if not found:
        return "not told: the hand is not at rest twice, and was never free of force for long"
    best = max(found, key=lambda each: max(each.given.energy, each.turned.energy))
    if not best.given.passive and not best.turned.passive:
        return "not told: with either sign the environment gives energy"
    larger = max(best.given, best.turned, key=lambda each: each.energy)
    return (
        f"not told: with neither sign would the environment give energy beyond doubt: {max(larger.energy, 0.0):.2g} J "
        f"at most, and noise, rounding and delay explain up to {larger.open:.2g} J"
    )


def _pointing(recording: Recording, told: Sign) -> tuple[Sign, Fault | None]:
    """Rule 2."""
    if "ihip" not in recording.channels or is_bilateral(recording):
        return told, None
    keep = recording.measured
    reach, force = recording.ihip - recording.hip, recording.force
    sizes = np.linalg.norm(reach, axis=1) * np.linalg.norm(force, axis=1)
    rows = keep & (np.linalg.norm(reach, axis=1) > QUANTA * resolution(recording).position) & (sizes > 0.0)
    if not rows.any():
        return told, None
    along = np.sum(force * reach, axis=1)[rows]
    share = float(np.sum(along) / np.sum(sizes[rows]))
    if share >= EXTREME:
        return Sign(told.channel, 1, "right: in contact it points from the HIP to the IHIP"), None
    if share > -EXTREME:
        return told, None
    first, last = int(np.argmax(rows)), int(rows.size - 1 - np.argmax(rows[::-1]))
    count = int(np.sum(along < 0.0))
    words = f"it points away from the IHIP, into what is touched, in {count} of {along.size} rows of contact"
    fault = Fault(
        "force sign",
        Severity.SUSPICIOUS,
        f"the sign seems wrong: {words}",
        f"{ADVICE}. It is to be the force on the hand",
        told.channel,
        first,
        last + 1,
        (float(recording.time[first]), float(recording.time[last])),
        {"share": share},
    )
    return Sign(told.channel, -1, f"seems wrong: {words}"), fault


def _approach(recording: Recording, told: Sign) -> tuple[Sign, Fault | None]:
    """Rule 3, of the force that `contacts` takes for the wall's."""
    if told.channel != wall_channel(recording):
        return told, None
    try:
        found = impacts(recording)
    except InputError:
        return told, None
    into, out = len(found.contacts), len(found.retreats)
    if _chance(out, into + out) < LEVEL:
        return Sign(told.channel, 1, f"right: {into} of {into + out} pushes begin as the tool moves in"), None
    if not _chance(into, into + out) < LEVEL:
        return told, None
    words = f"{out} of {into + out} pushes begin as the tool moves away from what pushes it"
    fault = Fault(
        "force sign",
        Severity.SUSPICIOUS,
        f"the sign seems wrong: {words}, at {', '.join(f'{each:.4g} s' for each in found.retreats[:8])}",
        ADVICE,
        told.channel,
        measures={"into": into, "out": out},
    )
    return Sign(told.channel, -1, f"seems wrong: {words}"), fault


def _chance(few: int, count: int) -> float:
    """The probability of so few heads or fewer in `count` tosses of a coin."""
    return sum(math.comb(count, k) for k in range(few + 1)) / 2.0**count


def _floor(recording: Recording, channel: str) -> float:
    """What the sensor may read in free motion: declared of the force that `contacts` takes for the wall's."""
    return declared_floor(recording) or 0.0 if channel == wall_channel(recording) else 0.0
