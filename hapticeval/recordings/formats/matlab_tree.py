"""What both kinds of MATLAB files have in common: a tree of named arrays that becomes a table of columns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.recordings.formats.table import Table, spread

FEW = 9
"""An array of as many numbers at the most is a parameter (a 3 x 3 matrix), no signal."""


class Tree:
    """Takes the arrays of a file one after the other, each by its path, as MATLAB orders them (rows first)."""

    def __init__(self) -> None:
        self._columns: dict[str, NDArray[Any]] = {}
        self._attributes: dict[str, Any] = {}
        self._warnings: list[str] = []
        self._objects: list[str] = []

    def warn(self, text: str) -> None:
        """Note what could not be read."""
        self._warnings.append(text)

    def left_out(self, name: str, kind: str) -> None:
        """Note a variable that is an object of MATLAB's own, which nothing else reads."""
        self._objects.append(f"{name} ({kind})")

    def add(self, name: str, value: NDArray[Any]) -> None:
        """An array: text, a single number, or columns; a row of numbers is a column that lies down.

        Signals that are matrices have their samples along the last axis, as Simulink logs them.
        """
        if value.dtype.kind in "US":
            self._attributes[name] = "\n".join(str(row) for row in value.ravel())
        elif value.dtype.kind == "c":
            self.warn(f"'{name}' holds complex numbers, which are left out")
        elif value.dtype.kind not in "fiub" or value.size == 0:
            return
        elif value.size == 1:
            self._attributes[name] = value.ravel()[0].item()
        elif value.size <= FEW:
            self._attributes[name] = value.tolist()
        else:
            if value.ndim == 2 and value.shape[0] == 1:
                value = value.T
            elif value.ndim == 3:
                value = np.moveaxis(value, -1, 0)
            self._columns |= spread(name, value)

    def table(self) -> Table:
        """The columns, with a scope's label as the note of each of its signals."""
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
        )

    def _unit(self, column: str) -> str | None:
        """The unit of a column of a recording that hapticeval wrote, which stands beside it under the same name."""
        if "hapticeval" not in self._attributes or not column.startswith("recording."):
            return None
        return self._attributes.get("units." + column.removeprefix("recording.").partition("[")[0])
