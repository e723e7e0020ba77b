"""What a foreign file holds before anyone has said what it means: named columns of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.types import BoolArray


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers, each (n,), float64 or int64; they may differ in length, as topics of a bag do.

    `units` holds only what the file or its format states; `notes` is the file's text about a column, a scope's label;
    `attributes` are single numbers and texts of the file; `warnings` say what is missing or damaged, `remarks` what
    is whole but no column of numbers. Of a file that is cut short, `promised` says how many rows a column should have
    that lacks some at its end, or all of them: then it is in no `columns`. `open_ended` is one that was cut before it
    said what else it held. `cells` are those of the warnings that tell of cells without a number, which a recording
    counts itself.
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
    promised: Mapping[str, int] = field(default_factory=dict)
    open_ended: bool = False
    cells: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        columns = {name: _column(name, values) for name, values in self.columns.items()}
        object.__setattr__(self, "columns", MappingProxyType(columns))
        for name in ("units", "notes", "attributes", "promised"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for name in ("warnings", "remarks", "cells"):
            object.__setattr__(self, name, tuple(getattr(self, name)))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column, (n,).

        Raises `UnknownNameError`, which suggests the closest, for one that is not there, and `InputError` for one that
        is, or may be, in what the file has lost.
        """
        if name in self.columns:
            return np.asarray(self.columns[name])
        if self.lacks(name):
            raise InputError(
                f"the column '{name}' is not in what is left of the file",
                why="; ".join(self.warnings),
                todo="copy the file again from where it was recorded",
            )
        raise UnknownNameError("column", name, self.columns)

    def lacks(self, name: str) -> bool:
        """Whether a column is, or may be, in what the file has lost altogether."""
        return name not in self.columns and (self.open_ended or name in self.promised)

    def rows(self, name: str) -> int:
        """How many numbers a column has."""
        return int(self[name].size)


def whole_rows(
    name: str, values: NDArray[Any], whole: BoolArray | None
) -> tuple[dict[str, NDArray[Any]], dict[str, int]]:
    """The columns of an array (n, ...) up to the first row that is not `whole`, and of those that end early, n.

    `whole` is of the shape of `values`, or of its first axes; None stands for all.
    """
    columns = spread(name, values)
    if whole is None:
        return columns, {}
    whole = np.broadcast_to(whole.reshape(whole.shape + (1,) * (values.ndim - whole.ndim)), values.shape)
    kept, promised = {}, {}
    for column, there in spread(name, whole).items():
        if not there.all():
            promised[column] = there.size
        rows = there.size if there.all() else int(np.argmin(there))
        if rows:
            kept[column] = columns[column][:rows]
    return kept, promised


def lost_columns(name: str, shape: tuple[int, ...], dtype: Any) -> dict[str, int]:
    """How many rows the columns of an array had that is lost: by their names."""
    return {column: values.size for column, values in spread(name, np.broadcast_to(np.zeros((), dtype), shape)).items()}


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
