"""HDF5 files read as far as they go: a file that is cut short gives what is whole, and says what is not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.cut import ending, open_ended
from hapticeval.types import BoolArray

DAMAGE = (OSError, KeyError, RuntimeError, ValueError)
"""h5py speaks of one and the same damage in all of these, by where it strikes."""

MOST = 5
"""So many lost parts are named, the others counted."""


@contextmanager
def opened(path: Path) -> Iterator[Partial]:
    """An HDF5 file; whatever h5py says of one that is damaged, not merely cut short, becomes an `InputError`."""
    import h5py

    cut = ending(path)
    try:
        with path.open("rb") as raw, open_ended(raw, path) if cut else h5py.File(path, "r") as file:
            yield Partial(file, cut, path.stat().st_size)
    except DAMAGE as error:
        raise InputError(
            f"{path} is cut short or damaged",
            why=f"{cut}, and its own index is lost with the rest" if cut else str(error),
            todo="copy it again from where it was recorded",
        ) from error


class Partial:
    """An HDF5 file, whole or cut short (`cut`, in words), of which only bytes that are there are ever read.

    In a whole file nothing is forgiven; in one that is cut `lost` names what cannot be found or read.
    """

    def __init__(self, file: Any, cut: str, size: int) -> None:
        self.file, self.cut, self.lost = file, cut, list[str]()
        self._size = size

    @contextmanager
    def losing(self, name: str) -> Iterator[None]:
        """Where the file is cut, what goes wrong inside is the loss of `name`."""
        try:
            yield
        except DAMAGE:
            if not self.cut:
                raise
            self.lost.append(name)

    def told(self) -> str:
        """What the cut took besides rows, in words that follow `cut`."""
        if not self.lost:
            return ""
        more = f" and {len(self.lost) - MOST} more" if len(self.lost) > MOST else ""
        return f"; what says where they lie is lost of {', '.join(self.lost[:MOST])}{more}"

    def members(self, group: Any) -> Iterator[tuple[str, Any]]:
        """The names in a group and what they name."""
        for name in self._names(group):
            with self.losing(f"'{_path(group, name)}'"):
                yield name, group[name]

    def visit(self, call: Callable[[str, Any], None]) -> None:
        """Call with the path of each group and dataset below the root, and with itself, once each."""
        import h5py

        if not self.cut:
            self.file.visititems(call)
        else:
            self._visit(self.file, call, {h5py.h5g.get_objinfo(self.file.id, b"/").objno})

    def attributes(self, node: Any) -> Iterator[tuple[str, Any]]:
        """The attributes of a group or dataset."""
        with self.losing(f"the attributes of '{node.name}'"):
            for name in node.attrs:
                with self.losing(f"'{node.name}@{name}'"):
                    yield name, node.attrs[name]

    def read(self, dataset: Any) -> tuple[Any, BoolArray | None]:
        """The numbers of a dataset, and which of them are there, in its shape; None for all."""
        if not self.cut:
            return dataset[()], None
        values, whole = np.zeros(dataset.shape, dataset.dtype), np.zeros(dataset.shape, dtype=bool)
        for part in self._parts(dataset):
            try:
                values[part] = dataset[part]
            except DAMAGE:
                continue
            whole[part] = True
        return values, None if whole.all() else whole

    def _names(self, group: Any) -> list[str]:
        import h5py

        if not self.cut:
            return list(group)
        names: list[str] = []

        def note(name: bytes) -> None:
            names.append(name.decode(errors="surrogateescape"))

        with self.losing(f"others in '{group.name}'"):
            here = h5py.h5g.open(group.id, b".")
            here.links.iterate(note)
        return names

    def _visit(self, group: Any, call: Callable[[str, Any], None], seen: set[Any]) -> None:
        import h5py

        for name in self._names(group):
            path = _path(group, name)
            with self.losing(f"'{path}'"):
                if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                    continue
                about = h5py.h5g.get_objinfo(group.id, name.encode(errors="surrogateescape"))
                if about.objno in seen:
                    continue
                seen.add(about.objno)
                node = group[name]
                call(path, node)
                if isinstance(node, h5py.Group):
                    self._visit(node, call, seen)

    def _parts(self, dataset: Any) -> Iterator[Any]:
        """Selections that are there or lost as one: blocks, or else what of the bytes lies before the end."""
        if dataset.chunks is not None:
            yield from dataset.iter_chunks()
            return
        offset = dataset.id.get_offset()
        there = dataset.size if offset is None else (self._size - offset) // dataset.id.get_type().get_size()
        if there >= dataset.size:
            yield ()
        elif there > 0:
            place = np.unravel_index(there, dataset.shape)
            for axis, index in enumerate(place):
                if index:
                    yield (*map(int, place[:axis]), slice(0, int(index)))


def _path(group: Any, name: str) -> str:
    return f"{group.name}/{name}".lstrip("/")
