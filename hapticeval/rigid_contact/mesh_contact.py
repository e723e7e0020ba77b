"""A triangle mesh under the ideal contact: where the tool starts on it, and how it is carried along."""

from __future__ import annotations

import numpy as np

from hapticeval.compiled import as_record
from hapticeval.errors import RefusalError
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.mesh_kernels import closest_feature
from hapticeval.rigid_contact.contact import ON_BOUNDARY
from hapticeval.rigid_contact.force import SLIDE, Stretches
from hapticeval.rigid_contact.mesh_advance import carry_on_mesh
from hapticeval.rigid_contact.mesh_terrain import feature_at, prepare_mesh
from hapticeval.rigid_contact.space import SPACE_TOOL, state_in_flight
from hapticeval.scene import Scene
from hapticeval.types import Array


class MeshGround:
    """A triangle mesh as the `Ground` of an ideal contact: flat faces, edges and corners, unilateral.

    Raises `RefusalError` for a bilateral scene.
    """

    def __init__(self, scene: Scene) -> None:
        boundary = scene.model.boundary
        assert isinstance(boundary, Mesh)
        if scene.bilateral:
            raise RefusalError(
                f"the mesh '{scene.model.name}' holds the tool from both sides",
                why="a tool that is held loses its velocity across the next face at every convex edge, and in a corner "
                "it has no next face",
                todo="compare on a smooth surface, or in the plane",
            )
        self._mesh = boundary
        self._terrain = prepare_mesh(boundary)

    def in_flight(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.in_flight` for a point (3,), m, and a velocity (3,), m/s."""
        # its triangle and feature are those of its first hit: none is read before
        return state_in_flight(point, velocity)

    def on_boundary(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.on_boundary` for a point (3,), m, and a velocity (3,), m/s."""
        # the search begins at the first triangle, as well as at any
        k, _, foot = closest_feature(*self._mesh.tables, (float(point[0]), float(point[1]), float(point[2])), 0)
        # beside an edge or a corner it starts there, so that these are seen
        feature, place = feature_at(self._terrain, k, foot, ON_BOUNDARY, ON_BOUNDARY)
        state = self.in_flight(np.array(place), velocity)
        tool = as_record(state, SPACE_TOOL)
        tool.mode, tool.triangle, tool.feature = SLIDE, k, feature
        return state

    def carry(
        self, start: Array, stretches: Stretches, gains: Array, rows: int, limit: int
    ) -> tuple[Array, Array, int, Array]:
        """Answer `Ground.carry`: samples (rows, 12) and events (k, 8), in m, m/s, s and N s."""
        return carry_on_mesh(start, self._terrain, stretches, gains, rows, limit)
