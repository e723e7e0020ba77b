"""Forces of several runs over a common abscissa, with the spread of the repeats, as in Figures 6.5 and 6.9."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.files import plain, without_non_finite
from hapticeval.recordings.compare.align import COLUMNS, Aligned
from hapticeval.recordings.compare.spread import Band, Comparison
from hapticeval.reports.canvas import figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0067b1", "#c4501b", "#2f7d32", "#7b3f99", "#8a6d00", "#00757a")
SCALE = {"rad": (180.0 / math.pi, "degrees"), "m": (1e3, "mm"), "N": (1.0, "N")}
TITLES = {
    "direction": "direction of the force",
    "leaning": "force against the model's normal",
    "magnitude": "size of the force",
    "depth": "distance of IHIP and HIP",
}
ALONG = {"angle": "polar angle of the HIP", "arc": "arc length along the model"}
WAYS = {1: "forward", -1: "backward"}
SETTINGS = {"axes.titlesize": 9.0, "axes.titlelocation": "left"}


def write_spread(
    directory: Path, aligned: Aligned, bands: Sequence[Band], comparisons: Sequence[Comparison]
) -> list[Path]:
    """Write comparison.svg, .png, .md and .json into `directory`; return the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    columns = [name for name in TITLES if any(band.column == name for band in bands)]
    rows = (len(columns) + 1) // 2
    height = 0.9 + 2.6 * rows
    with figure(9.0, height, settings=SETTINGS) as made:
        panels = list(made.subplots(rows, 2, squeeze=False).flat)
        for axes, column in zip(panels, columns, strict=False):
            _draw(axes, aligned, [band for band in bands if band.column == column])
        for axes in panels[len(columns) :]:
            axes.set_visible(False)
        made.legend(*panels[0].get_legend_handles_labels(), loc="upper left", ncols=3)
        made.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.35 / height))
        document = _document(aligned, bands, comparisons)
        return save_figure(made, directory, "comparison", text=table(aligned, comparisons), document=document)


def _draw(axes: Axes, aligned: Aligned, bands: Sequence[Band]) -> None:
    column = bands[0].column
    scale, unit = _scaled(COLUMNS[column][0])
    across, along = _scaled(aligned.unit)
    names = list(dict.fromkeys(band.renderer for band in bands))
    ways = len({band.direction for band in bands}) > 1
    for band in bands:
        order = names.index(band.renderer)
        colour = COLOURS[order % len(COLOURS)]
        width = 0.9 + 1.1 * (len(names) - 1 - order) / max(len(names) - 1, 1)  # curves that coincide are all seen
        label = f"{band.renderer}{f', {WAYS[band.direction]}' if ways else ''} ({int(band.count.max())} repeats)"
        low, high, median = (
            np.where(band.count > 0, scale * each, np.nan) for each in (band.low, band.high, band.median)
        )
        axes.fill_between(across * aligned.grid, low, high, color=colour, alpha=0.18, linewidth=0.0)
        style = "-" if band.direction > 0 else "--"
        axes.plot(across * aligned.grid, median, color=colour, linewidth=width, label=label, linestyle=style)
    axes.set(title=TITLES[column], xlabel=f"{ALONG.get(aligned.by, aligned.by)} ({along})", ylabel=unit)
    axes.grid(True)


def _scaled(unit: str) -> tuple[float, str]:
    """The factor to the unit that is shown, and that unit."""
    return SCALE.get(unit, (1.0, unit))


def table(aligned: Aligned, comparisons: Sequence[Comparison]) -> str:
    """Describe how renderers differ, and every pass that was aligned, as markdown."""
    head = ("renderer", "run", "direction", "lap", "from (s)", "to (s)", "coverage")
    rows = []
    for each in aligned.passes:
        run = aligned.runs[each.run]
        when = (f"{each.start:.4g}", f"{each.end:.4g}", f"{100.0 * each.coverage:.3g} %")
        rows.append((run.renderer, run.label, WAYS[each.direction], str(each.lap + 1), *when))
    return _markdown(aligned, comparisons, head, rows)


def summary(aligned: Aligned, comparisons: Sequence[Comparison]) -> str:
    """Describe how renderers differ, and for each run what share of the way its passes cover, as markdown."""
    rows = []
    for number, run in enumerate(aligned.runs):
        cells = []
        for direction in WAYS:
            own = [each.mask for each in aligned.passes if each.run == number and each.direction == direction]
            share = f"{100.0 * float(np.mean(np.any(own, axis=0))):.3g} %" if own else ""
            cells.append(f"{share} in {len(own)} passes" if len(own) > 1 else share)
        rows.append((run.renderer, run.label, *cells))
    return _markdown(aligned, comparisons, ("renderer", "run", "covered forward", "covered backward"), rows)


def _markdown(
    aligned: Aligned, comparisons: Sequence[Comparison], head: Sequence[str], rows: Sequence[Sequence[str]]
) -> str:
    said = list(_statements(aligned, comparisons)) or [
        "Nothing is compared: that takes two renderers with repeats of each."
    ]
    first, *lines = (f"| {' | '.join(row)} |" for row in (head, *rows))
    return "\n".join([*said, "", first, f"|{'---|' * len(head)}", *lines])


def _statements(aligned: Aligned, comparisons: Sequence[Comparison]) -> Iterator[str]:
    """One line for each two renderers, direction and column."""
    across, along = _scaled(aligned.unit)
    for each in comparisons:
        scale, unit = _scaled(COLUMNS[each.column][0])
        size = f"{scale * each.difference:.3g} {unit}"
        tested = f"p = {each.p:.2g}, {each.repeats[0]} and {each.repeats[1]} repeats ({each.basis})"
        spreads = f"which is {each.times:.3g} times the repeat spread of {scale * each.spread:.3g} {unit}"
        if each.spread == 0.0:
            spreads = "where repeats do not differ at all"
        if each.outcome == "too little in common":
            said = f"too little in common: {100.0 * each.common:.3g} % of the way"
        elif each.outcome == "the same to rounding":
            said = (
                f"the same to rounding: {scale * each.largest:.2g} {unit} apart at most, and no two repeats by "
                f"more than {each.rounding:.2g} of what their numbers resolve; not tested"
            )
        elif each.outcome in ("differs", "the runs differ"):
            said = f"{each.outcome} by {size}, {spreads} ({tested}); most at {across * each.worst:.4g} {along}"
            if each.outcome == "the runs differ":
                said += ". These are single runs: whether other runs of the same renderers would differ is not known"
        elif each.outcome == "within the spread":
            said = f"within the spread: {size} apart, repeats {scale * each.spread:.3g} {unit} ({tested})"
        else:
            said = (
                f"too few repeats: {size} apart, {spreads}, "
                f"and these repeats cannot give a p below {each.least:.2g} ({tested}); {_needed(each)}"
            )
        yield f"- {each.first} and {each.second}, {WAYS[each.direction]}, {TITLES[each.column]}: {said}"


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
    passes = [
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
    ]
    document = {
        "by": aligned.by,
        "unit": aligned.unit,
        "grid": aligned.grid,
        "passes": passes,
        "bands": [asdict(band) for band in bands],
        "comparisons": [{**asdict(each), "times": each.times, "outcome": each.outcome} for each in comparisons],
    }
    return without_non_finite(plain(document, "comparison"))[0]
