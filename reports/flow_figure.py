"""Pictures of a flow (Figures 5.3 to 5.13): the levels of a shrinking outline and the lines across them."""

from __future__ import annotations

import re
from pathlib import Path

from hapticeval.files import file_stem
from hapticeval.geometry.maps.flow import Flow
from hapticeval.geometry.model import Model
from hapticeval.reports.canvas import BOXED, INK, MM, figure, save_figure
from hapticeval.reports.fields_figure import COLOURS

EVERY_LEVEL = 4
EVERY_LINE = 8


def write_flow(
    directory: Path, model: Model, flow: Flow | None, *, title: str, cross: tuple[float, ...] | None = None
) -> list[Path]:
    """Draw a flow into `directory` as SVG and PNG; the paths written.

    Without a flow the outline alone, with a `cross` (m) where the flow failed. Raises `HapticevalError` where a file
    cannot be written.
    """
    from matplotlib.collections import LineCollection

    xmin, ymin, xmax, ymax = (MM * bound for bound in model.boundary.bounds)
    pad = 0.03 * max(xmax - xmin, ymax - ymin)
    tall = 5.5 * (ymax - ymin + 2 * pad) / (xmax - xmin + 2 * pad)
    with figure(6.3, tall + 1.3, settings=BOXED) as made:
        axes = made.add_axes((0.65 / 6.3, 0.85 / (tall + 1.3), 5.5 / 6.3, tall / (tall + 1.3)))
        outline = MM * model.boundary.points(max(2000, 8 * len(model.boundary.corners)))
        axes.fill(outline[:, 0], outline[:, 1], facecolor=COLOURS["model"], edgecolor="none")
        axes.plot(outline[:, 0], outline[:, 1], color=INK, linewidth=1.3, zorder=3)
        if flow is not None:
            points = MM * flow.points
            levels = [[*level, level[0]] for level in points[EVERY_LEVEL::EVERY_LEVEL]]
            lines = [points[:, k] for k in range(0, points.shape[1], EVERY_LINE)]
            axes.add_collection(LineCollection(levels, colors=COLOURS["tool"], linewidths=0.7, label="levels"))
            axes.add_collection(
                LineCollection(lines, colors=COLOURS["line"], linewidths=0.7, label="transversal lines")
            )
        if cross is not None:
            axes.plot(
                [MM * cross[0]], [MM * cross[1]], "x", color=COLOURS["jump"], markersize=12, markeredgewidth=2.4,
                label="no map: here", zorder=5,
            )  # fmt: skip
        axes.set_aspect("equal")
        axes.set(xlim=(xmin - pad, xmax + pad), ylim=(ymin - pad, ymax + pad))
        axes.set_xlabel("y₁ (mm)")
        axes.set_ylabel("y₂ (mm)")
        axes.set_title(title, fontsize=10, color=INK)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.42 / tall), ncols=3, frameon=False)
        return save_figure(made, directory, "flow-" + file_stem(re.sub(r"[ :=,]+", "-", title)))
