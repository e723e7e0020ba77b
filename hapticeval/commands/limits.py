"""`hapticeval limits`: how stiff a scene may be on its device before the sampled loop loses stability."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hapticeval.commands.arguments import parse_point
from hapticeval.commands.output import say
from hapticeval.errors import InputError

if TYPE_CHECKING:
    from hapticeval.suite.case import Case

EXIT_CODES = """\b
Exit codes:
  0  the scene's own stiffness is stable
  1  it is not
  2  wrong usage or input
  3  the renderer broke
"""


def limits(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="SUITE/CASE, as in `hapticeval list cases`, or FILE.toml/CASE.",
            show_default=False,
        ),
    ],
    renderer: Annotated[
        str, typer.Option("-r", "--renderer", metavar="NAME", help="As in `run -r`.")
    ] = "minimum-distance+pp-pd",
    device: Annotated[
        str | None,
        typer.Option(
            metavar="KIND[:NAME=VALUE,...]",
            help="Another device than the scene's: parallelogram-2dof, ...",
            show_default=False,
        ),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="Y1,Y2[,Y3]",
            help="The surface point nearest to this one, m; without it, to where the case starts.",
            show_default=False,
        ),
    ] = None,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where picture and numbers go.")
    ] = Path(),
) -> None:
    """Find the largest stiffness that stays stable, and what it depends on.

    The bound (2.40), the eigenvalues of the sampled loop, and the loop itself, run without encoders, torque limits and
    friction. The picture shows the limit over damping and sampling time (Z-width), delay and the workspace.

    \b
    Examples:
      hapticeval limits thesis/plane-press --device parallelogram-2dof
      hapticeval limits dynamics-circle/circle-robot -r minimum-distance+pp-v -o pictures
      hapticeval limits mysuite.toml/mycase --at 0.05,0.02
    """
    import numpy as np

    from hapticeval.commands.listing import columns
    from hapticeval.commands.terminal import Terminal
    from hapticeval.devices.catalogue import device_named
    from hapticeval.discovery import resolve
    from hapticeval.reports.limits_figure import write_limits
    from hapticeval.stimulus.stimulus import Path as HandPath
    from hapticeval.study.limits.loop import Place
    from hapticeval.study.limits.study import study_limits
    from hapticeval.study.limits.text import describe

    case = _case(scene)
    built = case.build_scene()
    if device is not None:
        built = replace(built, device=device_named(device))
    if at is None:
        stimulus = case.build_stimulus(built, None)
        point = stimulus.points[0] if isinstance(stimulus, HandPath) else stimulus.position
    else:
        point = parse_point(at, built.model.dimension, option="--at")
    frame = built.model.boundary.frame(np.asarray(point)[None])
    place = Place(frame.foot[0], frame.normal[0])
    with Terminal() as terminal:
        document = study_limits(resolve(renderer), built, place, terminal.working)
    document = {"scene": scene, "renderer": renderer, **document}
    written = write_limits(directory, document)
    say("\n".join([columns(describe(document)), "", *(f"wrote {path}" for path in written)]))
    raise typer.Exit(int(document["growth"] >= 1.0))


def _case(scene: str) -> Case:
    from hapticeval.suite.reading import load_suite

    suite, slash, name = scene.rpartition("/")
    if not slash:
        raise InputError(
            f"'{scene}' names no case", why="a scene is named SUITE/CASE", todo="see hapticeval list cases"
        )
    return load_suite(suite).case(name)
