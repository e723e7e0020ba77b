"""Playback (Figure 6.1): a renderer is led along a given HIP path, as if it came from the robot's encoders.

Any way to answer along a given path is made of two loops: `laws.lead_by_law` over a compiled step, and one over
`step` here. What a run had answered until its renderer raises is not kept; one that ends because the renderer leaves
its domain keeps its rows, and the siblings that checks ask for are made along these.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, cast

import numpy as np

from hapticeval.errors import (
    DomainError,
    HapticevalError,
    RefusalError,
    RendererError,
    blame_renderer,
    renderer_errors,
)
from hapticeval.geometry.boundary import Boundary
from hapticeval.pulse import count_answer, note_run
from hapticeval.recordings.recording import Recording, backward_difference, single_rounding
from hapticeval.renderer import Answers, Batch, Renderer, TrajectoryRenderer, abilities_of
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import (
    not_finite,
    observe_force_checked,
    reported_contact,
    reported_contacts,
    reset_checked,
    simulate_checked,
    step_checked,
)
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array, BoolArray

LEAD_IN_SHARE = 1e-4
"""Distance from the surface, as a share of the model's size, from which a hand that rests is led in."""

MOST_LEAD_IN_TICKS = 100
"""Ticks that a hand is led in at the most, in longer steps than the path's where that needs more: none is judged."""

LEAD_IN_REST_TICKS = 10
"""Ticks that it then rests where the path begins: more than any granted lag."""


def play(renderer: Renderer | TrajectoryRenderer, path: Path, dt: float, *, scene: Scene | None = None) -> Recording:
    """Return a renderer's answers along `path`, sampled every `dt` s; with a `scene` led in first: see `run_path`.

    Raises `RendererError`, naming tick and HIP, when the renderer raises, answers in a wrong shape or with a
    number that is not finite, and `DomainError` where it is led out of where it is defined.
    """
    if not isinstance(renderer, Renderer):
        return simulate_checked(renderer, path, dt)
    return _play(renderer, *path.sampled(dt), dt, scene)


def play_while_defined(
    renderer: Renderer | TrajectoryRenderer, path: Path, dt: float, *, scene: Scene | None = None
) -> Recording:
    """Return the answers along `path` as `play` does, up to where the renderer is led out of where it is defined.

    As in a closed loop `meta["ended"]` then says at which `tick` and `time`, `what` and `why`, and the recording holds
    what was before that tick. Raises `DomainError` where that is less than two samples, and of a renderer that
    answers a stimulus whole.
    """
    try:
        return play(renderer, path, dt, scene=scene)
    except DomainError as error:
        if not isinstance(renderer, Renderer):
            raise
        time, hips = path.sampled(dt)
        count = rows_defined(lambda rows: _play(renderer, time[:rows], hips[:rows], dt, scene), time.size)
        if count < 2:
            raise
        recording = _play(renderer, time[:count], hips[:count], dt, scene)
        ended = {"tick": count, "time": float(time[count]), "what": error.what, "why": error.why}
        return Recording(recording.time, recording.channels, {**recording.meta, "ended": ended})


def rows_defined(lead: Callable[[int], object], count: int) -> int:
    """Return how many rows of `count` a renderer answers before it is led out of where it is defined.

    `lead(rows)` answers so many from a reset on; it raises `DomainError` for `count`. Found by halves.
    """

    def leaves(rows: int) -> bool:
        try:
            lead(rows)
        except DomainError:
            return True
        return False

    # rows that end too early answer, all that go on refuse: the first that refuses has one row too many
    return bisect_left(range(1, count), True, key=leaves)


def _play(renderer: Renderer, time: Array, hips: Array, dt: float, scene: Scene | None) -> Recording:
    velocity = backward_difference(hips, time)
    answers = run_path(renderer, hips, velocity, dt, scene=scene)
    channels = {"hip": hips, **channels_of(answers), "velocity": velocity}
    meta = {"source": "playback", "dt": dt, **abilities_of(renderer).meta}
    # How many steps a log that the renderer keeps itself has before the first row.
    if ticks := len(lead_in_path(renderer, hips, scene)):
        meta["lead_in_ticks"] = ticks
    return Recording(time, channels, meta=meta)


