"""`hapticeval replay`: a recorded hand path through other renderers, or through the recorded one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.commands.arguments import FormatName, MappingFile, MemoryLimit
from hapticeval.commands.output import prepare, say
from hapticeval.commands.running import report_on, watch
from hapticeval.errors import InputError
from hapticeval.files import file_stem
from hapticeval.recordings.memory import LIMIT

if TYPE_CHECKING:
    from hapticeval.commands.terminal import Terminal
    from hapticeval.replay.subject import Subject

EXIT_CODES = """\b
Exit codes:
  0  every verdict is as required; with --as-recorded, the log follows from its renderer
  1  a check failed, could not decide or differs; with --as-recorded, the log does not follow
  2  wrong usage or input, or every renderer refused the case
  3  a renderer broke
"""


def replay(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording.", show_default=False)],
    renderers: Annotated[
        list[str] | None,
        typer.Option("-r", "--renderer", metavar="NAME", help="As in `run -r`; may be repeated.", show_default=False),
    ] = None,
    as_recorded: Annotated[
        bool, typer.Option("--as-recorded", help="Compute the recorded renderer again, and compare with the log.")
    ] = False,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL",
            help="What was touched, as in star:points=6, or a WKT or GeoJSON file, where the recording does not say.",
            show_default=False,
        ),
    ] = None,
    suite_case: Annotated[
        str | None,
        typer.Option(
            "--suite-case", metavar="SUITE/CASE", help="Take model, scene and checks from a case.", show_default=False
        ),
    ] = None,
    scene: Annotated[
        list[str] | None,
        typer.Option(
            "--scene",
            metavar="KEY=VALUE",
            help="An entry of the scene, such as stiffness=1000, in SI units; may be repeated.",
            show_default=False,
        ),
    ] = None,
    mapping: MappingFile = None,
    format_: FormatName = None,
    memory_limit: MemoryLimit = LIMIT,
    directory: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Where results and reports go: replay-FILE.", show_default=False
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of everything random.", min=0, max=2**32 - 1)] = 0,
) -> None:
    """Lead renderers along a recorded hand path, and judge them beside the recorded run.

    The path is played sample by sample at its recorded times. It is open loop: under another force the hand would
    have moved otherwise.

    \b
    Examples:
      hapticeval replay run7.h5 -r constraint -r minimum-distance
      hapticeval replay signal.svc --mapping handwriting.toml --model circle --scene stiffness=1000
      hapticeval replay run7.h5 --as-recorded
    """
    from hapticeval.discovery import own_renderers
    from hapticeval.hardware.logs import load
    from hapticeval.recordings.memory import limited
    from hapticeval.replay.as_recorded import unsaid
    from hapticeval.replay.subject import subject

    if directory is None:
        directory = Path(f"replay-{file_stem(file.stem)}")
    if file.resolve().is_relative_to((directory / "recordings").resolve()) and not as_recorded:
        raise InputError(
            f"{file} is a recording of the results in '{directory}', which a replay into that folder would remove",
            why="new results take the place of earlier ones",
            todo="name another folder with -o",
        )
    with limited(memory_limit):
        recording = load(file, mapping=mapping, format=format_)
    made = subject(
        file, recording, model=_model(model), suite_case=suite_case, scene=scene or (),
        unsaid=unsaid(recording, renderers or ()) if as_recorded else None,
    )  # fmt: skip
    see = f"see `hapticeval inspect {file}{'' if mapping is None else f' --mapping {mapping}'}`"
    if as_recorded:
        raise typer.Exit(_as_recorded(made, renderers, see))
    raise typer.Exit(_replay(made, renderers or list(own_renderers()), directory, seed, see))


def _model(name: str | None) -> Mapping[str, Any] | None:
    from hapticeval.commands.arguments import model_named

    if name is None:
        return None
    found = model_named(name)
    return {"kind": found.name, **found.parameters}


def _replay(made: Subject, renderers: list[str], directory: Path, seed: int, see: str) -> int:
    from hapticeval.commands.terminal import Terminal, exit_code, summary
    from hapticeval.replay.job import differences, prepared, replay_plan
    from hapticeval.runner.execution import execute
    from hapticeval.runner.interrupts import Interrupts
    from hapticeval.runner.results import FILE
    from hapticeval.workers import cores

    planned = replay_plan(made, renderers, seed=seed)
    work = prepared(made)
    prepare(directory)
    with Interrupts(to_the_end=True) as interrupts, Terminal() as terminal:
        _warn(work.path.suspicious, see, terminal)
        stream = execute(planned, directory, workers=cores(), work=work, interrupts=interrupts)
        results = watch(stream, terminal)
        written = report_on(directory, terminal, interrupts)
        say("\n\n".join([differences(results), summary(results, [directory / FILE, *written])]))
    return max(exit_code(results, terminal.errors), int(terminal.stopped))


def _warn(suspicious: Sequence[str], see: str, terminal: Terminal) -> None:
    """Say what an examination of the recording found: verdicts on it may say little."""
    for each in suspicious:
        terminal.line(f"suspicious: {each}")
    if suspicious:
        terminal.line(see)


def _as_recorded(made: Subject, renderers: list[str] | None, see: str) -> int:
    from hapticeval.commands.terminal import Terminal
    from hapticeval.replay.as_recorded import as_recorded

    found = as_recorded(made, renderers or ())
    with Terminal() as terminal:
        _warn(found.suspicious, see, terminal)
    say(found.told())
    return int(not found.follows)
