"""A model in the plane of a figure: what it fills there, or its shadow; the view, and labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.reports.canvas import MM, colour_of
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from shapely import Geometry

    from hapticeval.geometry.mesh import Mesh

FACET_SHARE = 1.0 / 400.0
"""Share of a solid's size that its triangles may lie off it: half a pixel of a picture of it."""

PAGE_DETAIL = 1500.0
"""Width of the view over what is left out of an outline: finer than a pixel of a figure as wide as a page."""

SHARP_TURN = 0.5
"""Turn (rad) of the faces at an edge of a solid that is drawn: round ones of few triangles have none."""

Box = tuple[float, float, float, float]
"""(xmin, ymin, xmax, ymax), mm."""


def name_axes(axes: Axes, coordinates: tuple[int, int], dimension: int) -> None:
    """Label a plane with its two coordinates, and with the direction from which a run in space is seen."""
    first, second = ("₁₂₃"[axis] for axis in coordinates)
    # The coordinates 0, 1 and 2 add up to 3, so that the third is 3 less the two.
    along = f", seen along y{'₁₂₃'[3 - sum(coordinates)]}" if dimension == 3 else ""
    axes.set(xlabel=f"y{first} (mm){along}", ylabel=f"y{second} (mm)")


def labels(numbers: Sequence[int], places: Sequence[Array], near: float) -> list[tuple[Array, str]]:
    """Return where to write which numbers: marks closer than `near` to one another share a label, as in "1,3".

    `places` are points (2,) or (1,) in the unit of their axes, mm or s, and so is `near`.
    """
    groups: list[tuple[Array, list[int]]] = []
    for number, place in zip(numbers, places, strict=True):
        # The first group that is near enough; its first place is where all are written.
        group = next((group for group in groups if np.linalg.norm(place - group[0]) < near), None)
        if group is None:
            groups.append((place, [number]))
        else:
            group[1].append(number)
    return [(where, ",".join(map(str, together))) for where, together in groups]


def aspect_of(axes: Axes) -> float:
    """Return the width of the axes over their height, on paper."""
    size = axes.get_window_extent()
    return float(size.width / size.height)


def box_round(centre: Array, size: Array, aspect: float) -> Box:
    """Return the smallest box about `centre` (2,) that holds `size` (2,), mm, and is `aspect` times as wide as high."""
    # mm; at least 20 um, for a hand that does not move.
    height = max(float(size[1]), float(size[0]) / aspect, 0.02)
    half = 0.5 * np.array([height * aspect, height])
    (xmin, ymin), (xmax, ymax) = centre - half, centre + half
    return float(xmin), float(ymin), float(xmax), float(ymax)


def model_shadow(model: Model, coordinates: tuple[int, int], view: Box, *, detail: float = PAGE_DETAIL) -> Geometry:
    """Return what to draw of a model, mm: what it fills in the plane, or its shadow on the two coordinates."""
    if model.dimension == 2:
        return filled_part(model, view, detail=detail)
    right, up = np.eye(3)[list(coordinates)]
    return solid_shadow(model, np.stack([right, up, np.cross(right, up)]))


def solid_mesh(model: Model) -> Mesh:
    """Return a model in space as a mesh of triangles that is as fine as a picture of it shows."""
    from hapticeval.geometry.mesh import Mesh

    mesh = model.mesh(max_error=FACET_SHARE * model.size).boundary
    assert isinstance(mesh, Mesh), "a model in space has no edges"
    return mesh


def solid_shadow(model: Model, frame: Array) -> Geometry:
    """Return the shadow of a solid and its sharp edges in sight, mm: the union of the triangles that face the eye.

    The rows of `frame` (3, 3) are unit vectors to the right, up, and to the eye.
    """
    import shapely

    mesh, eye = solid_mesh(model), frame[2]
    corners = MM * mesh.vertices @ frame[:2].T
    facing = mesh.normals @ eye > 0.0
    # Joined on a grid of 1 um.
    shadow = shapely.union_all(shapely.polygons(corners[mesh.triangles[facing]]), grid_size=1e-3)
    edges = shapely.MultiLineString(list(MM * mesh.edges(SHARP_TURN, eye) @ frame[:2].T))
    return shapely.GeometryCollection([*shapely.get_parts(shadow), edges])


def filled_part(model: Model, view: Box, *, detail: float = PAGE_DETAIL) -> Geometry:
    """Return what the model fills of `view` and a bit around it, mm, to the width of the view over `detail`."""
    import shapely

    xmin, ymin, xmax, ymax = view
    width, height = xmax - xmin, ymax - ymin
    # Clipping takes valid polygons only, and an outline may cross itself.
    area = shapely.make_valid(shapely.Polygon(_outline(model, view, detail)))
    clipped = shapely.clip_by_rect(
        area, xmin - 0.1 * width, ymin - 0.1 * height, xmax + 0.1 * width, ymax + 0.1 * height
    )
    return shapely.simplify(clipped, width / detail)


def _outline(model: Model, view: Box, detail: float) -> Array:
    """The closed outline, or of an open one a ring that is large enough to fill the view on its inside."""
    boundary = model.boundary
    if boundary.closed:
        # With the usual detail 400 points on a length as wide as the view.
        points = int(np.clip(boundary.girth * MM / (view[2] - view[0]) * detail / 3.75, 400, 40_000))
        return MM * boundary.points(max(points, 8 * len(boundary.corners)))
    centre = np.array([view[0] + view[2], view[1] + view[3]]) / 2.0
    # An open model is drawn as the half-plane behind the tangent next to the view's centre.
    frame = boundary.closest_point(centre[np.newaxis] / MM)
    point, left = MM * frame.foot[0], -frame.normal[0]
    tangent = np.array([left[1], -left[0]])
    # mm: beyond the view on all sides, wherever its centre is.
    reach = 3.0 * (np.linalg.norm(centre - point) + view[2] - view[0] + view[3] - view[1])
    return np.asarray(point + reach * np.array([-tangent, tangent, tangent + left, left - tangent]))


def draw_geometry(axes: Axes, body: Geometry | None, view: Box, *, linewidth: float = 1.1) -> None:
    """Draw a body's polygons filled, with their holes, and its lines thinner; set the view (mm)."""
    import shapely
    from matplotlib.collections import LineCollection

    for part in () if body is None else shapely.get_parts(body):
        if part.geom_type == "Polygon" and not part.is_empty:
            ring = shapely.get_coordinates(part.exterior)
            axes.fill(*ring.T, facecolor=colour_of("model"), edgecolor=colour_of("ink"), linewidth=linewidth, zorder=1)
            # A hole is painted over in the background's colour.
            for hole in part.interiors:
                rim = shapely.get_coordinates(hole)
                axes.fill(
                    *rim.T, facecolor=axes.get_facecolor(), edgecolor=colour_of("ink"), linewidth=linewidth, zorder=1
                )
        elif part.geom_type == "MultiLineString":
            lines = list(shapely.get_coordinates(part).reshape(-1, 2, 2))
            axes.add_collection(LineCollection(lines, colors=colour_of("ink"), linewidths=0.4 * linewidth, zorder=1))
    axes.set(xlim=view[::2], ylim=view[1::2])
