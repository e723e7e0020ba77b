"""A device as a picture, in the manner of thesis Figures 2.11 and 2.12: where it reaches, and how heavy it is there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.devices.criteria import cartesian_inertia
from hapticeval.devices.parallelogram import EDGES, Parallelogram, Parallelogram2, Parallelogram3, corners
from hapticeval.devices.parallelogram_kernels import BASE_LIMIT
from hapticeval.devices.workspace import lattice
from hapticeval.errors import DomainError
from hapticeval.quantity import quantity
from hapticeval.reports.canvas import BOXED, INK, MM, figure, save_figure
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "inside": "#eaf1f7",
        "beyond": "#f3f5f7",
        "shoulder": "#0072b2",
        "elbow": "#8e3fa8",
        "stop": "#00796b",
        "singular": "#d1350f",
        "inertia": "#9a6700",
    }
)
ELLIPSE = 18.0
"""Half-axis (mm) of the ellipse of 1 kg; it goes with the root of the mass, so that 2 and 0.15 kg are both seen."""
SPACING, CLEARANCE = 0.5, 0.12
"""rad: between the poses that an ellipse is drawn for, and their least margin."""


def write_device(directory: Path, device: Parallelogram, joints: Array, *, stem: str) -> list[Path]:
    """Draw a device at the pose `joints` (N,), rad, into `directory`, as SVG and PNG; return the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    deep = isinstance(device, Parallelogram3)
    size, widths = ((13.2, 5.3), (1.12, 1.25, 0.9)) if deep else ((9.2, 5.3), (1.2, 0.9))
    with figure(*size, settings=BOXED, layout="constrained") as made:
        panels = made.subplots(1, len(widths), width_ratios=widths)
        _side(panels[0], device, joints)
        if isinstance(device, Parallelogram3):
            _top(panels[1], device, joints)
        _joint_space(panels[-1], device, joints)
        handles, labels = panels[0].get_legend_handles_labels()
        made.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, handlelength=1.8)
        made.suptitle(_title(device), fontsize=10, color=INK)
        return save_figure(made, directory, stem)


def _title(device: Parallelogram) -> str:
    if isinstance(device, Parallelogram2):
        return device.name
    return f"{device.name}: {device.dynamics} dynamics, d₀ with {device.base_inertia}² x₃"


def _side(axes: Axes, device: Parallelogram, joints: Array) -> None:
    """The linkage's plane: what is reached, its edges by limit, inertia, and the pose."""
    deep = isinstance(device, Parallelogram3)
    flat = Parallelogram2(device.constants)
    around = np.concatenate([points for _, points in device.edges()])
    axes.fill(*(MM * around.T), facecolor=COLOURS["beyond"], edgecolor="none")
    axes.fill(*(MM * device.section().T), facecolor=COLOURS["inside"], edgecolor="none", label="functional workspace")
    names = _names(device)
    seen = set()
    for name, points in device.edges():
        label = None if name in seen else f"{names[name]} at its limit"
        seen.add(name)
        axes.plot(*(MM * points.T), color=COLOURS[name], linewidth=1.5, label=label)
    if deep:
        low, high = MM * around[:, 1].min(), MM * around[:, 1].max()
        axes.plot(
            [-MM * device.constants.l4] * 2, [low, high], color=COLOURS["singular"], linewidth=1.3, linestyle="--",
            label="base's axis: singular",
        )  # fmt: skip
    within = [
        pose for pose in lattice(flat, step=SPACING, clearance=CLEARANCE) if not deep or _reach(device, pose) > 0.05
    ]
    for pose in within:
        _ellipse(axes, flat.position(pose), cartesian_inertia(flat, pose))
    axes.plot(
        [], [], color=COLOURS["inertia"], linewidth=1.0, label=f"inertia: half-axis {ELLIPSE:g} mm at 1 kg, ∝ √mass"
    )
    _pose(axes, device, joints)
    axes.set_aspect("equal")
    axes.set_xlabel("from home, outwards (mm)" if deep else "y₁ (mm)")
    axes.set_ylabel("y₃ (mm)" if deep else "y₂ (mm)")
    axes.set_title("in the plane of the linkage" if deep else "where the hand reaches", fontsize=8.5)


def _reach(device: Parallelogram, linkage: Array) -> float:
    """The hand's distance (m) from the base's axis."""
    shoulder, elbow = linkage
    return device.constants.l4 * math.cos(elbow) - device.constants.l1 * math.sin(shoulder)


def _names(device: Parallelogram) -> dict[str, str]:
    first, second = ("x₂", "x₃") if isinstance(device, Parallelogram3) else ("x₁", "x₂")
    return {"shoulder": first, "elbow": second, "stop": f"{first} − {second}"}  # noqa: RUF001


def _pose(axes: Axes, device: Parallelogram, joints: Array) -> None:
    """Both links from the shoulder to the hand, and the ellipse there."""
    flat = Parallelogram2(device.constants)
    linkage = joints[-2:]
    shoulder = np.array([-device.constants.l4, -device.constants.l1])
    elbow = shoulder + device.constants.l1 * np.array([-math.sin(linkage[0]), math.cos(linkage[0])])
    hand = flat.position(linkage)
    points = MM * np.array([shoulder, elbow, hand])
    axes.plot(
        points[:, 0], points[:, 1], "-o", color=INK, linewidth=2.4, markersize=3.5, zorder=5,
        solid_capstyle="round", label="the pose",
    )  # fmt: skip
    _ellipse(axes, hand, cartesian_inertia(flat, linkage), strong=True)


