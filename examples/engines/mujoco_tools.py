"""MuJoCo as a renderer, in two ways: asked for the depth, or moving a tool that the hand holds by a spring.

hapticeval run solids -r hapticeval.examples.engines.mujoco_tools:Stiff
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from hapticeval import RefusalError, Scene
from hapticeval.adapters.outside import Outside
from hapticeval.examples.engines.shown import ContactOnly

RADIUS = 1e-4
"""Radius of the tool, m: MuJoCo has no points."""

MOST_CUTS = 100
"""Faces of a model up to which its planes are tried as cuts."""


def load(scene: Scene, solids: Sequence[tuple[np.ndarray, np.ndarray]], solref: str = "0.02 1") -> mujoco.MjModel:
    """Return a world with fixed meshes, vertices (n, 3), m, and triangles (k, 3), and a ball that slides along axes."""
    assets = geoms = ""
    for number, (vertices, cells) in enumerate(solids):
        corners = " ".join(f"{x:.17g}" for x in vertices.ravel())
        faces = " ".join(str(corner) for corner in cells.ravel())
        assets += f'<mesh name="solid{number}" inertia="shell" vertex="{corners}" face="{faces}"/>'
        geoms += f'<geom type="mesh" mesh="solid{number}" solref="{solref}" condim="1"/>'
    if scene.motion is not None:  # a body that moves as it is told to is MuJoCo's mocap body
        geoms = f'<body mocap="true">{geoms}</body>'
    axes = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{scene.sampling_time}"/>
        <asset>{assets}</asset>
        <worldbody>{geoms}<body name="tool">{axes}
        <geom type="sphere" size="{RADIUS}" mass="{scene.mass}" solref="{solref}" condim="1"/>
        </body></worldbody></mujoco>"""
    )


class Placed:
    """What places the model's body, where that moves: its pose is the mocap body's."""

    supports = frozenset({"moving", "space"})
    state: Any

    def place(self, rotation: np.ndarray, translation: np.ndarray) -> None:
        """Take the pose of the model, (3, 3) and (3,), m."""
        self.state.mocap_pos[0] = translation
        mujoco.mju_mat2Quat(self.state.mocap_quat[0], rotation.ravel())


class Query(Placed):
    """The depth and normal that MuJoCo gives at the hand, and a spring."""

    def __init__(self, scene: Scene) -> None:
        self.stiffness = scene.stiffness
        given = Outside(scene)
        # How far the ball stays off the model: its radius, and the facets' own error where the model is smooth.
        vars(self).update(given.lengths(RADIUS, 0.0))
        self.world = load(scene, self.solids(given))
        self.state = mujoco.MjData(self.world)

    def solids(self, given: Outside) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the meshes of the world: vertices (n, 3), m, and triangles (k, 3)."""
        return [(given.facets.vertices, given.facets.cells)]

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
        # MuJoCo's normal leads from the first geom of a pair to the second, and the tool is the last
        outwards = 1.0 if contact.geom[1] == self.world.ngeom - 1 else -1.0
        out = outwards * np.array(contact.frame[:3]) * -float(contact.dist)
        return hip + out, self.stiffness * out


class Coupled(Placed):
    """A ball of the scene's mass that MuJoCo moves; the hand holds it by the scene's spring, critically damped."""

    solref, contact, substeps = "0.02 1", False, 1

    def __init__(self, scene: Scene) -> None:
        self.stiffness, self.damping = scene.stiffness, 2.0 * math.sqrt(scene.stiffness * scene.mass)
        given = Outside(scene)
        vars(self).update(given.lengths(RADIUS, 0.0))
        facets = given.facets
        self.world = load(scene, [(facets.vertices, facets.cells)], self.solref)
        self.state = mujoco.MjData(self.world)

    def reset(self, hip: np.ndarray) -> None:
        """Start a run with the tool at the hand; the first step, at the same time, says how fast both move."""
        mujoco.mj_resetData(self.world, self.state)  # the body is placed again before the first step
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
        self.world.opt.timestep, touched = dt / self.substeps, 0
        for substep in range(self.substeps):
            # The hand as it was at the step's start, as the tool is: else the tool would run ahead of it by a step.
            hand = self.hand + substep / self.substeps * (hip - self.hand)
            state.qfrc_applied[:] = self.stiffness * (hand - state.qpos) + self.damping * (velocity - state.qvel)
            mujoco.mj_step(self.world, state)
            touched += state.ncon
        self.contact, self.hand = touched > 0, hip.copy()
        tool = np.array(state.qpos)
        return tool, self.stiffness * (tool - hip) + self.damping * (np.array(state.qvel) - velocity)


class Stiff(Coupled):
    """The same with contacts as stiff as MuJoCo's documentation allows: a time constant of two ticks."""

    solref = "0.002 1"


def half_of(mesh: trimesh.Trimesh, normal: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """Return the points (n, 3), m, that span what of a mesh lies on the side of a plane to which `normal` leads."""
    side = np.sign(np.round((mesh.vertices - corner) @ normal, 12))
    upper = mesh.edges_unique[np.any(side[mesh.edges_unique] > 0.0, axis=1)]
    starts, ends = mesh.vertices[upper[:, 0]], mesh.vertices[upper[:, 1]]
    low, high = (starts - corner) @ normal, (ends - corner) @ normal
    # an edge is cut where it crosses the plane: a + (b - a) h_a / (h_a - h_b), but for what has both ends above it
    crossing = side[upper[:, 0]] * side[upper[:, 1]] < 0.0
    share = np.divide(low, low - high, out=np.zeros_like(low), where=crossing)[:, np.newaxis]
    cuts = (starts + share * (ends - starts))[crossing]
    corners = mesh.vertices[np.unique(upper[side[upper] >= 0.0])]
    return np.vstack([corners, cuts])


class Exact(Query):
    """The query with the normal as good as MuJoCo makes it: `ccd_tolerance` of 1e-12 in place of 1e-6."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.world.opt.ccd_tolerance, self.world.opt.ccd_iterations = 1e-12, 500


class Parts(Query):
    """The query with a model that is not convex cut into two parts that are, as MuJoCo advises."""

    def solids(self, given: Outside) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return both parts. Raises `RefusalError` where no face's plane cuts the model into two convex parts."""
        facets = given.facets
        mesh = trimesh.Trimesh(facets.vertices, facets.cells, process=False)
        few_faces = len(mesh.faces) <= MOST_CUTS
        for normal, corner in zip(mesh.face_normals, mesh.triangles[:, 0], strict=True) if few_faces else ():
            halves = [half_of(mesh, side * normal, corner) for side in (1.0, -1.0)]
            if not all(len(half) for half in halves):  # the plane of a face on the outside cuts nothing
                continue
            # Parts that are convex fill the model, and their hulls no more than it.
            hulls = [ConvexHull(half) for half in halves]
            if math.isclose(sum(hull.volume for hull in hulls), mesh.volume, rel_tol=1e-9):
                return [(hull.points, hull.simplices) for hull in hulls]
        raise RefusalError("a model that one cut does not make convex", todo="decompose it with a tool such as CoACD")


class Fine(Coupled):
    """The coupled tool in ten time steps a tick, with contacts as stiff as that allows: again two steps."""

    solref, substeps = "0.0002 1", 10


class Shown(ContactOnly, Fine):
    """The same, of which the hand is shown the contact alone."""
