"""Handwriting of a pen tablet (.svc): the number of rows, then x, y, time, pen, azimuth, tilt, pressure.

x and y in mm, time in s; azimuth and tilt in tenths of a degree; pressure from 0 to 1, which is no force. Layout and
units as in the package handwriting-sample of the BDALab (github.com/BDALab/handwriting-sample).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table
from hapticeval.recordings.formats.text import cut_row, missing, step_of, whole_lines

COLUMNS = ("x", "y", "time", "pen", "azimuth", "tilt", "pressure")
UNITS = {"x": "mm", "y": "mm", "time": "s", "azimuth": "0.1 deg", "tilt": "0.1 deg"}
NOTES = {
    "pen": "1 on the tablet, 0 above it",
    "pressure": "0 to 1 of the range of the tablet, no newtons",
}


def _recognises(head: bytes) -> bool:
    first, _, rest = head.partition(b"\n")
    second = rest.partition(b"\n")[0].split()
    return bool(re.fullmatch(rb"\s*\d+\s*", first)) and len(second) == len(COLUMNS)


@importer("svc", about="handwriting of a pen tablet (.svc)", suffixes=(".svc",), recognises=_recognises)
def read_svc(path: Path) -> Table:
    """The seven columns, and a warning where the file has fewer rows than its first line says."""
    lines, cut = whole_lines(path)
    promised = int(lines[0])
    rows = []
    for number, line in enumerate(lines[1:]):
        try:
            row = [float(word) for word in line.split()]
        except ValueError:
            row = []
        if len(row) != len(COLUMNS):
            raise InputError(
                f"{path}: row {number} is {line.strip()!r}",
                why=f"a row has {len(COLUMNS)} numbers: {', '.join(COLUMNS)}",
                todo="mend or cut that row",
            )
        rows.append(row)
    table = np.array(rows).reshape(-1, len(COLUMNS))
    step = step_of(table[:, COLUMNS.index("time")])
    warnings = [cut_row(len(rows), step)] if cut else []
    if len(rows) != promised:
        lost = f"{missing(promised - len(rows), step)} missing" if promised > len(rows) else "it has more"
        warnings.append(f"the first line promises {promised} rows, {len(rows)} are whole: {lost}")
    return Table(
        {name: table[:, k] for k, name in enumerate(COLUMNS)},
        units=UNITS,
        notes=NOTES,
        attributes={"promised_rows": promised},
        warnings=tuple(warnings),
    )
