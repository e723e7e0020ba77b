"""Commands that study a renderer rather than judge it: what accuracy costs, and where projections lead."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hapticeval.errors import RefusalError
from hapticeval.output import DEFAULT_DIRECTORY, prepare, say

ModelName = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="A model of the catalogue, as in star or star:points=6,tip_angle=40, or a WKT or GeoJSON file.",
        show_default=False,
    ),
]

BENCH_EXIT_CODES = """\b
Exit codes:
  0  measured; with --compare nothing is worse, with --within a setting meets it
  1  something is significantly worse, no setting meets --within, or the bench was interrupted
  2  wrong usage or input, or a setting whose input was not usable
  3  a renderer broke (outranks 1 and 2)
"""


def bench(
    renderers: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="RENDERER",
            help="As in `run -r`. Without one, those that come with hapticeval, on every representation.",
            show_default=False,
        ),
    ] = None,
    knobs: Annotated[
        list[str] | None,
        typer.Option(
            "--knob",
            metavar="NAME=VALUE,...",
            help="Values to sweep a knob over, such as vertices=40,80,160; may be repeated.",
            show_default=False,
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few values and few samples: some minutes.")] = False,
    within: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="Name the cheapest setting whose IHIP error is at most this, such as 0.1mm.",
            show_default=False,
        ),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(
            metavar="TIME", help="Only settings whose step takes at most this, such as 10us.", show_default=False
        ),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="The folder of an earlier bench: tell what is better or worse now.", show_default=False
        ),
    ] = None,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where the measurements go.")
    ] = DEFAULT_DIRECTORY,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of everything random.", min=0)] = 0,
) -> None:
    """Measure what accuracy costs in time: sweep the knobs of renderers.

    \b
    Examples:
      hapticeval bench --quick
      hapticeval bench constraint@polygon --knob vertices=40,80,160
      hapticeval bench --within 0.1mm --budget 10us
      hapticeval bench --quick -o new --compare old
    """
    from dataclasses import replace

    from hapticeval.bench import compare as comparison
    from hapticeval.bench import quantity, tell
    from hapticeval.bench.judge import judged
    from hapticeval.bench.settings import chosen_values, own_variants, settings_of
    from hapticeval.bench.sweep import Sweep
    from hapticeval.costs import read_costs, read_samples, write_costs
    from hapticeval.terminal import Terminal

    wanted = None if within is None else quantity.length(within, option="--within")
    limit = None if budget is None else quantity.duration(budget, option="--budget")
    before = None if compare is None else (read_costs(compare), read_samples(compare))
    names = renderers or own_variants()
    settings = settings_of(names, quick=quick, chosen=chosen_values(knobs or []))
    prepare(directory)
    command = {"renderers": names, "knobs": knobs or [], "within": within, "budget": budget}
    sweep = Sweep(settings, quick=quick, seed=seed, command=command)
    with Terminal() as terminal:
        sweep.run(terminal.working)
    samples = sweep.samples()
    costs = judged(sweep.costs(), within=wanted, budget=limit)
    if before is not None:
        costs = replace(costs, comparison=comparison.compare(costs, samples, *before))
    written = write_costs(directory, costs, samples)
    say("\n".join([tell.summary(costs), "", *(f"wrote {path}" for path in written)]))
    missed = within is not None and any(each["what"] == "step" and each["key"] is None for each in costs.answers)
    worse = any(each["verdict"] == "worse" for each in costs.comparison)
    raise typer.Exit(max([int(missed or worse or not costs.complete), *(each.exit_code for each in sweep.failures)]))


def field(
    renderer: Annotated[str, typer.Argument(metavar="RENDERER", help="As in `run -r`.", show_default=False)],
    model: ModelName,
    within: Annotated[
        str, typer.Option(metavar="LENGTH", help="How far from a discontinuity the inside is measured.")
    ] = "1mm",
    origin: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="X,Y",
            help="Of a renderer with memory: the surface point nearest to this one, m, is where its tool was.",
            show_default=False,
        ),
    ] = None,
    arc: Annotated[
        float | None,
        typer.Option("--s", metavar="ARC", help="The same by arc length along the model, m.", show_default=False),
    ] = None,
    knobs: Annotated[
        list[str] | None,
        typer.Option("--knob", metavar="NAME=VALUE", help="Set a knob; may be repeated.", show_default=False),
    ] = None,
    cells: Annotated[int, typer.Option(metavar="N", help="Lattice steps along the longer side.", min=20)] = 300,
    directory: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where picture and numbers go.")
    ] = Path(),
) -> None:
    """Draw where a projection sends the inside of a model, and where it jumps.

    \b
    Examples:
      hapticeval field minimum-distance star
      hapticeval field constraint@curve cassinian --from 0.1,0
      hapticeval field minimum-distance@polygon cassinian --knob vertices=80 -o pictures
      hapticeval field mapping outline.wkt --within 2mm
    """
    from hapticeval.bench.quantity import length
    from hapticeval.picturing import pictured
    from hapticeval.reports.fields_figure import caption, write_field

    distance = length(within, option="--within")
    found, document = pictured(renderer, model, within=distance, origin=origin, arc=arc, knobs=knobs or [], cells=cells)
    written = write_field(directory, found, document)
    say("\n".join([document["title"], caption(document), "", *(f"wrote {path}" for path in written)]))


def flow(
    model: ModelName,
    velocity: Annotated[
        str, typer.Option(metavar="NAME", help="Velocity function: arc, cap, unit or curvature.")
    ] = "arc",
    cells: Annotated[int, typer.Option(metavar="N", help="Grid cells along the longer side.", min=20)] = 200,
    directory: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where the picture goes.")] = Path(),
) -> None:
    """Draw how a model's outline shrinks to a point, and the grid of levels and lines that this makes.

    A model that the flow cannot map is drawn with a cross where that was seen, and the command ends with 2.

    \b
    Examples:
      hapticeval flow cassinian
      hapticeval flow star --velocity cap
      hapticeval flow dumbbell:neck=0.3 -o pictures
    """
    from hapticeval.geometry.flow import FlowSettings
    from hapticeval.geometry.flow import flow as shrink
    from hapticeval.picturing import model_named
    from hapticeval.reports.flow_figure import write_flow

    shape = model_named(model)
    title = f"{velocity} flow of {Path(model).stem if Path(model).is_file() else model}"
    try:
        made = shrink(shape, FlowSettings(velocity=velocity, cells=cells))
    except RefusalError as refusal:
        for path in write_flow(directory, shape, None, title=title, cross=refusal.position):
            say(f"wrote {path}")
        raise
    say(
        f"{title}: {len(made.times)} levels, {made.points.shape[1]} lines, "
        f"{1e3 * made.lengths[0]:.4g} mm of outline shrunk to {1e3 * made.lengths[-1]:.3g} mm"
    )
    for path in write_flow(directory, shape, made, title=title):
        say(f"wrote {path}")
