"""The factory behind the name `set-stabilisation`: the surface as a constraint, with a tool's dynamics along it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hapticeval.errors import InputError, RefusalError, UnknownNameError

if TYPE_CHECKING:
    from hapticeval.renderer import Renderer
    from hapticeval.scene import Scene

CURVE, ATLAS = "curve", "atlas"


@dataclass(frozen=True, kw_only=True)
class SetStabilisation:
    """A factory of set stabilisation renderers: on any smooth plane curve, and on smooth surfaces in space.

    `curve` works in the coordinates of the boundary itself; `atlas` in the two charts of thesis (7.45) to (7.56), which
    are those of the sphere. There is no regulation scheme to choose: (7.14) is the only one.
    """

    summary: str = "set stabilisation, thesis chapter 7: feedback linearisation that follows the surface's curvature"
    representation: str = CURVE
    supports = frozenset({"bilateral", "viscosity", "force-sensor", "plane", "space"})

    @property
    def representations(self) -> tuple[str, ...]:
        """The names that `variant` takes."""
        return (CURVE, ATLAS)

    def variant(self, *, regulation: str | None = None, representation: str | None = None) -> SetStabilisation:
        """The same in other coordinates. Raises `InputError` for a scheme, and `UnknownNameError` for another name."""
        if regulation is not None:
            raise InputError(
                f"set-stabilisation has no regulation scheme '{regulation}'",
                why="its transversal controller is (7.14), with the scene's gains",
                todo="leave '+' and the scheme out",
            )
        if representation is not None and representation not in self.representations:
            raise UnknownNameError("representation of set-stabilisation", representation, self.representations)
        return replace(self, representation=representation or self.representation)

    def __call__(self, scene: Scene) -> Renderer:
        """The renderer for a scene. Raises `RefusalError` for a model that it cannot work on."""
        if scene.model.dimension == 3:
            from hapticeval.renderers.stabilisation import SurfaceStabilisation

            return SurfaceStabilisation(scene, atlas=self.representation == ATLAS)
        if self.representation == ATLAS:
            raise RefusalError(
                f"model '{scene.model.name}' has no atlas",
                why="the charts of (7.45) to (7.56) are those of the sphere, and a plane curve needs one coordinate",
                todo="use set-stabilisation as it is",
            )
        from hapticeval.renderers.stabilisation import CurveStabilisation

        return CurveStabilisation(scene)


set_stabilisation = SetStabilisation()
"""The set stabilisation renderer."""
