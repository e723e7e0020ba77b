"""Whether a recording's seconds can be seconds: a loop and a hand have their own pace."""

from __future__ import annotations

import numpy as np

from hapticeval.recordings.finding import Fault, Severity
from hapticeval.recordings.metadata import SIMULATED
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.relations import LEAST, LIMITS
from hapticeval.recordings.stretches import nominal_step
from hapticeval.types import Array

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
