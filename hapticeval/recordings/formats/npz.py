"""NumPy's .npz: every numeric array is a column, or several. Pickled objects are never opened: they can run code."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table, spread


def _recognises(head: bytes) -> bool:
    return head.startswith(b"PK\x03\x04") and b".npy" in head[:300]


@importer("npz", about="NumPy arrays (.npz)", suffixes=(".npz",), recognises=_recognises)
def read_npz(path: Path) -> Table:
    """Columns by the arrays' names; single numbers and texts as attributes."""
    columns: dict[str, Any] = {}
    attributes: dict[str, Any] = {}
    warnings: list[str] = []
    remarks: list[str] = []
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            for name in file.files:
                try:
                    array = file[name]
                except (ValueError, zipfile.BadZipFile, zlib.error, EOFError) as error:
                    warnings.append(f"the array '{name}' is left out: {error}")
                    continue
                for part, values in _parts(name, array).items():
                    if values.dtype.kind in "US" and values.size == 1:
                        attributes[part] = str(values.ravel()[0])
                    elif values.dtype.kind not in "fiub":
                        remarks.append(f"the array '{part}' is of type {values.dtype}, which is left out")
                    elif values.size == 1:
                        attributes[part] = values.ravel()[0].item()
                    elif values.size:
                        columns |= spread(part, values)
    except (zipfile.BadZipFile, ValueError, EOFError) as error:
        raise InputError(
            f"{path} is cut short or damaged",
            why=f"{error}; the index of an .npz stands at its end, and without it nothing is read safely",
            todo="copy it again from where it was recorded",
        ) from error
    return Table(
        columns, units=_units(attributes), attributes=attributes, warnings=tuple(warnings), remarks=tuple(remarks)
    )


def _parts(name: str, array: Any) -> dict[str, Any]:
    return {name: array} if not array.dtype.names else {f"{name}.{part}": array[part] for part in array.dtype.names}


def _units(attributes: dict[str, Any]) -> dict[str, str]:
    """Units as `hapticeval convert` writes them beside the arrays: `unit:force[0]`, a text."""
    return {name.removeprefix("unit:"): str(text) for name, text in attributes.items() if name.startswith("unit:")}
