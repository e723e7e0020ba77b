"""Measure what effects cost: each scene with and without them, in turns, the shortest of many runs of each."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from hapticeval.discovery import resolve
from hapticeval.effects.effect import Stage
from hapticeval.errors import HapticevalError
from hapticeval.recordings.recording import Recording, backward_difference
from hapticeval.renderer import Batch, CompiledStep, Renderer, abilities_of
from hapticeval.runner.judging import make_renderer
from hapticeval.runner.planning import Job
from hapticeval.runner.results import environment
from hapticeval.scene import Scene
from hapticeval.simulation.answers import Affected
from hapticeval.simulation.closed_loop import loop_of, simulate_closed_loop
from hapticeval.simulation.playback import play, way_in
from hapticeval.stimulus.stimulus import Experiment, Path, Stimulus
from hapticeval.study.bench.measure import machine, quiet
from hapticeval.study.effects.document import Cost, EffectsDocument, Ladder, Rung, SceneEntry
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.compiled import FirstClass

ROUNDS = 30
LONG = 1.0
"""Seconds that the rounds of one run may take together, once there are `FEW`."""
FEW = 3

NOTHING: Array = np.empty(0)

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Ready:
    """A run that is ready to be timed: `once` makes it and returns its seconds and ticks.

    `kernels` are those of ours that it runs, each with its arguments or their types; none for a renderer's own.
    """

    once: Callable[[], tuple[float, int]]
    kernels: Sequence[tuple[Any, Sequence[Any]]] = ()

    @property
    def code(self) -> int | None:
        """Bytes of machine code of the kernels; None without any."""
        from hapticeval.compiled import machine_code

        return sum(len(machine_code(kernel, *given)) for kernel, given in self.kernels) if self.kernels else None


def measure(jobs: Sequence[Job], progress: Progress) -> EffectsDocument:
    """Measure every scene of `jobs`, and the ladder of the compiled one that calls for most effects of the surface.

    `progress` is called with how many are done, of how many, and what comes next.
    """
    scenes: list[SceneEntry] = []
    for job in jobs:
        progress(len(scenes), len(jobs) + 1, f"{job.renderer} on {job.suite}/{job.case.name}")
        scenes.append(measure_scene(job))
    climbed = [len(entry.assembled.get(Stage.ANSWER, ())) if entry.cost and entry.cost.code else 0 for entry in scenes]
    most = int(np.argmax(climbed))
    ladder = None
    if climbed[most] > 1:
        progress(len(jobs), len(jobs) + 1, f"{jobs[most].suite}/{jobs[most].case.name} effect by effect")
        ladder = measure_ladder(jobs[most])
    progress(len(jobs) + 1, len(jobs) + 1, "")
    return EffectsDocument(scenes, ladder, ROUNDS, environment(), machine())


def measure_scene(job: Job) -> SceneEntry:
    """Measure a scene with its effects and without; what stops that is its entry's `problem`."""
    scene = job.case.build_scene()
    named = (job.suite, job.case.name, job.renderer, [each.kind for each in scene.effects])
    plain = replace(scene, effects=())
    try:
        renderer, stimulus = made(job, scene)
        runs = [ready(renderer, stimulus, scene)]
        if scene.effects:
            runs.append(ready(*made(job, plain), plain))
        ticks, found = shortest(runs)
        costs = [Cost(each, run.code) for each, run in zip(found, runs, strict=True)]
    except HapticevalError as error:
        return SceneEntry(*named, {}, problem=error.what)
    return SceneEntry(*named, assembled(renderer, scene), ticks[0], costs[0], costs[1] if scene.effects else None)


def assembled(renderer: object, scene: Scene) -> dict[str, list[str]]:
    """Return the kinds of the scene's effects by the stage that they take part in; the renderer's own by "renderer"."""
    put_on = {each.kind for each in renderer.effects} if isinstance(renderer, Affected) else set()
    found: dict[str, list[str]] = {}
    for each in scene.effects:
        own = each.stage is None or (each.stage is Stage.ANSWER and each.kind not in put_on)
        found.setdefault("renderer" if own else str(each.stage), []).append(each.kind)
    return found


def measure_ladder(job: Job) -> Ladder:
    """Measure an answer with the first 0, 1, ... effects of the surface of a scene, composed and tested for by flags.

    The answers are those along the way of the hand in the scene, without the robot.
    """
    from hapticeval.study.effects.flags import flagged

    scene = job.case.build_scene()
    surface = [each for each in scene.effects if each.stage is Stage.ANSWER]
    whole, stimulus = made(job, scene)
    dt = scene.sampling_time
    led = play(whole, stimulus, dt) if isinstance(stimulus, Path) else simulate_closed_loop(whole, stimulus, scene, dt)
    data: Any = _law(whole).data
    engine, flags = flagged(data)
    kinds, runs = [], []
    for count in range(len(surface) + 1):
        kinds.append([each.kind for each in surface[:count]])
        some = made(job, replace(scene, effects=tuple(surface[:count])))[0]
        runs.append(_asked(some, _law(some), led, dt))
        on = np.array([float(k < count) for k in range(len(surface))])
        runs.append(_asked(whole, engine, led, dt, flags=flags, on=on))
    _, ticks = shortest(runs)
    return Ladder(
        job.suite,
        job.case.name,
        job.renderer,
        [Rung(*each) for each in zip(kinds, ticks[::2], ticks[1::2], strict=True)],
    )


