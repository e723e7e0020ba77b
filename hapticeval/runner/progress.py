"""The results so far, on disk while the run goes on, so that a run that is killed leaves what it had."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hapticeval.errors import HapticevalError, RefusalError
from hapticeval.phenomena.verdict import Verdict
from hapticeval.runner.events import JobFinished
from hapticeval.runner.judging import Judged
from hapticeval.runner.planning import Job, Plan
from hapticeval.runner.results import Results, environment, verdict_document, write_results
from hapticeval.runner.table import fill_table
from hapticeval.runner.work import scene_document
from hapticeval.scene import Scene
from hapticeval.suite.case import Case
from hapticeval.suite.suite import Suite

SAVE_EVERY = 1.0
"""Seconds between two writings of results.json: what a killed run may lose."""


class Progress:
    """Takes judged jobs in the order of the plan, and keeps results.json up to date, at most once a second."""

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
        """Take what came of a job, and give the event that tells it."""
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
        """Write the results for the last time, incomplete for that `reason` where there is one."""
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
                "strict": self.plan.strict,
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
        "scene": {**scene_document(scene), **_robot_document(case, scene)},
        "closed_form": case.closed_form.get(job.renderer),
        "ended": None if judged.ended is None else dict(judged.ended),
        "error": _error_document(judged.error),
        "refusal": _refusal_document(judged.refusal),
        **({} if judged.replay is None else {"replay": judged.replay}),
    }


def _robot_document(case: Case, scene: Scene) -> Mapping[str, Any]:
    """Describe what an experiment drives: the device as it was made, and its inner loop."""
    if case.stimulus_kind != "experiment":
        return {}
    device = scene.robot
    return {
        "device": {
            "kind": device.name,
            **{name: str(value) for name in ("dynamics", "base_inertia") if (value := getattr(device, name, None))},
        },
        "inner_loop": scene.inner_loop.value,
    }


def _refusal_document(refusal: RefusalError | None) -> Mapping[str, Any] | None:
    if refusal is None:
        return None
    position = None if refusal.position is None else list(refusal.position)
    return {"what": refusal.what, "why": refusal.why, "todo": refusal.todo, "position": position}


def _error_document(error: HapticevalError | None) -> Mapping[str, str] | None:
    return None if error is None else {"what": error.what, "why": error.why, "todo": error.todo}
