"""`hapticeval limits`: how stiff a scene may be on its device before the sampled loop loses stability."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.output import say

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

    from hapticeval.devices.catalogue import device_named
    from hapticeval.discovery import resolve
    from hapticeval.limits.linear import Place
    from hapticeval.limits.study import study
    from hapticeval.reports.limits_figure import write_limits
    from hapticeval.stimulus import Path as HandPath
    from hapticeval.terminal import Terminal

    case = _case(scene)
    built = case.build_scene()
    if device is not None:
        built = replace(built, device=device_named(device))
    if at is None:
        stimulus = case.build_stimulus(built, None)
        point = stimulus.points[0] if isinstance(stimulus, HandPath) else stimulus.position
    else:
        point = _point(at, built.model.dimension)
    frame = built.model.boundary.frame(np.asarray(point)[None])
    place = Place(frame.foot[0], frame.normal[0])
    with Terminal() as terminal:
        document = study(resolve(renderer), built, place, terminal.working)
    document = {"scene": scene, "renderer": renderer, **document}
    written = write_limits(directory, document)
    say("\n".join([told(document), "", *(f"wrote {path}" for path in written)]))
    raise typer.Exit(int(document["growth"] >= 1.0))


def told(document: Mapping[str, Any]) -> str:
    """The limits at the place as a table, and what follows for the scene's own stiffness."""
    from hapticeval.listing import columns

    place = ", ".join(f"{1e3 * value:.4g}" for value in document["point"])
    normal = ", ".join(f"{value:.3g}" for value in document["normal"])
    rows = [
        ("scene", f"{document['scene']}, {document['renderer']}, K = {document['stiffness']:.6g} N/m, "
                  f"B = {document['damping']:.4g} N s/m, T = {1e3 * document['sampling_time']:.4g} ms"),
        ("device", f"{document['device']}, {document['inner_loop']} inner loop, at ({place}) mm, "
                   f"wall facing ({normal})"),
        ("", ""),
        ("bound (2.40)", _bound(document)),
        ("eigenvalues", f"{_stiffness(document['eigenvalues'])}  of the sampled loop, without a hand"),
        ("simulation", f"{_stiffness(document['simulated'])}  the sampled loop itself, run and bisected"),
        *([("", why_none(document))] if document["eigenvalues"] == 0.0 else []),
        ("", ""),
        ("the scene", verdict(document)),
    ]  # fmt: skip
    return columns(rows)


def why_none(document: Mapping[str, Any]) -> str:
    """Why no stiffness is stable."""
    if document["port_damping"] == 0.0 and document["damping"] == 0.0 and document["inner_loop"] == "static":
        return (
            "no stiffness is stable: a spring held over a step gives back more than it took, and neither device nor "
            "renderer has damping to take it up (2.40)"
        )
    return "no stiffness is stable with this damping, sampling time and delay"


def verdict(document: Mapping[str, Any]) -> str:
    """What the limits mean for the stiffness that the scene asks for."""
    stiffness, growth = document["stiffness"], document["growth"]
    dt = document["sampling_time"]
    parts = []
    passive = document["passive"]
    if passive is None:
        parts.append("the bound (2.40) says nothing about it")
    elif stiffness > passive:
        parts.append(f"its {stiffness:.4g} N/m exceed the bound (2.40) of {passive:.4g} N/m")
    else:
        parts.append(f"its {stiffness:.4g} N/m are within the bound (2.40)")
    if growth >= 1.0:
        parts.append(
            f"without a hand the loop is unstable: it grows by {100 * (growth - 1.0):.3g} % a tick, "
            f"tenfold in {_seconds(growth, dt)}"
        )
    else:
        parts.append(f"without a hand the loop settles, to a tenth in {_seconds(growth, dt)}")
    return "; ".join(parts)


def _seconds(growth: float, dt: float) -> str:
    from math import log

    return f"{dt * log(10.0) / abs(log(growth)):.3g} s" if growth not in (0.0, 1.0) else "no time to speak of"


def _bound(document: Mapping[str, Any]) -> str:
    if document["passive"] is None:
        return f"none: a {document['inner_loop']} inner loop compensates the damping that it counts on"
    b = document["port_damping"]
    formula = f"2 (b - |B|) / (T + 2 delay) with b = {b:.4g} N s/m"
    return f"{_stiffness(document['passive'])}  {formula}, sufficient with any passive hand"


def _stiffness(value: float | None) -> str:
    return "no limit found  " if value is None else f"{value:11.1f} N/m"


def _case(scene: str) -> Case:
    from hapticeval.suite.reading import load_suite

    suite, slash, name = scene.rpartition("/")
    if not slash:
        raise InputError(
            f"'{scene}' names no case", why="a scene is named SUITE/CASE", todo="see hapticeval list cases"
        )
    cases = {case.name: case for case in load_suite(suite).cases}
    if name not in cases:
        raise UnknownNameError(f"case of {suite}", name, cases)
    return cases[name]


def _point(text: str, dimension: int) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != dimension:
        raise InputError(
            f"--at {text}", why=f"it must be {dimension} numbers in metres", todo="for example --at 0.05,0.02"
        )
    return numbers
