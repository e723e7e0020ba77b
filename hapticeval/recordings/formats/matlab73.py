"""MATLAB 7.3 files (.mat), which are HDF5 files under another name: arrays lie transposed, texts as numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.recordings.formats.hdf5 import opened
from hapticeval.recordings.formats.matlab_tree import Tree
from hapticeval.recordings.formats.registry import importer
from hapticeval.recordings.formats.table import Table

NUMERIC = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}


def _recognises(head: bytes) -> bool:
    return head.startswith(b"MATLAB 7.3 MAT-file")


@importer("matlab73", about="a MATLAB 7.3 file (.mat)", suffixes=(".mat",), recognises=_recognises)
def read_matlab73(path: Path) -> Table:
    """As `read_matlab5`: the same variables have the same column names in both."""
    tree = Tree()
    with opened(path) as file:
        for name in file:
            if not name.startswith("#"):
                _walk(tree, file, name, file[name])
    return tree.table()


def _walk(tree: Tree, file: Any, name: str, node: Any) -> None:
    import h5py

    kind = node.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if "MATLAB_object_decode" in node.attrs:
        tree.left_out(name, kind)
    elif isinstance(node, h5py.Group):
        parts = {part: node[part] for part in node}
        items = [part.size for part in parts.values() if _refers(part)]
        if items and len(items) == len(parts):  # an array of structures: each field is an array of references
            for part, references in parts.items():
                for place, reference in enumerate(references[()].ravel()):
                    _walk(tree, file, f"{name}{'' if items[0] == 1 else f'[{place}]'}.{part}", file[reference])
        else:
            for part, item in parts.items():
                _walk(tree, file, f"{name}.{part}", item)
    elif _refers(node):
        for place, reference in enumerate(node[()].ravel()):
            _walk(tree, file, f"{name}{'' if node.size == 1 else f'{{{place}}}'}", file[reference])
    elif "MATLAB_empty" in node.attrs:
        return
    elif kind == "char":
        tree.add(name, np.array(["".join(map(chr, node[()].T.ravel()))]))
    elif kind in NUMERIC or not kind:
        tree.add(name, np.asarray(node[()]).T)
    else:
        tree.warn(f"the variable '{name}' of class '{kind}' is left out")


def _refers(node: Any) -> bool:
    """Whether a dataset holds references to others rather than numbers; a cell, or a field of a structure array."""
    import h5py

    return isinstance(node, h5py.Dataset) and h5py.check_ref_dtype(node.dtype) is not None
