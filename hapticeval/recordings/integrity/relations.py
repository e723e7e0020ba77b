"""What is wrong between columns: copies, a velocity that is not a derivative, a force that lags, units and times.

Whether a velocity is the derivative of its position is seen in increments, which filters leave alone. Differences from
row to row are not a fair measure: an encoder's quantum q makes them noisy by about q / dt, and the low-pass that every
controller puts on them takes away what is fast. What a filtered velocity still owes is its integral. With the filter's
weights h_j, which sum to one,

    v_k = sum_j h_j (p_{k-j} - p_{k-j-1}) / dt      so that      sum of v dt over W rows = increment of h * p over them

and h * p is the position itself, late by the filter's mean lag L = sum_j j h_j, with an error of the second order in
the ratio of L to the time in which the motion changes.

Both increments carry encoder noise of q / sqrt(6) at most, from the rounding at either end, whatever W is, while the
motion in them grows with W. So for windows from `SHORTEST_WINDOW` rows on, in octaves, the integral of the velocity is
regressed on the increment of the position, at the lag that fits best.

A wrong sign or unit is the same factor in every window, and a shift the same lag. What a filter does to a shaking hand
is gone in long windows, where strokes are the most of an increment. So the longest window in which the two are alike
is judged; where there is none, the one that comes nearest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.integrity.issue import Issue, Severity, make_issue
from hapticeval.recordings.recording import Recording, columns_of
from hapticeval.recordings.stretches import LAG_TICKS, nominal_step, stretches
from hapticeval.recordings.world import POSE_CHANNELS
from hapticeval.types import Array

LAGS_TRIED = 20  # ticks over which a lag is looked for
SHORTEST_WINDOW = 8  # rows of the shortest window
LEAST_CORRELATION = 0.8  # correlation below which a velocity is not the derivative of its position
INDEPENDENT_WINDOWS = 10  # so many windows that do not overlap are the fewest that a correlation is taken from
# Lags that leave up to so many times as much unexplained as the best one explain a velocity as well.
LAG_TOLERANCE = 1.1
# How far the ratio of a velocity to the derivative may be from one; a wrong unit is further off by far.
RATIO_TOLERANCE = 0.2

NOISE_TIMES = 3.0
"""Increments that vary by less than so many times their encoder noise, q / sqrt(6), show nothing. For a position that
is made of several encoders q is the usual step from row to row, where it steps at all: at rest that is their dither."""


class Fit(NamedTuple):
    """A velocity on its position's derivative: the `ratio` of their increments, their `correlation` (0 to 1), and the
    velocity's `lag` in ticks."""

    ratio: float
    correlation: float
    lag: int


def lagged(x: Array, y: Array, lag: int) -> tuple[Array, Array]:
    """Return the rows of x and those of y that come `lag` rows later, for channels (n,) or (n, N) of one length.

    Both keep their unit (m, N or another); they are empty for too long a lag.
    """
    size = max(len(x) - abs(lag), 0)
    return (x[:size], y[lag : lag + size]) if lag >= 0 else (x[-lag : -lag + size], y[:size])


def correlation(x: Array, y: Array) -> float:
    """Return Pearson's correlation of two channels (n,), 0 where one of them does not vary.

    Their units (m, N or another) drop out.
    """
    x, y = x - x.mean(), y - y.mean()
    scale = float(np.sqrt(np.dot(x, x) * np.dot(y, y)))
    return float(np.dot(x, y)) / scale if scale > 0.0 else 0.0


