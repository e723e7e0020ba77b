"""Look-up tables in files that are read where they are touched, so that one may be larger than memory (thesis 6.2).

A file, all numbers little-endian:

| offset | bytes | what |
|---|---|---|
| 0 | 8 | the magic `HEVALLUT` |
| 8 | 4 | version, unsigned: 1 |
| 12 | 4 | length n of the header, unsigned |
| 16 | 4 | CRC-32 of the header's n bytes |
| 20 | n | the header, JSON in UTF-8 |
| 4096 | 16 N prod(c_i + 1) | nodes, float64: IHIP and normal of each, x fastest, m |
| behind | prod(c_i) | cells, a byte each, x fastest: see `lut_kernels` |

The header is an object with `origin` (N numbers, m), `cell` (m), `cells` (N counts c_i along x, y and, in space, z),
`everywhere` (true or false) and `standoff` (m, or null while the table is being filled). What is behind the header is
not summed: that would mean to read it all.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError, described
from hapticeval.files import replacing
from hapticeval.renderers.lut_table import Grid, Table

MAGIC, VERSION, START = b"HEVALLUT", 1, 4096
FRONT = struct.Struct("<8sIII")
REMAKE = "make the table anew and save it"


def save(table: Table, path: Path) -> None:
    """Write a table, whole or not at all."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(_front(table.grid, table.everywhere, table.standoff))
        np.asarray(table.nodes, "<f8").tofile(file)
        np.asarray(table.cells, np.uint8).tofile(file)


def create(path: Path, grid: Grid, *, everywhere: bool = False) -> Table:
    """A new file with a table that is free space throughout, to be filled in place, by boxes, and then finished.

    Where the file system knows sparse files, only what is filled takes room. `load` refuses it until `finish`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        file.write(_front(grid, everywhere, None))
        file.truncate(START + grid.node_bytes + grid.cell_bytes)
    return _mapped(path, grid, everywhere, math.nan, "r+")


def finish(table: Table, path: Path, *, standoff: float) -> None:
    """Write what was filled into a created table to its file, and the largest distance (m) off the surface."""
    for array in (table.nodes, table.cells):
        if isinstance(array, np.memmap):
            array.flush()
    with path.open("r+b") as file:
        file.write(_front(table.grid, table.everywhere, standoff))


def load(path: Path) -> Table:
    """The table in a file, mapped into memory: a look-up reads the pages that it touches.

    Raises `InputError` for a file that cannot be read, is no table, of another version, damaged in its header, not
    finished, or of another length than its header tells.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            front = file.read(START)
    except OSError as error:
        raise InputError(f"cannot read the look-up table {path}", why=str(error)) from error
    header = _header(path, front)
    try:
        grid = Grid(
            tuple(float(value) for value in header["origin"]),
            float(header["cell"]),
            tuple(int(count) for count in header["cells"]),
        )
        everywhere, standoff = bool(header["everywhere"]), header["standoff"]
        sound = (
            grid.dimension in (2, 3)
            and len(grid.origin) == grid.dimension
            and min(grid.cells) >= 1
            and all(map(math.isfinite, (*grid.origin, grid.cell, 0.0 if standoff is None else standoff)))
            and grid.cell > 0.0
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise _unfit(path, f"its header does not describe a table: {described(error)}") from error
    if not sound:
        raise _unfit(path, f"its header describes no grid: {grid}")
    if standoff is None:
        raise InputError(
            f"the look-up table {path} is not finished",
            why="whoever filled it did not reach the end",
            todo="fill it, and call finish",
        )
    whole = START + grid.node_bytes + grid.cell_bytes
    if size != whole:
        raise InputError(
            f"the look-up table {path} has {size} bytes, not {whole}",
            why="it is cut short" if size < whole else "something is behind it that does not belong there",
            todo=REMAKE,
        )
    return _mapped(path, grid, everywhere, float(standoff), "r")


def _front(grid: Grid, everywhere: bool, standoff: float | None) -> bytes:
    fields = {"origin": grid.origin, "cell": grid.cell, "cells": grid.cells, "everywhere": everywhere}
    header = json.dumps({**fields, "standoff": standoff}, allow_nan=False).encode()
    return (FRONT.pack(MAGIC, VERSION, len(header), zlib.crc32(header)) + header).ljust(START, b"\0")


def _header(path: Path, front: bytes) -> dict[str, Any]:
    if not front.startswith(MAGIC):
        raise _unfit(path, f"it does not begin with {MAGIC.decode()}", todo="give a file that lut_file.save wrote")
    if len(front) < START:
        raise InputError(f"the look-up table {path} is cut short in its header", why=f"it has {len(front)} bytes")
    _, version, length, checksum = FRONT.unpack_from(front)
    if version != VERSION:
        raise InputError(
            f"the look-up table {path} is of version {version}",
            why=f"this hapticeval reads version {VERSION}",
            todo=REMAKE,
        )
    header = front[FRONT.size : FRONT.size + length]
    if zlib.crc32(header) != checksum:
        raise _unfit(path, "its header does not have the checksum that is written with it")
    try:
        fields = json.loads(header)
    except ValueError as error:
        raise _unfit(path, f"its header is no JSON: {error}") from error
    if not isinstance(fields, dict):
        raise _unfit(path, "its header is no JSON object")
    return fields


def _unfit(path: Path, why: str, todo: str = REMAKE) -> InputError:
    return InputError(f"{path} is not a sound look-up table", why=why, todo=todo)


def _mapped(path: Path, grid: Grid, everywhere: bool, standoff: float, mode: Any) -> Table:
    shape = grid.cells[::-1]
    nodes = np.memmap(path, "<f8", mode, offset=START, shape=(*(count + 1 for count in shape), 2 * grid.dimension))
    cells = np.memmap(path, np.uint8, mode, offset=START + grid.node_bytes, shape=shape)
    return Table(grid, nodes, cells, everywhere, standoff)
