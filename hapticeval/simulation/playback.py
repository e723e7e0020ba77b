"""Playback (Figure 6.1): a renderer is led along a given HIP path, as if it came from the robot's encoders.

Whatever is led is led by `lead_on`: by a loop over the compiled step where the renderer has one, `laws.lead_by_law`,
else by a loop over `step`. What a run had answered until its renderer raises is not kept; one that ends because the
renderer leaves its domain keeps its rows, and the siblings that checks ask for are made along these.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hapticeval.errors import DomainError, RendererError
from hapticeval.geometry.boundary import Boundary
from hapticeval.pulse import note_run
from hapticeval.recordings.recording import Recording, backward_difference, path_velocities
from hapticeval.recordings.world import pose_channels
from hapticeval.renderer import AnyRenderer, CompiledStep, WrappedRenderer, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import (
    not_finite,
    observe_force_checked,
    reported_contact,
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


def play(renderer: AnyRenderer, path: Path, dt: float, *, scene: Scene | None = None) -> Recording:
    """Return a renderer's answers along `path`, sampled every `dt` s; with a `scene` led in first: see `run_path`.

    Raises `RendererError`, naming tick and HIP, when the renderer raises, answers in a wrong shape or with a
    number that is not finite, and `DomainError` where it is led out of where it is defined.
    """
    renderer = wrapped(renderer)
    if not renderer.steps:
        return with_poses(simulate_checked(renderer, path, dt), scene)
    return _play(renderer, *path.sampled(dt), dt, scene)


def play_while_defined(renderer: AnyRenderer, path: Path, dt: float, *, scene: Scene | None = None) -> Recording:
    """Return the answers along `path` as `play` does, up to where the renderer is led out of where it is defined.

    As in a closed loop `meta["ended"]` then says at which `tick` and `time`, `what` and `why`, and the recording holds
    what was before that tick. Raises `DomainError` where that is less than two samples, and of a renderer that
    answers a stimulus whole.
    """
    renderer = wrapped(renderer)
    try:
        return play(renderer, path, dt, scene=scene)
    except DomainError as error:
        if not renderer.steps:
            raise
        time, hips = path.sampled(dt)
        count = rows_defined(lambda rows: _play(renderer, time[:rows], hips[:rows], dt, scene), time.size)
        if count < 2:
            raise
        recording = _play(renderer, time[:count], hips[:count], dt, scene)
        ended = {"tick": count, "time": float(time[count]), "what": error.what, "why": error.why}
        return replace(recording, meta={**recording.meta, "ended": ended})


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


def _play(renderer: WrappedRenderer, time: Array, hips: Array, dt: float, scene: Scene | None) -> Recording:
    velocity = backward_difference(hips, time)
    answers = run_path(renderer, hips, velocity, dt, scene=scene)
    channels = {"hip": hips, **channels_of(answers), "velocity": velocity}
    meta = {"source": "playback", "dt": dt, **renderer.meta}
    # How many steps a log that the renderer keeps itself has before the first row.
    if ticks := len(lead_in_path(renderer, hips, scene)):
        meta["lead_in_ticks"] = ticks
    return with_poses(Recording(time, channels, meta=meta), scene)


def with_poses(recording: Recording, scene: Scene | None) -> Recording:
    """Return a recording in the frame of the body with the poses of the body; itself of a body at rest.

    A motion begins with the reset: where the hand is led in first, before the first row.
    """
    if scene is None or scene.motion is None:
        return recording
    ahead = recording.meta.get("lead_in_ticks", 0) * recording.meta.get("dt", 0.0)
    poses = scene.motion.pose(recording.time + ahead)
    return recording.with_channels(**pose_channels(poses))


class Answers(NamedTuple):
    """Answers to HIPs: IHIPs (n, N), m; forces (n, N), N; and (n,) whether contact is reported, NaN where unknown."""

    ihip: Array
    force: Array
    contact: Array

    @classmethod
    def room(cls, hips: Array) -> Answers:
        """Return room for the answers to HIPs (n, N), m, of which nothing is known yet."""
        return cls(np.empty_like(hips), np.empty_like(hips), np.full(hips.shape[0], np.nan))

    def part(self, rows: slice) -> Answers:
        """Return some of the rows."""
        return Answers(*(column[rows] for column in self))

    def write(self, first: int, others: Answers) -> None:
        """Write other answers from row `first` on."""
        for column, values in zip(self, others, strict=True):
            column[first : first + len(values)] = values


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
    renderer: AnyRenderer,
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

    `velocity` (n, N), m/s, is the hand's, and `dt`, one or (n,), s, what the ticks last. One that feels is given the
    measured `pushes` (n, N), N, row by row, where there are any. Errors count ticks from `first` on.
    """
    renderer = wrapped(renderer)
    # the hand starts inside: it is led in at the path's median rate
    lead_in = lead_in_rows(renderer, hips, float(np.median(dt)), scene)
    count = lead_in.dt.size
    rows = lead_in.followed_by(Rows(hips, velocity, np.broadcast_to(dt, len(hips))))
    felt = None if pushes is None else np.vstack([np.zeros_like(lead_in.hip), pushes])
    reset_checked(renderer, rows.hip[0])
    answers = lead_on(renderer, rows, Ticks(first, ahead=count), from_reset=True, pushes=felt)
    return answers.part(slice(count, None))


