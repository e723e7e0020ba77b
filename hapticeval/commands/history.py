"""`hapticeval history`: a renderer over the runs of its commits or versions, and where a check turned red."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hapticeval.commands.arguments import argument, option
from hapticeval.commands.terminal import lines, paragraphs, plural, say, wrote_lines
from hapticeval.errors import UnknownNameError

if TYPE_CHECKING:
    from hapticeval.runner.history import History

EXIT_CODES = """\b
Exit codes:
  0  written, whatever it says
  2  wrong usage or input
"""


def history(
    folders: Annotated[list[Path], argument(metavar="DIR...", help="Folders of runs.")],
    renderers: Annotated[
        list[str] | None,
        option("-r", "--renderer", metavar="NAME", help="Show this renderer; may be repeated. Without it: all."),
    ] = None,
    as_given: Annotated[
        bool, typer.Option("--as-given", help="Take the runs in this order, and not by the time when they ran.")
    ] = False,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The page to write, or a folder for it.")
    ] = Path("history.html"),
) -> None:
    """Show a renderer over several runs: a page of checks over commits, with the first red commit of each.

    A check is red in a run where one of its verdicts stops that run's gate. A run whose renderer lies in a git
    repository is called by its commit, any other by its folder. Columns link to the reports that are there.

    \b
    Examples:
      hapticeval history results-*
      hapticeval history --as-given good middle bad -r mine:Nearest -o bisect.html
    """
    from hapticeval.reports.history_page import write_history
    from hapticeval.runner.history import histories_of
    from hapticeval.runner.results import read_results

    runs = [(folder, read_results(folder)) for folder in dict.fromkeys(folders)]
    if not as_given:
        # ISO dates in UTC: their order as text is that in time.
        runs.sort(key=lambda run: run[1].date)
    known = {name for _, results in runs for name in results.renderers}
    for name in renderers or ():
        if name not in known:
            raise UnknownNameError("renderer of these runs", name, known)
    histories = histories_of(runs, renderers or ())
    # As -o of other commands, a folder will do.
    written = write_history(output if output.suffix else output / "history.html", histories)
    say(paragraphs(*(lines(_words_of(renderer_history)) for renderer_history in histories), wrote_lines([written])))


def _words_of(renderer_history: History) -> Iterator[str]:
    """Yield what is told of a renderer: over what, what is red, and since when."""
    red = [check for check in renderer_history.checks if check.is_red]
    state = (
        f"{plural(len(red), 'check')} red, the first from {renderer_history.first_red.words}"
        if renderer_history.first_red
        else "all green"
    )
    yield f"{renderer_history.renderer}: {plural(len(renderer_history.editions), 'run')}; now {state}"
    for check in renderer_history.checks:
        if check.words:
            yield f"  {check.check}: {check.words}"
            if check.is_red and check.first_red is not None:
                yield f"    {check.first_red.gravest.place}: {check.first_red.gravest.message}"