class Rows(NamedTuple):
    """What a renderer is asked, tick by tick: HIP (n, N), m; velocity (n, N), m/s; dt (n,), s."""

    hip: Array
    velocity: Array
    dt: Array

    def part(self, begin: int, end: int) -> Rows:
        """Return the rows from `begin` to before `end`."""
        return Rows(*(column[begin:end] for column in self))

    def followed_by(self, other: Rows) -> Rows:
        """Return these rows and then others."""
        return Rows(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))

    @classmethod
    def along(cls, time: Array, hips: Array, dt: float) -> Rows:
        """Return the rows of a path, `hips` (n, N), m, at `time` (n,), s, every `dt` (s)."""
        return cls(hips, backward_difference(hips, time), np.full(time.size, dt))

    @classmethod
    def resting(cls, hip: Array, dt: float, count: int) -> Rows:
        """Return rows of a hand that rests at `hip` (N,), m, for `count` ticks of `dt` (s)."""
        return cls(np.tile(hip, (count, 1)), np.zeros((count, hip.size)), np.full(count, dt))


def channels_of(answers: Answers) -> dict[str, Array]:
    """Return what a recording holds of answers."""
    return {"ihip": answers.ihip, "force": answers.force, **contact_channel(answers.contact)}


def contact_channel(contact: Array) -> dict[str, Array]:
    """Return the recording's channel of reported `contact` (n,), 1, 0 or NaN: none unless it is known of every row."""
    return {} if np.isnan(contact).any() else {"contact": contact}


def run_path(
    renderer: Renderer,
    hips: Array,
    velocity: Array,
    dt: float | Array,
    *,
    scene: Scene | None = None,
    pushes: Array | None = None,
    first: int = 0,
) -> Answers:
    """Return the answers of a renderer that is reset at the first row of `hips` (n, N), m, and led on.

    With a `scene`, a hand that would start inside its model is led in first: see `lead_in_path`. These ticks are no
    part of the answer.

    With one `dt` (s) for all rows a batch renderer is asked at once, and takes the velocity from the HIPs itself; with
    a step a row, `dt` (n,), every renderer is asked row by row and given `velocity` (n, N).

    One that feels is given the measured `pushes` (n, N), N, row by row, where there are any. Errors count ticks from
    `first` on.
    """
    abilities = abilities_of(renderer)
    one_step = not isinstance(dt, np.ndarray)
    # the hand starts inside: it is led in at the path's median rate
    lead_in = lead_in_rows(renderer, hips, float(np.median(dt)), scene)
    count = lead_in.dt.size
    rows = lead_in.followed_by(Rows(hips, velocity, np.broadcast_to(dt, len(hips))))
    if pushes is not None and abilities.observe_force:
        answers = _step_by_step(renderer, rows, first, count, np.vstack([np.zeros_like(lead_in.hip), pushes]))
    elif abilities.run and one_step:
        answers = _all_at_once(renderer, rows, first, count)
    else:
        answers = _step_by_step(renderer, rows, first, count)
    return answers.part(slice(count, None))


def lead_in_rows(renderer: object, hips: Array, dt: float, scene: Scene | None) -> Rows:
    """Return the ticks of `lead_in_path` to the first of `hips` (n, N), m, one every `dt` (s)."""
    lead_in = lead_in_path(renderer, hips, scene)
    return Rows(lead_in, np.diff(lead_in, axis=0, prepend=lead_in[:1]) / dt, np.full(len(lead_in), dt))


