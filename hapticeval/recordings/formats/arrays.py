"""Files of named arrays: HDF5 of any origin, and NumPy's .npz. Every numeric array is a column, or several.

What a file names outside of itself is never opened: external links, external storage and virtual data sets of HDF5 can
read any path of the machine, and pickled objects of NumPy can run code.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table, spread, upright
from hapticeval.recordings.hdf5 import SIGNATURE, ending, lies_elsewhere
from hapticeval.recordings.memory import reserve

UNIT_NAMES = ("unit", "units", "Unit", "Units")

H5_DAMAGE = (OSError, KeyError, RuntimeError, ValueError)
"""h5py speaks of one and the same damage in all of these, by where it strikes."""

NPZ_DAMAGE = (ValueError, RuntimeError, zipfile.BadZipFile, zlib.error, EOFError, TokenError, MemoryError)
"""So does NumPy."""

DEEPEST = 32
"""Groups within groups; a file nested deeper holds no log, and takes minutes to walk through."""

MOST = 100_000
"""Objects in a file."""


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """An HDF5 file; whatever h5py raises for one that is cut short or damaged becomes an `InputError`."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            yield file
    except HapticevalError:
        raise
    except H5_DAMAGE as error:
        raise damaged(path, ending(path) or str(error)) from error


def damaged(path: Path, why: str) -> InputError:
    """The error of a foreign file that is not whole."""
    return InputError(f"{path} is cut short or damaged", why=why, todo="copy it again from where it was recorded")


