"""The plane of a figure: the model, where the hand was, where the tool was put, and the lines between.

Of a run in space its shadow is drawn, on the plane of the two axes along which the hand moves most.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import MM, colour_of, figure, legend_above, page_svg
from hapticeval.types import Array, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from shapely import Geometry

    from hapticeval.geometry.mesh import Mesh

DRAWN_SAMPLES = 60
"""About so many samples of a run are drawn, and the marked ones."""

OVERVIEW_BELOW = 0.35
"""Share of the model in view below which a small picture of the whole is added."""
LENS_BELOW = 0.025
"""Depth as a share of the view below which the points cannot be told apart without a lens."""
INSET_SIDE = 0.31
"""Side of a small picture, as a share of the axes."""
FACET_SHARE = 1.0 / 400.0
"""Share of a solid's size that its triangles may lie off it: half a pixel of a picture of it."""

PAGE_DETAIL = 1500.0
"""Width of the view over what is left out of an outline: finer than a pixel of a figure as wide as a page."""

SHARP_TURN = 0.5
"""Turn (rad) of the faces at an edge of a solid that is drawn: round ones of few triangles have none."""

Box = tuple[float, float, float, float]
"""(xmin, ymin, xmax, ymax), mm."""


def draw_plane(
    axes: Axes, recording: Recording, model: Model | None, *, ticks: Mapping[int, int], failed: Collection[int]
) -> None:
    """Draw into `axes`; `ticks` maps the numbers of marks to samples, `failed` are the numbers that failed.

    A mark that is alone has no number.
    """
    coordinates = widest_coordinates(recording.hip)
    name_axes(axes, coordinates, recording.hip.shape[1])
    axes.yaxis.set_label_coords(-0.13, 0.5)
    columns = list(coordinates)
    # From here on the run is one in the plane: its shadow.
    channels = {name: getattr(recording, name)[:, columns] for name in ("hip", "ihip", "force")}
    recording = Recording(recording.time, channels, recording.meta)
    points = MM * np.vstack([recording.hip, recording.ihip])
    view = box_round(0.5 * (points.min(axis=0) + points.max(axis=0)), 1.24 * np.ptp(points, axis=0), aspect_of(axes))
    body = None if model is None else model_shadow(model, coordinates, view)
    draw_geometry(axes, body, view)
    chosen = samples_along_path(recording, DRAWN_SAMPLES, keep=ticks.values())
    _draw_samples(axes, recording, chosen)
    for number, tick in ticks.items():
        _draw_mark(axes, recording, tick, failed=number in failed)
    numbered = ticks if len(ticks) > 1 else {}
    places = [MM * recording.ihip[tick] for tick in numbered.values()]
    for label_place, text in labels(list(numbered), places, 0.05 * (view[2] - view[0])):
        axes.annotate(text, tuple(label_place), xytext=(5.5, 3.5), textcoords="offset points", zorder=6)
    axes.set(xlim=view[::2], ylim=view[1::2])
    legend_above(
        axes, loc="lower left", bbox_to_anchor=(0.0, 0.985), handlelength=1.4, columnspacing=1.2, handletextpad=0.4
    )
    corners = _emptiest_corners(recording, chosen, view)
    closed_model = model if model is not None and model.dimension == 2 and model.boundary.closed else None
    if closed_model is not None and view[2] - view[0] < OVERVIEW_BELOW * closed_model.size * MM:
        _draw_overview(axes, corners.pop(0), closed_model, view)
    depths = MM * np.linalg.norm(recording.ihip - recording.hip, axis=1)
    # mm: HIP and IHIP would fall into one dot.
    if 0.0 < depths.max() < LENS_BELOW * (view[2] - view[0]):
        # A failed mark deep enough to be seen, else the deepest sample.
        deep_failures = [
            ticks[number] for number in ticks if number in failed and depths[ticks[number]] > 0.3 * depths.max()
        ]
        tick = deep_failures[0] if deep_failures else int(np.argmax(depths))
        _draw_lens(axes, corners.pop(0), recording, body, tick, float(depths.max()))


