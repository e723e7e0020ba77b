"""MATLAB 5 to 7.2 files (.mat): Simulink's structures with time, timeseries saved as structures, plain arrays.

The file is taken apart variable by variable, so that an object which scipy cannot read costs that variable and no
other, and a file that is cut short gives the variables that are whole. Columns are named by their path from the
variable on, counting from zero: `scope.signals[1].values[0]`.
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.formats.matlab_tree import Tree
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table

HEADER = 128
COMPRESSED, MATRIX, INT8 = 15, 14, 1
OPAQUE = 17
NUMBERS = (6, 15)
"""From the class of doubles to that of 64-bit integers."""

COMPLEX = 0x800
"""Among the flags beside the class."""

SUBSYSTEM = slice(116, 124)
"""Where the header says at which byte the data of objects lie, which are no variable."""


def _recognises(head: bytes) -> bool:
    return len(head) >= HEADER and head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


@importer("matlab5", about="a MATLAB 5 to 7.2 file (.mat)", suffixes=(".mat",), recognises=_recognises)
def read_matlab5(path: Path) -> Table:
    """Every numeric array of two rows or more, as columns; numbers and texts as attributes."""
    from scipy.io import loadmat

    data = path.read_bytes()
    if len(data) < HEADER:
        raise InputError(
            f"{path} is cut short or damaged",
            why=f"its header has {HEADER} bytes, and {len(data)} are there",
            todo="copy it again from where it was recorded",
        )
    order = "<" if data[126:128] == b"IM" else ">"
    (subsystem,) = struct.unpack(order + "Q", data[SUBSYSTEM])
    tree = Tree()
    open_ended = False
    for offset, element, whole in _elements(data, order):
        if offset == subsystem and subsystem:
            continue
        kind, name, described = _described(element, order)
        if not whole:
            open_ended = True
            lost, shape = _lost(element, order)
            missing = tree.lose(name, shape) if name and shape else ""
            tree.warn(
                f"the file ends at byte {len(data)}, within the variable '{name or '?'}', which is left out with all "
                f"that followed: {lost}{missing and f'; {missing}'}"
            )
        elif kind == OPAQUE:
            tree.left_out(name, described)
        else:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    stream: Any = io.BytesIO(data[:HEADER] + element)
                    found = loadmat(stream, struct_as_record=True)
            except Exception as error:  # scipy raises anything on what it does not know
                tree.warn(f"the variable '{name or '?'}' cannot be read: {error}")
                continue
            for variable, value in found.items():
                if not str(variable).startswith("__"):
                    walk(tree, str(variable), value)
    return tree.table(open_ended=open_ended)


def walk(tree: Tree, name: str, value: Any) -> None:
    """Put a value as scipy gives it, and all that it holds, into the tree."""
    if isinstance(value, np.ndarray) and value.dtype.names is not None:
        for place, item in enumerate(value.ravel(order="F")):
            for part in value.dtype.names:
                walk(tree, f"{name}{'' if value.size == 1 else f'[{place}]'}.{part}", item[part])
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for place, item in enumerate(value.ravel(order="F")):
            walk(tree, f"{name}{'' if value.size == 1 else f'{{{place}}}'}", item)
    elif isinstance(value, np.ndarray):
        tree.add(name, value)
    elif value is not None:
        tree.warn(f"'{name}' is a {type(value).__name__}, which is left out")


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes, bool]]:
    """Each top-level element: where it starts, its bytes, and whether all of them are there."""
    offset = HEADER
    while offset < len(data):
        if offset + 8 > len(data):
            yield offset, data[offset:], False
            return
        kind, size = struct.unpack(order + "II", data[offset : offset + 8])
        if kind not in (COMPRESSED, MATRIX):
            raise InputError(
                f"the MATLAB file is damaged at byte {offset}",
                why=f"a variable starts with the type {MATRIX} or {COMPRESSED}, not {kind}",
                todo="save or copy it again",
            )
        end = offset + 8 + size + (-size % 8 if kind == MATRIX else 0)
        yield offset, data[offset:end], end <= len(data) or offset + 8 + size <= len(data)
        offset = end


def _described(element: bytes, order: str) -> tuple[int, str, str]:
    """Class number, name, and for an object the name of its class, of as much of an element as there is."""
    try:
        if struct.unpack(order + "I", element[:4])[0] == COMPRESSED:
            element = zlib.decompressobj().decompress(element[8:], 4096)
        kind = struct.unpack(order + "I", element[16:20])[0] & 0xFF
        place, words = 24, []
        if kind != OPAQUE:  # the dimensions come before the name, which an object does not have
            place += 8 + _padded(struct.unpack(order + "I", element[place + 4 : place + 8])[0])
        for _ in range(3 if kind == OPAQUE else 1):
            word, place = _word(element, place, order)
            words.append(word)
    except (struct.error, zlib.error, UnicodeDecodeError):
        return 0, "", ""
    return kind, words[0], words[-1]


def _lost(element: bytes, order: str) -> tuple[str, tuple[int, ...]]:
    """What of a variable that is cut off is missing, and the shape that it says it has, where it is an array."""
    try:
        (size,) = struct.unpack(order + "I", element[4:8])
        share = f"{len(element) - 8} of its {size} bytes are there"
        if struct.unpack(order + "I", element[:4])[0] == COMPRESSED:
            element = zlib.decompressobj().decompress(element[8:], 4096)
        (flags,) = struct.unpack(order + "I", element[16:20])
        count = struct.unpack(order + "I", element[28:32])[0] // 4
        shape = struct.unpack(order + f"{count}i", element[32 : 32 + 4 * count])
    except (struct.error, zlib.error):
        return "how many rows of how many variables, the rest of the file would have said", ()
    if not NUMBERS[0] <= flags & 0xFF <= NUMBERS[1] or flags & COMPLEX or min(shape, default=0) < 0:
        return share, ()
    return f"{' x '.join(str(each) for each in shape)} numbers, of which {share}", shape


def _word(data: bytes, place: int, order: str) -> tuple[str, int]:
    """A text element, which is short (four bytes at the most, in its own tag) or long, and where the next begins."""
    tag, size = struct.unpack(order + "II", data[place : place + 8])
    if tag >> 16:
        return data[place + 4 : place + 4 + (tag >> 16)].decode(), place + 8
    return data[place + 8 : place + 8 + size].decode(), place + 8 + _padded(size)


def _padded(size: int) -> int:
    return size + (-size % 8)
