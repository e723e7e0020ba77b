"""What the hand feels of a device, and a picture in the manner of thesis Figures 2.11 and 2.12: where it reaches.

Run it as `python -m hapticeval.examples.studies.device parallelogram-2dof -o pictures`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from hapticeval.cli import run_program
from hapticeval.commands.arguments import (
    Folder,
    argument,
    option,
    parse_point,
)
from hapticeval.commands.draw import DRAW_CODES
from hapticeval.commands.terminal import columns, paragraphs, say, wrote_lines
from hapticeval.devices.catalogue import device_named
from hapticeval.devices.device import Device
from hapticeval.devices.parallelogram import (
    BASE_LIMIT,
    MOTOR_TORQUE,
    Parallelogram,
    Parallelogram2,
    Parallelogram3,
)
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import DomainError
from hapticeval.examples.studies.device_criteria import (
    CLEARANCE,
    SAMPLING_TIME,
    Criteria,
    Peak,
    Spread,
    cartesian_inertia,
    criteria,
    over_workspace,
)
from hapticeval.examples.studies.reach import (
    EDGES,
    corner_angles,
    describe_dynamics,
    lattice,
    nearest_limit,
    nearest_singularity,
    trace_edges,
    trace_section,
    workspace_size,
)
from hapticeval.quantity import format_quantity
from hapticeval.reports.canvas import BOXED, INK, MM, PALETTE, figure, save_figure
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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


LIMIT_COLOURS = {"shoulder": PALETTE["line"], "elbow": PALETTE["tool"], "stop": PALETTE["stop"]}
"""Colours of the workspace's edges by the joint limit that makes them."""

SINGULAR_STYLE: dict[str, Any] = {"color": PALETTE["jump"], "label": "base's axis: singular"}
"""How the base's axis is drawn, on which the device is singular."""

ELLIPSE_RADIUS = 18.0
"""Half-axis (mm) of the ellipse of 1 kg; it goes with the root of the mass, so that 2 and 0.15 kg are both seen."""
POSE_SPACING, POSE_CLEARANCE = 0.5, 0.12
"""rad: between the poses that an ellipse is drawn for, and their least margin."""


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
      python -m hapticeval.examples.studies.device parallelogram-2dof
      python -m hapticeval.examples.studies.device parallelogram-3dof --at 0.1,0.05,-0.05 -o pictures
      python -m hapticeval.examples.studies.device parallelogram-3dof:base_inertia=cos,b1=0.4
    """
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
    yield "device", f"{robot.name}, {robot.dimension} degrees of freedom"
    if isinstance(robot, Parallelogram):
        yield "dynamics", describe_dynamics(robot)
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
        yield "workspace", f"{workspace_size(robot):.4g} {'m²' if robot.dimension == 2 else 'm³'}"
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
    lines = [f"{f'over the workspace, {CLEARANCE:g} rad clear of its edge':46}{'least':>9}{'median':>9}{'greatest':>9}"]
    for key, (name, unit, scale) in SPREAD_ROWS.items():
        if key in spread:
            title = f"  {name} ({unit})" if unit else f"  {name}"
            lines.append(f"{title:46}" + "".join(f"{scale * value:9.4g}" for value in spread[key]))
    return "\n".join(lines)


def write_device(directory: Path, device: Parallelogram, joints: Array, *, stem: str) -> list[Path]:
    """Draw a device at the pose `joints` (N,), rad, into `directory`, as SVG and PNG; return the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    has_base = isinstance(device, Parallelogram3)
    size, widths = ((13.2, 5.3), (1.12, 1.25, 0.9)) if has_base else ((9.2, 5.3), (1.2, 0.9))
    with figure(*size, settings={**BOXED, "axes.titlesize": 8.5}, layout="constrained") as fig:
        panels = fig.subplots(1, len(widths), width_ratios=widths)
        _draw_side(panels[0], device, joints)
        title = device.name
        if isinstance(device, Parallelogram3):
            _draw_top(panels[1], device, joints)
            title += f": {device.dynamics} dynamics, d₀ with {device.base_inertia}² x₃"
        _draw_joint_space(panels[-1], device, joints)
        handles, labels = panels[0].get_legend_handles_labels()
        fig.legend(handles, labels, loc="outside lower center", ncols=4, handlelength=1.8)
        fig.suptitle(title, fontsize=10, color=INK)
        return save_figure(fig, directory, stem)


