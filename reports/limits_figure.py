"""The stability limits of a scene as a picture: Z-width, delay, and the workspace."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.files import file_stem
from hapticeval.reports.canvas import INK, PALETTE, QUIET, figure, save_figure
from hapticeval.reports.paper_figure import PaperFigure, paper_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
