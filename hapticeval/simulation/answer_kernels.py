"""A renderer's compiled step, and then what the scene's effects change of its answer."""

from __future__ import annotations

from hapticeval.compiled import Change, Closest, Composed, borrowing
from hapticeval.types import Array

REFUSALS_PER_EFFECT = 1000
"""Refusals of the k-th effect, from 1, are numbered from REFUSALS_PER_EFFECT k on."""


@borrowing
def change_row(
    changes: tuple[Change, ...], closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:
    """Let the scene's effects change one answer in place, in their order; return 0, or the number of a refusal.

    `hip` (N,), m, and `velocity` (N,), m/s, are the hand's; `ihip` (N,), m, and `force` (N,), N, are changed.
    """
    for k in range(len(changes)):
        change = changes[k]
        refusal = change.function(change.numbers, closest, hip, velocity, dt, ihip, force)
        if refusal != 0:  # numbered so that it tells the effect too
            return REFUSALS_PER_EFFECT * (k + 1) + refusal
    return 0


@borrowing
def change_rows(
    changes: tuple[Change, ...], closest: Closest, hips: Array, velocities: Array, dt: float, ihips: Array,
    forces: Array,
) -> tuple[int, int]:  # fmt: skip
    """Change the answers to a path row by row; return the row at which an effect refuses, and its number, or 0.

    `hips` (n, N), m, and `velocities` (n, N), m/s, are the hand's; `ihips` (n, N), m, and `forces` (n, N), N, are
    changed.
    """
    for row in range(hips.shape[0]):
        refusal = change_row(changes, closest, hips[row], velocities[row], dt, ihips[row], forces[row])
        if refusal != 0:
            return row, refusal
    return hips.shape[0], 0


@borrowing
def answer(
    data: Composed, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array
) -> int:  # fmt: skip
    """One tick of a renderer with effects, of signature `LAW` but for its data: its own law, then the changes.

    `hip` (N,), m, `velocity` (N,), m/s, and `push` (N,), N, are the hand's; `ihip` (N,), m, and `force` (N,), N, are
    written.
    """
    refusal = data.law(data.data, hip, velocity, push, dt, ihip, force)
    if refusal != 0:
        return refusal
    return change_row(data.changes, data.closest, hip, velocity, dt, ihip, force)
