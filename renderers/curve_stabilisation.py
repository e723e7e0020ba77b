"""Set stabilisation on a plane curve as a renderer: gains that hold, models that have a curvature, one tick."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import DomainError, InputError, RefusalError
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.model import Model
from hapticeval.renderer import CompiledLaw
from hapticeval.renderers.curve_law import BEYOND, answer
from hapticeval.renderers.law_renderer import LawRenderer
from hapticeval.renderers.unilateral import MEMORY
from hapticeval.scene import Scene
from hapticeval.types import Array

REFUSALS = {BEYOND: "the hand is at the centre of curvature of its nearest surface point, or beyond it"}


class CurveStabilisation(LawRenderer):
    """Holds the hand on a smooth plane curve, or outside of it, as a frictionless constraint (7.11), (7.14), (7.22).

    The force is that on the hand, F_r = m ÿ_cmd less what the hand pushes where that is sensed: see `curve_law`. An
    inner loop that is `linearised` (6.7) makes the torques of (7.11) of it. The IHIP is the nearest point. Where that
    jumps (the medial axis) the force does too: one point does not show it, and only a centre of curvature is guarded.

    Curves of lines and arcs that join smoothly have a curvature that jumps there. Then so does the force, by m Δκ ṡ^2,
    as that of a rigid contact does; n̈ = v⊥ holds on both sides, and on the surface the speed is kept through it.
    Raises `RefusalError` for a curve with corners, and `InputError` as `check_gains` does.
    """

    def __init__(self, scene: Scene) -> None:
        self.surface: Curve = smooth_curve(scene.model)
        check_gains(scene)
        reals = (scene.stiffness, scene.damping, scene.mass, scene.viscosity, float(scene.bilateral))
        law = CompiledLaw(
            function=answer,
            reals=np.array(reals),
            pieces=np.array(self.surface.pieces),
            samples=np.array(self.surface.samples),
            memory=MEMORY,
            refusals=REFUSALS,
        )
        super().__init__(law, dimension=2)

    def led_out(self, hip: Array, what: str) -> DomainError:
        """Where 1 + n κ <= 0."""
        return DomainError(
            f"{what}: ({hip[0]:.6g}, {hip[1]:.6g}) m",
            why="there the foot is not unique and 1 + n κ vanishes: the virtual output (7.33) is singular",
            todo="start nearer to the surface, hold on stiffer, or push less",
        )


def smooth_curve(model: Model) -> Curve:
    """The model's curve. Raises `RefusalError`, with the first corner, for one without curvature."""
    curve = model.curve
    if curve.corners:
        corner = curve.corners[0]
        x, y = (round(float(each), 9) + 0.0 for each in corner.position)
        error = RefusalError(
            f"model '{model.name}' has {len(curve.corners)} corners, the first at ({x:.6g}, {y:.6g}) m",
            why="set stabilisation follows the curvature of the surface, and a corner has none",
            todo="choose a smooth model (line, circle, ellipse, cassinian, dumbbell), or another renderer: "
            "minimum-distance, constraint",
        )
        error.position = (float(corner.position[0]), float(corner.position[1]))
        raise error
    return curve


def check_gains(scene: Scene) -> None:
    """Raises `InputError` for gains with which a bilateral constraint is unstable at the scene's sampling time.

    Held over T, n̈ = -(K_p n + K_d ṅ)/m becomes, with k = K_p/m and d = K_d/m, a step with the characteristic polynomial

        z^2 - (2 - d T - k T^2/2) z + (1 - d T + k T^2/2)

    whose roots lie in the unit circle (Jury) when the last coefficient is below 1, K_p < 2 K_d / T, and the value at -1
    is positive, K_d < 2 m / T. Along the surface ṡ is multiplied by 1 - b_d T/m each tick: b_d < 2 m / T.

    Not asked of a unilateral contact, where the hand is in the loop and may damp it, nor where the force moves another
    mass than the tool's, as `static` and `compensated` inner loops let it.
    """
    tool_moves = scene.inner_loop is InnerLoop.LINEARISED or scene.robot == PointMass(scene.mass, scene.model.dimension)
    if not (scene.bilateral and tool_moves):
        return
    period, mass = scene.sampling_time, scene.mass
    k, d = 0.5 * scene.stiffness * period**2 / mass, scene.damping * period / mass
    if not k < d < 2.0:
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
