"""What a robot's driver must offer, and what it gives."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from hapticeval.types import Array


class Reading(NamedTuple):
    """One cycle of the hardware: its own monotonic clock (ns), its own count of cycles, and the raw joint positions.

    Raw is what the hardware has, encoder counts or radians: `Wiring` says what they mean.
    """

    nanoseconds: int
    sequence: int
    raw: Array


@runtime_checkable
class HardwareDevice(Protocol):
    """A robot as a loop sees it. A driver of your own is a class with these three:

    class MyCard:
        def __init__(self):
            self.card = open_card()                                  # whatever your card's library has
            self.count = 0
        def read(self):
            self.card.wait_for_tick()                                # the hardware sets the pace
            self.count += 1
            return Reading(time.monotonic_ns(), self.count, np.array(self.card.encoders(), dtype=float))
        def write(self, command):
            self.card.analog_out(command)                            # V, A or N m: see Wiring.torque_per_command
        def close(self):
            self.card.analog_out(np.zeros(3))
            self.card.close()
    """

    def read(self) -> Reading:
        """Wait for the next cycle, and read the encoders. Raises `HapticevalError` when the hardware has gone."""

    def write(self, command: Array) -> None:
        """Motor commands (N,) for this cycle, in the unit that the wiring says."""

    def close(self) -> None:
        """Stop the motors and let go of the hardware; may be called more than once."""