def _ellipse(axes: Axes, centre: Array, inertia: Array, *, strong: bool = False) -> None:
    """The square root of M̂ as an ellipse: long where the hand feels heavy."""
    masses, directions = np.linalg.eigh(inertia)
    angles = np.linspace(0.0, 2.0 * math.pi, 73)
    circle = np.array([np.cos(angles), np.sin(angles)])
    points = MM * centre[:, None] + ELLIPSE * directions @ (np.sqrt(masses)[:, None] * circle)
    axes.plot(*points, color=COLOURS["inertia"], linewidth=1.8 if strong else 0.8, zorder=6 if strong else 3)


def _top(axes: Axes, device: Parallelogram3, joints: Array) -> None:
    """From above: what the base sweeps, with the horizontal part of the inertia at the height of the pose."""
    outline = device.section()
    inner, outer = (device.constants.l4 + end for end in (outline[:, 0].min(), outline[:, 0].max()))
    turns = np.linspace(-BASE_LIMIT, BASE_LIMIT, 200)
    arcs = [radius * np.array([np.cos(turns), np.sin(turns)]) for radius in (outer, inner)]
    ring = np.concatenate([arcs[0], arcs[1][:, ::-1], arcs[0][:, :1]], axis=1) - [[device.constants.l4], [0.0]]
    axes.fill(*(MM * ring), facecolor=COLOURS["inside"], edgecolor="none")
    for turn in (-BASE_LIMIT, BASE_LIMIT):
        end = outer * np.array([math.cos(turn), math.sin(turn)]) - [device.constants.l4, 0.0]
        axes.plot(
            [-MM * device.constants.l4, MM * end[0]], [0.0, MM * end[1]], color=INK, linewidth=1.3,
            label="x₁ at its limit" if turn > 0.0 else None,
        )  # fmt: skip
    axes.plot(
        -MM * device.constants.l4, 0.0, "x", color=COLOURS["singular"], markersize=7, markeredgewidth=1.6, zorder=5,
        label="base's axis: singular",
    )  # fmt: skip
    height = round(float(device.position(joints)[2]), 12) + 0.0
    flat = Parallelogram2(device.constants)
    for turn in np.arange(-3, 4) * 0.7:
        for reach in (0.25, 0.4, 0.55):
            pose = _linkage_at(flat, reach - device.constants.l4, height)
            if pose is None or device.margin((turn, *pose)) <= 0.0:
                continue
            full = np.array([turn, *pose])
            _ellipse(axes, device.position(full)[:2], cartesian_inertia(device, full)[:2, :2])
    hand = device.position(joints)
    axes.plot(
        [-MM * device.constants.l4, MM * hand[0]], [0.0, MM * hand[1]], "-o", color=INK, linewidth=2.4,
        markersize=4.5, zorder=5,
    )  # fmt: skip
    _ellipse(axes, hand[:2], cartesian_inertia(device, joints)[:2, :2], strong=True)
    axes.set_aspect("equal")
    axes.set_xlabel("y₁ (mm)")
    axes.set_ylabel("y₂ (mm)")
    axes.set_title(f"from above, with inertia at y₃ = {quantity(height, 'm')}", fontsize=8.5)
    axes.legend(loc="lower left", frameon=False)


def _linkage_at(flat: Parallelogram2, across: float, up: float) -> Array | None:
    try:
        return flat.joints((across, up))
    except DomainError:
        return None


def _joint_space(axes: Axes, device: Parallelogram, joints: Array) -> None:
    """The limits of the linkage's joints, and the singular curve between them."""
    ends = corners()
    axes.fill(*ends.T, facecolor=COLOURS["inside"], edgecolor="none")
    if isinstance(device, Parallelogram3):
        shoulder, elbow = np.meshgrid(np.linspace(-2.1, 2.5, 300), np.linspace(-1.1, 2.4, 300))
        reach = device.constants.l4 * np.cos(elbow) - device.constants.l1 * np.sin(shoulder)
        within = (np.abs(shoulder - elbow) <= 1.0) & (elbow >= -1.0) & (elbow <= 2.3) & (shoulder <= 2.4)
        shown = np.where(within, reach, np.nan)
        axes.contourf(shoulder, elbow, shown, levels=[-10.0, 0.0], colors=[COLOURS["beyond"]])
        axes.contour(
            shoulder, elbow, shown, levels=[0.0], colors=[COLOURS["singular"]], linewidths=1.3, linestyles=[(0, (4, 2))]
        )
    axes.plot(*joints[-2:], "o", color=INK, markersize=5, zorder=5)
    names = _names(device)
    axes.set_xlabel(f"{names['shoulder']} (rad)")
    axes.set_ylabel(f"{names['elbow']} (rad)")
    axes.set_aspect("equal")
    axes.set_title("the linkage's joints", fontsize=8.5)
    for name, here, there in zip(EDGES, ends, np.roll(ends, -1, axis=0), strict=True):
        axes.plot(*np.array([here, there]).T, color=COLOURS[name], linewidth=1.5)