def answers_along(renderer: AnyRenderer, hips: Array, dt: float, *, scene: Scene | None = None) -> Answers:
    """Return the answers of a renderer that is reset at the first of `hips` (n, N), m, and led on every `dt` (s).

    The velocities are a recording's. With a `scene` it is led in first, see `run_path`.
    """
    hips = np.asarray(hips, dtype=np.float64)
    return run_path(renderer, hips, path_velocities(hips, dt), dt, scene=scene)


def lead_in_rows(renderer: WrappedRenderer, hips: Array, dt: float, scene: Scene | None) -> Rows:
    """Return the ticks of `lead_in_path` to the first of `hips` (n, N), m, one every `dt` (s)."""
    lead_in = lead_in_path(renderer, hips, scene)
    return Rows(lead_in, np.diff(lead_in, axis=0, prepend=lead_in[:1]) / dt, np.full(len(lead_in), dt))


def lead_in_path(renderer: WrappedRenderer, hips: Array, scene: Scene | None) -> Array:
    """Return HIPs (m, N), m, that lead a hand from free space to the first of `hips` (n, N), m, if that is inside.

    Straight in from the nearest point of the surface, the renderer's own where it has one, at the pace of the path or
    faster, and a rest at the end.

    A proxy that is reset inside of the solid would know no way out; so none is, and each starts with its tool where the
    nearest projection puts it. None for a hand that starts outside, and on a bilateral constraint.
    """
    nothing = np.empty((0, hips.shape[1]))
    if scene is None or scene.bilateral:
        return nothing
    boundary: Boundary = renderer.surface or scene.model.boundary
    start = hips[0]
    frame = boundary.closest_point(start[np.newaxis])
    depth = -float(frame.distance[0])
    if depth <= 0.0:
        return nothing
    # as far a tick as the path's fastest one; a hand at rest there is led in by a small share of the model's size
    pace = float(np.linalg.norm(np.diff(hips, axis=0), axis=1).max(initial=0.0)) or LEAD_IN_SHARE * scene.model.size
    outwards = (frame.foot[0] - start) / depth
    # beyond the surface, by as much as the renderer's own may stray; else, in a narrow notch, on it
    outside = frame.foot[0] + (renderer.standoff + pace) * outwards
    if not boundary.signed_distance(outside[np.newaxis])[0] > 0.0:
        outside = frame.foot[0]
    ticks = min(math.ceil(float(np.linalg.norm(start - outside)) / pace), MOST_LEAD_IN_TICKS)
    share = np.linspace(0.0, 1.0, ticks + 1)[:, np.newaxis]
    return np.vstack(
        [(1.0 - share) * outside + share * start, np.repeat(start[np.newaxis], LEAD_IN_REST_TICKS, axis=0)]
    )


TURN_TICKS = 8
"""Ticks that a renderer answers before it is another one's turn."""

Party = tuple[AnyRenderer, Path, Scene]
"""A renderer, the path that it is led along, and its scene."""


