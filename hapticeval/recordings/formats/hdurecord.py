"""ASCII records of OpenHaptics' `hduRecord`: no header; tick, force, position, velocity, and the application's text.

As written by the toolkit's utilities/src/hduRecord.cpp, one line a tick of the scheduler:

    index TAB fx fy fz TAB TAB px py pz TAB TAB vx vy vz TAB TAB text

in the units that the API reference gives HD_CURRENT_FORCE (N), HD_CURRENT_POSITION (mm) and HD_CURRENT_VELOCITY (mm/s).
There is no clock: the scheduler's rate, 1000 Hz unless the application set another, is not in the file, so the mapping
has to say it. The text is what the application appended, `(null)` where it appended nothing; numbers in it are read.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table
from hapticeval.recordings.formats.text import cut_row, whole_lines

VECTOR = r"(-?\d+\.\d+|-?nan|-?inf) " * 2 + r"(-?\d+\.\d+|-?nan|-?inf)"
ROW = re.compile(rf"(\d+)\t{VECTOR}\t\t{VECTOR}\t\t{VECTOR}\t\t(.*)")
GROUPS = (("force", "N"), ("position", "mm"), ("velocity", "mm/s"))
NAMES = ("tick", *(f"{name}.{axis}" for name, _ in GROUPS for axis in "xyz"))


def _recognises(head: bytes) -> bool:
    return ROW.fullmatch(head.split(b"\n")[0].decode("latin-1").rstrip("\r")) is not None


@importer("hdurecord", about="an ASCII record of OpenHaptics' hduRecord", recognises=_recognises)
def read_hdurecord(path: Path) -> Table:
    """The ten columns, and `text[0]`, `text[1]`, ... where every row's text holds as many numbers."""
    lines, cut = whole_lines(path)
    rows, texts = [], []
    for number, line in enumerate(lines):
        found = ROW.fullmatch(line)
        if found is None:
            raise InputError(
                f"{path}: row {number} is {line!r}",
                why="hduRecord writes a tick, three vectors and a text, separated by tabs",
                todo="mend or cut that row",
            )
        rows.append([float(word) for word in found.groups()[:-1]])
        texts.append(found.groups()[-1])
    table = np.array(rows).reshape(-1, len(NAMES))
    columns = {name: table[:, k] for k, name in enumerate(NAMES)}
    appended, warnings = _numbers(texts)
    columns |= {f"text[{k}]": appended[:, k] for k in range(appended.shape[1])}
    if cut:
        warnings.append(cut_row(len(rows), None))
    return Table(
        columns,
        units={f"{name}.{axis}": unit for name, unit in GROUPS for axis in "xyz"},
        notes={"tick": "ticks of the scheduler: 1000 a second unless the application set another rate"},
        warnings=tuple(warnings),
    )


def _numbers(texts: list[str]) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.float64]], list[str]]:
    nothing = np.empty((len(texts), 0))
    if all(text.strip() in ("", "(null)") for text in texts):
        return nothing, []
    try:
        numbers = np.array([[float(word) for word in re.split(r"[,;\s]+", text.strip())] for text in texts])
    except ValueError:
        return nothing, ["the application's text is left out: it is not as many numbers in every row"]
    return numbers, []
