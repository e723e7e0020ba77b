"""MuJoCo as a renderer, in two ways: asked for the depth, or moving a tool that the hand holds by a spring.

hapticeval run solids -r hapticeval.examples.engines.mujoco_tools:Stiff
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from hapticeval import Scene
from hapticeval.adapters.outside import Outside

RADIUS = 1e-4
"""Radius of the tool, m: MuJoCo has no points."""


def load(given: Outside, solref: str = "0.02 1") -> mujoco.MjModel:
    """Return a world with the scene's model as a fixed mesh, and a ball that slides along three axes."""
    scene, facets = given.scene, given.facets
    vertices = " ".join(f"{x:.17g}" for x in facets.vertices.ravel())
    faces = " ".join(str(corner) for corner in facets.cells.ravel())
    axes = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{scene.sampling_time}"/>
        <asset><mesh name="solid" inertia="shell" vertex="{vertices}" face="{faces}"/></asset>
        <worldbody><geom type="mesh" mesh="solid" solref="{solref}" condim="1"/>
        <body name="tool">{axes}<geom type="sphere" size="{RADIUS}" mass="{scene.mass}" solref="{solref}" condim="1"/>
        </body></worldbody></mujoco>"""
    )


class Query:
    """The depth and normal that MuJoCo gives at the hand, and a spring."""

    supports = frozenset({"space"})

    def __init__(self, scene: Scene) -> None:
        self.stiffness = scene.stiffness
        given = Outside(scene)
        # How far the ball stays off the model: its radius, and the facets' own error where the model is smooth.
        vars(self).update(given.lengths(RADIUS, 0.0))
        self.world = load(given)
        self.state = mujoco.MjData(self.world)

    def reset(self, hip: np.ndarray) -> None:
        """Start a run: nothing is remembered."""
        mujoco.mj_resetData(self.world, self.state)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the HIP moved out along the deepest contact's normal (3,), m, and the spring's force (3,), N."""
        if not np.isfinite(hip).all():
            raise ValueError("the hand's position is missing")
        self.state.qpos[:] = hip
        mujoco.mj_kinematics(self.world, self.state)
        mujoco.mj_collision(self.world, self.state)
        contact = min(self.state.contact, key=lambda contact: float(contact.dist), default=None)
        if contact is None or contact.dist >= 0.0:
            return hip, np.zeros(3)
        # MuJoCo's normal leads from the first geom of a pair to the second, and geom 0 is the solid
        outwards = 1.0 if contact.geom[0] == 0 else -1.0
        out = outwards * np.array(contact.frame[:3]) * -float(contact.dist)
        return hip + out, self.stiffness * out


class Coupled:
    """A ball of the scene's mass that MuJoCo moves; the hand holds it by the scene's spring, critically damped."""

    supports = frozenset({"space"})
    solref, contact = "0.02 1", False

    def __init__(self, scene: Scene) -> None:
        self.stiffness, self.damping = scene.stiffness, 2.0 * math.sqrt(scene.stiffness * scene.mass)
        given = Outside(scene)
        vars(self).update(given.lengths(RADIUS, 0.0))
        self.world = load(given, self.solref)
        self.state = mujoco.MjData(self.world)

    def reset(self, hip: np.ndarray) -> None:
        """Start a run with the tool at the hand; the first step, at the same time, says how fast both move."""
        mujoco.mj_resetData(self.world, self.state)
        self.state.qpos[:] = hip
        self.hand, self.begins, self.contact = hip.copy(), True, False

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Let the coupling pull the tool for a tick; return where that is (3,), m, and the coupling's force (3,), N."""
        if not np.isfinite(hip).all():
            raise ValueError("the hand's position is missing")
        state: Any = self.state
        if self.begins:  # no time has passed since the reset
            state.qvel[:], self.begins = velocity, False
            return np.array(state.qpos), np.zeros(3)
        # The hand as it was at the tick's start, as the tool is: else the tool would run ahead of it by a tick.
        state.qfrc_applied[:] = self.stiffness * (self.hand - state.qpos) + self.damping * (velocity - state.qvel)
        self.world.opt.timestep, self.hand = dt, hip.copy()
        mujoco.mj_step(self.world, state)
        self.contact = state.ncon > 0
        tool = np.array(state.qpos)
        return tool, self.stiffness * (tool - hip) + self.damping * (np.array(state.qvel) - velocity)


class Stiff(Coupled):
    """The same with contacts as stiff as MuJoCo's documentation allows: a time constant of two ticks."""

    solref = "0.002 1"
