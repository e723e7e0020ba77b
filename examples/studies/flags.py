"""An engine that tests at each tick which effects are on, for comparison with one that is composed of them.

It holds every effect and calls each by name, inlined where the compiler likes, behind a test of its flag.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numba
import numpy as np

from hapticeval.compiled import borrowing
from hapticeval.laws import ChangeData, Closest, Composed, LawData
from hapticeval.renderer import CompiledStep
from hapticeval.types import Array


class Flagged(NamedTuple):
    """What the engine's step works on: a renderer's `law`, and the data of all effects with their `flags` (n,)."""

    law: Callable[..., int]
    data: LawData
    change_data: tuple[ChangeData, ...]
    flags: Array
    closest: Closest


def flagged_law(composed: Composed) -> tuple[CompiledStep, Array]:
    """Return a step that shows those effects of a composed law whose flag is not 0, and the flags (n,), all 0."""
    # The kernels by name, not as values: the compiler may inline them.
    functions: list[Any] = [change.function for change in composed.changes]
    chain = _chain([function.kernel for function in functions])

    @_compile_inlining
    def answer(data: Flagged, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array) -> int:
        """Answer a `hip` (N,), m, with `ihip` (N,), m, and `force` (N,), N, both written; see `laws.LAW`."""
        exit_number = data.law(data.data, hip, velocity, push, dt, ihip, force)
        if exit_number != 0:
            return exit_number
        return chain(data, hip, velocity, dt, ihip, force)

    flags = np.zeros(len(functions))
    change_data = tuple(change.data for change in composed.changes)
    data: Any = Flagged(composed.law, composed.data, change_data, flags, composed.closest)
    return CompiledStep(answer, data, {}), flags


def _chain(functions: Sequence[Callable[..., int]]) -> Callable[..., int]:
    """Return a kernel that calls each change, in order, whose flag is not 0."""
    if not functions:
        return _change_nothing
    # Recursion makes the chain: a compiled loop cannot go over functions of different types.
    before, change, last = _chain(functions[:-1]), functions[-1], len(functions) - 1

    @_compile_inlining
    def change_flagged(data: Flagged, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array) -> int:
        """Change `ihip` (N,), m, and `force` (N,), N, by each effect whose flag is set; see `laws.CHANGE`."""
        exit_number = before(data, hip, velocity, dt, ihip, force)
        if exit_number != 0:
            return exit_number
        # The test at each tick whose cost is measured: a flag of this change, as a number.
        if data.flags[last] != 0.0:
            return change(data.change_data[last], data.closest, hip, velocity, dt, ihip, force)
        return 0

    return change_flagged


def _compile_inlining(function: Callable[..., int]) -> Callable[..., int]:
    """Compile a function that names other kernels as they are now: no cache would know it again."""
    compile_: Any = numba.njit
    # No reference counts, as in `borrowing`: the two engines differ in the tests alone.
    kernel: Callable[..., int] = compile_(error_model="numpy", _nrt=False)(function)
    return kernel


@borrowing
def _change_nothing(data: Flagged, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array) -> int:
    return 0


@borrowing
def answer_rows(
    law: Callable[..., int], data: Any, hips: Array, velocities: Array, push: Array, dt: float, ihips: Array,
    forces: Array,
) -> int:  # fmt: skip
    """Ask a compiled step for its answer to every hand position; return how many it answered.

    `hips` (n, N), m, and `velocities` (n, N), m/s, are the ticks; `push` (N,), N, is the hand's force at all of them.
    The answers are written into `ihips` (n, N), m, and `forces` (n, N), N.
    """
    for row in range(hips.shape[0]):
        if law(data, hips[row], velocities[row], push, dt, ihips[row], forces[row]) != 0:
            return row
    return int(hips.shape[0])
