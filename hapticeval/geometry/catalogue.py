"""The models that suites name: the star and Cassinian of chapter 4, and shapes with closed-form answers."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.errors import InputError, UnknownNameError, at
from hapticeval.geometry import kernels as pieces
from hapticeval.geometry import solids
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import CASSINIAN, ELLIPSE, PIECE_COLUMNS, UNBOUNDED
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_input import checked_positions, checked_triangles
from hapticeval.geometry.model import Model
from hapticeval.geometry.solids import Triangles
from hapticeval.geometry.surface import Surface
from hapticeval.geometry.validate import (
    checked_number,
    checked_size,
    checked_vertices,
    vertices_from_geojson,
    vertices_from_wkt,
)
from hapticeval.types import Array

TURN_ROUNDING, LARGEST_POINT_ROUNDING = math.ulp(2.0 * math.pi) / 2.0, 1e-12
"""Rounding (rad) of an angle within one turn; and how far it may move a point of a Cassinian, as a share of its radius.
"""

LARGEST_AXIS_RATIO = 1e6
"""Largest ratio of two axes."""

LOBE_SHARE, FILLET_SHARE = 0.38, 0.5
"""Dumbbell: lobe radius as a share of half the size, fillet radius as a share of the lobe radius."""


def star(points: int = 5, tip_angle: float = 60.0, size: float = 0.2) -> Model:
    """A star with sharp tips and notches: the model of pop-through at corners.

    `points` tips of `tip_angle` degrees on a circle of diameter `size` (m), the first at 90 degrees. Raises
    `InputError` for fewer than three points and for a tip so wide that nothing is left of the notches.
    """
    points = _checked_count("points", points, 3, 100_000)
    size = checked_size(size)
    tip_angle = checked_number("tip_angle", tip_angle)
    # the inner angle of the regular polygon: at that the notches are flat
    widest = 180.0 - 360.0 / points
    if not 0.0 < tip_angle < widest * (1.0 - 1e-9):
        raise InputError(
            f"tip_angle = {tip_angle!r} degrees gives no star of {points} points",
            why=f"its tips must be sharper than the {widest:g} degrees of the regular polygon",
            todo=f"choose an angle between 0 and {widest:g} degrees",
        )
    outer = size / 2.0
    half = math.radians(tip_angle / 2.0)
    # law of sines in the triangle of centre, tip and notch: angles half, pi / points, and the rest
    inner = outer * math.sin(half) / math.sin(half + math.pi / points)
    angles = math.pi / 2.0 + np.arange(2 * points) * (math.pi / points)
    radii = np.where(np.arange(2 * points) % 2 == 0, outer, inner)
    vertices = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    return _polygon_model("star", vertices, points=points, tip_angle=tip_angle, size=size)


def cassinian(lobes: int = 4, a_n: float = 2.0, a_d: float = 1.0, size: float = 0.2) -> Model:
    """The smooth lobed curve of thesis (4.1), convex and concave in turn, with its first tip at angle 0.

    `a_n` / `a_d` above 1 sets the depth of the valleys; `size` (m) is the circumscribed diameter.

    Raises `InputError` if `a_n` / `a_d` is not above 1: then the lobes are separate curves.

    So it does where it is so little above 1 that the curve's parameter cannot resolve the sides of the valleys: a point
    moves there by r / sqrt(a_n / a_d - 1) per radian.
    """
    lobes = _checked_count("lobes", lobes, 2, 1_000)
    size = checked_size(size)
    a_n, a_d = _positive("a_n", a_n), _positive("a_d", a_d)
    # a_n / a_d - 1, to rounding: the small difference that (4.1) lives on
    above = (a_n - a_d) / a_d
    if not 0.0 < above <= 1e100:
        raise InputError(
            f"a_n / a_d = {a_n!r} / {a_d!r} = {a_n / a_d!r}",
            why="the lobes are separate curves unless it is above 1" if above <= 0.0 else "it must be finite",
            todo="choose a_n larger than a_d",
        )
    # radius at cos(n_l u) = 0, on the sides of the valleys, as a share of the tips'
    radius = (math.sqrt(above) / (1.0 + math.sqrt(1.0 + above))) ** (1.0 / lobes)
    if TURN_ROUNDING * radius > LARGEST_POINT_ROUNDING * math.sqrt(above):
        raise InputError(
            f"a_n / a_d is 1 + {above:.3g}, with {lobes} lobes: valleys too narrow for the number format",
            why=f"the parameter of (4.1), an angle, is rounded to {TURN_ROUNDING:.2g} rad; beside a valley that moves "
            f"the surface point by {0.5 * TURN_ROUNDING * radius / math.sqrt(above):.2g} of the size, more than "
            f"{0.5 * LARGEST_POINT_ROUNDING:g}",
            todo="choose a larger a_n, or give the outline as a polygon",
        )
    row = np.array([[CASSINIAN, 0.0, 2.0 * math.pi, size / 2.0, float(lobes), 1.0 + above, above, 0.0, 0.0]])
    return _model_of(Curve("cassinian", row, True), lobes=lobes, a_n=a_n, a_d=a_d, size=size)


def circle(size: float = 0.2) -> Model:
    """A circle of diameter `size` (m) about the origin: constant curvature, closed-form answers."""
    size = checked_size(size)
    rows = pieces.concatenate_segments([pieces.arc_piece((0.0, 0.0), size / 2.0, 0.0, 2.0 * math.pi)])
    return _model_of(Curve("circle", rows, True), size=size)


def ellipse(ratio: float = 2.0, size: float = 0.2) -> Model:
    """An ellipse whose long axis, `size` (m), lies along x and is `ratio` times the short one."""
    size = checked_size(size)
    ratio = checked_number("ratio", ratio)
    if not 1.0 <= ratio <= LARGEST_AXIS_RATIO:
        raise InputError(
            f"ratio = {ratio!r}", why="it is the long axis over the short one, between 1 and 1e6", todo="invert it"
        )
    row = np.zeros((1, PIECE_COLUMNS))
    row[0, :5] = ELLIPSE, 0.0, 2.0 * math.pi, size / 2.0, size / 2.0 / ratio
    return _model_of(Curve("ellipse", row, True), ratio=ratio, size=size)


def dumbbell(neck: float = 0.5, size: float = 0.2) -> Model:
    """Two round lobes joined along x by a straight neck with tangent circular fillets: smooth, with a narrow
    waist.

    `neck` is the neck's half-width as a share of the lobe radius, between 0 and 1; `size` (m) is the whole
    length.
    """
    size = checked_size(size)
    neck = checked_number("neck", neck)
    if not 1e-6 <= neck < 1.0:
        raise InputError(f"neck = {neck!r}", why="it is a share of the lobe radius, from 1e-6 to below 1")
    lobe = LOBE_SHARE * size / 2.0
    fillet, half_width, centre = FILLET_SHARE * lobe, neck * lobe, size / 2.0 - lobe
    height = half_width + fillet
    # the fillet touches the lobe: their centres lie lobe + fillet apart
    inward = math.sqrt((lobe + fillet) ** 2 - height**2)
    # polar angle, at the lobe's centre, of the point where they touch
    reach = math.atan2(height, -inward)
    fillet_sweep = reach - math.pi / 2.0
    end = centre - inward
    rows = [
        pieces.arc_piece((centre, 0.0), lobe, -reach, 2.0 * reach),
        pieces.arc_piece((end, height), fillet, reach - math.pi, -fillet_sweep),
        pieces.line_piece((end, half_width), (-end, half_width)),
        pieces.arc_piece((-end, height), fillet, -math.pi / 2.0, -fillet_sweep),
        pieces.arc_piece((-centre, 0.0), lobe, math.pi - reach, 2.0 * reach),
        pieces.arc_piece((-end, -height), fillet, reach, -fillet_sweep),
        pieces.line_piece((-end, -half_width), (end, -half_width)),
        pieces.arc_piece((end, -height), fillet, math.pi / 2.0, -fillet_sweep),
    ]
    return _model_of(Curve("dumbbell", pieces.concatenate_segments(rows), True), neck=neck, size=size)


def line() -> Model:
    """The half-plane y < 0, whose boundary is the x axis run towards -x: the flat wall of chapter 6."""
    row = np.array([[UNBOUNDED, -math.inf, math.inf, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0]])
    return _model_of(Curve("line", row, False))


def sphere(size: float = 0.2) -> Model:
    """A sphere of diameter `size` (m) about the origin: the surface of thesis (7.50)."""
    size = checked_size(size)
    return _model_of(Surface("sphere", "sphere", (size / 2.0,)), size=size)


def ellipsoid(a: float = 0.1, b: float = 0.07, c: float = 0.05) -> Model:
    """An ellipsoid about the origin with semi-axes `a`, `b` and `c` (m) along x, y and z.

    Raises `InputError` if one is more than 1e6 times another.
    """
    a, b, c = checked_size(a, "a"), checked_size(b, "b"), checked_size(c, "c")
    if max(a, b, c) > LARGEST_AXIS_RATIO * min(a, b, c):
        raise InputError(f"semi-axes of {min(a, b, c):g} m and {max(a, b, c):g} m", why="their ratio is at most 1e6")
    return _model_of(Surface("ellipsoid", "ellipsoid", (a, b, c)), a=a, b=b, c=c)


def torus(major: float = 0.07, minor: float = 0.03) -> Model:
    """A torus about the z axis: a tube of radius `minor` (m) about the circle of radius `major` (m) in z = 0.

    Raises `InputError` unless `minor` is below `major`: then the tube crosses itself on the axis.
    """
    major, minor = checked_size(major, "major"), checked_size(minor, "minor")
    if not minor < major * (1.0 - 1e-9):
        raise InputError(
            f"a torus with a tube of radius {minor:g} m about a circle of radius {major:g} m",
            why="it crosses itself on its axis unless the tube's radius is the smaller one",
            todo="choose minor below major",
        )
    if major > LARGEST_AXIS_RATIO * minor:
        raise InputError(f"radii of {minor:g} m and {major:g} m", why="their ratio is at most 1e6")
    return _model_of(Surface("torus", "torus", (major, minor)), major=major, minor=minor)


def mesh(
    vertices: ArrayLike | None = None,
    triangles: ArrayLike | None = None,
    file: str | None = None,
    unit: str | None = None,
    name: str = "mesh",
) -> Model:
    """A closed triangle mesh: from a `file` (STL, OBJ, PLY or OFF), or of `vertices` and `triangles`.

    - `vertices` (v, 3) are positions, and `triangles` (t, 3) rows of them, anticlockwise seen from outside.
    - `unit` is that of the coordinates: m, mm, cm or in; a file needs it, and vertices are in metres without it.

    In a suite the file counts from the suite's folder. Raises `InputError` as `read_mesh` and `Mesh` do.
    """
    from hapticeval.geometry.mesh_input import metres_per, read_mesh

    # exactly one of both ways, and neither half of the second
    inline = vertices is not None and triangles is not None
    if inline is (file is not None) or (vertices is None) is not (triangles is None):
        raise InputError(
            "a mesh is either a file, or vertices and triangles", todo="give file and unit, or vertices and triangles"
        )
    parameters: dict[str, Any] = {"name": name} if unit is None else {"unit": unit, "name": name}
    if file is None:
        corners = checked_positions(vertices)
        rows = checked_triangles(triangles, len(corners))
        parameters |= {"vertices": corners.tolist(), "triangles": rows.tolist()}
        surface = Mesh(name, corners if unit is None else metres_per(unit) * corners, rows)
        return Model(name, MappingProxyType(parameters), surface)
    if unit is None:
        raise InputError(
            f"the mesh file {file} has no unit", why="the format has none", todo="give unit: m, mm, cm or in"
        )
    factor = metres_per(unit)
    corners, rows = read_mesh(Path(file))
    with at(str(file)):
        surface = Mesh(name, factor * corners, rows)
    return Model(name, MappingProxyType({"file": str(file), **parameters}), surface)


def cube(size: float = 0.1) -> Model:
    """A cube of edge `size` (m) about the origin, its edges along the axes."""
    size = checked_size(size)
    return _mesh_model("cube", solids.box((size, size, size)), size=size)


def box(x: float = 0.1, y: float = 0.08, z: float = 0.06) -> Model:
    """A box of edges `x`, `y` and `z` (m) along the axes, about the origin: a plate if one of them is small."""
    sides = checked_size(x, "x"), checked_size(y, "y"), checked_size(z, "z")
    return _mesh_model("box", solids.box(sides), x=sides[0], y=sides[1], z=sides[2])


def wedge(angle: float = 60.0, size: float = 0.1, length: float = 0.1) -> Model:
    """A prism along z whose edge of `angle` degrees points along x; it is `size` (m) deep and `length` (m) long."""
    angle, size, length = checked_number("angle", angle), checked_size(size), checked_size(length, "length")
    if not 1e-3 <= angle <= 179.0:
        raise InputError(f"angle = {angle!r} degrees", why="that of a wedge is between 0.001 and 179")
    return _mesh_model("wedge", solids.wedge(math.radians(angle), size, length), angle=angle, size=size, length=length)


def l_block(size: float = 0.1, thickness: float = 0.04, length: float = 0.1) -> Model:
    """Two legs, as long as `size` and of one `thickness` (m), that form an L, extruded along z: with a concave edge."""
    size, thickness, length = checked_size(size), checked_size(thickness, "thickness"), checked_size(length, "length")
    if not thickness < size:
        raise InputError(
            f"an L of thickness {thickness:g} m and size {size:g} m",
            why="without a notch it is a box",
            todo="choose a thickness below the size",
        )
    return _mesh_model(
        "l-block", solids.l_block(size, thickness, length), size=size, thickness=thickness, length=length
    )


def icosphere(subdivisions: int = 3, size: float = 0.2) -> Model:
    """A sphere of diameter `size` (m) as 20 * 4^`subdivisions` triangles with their corners on it."""
    subdivisions, size = _checked_count("subdivisions", subdivisions, 0, 8), checked_size(size)
    return _mesh_model("icosphere", solids.icosphere(subdivisions, size / 2.0), subdivisions=subdivisions, size=size)


def cylinder(size: float = 0.1, length: float = 0.1, sides: int = 64) -> Model:
    """A cylinder of diameter `size` (m) along z as a prism of `sides` faces, with their edges on it."""
    size, length, sides = checked_size(size), checked_size(length, "length"), _checked_count("sides", sides, 3, 100_000)
    return _mesh_model("cylinder", solids.cylinder(size / 2.0, length, sides), size=size, length=length, sides=sides)


def extruded(
    model: Mapping[str, Any] = MappingProxyType({"kind": "star"}), length: float = 0.1, vertices: int = 160
) -> Model:
    """A closed plane model, given by its `kind` and parameters, extruded along z to `length` (m) about z = 0.

    A model of straight edges is extruded as it is, another as the polygon of `vertices` corners on it.
    """
    length, vertices = checked_size(length, "length"), _checked_count("vertices", vertices, 3, 100_000)
    if not isinstance(model, Mapping) or not isinstance(model.get("kind"), str):
        raise InputError("the model that is extruded has no kind", todo='give model = { kind = "star" }')
    with at("the extruded model"):
        flat = make_model(**model)
        if flat.dimension != 2:
            raise InputError(f"model '{flat.name}' is in space", why="plane models are extruded")
        if not flat.curve.closed:
            raise InputError(f"model '{flat.name}' is unbounded", why="closed plane models are extruded")
        outline = flat.polygon(vertices).vertices
    return _mesh_model("extruded", solids.prism(outline, length), model=dict(model), length=length, vertices=vertices)


def from_vertices(vertices: ArrayLike | Sequence[Sequence[float]], *, name: str = "polygon") -> Model:
    """A polygon of given corners (n, 2), m, anticlockwise. Raises `InputError` as `checked_vertices` does."""
    array = checked_vertices(vertices)
    return _polygon_model(name, array, vertices=array.tolist(), name=name)


def from_wkt(text: str, *, name: str = "wkt") -> Model:
    """A polygon in well-known text, in metres: one anticlockwise outer ring."""
    return _polygon_model(name, vertices_from_wkt(text), text=text, name=name)


def from_geojson(document: str | Mapping[str, Any], *, name: str = "geojson") -> Model:
    """A GeoJSON Polygon, as text or as a mapping, in metres: one anticlockwise outer ring."""
    return _polygon_model(name, vertices_from_geojson(document), document=document, name=name)


EXACT_MAKERS = (star, cassinian, circle, ellipse, dumbbell, line, sphere, ellipsoid, torus)
SOLID_MAKERS = (cube, box, wedge, l_block, icosphere, cylinder, extruded)
MODELS: Mapping[str, Callable[..., Model]] = MappingProxyType(
    {
        **{maker.__name__.replace("_", "-"): maker for maker in (*EXACT_MAKERS, *SOLID_MAKERS)},
        "polygon": from_vertices,
        "wkt": from_wkt,
        "geojson": from_geojson,
        "mesh": mesh,
    }
)
"""What makes a model of each kind. A further kind is a line here, where its boundary is of a class that there is.

