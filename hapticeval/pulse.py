"""The pulse of a process, seen from another one: how many answers its renderers have given, whether it compiles.

Who waits for a long case learns from it whether the renderer is slow or hangs; and where a renderer ends its process,
at which tick and HIP it was asked.
"""

from __future__ import annotations

from collections.abc import Iterator, MutableSequence, Sequence
from contextlib import contextmanager
from typing import TypeAlias

Pulse: TypeAlias = MutableSequence[int]
"""Two numbers that processes share, as `multiprocessing.RawArray` makes them: answers, and compilations under way."""

PendingStep: TypeAlias = MutableSequence[float]
"""What is asked of a renderer now, shared likewise: how many coordinates the HIP has, 0 between two steps; the tick;
up to three coordinates (m); and a number for whoever notes it."""

PENDING_SIZE = 6

_pulse: Pulse = [0, 0]
_pending: PendingStep = [0.0] * PENDING_SIZE


def share_pulse(pulse: Pulse, pending: PendingStep) -> None:
    """Count this process's answers in `pulse`, and note the step under way in `pending`, from now on."""
    global _pulse, _pending
    _pulse, _pending = pulse, pending


def note_pending(tick: int, hip: Sequence[float]) -> None:
    """Note that a renderer is asked for the step `tick` at the HIP (N,), m, until `count_answer`."""
    # The count of coordinates says that a step is under way. It goes last: who finds it finds tick and HIP complete.
    _pending[1] = tick
    _pending[2 : 2 + len(hip)] = hip
    _pending[0] = len(hip)


def note_run(first: int) -> None:
    """Note that a compiled loop begins, in which the first step is the tick `first`: see `pending_memory`."""
    _pending[1] = first - 1


def pending_memory() -> PendingStep:
    """Return the memory of the step under way, for compiled code that notes by itself what it asks of a renderer."""
    return _pending


def unanswered_step(pending: PendingStep) -> tuple[int, tuple[float, ...]] | None:
    """Return the tick and HIP (m) of a step that was not answered; None where there was none."""
    # 0 coordinates: the last step was answered.
    count = int(pending[0])
    # A hand is led in before tick 0.
    return (max(int(pending[1]), 0), tuple(pending[2 : 2 + count])) if count else None


def count_answer() -> None:
    """Count an answer of a renderer."""
    # One process counts and others only read: no lock is needed.
    _pulse[0] += 1
    _pending[0] = 0


@contextmanager
def compiling() -> Iterator[None]:
    """Say, as long as the block lasts, that this process compiles: no renderer is to blame for its silence."""
    # A count and no flag: kernels that are compiled may call others that are compiled meanwhile.
    _pulse[1] += 1
    try:
        yield
    finally:
        _pulse[1] -= 1
