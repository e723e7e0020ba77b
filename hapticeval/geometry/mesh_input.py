"""Triangles from outside: mesh files, and what makes triangles a mesh that bounds a model.

Files are STL, OBJ, PLY and OFF, in a unit that the user names, as these hold none. Each way in which triangles bound no
model has one clear error.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from hapticeval.errors import InputError, UnknownNameError, at, in_m, unreadable
from hapticeval.geometry import mesh_build as build
from hapticeval.geometry.validate import check_range, not_finite_error
from hapticeval.types import Array, IntArray

MOST_TRIANGLES = 5_000_000
"""Triangles of the largest mesh that is taken: beyond it the tables take more than a gigabyte."""
SUSPECT_BATCH = 4096
"""Pairs of triangles that are looked at together for whether they cross."""

EDGE_WORDS = ("first", "second", "third")
REPAIR = "in MeshLab: Filters > Cleaning and Repairing; in Python: trimesh.repair"

PROBLEMS = {
    build.FLAT_TRIANGLE: (
        "at {from_} is degenerate: its corners lie on one straight line",
        "it has no area, and so no normal",
        "collapse its shortest edge, or remove it and close the gap",
    ),
    build.OPEN: (
        "has no neighbour across its {edge} edge, {from_} to {to}: the mesh is open",
        "only a closed surface has an inside",
        "close the hole; merge corners that should be one point; divide the triangle where a corner of another lies in "
        "the middle of that edge, a T-junction ({repair})",
    ),
    build.SHARED: (
        "shares its {edge} edge, {from_} to {to}, with more than one other: the mesh is not a manifold",
        "the surface divides there, so that the inside is on no one side of it",
        "remove inner walls and double triangles, or join the parts by a boolean union ({repair})",
    ),
    build.FLIPPED: (
        "and its neighbour across the {edge} edge, {from_} to {to}, run the same way round",
        "one of them shows its inner side: corners run anticlockwise seen from outside",
        "turn one of them: swap two of its corners (trimesh.repair.fix_winding)",
    ),
    build.PINCHED: (
        "is in one of several fans that touch in a single point, {from_}: the mesh is not a manifold",
        "the surface is pinched to a point there",
        "split the vertex there, and move the copies apart",
    ),
    build.OTHER_PART: (
        "at {from_} belongs to another part than triangle 0",
        "a model is bounded by one connected surface",
        "give each part as a model of its own, or join them by a boolean union; remove closed voids inside",
    ),
    build.FOLDED: (
        "at {from_} is folded flat onto a neighbour",
        "the solid between them has no thickness",
        "remove both, or move their corners apart",
    ),
}
"""What is wrong, why that matters, and how to mend it."""


def checked_positions(vertices: object) -> Array:
    """Return vertices as (v, 3) float64. Raises `InputError`, naming the vertex, for anything else or not finite."""
    try:
        array = np.array(vertices, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InputError("the vertices are not rows of three numbers", why=str(error)) from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"the vertices have the shape {array.shape}", why="they must be rows of x, y and z: (n, 3)")
    if not np.isfinite(array).all():
        raise not_finite_error(array, "vertex coordinates: vertex")
    return array


def checked_triangles(triangles: object, count: int) -> IntArray:
    """Return triangles as (t, 3) rows of `count` vertices, anticlockwise seen from outside.

    Raises `InputError`, naming the triangle, for other shapes, numbers that are not whole or name no vertex, a corner
    that comes twice, and fewer than four triangles or more than `MOST_TRIANGLES`.
    """
    try:
        numbers = np.array(triangles)
        array = numbers.astype(np.int64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError("the triangles are not rows of three whole numbers", why=str(error)) from error
    if array.ndim != 2 or array.shape[1] != 3 or numbers.dtype.kind not in "iuf" or not np.array_equal(numbers, array):
        raise InputError(
            f"the triangles have the shape {array.shape}" if array.ndim != 2 or array.shape[1] != 3
            else "the triangles are not whole numbers",
            why="each is the numbers of its three vertices, counted from 0: (n, 3)",
            todo="divide faces of more corners into triangles",
        )  # fmt: skip
    if not 4 <= array.shape[0] <= MOST_TRIANGLES:
        raise InputError(
            f"a mesh of {array.shape[0]} triangles",
            why="a closed one has at least four" if array.shape[0] < 4 else f"at most {MOST_TRIANGLES} are taken",
            todo="" if array.shape[0] < 4 else "simplify it: quadric decimation keeps the shape",
        )
    check_corners_named(array, count)
    # one vertex for two corners: no area
    twice = np.flatnonzero((array == np.roll(array, 1, axis=1)).any(axis=1))
    if twice.size:
        raise InputError(
            f"triangle {twice[0]} has one vertex for two of its corners",
            why="it has no area, and so no normal",
            todo="remove it, and close the gap",
        )
    return np.ascontiguousarray(array)


def check_corners_named(triangles: IntArray, count: int) -> None:
    """Raise `InputError`, naming the triangle, where a corner of triangles (t, 3) is none of `count` vertices."""
    outside = np.flatnonzero(((triangles < 0) | (triangles >= count)).any(axis=1))
    if outside.size:
        raise InputError(
            f"triangle {outside[0]} is {triangles[outside[0]].tolist()}",
            why=f"its corners are numbers of the {count} vertices, counted from 0",
        )


def check_closed(positions: Array, triangles: IntArray) -> IntArray:
    """Return the neighbours (t, 3) of the triangles (t, 3) of a closed, connected, outward manifold.

    `positions` (v, 3), m. Raises `InputError`, naming the triangle and how to mend it, for any other.
    """
    used = np.zeros(positions.shape[0], dtype=bool)
    used[triangles] = True
    # vertices that no triangle has do not count
    check_range(positions[used])
    across, problem, triangle, corner = build.join_neighbours(positions.shape[0], triangles)
    if problem:
        refuse_triangle(problem, triangle, positions[triangles[triangle]], corner)
    detached = build.other_component(across)
    if detached >= 0:
        refuse_triangle(build.OTHER_PART, detached, positions[triangles[detached]])
    if build.volume(positions, triangles) <= 0.0:
        raise InputError(
            "the mesh is inside out, or encloses nothing: triangle 0 and all others show their inner side",
            why="corners run anticlockwise seen from outside, so that the enclosed volume is positive",
            todo="swap two corners of every triangle (trimesh.repair.fix_inversion)",
        )
    return across


def check_crossings(faces: Array, vertices: Array, tree: Array, order: IntArray) -> None:
    """Raise `InputError`, naming two triangles, where a mesh crosses or touches itself, with the place (m).

    `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) are the mesh, `order` (t,) the triangles' numbers as they
    were given. Pairs that no plane separates by more than rounding are decided in exact arithmetic.
    """
    begin = 0
    while begin < faces.shape[0]:
        pairs, begin = build.suspect_pairs(faces, vertices, tree, begin, SUSPECT_BATCH)
        for one, two in pairs.tolist():
            first, second = (
                # a double is a fraction: no rounding from here on
                [tuple(map(Fraction, vertices[int(row), :3].tolist())) for row in faces[k, :3]]
                for k in (one, two)
            )
            shared = set(first) & set(second)
            for place in meeting_points(first, second):
                # neighbours meet in the corners that they share
                if place not in shared:
                    low, high = sorted((int(order[one]), int(order[two])))
                    raise InputError(
                        f"triangles {low} and {high} cross or touch at {in_m(map(float, place))}",
                        why="the surface of a rigid model does not meet itself",
                        todo="move the parts apart, or join them by a boolean union (trimesh.boolean.union, MeshLab)",
                    )


def refuse_triangle(problem: int, triangle: int, corners: Array, corner: int = 0) -> NoReturn:
    """Raise the `InputError` that names a triangle, by its number and the places (3, 3) of its corners, m."""
    what, why, todo = PROBLEMS[problem]
    places = [in_m(place) for place in corners.tolist()]
    words = {
        "edge": EDGE_WORDS[corner],
        "from_": places[corner],
        "to": places[(corner + 1) % 3],
        "repair": REPAIR,
    }
    raise InputError(f"triangle {triangle} {what.format(**words)}", why=why, todo=todo.format(**words))


ExactPoint = tuple[Fraction, ...]


def meeting_points(first: Sequence[ExactPoint], second: Sequence[ExactPoint]) -> Iterator[ExactPoint]:
    """Yield points at which two triangles meet, exactly: where edges of one pass through the other.

    Two in one plane meet in the corners of the area that they share.
    """
    for one, two in ((first, second), (second, first)):
        normal = _cross(_difference(two[1], two[0]), _difference(two[2], two[0]))
        # the plane is looked at along the axis that it faces most: no area vanishes
        axis = max(range(3), key=lambda i: abs(normal[i]))
        for start, end in ((one[0], one[1]), (one[1], one[2]), (one[2], one[0])):
            low, high = _dot(normal, _difference(start, two[0])), _dot(normal, _difference(end, two[0]))
            # the edge lies in the other triangle's plane
            if low == high == 0:
                yield from _meeting_points_in_plane(start, end, two, axis)
            elif min(low, high) <= 0 <= max(low, high):
                # where the edge passes the plane
                share = low / (low - high)
                place = tuple(a + share * (b - a) for a, b in zip(start, end, strict=True))
                if _contains(two, place, axis):
                    yield place


def _meeting_points_in_plane(
    start: ExactPoint, end: ExactPoint, triangle: Sequence[ExactPoint], axis: int
) -> Iterator[ExactPoint]:
    """Yield the ends of a segment that lie in a triangle of the same plane, and where it crosses edges."""
    for place in (start, end):
        if _contains(triangle, place, axis):
            yield place
    for i in range(3):
        a, b = triangle[i], triangle[(i + 1) % 3]
        low, high = _doubled_area(a, b, start, axis), _doubled_area(a, b, end, axis)
        # parallel, or both ends on one side: no crossing
        if low == high or min(low, high) > 0 or max(low, high) < 0:
            continue
        share = low / (low - high)
        place = tuple(p + share * (q - p) for p, q in zip(start, end, strict=True))
        u, v = (axis + 1) % 3, (axis + 2) % 3
        if all(min(a[w], b[w]) <= place[w] <= max(a[w], b[w]) for w in (u, v)):
            yield place


def _contains(triangle: Sequence[ExactPoint], place: ExactPoint, axis: int) -> bool:
    """Whether a triangle holds a point of its plane, seen along an axis."""
    turns = [_doubled_area(triangle[i], triangle[(i + 1) % 3], place, axis) for i in range(3)]
    # on one side of all edges, whichever way the triangle runs seen along the axis
    return min(turns) >= 0 or max(turns) <= 0


def _doubled_area(a: ExactPoint, b: ExactPoint, c: ExactPoint, axis: int) -> Fraction:
    """Return twice the signed area of a triangle seen along an axis, exactly."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    return (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u])


def _difference(a: ExactPoint, b: ExactPoint) -> ExactPoint:
    """Return a - b, exactly."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def _cross(a: ExactPoint, b: ExactPoint) -> ExactPoint:
    """Return the vector product a x b, exactly."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: ExactPoint, b: ExactPoint) -> Fraction:
    """Return the scalar product, exactly."""
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


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
        why = f"read are {', '.join(FILE_ENDINGS)}"
        raise InputError(f"the mesh file {file} ends in '{file.suffix}'", why=why, todo="save it as one of these")
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
        raise unreadable(f"the mesh file {file}", error) from error
    import trimesh

    damaged = f"{file} is not of the format {file.suffix[1:].upper()}, or is damaged"
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
    with at(str(file)):
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