def derivative_fit(position: Array, speed: Array, time: Array) -> Fit | None:
    """Fit a velocity (n,), m/s, to its position (n,), m, over rows without a gap.

    Of joints they are in rad/s and rad; `time` (n,) is in s. None where too little moves above the noise of the
    position.
    """
    # A filter that starts there knows nothing of what was before.
    position, speed, time = (values[2 * LAGS_TRIED :] for values in (position, speed, time))
    steps = np.abs(np.diff(position))
    noise = float(np.median(steps[steps > 0.0])) / np.sqrt(6.0) if np.any(steps > 0.0) else 0.0
    # The speed at a row is that of the step that led there.
    integral = np.concatenate([[0.0], np.cumsum(speed[1:] * np.diff(time))])
    best: Fit | None = None
    window = SHORTEST_WINDOW
    # Octaves of the window, up to where too few independent ones are left.
    while position.size >= INDEPENDENT_WINDOWS * window + LAGS_TRIED:
        moved, integrated = position[window:] - position[:-window], integral[window:] - integral[:-window]
        if np.std(moved) > NOISE_TIMES * noise:
            fit = _regressed(moved, integrated, window)
            # A longer window replaces a shorter one as long as the two are alike; else the better one stays.
            if best is None or fit.correlation >= LEAST_CORRELATION or fit.correlation > best.correlation:
                best = fit
        window *= 2
    return best


def _regressed(moved: Array, integrated: Array, window: int) -> Fit:
    """Regress `integrated` on `moved` at the lag of the least size that explains as much as any.

    Windows overlap, so one in several is enough. What noise leaves unexplained hardly depends on the lag. The
    correlation of the fit is its size.
    """
    stride = window // SHORTEST_WINDOW
    # The smallest lag comes first, so that argmax below finds it among those that explain as much.
    lags = sorted(range(-LAGS_TRIED, LAGS_TRIED + 1), key=abs)
    pairs = [[series[::stride] for series in lagged(moved, integrated, lag)] for lag in lags]
    likes = np.abs([correlation(x, y) for x, y in pairs])
    place = int(np.argmax(1.0 - likes <= LAG_TOLERANCE * (1.0 - likes).min() + 1e-12))
    x, y = (series - series.mean() for series in pairs[place])
    # Least-squares slope through the means.
    ratio = float(np.dot(x, y) / np.dot(x, x)) if np.any(x) else float("inf")
    return Fit(ratio, float(likes[place]), lags[place])


PLACES_AND_VELOCITIES = (("hip", "velocity"), ("joint_position", "joint_velocity"), ("ihip", "tool_velocity"))
"""Places and their velocities."""


def velocities(recording: Recording) -> Iterator[Issue]:
    """Yield velocities whose ratio, correlation or lag to the derivative of their position is wrong.

    They are looked at over the longest stretch without a gap.
    """
    rows = _longest_stretch(recording)
    time = recording.time[rows]
    for place, speed in PLACES_AND_VELOCITIES:
        positions, speeds = recording.channels.get(place), recording.channels.get(speed)
        if positions is None or speeds is None or positions.shape != speeds.shape:
            continue
        names = [name for name, column in columns_of(recording).items() if column.channel == speed]
        for name, position, values in zip(names, positions.T, speeds.T, strict=True):
            fit = derivative_fit(position[rows], values[rows], time)
            message = _misfit(fit, place) if fit else ""
            if message:
                yield make_issue(recording, "velocity", message, name)


def _longest_stretch(recording: Recording) -> slice:
    """Return the rows of the longest stretch without a gap; none where no two rows follow each other."""
    return max(
        (stretch.rows for stretch in stretches(recording)), key=lambda rows: rows.stop - rows.start, default=slice(0)
    )


def _misfit(fit: Fit, place: str) -> str:
    """Describe what is wrong with a velocity: no derivative, a factor, or a lag; empty where nothing is."""
    if fit.correlation < LEAST_CORRELATION:
        return f"it is not the derivative of '{place}': correlation {fit.correlation:.2f} at best"
    if abs(fit.ratio - 1.0) > RATIO_TOLERANCE:
        return f"it is {fit.ratio:.4g} times the derivative of '{place}': sign or unit?"
    if abs(fit.lag) > LAGS_TRIED // 2:
        return f"it is {abs(fit.lag)} ticks {'behind' if fit.lag > 0 else 'ahead of'} the derivative of '{place}'"
    return ""


