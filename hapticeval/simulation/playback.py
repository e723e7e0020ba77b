"""Playback (Figure 6.1): a renderer is led along a given HIP path, as if it came from the robot's encoders.

Any way to answer along a given path is made of two loops: `compiled.lead_by_law` over a compiled step, and one over
`step` here. What a run had answered until its renderer raises is not kept; one that ends because the renderer leaves
its domain keeps its rows, and the siblings that checks ask for are made along these.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import NamedTuple, cast

import numpy as np

from hapticeval.errors import (
    DomainError,
    HapticevalError,
    RefusalError,
    RendererError,
    blame_renderer,
    describe_error,
    in_mm,
    is_foreign,
    renderer_errors,
)
from hapticeval.geometry.boundary import Boundary
from hapticeval.pulse import count_answer, note_pending, note_run
from hapticeval.recordings.channels import REQUIRED
from hapticeval.recordings.recording import OWN_TOOL, Recording, backward_difference, single_rounding
from hapticeval.renderer import Answers, Batch, Renderer, TrajectoryRenderer, abilities_of
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Path, Stimulus, sample_times
from hapticeval.types import Array, BoolArray

LEAD_IN_SHARE = 1e-4
"""Distance from the surface, as a share of the model's size, from which a hand that rests is led in."""

MOST_LEAD_IN_TICKS = 100
"""Ticks that a hand is led in at the most, in longer steps than the path's where that needs more: none is judged."""

CLOCK_ROUNDING = 1e-6
"""A share of the sampling time by which a clock may differ from what was asked: rounding."""

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


def reported_contact(renderer: Renderer) -> float:
    """Return 1 where a renderer reports that its last step was in contact, 0 where not, and NaN where it is silent."""
    report = getattr(renderer, "contact", None) if abilities_of(renderer).contact else None
    return float(report) if isinstance(report, bool | np.bool_) else math.nan


def _reported_contacts(renderer: Renderer, count: int) -> Array:
    """Return what a renderer reports of the answers of its last `run` or `lead`, (count,): `reported_contact`."""
    report = np.asarray(getattr(renderer, "contact", None) if abilities_of(renderer).contact else None)
    known = report.dtype == np.bool_ and report.shape == (count,)
    return report.astype(np.float64) if known else np.full(count, np.nan)


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


def simulate_checked(renderer: TrajectoryRenderer, stimulus: Stimulus, dt: float) -> Recording:
    """Return `renderer.simulate(...)`, marked as `OWN_TOOL`. Raises `RendererError` for what was not asked for."""
    with renderer_errors("simulate()"):
        recording = renderer.simulate(stimulus, dt)
    if not isinstance(recording, Recording):
        raise RendererError(
            f"the renderer's simulate() gave a {type(recording).__name__}", todo="return a hapticeval.Recording"
        )
    recording.require(*REQUIRED)
    time = stimulus.sampled(dt)[0] if isinstance(stimulus, Path) else sample_times(stimulus.duration, dt)
    if recording.time.shape != time.shape or np.max(np.abs(recording.time - time)) > CLOCK_ROUNDING * dt:
        raise RendererError(
            f"the renderer's simulate() has {len(recording)} samples from {recording.time[0]:.6g} to "
            f"{recording.time[-1]:.6g} s",
            why=f"it was asked for {time.size} samples every {dt:.6g} s, from 0 to {time[-1]:.6g} s",
            todo="record a sample at each of hapticeval's sample times, the last one included",
        )
    if recording.hip.shape[1] != stimulus.dimension:
        raise RendererError(
            f"the renderer's simulate() has a HIP in {recording.hip.shape[1]}D, and the stimulus is in "
            f"{stimulus.dimension}D",
            todo="record the HIP in the space of the stimulus",
        )
    return replace(recording, meta={**recording.meta, OWN_TOOL: True})


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
    return Answers(ihips, forces, _reported_contacts(renderer, hips.shape[0]))


