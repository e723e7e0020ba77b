"""Triangle meshes from files: STL, OBJ, PLY and OFF, in a unit that the user names, as these files hold none."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.mesh_checks import MOST_TRIANGLES, check_corners_named
from hapticeval.geometry.validate import not_finite_error
from hapticeval.types import Array, IntArray

METRES_PER_UNIT = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 25.4e-3}
"""Metres in each unit."""
FILE_ENDINGS = (".stl", ".obj", ".ply", ".off")
TEXT_ENDINGS = (".obj", ".off")
STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL file: a header that ends with the number of triangles, and each triangle."""
LARGEST_FILE = 1 << 30
"""Bytes of the largest file that is read: five million triangles are a quarter of a gigabyte in STL."""


def metres_per(unit: str) -> float:
    """Return how many metres a unit is. Raises `UnknownNameError`."""
    if not isinstance(unit, str) or unit not in METRES_PER_UNIT:
        raise UnknownNameError("unit", str(unit), METRES_PER_UNIT, todo=f"choose one of: {', '.join(METRES_PER_UNIT)}")
    return METRES_PER_UNIT[unit]


def read_mesh(file: Path) -> tuple[Array, IntArray]:
    """Return vertices (v, 3), in the file's own unit, and triangles (t, 3) of a mesh file; equal vertices become one.

    Nothing but the file is read, no other that it names, and nothing of it runs. Raises `InputError`, naming the file,
    for one that is not there, too large, of another format, damaged, or that holds no triangles.
    """
    if file.suffix.lower() not in FILE_ENDINGS:
        raise InputError(f"the mesh file {file} ends in '{file.suffix}'", why=f"read are {', '.join(FILE_ENDINGS)}")
    try:
        if not file.is_file():
            raise InputError(
                f"no mesh file {file}", todo="check the path; in a suite it counts from the suite's folder"
            )
        size = file.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(
                f"the mesh file {file} has {size / 2**20:.0f} MiB", why=f"at most {LARGEST_FILE >> 20} MiB are read",
                todo="simplify the mesh: quadric decimation keeps the shape",
            )  # fmt: skip
        content = file.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read the mesh file {file}", why=error.strerror or str(error)) from error
    import trimesh

    damaged = f"{file} is no {file.suffix[1:].upper()} file, or a damaged one"
    if not content.strip():
        raise InputError(f"the mesh file {file} is empty", todo="export it again")
    content = _as_utf8(content) if file.suffix.lower() in TEXT_ENDINGS else content
    fault = _stl_fault(content) if file.suffix.lower() == ".stl" else ""
    if fault:
        raise InputError(damaged, why=fault, todo="export it again, or copy it again")
    try:
        with np.errstate(all="ignore"):
            loaded: Any = trimesh.load(
                io.BytesIO(content), file_type=file.suffix[1:].lower(), process=False, force="mesh", skip_materials=True
            )
        # `process=False`: corners come as they are in the file
        vertices, triangles = np.asarray(loaded.vertices, dtype=np.float64), np.asarray(loaded.faces, dtype=np.int64)
    except MemoryError as error:
        raise InputError(damaged, why="its header announces more than memory holds") from error
    except Exception as error:  # a parser may raise anything on bytes of anyone
        raise InputError(damaged, why=f"{type(error).__name__}: {error}", todo="export it again") from error
    if vertices.ndim != 2 or triangles.ndim != 2 or not triangles.size:
        raise InputError(f"{file} holds no triangles", why="lines and points bound no solid", todo="export a surface")
    if len(triangles) > MOST_TRIANGLES:
        raise InputError(f"{file} holds {len(triangles)} triangles", why=f"at most {MOST_TRIANGLES} are taken")
    if not np.isfinite(vertices).all():
        raise not_finite_error(vertices, "vertex coordinates: vertex")
    check_corners_named(triangles, len(vertices))
    return merge_equal_vertices(vertices, triangles)


def _as_utf8(content: bytes) -> bytes:
    """Return text in UTF-8, which the parsers take: what is in no UTF-8 is taken for Latin-1, which reads anything."""
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1").encode()
    return content


def _stl_fault(content: bytes) -> str:
    """Return why the bytes are neither a binary STL file nor one in text; "" for those that may be one."""
    (count,) = struct.unpack("<I", content[STL_HEADER - 4 : STL_HEADER].ljust(4, b"\0"))
    size = STL_HEADER + STL_TRIANGLE * count
    # the size alone tells a binary file: text ones may begin with "solid" and so may binary ones
    if len(content) == size:
        return ""
    if content.lstrip()[:5].lower() == b"solid" and b"\0" not in content:
        return "" if b"endsolid" in content.lower() else "it begins with 'solid', and no 'endsolid' ends it"
    if len(content) < STL_HEADER:
        return f"it has {len(content)} bytes, and the header of a binary one has {STL_HEADER}"
    return f"its header counts {count} triangles, which take {size} bytes, and {len(content)} are there"


def merge_equal_vertices(vertices: Array, triangles: IntArray) -> tuple[Array, IntArray]:
    """Return the same triangles (t, 3) over vertices that differ: STL writes each corner of each triangle again.

    `vertices` (v, 3) are in the file's own unit, m or another; equal means equal to the last bit.
    """
    vertices = vertices + 0.0  # no negative zero
    # equal vertices come to stand next to each other
    order = np.lexsort(vertices.T)
    ranked = vertices[order]
    is_first = np.concatenate([[True], (ranked[1:] != ranked[:-1]).any(axis=1)])
    number = np.empty(len(vertices), np.int64)
    # the new number of each old vertex: how many different ones come before
    number[order] = np.cumsum(is_first) - 1
    return ranked[is_first], number[triangles]
