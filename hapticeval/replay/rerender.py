"""A renderer led along a recorded hand path, stretch by stretch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticeval.errors import DomainError, RefusalError, RendererError
from hapticeval.recordings.recording import Recording, backward_difference
from hapticeval.recordings.stretches import Stretch, steps
from hapticeval.renderer import Renderer, SelfDriven, abilities_of
from hapticeval.scene import Scene
from hapticeval.simulation.playback import answered, lead
from hapticeval.stimulus.stimulus import Path
from hapticeval.types import Array


@dataclass(frozen=True)
class HandPath:
    """What a renderer would have been given: times (n,), s, HIP and velocity (n, N), and the gapless stretches.

    Where the recording holds what the sensors gave to the renderer, that is the path and not the true HIP. `dt` (s) is
    what a renderer is told that each step took, where that is not what the clock says.
    """

    recording: Recording
    stretches: tuple[Stretch, ...]
    dt: float | None = None

    @property
    def hip(self) -> Array:
        """The HIP that the renderer saw, (n, N), m."""
        return self.recording.channels.get("measured_hip", self.recording.hip)

    def velocity(self, stretch: Stretch) -> Array:
        """The velocity that the renderer saw over a stretch, m/s; the difference backwards where none was recorded."""
        for name in ("measured_velocity", "velocity"):
            if name in self.recording.channels:
                return self.recording.channels[name][stretch.rows]
        return backward_difference(self.hip[stretch.rows], self.recording.time[stretch.rows])


@dataclass(frozen=True)
class Part:
    """The answers over a stretch, in full or, where the renderer was led out of its domain, up to there."""

    stretch: Stretch
    recording: Recording
    ended: str = ""


def rerendered(renderer: Renderer | SelfDriven, path: HandPath, scene: Scene | None) -> tuple[Part, ...]:
    """The renderer's answers along each stretch, from a reset each, at the recorded samples and times.

    With a `scene`, a hand that starts inside its model is led in first, see `playback.way_in`.

    The HIP is never resampled. A renderer that answers a stimulus whole is given straight lines between the samples;
    it is refused (`RefusalError`) on a clock that is not regular, since it knows one sampling time. A `DomainError`
    ends the stretch, and the error goes on only where nothing of the path is answered. Raises `RendererError` where
    the renderer breaks, with the recording's own row as the tick.
    """
    meta = {"source": "replay", **abilities_of(renderer).meta}
    parts: list[Part] = []
    left: DomainError | None = None
    for stretch in path.stretches:
        try:
            parts.append(_stretch(renderer, path, stretch, meta, scene))
        except DomainError as error:
            left = error
    if not parts and left is not None:
        raise left
    return tuple(parts)


def backwards(renderer: Renderer | SelfDriven, path: HandPath, stretch: Stretch, scene: Scene) -> Recording:
    """The same samples of a stretch in the opposite order, each step as long as it was."""
    return _reversed(renderer, path, stretch, {"source": "replay", **abilities_of(renderer).meta}, scene)


def _stretch(
    renderer: Renderer | SelfDriven, path: HandPath, stretch: Stretch, meta: Mapping[str, Any], scene: Scene | None
) -> Part:
    time = path.recording.time[stretch.rows]
    hip, dt = path.hip[stretch.rows], steps(path.recording, stretch) if path.dt is None else path.dt
    if not isinstance(renderer, Renderer):
        return Part(stretch, _whole(renderer, time, hip, dt, meta))
    velocity = path.velocity(stretch)
    felt = path.recording.channels.get("measured_force")
    pushes = None if felt is None else felt[stretch.rows]
    # A batch makes the velocity itself: only where that is the recorded one may it stand for single steps.
    if isinstance(dt, float) and not np.array_equal(velocity, backward_difference(hip, time)):
        dt = np.full(time.size, dt)
    ended = ""
    try:
        ihip, force = lead(renderer, hip, velocity, dt, scene=scene, pushes=pushes, first=stretch.first)
    except DomainError as error:
        rows = _answered_rows(renderer, hip, velocity, np.broadcast_to(dt, time.size), pushes, scene)
        if rows < 2:
            raise
        whole = slice(0, rows)
        ended = f"{time[rows]:.6g} to {time[-1]:.6g} s: {error.what}"
        time, hip, velocity = time[whole], hip[whole], velocity[whole]
        dt, pushes = np.broadcast_to(dt, rows).copy(), None if pushes is None else pushes[whole]
        ihip, force = lead(renderer, hip, velocity, dt, scene=scene, pushes=pushes, first=stretch.first)
    channels = {"hip": hip, "ihip": ihip, "force": force, "velocity": velocity}
    return Part(stretch, Recording(time, channels, {**meta, "dt": float(np.median(dt))}), ended)


def _answered_rows(
    renderer: Renderer, hip: Array, velocity: Array, dt: Array, pushes: Array | None, scene: Scene | None
) -> int:
    """How many samples a renderer answers before it is led out of its domain: found by bisection on the path."""
    low, high = 0, hip.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        try:
            lead(
                renderer, hip[:middle], velocity[:middle], dt[:middle].copy(), scene=scene,
                pushes=None if pushes is None else pushes[:middle],
            )  # fmt: skip
        except DomainError:
            high = middle
        else:
            low = middle
    return low


def _reversed(
    renderer: Renderer | SelfDriven, path: HandPath, stretch: Stretch, meta: Mapping[str, Any], scene: Scene
) -> Recording:
    """The same HIPs in the opposite order, each step as long as it was."""
    time = path.recording.time[stretch.rows]
    back = time[-1] - time[::-1]
    hip = path.hip[stretch.rows][::-1]
    dt = steps(path.recording, stretch)
    if not isinstance(renderer, Renderer):
        return _whole(renderer, back, hip, dt, meta)
    velocity = backward_difference(hip, back)
    if not isinstance(dt, float):
        dt = np.concatenate([[dt[0]], dt[:0:-1]])
    ihip, force = lead(renderer, hip, velocity, dt, scene=scene)
    return Recording(
        back, {"hip": hip, "ihip": ihip, "force": force, "velocity": velocity}, {**meta, "dt": float(np.median(dt))}
    )


def _whole(renderer: SelfDriven, time: Array, hip: Array, dt: float | Array, meta: Mapping[str, Any]) -> Recording:
    if not isinstance(dt, float):
        raise RefusalError(
            "the recording's clock is not regular",
            why="it answers a stimulus whole, at one sampling time, and a recording is never re-timed",
            todo="choose a renderer that is asked step by step",
        )
    answer = answered(renderer, Path(time - time[0], hip), dt)
    if len(answer) != time.size:
        raise RendererError(
            f"the renderer's answer() gave {len(answer)} samples for {time.size}",
            why="a replay needs an answer at every recorded sample",
        )
    return Recording(time, answer.channels, {**answer.meta, **meta, "dt": dt}, events=answer.events)


def joined(parts: Sequence[Recording]) -> Recording:
    """The stretches as one recording, with what was left out absent; `meta["stretches"]` has their times, s."""
    if len(parts) == 1:
        return parts[0]
    return Recording(
        np.concatenate([part.time for part in parts]),
        {name: np.concatenate([part.channels[name] for part in parts]) for name in parts[0].channels},
        {**parts[0].meta, "stretches": [[float(part.time[0]), float(part.time[-1])] for part in parts]},
        signals=parts[0].signals,
        events=tuple(event for part in parts for event in part.events),
    )
