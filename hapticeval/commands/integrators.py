"""`hapticeval integrators`: what the accuracy of a device's motion costs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.commands.output import say


def integrators(
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where picture and numbers go.")
    ] = Path(),
) -> None:
    """Draw how exactly each method moves the robot between samples, and in what time.

    A hand draws the robot along a circle against motors that jump at each tick. Errors are against scipy's DOP853 at
    its tightest.

    \b
    Example:
      hapticeval integrators -o pictures
    """
    from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
    from hapticeval.reports.precision_figure import write_precision
    from hapticeval.study.integrators import study_integrators

    document = study_integrators([Parallelogram2(), Parallelogram3()])
    chosen = document["default"]
    for device in document["devices"]:
        methods = {method["name"]: method for method in device["methods"]}
        point = next(p for p in methods[chosen["method"]]["points"] if p["tolerance"] == chosen["tolerance"])
        say(
            f"{device['device']}: closed loops use {chosen['method']} with a tolerance of {chosen['tolerance']:.0e}: "
            f"error {point['error']:.1e} after a tick at the most, {1.0 / point['seconds_per_second']:.0f} times real "
            "time"
        )
    for path in write_precision(directory, document):
        say(f"wrote {path}")
