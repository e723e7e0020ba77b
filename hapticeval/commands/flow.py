"""`hapticeval flow`: the curve shortening flow of a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.arguments import ModelName, model_named, model_title
from hapticeval.commands.output import say
from hapticeval.errors import RefusalError


def flow(
    model: ModelName,
    velocity: Annotated[
        str, typer.Option(metavar="NAME", help="Velocity function: arc, cap, unit or curvature.")
    ] = "arc",
    cells: Annotated[int, typer.Option(metavar="N", help="Grid cells along the longer side.", min=20)] = 200,
    directory: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where the picture goes.")] = Path(),
) -> None:
    """Draw how a model's outline shrinks to a point, and the grid of levels and lines that this makes.

    A model that the flow cannot map is drawn with a cross where that was seen, and the command ends with 2.

    \b
    Examples:
      hapticeval flow cassinian
      hapticeval flow star --velocity cap
      hapticeval flow dumbbell:neck=0.3 -o pictures
    """
    from hapticeval.geometry.maps.flow import FlowSettings
    from hapticeval.geometry.maps.flow import flow as shrink
    from hapticeval.reports.fields_figure import write_flow

    shape = model_named(model)
    title = f"{velocity} flow of {model_title(model)}"
    try:
        made = shrink(shape, FlowSettings(velocity=velocity, cells=cells))
    except RefusalError as refusal:
        for path in write_flow(directory, shape, None, title=title, cross=refusal.position):
            say(f"wrote {path}")
        raise
    say(
        f"{title}: {len(made.times)} levels, {made.points.shape[1]} lines, "
        f"{1e3 * made.lengths[0]:.4g} mm of outline shrunk to {1e3 * made.lengths[-1]:.3g} mm"
    )
    for path in write_flow(directory, shape, made, title=title):
        say(f"wrote {path}")
