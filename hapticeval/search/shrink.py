"""A case that fails, made smaller step by step while it fails in the same way.

In this order:

1. a body at rest, or a slower one; fewer moves, and a shorter path; of a polygon also fewer vertices;
2. coordinates on a grid of 1 mm, 0.1 mm, 10 um or 1 um;
3. a round speed;
4. a path in the first quadrant.

A hand that started in free space still does. A smaller path need not be one that a hand can make: its moves are even,
straight and at constant speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec.structs import replace

from hapticeval.errors import InputError
from hapticeval.search.trial import Fault
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.moves import Moves
from hapticeval.suite.case import Case
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.geometry.model import Model

GRIDS = (1e-3, 1e-4, 1e-5, 1e-6)
"""Metres to which coordinates are rounded, the coarsest first that the fault survives."""

MOST_ROUNDED = 6
"""Up to so many coordinates, those of three points in the plane, are rounded in all combinations of up and down."""

ROUND_SPEEDS = (0.05, 0.1, 0.02, 0.01, 0.2, 0.5)
"""Round speeds (m/s) of even moves, the first that the fault survives: 0.05 m/s is 50 um a tick at 1 kHz."""

LONG_PATH = 0.3
"""Length (m) from which on a path is first of all made faster, since each trial takes as long as its path."""

SHORTER_SHARE = 0.98
"""A path counts as shorter below this share of the length before."""

PULLS = (1.0, 0.75, 0.5, 0.25, 0.1, 0.03)
"""Shares by which a point of a path is pulled towards another."""

SHORTEST_PATH = 1e-4
"""Length (m) below which no path is shrunk: a hundred steps of the finest grid, to which it is rounded."""

START_PLACES = 8
"""How many places to either side of a path's first contact are tried as starts."""

START_HEIGHT = 1e-3
"""Height over the surface of a start that is tried, as a share of the model's size: 0.2 mm of 200 mm."""

MOST_TRIALS = 600
"""Cases that a shrink tries at the most: no clock decides how small a case gets, unless it stops the search."""

SLOWEST_BODY = 1e-3
"""Speed (m/s) and rate (turns a second) below which a body is not made slower: a tick's way is a micrometre."""

FindFault = Callable[[Case], Fault | None]


