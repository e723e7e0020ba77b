"""How a logged channel deviates from the computed one: by rounding, a lag, its sign, a gain, or from a tick on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.types import Array

LONGEST_LAG = 20
"""Ticks up to which a lag is looked for, either way: 20 ms at 1 kHz, more than any loop that anyone could feel with."""

SETTLED = 0.99
"""Share of the samples that a lag or a gain must bring within the tolerance to explain the deviation."""


@dataclass(frozen=True)
class Deviation:
    """One channel of a log against its computation.

    `largest` (m or N) is the largest distance, `tolerance` what rounding allows. `first` is the first row beyond that,
    None where there is none; `lag` (ticks, positive where the log is late) and `gain` explain it where they can.
    """

    channel: str
    largest: float
    tolerance: float
    first: int | None
    first_time: float | None
    beyond: float
    lag: int = 0
    gain: float = 1.0
    explained: bool = False

    @property
    def follows(self) -> bool:
        """Whether rounding is all of it."""
        return self.first is None

    def told(self) -> str:
        """One line for a person."""
        scale, unit = (1e3, "mm") if self.channel == "ihip" else (1.0, "N")
        name = self.channel.replace("ihip", "IHIP")
        if self.largest == 0.0:
            return f"{name}: follows to the last bit"
        size = f"{scale * self.largest:.3g} {unit}"
        bound = f"{scale * self.tolerance:.3g} {unit}"
        if self.follows:
            return f"{name}: follows to rounding: {size} at most, where rounding may make {bound}"
        head = (
            f"{name}: does not follow: {size} apart, where rounding makes {bound}; from row {self.first} on "
            f"(t = {self.first_time:.6g} s), in {100.0 * self.beyond:.3g} % of the samples"
        )
        return f"{head}; {self._cause()}"

    def _cause(self) -> str:
        if not self.explained:
            return "neither a lag, nor a sign, nor a gain explains it"
        causes = []
        if self.lag:
            side = "late" if self.lag > 0 else "early"
            causes.append(f"the log is {abs(self.lag)} tick{'' if abs(self.lag) == 1 else 's'} {side}")
        if self.gain == -1.0:
            causes.append("its sign is turned")
        elif self.gain != 1.0:
            causes.append(f"its gain is {self.gain:.6g}")
        return " and ".join(causes)


def deviation(channel: str, computed: Array, logged: Array, time: Array, *, tolerance: float) -> Deviation:
    """Compare a logged channel (n, N) with its computation, and look for the simplest thing that explains the rest.

    In this order: nothing; the sign; a gain (of forces); a lag up to `LONGEST_LAG` ticks; a lag with a sign or gain.
    """
    distance = np.linalg.norm(logged - computed, axis=1)
    beyond = distance > tolerance
    if not beyond.any():
        return Deviation(channel, float(distance.max()), tolerance, None, None, 0.0)
    first = int(np.argmax(beyond))
    found = Deviation(channel, float(distance.max()), tolerance, first, float(time[first]), float(beyond.mean()))
    gains = channel == "force"
    lags = sorted(range(-LONGEST_LAG, LONGEST_LAG + 1), key=lambda lag: (abs(lag), lag < 0))
    for lag, gained in [(0, True), *((lag, False) for lag in lags[1:]), *((lag, True) for lag in lags[1:])]:
        if gained and not gains:
            continue
        mine, theirs = _shifted(computed, logged, lag)
        if mine.shape[0] < 2:
            continue
        gain = _gain(mine, theirs) if gained else 1.0
        if gained and (gain is None or gain == 1.0):
            continue
        assert gain is not None
        left = np.linalg.norm(theirs - gain * mine, axis=1) <= tolerance * max(1.0, abs(gain))
        # What is zero or at rest fits any lag and gain; those samples that deviate must be brought to fit.
        moved = beyond[max(lag, 0) : beyond.size + min(lag, 0)]
        if moved.any() and np.mean(left[moved]) >= SETTLED and np.mean(left) >= SETTLED:
            return Deviation(
                channel, found.largest, tolerance, first, found.first_time, found.beyond, lag, gain, explained=True
            )
    return found


def _shifted(computed: Array, logged: Array, lag: int) -> tuple[Array, Array]:
    """What the log says `lag` ticks after the computation, row by row."""
    count = computed.shape[0]
    if abs(lag) >= count:
        return computed[:0], logged[:0]
    if lag >= 0:
        return computed[: count - lag], logged[lag:]
    return computed[-lag:], logged[: count + lag]


def _gain(computed: Array, logged: Array) -> float | None:
    """The least-squares gain of the log; -1 where it is that to single precision, None where nothing is computed."""
    power = float(np.sum(computed**2))
    if power == 0.0:
        return None
    gain = float(np.sum(logged * computed)) / power
    return float(np.round(gain)) if abs(gain - np.round(gain)) < 1e-6 else gain
