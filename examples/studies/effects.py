"""What scenes call for, what was assembled of it, and what that costs.

Each scene is measured with its effects and without them, in turns, and the shortest of many runs of each counts.

Run it as `python -m hapticeval.examples.studies.effects -o results`; `hapticeval report results` draws it.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np
import typer

from hapticeval.cli import run_program
from hapticeval.commands.arguments import argument, option
from hapticeval.commands.terminal import Terminal, lines, paragraphs, say, wrote_lines
from hapticeval.compiled import for_kernels, specialised
from hapticeval.discovery import resolve
from hapticeval.effects.effect import Stage
from hapticeval.errors import HapticevalError
from hapticeval.examples.studies.flags import answer_rows, flagged_law
from hapticeval.laws import Composed, change_rows, law_value
from hapticeval.quantity import align_columns
from hapticeval.recordings.recording import Recording, backward_difference
from hapticeval.renderer import Batch, CompiledStep, Renderer, abilities_of
from hapticeval.runner.folder import prepared_folder
from hapticeval.runner.planning import Job, RunOptions, plan
from hapticeval.runner.results import environment
from hapticeval.scene import Scene
from hapticeval.simulation import kernels
from hapticeval.simulation.answers import Affected, make_renderer
from hapticeval.simulation.closed_loop import loop_of, simulate_closed_loop
from hapticeval.simulation.playback import lead_in_path, play
from hapticeval.stimulus.stimulus import Experiment, Stimulus
from hapticeval.stimulus.stimulus import Path as HandPath
from hapticeval.study.bench.measure import machine, without_garbage_collection
from hapticeval.study.effects_cost import Cost, EffectsDocument, Ladder, Rung, SceneEntry, write_costs
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.compiled import FirstClass

ROUNDS = 30
LONGEST_ROUNDS = 1.0
"""Seconds that the rounds of one run may take together, once there are `FEWEST_ROUNDS`."""
FEWEST_ROUNDS = 3

NO_FLAGS: Array = np.empty(0)

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class TimedRun:
    """A run that is ready to be timed: `once` makes it and returns its seconds and ticks.

    `kernels` are those of ours that it runs, each with its arguments or their types; none for a renderer's own.
    """

    once: Callable[[], tuple[float, int]]
    kernels: Sequence[tuple[Any, Sequence[Any]]] = ()

    @property
    def code(self) -> int | None:
        """How many bytes of machine code the kernels are; None without any."""
        from hapticeval.compiled import machine_code

        return (
            sum(len(machine_code(kernel, *arguments)) for kernel, arguments in self.kernels) if self.kernels else None
        )


def measure(jobs: Sequence[Job], progress: Progress) -> EffectsDocument:
    """Measure every scene of `jobs`, and the ladder of the compiled one that calls for most effects of the surface.

    `progress` is called with how many are done, of how many, and what comes next.
    """
    scenes: list[SceneEntry] = []
    for job in jobs:
        progress(len(scenes), len(jobs) + 1, f"{job.renderer} on {job.suite}/{job.case.name}")
        scenes.append(measure_scene(job))
    # Effects of the surface by scene; none counts where the step is Python's, for there the ladder has no kernel.
    climbed = [len(entry.assembled.get(Stage.ANSWER, ())) if entry.cost and entry.cost.code else 0 for entry in scenes]
    tallest = int(np.argmax(climbed))
    ladder = None
    if climbed[tallest] > 1:
        progress(len(jobs), len(jobs) + 1, f"{jobs[tallest].suite}/{jobs[tallest].case.name} effect by effect")
        ladder = measure_ladder(jobs[tallest])
    progress(len(jobs) + 1, len(jobs) + 1, "")
    return EffectsDocument(scenes, ladder, ROUNDS, environment(), machine())


def measure_scene(job: Job) -> SceneEntry:
    """Measure a scene with its effects and without; what stops that is its entry's `problem`."""
    scene = job.case.build_scene()
    named = (job.suite, job.case.name, job.renderer, [effect.kind for effect in scene.effects])
    plain = replace(scene, effects=())
    try:
        renderer, stimulus = make_run(job, scene)
        runs = [prepare_run(renderer, stimulus, scene)]
        if scene.effects:
            runs.append(prepare_run(*make_run(job, plain), plain))
        # Both in turns, so that a slow stretch of the machine meets them alike.
        ticks, seconds = shortest_times(runs)
        costs = [Cost(tick, run.code) for tick, run in zip(seconds, runs, strict=True)]
    except HapticevalError as error:
        return SceneEntry(*named, {}, problem=error.what)
    return SceneEntry(
        *named, effects_by_stage(renderer, scene), ticks[0], costs[0], costs[1] if scene.effects else None
    )


