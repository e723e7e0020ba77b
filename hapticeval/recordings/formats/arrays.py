"""Files of named arrays: HDF5 of any origin, NumPy's .npz and .npy, Parquet, TDMS. Every numeric array is columns.

What a file names outside of itself is never opened: external links, external storage and virtual data sets of HDF5 can
read any path of the machine, and pickled objects of NumPy can run code.
"""

from __future__ import annotations

import io
import math
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.formats import (
    Table,
    damaged_error,
    importer,
    is_picture,
    missing_library,
    picture_remark,
    samples_first,
    spread,
)
from hapticeval.recordings.hdf5 import DAMAGE, SIGNATURE, lies_elsewhere
from hapticeval.recordings.memory import reserve

NPZ_DAMAGE = (ValueError, RuntimeError, zipfile.BadZipFile, zlib.error, EOFError, TokenError, MemoryError)
"""NumPy and zipfile raise any of these for one and the same damage, by where it strikes."""

UNIT_NAMES = ("unit", "units", "Unit", "Units")
DEEPEST_GROUP = 32
"""Groups within groups; a file nested deeper holds no log, and takes minutes to walk through."""

MOST_OBJECTS = 100_000
"""Objects in a file."""


def check_nesting(path: Path, kind: str, depth: int, count: int, place: str) -> None:
    """Raise `InputError` for groups or structures (`kind`) that are nested too deep, or too many parts in a file."""
    if depth > DEEPEST_GROUP or count > MOST_OBJECTS:
        what = f"{kind} {depth} deep" if depth > DEEPEST_GROUP else f"more than {MOST_OBJECTS} parts"
        raise InputError(
            f"{path} has {what}, {place}",
            why=f"at most {DEEPEST_GROUP} levels and {MOST_OBJECTS} parts are read",
            todo="save the signals of the recording by themselves",
        )


class Arrays:
    """Takes the arrays of a file one after the other, each by its path: columns of numbers, or attributes."""

    def __init__(self) -> None:
        self.columns: dict[str, NDArray[Any]] = {}
        self.units: dict[str, str] = {}
        self.notes: dict[str, str] = {}
        self.attributes: dict[str, Any] = {}
        self.warnings: list[str] = []
        self.remarks: list[str] = []

    def add(self, name: str, values: NDArray[Any]) -> None:
        """Add an array: columns (n,) or (n, k) of numbers, each field of a structured one, or a single number or text.

        Numbers keep their unit (m, N or what the file states). What is neither number nor text is named in `remarks`.
        """
        if values.dtype.names:
            for part in values.dtype.names:
                self.add(f"{name}.{part}", values[part])
        elif values.dtype.kind in "US" and values.size == 1:
            self.attributes[name] = str(values.ravel()[0])
        elif is_picture(values.shape):
            self.remarks.append(picture_remark(name, values.shape))
        elif values.dtype.kind in "mM":  # times: whole nanoseconds since 1970, or durations
            self.columns[name], self.units[name] = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64), "ns"
        elif values.dtype.kind not in "fiub":
            self.remarks.append(f"'{name}' is of type {values.dtype}, which is left out")
        elif values.size == 1:
            self.attributes[name] = values.ravel()[0].item()
        elif values.size:
            self.columns |= spread(name, samples_first(f"'{name}'", values, self.remarks))

    def table(self) -> Table:
        """Return all of them as a table."""
        return Table(self.columns, self.units, self.notes, self.attributes, self.warnings, self.remarks)


class Nodes:
    """The groups and data sets of an HDF5 file, as far as they lie in the file itself.

    What does not is named in `warnings`. Raises `InputError` for a file that is nested too deep, has too many parts, or
    whose numbers take more memory than is allowed.
    """

    def __init__(self, path: Path, file: Any, warnings: list[str]) -> None:
        self.path, self.file, self.warnings = path, file, warnings
        self._count = self._size = 0

    def members(self, group: Any, depth: int) -> Iterator[tuple[str, Any]]:
        """Yield the names in a group, which lies `depth` groups deep, and what they name in this file."""
        import h5py

        for name in group:
            # Asked of the link itself, since looking at the target would open the other file.
            if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
                self._leave_out(f"{group.name}/{name}".lstrip("/"))
                continue
            node = group.get(name)
            if node is not None:
                self.enter(node, depth)
                yield name, node

    def enter(self, node: Any, depth: int) -> None:
        """Count an object that is about to be looked at."""
        self._count += 1
        check_nesting(self.path, "groups", depth, self._count, f"at '{str(node.name)[:80]}'")

    def read(self, node: Any, name: str, parts: list[str] | None = None) -> Any:
        """Return the numbers of a data set, or those of its fields `parts`; none where they lie in another file."""
        if lies_elsewhere(node):
            self._leave_out(name)
            return np.empty(0)
        # Counted before a number is read: single precision becomes double, 8 bytes.
        self._size += max(8, node.dtype.itemsize) * math.prod(node.shape or ())
        reserve(self._size, str(self.path))
        return node.fields(parts)[()] if parts else node[()]

    def _leave_out(self, name: str) -> None:
        self.warnings.append(f"'{name}' lies in another file, which is not opened: it is left out")


