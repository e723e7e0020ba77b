"""MATLAB files, each numeric array as columns by its path, counting from zero: `scope.signals[1].values[0]`.

Those of version 5 to 7.2 are read by scipy, in a process of its own: it trusts the sizes in a file, and of damaged
ones, one in sixty ended the process with a segmentation fault. Those of version 7.3 are HDF5 files: arrays lie
transposed, texts as numbers.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.errors import HapticevalError
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
from hapticeval.workers import FORKS, ProcessEnded, Workers

MOST_PARAMETERS = 9
"""A MATLAB array of as many numbers at the most is a parameter (a 3 x 3 matrix), no signal."""

LEAST_PATIENCE, PATIENCE_PER_BYTE = 60.0, 1e-5
"""s, and s/byte, that reading may take before its file is taken for damaged; *chosen*: cells and structures of two
numbers, the slowest, take a hundredth of that. One wrong byte in the size of an array makes scipy count for minutes."""

HEADER_BYTES, MATRIX_ELEMENT, PACKED_ELEMENT = 128, 14, 15
"""Of a file of version 5: the length of its header, and the two kinds of elements that are variables."""


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


@importer(
    "matlab5",
    about="a MATLAB 5 to 7.2 file (.mat)",
    recognises=lambda head: head[124:128] in (b"\x00\x01IM", b"\x01\x00MI"),
)
def read_matlab5(path: Path) -> Table:
    """Return every numeric array of more than `MOST_PARAMETERS` numbers, as columns; numbers and texts as attributes.

    Raises `InputError` where the file is cut short, or scipy cannot read it: one wrong byte may end its process, or
    keep it busy.
    """
    patience = LEAST_PATIENCE + PATIENCE_PER_BYTE * _reserve_variables(path)
    with Workers(_load_matlab5, int(FORKS)) as workers:
        workers.begin(0, path)
        answers = workers.answers(patience)
    if not answers:
        raise damaged_error(path, f"scipy has not read it after {patience:.0f} s: a size in it may be wrong")
    (answer,) = answers
    error = answer.error
    if isinstance(error, HapticevalError):
        raise error
    if answer.value is None:
        how = f"reading it ended with {error.how}" if isinstance(error, ProcessEnded) else f"scipy's reader: {error}"
        raise damaged_error(path, how) from error
    return answer.value.table()


def _reserve_variables(path: Path) -> int:
    """Reserve what the variables of a file declare to take, and return that, in bytes.

    Raises `InputError` where the file ends within one.

    A file is a header of 128 bytes and elements: a kind, a size, and so many bytes. A variable is one of kind
    `MATRIX_ELEMENT`, or a packed element that holds one.
    """
    data = path.read_bytes()
    # The header ends with the letters MI as one 16-bit number: which comes first gives the byte order.
    order = "<" if data[126:128] == b"IM" else ">"
    offset, total = HEADER_BYTES, 0
    while offset < len(data):
        kind, size = struct.unpack(order + "II", data[offset : offset + 8].ljust(8, b"\0"))
        end = offset + 8 + size
        if kind not in (MATRIX_ELEMENT, PACKED_ELEMENT):
            raise damaged_error(path, f"at byte {offset} a variable should start, and an element of kind {kind} does")
        if end > len(data):
            raise damaged_error(
                path,
                f"it ends at byte {len(data)}, within the variable that starts at byte {offset}: of its {size} bytes "
                f"{max(0, len(data) - offset - 8)} are there",
            )
        if kind == PACKED_ELEMENT:
            try:  # only the tag is unpacked: a small file may state any size
                tag = zlib.decompressobj().decompress(data[offset + 8 : end], 8)
            except zlib.error as error:
                raise damaged_error(path, f"the variable at byte {offset} cannot be unpacked: {error}") from error
            _, size = struct.unpack(order + "II", tag.ljust(8, b"\0"))
        total += size
        reserve(total, f"{path}, as far as it was counted,")
        # Packed elements are not padded to eight bytes.
        offset = end + (-size % 8 if kind == MATRIX_ELEMENT else 0)
    return total


def _load_matlab5(path: Path) -> Variables:
    """Return the variables of a file, read by scipy, which trusts the sizes in it: call it in a process of its own."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabFunction, MatlabOpaque, varmats_from_mat
    from scipy.sparse import issparse

    variables, parts = Variables(), 0

    def add(name: str, value: Any, depth: int) -> None:
        nonlocal parts
        parts += 1
        check_nesting(path, "structures", depth, parts, f"in the variable '{name[:80]}'")
        if isinstance(value, MatlabOpaque):  # fields s0 to s2 are its name, its system and its class
            # The data of all objects lie in one more that has neither.
            owner, kind = (value[part].ravel()[0] for part in ("s0", "s2"))
            variables.objects += [f"{_decoded(owner)} ({_decoded(kind)})"] if kind else []
        elif issparse(value) or isinstance(value, MatlabFunction):
            words = "a sparse matrix" if issparse(value) else "a function"
            variables.warnings.append(f"'{name}' is {words}, which is left out")
        elif value.dtype == object or value.dtype.names:
            cell = not value.dtype.names
            # MATLAB counts its cells column by column.
            for place, item in enumerate(value.ravel(order="F")):
                bracket = "" if value.size == 1 else f"{{{place}}}" if cell else f"[{place}]"
                for part in value.dtype.names or ("",):
                    add(
                        f"{name}{bracket}.{part}" if part else f"{name}{bracket}",
                        item[part] if part else item,
                        depth + 1,
                    )
        else:
            variables.add(name, value)

    with warnings.catch_warnings(), path.open("rb") as file:
        warnings.simplefilter("ignore")
        # One by one, for all objects have the name None. scipy's types lack that it takes a stream.
        streams: Any = varmats_from_mat(file)
        for _, variable in streams:
            for name, value in loadmat(variable).items():
                if isinstance(value, np.ndarray) or issparse(value):
                    add(name, value, 0)
    return variables


def _decoded(text: Any) -> str:
    return text.decode("latin-1") if isinstance(text, bytes) else str(text)


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
