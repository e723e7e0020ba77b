"""Forces of several runs over a common abscissa, with the spread of the repeats, as in Figures 6.5 and 6.9."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.errors import HapticevalError
from hapticeval.files import plain, replacing, without_non_finite
from hapticeval.recordings.compare.align import COLUMNS, Aligned
from hapticeval.recordings.compare.spread import Band, Comparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0067b1", "#c4501b", "#2f7d32", "#7b3f99", "#8a6d00", "#00757a")
INK, QUIET = "#1d2329", "#9aa2aa"
SCALE = {"rad": (180.0 / math.pi, "degrees"), "m": (1e3, "mm"), "N": (1.0, "N")}
TITLES = {
    "direction": "direction of the force",
    "leaning": "force against the model's normal",
    "magnitude": "size of the force",
    "depth": "distance of IHIP and HIP",
}
ALONG = {"angle": "polar angle of the HIP", "arc": "arc length along the model"}
SETTINGS: Mapping[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "hapticeval",
    "font.size": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.edgecolor": QUIET,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "legend.fontsize": 8.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "grid.color": "#e4e7ea",
}


def write_spread(
    directory: Path, aligned: Aligned, bands: Sequence[Band], comparisons: Sequence[Comparison]
) -> list[Path]:
    """Write comparison.svg, .png, .md and .json into `directory`; the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    paths = [directory / f"comparison.{suffix}" for suffix in ("svg", "png", "md", "json")]
    texts = table(aligned, comparisons) + "\n", json.dumps(_document(aligned, bands, comparisons), indent=1) + "\n"
    try:
        _write_figure(paths[:2], aligned, bands)
        for path, text in zip(paths[2:], texts, strict=True):
            with replacing(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write into {directory}", why=error.strerror or str(error)) from error
    return paths


def _write_figure(paths: Sequence[Path], aligned: Aligned, bands: Sequence[Band]) -> None:
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = [name for name in TITLES if any(band.column == name for band in bands)]
    settings: Any = dict(SETTINGS)
    with rc_context(settings):
        rows = (len(columns) + 1) // 2
        figure = Figure(figsize=(9.0, 0.9 + 2.6 * rows), facecolor="white")
        FigureCanvasAgg(figure)
        axes = figure.subplots(rows, 2, squeeze=False)
        for place, column in zip(axes.flat, columns, strict=False):
            _draw(place, aligned, [band for band in bands if band.column == column], column)
        for place in list(axes.flat)[len(columns) :]:
            place.set_visible(False)
        handles, labels = axes.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper left", ncols=3, frameon=False)
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.35 / (0.9 + 2.6 * rows)))
        for path in paths:
            with replacing(path) as temporary:
                vector = path.suffix == ".svg"
                figure.savefig(temporary, format=path.suffix[1:], dpi=160, metadata={"Date": None} if vector else None)


def _draw(axes: Axes, aligned: Aligned, bands: Sequence[Band], column: str) -> None:
    scale, unit = SCALE.get(COLUMNS[column][0], (1.0, COLUMNS[column][0]))
    across, along = SCALE.get(aligned.unit, (1.0, aligned.unit))
    names = list(dict.fromkeys(band.renderer for band in bands))
    ways = len({band.direction for band in bands}) > 1
    for band in bands:
        order = names.index(band.renderer)
        colour = COLOURS[order % len(COLOURS)]
        width = 0.9 + 1.1 * (len(names) - 1 - order) / max(len(names) - 1, 1)  # curves that coincide are all seen
        seen = band.count > 0
        label = band.renderer + (f", {'forward' if band.direction > 0 else 'backward'}" if ways else "")
        label += f" ({int(band.count.max())} repeats)"
        at = across * aligned.grid

        def shown(values: Any, seen: Any = seen) -> Any:
            return np.where(seen, scale * values, np.nan)

        axes.fill_between(at, shown(band.low), shown(band.high), color=colour, alpha=0.18, linewidth=0.0)
        axes.plot(
            at, shown(band.median), color=colour, linewidth=width, label=label,
            linestyle="-" if band.direction > 0 else "--",
        )  # fmt: skip
    axes.set_title(TITLES[column])
    axes.set_xlabel(f"{ALONG.get(aligned.by, aligned.by)} ({along})")
    axes.set_ylabel(unit)
    axes.grid(True, linewidth=0.5)
    axes.set_axisbelow(True)


def table(aligned: Aligned, comparisons: Sequence[Comparison]) -> str:
    """How renderers differ, and every pass that was aligned, as markdown."""
    return "\n".join([*_statements(aligned, comparisons), "", *_passes(aligned)])


def summary(aligned: Aligned, comparisons: Sequence[Comparison]) -> str:
    """How renderers differ, and a row for each run, as markdown."""
    return "\n".join([*_statements(aligned, comparisons), "", *_runs(aligned)])