def effects_by_stage(renderer: object, scene: Scene) -> dict[str, list[str]]:
    """Return the kinds of the scene's effects by the stage that they take part in; the renderer's own by "renderer"."""
    put_on = {effect.kind for effect in renderer.effects} if isinstance(renderer, Affected) else set()
    by_stage: dict[str, list[str]] = {}
    for effect in scene.effects:
        # An effect that the renderer brings itself is not put on its answers a second time.
        own = effect.stage is None or (effect.stage is Stage.ANSWER and effect.kind not in put_on)
        by_stage.setdefault("renderer" if own else str(effect.stage), []).append(effect.kind)
    return by_stage


def measure_ladder(job: Job) -> Ladder:
    """Measure an answer with the first 0, 1, ... effects of the surface of a scene, composed and tested for by flags.

    The answers are those along the way of the hand in the scene, without the robot.
    """
    scene = job.case.build_scene()
    surface = [effect for effect in scene.effects if effect.stage is Stage.ANSWER]
    complete, stimulus = make_run(job, scene)
    dt = scene.sampling_time
    led = (
        play(complete, stimulus, dt)
        if isinstance(stimulus, HandPath)
        else simulate_closed_loop(complete, stimulus, scene, dt)
    )
    data: Any = _law_of(complete).data
    engine, flags = flagged_law(data)
    kinds, runs = [], []
    for count in range(len(surface) + 1):
        kinds.append([effect.kind for effect in surface[:count]])
        some = make_run(job, replace(scene, effects=tuple(surface[:count])))[0]
        runs.append(_prepare_law(some, _law_of(some), led, dt))
        # The engine with flags holds all effects in every rung; only the flags differ.
        on = np.array([float(k < count) for k in range(len(surface))])
        runs.append(_prepare_law(complete, engine, led, dt, flags=flags, on=on))
    _, ticks = shortest_times(runs)
    return Ladder(
        job.suite,
        job.case.name,
        job.renderer,
        [Rung(*row) for row in zip(kinds, ticks[::2], ticks[1::2], strict=True)],
    )


def _law_of(renderer: object) -> CompiledStep:
    law = abilities_of(renderer).law
    assert law is not None
    return law


def _prepare_law(
    renderer: Renderer, law: CompiledStep, led: Recording, dt: float, *, flags: Array = NO_FLAGS, on: Array = NO_FLAGS
) -> TimedRun:
    """Prepare a compiled step along the HIPs of a recording, with `flags` as in `on`."""
    value = law_value(law.function, law.data)
    hips, velocities = for_kernels(led.hip), for_kernels(led.velocity)
    # No hand pushes: the measured force (N,) is zero.
    out, push = np.zeros((2, *hips.shape)), np.zeros(hips.shape[1])
    answer_all = specialised(answer_rows, value, law.data, hips, velocities, push, dt, out[0], out[1])

    def once() -> tuple[float, int]:
        renderer.reset(hips[0])
        flags[:] = on
        return _time_run(lambda: answer_all(value, law.data, hips, velocities, push, dt, out[0], out[1]))

    return TimedRun(once)


def make_run(job: Job, scene: Scene) -> tuple[Renderer, Stimulus]:
    """Make the job's renderer for a scene, and the path or experiment that it is run with."""
    renderer = make_renderer(job.factory or resolve(job.renderer), scene)
    return cast("Renderer", renderer), job.case.build_stimulus(scene, renderer)


def prepare_run(renderer: Renderer, stimulus: Stimulus, scene: Scene) -> TimedRun:
    """Prepare runs of a renderer: of a path by `run`, or by steps; of an experiment compiled, or through Python."""
    dt, law = scene.sampling_time, abilities_of(renderer).law
    if isinstance(stimulus, HandPath):
        return _prepare_path(renderer, stimulus, scene)
    if law is None:
        return TimedRun(lambda: _time_run(lambda: len(simulate_closed_loop(renderer, stimulus, scene, dt))))
    return _prepare_loop(renderer, law, stimulus, scene)


