"""What a renderer outside of Python is given of a scene, as facets and numbers, and where its tool starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.pose import Pose
from hapticeval.geometry.representations import Facets
from hapticeval.scene import Scene
from hapticeval.types import Array

CLEARANCE_SHARE = 1e-4
"""How far outside of the surface a tool starts at least, as a share of the model's size."""


RING_GROWTH, RING_COUNT = 1.25, 60
"""Growth of the rings on which a free start is looked for, and their number.

The last is 1.25^59 = 5.2e5 times as wide as the clearance, which is 52 times the model's size at least. *Chosen*: in
the corner of a cube the start lies at most a quarter further away than the nearest.
"""


@dataclass(frozen=True)
class Outside:
    """A scene as facets and numbers; `max_error` (m) is how far facets may lie from the model, 0 for the default."""

    scene: Scene
    max_error: float = 0.0

    @cached_property
    def facets(self) -> Facets:
        """The model as edges or triangles. Raises as `Model.mesh` does."""
        return self.scene.model.mesh(max_error=self.max_error or None)

    @property
    def numbers(self) -> dict[str, float]:
        """The scene's gains and other numbers, in SI units, by the names that the header has for them."""
        scene = self.scene
        return {
            "stiffness": scene.stiffness, "damping": scene.damping, "mass": scene.mass,
            "restitution": scene.restitution, "viscosity": scene.viscosity, "sampling_time": scene.sampling_time,
            "chord_error": self.facets.chord_error,
        }  # fmt: skip

    def tool(self, hip: Array, standoff: float = 0.0, pose: Pose | None = None) -> Array:
        """Return the point (N,), m, at which the tool starts after a reset with the hand at `hip` (N,), m: a free one.

        Free is what lies outside of the facets by `CLEARANCE_SHARE` of the model's size and `standoff` (m). It is the
        first of these that is free:

        - the hand itself;
        - the point straight off the nearest one of the surface;
        - one beside that: see `_clear_point`.

        In a bilateral scene the tool starts on the surface. With the `pose` of a body that moves both are in the world.
        """
        if pose is not None:
            return pose.to_world(self._tool_at_rest(pose.to_body(hip), standoff))
        return self._tool_at_rest(hip, standoff)

    def _tool_at_rest(self, hip: Array, standoff: float) -> Array:
        """Return the point (N,), m, at which the tool starts: see `tool`; both in the frame of the body."""
        boundary: Boundary = self.facets.boundary
        frame = boundary.closest_point(hip[np.newaxis])
        foot, clear = frame.foot[0], standoff + CLEARANCE_SHARE * self.scene.model.size
        # A bilateral contact never ends: its tool starts on the surface.
        if self.scene.bilateral:
            return np.asarray(foot)
        if frame.distance[0] >= clear:
            return hip
        return _clear_point(boundary, foot, frame.normal[0], clear)

    def lengths(self, standoff: float, resolution: float) -> dict[str, Any]:
        """Return `standoff` and `resolution` (m) of a renderer towards the model, from those towards its facets.

        Where facets stand for a smooth model, their error adds to the standoff, and the resolution is at least their
        longest edge; the facets are then the renderer's own surface. The names are attributes of a renderer.
        """
        boundary, error = self.facets
        if error == 0.0:
            return {"standoff": standoff, "resolution": resolution}
        longest = _longest_edge(boundary) if isinstance(boundary, Mesh) else boundary.resolution
        lengths = {"standoff": standoff + error, "resolution": max(resolution, longest)}
        return {**lengths, "surface": boundary, "pieces": boundary}


def _clear_point(boundary: Boundary, foot: Array, normal: Array, clear: float) -> Array:
    """Return a point (N,), m, that is `clear` (m) outside of a boundary, near its point `foot` (N,) with this `normal`.

    Straight off it where that is free; else on rings of growing radius round it:

    - the nearest free point with an open line to it;
    - in a slot too narrow for that, the nearest free point. Far out all are free.
    """
    straight_point = foot + clear * normal
    # A rounding less: of a plane face the distance comes out as `clear` but for the last digits.
    least_distance = (1.0 - 1e-9) * clear
    if boundary.signed_distance(straight_point[np.newaxis])[0] >= least_distance:
        return np.asarray(straight_point)
    directions = _spread_directions(foot.size)
    # A line from the surface itself would cross it: sight begins a thousandth of the clearance above.
    start, free_points = foot + 1e-3 * clear * normal, []
    for radius in clear * RING_GROWTH ** np.arange(RING_COUNT):
        ring = foot + radius * directions
        ring = ring[boundary.signed_distance(ring) >= least_distance]
        free_points += list(ring)
        # The points most along the normal come first, in the same order on every machine.
        for point in ring[np.argsort(-(ring - foot) @ normal, kind="stable")]:
            if boundary.first_crossing(point, start, grain=clear) is None:
                return np.asarray(point)
    return np.asarray(free_points[0] if free_points else straight_point)


def _spread_directions(dimension: int) -> Array:
    """Return some 100 unit vectors (k, N), evenly spread: in space on a spiral."""
    count = np.arange(100) + 0.5
    if dimension == 2:
        return np.column_stack([np.cos(0.02 * np.pi * count), np.sin(0.02 * np.pi * count)])
    # A golden spiral: even steps in height, and pi (1 + sqrt 5) rad from each point to the next.
    height, turn = 1.0 - 0.02 * count, np.pi * (1.0 + math.sqrt(5.0)) * count
    across = np.sqrt(1.0 - height**2)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), height])


def _longest_edge(mesh: Mesh) -> float:
    """Return the longest edge, m."""
    corners = mesh.vertices[mesh.triangles]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
