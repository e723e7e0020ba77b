"""Where points stand to a boundary, in the plane and in space alike."""

from __future__ import annotations

from typing import NamedTuple

from hapticeval.types import Array


class Frame(NamedTuple):
    """For each of n points: y = foot + distance normal.

    `foot` (n, N), m, is the globally nearest boundary point; `normal` (n, N) the outward unit normal there; `distance`
    (n,), m, signed, negative inside; `shape` (n, N, N), 1/m, the shape operator W (symmetric, W normal = 0, positive
    where the model is convex): a foot that moves with velocity ṗ turns the normal by W ṗ, and off the surface
    P_T ẏ = (I + distance W) ṗ, the projection of section 7.2 of the thesis differentiated. In the plane W = κ t tᵀ.
    """

    foot: Array
    normal: Array
    distance: Array
    shape: Array
