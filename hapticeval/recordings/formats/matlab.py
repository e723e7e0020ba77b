"""MATLAB files (.mat): Simulink's structures with time, timeseries saved as structures, plain arrays.

Those of version 5 to 7.2 are read by scipy, variable by variable, so that an object which scipy cannot read costs that
variable and no other. Those of version 7.3 are HDF5 files under another name: arrays lie transposed, texts as numbers.
Columns are named alike in both, by their path from the variable on, counting from zero: `scope.signals[1].values[0]`.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.errors import InputError
from hapticeval.recordings.formats.arrays import DEEPEST, Nodes, damaged, opened
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table, lies, lying, spread
from hapticeval.recordings.hdf5 import lies_elsewhere
from hapticeval.recordings.memory import allowed, reserve

HEADER = 128
COMPRESSED, MATRIX = 15, 14
CELL, STRUCT, OBJECT, OPAQUE = 1, 2, 3, 17
SUBSYSTEM = slice(116, 124)
"""Where the header of version 5 says at which byte the data of objects lie, which are no variable."""

STEP = 1 << 20
"""Bytes that are unpacked at a time while they are counted."""

FEW = 9
"""An array of as many numbers at the most is a parameter (a 3 x 3 matrix), no signal."""

NUMERIC = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}


class Tree:
    """Takes the arrays of a file one after the other, each by its path, as MATLAB orders them (rows first)."""

    def __init__(self) -> None:
        self._columns: dict[str, NDArray[Any]] = {}
        self._attributes: dict[str, Any] = {}
        self._remarks: list[str] = []
        self._objects: list[str] = []
        self.warnings: list[str] = []

    def left_out(self, name: str, kind: str) -> None:
        """Note a variable that is an object of MATLAB's own, which nothing else reads."""
        self._objects.append(f"{name} ({kind})")

    def add(self, name: str, value: NDArray[Any]) -> None:
        """An array: text, a single number, or columns; a row of numbers is a column that lies down.

        Signals that are matrices have their samples along the last axis, as Simulink logs them.
        """
        if value.dtype.kind == "c":
            self.warnings.append(f"'{name}' holds complex numbers, which are left out")
        elif value.dtype.kind in "fiub" and value.size > FEW:
            self._columns |= spread(name, self._upright(name, value))
        elif value.dtype.kind in "US":
            self._attributes[name] = "\n".join(str(row) for row in value.ravel())
        elif value.dtype.kind in "fiub" and value.size:
            self._attributes[name] = value.ravel()[0].item() if value.size == 1 else value.tolist()

    def _upright(self, name: str, value: NDArray[Any]) -> NDArray[Any]:
        """An array with its samples along the first axis; a matrix beside a time vector has as many of them as that."""
        if value.ndim == 3:
            return np.moveaxis(value, -1, 0)
        if value.ndim != 2 or value.shape[0] == 1:
            return value.T
        samples = self._samples(name)
        if samples == value.shape[1] != value.shape[0] or (samples not in value.shape and lies(value.shape)):
            self._remarks.append(lying(f"'{name}'", value.shape))
            return value.T
        return value

    def _samples(self, name: str) -> int | None:
        """How many samples the time vector of the structure that holds an array has, where there is one before it."""
        while name:
            name = name.rpartition(".")[0]
            for leaf in ("time", "Time", "t"):
                found = self._columns.get(f"{name}.{leaf}".lstrip("."))
                if found is not None:
                    return int(found.size)
        return None

    def table(self) -> Table:
        """The columns, with a scope's label as the note of each of its signals."""
        notes = {}
        for column in self._columns:
            stem = column.rpartition(".")[0]
            label = self._attributes.get(f"{stem}.label") or self._attributes.get(f"{stem}.title")
            if label and column.startswith(f"{stem}.values"):
                notes[column] = f"label: {label}"
        if self._objects:
            first = self._objects[0].partition(" ")[0]
            self._remarks.append(
                f"left out, as objects that only MATLAB reads: {', '.join(self._objects)}; to have one, save its "
                f"numbers in MATLAB: s = struct({first}), or the Time and Data of a timeseries"
            )
        units = {column: unit for column in self._columns if (unit := self._unit(column))}
        return Table(
            self._columns,
            units=units,
            notes=notes,
            attributes=self._attributes,
            warnings=tuple(self.warnings),
            remarks=tuple(self._remarks),
        )

    def _unit(self, column: str) -> str | None:
        """The unit of a column of a recording that hapticeval wrote, which stands beside it under the same name."""
        if "hapticeval" not in self._attributes or not column.startswith("recording."):
            return None
        return self._attributes.get("units." + column.removeprefix("recording.").partition("[")[0])


