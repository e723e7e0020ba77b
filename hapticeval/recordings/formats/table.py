"""What a foreign file holds before anyone has said what it means: named columns of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hapticeval.errors import InputError, UnknownNameError


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers, each (n,), float64 or int64; they may differ in length, as topics of a bag do.

    `units` holds only what the file or its format states; `notes` is the file's text about a column, a scope's label;
    `attributes` are single numbers and texts of the file; `warnings` say what is missing or damaged, `remarks` what
    is whole but no column of numbers.
    Integers stay integers: nanoseconds of a wall clock do not fit into a float.

    Raises `InputError`, naming the column, for one that is not a row of numbers.
    """

    columns: Mapping[str, ArrayLike]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    format: str = ""

    def __post_init__(self) -> None:
        columns = {name: _column(name, values) for name, values in self.columns.items()}
        object.__setattr__(self, "columns", MappingProxyType(columns))
        for name in ("units", "notes", "attributes"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for name in ("warnings", "remarks"):
            object.__setattr__(self, name, tuple(getattr(self, name)))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column, (n,). Raises `UnknownNameError`, which suggests the closest, for one that is not there."""
        if name not in self.columns:
            raise UnknownNameError("column", name, self.columns)
        return np.asarray(self.columns[name])

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
