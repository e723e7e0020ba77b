"""What makes vertices and points usable, and one clear error for each way in which they are not."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from hapticeval.documents import check_depth, parse_json
from hapticeval.errors import InputError, in_m
from hapticeval.types import Array

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

R = TypeVar("R")

SMALLEST_SIZE, LARGEST_SIZE = 1e-100, 1e100
"""Sizes (m) whose squares and cubes stay inside the float range."""
COARSEST_ROUNDING = 1e-7
"""Rounding of a model's coordinates, as a share of its size, that is still fine enough.

Bounds on IHIPs are some 1e-5 of a model's size at the finest: rounding must stay two digits below them.
"""
GEOJSON_HINT = 'give {"type": "Polygon", "coordinates": [[...]]}'
WKT_HINT = "give POLYGON ((x y, x y, x y, x y)), ring closed"
DEEPEST_WKT = 16
"""Brackets within brackets, *chosen*: a polygon has two, and GEOS has no limit but its stack."""


def points_for_kernels(points: object, dimension: int) -> Array:
    """Return points as kernels take them, (n, `dimension`) float64. Raises `InputError` for another shape.

    Whether they are finite is left to the kernel, see `kernels.check_finite`: for one point that costs a tenth.
    """
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"points are not rows of {dimension} numbers", why=str(error)) from error
    if array.ndim != 2 or array.shape[1] != dimension:
        axes = "x and y" if dimension == 2 else "x, y and z"
        raise InputError(f"points have the shape {array.shape}", why=f"they must be rows of {axes}: (n, {dimension})")
    # kernels are compiled for one layout: C order, aligned and writable
    return array if array.flags.carray else np.require(array, requirements=["C", "W"])


def checked_points(points: object) -> Array:
    """Return points of the plane, (n, 2), m, as kernels take them.

    Raises `InputError` as `points_for_kernels` does, and, naming the row, for one that is not finite.
    """
    array = points_for_kernels(points, 2)
    if not np.isfinite(array).all():
        raise not_finite_error(array)
    return array


def answer_by_kernel(kernel: Callable[..., R], tables: Sequence[Array | None], points: object, dimension: int) -> R:
    """Return what a kernel that calls `check_finite` gives of points (n, `dimension`), m: one compiled call.

    `tables` are those of the boundary, such as faces (t, 9) and vertices (v, 6), that the kernel takes before the
    points. Raises `InputError` for points of another shape, and, naming the row, for one that is not finite.
    """
    array = points_for_kernels(points, dimension)
    try:
        return kernel(*tables, array)
    # the kernel can say no more than that some number is not finite
    except ValueError:
        raise not_finite_error(array) from None


def not_finite_error(array: Array, what: str = "points: row") -> InputError:
    """Return the error that names the first row of an array (n, N), such as points in m, with a number not finite."""
    row = int(np.argmin(np.isfinite(array).all(axis=1)))
    return InputError(f"{what} {row} is ({', '.join(map(str, array[row]))})", why="every number must be finite")


def checked_size(size: float, what: str = "size") -> float:
    """Return a length in metres that is finite, positive and whose squares stay inside the float range."""
    value = checked_number(what, size)
    if value <= 0.0:
        raise InputError(f"{what} = {value!r} m", why="it must be positive")
    if not SMALLEST_SIZE <= value <= LARGEST_SIZE:
        raise InputError(
            f"{what} = {value!r} m: a model {'larger' if value > 1.0 else 'smaller'} than the float range",
            why="squares of its lengths overflow or vanish in double precision",
            todo=f"choose a size between {SMALLEST_SIZE:g} and {LARGEST_SIZE:g} m",
        )
    return value


def checked_number(what: str, value: object) -> float:
    """Return a finite real number. Raises `InputError` otherwise."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{what} = {value!r}", why="it must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = np.inf
    if not np.isfinite(number):
        raise InputError(f"{what} = {value!r}", why="it must be finite")
    return number


