"""ASCII logs of HAPI's and H3D's `DeviceLog`: a line of what is logged, then a row of numbers each sample.

As written by HAPI/src/DeviceLog.cpp: the first line holds words of `WIDTHS` separated by spaces, a position is three
numbers and an orientation four (axis and angle); numbers have five decimals, and that is the finest step of a position.
TIME counts seconds from the first row. The file states no other unit, so the mapping has to. RAW values are those of
the device before the application's calibration: their frame is the device's own.
"""

from __future__ import annotations

from pathlib import Path

from hapticeval.recordings.formats.magic import is_text
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table
from hapticeval.recordings.formats.text import cut_row, decoded, rows_of, step_of, whole_lines

WIDTHS = {
    "TIME": 1,
    "TIMESTAMP": 1,
    "BUTTONS": 1,
    **{f"{raw}{word}": 3 for raw in ("", "RAW_") for word in ("POSITION", "VELOCITY", "FORCE", "TORQUE")},
    **{f"{raw}ORIENTATION": 4 for raw in ("", "RAW_")},
}
UNITS = {"TIME": "s", "TIMESTAMP": "s"}
COMPONENTS = {3: ("x", "y", "z"), 4: ("axis_x", "axis_y", "axis_z", "angle")}


def _recognises(head: bytes) -> bool:
    if not is_text(head):
        return False
    words = decoded(head.split(b"\n")[0]).split()
    return bool(words) and all(word in WIDTHS for word in words)


@importer("devicelog", about="an ASCII log of HAPI's DeviceLog", recognises=_recognises)
def read_devicelog(path: Path) -> Table:
    """A column for each number: `POSITION.x`, `FORCE.z`, `BUTTONS`, ..."""
    lines, cut = whole_lines(path)
    names, units = [], {}
    for word in lines[0].split():
        for part in COMPONENTS.get(WIDTHS[word], ("",)):
            names.append(f"{word}.{part}" if part else word)
            if word in UNITS:
                units[names[-1]] = UNITS[word]
    table = rows_of(
        path, lines, names, above=1, why=f"the first line promises {len(names)} numbers a row: {lines[0].strip()}"
    )
    clock = next((k for k, name in enumerate(names) if name.startswith("TIME")), None)
    step = None if clock is None else step_of(table[:, clock])
    return Table(
        {name: table[:, k] for k, name in enumerate(names)},
        units=units,
        warnings=(cut_row(len(table), step),) if cut else (),
    )
