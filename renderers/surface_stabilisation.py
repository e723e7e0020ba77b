"""Set stabilisation on a surface in space as a renderer: without charts, or by the atlas of the sphere."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hapticeval.errors import DomainError, RefusalError
from hapticeval.geometry.surface import Surface
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import CompiledLaw
from hapticeval.renderers import sphere_atlas, surface_law
from hapticeval.renderers.curve_stabilisation import check_gains
from hapticeval.renderers.law_renderer import LawRenderer
from hapticeval.renderers.unilateral import MEMORY
from hapticeval.scene import Scene
from hapticeval.types import Array

REFUSALS = {surface_law.BEYOND: "the hand is at a centre of curvature of its nearest surface point, or beyond it"}


class SurfaceStabilisation(LawRenderer):
    """Holds the hand on a smooth surface, or outside of it, as a frictionless or viscous constraint (7.11), (7.14).

    The force is that on the hand, F_r = m ÿ less what the hand pushes where that is sensed: see `surface_law` and, with
    `charts`, `sphere_atlas`. An inner loop that is `linearised` (6.7) makes the torques of (7.11) of it. The IHIP is
    the nearest point. Where that jumps, in the medial disc of an ellipsoid, the force does too: one point does not show
    it, and only where I + nW is no longer positive is guarded.

    Raises `RefusalError` for a plane model and, with `charts`, for anything but a sphere, and `InputError` for gains
    that are unstable at the sampling time.
    """

    def __init__(self, scene: Scene, *, charts: bool) -> None:
        self.surface: Surface = scene.model.surface
        if charts and self.surface.kind != "sphere":
            raise RefusalError(
                f"model '{scene.model.name}' has no atlas",
                why="the charts of (7.45) to (7.56) are those of the sphere",
                todo="use set-stabilisation as it is, which needs no charts",
            )
        check_gains(scene)
        gains = (scene.stiffness, scene.damping, scene.mass, scene.viscosity, float(scene.bilateral))
        law = CompiledLaw(
            function=sphere_atlas.answer if charts else surface_law.answer,
            reals=np.concatenate([self.surface.row, gains]),
            pieces=np.empty((0, 0)),
            samples=np.empty((0, 0)),
            memory=MEMORY,
            refusals=REFUSALS,
        )
        super().__init__(law, dimension=3)
        self._scene = scene
        self.charts = charts

    def signals(self, recording: Recording) -> Mapping[str, tuple[Signal, Array]]:
        """With charts, what Figures 7.7 and 7.8 show: the active chart, the coordinates and the torques of each.

        `eta1` and `eta2` (n, 4) are (t̂_1, its rate, t̂_2, its rate) of (7.10), rad and rad/s; `torque1` and `torque2`
        (n, N) what each chart asks of the joints, N m, on a robot. Of the states that the renderer was given.
        """
        if not self.charts:
            return {}
        given = recording.channels
        y, yd = given.get("measured_hip", recording.hip), given.get("measured_velocity", recording.velocity)
        scene, push = self._scene, given.get("measured_force")
        told: dict[str, tuple[Signal, Array]] = {
            "chart": (Signal("1", "the chart that the switching law (7.56) uses"), sphere_atlas.active(y).astype(float))
        }
        answers = sphere_atlas.charts(
            y, yd, radius=float(self.surface.reals[0]), stiffness=scene.stiffness, damping=scene.damping,
            mass=scene.mass, viscosity=scene.viscosity, push=push,
        )  # fmt: skip
        for number, answer in enumerate(answers, start=1):
            told[f"eta{number}"] = (Signal("rad, rad/s", f"coordinates and rates of chart {number} (7.10)"), answer.eta)
            if "joint_position" in given:
                told[f"torque{number}"] = (
                    Signal("N m", f"joint torque by chart {number}", "joint"),
                    self._torques(answer.force, recording, push),
                )
        return told

    def _torques(self, forces: Array, recording: Recording, push: Array | None) -> Array:
        """What the inner loop makes of forces (n, 3)."""
        scene = self._scene
        joints, rates = recording.channels["joint_position"], recording.channels["joint_velocity"]
        pushes = [None] * len(forces) if push is None else push
        return np.array(
            [
                scene.inner_loop.torque(scene.robot, *state, mass=scene.mass, push=each)
                for *state, each in zip(joints, rates, forces, pushes, strict=True)
            ]
        )

    def led_out(self, hip: Array, what: str) -> DomainError:
        """Where I + nW is not positive."""
        foot, _, distance, _ = self.surface.frame(hip[np.newaxis])
        inwards, outwards = self.surface.medial_distance(foot)[0]
        inside = distance[0] < 0.0
        return DomainError(
            f"{what}: ({', '.join(f'{x:.6g}' for x in hip)}) m",
            why=f"{abs(distance[0]):.6g} m {'inside' if inside else 'outside'}; the medial set, where the foot is not "
            f"unique and the virtual output is singular, is {inwards if inside else outwards:.6g} m from that foot",
            todo="start nearer to the surface, hold on stiffer, or push less",
        )
