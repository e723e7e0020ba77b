"""What a robot's driver must offer, and the guard that makes one safe for a loop.

The guard checks what a driver gives, breaks it off where it hangs, and stops the motors at the end, whatever happened.
"""

from __future__ import annotations

import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from types import FrameType, TracebackType
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from hapticeval.errors import HapticevalError, describe_error, origin
from hapticeval.hardware.safety import WatchdogError
from hapticeval.types import Array


class Reading(NamedTuple):
    """One cycle of the hardware: its own monotonic clock (ns), its own count of cycles, and the raw joint positions.

    Raw is what the hardware has, encoder counts or radians, which `Wiring` converts. The count increases by one per
    cycle, whether the loop was there to read it or not: a gap in it is the number of cycles missed.
    """

    nanoseconds: int
    sequence: int
    raw: Array


@runtime_checkable
class HardwareDevice(Protocol):
    """A robot as a loop sees it. A driver of your own is a class with these three: see `examples/my_card.py`.

    Whatever they raise ends the run: the motors are commanded to zero, `close` is called, and what was recorded is
    kept. One that throws away what it was sent may have a mapping `dropped` of reasons to counts, which is told at the
    end.
    """

    def read(self) -> Reading:
        """Wait for the next cycle, and read the encoders."""

    def write(self, command: Array) -> None:
        """Output motor commands (N,) for this cycle, in the unit that the wiring states."""

    def close(self) -> None:
        """Stop the motors and let go of the hardware."""


FIRST_PATIENCE = 2.0
"""Seconds that the first cycle and closing may take."""

ZEROS = 3
"""How often zero is commanded at the end: one or two of them may be lost on the way."""

