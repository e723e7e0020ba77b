"""Draw how a model's outline shrinks to a point by curve shortening flow (Figures 5.3 to 5.13).

Run it as `python -m hapticeval.examples.studies.flow cassinian -o pictures`. The mapping renderer's grid is made of it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from hapticeval.cli import run_program
from hapticeval.commands.arguments import Folder, ModelName, model_named, model_title
from hapticeval.commands.draw import DRAW_CODES
from hapticeval.commands.terminal import lines, say, wrote_lines
from hapticeval.errors import RefusalError
from hapticeval.files import file_stem
from hapticeval.geometry.model import Model
from hapticeval.renderers.maps.flow import Flow, FlowSettings, run_flow
from hapticeval.reports.canvas import MM, PALETTE, save_figure
from hapticeval.reports.study_figures import add_legend, add_lines, model_figure

LEVEL_STRIDE, LINE_STRIDE = 4, 8
"""Of a flow's levels and lines, those that are drawn."""


def flow(
    model: ModelName,
    velocity: Annotated[
        str, typer.Option(metavar="NAME", help="Velocity function: arc, cap, unit or curvature.")
    ] = "arc",
    cells: Annotated[int, typer.Option(metavar="N", help="Grid cells along the longer side.", min=20)] = 200,
    directory: Folder = Path(),
) -> None:
    """Draw how a model's outline shrinks to a point, and the grid of levels and lines that this makes.

    A model that the flow cannot map is drawn with a cross where that was seen, and the command ends with 2.

    \b
    Examples:
      python -m hapticeval.examples.studies.flow cassinian
      python -m hapticeval.examples.studies.flow star --velocity cap
      python -m hapticeval.examples.studies.flow dumbbell:neck=0.3 -o pictures
    """
    shape = model_named(model)
    title = f"{velocity} flow of {model_title(model)}"
    try:
        levels = run_flow(shape, FlowSettings(velocity=velocity, cells=cells))
    except RefusalError as refusal:
        if refusal.position is None:  # there is no outline that shrinks, as of a line
            raise
        say(wrote_lines(write_flow(directory, shape, None, title=title, cross=refusal.position)))
        raise
    size_words = (
        f"{title}: {len(levels.times)} levels, {levels.points.shape[1]} lines, "
        f"{1e3 * levels.lengths[0]:.4g} mm of outline shrunk to {1e3 * levels.lengths[-1]:.3g} mm"
    )
    say(lines([size_words, wrote_lines(write_flow(directory, shape, levels, title=title))]))


def write_flow(
    directory: Path, model: Model, flow: Flow | None, *, title: str, cross: tuple[float, ...] | None = None
) -> list[Path]:
    """Draw a flow's levels and lines into `directory` as SVG and PNG, its numbers as JSON; return the paths written.

    Without a flow the outline alone, with a `cross` (m) where the flow failed. Raises `HapticevalError` where a file
    cannot be written.
    """
    xmin, ymin, xmax, ymax = model.boundary.bounds
    with model_figure(model.boundary, max(xmax - xmin, ymax - ymin), title, below=0.85) as (fig, axes, _):
        if flow is not None:
            points = MM * flow.points
            # Every fourth level, closed on its first point.
            levels = [[*level, level[0]] for level in points[LEVEL_STRIDE::LEVEL_STRIDE]]
            add_lines(axes, levels, "tool", "levels")
            add_lines(axes, [points[:, k] for k in range(0, points.shape[1], LINE_STRIDE)], "line", "transversal lines")
        if cross is not None:
            axes.plot(
                [MM * cross[0]], [MM * cross[1]], "x", color=PALETTE["jump"], markersize=12, markeredgewidth=2.4,
                label="no map: here", zorder=5,
            )  # fmt: skip
        add_legend(fig, 0.85, ncols=3)
        # m: a flow by the curvature alone leaves the model where that is concave (Figure 5.4)
        document = (
            None
            if flow is None
            else {"title": title, "outside_m": float(model.boundary.signed_distance(flow.points.reshape(-1, 2)).max())}
        )
        return save_figure(fig, directory, "flow-" + file_stem(re.sub(r"[ :=,]+", "-", title)), document=document)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code."""
    return run_program(flow, DRAW_CODES, arguments)


if __name__ == "__main__":
    sys.exit(main())