COPY_ROWS = 50  # fewer moving rows than these can be equal by chance or by design
COPIED_SHARE, OTHER_RUN_SHARE = 0.9, 0.5
"""Shares of the moving rows that are equal to the bit: of two columns of one run, and of one column of two runs. By
chance a converter of a hundred steps gives a hundredth of them."""

SAME_BY_MEANING = (
    {"hip", "ihip", "measured_hip", "joint_position", "raw"},
    {"velocity", "measured_velocity"},
    {"operator_force", "measured_force"},
    {"joint_torque", "command", "commanded_torque"},
    {"force", "sent_force"},
)
"""Channels that may be the same signal: an IHIP may be the HIP, and a sensor exact."""


class Match(NamedTuple):
    """`equal` of the `rows` in which a column moves are another one's to the last bit, `lag` rows later."""

    lag: int
    equal: int
    rows: int

    @property
    def when(self) -> str:
        """For instance ` 3 rows later`; empty without a lag."""
        return f" {abs(self.lag)} rows {'later' if self.lag > 0 else 'earlier'}" if self.lag else ""

    @property
    def share(self) -> str:
        """For instance ` in 1118 of 1120 rows`; empty for all of them."""
        return "" if self.equal == self.rows else f" in {self.equal} of {self.rows} rows"


def matched(a: Array, b: Array, share: float) -> Match | None:
    """Return at which lag `b` (n,) is a copy of `a` (n,), bit for bit; None where it is none.

    At least a `share` of the moving rows of `b` has to be equal, at lag 0 or where their steps correlate best. Rows in
    which nothing moves are left out, as they are equal by chance; the unit (m, N or another) does not matter.
    """
    size = min(a.size, b.size)
    # As they are first: most copies have no lag.
    for lag in (0, _best_lag(a[:size], b[:size])):
        x, y = lagged(a[:size], b[:size], lag)
        moving = np.concatenate([[False], np.diff(y) != 0.0])
        rows = int(np.count_nonzero(moving))
        equal = int(np.count_nonzero((x == y) & moving))
        if rows >= COPY_ROWS and equal >= max(COPY_ROWS, share * rows):
            return Match(lag, equal, rows)
    return None


def _best_lag(a: Array, b: Array) -> int:
    """Return by how many rows the steps of `b` come later than those of `a` at the best correlation; 0 if too short."""
    size = a.size
    if size < 2 * COPY_ROWS:
        return 0
    length = 1 << int(np.ceil(np.log2(2 * size)))
    # Cross-correlation by the Fourier transform, padded to twice the length so that no end meets the begin.
    spectrum = np.conj(np.fft.rfft(np.diff(a), length)) * np.fft.rfft(np.diff(b), length)
    best = int(np.argmax(np.fft.irfft(spectrum, length)))
    # The second half of a circular correlation holds the negative lags.
    lag = best if best < length // 2 else best - length
    return lag if abs(lag) <= size - COPY_ROWS else 0


def copies(recording: Recording) -> Iterator[Issue]:
    """Yield columns that are another one over again, or its negative, or shifted by some ticks: no second measurement.

    That two channels are one column of the file is a note where the mapping says so.
    """
    keep = recording.measured
    columns = {name: (column.channel, column.values[keep]) for name, column in columns_of(recording).items()}
    moving = {name: column for name, column in columns.items() if np.count_nonzero(np.diff(column[1])) >= COPY_ROWS}
    mapped = recording.meta.get("import", {}).get("columns", {})
    for (one, (a, values)), (other, (b, others)) in combinations(moving.items(), 2):
        # a rotation's matrix repeats its numbers
        if (a != b and any({a, b} <= alike for alike in SAME_BY_MEANING)) or a == b == POSE_CHANNELS[0]:
            continue
        for how, sign in (("", 1.0), ("minus ", -1.0)):
            match = matched(values, sign * others, COPIED_SHARE)
            if match is None or (how and match.lag):
                continue
            # The mapping names one column of the file for both: then the copy is meant.
            note = match.lag == 0 and a != b and bool(set(mapped.get(a, ())) & set(mapped.get(b, ())))
            why = ", as the mapping says" if note else ""
            yield make_issue(
                recording,
                "shifted copy" if match.lag else "copy",
                f"it is {how}'{one}'{match.when or ' over again'}{match.share}{why}: no second measurement",
                other,
                severity=Severity.NOTE if note else None,
                todo="" if note else None,
            )
            break


