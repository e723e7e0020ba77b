"""Strategies of hypothesis for what a renderer may meet: hand paths, pushes, models, scenes, effects.

For anyone's tests:

    from hypothesis import given
    from hapticeval import make_model, play
    from hapticeval.strategies import hand_paths

    STAR = make_model("star")

    @given(hand_paths(STAR))
    def test_the_force_stays_small(moves):
        hips = moves.path().sampled(1e-3)[1]
        ...

What is drawn prints as something that can be pasted. Smaller examples are simpler ones: fewer parts, shallower, nearer
to where the model's outline begins. All numbers come from small whole ones: of larger numbers hypothesis draws some
from the source of whatever modules are loaded, and the same seed would give other examples in another program.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st

from hapticeval.effects.catalogue import EFFECTS, make_effect
from hapticeval.effects.effect import Effect
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry import catalogue
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve, as_curve
from hapticeval.geometry.model import Model
from hapticeval.scene import Scene
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.moves import Move, Moves, Tremor, shortest
from hapticeval.types import Array, BoolArray

T = TypeVar("T")

PARTS = ("slide", "corner", "graze", "rest", "release", "medial-axis", "focal-point", "through")
"""What a hand does between its first contact and its last release: see `hand_paths`."""

ROUND = 16
"""Places of a lap round a model at which the hand comes close to the surface, beside its corners."""

PLACES = 100
"""Points of the surface from which parts start; any other lies between two of them."""

MOST_PARTS = 12
"""Parts of a path at the most: some half a minute."""

PACES = (1.0, 1.0, 1.5, 3.0)
"""How much slower than it could a hand moves."""


class Place(NamedTuple):
    """A point of the surface: `foot` (N,), m, its outward unit `normal` (N,), and two depths under it, m.

    At `medial` another point of the surface is as near; at `focal` is the centre of the surface's curvature. Infinite
    where there is none.
    """

    foot: Array
    normal: Array
    medial: float
    focal: float


def hand_paths(
    model: Model, *, parts: Sequence[str] = PARTS, most: int = 3, tremor: bool = False
) -> st.SearchStrategy[Moves]:
    """Draw paths of a hand on `model`: an approach through free space, a contact, up to `most` parts, a last release.

    A path is a list of moves from rest to rest as a hand makes them: 99.9 % of the power of the acceleration below
    10 Hz, at most 1 m/s and 10 m/s^2 (`hapticeval.stimulus.moves`), or up to three times slower. With `tremor` it may
    add one of 8 to 12 Hz and up to 0.2 mm. Each of the `parts` starts where the one before has ended:

    - `slide`: along the surface, at the depth at which the hand is, or another;
    - `corner`: along one face past a corner, of a model that has any, from free space;
    - `graze`: from free space past the surface, at most 0.5 % of the model's size under it, and out again;
    - `rest`: stays where it is;
    - `release`: into free space and back;
    - `medial-axis`: so deep that another point of the surface becomes the nearest;
    - `focal-point`: to the centre of curvature of a convex place, near it or through it;
    - `through`: straight to another place of the surface, through the model or past it.

    `most` is from 1 to 12. Raises `InputError` for another number and for what is no model, and `UnknownNameError` for
    an unknown part.
    """
    _check_model(model)
    if isinstance(parts, str) or not parts:
        raise InputError(f"parts = {parts!r}", why="it is a list of one part or more", todo=f"use {', '.join(PARTS)}")
    for part in parts:
        if part not in PARTS:
            raise UnknownNameError("part of a hand path", str(part), PARTS)
    if isinstance(most, bool) or not isinstance(most, int) or not 1 <= most <= MOST_PARTS:
        raise InputError(f"most = {most!r}", why=f"it is a whole number of parts, from 1 to {MOST_PARTS}")
    possible = tuple(part for part in PARTS if part in parts and (part != "corner" or model.boundary.corners))
    if not possible:
        raise InputError(f"a path past a corner on model '{model.name}'", why="it has no corner", todo="add a part")
    return _hand_paths(model, possible, most, bool(tremor))


def laps(model: Model) -> st.SearchStrategy[Moves]:
    """Draw paths of a hand that goes along the whole outline of a plane `model`, under each corner, one to two times.

    Up to 1 % of the model's size deep, either way, from free space and back: for what a renderer has left of the lap
    before. Raises `InputError` for what is no model, and for one without a closed outline.
    """
    _check_model(model)
    curve = as_curve(model.boundary)
    if curve is None or not curve.closed:
        raise InputError(f"a lap round model '{model.name}'", why="it has no closed outline in a plane")
    return _laps(model, curve)


def pushes(model: Model, *, bilateral: bool = False) -> st.SearchStrategy[ExperimentTable]:
    """Draw experiments on `model` for a closed loop: a tool that flies at it, or along it, and an operator who pushes.

    It starts up to 5 % of the model's size off the surface, or on it, with up to 0.6 m/s into the surface and up to
    0.8 m/s along it, and is pushed by up to 6 N towards it, for up to 0.4 s. On a `bilateral` surface it starts on it,
    and moves along it. Raises `InputError` for what is no model.
    """
    _check_model(model)
    return _pushes(model, bool(bilateral))


def plane_models(*, kinds: Sequence[str] | None = None) -> st.SearchStrategy[Model]:
    """Draw models in the plane of the `kinds` of `PLANE_MODELS`, all if none are given; 5 to 40 cm, about the origin.

    Raises `UnknownNameError` for an unknown kind, and `InputError` for none.
    """
    return _of_kinds(PLANE_MODELS, kinds)


def meshes(*, kinds: Sequence[str] | None = None) -> st.SearchStrategy[Model]:
    """Draw closed triangle meshes of the `kinds` of `MESHES`, all if none are given; 5 to 40 cm, about the origin.

    Raises `UnknownNameError` for an unknown kind, and `InputError` for none.
    """
    return _of_kinds(MESHES, kinds)


def scenes(
    models: st.SearchStrategy[Model] | None = None,
    *,
    bilateral: bool | None = None,
    called: st.SearchStrategy[tuple[Effect, ...]] | None = None,
) -> st.SearchStrategy[Scene]:
    """Draw scenes on `models` (those of `plane_models` if none are given), with the effects that are `called` for.

    Stiffness 50 to 4000 N/m, with no damping to the critical one; a tool of 50 g to 1 kg. With `bilateral` None either.
    """
    for what, given_ in (("models", models), ("called", called)):
        if given_ is not None and not isinstance(given_, st.SearchStrategy):
            raise InputError(
                f"{what} = {given_!r}", why="it is no strategy", todo="use hypothesis.strategies.just(...)"
            )
    return _scenes(plane_models() if models is None else models, bilateral, st.just(()) if called is None else called)


def effects(kind: str, **numbers: st.SearchStrategy[Any]) -> st.SearchStrategy[Effect]:
    """Draw an effect of the catalogue: its `kind`, and a strategy for each of its numbers that it is to have.

    `st.tuples(effects("viscosity", coefficient=st.sampled_from([0.1, 1.0])))` is what `scenes(called=...)` takes.
    Raises `UnknownNameError` for an unknown kind; what the numbers may be is checked when they are drawn.
    """
    if kind not in EFFECTS:
        raise UnknownNameError("effect", kind, EFFECTS)
    return st.fixed_dictionaries({"kind": st.just(kind), **numbers}).map(make_effect)


def examples(strategy: st.SearchStrategy[T], count: int, *, seed: int = 0) -> list[T]:
    """Return up to `count` different examples of `strategy`: the same for the same seed and version of hypothesis.

    Fewer where it has no more. Nothing of it depends on a clock, on what is loaded, or on earlier examples.
    """
    if not isinstance(count, int) or count < 1:
        raise InputError(f"count = {count!r}", why="it is a whole number of examples, and positive")
    found: list[T] = []

    @seeded(seed)
    @settings(
        max_examples=count, phases=[Phase.generate], database=None, deadline=None, derandomize=False,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(strategy)
    def collect(example: T) -> None:
        found.append(example)

    collect()
    return found[:count]


def _of_kinds(
    known: Mapping[str, Callable[[], st.SearchStrategy[Model]]], kinds: Sequence[str] | None
) -> st.SearchStrategy[Model]:
    chosen = tuple(known if kinds is None else kinds)
    if isinstance(kinds, str) or not chosen:
        raise InputError(f"kinds = {kinds!r}", why="it is a list of one kind or more")
    for kind in chosen:
        if kind not in known:
            raise UnknownNameError("kind of drawn model", str(kind), known)
    return st.one_of([known[kind]() for kind in chosen])


def _check_model(model: object) -> None:
    if not isinstance(model, Model):
        raise InputError(f"{model!r} is no model", todo='make one: hapticeval.make_model("star")')


def _rounded(value: float, size: float) -> float:
    """Return a length to about 5e-6 of `size` m: what is drawn is to be read and pasted."""
    return round(float(value), 5 - math.floor(math.log10(size)))


def _share() -> st.SearchStrategy[float]:
    """Draw 0, 0.01, ..., 0.99."""
    return st.integers(0, 99).map(lambda percent: percent / 100.0)


def _signed() -> st.SearchStrategy[float]:
    """Draw -0.99, ..., 0.99; smaller ones are simpler."""
    return st.integers(-99, 99).map(lambda percent: percent / 100.0)


def _places(model: Model) -> list[Place]:
    """Return `PLACES` places of the model's surface, in order along a plane one."""
    boundary: Any = model.boundary
    return _places_of(boundary, model.size)


