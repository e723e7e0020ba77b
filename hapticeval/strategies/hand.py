"""Random paths of a hand on a model, and experiments that push a tool at it.

A path is an approach, a contact, what it does there, and a last release; or it goes along the whole outline of a
plane model, for more than a lap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.curve import Curve, as_curve
from hapticeval.geometry.model import Model
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.moves import Move, Moves, Tremor, shortest_duration
from hapticeval.strategies.place import PLACE_COUNT, Edge, Place, check_model, edges, places, vertices
from hapticeval.strategies.seeded import rounded, share, signed
from hapticeval.types import Array

PARTS = ("slide", "corner", "vertex", "graze", "rest", "release", "medial-axis", "focal-point", "through")
"""What a hand does between its first contact and its last release: see `hand_paths`."""


MOST_PARTS = 12
"""How many parts a path may have: some half a minute of them."""

PACES = (1.0, 1.0, 1.5, 3.0)
"""How many times the shortest possible duration a hand takes for its moves."""


def hand_paths(
    model: Model, *, parts: Sequence[str] = PARTS, most_parts: int = 3, tremor: bool = False
) -> st.SearchStrategy[Moves]:
    """Draw paths of a hand on `model`: an approach through free space, a contact, several parts, a last release.

    A path is a list of moves from rest to rest as a hand makes them (`hapticeval.stimulus.moves`): 99.9 % of the power
    of the acceleration below 10 Hz, at most 1 m/s and 10 m/s^2, or up to three times slower. With `tremor` some paths
    have one of 8 to 12 Hz and up to 0.2 mm. Each of the `parts` starts where the one before has ended:

    - `slide`: along the surface, at the depth at which the hand is, or another;
    - `corner`: along one face past a corner, or past an edge of a solid, from free space; into a concave one under both
      faces;
    - `vertex`: along one face of a solid to a vertex, under all faces that meet there, and on under another of them;
    - `graze`: from free space past the surface, at most 0.5 % of the model's size under it, and out again;
    - `rest`: stays where it is;
    - `release`: into free space and back;
    - `medial-axis`: so deep that another point of the surface becomes the nearest;
    - `focal-point`: to the centre of curvature of a convex place, near it or through it;
    - `through`: straight to another place of the surface, through the model or past it.

    A path has up to `most_parts` of them, which is from 1 to 12. Raises `InputError` for another number and for what is
    no model, and `UnknownNameError` for an unknown part.
    """
    check_model(model)
    if isinstance(parts, str) or not parts:
        raise InputError(f"parts = {parts!r}", why="it is a list of one part or more", todo=f"use {', '.join(PARTS)}")
    for part in parts:
        if part not in PARTS:
            raise UnknownNameError("part of a hand path", str(part), PARTS)
    if isinstance(most_parts, bool) or not isinstance(most_parts, int) or not 1 <= most_parts <= MOST_PARTS:
        raise InputError(f"most_parts = {most_parts!r}", why=f"it is a whole number of parts, from 1 to {MOST_PARTS}")
    targets = {"corner": edges(model), "vertex": vertices(model)}
    possible = tuple(part for part in PARTS if part in parts and targets.get(part, True))
    if not possible:
        raise InputError(
            f"a path past a {' or a '.join(parts)} of model '{model.name}'", why="it has none", todo="add a part"
        )
    return _hand_paths(model, possible, most_parts, bool(tremor))


class Hand:
    """A hand while its path is drawn: where it is, under which place of the surface, how deep, and its moves so far."""

    def __init__(self, draw: st.DrawFn, model: Model, tremor: Tremor | None) -> None:
        self.draw = draw
        self.boundary, self.size, self.dimension = model.boundary, model.size, model.dimension
        self.edges, self.vertices = edges(model), vertices(model)
        # Once round the model, or a way along it that its window shows.
        self.girth = min(model.boundary.girth, 4.0 * model.size)
        self.places = places(model)
        self.tremor = tremor
        self.moves: list[Move] = []
        self.pace = draw(st.sampled_from(PACES))
        self.place = self.draw_place()
        self.start = self.position = self.rounded(self.outside())
        self.depth = self.draw_depth()
        self.press_under(self.depth)

    def draw_place(self) -> Place:
        """Draw a place, most of the time between two of `PLACE_COUNT`."""
        place = self.places[self.draw(st.integers(0, PLACE_COUNT - 1))]
        return self.place_beside(place, self.draw(share()) * self.girth / PLACE_COUNT)

    def place_beside(self, place: Place, length: float) -> Place:
        """Return the place `length` (m) along the surface; its depths `medial` and `focal` stay those of `place`."""
        frame = self.boundary.walk(place.foot, np.array([length]))
        return place._replace(foot=frame.foot[0], normal=frame.normal[0])

    def draw_depth(self) -> float:
        """Draw a depth, m: from 4e-5 of the size to 0.4 of it, and often little."""
        # d = 0.4 L ((1 + i) / 99)^2 / 4^j with i = 0 ... 98, j = 0, 1, 2: the square and the power make small ones
        # common.
        return 0.4 * self.size * ((1 + self.draw(st.integers(0, 98))) / 99.0) ** 2 / 4.0 ** self.draw(st.integers(0, 2))

    def rounded(self, point: Array) -> list[float]:
        """Return a point (N,), m, rounded to about 5e-6 of the model's size."""
        return [rounded(x, self.size) for x in point]

    def outside(self) -> Array:
        """Draw a point (N,), m, of free space over the place."""
        height = self.size * (0.05 + 0.25 * self.draw(share()))
        # Where another part of the surface lies over this place, half the height may be free.
        heights = height * 0.5 ** np.arange(8)
        points = self.place.foot + heights[:, np.newaxis] * self.place.normal
        free = np.flatnonzero(self.boundary.signed_distance(points) > 0.0)
        return np.asarray(points[free[0] if free.size else -1])

    def move_to(self, point: Array) -> None:
        """Add a move to a point (N,), m, unless the hand is there."""
        to = self.rounded(point)
        length = math.dist(self.position, to)
        if length > 0.0:
            # The shortest duration of a hand's move, times its pace, rounded up to the next millisecond.
            self.moves.append(Move(to=to, seconds=round(self.pace * shortest_duration(length, self.tremor) + 5e-4, 3)))
            self.position = to

    def press_under(self, depth: float) -> None:
        """Add a move to `depth` (m) under the place."""
        self.depth = depth
        self.move_to(self.place.foot - depth * self.place.normal)

    def release(self) -> None:
        """Add a move into free space."""
        self.move_to(self.outside())

    def slide(self) -> None:
        """Go along the surface in a few moves, at the depth at which the hand is or at another."""
        depth = self.draw_depth() if self.draw(st.booleans()) else self.depth
        length = 0.4 * self.draw(signed()) * self.girth
        count = self.draw(st.integers(1, 5))
        start = self.place
        for k in range(1, count + 1):
            self.place = self.place_beside(start, length * k / count)
            self.press_under(depth)

    def corner(self) -> None:
        """Go along a face past a corner: over a convex one straight on, into a concave one and on along the next."""
        edge = self.draw_edge()
        corner, position = edge.corner, edge.corner.position
        if self.dimension == 3:
            # Anywhere on the middle four fifths of the edge.
            position = position + 0.4 * self.draw(signed()) * edge.along
        tangent_before, normal_before, tangent_after, normal_after = (
            corner.tangent_pre,
            corner.normal_pre,
            corner.tangent_post,
            corner.normal_post,
        )
        # From the other side: the faces change places, and the tangents turn round.
        if self.draw(st.booleans()):
            tangent_before, normal_before, tangent_after, normal_after = (
                -tangent_after,
                normal_after,
                -tangent_before,
                normal_before,
            )
        # So near to the corner that the faces are still its own.
        reach = 0.4 * min(self.nearest_edge(position), 0.5 * self.size)
        depth = reach * (0.005 + 0.5 * self.draw(share()) ** 2)
        face_point = position - reach * (0.3 + 0.7 * self.draw(share())) * tangent_before
        self.move_to(face_point + 0.3 * reach * normal_before)
        self.move_to(face_point - depth * normal_before)
        if corner.convex:
            self.move_to(position + reach * (0.3 + 0.7 * self.draw(share())) * tangent_before - depth * normal_before)
        else:
            self.move_to(position - depth * normal_before)
            if self.dimension == 3:
                # Under both faces: where they are square to each other, as deep under either.
                self.move_to(position - depth * (normal_before + normal_after))
            self.move_to(position - depth * normal_after)
            self.move_to(position + reach * (0.3 + 0.7 * self.draw(share())) * tangent_after - depth * normal_after)
        self.place, self.depth = self.place_near(np.array(self.position)), depth

    def draw_edge(self) -> Edge:
        """Draw a corner or an edge: of very many one in so many, evenly round the model."""
        concave_edges = [edge for edge in self.edges if not edge.corner.convex]
        # In space few edges are concave, and only there a tool has a second contact.
        seldom = self.dimension == 3 and 0 < len(concave_edges) < len(self.edges)
        pool = concave_edges if seldom and self.draw(st.booleans()) else self.edges
        count = min(len(pool), PLACE_COUNT)
        return pool[self.draw(st.integers(0, count - 1)) * len(pool) // count]

    def nearest_edge(self, position: Array) -> float:
        """Return the distance (m) from `position` (N,), m, to the nearest edge that it is not on, or else the size."""
        gaps = [edge.distance_from(position) for edge in self.edges]
        # On an edge, to rounding; in the plane its own corner is at no distance at all.
        return min((gap for gap in gaps if gap > 1e-9 * self.size), default=self.size)

    def vertex(self) -> None:
        """Go along a face to a vertex, under all faces that meet there, and on under another of them."""
        count = min(len(self.vertices), PLACE_COUNT)
        vertex = self.vertices[self.draw(st.integers(0, count - 1)) * len(self.vertices) // count]
        position, normals = vertex.position, vertex.normals
        first = self.draw(st.integers(0, len(normals) - 1))
        last = (first + self.draw(st.integers(1, len(normals) - 1))) % len(normals)
        reach = 0.4 * min(self.nearest_vertex(position), 0.5 * self.size)
        depth = reach * (0.005 + 0.5 * self.draw(share()) ** 2)
        # d with n . d = -depth for all of the faces: where there are more than three, as nearly as can be.
        under_all = np.linalg.lstsq(normals, np.full(len(normals), -depth), rcond=None)[0]
        for row, lift in ((first, 0.3 * reach), (first, -depth)):
            self.move_to(self.on_face(position, normals, row, reach) + lift * normals[row])
        self.move_to(position + under_all)
        self.move_to(self.on_face(position, normals, last, reach) - depth * normals[last])
        self.place, self.depth = self.place_near(np.array(self.position)), depth

    def on_face(self, position: Array, normals: Array, row: int, reach: float) -> Array:
        """Return a point (3,), m, of one of the faces that meet at a vertex, about `reach` (m) from it."""
        # Inwards, across the other faces, and along this one.
        inwards = -normals.sum(axis=0)
        inwards -= (inwards @ normals[row]) * normals[row]
        guess = position + reach * inwards / max(float(np.linalg.norm(inwards)), 1e-9)
        return np.asarray(self.boundary.closest_point((guess + 1e-3 * reach * normals[row])[np.newaxis]).foot[0])

    def nearest_vertex(self, position: Array) -> float:
        """Return the distance (m) from a vertex at `position` (3,), m, to the nearest other, or the model's size."""
        gaps = [float(np.linalg.norm(other.position - position)) for other in self.vertices]
        return min((gap for gap in gaps if gap > 0.0), default=self.size)

    def place_near(self, point: Array) -> Place:
        """Return the place nearest to a point (N,), m, with the depths of the nearest of `places`."""
        frame = self.boundary.closest_point(point[np.newaxis])
        distances = [float(np.linalg.norm(place.foot - frame.foot[0])) for place in self.places]
        return self.places[int(np.argmin(distances))]._replace(foot=frame.foot[0], normal=frame.normal[0])

    def graze(self) -> None:
        """Go from free space straight along the surface, just under it, and out again."""
        self.release()
        self.place = self.draw_place()
        # The rows after the first span what is perpendicular to the normal: a line, in space a plane.
        tangents = np.linalg.svd(self.place.normal[np.newaxis])[2][1:]
        along = tangents[self.draw(st.integers(0, len(tangents) - 1))] * (0.02 + 0.2 * self.draw(share())) * self.size
        deepest_point = self.place.foot - 5e-3 * self.size * (0.02 + 0.98 * self.draw(share())) * self.place.normal
        self.move_to(deepest_point - along)
        self.move_to(deepest_point + along)
        self.release()

    def stay(self) -> None:
        """Stay for 0.1 to 0.5 s."""
        self.moves.append(Move(to=self.position, seconds=self.draw(st.sampled_from([0.1, 0.3, 0.5]))))

    def out_and_in(self) -> None:
        """Release, and come back near the place."""
        self.release()
        self.place = self.place_beside(self.place, 0.1 * self.draw(signed()) * self.girth)
        self.press_under(self.draw_depth())

    def cross_depth(self, depths: Callable[[Place], float]) -> None:
        """Go to somewhat less and then, a little aside, to somewhat more than a depth (m) that a place gives."""
        self.place = self.draw_place() if self.draw(st.booleans()) else self.place
        # a depth without end, as under a flat place, is cut to half the size
        depth = min(depths(self.place), 0.5 * self.size)
        # 0.80 to 0.99 of the depth, on the near side of it,
        self.press_under(depth * (0.8 + 0.19 * self.draw(share())))
        aside = self.place_beside(self.place, 0.05 * self.draw(signed()) * self.girth)
        self.place = aside
        # and 1.01 to 1.21 of it, beyond.
        self.press_under(depth * (1.01 + 0.2 * self.draw(share())))

    def focal_point(self) -> None:
        """Go to a centre of curvature, near it or through it; on a model without one to the medial axis."""
        curved_places = [place for place in self.places if place.focal < 0.5 * self.size]
        if not curved_places:
            self.cross_depth(lambda place: place.medial)
            return
        self.place = curved_places[self.draw(st.integers(0, len(curved_places) - 1))]
        # 0.90, 0.95, ... 1.10 of the radius of curvature
        self.press_under(self.place.focal * (0.9 + self.draw(st.integers(0, 4)) / 20.0))
        along = self.place_beside(self.place, 0.01 * self.size).foot - self.place.foot
        self.move_to(np.array(self.position) + self.draw(signed()) * along)

    def through(self) -> None:
        """Go straight to another place, through the model or past it."""
        self.place = self.draw_place()
        self.press_under(self.draw_depth())

    def add_part(self, part: str) -> None:
        """Add the moves of one of `PARTS`."""
        {
            "slide": self.slide,
            "corner": self.corner,
            "vertex": self.vertex,
            "graze": self.graze,
            "rest": self.stay,
            "release": self.out_and_in,
            "medial-axis": lambda: self.cross_depth(lambda place: place.medial),
            "focal-point": self.focal_point,
            "through": self.through,
        }[part]()


@st.composite
def _hand_paths(draw: st.DrawFn, model: Model, parts: tuple[str, ...], most_parts: int, trembles: bool) -> Moves:
    tremor = None
    if trembles and draw(st.booleans()):
        direction = 2.0 * math.pi * draw(share())
        # Amplitude from 10 um to 0.2 mm, frequency from 8 to 12 Hz in steps of 0.5 Hz.
        size = 2e-4 * (0.05 + 0.95 * draw(share()))
        amplitude = [size * math.cos(direction), size * math.sin(direction), 0.0][: model.dimension]
        tremor = Tremor(amplitude=[round(x, 7) for x in amplitude], hertz=8.0 + draw(st.integers(0, 8)) / 2.0)
    hand = Hand(draw, model, tremor)
    for _ in range(draw(st.integers(1, most_parts))):
        hand.add_part(draw(st.sampled_from(parts)))
    # Three paths of four end in free space.
    if draw(st.integers(0, 3)):
        hand.release()
    assume(hand.moves)
    return Moves(start=hand.start, moves=tuple(hand.moves), tremor=tremor)


STOP_ANGLE = math.pi / 8.0
"""Angle (rad) by which an outline turns, at least, from one stop of the hand to the next."""

ASIDE_SHARE = 0.01
"""How far the hand goes on past a corner, on top of twice its depth, as a share of the model's size."""

OUTLINE_DIRECTIONS = 320
"""Number of points, besides the corners, at which an outline's direction is taken."""


def laps(model: Model, *, past: bool = False) -> st.SearchStrategy[Moves]:
    """Draw paths of a hand that goes twice along the whole outline of a plane `model`, under each sharp corner.

    They show what a renderer has kept of the lap before. The hand comes from free space and goes back there, is up to
    1 % of the model's size deep, and goes either way round. A corner is sharp from 22.5 degrees on; between two stops
    the outline turns by about as much.

    With `past` the hand goes straight on past a convex corner of 90 degrees or less, and comes down on the next face
    from free space: from within, a rigid contact keeps the face that it has.

    Raises `InputError` for what is not a model, and for one without a closed outline.
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
        np.arange(OUTLINE_DIRECTIONS) * curve.length / OUTLINE_DIRECTIONS, [corner.s for corner in curve.corners]
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


def pushes(model: Model, *, bilateral: bool = False) -> st.SearchStrategy[ExperimentTable]:
    """Draw experiments on `model` for a closed loop: a tool that flies at it, or along it, and an operator who pushes.

    - The tool starts on the surface or up to 5 % of the model's size off it, at up to 0.6 m/s into the surface and up
      to 0.8 m/s along it. On a `bilateral` surface it starts on it, and moves along it.
    - The operator pushes by up to 6 N towards the surface, for up to 0.4 s.

    Raises `InputError` for what is not a model.
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