def _step_by_step(renderer: Renderer, rows: Rows, first: int, ahead: int = 0, pushes: Array | None = None) -> Answers:
    """Answer rows from a reset by `step`; the `ahead` rows of the way in count as tick `first`."""
    answers = Answers.room(rows.hip)
    reset_checked(renderer, rows.hip[0])
    _answer_each(renderer, rows, answers, range(len(rows.hip)), first, ahead, pushes)
    return answers


def _answer_each(
    renderer: Renderer, rows: Rows, answers: Answers, numbers: range, first: int, ahead: int = 0,
    pushes: Array | None = None,
) -> None:  # fmt: skip
    """Write the answers of the rows `numbers`, a `step` a row: the one loop in Python over a path that is given.

    One that feels is given `pushes` (n, N), N. Errors count ticks from `first` on, to which the first `ahead` rows
    belong.
    """
    for row in numbers:
        tick, hip = first + max(row - ahead, 0), rows.hip[row]
        if pushes is not None:
            observe_force_checked(renderer, tick, hip, pushes[row])
        try:
            ihip, force = step_checked(
                renderer, tick, hip, rows.velocity[row], float(rows.dt[row]), may_refuse=row == 0
            )
        except RendererError as error:
            if ahead:
                error.after_lead_in(row + 1, ahead)
            raise
        answers.ihip[row], answers.force[row], answers.contact[row] = ihip, force, reported_contact(renderer)


def reset_checked(renderer: Renderer, hip: Array) -> None:
    """Call `renderer.reset(hip)` with the hand at `hip` (N,), m. Raises `RendererError` for what it raises."""
    with renderer_errors("reset()", tick=0, hip=hip):
        try:
            renderer.reset(hip.copy())
        except RendererError as error:
            raise error.placed(0, hip) from error


def ask_without_hip(renderer: Renderer, hip: Array, dt: float) -> tuple[Array | None, Array | None]:
    """Return a renderer's forces (N,), N, for a tick (`dt` s) without a HIP, and for one at `hip` (N,), m, after it.

    None for a tick that it refuses, by whatever it raises.
    """

    def force_for(hip: Array, velocity: Array) -> Array | None:
        try:
            return np.asarray(renderer.step(hip, velocity, dt)[1], dtype=np.float64)
        except Exception:  # a refusal is what a renderer of any kind may raise
            return None

    nowhere = np.full_like(hip, np.nan)
    # The velocity is a difference of places: of one that is missing it is missing too.
    return force_for(nowhere, nowhere.copy()), force_for(hip.copy(), np.zeros_like(hip))


def observe_force_checked(renderer: Renderer, tick: int, hip: Array, push: Array) -> None:
    """Call `renderer.observe_force(push)` with the measured `push` (N,), N, of a hand at `hip` (N,), m.

    Raises `RendererError` for what it raises.
    """
    with renderer_errors("observe_force()", tick=tick, hip=hip):
        renderer.observe_force(push.copy())  # type: ignore[attr-defined]


_step_seconds: list[float] | None = None


@contextmanager
def timed_steps() -> Iterator[list[float]]:
    """Yield a list that takes the seconds of every step that `step_checked` asks for within the block."""
    global _step_seconds
    seconds: list[float] = []
    _step_seconds = seconds
    try:
        yield seconds
    finally:
        _step_seconds = None


def step_checked(
    renderer: Renderer, tick: int, hip: Array, velocity: Array, dt: float, *, may_refuse: bool = True
) -> tuple[Array, Array]:
    """Return IHIP (N,), m, and force (N,), N, of `renderer.step(hip, velocity, dt)`, in copies of their own.

    A refusal is about a scene: it is a fault where the renderer no longer `may_refuse`, after a run's first answer.
    The renderer gets copies too: what it does to its arguments, and to its answers later, must not reach the recording.
    Raises `RendererError`, with tick and HIP, unless it answers two finite vectors like `hip`.
    """
    note_pending(tick, hip.tolist())
    try:
        begun = perf_counter()
        answer = renderer.step(hip.copy(), velocity.copy(), dt)  # an (ihip, force) pair of any kind
        if _step_seconds is not None:
            _step_seconds.append(perf_counter() - begun)
        count_answer()
    except RendererError as error:
        raise error.placed(tick, hip) from error
    except RefusalError as refusal:
        if may_refuse:
            raise
        raise RendererError(
            f"the renderer refuses in the middle of a run: {refusal.what}",
            tick=tick,
            hip=hip,
            why="a refusal is about a scene, and stands before the first answer",
            todo="refuse in the factory, in reset() or in the first step()",
        ) from refusal
    except HapticevalError:
        raise
    except BaseException as error:
        if not is_foreign(error):
            raise
        raise blame_renderer("step()", error, tick=tick, hip=hip) from error
    return check_answer(answer, tick, hip)