def checked_vertices(vertices: object) -> Array:
    """Return the corners of one simple anticlockwise polygon, (n, 2), m, without a closing repetition of the first.

    Raises `InputError`, naming the vertices or the place, for fewer than three vertices, numbers that are not finite,
    points in 3D, repeated points, an outline that crosses itself, no area, clockwise order, and sizes outside the float
    range.
    """
    array = _vertex_rows(vertices)
    if not np.isfinite(array).all():
        raise not_finite_error(array, "vertex coordinates: vertex")
    # files repeat the first corner at the end
    if array.shape[0] > 1 and np.array_equal(array[0], array[-1]):
        array = array[:-1]
    if array.shape[0] < 3:
        raise InputError(f"a polygon of {array.shape[0]} vertices", why="it needs at least three", todo="add vertices")
    check_range(array)
    _check_simple(array)
    return np.ascontiguousarray(array)


def vertices_from_wkt(text: str) -> Array:
    """Return the vertices of a `POLYGON` in well-known text; see `checked_vertices` for what is refused."""
    import shapely

    if not isinstance(text, str) or not text.strip():
        raise InputError("the WKT text is empty", todo=WKT_HINT)
    # GEOS recurses: counted here, before its stack overflows
    if max(accumulate((character == "(") - (character == ")") for character in text)) > DEEPEST_WKT:
        raise InputError("the WKT text is nested too deep", why="a polygon has two levels of brackets", todo=WKT_HINT)
    try:
        with np.errstate(all="ignore"):  # numbers that are not finite are refused below, by vertex
            geometry = shapely.from_wkt(text)
    except shapely.errors.ShapelyError as error:
        raise InputError("the WKT text cannot be read", why=str(error), todo=WKT_HINT) from error
    return _outline_of(geometry)


def vertices_from_geojson(document: str | Mapping[str, Any]) -> Array:
    """Return the vertices of a GeoJSON Polygon, as text or mapping; see `checked_vertices` for what is refused."""
    import shapely

    if isinstance(document, str):
        if not document.strip():
            raise InputError("the GeoJSON text is empty", todo=GEOJSON_HINT)
        document = parse_json(document, "the GeoJSON text")
    else:
        check_depth(document, "the GeoJSON")
    if not isinstance(document, Mapping) or "type" not in document:
        raise InputError("the GeoJSON has no 'type'", todo=GEOJSON_HINT)
    if document["type"] == "FeatureCollection":
        raise InputError("the GeoJSON is a FeatureCollection", why="a model is one outline", todo="give one Feature")
    if document["type"] == "Feature":
        document = document.get("geometry") or {}
    try:
        geometry = shapely.from_geojson(json.dumps(document, allow_nan=False))
    except (shapely.errors.ShapelyError, ValueError, TypeError) as error:
        raise InputError("the GeoJSON cannot be read", why=str(error), todo=GEOJSON_HINT) from error
    return _outline_of(geometry)


def _outline_of(geometry: BaseGeometry | None) -> Array:
    """Return the outer ring (n, 2) of a polygon of shapely's. Raises `InputError` for any other geometry, and holes."""
    import shapely

    if geometry is None or geometry.is_empty:
        raise InputError("the geometry is empty", todo="give a polygon of at least three vertices")
    if not isinstance(geometry, shapely.Polygon):
        several = geometry.geom_type.startswith("Multi") or geometry.geom_type == "GeometryCollection"
        raise InputError(
            f"the geometry is a {geometry.geom_type}",
            why="a model is one outline" if several else "only a Polygon has an inside",
            todo="give each part as a model of its own" if several else "give a Polygon",
        )
    if len(geometry.interiors) > 0:
        raise InputError(
            "the polygon has holes",
            why="a model is bounded by one curve",
            todo="leave the inner rings out",
        )
    return checked_vertices(shapely.get_coordinates(geometry.exterior, include_z=bool(geometry.has_z)))


