"""`hapticeval study effects`: what scenes call for, what was assembled of it, and what that costs."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hapticeval.commands.arguments import argument, option
from hapticeval.commands.terminal import Terminal, lines, paragraphs, say, wrote_lines

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hapticeval.study.effects.document import Cost, EffectsDocument, SceneEntry

EFFECTS_CODES = """\b
Exit codes:
  0  measured
  2  wrong usage or input: the message says what, why, and what to do
  4  nothing is selected
"""

STAGE_WORDS = {
    "renderer": "renderer",
    "sense": "sensors",
    "feel": "force sensor",
    "answer": "answer",
    "command": "motors",
}
"""What the table calls the stages of a tick; another by its name."""


def effects(
    suites: Annotated[
        list[str] | None,
        argument(metavar="SUITE", help="Suites, groups of suites or suite files; without one: effects."),
    ] = None,
    renderer: Annotated[
        str, typer.Option("-r", "--renderer", metavar="NAME", help="As in `run -r`, one.")
    ] = "minimum-distance",
    select: Annotated[
        list[str] | None, option("-k", "--select", metavar="GLOB", help="As in `run -k`; may be repeated.")
    ] = None,
    directory: Annotated[
        Path | None, option("-o", "--output", metavar="DIR", help="Write effects.json there, which `report` draws.")
    ] = None,
) -> None:
    """Measure what the effects of scenes cost: the time of a tick with and without, and the compiled code.

    A scene is timed as it is and without its effects, in turns, 30 times each; the shortest counts. The code is the
    machine code of the loop, or of what changes the answers along a path, and of all that it calls of ours. A scene
    that calls for no effect runs the renderer itself in the same loop.

    \b
    Examples:
      hapticeval study effects
      hapticeval study effects dynamics-line -r set-stabilisation
      hapticeval study effects mine.toml -k '*texture*' -o results
    """
    from hapticeval.runner.folder import prepared_folder
    from hapticeval.runner.options import RunOptions
    from hapticeval.runner.planning import plan
    from hapticeval.study.effects.document import write_costs
    from hapticeval.study.effects.measure import measure

    jobs = plan(suites or ["effects"], [renderer], RunOptions(select=tuple(select or ()))).jobs
    # Without a folder nothing is written, and no earlier report removed.
    with nullcontext() if directory is None else prepared_folder(directory):
        with Terminal() as terminal:
            document = measure(jobs, terminal.working)
        written = [] if directory is None else [write_costs(directory, document)]
    say(
        paragraphs(
            lines(_cost_lines(document)),
            lines(_ladder_lines(document)),
            lines(_problem_lines(document)),
            wrote_lines(written),
        )
    )


def _cost_lines(document: EffectsDocument) -> Iterator[str]:
    """Yield the table of scenes: ns a tick and bytes of code, with their effects and without."""
    from hapticeval.quantity import align_columns

    head = ["scene", "effects, by where they take part", "ticks", "without", "with", "more", "code without", "with"]
    rows = [_cost_row(scene, scene.cost) for scene in document.scenes if scene.cost is not None]
    yield f"{document.scenes[0].renderer}: a tick, ns, and machine code, bytes"
    yield from align_columns([head, *rows], left=2)


def _cost_row(scene: SceneEntry, cost: Cost) -> list[str]:
    """Return a scene's row: its effects by stage, ticks, times and code."""
    # A scene without effects is its own reference.
    reference = scene.plain or cost
    more = f"{1e9 * (cost.tick - reference.tick):+.0f}" if scene.plain else "0"
    stages = "; ".join(
        f"{STAGE_WORDS.get(stage, stage)}: {', '.join(kinds)}" for stage, kinds in scene.assembled.items()
    )
    # ns a tick and bytes of machine code, without effects and with.
    numbers = [f"{scene.ticks}", _tick_ns(reference), _tick_ns(cost), more, _code_bytes(reference), _code_bytes(cost)]
    return [f"{scene.suite}/{scene.case}", stages or "none", *numbers]


def _tick_ns(cost: Cost) -> str:
    return f"{1e9 * cost.tick:.0f}"


def _code_bytes(cost: Cost) -> str:
    return "-" if cost.code is None else f"{cost.code}"


def _ladder_lines(document: EffectsDocument) -> Iterator[str]:
    """Yield the time of an answer (ns) with one effect more from row to row; nothing where it was not measured."""
    from hapticeval.quantity import align_columns

    # None where no compiled scene calls for effects of the surface.
    ladder = document.ladder
    if ladder is None:
        return
    rows = [
        [rung.kinds[-1] if rung.kinds else "none", f"{1e9 * rung.composed:.0f}", f"{1e9 * rung.tested:.0f}"]
        for rung in ladder.rungs
    ]
    yield f"{ladder.suite}/{ladder.case} effect by effect: an answer, ns, composed, and of an engine that tests flags"
    yield from align_columns([["up to", "composed", "tested"], *rows], left=1)


def _problem_lines(document: EffectsDocument) -> Iterator[str]:
    yield from (f"{scene.suite}/{scene.case}: {scene.problem}" for scene in document.scenes if scene.problem)