def check_answer(answer: object, tick: int, hip: Array) -> tuple[Array, Array]:
    """Return IHIP (N,), m, and force (N,), N, of what `step` has answered to `hip` (N,), m, in copies of their own.

    Raises `RendererError`, with tick and HIP, unless these are two finite vectors like `hip`.
    """
    try:
        first, second = cast("tuple[Array, Array]", answer)
        ihip, force = np.array(first, dtype=np.float64), np.array(second, dtype=np.float64)
    except (Exception, SystemExit) as error:
        raise RendererError(
            f"the renderer's step() returned {type(answer).__name__}, no pair of an IHIP and a force",
            tick=tick,
            hip=hip,
            why=describe_error(error),
            todo="return hapticeval.Response(ihip, force), or any pair of two vectors",
        ) from error
    if ihip.shape != hip.shape or force.shape != hip.shape:
        raise RendererError(
            f"the renderer answered an IHIP of shape {ihip.shape} and a force of shape {force.shape}",
            tick=tick,
            hip=hip,
            why=f"both must have the HIP's shape {hip.shape}",
        )
    if not all(map(math.isfinite, [*ihip.tolist(), *force.tolist()])):
        raise not_finite(tick, hip, ihip, force)
    return ihip, force


def not_finite(tick: int, hip: Array, ihip: Array, force: Array) -> RendererError:
    """Return the error of a renderer whose `ihip` (N,), m, or `force` (N,), N, to `hip` (N,), m, is not finite."""
    return RendererError(
        f"the renderer's answer is not finite: IHIP {in_mm(ihip)}, force {force} N",
        tick=tick,
        hip=hip,
        why="a number that is not finite would reach the motors",
    )


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
            _lead_on(renderer, rows.part(begin, begin + TURN_TICKS), begin, partial(rows.part, 0, begin))
            for renderer, rows in parties
        ]
        for column, answered in zip(answers, answers_of_turn[0], strict=True):
            column[begin : begin + TURN_TICKS] = answered
    time, hips = first[1].sampled(dt)
    recorded = slice(len(first_rows.dt) - len(time), None)
    channels = {"hip": hips, **channels_of(answers.part(recorded)), "velocity": first_rows.velocity[recorded]}
    return Recording(time, channels, meta={"source": "playback", "dt": dt, **abilities_of(first[0]).meta})


REST_PATIENCE = 32
"""Ticks after which a renderer that still moves under a hand at rest is not waited for."""