def of_another_run(recording: Recording, other: Recording, run: str) -> Iterator[Issue]:
    """Yield columns that another run, called `run`, holds too, at some shift: runs of a hand never agree to the bit."""
    theirs = columns_of(other)
    for name, column in columns_of(recording).items():
        if name in theirs and np.count_nonzero(np.diff(column.values)) >= COPY_ROWS:
            match = matched(theirs[name].values, column.values, OTHER_RUN_SHARE)
            if match is not None:
                message = f"it is that of {run}{',' if match.lag else ''}{match.when}{match.share}, bit for bit"
                yield make_issue(recording, "from another run", message, name)


LAG_CORRELATION = 0.95
"""The steps of a force that is made of IHIP - HIP correlate with those by at least this, at the right lag."""


def force_lag(recording: Recording) -> Iterator[Issue]:
    """Yield by how many ticks the force follows IHIP - HIP, of which it is made where no damping is."""
    if not {"hip", "ihip", "force"} <= recording.channels.keys():
        return
    rows = _longest_stretch(recording)
    force = np.diff(recording.force[rows], axis=0)  # steps show a lag more sharply than the signals
    reach = np.diff((recording.ihip - recording.hip)[rows], axis=0)
    if len(force) < 4 * LAGS_TRIED or not np.any(np.std(force, axis=0)) or not np.any(np.std(reach, axis=0)):
        return
    best, at, unlagged = 0.0, 0, 0.0
    for lag in range(-LAGS_TRIED, LAGS_TRIED + 1):
        like = correlation(*(series.ravel() for series in lagged(reach, force, lag)))
        unlagged = like if lag == 0 else unlagged
        if like > best + 1e-12:
            best, at = like, lag
    # Reported only where the lag explains what no lag does not, and is longer than a proxy's own.
    if best < LAG_CORRELATION or best - unlagged < 1.0 - LAG_CORRELATION or not LAG_TICKS < abs(at) < LAGS_TRIED:
        return
    when = "after" if at > 0 else "before"
    message = f"the force comes {abs(at)} ticks {when} the IHIP - HIP that it is made of (correlation {best:.3f})"
    yield make_issue(recording, "force lag", message, "force", lag=at)


UNIT_LIMITS: Mapping[str, tuple[float, str]] = {
    "m": (3.0, "a workspace of {0:.4g} m: are these millimetres?"),
    "rad": (4.0 * np.pi, "angles over {0:.4g} rad, more than two turns: are these degrees?"),
    "m/s": (50.0, "a speed of {0:.4g} m/s: are these mm/s?"),
    "rad/s": (500.0, "{0:.4g} rad/s: are these degrees a second?"),
    "N": (2000.0, "a force of {0:.4g} N: are these millinewtons?"),
    "N m": (500.0, "a torque of {0:.4g} N m: are these N mm?"),
}
"""By unit, the extent (of a position or an angle) or peak (of the others) that no desk-top haptic device has."""

LEAST_EXTENT = 1e-5
"""Metres of extent below which a device has hardly moved, or its metres were meant to be something larger."""


