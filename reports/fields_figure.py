"""A projection field as a picture, in the manner of thesis Figures 4.5 to 4.8 and 5.14."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.quantity import quantity
from hapticeval.reports.canvas import BOXED, INK, MM, figure, save_figure
from hapticeval.study.projection_field.field import Field
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from shapely.geometry.base import BaseGeometry

COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "model": "#f3f5f7",
        "rests": "#d5dee8",
        "line": "#0072b2",
        "jump": "#d1350f",
        "tool": "#8e3fa8",
    }
)
PAD = 0.03
"""Room around the model, as a share of its size."""

LEFT, PLOT, RIGHT, BELOW, ABOVE = 0.65, 5.5, 0.15, 1.4, 0.35
"""Inches: beside and above the axes, and their width."""

PRECISION = 2e-5
"""How far (m) a drawn line may be from the computed one."""


def write_field(directory: Path, field: Field, document: Mapping[str, Any]) -> list[Path]:
    """Draw a field into `directory`, as SVG and PNG, with its numbers as JSON; return the paths written.

    `document` is `Field.summary`'s with a `title` and the files' `stem`. The same field gives the same files. Raises
    `HapticevalError` where a file cannot be written.
    """
    xmin, ymin, xmax, ymax = field.surface.bounds
    pad = 2.0 * PAD * field.lattice.size
    tall = PLOT * (ymax - ymin + pad) / (xmax - xmin + pad)
    width, height = LEFT + PLOT + RIGHT, BELOW + tall + ABOVE
    with figure(width, height, settings=BOXED) as made:
        axes = made.add_axes((LEFT / width, BELOW / height, PLOT / width, tall / height))
        draw_field(axes, field)
        axes.set_title(document["title"], fontsize=10, color=INK)
        axes.legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.42 / tall), ncols=4, frameon=False, handlelength=1.6,
            borderaxespad=0.0,
        )  # fmt: skip
        made.text(
            0.35 / width, (BELOW - 0.78) / height, caption(document), fontsize=8, color=INK, va="top", linespacing=1.5
        )
        return save_figure(made, directory, document["stem"], document=document)


def caption(summary: Mapping[str, Any]) -> str:
    """Describe the numbers of section 5.1 that the picture cannot show, one per line."""
    singular, amplification = summary["singular"], summary["amplification"]
    if singular["length_m"] > 0.0 or singular["points"]:
        parts = [f"{quantity(singular['length_m'], 'm')} of lines"] if singular["length_m"] > 0.0 else []
        count = len(singular["points"])
        parts += [f"{count} single point{'' if count == 1 else 's'}"] if count else []
        jump = f", jumps up to {quantity(singular['largest_jump_m'], 'm')}" if singular["length_m"] > 0.0 else ""
        near = quantity(singular["within_m"], "m")
        share = f"{100 * singular['share_within']:.3g} % of the inside within {near} of it"
        first = f"Discontinuous: {' and '.join(parts)}{jump}; {share}"
    else:
        first = "No discontinuity found"
    rates = " / ".join(f"{amplification[name]:.3g}" for name in ("median", "p95", "max"))
    second = f"Amplification |dIHIP| / |dHIP|: {rates} (median / 95 % / largest on the lattice)"
    third = []
    if amplification["rest_share"] > 0.0:
        third.append(f"the IHIP rests at a corner in {100 * amplification['rest_share']:.3g} %")
    if summary["contact_share"] < 1.0:
        third.append(f"the tool is free in {100 * (1 - summary['contact_share']):.3g} %")
    lines = [first, second]
    if summary.get("shallow_angle_deg"):
        angles = ", ".join(
            f"{each['median']:.3g} / {each['p95']:.3g} at {quantity(each['depth'], 'm')}"
            for each in summary["shallow_angle_deg"]
        )
        lines.append(f"Error vector against the normal, degrees (median / 95 %): {angles}")
    return "\n".join([*lines, *([f"Of the inside, {' and '.join(third)}"] if third else [])])


def draw_field(axes: Axes, field: Field) -> None:
    """The model, the lines of constant projection, where the IHIP rests, and the singular set, mm."""
    import shapely
    from matplotlib.collections import LineCollection

    outline = MM * field.surface.outline(max(2000, 8 * len(field.surface.corners)))
    axes.fill(outline[:, 0], outline[:, 1], facecolor=COLOURS["model"], edgecolor="none")
    _draw_rests(axes, field)
    lines = [MM * _simple(shapely.LineString(line)) for line in field.lines if len(line) > 1]
    axes.add_collection(LineCollection(lines, colors=COLOURS["line"], linewidths=0.7, label="constant projection"))
    axes.plot(outline[:, 0], outline[:, 1], color=INK, linewidth=1.3, zorder=3)
    jumps = [MM * _simple(part) for part in shapely.get_parts(field.discontinuity) if part.geom_type == "LineString"]
    if jumps:
        axes.add_collection(
            LineCollection(jumps, colors=COLOURS["jump"], linewidths=1.6, zorder=4, label="discontinuity")
        )
    points = MM * field.singular.points
    if len(points):
        axes.plot(
            points[:, 0], points[:, 1], "o", color=COLOURS["jump"], markersize=5, zorder=4, linestyle="none",
            label="single point" if not jumps else None,
        )  # fmt: skip
    if field.start is not None:
        axes.plot(
            *(MM * field.start[:2]), "D", color=COLOURS["tool"], markersize=7, zorder=6, linestyle="none",
            label="previous IHIP",
        )  # fmt: skip
    axes.set_aspect("equal")
    pad = PAD * MM * field.lattice.size
    xmin, ymin, xmax, ymax = (MM * each for each in field.surface.bounds)
    axes.set(xlim=(xmin - pad, xmax + pad), ylim=(ymin - pad, ymax + pad))
    axes.set_xlabel("y₁ (mm)")
    axes.set_ylabel("y₂ (mm)")


def _draw_rests(axes: Axes, field: Field) -> None:
    """A tint where all HIPs go to one corner: there the lines of constant projection are areas."""
    from scipy.ndimage import binary_opening

    resting = binary_opening(field.rests, np.ones((2, 2), dtype=bool))
    if not resting.any():
        return
    lattice = field.lattice
    half = 0.5 * lattice.h
    edges = [MM * np.append(each - half, each[-1] + half) for each in (lattice.x, lattice.y)]
    from matplotlib.colors import ListedColormap

    shown = np.ma.masked_array(np.ones(resting.shape), mask=~resting)
    mesh = axes.pcolormesh(*edges, shown, cmap=ListedColormap([COLOURS["rests"]]), rasterized=True, zorder=1.1)
    mesh.set_clip_path(_outline_patch(axes, field))
    axes.fill([], [], facecolor=COLOURS["rests"], label="rests at a corner")


def _outline_patch(axes: Axes, field: Field) -> Any:
    """The outline as something to clip by."""
    from matplotlib.patches import Polygon

    patch = Polygon(
        MM * field.surface.outline(max(2000, 8 * len(field.surface.corners))),
        closed=True, facecolor="none", edgecolor="none",
    )  # fmt: skip
    axes.add_patch(patch)
    return patch


def _simple(line: BaseGeometry) -> Array:
    import shapely

    return shapely.get_coordinates(shapely.simplify(line, PRECISION))
