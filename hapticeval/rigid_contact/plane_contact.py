"""The boundary of a plane model under the ideal contact: where the tool starts on it, and how it is carried along."""

from __future__ import annotations

import numpy as np

from hapticeval.compiled import as_record, room_for
from hapticeval.geometry.kernels import U0, U1, piece_index
from hapticeval.rigid_contact.advance import TOOL, carry_tool
from hapticeval.rigid_contact.collision import prepare_boundary
from hapticeval.rigid_contact.contact import ON_BOUNDARY
from hapticeval.rigid_contact.force import FLIGHT, SLIDE, Stretches
from hapticeval.scene import Scene
from hapticeval.types import Array


class PlaneGround:
    """A plane curve as the `Ground` of an ideal contact, unilateral or bilateral: thesis (3.1) to (3.8)."""

    def __init__(self, scene: Scene) -> None:
        self.curve = scene.model.curve
        self._terrain = prepare_boundary(self.curve)

    def in_flight(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.in_flight` for a point (2,), m, and a velocity (2,), m/s."""
        state = np.zeros(room_for(TOOL))
        tool = as_record(state, TOOL)
        tool.mode, tool.x, tool.y, tool.vx, tool.vy = FLIGHT, *point, *velocity
        return state

    def on_boundary(self, point: Array, velocity: Array) -> Array:
        """Answer `Ground.on_boundary` for a point (2,), m, and a velocity (2,), m/s."""
        curve, pieces = self.curve, self._terrain.pieces
        u = float(curve.nearest(point[np.newaxis])[0])
        index = piece_index(pieces, u)
        state = self.in_flight(curve.position(u), velocity)
        for joint in (pieces[index, U0], pieces[index, U1]):
            # beside a joint it starts at the joint, so that corners are seen
            if abs(u - joint) <= ON_BOUNDARY:
                u = float(joint)
        tool = as_record(state, TOOL)
        tool.mode, tool.piece, tool.u = SLIDE, index, u
        return state

    def carry(
        self, start: Array, stretches: Stretches, gains: Array, rows: int, limit: int
    ) -> tuple[Array, Array, int, Array]:
        """Answer `Ground.carry`: samples (rows, 8) and events (k, 6), in m, m/s, s and N s."""
        return carry_tool(start, self._terrain, stretches, gains, rows, limit)