def _draw_side(axes: Axes, device: Parallelogram, joints: Array) -> None:
    """The linkage's plane: what is reached, its edges by limit, inertia, and the pose with both links."""
    has_base, constants = isinstance(device, Parallelogram3), device.constants
    linkage_device = Parallelogram2(constants)
    edge_points = MM * np.concatenate([points for _, points in trace_edges(device)])
    axes.fill(*edge_points.T, facecolor=PALETTE["model"], edgecolor="none")
    section_points = MM * trace_section(device)
    axes.fill(*section_points.T, facecolor=PALETTE["inside"], edgecolor="none", label="functional workspace")
    names = _joint_names(device)
    for name, points in trace_edges(device):
        label = f"{names.pop(name)} at its limit" if name in names else None
        axes.plot(*(MM * points.T), color=LIMIT_COLOURS[name], linewidth=1.5, label=label)
    if has_base:
        axis = [-MM * constants.l4] * 2, [edge_points[:, 1].min(), edge_points[:, 1].max()]
        axes.plot(*axis, linewidth=1.3, linestyle="--", **SINGULAR_STYLE)
    for pose in lattice(linkage_device, step=POSE_SPACING, clearance=POSE_CLEARANCE):
        # The hand's distance from the base's axis, m: near it a motion across takes large turns of the base.
        if not has_base or constants.l4 * math.cos(pose[1]) - constants.l1 * math.sin(pose[0]) > 0.05:
            _draw_ellipse(axes, linkage_device.position(pose), cartesian_inertia(linkage_device, pose))
    words = f"inertia: half-axis {ELLIPSE_RADIUS:g} mm at 1 kg, ∝ √mass"
    axes.plot([], [], color=PALETTE["inertia"], linewidth=1.0, label=words)
    # Shoulder and elbow, rad; the base's turn comes before them.
    linkage = joints[-2:]
    # m, with the hand at the origin when all joints are zero.
    shoulder = np.array([-constants.l4, -constants.l1])
    elbow = shoulder + constants.l1 * np.array([-math.sin(linkage[0]), math.cos(linkage[0])])
    hand = linkage_device.position(linkage)
    _draw_links(axes, np.array([shoulder, elbow, hand]), markersize=3.5, solid_capstyle="round", label="the pose")
    _draw_ellipse(axes, hand, cartesian_inertia(linkage_device, linkage), strong=True)
    axes.set(aspect="equal", title="in the plane of the linkage" if has_base else "where the hand reaches")
    axes.set(xlabel="from home, outwards (mm)" if has_base else "y₁ (mm)", ylabel="y₃ (mm)" if has_base else "y₂ (mm)")


def _joint_names(device: Parallelogram) -> dict[str, str]:
    first, second = ("x₂", "x₃") if isinstance(device, Parallelogram3) else ("x₁", "x₂")
    return {"shoulder": first, "elbow": second, "stop": f"{first} − {second}"}  # noqa: RUF001


def _draw_links(axes: Axes, points: Array, **style: Any) -> None:
    axes.plot(*(MM * points.T), "-o", color=INK, linewidth=2.4, zorder=5, **style)


def _draw_ellipse(axes: Axes, centre: Array, inertia: Array, *, strong: bool = False) -> None:
    """The square root of M̂ as an ellipse: long where the hand feels heavy."""
    # Principal masses (2,), kg, and their directions; half-axis d_i has length ELLIPSE_RADIUS sqrt(m_i).
    masses, directions = np.linalg.eigh(inertia)
    angles = np.linspace(0.0, 2.0 * math.pi, 73)
    circle = np.array([np.cos(angles), np.sin(angles)])
    points = MM * centre[:, None] + ELLIPSE_RADIUS * directions @ (np.sqrt(masses)[:, None] * circle)
    axes.plot(*points, color=PALETTE["inertia"], linewidth=1.8 if strong else 0.8, zorder=6 if strong else 3)


