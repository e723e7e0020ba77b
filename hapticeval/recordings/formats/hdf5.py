"""HDF5 files of any origin: every numeric dataset is a column, or several, by its path."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.recordings.cut import SIGNATURE
from hapticeval.recordings.formats.partial import opened
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.shortfall import shortfall
from hapticeval.recordings.formats.table import Table, whole_rows

UNIT_NAMES = ("unit", "units", "Unit", "Units")


def _recognises(head: bytes) -> bool:
    return head.startswith(SIGNATURE)


@importer("hdf5", about="an HDF5 file", suffixes=(".h5", ".hdf5", ".hdf"), recognises=_recognises)
def read_hdf5(path: Path) -> Table:
    """Columns `group/dataset`, with the unit that the attribute `unit` or `units` states; attributes as `path@name`.

    A file that is cut short gives the rows of which all bytes, and all that says where they lie, come before its end.
    """
    columns: dict[str, Any] = {}
    promised: dict[str, int] = {}
    units: dict[str, str] = {}
    attributes: dict[str, Any] = {}
    remarks: list[str] = []

    def visit(name: str, node: Any) -> None:
        said = {key: _plain(value) for key, value in file.attributes(node)}
        attributes.update({f"{name}@{key}".lstrip("/"): value for key, value in said.items()})
        if getattr(node, "shape", None) is None:
            return
        parts = node.dtype.names
        kinds = {f"{name}.{part}": node.dtype[part].base for part in parts} if parts else {name: node.dtype}
        found = [path_ for path_, kind in kinds.items() if kind.kind in "fiub"]
        remarks.extend(
            f"'{path_}' is of type {kind}, which is left out" for path_, kind in kinds.items() if path_ not in found
        )
        if not found or not node.size:
            return
        read, whole = file.read(node)
        for path_ in found:
            values = read[path_.removeprefix(f"{name}.")] if parts else np.asarray(read)
            if values.size == 1 and whole is None:
                attributes[path_] = values.ravel()[0].item()
            elif values.size == 1:
                file.lost.append(f"'{path_}'")
            else:
                lies = values.ndim == 2 and values.shape[0] == 1
                kept, short = whole_rows(
                    path_, values.T if lies else values, whole.T if lies and whole is not None else whole
                )
                columns.update(kept)
                promised.update(short)
                unit = next((said[key] for key in UNIT_NAMES if key in said), None)
                units.update({column: str(unit) for column in kept if unit})

    with opened(path) as file:
        visit("", file.file)
        file.visit(visit)
    warnings = []
    if file.cut:
        warnings = [": ".join(filter(None, (file.cut, shortfall(columns, promised, units)))) + file.told()]
    return Table(
        columns,
        units=units,
        attributes=attributes,
        warnings=tuple(warnings),
        remarks=tuple(remarks),
        promised=promised,
        open_ended=bool(file.lost),
    )


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value
