"""Limits of stiffness that the literature has in closed form, and what this loop gives beside them.

- Passive with any hand, with encoders and Coulomb friction: Abbott and Okamura 2005, a condition that is necessary and
  sufficient for a mass in one direction.
- Stable without a hand, over the delay: the linear condition of Gil and others 2009.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from hapticeval.devices.parallelogram import ENCODER_COUNTS
from hapticeval.effects.actuators import JointFriction
from hapticeval.effects.sensors import Encoder
from hapticeval.renderer import RendererFactory
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.checked_calls import reset_checked, step_checked
from hapticeval.study.limits.loop import Place, Robot, loop_delay, robot_at
from hapticeval.study.limits.search import finite_or_none, rests_after_release
from hapticeval.types import Array

CURVE_FRICTIONS = 10  # joint frictions of the curve, up to three times the one, among them, at which its two parts meet
STROKE_DEPTHS = 4000  # depths over which a hand that goes to and fro is tried, in steps below its shortest stroke
STROKES = (0.001, 0.5, 1.001, 2.001, 5.001, 20.0, 100.0, 1000.0)  # lengths of its stroke, in counts along the normal
STEP = 1e-4  # m into the surface at which the hand is tried: far from leaving it, near enough to keep the robot's pose


class Losses(NamedTuple):
    """What takes up energy in a straight motion of the hand along the wall's normal n, and what misleads the sensors.

    - `damping` b, N s/m: nᵀ J⁻ᵀ D J⁻¹ n, with the viscous losses D of the joints.
    - `force_per_joint_friction`: f_c in N for a friction of 1 N m (or N) in each joint, the sum of |J⁻¹ n|.
    - `encoder_count` Δ, m: twice the largest shift of the hand along n by rounding: the sum of |Jᵀ n| counts.
    """

    damping: float
    force_per_joint_friction: float
    encoder_count: float


def losses_along(robot: Robot, normal: Array, encoder_step: float) -> Losses:
    """Return the losses for a hand that moves along `normal` (N,); `encoder_step` is in rad, or m for a point mass."""
    joint_motion = np.linalg.solve(robot.jacobian, normal)
    return Losses(
        damping=float(joint_motion @ robot.losses @ joint_motion),
        force_per_joint_friction=float(np.abs(joint_motion).sum()),
        encoder_count=encoder_step * float(np.abs(robot.jacobian.T @ normal).sum()),
    )


def passive_with_encoders(losses: Losses, joint_friction: float, dt: float) -> float:
    """Return the stiffness (N/m) up to which a held spring is passive with any hand: min(2 b / T, 2 f_c / Δ).

    `joint_friction` in N m, or N, and `dt` = T in s. J. J. Abbott and A. M. Okamura, Effects of Position Quantization
    and Sampling Rate on Virtual-Wall Passivity, IEEE Transactions on Robotics 21(5), 2005.
    """
    return min(2.0 * losses.damping / dt, 2.0 * losses.force_per_joint_friction * joint_friction / losses.encoder_count)


def stable_with_delay(damping: float, scene: Scene) -> float:
    """Return the stiffness (N/m) up to which the loop is stable: (b + B) / (T / 2 + d), b = `damping` (N s/m).

    B is the scene's damping, T its sampling time, d its delay. A condition for little damping, short delays and fast
    sampling: J. J. Gil, E. Sánchez, T. Hulin, C. Preusche and G. Hirzinger, Stability Boundary for Haptic Rendering:
    Influence of Damping and Delay, Journal of Computing and Information Science in Engineering 9(1), 2009.
    """
    return (damping + scene.damping) / (0.5 * scene.sampling_time + loop_delay(scene))


def encoder_step_of(scene: Scene) -> float | None:
    """Return the step (rad, or m) of the scene's encoders, or of the robot's own (A.1); None for a bare point mass."""
    encoder = scene.effect(Encoder)
    if encoder is not None:
        return encoder.step
    return 2.0 * np.pi / ENCODER_COUNTS if scene.robot.turning else None


def over_friction(factory: RendererFactory, scene: Scene, place: Place) -> Mapping[str, Any] | None:
    """Compute limits over the joint friction: the closed form, the worst of hands, and the loop let go without one.

    None where the closed form does not hold: damping in the renderer, a delay, another inner loop than the static one,
    no losses in the joints, or no encoder.
    """
    step = encoder_step_of(scene)
    robot = robot_at(scene.robot, place.point)
    if step is None or scene.damping or loop_delay(scene) or not robot.losses.any():
        return None
    losses = losses_along(robot, place.normal, step)
    # Where 2 f_c / Δ = 2 b / T.
    corner = losses.damping * losses.encoder_count / (scene.sampling_time * losses.force_per_joint_friction)
    frictions = np.linspace(0.0, 3.0, CURVE_FRICTIONS) * corner
    hands = try_hands(factory, scene, place, step, losses)
    return {
        "joint_friction": frictions.tolist(),
        "encoder_step": step,
        "closed_form": [passive_with_encoders(losses, friction, scene.sampling_time) for friction in frictions],
        "worst_hand": [hands.limit(friction) for friction in frictions],
        "let_go": [
            finite_or_none(
                rests_after_release(factory, with_friction(scene, step, friction), place, losses.encoder_count)
            )
            for friction in frictions
        ],
    }


def with_friction(scene: Scene, encoder_step: float, joint_friction: float) -> Scene:
    """Return the scene with those encoders (rad, or m) and that friction (N m, or N) as its only effects."""
    friction = (JointFriction(float(joint_friction)),) if joint_friction else ()
    return replace(scene, effects=(Encoder(step=encoder_step), *friction))


class WorstHand(NamedTuple):
    """Hands that were tried: the force that each gains for a stiffness of 1 N/m (m), and its stroke (m)."""

    gains: Array
    strokes: Array
    losses: Losses
    dt: float

    def limit(self, joint_friction: float) -> float:
        """Return the stiffness (N/m) above which one of the hands is given energy, with that friction (N m, or N)."""
        gained = self.gains > 0.0
        resistance = (
            self.losses.force_per_joint_friction * joint_friction + self.losses.damping * self.strokes / self.dt
        )
        return float(np.min(2.0 * resistance[gained] / self.gains[gained]))


def try_hands(factory: RendererFactory, scene: Scene, place: Place, encoder_step: float, losses: Losses) -> WorstHand:
    """Try hands that go to and fro between two depths, a tick each way: the worst of paths for a held spring.

    A hand at a + s answers with F(a + s) for the tick in which it goes back to a, and with F(a) for the one in which it
    comes again: it is given (F(a + s) - F(a)) s, and friction and damping take 2 (f_c + b s / T) s of it.
    """
    rigid = replace(scene, device=None, bilateral=True)
    renderer = make_renderer(factory, rigid)
    assert renderer.steps
    device, still = scene.robot, np.zeros_like(place.point)

    @cache  # many depths lie within one count
    def force_where(counts: tuple[float, ...]) -> float:
        """Return the force (N) along the normal that the renderer answers where the encoders say that the hand is."""
        hip = np.asarray(device.position(encoder_step * np.array(counts)))
        reset_checked(renderer, hip)
        return float(step_checked(renderer, 0, hip, still, scene.sampling_time)[1] @ place.normal)

    def forces_at(depths: Array) -> Array:
        """Return the forces (n,), N, at true depths (n,), m, each by joints in whole counts."""
        points = place.point - depths[:, None] * place.normal
        return np.array([force_where(tuple(np.rint(device.joints(point) / encoder_step))) for point in points])

    depths = STEP + losses.encoder_count * np.linspace(0.0, 3.0, STROKE_DEPTHS)
    strokes = losses.encoder_count * np.array(STROKES)
    shallow = forces_at(depths)
    gains = [(forces_at(depths + stroke) - shallow) / scene.stiffness for stroke in strokes]
    return WorstHand(np.concatenate(gains), np.repeat(strokes, STROKE_DEPTHS), losses, scene.sampling_time)
