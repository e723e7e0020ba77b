"""Set stabilisation as a renderer, on plane curves and on surfaces in space: a compiled law, one tick at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import DomainError, InputError, RefusalError, in_m
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.model import Model
from hapticeval.geometry.surface import Surface
from hapticeval.laws import law_data
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.recording import Recording
from hapticeval.records import numbers_of, room_for
from hapticeval.renderer import CompiledStep, Declaration
from hapticeval.renderers.atlas import active_charts, by_charts, charts
from hapticeval.renderers.law_renderer import LawRenderer
from hapticeval.renderers.stabilisation_laws import (
    BEYOND,
    PREDICTED_STATE,
    SET_GAINS,
    TOUCH,
    on_curve,
    on_curve_predicted,
    on_surface,
    on_surface_predicted,
)
from hapticeval.scene import Scene
from hapticeval.types import Array


class Stabilisation(LawRenderer):
    """The step of a law of set stabilisation, with the hand's force as sensed.

    Where `predicted` it is evaluated where the tool will be when the force acts: see `stabilisation_laws`.
    """

    declares = Declaration(closed_form="set-stabilisation", memoryless=True)

    def __init__(
        self, scene: Scene, law: Callable[..., Any], surface: Boundary, *, predicted: bool, **tables: ArrayLike
    ) -> None:
        if predicted:
            check_prediction(scene)
            # It goes by the force of the tick before.
            self.declares = Declaration(closed_form="set-stabilisation")
        check_gains(scene, predicted=predicted)
        gains = numbers_of(
            SET_GAINS, stiffness=scene.stiffness, damping=scene.damping, mass=scene.mass, viscosity=scene.viscosity,
            bilateral=scene.bilateral,
        )  # fmt: skip
        if predicted:
            # What is known of the loop: the low-pass of its velocities, and the delay of its motors.
            low_pass, delay = scene.effect("velocity-filter"), scene.effect("delay")
            gains = np.append(
                gains, [0.0 if low_pass is None else low_pass.cutoff, 0.0 if delay is None else delay.time]
            )
        data = law_data(gains, state=room_for(PREDICTED_STATE if predicted else TOUCH), **tables)
        where = "the centre of curvature" if surface.dimension == 2 else "a centre of curvature"
        domain_exits = {BEYOND: f"the hand is at {where} of its nearest surface point, or beyond it"}
        super().__init__(CompiledStep(law, data, domain_exits), surface)

    def observe_force(self, push: Array) -> None:
        """Take the hand's measured force on the tool, `push` (N,), N, for the ticks that follow."""
        self._push[:] = push


class CurveStabilisation(Stabilisation):
    """Holds the hand on a smooth plane curve, or outside of it, as a frictionless constraint (7.11), (7.14), (7.22).

    The force is that on the hand, F_r = m ÿ_cmd less what the hand pushes where that is sensed: see `on_curve`. An
    inner loop that is `linearised` (6.7) makes the torques of (7.11) of it.

    The IHIP is the nearest point. Where that jumps (the medial axis) the force does too: one point does not show it,
    and only a centre of curvature is guarded.

    Curves of lines and arcs that join smoothly have a curvature that jumps there. Then so does the force, by m Δκ ṡ^2,
    as that of a rigid contact does; n̈ = v⊥ holds on both sides, and on the surface the speed is kept through it.

    Raises `RefusalError` for a curve with corners, and `InputError` as `check_gains` does.
    """

    def __init__(self, scene: Scene, *, predicted: bool = False) -> None:
        curve = smooth_curve(scene.model)
        law = on_curve_predicted if predicted else on_curve
        super().__init__(scene, law, curve, predicted=predicted, pieces=curve.pieces, lookup=curve.samples)

    def led_out(self, hip: Array, what: str) -> DomainError:
        """Return the error for a hand at `hip` (2,), m, where 1 + n κ <= 0, as `what` says."""
        return DomainError(
            f"{what}: {in_m(hip)}",
            why="there the foot is not unique and 1 + n κ vanishes: the virtual output (7.33) is singular",
            todo="start nearer to the surface, hold on stiffer, or push less",
        )


