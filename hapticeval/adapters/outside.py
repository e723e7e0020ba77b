"""What a renderer that is no Python is given of a scene, and what it answers to that: the same for every transport."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.facets import Facets
from hapticeval.geometry.mesh import Mesh
from hapticeval.recordings.recording import backward_difference
from hapticeval.scene import Scene
from hapticeval.types import Array

FINE = {2: 1e-4, 3: 1e-3}
"""The chord error of the edges, and triangles, that are given where no other is asked for, in sizes of the model.

They are some 160 edges of a circle, and 5,120 triangles of a sphere: a renderer without a search tree goes through them
in a tick."""

CLEAR = 1e-4
"""How far outside a tool begins at the least, in sizes of the model."""


@dataclass(frozen=True)
class Outside:
    """A scene as edges or triangles with numbers, for a renderer that asks for a chord error of `max_error` (m)."""

    scene: Scene
    max_error: float = 0.0

    @cached_property
    def facets(self) -> Facets:
        """The model as edges or triangles. Raises as `Model.mesh` does."""
        model = self.scene.model
        return model.mesh(max_error=self.max_error or FINE[model.dimension] * model.size)

    @property
    def numbers(self) -> dict[str, float]:
        """The gains and what else the contact is like, by the names that the header has for them."""
        scene = self.scene
        return {
            "stiffness": scene.stiffness, "damping": scene.damping, "mass": scene.mass,
            "restitution": scene.restitution, "viscosity": scene.viscosity, "sampling_time": scene.sampling_time,
            "chord_error": self.facets.chord_error,
        }  # fmt: skip

    def tool(self, hip: Array, standoff: float = 0.0) -> Array:
        """Return the point (N,), m, that the tool comes from at a reset with the hand at `hip` (N,): free, if possible.

        The hand itself where that is `CLEAR` and the renderer's own `standoff` (m) outside; else the point so far
        outside of the nearest one of the given surface. In a bilateral scene the tool is on the surface.
        """
        boundary: Boundary = self.facets.boundary
        frame = boundary.closest_point(hip[np.newaxis])
        foot, clear = frame.foot[0], standoff + CLEAR * self.scene.model.size
        if self.scene.bilateral:
            return np.asarray(foot)
        if frame.distance[0] >= clear:
            return hip
        outside = foot + clear * frame.normal[0]
        return np.asarray(outside if boundary.signed_distance(outside[np.newaxis])[0] > 0.0 else foot)

    def lengths(self, standoff: float, resolution: float) -> dict[str, Any]:
        """Return the attributes of a renderer with these lengths (m) towards what it is given: those towards the model.

        Where edges or triangles stand for a smooth model, their error adds to its standoff, and its representation is
        blurred over the longest of them at the least.
        """
        boundary, error = self.facets
        if error == 0.0:
            return {"standoff": standoff, "resolution": resolution}
        longest = _longest(boundary) if isinstance(boundary, Mesh) else boundary.resolution
        return {"standoff": standoff + error, "resolution": max(resolution, longest), "surface": boundary}


def _longest(mesh: Mesh) -> float:
    """Return the longest edge, m."""
    corners = mesh.vertices[mesh.triangles]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())


def path_velocities(hips: Array, dt: float) -> Array:
    """Return the velocities (n, N), m/s, that single steps along HIPs (n, N) in steps of `dt` (s) are given."""
    return backward_difference(hips, dt * np.arange(len(hips), dtype=np.float64))