ZEROS_SECONDS = 2e-3
"""s between two of them, or a cycle where that is shorter: so that one burst of losses does not take them all."""

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""What ends a run with zeros: Ctrl-C, a request to end, and a terminal that is gone."""

LATE_READING = "late or repeated"
"""Why a reading is dropped whose count is no later than that of one before it."""

R = TypeVar("R")


def dropped_lines(counts: Mapping[str, int]) -> tuple[str, ...]:
    """Return how many readings were dropped, and why, a line for each reason of `counts`."""
    return tuple(f"{count} readings dropped: {why}" for why, count in counts.items())


class Guarded:
    """A driver made safe for a loop: `hardware` with `joints` joints and cycles of `dt` seconds, as a context.

    - Whatever it raises becomes a `HapticevalError` that names the cycle. A reading that is not finite is a
      `WatchdogError`, and so is a cycle that does not end within `patience` seconds (`FIRST_PATIENCE` for the first),
      which a timer signal breaks off. Only the main thread can have one, and a driver that waits in foreign code does
      not see it: give such a driver a time limit of its own.
    - A reading whose count is not later than the last one's, or later by more cycles than `patience` has, is dropped
      and counted: see `dropped`.
    - Ctrl-C, SIGTERM and SIGHUP are raised when a reading has come, never within the driver.
    - Zero is commanded at the end, `ZEROS` times, however often Ctrl-C is pressed.
    """

    def __init__(self, hardware: HardwareDevice, joints: int, dt: float, patience: float) -> None:
        self._hardware, self._joints, self._dt = hardware, joints, dt
        self._patience = max(FIRST_PATIENCE, patience)
        self._later_patience = patience
        self._most_ahead = max(1, round(patience / dt))
        self._cycle = 0
        self._last: int | None = None
        self._doing = "the driver"
        self._interrupted = False
        self._handled: list[tuple[signal.Signals, Any]] = []
        self._dropped: Counter[str] = Counter()
        self._watched = threading.current_thread() is threading.main_thread()

    def __enter__(self) -> Guarded:
        if self._watched:
            self._before = signal.signal(signal.SIGALRM, self._late)
            for number in ENDING_SIGNALS:
                # Only Python's own handlers are taken over: a program that has its own keeps it.
                handler = signal.getsignal(number)
                if handler in (signal.default_int_handler, signal.SIG_DFL):
                    self._handled.append((number, handler))
                    signal.signal(number, self._interrupt)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._stop(error)
        finally:
            if self._watched:
                # Stops the timer, also where closing the driver failed.
                signal.setitimer(signal.ITIMER_REAL, 0.0)
                signal.signal(signal.SIGALRM, self._before)
            for number, handler in self._handled:
                signal.signal(number, handler)

    def read(self) -> Reading:
        """Return the next reading: as many finite numbers as joints, and a count that is later than the last."""
        self._cycle += 1
        self._doing = "the driver's read()"
        self._wind()
        while True:
            answer = self._asked("read()", self._hardware.read)
            # Ctrl-C came while the driver waited: raised here, never within its code.
            if self._interrupted:
                raise KeyboardInterrupt
            reading = self._checked(answer)
            ahead = 1 if self._last is None else reading.sequence - self._last
            if 0 < ahead <= self._most_ahead:
                break
            # The timer is not wound up again: nothing but such readings is not a reading.
            self._dropped[LATE_READING if ahead <= 0 else f"counted more than {self._most_ahead} cycles ahead"] += 1
        self._last = reading.sequence
        # The timer goes on: until the next read or write a late cycle is the renderer's.
        self._doing, self._patience = "the renderer", self._later_patience
        return reading

    def dropped(self) -> tuple[str, ...]:
        """Return what the guard dropped, and a driver that has a mapping `dropped` of its own, a line each."""
        return dropped_lines(Counter(getattr(self._hardware, "dropped", {})) + self._dropped)

    def _checked(self, answer: Any) -> Reading:
        """Return what the driver gave, if it is a reading: it is foreign code, and may have given anything."""
        try:
            nanoseconds, sequence, raw = answer
            reading = Reading(int(nanoseconds), int(sequence), np.array(raw, dtype=np.float64))
        except (TypeError, ValueError):
            wrong = f"gave a {type(answer).__name__}: {str(answer)[:60]}"
            raise self._error(wrong, "a reading is (nanoseconds, sequence, raw positions)") from None
        if reading.raw.shape != (self._joints,):
            shape = f"gave raw positions of shape {reading.raw.shape}"
            raise self._error(shape, f"the robot has {self._joints} joints")
        if not np.isfinite(reading.raw).all():
            wrong = f"the driver's read() gave raw positions {reading.raw.tolist()} in cycle {self._cycle}"
            raise WatchdogError(wrong, why="they must be finite")
        return reading

    def write(self, command: Array) -> None:
        """Hand over motor commands (N,)."""
        self._doing = "the driver's write()"
        self._wind()
        self._asked("write()", lambda: self._hardware.write(command))

    def _wind(self) -> None:
        """Let the timer break off what does not end in time."""
        if self._watched:
            # s, and again after as long: a driver that swallows the first exception is broken off by the next.
            signal.setitimer(signal.ITIMER_REAL, self._patience, self._patience)

    def _asked(self, what: str, call: Callable[[], R]) -> R:
        try:
            return call()
        except HapticevalError:
            raise
        except Exception as error:
            raise HapticevalError(
                f"the driver's {what} raised {describe_error(error)} in cycle {self._cycle}",
                why=origin(error),
            ) from error

    def _stop(self, cause: BaseException | None) -> None:
        """Command zero and close, both in any case; report if either fails, for then the motors may still be on."""
        # What is to be done in any case may take as long as a start.
        self._patience = max(FIRST_PATIENCE, self._later_patience)
        problems: list[str] = []
        # Zero first: closing may hang, or let go of the card with its outputs as they are.
        zeros = ("write()", lambda: self._hardware.write(np.zeros(self._joints)))
        for count, (what, call) in enumerate([*[zeros] * ZEROS, ("close()", self._hardware.close)]):
            try:
                self._doing = f"the driver's {what}"
                self._wind()
                self._asked(what, call)
                if count < ZEROS - 1:
                    time.sleep(min(self._dt, ZEROS_SECONDS))
            except HapticevalError as error:
                if error.what not in problems:
                    problems.append(error.what)
        if problems:
            ended = []
            if isinstance(cause, HapticevalError):
                # Both are told: what ended the run, and that the motors may be on.
                reason = "" if cause.what in problems else f"the run had ended because {cause.what}"
                ended = [reason, cause.why]
            elif cause is not None:
                ended = [f"the run had ended by {describe_error(cause)}"]
            raise HapticevalError(
                "the motors may still be on", why="; ".join(filter(None, problems + ended)), todo="switch them off"
            ) from cause

    def _error(self, what: str, why: str) -> HapticevalError:
        return HapticevalError(f"the driver's read() {what} in cycle {self._cycle}", why=why)

    def _interrupt(self, _number: int, _frame: FrameType | None) -> None:
        self._interrupted = True

    def _late(self, _number: int, _frame: FrameType | None) -> None:
        dropped = "; ".join(self.dropped())
        raise WatchdogError(
            f"{self._doing} has not come back for {self._patience:g} s in cycle {self._cycle}",
            why=dropped,
            todo="see that the hardware is on and answers, and what holds up this program; silent_cycles in the wiring "
            "say how long that may be",
        )
