"""The commands that study and draw: fields and limits of stability."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.arguments import (
    Folder,
    ModelName,
    argument,
    model_named,
    model_title,
    option,
    parse_knobs,
    parse_point,
)
from hapticeval.commands.terminal import Terminal, columns, lines, paragraphs, say, wrote_lines
from hapticeval.errors import InputError

DRAW_CODES = """\b
Exit codes:
  0  measured and drawn
  2  wrong usage or input: the message says what, why, and what to do
"""

LIMITS_CODES = """\b
Exit codes:
  0  the scene's own stiffness is stable
  1  it is not
  2  wrong usage or input
  3  the renderer broke
"""


def field(
    renderer: Annotated[str, argument(metavar="RENDERER", help="As in `run -r`.")],
    model: ModelName,
    within: Annotated[
        str, typer.Option(metavar="LENGTH", help="How far from a discontinuity the inside is measured.")
    ] = "1mm",
    origin: Annotated[
        str | None,
        option(
            "--from",
            metavar="X,Y",
            help="Of a renderer with memory: the surface point nearest to this one, m, is where its tool was.",
        ),
    ] = None,
    arc: Annotated[
        float | None, option("--s", metavar="ARC", help="The same by arc length along the model, m.")
    ] = None,
    knobs: Annotated[
        list[str] | None, option("--knob", metavar="NAME=VALUE", help="Set a knob; may be repeated.")
    ] = None,
    cells: Annotated[int, typer.Option(metavar="N", help="Lattice steps along the longer side.", min=20)] = 300,
    directory: Folder = Path(),
) -> None:
    """Draw where a projection sends the inside of a model, and where it jumps.

    \b
    Examples:
      hapticeval study field minimum-distance star
      hapticeval study field constraint@curve cassinian --from 0.1,0
      hapticeval study field minimum-distance@polygon cassinian --knob vertices=80 -o pictures
      hapticeval study field mapping outline.wkt --within 2mm
    """
    from hapticeval.quantity import parse_length
    from hapticeval.reports.study_figures import caption, write_field
    from hapticeval.study.projection_field.study import study_field

    distance = parse_length(within, option="--within")
    # parse_knobs takes lists for sweeps: a picture has one value of each.
    settings = {knob: values[0] for knob, values in parse_knobs(knobs or []).items()}
    shape = model_named(model)
    if origin is not None and arc is not None:
        raise InputError("both --from and --s are given", why="both say where the tool was", todo="give one of them")
    start = None if origin is None else parse_point(origin, 2, option="--from")
    if arc is not None:
        start = shape.curve.position(shape.curve.parameter(arc))
    projection_field, document = study_field(
        renderer, shape, within=distance, name=model_title(model), origin=start, knobs=settings, cells=cells
    )
    written = write_field(directory, projection_field, document)
    say(paragraphs(lines([document["title"], caption(document)]), wrote_lines(written)))


def limits(
    scene: Annotated[
        str,
        argument(metavar="SCENE", help="SUITE/CASE, as in `hapticeval list cases`, or FILE.toml/CASE."),
    ],
    renderer: Annotated[
        str, typer.Option("-r", "--renderer", metavar="NAME", help="As in `run -r`.")
    ] = "minimum-distance+pp-pd",
    device: Annotated[
        str | None,
        option(metavar="KIND[:NAME=VALUE,...]", help="Another device than the scene's: parallelogram-2dof, ..."),
    ] = None,
    at: Annotated[
        str | None,
        option(
            metavar="Y1,Y2[,Y3]", help="The surface point nearest to this one, m; without it, to where the case starts."
        ),
    ] = None,
    directory: Folder = Path(),
) -> None:
    """Find the largest stiffness that stays stable, and what it depends on.

    The bound (2.40), the eigenvalues of the sampled loop, and the loop itself, run without encoders, torque limits and
    friction; then limits that are in print in closed form, with encoders and friction. The picture shows the limit
    over damping and sampling time (Z-width), delay, friction and the workspace.

    \b
    Examples:
      hapticeval study limits thesis/plane-press --device parallelogram-2dof
      hapticeval study limits dynamics-circle/circle-robot -r minimum-distance+pp-v -o pictures
      hapticeval study limits mysuite.toml/mycase --at 0.05,0.02
    """
    import numpy as np

    from hapticeval.devices.catalogue import device_named
    from hapticeval.discovery import resolve
    from hapticeval.reports.study_figures import write_limits
    from hapticeval.stimulus.stimulus import Path as HandPath
    from hapticeval.study.limits.loop import Place
    from hapticeval.study.limits.study import describe, study_limits
    from hapticeval.suite.reading import case_named

    case = case_named(scene)
    built = case.build_scene()
    if device is not None:
        built = replace(built, device=device_named(device))
    if at is None:
        stimulus = case.build_stimulus(built, None)
        # m: where a given path begins, or where the closed loop starts.
        point = stimulus.points[0] if isinstance(stimulus, HandPath) else stimulus.position
    else:
        point = parse_point(at, built.model.dimension, option="--at")
    # The wall of the loop is the tangent plane at the foot of that point.
    frame = built.model.boundary.closest_point(np.asarray(point)[None])
    place = Place(frame.foot[0], frame.normal[0])
    with Terminal() as terminal:
        document = study_limits(resolve(renderer), built, place, terminal.working)
    document = {"scene": scene, "renderer": renderer, **document}
    written = write_limits(directory, document)
    say(paragraphs(columns(describe(document)), wrote_lines(written)))
    # The largest eigenvalue's size in the sampled loop: below 1 it dies out.
    raise typer.Exit(int(document["growth"] >= 1.0))
