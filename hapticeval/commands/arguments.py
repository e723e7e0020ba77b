"""Arguments that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ModelName = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="A model of the catalogue, as in star or star:points=6,tip_angle=40, or a WKT or GeoJSON file.",
        show_default=False,
    ),
]

MappingFile = Annotated[
    Path | None,
    typer.Option(
        "--mapping",
        metavar="TOML",
        help="For a file that is no recording of ours: which column is what.",
        show_default=False,
    ),
]
MemoryLimit = Annotated[
    float,
    typer.Option("--memory-limit", metavar="GB", help="Refuse a file whose numbers would take more.", min=0.0),
]

FormatName = Annotated[
    str | None,
    typer.Option(
        "--format",
        metavar="NAME",
        help="Its format, where it cannot be told: a name, or module:function of an importer of yours.",
        show_default=False,
    ),
]
