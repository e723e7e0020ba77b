"""The mapping projection (5.17): thesis chapter 5, with the curve shortening flow as its transformation to the disk."""

from __future__ import annotations

from hapticeval.geometry.flow import FlowSettings
from hapticeval.geometry.flow_map import flow_map
from hapticeval.geometry.model import Model
from hapticeval.renderers.disk_projection import DiskProjection
from hapticeval.renderers.nearest import MinimumDistanceProjection
from hapticeval.renderers.outline import outline_of
from hapticeval.renderers.projection import Projection


def mapping_projection(model: Model, *, bilateral: bool, settings: FlowSettings) -> Projection:
    """The projection through the flow map of a model's inside; the nearest surface point outside, where bilateral.

    The IHIP lies on the exact curve, linear in the curve's parameter between the starts of the transversal lines, whose
    distance is the `resolution`. On the unbounded line the lines are vertical and lead to the nearest point: that is
    used there. Raises `FlowSplitError`, `FlowCollapseError` and `FoldedGridError` for a model that the flow does not
    map.
    """
    if not model.curve.closed:
        return MinimumDistanceProjection(outline_of(model, "curve"), bilateral=bilateral)
    made = flow_map(model, settings)
    return DiskProjection(made, model.curve, bilateral=bilateral, resolution=made.spacing)
