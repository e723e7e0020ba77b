"""Bullet as a renderer, by pybullet: its closest points with a spring, and a tool behind a spring.

hapticeval run solids -r hapticeval.examples.engines.bullet_tools:Coupled
"""

from __future__ import annotations

import math
import weakref
from typing import Any

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from hapticeval import RefusalError, Scene
from hapticeval.adapters.outside import Outside
from hapticeval.examples.engines.shown import ContactOnly, is_convex
from hapticeval.geometry.representations import Facets

RADIUS = 1e-4
"""Radius of the tool, m: Bullet has no points."""

MARGIN = 1e-3
"""How far a convex hull reaches beyond its vertices unless it is told otherwise, m: pybullet's own default."""

DISTANCE, NORMAL, PUSH = 8, 7, 9
"""Places in a contact of pybullet: signed distance, m; normal of the solid, outwards; force along it, N."""


class World:
    """A world of Bullet's with the model, which is told where it is, and a ball for a tool."""

    supports = frozenset({"moving", "space"})
    margin, swept = MARGIN, False

    def __init__(self, scene: Scene) -> None:
        self.stiffness = scene.stiffness
        given = Outside(scene)
        facets = given.facets
        hull = self.takes_hull(facets)
        # How far the ball stays off the model: its radius, a hull's margin, and the facets' own error.
        vars(self).update(given.lengths(RADIUS + hull * self.margin, 0.0))
        client = pybullet.connect(pybullet.DIRECT)
        weakref.finalize(self, pybullet.disconnect, client)
        self.client = {"physicsClientId": client}
        shape: dict[str, Any] = {"vertices": facets.vertices.tolist()}
        if not hull:
            shape |= {"indices": facets.cells.ravel().tolist(), "flags": pybullet.GEOM_FORCE_CONCAVE_TRIMESH}
        self.solid = self.add(0.0, pybullet.createCollisionShape(pybullet.GEOM_MESH, **shape, **self.client))
        ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=RADIUS, **self.client)
        self.tool = self.add(scene.mass, ball)
        pybullet.changeDynamics(self.solid, -1, collisionMargin=self.margin, **self.client)

    def takes_hull(self, facets: Facets) -> bool:
        """Return whether the model is its convex hull to Bullet, and no triangles."""
        return is_convex(facets.vertices, facets.cells)

    def add(self, mass: float, shape: int) -> int:
        """Return a new body of a mass (kg; 0 does not move by itself), without friction and drag."""
        body: int = pybullet.createMultiBody(mass, shape, useMaximalCoordinates=self.swept, **self.client)
        pybullet.changeDynamics(body, -1, lateralFriction=0.0, linearDamping=0.0, angularDamping=0.0, **self.client)
        return body

    def place(self, rotation: np.ndarray, translation: np.ndarray) -> None:
        """Take the pose of the model, (3, 3) and (3,), m."""
        turn = Rotation.from_matrix(rotation).as_quat()
        pybullet.resetBasePositionAndOrientation(self.solid, translation, turn, **self.client)

    def put_tool(self, point: np.ndarray) -> None:
        """Put the ball at a point (3,), m."""
        pybullet.resetBasePositionAndOrientation(self.tool, point, (0.0, 0.0, 0.0, 1.0), **self.client)


class Query(World):
    """The depth and normal that Bullet gives at the hand, and a spring; a model that is not convex is refused."""

    def takes_hull(self, facets: Facets) -> bool:
        """Return that it is. Raises `RefusalError` where triangles were needed, which have no inside."""
        if not is_convex(facets.vertices, facets.cells):
            raise RefusalError("Bullet's convex hull of a model that is not convex", todo="take a coupled tool")
        return True

    def reset(self, hip: np.ndarray) -> None:
        """Start a run: nothing is remembered."""

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the HIP moved out along the deepest contact's normal (3,), m, and the spring's force (3,), N."""
        if not np.isfinite(hip).all():
            raise ValueError("the hand's position is missing")
        self.put_tool(hip)
        contacts = pybullet.getClosestPoints(self.tool, self.solid, 0.0, **self.client)
        deepest = min(contacts, key=lambda contact: contact[DISTANCE], default=None)
        if deepest is None or deepest[DISTANCE] >= 0.0:
            return hip, np.zeros(3)
        out = np.array(deepest[NORMAL]) * -deepest[DISTANCE]
        return hip + out, self.stiffness * out


class Exact(Query):
    """The query with a hull that has no margin."""

    margin = 0.0


class Coupled(World):
    """A ball of the scene's mass that Bullet moves; the hand holds it by the scene's spring, critically damped.

    The model is its convex hull where it is convex, and triangles elsewhere, as Bullet's manual has it.
    """

    contact, substeps = False, 1

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.damping = 2.0 * math.sqrt(scene.stiffness * scene.mass)

    def reset(self, hip: np.ndarray) -> None:
        """Start a run with the tool at the hand; the first step, at the same time, says how fast both move."""
        self.put_tool(hip)
        self.hand, self.begins, self.contact = hip.copy(), True, False

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return where the tool is (3,), m, and its velocity (3,), m/s."""
        position, _ = pybullet.getBasePositionAndOrientation(self.tool, **self.client)
        velocity, _ = pybullet.getBaseVelocity(self.tool, **self.client)
        return np.array(position), np.array(velocity)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Let the coupling pull the tool for a tick; return where that is (3,), m, and the coupling's force (3,), N."""
        if not np.isfinite(hip).all():
            raise ValueError("the hand's position is missing")
        if self.begins:  # no time has passed since the reset
            pybullet.resetBaseVelocity(self.tool, velocity, (0.0, 0.0, 0.0), **self.client)
            self.begins = False
            return hip.copy(), np.zeros(3)
        pybullet.setTimeStep(dt / self.substeps, **self.client)
        self.contact = False
        for substep in range(self.substeps):
            # The hand as it was at the step's start, as the tool is: else the tool would run ahead of it by a step.
            hand = self.hand + substep / self.substeps * (hip - self.hand)
            tool, speed = self.state()
            pull = self.stiffness * (hand - tool) + self.damping * (velocity - speed)
            pybullet.applyExternalForce(self.tool, -1, pull, tool, pybullet.WORLD_FRAME, **self.client)
            pybullet.stepSimulation(**self.client)
            contacts = pybullet.getContactPoints(self.tool, self.solid, **self.client)
            self.contact |= any(contact[PUSH] > 0.0 for contact in contacts)
        self.hand = hip.copy()
        tool, speed = self.state()
        return tool, self.stiffness * (tool - hip) + self.damping * (speed - velocity)


class Swept(Coupled):
    """The same on triangles of any model, with the ball swept from step to step, as Bullet has it for what is fast."""

    swept, margin = True, 0.0

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        pybullet.changeDynamics(self.tool, -1, ccdSweptSphereRadius=RADIUS, **self.client)
        pybullet.setPhysicsEngineParameter(allowedCcdPenetration=RADIUS, **self.client)

    def takes_hull(self, facets: Facets) -> bool:
        """Return that it is triangles."""
        return False


class Fine(Coupled):
    """The coupled tool in ten time steps a tick."""

    substeps = 10


class Shown(ContactOnly, Fine):
    """The same, of which the hand is shown the contact alone."""
