"""A replay as a plan of jobs for the runner: the recorded run itself, and each renderer along its hand path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.phenomena.check import LACKING_CHANNEL, Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.quantity import align_columns
from hapticeval.recordings.channels import REQUIRED
from hapticeval.recordings.difference import Apart, Difference, difference
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import describe_clock
from hapticeval.replay import OPEN_LOOP, RECORDED
from hapticeval.replay.rerender import HandPath, Part, concatenated, hand_path, rerender, rerender_backwards
from hapticeval.replay.subject import REPLAY_SUITE, ReplayCase
from hapticeval.runner import results
from hapticeval.runner.judging import Recorded, judge_recorded, merge_findings
from hapticeval.runner.planning import DEFAULT_OPTIONS, Job, Plan, RunOptions
from hapticeval.runner.work import JudgedJob, seed_all, store_recording
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.suite.suite import Suite


@dataclass(frozen=True)
class ReplayTask:
    """The runner's work: judge the recorded run, or replay its hand `path` through the job's renderer."""

    replay_case: ReplayCase
    path: HandPath

    def __call__(self, job: Job, directory: Path | None, seed: int) -> JudgedJob:
        """Do one job, in a process of its own.

        An inconclusive verdict on what no renderer could have made otherwise decides no exit code.
        """
        seed_all(seed)
        # How hand and force act on each other a given path may not settle: on a replay these checks stop no gate. Those
        # that only warn have nothing to warn of where nobody led the hand for them, as round laps for drift.
        loop_needed = tuple(check for check in job.case.checks if CHECKS[check].needs_loop)
        only_warn = tuple(check for check in job.case.checks if CHECKS[check].level is Level.SHOULD)
        channels = self.path.recording.channels
        advisory: tuple[str, ...] = (*loop_needed, *only_warn)
        if job.renderer == RECORDED:
            # What its renderer would have answered without an effect was not recorded.
            compares = tuple(check for check in job.case.checks if "without" in CHECKS[check].needs)
            advisory = (*(() if "operator_force" in channels else loop_needed), *only_warn, *compares)
            advisory = advisory if all(name in channels for name in REQUIRED) else job.case.checks
        judged = judge_recorded(
            lambda scene: self._recorded() if job.renderer == RECORDED else self._replayed(job.renderer, scene),
            merge_findings, job.renderer, job.suite, job.case,
        )  # fmt: skip
        # Informative only: shown in the report, without a say in the exit code.
        verdicts = tuple(
            replace(verdict, level=Level.INFO)
            if verdict.check in advisory and verdict.outcome is Outcome.INCONCLUSIVE
            else verdict
            for verdict in judged.verdicts
        )
        return store_recording(replace(judged, verdicts=verdicts), job, directory)

    def _recorded(self) -> Recorded:
        """Return the recorded run itself, stretch by stretch as it is judged."""
        path = self.path
        parts = [path.recording.part(stretch.rows) for stretch in path.judged]
        note = self._entry(None, "The recorded run as it was.", parts, path.left_out)
        return Recorded(concatenated(parts), tuple(Runs(part) for part in parts), note)

    def _replayed(self, name: str, scene: Scene) -> Recorded:
        """Return the renderer's answers along the hand path, and how checks may ask it again."""
        path, renderer = self.path, make_renderer(resolve(name), scene)
        parts = rerender(renderer, path, scene)

        def runs(part: Part) -> Runs:
            if part.ended:
                return Runs(part.recording)
            # The samples backwards are as much the recorded path as forwards; finer samples would be invented.
            alone = replace(path, stretches=(part.stretch,))

            def fresh(_number: int) -> Recording:
                return rerender(make_renderer(resolve(name), scene), alone, scene)[0].recording

            def without(kind: str) -> Recording:
                less = scene.without(kind)
                return rerender(make_renderer(resolve(name), less), alone, less)[0].recording

            return Runs(
                part.recording,
                reverse=cache(lambda: rerender_backwards(renderer, path, part.stretch, scene)),
                again=cache(lambda: rerender(renderer, alone, scene)[0].recording),
                fresh=cache(fresh),
                without=cache(without),
            )

        recordings = [part.recording for part in parts]
        answers = concatenated(recordings)
        ended = [part.ended for part in parts if part.ended]
        # Against the recorded run at equal times.
        entry = self._entry(difference(answers, path.recording), OPEN_LOOP, recordings, ended)
        return Recorded(answers, tuple(runs(part) for part in parts), entry, simulated=lambda: entry.seconds)

    def _entry(
        self, distance: Difference | None, note: str, parts: Sequence[Recording], left_out: Sequence[str]
    ) -> results.Replay:
        path, rows = self.path, sum(map(len, parts))
        return results.Replay(
            file=self.replay_case.file,
            note=note,
            clock=describe_clock(path.recording, path.stretches),
            stretches=len(parts),
            rows=rows,
            rows_left_out=len(path.recording) - rows,
            left_out=list(left_out),
            suspicious=list(path.suspicious),
            seconds=float(sum(part.time[-1] - part.time[0] for part in parts)),
            difference=distance,
        )


def replay_plan(
    replay_case: ReplayCase,
    renderers: Sequence[str],
    options: RunOptions = DEFAULT_OPTIONS,
) -> Plan:
    """Plan the recorded run and each of `renderers` for the runner, with `prepare_replay(replay_case)` as its work.

    Raises what `resolve` raises, and `InputError` for a renderer that would be taken for the recorded run.
    """
    # A renderer that is named twice is replayed once.
    names = tuple(dict.fromkeys(renderers))
    if RECORDED in names:
        raise InputError(f"'{RECORDED}' is the column of the recorded run", todo="name renderers to replay it through")
    # Unknown names are an error now, not in the middle of a run.
    for name in names:
        resolve(name)
    case = replay_case.case
    suite = Suite(name=REPLAY_SUITE, title=case.title, citation="", cases=(case,), rows=())
    jobs = tuple(Job(REPLAY_SUITE, case, name) for name in (RECORDED, *names))
    return Plan((suite,), (RECORDED, *names), jobs, options)


def prepare_replay(replay_case: ReplayCase) -> ReplayTask:
    """Return the work of a replay: what of the recording is sound is found once, for all renderers.

    Raises `InputError` where no two sound samples follow each other.
    """
    return ReplayTask(replay_case, hand_path(replay_case))


def describe_differences(document: results.ResultsDocument) -> str:
    """Describe how far each renderer is from the recorded run, and which channels checks lacked."""
    rows = [
        [run.renderer, _apart(run.replay.difference.ihip, "mm", 1e3), _apart(run.replay.difference.force, "N", 1.0)]
        for run in document.runs
        if run.replay is not None and run.replay.difference is not None
    ]
    checks: dict[str, list[str]] = {}
    for verdict in document.verdicts:
        if verdict.renderer == RECORDED and LACKING_CHANNEL in verdict.evidence:
            checks.setdefault(verdict.evidence[LACKING_CHANNEL], []).append(verdict.check)
    lines = align_columns([["against the recorded run", "IHIP", "force"], *rows]) if rows else []
    lines += [
        f"the recording has no channel '{channel}': its own run is not judged by {', '.join(names)}"
        for channel, names in checks.items()
    ]
    return "\n".join([*lines, OPEN_LOOP])


def _apart(distance: Apart | None, unit: str, scale: float) -> str:
    if distance is None:
        return "not recorded"
    if distance.max == 0.0:
        return "equal to the last bit"
    return (
        f"rms {scale * distance.rms:.3g} {unit}, at most {scale * distance.max:.3g} {unit} at t = {distance.time:.4g} s"
    )