def lead_in_path(renderer: object, hips: Array, scene: Scene | None) -> Array:
    """Return HIPs (m, N), m, that lead a hand from free space to the first of `hips` (n, N), m, if that is inside.

    Straight in from the nearest point of the surface, the renderer's own where it has one, at the pace of the path or
    faster, and a rest at the end.

    A proxy that is reset inside of the solid would know no way out; so none is, and each starts with its tool where the
    nearest projection puts it. None for a hand that starts outside, and on a bilateral constraint.
    """
    nothing = np.empty((0, hips.shape[1]))
    if scene is None or scene.bilateral:
        return nothing
    boundary: Boundary = abilities_of(renderer).surface or scene.model.boundary
    start = hips[0]
    frame = boundary.closest_point(start[np.newaxis])
    depth = -float(frame.distance[0])
    if depth <= 0.0:
        return nothing
    # as far a tick as the path's fastest one; a hand at rest there is led in by a small share of the model's size
    pace = float(np.linalg.norm(np.diff(hips, axis=0), axis=1).max(initial=0.0)) or LEAD_IN_SHARE * scene.model.size
    outwards = (frame.foot[0] - start) / depth
    # beyond the surface, by as much as the renderer's own may stray; else, in a narrow notch, on it
    outside = frame.foot[0] + (abilities_of(renderer).standoff + pace) * outwards
    if not boundary.signed_distance(outside[np.newaxis])[0] > 0.0:
        outside = frame.foot[0]
    ticks = min(math.ceil(float(np.linalg.norm(start - outside)) / pace), MOST_LEAD_IN_TICKS)
    share = np.linspace(0.0, 1.0, ticks + 1)[:, np.newaxis]
    return np.vstack(
        [(1.0 - share) * outside + share * start, np.repeat(start[np.newaxis], LEAD_IN_REST_TICKS, axis=0)]
    )


def _all_at_once(renderer: Renderer, rows: Rows, first: int, ahead: int = 0) -> Answers:
    """Answer rows of one `dt` from a reset by `run`; the `ahead` rows of the way in count as tick `first`."""
    hips = rows.hip
    with renderer_errors(
        "run()",
        tick=first,
        hip=hips[0],
        why="its step() takes the same path without an error",
        todo="make run() equal to reset() and a step() a row",
    ):
        note_run(first - ahead)
        try:
            answer = cast("Batch", renderer).run(hips.copy(), float(rows.dt[0]))
            ihips, forces = (np.asarray(part, dtype=np.float64) for part in answer)
            count_answer()
        except (Exception, SystemExit) as error:
            if isinstance(error, HapticevalError) and not isinstance(error, RefusalError):
                raise
            # A batch does not say where it broke; single steps do.
            _step_by_step(renderer, rows, first, ahead)
            raise
    for name, array in (("IHIPs", ihips), ("forces", forces)):
        if array.shape != hips.shape:
            raise RendererError(
                f"the renderer's run() answered {name} of shape {array.shape}, not {hips.shape}",
                tick=first,
                hip=hips[0],
            )
        bad = ~np.isfinite(array).all(axis=1)
        if bad.any():
            tick = int(np.argmax(bad))
            raise RendererError(f"{name} not finite: {array[tick]}", tick=first + max(tick - ahead, 0), hip=hips[tick])
    return Answers(ihips, forces, reported_contacts(renderer, hips.shape[0]))


def _step_by_step(renderer: Renderer, rows: Rows, first: int, ahead: int = 0, pushes: Array | None = None) -> Answers:
    """Answer rows from a reset by `step`; the `ahead` rows of the way in count as tick `first`."""
    answers = Answers.room(rows.hip)
    reset_checked(renderer, rows.hip[0])
    _answer_each(renderer, rows, answers, range(len(rows.hip)), first, ahead, pushes, from_reset=True)
    return answers


def _answer_each(
    renderer: Renderer, rows: Rows, answers: Answers, numbers: range, first: int, ahead: int = 0,
    pushes: Array | None = None, *, from_reset: bool,
) -> None:  # fmt: skip
    """Write the answers of the rows `numbers`, a `step` a row: the one loop in Python over a path that is given.

    A renderer may refuse a row only if that is the first `from_reset` on. One that feels is given `pushes` (n, N), N.
    Errors count ticks from `first` on, to which the first `ahead` rows belong.
    """
    for row in numbers:
        tick, hip = first + max(row - ahead, 0), rows.hip[row]
        if pushes is not None:
            observe_force_checked(renderer, tick, hip, pushes[row])
        try:
            ihip, force = step_checked(
                renderer, tick, hip, rows.velocity[row], float(rows.dt[row]), may_refuse=from_reset and row == 0
            )
        except RendererError as error:
            if ahead:
                error.after_lead_in(row + 1, ahead)
            raise
        answers.ihip[row], answers.force[row], answers.contact[row] = ihip, force, reported_contact(renderer)


