"""What a foreign file holds before anyone has said what it means: named columns of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.recordings.memory import reserve


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers, each (n,), float64 or int64; they may differ in length, as topics of a bag do.

    `units` holds only what the file or its format states; `notes` is the file's text about a column, a scope's label;
    `attributes` are single numbers and texts of the file; `warnings` say what is missing or damaged, `remarks` what
    is whole but no column of numbers. `cells` are those of the warnings that report cells without a number, which a
    recording counts itself. `topics` names, for columns of a file that holds several streams, the stream of each: rows
    of different streams are at different times, however many there are.
    Integers stay integers: nanoseconds of a wall clock do not fit into a float.

    Raises `InputError`, naming the column, for one that is not a row of numbers, and where all of them take more memory
    than `memory.limited` allows.
    """

    columns: Mapping[str, ArrayLike]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    format: str = ""
    cells: tuple[str, ...] = ()
    topics: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        reserve(8 * sum(np.size(values) for values in self.columns.values()), "the columns of the file")
        columns = {name: _column(name, values) for name, values in self.columns.items()}
        object.__setattr__(self, "columns", MappingProxyType(columns))
        for name in ("units", "notes", "attributes", "topics"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for name in ("warnings", "remarks", "cells"):
            object.__setattr__(self, name, tuple(getattr(self, name)))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column, (n,). Raises `UnknownNameError`, which suggests the closest, for one that is not there."""
        if name in self.columns:
            return np.asarray(self.columns[name])
        raise UnknownNameError("column", name, self.columns)

    def rows(self, name: str) -> int:
        """How many numbers a column has."""
        return int(self[name].size)


def _column(name: str, values: ArrayLike) -> NDArray[Any]:
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "fiub":
        raise InputError(
            f"column '{name}' is of shape {array.shape} and type {array.dtype}",
            why="a column is one number a row",
            todo="split an array of several columns into one each: see `spread`",
        )
    kept = np.array(array, dtype=np.float64 if array.dtype.kind == "f" else np.int64)
    kept.flags.writeable = False
    return kept


def spread(name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The columns of an array (n, ...): itself where it is one column, else `name[0]`, `name[1]`, ..."""
    if values.ndim == 1:
        return {name: values}
    flat = values.reshape(len(values), -1)
    return {name if flat.shape[1] == 1 else f"{name}[{k}]": flat[:, k] for k in range(flat.shape[1])}


def upright(name: str, values: NDArray[Any], remarks: list[str]) -> NDArray[Any]:
    """An array with its samples along the first axis, as far as its shape alone shows it.

    A single row is a column that lies down. A matrix of many more columns than any device has signals, and of fewer
    rows than columns, has its signals in rows: a remark says that they were swapped.
    """
    if values.ndim != 2 or (values.shape[0] > 1 and not lies(values.shape)):
        return values
    if values.shape[0] > 1:
        remarks.append(lying(name, values.shape))
    return values.T


MOST_SIGNALS = 64
"""A matrix of more columns than these that has fewer rows than columns holds its signals in rows."""


def lies(shape: tuple[int, ...]) -> bool:
    """Whether a matrix of this shape has its signals in rows and its samples in columns."""
    return len(shape) == 2 and shape[1] > max(MOST_SIGNALS, shape[0])


def lying(name: str, shape: tuple[int, ...]) -> str:
    """The remark on a matrix whose rows and columns are swapped."""
    return f"{name} is {shape[0]} x {shape[1]}: its {shape[0]} rows are taken for the signals, its columns for samples"
