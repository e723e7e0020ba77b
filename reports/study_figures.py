"""Studies as pictures: a projection field (Figures 4.5 to 4.8, 5.14), limits of stability."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.files import file_stem
from hapticeval.quantity import format_quantity, plural
from hapticeval.reports.canvas import BOXED, INK, MM, PALETTE, QUIET, figure, save_figure
from hapticeval.reports.paper import PaperFigure, paper_page
from hapticeval.study.projection_field.field import Field

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon


MARGIN_SHARE = 0.03
"""Room around the model, as a share of its size."""

LEFT, PLOT, RIGHT, ABOVE = 0.65, 5.5, 0.15, 0.35
"""Inches: beside and above the axes, and their width."""

DRAWN_LINE_TOLERANCE = 2e-5
"""How far (m) a drawn line may be from the computed one."""


def write_field(directory: Path, field: Field, document: Mapping[str, Any]) -> list[Path]:
    """Draw a field into `directory`, as SVG and PNG, with its numbers as JSON; return the paths written.

    `document` is `Field.summary`'s with a `title` and the files' `stem`. The same field gives the same files. Raises
    `HapticevalError` where a file cannot be written.
    """
    with model_figure(field.surface, field.lattice.size, document["title"], below=1.4) as (fig, axes, outline):
        _draw_field(axes, field, outline)
        add_legend(fig, 1.4, ncols=4, handlelength=1.6)
        place = (0.35 / fig.get_figwidth(), 0.62 / fig.get_figheight())
        fig.text(*place, caption(document), fontsize=8, color=INK, va="top", linespacing=1.5)
        return save_figure(fig, directory, document["stem"], document=document)


@contextmanager
def model_figure(surface: Any, size: float, title: str, *, below: float) -> Iterator[tuple[Figure, Axes, Polygon]]:
    """A figure with a model in the plane, to scale; `below` (inches) is the room under its axes. Also its outline."""
    xmin, ymin, xmax, ymax = (MM * bound for bound in surface.bounds)
    pad = MARGIN_SHARE * MM * size
    # Inches: as high as the model needs at one scale for both axes.
    plot_height = PLOT * (ymax - ymin + 2.0 * pad) / (xmax - xmin + 2.0 * pad)
    width, height = LEFT + PLOT + RIGHT, below + plot_height + ABOVE
    with figure(width, height, settings=BOXED) as fig:
        axes = fig.add_axes((LEFT / width, below / height, PLOT / width, plot_height / height))
        # Fine enough for round parts, and for every corner of a polygon.
        points = MM * surface.points(max(2000, 8 * len(surface.corners)))
        (outline,) = axes.fill(points[:, 0], points[:, 1], facecolor=PALETTE["model"], edgecolor="none")
        axes.plot(points[:, 0], points[:, 1], color=INK, linewidth=1.3, zorder=3)
        axes.set(aspect="equal", xlabel="y₁ (mm)", ylabel="y₂ (mm)")
        axes.set(xlim=(xmin - pad, xmax + pad), ylim=(ymin - pad, ymax + pad))
        axes.set_title(title, fontsize=10, color=INK)
        yield fig, axes, outline


def add_legend(fig: Figure, below: float, **options: Any) -> None:
    """Put the legend 0.42 inches under axes that stand `below` inches above the figure's edge."""
    place = ((LEFT + 0.5 * PLOT) / fig.get_figwidth(), (below - 0.42) / fig.get_figheight())
    fig.legend(loc="upper center", bbox_to_anchor=place, **options)


