"""The hand path of a recording, as far as it is sound, and a renderer led along it, stretch by stretch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hapticeval.errors import DomainError, InputError, RefusalError, RendererError
from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.integrity.issue import Issue, Severity
from hapticeval.recordings.recording import Recording, backward_difference
from hapticeval.recordings.stretches import Stretch, steps, stretches
from hapticeval.renderer import AnyRenderer, WrappedRenderer, wrapped
from hapticeval.replay.subject import ReplayCase
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import simulate_checked
from hapticeval.simulation.playback import channels_of, rows_defined, run_path
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array

GIVEN_CHANNELS = ("hip", "measured_hip")
"""Channels that a renderer is given: only their issues break the hand's path."""

MOST_NAMED = 12
"""So many left-out intervals are named; of more, the number."""


@dataclass(frozen=True)
class HandPath:
    """What renderers are given: HIP and velocity (n, N) of a recording, over the gapless `stretches`.

    Where the recording holds what the sensors gave to the renderer, that is the path and not the true HIP.

    - `dt` (s): the duration of each step that a renderer is told, where that is not what the clock says.
    - `judged`: over which the recorded run itself is judged; an issue of its force or IHIP parts these, too.
    - `left_out`: what is not used, and when; `suspicious`: what else a person should look at.
    """

    recording: Recording
    stretches: tuple[Stretch, ...]
    judged: tuple[Stretch, ...] = ()
    left_out: tuple[str, ...] = ()
    suspicious: tuple[str, ...] = ()
    dt: float | None = None

    @property
    def hip(self) -> Array:
        """The HIP that the renderer saw, (n, N), m."""
        return self.recording.channels.get("measured_hip", self.recording.hip)

    def velocity(self, stretch: Stretch) -> Array:
        """Return the velocity that the renderer saw over a stretch, m/s, by differences where none was recorded."""
        for name in ("measured_velocity", "velocity"):
            if name in self.recording.channels:
                return self.recording.channels[name][stretch.rows]
        return backward_difference(self.hip[stretch.rows], self.recording.time[stretch.rows])


def hand_path(replay_case: ReplayCase) -> HandPath:
    """Find the hand path of a recording. Raises `InputError` where no two sound samples follow each other.

    A simulated recording is examined for gaps only, any other as `inspect` does it, with the model that it is replayed
    with, and the stiffness of a spring without damping.
    """
    recording, scene = replay_case.recording, replay_case.case.build_scene()
    recording.require("hip")
    if recording.meta.get("source") in SIMULATED:
        gapless = stretches(recording)
        path = HandPath(recording, gapless, gapless)
    else:
        from hapticeval.recordings.integrity.issue import LEFT_OUT_KINDS
        from hapticeval.recordings.integrity.report import examine, sound_intervals

        report = examine(recording, model=scene.model, stiffness=None if scene.damping else scene.stiffness)
        soundness = sound_intervals(recording, report)
        # An issue of force or IHIP does not break the hand's path, which only needs what the renderer is given.
        hand = recording.measured.copy()
        for issue in report.issues:
            if (
                issue.kind in LEFT_OUT_KINDS
                and issue.channel.partition(".")[0] in GIVEN_CHANNELS
                and issue.first is not None
            ):
                hand[issue.first : issue.end] = False
        left = [f"{why}, {stretch.times(recording)}" for stretch, why in soundness.left_out]
        if len(left) > MOST_NAMED:
            left = [*left[:MOST_NAMED], f"and {len(left) - MOST_NAMED} more"]
        hand_stretches = stretches(recording, hand)
        # Where nothing of the run is sound throughout, the hand's path alone decides.
        judged = soundness.sound or hand_stretches
        path = HandPath(recording, hand_stretches, judged, tuple(left), tuple(_suspicious(report.issues)))
    if not path.stretches:
        raise InputError(
            f"{replay_case.file} has no stretch of hand path to replay",
            why="no two sound samples follow each other",
            todo="look at it with `hapticeval inspect`",
        )
    return path


def _suspicious(issues: Sequence[Issue]) -> Iterator[str]:
    """Yield a line for each kind of issue and channel: the first of them, and how many there are."""
    issues_of: dict[tuple[str, str], list[Issue]] = {}
    for issue in issues:
        # A note asks nobody to look.
        if issue.severity is not Severity.NOTE:
            issues_of.setdefault((issue.kind, issue.channel), []).append(issue)
    for key, alike in issues_of.items():
        place = "" if alike[0].place == "all" else f" ({alike[0].place})"
        more = f", and {len(alike) - 1} more" if len(alike) > 1 else ""
        yield f"{' '.join(key).rstrip()}{place}: {alike[0].message}{more}"


@dataclass(frozen=True)
class Part:
    """The answers over a stretch, in full or, where the renderer was led out of its domain, up to there."""

    stretch: Stretch
    recording: Recording
    ended: str = ""


