"""`hapticeval badge`: how many verdicts are as required, as a picture for a README."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from hapticeval.commands.arguments import argument, option
from hapticeval.commands.terminal import say, wrote_lines

EXIT_CODES = """\b
Exit codes:
  0  the badge is written, whatever it shows
  2  wrong usage, no results in the folder, or no badge can be written there
"""


def badge(
    directory: Annotated[Path, argument(metavar="DIR", help="The folder of a run.")] = Path("results"),
    output: Annotated[
        Path | None, option("-o", "--output", metavar="DIR", help="Where badge.svg and badge.json go: DIR of the run.")
    ] = None,
) -> None:
    """Draw a badge of a run: badge.svg, and badge.json for an endpoint of shields.io.

    \b
    Example:
      hapticeval badge results -o badges
    """
    from hapticeval.reports.badge import write_badge
    from hapticeval.runner.results import read_results

    # Beside the results unless a folder is named.
    say(wrote_lines(write_badge(output or directory, read_results(directory))))
