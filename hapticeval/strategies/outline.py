"""Paths of a hand along the whole outline of a plane model, for more than a lap."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve, as_curve
from hapticeval.geometry.model import Model
from hapticeval.stimulus.moves import Moves
from hapticeval.strategies.hand import Hand
from hapticeval.strategies.numbers import share
from hapticeval.strategies.place import check_model
from hapticeval.types import Array

STOP_ANGLE = math.pi / 8.0
"""Angle (rad) by which an outline turns, at least, from one stop of the hand to the next."""

ASIDE_SHARE = 0.01
"""How far the hand goes on past a corner, on top of twice its depth, as a share of the model's size."""

OUTLINE_POINTS = 320
"""Number of points, besides the corners, at which an outline's direction is taken."""


def laps(model: Model, *, past: bool = False) -> st.SearchStrategy[Moves]:
    """Draw paths of a hand that goes twice along the whole outline of a plane `model`, under each sharp corner.

    They show what a renderer has kept of the lap before. The hand comes from free space and goes back there, is up to
    1 % of the model's size deep, and goes either way round. A corner is sharp from 22.5 degrees on; between two stops
    the outline turns by about as much.

    With `past` the hand goes straight on past a convex corner of 90 degrees or less, and comes down on the next face
    from free space: from within, a rigid contact keeps the face that it has.

    Raises `InputError` for what is no model, and for one without a closed outline.
    """
    check_model(model)
    curve = as_curve(model.boundary)
    if curve is None or not curve.closed:
        raise InputError(f"a lap round model '{model.name}'", why="it has no closed outline in a plane")
    return _laps(model, curve, bool(past))


@st.composite
def _laps(draw: st.DrawFn, model: Model, curve: Curve, past: bool) -> Moves:
    hand = Hand(draw, model, None)
    # d = 1e-4 L to 1e-2 L
    depth = 0.01 * model.size * (1 + draw(st.integers(0, 98))) / 99.0
    direction = draw(st.sampled_from([1.0, -1.0]))
    start = draw(share()) * curve.length
    stops = sorted(_stops_of(curve), key=lambda stop: direction * (stop.s - start) % curve.length)
    hand.release()
    hand.pace = 1.0  # it takes long enough
    overshoot = 2.0 * depth + ASIDE_SHARE * model.size
    for stop in (*stops, *stops, stops[0]):
        if past and stop.pointed:
            normal_before, normal_after = (stop.before, stop.after) if direction > 0.0 else (stop.after, stop.before)
            # The outward normal turned by 90 degrees is the tangent; anticlockwise for direction +1.
            along = direction * np.array([-normal_before[1], normal_before[0]])
            hand.move_to(stop.foot + overshoot * along - depth * normal_before)
            hand.move_to(stop.foot + overshoot * normal_after)
        else:
            # Under a corner along the bisector of its normals.
            normal = stop.before + stop.after
            hand.move_to(stop.foot - depth * normal / max(float(np.linalg.norm(normal)), 1e-9))
    hand.place = hand.place_near(np.array(hand.position))
    hand.release()
    return Moves(start=hand.start, moves=tuple(hand.moves))


class Stop(NamedTuple):
    """A point of an outline at which the hand changes direction: arc length `s`, m, and `foot` (2,), m.

    `before` and `after` (2,) are the outward unit normals on both sides. It is `pointed` where the outline turns there
    by 90 degrees or more, as a convex one does.
    """

    s: float
    foot: Array
    before: Array
    after: Array
    pointed: bool


@lru_cache(maxsize=16)
def _stops_of(curve: Curve) -> list[Stop]:
    """Return the points at which an outline has turned by `STOP_ANGLE` since the one before.

    A straight move from one of them to the next stays close to the outline.
    """
    # Even arc lengths (m), and the corners themselves.
    arc_lengths = np.union1d(
        np.arange(OUTLINE_POINTS) * curve.length / OUTLINE_POINTS, [corner.s for corner in curve.corners]
    )
    # The normal half way between a point and the one before it; before the first one comes the last.
    normals_before = curve.normal(
        curve.parameter(
            0.5 * (arc_lengths + np.roll(arc_lengths, 1) - curve.length * (np.arange(arc_lengths.size) == 0))
        )
    )
    normals_after = np.roll(normals_before, -1, axis=0)
    # Angle (rad) by which the normal turns at each point.
    turns = np.arccos(np.clip(np.sum(normals_before * normals_after, axis=1), -1.0, 1.0))
    stops, turned_angle = [], 0.0
    for index, turn in enumerate(turns.tolist()):
        turned_angle += turn
        if turned_angle >= STOP_ANGLE - 1e-6:
            foot = np.asarray(curve.position(curve.parameter(arc_lengths[index])))
            # n1 x n2 > 0: a turn to the left, which is convex on an anticlockwise outline.
            convex = (
                normals_before[index, 0] * normals_after[index, 1] > normals_before[index, 1] * normals_after[index, 0]
            )
            pointed = bool(convex) and turn > 0.5 * math.pi - 1e-6
            stops.append(Stop(float(arc_lengths[index]), foot, normals_before[index], normals_after[index], pointed))
            turned_angle = 0.0
    return stops
