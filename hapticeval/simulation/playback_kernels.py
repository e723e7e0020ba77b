"""A renderer's compiled step, led along a path from the state that it has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hapticeval.compiled import borrowing
from hapticeval.types import Array


@borrowing
def lead(
    law: Callable[..., Any], data: Any, push: Array, hips: Array, velocities: Array, dt: Array,
    answers: tuple[Array, Array], reported: Array, contact: Array,
) -> int:  # fmt: skip
    """Write the IHIPs and forces, (n, N) each, of `answers` to `hips` (n, N), m, with `velocities` (n, N), m/s.

    Tick k lasts `dt[k]` s; `push` (N,), N, is the force that the hand is sensed to have. What the law leaves in
    `reported` (1,), unless that is empty, goes to `contact` (n,). Returns the row at which the law refuses, or n.
    """
    ihips, forces = answers
    for row in range(hips.shape[0]):
        if law(data, hips[row], velocities[row], push, dt[row], ihips[row], forces[row]) != 0:
            return row
        for i in range(reported.shape[0]):
            contact[row] = reported[i]
    return int(hips.shape[0])
