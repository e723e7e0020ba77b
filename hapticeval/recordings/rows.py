"""What rows of numbers have to be, and arrays that nobody can change."""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.types import Array, BoolArray


def locked(values: Any, dtype: Any) -> Any:
    """`values` as a read-only array: a copy, unless they are one already that nobody holds a way to write to."""
    if isinstance(values, np.ndarray) and values.dtype == dtype and not values.flags.writeable:
        base = values.base
        if base is None or (isinstance(base, np.ndarray) and not base.flags.writeable):
            return values
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def runs_of(mask: BoolArray) -> list[tuple[int, int]]:
    """The rows [first, end) over which `mask` (n,) holds, each as long as it goes."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def backward_difference(values: Array, time: Array) -> Array:
    """The causal derivative: (x[k] - x[k-1]) / (t[k] - t[k-1]), and zero at the first sample."""
    out = np.zeros_like(values)
    out[1:] = np.diff(values, axis=0) / np.diff(time)[:, None]
    return out


def check_finite(name: str, values: Array, valid: BoolArray | None = None) -> None:
    """Raise `InputError` with the first row of `values` (of those that are `valid`) that is not finite."""
    bad = ~np.isfinite(values)
    if bad.any():
        rows = bad.any(axis=-1) if values.ndim > 1 else np.atleast_1d(bad)
        if valid is not None:
            rows &= valid
            if not rows.any():
                return
        row = int(np.argmax(rows))
        raise InputError(
            f"{name} is not finite at row {row}: {np.array2string(np.atleast_1d(values[row]))}",
            why="a missing or infinite number cannot be judged and must not spread",
            todo="mend or cut that row",
        )


def check_increasing(name: str, values: Any, valid: BoolArray | None = None, *, unit: str = "s") -> None:
    """Raise `InputError` with the first row (of those that are `valid`) at which `values` does not increase."""
    kept = values if valid is None else values[valid]
    rises = kept[1:] > kept[:-1]
    if not rises.all():
        at = int(np.argmin(rises)) + 1
        row = at if valid is None else int(np.flatnonzero(valid)[at])
        before, after = (f"{x:.9g}" if isinstance(x, float) else f"{x}" for x in kept[at - 1 : at + 1].tolist())
        raise InputError(
            f"{name} does not increase at row {row}: {before} {unit}".rstrip() + f", then {after} {unit}".rstrip(),
            why="samples must be in the order in which they happened, each at a time of its own",
            todo="sort the rows, or drop the repeated ones",
        )
