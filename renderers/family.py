"""The factories behind the names BASE[+SCHEME][@REPRESENTATION]: a projection in all its variants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.renderers.regulation import REGULATIONS

if TYPE_CHECKING:
    from hapticeval.renderers.projection import Projection
    from hapticeval.renderers.projective import ProjectiveRenderer
    from hapticeval.scene import Scene

VERTICES = 40
"""Vertices of the polygon representation (thesis 4.1.1)."""

GRID = (100, 100)
"""Nodes of the level set representation (thesis 4.1.1)."""

REPRESENTATIONS = ("curve", "polygon", "level-set")


@dataclass(frozen=True, kw_only=True)
class ProjectiveFamily:
    """A factory of projective renderers, and, by `variant`, of those with another scheme or representation.

    Calling it with a scene builds the renderer. A model of straight edges is its own polygon: there polygon and curve
    coincide. The line is unbounded and has no finite polygon or grid: there every representation means the exact line.
    """

    summary: str
    project: Callable[[Scene, str], Projection]
    representations: tuple[str, ...]
    representation: str
    regulation: str = "pp"
    refused: str = ""

    @property
    def regulations(self) -> tuple[str, ...]:
        """The names of the regulation schemes that `variant` takes."""
        return tuple(REGULATIONS)

    def variant(self, *, regulation: str | None = None, representation: str | None = None) -> ProjectiveFamily:
        """The same projection with another regulation scheme or on another representation; None keeps this one's.

        Raises `UnknownNameError` for a name that is not known, and `InputError` for a representation that this
        projection cannot work on.
        """
        if regulation is not None and regulation not in REGULATIONS:
            raise UnknownNameError("regulation scheme", regulation, self.regulations)
        if representation is not None and representation not in self.representations:
            if representation in REPRESENTATIONS:
                raise InputError(
                    f"representation '{representation}' is not for this projection",
                    why=self.refused,
                    todo=f"use one of: {', '.join(self.representations)}",
                )
            raise UnknownNameError("representation", representation, self.representations)
        return replace(
            self,
            regulation=regulation or self.regulation,
            representation=representation or self.representation,
        )

    def __call__(self, scene: Scene) -> ProjectiveRenderer:
        """The renderer for a scene; its gains are the scene's."""
        from hapticeval.renderers.projective import ProjectiveRenderer

        return ProjectiveRenderer(
            self.project(scene, self.representation),
            REGULATIONS[self.regulation],
            stiffness=scene.stiffness,
            damping=scene.damping,
        )


def by_constraint(scene: Scene, representation: str) -> Projection:
    """The constraint projection (4.3) on a representation of the scene's model."""
    from hapticeval.renderers.god_object import ConstraintProjection
    from hapticeval.renderers.outline import outline_of

    return ConstraintProjection(outline_of(scene.model, representation), bilateral=scene.bilateral)


def by_minimum_distance(scene: Scene, representation: str) -> Projection:
    """The minimum distance projection (4.2) on a representation of the scene's model."""
    from hapticeval.renderers.nearest_point import MinimumDistanceProjection
    from hapticeval.renderers.outline import outline_of

    if representation == "level-set" and scene.model.curve.closed:
        from hapticeval.renderers.nearest_contour import LevelSetProjection

        return LevelSetProjection(scene.model, GRID, bilateral=scene.bilateral)
    return MinimumDistanceProjection(outline_of(scene.model, representation), bilateral=scene.bilateral)
