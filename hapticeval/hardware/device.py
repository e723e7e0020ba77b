"""What a robot's driver must offer, and the guard that makes one safe for a loop.

The guard checks what a driver gives, breaks it off where it hangs, and stops the motors at the end, whatever happened.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from hapticeval.errors import HapticevalError, describe_error, origin
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
    kept.
    """

    def read(self) -> Reading:
        """Wait for the next cycle, and read the encoders."""

    def write(self, command: Array) -> None:
        """Output motor commands (N,) for this cycle, in the unit that the wiring states."""

    def close(self) -> None:
        """Stop the motors and let go of the hardware."""


CYCLE_PATIENCE = 2.0
"""Seconds that a cycle may take before the hardware counts as gone, but four cycles at least."""

R = TypeVar("R")


class Guarded:
    """A driver made safe for a loop: `hardware` with `joints` joints and cycles of `dt` seconds, as a context.

    - Whatever it raises becomes a `HapticevalError` that names the cycle, and so do readings that are no numbers.
    - A cycle that does not end within `CYCLE_PATIENCE` is broken off by a timer signal. Only the main thread can have
      one, and a driver that waits in foreign code does not see it: give such a driver a time limit of its own.
    - Ctrl-C is raised when a reading has come, never within the driver.
    - The motors are stopped at the end, however often Ctrl-C is pressed.
    """

    def __init__(self, hardware: HardwareDevice, joints: int, dt: float) -> None:
        self._hardware, self._joints = hardware, joints
        self._patience = max(CYCLE_PATIENCE, 4.0 * dt)
        self._cycle = 0
        self._last: int | None = None
        self._doing = "the driver"
        self._interrupted = self._asks_us = False
        self._watched = threading.current_thread() is threading.main_thread()

    def __enter__(self) -> Guarded:
        if self._watched:
            self._before = signal.signal(signal.SIGALRM, self._late)
            # Only Python's own Ctrl-C is taken over: a program that handles it keeps its handler.
            self._asks_us = signal.getsignal(signal.SIGINT) is signal.default_int_handler
            if self._asks_us:
                signal.signal(signal.SIGINT, self._interrupt)
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
            if self._asks_us:
                signal.signal(signal.SIGINT, signal.default_int_handler)

    def read(self) -> Reading:
        """Return the next reading: as many finite numbers as joints, and a count that is later than the last."""
        self._cycle += 1
        answer = self._asked("read()", self._hardware.read)
        # Ctrl-C came while the driver waited: raised here, never within its code.
        if self._interrupted:
            raise KeyboardInterrupt
        try:
            # A driver is foreign code: whatever it gives is checked before the loop sees it.
            nanoseconds, sequence, raw = answer
            reading = Reading(int(nanoseconds), int(sequence), np.array(raw, dtype=np.float64))
        except (TypeError, ValueError):
            wrong = f"gave a {type(answer).__name__}: {str(answer)[:60]}"
            raise self._error(wrong, "a reading is (nanoseconds, sequence, raw positions)") from None
        if reading.raw.shape != (self._joints,):
            shape = f"gave raw positions of shape {reading.raw.shape}"
            raise self._error(shape, f"the robot has {self._joints} joints")
        if not np.isfinite(reading.raw).all():
            raise self._error(f"gave raw positions {reading.raw.tolist()}", "they must be finite")
        if self._last is not None and reading.sequence <= self._last:
            count = f"counted cycle {reading.sequence} after cycle {self._last}"
            raise self._error(count, "the count of cycles must increase")
        self._last = reading.sequence
        # The timer goes on: until the next read or write a late cycle is the renderer's.
        self._doing = "the renderer"
        return reading

    def write(self, command: Array) -> None:
        """Hand over motor commands (N,)."""
        self._asked("write()", lambda: self._hardware.write(command))

    def _asked(self, what: str, call: Callable[[], R]) -> R:
        self._doing = f"the driver's {what}"
        if self._watched:
            # s, and again after as long: a driver that swallows the first exception is broken off by the next.
            signal.setitimer(signal.ITIMER_REAL, self._patience, self._patience)
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
        problems = []
        for what, call in (
            # Zero first: closing may hang, or let go of the card with its outputs as they are.
            ("write()", lambda: self._hardware.write(np.zeros(self._joints))),
            ("close()", self._hardware.close),
        ):
            try:
                self._asked(what, call)
            except HapticevalError as error:
                problems.append(error.what)
        if problems:
            ended = []
            if isinstance(cause, HapticevalError):
                # Both are told: what ended the run, and that the motors may be on.
                ended = [f"the run had ended because {cause.what}"] * (cause.what not in problems) + [cause.why]
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
        raise HapticevalError(
            f"{self._doing} has not come back for {self._patience:g} s in cycle {self._cycle}",
            todo="see that the hardware is on and answers",
        )
