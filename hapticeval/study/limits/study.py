"""Find how stiff a scene may be, at one place and over damping, sampling time, delay and workspace; say it in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.effects.actuators import Delay
from hapticeval.errors import DomainError, InputError
from hapticeval.renderer import RendererFactory
from hapticeval.scene import Scene
from hapticeval.study.limits.loop import Place, SampledLoop, passive_stiffness, port_damping, robot_at
from hapticeval.study.limits.published import over_friction, stable_with_delay
from hapticeval.study.limits.search import GainFamily, eigenvalue_limit, family_of, finite_or_none, simulated_limit
from hapticeval.types import Array

Progress = Callable[[int, int, str], None]

COARSE_HALVINGS = 12  # halvings of a limit in a map: to a thousandth of the half-decade in which it lies
DAMPINGS = 45  # dampings of each curve of the Z-width plot, beside zero
TIME_SHARES = (0.25, 0.5, 1.0, 2.0)  # sampling times of the Z-width plot, as shares of the scene's
POSES = 27  # poses along each side of the workspace map
WALL_DIRECTIONS = 12  # directions of a wall, over half a turn, at each pose


def study_limits(factory: RendererFactory, scene: Scene, place: Place, progress: Progress) -> dict[str, Any]:
    """Find a scene's limits as a document in SI units, with None for what is infinite or has no meaning.

    Raises `DomainError` for a place outside the device's workspace, and `InputError` for a renderer that has no gains
    and for a place in another dimension than the device's.
    """
    if scene.robot.dimension != place.point.size:
        raise InputError(
            f"the {scene.robot.name} moves in {scene.robot.dimension}D, and '{scene.model.name}' is in "
            f"{place.point.size}D",
            why="hand and model must live in the same space",
            todo="choose another device",
        )
    total = 6
    progress(0, total, "the loop at one place")
    robot = robot_at(scene.robot, place.point)
    family = family_of(factory, scene, place)
    loop = SampledLoop(scene, robot)
    document: dict[str, Any] = {
        "device": scene.robot.name,
        "turning": scene.robot.turning,
        "inner_loop": scene.inner_loop.value,
        "sampling_time": scene.sampling_time,
        "stiffness": scene.stiffness,
        "damping": scene.damping,
        "point": place.point.tolist(),
        "normal": place.normal.tolist(),
        "port_damping": port_damping(robot, place.normal, scene.sampling_time),
        "passive": passive_stiffness(scene, robot, place.normal),
        "eigenvalues": finite_or_none(eigenvalue_limit(loop, family)),
        "growth": loop.growth(family.at(scene.stiffness)),
    }
    stages: Mapping[str, tuple[str, Callable[[], Any]]] = {
        "simulated": ("the sampled loop, run", lambda: finite_or_none(simulated_limit(factory, scene, place))),
        "width": (
            "damping and sampling time",
            lambda: [_z_width_curve(factory, scene, place, share * scene.sampling_time) for share in TIME_SHARES],
        ),
        "delay": ("delay", lambda: _over_delay(scene, place, family)),
        "friction": ("friction and encoders", lambda: over_friction(factory, scene, place)),
        "workspace": ("workspace", lambda: _over_workspace(scene, family)),
    }
    for done, (entry, (stage, find)) in enumerate(stages.items(), start=1):
        progress(done, total, stage)
        document[entry] = find()
    progress(total, total, "")
    return document


def _z_width_curve(factory: RendererFactory, scene: Scene, place: Place, dt: float) -> Mapping[str, Any]:
    """Compute one curve of the Z-width plot, over dampings up to 2.5 m / T."""
    robot = robot_at(scene.robot, place.point)
    # The mass that a push along the normal meets: 1 / (nᵀ M̂⁻¹ n), with M̂ = J⁻ᵀ M J⁻¹, kg.
    inverse = np.linalg.inv(robot.jacobian)
    felt = 1.0 / float(place.normal @ np.linalg.inv(inverse.T @ robot.inertia @ inverse) @ place.normal)
    # Feedback linearisation gives the hand the mass of the virtual tool.
    mass = scene.mass if scene.inner_loop is InnerLoop.LINEARISED else felt
    # A damper held over a tick is stable below 2 m / T, by v' = (1 - B T / m) v: the curve goes a little beyond.
    dampings = np.append(0.0, np.geomspace(1e-4, 2.5, DAMPINGS) * mass / dt)
    curve: dict[str, list[float | None]] = {"eigenvalues": [], "passive": []}
    for damping in dampings:
        varied = replace(scene, damping=float(damping), sampling_time=dt)
        try:
            family = family_of(factory, varied, place)
        except InputError:  # a damping that the renderer itself knows to be unstable
            curve["eigenvalues"].append(0.0)
        else:
            curve["eigenvalues"].append(
                finite_or_none(eigenvalue_limit(SampledLoop(varied, robot), family, steps=COARSE_HALVINGS))
            )
        curve["passive"].append(passive_stiffness(varied, robot, place.normal))
    return {"sampling_time": dt, "damping": dampings.tolist(), **curve}


def _over_delay(scene: Scene, place: Place, family: GainFamily) -> Mapping[str, Any]:
    robot = robot_at(scene.robot, place.point)
    delays = np.linspace(0.0, 3.0 * scene.sampling_time, 25)
    late = [scene.with_effects(Delay(float(delay))) for delay in delays]
    return {
        "delay": delays.tolist(),
        "eigenvalues": [
            finite_or_none(eigenvalue_limit(SampledLoop(delayed, robot), family, steps=COARSE_HALVINGS))
            for delayed in late
        ],
        "passive": [passive_stiffness(delayed, robot, place.normal) for delayed in late],
        "closed_form": None
        if scene.inner_loop is not InnerLoop.STATIC
        else [stable_with_delay(port_damping(robot, place.normal, scene.sampling_time), delayed) for delayed in late],
    }


def _over_workspace(scene: Scene, family: GainFamily) -> Mapping[str, Any] | None:
    """Compute for each pose the limit at a wall in the worst direction; None for a device that is alike everywhere.

    In 3D over the plane y_2 = 0, with walls whose normals lie in it.
    """
    device = scene.robot
    window = _reachable_box(device)
    if window is None:
        return None
    axes = (0, 1) if device.dimension == 2 else (0, 2)
    grids = [np.linspace(window[0][axis], window[1][axis], POSES) for axis in axes]
    # Half a turn: a wall and its back have the same limit, for gains are even in the normal.
    angles = np.arange(WALL_DIRECTIONS) * np.pi / WALL_DIRECTIONS
    normals = np.zeros((WALL_DIRECTIONS, device.dimension))
    normals[:, axes[0]], normals[:, axes[1]] = np.cos(angles), np.sin(angles)
    shape = (POSES, POSES)
    limits, passive = np.full(shape, np.nan), np.full(shape, np.nan)
    for row, second in enumerate(grids[1]):
        for column, first in enumerate(grids[0]):
            point = np.zeros(device.dimension)
            point[axes[0]], point[axes[1]] = first, second
            try:
                robot = robot_at(device, point)
            except DomainError:
                continue
            loop = SampledLoop(scene, robot)
            places = [family.facing(Place(point, normal)) for normal in normals]
            limits[row, column] = min(eigenvalue_limit(loop, facing, steps=COARSE_HALVINGS) for facing in places)
            bounds = [passive_stiffness(scene, robot, normal) for normal in normals]
            passive[row, column] = min((bound for bound in bounds if bound is not None), default=np.nan)
    return {
        "axes": [f"y{axis + 1}" for axis in axes],
        "first": grids[0].tolist(),
        "second": grids[1].tolist(),
        "eigenvalues": [[finite_or_none(value) for value in row] for row in limits],
        "passive": [[finite_or_none(value) for value in row] for row in passive],
    }


def _reachable_box(device: Device) -> tuple[Array, Array] | None:
    """Find the box around what the device reaches by its own inverse kinematics; None without an edge."""
    if not np.isfinite(device.margin(device.joints(np.zeros(device.dimension)))):
        return None
    # m to each side, more than a desktop device reaches.
    reach = 2.0
    lows, highs = np.zeros(device.dimension), np.zeros(device.dimension)
    coarse = np.linspace(-reach, reach, 81)
    mesh = np.stack(np.meshgrid(*([coarse] * 2), indexing="ij"), axis=-1).reshape(-1, 2)
    for pair in mesh:
        point = pair if device.dimension == 2 else np.array([pair[0], 0.0, pair[1]])
        try:
            device.joints(point)
        except DomainError:
            continue
        lows, highs = np.minimum(lows, point), np.maximum(highs, point)
    step = coarse[1] - coarse[0]
    # A step more on each side: the edge lies between two points of the grid.
    return lows - step, highs + step


def describe(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return rows of name and text: the limits at the place, and what follows for the scene's own stiffness."""
    place = ", ".join(f"{1e3 * value:.4g}" for value in document["point"])
    normal = ", ".join(f"{value:.3g}" for value in document["normal"])
    return [
        ("scene", f"{document['scene']}, {document['renderer']}, K = {document['stiffness']:.6g} N/m, "
                  f"B = {document['damping']:.4g} N s/m, T = {1e3 * document['sampling_time']:.4g} ms"),
        ("device", f"{document['device']}, {document['inner_loop']} inner loop, at ({place}) mm, "
                   f"wall facing ({normal})"),
        ("", ""),
        ("bound (2.40)", _describe_bound(document)),
        ("eigenvalues", f"{_describe_stiffness(document['eigenvalues'])}  of the sampled loop, without a hand"),
        ("simulation", f"{_describe_stiffness(document['simulated'])}  the sampled loop itself, run and bisected"),
        *_describe_published(document),
        *([("", why_none(document))] if document["eigenvalues"] == 0.0 else []),
        ("", ""),
        ("the scene", describe_verdict(document)),
    ]  # fmt: skip


