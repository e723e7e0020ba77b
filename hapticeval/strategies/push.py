"""Experiments for a closed loop: a tool that flies at a model or along it, and an operator who pushes."""

from __future__ import annotations

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from hapticeval.geometry.model import Model
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.strategies.numbers import rounded, share
from hapticeval.strategies.place import PLACE_COUNT, check_model, places


def pushes(model: Model, *, bilateral: bool = False) -> st.SearchStrategy[ExperimentTable]:
    """Draw experiments on `model` for a closed loop: a tool that flies at it, or along it, and an operator who pushes.

    - The tool starts on the surface or up to 5 % of the model's size off it, at up to 0.6 m/s into the surface and up
      to 0.8 m/s along it. On a `bilateral` surface it starts on it, and moves along it.
    - The operator pushes by up to 6 N towards the surface, for up to 0.4 s.

    Raises `InputError` for what is no model.
    """
    check_model(model)
    return _pushes(model, bool(bilateral))


@st.composite
def _pushes(draw: st.DrawFn, model: Model, bilateral: bool) -> ExperimentTable:
    place = places(model)[draw(st.integers(0, PLACE_COUNT - 1))]
    # The rows after the first are perpendicular to the normal.
    tangents = np.linalg.svd(place.normal[np.newaxis])[2][1:]
    tangent = tangents[draw(st.integers(0, len(tangents) - 1))] * draw(st.sampled_from([-1.0, 1.0]))
    # On the surface, or 0.1 to 5 % of the model's size off it.
    height = 0.0 if bilateral or draw(st.booleans()) else 0.05 * (0.02 + 0.98 * draw(share())) * model.size
    position = place.foot + height * place.normal
    # Off a concave place another part of the surface may be in the way.
    assume(height == 0.0 or float(model.boundary.signed_distance(position[np.newaxis])[0]) > 0.0)
    speed_into = 0.0 if height == 0.0 else 0.06 * draw(st.integers(0, 10))
    velocity = -speed_into * place.normal + 0.08 * draw(st.integers(0, 10)) * tangent
    duration = draw(st.integers(1, 8)) / 20.0
    force, time = [], 0.0
    for _ in range(draw(st.integers(1, 3))):
        # Up to 6 N into the surface and 2 N along it.
        push = -0.5 * draw(st.integers(0, 12)) * place.normal + 0.5 * draw(st.integers(-4, 4)) * tangent
        force.append([round(time, 3), *(round(float(x), 4) for x in push)])
        time += 0.5 * duration
    return ExperimentTable(
        duration=duration,
        # On the surface as well as the number format can say it: a start inside of it is none.
        position=[float(x) if height == 0.0 else rounded(x, model.size) for x in position],
        velocity=[round(float(x), 4) for x in velocity],
        force=force,
    )