@lru_cache(maxsize=16)
def _places_of(boundary: Boundary, size: float) -> list[Place]:
    """Find them once for a boundary."""
    frame = boundary.closest_point(boundary.points(PLACES))
    foot, normal = frame.foot, frame.normal
    bend = np.linalg.eigvalsh(frame.shape).max(axis=1)

    def own(depth: Array) -> BoolArray:
        """Whether the place is the nearest point of the surface from `depth` under it."""
        off = boundary.signed_distance(foot - depth[:, np.newaxis] * normal)
        nearest: BoolArray = off < -depth + 1e-6 * size
        return nearest

    low, high = np.zeros(PLACES), np.full(PLACES, np.inf)
    for depth in size * np.geomspace(1e-4, 1.0, 32):
        still = own(np.full(PLACES, depth))
        low = np.where(still & np.isinf(high), depth, low)
        high = np.where(~still & np.isinf(high), depth, high)
    known = np.isfinite(high)
    for _ in range(12):
        middle = np.where(known, 0.5 * (low + np.where(known, high, 0.0)), low)
        still = own(middle)
        low, high = np.where(known & still, middle, low), np.where(known & ~still, middle, high)
    focal = np.where(bend * size > 1e-6, 1.0 / np.maximum(bend, 1e-300), np.inf)
    return [
        Place(*row) for row in zip(foot, normal, np.where(known, low, np.inf).tolist(), focal.tolist(), strict=True)
    ]