def _runs(aligned: Aligned) -> Iterator[str]:
    """Of each run how many passes it makes, and what share of the way they cover together, forward and backward."""
    yield "| renderer | run | covered forward | covered backward |"
    yield "|---|---|---|---|"
    for number, run in enumerate(aligned.runs):
        cells = []
        for direction in (1, -1):
            own = [each.mask for each in aligned.passes if each.run == number and each.direction == direction]
            share = f"{100.0 * float(np.mean(np.any(own, axis=0))):.3g} %" if own else ""
            cells.append(f"{share} in {len(own)} passes" if len(own) > 1 else share)
        yield f"| {run.renderer} | {run.label} | {cells[0]} | {cells[1]} |"


def _passes(aligned: Aligned) -> Iterator[str]:
    yield "| renderer | run | direction | lap | from (s) | to (s) | coverage |"
    yield "|---|---|---|---|---|---|---|"
    for each in aligned.passes:
        run = aligned.runs[each.run]
        way = "forward" if each.direction > 0 else "backward"
        yield (
            f"| {run.renderer} | {run.label} | {way} | {each.lap + 1} | {each.start:.4g} | {each.end:.4g} | "
            f"{100.0 * each.coverage:.3g} % |"
        )


def _statements(aligned: Aligned, comparisons: Sequence[Comparison]) -> Iterator[str]:
    if not comparisons:
        yield "Nothing is compared: that takes two renderers with repeats of each."
        return
    across, along = SCALE.get(aligned.unit, (1.0, aligned.unit))
    for each in comparisons:
        scale, unit = SCALE.get(COLUMNS[each.column][0], (1.0, COLUMNS[each.column][0]))
        size = f"{scale * each.difference:.3g} {unit}"
        tested = f"p = {each.p:.2g}, {each.repeats[0]} and {each.repeats[1]} repeats ({each.basis})"
        head = f"- {each.first} and {each.second}, {'forward' if each.direction > 0 else 'backward'}, "
        head += f"{TITLES[each.column]}: "
        if each.outcome == "too little in common":
            yield f"{head}too little in common: {100.0 * each.common:.3g} % of the way"
        elif each.outcome == "the same to rounding":
            yield (
                f"{head}the same to rounding: {scale * each.largest:.2g} {unit} apart at most, and no two repeats by "
                f"more than {each.rounding:.2g} of what their numbers resolve; not tested"
            )
        elif each.outcome in ("differs", "the runs differ"):
            whose = (
                ""
                if each.outcome == "differs"
                else (". These are single runs: whether other runs of the same renderers would differ is not known")
            )
            yield (
                f"{head}{each.outcome} by {size}, {_in_spreads(each, scale, unit)} ({tested}); "
                f"most at {across * each.worst:.4g} {along}{whose}"
            )
        elif each.outcome == "within the spread":
            yield f"{head}within the spread: {size} apart, repeats {scale * each.spread:.3g} {unit} ({tested})"
        else:
            yield (
                f"{head}too few repeats to tell: {size} apart, {_in_spreads(each, scale, unit)}, "
                f"and these repeats cannot give a p below {each.least:.2g} ({tested}); {_needed(each)}"
            )


def _in_spreads(each: Comparison, scale: float, unit: str) -> str:
    if each.spread == 0.0:
        return "where repeats do not differ at all"
    return f"which is {each.times:.3g} times the repeat spread of {scale * each.spread:.3g} {unit}"


def _needed(each: Comparison) -> str:
    """How many repeats were given, and how many more of which it takes."""
    given = f"given are {each.repeats[0]} of {each.first} and {each.repeats[1]} of {each.second}"
    if each.needed is None:
        return f"{given}, and among so many renderers no number is enough: compare fewer at once"
    more = [
        f"{enough - had} more of {renderer}"
        for renderer, had, enough in zip((each.first, each.second), each.repeats, each.needed, strict=True)
        if enough > had
    ]
    return f"{given}; it takes {' and '.join(more)} at the least ({each.needed[0]} and {each.needed[1]})"


def _document(aligned: Aligned, bands: Sequence[Band], comparisons: Sequence[Comparison]) -> Any:
    document = {
        "by": aligned.by,
        "unit": aligned.unit,
        "grid": aligned.grid,
        "passes": [
            {
                "renderer": aligned.runs[each.run].renderer,
                "run": aligned.runs[each.run].label,
                "direction": each.direction,
                "lap": each.lap,
                "start_s": each.start,
                "end_s": each.end,
                "coverage": each.coverage,
            }
            for each in aligned.passes
        ],
        "bands": [asdict(band) for band in bands],
        "comparisons": [{**asdict(each), "times": each.times, "outcome": each.outcome} for each in comparisons],
    }
    return without_non_finite(plain(document, "comparison"))[0]
