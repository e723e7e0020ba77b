"""The pulse of a process, seen from another one: how many answers its renderers have given, whether it compiles.

Who waits for a long case learns from it whether the renderer is slow or hangs.
"""

from __future__ import annotations

from collections.abc import Iterator, MutableSequence
from contextlib import contextmanager
from typing import TypeAlias

Pulse: TypeAlias = MutableSequence[int]
"""Two numbers that processes share, as `multiprocessing.RawArray` makes them: answers, and compilations under way."""

_pulse: Pulse = [0, 0]


def count_in(pulse: Pulse) -> None:
    """Count this process's answers in `pulse` from now on."""
    global _pulse
    _pulse = pulse


def beat() -> None:
    """Count an answer of a renderer."""
    _pulse[0] += 1


@contextmanager
def compiling() -> Iterator[None]:
    """While it lasts, this process compiles, and no renderer is to blame for its silence."""
    _pulse[1] += 1
    try:
        yield
    finally:
        _pulse[1] -= 1