class _Hand:
    """A hand that is being led: where it is, under which place of the surface, how deep, and what it has done."""

    def __init__(self, draw: st.DrawFn, model: Model, tremor: Tremor | None) -> None:
        self.draw = draw
        self.boundary, self.size, self.corners = model.boundary, model.size, model.boundary.corners
        # Once round the model, or a way along it that its window shows.
        self.girth = min(model.boundary.girth, 4.0 * model.size)
        self.places = _places(model)
        self.tremor = tremor
        self.moves: list[Move] = []
        self.pace = draw(st.sampled_from(PACES))
        self.place = self.any_place()
        self.start = self.at = self.rounded(self.outside())
        self.depth = self.any_depth()
        self.press(self.depth)

    def any_place(self) -> Place:
        """Draw a place, most of the time between two of `PLACES`."""
        place = self.places[self.draw(st.integers(0, PLACES - 1))]
        return self.beside(place, self.draw(_share()) * self.girth / PLACES)

    def beside(self, place: Place, length: float) -> Place:
        """Return the place `length` m along; how deep its axis and its focus lie is taken from the given one."""
        frame = self.boundary.walk(place.foot, np.array([length]))
        return place._replace(foot=frame.foot[0], normal=frame.normal[0])

    def any_depth(self) -> float:
        """Draw a depth, m: from 4e-5 of the size to 0.4 of it, and often little."""
        return 0.4 * self.size * ((1 + self.draw(st.integers(0, 98))) / 99.0) ** 2 / 4.0 ** self.draw(st.integers(0, 2))

    def rounded(self, point: Array) -> list[float]:
        return [_rounded(x, self.size) for x in point]

    def outside(self) -> Array:
        """Draw a point of free space over the place."""
        height = self.size * (0.05 + 0.25 * self.draw(_share()))
        heights = height * 0.5 ** np.arange(8)
        points = self.place.foot + heights[:, np.newaxis] * self.place.normal
        free = np.flatnonzero(self.boundary.signed_distance(points) > 0.0)
        return np.asarray(points[free[0] if free.size else -1])

    def move(self, point: Array) -> None:
        """Go there."""
        to = self.rounded(point)
        length = math.dist(self.at, to)
        if length > 0.0:
            self.moves.append(Move(to=to, seconds=round(self.pace * shortest(length, self.tremor) + 5e-4, 3)))
            self.at = to

    def press(self, depth: float) -> None:
        """Go to `depth` m under the place."""
        self.depth = depth
        self.move(self.place.foot - depth * self.place.normal)

    def release(self) -> None:
        """Go out."""
        self.move(self.outside())

    def slide(self) -> None:
        """Go along the surface in a few moves."""
        depth = self.any_depth() if self.draw(st.booleans()) else self.depth
        length = 0.4 * self.draw(_signed()) * self.girth
        count = self.draw(st.integers(1, 5))
        start = self.place
        for k in range(1, count + 1):
            self.place = self.beside(start, length * k / count)
            self.press(depth)

    def corner(self) -> None:
        """Go along a face past a corner: over a convex one straight on, into a concave one and on along the next."""
        chosen = self.draw(st.integers(0, min(len(self.corners), PLACES) - 1))
        corner = self.corners[chosen * len(self.corners) // min(len(self.corners), PLACES)]
        ahead, normal, leaves, after = corner.tangent_pre, corner.normal_pre, corner.tangent_post, corner.normal_post
        if self.draw(st.booleans()):
            ahead, normal, leaves, after = -leaves, after, -ahead, normal
        reach = 0.4 * min(self.nearest_corner(corner.position), 0.5 * self.size)
        depth = reach * (0.005 + 0.5 * self.draw(_share()) ** 2)
        before = corner.position - reach * (0.3 + 0.7 * self.draw(_share())) * ahead
        self.move(before + 0.3 * reach * normal)
        self.move(before - depth * normal)
        if corner.convex:
            self.move(corner.position + reach * (0.3 + 0.7 * self.draw(_share())) * ahead - depth * normal)
        else:
            self.move(corner.position - depth * normal)
            self.move(corner.position - depth * after)
            self.move(corner.position + reach * (0.3 + 0.7 * self.draw(_share())) * leaves - depth * after)
        self.place, self.depth = self.near(np.array(self.at)), depth

    def nearest_corner(self, position: Array) -> float:
        gaps = [float(np.linalg.norm(other.position - position)) for other in self.corners]
        return min((gap for gap in gaps if gap > 0.0), default=self.size)

    def near(self, point: Array) -> Place:
        """Return the place nearest to a point."""
        frame = self.boundary.closest_point(point[np.newaxis])
        far = [float(np.linalg.norm(place.foot - frame.foot[0])) for place in self.places]
        return self.places[int(np.argmin(far))]._replace(foot=frame.foot[0], normal=frame.normal[0])

    def graze(self) -> None:
        """Go straight past the surface."""
        self.release()
        self.place = self.any_place()
        tangents = np.linalg.svd(self.place.normal[np.newaxis])[2][1:]
        along = tangents[self.draw(st.integers(0, len(tangents) - 1))] * (0.02 + 0.2 * self.draw(_share())) * self.size
        under = self.place.foot - 5e-3 * self.size * (0.02 + 0.98 * self.draw(_share())) * self.place.normal
        self.move(under - along)
        self.move(under + along)
        self.release()

    def rest(self) -> None:
        """Stay."""
        self.moves.append(Move(to=self.at, seconds=self.draw(st.sampled_from([0.1, 0.3, 0.5]))))

    def out_and_in(self) -> None:
        """Release, and come back beside there."""
        self.release()
        self.place = self.beside(self.place, 0.1 * self.draw(_signed()) * self.girth)
        self.press(self.any_depth())

    def cross(self, depths: Callable[[Place], float]) -> None:
        """Go under a place to somewhat less and to somewhat more than a depth, and on to the side."""
        self.place = self.any_place() if self.draw(st.booleans()) else self.place
        deep = min(depths(self.place), 0.5 * self.size)
        self.press(deep * (0.8 + 0.19 * self.draw(_share())))
        aside = self.beside(self.place, 0.05 * self.draw(_signed()) * self.girth)
        self.place = aside
        self.press(deep * (1.01 + 0.2 * self.draw(_share())))

    def focal_point(self) -> None:
        """Go to a centre of curvature, to near it, or through it; without one, to the medial axis."""
        bent = [place for place in self.places if place.focal < 0.5 * self.size]
        if not bent:
            self.cross(lambda place: place.medial)
            return
        self.place = bent[self.draw(st.integers(0, len(bent) - 1))]
        self.press(self.place.focal * (0.9 + self.draw(st.integers(0, 4)) / 20.0))
        along = self.beside(self.place, 0.01 * self.size).foot - self.place.foot
        self.move(np.array(self.at) + self.draw(_signed()) * along)

    def through(self) -> None:
        """Go straight to another place."""
        self.place = self.any_place()
        self.press(self.any_depth())

    def do(self, part: str) -> None:
        """Do one of `PARTS`."""
        {
            "slide": self.slide,
            "corner": self.corner,
            "graze": self.graze,
            "rest": self.rest,
            "release": self.out_and_in,
            "medial-axis": lambda: self.cross(lambda place: place.medial),
            "focal-point": self.focal_point,
            "through": self.through,
        }[part]()


@st.composite
def _hand_paths(draw: st.DrawFn, model: Model, parts: tuple[str, ...], most: int, trembles: bool) -> Moves:
    tremor = None
    if trembles and draw(st.booleans()):
        direction = 2.0 * math.pi * draw(_share())
        size = 2e-4 * (0.05 + 0.95 * draw(_share()))
        amplitude = [size * math.cos(direction), size * math.sin(direction), 0.0][: model.dimension]
        tremor = Tremor(amplitude=[round(x, 7) for x in amplitude], hertz=8.0 + draw(st.integers(0, 8)) / 2.0)
    hand = _Hand(draw, model, tremor)
    for _ in range(draw(st.integers(1, most))):
        hand.do(draw(st.sampled_from(parts)))
    if draw(st.integers(0, 3)):
        hand.release()
    assume(hand.moves)
    return Moves(start=hand.start, moves=tuple(hand.moves), tremor=tremor)


@st.composite
def _laps(draw: st.DrawFn, model: Model, curve: Curve) -> Moves:
    hand = _Hand(draw, model, None)
    depth = 0.01 * model.size * (1 + draw(st.integers(0, 98))) / 99.0
    way = draw(st.sampled_from([1.0, -1.0]))
    start = draw(_share()) * curve.length
    over = {corner.s: corner for corner in curve.corners}
    stops = sorted(
        {*over, *(np.arange(ROUND) * curve.length / ROUND).tolist()}, key=lambda s: way * (s - start) % curve.length
    )
    hand.release()
    # Two laps, or the second up to three quarters of it, a half, a quarter; and on to where it began.
    count = 2 * len(stops) - draw(st.integers(0, 3)) * len(stops) // 4 + 1
    for k in range(count):
        s = stops[k % len(stops)]
        u = curve.parameter(s)
        normal = over[s].normal_pre + over[s].normal_post if s in over else curve.normal(u)
        hand.move(curve.position(u) - depth * normal / max(float(np.linalg.norm(normal)), 1e-9))
    hand.place = hand.near(np.array(hand.at))
    hand.release()
    return Moves(start=hand.start, moves=tuple(hand.moves))


@st.composite
def _pushes(draw: st.DrawFn, model: Model, bilateral: bool) -> ExperimentTable:
    places = _places(model)
    place = places[draw(st.integers(0, PLACES - 1))]
    tangents = np.linalg.svd(place.normal[np.newaxis])[2][1:]
    along = tangents[draw(st.integers(0, len(tangents) - 1))] * draw(st.sampled_from([-1.0, 1.0]))
    off = 0.0 if bilateral or draw(st.booleans()) else 0.05 * (0.02 + 0.98 * draw(_share())) * model.size
    position = place.foot + off * place.normal
    assume(off == 0.0 or float(model.boundary.signed_distance(position[np.newaxis])[0]) > 0.0)
    into = 0.0 if off == 0.0 else 0.06 * draw(st.integers(0, 10))
    velocity = -into * place.normal + 0.08 * draw(st.integers(0, 10)) * along
    duration = draw(st.integers(1, 8)) / 20.0
    force, time = [], 0.0
    for _ in range(draw(st.integers(1, 3))):
        push = -0.5 * draw(st.integers(0, 12)) * place.normal + 0.5 * draw(st.integers(-4, 4)) * along
        force.append([round(time, 3), *(round(float(x), 4) for x in push)])
        time += 0.5 * duration
    return ExperimentTable(
        duration=duration,
        # On the surface as well as the number format can say it: a start inside of it is none.
        position=[float(x) if off == 0.0 else _rounded(x, model.size) for x in position],
        velocity=[round(float(x), 4) for x in velocity],
        force=force,
    )


@st.composite
def _scenes(
    draw: st.DrawFn,
    models: st.SearchStrategy[Model],
    bilateral: bool | None,
    called: st.SearchStrategy[tuple[Effect, ...]],
) -> Scene:
    stiffness = draw(st.sampled_from([1000.0, 50.0, 200.0, 4000.0]))
    mass = draw(st.sampled_from([0.1, 0.05, 0.3, 1.0]))
    ratio = draw(st.sampled_from([0.0, 0.3, 1.0]))
    return Scene(
        model=draw(models),
        stiffness=stiffness,
        damping=round(2.0 * ratio * math.sqrt(stiffness * mass), 3),
        mass=mass,
        bilateral=draw(st.booleans()) if bilateral is None else bilateral,
        effects=draw(called),
    )


def _sizes() -> st.SearchStrategy[float]:
    return st.sampled_from([0.2, 0.1, 0.05, 0.4])


def _polygon(points: Array) -> Model:
    """Return a polygon to the micrometre; an outline that is none is not drawn."""
    try:
        return catalogue.from_vertices(np.round(points, 6).tolist())
    except InputError:
        assume(False)
        raise


@st.composite
def _radial(draw: st.DrawFn) -> tuple[Array, Array]:
    """Draw angles (n,), rad, once round, and a radius at each, as a share of the largest."""
    count = draw(st.integers(3, 14))
    steps = np.array([1.0 + draw(_share()) for _ in range(count)])
    radii = np.array([0.2 + 0.8 * draw(_share()) for _ in range(count)])
    return np.cumsum(steps) * (2.0 * math.pi / steps.sum()), radii


def _round(angle: Array, radius: Array) -> Array:
    return np.asarray(radius[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)]))


