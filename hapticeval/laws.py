"""What compiled laws, effects and devices take, as values that other compiled code calls, and a tick of the whole step.

A renderer's law answers the hand; the scene's effects change that answer in their order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types
from numpy.typing import ArrayLike

from hapticeval.compiled import FirstClass, borrowing, first_class, for_kernels
from hapticeval.types import Array

VECTOR = types.Array(types.float64, 1, "C")
MATRIX = types.Array(types.float64, 2, "C")

KINEMATICS = types.void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR)
"""(parameters, joints, rates, out position, out velocity, out Jacobian J, out J̇ rates) of a device."""

DYNAMICS = types.void(VECTOR, VECTOR, VECTOR, MATRIX, VECTOR)
"""(parameters, joints, rates, out inertia M, out bias): M q̈ + bias = τ."""

MARGIN = types.float64(VECTOR, VECTOR)
"""(parameters, joints): positive inside the functional configuration space, see `Device.margin`."""

EFFECT = types.float64(VECTOR, MATRIX, MATRIX, types.int64, types.float64, VECTOR, VECTOR)
"""(params, samples, state, tick, dt, first, second): one tick of an effect, see `hapticeval.effects.effect.Part`."""


EMPTY_TABLE: Array = np.empty((0, 0))
"""The table that a law has no use for."""


class LawData(NamedTuple):
    """What a renderer's compiled step works on, in arrays that are writable and contiguous: any may be empty.

    - `params` (k,): gains and other numbers.
    - `pieces`, `joins`, `lookup`, `vertices` and `tree`, all (rows, columns): the surface. They are its pieces (of a
      curve, a mesh's faces, or a smooth surface as one row), what belongs to the joins between a curve's, a table in
      which the nearest point is looked for, an outline of straight edges or a mesh's vertices, and its search tree.
    - `state` (m,): what the renderer keeps between ticks. Its `reset` prepares it, and each tick of the law goes on
      from it.
    """

    params: Array
    pieces: Array
    joins: Array
    lookup: Array
    vertices: Array
    tree: Array
    state: Array


def law_data(
    params: ArrayLike = (),
    *,
    pieces: ArrayLike = EMPTY_TABLE,
    joins: ArrayLike = EMPTY_TABLE,
    lookup: ArrayLike = EMPTY_TABLE,
    vertices: ArrayLike = EMPTY_TABLE,
    tree: ArrayLike = EMPTY_TABLE,
    state: int = 0,
) -> LawData:
    """Return what a law works on, of the type that `LAW` asks for, from what a renderer has.

    `params` (k,) are its numbers; the tables are (rows, columns) with lengths in m, see `LawData`; `state` is the size
    of the state, all zeros. Tables that have the type already are shared, for a mesh has many megabytes of them; the
    few numbers are copied.
    """
    tables = (for_kernels(np.asarray(table, dtype=np.float64)) for table in (pieces, joins, lookup, vertices, tree))
    return LawData._make([np.array(params, dtype=np.float64), *tables, np.zeros(state)])


LAW_DATA = types.NamedTuple((VECTOR, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX, VECTOR), LawData)  # type: ignore[no-untyped-call]

LAW = types.int64(LAW_DATA, VECTOR, VECTOR, VECTOR, types.float64, VECTOR, VECTOR)
"""(data, hip, velocity, push, dt, out ihip, out force): one tick of a renderer.

Returns 0, or where the hand has left the law's domain the number that `CompiledStep.domain_exits` words. `push` is the
hand's force as sensed, zero where there is no sensor.
"""


class Closest(NamedTuple):
    """The closest point of a boundary as compiled code: `function`, of signature `CLOSEST`, over its own `data`."""

    function: Callable[..., float]
    data: LawData


FOOT, NORMAL, SHAPE = 0, 1, 2
"""Rows of a frame that `CLOSEST` writes: see there."""

CLOSEST = types.float64(LAW_DATA, VECTOR, MATRIX)
"""(data, point, out frame): the signed distance (m) of a point (N,), and as many rows of N as the frame has.

Row `FOOT` is the closest point, `NORMAL` the outward unit normal there, the N rows from `SHAPE` on the shape operator
(1/m), and the first number of the row after it, in the plane, the arc length (m) from the curve's start.
"""


class ChangeData(NamedTuple):
    """The arrays that an effect's change of an answer works on: fields of the effect's `Part`."""

    params: Array
    samples: Array
    state: Array


_CHANGE_DATA_TYPE = types.NamedTuple((VECTOR, MATRIX, MATRIX), ChangeData)  # type: ignore[no-untyped-call]
_CLOSEST_TYPE = types.NamedTuple((types.FunctionType(CLOSEST), LAW_DATA), Closest)  # type: ignore[no-untyped-call]
CHANGE = types.int64(_CHANGE_DATA_TYPE, _CLOSEST_TYPE, VECTOR, VECTOR, types.float64, VECTOR, VECTOR)
"""(data, closest, hip, velocity, dt, ihip, force): an effect's change of an answer, in place, after each tick.

Returns 0, or where the hand has left the effect's domain the number that its `domain_exits` words.
"""


class Change(NamedTuple):
    """An effect's change of an answer: `function`, of signature `CHANGE`, and what it works on."""

    function: Callable[..., int]
    data: ChangeData


class Composed(NamedTuple):
    """A renderer's compiled `law` with the effects' `changes` of its answers, in order: the data of the whole step."""

    law: Callable[..., int]
    data: LawData
    changes: tuple[Change, ...]
    closest: Closest


def law_value(function: Callable[..., Any], data: Any) -> FirstClass:
    """Return a compiled step as a value: of signature `LAW`, with the type of its own data in place of `LawData`."""
    # Another tuple, of a law with effects, has a type of its own, and so the kernel a signature of its own.
    if isinstance(data, LawData):
        return first_class(function, LAW)
    return first_class(function, types.int64(numba.typeof(data), *LAW.args[1:]))  # type: ignore[no-untyped-call]


@borrowing
def lead_by_law(
    law: Callable[..., Any], data: Any, push: Array, hips: Array, velocities: Array, dt: Array, ihips: Array,
    forces: Array, reported: Array, contact: Array,
) -> tuple[int, int]:  # fmt: skip
    """Answer each row of a path by a law, a tick a row, from the state that it has.

    `hips` (n, N), m, and `velocities` (n, N), m/s, are the hand's, and `push` (N,), N, what it is sensed to push; tick
    k lasts `dt[k]` s. Writes `ihips` (n, N), m, and `forces` (n, N), N. What the law leaves in `reported` (1,), unless
    that is empty, goes to `contact` (n,). Returns the row at which the hand leaves the law's domain or the law
    breaks, and its number; else n and 0.
    """
    for row in range(hips.shape[0]):
        number = law(data, hips[row], velocities[row], push, dt[row], ihips[row], forces[row])
        if number != 0:
            return row, number
        for i in range(reported.shape[0]):
            contact[row] = reported[i]
    return hips.shape[0], 0


EXITS_PER_EFFECT = 1000
"""Domain exits of the k-th effect, from 1, are numbered from EXITS_PER_EFFECT k on."""


@borrowing
def change_row(
    changes: tuple[Change, ...], closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:
    """Let the scene's effects change one answer in place, in their order; return 0, or a domain exit's number.

    `hip` (N,), m, and `velocity` (N,), m/s, are the hand's; `ihip` (N,), m, and `force` (N,), N, are changed.
    """
    for k in range(len(changes)):
        change = changes[k]
        exit_number = change.function(change.data, closest, hip, velocity, dt, ihip, force)
        if exit_number != 0:  # numbered so that it tells the effect too
            return EXITS_PER_EFFECT * (k + 1) + exit_number
    return 0


@borrowing
def answer(
    data: Composed, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array
) -> int:  # fmt: skip
    """One tick of a renderer with effects, of signature `LAW` but for its data: its own law, then the changes.

    `hip` (N,), m, `velocity` (N,), m/s, and `push` (N,), N, are the hand's; `ihip` (N,), m, and `force` (N,), N, are
    written.
    """
    exit_number = data.law(data.data, hip, velocity, push, dt, ihip, force)
    if exit_number != 0:
        return exit_number
    return change_row(data.changes, data.closest, hip, velocity, dt, ihip, force)


@borrowing
def give_next(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """Give the next of answers that are known, of signature `LAW`: the rows of `data.pieces`, m, and `data.joins`, N.

    Neither `hip` (N,), m, nor `velocity` (N,), m/s, is asked; `ihip` (N,), m, and `force` (N,), N, are written.
    """
    row = int(data.state[0])
    for i in range(ihip.shape[0]):
        ihip[i], force[i] = data.pieces[row, i], data.joins[row, i]
    data.state[0] = row + 1.0
    return 0