COMPARED = (4, 64)
"""Stretches of a path, and ticks each, on which a renderer's two ways of answering are compared."""


def compare_batch(
    renderer: Renderer, recording: Recording, *, contact: BoolArray, stiffness: float, damping: float
) -> None:
    """Hold a renderer's `run` to its `step`, on stretches of the path that `recording` was played along.

    The stretches begin at samples in `contact` (n,), from the first to the last, each with a reset. Both ways may
    differ by the rounding of coordinates in single precision, and forces by what the gains, `stiffness` (N/m) and
    `damping` (N s/m), make of that; and by as much as a HIP moved by that rounding changes the answer of `step`, which
    is all there is to say beside a jump.

    Does nothing for a renderer without `run`. Raises `RendererError`, naming tick, HIP and difference, where they
    differ by more.
    """
    touched = np.flatnonzero(contact)
    if not abilities_of(renderer).run or touched.size == 0:
        return
    dt = float(recording.meta["dt"])
    # of a coordinate, m; a spring and a backward difference make forces of it, which are rounded themselves
    rounding = single_rounding(recording.hip)
    allowed = np.array([rounding, (stiffness + 2.0 * damping / dt) * rounding])
    allowed[1] += single_rounding(recording.force)
    count, length = COMPARED
    for first in sorted({int(touched[k]) for k in np.linspace(0, touched.size - 1, count + 1).astype(int)[:-1]}):
        rows = Rows.along(recording.time[first : first + length], recording.hip[first : first + length], dt)
        try:
            batch = np.stack(_all_at_once(renderer, rows, first)[:2], axis=1)
        except DomainError:
            continue  # it may be led here, and not start here
        single = np.stack(_step_by_step(renderer, rows, first)[:2], axis=1)
        differences = np.linalg.norm(batch - single, axis=2)
        wrong = np.flatnonzero(np.any(differences > allowed, axis=1))
        if wrong.size == 0:
            continue
        row = int(wrong[0])
        if np.any(
            differences[row] > allowed + _change_of_answer(renderer, rows.part(0, row + 1), rounding, single[row])
        ):
            ihip, force = differences[row]
            answers_of_both = [
                f"{method}() answers {answers[row, 0]} m, {answers[row, 1]} N"
                for method, answers in zip(("run", "step"), (batch, single), strict=True)
            ]
            raise RendererError(
                f"the renderer's run() and step() differ by {1e3 * ihip:.3g} mm in the IHIP and {force:.3g} N",
                tick=first + row,
                hip=rows.hip[row],
                why=f"{', '.join(answers_of_both)}, both from a reset at tick {first} on; "
                f"rounding allows for {1e3 * allowed[0]:.2g} mm and {allowed[1]:.2g} N",
                todo="make run() equal to reset() and a step() a row",
            )


def _change_of_answer(renderer: Renderer, rows: Rows, by: float, answer: Array) -> Array:
    """How far the last answer of `step` moves, (IHIP, force), when the last HIP is moved by `by` (m) either way."""
    largest_change = np.zeros(2)
    for shift in by * np.vstack([np.eye(rows.hip.shape[1]), -np.eye(rows.hip.shape[1])]):
        shaken = rows.hip.copy()
        shaken[-1] += shift
        answer_there = np.stack(_step_by_step(renderer, rows._replace(hip=shaken), 0)[:2], axis=1)[-1]
        largest_change = np.maximum(largest_change, np.linalg.norm(answer_there - answer, axis=1))
    return largest_change


TURN_TICKS = 8
"""Ticks that a renderer answers before it is another one's turn."""

Party = tuple[Renderer, Path, Scene]
"""A renderer, the path that it is led along, and its scene."""