@st.composite
def _star_shaped(draw: st.DrawFn) -> Model:
    """A polygon that is star-shaped about the origin: arms, notches and slivers."""
    angles, radii = draw(_radial())
    return _polygon(0.5 * draw(_sizes()) * _round(angles, radii))


@st.composite
def _spline(draw: st.DrawFn) -> Model:
    """A closed cubic spline, as 96 edges: facets of a smooth outline."""
    from scipy.interpolate import CubicSpline

    angles, radii = draw(_radial())
    knots = np.concatenate([angles - angles[0], [2.0 * math.pi]])
    # Between the knots a spline swings past them: half of the radius of a circle keeps it from the origin.
    spline = CubicSpline(knots, np.append(0.5 + 0.5 * radii, 0.5 + 0.5 * radii[0]), bc_type="periodic")
    turn = np.linspace(0.0, 2.0 * math.pi, 96, endpoint=False)
    radius = np.asarray(spline(turn))
    assume(radius.min() > 0.1)
    return _polygon(0.5 * draw(_sizes()) * _round(turn, radius))


@st.composite
def _patchwork(draw: st.DrawFn) -> Model:
    """A general polygon: squares that adjoin, in a lattice that is pulled askew; arms, hooks and rings with a gap."""
    import shapely

    cells = [(0, 0)]
    for _ in range(draw(st.integers(1, 9))):
        x, y = cells[-1] if draw(st.booleans()) else cells[draw(st.integers(0, len(cells) - 1))]
        dx, dy = draw(st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1)]))
        cells.append((x + dx, y + dy))
    # Overlapping a little, so that squares that meet at a corner make no outline that touches itself.
    squares = [shapely.box(x - 0.55, y - 0.55, x + 0.55, y + 0.55) for x, y in cells]
    points = _outline(shapely.union_all(squares))
    askew = np.array([[1.0, 0.6 * draw(_signed())], [0.6 * draw(_signed()), 1.0]])
    return _polygon(_sized(points @ askew.T, draw(_sizes())))


