"""HDF5 files of any origin: every numeric dataset is a column, or several, by its path."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table, spread

SIGNATURE = b"\x89HDF\r\n\x1a\n"
UNIT_NAMES = ("unit", "units", "Unit", "Units")


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """An HDF5 file; whatever h5py says of a damaged one becomes an `InputError`."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            yield file
    # h5py speaks of one and the same damage in all of these, by where it strikes
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise InputError(
            f"{path} is cut short or damaged",
            why=f"{error}; an HDF5 file that is cut gives none of its rows safely",
            todo="copy it again from where it was recorded",
        ) from error


def _recognises(head: bytes) -> bool:
    return head.startswith(SIGNATURE)


@importer("hdf5", about="an HDF5 file", suffixes=(".h5", ".hdf5", ".hdf"), recognises=_recognises)
def read_hdf5(path: Path) -> Table:
    """Columns `group/dataset`, with the unit that the attribute `unit` or `units` states; attributes as `path@name`."""
    columns: dict[str, Any] = {}
    units: dict[str, str] = {}
    attributes: dict[str, Any] = {}
    remarks: list[str] = []

    def visit(name: str, node: Any) -> None:
        for key, value in node.attrs.items():
            attributes[f"{name}@{key}".lstrip("/")] = _plain(value)
        if not hasattr(node, "dtype"):
            return
        parts = node.dtype.names
        found = {f"{name}.{part}": node[part] for part in parts} if parts else {name: node}
        for path_, values in found.items():
            array = np.asarray(values)
            if array.dtype.kind not in "fiub":
                remarks.append(f"'{path_}' is of type {array.dtype}, which is left out")
            elif array.size == 1:
                attributes[path_] = array.ravel()[0].item()
            elif array.size:
                made = spread(path_, array.T if array.ndim == 2 and array.shape[0] == 1 else array)
                columns.update(made)
                unit = next((_plain(node.attrs[key]) for key in UNIT_NAMES if key in node.attrs), None)
                units.update({column: str(unit) for column in made if unit})

    with opened(path) as file:
        visit("", file)
        file.visititems(visit)
    return Table(columns, units=units, attributes=attributes, remarks=tuple(remarks))


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value