def rerender(renderer: AnyRenderer, path: HandPath, scene: Scene | None) -> tuple[Part, ...]:
    """Return the renderer's answers along each stretch, from a reset each, at the recorded samples and times.

    With a `scene`, a hand that starts inside its model is led in first, see `playback.lead_in_path`.

    The HIP is never resampled. A renderer that answers a stimulus whole is given straight lines between the samples;
    it is refused (`RefusalError`) on a clock that is not regular, since it knows one sampling time. A `DomainError`
    ends the stretch, and the error goes on only where nothing of the path is answered. Raises `RendererError` where
    the renderer breaks, with the recording's own row as the tick.
    """
    renderer, parts = wrapped(renderer), list[Part]()
    left: DomainError | None = None
    for stretch in path.stretches:
        try:
            parts.append(_rerender_stretch(renderer, path, stretch, scene))
        except DomainError as error:
            left = error
    if not parts and left is not None:
        raise left
    return tuple(parts)


def _rerender_stretch(renderer: WrappedRenderer, path: HandPath, stretch: Stretch, scene: Scene | None) -> Part:
    """Return the renderer's answers along one stretch, or, where it is led out of its domain, up to there."""
    rows = stretch.rows
    time, hip, velocity = path.recording.time[rows], path.hip[rows], path.velocity(stretch)
    dt = steps(path.recording, stretch) if path.dt is None else path.dt
    if not renderer.steps:
        return Part(stretch, _simulate_recorded(renderer, time, hip, dt))
    # N: what a force sensor gave, for renderers that are driven by force.
    felt = path.recording.channels.get("measured_force")
    pushes = None if felt is None else felt[rows]

    def led(count: int, dt: float | Array) -> Recording:
        """Lead the renderer along the first `count` rows, with steps of `dt` s: one, or (count,)."""
        push = None if pushes is None else pushes[:count]
        return _play_recorded(renderer, time[:count], hip[:count], velocity[:count], dt, scene, push, stretch.first)

    try:
        return Part(stretch, led(time.size, dt))
    except DomainError as error:
        durations = np.broadcast_to(dt, time.size)

        # The longest beginning of the stretch over which the renderer has an answer.
        count = rows_defined(lambda rows: led(rows, durations[:rows].copy()), time.size)
        # A single row has no step: nothing of this stretch is answered.
        if count < 2:
            raise
        return Part(
            stretch, led(count, durations[:count].copy()), f"{time[count]:.6g} to {time[-1]:.6g} s: {error.what}"
        )


def rerender_backwards(renderer: AnyRenderer, path: HandPath, stretch: Stretch, scene: Scene) -> Recording:
    """Return the answers to the same HIPs in the opposite order, each step as long as it was."""
    time, hip = path.recording.time[stretch.rows], path.hip[stretch.rows][::-1]
    back, dt = time[-1] - time[::-1], steps(path.recording, stretch)
    renderer = wrapped(renderer)
    if not renderer.steps:
        return _simulate_recorded(renderer, back, hip, dt)
    if not isinstance(dt, float):
        # Backwards the steps come in the opposite order; the first sample has none before it.
        dt = np.concatenate([[dt[0]], dt[:0:-1]])
    return _play_recorded(renderer, back, hip, backward_difference(hip, back), dt, scene)


def _play_recorded(
    renderer: WrappedRenderer,
    time: Array,
    hip: Array,
    velocity: Array,
    dt: float | Array,
    scene: Scene | None,
    pushes: Array | None = None,
    first: int = 0,
) -> Recording:
    answers = run_path(renderer, hip, velocity, dt, scene=scene, pushes=pushes, first=first)
    channels = {"hip": hip, **channels_of(answers), "velocity": velocity}
    return Recording(time, channels, {"source": "replay", **renderer.meta, "dt": float(np.median(dt))})


def _simulate_recorded(renderer: WrappedRenderer, time: Array, hip: Array, dt: float | Array) -> Recording:
    """Return the answer of a renderer that takes a stimulus whole: straight lines between the recorded samples.

    Raises `RefusalError` on a clock that is not regular, and `RendererError` for another number of samples.
    """
    if not isinstance(dt, float):
        raise RefusalError(
            "the recording's clock is not regular",
            why="it answers a stimulus whole, at one sampling time, and a recording is never re-timed",
            todo="choose a renderer that is asked step by step",
        )
    # Stimuli begin at t = 0.
    answer = simulate_checked(renderer, Path(time - time[0], hip), dt)
    if len(answer) != time.size:
        raise RendererError(
            f"the renderer's simulate() gave {len(answer)} samples for {time.size}",
            why="a replay needs an answer at every recorded sample",
        )
    meta = {**answer.meta, "source": "replay", **renderer.meta, "dt": dt}
    return replace(answer, time=time, meta=meta)


def concatenated(parts: Sequence[Recording]) -> Recording:
    """Join stretches to one recording, with what was left out absent; `meta["stretches"]` has their times, s."""
    # Nothing is left out within a single stretch, and its recording stays what it is.
    if len(parts) == 1:
        return parts[0]
    return Recording(
        np.concatenate([part.time for part in parts]),
        {name: np.concatenate([part.channels[name] for part in parts]) for name in parts[0].channels},
        {**parts[0].meta, "stretches": [[float(part.time[0]), float(part.time[-1])] for part in parts]},
        signals=parts[0].signals,
        events=tuple(event for part in parts for event in part.events),
    )
