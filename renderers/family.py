"""The factories behind the names BASE[+SCHEME][@REPRESENTATION]: a projection in all its variants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING

from hapticeval.errors import InputError, RefusalError, UnknownNameError
from hapticeval.renderer import Knob, Settings, at_rest, refuse_unknown
from hapticeval.renderers.regulation import REGULATIONS

if TYPE_CHECKING:
    from hapticeval.renderer import Renderer
    from hapticeval.renderers.projective import Projection
    from hapticeval.scene import Scene


VERTICES_KNOB = Knob(
    values=(20, 40, 80, 160, 320, 640, 1280, 2560),
    quick=(40, 160, 640),
    unit="",
    meaning="vertices of the polygon, at equal steps of the curve's parameter",
)
GRID_KNOB = Knob(
    values=(50, 100, 200, 400, 800),
    quick=(50, 100, 200),
    unit="",
    meaning="nodes of the level set along each side",
)
NODES_KNOB = Knob(
    values=(80, 160, 320, 640, 1280),
    quick=(80, 320, 1280),
    finest=(1280, 2560),
    unit="",
    meaning="nodes of the conformal map's boundary integral",
)

CELL_KNOB = Knob(
    values=(4e-3, 2e-3, 1e-3, 0.5e-3, 0.25e-3),
    quick=(2e-3, 0.5e-3),
    unit="m",
    meaning="side of a cell of the look-up table",
)

FRONT_KNOB = Knob(
    values=(400, 800, 1600),
    quick=(200, 400, 800),
    unit="",
    meaning="nodes of a front that is followed by points, without a grid",
)
"""Each value is twice the one before it: what is left of the error is told by that (Richardson)."""

SAMPLES_KNOB = Knob(
    values=(400, 800, 1600),
    quick=(200, 400, 800),
    unit="",
    meaning="samples of the boundary, between which the place is bisected",
)

FLOW_KNOBS = {
    "cells": Knob(
        values=(50, 100, 150, 200, 300),
        quick=(50, 100, 200),
        finest=(300, 400),
        unit="",
        meaning="cells of the flow grid along the model's longer side",
    ),
    "lines": Knob(
        values=(50, 100, 200, 400, 800), quick=(100, 400), unit="", meaning="transversal lines of the flow grid"
    ),
    "gap": Knob(
        values=(0.2, 0.05, 0.01, 1e-3, 1e-6),
        quick=(0.05, 1e-6),
        unit="",
        meaning="least distance of transversal lines as a share of their mean; 0.05 makes the map of a star continuous",
    ),
    "levels": Knob(
        values=(10, 20, 40, 60, 80, 100), quick=(20, 40), unit="", meaning="tangential levels of the flow grid"
    ),
}

LUT = "lut"
"""The representation that is a table of what the projection answers on its `TABULATED` one (thesis 6.2)."""

TABULATED = "curve"

REPRESENTATIONS = ("curve", "polygon", "level-set", LUT)


@dataclass(frozen=True, kw_only=True)
class ProjectiveFamily:
    """A factory of projective renderers, and, by `variant`, of those with another scheme or representation.

    Calling it with a scene builds the renderer, with `project(scene, representation, **settings)` as its projection.

    - `project`: module:function of this package, which is imported with the first renderer.
    - `representations`: those that it can work on, and `representation` the one that it does. On `lut`, which a family
      without memory may list, the projection is read from a table.
    - `regulation`: its scheme, and `refused` why it cannot work on the other representations.
    - `bends`: whether the projection knows the curvature where it projects to on the exact curve, for schemes that need
      it; `potential`: whether it has one for `gradient`; `space`: whether there is a form for models in space too.
    - `offered_knobs`: the knobs of each representation, and `settings` those that are set.
    - `independent`: module:function of the same projection computed another way, which has `independent_knobs`.

    A model of straight edges is its own polygon, and so is a mesh: there polygon and curve coincide. The line is
    unbounded and has no finite polygon or grid: there every representation means the exact line.
    """

    summary: str
    project: str
    representations: tuple[str, ...]
    representation: str
    regulation: str = "pp"
    refused: str = ""
    bends: bool = False
    potential: bool = False
    space: bool = False
    offered_knobs: Mapping[str, Mapping[str, Knob]] = field(default_factory=dict)
    settings: Settings = field(default_factory=dict)
    independent: str = ""
    independent_knobs: Mapping[str, Knob] = field(default_factory=dict)

    @property
    def reference(self) -> ProjectiveFamily | None:
        """The same projection, computed another way: what errors count from; None where there is none."""
        if not self.independent:
            return None
        return replace(
            self,
            project=self.independent,
            offered_knobs={self.representation: self.independent_knobs},
            settings={},
            independent="",
        )

    @property
    def regulations(self) -> tuple[str, ...]:
        """The names of the regulation schemes that `variant` takes."""
        return tuple(
            name
            for name, regulation in REGULATIONS.items()
            if (self.bends or not regulation.bends) and (self.potential or not regulation.potential)
        )

    @property
    def supports(self) -> frozenset[str]:
        """What its renderers can beside unilateral contact: hold from both sides.

        They need no force sensor: what it measures the inner loop gives to the tool (8.6), beside their force.
        Viscosity (7.18) they do not have: no scheme of section 4.2 brakes along the surface alone.
        """
        space = self.space and self.representation in (TABULATED, "polygon", LUT)
        return frozenset({"bilateral", "force-sensor", "moving", "plane"} | ({"space"} if space else set()))

    @property
    def knobs(self) -> Mapping[str, Knob]:
        """What can be set finer or coarser on this representation, by name."""
        return self.offered_knobs.get(self.representation, {})

    def with_knobs(self, **values: float) -> ProjectiveFamily:
        """The same with some knobs set. Raises `UnknownNameError` for one that this representation does not have."""
        refuse_unknown(values, self.knobs, name=f"the {self.representation} representation")
        return replace(self, settings={**self.settings, **values})

    def variant(self, *, regulation: str | None = None, representation: str | None = None) -> ProjectiveFamily:
        """The same projection with another regulation scheme or on another representation; None keeps this one's.

        Raises `UnknownNameError` for a name that is not known, and `InputError` for a representation that this
        projection cannot work on.
        """
        # an unknown name is one error, a known one that does not go with this projection another
        if regulation is not None and regulation not in REGULATIONS:
            raise UnknownNameError("regulation scheme", regulation, self.regulations)
        if representation is not None and representation not in self.representations:
            if representation in REPRESENTATIONS:
                raise InputError(
                    f"representation '{representation}' is not for this projection",
                    why=self.refused if representation != LUT else "it remembers, and a table holds no past (6.2)",
                    todo=f"use one of: {', '.join(self.representations)}",
                )
            raise UnknownNameError("representation", representation, self.representations)
        representation_name = representation or self.representation
        scheme_name = regulation or self.regulation
        if REGULATIONS[scheme_name].bends and not (self.bends and representation_name == TABULATED):
            raise InputError(
                f"regulation scheme '{scheme_name}' is not for this projection on '{representation_name}'",
                why="it needs the curvature of the surface at the nearest point of the exact curve",
                todo=f"use minimum-distance+{scheme_name}@{TABULATED}, or set-stabilisation",
            )
        if REGULATIONS[scheme_name].potential and not self.potential:
            raise InputError(
                f"regulation scheme '{scheme_name}' is not for this projection",
                why="its force is the gradient of a potential that is made with the projection, and this has none",
                todo=f"use homothetic+{scheme_name} or combescure+{scheme_name}",
            )
        settings = {
            name: value
            for name, value in self.settings.items()
            if name in self.offered_knobs.get(representation_name, {})
        }
        return replace(self, regulation=scheme_name, representation=representation_name, settings=settings)

    def __call__(self, scene: Scene) -> Renderer:
        """The renderer for a scene; its gains are the scene's."""
        from hapticeval.renderers.projective import ProjectiveRenderer

        return at_rest(ProjectiveRenderer(self._projection(scene), REGULATIONS[self.regulation], scene), scene)

    def _projection(self, scene: Scene) -> Projection:
        module, _, function = self.project.partition(":")
        project: Callable[..., Projection] = getattr(import_module(f"hapticeval.renderers.{module}"), function)
        if self.representation != LUT:
            return project(scene, self.representation, **self.settings)
        from hapticeval.renderers.lut import tabulated

        return tabulated(project, scene, TABULATED, **self.settings)


