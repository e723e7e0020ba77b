"""Cases x renderers -> recordings -> verdicts -> results on disk, told as one stream of events."""

from __future__ import annotations

import multiprocessing
import random
import shutil
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from hapticeval.discovery import own_renderers, resolve
from hapticeval.errors import HapticevalError, InputError, NothingSelectedError, RefusalError, RendererError
from hapticeval.events import Event, JobFinished, RunFinished, RunStarted
from hapticeval.judging import Judged, broken, judge
from hapticeval.phenomena.verdict import Verdict
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.results import Results, environment, file_stem, verdict_document, write_results
from hapticeval.scene import Scene
from hapticeval.suite import Case, Suite, load_suite, suites_named
from hapticeval.table import fill_table

Done: TypeAlias = tuple[Judged, Path | None]
"""A judged job and where its recording lies below the result folder."""

SAVE_EVERY = 1.0
"""Seconds between two writings of results.json: what a killed run may lose."""


@dataclass(frozen=True)
class Job:
    """One renderer through one case."""

    suite: str
    case: Case
    renderer: str


@dataclass(frozen=True)
class Plan:
    """What will run. `suites` are whole; `jobs` hold only the selected cases, with only the selected checks."""

    suites: tuple[Suite, ...]
    renderers: tuple[str, ...]
    jobs: tuple[Job, ...]
    select: tuple[str, ...]
    seed: int

    @property
    def planned(self) -> int:
        """Number of verdicts."""
        return sum(len(job.case.checks) for job in self.jobs)


def plan(suites: Sequence[str], renderers: Sequence[str], *, select: Sequence[str] = (), seed: int = 0) -> Plan:
    """Load the suites, see that every renderer can be found, and apply the selection.

    A suite's name may be that of a group: `dynamics` for `dynamics-line` and the others. Where no `renderers` are named
    each suite runs its own, or those that come with the package. `select` holds globs on case names, on `suite/case`,
    or on `case/check`; what any of them matches is run, and everything where there are none. Raises
    `NothingSelectedError` when nothing is left, and what `load_suite` and `resolve` raise.
    """
    members = dict.fromkeys(name for given in suites for name in suites_named(given))
    loaded = tuple(load_suite(name) for name in members)
    _refuse_namesakes(loaded)
    chosen = {suite.name: tuple(dict.fromkeys(renderers or suite.renderers or own_renderers())) for suite in loaded}
    names = tuple(dict.fromkeys(name for each in chosen.values() for name in each))
    for name in names:
        resolve(name)
    jobs = tuple(
        Job(suite.name, selected, name)
        for suite in loaded
        for case in suite.cases
        for selected in _selected(case, suite.name, select)
        for name in chosen[suite.name]
    )
    if not jobs:
        cases = sorted({case.name for suite in loaded for case in suite.cases})
        raise NothingSelectedError(
            f"nothing matches -k {' -k '.join(map(repr, select))}" if select else "no suites or no renderers are named",
            why=f"the cases are: {', '.join(cases)}" if cases else "",
            todo="a glob is matched against the whole name: try -k '*slide*' or -k '*/memoryless'",
        )
    for case in {(job.suite, job.case.name): job.case for job in jobs}.values():
        case.check_stimulus()
    return Plan(loaded, names, jobs, tuple(select), seed)


def _refuse_namesakes(suites: Sequence[Suite]) -> None:
    """Two suites of one name would write over each other's recordings and verdicts."""
    names = [suite.name for suite in suites]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two suites are named '{name}'", todo="rename one of the files, or run them apart")


def _selected(case: Case, suite: str, select: Sequence[str]) -> Iterator[Case]:
    if not select or any(fnmatchcase(f"{suite}/{case.name}" if "/" in glob else case.name, glob) for glob in select):
        yield case
        return
    checks = tuple(check for check in case.checks if any(fnmatchcase(f"{case.name}/{check}", glob) for glob in select))
    if checks:
        yield replace(case, checks=checks)


Work: TypeAlias = Callable[[Job, Path, int], Done]
"""What is done with a job, in a process of its own: a module's function, given the job, the folder and the seed."""