A smooth plane curve that is none yet is a kind of piece: see `kernels.SMOOTH_KINDS`.
"""


KINDS_FROM_USER = ("polygon", "wkt", "geojson", "mesh")
"""Kinds that are nothing without a shape of the user's own."""


def make_model(kind: str, **parameters: Any) -> Model:
    """A model by the name and parameters that a suite file gives.

    Raises `UnknownNameError` for an unknown kind and `InputError` for parameters that it does not have,
    lacks, or cannot be made from.
    """
    if kind not in MODELS:
        raise UnknownNameError("model", kind, MODELS)
    maker = MODELS[kind]
    known = inspect.signature(maker).parameters
    for name in parameters:
        if name not in known:
            raise UnknownNameError(f"parameter of model '{kind}'", name, known)
    # names the parameter that is missing, where Python's error would name a function
    for name_needed, parameter in known.items():
        if parameter.default is inspect.Parameter.empty and name_needed not in parameters:
            raise InputError(f"model '{kind}' lacks the parameter '{name_needed}'", todo=f"give {name_needed}")
    return maker(**parameters)


def _model_of(boundary: Boundary, /, **parameters: Any) -> Model:
    """Return the model of a boundary, which has its name, with the parameters that it was made from."""
    return Model(boundary.name, MappingProxyType(parameters), boundary)


def _mesh_model(title: str, triangles: Triangles, /, **parameters: Any) -> Model:
    """Return the model of a mesh with this title."""
    return _model_of(Mesh(title, *triangles), **parameters)


def _polygon_model(title: str, vertices: Array, /, **parameters: Any) -> Model:
    """Return the model of a polygon of `vertices` (n, 2), m, with this title."""
    return _model_of(Curve(title, pieces.line_pieces(vertices), True), **parameters)


def _checked_count(what: str, value: object, smallest: int, largest: int) -> int:
    """Return a whole number between two bounds. Raises `InputError` otherwise, naming `what`."""
    number = checked_number(what, value)
    if number != int(number) or not smallest <= number <= largest:
        raise InputError(f"{what} = {value!r}", why=f"it must be a whole number between {smallest} and {largest}")
    return int(number)


def _positive(what: str, value: object) -> float:
    """Return a finite number above 0. Raises `InputError` otherwise, naming `what`."""
    number = checked_number(what, value)
    if number <= 0.0:
        raise InputError(f"{what} = {value!r}", why="it must be positive")
    return number
