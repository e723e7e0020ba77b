"""The commands that study and draw: fields, devices, limits of stability, integrators."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    renderers_option,
)
from hapticeval.commands.terminal import Terminal, columns, lines, paragraphs, say, wrote_lines
from hapticeval.errors import InputError

if TYPE_CHECKING:
    from hapticeval.devices.criteria import Criteria, Peak, Spread
    from hapticeval.devices.device import Device
    from hapticeval.types import Array

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

SPREAD_ROWS = {
    "lightest": ("lightest direction", "kg", 1.0),
    "heaviest": ("heaviest direction", "kg", 1.0),
    "anisotropy": ("anisotropy", "", 1.0),
    "damping": ("least damping", "N s/m", 1.0),
    "stiffest": ("least bound (2.40)", "N/m", 1.0),
    "resolution": ("coarsest coordinate", "µm", 1e6),
    "force": ("force in every direction", "N", 1.0),
    "acceleration": ("acceleration in every direction", "m/s²", 1.0),
    "manipulability": ("manipulability", "", 1.0),
}
"""How the criteria over the workspace are shown: name, unit, and how many of it make the SI unit."""


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
    from hapticeval.reports.fields_figure import caption, write_field
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


def device(
    name: Annotated[
        str,
        argument(
            metavar="DEVICE",
            help="As in parallelogram-2dof, parallelogram-3dof:dynamics=printed or point-mass:mass=0.1.",
        ),
    ],
    at: Annotated[
        str | None, option("--at", metavar="Y1,Y2[,Y3]", help="Where the hand is, m; at home if not given.")
    ] = None,
    torque: Annotated[
        float | None,
        option(
            metavar="TAU",
            help="Peak torque of each motor, N m (of a point mass its force, N); the robot's has 0.368 of its own.",
        ),
    ] = None,
    directory: Folder = Path(),
) -> None:
    """Show what the hand feels of a device, and draw where it reaches.

    \b
    Examples:
      hapticeval study device parallelogram-2dof
      hapticeval study device parallelogram-3dof --at 0.1,0.05,-0.05 -o pictures
      hapticeval study device parallelogram-3dof:base_inertia=cos,b1=0.4
    """
    import numpy as np

    from hapticeval.devices.catalogue import device_named
    from hapticeval.devices.criteria import MOTOR_TORQUE, criteria, over_workspace
    from hapticeval.devices.parallelogram import Parallelogram
    from hapticeval.devices.point_mass import PointMass
    from hapticeval.reports.device_figure import write_device

    robot = device_named(name)
    # N m; a point mass has no motors, and without a number no limit.
    limit = MOTOR_TORQUE if torque is None and not isinstance(robot, PointMass) else torque
    place = np.zeros(robot.dimension) if at is None else parse_point(at, robot.dimension, option="--at")
    joints = robot.joints(place)
    measured = criteria(robot, joints, torque_limit=limit)
    parts = [columns(_criteria_rows(robot, measured, limit))]
    if isinstance(robot, Parallelogram):
        parts.append(_workspace_table(over_workspace(robot, torque_limit=limit)))
        parts.append(wrote_lines(write_device(directory, robot, joints, stem=f"device-{robot.name}")))
    say(paragraphs(*parts))


def _criteria_rows(robot: Device, pose: Criteria, limit: float | None) -> Iterator[tuple[str, str]]:
    """Yield name and text of each criterion at the pose."""
    from hapticeval.devices.criteria import SAMPLING_TIME
    from hapticeval.devices.parallelogram import Parallelogram
    from hapticeval.devices.workspace import nearest_limit, nearest_singularity

    yield "device", f"{robot.name}, {robot.dimension} degrees of freedom"
    if isinstance(robot, Parallelogram):
        yield "dynamics", robot.described_dynamics
    yield "hand", f"{_vector_text(1e3 * pose.position)} mm"
    # None for a device without limits, as a point mass.
    nearest = nearest_limit(robot, pose.joints)
    if nearest is None:
        yield "workspace", "all of space"
    else:
        yield "joints", f"{_vector_text(pose.joints)} rad"
        yield "nearest limit", nearest.text
        yield "singularities", f"none within {nearest_singularity(robot, pose.joints):.4g} rad of the joints"
    if isinstance(robot, Parallelogram):
        yield "workspace", f"{robot.size():.4g} {'m²' if robot.dimension == 2 else 'm³'}"
    yield from _direction_rows("inertia", pose.masses, "kg", pose.directions)
    yield "anisotropy", f"{pose.anisotropy:.4g}, the heaviest direction over the lightest"
    yield from _direction_rows("damping", pose.resistances, "N s/m", pose.resistance_directions)
    # (2.40) bounds the stiffness by the damping: without any there is no bound to show.
    if pose.resistances[-1] > 0.0:
        yield from _direction_rows("stiffest (2.40)", pose.stiffest, "N/m", pose.resistance_directions)
    if nearest is not None:
        # um a coordinate, from the encoders' counts: a point mass has none.
        yield "resolution", f"{_vector_text(1e6 * pose.resolution)} µm a coordinate"
    if pose.force is not None and pose.acceleration is not None and limit is not None:
        motors = f"motors of {limit:g} {'N' if nearest is None else 'N m'}"
        yield "peak force", f"{_peak_words(pose.force, 'N')}, with {motors}"
        yield "peak acceleration", f"{_peak_words(pose.acceleration, 'm/s²')}, from rest"
    yield "manipulability", f"{pose.manipulability:.4g}, |det J|"
    yield "sampling rate", f"{1.0 / SAMPLING_TIME:g} Hz"


def _direction_rows(name: str, values: Array, unit: str, directions: Array) -> Iterator[tuple[str, str]]:
    for i, value in enumerate(values):
        # The name once, beside the first direction.
        yield "" if i else name, f"{value:.4g} {unit} along {_vector_text(_sign_fixed(directions[:, i]))}"


def _peak_words(peak: Peak, unit: str) -> str:
    along = _vector_text(_sign_fixed(peak.best_direction))
    return f"{peak.worst:.4g} {unit} in every direction, {peak.best:.4g} {unit} along {along}"


def _sign_fixed(direction: Array) -> Array:
    """Return a direction or its opposite, whichever has its largest part positive."""
    # A direction and its opposite are one axis; this picks the same of them everywhere.
    return -direction if direction[abs(direction).argmax()] < 0.0 else direction


def _vector_text(values: Array) -> str:
    # Rounded to 1e-12 and + 0.0, so that no -0 is printed.
    return f"({', '.join(f'{value + 0.0:.4g}' for value in values.round(12))})"


def _workspace_table(spread: dict[str, Spread]) -> str:
    """Format the least, median and greatest of each criterion in columns."""
    from hapticeval.devices.criteria import CLEARANCE

    lines = [f"{f'over the workspace, {CLEARANCE:g} rad clear of its edge':46}{'least':>9}{'median':>9}{'greatest':>9}"]
    for key, (name, unit, scale) in SPREAD_ROWS.items():
        if key in spread:
            title = f"  {name} ({unit})" if unit else f"  {name}"
            lines.append(f"{title:46}" + "".join(f"{scale * value:9.4g}" for value in spread[key]))
    return "\n".join(lines)


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
    from hapticeval.reports.limits_figure import write_limits
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


def plates(
    renderers: Annotated[list[str] | None, renderers_option("an error")] = None,
    directory: Folder = Path(),
) -> None:
    """Find the thinnest plate that a renderer holds, over the hand's speed and its push.

    By bisection between 0.1 and 10 mm, along the direction of the case solids/plate. The hand stops where a spring of
    1000 N/m pushes as much, and a plate is held where half of that comes back in the end.

    \b
    Examples:
      hapticeval study plates -r constraint
      hapticeval study plates -r virtual-proxy -r coupled -o pictures
    """
    from hapticeval.discovery import resolve
    from hapticeval.reports.plates_figure import write_plates
    from hapticeval.study.plates import CITED, THICKEST, THINNEST, describe_border, study_plates

    if not renderers:
        raise InputError("no renderer is named", why="a map is of a renderer", todo="name one: -r constraint")
    maps = {}
    with Terminal() as terminal:
        for name in renderers:
            maps[name] = study_plates(resolve(name), terminal.working)
    speed, push = CITED
    rows = [
        (name, f"at {speed:g} m/s and {push:g} N {describe_border(border.thinnest)}")
        for name, borders in maps.items()
        for border in borders
        if (border.speed, border.push) == CITED
    ]
    document = {
        "thinnest": THINNEST,
        "thickest": THICKEST,
        "renderers": {name: [border._asdict() for border in borders] for name, borders in maps.items()},
    }
    say(paragraphs(columns(rows), wrote_lines(write_plates(directory, document))))


def integrators(
    directory: Folder = Path(),
) -> None:
    """Draw how exactly each method moves the robot between samples, and in what time.

    A hand draws the robot along a circle against motors that jump at each tick. Errors are against scipy's DOP853 at
    its tightest.

    \b
    Example:
      hapticeval study integrators -o pictures
    """
    from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
    from hapticeval.reports.precision_figure import write_precision
    from hapticeval.study.integrators import study_integrators

    document = study_integrators([Parallelogram2(), Parallelogram3()])
    chosen = document["default"]
    for device in document["devices"]:
        methods = {method["name"]: method for method in device["methods"]}
        # The measured point of the method and tolerance that closed loops use.
        point = next(p for p in methods[chosen["method"]]["points"] if p["tolerance"] == chosen["tolerance"])
        say(
            f"{device['device']}: closed loops use {chosen['method']} with a tolerance of {chosen['tolerance']:.0e}: "
            f"error {point['error']:.1e} after a tick at the most, {1.0 / point['seconds_per_second']:.0f} times real "
            "time"
        )
    say(wrote_lines(write_precision(directory, document)))
