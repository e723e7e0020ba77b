"""One recording to look at: the run as it was recorded, and what checks find in it where its scene is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from hapticeval.errors import InputError
from hapticeval.files import file_stem
from hapticeval.recordings.provenance import LINE_MODEL, model_of, scene_of
from hapticeval.recordings.recording import Recording
from hapticeval.replay import RECORDED
from hapticeval.replay.job import prepare_replay
from hapticeval.replay.subject import REPLAY_SUITE, make_replay_case
from hapticeval.runner.planning import Job
from hapticeval.runner.results import RunEntry, SceneEntry, VerdictEntry
from hapticeval.runner.work import run_entry


@dataclass(frozen=True)
class Viewed:
    """A run with what a page needs of it; `verdicts` are none where `unjudged` gives the reason."""

    entry: RunEntry
    recording: Recording
    verdicts: tuple[VerdictEntry, ...]
    suspicious: tuple[str, ...] = ()
    unjudged: str = ""

    def called(self, name: str, *, title: str) -> Viewed:
        """Return the run under another name than `recorded`, which tells it from another on one page, `title`."""
        renamed = (msgspec.structs.replace(verdict, renderer=name) for verdict in self.verdicts)
        return replace(
            self, entry=msgspec.structs.replace(self.entry, renderer=name, title=title), verdicts=tuple(renamed)
        )


def view_recording(
    file: Path,
    recording: Recording,
    *,
    model: Mapping[str, Any] | None = None,
    suite_case: str | None = None,
    scene: Sequence[str] = (),
) -> Viewed:
    """Return the recorded run, judged as a replay judges it; see `make_replay_case` for what is given.

    Where neither that nor the recording names the model and the stiffness, it is shown and not judged. A recording in
    one dimension that names no model is before a wall, `line`.

    Raises `InputError` as `make_replay_case` and `hand_path` do, and for a recording without a HIP.
    """
    recording.require("hip")
    # A run in one dimension needs no model: what it touches is a wall.
    touched = model or model_of(recording) or ({"kind": LINE_MODEL} if recording.dimension == 1 else None)
    missing = []
    if suite_case is None:
        if touched is None:
            missing.append("the model that was touched: --model circle:size=0.2")
        if "stiffness" not in scene_of(recording) and not any(text.partition("=")[0] == "stiffness" for text in scene):
            missing.append("the stiffness of the scene: --scene stiffness=1000")
    # Shown all the same: a page of a recording is of use without verdicts.
    if missing:
        return _unjudged(file, recording, touched, f"Not judged, for want of {' and '.join(missing)}.")
    replay_case = make_replay_case(
        file, recording, model=touched if suite_case is None else model, suite_case=suite_case, scene=scene
    )
    # The runner's own work, done here at once: the page shows what a replay's report would.
    work, job = prepare_replay(replay_case), Job(REPLAY_SUITE, replay_case.case, RECORDED)
    judged, _ = work(job, None, 0)
    entry = msgspec.structs.replace(run_entry(job, judged, None), title=f"Recording {file.name}", shows=None)
    # The recorded run is given, so that only an error can leave none.
    if judged.recording is None:
        raise judged.error or InputError(f"{file} cannot be shown")
    return Viewed(entry, judged.recording, tuple(map(VerdictEntry.of, judged.verdicts)), work.path.suspicious)


def _unjudged(file: Path, recording: Recording, model: Mapping[str, Any] | None, why: str) -> Viewed:
    """Return the run as it was recorded, without verdicts, and `why` there are none."""
    entries = scene_of(recording)
    scene = {name: float(entries.get(name, 0.0)) for name in ("stiffness", "damping", "mass", "restitution")}
    scene |= {"bilateral": bool(entries.get("bilateral", False)), "sampling_time": float(recording.dt)}
    entry = RunEntry(
        suite=REPLAY_SUITE,
        case=file_stem(file.stem),
        renderer=RECORDED,
        recording=None,
        simulated_seconds=0.0,
        wall_seconds=0.0,
        stimulus="experiment",
        title=f"Recording {file.name}",
        shows=None,
        citation=None,
        model=dict(model or {"kind": "unknown"}),
        depth_of=None,
        judged=False,
        scene=msgspec.convert(scene, SceneEntry),
        closed_form=None,
        ended=None,
        error=None,
        refusal=None,
    )
    return Viewed(entry, recording, (), unjudged=why)
