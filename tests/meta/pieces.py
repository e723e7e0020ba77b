"""God-objects on the edges or triangles that a library is given for a smooth model: right ones, and wrong ones."""

from __future__ import annotations

import numpy as np

from hapticeval.adapters.outside import Outside
from hapticeval.renderer import Response
from hapticeval.scene import Scene


class GodObject:
    """A point that slides on the pieces to where the hand is locally nearest. Honest: under a convex edge it jumps."""

    supports = frozenset({"space"})

    def __init__(self, scene: Scene) -> None:
        outside = Outside(scene)
        self.facets, self.stiffness = outside.facets.boundary, scene.stiffness
        self.__dict__.update(outside.lengths(0.0, 0.0))

    def reset(self, hip: np.ndarray) -> None:
        self.tool: np.ndarray | None = None
        self.ticks = 0

    def step(self, hip: np.ndarray, velocity: np.ndarray, dt: float) -> Response:
        if self.facets.signed_distance(hip[np.newaxis])[0] >= 0.0:
            self.tool = None
            return Response(hip, np.zeros_like(hip))
        self.ticks += 1
        before = self.facets.closest_point(hip[np.newaxis]).foot[0] if self.tool is None else self.tool
        self.tool = self.slide(before, hip)
        return Response(self.tool.copy(), self.stiffness * (self.tool - hip))

    def slide(self, before: np.ndarray, hip: np.ndarray) -> np.ndarray:
        return self.facets.descend(before, hip, step=1e-6)


class Unhurried(GodObject):
    """The same, a tick later. Honest: up to three ticks are granted."""

    def reset(self, hip: np.ndarray) -> None:
        super().reset(hip)
        self.last = hip

    def slide(self, before: np.ndarray, hip: np.ndarray) -> np.ndarray:
        self.last, last = hip, self.last
        return super().slide(before, last)


class Hopping(GodObject):
    """Is 2 mm beside its place in every 50th tick: a step of its own, longer than those that its triangles make."""

    def slide(self, before: np.ndarray, hip: np.ndarray) -> np.ndarray:
        tool = super().slide(before, hip)
        if self.ticks % 50:
            return tool
        way = tool - hip
        aside = np.array([way[1], -way[0], 0.0])
        return self.facets.closest_point((tool + 2e-3 * aside / np.linalg.norm(aside))[np.newaxis]).foot[0]


class Nearest(GodObject):
    """Takes the point nearest to the hand on all of the triangles: deep inside it goes to the other side."""

    def slide(self, before: np.ndarray, hip: np.ndarray) -> np.ndarray:
        return self.facets.closest_point(hip[np.newaxis]).foot[0]


class Chosen(GodObject):
    """One whose surface is a mesh by its own choice: it has no `pieces`."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        del self.pieces