def _draw_top(axes: Axes, device: Parallelogram3, joints: Array) -> None:
    """From above: what the base sweeps, with the horizontal part of the inertia at the height of the pose."""
    outline, axis = trace_section(device), np.array([-device.constants.l4, 0.0])
    # m from the base's axis, which lies l4 behind the hand at home.
    inner, outer = (device.constants.l4 + end for end in (outline[:, 0].min(), outline[:, 0].max()))
    turns = np.linspace(-BASE_LIMIT, BASE_LIMIT, 200)
    arc = np.column_stack([np.cos(turns), np.sin(turns)])
    # The outer arc forwards and the inner one back.
    ring = MM * (axis + np.vstack([outer * arc, inner * arc[::-1]]))
    axes.fill(*ring.T, facecolor=PALETTE["inside"], edgecolor="none")
    for end, label in zip((arc[0], arc[-1]), (None, "x₁ at its limit"), strict=True):
        axes.plot(*(MM * np.array([axis, axis + outer * end]).T), color=INK, linewidth=1.3, label=label)
    axes.plot(*(MM * axis), "x", markersize=7, markeredgewidth=1.6, zorder=5, **SINGULAR_STYLE)
    # m; + 0.0 takes the sign off a zero.
    height = round(float(device.position(joints)[2]), 12) + 0.0
    linkage_device = Parallelogram2(device.constants)
    for turn in np.arange(-3, 4) * 0.7:
        for reach in (0.25, 0.4, 0.55):
            # Where no joints reach the place there is nothing to draw.
            with suppress(DomainError):
                pose = np.array([turn, *linkage_device.joints((reach - device.constants.l4, height))])
                if device.margin(pose) > 0.0:
                    _draw_ellipse(axes, device.position(pose)[:2], cartesian_inertia(device, pose)[:2, :2])
    hand = device.position(joints)[:2]
    _draw_links(axes, np.array([axis, hand]), markersize=4.5)
    _draw_ellipse(axes, hand, cartesian_inertia(device, joints)[:2, :2], strong=True)
    axes.set(aspect="equal", xlabel="y₁ (mm)", ylabel="y₂ (mm)")
    axes.set_title(f"from above, with inertia at y₃ = {format_quantity(height, 'm')}")
    axes.legend(loc="lower left")


def _draw_joint_space(axes: Axes, device: Parallelogram, joints: Array) -> None:
    """The limits of the linkage's joints, and the singular curve between them."""
    ends = corner_angles()
    axes.fill(*ends.T, facecolor=PALETTE["inside"], edgecolor="none")
    if isinstance(device, Parallelogram3):
        shoulder, elbow = np.meshgrid(np.linspace(-2.1, 2.5, 300), np.linspace(-1.1, 2.4, 300))
        # m: the hand's distance from the base's axis; the device is singular where it is 0.
        reach = device.constants.l4 * np.cos(elbow) - device.constants.l1 * np.sin(shoulder)
        # The linkage's limits, rad.
        within = (np.abs(shoulder - elbow) <= 1.0) & (elbow >= -1.0) & (elbow <= 2.3) & (shoulder <= 2.4)
        field = shoulder, elbow, np.where(within, reach, np.nan)
        axes.contourf(*field, levels=[-10.0, 0.0], colors=[PALETTE["model"]])
        axes.contour(*field, levels=[0.0], colors=[PALETTE["jump"]], linewidths=1.3, linestyles=[(0, (4, 2))])
    axes.plot(*joints[-2:], "o", color=INK, markersize=5, zorder=5)
    for name, corner, next_corner in zip(EDGES, ends, np.roll(ends, -1, axis=0), strict=True):
        axes.plot(*np.array([corner, next_corner]).T, color=LIMIT_COLOURS[name], linewidth=1.5)
    names = _joint_names(device)
    axes.set(xlabel=f"{names['shoulder']} (rad)", ylabel=f"{names['elbow']} (rad)", aspect="equal")
    axes.set_title("the linkage's joints")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code."""
    return run_program(device, DRAW_CODES, arguments)


if __name__ == "__main__":
    sys.exit(main())