@contextmanager
def opened(path: Path, warnings: list[str]) -> Iterator[Nodes]:
    """Open an HDF5 file; whatever h5py raises for one that is cut short or damaged becomes an `InputError`."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            yield Nodes(path, file, warnings)
    except HapticevalError:
        raise
    except DAMAGE as error:
        raise damaged_error(path, str(error)) from error


@importer("hdf5", about="an HDF5 file", recognises=lambda head: head.startswith(SIGNATURE))
def read_hdf5(path: Path) -> Table:
    """Return columns `group/dataset`, with the unit of the attribute `unit` or `units`; attributes as `path@name`."""
    import h5py

    arrays = Arrays()
    with opened(path, arrays.warnings) as nodes:
        # HDF5 groups may contain themselves: each object is walked through once.
        visited = {hash(nodes.file["/"].id)}

        def walk(place: str, node: Any, depth: int) -> None:
            stated = {f"{place}@{key}": plain_value(node.attrs[key]) for key in node.attrs}
            arrays.attributes.update(stated)
            if isinstance(node, h5py.Dataset):
                # One data set may become several columns; its unit is that of each of them.
                before = set(arrays.columns)
                _add_dataset(nodes, arrays, place, node)
                unit = next((text for key in UNIT_NAMES if (text := stated.get(f"{place}@{key}"))), None)
                arrays.units.update({name: str(unit) for name in arrays.columns.keys() - before if unit})
            elif isinstance(node, h5py.Group):
                for name, part in nodes.members(node, depth):
                    if hash(part.id) not in visited:  # neither a second name of an object, nor a group in itself
                        visited.add(hash(part.id))
                        walk(f"{place}/{name}".lstrip("/"), part, depth + 1)

        walk("", nodes.file, 1)
        return arrays.table()


def _add_dataset(nodes: Nodes, arrays: Arrays, name: str, node: Any) -> None:
    """Add the numbers of a data set, or of the numeric fields of a structured one; the others become remarks."""
    kinds = {part: node.dtype[part].base for part in node.dtype.names or ()} or {"": node.dtype}
    numeric = [part for part, kind in kinds.items() if kind.kind in "fiub"]
    for part, kind in kinds.items():
        if part not in numeric:
            path = f"{name}.{part}" if part else name
            arrays.remarks.append(f"'{path}' is of type {kind}, which is left out")
    if is_picture(node.shape or ()):
        arrays.remarks.append(picture_remark(name, node.shape))
    elif numeric and node.size:
        values = np.asarray(nodes.read(node, name, numeric if node.dtype.names else None))
        for part in numeric if values.size else ():
            arrays.add(f"{name}.{part}" if part else name, values[part] if part else values)


def plain_value(value: Any) -> Any:
    """Return an attribute of an HDF5 file as plain Python: bytes as text, arrays as lists."""
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


@importer(
    "npz",
    about="NumPy arrays (.npz)",
    recognises=lambda head: head.startswith(b"PK\x03\x04") and b".npy" in head[:300],
)
def read_npz(path: Path) -> Table:
    """Return columns by the arrays' names; single numbers and texts as attributes; the unit of `x` is text `unit:x`."""
    arrays = Arrays()
    place = "its index, which stands at its end"
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            # An archive begins at byte 0: any other offset is that of an archive within this file, which was cut.
            if min((entry.header_offset for entry in entries), default=0):
                raise zipfile.BadZipFile("it is that of another archive inside of it")
            names = [entry.filename for entry in entries]
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None:
                raise zipfile.BadZipFile(f"'{twice}' is in it twice, and which of both is meant is not known")
            reserve(sum(entry.file_size for entry in entries), str(path))
            for entry in entries:
                name = entry.filename.removesuffix(".npy")
                place = f"the array '{name}', from byte {entry.header_offset} on"
                data = archive.read(entry)  # all of it, which has its checksum compared
                if not data.startswith(np.lib.format.MAGIC_PREFIX):
                    arrays.remarks.append(f"'{name}' is not an array, and is left out")
                    continue
                try:
                    arrays.add(name, np.load(io.BytesIO(data), allow_pickle=False))
                except ValueError as error:
                    # NumPy raises the same kind for damage; only its words tell pickled objects apart.
                    if "allow_pickle" not in str(error):
                        raise
                    what = f"the array '{name}' is left out: it holds pickled objects, which can run code"
                    arrays.warnings.append(what)
    except NPZ_DAMAGE as error:
        raise damaged_error(path, f"{place}: {error}") from error
    units = {name: str(arrays.attributes.get(f"unit:{name}", "")) for name in arrays.columns}
    arrays.units = {name: unit for name, unit in units.items() if unit}
    return arrays.table()


