"""`hapticeval convert`: a foreign file as a recording, and a recording as a file for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.arguments import FormatName, MappingFile, MemoryLimit
from hapticeval.commands.output import say
from hapticeval.recordings.memory import LIMIT

EXIT_CODES = """\b
Exit codes:
  0  converted
  1  converted, but rows are lost or masked, the run ended early, or something is suspicious
  2  wrong usage, or unreadable; nothing is written
"""


def convert(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording, or a foreign file.", show_default=False)],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The file to write: .h5, .mat, .csv or .npz.")
    ],
    mapping: MappingFile = None,
    format_: FormatName = None,
    memory_limit: MemoryLimit = LIMIT,
    salvage: Annotated[
        bool, typer.Option("--salvage", help="Of a recording that is cut short or damaged take what is whole.")
    ] = False,
) -> None:
    """Convert a foreign file or a journal to a recording, or a recording to .mat, .csv or .npz.

    Nothing is written over. What the file lacks is told, and stays in the recording.

    \b
    Examples:
      hapticeval convert log.mat --mapping rig.toml -o run7.h5
      hapticeval convert run7.journal -o run7.h5
      hapticeval convert run7.h5 -o run7.csv
      hapticeval convert cut.h5 --salvage -o whole.h5
    """
    from hapticeval.hardware.logs import load
    from hapticeval.recordings.importing.convert import export, refuse_existing
    from hapticeval.recordings.integrity.report import converted
    from hapticeval.recordings.memory import limited
    from hapticeval.recordings.salvage import incomplete

    refuse_existing(output)
    with limited(memory_limit):
        recording = load(file, mapping=mapping, format=format_, salvaging=salvage)
    export(output, recording)
    say(f"{converted(recording)}\nwrote {output}")
    raise typer.Exit(int(incomplete(recording)))