class Shrink:
    """The shrink of one case: `case` and `fault` are the smallest so far, `tried` counts the trials.

    `fails` returns a case's fault where that is the same as `fault`, and None otherwise.
    """

    def __init__(self, case: Case, fault: Fault, fails: FindFault) -> None:
        self.case = case
        self.fault = fault
        self.tried = 0
        self._most_trials = MOST_TRIALS
        self._fails = fails
        self._outside = self._starts_outside(case)
        self._seen: set[str] = set()

    def run(self, most_trials: int = MOST_TRIALS) -> bool:
        """Shrink until nothing gets smaller or `most_trials` were made in all; return whether nothing does."""
        self._most_trials = most_trials
        if isinstance(self.case.trajectory, Moves):
            # A body at rest first: what it breaks there needs no motion, and is tried in less time.
            self._fixpoint(_calmer_body)
            # What comes after the evidence makes no difference, and costs time in every further trial.
            self._take_first_failing(self._cut_after_fault)
            if size_of(self.case) > LONG_PATH:  # each case that is tried takes as long as its path
                self._take_first_failing(_even_moves)
            self._fixpoint(_without_tremor, self._cut_after_fault, _fewer_moves, _even_moves, self._shorter)
            # Vertices on a path that is short by now: trials are quick.
            self._fixpoint(_fewer_vertices, _fewer_moves, self._shorter)
            # Bounds grow with the HIP's steps: a fault that is small on a short path shows under a slower hand.
            self._take_first_failing(_slow)
            self._fixpoint(_fewer_moves, self._shorter)
            # From here on the case gets no smaller, but easier to tell: round numbers, positive ones.
            self._take_first_failing(_on_grid)
            self._take_first_failing(_points_on_grid)
            self._take_first_failing(_at_round_speeds)
            self._take_first_failing(_mirrored_paths)
        else:
            self._fixpoint(_plainer_scene, _less_push, _fewer_vertices)
        return self.tried < most_trials

    def _fixpoint(self, *passes: Callable[[Case], Iterator[Case]]) -> None:
        """Repeat passes, each as long as it makes the case smaller, until none does."""
        while True:
            before = self.case
            for pass_ in passes:
                while self._take_first_failing(pass_):
                    pass
            if self.case is before or self.tried >= self._most_trials:
                return

    def _take_first_failing(self, pass_: Callable[[Case], Iterator[Case]]) -> bool:
        """Take the first case of a pass that still fails in the same way; return whether there was one."""
        for case in pass_(self.case):
            if self.tried >= self._most_trials:
                return False
            if self._take(case):
                return True
        return False

    def _take(self, case: Case) -> bool:
        """Try a case that was not tried before, and make it the smallest one if it fails in the same way."""
        key = repr((case.model, case.scene, case.trajectory, case.experiment))
        # Passes meet each other's candidates again, and a trial would end as it did.
        if key in self._seen:
            return False
        self._seen.add(key)
        try:
            # A hand that starts inside the model breaks other things than one that comes from free space.
            if self._outside and not self._starts_outside(case):
                return False
        except InputError:  # a polygon that is none any more
            return False
        self.tried += 1
        fault = self._fails(case)
        if fault is None:
            return False
        self.case, self.fault = case, fault
        return True

    def _starts_outside(self, case: Case) -> bool:
        """Whether a path starts in free space; True of an experiment."""
        if not isinstance(case.trajectory, Moves):
            return True
        boundary = case.build_scene().model.boundary
        return bool(boundary.signed_distance(np.array([case.trajectory.start]))[0] > 0.0)

    def _shorter(self, case: Case) -> Iterator[Case]:
        """Yield shorter paths: from another start or to another end, with a point pulled in, and shrunk as a whole."""
        points, model = _points(_moves(case)), case.build_scene().model
        length = _length(points)
        feet = model.boundary.closest_point(points).foot
        ends = []
        if self.fault.time is not None:
            # Where the hand is two ticks after the evidence (N,), m.
            path, time = _moves(case).path(), self.fault.time + 2.0 * case.build_scene().sampling_time
            ends = [np.array([np.interp(time, path.time, column) for column in path.points.T])]
        candidates = [
            *_with_start_nearby(points, feet, model),
            *(np.vstack([points[:-1], end]) for end in ends),
            *_with_point_pulled(points),
            *_drawn_together(points, feet, model),
        ]
        for moved_points in candidates:
            if SHORTEST_PATH <= _length(moved_points) < SHORTER_SHARE * length:
                yield _with_points(case, moved_points)

    def _cut_after_fault(self, case: Case) -> Iterator[Case]:
        """End a path soon after the time of the evidence."""
        moves, fault_time = _moves(case), self.fault.time
        if fault_time is None:
            return
        end_times = np.cumsum([move.seconds for move in moves.moves])
        # Up to the end of the move in which the evidence lies, or else of the next one.
        move_count = int(np.searchsorted(end_times, fault_time)) + 1
        for count in (move_count, move_count + 1):
            if count < len(moves.moves):
                yield _with_moves(case, replace(moves, moves=moves.moves[:count]))


def _moves(case: Case) -> Moves:
    assert isinstance(case.trajectory, Moves)
    return case.trajectory


def _points(moves: Moves) -> Array:
    """Return the start and the ends of all moves (n, N), m."""
    return np.array([moves.start, *(move.to for move in moves.moves)])


