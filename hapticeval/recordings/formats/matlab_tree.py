"""What both kinds of MATLAB files have in common: a tree of named arrays that becomes a table of columns."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.recordings.formats.shortfall import shortfall
from hapticeval.recordings.formats.table import Table, lost_columns, whole_rows
from hapticeval.types import BoolArray

FEW = 9
"""An array of as many numbers at the most is a parameter (a 3 x 3 matrix), no signal."""


class Tree:
    """Takes the arrays of a file one after the other, each by its path, as MATLAB orders them (rows first)."""

    def __init__(self) -> None:
        self._columns: dict[str, NDArray[Any]] = {}
        self._attributes: dict[str, Any] = {}
        self._promised: dict[str, int] = {}
        self._warnings: list[str] = []
        self._objects: list[str] = []

    def warn(self, text: str) -> None:
        """Note what could not be read."""
        self._warnings.append(text)

    def left_out(self, name: str, kind: str) -> None:
        """Note a variable that is an object of MATLAB's own, which nothing else reads."""
        self._objects.append(f"{name} ({kind})")

    def add(self, name: str, value: NDArray[Any], whole: BoolArray | None = None) -> None:
        """An array: text, a single number, or columns; a row of numbers is a column that lies down.

        Signals that are matrices have their samples along the last axis, as Simulink logs them. Of an array that is
        not all there `whole`, of its shape, says what is: its columns are kept up to their first lost row, and
        anything else is left out.
        """
        if value.dtype.kind == "c":
            self.warn(f"'{name}' holds complex numbers, which are left out")
        elif _is_signal(value.shape, value.dtype):
            columns, promised = whole_rows(name, _upright(value), None if whole is None else _upright(whole))
            self._columns |= columns
            self._promised |= promised
        elif whole is not None:
            self.warn(f"'{name}' is left out: not all of it is there")
        elif value.dtype.kind in "US":
            self._attributes[name] = "\n".join(str(row) for row in value.ravel())
        elif value.dtype.kind not in "fiub" or value.size == 0:
            return
        elif value.size == 1:
            self._attributes[name] = value.ravel()[0].item()
        else:
            self._attributes[name] = value.tolist()

    def lose(self, name: str, shape: tuple[int, ...]) -> str:
        """Note an array of numbers of which nothing is there; in words, how many rows that is."""
        empty = np.broadcast_to(np.zeros(()), shape)
        if not _is_signal(shape, empty.dtype):
            return ""
        promised = lost_columns(name, _upright(empty).shape, empty.dtype)
        self._promised |= promised
        return shortfall(self._columns, promised, {})

    def table(self, *, cut: str = "", lost: str = "", open_ended: bool = False) -> Table:
        """The columns, with a scope's label as the note of each of its signals.

        Of a file that is `cut` short, in words, the first warning tells that, which rows are missing, and what is
        `lost` besides. `open_ended` is as a `Table` has it.
        """
        if cut:
            self._warnings.insert(
                0, ": ".join(filter(None, (cut, shortfall(self._columns, self._promised, {})))) + lost
            )
        notes = {}
        for column in self._columns:
            stem = column.rpartition(".")[0]
            label = self._attributes.get(f"{stem}.label") or self._attributes.get(f"{stem}.title")
            if label and column.startswith(f"{stem}.values"):
                notes[column] = f"label: {label}"
        remarks = []
        if self._objects:
            first = self._objects[0].partition(" ")[0]
            remarks.append(
                f"left out, as objects that only MATLAB reads: {', '.join(self._objects)}; to have one, save its "
                f"numbers in MATLAB: s = struct({first}), or the Time and Data of a timeseries"
            )
        units = {column: unit for column in self._columns if (unit := self._unit(column))}
        return Table(
            self._columns,
            units=units,
            notes=notes,
            attributes=self._attributes,
            warnings=tuple(self._warnings),
            remarks=tuple(remarks),
            promised=self._promised,
            open_ended=open_ended,
        )

    def _unit(self, column: str) -> str | None:
        """The unit of a column of a recording that hapticeval wrote, which stands beside it under the same name."""
        if "hapticeval" not in self._attributes or not column.startswith("recording."):
            return None
        return self._attributes.get("units." + column.removeprefix("recording.").partition("[")[0])


def _is_signal(shape: tuple[int, ...], dtype: Any) -> bool:
    return dtype.kind in "fiub" and math.prod(shape) > FEW


def _upright(value: NDArray[Any]) -> NDArray[Any]:
    """An array with its rows along the first axis."""
    if value.ndim == 2 and value.shape[0] == 1:
        return value.T
    return np.moveaxis(value, -1, 0) if value.ndim == 3 else value