def _vertex_rows(vertices: object) -> Array:
    """Return vertices as an array (n, 2). Raises `InputError`, naming the first one that is no pair."""
    try:
        array = np.array(vertices, dtype=np.float64)
    except (TypeError, ValueError) as error:
        for i, vertex in enumerate(vertices if isinstance(vertices, (list, tuple)) else ()):
            if not isinstance(vertex, (list, tuple, np.ndarray)) or len(vertex) != 2:
                raise InputError(f"vertex {i} is {vertex!r}", why="it must be a pair of numbers") from error
        raise InputError("the vertices are not rows of two numbers", why=str(error)) from error
    if array.ndim == 2 and array.shape[1] == 3:
        raise InputError(
            "the vertices have three coordinates", why="a model is a curve in the plane", todo="leave z out"
        )
    if array.size and (array.ndim != 2 or array.shape[1] != 2):
        raise InputError(f"the vertices have the shape {array.shape}", why="they must be rows of x and y: (n, 2)")
    return array.reshape(-1, 2)


def check_range(array: Array) -> None:
    """Raise `InputError` for vertices (n, N), m, of a size, or so far from the origin, that the numbers do not hold."""
    # halved first: the difference of two of the largest numbers would overflow
    span = float(np.max(np.ptp(array / 2.0, axis=0))) * 2.0
    largest = float(np.max(np.abs(array)))
    if largest > LARGEST_SIZE:
        raise InputError(
            f"vertex {int(np.argmax(np.abs(array).max(axis=1)))} lies {largest:g} m from the origin: "
            "a model larger than the float range",
            why="squares of its lengths overflow in double precision",
            todo=f"keep coordinates below {LARGEST_SIZE:g} m",
        )
    if 0.0 < span < SMALLEST_SIZE:
        raise InputError(
            f"the vertices span {span:g} m: a model smaller than the float range",
            why="squares of its lengths vanish in double precision",
            todo=f"keep models above {SMALLEST_SIZE:g} m",
        )
    # the gap between neighbouring numbers as large as the coordinates
    rounding = float(np.spacing(largest))
    if rounding > COARSEST_ROUNDING * span > 0.0:
        raise InputError(
            f"a model of {span:g} m lies {largest:g} m from the origin: farther than the number format resolves",
            why=f"coordinates there are multiples of {rounding:.2g} m, which is more than {COARSEST_ROUNDING:g} of its "
            "size",
            todo="shift the model nearer to the origin",
        )


def _check_simple(array: Array) -> None:
    """Refuse outlines that pass a point twice, cross or touch themselves, enclose nothing, or run clockwise."""
    import shapely

    if len(set(map(tuple, array.tolist()))) < len(array):
        _, numbers, counts = np.unique(array, axis=0, return_inverse=True, return_counts=True)
        first, second = np.flatnonzero(numbers.ravel() == np.argmax(counts > 1))[:2]
        raise InputError(
            f"vertices {first} and {second} are the same point ({array[first, 0]:g}, {array[first, 1]:g})",
            why="an outline passes each point once",
            todo="remove one of them",
        )
    count = f"the {array.shape[0]} vertices"
    # about a corner: far from the origin the products would be all rounding
    x, y = (array - array[0]).T
    # all on the line from the first corner to the farthest one
    farthest = int(np.argmax(x * x + y * y))
    if np.max(np.abs(x * y[farthest] - y * x[farthest])) <= 1e-14 * (x[farthest] ** 2 + y[farthest] ** 2):
        raise InputError(f"{count} lie on one straight line", why="it has zero area and no inside")
    reason = shapely.is_valid_reason(shapely.Polygon(array))
    if reason != "Valid Geometry":
        place = re.search(r"\[(\S+) (\S+)\]", reason)
        where = f" at {in_m(map(float, place.groups()))}" if place else ""
        raise InputError(
            f"the outline crosses or touches itself{where}",
            why=reason.split("[")[0].lower(),
            todo="move or reorder the vertices so that edges meet only at shared vertices",
        )
    # twice the signed area
    if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0.0:
        raise InputError(
            f"{count} run clockwise",
            why="outlines run anticlockwise: the inside lies to the left",
            todo="reverse the order of the vertices",
        )
