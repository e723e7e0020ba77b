"""What a projection on a boundary is given: the curve or polygon, and how far it is from the model."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

from hapticeval.geometry.curve import Curve
from hapticeval.geometry.model import Model
from hapticeval.renderers.boundary import Boundary, boundary_of, straight
from hapticeval.renderers.family import VERTICES


@dataclass(frozen=True)
class Outline:
    """A boundary for the compiled loops, the same as a curve, and its `resolution` and `standoff` (m)."""

    boundary: Boundary
    surface: Curve
    resolution: float
    standoff: float


def outline_of(model: Model, representation: str, vertices: int = VERTICES) -> Outline:
    """The representation of a model, made once: its polygon of so many vertices, or its exact curve.

    A model of straight edges is its own polygon; the unbounded line has no other representation than itself.
    """
    curve = model.curve
    kept = _KEPT.setdefault(model, {})
    key = f"{representation} {vertices}" if representation == "polygon" else representation
    if key not in kept:
        if curve.closed and straight(curve):
            kept[key] = Outline(boundary_of(model.polygon()), curve, 0.0, 0.0)
        elif curve.closed and representation == "polygon":
            polygon = model.polygon(vertices)
            kept[key] = Outline(
                boundary_of(polygon), polygon.as_curve(), polygon.resolution, polygon.standoff_from(curve)
            )
        else:
            kept[key] = Outline(boundary_of(curve), curve, 0.0, 0.0)
    return kept[key]


_KEPT: WeakKeyDictionary[Model, dict[str, Outline]] = WeakKeyDictionary()
