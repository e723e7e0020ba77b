"""A replay as a plan of jobs for the runner: the recorded run itself, and each renderer along its hand path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.recordings.compare.difference import Difference, difference
from hapticeval.recordings.recording import REQUIRED, Recording
from hapticeval.recordings.stretches import Stretch, told
from hapticeval.replay import OPEN_LOOP, RECORDED
from hapticeval.replay.merge import merged
from hapticeval.replay.rerender import HandPath, Part, backwards, joined, rerendered
from hapticeval.replay.sound import Usable, usable
from hapticeval.replay.subject import SUITE, Subject
from hapticeval.runner import results
from hapticeval.runner.judging import Judged, Recorded, built, judge_recorded
from hapticeval.runner.planning import Job, Plan
from hapticeval.runner.work import Done, kept, seed_all
from hapticeval.scene import Scene
from hapticeval.suite.suite import Suite

LOOP_NEEDED = ("impulsive-collision", "centripetal-force", "passivity")
"""Checks of how hand and force act on each other, which a given path may not settle: on a replay they stop no gate."""


@dataclass(frozen=True)
class Replay:
    """The runner's work: judges the recorded run, or replays its hand path through the job's renderer.

    `judged` are the stretches of the recorded run that its checks read, `left_out` what they do not, in words, and
    `suspicious` what the recording's examination found.
    """

    subject: Subject
    path: HandPath
    judged: tuple[Stretch, ...]
    left_out: tuple[str, ...]
    suspicious: tuple[str, ...]

    def __call__(self, job: Job, directory: Path, seed: int) -> Done:
        """One job, in a process of its own."""
        seed_all(seed)
        path = self.path
        if job.renderer == RECORDED:
            judged = judge_recorded(lambda _: self._recorded(), merged, job.renderer, job.suite, job.case)
            if any(name not in path.recording.channels for name in REQUIRED):
                judged = _shown_only(judged, job.case.checks)
            elif "operator_force" not in path.recording.channels:
                judged = _shown_only(judged, LOOP_NEEDED)
        else:
            judged = judge_recorded(
                lambda scene: self._replayed(job.renderer, scene), merged, job.renderer, job.suite, job.case
            )
            judged = _shown_only(judged, LOOP_NEEDED)
        return kept(judged, job, directory)

    def _recorded(self) -> Recorded:
        parts = [self.path.recording.part(stretch.rows) for stretch in self.judged]
        return Recorded(
            joined(parts),
            tuple(Runs(part) for part in parts),
            self._document(None, "The recorded run as it was.", parts, left_out=self.left_out),
        )

    def _replayed(self, name: str, scene: Scene) -> Recorded:
        path = self.path
        renderer = built(resolve(name), scene)
        parts = rerendered(renderer, path, scene)

        def runs(part: Part) -> Runs:
            if part.ended:
                return Runs(part.recording)
            # The samples backwards are as much the recorded path as forwards; finer samples would be invented.
            alone = replace(path, stretches=(part.stretch,))
            return Runs(
                part.recording,
                reverse=cache(lambda: backwards(renderer, path, part.stretch, scene)),
                again=cache(lambda: rerendered(renderer, alone, scene)[0].recording),
            )

        recordings = [part.recording for part in parts]
        whole = joined(recordings)
        return Recorded(
            whole,
            tuple(runs(part) for part in parts),
            self._document(
                difference(whole, path.recording),
                OPEN_LOOP,
                recordings,
                left_out=[part.ended for part in parts if part.ended],
            ),
            simulated_seconds=float(sum(each.time[-1] - each.time[0] for each in recordings)),
        )

    def _document(
        self, found: Difference | None, note: str, parts: Sequence[Recording], *, left_out: Sequence[str] = ()
    ) -> results.Replay:
        path = self.path
        rows = sum(map(len, parts))
        return results.Replay(
            file=self.subject.file,
            note=note,
            clock=told(path.recording, path.stretches),
            stretches=len(parts),
            rows=rows,
            rows_left_out=len(path.recording) - rows,
            left_out=list(left_out),
            suspicious=list(self.suspicious),
            seconds=float(sum(part.time[-1] - part.time[0] for part in parts)),
            difference=found,
        )


def replay_plan(subject: Subject, renderers: Sequence[str], *, seed: int = 0) -> Plan:
    """The recorded run and each of `renderers`, as a plan for the runner with `prepared(subject)` as its work.

    Raises what `resolve` raises, and `InputError` for a renderer that would be taken for the recorded run.
    """
    names = tuple(dict.fromkeys(renderers))
    if RECORDED in names:
        raise InputError(f"'{RECORDED}' is the column of the recorded run", todo="name renderers to replay it through")
    for name in names:
        resolve(name)
    case = subject.case
    suite = Suite(name=SUITE, title=case.title, citation="", cases=(case,), rows=())
    jobs = tuple(Job(SUITE, case, name) for name in (RECORDED, *names))
    return Plan((suite,), (RECORDED, *names), jobs, (), seed)


def prepared(subject: Subject) -> Replay:
    """The work of a replay: what of the recording is sound is found once, for all renderers.

    Raises `InputError` where no two sound samples follow each other.
    """
    path, found = hand_path(subject)
    return Replay(subject, path, found.judged or path.stretches, found.left_out, found.suspicious)


def hand_path(subject: Subject) -> tuple[HandPath, Usable]:
    """The hand path of a recording, and what of it is sound. Raises `InputError` where it has none."""
    recording = subject.recording
    recording.require("hip")
    scene = subject.case.build_scene()
    found = usable(recording, model=scene.model, stiffness=None if scene.damping else scene.stiffness)
    if not found.path:
        raise InputError(
            f"{subject.file} has no stretch of hand path to replay",
            why="no two sound samples follow each other",
            todo="look at it with `hapticeval inspect`",
        )
    return HandPath(recording, found.path), found


def _shown_only(judged: Judged, checks: Sequence[str]) -> Judged:
    """Of `checks`, what is inconclusive is shown and decides no exit code: no renderer could have made it otherwise."""
    verdicts = tuple(
        replace(verdict, level=Level.INFO)
        if verdict.check in checks and verdict.outcome is Outcome.INCONCLUSIVE
        else verdict
        for verdict in judged.verdicts
    )
    return replace(judged, verdicts=verdicts)
