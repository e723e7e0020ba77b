"""Calls of a renderer's methods: what they raise or answer wrongly is a `RendererError` that names tick and HIP."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter
from typing import cast

import numpy as np

from hapticeval.errors import (
    HapticevalError,
    RefusalError,
    RendererError,
    blame_renderer,
    describe_error,
    in_mm,
    is_foreign,
    renderer_errors,
)
from hapticeval.pulse import count_answer, note_pending
from hapticeval.recordings.channels import REQUIRED
from hapticeval.recordings.recording import OWN_TOOL, Recording
from hapticeval.renderer import Renderer, TrajectoryRenderer, WrappedRenderer
from hapticeval.stimulus.stimulus import Path, Stimulus, sample_times
from hapticeval.types import Array

CLOCK_ROUNDING = 1e-6
"""A share of the sampling time by which a clock may differ from what was asked: rounding."""


def reported_contact(renderer: WrappedRenderer) -> float:
    """Return 1 where a renderer reports that its last step was in contact, 0 where not, and NaN where it is silent."""
    report = renderer.contact
    return math.nan if report is None else float(report)


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
        """Return the force (N,), N, for a `hip` (N,), m, and a `velocity` (N,), m/s; None where the step raises."""
        try:
            return np.asarray(renderer.step(hip, velocity, dt)[1], dtype=np.float64)
        except Exception:  # a refusal is what a renderer of any kind may raise
            return None

    nowhere = np.full_like(hip, np.nan)
    # The velocity is a difference of places: of one that is missing it is missing too.
    return force_for(nowhere, nowhere.copy()), force_for(hip.copy(), np.zeros_like(hip))


def observe_force_checked(renderer: WrappedRenderer, tick: int, hip: Array, push: Array) -> None:
    """Call `renderer.observe_force(push)` with the measured `push` (N,), N, of a hand at `hip` (N,), m.

    Raises `RendererError` for what it raises.
    """
    with renderer_errors("observe_force()", tick=tick, hip=hip):
        renderer.observe_force(push.copy())


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