def execute(plan: Plan, directory: Path, *, workers: int = 2, work: Work | None = None) -> Iterator[Event]:
    """Run the plan, in `workers` processes, and keep results.json in `directory` up to date while it goes on.

    Each job is run and judged as its case says, or by `work` where that is given.

    Events come in the order of the plan. A renderer that ends its process makes its own verdicts errors. On Ctrl-C what
    has finished is kept, the results say that they are incomplete and why, and `RunFinished` is still the last event.
    """
    directory.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(directory / "recordings", ignore_errors=True)  # of an earlier run, whose results go as well
    yield RunStarted(plan.planned, len(plan.jobs))
    progress = _Progress(plan, directory)
    task = work or _run_job
    others = set(multiprocessing.active_children())
    reason = None
    futures: list[Future[Done]] = []
    pool = ProcessPoolExecutor(max_workers=workers, initializer=_ignore_interrupts)
    try:
        futures = [pool.submit(task, job, directory, plan.seed) for job in plan.jobs]
        for job, future in zip(plan.jobs, futures, strict=True):
            try:
                done = future.result()
            except BrokenProcessPool:
                # One process has died and taken the pool along: whose fault it was shows when each has its own.
                done = _run_alone(task, job, directory, plan.seed)
            yield progress.add(job, *done)
    except KeyboardInterrupt:
        reason = "interrupted by the user"
    finally:
        pool.shutdown(wait=reason is None, cancel_futures=True)
    if reason is not None:
        # A renderer in the middle of a long step would keep its process, and this one, alive.
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
    told = len(progress.runs)
    for job, future in zip(plan.jobs[told:], futures[told:], strict=False):
        if future.done() and not future.cancelled() and future.exception() is None:
            yield progress.add(job, *future.result())
    yield RunFinished(progress.finish(reason))


def _ignore_interrupts() -> None:
    """Ctrl-C reaches the whole process group; only the parent decides what it means."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _run_alone(task: Work, job: Job, directory: Path, seed: int) -> Done:
    """A job in a process of its own; a renderer that ends the process is a broken renderer."""
    with ProcessPoolExecutor(max_workers=1, initializer=_ignore_interrupts) as pool:
        try:
            return pool.submit(task, job, directory, seed).result()
        except BrokenProcessPool:
            error = RendererError(
                "the renderer ended the process that it ran in",
                why="a crash in compiled code, os._exit(), or memory that ran out",
                todo="run it alone under a debugger: python -X faulthandler",
            )
            return broken(error, job.renderer, job.suite, job.case), None


def _run_job(job: Job, directory: Path, seed: int) -> Done:
    """Judge, and write the recording here: verdicts travel between processes, recordings do not."""
    seed_all(seed)
    return kept(judge(resolve(job.renderer), job.renderer, job.suite, job.case), job, directory)


def seed_all(seed: int) -> None:
    """Seed the generators that everybody shares: a third party's renderer may draw from them."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - the global generator


def kept(judged: Judged, job: Job, directory: Path) -> Done:
    """Write a job's recording, which says where it comes from; the verdicts alone travel on."""
    if judged.recording is None:
        return judged, None
    file = recording_file(job)
    write_recording(directory / file, _labelled(judged.recording, job), replace=True)
    return replace(judged, recording=None), file


def _labelled(recording: Recording, job: Job) -> Recording:
    """The recording with what it takes to render it again: renderer, model and scene; what it says itself stays."""
    case = job.case
    origin = {
        "renderer": job.renderer,
        "suite": job.suite,
        "case": case.name,
        "scene": {**_scene_document(case.build_scene()), **case.scene, "model": dict(case.model)},
        "checks": list(case.checks),
    }
    return replace(recording, meta={**origin, **recording.meta})


def recording_file(job: Job) -> Path:
    """Where a job's recording lies below the result folder."""
    return Path("recordings") / job.suite / job.case.name / f"{file_stem(job.renderer)}.h5"


