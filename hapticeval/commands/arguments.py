"""Arguments that several commands take."""

from __future__ import annotations

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
