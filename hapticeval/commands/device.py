"""`hapticeval device`: what a device is like, at a pose and over its workspace."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hapticeval.commands.arguments import parse_point
from hapticeval.commands.output import say

if TYPE_CHECKING:
    from hapticeval.devices.criteria import Criteria, Peak, Spread
    from hapticeval.devices.device import Device
    from hapticeval.types import Array

SPREAD = {
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


def device(
    name: Annotated[
        str,
        typer.Argument(
            metavar="DEVICE",
            help="As in parallelogram-2dof, parallelogram-3dof:dynamics=printed or point-mass:mass=0.1.",
            show_default=False,
        ),
    ],
    at: Annotated[
        str | None,
        typer.Option(
            "--at", metavar="Y1,Y2[,Y3]", help="Where the hand is, m; at home if not given.", show_default=False
        ),
    ] = None,
    torque: Annotated[
        float | None,
        typer.Option(
            metavar="TAU",
            help="Peak torque of each motor, N m (of a point mass its force, N); the robot's has 0.368 of its own.",
            show_default=False,
        ),
    ] = None,
    directory: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where the picture goes.")] = Path(),
) -> None:
    """Show what the hand feels of a device, and draw where it reaches.

    \b
    Examples:
      hapticeval device parallelogram-2dof
      hapticeval device parallelogram-3dof --at 0.1,0.05,-0.05 -o pictures
      hapticeval device parallelogram-3dof:base_inertia=cos,b1=0.4
    """
    import numpy as np

    from hapticeval.commands.listing import columns
    from hapticeval.devices.catalogue import device_named
    from hapticeval.devices.criteria import MOTOR_TORQUE, criteria, over_workspace
    from hapticeval.devices.parallelogram import Parallelogram
    from hapticeval.devices.point_mass import PointMass
    from hapticeval.reports.device_figure import write_device

    robot = device_named(name)
    limit = MOTOR_TORQUE if torque is None and not isinstance(robot, PointMass) else torque
    place = np.zeros(robot.dimension) if at is None else parse_point(at, robot.dimension, option="--at")
    joints = robot.joints(place)
    found = criteria(robot, joints, torque_limit=limit)
    say(columns(_rows(robot, found, limit)))
    if isinstance(robot, Parallelogram):
        say(f"\n{_table(over_workspace(robot, torque_limit=limit))}\n")
        for path in write_device(directory, robot, joints, stem=f"device-{robot.name}"):
            say(f"wrote {path}")


def _rows(robot: Device, at: Criteria, limit: float | None) -> Iterator[tuple[str, str]]:
    """Yield name and text of each criterion at the pose."""
    from hapticeval.devices.criteria import SAMPLING_TIME
    from hapticeval.devices.parallelogram import Parallelogram
    from hapticeval.devices.workspace import nearest_limit, nearest_singularity

    yield "device", f"{robot.name}, {robot.dimension} degrees of freedom"
    if isinstance(robot, Parallelogram):
        yield "dynamics", robot.described_dynamics
    yield "hand", f"{_vector(1e3 * at.position)} mm"
    nearest = nearest_limit(robot, at.joints)
    if nearest is None:
        yield "workspace", "all of space"
    else:
        yield "joints", f"{_vector(at.joints)} rad"
        yield "nearest limit", nearest.text
        yield "singularities", f"none within {nearest_singularity(robot, at.joints):.4g} rad of the joints"
    if isinstance(robot, Parallelogram):
        yield "workspace", f"{robot.size():.4g} {'m²' if robot.dimension == 2 else 'm³'}"
    yield from _along("inertia", at.masses, "kg", at.directions)
    yield "anisotropy", f"{at.anisotropy:.4g}, the heaviest direction over the lightest"
    yield from _along("damping", at.resistances, "N s/m", at.resistance_directions)
    if at.resistances[-1] > 0.0:
        yield from _along("stiffest (2.40)", at.stiffest, "N/m", at.resistance_directions)
    if nearest is not None:
        yield "resolution", f"{_vector(1e6 * at.resolution)} µm a coordinate"
    if at.force is not None and at.acceleration is not None and limit is not None:
        motors = f"motors of {limit:g} {'N' if nearest is None else 'N m'}"
        yield "peak force", f"{_peak(at.force, 'N')}, with {motors}"
        yield "peak acceleration", f"{_peak(at.acceleration, 'm/s²')}, from rest"
    yield "manipulability", f"{at.manipulability:.4g}, |det J|"
    yield "sampling rate", f"{1.0 / SAMPLING_TIME:g} Hz"


def _along(name: str, values: Array, unit: str, directions: Array) -> Iterator[tuple[str, str]]:
    for i, value in enumerate(values):
        yield "" if i else name, f"{value:.4g} {unit} along {_vector(_pointed(directions[:, i]))}"


def _peak(peak: Peak, unit: str) -> str:
    along = _vector(_pointed(peak.best_direction))
    return f"{peak.worst:.4g} {unit} in every direction, {peak.best:.4g} {unit} along {along}"


def _pointed(direction: Array) -> Array:
    """Return a direction or its opposite, whichever has its largest part positive."""
    return -direction if direction[abs(direction).argmax()] < 0.0 else direction


def _vector(values: Array) -> str:
    return f"({', '.join(f'{value + 0.0:.4g}' for value in values.round(12))})"


def _table(spread: dict[str, Spread]) -> str:
    """Format the least, median and greatest of each criterion in columns."""
    from hapticeval.devices.criteria import CLEARANCE

    lines = [f"{f'over the workspace, {CLEARANCE:g} rad clear of its edge':46}{'least':>9}{'median':>9}{'greatest':>9}"]
    for key, (name, unit, scale) in SPREAD.items():
        if key in spread:
            title = f"  {name} ({unit})" if unit else f"  {name}"
            lines.append(f"{title:46}" + "".join(f"{scale * value:9.4g}" for value in spread[key]))
    return "\n".join(lines)
