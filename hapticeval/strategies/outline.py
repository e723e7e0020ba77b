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

TURN = math.pi / 8.0
"""Angle (rad) by which an outline turns from one stop of the hand to the next."""

ASIDE = 0.01
"""How far the hand goes on past a corner, beside twice its depth, as a share of the model's size."""

FINE = 320
"""Points of an outline, beside its corners, between which it is looked at."""


def laps(model: Model, *, past: bool = False) -> st.SearchStrategy[Moves]:
    """Draw paths of a hand that goes twice along the whole outline of a plane `model`, under each sharp corner.

    Up to 1 % of the model's size deep, either way, from free space and back: for what a renderer has left of the lap
    before. A corner is sharp from 22.5 degrees on; between two stops the outline turns by about as much. With `past`
    the hand goes straight on past a convex corner of 90 degrees or less, and comes down on the next face from free
    space: from within, a rigid contact keeps the face that it has. Raises `InputError` for what is no model, and for
    one without a closed outline.
    """
    check_model(model)
    curve = as_curve(model.boundary)
    if curve is None or not curve.closed:
        raise InputError(f"a lap round model '{model.name}'", why="it has no closed outline in a plane")
    return _laps(model, curve, bool(past))


@st.composite
def _laps(draw: st.DrawFn, model: Model, curve: Curve, past: bool) -> Moves:
    hand = Hand(draw, model, None)
    depth = 0.01 * model.size * (1 + draw(st.integers(0, 98))) / 99.0
    way = draw(st.sampled_from([1.0, -1.0]))
    start = draw(share()) * curve.length
    stops = sorted(_stops(curve), key=lambda stop: way * (stop.s - start) % curve.length)
    hand.release()
    hand.pace = 1.0  # it takes long enough
    aside = 2.0 * depth + ASIDE * model.size
    for stop in (*stops, *stops, stops[0]):
        if past and stop.pointed:
            here, there = (stop.before, stop.after) if way > 0.0 else (stop.after, stop.before)
            along = way * np.array([-here[1], here[0]])
            hand.move(stop.foot + aside * along - depth * here)
            hand.move(stop.foot + aside * there)
        else:
            normal = stop.before + stop.after
            hand.move(stop.foot - depth * normal / max(float(np.linalg.norm(normal)), 1e-9))
    hand.place = hand.near(np.array(hand.at))
    hand.release()
    return Moves(start=hand.start, moves=tuple(hand.moves))


class Stop(NamedTuple):
    """A point of an outline: arc length `s` and `foot` (2,), m, and the outward unit normals `before` it and `after`.

    It is `pointed` where the outline turns there by 90 degrees or more, outwards.
    """

    s: float
    foot: Array
    before: Array
    after: Array
    pointed: bool


@lru_cache(maxsize=16)
def _stops(curve: Curve) -> list[Stop]:
    """Return where an outline has turned by `TURN` since the stop before: straight from one to the next is along it."""
    s = np.union1d(np.arange(FINE) * curve.length / FINE, [corner.s for corner in curve.corners])
    before = curve.normal(curve.parameter(0.5 * (s + np.roll(s, 1) - curve.length * (np.arange(s.size) == 0))))
    after = np.roll(before, -1, axis=0)
    turns = np.arccos(np.clip(np.sum(before * after, axis=1), -1.0, 1.0))
    found, turned = [], 0.0
    for at, turn in enumerate(turns.tolist()):
        turned += turn
        if turned >= TURN - 1e-6:
            foot = np.asarray(curve.position(curve.parameter(s[at])))
            convex = before[at, 0] * after[at, 1] > before[at, 1] * after[at, 0]
            found.append(Stop(float(s[at]), foot, before[at], after[at], bool(convex) and turn > 0.5 * math.pi - 1e-6))
            turned = 0.0
    return found