def play_in_turns(first: Party, second: Party, dt: float) -> Recording:
    """Return what the first renderer answers along its path, while the second is led along its own by turns.

    Both are reset at the beginning, and then answer `TURN_TICKS` ticks each until the first path ends.
    """
    parties = []
    for party, path, scene in (first, second):
        renderer, (time, hips) = wrapped(party), path.sampled(dt)
        lead_in = lead_in_rows(renderer, hips, dt, scene)
        parties.append((renderer, lead_in.followed_by(Rows.along(time, hips, dt))))
        reset_checked(renderer, parties[-1][1].hip[0])
    judged, first_rows = parties[0]  # only the first renderer's answers are recorded
    answers = Answers.room(first_rows.hip)
    for begin in range(0, len(first_rows.dt), TURN_TICKS):
        for renderer, rows in parties:
            turn = rows.part(begin, begin + TURN_TICKS)
            answered = lead_on(renderer, turn, Ticks(begin), from_reset=begin == 0)
            if renderer is judged:
                answers.write(begin, answered)
    time, hips = first[1].sampled(dt)
    recorded = slice(len(first_rows.dt) - len(time), None)
    channels = {"hip": hips, **channels_of(answers.part(recorded)), "velocity": first_rows.velocity[recorded]}
    return Recording(time, channels, meta={"source": "playback", "dt": dt, **judged.meta})


class Ticks(NamedTuple):
    """How errors count the rows that a renderer is led along: the first is the tick `first`.

    The hand is led in before that over `ahead` rows more, which all count as it.
    """

    first: int
    ahead: int = 0

    def at(self, row: int) -> int:
        """Return the tick of a row."""
        return self.first + max(row - self.ahead, 0)

    def after(self, rows: int) -> Ticks:
        """Return how rows are counted that follow so many of these."""
        return Ticks(self.at(rows), max(self.ahead - rows, 0))


def lead_on(
    renderer: WrappedRenderer, rows: Rows, ticks: Ticks, *, from_reset: bool = False, pushes: Array | None = None
) -> Answers:
    """Return the answers of a renderer that is led on from where it is: the one way to lead one.

    By its compiled `law` where it has one, else a `step` a row. It may refuse a row only if that is the first
    `from_reset` on. One that feels is given `pushes` (n, N), N, before each step.
    """
    answers = Answers.room(rows.hip)
    if pushes is not None and renderer.observes_force:
        _lead_by_step(renderer, rows, answers, ticks, from_reset=from_reset, pushes=pushes)
    elif renderer.law is not None and rows.dt.size:
        _lead_by_law(renderer, renderer.law, rows, answers, ticks)
    else:
        _lead_by_step(renderer, rows, answers, ticks, from_reset=from_reset)
    return answers


def _lead_by_step(
    renderer: WrappedRenderer, rows: Rows, answers: Answers, ticks: Ticks, *, from_reset: bool,
    pushes: Array | None = None,
) -> None:  # fmt: skip
    """Write the answers of all rows, a `step` a row: the one loop in Python over a path that is given."""
    for row, hip in enumerate(rows.hip):
        tick = ticks.at(row)
        if pushes is not None:
            observe_force_checked(renderer, tick, hip, pushes[row])
        try:
            ihip, force = step_checked(
                renderer, tick, hip, rows.velocity[row], float(rows.dt[row]), may_refuse=from_reset and row == 0
            )
        except RendererError as error:
            if ticks.ahead:
                error.after_lead_in(row + 1, ticks.ahead)
            raise
        answers.ihip[row], answers.force[row], answers.contact[row] = ihip, force, reported_contact(renderer)


