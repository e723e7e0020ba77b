"""`hapticeval compare`: runs of different hands, over angle, arc length or a phase, against the spread of repeats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hapticeval.commands.arguments import FormatName, MappingFile, MemoryLimit
from hapticeval.commands.output import say
from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.memory import LIMIT

if TYPE_CHECKING:
    from hapticeval.geometry.curve import Curve
    from hapticeval.recordings.compare.align import Run

EXIT_CODES = """\b
Exit codes:
  0  aligned and drawn, and compared where there are repeats; or no renderers to compare
  2  wrong usage or input, or a renderer without repeats to compare it by
"""


def compare(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="[RENDERER=]FILE...",
            help="Recordings; those of one renderer are its repeats.",
            show_default=False,
        ),
    ],
    by: Annotated[
        str,
        typer.Option(
            metavar="WHAT",
            help="angle (of the HIP), arc (length along the model), or a phase as CHANNEL:COLUMN.",
        ),
    ] = "angle",
    centre: Annotated[str, typer.Option(metavar="X,Y", help="What the angle is about, m.")] = "0,0",
    model: Annotated[
        str | None,
        typer.Option(metavar="MODEL", help="What was touched, where the recordings do not say.", show_default=False),
    ] = None,
    split: Annotated[
        bool, typer.Option("--split", help="Take a run that turns back as a pass of its own for each way.")
    ] = False,
    mapping: MappingFile = None,
    format_: FormatName = None,
    memory_limit: MemoryLimit = LIMIT,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where table and figure go.")
    ] = Path(),
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of the permutation test.", min=0)] = 0,
) -> None:
    """Compare direction and size of the force across runs that no clock can align.

    Two renderers differ only as far as they differ by more than the repeats of one of them do. Record them in turns:
    what drifts from the first run to the last would else count as theirs.

    A permutation test at 5 per cent decides. 4 and 4 repeats are dealt to two renderers in 70 ways, of which 2 part
    them as they were recorded, so p is 2/70 or more: 4 and 3 are the fewest that can tell. Both ways, with --split,
    are two tests, and p is doubled: 5 and 3 are the fewest, and beside 4 of one it takes 5 of the other. Three
    renderers take 5, 5 and 4 runs, one way or both. Where there are too few, what is printed says how many more.

    \b
    Examples:
      hapticeval compare constraint-*.h5 mapping-*.h5 -o comparison
      hapticeval compare --by arc --model star constraint=a.h5 constraint=b.h5 mapping=c.h5 mapping=d.h5
    """
    from hapticeval.recordings.compare.align import Abscissa, align
    from hapticeval.recordings.compare.spread import bands
    from hapticeval.recordings.compare.spread import compare as compared
    from hapticeval.recordings.memory import limited
    from hapticeval.reports.spread_figure import summary, write_spread

    with limited(memory_limit):
        runs = [_run(each, mapping, format_) for each in files]
    abscissa = Abscissa(by, centre=_centre(centre), curve=_curve(model, runs))
    aligned = align(runs, abscissa, split=split)
    refused: HapticevalError | None = None
    try:
        found = compared(aligned, seed=seed)
    except InputError as error:
        refused, found = error, ()
    written = write_spread(directory, aligned, bands(aligned), found)
    say("\n".join([summary(aligned, found), "", *(f"wrote {path}" for path in written)]))
    if refused is not None and len({run.renderer for run in runs}) > 1:
        raise refused


def _run(text: str, mapping: Path | None, format_: str | None) -> Run:
    from hapticeval.hardware.logs import load
    from hapticeval.recordings.compare.align import Run
    from hapticeval.recordings.importing.convert import is_ours

    renderer, equals, name = text.partition("=")
    file = Path(name if equals else text)
    recording = load(file, mapping=None if is_ours(file) else mapping, format=format_)
    recording.require("hip", "force")
    said = renderer if equals else recording.meta.get("renderer")
    if not isinstance(said, str) or not said:
        raise InputError(
            f"{file} does not say its renderer",
            why="repeats of one renderer belong together",
            todo=f"name it: constraint={file}",
        )
    return Run(str(file), said, recording)


def _centre(text: str) -> tuple[float, float]:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--centre {text}", why="it is not two numbers", todo="write metres: --centre 0.1,0") from None
    return x, y


def _curve(model: str | None, runs: Sequence[Run]) -> Curve | None:
    """The model's outline: the given one, else the one that all recordings name."""
    import json

    from hapticeval.commands.arguments import model_named
    from hapticeval.geometry.catalogue import make_model
    from hapticeval.recordings.provenance import model_of

    if model is not None:
        return model_named(model).curve
    models = [model_of(run.recording) for run in runs]
    said = {json.dumps(model, sort_keys=True, default=str) for model in models}
    if len(said) > 1:
        raise InputError(
            "the recordings are of different models",
            why="what is felt is compared at places of one model",
            todo="compare runs on one model, or say with --model which it was",
        )
    document = models[0] if models else None
    if document is None:
        return None
    made = make_model(**document)
    return made.curve if made.dimension == 2 else None
