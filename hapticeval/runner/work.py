"""What is done with one job in its process: seed, judge, and write the recording, which is not sent back."""

from __future__ import annotations

import hashlib
import json
import random
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import read_effects
from hapticeval.files import file_stem
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.runner.judging import Judged, judge
from hapticeval.runner.planning import Job
from hapticeval.scene import Scene

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
