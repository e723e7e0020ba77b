"""The conformal projection: thesis (5.17) with the conformal map of 8.2.1 as its transformation to the disk."""

from __future__ import annotations

from weakref import WeakKeyDictionary

from hapticeval.geometry.conformal import ConformalMap, conformal_map
from hapticeval.geometry.model import Model
from hapticeval.renderers.disk_projection import DiskProjection
from hapticeval.renderers.nearest import MinimumDistanceProjection
from hapticeval.renderers.outline import outline_of
from hapticeval.renderers.projection import Projection


def conformal_projection(model: Model, *, bilateral: bool, nodes: int | None = None) -> Projection:
    """The projection through the conformal map of a model's inside, on `nodes` boundary nodes or as many as it needs.

    On the unbounded line the map's limit is the vertical projection, which is the nearest point: that is used there.
    Raises `CrowdingError` and `InputError` as `conformal_map` does.
    """
    if not model.curve.closed:
        return MinimumDistanceProjection(outline_of(model, "curve"), bilateral=bilateral)
    kept = _KEPT.setdefault(model, {})
    if nodes not in kept:
        kept[nodes] = conformal_map(model.curve, nodes=nodes)
    made = kept[nodes]
    return DiskProjection(made, model.curve, bilateral=bilateral, resolution=made.blur)


_KEPT: WeakKeyDictionary[Model, dict[int | None, ConformalMap]] = WeakKeyDictionary()