class Closeup:
    """A path that a renderer was led along, any part of which it can be led along again in finer steps.

    The renderer gets to that part as it did before, tick by tick, and the part alone is refined: from a copy of the
    renderer where it can be copied, else by leading it there anew from its reset. `recording` holds what it answered.
    """

    def __init__(self, recording: Recording, rows: Rows, before: Rows, subject: _Original) -> None:
        self.recording = recording
        self._rows = rows
        self._before = before
        self._subject = subject
        self._copies: dict[int, Renderer] = {}

    @classmethod
    def of(cls, renderer: Renderer, recording: Recording, scene: Scene) -> Closeup:
        """Return the close-up of a `recording` that `play` made of `renderer` in `scene`.

        The renderer's copies have the scene in common with it.
        """
        dt = float(recording.meta["dt"])
        rows = Rows(recording.hip, recording.channel("velocity"), np.full(len(recording), dt))
        before = lead_in_rows(renderer, recording.hip, dt, scene)
        shared = (scene, scene.model, scene.model.boundary)
        return cls(recording, rows, before, _Original(renderer, dt, shared, before.dt.size))

    def refined(self, first: int, last: int, factor: int, *, lag: int) -> Closeup:
        """Return a close-up of the path from row `first` to row `last` > `first`, each step in `factor` equal ones.

        The hand first rests at row `first`, at the path's own rate, until `lag` + 1 answers are the same: what a
        lagging proxy has to catch up with there belongs to the way before.

        Row 0 is the last of that rest, and row k `factor` is where row `first` + k was. Then the hand rests for `lag`
        fine ticks. Raises `RendererError` as `play` does.
        """
        renderer = self._renderer_after(first)
        tick = self._tick(first)
        # the hand rests before the part, which then begins without lag, and after it, so that a lag shows
        rest_rows, rest_answer = self._rest_at(renderer, first, lag)
        copy = self._subject.copy(renderer)
        share = np.tile(np.arange(1.0, factor + 1.0) / factor, last - first)[:, np.newaxis]
        start, end = (np.repeat(self._rows.hip[k : k + last - first], factor, axis=0) for k in (first, first + 1))
        dt = np.repeat(self._rows.dt[first + 1 : last + 1] / factor, factor)
        # where a step ends the HIP is the path's own, to the bit
        hip = np.where(share == 1.0, end, start + share * (end - start))
        fine_rows = Rows(hip, (end - start) / (factor * dt)[:, np.newaxis], dt)
        fine_rows = fine_rows.followed_by(Rows.resting(hip[-1], float(dt[-1]), lag))
        fine_answers = _lead_on(
            renderer,
            fine_rows,
            tick,
            lambda: self._rows_since_reset(first + 1).followed_by(rest_rows),
            ahead=self._subject.ahead,
        )
        answers = Answers(*(np.concatenate(pair) for pair in zip(rest_answer, fine_answers, strict=True)))
        time = self.recording.time[first] + np.concatenate([[0.0], np.cumsum(fine_rows.dt)])
        rows = rest_rows.part(-1, rest_rows.dt.size).followed_by(fine_rows)
        channels = {"hip": rows.hip, **channels_of(answers), "velocity": rows.velocity}
        recording = Recording(time, channels, {**self.recording.meta, "dt": float(dt[-1])})
        before = self._rows_since_reset(first + 1).followed_by(rest_rows.part(0, -1))
        closeup = Closeup(recording, rows, before, self._subject)
        if copy is not None:
            closeup._copies[0] = copy
        return closeup

    def _rows_since_reset(self, count: int) -> Rows:
        """What the renderer has been asked before row `count` of the path."""
        return self._before.followed_by(self._rows.part(0, count))

    def _tick(self, row: int) -> int:
        """As errors count it, from where the path begins."""
        return self._before.dt.size - self._subject.ahead + row

    def _rest_at(self, renderer: Renderer, row: int, lag: int) -> tuple[Rows, Answers]:
        """The ticks of a rest at `row`, and the last answer, a single row."""
        rows = Rows.resting(self._rows.hip[row], self._subject.dt, REST_PATIENCE)
        answers: list[tuple[Array, Array]] = []
        for _ in range(REST_PATIENCE):
            answers.append(step_checked(renderer, self._tick(row), rows.hip[0], rows.velocity[0], self._subject.dt))
            same_answers = [np.array_equal(ihip, answers[-1][0]) for ihip, _ in answers[-lag - 1 :]]
            # a proxy that lags by `lag` ticks has caught up when so many answers are the same
            if len(same_answers) > lag and all(same_answers):
                break
        ihip, force = answers[-1]
        last = Answers(ihip[np.newaxis], force[np.newaxis], np.array([reported_contact(renderer)]))
        return rows.part(0, len(answers)), last

    def _renderer_after(self, row: int) -> Renderer:
        """The renderer as it was after `row`, to be led on from there."""
        renderer_copy = self._copy_after(row) if self._subject.copies else None
        copy = None if renderer_copy is None else self._subject.copy(renderer_copy)
        if copy is not None:
            return copy
        # it cannot be copied: led from its reset again
        renderer = self._subject.renderer
        rows = self._rows_since_reset(row + 1)
        reset_checked(renderer, rows.hip[0])
        _lead_on(renderer, rows, -self._subject.ahead, partial(rows.part, 0, 0))
        return renderer

    def _copy_after(self, row: int) -> Renderer | None:
        """A copy of the renderer as it was after `row`, which is not to be led on itself; None where there is none."""
        if row in self._copies:
            return self._copies[row]
        subject = self._subject
        # from the last copy before the row, or from a reset
        nearest = max((copied_row for copied_row in self._copies if copied_row < row), default=-1)
        if nearest >= 0:
            renderer = subject.copy(self._copies[nearest])
        else:
            reset_checked(subject.renderer, self._rows_since_reset(1).hip[0])
            _lead_on(subject.renderer, self._before, -subject.ahead, partial(self._before.part, 0, 0))
            renderer = subject.renderer
        if renderer is None:
            return None
        _lead_on(
            renderer,
            self._rows.part(nearest + 1, row + 1),
            self._tick(nearest + 1),
            lambda: self._rows_since_reset(nearest + 1),
            ahead=subject.ahead,
        )
        copy = subject.copy(renderer) if nearest < 0 else renderer
        if copy is not None and self._proves_copies(copy, row + 1):
            self._copies[row] = copy
            if len(self._copies) > MOST_COPIES:
                # the copy whose neighbours are closest together is the one that is missed least
                rows = sorted(self._copies)
                del self._copies[
                    min(zip(rows, rows[1:], rows[2:], strict=False), key=lambda three: three[2] - three[0])[1]
                ]
            return copy
        return None

    def _proves_copies(self, renderer: Renderer, row: int) -> bool:
        """Whether copies are independent: of a handle to a state elsewhere a copy is the same state once more.

        Two copies are led along the same rows from `row` on one after the other, and must give the same answers to the
        bit.
        """
        subject = self._subject
        if not subject.proved:
            rows, tick = self._rows.part(row, row + PROOF_TICKS), self._tick(row)
            answers = []
            for _ in range(2):
                copy = subject.copy(renderer)
                if copy is None:
                    return False
                answers.append(_lead_on(copy, rows, tick, lambda: self._rows_since_reset(row), ahead=subject.ahead))
            subject.copies = subject.proved = all(map(np.array_equal, *(answer[:2] for answer in answers)))
        return subject.copies