@st.composite
def _union(draw: st.DrawFn) -> Model:
    """A union of discs, bars and wedges, each placed on the outline of those before."""
    import shapely
    from shapely.affinity import rotate

    shape: Any = shapely.Point(0.0, 0.0).buffer(1.0, quad_segs=8)
    for _ in range(draw(st.integers(1, 3))):
        at = shape.exterior.interpolate(draw(_share()), normalized=True)
        x, y, size = at.x, at.y, 0.2 + 0.8 * draw(_share())
        kind, turn = draw(st.sampled_from(["disc", "bar", "wedge"])), 360.0 * draw(_share())
        part: Any = at.buffer(size, quad_segs=6)
        if kind == "bar":
            part = shapely.box(x - 1.5 * size, y - 0.2, x + 1.5 * size, y + 0.2)
        elif kind == "wedge":
            part = shapely.Polygon([(x - size, y - 0.3 * size), (x + size, y), (x - size, y + 0.3 * size)])
        shape = shape.union(rotate(part, turn, origin=(x, y)))
        assume(isinstance(shape, shapely.Polygon))
    return _polygon(_sized(_outline(shape.simplify(1e-4)), draw(_sizes())))


def _outline(shape: Any) -> Array:
    """Return the outer ring of a shapely polygon, anticlockwise, without its last point, which is its first."""
    import shapely

    assume(isinstance(shape, shapely.Polygon))
    return shapely.get_coordinates(shapely.geometry.polygon.orient(shape).exterior)[:-1]


