"""Handwriting of a pen tablet (.svc): the number of rows, then x, y, time, pen, azimuth, tilt, pressure.

x and y in mm, time in s; azimuth and tilt in tenths of a degree; pressure from 0 to 1, which is no force. Layout and
units as in the package handwriting-sample of the BDALab (github.com/BDALab/handwriting-sample).
"""

from __future__ import annotations

import re
from pathlib import Path

from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table
from hapticeval.recordings.formats.text import cut_row, missing, rows_of, step_of, whole_lines

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
    table = rows_of(path, lines, COLUMNS, above=1, why=f"a row has {len(COLUMNS)} numbers: {', '.join(COLUMNS)}")
    step = step_of(table[:, COLUMNS.index("time")])
    warnings = [cut_row(len(table), step)] if cut else []
    if len(table) != promised:
        lost = f"{missing(promised - len(table), step)} missing" if promised > len(table) else "it has more"
        warnings.append(f"the first line promises {promised} rows, {len(table)} are whole: {lost}")
    return Table(
        {name: table[:, k] for k, name in enumerate(COLUMNS)},
        units=UNITS,
        notes=NOTES,
        attributes={"promised_rows": promised},
        warnings=tuple(warnings),
    )