def smooth_curve(model: Model) -> Curve:
    """The model's curve. Raises `RefusalError`, with the first corner, for one without curvature."""
    curve = model.curve
    if curve.corners:
        corner = curve.corners[0]
        error = RefusalError(
            f"model '{model.name}' has {len(curve.corners)} corners, the first at {in_m(corner.position)}",
            why="set stabilisation follows the curvature of the surface, and a corner has none",
            todo="choose a smooth model (line, circle, ellipse, cassinian, dumbbell), or another renderer: "
            "minimum-distance, constraint",
        )
        error.position = (float(corner.position[0]), float(corner.position[1]))
        raise error
    return curve


def check_prediction(scene: Scene) -> None:
    """Raises `RefusalError` for a scene in which the last force does not say how the tool moves on."""
    if not scene.bilateral:
        raise RefusalError(
            "set-stabilisation+predicted is for a surface that holds the tool from both sides",
            why="where a contact begins there is no force of the tick before to go by",
            todo="use set-stabilisation, or say bilateral = true in the scene",
        )
    if not tool_moves(scene):
        raise RefusalError(
            "set-stabilisation+predicted needs a device that moves as the tool does",
            why="the force of the tick before moves another mass here",
            todo='say inner_loop = "linearised" in the scene, or leave the device out',
        )


def tool_moves(scene: Scene) -> bool:
    """Return whether the force moves the mass that it was computed for."""
    return scene.inner_loop is InnerLoop.LINEARISED or scene.robot == PointMass(scene.mass, scene.model.dimension)


def check_gains(scene: Scene, *, predicted: bool) -> None:
    """Raises `InputError` for gains with which a bilateral constraint is unstable at the scene's sampling time.

    Held over T, n̈ = -(K_p n + K_d ṅ)/m becomes, with k = K_p/m and d = K_d/m, a step with the characteristic polynomial

        z^2 - (2 - d T - k T^2/2) z + (1 - d T + k T^2/2)

    whose roots lie in the unit circle (Jury) when the last coefficient is below 1, K_p < 2 K_d / T, and the value at -1
    is positive, K_d < 2 m / T. Along the surface ṡ is multiplied by 1 - b_d T/m each tick: b_d < 2 m / T.

    With the prediction, for h = T/2, the force has a memory: n̈ = -K_p n - (K_p h + K_d) (ṅ + h n̈_prev) over m, and the
    step three eigenvalues.

    Not asked of a unilateral contact, where the hand is in the loop and may damp it, nor where the force moves another
    mass than the tool's, as `static` and `compensated` inner loops let it.
    """
    if not (scene.bilateral and tool_moves(scene)):
        return
    period, mass = scene.sampling_time, scene.mass
    # k T^2 / 2 and d T of the polynomial: Jury's conditions are k < d < 2 in them
    k, d = 0.5 * scene.stiffness * period**2 / mass, scene.damping * period / mass
    if predicted:
        # In n / T^2, ṅ / T and n̈ of the tick before; with h = T/2.
        answer = np.array([-2.0 * k, -(k + d), -0.5 * (k + d)])
        step = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
        size = float(np.max(np.abs(np.linalg.eigvals(step + np.outer([0.5, 1.0, 1.0], answer)))))
        if not size < 1.0:
            raise InputError(
                f"stiffness {scene.stiffness:g} N/m and damping {scene.damping:g} N s/m are unstable at {period:g} s "
                "with the prediction",
                why=f"the sampled constraint has an eigenvalue of size {size:.9g}",
                todo="sample faster, lower the stiffness, or change the damping",
            )
    elif not k < d < 2.0:
        size = float(np.max(np.abs(np.roots([1.0, d + k - 2.0, 1.0 - d + k]))))
        raise InputError(
            f"stiffness {scene.stiffness:g} N/m and damping {scene.damping:g} N s/m are unstable at {period:g} s",
            why=f"the sampled constraint n̈ = -(K_p n + K_d ṅ)/m has an eigenvalue of size {size:.9g}; stable are a "
            f"damping below {2.0 * mass / period:.6g} N s/m with a stiffness below 2 K_d / T"
            f"{f' = {2.0 * scene.damping / period:.6g} N/m' if d < 2.0 else ''}",
            todo="sample faster, lower the stiffness, or change the damping",
        )
    if not scene.viscosity * period < 2.0 * mass:
        raise InputError(
            f"viscosity {scene.viscosity:g} kg/s is unstable at {period:g} s",
            why=f"the sampled speed is multiplied by {1.0 - scene.viscosity * period / mass:g} at each tick",
            todo=f"choose it below {2.0 * mass / period:g} kg/s, or sample faster",
        )


