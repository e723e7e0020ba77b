"""Playback (Figure 6.1): a renderer is led along a given HIP path, as if it came from the robot's encoders."""

from __future__ import annotations

import math
import traceback
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, RendererError
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.surface import Surface
from hapticeval.recordings.recording import REQUIRED, Recording, backward_difference
from hapticeval.renderer import Batch, Declaration, Feeling, Renderer, SelfDriven, Spring
from hapticeval.scene import Scene
from hapticeval.stimulus import Path, Stimulus
from hapticeval.types import Array

NEAR = 1e-4
"""Distance from the surface, as a share of the model's size, from which a hand that rests is led in."""

WAY = 100
"""Ticks that a hand is led in at the most, in longer steps than the path's where that needs more: none is judged."""

REST = 10
"""Ticks that it then rests where the path begins: more than any granted lag."""


def play(renderer: Renderer | SelfDriven, path: Path, dt: float, *, scene: Scene | None = None) -> Recording:
    """The renderer's answers along `path`, sampled every `dt` seconds; with a `scene` led in first: see `lead`.

    Raises `RendererError`, naming tick and HIP, when the renderer raises, answers in a wrong shape or with a
    number that is not finite.
    """
    if isinstance(renderer, SelfDriven):
        return answered(renderer, path, dt)
    time, hips = path.sampled(dt)
    velocity = backward_difference(hips, time)
    ihips, forces = lead(renderer, hips, velocity, dt, scene=scene)
    channels = {"hip": hips, "ihip": ihips, "force": forces, "velocity": velocity}
    return Recording(time, channels, meta={"source": "playback", "dt": dt, **declared(renderer)})


def lead(
    renderer: Renderer,
    hips: Array,
    velocity: Array,
    dt: float | Array,
    *,
    scene: Scene | None = None,
    pushes: Array | None = None,
    first: int = 0,
) -> tuple[Array, Array]:
    """IHIPs and forces, (n, N) each, of a renderer that is reset at the first row of `hips` (n, N) and led on.

    With a `scene`, a hand that would start inside its model is led in first: see `way_in`. These ticks are no part of
    the answer.

    With one `dt` (s) for all rows a batch renderer is asked at once, and takes the velocity from the HIPs itself; with
    a step a row, `dt` (n,), every renderer is asked row by row and given `velocity` (n, N). One that feels is told the
    measured `pushes` (n, N), N, row by row, where there are any. Errors count ticks from `first` on.
    """
    if not isinstance(renderer, Feeling):
        pushes = None
    way = way_in(renderer, hips, scene)
    count = way.shape[0]
    if count:
        step = float(np.median(dt))
        moving = np.diff(way, axis=0, prepend=way[:1]) / step
        hips, velocity = np.vstack([way, hips]), np.vstack([moving, velocity])
        dt = np.concatenate([np.full(count, step), dt]) if isinstance(dt, np.ndarray) else dt
        pushes = None if pushes is None else np.vstack([np.zeros_like(way), pushes])
    if isinstance(renderer, Batch) and not isinstance(dt, np.ndarray) and pushes is None:
        ihips, forces = _all_at_once(renderer, hips, velocity, dt, first, count)
    else:
        ihips, forces = _step_by_step(renderer, hips, velocity, dt, first, count, pushes)
    return ihips[count:], forces[count:]


def way_in(renderer: object, hips: Array, scene: Scene | None) -> Array:
    """HIPs (m, N) that lead a hand from free space to the first row of `hips` (n, N), where that is inside the model.

    Straight in from the nearest point of the surface, the renderer's own where it has one, at the pace of the path or
    faster, and a rest at the end. A proxy that is reset inside of the solid would know no way out; so none is, and each
    starts with its tool where the nearest projection puts it. None for a hand that starts outside, and on a bilateral
    constraint.
    """
    none = np.empty((0, hips.shape[1]))
    if scene is None or scene.bilateral:
        return none
    boundary: Curve | Surface = getattr(renderer, "surface", None) or scene.model.boundary
    start = hips[0]
    frame = boundary.frame(start[np.newaxis])
    depth = -float(frame.distance[0])
    if depth <= 0.0:
        return none
    pace = float(np.linalg.norm(np.diff(hips, axis=0), axis=1).max(initial=0.0)) or NEAR * scene.model.size
    outwards = (frame.foot[0] - start) / depth
    before = frame.foot[0] + (declared(renderer)["standoff"] + pace) * outwards
    if not boundary.signed_distance(before[np.newaxis])[0] > 0.0:
        before = frame.foot[0]
    ticks = min(math.ceil(float(np.linalg.norm(start - before)) / pace), WAY)
    share = np.linspace(0.0, 1.0, ticks + 1)[:, np.newaxis]
    return np.vstack([(1.0 - share) * before + share * start, np.repeat(start[np.newaxis], REST, axis=0)])


def answered(renderer: SelfDriven, stimulus: Stimulus, dt: float) -> Recording:
    """`renderer.answer(...)`, refused unless it is a recording, with what it raises told as a `RendererError`."""
    try:
        recording = renderer.answer(stimulus, dt)
    except HapticevalError:
        raise
    except (Exception, SystemExit) as error:
        raise RendererError(
            f"the renderer's answer() raised {type(error).__name__}: {error}", why=origin(error)
        ) from error
    if not isinstance(recording, Recording):
        raise RendererError(
            f"the renderer's answer() gave a {type(recording).__name__}", todo="return a hapticeval.Recording"
        )
    recording.require(*REQUIRED)
    return recording


