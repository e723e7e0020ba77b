"""What is wrong between columns: copies, a velocity that is no derivative, a force that lags, units and times.

Whether a velocity is the derivative of its position is seen in increments, which filters leave alone. Differences from
row to row are no fair measure. An encoder's quantum q makes them noisy by about q / dt, and the low-pass that every
controller puts on them takes away what is fast. What a filtered velocity still owes is its integral. With the filter's
weights h_j, which sum to one,

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

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.integrity.columns import unbroken
from hapticeval.recordings.integrity.issue import Fault, Severity
from hapticeval.recordings.recording import Recording, columns_of
from hapticeval.recordings.stretches import LAG, nominal_step
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
    found = unbroken(sound, time)
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


COPY_ROWS = 50
"""Fewer moving rows than these can be equal by chance or by design."""

OWN, FOREIGN = 0.9, 0.5
"""Shares of the moving rows that are equal to the bit: of two columns of one run, and of one column of two runs. By
chance a converter of a hundred steps gives a hundredth of them."""

LINEAR = 0.95
"""The steps of a force that is made of IHIP - HIP correlate with those by at least this, at the right lag."""

SLOPE = 0.2
"""How far the ratio of a velocity to its position's derivative may be from one; a wrong unit is further off by far."""

LIMITS: Mapping[str, tuple[float, str]] = {
    "m": (3.0, "a workspace of {0:.4g} m: are these millimetres?"),
    "rad": (4.0 * np.pi, "angles over {0:.4g} rad, more than two turns: are these degrees?"),
    "m/s": (50.0, "a speed of {0:.4g} m/s: are these mm/s?"),
    "rad/s": (500.0, "{0:.4g} rad/s: are these degrees a second?"),
    "N": (2000.0, "a force of {0:.4g} N: are these millinewtons?"),
    "N m": (500.0, "a torque of {0:.4g} N m: are these N mm?"),
}
"""By unit, the extent (of a position or an angle) or peak (of the others) that no desk-top haptic device has."""

LEAST = {"m": 1e-5}
"""An extent below which a device has hardly moved, or its metres were meant to be something larger."""


def copies(recording: Recording) -> list[Fault]:
    """Columns that are another one over again, or its negative, or shifted by some ticks: no second measurement.

    An IHIP may be the HIP, and a sensor exact: these are the same signal by what they mean, and are not told.
    """
    keep = recording.measured
    columns = {name: each.values[keep] for name, each in columns_of(recording).items()}
    moving = {name: values for name, values in columns.items() if np.count_nonzero(np.diff(values)) >= COPY_ROWS}
    mapped = recording.meta.get("import", {}).get("columns", {})
    faults = []
    names = list(moving)
    for place, one in enumerate(names):
        for other in names[place + 1 :]:
            a, b = one.partition(".")[0], other.partition(".")[0]
            if a != b and _same_by_meaning(a, b):
                continue
            said = a != b and bool(set(mapped.get(a, ())) & set(mapped.get(b, ())))
            fault = _copy(one, other, moving[one], moving[other], said=said)
            if fault is not None:
                faults.append(fault)
    return faults


def _same_by_meaning(a: str, b: str) -> bool:
    place = {"hip", "ihip", "measured_hip", "joint_position", "raw"}
    pairs = ({"velocity", "measured_velocity"}, {"operator_force", "measured_force"}, {"joint_torque", "command"})
    return {a, b} <= place or {a, b} in pairs


def _copy(one: str, other: str, a: Array, b: Array, *, said: bool) -> Fault | None:
    for how, other_sign in (("", b), ("minus ", -b)):
        found = matched(a, other_sign, OWN)
        if found is None or (how and found.lag):
            continue
        why = ", as the mapping says" if said and found.lag == 0 else ""
        when = f" {abs(found.lag)} rows {'later' if found.lag > 0 else 'earlier'}" if found.lag else " over again"
        note = said and found.lag == 0
        return Fault(
            "shifted copy" if found.lag else "copy",
            Severity.NOTE if note else Severity.SUSPICIOUS,
            f"it is {how}'{one}'{when}{found.share}{why}: no second measurement",
            "" if note else "see which column of the file belongs here",
            other,
            measures={"rows": found.lag} if found.lag else {},
        )
    return None


class Match(NamedTuple):
    """`equal` of the `rows` in which a column moves are another one's to the last bit, `lag` rows later."""

    lag: int
    equal: int
    rows: int

    @property
    def share(self) -> str:
        """For instance ` in 1118 of 1120 rows`; empty for all of them."""
        return "" if self.equal == self.rows else f" in {self.equal} of {self.rows} rows"


