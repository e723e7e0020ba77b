"""The command that shows a recording: one page with a slider over time, and the verdicts beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from hapticeval.commands.arguments import (
    FormatName,
    MappingFile,
    MemoryLimit,
    SceneEntries,
    SuiteCase,
    TouchedModel,
    argument,
    model_named,
    option,
)
from hapticeval.commands.terminal import lines, say
from hapticeval.errors import InputError
from hapticeval.files import file_stem
from hapticeval.recordings.memory import DEFAULT_LIMIT

VIEW_CODES = """\b
Exit codes:
  0  the page is written, whatever it shows
  2  wrong usage, or the recording cannot be read
"""


def view(
    file: Annotated[Path, argument(metavar="FILE", help="A recording, or a foreign file.")],
    model: TouchedModel = None,
    suite_case: SuiteCase = None,
    scene: SceneEntries = None,
    mapping: MappingFile = None,
    format_: FormatName = None,
    memory_limit: MemoryLimit = DEFAULT_LIMIT,
    directory: Annotated[
        Path | None, option("-o", "--output", metavar="DIR", help="Where the page goes: view-FILE.")
    ] = None,
) -> None:
    """Show a recording in a page: the hand and the tool on the model, force and motion against time.

    What the recording says of its scene decides what is judged; without a model or a stiffness it is shown alone. One
    of one dimension is shown before its wall. The page needs no network.

    \b
    Examples:
      hapticeval view run7.h5
      hapticeval view log.mat --mapping rig.toml --scene stiffness=2000
      hapticeval view signal.svc --mapping handwriting.toml --model circle
    """
    from hapticeval.hardware.logs import load
    from hapticeval.recordings.memory import limited
    from hapticeval.replay.viewing import view_recording
    from hapticeval.reports.case_page import write_view

    directory = directory or Path(f"view-{file_stem(file.stem)}")
    named = None if model is None else model_named(model)
    with limited(memory_limit):
        recording = load(file, mapping=mapping, format=format_)
    # A recording in one dimension is shown in the plane.
    if named is not None and named.dimension != max(recording.dimension, 2):
        raise InputError(
            f"the recording is in {recording.dimension}D, the model '{model}' in {named.dimension}D",
            why="hand and model must live in the same space",
            todo="give another model with --model",
        )
    # Judged where model and stiffness are known, shown alone where they are not.
    viewed_run = view_recording(
        file, recording, suite_case=suite_case, scene=scene or (),
        model=None if named is None else {"kind": named.name, **named.parameters},
    )  # fmt: skip
    # With the reason where nothing was judged.
    page = write_view(directory, viewed_run.entry, viewed_run.recording, viewed_run.verdicts, note=viewed_run.unjudged)
    say(
        lines(
            [
                *(f"suspicious: {finding}" for finding in viewed_run.suspicious),
                *filter(None, [viewed_run.unjudged]),
                f"wrote {page}",
            ]
        )
    )