def _lead_by_law(renderer: WrappedRenderer, law: CompiledStep, rows: Rows, answers: Answers, ticks: Ticks) -> None:
    """Write the answers of all rows by the compiled step, in one loop without Python.

    What the law refuses the renderer's own `step` words.
    """
    from hapticeval.compiled import for_kernels
    from hapticeval.laws import law_value, lead_by_law

    note_run(ticks.first - ticks.ahead)
    hips, velocities, dt = (for_kernels(np.asarray(column, dtype=np.float64)) for column in rows)
    reported = np.empty(0) if law.contact is None else law.contact
    push = np.zeros(rows.hip.shape[1])
    answered, number = lead_by_law(
        law_value(law.function, law.data), law.data, push, hips, velocities, dt, answers.ihip, answers.force, reported,
        answers.contact,
    )  # fmt: skip
    ihips, forces, _ = answers.part(slice(answered))
    if not (np.isfinite(ihips).all() and np.isfinite(forces).all()):
        row = int(np.argmin(np.isfinite(ihips).all(axis=1) & np.isfinite(forces).all(axis=1)))
        raise not_finite(ticks.at(row), rows.hip[row], ihips[row], forces[row])
    if answered < rows.dt.size:
        tick, hip = ticks.at(answered), rows.hip[answered]
        step_checked(renderer, tick, hip, rows.velocity[answered], float(rows.dt[answered]), may_refuse=False)
        raise RendererError(
            f"the renderer's compiled step returned {number}, and its step() answers",
            tick=tick,
            hip=hip,
            todo="make the law equal to step(), to the last bit",
        )


HELD_TO_STEP = 100
"""Ticks of contact over which a compiled step is held to `step`. *Chosen*: most of a millisecond a case, and more than
a proxy has a memory of. Twice as many cost twice that."""


def hold_law_to_step(renderer: WrappedRenderer, recording: Recording, *, contact: BoolArray) -> None:
    """Hold a renderer's compiled step to its `step`, from where the path of `recording` is first in `contact` (n,).

    What hardware is driven by is the `step`; what is judged is then the same. Does nothing for a renderer without a
    law. Raises `RendererError`, naming tick and HIP, where an answer differs by a bit.
    """
    touched = np.flatnonzero(contact)
    if renderer.law is None or touched.size == 0:
        return
    first, dt = int(touched[0]), float(recording.meta["dt"])
    stretch = slice(first, first + HELD_TO_STEP)
    velocity = recording.channel("velocity")[stretch]
    rows, ticks = Rows(recording.hip[stretch], velocity, np.full(len(velocity), dt)), Ticks(first)

    def answers_by(law: CompiledStep | None) -> Answers:
        """Return the answers from a reset, by the law or by `step`."""
        reset_checked(renderer, rows.hip[0])
        return lead_on(replace(renderer, law=law), rows, ticks, from_reset=True)

    try:
        by_law, by_step = answers_by(renderer.law), answers_by(None)
    except DomainError:
        return  # it may be led here, and not start here
    differs = _differ(by_law, by_step)
    # one whose answers are never the same twice is not to blame for that here: see `repeatability`
    if differs.any() and not _differ(by_step, answers_by(None)).any():
        row = int(np.argmax(differs))
        ihip, force = (float(np.abs(by_law[k][row] - by_step[k][row]).max()) for k in range(2))
        raise RendererError(
            f"the renderer's law and step() differ by {1e3 * ihip:.3g} mm in the IHIP and {force:.3g} N",
            tick=ticks.at(row),
            hip=rows.hip[row],
            why=f"both from a reset at tick {first} on; a law stands for step(), which drives the hardware",
            todo="make the law equal to step(), to the last bit, or leave it out",
        )


def _differ(one: Answers, other: Answers) -> BoolArray:
    """Return in which rows two answers differ (n,)."""
    differs: BoolArray = np.any((one.ihip != other.ihip) | (one.force != other.force), axis=1)
    return differs


REST_PATIENCE = 32
"""Ticks after which a renderer that still moves under a hand at rest is not waited for."""