def _law(renderer: object) -> CompiledStep:
    found = abilities_of(renderer).law
    assert found is not None
    return found


def _asked(
    renderer: Renderer, law: CompiledStep, led: Recording, dt: float, *, flags: Array = NOTHING, on: Array = NOTHING
) -> Ready:
    """Prepare a compiled step along the HIPs of a recording, with `flags` as in `on`."""
    from hapticeval.compiled import for_kernels, law_value, specialised
    from hapticeval.study.effects.flags import ask

    value = law_value(law.function, law.data)
    hips, velocities = for_kernels(led.hip), for_kernels(led.velocity)
    out, push = np.zeros((2, *hips.shape)), np.zeros(hips.shape[1])
    asked = specialised(ask, value, law.data, hips, velocities, push, dt, out[0], out[1])

    def once() -> tuple[float, int]:
        renderer.reset(hips[0])
        flags[:] = on
        return _timed(lambda: asked(value, law.data, hips, velocities, push, dt, out[0], out[1]))

    return Ready(once)


def made(job: Job, scene: Scene) -> tuple[Renderer, Stimulus]:
    """Make the job's renderer for a scene, and what it is asked."""
    renderer = make_renderer(job.factory or resolve(job.renderer), scene)
    return cast("Renderer", renderer), job.case.build_stimulus(scene, renderer)


def ready(renderer: Renderer, stimulus: Stimulus, scene: Scene) -> Ready:
    """Prepare runs of a renderer: of a path by `run`, or by steps; of an experiment compiled, or through Python."""
    dt, law = scene.sampling_time, abilities_of(renderer).law
    if isinstance(stimulus, Path):
        return _path(renderer, stimulus, scene)
    if law is None:
        return Ready(lambda: _timed(lambda: len(simulate_closed_loop(renderer, stimulus, scene, dt))))
    return _loop(renderer, law, stimulus, scene)


def _loop(renderer: Renderer, law: CompiledStep, experiment: Experiment, scene: Scene) -> Ready:
    """Prepare the compiled loop with a law: only `run` is under the clock, not what assembles the loop."""
    from hapticeval.compiled import law_value, specialised
    from hapticeval.simulation import kernels

    value = law_value(law.function, law.data)
    loop = loop_of(experiment, scene, scene.sampling_time)
    run = specialised(kernels.run, value, law.data, loop)

    def once() -> tuple[float, int]:
        loop = loop_of(experiment, scene, scene.sampling_time)
        renderer.reset(loop.out[kernels.MEASURED_HIP, 0])
        return _timed(lambda: run(value, law.data, loop)[0])

    hooks = [each.function for hook in (loop.sensors, loop.feeling, loop.motors) for each in hook or ()]
    return Ready(once, [(kernels.run, (value, law.data, loop)), *_called(value, *_functions(law), *hooks)])


def _path(renderer: Renderer, path: Path, scene: Scene) -> Ready:
    """Prepare a path, with the way in."""
    from hapticeval.simulation.answer_kernels import change_rows

    dt = scene.sampling_time
    hips = path.sampled(dt)[1]
    hips = np.vstack([way_in(renderer, hips, scene), hips])
    velocities = backward_difference(hips, dt * np.arange(len(hips), dtype=np.float64))

    def asked() -> int:
        if abilities_of(renderer).run:
            cast("Batch", renderer).run(hips, dt)
        else:
            renderer.reset(hips[0])
            for hip, velocity in zip(hips, velocities, strict=True):
                renderer.step(hip, velocity, dt)
        return len(hips)

    law = abilities_of(renderer).law
    functions = list(_functions(law)) if law is not None else []
    if law is None or not functions:
        return Ready(lambda: _timed(asked))
    data: Any = law.data
    given = (data.changes, data.closest, hips, velocities, dt, hips, hips)
    return Ready(lambda: _timed(asked), [(change_rows, given), *_called(*functions[1:])])


def _functions(law: CompiledStep) -> Iterator[FirstClass]:
    """Yield what a composed law calls: the renderer's own, the closest point, and each effect; nothing for another."""
    from hapticeval.compiled import Composed

    data: Any = law.data
    if isinstance(data, Composed):
        yield from (data.law, data.closest.function, *(each.function for each in data.changes))  # type: ignore[misc]


def _called(*functions: FirstClass) -> Iterator[tuple[Any, Sequence[Any]]]:
    """Yield compiled functions that are values, each once, with the types of their arguments."""
    yield from {id(each.kernel): (each.kernel, each.signature().args) for each in functions}.values()


def _timed(run: Callable[[], int]) -> tuple[float, int]:
    """Return the seconds of a run, of this thread's own time, and its ticks."""
    began = time.thread_time()
    ticks = run()
    return time.thread_time() - began, ticks


def shortest(runs: Sequence[Ready]) -> tuple[list[int], list[float]]:
    """Return the ticks of each run, and the shortest time of one, s: all once outside the clock, then in turns."""
    ticks = [run.once()[1] for run in runs]
    times: list[list[float]] = []
    began = time.perf_counter()
    with quiet():
        while len(times) < ROUNDS and (len(times) < FEW or time.perf_counter() - began < LONG * len(runs)):
            times.append([seconds / max(ticks, 1) for seconds, ticks in (run.once() for run in runs)])
    return ticks, [float(each) for each in np.min(times, axis=0)]
