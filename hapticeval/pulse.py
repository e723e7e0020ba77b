"""The pulse of a process: how many answers its renderers have given, counted where another process can see it.

Who waits for a long case learns from it whether the renderer is slow or hangs.
"""

from __future__ import annotations

from typing import Protocol


class Pulse(Protocol):
    """A number that two processes share, as `multiprocessing.RawValue` makes it."""

    value: int


_pulse: Pulse | None = None


def count_in(pulse: Pulse) -> None:
    """Count this process's answers in `pulse` from now on."""
    global _pulse
    _pulse = pulse


def beat() -> None:
    """Count an answer of a renderer, where anybody wants to know."""
    if _pulse is not None:
        _pulse.value += 1