MOST_COPIES = 16
"""Copies of a renderer that are kept of one path, for it may be large: spread over all of it, so that none is far."""
PROOF_TICKS = 8
"""Ticks over which two copies of a renderer have to answer alike, one after the other."""


@dataclass
class _Original:
    """The renderer that is looked at, and whether copies of it can stand for it."""

    renderer: Renderer
    dt: float
    shared: tuple[object, ...]
    ahead: int
    copies: bool = True
    proved: bool = False

    def copy(self, renderer: Renderer) -> Renderer | None:
        """A copy that has the shared objects in common with `renderer`; None where it cannot be copied."""
        if not self.copies:
            return None
        try:
            return deepcopy(renderer, {id(shared_object): shared_object for shared_object in self.shared})
        except Exception:  # a foreign object may refuse in any way; it is then led to the place anew
            self.copies = False
            return None


def _lead_on(renderer: Renderer, rows: Rows, first: int, since_reset: Callable[[], Rows], *, ahead: int = 0) -> Answers:
    """The answers of a renderer that is led on without a reset. Errors count ticks from `first` on.

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
        _answer_each(renderer, before, Answers.room(before.hip), range(before.dt.size), 0, ahead)
        _answer_each(renderer, rows, answers, range(rows.dt.size), max(first, 0), max(-first, 0))
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
    _answer_each(renderer, rows, answers, range(answered, rows.dt.size), max(first, 0), max(-first, 0))
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
        answers.contact[:] = _reported_contacts(renderer, count)
        count_answer()
        return count
    return 0
