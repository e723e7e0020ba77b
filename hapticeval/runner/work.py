"""What is done with one job where it runs: seed, judge, write the recording, and make entries of results.json.

Only the entries travel back.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import random
import shlex
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TextIO, TypeAlias

import numpy as np

from hapticeval.devices.device import Device
from hapticeval.devices.parallelogram import Parallelogram
from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import read_effects
from hapticeval.errors import RendererError, place_in_stack
from hapticeval.files import digest_of, file_stem, plain
from hapticeval.recordings.hdf5 import recording_bytes, write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.runner.events import JobFinished
from hapticeval.runner.judging import Judged, error_verdicts, judge
from hapticeval.runner.planning import Job
from hapticeval.runner.results import Ended, Problem, Refusal, Robot, RunEntry, SceneEntry, VerdictEntry
from hapticeval.scene import Scene
from hapticeval.suite.case import Case
from hapticeval.workers import TRIES, Overdue, ProcessEnded

JudgedJob: TypeAlias = tuple[Judged, Path | None]
"""A judged job and where its recording lies below the result folder."""

Work: TypeAlias = Callable[[Job, Path | None, int], JudgedJob]
"""What is done with a job, given it, the result folder, if there is one, and the seed."""


def run_job(job: Job, directory: Path | None, seed: int) -> JudgedJob:
    """Run and judge a job as its case says."""
    seed_all(seed)
    factory = resolve(job.renderer) if job.factory is None else job.factory
    return store_recording(judge(factory, job.renderer, job.suite, job.case), job, directory)


def derived_seed(seed: int, *place: object) -> int:
    """Return the seed of one job, or of one drawn case: a hash of the run's seed and of the words that name it.

    It depends neither on order nor on process, nor on shards: together they give what one run gives.
    """
    text = json.dumps([seed, *map(str, place)])
    # 32 bits are what numpy's global generator takes as a seed.
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4])


def seed_all(seed: int) -> None:
    """Seed the global random generators, from which a third party's renderer may draw."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - the global generator


def store_recording(judged: Judged, job: Job, directory: Path | None) -> JudgedJob:
    """Write a judged job's recording, with its origin, into the result folder, and return the job without it.

    Without a folder nothing is written, and the job keeps it.
    """
    if judged.recording is None:
        return judged, None
    recording = _labelled(judged.recording, job)
    if directory is None:
        return replace(judged, recording=recording), None
    file = recording_file(job)
    write_recording(directory / file, recording, replace=True)
    return replace(judged, recording=None), file


def _labelled(recording: Recording, job: Job) -> Recording:
    """Return the recording with what it takes to render it again: renderer, model and scene."""
    case = job.case
    # The scene has its numbers and effects, then what else the case's table says, as it is written there, and then the
    # model as the case names it.
    origin = {
        "renderer": job.renderer,
        "suite": job.suite,
        "case": case.name,
        "scene": {
            **scene_document(case.build_scene()),
            **read_effects(case.scene, case.folder)[0],
            "model": dict(case.model),
        },
        "checks": list(case.checks),
    }
    # What the recording says of itself goes before what the job says of it.
    return replace(recording, meta={**origin, **recording.meta})


def recording_file(job: Job) -> Path:
    """Where a job's recording lies below the result folder."""
    return Path("recordings") / job.suite / job.case.name / f"{file_stem(job.renderer)}.h5"


def scene_document(scene: Scene) -> Mapping[str, Any]:
    """Return the scene's numbers and effects as JSON values, as recordings and results hold them."""
    return {
        "stiffness": scene.stiffness,
        "damping": scene.damping,
        "mass": scene.mass,
        "bilateral": scene.bilateral,
        "restitution": scene.restitution,
        "sampling_time": scene.sampling_time,
        **({"effects": [effect.document() for effect in scene.effects]} if scene.effects else {}),
    }


def carry_out(
    work: Work, job: Job, directory: Path | None, seed: int, *, shares_folder: bool
) -> tuple[JobFinished, bytes | None]:
    """Do a job; its recording is in the result folder afterwards.

    A machine elsewhere may not see that folder (`shares_folder`): from there the recording's file travels along, as
    bytes.
    """
    with _warnings_collected() as text_by_place:
        judged, file = work(job, directory if shares_folder else None, seed)
    if shares_folder or directory is None or judged.recording is None:
        return finished(job, judged, file, text_by_place), None
    content = recording_bytes(judged.recording)
    return finished(job, replace(judged, recording=None), recording_file(job), text_by_place), content


