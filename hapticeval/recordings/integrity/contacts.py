"""Contacts of a tool with a wall in one dimension: impulse, apparent stiffness, restitution, each with its error.

The press p is the wall's force against the tool, positive, less what the sensor read just before the touch. Each
contact has

    impulse      J = integral of p dt                         N s
    stiffness    slope of p over x, from touch to peak        N/m, by least squares
    restitution  - (speed after) / (speed before)             by the slope of x over `SPEED_WINDOW`; none where a
                                                              contact lasts longer than `LONGEST_IMPACT`

A contact begins with a tool that moves into the wall: a force that rises while the tool leaves is kept apart, because
a wall cannot make it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.provenance import declared_floor
from hapticeval.recordings.quantization import numeric_step
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.types import Array

SPEED_WINDOW = 3e-3  # s over which a speed is the slope of the position: short against an approach, long against a tick
BIAS_TIME = 10e-3  # s before the touch over which the sensor's own reading is taken
CONTACT_SHARE = 0.1  # of the largest force: where a contact begins, if the recording does not state its `force_floor`
PRESSED_SHARE = 0.05  # of the peak: a contact lasts while the press is above it
# Shares of the peak between which the slope is taken: beyond, the sensor wanders or the contact turns.
LOADING_SHARES = (0.1, 0.9)
# s; a longer contact is pushed by the hand, which reacts by then, and its speeds give no restitution.
LONGEST_IMPACT = 0.1
CONFIDENCE = 0.95  # of the interval about the mean of the contacts, by Student's t
LEAST_ROWS = 4  # a slope needs so many rows


@dataclass(frozen=True)
class Impact:
    """One contact of a tool with a wall, rows [first, end), with the measures of the module.

    `begin` and `duration` are in s, `peak` (press) in N, `depth` below the touch in m, `impulse` in N s, `stiffness` in
    N/m, speeds in m/s. `stiffness_error` and `restitution_error` are standard errors: from the scatter about the line,
    and from the quantum of the position.
    """

    first: int
    end: int
    begin: float
    duration: float
    peak: float
    depth: float
    impulse: float
    stiffness: float
    stiffness_error: float
    speed_before: float
    speed_after: float
    restitution: float
    restitution_error: float


@dataclass(frozen=True)
class Impacts:
    """The contacts of a recording, and when (s) a force rose without an approach; `floor` (N) is where one begins.

    In the `unexplained` ones the tool left, moved by no more than a quantum, or the recording begins with them.
    """

    contacts: tuple[Impact, ...]
    unexplained: tuple[float, ...]
    floor: float

    def mean(self, measure: str) -> tuple[float, float]:
        """Return the mean of a measure over the contacts, and half its 95 per cent interval; NaN where not known."""
        values = np.array([getattr(contact, measure) for contact in self.contacts])
        values = values[np.isfinite(values)]
        if values.size < 2:
            return (float(values[0]) if values.size else math.nan), math.nan
        from scipy.special import stdtrit

        # Student's t with n - 1 degrees of freedom: mean +- t s / sqrt(n).
        point = float(stdtrit(values.size - 1, 0.5 + 0.5 * CONFIDENCE))
        return float(values.mean()), point * float(values.std(ddof=1)) / math.sqrt(values.size)


def wall_channel(recording: Recording) -> str:
    """Return which force a wall gives: that on a teleoperated tool, where it is there, else that on the hand."""
    return "wall_force" if "wall_force" in recording.channels else "force"


def impacts(recording: Recording) -> Impacts:
    """Find the contacts of a recording in one dimension.

    The tool is the IHIP and its force `wall_force`, where that channel is there (a teleoperated tool at a real wall);
    else they are the HIP and the force on the hand. Free motion does not reach `meta["force_floor"]` (N), or else a
    tenth of the largest force. Raises `InputError` for another dimension and for a missing channel.
    """
    if recording.dimension != 1:
        raise InputError(
            f"a recording in {recording.dimension} dimensions",
            why="impulse and restitution can be separated from sliding in one dimension only",
            todo="take the checks of a suite: hapticeval replay",
        )
    pushing = wall_channel(recording)
    force = recording.channel(pushing)[:, 0]
    place = recording.channel("hip" if pushing == "force" else "ihip")[:, 0]
    valid, time = recording.measured, recording.time
    # The wall pushes against the side that the tool comes from: `into` grows as the tool moves into it.
    sign = -math.copysign(1.0, float(force[valid][np.argmax(np.abs(force[valid]))]))
    press, into = np.where(valid, -sign * force, 0.0), sign * place
    declared = declared_floor(recording)
    # N; below it the sensor may read anything in free motion.
    floor = CONTACT_SHARE * float(press.max()) if declared is None else declared
    step, tick = numeric_step(into[valid]) or 0.0, float(np.median(np.diff(time)))
    window = max(2, round(SPEED_WINDOW / tick))
    contacts, unexplained = [], []
    for first, end in runs_of((press > floor) & valid):
        if end - first < LEAST_ROWS:
            continue
        # m/s; a tool that moves by less than a quantum within the window has no known direction.
        speed, resolvable = _speed(into, first - window, first, tick), step / (window * tick)
        if speed > resolvable:
            contacts.append(_impact(time, press, into, first, end, step))
        else:
            unexplained.append(float(time[first]))
    return Impacts(tuple(contacts), tuple(unexplained), floor)


def _impact(time: Array, press: Array, into: Array, first: int, end: int, step: float) -> Impact:
    """Measure the contact over rows [first, end) above the floor, before which the tool moves into the wall."""
    tick = float(np.median(np.diff(time)))
    window, before = max(2, round(SPEED_WINDOW / tick)), max(2, round(BIAS_TIME / tick))
    largest = float(press[first:end].max())
    touch, bias = first, float(np.median(press[max(0, first - 2 * before) : max(1, first - before)]))
    for _ in range(3):  # what the sensor reads before the touch says where the touch is, and the other way round
        touch = first
        while touch > 0 and press[touch - 1] > bias + PRESSED_SHARE * (largest - bias):
            touch -= 1
        bias = float(np.median(press[max(0, touch - 1 - before) : max(1, touch - 1)]))
    # From here on the peak is above what the sensor read just before the touch.
    largest -= bias
    release = end
    while release < press.size and press[release] > bias + PRESSED_SHARE * largest:
        release += 1
    load = press[touch:release] - bias
    peak = int(np.argmax(load))
    loading = load[: peak + 1]
    rows = np.flatnonzero((loading >= LOADING_SHARES[0] * largest) & (loading <= LOADING_SHARES[1] * largest))
    # N/m, between a tenth and nine tenths of the peak.
    stiffness, error = _slope(into[touch + rows], load[rows])
    duration = float(time[release - 1] - time[touch])
    # Leaving is negative: the fastest way out after the peak is the smallest of these.
    exit_speeds = [_speed(into, row, row + window, tick) for row in range(touch + peak, release)]
    speed_after = (
        min([exit_speed for exit_speed in exit_speeds if math.isfinite(exit_speed)], default=math.nan)
        if duration <= LONGEST_IMPACT
        else math.nan
    )
    # The fastest way in before the touch: later the wall has slowed the tool already.
    speed_before = max(_speed(into, row - window, row, tick) for row in range(max(window, touch - window), touch + 1))
    # A rounding of one quantum has the variance step^2 / 12, and a difference of two roundings twice that.
    speed_error = math.sqrt(2.0 / 12.0) * step / (window * tick)
    return Impact(
        first=touch,
        end=release,
        begin=float(time[touch]),
        duration=duration,
        peak=float(load[peak]),
        depth=float(into[touch:release].max() - into[touch]),
        impulse=float(np.trapezoid(load, time[touch:release])),
        stiffness=stiffness,
        stiffness_error=error,
        speed_before=speed_before,
        speed_after=speed_after,
        restitution=-speed_after / speed_before,
        restitution_error=math.hypot(
            speed_error / speed_before, -speed_after / speed_before * speed_error / speed_before
        ),
    )


def _speed(values: Array, first: int, last: int, tick: float) -> float:
    """Return the mean speed between two rows, NaN where one is not there."""
    if first < 0 or last >= values.size or last <= first:
        return math.nan
    return float(values[last] - values[first]) / ((last - first) * tick)


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Return the slope of y over x by least squares, and its standard error; NaN where x does not move."""
    if x.size < LEAST_ROWS or np.ptp(x) == 0.0:
        return math.nan, math.nan
    line, covariance = np.polyfit(x, y, 1, cov=True)
    return float(line[0]), math.sqrt(float(covariance[0, 0]))
