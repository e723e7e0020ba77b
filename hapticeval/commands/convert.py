"""`hapticeval convert`: a foreign file as a recording, and a recording as a file for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.output import say


def convert(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording, or a foreign file.", show_default=False)],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The file to write: .h5, .mat, .csv or .npz.")
    ],
    mapping: Annotated[
        Path | None,
        typer.Option("--mapping", metavar="TOML", help="What the columns of a foreign file are.", show_default=False),
    ] = None,
    format_: Annotated[
        str | None,
        typer.Option(
            "--format", metavar="NAME", help="A format by name, or package.module:function.", show_default=False
        ),
    ] = None,
) -> None:
    """Convert a foreign file to a recording, or a recording to .mat, .csv or .npz. Nothing is written over.

    \b
    Examples:
      hapticeval convert log.mat --mapping rig.toml -o run7.h5
      hapticeval convert run7.h5 -o run7.csv
    """
    from hapticeval.recordings.conversion import load_recording
    from hapticeval.recordings.export import export, refuse_existing
    from hapticeval.recordings.tell import converted

    refuse_existing(output)
    recording = load_recording(file, mapping=mapping, format=format_)
    export(output, recording)
    say(f"{converted(recording)}\nwrote {output}")