def refusal_svg(model: Model, position: Sequence[float], *, prefix: str = "f", title: str = "") -> str:
    """Return the outline of a model that a renderer refuses as an SVG element, with a cross at `position` (m)."""
    xmin, ymin, xmax, ymax = (MM * bound for bound in model.boundary.bounds)
    edge = 0.06 * max(xmax - xmin, ymax - ymin)
    with figure(8.0, 2.8, page=True) as fig:
        axes = fig.add_axes((0.08, 0.18, 0.55, 0.77))
        axes.set_aspect("equal")
        view = (xmin - edge, ymin - edge, xmax + edge, ymax + edge)
        draw_geometry(axes, filled_part(model, view), view)
        axes.plot(MM * position[0], MM * position[1], "x", color=colour_of("ihip"), markersize=11, markeredgewidth=2.2)
        axes.set(xlabel="y₁ (mm)", ylabel="y₂ (mm)")
        return page_svg(fig, prefix=prefix, title=title)


def widest_coordinates(hips: Array) -> tuple[int, int]:
    """Return the two coordinates in which the hand moves most, in order.

    `hips` (n, N), m, are the hand's places; coordinates count from 0.
    """
    # A stable sort: of equal ranges the later coordinates are chosen.
    first, second = sorted(np.argsort(np.ptp(hips, axis=0), kind="stable")[-2:].tolist())
    return int(first), int(second)


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


def samples_along_path(recording: Recording, count: int, *, keep: Collection[int] = ()) -> IntArray:
    """Return about `count` samples, evenly spaced by how far HIP and IHIP travel, and `keep` with those before."""
    # (n, 2 N), m: a sample counts as far as HIP and IHIP move together.
    points = np.hstack([recording.hip, recording.ihip])
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    even = np.searchsorted(travelled, np.linspace(0.0, travelled[-1], count))
    # A mark is drawn with the step that leads to it.
    kept_ticks = [tick + offset for tick in keep for offset in (-1, 0)]
    chosen = np.unique(
        np.concatenate([even, [0, len(recording) - 1], np.array(kept_ticks, dtype=int)]).astype(np.int64)
    )
    return chosen[(chosen >= 0) & (chosen < len(recording))]


def _draw_samples(axes: Axes, recording: Recording, chosen: IntArray, *, size: float = 3.0) -> None:
    """Draw the chosen samples: HIPs hollow, IHIPs filled where they touch, and lines between them."""
    hip, ihip = MM * recording.hip[chosen], MM * recording.ihip[chosen]
    touching = recording.contact[chosen]
    # From each HIP to its IHIP, with NaN between the lines.
    rays = np.stack([hip, ihip, np.full_like(hip, np.nan)], axis=1)[touching].reshape(-1, 2)
    dot: dict[str, Any] = {"linestyle": "none", "marker": "o"}
    axes.plot(
        *hip.T, **dot, markersize=size, markerfacecolor="none", markeredgewidth=0.8, color=colour_of("hip"), zorder=3,
        label="HIP",
    )  # fmt: skip
    axes.plot(
        *ihip[touching].T, **dot, markersize=0.85 * size, markeredgewidth=0.0, color=colour_of("ihip"), zorder=4,
        label="IHIP",
    )  # fmt: skip
    axes.plot(*rays.T, color=colour_of("ray"), linewidth=0.7, zorder=2, label="projection")