@importer("npy", about="a NumPy array (.npy)", recognises=lambda head: head.startswith(np.lib.format.MAGIC_PREFIX))
def read_npy(path: Path) -> Table:
    """Return the columns `array[0]`, `array[1]`, ... of an array, or those of its fields."""
    reserve(path.stat().st_size, str(path))
    arrays = Arrays()
    try:
        arrays.add("array", np.load(path, allow_pickle=False))
    except NPZ_DAMAGE as error:
        raise damaged_error(path, str(error)) from error
    return arrays.table()


@importer("parquet", about="a Parquet file", recognises=lambda head: head.startswith(b"PAR1"))
def read_parquet(path: Path) -> Table:
    """Return the columns of numbers and times; lists of one length are columns `name[0]`, `name[1]`, ...

    Raises `HapticevalError` without `pyarrow`.
    """
    try:
        from pyarrow import ArrowException, parquet, types
    except ImportError as error:
        raise missing_library(path, "a Parquet file", "pyarrow", "logs", error) from error
    arrays, size = Arrays(), 0
    try:
        with parquet.ParquetFile(path) as file:
            for field in file.schema_arrow:
                listed = types.is_list(field.type) or types.is_fixed_size_list(field.type)
                kind = field.type.value_type if listed else field.type
                if not (types.is_primitive(kind) or types.is_dictionary(kind)):
                    arrays.remarks.append(f"'{field.name}' is of type {field.type}, which is left out")
                    continue
                column = file.read([field.name]).column(0).combine_chunks()
                size += 8 * len(column.flatten() if listed else column)
                reserve(size, f"{path}, as far as it was read,")
                values = (column.flatten() if listed else column).to_numpy(zero_copy_only=False)
                if listed and (len(values) % max(len(column), 1) or len(set(column.value_lengths().to_pylist())) > 1):
                    arrays.remarks.append(f"'{field.name}' has lists of different lengths, and is left out")
                else:
                    arrays.add(field.name, values.reshape(len(column), -1) if listed else values)
    except (ArrowException, OSError) as error:
        raise damaged_error(path, str(error)) from error
    return arrays.table()


@importer("tdms", about="a TDMS file of LabVIEW", recognises=lambda head: head.startswith(b"TDSm"))
def read_tdms(path: Path) -> Table:
    """Return columns `group/channel` with the units that they state, and `group/time` where a channel states its step.

    Raises `HapticevalError` without `nptdms`.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise missing_library(path, "a TDMS file", "npTDMS", "logs", error) from error
    arrays, size = Arrays(), 0
    try:
        with TdmsFile.open(path) as file:
            for group in file.groups():
                for channel in group.channels():
                    size += 8 * len(channel)
                    reserve(size, f"{path}, as far as it was read,")
                    name, time = f"{group.name}/{channel.name}", f"{group.name}/time"
                    arrays.add(name, np.asarray(channel[:]))
                    if unit := channel.properties.get("unit_string"):
                        arrays.units[name] = str(unit)
                    if "wf_increment" in channel.properties and time not in arrays.columns and len(channel) > 1:
                        arrays.add(time, channel.time_track())
                        arrays.units[time] = "s"
    except HapticevalError:
        raise
    except Exception as error:  # nptdms raises whatever its parsing meets
        raise damaged_error(path, str(error)) from error
    return arrays.table()