def declared(renderer: object) -> Mapping[str, Any]:
    """What a renderer says of itself, as metadata: `resolution` and `standoff`, m, 0 where it says nothing.

    Beside them `spring`, `ihip_scatter` and `force_scatter` of its `Declaration`, where it makes one.
    """
    said: dict[str, Any] = {}
    for name in ("resolution", "standoff"):
        value = getattr(renderer, name, 0.0)
        try:
            said[name] = float(value)
        except (TypeError, ValueError):
            said[name] = math.nan
        if not (math.isfinite(said[name]) and said[name] >= 0.0):
            raise RendererError(
                f"the renderer declares {name} = {value!r}",
                why="it is a length in metres: a finite number that is not negative",
                todo=f"give {name} as a float, or leave it out",
            )
    return said | _promised(renderer)


def _promised(renderer: object) -> dict[str, Any]:
    promise = getattr(renderer, "declares", None)
    if promise is None:
        return {}
    scatter = (
        (promise.ihip_scatter, promise.force_scatter) if isinstance(promise, Declaration) else (math.nan, math.nan)
    )
    if not all(isinstance(each, int | float) and 0.0 <= each < math.inf for each in scatter):
        raise RendererError(
            f"the renderer declares {promise!r}",
            why="declares is a hapticeval.renderer.Declaration, with scatters that are finite and not negative",
            todo="give such a one, or leave declares out",
        )
    told = {"ihip_scatter": float(scatter[0]), "force_scatter": float(scatter[1])}
    return {**({} if promise.spring is None else {"spring": Spring(promise.spring).value}), **told}


def _all_at_once(
    renderer: Batch, hips: Array, velocity: Array, dt: float, first: int, ahead: int
) -> tuple[Array, Array]:
    try:
        ihips, forces = (np.asarray(part, dtype=np.float64) for part in renderer.run(hips.copy(), dt))
    except HapticevalError:
        raise
    except (Exception, SystemExit) as error:
        if not isinstance(renderer, Renderer):
            raise RendererError(
                f"the renderer's run() raised {type(error).__name__}: {error}", tick=first, hip=hips[0]
            ) from error
        # A batch does not say where it broke; single steps do.
        _step_by_step(renderer, hips, velocity, dt, first, ahead)
        raise RendererError(
            f"the renderer's run() raised {type(error).__name__}: {error}",
            tick=first,
            hip=hips[0],
            why="its step() takes the same path without an error",
            todo="make run() equal to reset() and a step() a row",
        ) from error
    answers = []
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
        answers.append(array)
    return answers[0], answers[1]


def _step_by_step(
    renderer: Renderer,
    hips: Array,
    velocity: Array,
    dt: float | Array,
    first: int,
    ahead: int,
    pushes: Array | None = None,
) -> tuple[Array, Array]:
    """A step a row; the `ahead` rows of the way in count as tick `first`."""
    ihips = np.empty_like(hips)
    forces = np.empty_like(hips)
    steps = np.broadcast_to(dt, hips.shape[0]).tolist()
    start(renderer, hips[0])
    for row, step in enumerate(steps):
        tick = first + max(row - ahead, 0)
        if pushes is not None:
            _feel(renderer, tick, hips[row], pushes[row])
        ihips[row], forces[row] = ask(renderer, tick, hips[row], velocity[row], step)
    return ihips, forces


def _feel(renderer: Renderer, tick: int, hip: Array, push: Array) -> None:
    try:
        renderer.feel(push.copy())  # type: ignore[attr-defined]
    except HapticevalError:
        raise
    except (Exception, SystemExit) as error:
        raise RendererError(
            f"the renderer's feel() raised {type(error).__name__}: {error}", tick=tick, hip=hip, why=origin(error)
        ) from error


def origin(error: BaseException) -> str:
    """Where in the renderer's code an exception came from: the innermost frame, for the `why` of an error."""
    frames = traceback.extract_tb(error.__traceback__)
    if not frames:
        return ""
    last = frames[-1]
    return f"in {PurePath(last.filename).name}, line {last.lineno}, in {last.name}: {last.line}"


def start(renderer: Renderer, hip: Array) -> None:
    """`renderer.reset(hip)`, with what it raises told as a `RendererError`."""
    try:
        renderer.reset(hip.copy())
    except HapticevalError:
        raise
    except (Exception, SystemExit) as error:
        raise RendererError(
            f"the renderer's reset() raised {type(error).__name__}: {error}", tick=0, hip=hip, why=origin(error)
        ) from error


def ask(renderer: Renderer, tick: int, hip: Array, velocity: Array, dt: float) -> tuple[Array, Array]:
    """`renderer.step(...)`, refused with tick and HIP unless it is two finite vectors like `hip`.

    The renderer gets copies: what it does to its arguments must not reach the recording.
    """
    try:
        answer, push = renderer.step(hip.copy(), velocity.copy(), dt)  # an (ihip, force) pair of any kind
        ihip, force = np.asarray(answer, dtype=np.float64), np.asarray(push, dtype=np.float64)
    except HapticevalError:
        raise
    except (Exception, SystemExit) as error:
        raise RendererError(
            f"the renderer's step() raised {type(error).__name__}: {error}", tick=tick, hip=hip, why=origin(error)
        ) from error
    if ihip.shape != hip.shape or force.shape != hip.shape:
        raise RendererError(
            f"the renderer answered an IHIP of shape {ihip.shape} and a force of shape {force.shape}",
            tick=tick,
            hip=hip,
            why=f"both must have the HIP's shape {hip.shape}",
        )
    if not (np.isfinite(ihip).all() and np.isfinite(force).all()):
        raise RendererError(
            f"the renderer's answer is not finite: IHIP {ihip}, force {force}",
            tick=tick,
            hip=hip,
            why="a number that is not finite would reach the motors",
        )
    return ihip, force