def caption(summary: Mapping[str, Any]) -> str:
    """Describe the numbers of section 5.1 that the picture cannot show, one per line."""
    singular, amplification = summary["singular"], summary["amplification"]
    parts, jump = [], ""
    if singular["length_m"] > 0.0:
        parts.append(f"{format_quantity(singular['length_m'], 'm')} of lines")
        # The largest step of the IHIP across the discontinuity.
        jump = f", jumps up to {format_quantity(singular['largest_jump_m'], 'm')}"
    if singular["points"]:
        parts.append(plural(len(singular["points"]), "single point"))
    within = format_quantity(singular["within_m"], "m")
    share = f"{100 * singular['share_within']:.3g} % of the inside within {within} of it"
    lines = [f"Discontinuous: {' and '.join(parts)}{jump}; {share}" if parts else "No discontinuity found"]
    # |dIHIP| / |dHIP|: 1 copies the hand, more amplifies it.
    rates = " / ".join(f"{amplification[name]:.3g}" for name in ("median", "p95", "max"))
    lines.append(f"Amplification |dIHIP| / |dHIP|: {rates} (median / 95 % / largest on the lattice)")
    if summary.get("shallow_angle_deg"):
        angles = ", ".join(
            f"{angle['median']:.3g} / {angle['p95']:.3g} at {format_quantity(angle['depth'], 'm')}"
            for angle in summary["shallow_angle_deg"]
        )
        lines.append(f"Error vector against the normal, degrees (median / 95 %): {angles}")
    inside_words = []
    if amplification["rest_share"] > 0.0:
        inside_words.append(f"the IHIP rests at a corner in {100 * amplification['rest_share']:.3g} %")
    if summary["contact_share"] < 1.0:
        inside_words.append(f"the tool is free in {100 * (1 - summary['contact_share']):.3g} %")
    return "\n".join([*lines, *([f"Of the inside, {' and '.join(inside_words)}"] if inside_words else [])])


def _draw_field(axes: Axes, field: Field, outline: Polygon) -> None:
    """The lines of constant projection, where the IHIP rests, and the singular set, mm."""
    import shapely

    # Areas first, then lines, then the discontinuity over them.
    _draw_rests(axes, field, outline)
    add_lines(axes, [_simplified_line(shapely.LineString(line)) for line in field.lines if len(line) > 1], "line",
           "constant projection")  # fmt: skip
    jumps = [
        _simplified_line(part) for part in shapely.get_parts(field.discontinuity) if part.geom_type == "LineString"
    ]
    if jumps:
        add_lines(axes, jumps, "jump", "discontinuity", linewidths=1.6, zorder=4)
    points = MM * field.singular.points
    if len(points):
        # The legend names the discontinuity once.
        label = "single point" if not jumps else None
        axes.plot(*points.T[:2], "o", color=PALETTE["jump"], markersize=5, zorder=4, label=label)
    if field.start is not None:
        place = MM * field.start[:2]
        axes.plot(*place, "D", color=PALETTE["tool"], markersize=7, zorder=6, linestyle="none", label="previous IHIP")


def add_lines(axes: Axes, lines: Any, colour: str, label: str, *, linewidths: float = 0.7, **style: Any) -> None:
    """Draw lines, a sequence of arrays (n, 2), mm, in a colour of the palette, named once in the legend."""
    from matplotlib.collections import LineCollection

    axes.add_collection(LineCollection(lines, colors=PALETTE[colour], linewidths=linewidths, label=label, **style))


def _draw_rests(axes: Axes, field: Field, outline: Polygon) -> None:
    """A tint where all HIPs go to one corner: there the lines of constant projection are areas."""
    from matplotlib.colors import ListedColormap
    from scipy.ndimage import binary_opening

    # Without what is narrower than two lattice steps, which is noise of the sampling.
    resting = binary_opening(field.rests, np.ones((2, 2), dtype=bool))
    if not resting.any():
        return
    # Masked cells stay transparent.
    tint = np.ma.masked_array(np.ones(resting.shape), mask=~resting)
    colours = ListedColormap([PALETTE["rests"]])
    x, y = MM * field.lattice.x, MM * field.lattice.y
    mesh = axes.pcolormesh(x, y, tint, shading="nearest", cmap=colours, rasterized=True, zorder=1.1)
    mesh.set_clip_path(outline)
    axes.fill([], [], facecolor=PALETTE["rests"], label="rests at a corner")


def _simplified_line(line: Any) -> Any:
    import shapely

    return MM * shapely.get_coordinates(shapely.simplify(line, DRAWN_LINE_TOLERANCE))


SAMPLING_TIME_COLOURS = ("#56b4e9", "#0072b2", "#1c1f23", "#d55e00")
"""One colour per sampling time, from the shortest."""

GIL, ABBOTT = "(b + B) / (T / 2 + d), Gil 2009", "min(2b/T, 2f_c/Δ), Abbott 2005"
"""Closed forms in print, as legends have them; `_explain_letters` says what their letters are."""


def paper_limits(
    document: Mapping[str, Any],
    *,
    width: str | None = None,
    height: str | None = None,
    font_size: float | None = None,
) -> PaperFigure:
    """Draw the document of `study_limits` for a paper: its panels below each other. Raises as `paper_page` does."""
    panels = _panels(document)
    with paper_page(width, height, font_size, natural=lambda across: 0.8 * across * len(panels)) as fig:
        for axes, draw in zip(fig.subplots(len(panels), 1, squeeze=False)[:, 0], panels, strict=True):
            draw(axes, document)
            axes.legend(loc="upper right" if draw is _draw_workspace else "best", handlelength=1.6, labelspacing=0.3)
        _explain_letters(fig)
        return fig