class SurfaceStabilisation(Stabilisation):
    """Holds the hand on a smooth surface, or outside of it, as a frictionless or viscous constraint (7.11), (7.14).

    The force is that on the hand, F_r = m ÿ less what the hand pushes where that is sensed: see `on_surface` and, with
    `atlas`, `by_charts`. An inner loop that is `linearised` (6.7) makes the torques of (7.11) of it.

    The IHIP is the nearest point. Where that jumps, in the medial disc of an ellipsoid, the force does too: one point
    does not show it, and only where I + nW is no longer positive is guarded.

    Raises `RefusalError` for a plane model and, with `atlas`, for anything but a sphere, and `InputError` for gains
    that are unstable at the sampling time.
    """

    surface: Surface

    def __init__(self, scene: Scene, *, atlas: bool, predicted: bool = False) -> None:
        surface = scene.model.surface
        if atlas and surface.kind != "sphere":
            raise RefusalError(
                f"model '{scene.model.name}' has no atlas",
                why="the charts of (7.45) to (7.56) are those of the sphere",
                todo="use set-stabilisation as it is, which needs no charts",
            )
        law = by_charts if atlas else on_surface_predicted if predicted else on_surface
        super().__init__(scene, law, surface, predicted=predicted, pieces=surface.row[np.newaxis])
        self._scene = scene
        self._atlas = atlas

    def diagnostics(self, recording: Recording) -> Mapping[str, tuple[Signal, Array]]:
        """With charts, what Figures 7.7 and 7.8 show: the active chart, the coordinates and the torques of each.

        `eta1` and `eta2` (n, 4) are (t̂_1, its rate, t̂_2, its rate) of (7.10), rad and rad/s; `torque1` and `torque2`
        (n, N) what each chart asks of the joints, N m, on a robot. Of the states that the renderer was given.
        """
        if not self._atlas:
            return {}
        channels = recording.channels
        positions, velocities = (
            channels.get("measured_hip", recording.hip),
            channels.get("measured_velocity", recording.velocity),
        )
        push = channels.get("measured_force")
        signals: dict[str, tuple[Signal, Array]] = {
            "chart": (
                Signal("1", "the chart that the switching law (7.56) uses"),
                active_charts(positions).astype(float),
            )
        }
        answers = charts(self.law.data, positions, velocities, push)
        for number, answer in enumerate(answers, start=1):
            meaning = Signal("rad, rad/s", f"coordinates and rates of chart {number} (7.10)")
            signals[f"eta{number}"] = (meaning, answer.eta)
            if "joint_position" in channels:
                signals[f"torque{number}"] = (
                    Signal("N m", f"joint torque by chart {number}", "joint"),
                    self._torques(answer.force, recording, push),
                )
        return signals

    def _torques(self, forces: Array, recording: Recording, push: Array | None) -> Array:
        """What the inner loop makes of forces (n, 3)."""
        scene = self._scene
        joints, rates = recording.channels["joint_position"], recording.channels["joint_velocity"]
        return scene.inner_loop.torques(scene.believed_robot, joints, rates, forces, mass=scene.mass, push=push)

    def led_out(self, hip: Array, what: str) -> DomainError:
        """Return the error for a hand at `hip` (3,), m, where I + nW is not positive, as `what` says."""
        foot, _, distance, _ = self.surface.closest_point(hip[np.newaxis])
        inwards, outwards = self.surface.medial_distance(foot)[0]
        inside = distance[0] < 0.0
        return DomainError(
            f"{what}: {in_m(hip)}",
            why=f"{abs(distance[0]):.6g} m {'inside' if inside else 'outside'}; the medial set, where the foot is not "
            f"unique and the virtual output is singular, is {inwards if inside else outwards:.6g} m from that foot",
            todo="start nearer to the surface, hold on stiffer, or push less",
        )
