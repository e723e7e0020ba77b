"""What is wrong between columns: copies, shifted copies, a velocity that is no derivative, a force that lags, units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hapticeval.recordings.derivative import LAGS, LIKE, correlation, derivative_fit
from hapticeval.recordings.finding import Fault, Severity
from hapticeval.recordings.recording import Recording
from hapticeval.types import Array, BoolArray

COPY_ROWS = 50
"""Fewer moving rows than these can be equal by chance or by design."""

OWN, FOREIGN = 0.9, 0.5
"""Shares of the moving rows that are equal to the bit: of two columns of one run, and of one column of two runs. By
chance a converter of a hundred steps gives a hundredth of them."""

LAG_TICKS = 3
"""A proxy may answer up to three ticks late without being wrong, as peers do."""

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


def columns_of(recording: Recording) -> dict[str, Array]:
    """Every column by name: `hip.x`, `joint_torque.0`, `grip`."""
    found = {}
    for name, values in recording.channels.items():
        if values.ndim == 1:
            found[name] = values
        else:
            parts = "xyz" if recording.signals[name].frame == "world" else [str(k) for k in range(values.shape[1])]
            found |= {f"{name}.{parts[k]}": values[:, k] for k in range(values.shape[1])}
    return found


def copies(recording: Recording) -> list[Fault]:
    """Columns that are another one over again, or its negative, or shifted by some ticks: no second measurement.

    An IHIP may be the HIP, and a sensor exact: these are the same signal by what they mean, and are not told.
    """
    keep = recording.measured
    columns = {name: values[keep] for name, values in columns_of(recording).items()}
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
    for column, values in columns_of(recording).items():
        if column not in theirs or np.count_nonzero(np.diff(values)) < COPY_ROWS:
            continue
        found = matched(theirs[column], values, FOREIGN)
        if found is not None:
            when = f", {abs(found.lag)} rows {'later' if found.lag > 0 else 'earlier'}" if found.lag else ""
            message = f"it is that of {name}{when}{found.share}, bit for bit"
            todo = "see which run was meant: a hand never moves the same way twice"
            faults.append(Fault("from another run", Severity.SUSPICIOUS, message, todo, column))
    return faults


def velocities(recording: Recording) -> list[Fault]:
    """Velocities against the derivative of their position: ratio, correlation and lag, see `derivative`."""
    pairs = (("hip", "velocity"), ("joint_position", "joint_velocity"), ("ihip", "tool_velocity"))
    faults = []
    for place, speed in pairs:
        if place not in recording.channels or speed not in recording.channels:
            continue
        positions, speeds = recording.channels[place], recording.channels[speed]
        if positions.shape != speeds.shape:
            continue
        for column in range(positions.shape[1]):
            fault = _velocity(recording, place, f"{speed}.{_part(recording, speed, column)}", positions[:, column],
                              speeds[:, column])  # fmt: skip
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
    if best < LINEAR or best - there < 1.0 - LINEAR or not LAG_TICKS < abs(at) < LAGS:
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
    for name, values in columns_of(recording).items():
        kept = values[keep]
        unit = recording.signals[name.partition(".")[0] if name not in recording.signals else name].unit
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


def _part(recording: Recording, name: str, column: int) -> str:
    return "xyz"[column] if recording.signals[name].frame == "world" else str(column)