def _is_5(head: bytes) -> bool:
    return len(head) >= HEADER and head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


@importer("matlab5", about="a MATLAB 5 to 7.2 file (.mat)", suffixes=(".mat",), recognises=_is_5)
def read_matlab5(path: Path) -> Table:
    """Every numeric array of two rows or more, as columns; numbers and texts as attributes."""
    from scipy.io import loadmat

    data = path.read_bytes()
    if len(data) < HEADER:
        raise damaged(path, f"its header has {HEADER} bytes, and {len(data)} are there")
    order = "<" if data[126:128] == b"IM" else ">"
    (subsystem,) = struct.unpack(order + "Q", data[SUBSYSTEM])
    tree = Tree()
    taken = 0
    for offset, element in _variables(path, data, order):
        if offset == subsystem and subsystem:
            continue
        matrix = _unpacked(path, offset, element, order, taken)
        taken += len(matrix)
        kind, name, described = _checked(path, offset, matrix, order)
        if kind == OPAQUE:
            tree.left_out(name, described)
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                stream: Any = io.BytesIO(data[:HEADER] + matrix)
                found = loadmat(stream, struct_as_record=True)
        except Exception as error:  # scipy raises anything on what it does not know
            tree.warnings.append(f"the variable '{name or '?'}' cannot be read: {error}")
            continue
        for variable, value in found.items():
            if not str(variable).startswith("__"):
                _walk5(tree, str(variable), value)
    return tree.table()


def _walk5(tree: Tree, name: str, value: Any) -> None:
    """Put a value as scipy gives it, and all that it holds, into the tree."""
    if isinstance(value, np.ndarray) and value.dtype.names is not None:
        for place, item in enumerate(value.ravel(order="F")):
            for part in value.dtype.names:
                _walk5(tree, f"{name}{'' if value.size == 1 else f'[{place}]'}.{part}", item[part])
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for place, item in enumerate(value.ravel(order="F")):
            _walk5(tree, f"{name}{'' if value.size == 1 else f'{{{place}}}'}", item)
    elif isinstance(value, np.ndarray):
        tree.add(name, value)
    elif value is not None:
        tree.warnings.append(f"'{name}' is a {type(value).__name__}, which is left out")