def _prepare_loop(renderer: Renderer, law: CompiledStep, experiment: Experiment, scene: Scene) -> TimedRun:
    """Prepare the compiled loop with a law: only `run` is under the clock, not what assembles the loop."""
    value = law_value(law.function, law.data)
    loop = loop_of(experiment, scene, scene.sampling_time)
    run = specialised(kernels.run, value, law.data, loop)

    def once() -> tuple[float, int]:
        # A loop of its own for each run: it keeps what it has recorded.
        loop = loop_of(experiment, scene, scene.sampling_time)
        renderer.reset(loop.out.measured_hip[0])
        return _time_run(lambda: run(value, law.data, loop)[0])

    # Effects beside the answer: sensors, what the hand feels, and the motors.
    hooks = [effect.function for hook in (loop.sensors, loop.feeling, loop.motors) for effect in hook or ()]
    return TimedRun(once, [(kernels.run, (value, law.data, loop)), *_kernels_of(value, *_functions_of(law), *hooks)])


def _prepare_path(renderer: Renderer, path: HandPath, scene: Scene) -> TimedRun:
    """Prepare a run along a path, with the way in from free space."""
    dt = scene.sampling_time
    hips = path.sampled(dt)[1]
    # Where the path begins inside the hand is led in first, see `Renderer.reset`.
    hips = np.vstack([lead_in_path(renderer, hips, scene), hips])
    velocities = backward_difference(hips, dt * np.arange(len(hips), dtype=np.float64))

    def answer_path() -> int:
        if abilities_of(renderer).run:
            cast("Batch", renderer).run(hips, dt)
        else:
            renderer.reset(hips[0])
            for hip, velocity in zip(hips, velocities, strict=True):
                renderer.step(hip, velocity, dt)
        return len(hips)

    law = abilities_of(renderer).law
    functions = list(_functions_of(law)) if law is not None else []
    if law is None or not functions:
        return TimedRun(lambda: _time_run(answer_path))
    data: Any = law.data
    # Types alone count here: the HIPs stand for IHIPs and forces, which have the same.
    arguments = (data.changes, data.closest, hips, velocities, dt, hips, hips)
    return TimedRun(lambda: _time_run(answer_path), [(change_rows, arguments), *_kernels_of(*functions[1:])])


def _functions_of(law: CompiledStep) -> Iterator[FirstClass]:
    """Yield what a composed law calls: the renderer's own, the closest point, and each effect; nothing for another."""
    data: Any = law.data
    if isinstance(data, Composed):
        yield from (data.law, data.closest.function, *(change.function for change in data.changes))  # type: ignore[misc]


def _kernels_of(*functions: FirstClass) -> Iterator[tuple[Any, Sequence[Any]]]:
    """Yield the kernels behind compiled functions, each once, with the types of their arguments."""
    yield from {id(function.kernel): (function.kernel, function.signature().args) for function in functions}.values()


def _time_run(run: Callable[[], int]) -> tuple[float, int]:
    """Return the seconds of a run, of this thread's own time, and its ticks."""
    began = time.thread_time()
    ticks = run()
    # This thread's own time: what other processes take of the processor is not in it.
    return time.thread_time() - began, ticks


def shortest_times(runs: Sequence[TimedRun]) -> tuple[list[int], list[float]]:
    """Return the ticks of each run, and the shortest time of one, s: all once outside the clock, then in turns."""
    # What is compiled on first use is compiled here.
    ticks = [run.once()[1] for run in runs]
    times: list[list[float]] = []
    began = time.perf_counter()
    with without_garbage_collection():
        while len(times) < ROUNDS and (
            len(times) < FEWEST_ROUNDS or time.perf_counter() - began < LONGEST_ROUNDS * len(runs)
        ):
            # Per tick; the least over all rounds, for what disturbs only adds.
            times.append([seconds / max(ticks, 1) for seconds, ticks in (run.once() for run in runs)])
    return ticks, [float(seconds) for seconds in np.min(times, axis=0)]


EFFECTS_CODES = """\b
Exit codes:
  0  measured
  2  wrong usage or input: the message says what, why, and what to do
  4  nothing is selected
"""

STAGE_WORDS = {
    "renderer": "renderer",
    "sense": "sensors",
    "feel": "force sensor",
    "answer": "answer",
    "command": "motors",
}
"""What the table calls the stages of a tick; another by its name."""