@contextmanager
def _warnings_collected() -> Iterator[Mapping[str, str]]:
    """Collect the warnings of a process that works for another, as text by place; elsewhere they go where they went.

    The process that everything is reported by shows them: workers know nothing of each other.
    """
    text_by_place: dict[str, str] = {}

    def collect(
        message: Warning | str, category: type[Warning], filename: str, lineno: int,
        file: TextIO | None = None, line: str | None = None,
    ) -> None:  # fmt: skip
        del file  # of Python's signature
        text = warnings.formatwarning(message, category, filename, lineno, line).rstrip()
        text_by_place.setdefault(f"{filename}:{lineno}: {category.__name__}", text)

    if multiprocessing.parent_process() is None:
        yield text_by_place
        return
    before = warnings.showwarning
    warnings.showwarning = collect
    try:
        yield text_by_place
    finally:
        warnings.showwarning = before


def finished(
    job: Job, judged: Judged, file: Path | None, text_by_place: Mapping[str, str] = MappingProxyType({})
) -> JobFinished:
    """Return the entries of a judged job, its recording where no file keeps it, and its warnings' text by place."""
    return JobFinished(
        run_entry(job, judged, file), tuple(map(VerdictEntry.of, judged.verdicts)), judged.error, judged.recording,
        dict(text_by_place),
    )  # fmt: skip


def finished_by_end(job: Job, how: ProcessEnded) -> JobFinished:
    """Return a job whose process ended without an answer as finished, by errors of a renderer that is broken."""
    # From outside, in each of TRIES processes: no crash of the renderer's own.
    if how.killed:
        error = RendererError(
            "the process that the renderer ran in was killed, again and again",
            why=f"{TRIES} processes in turn, from outside: as the system does where memory runs out",
            todo="run it alone and watch its memory",
        )
    else:
        # The step that the renderer was in, where it was asked for one.
        tick, hip = how.pending_step or (None, None)
        place = place_in_stack(how.stack)
        error = RendererError(
            f"the renderer ended the process that it ran in: {how.how}",
            tick=tick,
            hip=hip,
            why=f"a crash in compiled code, os._exit(), or memory that ran out{place and f': it was {place}'}",
            todo=f"see what `hapticeval doctor -r {shlex.quote(job.renderer)}` finds, or {_alone(job)}",
        )
    return finished(job, error_verdicts(error, job.renderer, job.suite, job.case), None)


def finished_by_timeout(job: Job, seconds: float, how: Overdue) -> JobFinished:
    """Return a job that took longer than so many seconds and was ended as finished, by errors."""
    tick, hip = how.pending_step or (None, None)
    place = place_in_stack(how.stack)
    error = RendererError(
        f"the renderer was ended after {seconds:g} s in this case",
        tick=tick,
        hip=hip,
        why=f"it hangs, or takes longer than --timeout{place and f': it was {place}'}",
        todo=f"give it more time with --timeout, or {_alone(job)}",
    )
    return finished(job, error_verdicts(error, job.renderer, job.suite, job.case), None)


def _alone(job: Job) -> str:
    return f"run the case alone under a debugger: -k {job.case.name}"


def run_entry(job: Job, judged: Judged, file: Path | None) -> RunEntry:
    """Return the entry of a judged job, whose recording lies in `file` below the result folder."""
    case, error, refusal = job.case, judged.error, judged.refusal
    position = None if refusal is None or refusal.position is None else [float(x) for x in refusal.position]
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
        model=_portable(plain(case.model, "model")),
        depth_of=case.depth_of,
        judged=case.judged,
        scene=_scene(case),
        closed_form=judged.closed_form,
        ended=None if judged.ended is None else Ended(**judged.ended),
        error=None if error is None else Problem.of(error),
        refusal=None if refusal is None else Refusal.of(refusal, position=position),
        replay=judged.replay,
        step_seconds=judged.step_seconds,
    )


def _portable(model: Mapping[str, Any]) -> dict[str, Any]:
    """Return a model as results name it: one of a file by the file's name and digest, without this machine's folder."""
    if not isinstance(model.get("file"), str):
        return dict(model)
    # The folder is this machine's. Name and digest tell the file on any other.
    return {**model, "file": Path(model["file"]).name, "sha256": digest_of(Path(model["file"]))}


def _scene(case: Case) -> SceneEntry:
    """Return the scene's numbers, and for an experiment also its device and inner loop."""
    scene = case.build_scene()
    numbers = scene_document(scene)
    # A hand that is led needs no device.
    if case.stimulus_kind == "trajectory":
        return SceneEntry(**numbers)
    believed = None if scene.believed is None else _robot(scene.believed)
    return SceneEntry(**numbers, device=_robot(scene.robot), inner_loop=scene.inner_loop, believed=believed)


def _robot(device: Device) -> Robot:
    """Return a device as results have it."""
    if not isinstance(device, Parallelogram):
        return Robot(kind=device.name)
    return Robot(
        kind=device.name,
        dynamics=device.dynamics.value,
        base_inertia=device.base_inertia.value,
        constants=device.constants.changed(),
    )