def _variables(path: Path, data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Each variable: where it starts, and its bytes. Raises `InputError` where the file ends within one."""
    offset = HEADER
    while offset < len(data):
        kind, size = struct.unpack(order + "II", data[offset : offset + 8].ljust(8, b"\0"))
        if kind not in (COMPRESSED, MATRIX):
            raise damaged(path, f"at byte {offset} a variable should start, with {MATRIX} or {COMPRESSED}, not {kind}")
        end = offset + 8 + size
        if end > len(data):
            raise damaged(
                path,
                f"it ends at byte {len(data)}, within the variable that starts at byte {offset}: of its {size} bytes "
                f"{max(0, len(data) - offset - 8)} are there",
            )
        yield offset, data[offset:end]
        offset = end + (-size % 8 if kind == MATRIX else 0)


def _unpacked(path: Path, offset: int, element: bytes, order: str, taken: int) -> bytes:
    """The bytes of a matrix, counted while they are unpacked; so many were `taken` by those before it."""
    if struct.unpack(order + "I", element[:4])[0] == MATRIX:
        return element
    parts: list[bytes] = []
    size, rest, unpacking = taken, element[8:], zlib.decompressobj()
    try:
        while rest and not unpacking.eof:
            parts.append(unpacking.decompress(rest, STEP))
            size, rest = size + len(parts[-1]), unpacking.unconsumed_tail
            if size > allowed():
                break
    except zlib.error as error:
        raise damaged(path, f"the variable at byte {offset} cannot be unpacked: {error}") from error
    reserve(size, f"{path}, as far as it was counted,")
    if not unpacking.eof:
        raise damaged(path, f"the variable at byte {offset} breaks off")
    return b"".join(parts)


def _checked(path: Path, offset: int, matrix: bytes, order: str) -> tuple[int, str, str]:
    """Class number and name of a matrix, and for an object the name of its class.

    Raises `InputError` for one that is nested too deep, for which scipy has no limit but the end of the stack.
    """
    try:
        outer, place, words = _head(matrix, 0, order)
        pending = [(place, len(matrix), outer, 1)]
        while pending:
            place, end, kind, depth = pending.pop()
            if depth > DEEPEST:
                raise InputError(
                    f"{path} has structures {depth} deep, in the variable at byte {offset}",
                    why=f"at most {DEEPEST} levels are read",
                    todo="save the signals as variables of their own",
                )
            while kind in (CELL, STRUCT, OBJECT) and place + 8 <= end:
                tag, size = struct.unpack_from(order + "II", matrix, place)
                if tag == MATRIX and size:
                    inner, begin, _ = _head(matrix, place, order)
                    pending.append((begin, place + 8 + size, inner, depth + 1))
                place += 8 if tag >> 16 else 8 + _padded(size)
    except (struct.error, UnicodeDecodeError):
        return 0, "", ""  # scipy names what is wrong
    return outer, words[0], words[-1]


def _head(data: bytes, place: int, order: str) -> tuple[int, int, list[str]]:
    """Class number of the matrix at `place`, where its content begins, and its name (of an object, its class too)."""
    kind = struct.unpack_from(order + "I", data, place + 16)[0] & 0xFF
    place, words = place + 24, []
    if kind != OPAQUE:  # the dimensions come before the name, which an object does not have
        place += 8 + _padded(struct.unpack_from(order + "I", data, place + 4)[0])
    for _ in range(3 if kind == OPAQUE else 1):
        word, place = _word(data, place, order)
        words.append(word)
    return kind, place, words


def _word(data: bytes, place: int, order: str) -> tuple[str, int]:
    """A text element, which is short (four bytes at the most, in its own tag) or long, and where the next begins."""
    tag, size = struct.unpack_from(order + "II", data, place)
    if tag >> 16:
        return data[place + 4 : place + 4 + (tag >> 16)].decode(), place + 8
    return data[place + 8 : place + 8 + size].decode(), place + 8 + _padded(size)


def _padded(size: int) -> int:
    return size + (-size % 8)


def _is_73(head: bytes) -> bool:
    return head.startswith(b"MATLAB 7.3 MAT-file")


@importer("matlab73", about="a MATLAB 7.3 file (.mat)", suffixes=(".mat",), recognises=_is_73)
def read_matlab73(path: Path) -> Table:
    """As `read_matlab5`, with the same names of columns."""
    with opened(path) as file:
        return _Matlab73(path, file).table()


class _Matlab73:
    """The walk through a file whose cells and arrays of structures are references into the same file."""

    def __init__(self, path: Path, file: Any) -> None:
        self.path, self.file, self.tree, self.nodes = path, file, Tree(), Nodes(path)
        self.size = 0

    def table(self) -> Table:
        """The columns."""
        for name, node in self.nodes.members(self.file, 1):
            if not name.startswith("#"):
                self._add(name, node, 1)
        self.tree.warnings += self.nodes.warnings()
        return self.tree.table()

    def _add(self, name: str, node: Any, depth: int) -> None:
        import h5py

        kind = node.attrs.get("MATLAB_class", b"")
        kind = kind.decode() if isinstance(kind, bytes) else str(kind)
        if "MATLAB_object_decode" in node.attrs:
            self.tree.left_out(name, kind)
        elif isinstance(node, h5py.Group):
            parts = dict(self.nodes.members(node, depth + 1))
            if parts and all(map(_refers, parts.values())):  # an array of structures: each field holds references
                for part, references in parts.items():
                    self._follow(references, name, "[]", f".{part}", depth + 1)
            else:
                for part, item in parts.items():
                    self._add(f"{name}.{part}", item, depth + 1)
        elif _refers(node):
            self._follow(node, name, "{}", "", depth + 1)
        elif "MATLAB_empty" in node.attrs:
            return
        elif kind == "char" or kind in NUMERIC or not kind:
            array = np.asarray(self._read(node, name)).T
            if kind == "char":
                array = np.array(["".join(map(chr, array.ravel()))])
            self.tree.add(name, array)
        else:
            self.tree.warnings.append(f"the variable '{name}' of class '{kind}' is left out")

    def _follow(self, node: Any, name: str, brackets: str, after: str, depth: int) -> None:
        """Add what each reference of an array leads to, numbered where there are several."""
        for place, reference in enumerate(self._read(node, name).ravel()):
            numbered = f"{name}{'' if node.size == 1 else f'{brackets[0]}{place}{brackets[1]}'}{after}"
            found = self.file[reference]
            self.nodes.enter(found, depth)
            self._add(numbered, found, depth)

    def _read(self, node: Any, name: str) -> Any:
        if lies_elsewhere(node):
            self.nodes.elsewhere.append(name)
            return np.empty(0)
        self.size += 8 * math.prod(node.shape or ())
        reserve(self.size, str(self.path))
        return node[()]


def _refers(node: Any) -> bool:
    """Whether a dataset holds references to others rather than numbers; a cell, or a field of a structure array."""
    import h5py

    return isinstance(node, h5py.Dataset) and h5py.check_ref_dtype(node.dtype) is not None
