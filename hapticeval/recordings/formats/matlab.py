"""MATLAB files, each numeric array as columns by its path, counting from zero: `scope.signals[1].values[0]`.

Those of version 7.3 are HDF5 files: arrays lie transposed, texts as numbers. Those of version 5 to 7.2 are taken apart
here, and every size is held against the bytes that are there first. scipy's reader trusts the sizes in a file: of
damaged ones, one in sixty ended the process with a segmentation fault. A variable that cannot be read costs itself and
no other.

Such a file is a header and elements: a kind, a size, and so many bytes, padded to eight; short ones stand within their
own tag. A variable is an element of kind `MATRIX_ELEMENT`, or one that holds such an element packed, and a matrix is
made of elements again: its flags with the class, its dimensions, its name, and what it holds by class.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hapticeval.recordings.formats import (
    Table,
    damaged_error,
    importer,
    signals_in_rows,
    signals_in_rows_remark,
    spread,
)
from hapticeval.recordings.formats.arrays import Arrays, check_nesting, opened, plain_value
from hapticeval.recordings.memory import reserve

MOST_PARAMETERS = 9
"""A MATLAB array of as many numbers at the most is a parameter (a 3 x 3 matrix), no signal."""

HEADER_BYTES = 128
COMPRESSED_ELEMENT, MATRIX_ELEMENT = 15, 14
CELL, STRUCTURE, OBJECT, TEXT, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
"""Classes of a matrix beside those of numbers."""

NUMBER_CLASSES = range(6, 16)
COMPLEX_FLAG = 0x0800

NUMBER_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Kinds of elements of numbers; of whole ones MATLAB takes the shortest that holds them."""