def effects(
    suites: Annotated[
        list[str] | None,
        argument(metavar="SUITE", help="Suites, groups of suites or suite files; without one: effects."),
    ] = None,
    renderer: Annotated[
        str, typer.Option("-r", "--renderer", metavar="NAME", help="As in `run -r`, one.")
    ] = "minimum-distance",
    select: Annotated[
        list[str] | None, option("-k", "--select", metavar="GLOB", help="As in `run -k`; may be repeated.")
    ] = None,
    directory: Annotated[
        Path | None, option("-o", "--output", metavar="DIR", help="Write effects.json there, which `report` draws.")
    ] = None,
) -> None:
    """Measure what the effects of scenes cost: the time of a tick with and without, and the compiled code.

    A scene is timed as it is and without its effects, in turns, 30 times each; the shortest counts. The code is the
    machine code of the loop, or of what changes the answers along a path, and of all that it calls of ours. A scene
    that calls for no effect runs the renderer itself in the same loop.

    \b
    Examples:
      python -m hapticeval.examples.studies.effects
      python -m hapticeval.examples.studies.effects dynamics-line -r set-stabilisation
      python -m hapticeval.examples.studies.effects mine.toml -k '*texture*' -o results
    """
    jobs = plan(suites or ["effects"], [renderer], RunOptions(select=tuple(select or ()))).jobs
    # Without a folder nothing is written, and no earlier report removed.
    with nullcontext() if directory is None else prepared_folder(directory):
        with Terminal() as terminal:
            document = measure(jobs, terminal.working)
        written = [] if directory is None else [write_costs(directory, document)]
    say(
        paragraphs(
            lines(_cost_lines(document)),
            lines(_ladder_lines(document)),
            lines(_problem_lines(document)),
            wrote_lines(written),
        )
    )


def _cost_lines(document: EffectsDocument) -> Iterator[str]:
    """Yield the table of scenes: ns a tick and bytes of code, with their effects and without."""
    head = ["scene", "effects, by where they take part", "ticks", "without", "with", "more", "code without", "with"]
    rows = [_cost_row(scene, scene.cost) for scene in document.scenes if scene.cost is not None]
    yield f"{document.scenes[0].renderer}: a tick, ns, and machine code, bytes"
    yield from align_columns([head, *rows], left=2)


def _cost_row(scene: SceneEntry, cost: Cost) -> list[str]:
    """Return a scene's row: its effects by stage, ticks, times and code."""
    # A scene without effects is its own reference.
    reference = scene.plain or cost
    more = f"{1e9 * (cost.tick - reference.tick):+.0f}" if scene.plain else "0"
    stages = "; ".join(
        f"{STAGE_WORDS.get(stage, stage)}: {', '.join(kinds)}" for stage, kinds in scene.assembled.items()
    )
    # ns a tick and bytes of machine code, without effects and with.
    numbers = [f"{scene.ticks}", _tick_ns(reference), _tick_ns(cost), more, _code_bytes(reference), _code_bytes(cost)]
    return [f"{scene.suite}/{scene.case}", stages or "none", *numbers]


def _tick_ns(cost: Cost) -> str:
    return f"{1e9 * cost.tick:.0f}"


def _code_bytes(cost: Cost) -> str:
    return "-" if cost.code is None else f"{cost.code}"


def _ladder_lines(document: EffectsDocument) -> Iterator[str]:
    """Yield the time of an answer (ns) with one effect more from row to row; nothing where it was not measured."""
    # None where no compiled scene calls for effects of the surface.
    ladder = document.ladder
    if ladder is None:
        return
    rows = [
        [rung.kinds[-1] if rung.kinds else "none", f"{1e9 * rung.composed:.0f}", f"{1e9 * rung.tested:.0f}"]
        for rung in ladder.rungs
    ]
    yield f"{ladder.suite}/{ladder.case} effect by effect: an answer, ns, composed, and of an engine that tests flags"
    yield from align_columns([["up to", "composed", "tested"], *rows], left=1)


def _problem_lines(document: EffectsDocument) -> Iterator[str]:
    yield from (f"{scene.suite}/{scene.case}: {scene.problem}" for scene in document.scenes if scene.problem)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code."""
    return run_program(effects, EFFECTS_CODES, arguments)


if __name__ == "__main__":
    sys.exit(main())