CURVE, ATLAS, PREDICTED = "curve", "atlas", "predicted"


@dataclass(frozen=True, kw_only=True)
class SetStabilisation:
    """A factory of set stabilisation renderers: on any smooth plane curve, and on smooth surfaces in space.

    `curve` works in the coordinates of the boundary itself; `atlas` in the two charts of thesis (7.45) to (7.56), which
    are those of the sphere. The regulation scheme is (7.14); `predicted` evaluates it where the tool will be when the
    force acts.
    """

    summary: str = "set stabilisation, thesis chapter 7: feedback linearisation that follows the surface's curvature"
    representation: str = CURVE
    predicted: bool = False
    regulations = (PREDICTED,)
    supports = frozenset({"bilateral", "viscosity", "force-sensor", "moving", "plane", "space"})

    @property
    def representations(self) -> tuple[str, ...]:
        """The names that `variant` takes."""
        return (CURVE, ATLAS)

    def variant(self, *, regulation: str | None = None, representation: str | None = None) -> SetStabilisation:
        """The same in other coordinates, or predicted. Raises `InputError` for what is not known, or not together."""
        if regulation not in (None, *self.regulations):
            raise InputError(
                f"set-stabilisation has no regulation scheme '{regulation}'",
                why="its transversal controller is (7.14), with the scene's gains",
                todo=f"leave '+' and the scheme out, or use +{PREDICTED}",
            )
        if representation is not None and representation not in self.representations:
            raise UnknownNameError("representation of set-stabilisation", representation, self.representations)
        chosen = replace(
            self,
            representation=representation or self.representation,
            predicted=self.predicted or regulation is not None,
        )
        if chosen.predicted and chosen.representation == ATLAS:
            raise InputError(
                f"set-stabilisation+{PREDICTED} has no charts",
                why="the prediction is one of place and velocity in space",
                todo=f"use set-stabilisation+{PREDICTED}, or set-stabilisation@{ATLAS}",
            )
        return chosen

    def __call__(self, scene: Scene) -> Renderer:
        """The renderer for a scene. Raises `RefusalError` for a model that it cannot work on."""
        if scene.model.dimension == 3:
            from hapticeval.renderers.stabilisation import SurfaceStabilisation

            controller = SurfaceStabilisation(scene, atlas=self.representation == ATLAS, predicted=self.predicted)
            return at_rest(controller, scene)
        if self.representation == ATLAS:
            raise RefusalError(
                f"model '{scene.model.name}' has no atlas",
                why="the charts of (7.45) to (7.56) are those of the sphere, and a plane curve needs one coordinate",
                todo="use set-stabilisation as it is",
            )
        from hapticeval.renderers.stabilisation import CurveStabilisation

        return at_rest(CurveStabilisation(scene, predicted=self.predicted), scene)


set_stabilisation = SetStabilisation()
"""The set stabilisation renderer."""