class Nodes:
    """The groups and data sets of an HDF5 file, each once, as far as they lie in the file itself.

    `elsewhere` collects what does not. Raises `InputError` for a file that is nested too deep or has too many parts.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.elsewhere: list[str] = []
        self._count = 0

    def members(self, group: Any, depth: int) -> Iterator[tuple[str, Any]]:
        """The names in a group, which lies `depth` groups deep, and what they name in this file."""
        import h5py

        for name in group:
            if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
                self.elsewhere.append(f"{group.name}/{name}".lstrip("/"))
                continue
            node = group.get(name)
            if node is not None:
                self.enter(node, depth)
                yield name, node

    def enter(self, node: Any, depth: int) -> None:
        """Count an object that is about to be looked at."""
        self._count += 1
        if depth > DEEPEST or self._count > MOST:
            what = f"groups {depth} deep" if depth > DEEPEST else f"more than {MOST} parts"
            raise InputError(
                f"{self.path} has {what}, at '{str(node.name)[:80]}'",
                why=f"at most {DEEPEST} levels and {MOST} parts are read",
                todo="write the recording's data sets into a file of their own",
            )

    def warnings(self) -> list[str]:
        """What was left out for lying in another file."""
        return [f"'{name}' lies in another file, which is not opened: it is left out" for name in self.elsewhere]


def _is_hdf5(head: bytes) -> bool:
    return head.startswith(SIGNATURE)


@importer("hdf5", about="an HDF5 file", suffixes=(".h5", ".hdf5", ".hdf"), recognises=_is_hdf5)
def read_hdf5(path: Path) -> Table:
    """Columns `group/dataset`, with the unit that the attribute `unit` or `units` states; attributes as `path@name`."""
    with opened(path) as file:
        return _Hdf5(path, file).table()


class _Hdf5:
    """One pass that finds the data sets and their size, and a second one that reads them."""

    def __init__(self, path: Path, file: Any) -> None:
        self.nodes = Nodes(path)
        self.columns: dict[str, Any] = {}
        self.units: dict[str, str] = {}
        self.attributes: dict[str, Any] = {}
        self.remarks: list[str] = []
        self.datasets: list[tuple[str, Any, list[str]]] = []
        self.seen = {hash(file["/"].id)}
        self.size = 0
        self._note("", file)
        self._find(file, "", 1)
        reserve(self.size, str(path))

    def table(self) -> Table:
        """The columns."""
        for name, node, parts in self.datasets:
            read = node.fields(parts)[()] if parts else node[()]
            for path_ in [f"{name}.{part}" for part in parts] if parts else [name]:
                values = np.asarray(read[path_.removeprefix(f"{name}.")] if parts else read)
                if values.size == 1:
                    self.attributes[path_] = values.ravel()[0].item()
                    continue
                found = spread(path_, upright(f"'{path_}'", values, self.remarks))
                self.columns |= found
                said = (self.attributes.get(f"{name}@{key}") for key in UNIT_NAMES)
                unit = next((unit for unit in said if unit), None)
                self.units.update({column: str(unit) for column in found if unit})
        return Table(
            self.columns,
            units=self.units,
            attributes=self.attributes,
            warnings=tuple(self.nodes.warnings()),
            remarks=tuple(self.remarks),
        )

    def _find(self, group: Any, path: str, depth: int) -> None:
        import h5py

        for name, node in self.nodes.members(group, depth):
            place = f"{path}/{name}".lstrip("/")
            if hash(node.id) in self.seen:  # a second name of the same object, or a group that holds itself
                continue
            self.seen.add(hash(node.id))
            self._note(place, node)
            if isinstance(node, h5py.Group):
                self._find(node, place, depth + 1)
            elif isinstance(node, h5py.Dataset):
                self._dataset(place, node)

    def _dataset(self, name: str, node: Any) -> None:
        names = node.dtype.names
        kinds = {part: node.dtype[part].base for part in names} if names else {"": node.dtype}
        found = [part for part, kind in kinds.items() if kind.kind in "fiub"]
        self.remarks += [
            f"'{name}{'.' * bool(part)}{part}' is of type {kind}, which is left out"
            for part, kind in kinds.items()
            if part not in found
        ]
        if not found or not node.size:
            return
        if lies_elsewhere(node):
            self.nodes.elsewhere.append(name)
            return
        self.size += 8 * node.size * sum(int(np.prod(node.dtype[part].shape)) if part else 1 for part in found)
        self.datasets.append((name, node, found if names else []))

    def _note(self, name: str, node: Any) -> None:
        self.attributes.update({f"{name}@{key}".lstrip("/"): _plain(node.attrs[key]) for key in node.attrs})


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _is_npz(head: bytes) -> bool:
    return head.startswith(b"PK\x03\x04") and b".npy" in head[:300]


@importer("npz", about="NumPy arrays (.npz)", suffixes=(".npz",), recognises=_is_npz)
def read_npz(path: Path) -> Table:
    """Columns by the arrays' names; single numbers and texts as attributes; a unit of `x` is the text `unit:x`."""
    columns: dict[str, Any] = {}
    attributes: dict[str, Any] = {}
    warnings: list[str] = []
    remarks: list[str] = []
    place = "its index, which stands at its end"
    try:
        with zipfile.ZipFile(path) as archive:
            found = archive.infolist()
            if min((entry.header_offset for entry in found), default=0):
                raise zipfile.BadZipFile("it is that of another archive inside of it")
            reserve(sum(entry.file_size for entry in found), str(path))
            for entry in found:
                name = entry.filename.removesuffix(".npy")
                place = f"the array '{name}', from byte {entry.header_offset} on"
                data = archive.read(entry)
                if not data.startswith(np.lib.format.MAGIC_PREFIX):
                    remarks.append(f"'{name}' is no array, and is left out")
                    continue
                try:
                    array = np.load(io.BytesIO(data), allow_pickle=False)
                except ValueError as error:
                    if "allow_pickle" not in str(error):
                        raise
                    warnings.append(f"the array '{name}' is left out: it holds pickled objects, which can run code")
                    continue
                _sort(name, array, columns, attributes, remarks)
    except NPZ_DAMAGE as error:
        raise damaged(path, f"{place}: {error}") from error
    units = {name.removeprefix("unit:"): str(text) for name, text in attributes.items() if name.startswith("unit:")}
    return Table(columns, units=units, attributes=attributes, warnings=tuple(warnings), remarks=tuple(remarks))


def _sort(name: str, array: Any, columns: dict[str, Any], attributes: dict[str, Any], remarks: list[str]) -> None:
    """Put an array, or each field of a structured one, among the columns or the attributes."""
    names = array.dtype.names
    for part, values in {f"{name}.{part}": array[part] for part in names}.items() if names else [(name, array)]:
        if values.dtype.kind in "US" and values.size == 1:
            attributes[part] = str(values.ravel()[0])
        elif values.dtype.kind not in "fiub":
            remarks.append(f"the array '{part}' is of type {values.dtype}, which is left out")
        elif values.size == 1:
            attributes[part] = values.ravel()[0].item()
        elif values.size:
            columns |= spread(part, upright(f"'{part}'", values, remarks))