ENCODINGS = {1: "latin-1", 2: "utf-8", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
"""Kinds of elements of text; one of 16-bit numbers (4) holds UTF-16 as well."""

PADDING_BYTES = 8
"""Elements are padded to so many bytes."""


class Variables(Arrays):
    """The arrays of a MATLAB file, each by its path, as MATLAB orders them (rows first)."""

    def __init__(self) -> None:
        super().__init__()
        self.objects: list[str] = []
        """Variables that are objects of MATLAB's own, which nothing else reads."""

    def add(self, name: str, values: NDArray[Any]) -> None:
        """Add an array as MATLAB holds it: text, a few numbers, or columns (n,) or (n, k).

        Columns have more than `MOST_PARAMETERS` numbers. Numbers keep their unit (m, N or what the file states).
        """
        if values.dtype.kind == "c":
            self.warnings.append(f"'{name}' holds complex numbers, which are left out")
        elif values.dtype.kind in "fiub" and values.size > MOST_PARAMETERS:
            self.columns |= spread(name, self._upright(name, values))
        elif values.dtype.kind in "US":
            self.attributes[name] = "\n".join(str(row) for row in values.ravel())
        elif values.dtype.kind in "fiub" and values.size:
            self.attributes[name] = values.ravel()[0].item() if values.size == 1 else values.tolist()

    def _upright(self, name: str, values: NDArray[Any]) -> NDArray[Any]:
        """Return an array with its samples along the first axis, by the time vector beside it or by its shape.

        Signals that are matrices have their samples along the last axis, as Simulink logs them.
        """
        # (rows, columns, samples) becomes (samples, rows, columns).
        if values.ndim == 3:
            return np.moveaxis(values, -1, 0)
        if values.ndim != 2 or values.shape[0] == 1:
            return values.T
        # Where a time vector stands beside them, its length says which axis is the samples.
        samples = self._samples(name)
        if samples == values.shape[1] != values.shape[0] or (
            samples not in values.shape and signals_in_rows(values.shape)
        ):
            self.remarks.append(signals_in_rows_remark(f"'{name}'", values.shape))
            return values.T
        return values

    def _samples(self, name: str) -> int | None:
        """Return the length of the time vector of the structure that holds an array, where one stands before it."""
        while name:
            name = name.rpartition(".")[0]
            for leaf in ("time", "Time", "t"):
                times = self.columns.get(f"{name}.{leaf}".lstrip("."))
                if times is not None:
                    return int(times.size)
        return None

    def table(self) -> Table:
        """Return the columns, with a scope's label as the note of each signal, and the units of files of ours."""
        for column in self.columns:
            stem, _, leaf = column.rpartition(".")
            label = self.attributes.get(f"{stem}.label") or self.attributes.get(f"{stem}.title")
            if label and leaf.startswith("values"):
                self.notes[column] = f"label: {label}"
            unit = self.attributes.get("units." + column.removeprefix("recording.").partition("[")[0])
            if unit and "hapticeval" in self.attributes:
                self.units[column] = unit
        if self.objects:
            self.remarks.append(
                f"left out, as objects that only MATLAB reads: {', '.join(self.objects)}; to have one, save its "
                f"numbers in MATLAB: s = struct({self.objects[0].partition(' ')[0]}), or Time and Data of a timeseries"
            )
        return super().table()


class OddError(Exception):
    """A variable is not as it should be: its message says where."""


class Element(NamedTuple):
    """An element within the bytes of a variable: what it holds, and where the next one begins."""

    kind: int
    data: memoryview
    end: int


@importer(
    "matlab5",
    about="a MATLAB 5 to 7.2 file (.mat)",
    recognises=lambda head: head[124:128] in (b"\x00\x01IM", b"\x01\x00MI"),
)
def read_matlab5(path: Path) -> Table:
    """Return every numeric array of two rows or more, as columns; numbers and texts as attributes."""
    data = path.read_bytes()
    if len(data) < HEADER_BYTES:
        raise damaged_error(path, f"its header has {HEADER_BYTES} bytes, and {len(data)} are there")
    # The header ends with the two letters MI as one 16-bit number: which comes first gives the byte order.
    order = "<" if data[126:128] == b"IM" else ">"
    (subsystem,) = struct.unpack(order + "Q", data[116:124])  # where data of objects lie, which are no variable
    variables, unpacked_bytes, parts = Variables(), 0, 0
    for offset, kind, content in _variables(path, memoryview(data), order):
        if offset == subsystem and subsystem:
            continue
        if kind == COMPRESSED_ELEMENT:
            content = _unpacked(path, offset, content, order, unpacked_bytes)
            unpacked_bytes += len(content)
        matrix = _Matrix(path, offset, order, parts)
        try:
            matrix.read(content, "", 1)
        except OddError as error:
            variables.warnings.append(f"the variable '{matrix.name or '?'}' cannot be read: {error}")
            continue
        # Only after success: what a damaged variable counted is not held against the next.
        parts = matrix.count
        variables.objects += matrix.objects
        variables.warnings += matrix.warnings
        for name, values in matrix.arrays:
            variables.add(name, values)
    return variables.table()


def _variables(path: Path, data: memoryview, order: str) -> Iterator[tuple[int, int, memoryview]]:
    """Yield where each variable starts, its kind and bytes. Raises `InputError` where the file ends within one."""
    offset = HEADER_BYTES
    while offset < len(data):
        kind, size = struct.unpack(order + "II", bytes(data[offset : offset + 8]).ljust(8, b"\0"))
        if kind not in (COMPRESSED_ELEMENT, MATRIX_ELEMENT):
            raise damaged_error(
                path,
                f"at byte {offset} a variable should start, with {MATRIX_ELEMENT} or {COMPRESSED_ELEMENT}, not {kind}",
            )
        end = offset + 8 + size
        if end > len(data):
            raise damaged_error(
                path,
                f"it ends at byte {len(data)}, within the variable that starts at byte {offset}: of its {size} bytes "
                f"{max(0, len(data) - offset - 8)} are there",
            )
        yield offset, kind, data[offset + 8 : end]
        # Packed elements are not padded.
        offset = end + (-size % PADDING_BYTES if kind == MATRIX_ELEMENT else 0)


def _unpacked(path: Path, offset: int, packed: memoryview, order: str, unpacked_bytes: int) -> memoryview:
    """Return what a packed matrix holds; its size, which its tag states, is reserved first, beside `taken` bytes."""
    unpacking = zlib.decompressobj()
    try:
        # Only the tag is unpacked before its size has been reserved: a small file may state any size.
        tag = unpacking.decompress(packed, 8)
        kind, size = struct.unpack(order + "II", tag.ljust(8, b"\0"))
        if kind != MATRIX_ELEMENT:
            raise damaged_error(
                path, f"the variable at byte {offset} holds an element of kind {kind}, not {MATRIX_ELEMENT}"
            )
        reserve(unpacked_bytes + size, f"{path}, as far as it was counted,")
        # No more than that, what pads it, and the checksum.
        matrix = unpacking.decompress(unpacking.unconsumed_tail, size + PADDING_BYTES)
    except zlib.error as error:
        raise damaged_error(path, f"the variable at byte {offset} cannot be unpacked: {error}") from error
    if len(matrix) < size or not unpacking.eof:
        raise damaged_error(path, f"the variable at byte {offset} breaks off")
    return memoryview(matrix)[:size]


class _Matrix:
    """Takes the bytes of one variable apart: `arrays` by their paths, and `objects` that only MATLAB reads.

    `count` is of all matrices in the file so far. Raises `OddError` for what does not fit together, `InputError` for
    matrices within matrices too deep, or too many of them.
    """

    def __init__(self, path: Path, offset: int, order: str, count: int) -> None:
        self.path, self.offset, self.order, self.count = path, offset, order, count
        self.name = ""
        self.arrays: list[tuple[str, NDArray[Any]]] = []
        self.objects: list[str] = []
        self.warnings: list[str] = []

    def read(self, data: memoryview, name: str, depth: int) -> None:
        """Take a matrix of that name, which the outermost one states itself; an empty one holds nothing."""
        self.count += 1
        check_nesting(self.path, "structures", depth - 1, self.count, f"in the variable at byte {self.offset}")
        if not data:
            return
        flags = self._next(data, 0, "its flags")
        (word,) = struct.unpack(self.order + "I", bytes(flags.data[:4]).ljust(4, b"\0"))
        # The lowest byte is the class, the bits above are flags (complex, global, logical).
        kind = word & 0xFF
        if kind == OPAQUE:  # name, system and class
            stated = self._next(data, flags.end, "its name")
            system = self._next(data, stated.end, "its system")
            owner = self._next(data, system.end, "its class")
            self.objects.append(f"{name or _decoded(stated)} ({_decoded(owner)})")
            return
        sizes = self._next(data, flags.end, "its dimensions")
        shape = tuple(int(size) for size in self._numbers(sizes, "its dimensions"))
        stated = self._next(data, sizes.end, "its name")
        name = name or _decoded(stated)
        self.name = self.name or name
        if len(shape) < 2 or min(shape) < 0:
            raise OddError(f"'{name}' has the dimensions {shape}")
        content = data[stated.end :]
        if kind in NUMBER_CLASSES:
            # A device's signals are real numbers.
            if word & COMPLEX_FLAG:
                self.warnings.append(f"'{name}' holds complex numbers, which are left out")
            else:
                element = self._next(content, 0, "its numbers")
                self.arrays.append((name, self._shaped(self._numbers(element, "its numbers"), shape, name)))
        elif kind == TEXT:
            self.arrays.append((name, self._text(self._next(content, 0, "its text"), shape, name)))
        elif kind == CELL:
            self._members(content, name, shape, [""], depth)
        elif kind in (STRUCTURE, OBJECT):
            at = self._next(content, 0, "its class").end if kind == OBJECT else 0
            self._structures(content[at:], name, shape, depth)
        else:
            words = {SPARSE: "a sparse matrix", FUNCTION: "a function"}.get(kind, f"of class {kind}")
            self.warnings.append(f"'{name}' is {words}, which is left out")

    def _structures(self, data: memoryview, name: str, shape: tuple[int, ...], depth: int) -> None:
        """Take an array of structures: the length of names, the names of the fields, then each one's fields."""
        longest = self._next(data, 0, "the length of its names")
        # Names of fields have one fixed width, padded with zero bytes; 0 where the element is empty.
        (width,) = [*self._numbers(longest, "the length of its names"), 0][:1]
        texts = self._next(data, longest.end, "the names of its fields")
        if texts.data and not 0 < width <= len(texts.data):
            raise OddError(f"the names of its fields have a length of {width}")
        names = [bytes(texts.data[at : at + int(width)]) for at in range(0, len(texts.data), int(width) or 1)]
        fields = [text.partition(b"\0")[0].decode("latin-1") for text in names]
        if fields:
            self._members(data[texts.end :], name, shape, fields, depth)

    def _members(self, data: memoryview, name: str, shape: tuple[int, ...], fields: list[str], depth: int) -> None:
        """Take the matrices of cells, whose one field has no name, or of structures: as many as the dimensions say."""
        size = math.prod(shape)
        if size * len(fields) > len(data) // 8:  # the tag of each takes eight bytes
            raise OddError(f"'{name}' has the dimensions {shape}, and {len(data)} bytes")
        at, (before, after) = 0, "[]" if fields != [""] else "{}"
        for place, field in product(range(size), fields):
            member = self._next(data, at, f"part {place}")
            if member.kind != MATRIX_ELEMENT:
                raise OddError(f"part {place} of '{name}' is of kind {member.kind}, no matrix")
            bracket = "" if size == 1 else f"{before}{place}{after}"
            self.read(member.data, f"{name}{bracket}.{field}" if field else f"{name}{bracket}", depth + 1)
            at = member.end

    def _next(self, data: memoryview, begin: int, what: str) -> Element:
        """Return the element at a byte."""
        if begin + 8 > len(data):
            raise OddError(f"it ends before {what}")
        kind, size = struct.unpack_from(self.order + "II", data, begin)
        if kind >> 16:  # a short one: its bytes stand in its tag
            if kind >> 16 > 4:
                raise OddError(f"{what} have a short element of {kind >> 16} bytes")
            return Element(kind & 0xFFFF, data[begin + 4 : begin + 4 + (kind >> 16)], begin + 8)
        if begin + 8 + size > len(data):
            raise OddError(f"{what} should have {size} bytes, and {len(data) - begin - 8} are there")
        return Element(kind, data[begin + 8 : begin + 8 + size], begin + 8 + size + -size % PADDING_BYTES)

    def _numbers(self, element: Element, what: str) -> NDArray[Any]:
        """Return the numbers of an element, (n,)."""
        dtype = NUMBER_TYPES.get(element.kind)
        if dtype is None or len(element.data) % int(dtype[1]):
            raise OddError(f"{what} are {len(element.data)} bytes of kind {element.kind}")
        return np.frombuffer(element.data, dtype=np.dtype(self.order + dtype))

    def _shaped(self, values: NDArray[Any], shape: tuple[int, ...], name: str) -> NDArray[Any]:
        if values.size != math.prod(shape):
            raise OddError(f"'{name}' has the dimensions {shape}, and {values.size} numbers")
        # MATLAB stores its arrays column by column.
        return values.reshape(shape, order="F")

    def _text(self, element: Element, shape: tuple[int, ...], name: str) -> NDArray[Any]:
        """Return the rows of a text, (n,): characters stand column by column."""
        order = {"<": "-le", ">": "-be"}[self.order]
        encoding = "utf-16" if element.kind == 4 else ENCODINGS.get(element.kind)
        if encoding is None:
            raise OddError(f"the text '{name}' is of kind {element.kind}")
        encoding += order if encoding in ("utf-16", "utf-32") else ""
        text = bytes(element.data).decode(encoding, errors="replace")
        if shape[0] == 1:  # also where characters are counted otherwise, as beyond 16 bits
            return np.array([text])
        characters = list(text)
        if len(characters) != math.prod(shape):
            raise OddError(f"the text '{name}' has the dimensions {shape}, and {len(characters)} characters")
        rows = np.array(characters, dtype="U1").reshape(shape[0], -1, order="F") if characters else np.empty((0, 0))
        return np.array(["".join(row) for row in rows], dtype=np.str_)


def _decoded(element: Element) -> str:
    return bytes(element.data).decode("utf-8", errors="replace")


NUMERIC_CLASSES = {
    "",
    "double",
    "single",
    "logical",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
}


@importer("matlab73", about="a MATLAB 7.3 file (.mat)", recognises=lambda head: head.startswith(b"MATLAB 7.3 MAT-file"))
def read_matlab73(path: Path) -> Table:
    """Return what `read_matlab5` does, with the same names of columns.

    Cells and arrays of structures are references into the same file.
    """
    import h5py

    variables = Variables()
    with opened(path, variables.warnings) as nodes:

        def refers(node: Any) -> bool:
            return isinstance(node, h5py.Dataset) and h5py.check_ref_dtype(node.dtype) is not None

        def follow(node: Any, name: str, brackets: str, after: str, depth: int) -> None:
            for place, reference in enumerate(nodes.read(node, name).ravel()):
                target = nodes.file[reference]
                nodes.enter(target, depth)
                numbered = "" if node.size == 1 else f"{brackets[0]}{place}{brackets[1]}"
                add(f"{name}{numbered}{after}", target, depth)

        def add(name: str, node: Any, depth: int) -> None:
            # MATLAB writes its class as an attribute; objects have one that only it can decode.
            kind = plain_value(node.attrs.get("MATLAB_class", b""))
            if "MATLAB_object_decode" in node.attrs:
                variables.objects.append(f"{name} ({kind})")
            elif isinstance(node, h5py.Group):
                parts = dict(nodes.members(node, depth + 1))
                several = bool(parts) and all(map(refers, parts.values()))  # structures: each field holds references
                for part, member in parts.items():
                    if several:
                        follow(member, name, "[]", f".{part}", depth + 1)
                    else:
                        add(f"{name}.{part}", member, depth + 1)
            elif refers(node):
                follow(node, name, "{}", "", depth + 1)
            elif "MATLAB_empty" in node.attrs:
                return
            elif kind == "char":
                variables.add(name, np.array(["".join(map(chr, np.asarray(nodes.read(node, name)).T.ravel()))]))
            elif kind in NUMERIC_CLASSES:
                variables.add(name, np.asarray(nodes.read(node, name)).T)
            else:
                variables.warnings.append(f"the variable '{name}' of class '{kind}' is left out")

        # Groups as `#refs#` hold what cells refer to: they are reached from there.
        for name, node in nodes.members(nodes.file, 1):
            if not name.startswith("#"):
                add(name, node, 1)
        return variables.table()
