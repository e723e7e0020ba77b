"""The results so far, on disk while the run goes on, so that a run that is killed leaves what it had."""

from __future__ import annotations

import time
from pathlib import Path

from hapticeval.errors import RefusalError
from hapticeval.files import plain
from hapticeval.runner.events import JobFinished
from hapticeval.runner.judging import Judged
from hapticeval.runner.planning import Job, Plan
from hapticeval.runner.results import (
    Command,
    Ended,
    Environment,
    Problem,
    Refusal,
    ResultsDocument,
    Robot,
    RunEntry,
    SceneEntry,
    SuiteEntry,
    Timing,
    VerdictEntry,
    environment,
    write_results,
)
from hapticeval.runner.table import fill_table
from hapticeval.runner.work import scene_document
from hapticeval.suite.case import Case

SAVE_EVERY = 1.0
"""Seconds between two writings of results.json: what a killed run may lose."""


class Progress:
    """Takes judged jobs in the order of the plan, and keeps results.json up to date, at most once a second."""

    def __init__(self, plan: Plan, directory: Path | None) -> None:
        self.plan = plan
        self.directory = directory
        self.verdicts: list[VerdictEntry] = []
        self.runs: list[RunEntry] = []
        self.started = time.perf_counter()
        self.environment = Environment(**environment())
        self._save("still running, or killed")

    def add(self, job: Job, judged: Judged, file: Path | None) -> JobFinished:
        """Take what came of a job, and return the event that reports it."""
        run = _run(job, judged, file)
        verdicts = self._entries(judged)
        self.runs.append(run)
        self.verdicts += verdicts
        if time.perf_counter() - self.saved > SAVE_EVERY:
            self._save("still running, or killed")
        return JobFinished(run, verdicts, judged.error, judged.recording)

    def stops(self, judged: Judged) -> bool:
        """Return whether a verdict of a job stops the gate."""
        return any(verdict.stops(strict=self.plan.strict) for verdict in self._entries(judged))

    def _entries(self, judged: Judged) -> tuple[VerdictEntry, ...]:
        return tuple(self.plan.known.marked(VerdictEntry.of(each)) for each in judged.verdicts)

    def finish(self, reason: str | None) -> ResultsDocument:
        """Write the results for the last time, incomplete for that `reason` where there is one."""
        if reason is None and len(self.verdicts) < self.plan.planned:
            reason = "fewer verdicts than planned"
        return self._save(reason)

    def _save(self, reason: str | None) -> ResultsDocument:
        plan = self.plan
        simulated = float(sum(run.simulated_seconds for run in self.runs))
        wall = time.perf_counter() - self.started
        results = ResultsDocument(
            planned=plan.planned,
            ran=len(self.verdicts),
            complete=reason is None,
            reason=reason,
            environment=self.environment,
            seed=plan.seed,
            command=Command(
                suites=[suite.name for suite in plan.suites],
                renderers=list(plan.renderers),
                select=list(plan.select),
                strict=plan.strict,
            ),
            runs=list(self.runs),
            verdicts=list(self.verdicts),
            table=fill_table(plan.suites, self.verdicts),
            published_table={row.title: dict(row.published) for suite in plan.suites for row in suite.rows},
            suites=[
                SuiteEntry(
                    name=suite.name, title=suite.title, citation=suite.citation, rows=[row.title for row in suite.rows]
                )
                for suite in plan.suites
            ],
            timing=Timing(
                simulated_seconds=simulated,
                wall_seconds=wall,
                times_real_time=simulated / wall if wall > 0.0 else 0.0,
            ),
        )
        if self.directory is not None:
            write_results(self.directory, results)
        self.saved = time.perf_counter()
        return results


def _run(job: Job, judged: Judged, file: Path | None) -> RunEntry:
    case = job.case
    return RunEntry(
        suite=job.suite,
        case=case.name,
        renderer=job.renderer,
        recording=None if file is None else file.as_posix(),
        simulated_seconds=judged.simulated_seconds,
        wall_seconds=judged.wall_seconds,
        stimulus=case.stimulus_kind,
        title=case.title,
        shows=case.shows,
        citation=case.citation,
        model=plain(case.model, "model"),
        depth_of=case.depth_of,
        judged=case.judged,
        scene=_scene(case),
        closed_form=case.closed_form.get(job.renderer),
        ended=None if judged.ended is None else Ended(**judged.ended),
        error=None if judged.error is None else Problem.of(judged.error),
        refusal=None if judged.refusal is None else Refusal.of(judged.refusal, position=_position(judged.refusal)),
        replay=judged.replay,
    )


def _position(refusal: RefusalError) -> list[float] | None:
    return None if refusal.position is None else [float(each) for each in refusal.position]


def _scene(case: Case) -> SceneEntry:
    """The scene's numbers, and what an experiment drives: device and inner loop."""
    scene = case.build_scene()
    numbers = scene_document(scene)
    if case.stimulus_kind == "trajectory":
        return SceneEntry(**numbers)
    device = scene.robot
    choices = {name: str(each) for name in ("dynamics", "base_inertia") if (each := getattr(device, name, None))}
    return SceneEntry(
        **numbers,
        device=Robot(kind=device.name, **choices),
        inner_loop=scene.inner_loop,
    )
