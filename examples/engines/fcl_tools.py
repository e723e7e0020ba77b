"""FCL as a renderer: its collision query with a spring, on triangles or a convex body, and a tool behind a spring.

hapticeval run solids -r hapticeval.examples.engines.fcl_tools:Convex
"""

from __future__ import annotations

import math

import fcl
import numpy as np

from hapticeval import RefusalError, Scene
from hapticeval.adapters.outside import Outside
from hapticeval.examples.engines.shown import ContactOnly, is_convex

RADIUS = 1e-4
"""Radius of the tool, m: FCL has no points."""


class Triangles:
    """The deepest contact of a ball at the hand with the model's triangles, and a spring."""

    supports = frozenset({"moving", "space"})

    def __init__(self, scene: Scene) -> None:
        self.stiffness = scene.stiffness
        given = Outside(scene)
        facets = given.facets
        # How far the ball stays off the model: its radius, and the facets' own error where the model is smooth.
        vars(self).update(given.lengths(RADIUS, 0.0))
        self.solid = fcl.CollisionObject(self.shape(facets.vertices, facets.cells))
        self.tool = fcl.CollisionObject(fcl.Sphere(RADIUS))
        self.request = fcl.CollisionRequest(num_max_contacts=64, enable_contact=True)

    def shape(self, vertices: np.ndarray, cells: np.ndarray) -> fcl.CollisionGeometry:
        """Return the body: a soup of triangles."""
        soup = fcl.BVHModel()
        soup.beginModel(len(vertices), len(cells))
        soup.addSubModel(vertices, cells)
        soup.endModel()
        return soup

    def place(self, rotation: np.ndarray, translation: np.ndarray) -> None:
        """Take the pose of the model, (3, 3) and (3,), m."""
        self.solid.setTransform(fcl.Transform(rotation, translation))

    def reset(self, hip: np.ndarray) -> None:
        """Start a run: nothing is remembered."""

    def escape(self, point: np.ndarray) -> np.ndarray:
        """Return the shift (3,), m, that takes a ball at a point (3,), m, out of the solid; zero where it is free."""
        self.tool.setTranslation(point)
        result = fcl.CollisionResult()
        fcl.collide(self.solid, self.tool, self.request, result)
        # The depth is below zero for triangles, and above it for a convex body
        deepest = max(result.contacts, key=lambda contact: abs(contact.penetration_depth), default=None)
        # FCL's normal leads from the first body, the solid, to the second
        return np.zeros(3) if deepest is None else np.array(deepest.normal) * abs(deepest.penetration_depth)

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the HIP moved out of the solid (3,), m, and the spring's force (3,), N."""
        if not np.isfinite(hip).all():
            raise ValueError("the hand's position is missing")
        out = self.escape(hip)
        return hip + out, self.stiffness * out


class Convex(Triangles):
    """The same on a convex body, which has an inside and a depth; a model that is not convex is refused."""

    def shape(self, vertices: np.ndarray, cells: np.ndarray) -> fcl.CollisionGeometry:
        """Return the body. Raises `RefusalError` where the model is smaller than its convex hull."""
        if not is_convex(vertices, cells):
            raise RefusalError("FCL's convex body of a model that is not convex", todo="take its triangles")
        faces = np.column_stack([np.full(len(cells), 3), cells]).ravel()
        return fcl.Convex(vertices, len(cells), faces)


class Coupled(Convex):
    """A point tool of the scene's mass behind the scene's spring, pushed out by a contact spring ten times as stiff."""

    contact = False

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.mass, self.damping = scene.mass, 2.0 * math.sqrt(scene.stiffness * scene.mass)

    def reset(self, hip: np.ndarray) -> None:
        """Start a run with the tool at the hand; the first step, at the same time, says how fast both move."""
        self.hand, self.position, self.speed, self.contact = hip.copy(), hip.copy(), None, False

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Move the tool for a tick, damper implicit; return where it is (3,), m, and the coupling's force (3,), N."""
        if not np.isfinite(hip).all():
            raise ValueError("the hand's position is missing")
        if self.speed is None:  # no time has passed since the reset
            self.speed = velocity.copy()
            return self.position, np.zeros(3)
        out = self.escape(self.position)
        self.contact = bool(out.any())
        # Hand and tool as both are at the tick's start: else the tool would run ahead of the hand by a tick.
        pull = self.stiffness * (self.hand - self.position) + self.damping * velocity + 10.0 * self.stiffness * out
        self.speed = (self.mass * self.speed + dt * pull) / (self.mass + dt * self.damping)
        self.hand, self.position = hip.copy(), self.position + dt * self.speed
        return self.position, self.stiffness * (self.position - hip) + self.damping * (self.speed - velocity)


class OtherSolver(Convex):
    """The convex body with FCL's own solver of depths, GST_INDEP, in place of libccd."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.request = fcl.CollisionRequest(
            num_max_contacts=64, enable_contact=True, gjk_solver_type=fcl.GJKSolverType.GST_INDEP
        )


class Shown(ContactOnly, Coupled):
    """The coupled tool, of which the hand is shown the contact alone."""