class _Progress:
    """The results so far, saved at most once a second."""

    def __init__(self, plan: Plan, directory: Path) -> None:
        self.plan = plan
        self.directory = directory
        self.verdicts: list[Verdict] = []
        self.runs: list[Mapping[str, Any]] = []
        self.simulated = 0.0
        self.started = time.perf_counter()
        self.environment = environment()
        self.saved = self.started
        self._save("still running, or killed")

    def add(self, job: Job, judged: Judged, file: Path | None) -> JobFinished:
        document = _run_document(job, judged, file)
        self.simulated += judged.simulated_seconds
        self.verdicts += judged.verdicts
        self.runs.append(document)
        if time.perf_counter() - self.saved > SAVE_EVERY:
            self._save("still running, or killed")
        return JobFinished(
            suite=job.suite,
            case=job.case.name,
            renderer=job.renderer,
            verdicts=judged.verdicts,
            error=judged.error,
            refusal=judged.refusal,
            simulated_seconds=judged.simulated_seconds,
            wall_seconds=judged.wall_seconds,
        )

    def finish(self, reason: str | None) -> Results:
        if reason is None and len(self.verdicts) < self.plan.planned:
            reason = "fewer verdicts than planned"
        return self._save(reason)

    def _save(self, reason: str | None) -> Results:
        wall = time.perf_counter() - self.started
        results = Results(
            planned=self.plan.planned,
            ran=len(self.verdicts),
            complete=reason is None,
            reason=reason,
            environment=self.environment,
            seed=self.plan.seed,
            command={
                "suites": [suite.name for suite in self.plan.suites],
                "renderers": list(self.plan.renderers),
                "select": list(self.plan.select),
            },
            runs=list(self.runs),
            verdicts=[verdict_document(verdict) for verdict in self.verdicts],
            table=fill_table(self.plan.suites, self.verdicts),
            published_table={row.title: row.published for suite in self.plan.suites for row in suite.rows},
            suites=[_suite_document(suite) for suite in self.plan.suites],
            timing={
                "simulated_seconds": self.simulated,
                "wall_seconds": wall,
                "times_real_time": self.simulated / wall if wall > 0.0 else 0.0,
            },
        )
        write_results(self.directory, results)
        self.saved = time.perf_counter()
        return results


def _suite_document(suite: Suite) -> Mapping[str, Any]:
    return {
        "name": suite.name,
        "title": suite.title,
        "citation": suite.citation,
        "rows": [row.title for row in suite.rows],
    }


def _run_document(job: Job, judged: Judged, file: Path | None) -> Mapping[str, Any]:
    case = job.case
    scene = case.build_scene()
    return {
        "suite": job.suite,
        "case": case.name,
        "renderer": job.renderer,
        "recording": None if file is None else file.as_posix(),
        "simulated_seconds": judged.simulated_seconds,
        "wall_seconds": judged.wall_seconds,
        "stimulus": case.stimulus_kind,
        "title": case.title,
        "shows": case.shows,
        "citation": case.citation,
        "model": dict(case.model),
        "depth_of": case.depth_of,
        "judged": case.judged,
        "scene": {**_scene_document(scene), **_robot_document(case, scene)},
        "closed_form": case.closed_form.get(job.renderer),
        "ended": None if judged.ended is None else dict(judged.ended),
        "error": _error_document(judged.error),
        "refusal": _refusal_document(judged.refusal),
        **({} if judged.replay is None else {"replay": judged.replay}),
    }


def _scene_document(scene: Scene) -> dict[str, Any]:
    return {
        "stiffness": scene.stiffness,
        "damping": scene.damping,
        "mass": scene.mass,
        "bilateral": scene.bilateral,
        "restitution": scene.restitution,
        "sampling_time": scene.sampling_time,
        "viscosity": scene.viscosity,
    }


def _robot_document(case: Case, scene: Scene) -> Mapping[str, Any]:
    """What an experiment drives: the device as it was made, its inner loop, and what is wrong with them."""
    if case.stimulus_kind != "experiment":
        return {}
    given = asdict(scene.imperfections)
    device = scene.robot
    return {
        "device": {
            "kind": device.name,
            **{name: str(value) for name in ("dynamics", "base_inertia") if (value := getattr(device, name, None))},
        },
        "inner_loop": scene.inner_loop.value,
        "imperfections": {name: value for name, value in given.items() if value},
    }


def _refusal_document(refusal: RefusalError | None) -> Mapping[str, Any] | None:
    if refusal is None:
        return None
    position = None if refusal.position is None else list(refusal.position)
    return {"what": refusal.what, "why": refusal.why, "todo": refusal.todo, "position": position}


def _error_document(error: HapticevalError | None) -> Mapping[str, str] | None:
    return None if error is None else {"what": error.what, "why": error.why, "todo": error.todo}