def _length(points: Array) -> float:
    """Return the length (m) of the polyline through points (n, N), m."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _with_start_nearby(points: Array, feet: Array, model: Model) -> Iterator[Array]:
    """Yield paths (n, N), m, that begin above the surface near to where one through `points` (n, N), m, touches first.

    `feet` (n, N), m, are the surface's points nearest to `points`. A path of one move goes to places nearby as a whole.
    """
    boundary = model.boundary
    start_height = START_HEIGHT * model.size
    # Straight in from above the surface beside where the first move ends, nearest first.
    reach = min(_length(points), boundary.girth / 4.0)
    # Arc lengths along the surface, m: 0, and then the nearest to either side.
    lengths = reach * np.array(sorted(range(-START_PLACES, START_PLACES + 1), key=abs)) / START_PLACES
    for foot in (feet[1], feet[0]):
        places_beside = boundary.walk(foot, lengths)
        for start in places_beside.foot + start_height * places_beside.normal:
            yield np.vstack([start, points[1:]])
    if len(points) == 2:
        depth = np.linalg.norm(points[1] - feet[1])
        places_beside = boundary.walk(feet[1], np.sort(lengths))
        above = places_beside.foot + start_height * places_beside.normal
        under = places_beside.foot - depth * places_beside.normal
        # From above one place to under its neighbour, at the same depth and at less.
        for share in (1.0, 0.5, 0.2):
            ends = places_beside.foot + share * (under - places_beside.foot)
            yield from (np.array(pair) for pair in zip(above[:-1], ends[1:], strict=True))
            yield from (np.array(pair) for pair in zip(above[1:], ends[:-1], strict=True))


def _with_point_pulled(points: Array) -> Iterator[Array]:
    """Yield paths (n, N), m, of which one of `points` (n, N), m, is pulled towards its neighbours.

    x_k += p (x_j - x_k): both ends towards the next point, inner points towards the middle of both.
    """
    pulled_ends = [(0, 1), (len(points) - 1, len(points) - 2)]
    for pull in PULLS[1:] if len(points) == 2 else PULLS:
        for index, neighbour in pulled_ends:
            moved_points = points.copy()
            moved_points[index] += pull * (points[neighbour] - points[index])
            yield moved_points
        for index in range(1, len(points) - 1):
            moved_points = points.copy()
            moved_points[index] += pull * (0.5 * (points[index - 1] + points[index + 1]) - points[index])
            yield moved_points


def _drawn_together(points: Array, feet: Array, model: Model) -> Iterator[Array]:
    """Yield the path through `points` (n, N), m, drawn together, x += p (c - x), about places c of the model.

    They are the corners nearest to it, its start, and where it touches: of `feet` (n, N), m, all but the first.
    """
    corners = sorted(
        model.boundary.corners, key=lambda corner: float(np.linalg.norm(points - corner.position, axis=1).min())
    )
    centres = [corner.position for corner in corners[:3]] + [points[0], *feet[1:]]
    for pull in PULLS[1:]:
        for centre in centres:
            yield points + pull * (centre - points)


def _with_moves(case: Case, moves: Moves) -> Case:
    return replace(case, trajectory=moves)


def _with_points(case: Case, points: Array) -> Case:
    """Return the case along other points (n, N), m: even moves keep their speed, and others their time."""
    moves = _moves(case)
    old_points = _points(moves)
    moves_along = []
    for move, old_start, old_end, new_start, new_end in zip(
        moves.moves, old_points[:-1], old_points[1:], points[:-1], points[1:], strict=True
    ):
        seconds = move.seconds
        # The same speed on the new way: t' = t |new_end - new_start| / |old_end - old_start|.
        if move.even and math.dist(old_start, old_end) > 0.0 and math.dist(new_start, new_end) > 0.0:
            seconds = _whole_milliseconds(seconds * math.dist(new_start, new_end) / math.dist(old_start, old_end))
        moves_along.append(replace(move, to=_rounded_point(new_end), seconds=seconds))
    return _with_moves(case, replace(moves, start=_rounded_point(points[0]), moves=tuple(moves_along)))


def _rounded_point(point: Array) -> list[float]:
    """Return a point (N,), m, as a case holds it, to the nanometre."""
    return [round(float(x), 9) + 0.0 for x in point]


def _whole_milliseconds(seconds: float) -> float:
    """Return a duration in whole milliseconds, two at least."""
    return max(round(seconds, 3), 2e-3)


def _without_tremor(case: Case) -> Iterator[Case]:
    """Leave out the tremor, where there is one."""
    moves = _moves(case)
    if moves.tremor is not None:
        yield _with_moves(case, replace(moves, tremor=None))


def _fewer_moves(case: Case) -> Iterator[Case]:
    """Leave moves out, many at once first; without the first ones the path starts where they have led."""
    moves = _moves(case)
    count = len(moves.moves)
    width = count - 1
    while width >= 1:
        for first in range(count - width + 1):
            fewer_moves = moves.moves[:first] + moves.moves[first + width :]
            if not fewer_moves:
                continue
            yield _with_moves(case, replace(moves, moves=fewer_moves))
            if first == 0:
                yield _with_moves(case, replace(moves, start=moves.moves[width - 1].to, moves=fewer_moves))
        # Widths are halved as long as they are large, as in a bisection, and then each is tried.
        width = width // 2 if width > 4 else width - 1


def _even_moves(case: Case) -> Iterator[Case]:
    """Make moves even: at round speeds, on a long path the highest first, and at the mean speed of each."""
    moves = _moves(case)
    if all(move.even for move in moves.moves):
        return
    points = _points(moves)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    for speed in (*_speeds(moves), None):
        even_moves = tuple(
            replace(
                move,
                even=True,
                seconds=move.seconds if speed is None or length == 0.0 else _whole_milliseconds(length / speed),
            )
            for move, length in zip(moves.moves, lengths.tolist(), strict=True)
        )
        yield _with_moves(case, replace(moves, moves=even_moves))


def _on_grid(case: Case) -> Iterator[Case]:
    """Round all coordinates; on a path of few points also up or down in place of to the nearest."""
    points = _points(_moves(case))
    for grid in GRIDS:
        rounded = np.round(points / grid)
        yield _with_points(case, rounded * grid)
        if points.size <= MOST_ROUNDED:
            # The 2^k corners of the grid's cell round the k coordinates, nearest first.
            lower_corner = np.floor(points / grid)
            roundings = [lower_corner + np.reshape(up, points.shape) for up in np.ndindex(*(2,) * points.size)]
            distances = [float(np.abs(rounding * grid - points).sum()) for rounding in roundings]
            for index in np.argsort(distances, kind="stable"):
                yield _with_points(case, roundings[index] * grid)


def _points_on_grid(case: Case) -> Iterator[Case]:
    """Round the coordinates of one point more coarsely than they are."""
    points = _points(_moves(case))
    for grid in GRIDS:
        for index in range(len(points)):
            moved_points = points.copy()
            moved_points[index] = np.round(points[index] / grid) * grid
            # Rounding may lengthen a path by a step of the grid, so that a coarse one has a chance.
            if not np.array_equal(moved_points, points) and _length(moved_points) < _length(points) + grid:
                yield _with_points(case, moved_points)


def _slow(case: Case) -> Iterator[Case]:
    """Give all even moves of a path that is not long the lowest of the round speeds."""
    if size_of(case) < LONG_PATH:
        yield from _at_speeds(case, [min(ROUND_SPEEDS)])


def _at_round_speeds(case: Case) -> Iterator[Case]:
    """Give all even moves one round speed."""
    yield from _at_speeds(case, _speeds(_moves(case)))


def _speeds(moves: Moves) -> Sequence[float]:
    """Return the round speeds in the order in which they are tried."""
    return ROUND_SPEEDS if moves.length < LONG_PATH else sorted(ROUND_SPEEDS, reverse=True)


def _at_speeds(case: Case, speeds: Sequence[float]) -> Iterator[Case]:
    """Give all moves one of the speeds (m/s) after the other, where all are even."""
    moves = _moves(case)
    points = _points(moves)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1).tolist()
    if not all(move.even for move in moves.moves):
        return
    for speed in speeds:
        timed_moves = tuple(
            replace(move, seconds=_whole_milliseconds(length / speed)) if length else move
            for move, length in zip(moves.moves, lengths, strict=True)
        )
        # It has this speed already, and those after it are no rounder.
        if timed_moves == moves.moves:
            return
        yield _with_moves(case, replace(moves, moves=timed_moves))


def _mirrored_paths(case: Case) -> Iterator[Case]:
    """Mirror the path so that more of its coordinates are positive: models have symmetries."""
    points = _points(_moves(case))
    negative = int(np.sum(points < 0.0))
    dimension = points.shape[1]
    # Each sign is 0 or 1, for an axis as it is or mirrored: few mirrored ones first.
    for signs in sorted(np.ndindex(*(2,) * dimension), key=sum):
        mirrored = points * (1.0 - 2.0 * np.array(signs))
        if int(np.sum(mirrored < 0.0)) < negative:
            yield _with_points(case, mirrored)


def _fewer_vertices(case: Case) -> Iterator[Case]:
    """Leave vertices of a polygon out."""
    vertices = case.model.get("vertices")
    if case.model.get("kind") != "polygon" or not isinstance(vertices, list):
        return
    count = len(vertices)
    width = max(count // 2, 1)
    while width >= 1:
        for first in range(0, count, width):
            fewer_vertices = vertices[:first] + vertices[first + width :]
            if len(fewer_vertices) >= 3:
                yield replace(case, model={**case.model, "vertices": fewer_vertices})
        width //= 2


def _plainer_scene(case: Case) -> Iterator[Case]:
    """Leave entries of the scene at their defaults."""
    for name in case.scene:
        yield replace(case, scene={key: value for key, value in case.scene.items() if key != name})


def _calmer_body(case: Case) -> Iterator[Case]:
    """Let the body rest; turn about its origin; move half as fast; and at numbers of one digit."""
    motion = case.scene.get("motion")
    if motion is None:
        return
    yield replace(case, scene={key: value for key, value in case.scene.items() if key != "motion"})
    name = "rate" if "rate" in motion else "velocity"
    values = np.atleast_1d(np.asarray(motion[name], dtype=np.float64))
    if any(motion.get("centre") or ()):
        yield replace(case, scene={**case.scene, "motion": {**motion, "centre": [0.0] * len(motion["centre"])}})
    alone = [np.where(np.arange(values.size) == index, values, 0.0) for index in range(values.size)]
    slower = [0.5 * values, np.round(values, 1), np.round(values, 2)]
    for candidate in (*alone, *slower):
        # what is slower is as good as at rest, which was tried
        if np.abs(candidate).max() >= SLOWEST_BODY and np.abs(candidate).sum() < np.abs(values).sum():
            calmer = candidate.tolist() if name == "velocity" else float(candidate[0])
            yield replace(case, scene={**case.scene, "motion": {**motion, name: calmer}})


def _less_push(case: Case) -> Iterator[Case]:
    """Shorten an experiment; push less often, or not at all; and round its numbers."""
    push = case.experiment
    assert push is not None
    rows = push.force or []
    for share in (0.25, 0.5, 0.75):
        if (duration := _whole_milliseconds(share * push.duration)) < push.duration:
            yield replace(case, experiment=replace(push, duration=duration))
    if rows:
        yield replace(case, experiment=replace(push, force=None))
    for index in range(len(rows)):
        if len(rows) > 1:
            yield replace(case, experiment=replace(push, force=rows[:index] + rows[index + 1 :]))
    # To 0.1, 0.01, 0.001 m/s, to a hundredth of that in metres, and to 1, 0.1, 0.01 N.
    for digits in (1, 2, 3):
        for name, finer_digits in (("velocity", 0), ("position", 2)):
            values: Sequence[float] | None = getattr(push, name)
            if values is not None:
                rounded_entry: dict[str, Any] = {name: [round(x, digits + finer_digits) + 0.0 for x in values]}
                if rounded_entry[name] != values:
                    yield replace(case, experiment=replace(push, **rounded_entry))
        rounded = [[row[0], *(round(x, digits - 1) + 0.0 for x in row[1:])] for row in rows]
        if rounded != rows:
            yield replace(case, experiment=replace(push, force=rounded))


def size_of(case: Case) -> float:
    """Return how large a case is, m or s: the length of its path, or how long its experiment lasts."""
    if isinstance(case.trajectory, Moves):
        return case.trajectory.length
    assert isinstance(case.experiment, ExperimentTable)
    return case.experiment.duration