def matched(a: Array, b: Array, share: float) -> Match | None:
    """Whether at least this share of the moving rows of `b` is `a`, at the lag that the correlation of the steps names.

    Rows in which nothing moves are left out, as they are equal by chance.
    """
    size = min(a.size, b.size)
    for lag in (0, _best_lag(a[:size], b[:size])):
        x, y = (a[: size - lag], b[lag:size]) if lag >= 0 else (a[-lag:size], b[: size + lag])
        moving = np.concatenate([[False], np.diff(y) != 0.0])
        rows = int(np.count_nonzero(moving))
        equal = int(np.count_nonzero((x == y) & moving))
        if rows >= COPY_ROWS and equal >= max(COPY_ROWS, share * rows):
            return Match(lag, equal, rows)
    return None


def _best_lag(a: Array, b: Array) -> int:
    """By how many rows the steps of `b` come later than those of `a` at the best correlation; 0 for short columns."""
    size = a.size
    if size < 2 * COPY_ROWS:
        return 0
    da, db = np.diff(a), np.diff(b)
    length = 1 << int(np.ceil(np.log2(2 * size)))
    spectrum = np.conj(np.fft.rfft(da, length)) * np.fft.rfft(db, length)
    found = int(np.argmax(np.fft.irfft(spectrum, length)))
    lag = found if found < length // 2 else found - length
    return lag if abs(lag) <= size - COPY_ROWS else 0


def of_another_run(recording: Recording, other: Recording, name: str) -> list[Fault]:
    """Columns that another run, called `name`, holds too, at some shift: two runs of a hand never agree to the bit."""
    theirs = columns_of(other)
    faults = []
    for column, each in columns_of(recording).items():
        if column not in theirs or np.count_nonzero(np.diff(each.values)) < COPY_ROWS:
            continue
        found = matched(theirs[column].values, each.values, FOREIGN)
        if found is not None:
            when = f", {abs(found.lag)} rows {'later' if found.lag > 0 else 'earlier'}" if found.lag else ""
            message = f"it is that of {name}{when}{found.share}, bit for bit"
            todo = "see which run was meant: a hand never moves the same way twice"
            faults.append(Fault("from another run", Severity.SUSPICIOUS, message, todo, column))
    return faults


def velocities(recording: Recording) -> list[Fault]:
    """Velocities against the derivative of their position: ratio, correlation and lag, see `derivative_fit`."""
    pairs = (("hip", "velocity"), ("joint_position", "joint_velocity"), ("ihip", "tool_velocity"))
    faults = []
    for place, speed in pairs:
        if place not in recording.channels or speed not in recording.channels:
            continue
        positions, speeds = recording.channels[place], recording.channels[speed]
        if positions.shape != speeds.shape:
            continue
        names = [name for name, each in columns_of(recording).items() if each.channel == speed]
        for column, name in enumerate(names):
            fault = _velocity(recording, place, name, positions[:, column], speeds[:, column])
            faults += [] if fault is None else [fault]
    return faults


def _velocity(recording: Recording, place: str, name: str, position: Array, speed: Array) -> Fault | None:
    fit = derivative_fit(position, speed, recording.time, recording.measured)
    if fit is None:
        return None
    measures = {"ratio": fit.ratio, "correlation": fit.correlation, "lag": fit.lag, "window": fit.window}
    if fit.correlation < LIKE:
        message = f"it is no derivative of '{place}': correlation {fit.correlation:.2f} at best"
    elif abs(fit.ratio - 1.0) > SLOPE:
        message = f"it is {fit.ratio:.4g} times the derivative of '{place}': sign or unit?"
    elif abs(fit.lag) > LAGS // 2:
        message = f"it is {abs(fit.lag)} ticks {'behind' if fit.lag > 0 else 'ahead of'} the derivative of '{place}'"
    else:
        return None
    return Fault("velocity", Severity.SUSPICIOUS, message, "see its column, unit and sign", name, measures=measures)


def force_lag(recording: Recording) -> list[Fault]:
    """By how many ticks the force follows IHIP - HIP, of which it is made where no damping is."""
    if not {"hip", "ihip", "force"} <= recording.channels.keys():
        return []
    best, at = 0.0, 0
    keep = max(recording.sound_rows(), key=lambda rows: rows.stop - rows.start)
    force = np.diff(recording.force[keep], axis=0)  # steps tell a lag more sharply than the signals
    reach = np.diff((recording.ihip - recording.hip)[keep], axis=0)
    if len(force) < 4 * LAGS or not np.any(np.std(force, axis=0)) or not np.any(np.std(reach, axis=0)):
        return []
    for lag in range(-LAGS, LAGS + 1):
        x, y = (reach[: len(reach) - lag], force[lag:]) if lag >= 0 else (reach[-lag:], force[: len(force) + lag])
        like = correlation(x.ravel(), y.ravel())
        if like > best + 1e-12:
            best, at = like, lag
    there = correlation(reach.ravel(), force.ravel())
    if best < LINEAR or best - there < 1.0 - LINEAR or not LAG < abs(at) < LAGS:
        return []
    when = "after" if at > 0 else "before"
    return [
        Fault(
            "force lag",
            Severity.SUSPICIOUS,
            f"the force comes {abs(at)} ticks {when} the IHIP - HIP that it is made of (correlation {best:.3f})",
            "see whether both were logged in the same tick, and the delay of the loop",
            "force",
            measures={"lag": at, "correlation": best},
        )
    ]


