"""Strategies for how a body moves: it slides or spins, and shrinks towards rest."""

from __future__ import annotations

from hypothesis import strategies as st

from hapticeval.geometry.model import Model
from hapticeval.stimulus.motions import AnyMotion, Slide, Spin
from hapticeval.strategies.place import check_model
from hapticeval.strategies.seeded import rounded, signed

FASTEST_SLIDE = 2.0
"""m/s, *chosen*: a body that comes onto a hand faster is thrown, not moved."""

FASTEST_SPIN = 2.0
"""Turns a second, *chosen*: twice what demonstrations turn at."""

AXES = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (1.0, 2.0, 3.0))
"""Directions that a body in space spins about: two of the axes, and one that no symmetry of a model shares."""


def motions(model: Model) -> st.SearchStrategy[AnyMotion]:
    """Draw motions of a `model`'s body: it slides at up to 2 m/s, or spins at up to 2 turns a second about some point.

    The path is given in the frame of the body. The simplest one rests. Raises `InputError` for what is no model.
    """
    check_model(model)
    return _motions(model.dimension, model.size)


@st.composite
def _motions(draw: st.DrawFn, dimension: int, size: float) -> AnyMotion:
    if draw(st.booleans()):
        centre = tuple(rounded(size * draw(signed()), size) for _ in range(dimension))
        axis = draw(st.sampled_from(AXES)) if dimension == 3 else None
        return Spin(rate=round(FASTEST_SPIN * draw(signed()), 3), centre=centre, axis=axis)
    # each component no more than its share of the fastest
    largest = FASTEST_SLIDE / dimension**0.5
    return Slide(velocity=tuple(round(largest * draw(signed()), 3) for _ in range(dimension)))