def _panels(document: Mapping[str, Any]) -> list[Callable[[Axes, Mapping[str, Any]], None]]:
    return [_draw_z_width, _draw_delay, *([_draw_workspace] if document["workspace"] else [])]


def write_limits(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """Draw the document of `study_limits` into `directory` as SVG and PNG, with the numbers as JSON.

    Return the paths written. Raises `HapticevalError` where a file cannot be written.
    """
    case = document["scene"].rpartition("/")[2]
    panels = [
        _draw_z_width,
        _draw_delay,
        *([_draw_friction] if document["friction"] else []),
        *([_draw_workspace] if document["workspace"] else []),
    ]
    # Four panels stand in two rows: side by side their text would be small on a page.
    rows = 2 if len(panels) > 3 else 1
    columns = -(-len(panels) // rows)
    with figure(4.6 * columns, 4.4 * rows, layout="constrained") as fig:
        for axes, draw in zip(fig.subplots(rows, columns, squeeze=False).flat, panels, strict=True):
            draw(axes, document)
            axes.legend(fontsize=8, loc="upper right" if draw is _draw_workspace else "best")
        _explain_letters(fig)
        title = f"Stable stiffness: {document['scene']}, {document['renderer']} on {document['device']}"
        fig.suptitle(title, fontsize=11, color=INK)
        return save_figure(fig, directory, file_stem(f"limits-{case}-{document['device']}"), document=document)


def _explain_letters(fig: Figure) -> None:
    """Say in small text under the panels what the letters of the closed forms in their legends are."""
    labels = {text.get_text() for axes in fig.axes if axes.legend_ for text in axes.legend_.get_texts()}
    meanings = []
    if GIL in labels:
        meanings += ["b: damping of the robot along the normal, B: of the renderer", "T: sampling time", "d: delay"]
    elif ABBOTT in labels:
        meanings += ["b: damping of the robot along the normal", "T: sampling time"]
    if ABBOTT in labels:
        meanings.append("f_c: Coulomb friction, Δ: a count of the encoders, both at the hand")
    if meanings:
        from matplotlib import rcParams

        # Letters are about half as wide as high: with a fifth more no line is longer than the figure.
        line_capacity = int(72.0 * fig.get_figwidth() / (0.6 * rcParams["font.size"]))
        fig.supxlabel(textwrap.fill("; ".join(meanings), line_capacity), fontsize=rcParams["font.size"], color=QUIET)


def _draw_z_width(axes: Axes, document: Mapping[str, Any]) -> None:
    """K over B for several T: stable below the solid line, passive below the dashed one."""
    passive: dict[str, Any] = {"linestyle": "--", "linewidth": 1.0}
    for colour, curve in zip(SAMPLING_TIME_COLOURS, document["width"], strict=True):
        label = f"T = {1e3 * curve['sampling_time']:.3g} ms"
        axes.plot(curve["damping"], _thousands(curve["eigenvalues"]), color=colour, label=label)
        axes.plot(curve["damping"], _thousands(curve["passive"]), color=colour, **passive)
    if document["passive"] is not None:
        axes.plot([], [], color=QUIET, label="passive", **passive)
    place = [document["damping"]], [1e-3 * document["stiffness"]]
    axes.plot(*place, "o", color=PALETTE["jump"], label="the scene", zorder=5, clip_on=False)
    # kN/m: linear below, so that zero stiffness has a place.
    axes.set_yscale("symlog", linthresh=0.1)
    axes.set_ylim(bottom=0.0)
    # N s/m: linear up to the first damping above zero.
    axes.set_xscale("symlog", linthresh=document["width"][-1]["damping"][1])
    axes.set_xlim(left=0.0)
    axes.set_xticks([0.0, *(10.0**power for power in range(-2, 4))])
    axes.set(xlabel="damping B (N s/m)", ylabel="stiffness K (kN/m)", title="Z-width: stable below the line")


def _draw_delay(axes: Axes, document: Mapping[str, Any]) -> None:
    """K over the delay. Wide under narrow and broken, and not clipped: where both are zero they lie on the axis."""
    curve = document["delay"]
    # ms and kN/m.
    delay, limit = 1e3 * np.array(curve["delay"]), _thousands(curve["eigenvalues"])
    formula = curve["closed_form"]
    # Points where a formula in print is the line, else a line of its own.
    look: dict[str, Any] = {"linewidth": 3.5} if formula is None else {"marker": "o", "linestyle": "none"}
    label = f"stable{_ratio_words(curve['eigenvalues'], formula)}"
    axes.plot(delay, limit, color=SAMPLING_TIME_COLOURS[0], label=label, clip_on=False, **look)
    axes.axhline(1e-3 * document["stiffness"], color=PALETTE["jump"], linewidth=1.0, linestyle="-.", label="the scene")
    if document["passive"] is not None:
        style: dict[str, Any] = {"color": SAMPLING_TIME_COLOURS[2], "linestyle": "--", "linewidth": 1.2}
        axes.plot(delay, _thousands(curve["passive"]), label="passive", clip_on=False, **style)
    if formula is not None:
        axes.plot(delay, _thousands(formula), color=INK, linewidth=1.2, label=GIL)
    # None stands for no limit: any stiffness is stable.
    if not any(value is None or value > 0.0 for value in curve["eigenvalues"]):
        axes.text(0.5, 0.5, "no stiffness is stable at any delay", transform=axes.transAxes, ha="center")
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(left=0.0)
    axes.set(xlabel="computation delay (ms)", ylabel="stiffness K (kN/m)", title="Delay")


def _draw_friction(axes: Axes, document: Mapping[str, Any]) -> None:
    """K over the joint friction: the closed form as a line; as points the worst hand, and the loop let go."""
    curve = document["friction"]
    unit, scale = ("mN m", 1e3) if document["turning"] else ("N", 1.0)
    friction = scale * np.array(curve["joint_friction"])
    # Straight between its values, one of which is the corner: drawn finely, for the axis is none of equal steps.
    fine = np.linspace(0.0, friction[-1], 500)
    line = np.interp(fine, friction, _thousands(curve["closed_form"]))
    axes.plot(fine, line, color=INK, label=ABBOTT)
    points: dict[str, Any] = {"linestyle": "none", "clip_on": False}
    label = f"passive with the worst hand tried{_ratio_words(curve['worst_hand'], curve['closed_form'])}"
    axes.plot(friction, _thousands(curve["worst_hand"]), "o", **points, label=label)
    label = f"comes to rest without a hand{_ratio_words(curve['let_go'], curve['closed_form'])}"
    axes.plot(friction, _thousands(curve["let_go"]), "^", **points, label=label)
    # kN/m: linear below, so that zero stiffness has a place.
    axes.set_yscale("symlog", linthresh=0.1)
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(left=0.0)
    axes.set(
        xlabel=f"Coulomb friction of each joint ({unit})", ylabel="stiffness K (kN/m)", title="Encoders and friction"
    )


def _draw_workspace(axes: Axes, document: Mapping[str, Any]) -> None:
    """The limit at each pose, at a wall that faces the worst direction there."""
    workspace = document["workspace"]
    first, second = (1e3 * np.array(workspace[name]) for name in ("first", "second"))
    limits = np.array([_thousands(row) for row in workspace["eigenvalues"]])
    mesh = axes.pcolormesh(first, second, limits, cmap="cividis", shading="nearest", rasterized=True)
    axes.figure.colorbar(mesh, ax=axes, shrink=0.85, label="stiffness K (kN/m)")
    point = 1e3 * np.array(document["point"])
    # The first and the last coordinate: in space the plane is the linkage's.
    axes.plot([point[0]], [point[-1]], "o", color=PALETTE["jump"], label="the place", zorder=5)
    names = [f"y{'₀₁₂₃'[int(name[1:])]} (mm)" for name in workspace["axes"]]
    axes.set(xlabel=names[0], ylabel=names[1], title="Workspace, worst wall direction", aspect="equal")


def _ratio_words(limits: Sequence[float | None], formula: Sequence[float] | None) -> str:
    """Return over which range limits lie as multiples of a formula in print; nothing where neither is above zero."""
    ratios = [limit / line for limit, line in zip(limits, formula or (), strict=False) if limit and line]
    return f": {min(ratios):.4g} to {max(ratios):.4g} times the formula" if ratios else ""


def _thousands(values: Sequence[float | None]) -> list[float]:
    return [np.nan if value is None else 1e-3 * value for value in values]