def units(recording: Recording) -> Iterator[Issue]:
    """Yield extents and peaks that no haptic device has: a unit taken for another."""
    keep = recording.measured
    todo = None if "import" in recording.meta else "see the program that wrote it"
    if recording.meta.get("source") == "hardware":
        todo = "see the wiring that it was recorded with: counts_per_turn, offsets and the other entries of [device]"
    for name, (channel, unit, values) in columns_of(recording).items():
        numbers = values[keep]
        if numbers.size == 0 or unit not in UNIT_LIMITS:
            continue
        # Extent of a place or an angle, peak of anything else, in the channel's unit.
        size = float(np.ptp(numbers) if unit in ("m", "rad") else np.max(np.abs(numbers)))
        limit, message = UNIT_LIMITS[unit]
        if size > limit:
            yield make_issue(recording, "unit", message.format(size), name, todo=todo)
        elif (
            channel == "hip"
            and 0.0 < size < LEAST_EXTENT
            and np.max(np.ptp(recording.hip[keep], axis=0)) < LEAST_EXTENT
        ):
            message = f"the hand moves by {1e6 * size:.3g} um: is the unit larger than it was taken for?"
            yield make_issue(recording, "unit", message, name, todo=todo)


RATE_RANGE = (10.0, 1e5)
"""Hz. Motion of a hand reaches some 5 Hz, which takes 10 rows a second to be seen at all; and 1e5 Hz is a hundred times
the usual haptic loop, beyond what a bus to encoders and motors passes."""

SPEED_RANGE = (1e-5, 10.0)
"""m/s, of a hand while it moves. One that tries to be still trembles by about 0.05 mm at 10 Hz, which is 2 mm/s: the
lower limit leaves a factor of 200 for hands that are held or simulated. The fastest throws reach the upper one."""

SMALLER_UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
FACTORS = {size: (unit, "s") for unit, size in SMALLER_UNITS.items()}
FACTORS |= {1.0 / size: ("s", unit) for unit, size in SMALLER_UNITS.items()}
"""What the times would have to be multiplied by where numbers in the first unit were taken for the second."""


def time_unit(recording: Recording) -> Iterator[Issue]:
    """Yield a suspicion where the clock or the hand's speed is none that a haptic device has, and the units that fit.

    A hand whose extent is none either has its length in a wrong unit, see `units`: only the clock counts then.
    """
    step = nominal_step(recording)
    if recording.meta.get("source") in SIMULATED or len(recording) < 3 or not step > 0.0:
        return
    rate, speed = 1.0 / step, _speed(recording)

    def described(factor: float) -> str:
        """Return rate and speed with times multiplied, in words; empty where no device and hand have them."""
        moves = "" if speed is None else f", and a hand that moves at {1e3 * speed / factor:.3g} mm/s"
        # Times multiplied by `factor` divide rate and speed by it.
        within = RATE_RANGE[0] <= rate / factor <= RATE_RANGE[1] and (
            speed is None or SPEED_RANGE[0] <= speed / factor <= SPEED_RANGE[1]
        )
        return f"{rate / factor:.4g} Hz{moves}" if within else ""

    if described(1.0):
        return
    now = f"{rate:.4g} Hz" + ("" if speed is None else f", and a hand that moves at {1e3 * speed:.3g} mm/s")
    others = [
        f"were the times in {unit}, and taken for {assumed}, it would be {words}"
        for factor, (unit, assumed) in FACTORS.items()
        if (words := described(factor))
    ]
    message = "; ".join([now, *others]) if others else f"{now}: no haptic device has that"
    yield make_issue(recording, "unit", message, "time", todo="see the unit of [time] in the mapping")


def _speed(recording: Recording) -> float | None:
    """Return the median speed of the HIP while it moves, m/s; None where it has no device's extent."""
    if "hip" not in recording.channels:
        return None
    keep = recording.measured
    if not keep.any():
        return None
    hip: Array = recording.hip[keep]
    steps, moved = np.diff(recording.time[keep]), np.linalg.norm(np.diff(hip, axis=0), axis=1)
    # At rest a hand has no typical speed, and stamps that repeat give none.
    some = (moved > 0.0) & (steps > 0.0)
    extent = float(np.max(np.ptp(hip, axis=0), initial=0.0))
    if not some.any() or not LEAST_EXTENT <= extent <= UNIT_LIMITS["m"][0]:
        return None
    return float(np.median(moved[some] / steps[some]))
