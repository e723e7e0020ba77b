"""MATLAB 7.3 files (.mat), which are HDF5 files under another name: arrays lie transposed, texts as numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.recordings.formats.matlab_tree import Tree
from hapticeval.recordings.formats.partial import Partial, opened
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table

NUMERIC = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}


def _recognises(head: bytes) -> bool:
    return head.startswith(b"MATLAB 7.3 MAT-file")


@importer("matlab73", about="a MATLAB 7.3 file (.mat)", suffixes=(".mat",), recognises=_recognises)
def read_matlab73(path: Path) -> Table:
    """As `read_matlab5`, with the same names of columns; of a file that is cut short all whole rows, as `read_hdf5`."""
    tree = Tree()
    with opened(path) as file:
        for name, node in file.members(file.file):
            if not name.startswith("#"):
                _walk(tree, file, name, node)
    return tree.table(cut=file.cut, lost=file.told(), open_ended=bool(file.lost))


def _walk(tree: Tree, file: Partial, name: str, node: Any) -> None:
    """Put a node, and all that it holds, into the tree; of a file that is cut, all of it that can be found."""
    with file.losing(f"'{name}'"):
        _add(tree, file, name, node)


def _add(tree: Tree, file: Partial, name: str, node: Any) -> None:
    import h5py

    kind = node.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if "MATLAB_object_decode" in node.attrs:
        tree.left_out(name, kind)
    elif isinstance(node, h5py.Group):
        parts = dict(file.members(node))
        items = [part.size for part in parts.values() if _refers(part)]
        if items and len(items) == len(parts):  # an array of structures: each field is an array of references
            for part, references in parts.items():
                _follow(tree, file, references, name, "[]", f".{part}")
        else:
            for part, item in parts.items():
                _walk(tree, file, f"{name}.{part}", item)
    elif _refers(node):
        _follow(tree, file, node, name, "{}")
    elif "MATLAB_empty" in node.attrs:
        return
    elif kind == "char" or kind in NUMERIC or not kind:
        read, whole = file.read(node)
        array = np.asarray(read).T
        if kind == "char":
            array = np.array(["".join(map(chr, array.ravel()))])
        tree.add(name, array, None if whole is None else whole.T)
    else:
        tree.warn(f"the variable '{name}' of class '{kind}' is left out")


def _follow(tree: Tree, file: Partial, node: Any, name: str, brackets: str, after: str = "") -> None:
    """Put what each reference of an array leads to into the tree, numbered where there are several."""
    references, whole = file.read(node)
    for place, reference in enumerate(references.ravel()):
        numbered = f"{name}{'' if node.size == 1 else f'{brackets[0]}{place}{brackets[1]}'}{after}"
        if whole is None or whole.ravel()[place]:
            with file.losing(f"'{numbered}'"):
                _add(tree, file, numbered, file.file[reference])
        else:
            file.lost.append(f"'{numbered}'")


def _refers(node: Any) -> bool:
    """Whether a dataset holds references to others rather than numbers; a cell, or a field of a structure array."""
    import h5py

    return isinstance(node, h5py.Dataset) and h5py.check_ref_dtype(node.dtype) is not None