def units(recording: Recording) -> list[Fault]:
    """Extents and peaks that no haptic device has: a unit taken for another."""
    keep = recording.measured
    faults = []
    for name, (_, unit, values) in columns_of(recording).items():
        kept = values[keep]
        if kept.size == 0 or unit not in LIMITS:
            continue
        extent = unit in ("m", "rad")
        size = float(np.ptp(kept) if extent else np.max(np.abs(kept)))
        limit, words = LIMITS[unit]
        todo = _unit_from(recording)
        if size > limit:
            faults.append(Fault("unit", Severity.SUSPICIOUS, words.format(size), todo, name, measures={"size": size}))
        elif extent and name.startswith("hip") and 0.0 < size < LEAST.get(unit, 0.0) and _all_small(recording, keep):
            message = f"the hand moves by {1e6 * size:.3g} um: is the unit larger than it was taken for?"
            faults.append(Fault("unit", Severity.SUSPICIOUS, message, todo, name, measures={"size": size}))
    return faults


def _unit_from(recording: Recording) -> str:
    """What to do about a unit: where a recording has its units from."""
    if recording.meta.get("source") == "hardware":
        return "see the wiring that it was recorded with: counts_per_turn, offsets and the other entries of [device]"
    if "import" in recording.meta:
        return "see the unit in the mapping"
    return "see the program that wrote it"


def _all_small(recording: Recording, keep: BoolArray) -> bool:
    return bool(np.max(np.ptp(recording.hip[keep], axis=0)) < LEAST["m"])


RATE = (10.0, 1e5)
"""Hz. Motion of a hand reaches some 5 Hz, which takes 10 rows a second to be seen at all; and 1e5 Hz is a hundred times
the usual haptic loop, beyond what a bus to encoders and motors passes."""

SPEED = (1e-5, 10.0)
"""m/s, of a hand while it moves. One that tries to be still trembles by about 0.05 mm at 10 Hz, which is 2 mm/s: the
lower limit leaves a factor of 200 for hands that are held or simulated. The fastest throws reach the upper one."""

FACTORS = {
    1e-3: "are these milliseconds taken for seconds, or microseconds for milliseconds?",
    1e-6: "are these microseconds taken for seconds?",
    1e-9: "are these nanoseconds taken for seconds?",
    1e3: "are these seconds taken for milliseconds, or milliseconds for microseconds?",
    1e6: "are these seconds taken for microseconds?",
    1e9: "are these seconds taken for nanoseconds?",
}
"""What the times would have to be multiplied by, and which units were mixed up then."""

ADVICE = "see the unit of [time] in the mapping"


def time_unit(recording: Recording) -> list[Fault]:
    """A suspicion where the clock or the hand's speed is none that a haptic device has, with the units that would do.

    A hand whose extent is none either has its length in a wrong unit, which is told of it: only the clock speaks then.
    """
    if recording.meta.get("source") in SIMULATED or len(recording) < 3:
        return []
    step = nominal_step(recording)
    if not step > 0.0:
        return []
    rate, speed = 1.0 / step, _speed(recording)
    slow = speed is not None and not _within(speed, SPEED)
    if _within(rate, RATE) and not slow:
        return []
    words = f"{rate:.4g} Hz" + ("" if speed is None else f", and a hand that moves at {_speed_words(speed)}")
    fitting = [
        f"with times {_longer(factor)} it would be {rate / factor:.4g} Hz"
        + ("" if speed is None else f" and {_speed_words(speed / factor)}")
        + f": {question}"
        for factor, question in FACTORS.items()
        if _within(rate / factor, RATE) and (speed is None or _within(speed / factor, SPEED))
    ]
    message = "; ".join([words, *fitting]) if fitting else f"{words}: no haptic device has that"
    return [Fault("unit", Severity.SUSPICIOUS, message, ADVICE, "time", measures={"rate": rate, "speed": speed})]


def _speed(recording: Recording) -> float | None:
    """The median speed of the HIP over the steps in which it moves, m/s; None where it does not, or has no length."""
    if "hip" not in recording.channels:
        return None
    keep = recording.measured
    hip: Array = recording.hip[keep]
    steps, moved = np.diff(recording.time[keep]), np.linalg.norm(np.diff(hip, axis=0), axis=1)
    some = (moved > 0.0) & (steps > 0.0)
    extent = float(np.max(np.ptp(hip, axis=0), initial=0.0))
    if not some.any() or not LEAST["m"] <= extent <= LIMITS["m"][0]:
        return None
    return float(np.median(moved[some] / steps[some]))


def _longer(factor: float) -> str:
    times, how = (factor, "longer") if factor > 1.0 else (1.0 / factor, "shorter")
    return f"{round(times)} times {how}"


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]


def _speed_words(speed: float) -> str:
    return f"{speed:.3g} m/s" if speed >= 0.1 else f"{1e3 * speed:.3g} mm/s"
