"""The rigid object: its exact boundary, and the coarser representations that renderers hold of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from hapticeval.errors import InputError, RefusalError
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.geometry.boundary import Boundary
    from hapticeval.geometry.curve import Curve
    from hapticeval.geometry.motion import Motion
    from hapticeval.geometry.representations import Facets, LevelSet, Polygon
    from hapticeval.geometry.surface import Surface


Prepared = TypeVar("Prepared")

VERTICES = 40
"""Vertices of the polygon representation (thesis 4.1.1)."""

GRID_NODES = 100
"""Nodes of the level set representation along each side (thesis 4.1.1)."""

KIND_BY_PARAMETER = {
    "model": "extruded",
    "triangles": "mesh",
    "file": "mesh",
    "vertices": "polygon",
    "text": "wkt",
    "document": "geojson",
}
"""The first parameter that only models of a kind without a name of its own have, and that kind."""


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A closed plane curve (an extruded cross-section), a half-plane, or a closed surface in space.

    - `parameters` are the JSON values it was made from.
    - `boundary` is the exact boundary, which answers alike in the plane and in space.
    - `curve` and `surface` are the same for what works on plane curves with a parameter, or on the surfaces with
      compiled kernels, alone.

    Representations are made on first use and kept.
    """

    name: str
    parameters: Mapping[str, Any]
    boundary: Boundary
    _prepared: dict[object, Any] = field(default_factory=dict, init=False, repr=False)

    def __repr__(self) -> str:
        parameters = [f"{name}={value!r}" for name, value in self.table.items() if name != "kind"]
        return f"make_model({', '.join([repr(self.table['kind']), *parameters])})"

    @property
    def table(self) -> dict[str, Any]:
        """What a suite file has for it: `kind` and parameters, as `make_model` takes them."""
        # models of a user's shape have a name of their own: the parameters tell the kind
        kind = next((KIND_BY_PARAMETER[name] for name in KIND_BY_PARAMETER if name in self.parameters), self.name)
        return {"kind": kind, **self.parameters}

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.boundary.dimension

    @property
    def curve(self) -> Curve:
        """The boundary as a plane curve. Raises `RefusalError` for a model in space: a plane renderer refuses it."""
        from hapticeval.geometry.curve import as_curve

        curve = as_curve(self.boundary)
        if curve is None:
            raise RefusalError(
                f"model '{self.name}' is a surface in space",
                why="this works on plane curves only, with scene.model.curve",
                todo="choose a renderer for surfaces: minimum-distance, set-stabilisation, and on meshes constraint; "
                "in one of your own use scene.model.boundary, whose closest_point works in the plane and in space",
            )
        return curve

    @property
    def surface(self) -> Surface:
        """The boundary as a surface with kernels. Raises `RefusalError` for a plane model, and one of another kind."""
        from hapticeval.geometry.surface import SURFACE_KINDS, Surface

        if not isinstance(self.boundary, Surface):
            kind = "a plane curve" if self.dimension == 2 else "a mesh, or a boundary of its own kind"
            raise RefusalError(
                f"model '{self.name}' is {kind}",
                why=f"this works on surfaces in space with compiled kernels only: {', '.join(SURFACE_KINDS)}",
            )
        return self.boundary

    def moved(self, motion: Motion) -> Model | None:
        """Return the model moved; None where its boundary does not offer `moved`, or cannot be moved so.

        It is kept, so that what a renderer prepares for it is prepared once.
        """
        # a motion has arrays: their bytes are its identity
        key = ("moved", motion.matrix.tobytes(), motion.scale, motion.shift.tobytes())
        return self._once(key, lambda: self._with_boundary("moved", motion))

    def reordered(self) -> Model | None:
        """Return the model with its vertices in another order; None where its boundary does not offer `reordered`."""
        return self._once("reordered", lambda: self._with_boundary("reordered"))

    def cut(self) -> Model | None:
        """Return the model with its faces cut into other triangles; None where its boundary does not offer `cut`."""
        return self._once("cut", lambda: self._with_boundary("cut"))

    def _with_boundary(self, change: str, *arguments: Any) -> Model | None:
        """Return this model with what a method of its boundary makes of that; None where it offers or makes none."""
        boundary = getattr(self.boundary, change, lambda *_: None)(*arguments)
        return None if boundary is None else Model(self.name, self.parameters, boundary)

    def _once(self, key: object, prepare: Callable[[], Prepared]) -> Prepared:
        """Return what `prepare` makes, which is kept under this key."""
        if key not in self._prepared:
            self._prepared[key] = prepare()
        prepared: Prepared = self._prepared[key]
        return prepared

    @property
    def size(self) -> float:
        """The largest extent (m) along an axis; for a half-plane that of the window it is drawn in."""
        bounds = self.boundary.bounds
        return max(high - low for low, high in zip(bounds[: self.dimension], bounds[self.dimension :], strict=True))

    def polygon(self, n: int = VERTICES) -> Polygon:
        """Return the polygon with vertices at n equal steps of the curve's own parameter, and at every corner.

        A model of straight edges is its own polygon, whatever n. Raises `RefusalError` for an unbounded model, and
        `InputError` for n below 3, and if n vertices are so few that the polygon crosses itself.
        """
        from hapticeval.geometry.representations import Polygon

        return self._once(("polygon", n), lambda: Polygon(self.curve.position(self._polygon_parameters(n))))

    def mesh(self, *, max_error: float | None = None) -> Facets:
        """Return the model as edges (in the plane) or triangles (in space) that lie off it by `max_error` (m) at most.

        Without one that is a share of the model's size: 1e-4 for edges, 1e-3 for triangles. See `Facets`: `vertices`
        (v, N), `cells` (c, N) and the `chord_error` (m) itself. Corners of the model are kept, and what is made of
        edges or triangles is returned as it is. Raises as `facets_of` does.
        """
        from hapticeval.geometry.representations import CHORD_ERROR_SHARE, facets_of

        error = CHORD_ERROR_SHARE[self.dimension] * self.size if max_error is None else max_error
        make = partial(facets_of, self.boundary, error, name=self.name, polygon_of=self.polygon, vertices=VERTICES)
        return self._once(("mesh", error), make)

    def level_set(self, shape: tuple[int, int] = (GRID_NODES, GRID_NODES)) -> LevelSet:
        """Return the signed distance on a grid of `shape` = (nx, ny) nodes that covers the model and a margin."""
        from hapticeval.geometry.representations import sample_level_set

        return self._once(("level set", tuple(shape)), lambda: sample_level_set(self.curve, shape))

    def _polygon_parameters(self, n: int) -> Array:
        """Return the parameters of the polygon's vertices: corners split the curve into runs of equal steps."""
        from hapticeval.geometry.kernels import PIECE
        from hapticeval.records import as_records

        curve = self.curve
        if not curve.closed:
            raise RefusalError(
                f"model '{self.name}' is unbounded",
                why="a polygon encloses a bounded area",
                todo="use scene.model.curve, or scene.model.mesh for edges: those of a line are a square's",
            )
        if n < 3:
            raise InputError(f"a polygon of {n} vertices", why="it needs at least three", todo="give n >= 3")
        # its own corners, whatever n
        if curve.straight:
            return np.array(as_records(curve.pieces, PIECE).u0)
        start, end = curve.u_range
        return equal_steps_between([corner.u for corner in curve.corners] or [start], end - start, n)


def equal_steps_between(cuts: list[float], length: float, n: int) -> Array:
    """Return about n positions once round a closed way of `length`: at every cut, and evenly between."""
    runs = []
    for first, last in zip(cuts, [*cuts[1:], cuts[0] + length], strict=True):
        # each stretch between cuts gets its share of n, one at the least
        steps = max(1, round(n * (last - first) / length))
        runs.append(first + (last - first) * np.arange(steps) / steps)
    return np.concatenate(runs)