def _sized(points: Array, size: float) -> Array:
    """Return points (n, 2) about the origin, moved and scaled so that their largest extent is `size` m."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray((points - 0.5 * (low + high)) * (size / float(np.max(high - low))))


def _named(kind: str, **numbers: st.SearchStrategy[Any]) -> Callable[[], st.SearchStrategy[Model]]:
    """Return what draws a model of the catalogue from strategies for its parameters."""
    return lambda: st.builds(lambda **values: catalogue.make_model(kind, **values), **numbers)


PLANE_MODELS: dict[str, Callable[[], st.SearchStrategy[Model]]] = {
    "circle": _named("circle", size=_sizes()),
    "ellipse": _named("ellipse", ratio=st.sampled_from([2.0, 1.2, 5.0, 20.0]), size=_sizes()),
    "star": _named("star", points=st.integers(5, 9), tip_angle=st.sampled_from([60.0, 20.0, 5.0, 90.0]), size=_sizes()),
    "cassinian": _named("cassinian", lobes=st.integers(2, 7), a_n=st.sampled_from([2.0, 1.1, 1.5, 4.0]), size=_sizes()),
    "dumbbell": _named("dumbbell", neck=st.sampled_from([0.5, 0.3, 0.1, 0.8]), size=_sizes()),
    "star-shaped": _star_shaped,
    "spline": _spline,
    "patchwork": _patchwork,
    "union": _union,
}
"""Kinds of models that are drawn: those of the catalogue, and polygons made in four ways."""


@st.composite
def _prism(draw: st.DrawFn) -> Model:
    """A polygon extruded: arms, notches and slivers with flat ends."""
    outline = draw(st.one_of(_star_shaped(), _patchwork()))
    return catalogue.make_model("extruded", model=outline.table, length=draw(_sizes()))


@st.composite
def _hull(draw: st.DrawFn) -> Model:
    """The convex hull of 5 to 20 points: faces, edges and corners of every angle."""
    from scipy.spatial import ConvexHull, QhullError

    count = draw(st.integers(5, 20))
    points = 0.5 * draw(_sizes()) * np.array([[draw(_signed()) for _ in range(3)] for _ in range(count)])
    points = np.round(points, 6)
    try:
        hull = ConvexHull(points)
    except QhullError:
        assume(False)
        raise
    corners = points[np.sort(hull.vertices)]
    rows = np.searchsorted(np.sort(hull.vertices), hull.simplices)
    inward = np.linalg.det(corners[rows] - corners.mean(axis=0)) < 0.0
    rows[inward] = rows[inward][:, ::-1]
    assume(np.ptp(corners, axis=0).max() >= 0.01)
    try:
        return catalogue.mesh(corners.tolist(), rows.tolist())
    except InputError:  # points in one plane
        assume(False)
        raise


MESHES: dict[str, Callable[[], st.SearchStrategy[Model]]] = {
    "cube": _named("cube", size=_sizes()),
    "box": _named("box", x=_sizes(), y=_sizes(), z=st.sampled_from([0.05, 0.2, 0.01, 0.001])),
    "wedge": _named("wedge", angle=st.sampled_from([60.0, 20.0, 5.0, 120.0]), size=_sizes(), length=_sizes()),
    "l-block": _named("l-block", size=_sizes(), thickness=st.sampled_from([0.02, 0.04, 0.005]), length=_sizes()),
    "icosphere": _named("icosphere", subdivisions=st.integers(0, 3), size=_sizes()),
    "cylinder": _named("cylinder", size=_sizes(), length=_sizes(), sides=st.sampled_from([3, 6, 12, 64])),
    "prism": _prism,
    "hull": _hull,
}
"""Kinds of meshes that are drawn: the solids of the catalogue, drawn polygons extruded, and convex hulls of points."""
