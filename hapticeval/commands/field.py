"""`hapticeval field`: where a projection leads, and where it jumps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.arguments import ModelName, model_named, model_title, parse_knobs, parse_point
from hapticeval.commands.output import say
from hapticeval.errors import InputError


def field(
    renderer: Annotated[str, typer.Argument(metavar="RENDERER", help="As in `run -r`.", show_default=False)],
    model: ModelName,
    within: Annotated[
        str, typer.Option(metavar="LENGTH", help="How far from a discontinuity the inside is measured.")
    ] = "1mm",
    origin: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="X,Y",
            help="Of a renderer with memory: the surface point nearest to this one, m, is where its tool was.",
            show_default=False,
        ),
    ] = None,
    arc: Annotated[
        float | None,
        typer.Option("--s", metavar="ARC", help="The same by arc length along the model, m.", show_default=False),
    ] = None,
    knobs: Annotated[
        list[str] | None,
        typer.Option("--knob", metavar="NAME=VALUE", help="Set a knob; may be repeated.", show_default=False),
    ] = None,
    cells: Annotated[int, typer.Option(metavar="N", help="Lattice steps along the longer side.", min=20)] = 300,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where picture and numbers go.")
    ] = Path(),
) -> None:
    """Draw where a projection sends the inside of a model, and where it jumps.

    \b
    Examples:
      hapticeval field minimum-distance star
      hapticeval field constraint@curve cassinian --from 0.1,0
      hapticeval field minimum-distance@polygon cassinian --knob vertices=80 -o pictures
      hapticeval field mapping outline.wkt --within 2mm
    """
    from hapticeval.quantity import parse_length
    from hapticeval.reports.fields_figure import caption, write_field
    from hapticeval.study.projection_field.study import study_field

    distance = parse_length(within, option="--within")
    settings = {knob: values[0] for knob, values in parse_knobs(knobs or []).items()}
    shape = model_named(model)
    if origin is not None and arc is not None:
        raise InputError("both --from and --s are given", why="both say where the tool was", todo="give one of them")
    start = None if origin is None else parse_point(origin, 2, option="--from")
    if arc is not None:
        start = shape.curve.position(shape.curve.parameter(arc))
    found, document = study_field(
        renderer, shape, within=distance, name=model_title(model), origin=start, knobs=settings, cells=cells
    )
    written = write_field(directory, found, document)
    say("\n".join([document["title"], caption(document), "", *(f"wrote {path}" for path in written)]))
