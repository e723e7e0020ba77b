"""Set stabilisation on a surface in space as a renderer: without charts, or by the atlas of the sphere."""

from __future__ import annotations

import numpy as np

from hapticeval.errors import DomainError, RefusalError
from hapticeval.geometry.surface import Surface
from hapticeval.renderer import CompiledLaw, Response
from hapticeval.renderers import sphere_atlas, surface_law
from hapticeval.renderers.curve_stabilisation import check_gains
from hapticeval.scene import Scene
from hapticeval.types import Array

REFUSALS = {surface_law.BEYOND: "the hand is at a centre of curvature of its nearest surface point, or beyond it"}


class SurfaceStabilisation:
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
        self._law = CompiledLaw(
            function=sphere_atlas.answer if charts else surface_law.answer,
            reals=np.concatenate([self.surface.row, gains]),
            pieces=np.empty((0, 0)),
            samples=np.empty((0, 0)),
            memory=1,
            refusals=REFUSALS,
        )
        self._memory = np.zeros(1)
        self._push = np.zeros(3)

    @property
    def law(self) -> CompiledLaw:
        """The same step for compiled loops."""
        return self._law

    def reset(self, hip: Array) -> None:  # noqa: ARG002 - the protocol's
        """Start a run: nothing is touched yet, and nothing felt."""
        self._memory[:] = 0.0
        self._push[:] = 0.0

    def feel(self, push: Array) -> None:
        """The measured force of the hand on the tool (3,), N, for the ticks that follow."""
        self._push[:] = push

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (3,), m; `velocity` (3,), m/s; `dt`, s. Raises `DomainError` where I + nW is not positive."""
        ihip, force = np.empty(3), np.empty(3)
        law, hip = self._law, np.array(hip, dtype=np.float64)
        velocity = np.array(velocity, dtype=np.float64)
        refusal = law.function(
            law.reals, law.pieces, law.samples, self._memory, hip, velocity, self._push, dt, ihip, force
        )
        if refusal:
            raise self._led_out(hip, law.refusals[refusal])
        return Response(ihip, force)

    def _led_out(self, hip: Array, what: str) -> DomainError:
        foot, _, distance, _ = self.surface.frame(hip[np.newaxis])
        inwards, outwards = self.surface.medial_distance(foot)[0]
        inside = distance[0] < 0.0
        return DomainError(
            f"{what}: ({', '.join(f'{x:.6g}' for x in hip)}) m",
            why=f"{abs(distance[0]):.6g} m {'inside' if inside else 'outside'}; the medial set, where the foot is not "
            f"unique and the virtual output is singular, is {inwards if inside else outwards:.6g} m from that foot",
            todo="start nearer to the surface, hold on stiffer, or push less",
        )