class Closeup:
    """A path that a renderer was led along, any part of which it can be led along again in finer steps.

    The renderer is led to that part from a reset, as it was before, tick by tick, and the part alone is refined.
    `recording` holds what it answered.

    - `rows` are those of the recording, and `before` what the renderer is asked from its reset up to them, of which the
      first `ahead` rows lead the hand in.
    - `dt` (s) is the path's own step, at which the hand rests.
    """

    def __init__(
        self, renderer: WrappedRenderer, recording: Recording, rows: Rows, before: Rows, *, dt: float, ahead: int
    ) -> None:
        self.recording = recording
        self._renderer, self._rows, self._before, self._dt, self._ahead = renderer, rows, before, dt, ahead

    @classmethod
    def of(cls, renderer: AnyRenderer, recording: Recording, scene: Scene) -> Closeup:
        """Return the close-up of a `recording` that `play` made of `renderer` in `scene`."""
        renderer, dt = wrapped(renderer), float(recording.meta["dt"])
        rows = Rows(recording.hip, recording.channel("velocity"), np.full(len(recording), dt))
        before = lead_in_rows(renderer, recording.hip, dt, scene)
        return cls(renderer, recording, rows, before, dt=dt, ahead=before.dt.size)

    def refined(self, first: int, last: int, factor: int, *, lag: int) -> Closeup:
        """Return a close-up of the path from row `first` to row `last` > `first`, each step in `factor` equal ones.

        The hand first rests at row `first`, at the path's own rate, until `lag` + 1 answers are the same: what a
        lagging proxy has to catch up with there belongs to the way before.

        Row 0 is the last of that rest, and row k `factor` is where row `first` + k was. Then the hand rests for `lag`
        fine ticks. Raises `RendererError` as `play` does.
        """
        before = self._before.followed_by(self._rows.part(0, first + 1))
        ticks = Ticks(0, self._ahead)
        reset_checked(self._renderer, before.hip[0])
        lead_on(self._renderer, before, ticks, from_reset=True)
        # fine ticks are counted on from that of the path
        ticks = Ticks(ticks.after(before.dt.size).first - 1)
        # the hand rests before the part, which then begins without lag, and after it, so that a lag shows
        standing_rows, standing_answer = self._rest_at(self._rows.hip[first], ticks, lag)
        fine_rows = self._fine_rows(first, last, factor)
        fine_rows = fine_rows.followed_by(Rows.resting(fine_rows.hip[-1], float(fine_rows.dt[-1]), lag))
        fine_answers = lead_on(self._renderer, fine_rows, ticks)
        answers = Answers(*(np.concatenate(pair) for pair in zip(standing_answer, fine_answers, strict=True)))
        time = self.recording.time[first] + np.concatenate([[0.0], np.cumsum(fine_rows.dt)])
        rows = standing_rows.part(-1, standing_rows.dt.size).followed_by(fine_rows)
        channels = {"hip": rows.hip, **channels_of(answers), "velocity": rows.velocity}
        recording = Recording(time, channels, {**self.recording.meta, "dt": float(fine_rows.dt[-1])})
        before = before.followed_by(standing_rows.part(0, -1))
        return Closeup(self._renderer, recording, rows, before, dt=self._dt, ahead=self._ahead)

    def _fine_rows(self, first: int, last: int, factor: int) -> Rows:
        """Return the rows from `first` to `last` with each step in `factor` equal ones, without row `first` itself."""
        share = np.tile(np.arange(1.0, factor + 1.0) / factor, last - first)[:, np.newaxis]
        start, end = (np.repeat(self._rows.hip[k : k + last - first], factor, axis=0) for k in (first, first + 1))
        dt = np.repeat(self._rows.dt[first + 1 : last + 1] / factor, factor)
        # where a step ends the HIP is the path's own, to the bit
        hip = np.where(share == 1.0, end, start + share * (end - start))
        return Rows(hip, (end - start) / (factor * dt)[:, np.newaxis], dt)

    def _rest_at(self, hip: Array, ticks: Ticks, lag: int) -> tuple[Rows, Answers]:
        """Lead the renderer through a rest at `hip` (N,), m: return its ticks, and the last answer, a single row."""
        tick = Rows.resting(hip, self._dt, 1)
        ihips: list[Array] = []
        for count in range(1, REST_PATIENCE + 1):
            answer = lead_on(self._renderer, tick, ticks)
            ihips.append(answer.ihip[0])
            # a proxy that lags by `lag` ticks has caught up when so many answers are the same
            if count > lag and all(np.array_equal(ihip, ihips[-1]) for ihip in ihips[-lag - 1 :]):
                break
        return Rows.resting(hip, self._dt, count), answer
