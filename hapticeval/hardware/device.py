"""What a robot's driver must offer, and what it gives."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from hapticeval.types import Array


class Reading(NamedTuple):
    """One cycle of the hardware: its own monotonic clock (ns), its own count of cycles, and the raw joint positions.

    Raw is what the hardware has, encoder counts or radians: `Wiring` says what they mean. The count increases by one a
    cycle, whether the loop was there to read it or not: a gap in it tells how many cycles were missed.
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
        """Motor commands (N,) for this cycle, in the unit that the wiring says."""

    def close(self) -> None:
        """Stop the motors and let go of the hardware."""