def play_in_turns(first: Party, second: Party, dt: float) -> Recording:
    """Return what the first renderer answers along its path, while the second is led along its own by turns.

    Both are reset at the beginning, and then answer `TURN_TICKS` ticks each until the first path ends.
    """
    parties = []
    for renderer, path, scene in (first, second):
        time, hips = path.sampled(dt)
        lead_in = lead_in_rows(renderer, hips, dt, scene)
        parties.append((renderer, lead_in.followed_by(Rows.along(time, hips, dt))))
        reset_checked(renderer, parties[-1][1].hip[0])
    first_rows = parties[0][1]  # only the first renderer's answers are recorded
    answers = Answers.room(first_rows.hip)
    for begin in range(0, len(first_rows.dt), TURN_TICKS):
        answers_of_turn = [
            lead_on(
                renderer,
                rows.part(begin, begin + TURN_TICKS),
                begin,
                partial(rows.part, 0, begin),
                from_reset=begin == 0,
            )
            for renderer, rows in parties
        ]
        for column, answered in zip(answers, answers_of_turn[0], strict=True):
            column[begin : begin + TURN_TICKS] = answered
    time, hips = first[1].sampled(dt)
    recorded = slice(len(first_rows.dt) - len(time), None)
    channels = {"hip": hips, **channels_of(answers.part(recorded)), "velocity": first_rows.velocity[recorded]}
    return Recording(time, channels, meta={"source": "playback", "dt": dt, **abilities_of(first[0]).meta})


def lead_on(
    renderer: Renderer,
    rows: Rows,
    first: int,
    since_reset: Callable[[], Rows],
    *,
    ahead: int = 0,
    from_reset: bool = False,
) -> Answers:
    """The answers of a renderer that is led on, or `from_reset` on. Errors count ticks from `first` on.

    By its compiled `law` or its `lead`, where it has one: what a law refuses its `step` words. A `lead` that raises has
    gone nobody knows how far. The renderer then steps from a reset along `since_reset`, the rows that it was led along
    before (of which `ahead` lead the hand in), and these ones, for the tick at which it breaks; where no step does,
    `lead` itself is to blame.
    """
    answers = Answers.room(rows.hip)
    ihips, forces, _ = answers
    try:
        answered = _lead_at_once(renderer, rows, answers, first)
    except (Exception, SystemExit) as error:
        before = since_reset()
        reset_checked(renderer, before.followed_by(rows).hip[0])
        _answer_each(renderer, before, Answers.room(before.hip), range(before.dt.size), 0, ahead, from_reset=True)
        _answer_each(renderer, rows, answers, range(rows.dt.size), max(first, 0), max(-first, 0), from_reset=from_reset)
        raise blame_renderer(
            "lead()",
            error,
            tick=max(first, 0),
            hip=rows.hip[0],
            why="its step() takes the same path without an error",
            todo="make lead() equal to a step() a row from where the last one ended",
        ) from error
    not_finite_rows = ~np.isfinite([ihips[:answered], forces[:answered]]).all(axis=(0, 2))
    if not_finite_rows.any():
        row = int(np.argmax(not_finite_rows))
        raise not_finite(max(first + row, 0), rows.hip[row], ihips[row], forces[row])
    # ticks before `first` = 0 are those of the way in
    _answer_each(
        renderer, rows, answers, range(answered, rows.dt.size), max(first, 0), max(-first, 0), from_reset=from_reset
    )
    return answers


def _lead_at_once(renderer: Renderer, rows: Rows, answers: Answers, first: int) -> int:
    """Write what a renderer answers in one call, and return how many rows that are: none where it cannot.

    Raises what its `lead` raises.
    """
    abilities, count = abilities_of(renderer), rows.dt.size
    # compiled first: it says itself how far it got; a `lead` in Python answers all rows or none
    if abilities.law is not None and count:
        note_run(first)
        return abilities.law.lead(*rows, answers)[0]
    if abilities.lead and count:
        answers.ihip[:], answers.force[:] = renderer.lead(*(column.copy() for column in rows))  # type: ignore[attr-defined]
        answers.contact[:] = reported_contacts(renderer, count)
        count_answer()
        return count
    return 0