def _draw_mark(axes: Axes, recording: Recording, tick: int, *, failed: bool) -> None:
    """The marked sample ringed, with the IHIP's way there from the sample before."""
    hip, ihip = MM * recording.hip[tick], MM * recording.ihip[tick]
    style: dict[str, Any] = {"color": colour_of("mark")}
    if tick > 0:
        axes.plot(*(MM * recording.ihip[tick - 1 : tick + 1]).T, linewidth=1.6, zorder=2.5, **style)
    axes.plot(*np.stack([hip, ihip]).T, linewidth=1.2 if failed else 0.8, zorder=2.4, **style)
    edge = 1.3 if failed else 0.8
    axes.plot(*ihip, marker="o", markersize=8.0, markerfacecolor="none", markeredgewidth=edge, zorder=5, **style)


Corner = tuple[float, float]
"""The lower left corner of an inset, as shares of the axes."""


def _emptiest_corners(recording: Recording, chosen: IntArray, view: Box) -> list[Corner]:
    """Places for insets, as shares of the axes, those that hide the fewest points first."""
    points = MM * np.vstack([recording.hip[chosen], recording.ihip[chosen]])
    # From mm to shares of the axes, in which insets are placed.
    share = (points - view[:2]) / (np.array(view[2:]) - view[:2])
    high = 0.985 - INSET_SIDE
    places = [(high, high), (0.015, high), (high, 0.015), (0.015, 0.015)]
    return sorted(
        places, key=lambda place: int(np.sum(np.all((share > place) & (share < np.add(place, INSET_SIDE)), axis=1)))
    )


def _add_inset(axes: Axes, corner: Corner) -> Axes:
    """Add a small picture at a corner of the axes."""
    inset = axes.inset_axes((*corner, INSET_SIDE, INSET_SIDE))
    inset.set(facecolor=colour_of("paper"), xticks=[], yticks=[])
    inset.spines[["top", "right"]].set_visible(True)
    return inset


def _draw_overview(axes: Axes, corner: Corner, model: Model, view: Box) -> None:
    """The whole model, with a rectangle round what the large picture shows of it."""
    from matplotlib.patches import Rectangle

    inset = _add_inset(axes, corner)
    bounds = MM * np.array(model.boundary.bounds)
    model_box = box_round(0.5 * (bounds[:2] + bounds[2:]), 1.15 * (bounds[2:] - bounds[:2]), aspect_of(axes))
    draw_geometry(inset, filled_part(model, model_box), model_box, linewidth=0.8)
    width, height = view[2] - view[0], view[3] - view[1]
    inset.add_patch(
        Rectangle(view[:2], width, height, fill=False, edgecolor=colour_of("ihip"), linewidth=1.0, zorder=3)
    )


def _draw_lens(
    axes: Axes, corner: Corner, recording: Recording, body: Geometry | None, tick: int, depth: float
) -> None:
    """The neighbourhood of one sample, enlarged until its depth can be seen."""
    inset = _add_inset(axes, corner)
    centre = MM * 0.5 * (recording.hip[tick] + recording.ihip[tick])
    box = box_round(centre, np.full(2, 3.2 * depth), aspect_of(axes))
    draw_geometry(inset, body, box)
    points = MM * recording.hip
    # Up to 7 samples in the lens, evenly spaced.
    inside = np.flatnonzero(np.all((points > box[:2]) & (points < box[2:]), axis=1))
    near = inside[np.linspace(0, inside.size - 1, min(7, inside.size)).astype(int)]
    _draw_samples(inset, recording, near.astype(np.int64), size=4.0)
    # How many times larger than in the picture, by widths in mm.
    times = np.ptp(axes.get_xlim()) * INSET_SIDE / (box[2] - box[0])
    paper = {"facecolor": colour_of("paper"), "edgecolor": "none", "pad": 1.0}
    text = f"× {float(f'{times:.2g}'):g}"  # noqa: RUF001
    inset.text(0.05, 0.95, text, va="top", transform=inset.transAxes, zorder=6, bbox=paper)
    axes.indicate_inset(
        (box[0], box[1], box[2] - box[0], box[3] - box[1]), inset, edgecolor=colour_of("quiet"), alpha=1.0
    )