def _describe_published(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return rows for the limits that are in print in closed form, each with what was measured over it."""
    rows = []
    delay, friction = document["delay"], document["friction"]
    if delay["closed_form"] is not None:
        # Without delay the limit may have no meaning; only limits that were found have a ratio.
        ratios = [
            limit / line
            for limit, line in zip(delay["eigenvalues"], delay["closed_form"], strict=True)
            if limit and line
        ]
        if ratios:
            rows.append(
                (
                    "Gil 2009",
                    f"{delay['closed_form'][0]:11.1f} N/m  (b + B) / (T / 2 + delay); the loop's limit is "
                    f"{_range_text(ratios)} times it, over delays up to {1e3 * delay['delay'][-1]:.3g} ms",
                )
            )
    if friction is not None:
        # Without friction the closed form is zero: nothing can be divided by it.
        triples = list(zip(friction["closed_form"], friction["worst_hand"], friction["let_go"], strict=True))[1:]
        hands = _range_text([hand / line for line, hand, _ in triples])
        let_go = _range_text([loop / line for line, _, loop in triples if loop is not None])
        rows.append(
            (
                "Abbott 2005",
                f"{max(friction['closed_form']):11.1f} N/m  min(2 b / T, 2 f_c / Δ) with friction enough; the worst "
                f"hand tried is given energy above {hands} times it; without a hand the loop comes to rest up to "
                f"{let_go} times it",
            )
        )
    return rows


def _range_text(ratios: Sequence[float]) -> str:
    return f"{min(ratios):.4g} to {max(ratios):.4g}" if ratios else "no"


def why_none(document: Mapping[str, Any]) -> str:
    """Explain why no stiffness is stable."""
    if document["port_damping"] == 0.0 and document["damping"] == 0.0 and document["inner_loop"] == "static":
        return (
            "no stiffness is stable: a spring held over a step gives back more than it took, and neither device nor "
            "renderer has damping to take it up (2.40)"
        )
    return "no stiffness is stable with this damping, sampling time and delay"


def describe_verdict(document: Mapping[str, Any]) -> str:
    """Describe what the limits mean for the stiffness that the scene asks for."""
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
            f"tenfold in {_settling_time(growth, dt)}"
        )
    else:
        parts.append(f"without a hand the loop settles, to a tenth in {_settling_time(growth, dt)}")
    return "; ".join(parts)


def _settling_time(growth: float, dt: float) -> str:
    # The logarithm of 0, or a division by that of 1.
    if growth in (0.0, 1.0):
        return "no time to speak of"
    # growth^k = 10 or 1/10: k = log 10 / |log growth| ticks.
    return f"{dt * math.log(10.0) / abs(math.log(growth)):.3g} s"


def _describe_bound(document: Mapping[str, Any]) -> str:
    if document["passive"] is None:
        return f"none: a {document['inner_loop']} inner loop compensates the damping that it counts on"
    b = document["port_damping"]
    formula = f"2 (b - |B|) / (T + 2 delay) with b = {b:.4g} N s/m"
    return f"{_describe_stiffness(document['passive'])}  {formula}, sufficient with any passive hand"


def _describe_stiffness(value: float | None) -> str:
    return "no limit found  " if value is None else f"{value:11.1f} N/m"
