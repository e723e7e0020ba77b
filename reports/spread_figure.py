"""What recordings show: stretches that are not sound over time, and forces of several runs with the repeats' spread.

The forces are over a common abscissa, as in Figures 6.5 and 6.9.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.files import file_stem, plain, without_non_finite
from hapticeval.recordings.compare.align import PASS_COLUMNS, Aligned
from hapticeval.recordings.compare.spread import Band, Comparison
from hapticeval.recordings.compare.spread import bands as bands_of
from hapticeval.recordings.integrity.issue import Issue, Severity
from hapticeval.recordings.integrity.report import Integrity, Soundness
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.reports.canvas import INK, figure, save_figure
from hapticeval.types import BoolArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes


LEFT_OUT_COLOUR = "#9a9a9a"
"""Of rows that are no measurement, or not to be trusted."""

LINE_COLOURS = ("#0072b2", "#d55e00", "#009e73")
"""Of a channel's columns, in turns."""

ISSUE_COLOURS = {Severity.FAULT: "#cc3311", Severity.SUSPICIOUS: "#e69f00", Severity.NOTE: "#56b4e9"}
"""Of issues, by how grave they are."""

MOST_CHANNELS = 6
"""Channels that are drawn."""
MOST_ISSUES = 100
"""Findings that are drawn of each channel."""


def write_integrity(
    directory: Path, recording: Recording, report: Integrity, soundness: Soundness, *, title: str, stem: str = ""
) -> list[Path]:
    """Draw a report into `directory` as SVG and PNG, named by `stem` or else by the title; return the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    from matplotlib.patches import Patch

    stem = "integrity-" + (stem or file_stem(re.sub(r"[ :=,.]+", "-", title).strip("-")))
    names, left = list(recording.channels)[:MOST_CHANNELS], list(recording.channels)[MOST_CHANNELS:]
    with figure(7.2, 2.25 + 1.15 * len(names), layout="constrained") as fig:
        *channels, clock = panels = fig.subplots(len(names) + 1, 1, sharex=True, squeeze=False)[:, 0]
        valid = soundness.rows(len(recording))
        for axes, name in zip(channels, names, strict=True):
            _draw_channel(axes, recording, name, valid)
            _draw_issues(axes, [issue for issue in report.issues if issue.channel.partition(".")[0] == name])
        # ms; from whole nanoseconds, as differences of seconds would show rounding.
        steps = 1e3 * np.diff(recording.nanoseconds) * 1e-9
        clock.plot(recording.time[1:], steps, ".", color=INK, markersize=1.5, rasterized=True)
        clock.set(ylabel="step (ms)", xlabel="time (s)")
        _draw_issues(clock, [issue for issue in report.issues if issue.channel == "time"])
        not_drawn = f"\n(not drawn: {', '.join(left)})" if left else ""
        panels[0].set_title(
            f"{title}: {'suspicious' if report.suspicious else 'nothing suspicious'}{not_drawn}", color=INK
        )
        severities = {issue.severity for issue in report.issues if issue.time is not None}
        handles = [
            Patch(color=ISSUE_COLOURS[severity], alpha=0.5, label=str(severity))
            for severity in ISSUE_COLOURS
            if severity in severities
        ]
        if not valid.all():
            handles.append(Patch(color=LEFT_OUT_COLOUR, alpha=0.25, label="left out"))
        if handles:
            fig.legend(handles=handles, loc="outside lower center", ncols=4)
        return save_figure(fig, directory, stem, dpi=140)


def _draw_channel(axes: Axes, recording: Recording, name: str, valid: BoolArray) -> None:
    """A channel's columns over time, broken where rows are left out, which are shaded."""
    columns = recording.channels[name].reshape(len(recording), -1).T
    signal = recording.signals[name]
    for k, column in enumerate(columns):
        label = "xyz"[k] if signal.frame == "world" else str(k)
        # NaN breaks the line where a row is left out.
        valid_values = np.where(valid, column, np.nan)
        axes.plot(recording.time, valid_values, color=LINE_COLOURS[k % len(LINE_COLOURS)], linewidth=0.8, label=label)
    if len(columns) > 1:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.0, borderpad=0.2)
    axes.set_ylabel(f"{name}\n({signal.unit})")
    for first, end in runs_of(~valid):
        axes.axvspan(recording.time[first], recording.time[end - 1], color=LEFT_OUT_COLOUR, alpha=0.25, linewidth=0)


def _draw_issues(axes: Axes, issues: Sequence[Issue]) -> None:
    """What was found, over its times: a line for a moment, a band for a stretch."""
    # An issue about the whole channel has no time, and stands in the text only.
    for issue in issues[:MOST_ISSUES]:
        if issue.time is not None:
            axes.axvspan(*issue.time, color=ISSUE_COLOURS[issue.severity], alpha=0.5, linewidth=1.2)


RENDERER_COLOURS = ("#0067b1", "#c4501b", "#2f7d32", "#7b3f99", "#8a6d00", "#00757a")
"""One colour for each renderer, in turns."""

SHOWN_UNITS = {"rad": (180.0 / math.pi, "degrees"), "m": (1e3, "mm"), "N": (1.0, "N")}
"""SI unit -> how many of the unit that is shown make one of it, and the unit that is shown."""

COLUMN_TITLES = {
    "direction": "direction of the force",
    "magnitude": "size of the force",
    "depth": "distance of IHIP and HIP",
}
"""Columns that are compared, in words."""

ABSCISSA_WORDS = {"angle": "polar angle of the HIP", "arc": "arc length along the model"}
"""What runs are aligned by, in words."""

DIRECTION_WORDS = {1: "forward", -1: "backward"}
"""The sense in which the abscissa grows along a pass, in words."""

SETTINGS = {"axes.titlesize": 9.0, "axes.titlelocation": "left"}
"""matplotlib's rcParams of this figure."""


def write_spread(directory: Path, aligned: Aligned, comparisons: Sequence[Comparison]) -> list[Path]:
    """Write comparison.svg, .png, .md and .json into `directory`; return the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    bands = bands_of(aligned)
    # In a fixed order; a signal that was not recorded has no panel.
    columns = [name for name in COLUMN_TITLES if any(band.column == name for band in bands)]
    rows = (len(columns) + 1) // 2
    height = 0.9 + 2.6 * rows
    with figure(9.0, height, settings=SETTINGS) as fig:
        # Two panels a row; the last one may stay empty.
        panels = list(fig.subplots(rows, 2, squeeze=False).flat)
        for axes, column in zip(panels, columns, strict=False):
            _draw_column(axes, aligned, [band for band in bands if band.column == column])
        for axes in panels[len(columns) :]:
            axes.set_visible(False)
        fig.legend(*panels[0].get_legend_handles_labels(), loc="upper left", ncols=3)
        fig.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.35 / height))
        document = _document(aligned, bands, comparisons)
        return save_figure(fig, directory, "comparison", text=table(aligned, comparisons), document=document)


def _draw_column(axes: Axes, aligned: Aligned, bands: Sequence[Band]) -> None:
    """Draw one signal of all renderers: the median of the repeats, and a band from the lowest to the highest."""
    column = bands[0].column
    # From SI to what is shown, as rad to degrees.
    scale, unit = _shown_unit(PASS_COLUMNS[column][0])
    across, along = _shown_unit(aligned.unit)
    names = list(dict.fromkeys(band.renderer for band in bands))
    both_directions = len({band.direction for band in bands}) > 1
    for band in bands:
        order = names.index(band.renderer)
        colour = RENDERER_COLOURS[order % len(RENDERER_COLOURS)]
        width = 0.9 + 1.1 * (len(names) - 1 - order) / max(len(names) - 1, 1)  # curves that coincide are all seen
        direction = f", {DIRECTION_WORDS[band.direction]}" if both_directions else ""
        label = f"{band.renderer}{direction} ({int(band.count.max())} repeats)"
        low, high, median = (
            # Where no repeat has a value there is no band.
            np.where(band.count > 0, scale * curve, np.nan)
            for curve in (band.low, band.high, band.median)
        )
        axes.fill_between(across * aligned.grid, low, high, color=colour, alpha=0.18, linewidth=0.0)
        style = "-" if band.direction > 0 else "--"
        axes.plot(across * aligned.grid, median, color=colour, linewidth=width, label=label, linestyle=style)
    axes.set(title=COLUMN_TITLES[column], xlabel=f"{ABSCISSA_WORDS.get(aligned.by, aligned.by)} ({along})", ylabel=unit)
    axes.grid(True)


def _shown_unit(unit: str) -> tuple[float, str]:
    """The factor to the unit that is shown, and that unit."""
    return SHOWN_UNITS.get(unit, (1.0, unit))


def table(aligned: Aligned, comparisons: Sequence[Comparison]) -> str:
    """Describe how renderers differ, and every pass that was aligned, as markdown."""
    head = ("renderer", "run", "direction", "lap", "from (s)", "to (s)", "coverage")
    rows = []
    for aligned_pass in aligned.passes:
        run = aligned.runs[aligned_pass.run]
        when = (f"{aligned_pass.start:.4g}", f"{aligned_pass.end:.4g}", f"{100.0 * aligned_pass.coverage:.3g} %")
        rows.append(
            (run.renderer, run.label, DIRECTION_WORDS[aligned_pass.direction], str(aligned_pass.lap + 1), *when)
        )
    return _markdown(aligned, comparisons, head, rows)


def summary(aligned: Aligned, comparisons: Sequence[Comparison]) -> str:
    """Describe how renderers differ, and for each run what share of the way its passes cover, as markdown."""
    rows = []
    for number, run in enumerate(aligned.runs):
        cells = []
        for direction in DIRECTION_WORDS:
            # Where on the grid each pass has values; a place counts as covered by any of them.
            masks = [
                aligned_pass.mask
                for aligned_pass in aligned.passes
                if aligned_pass.run == number and aligned_pass.direction == direction
            ]
            share = f"{100.0 * float(np.mean(np.any(masks, axis=0))):.3g} %" if masks else ""
            cells.append(f"{share} in {len(masks)} passes" if len(masks) > 1 else share)
        rows.append((run.renderer, run.label, *cells))
    return _markdown(aligned, comparisons, ("renderer", "run", "covered forward", "covered backward"), rows)


def _markdown(
    aligned: Aligned, comparisons: Sequence[Comparison], head: Sequence[str], rows: Sequence[Sequence[str]]
) -> str:
    """Return the statements on renderers, and below them a table."""
    statements = list(_statements(aligned, comparisons)) or [
        "Nothing is compared: that takes two renderers with repeats of each."
    ]
    first, *lines = (f"| {' | '.join(row)} |" for row in (head, *rows))
    return "\n".join([*statements, "", first, f"|{'---|' * len(head)}", *lines])


def _statements(aligned: Aligned, comparisons: Sequence[Comparison]) -> Iterator[str]:
    """One line for each two renderers, direction and column."""
    across, along = _shown_unit(aligned.unit)
    for comparison in comparisons:
        scale, unit = _shown_unit(PASS_COLUMNS[comparison.column][0])
        size = f"{scale * comparison.difference:.3g} {unit}"
        tested = f"p = {comparison.p:.2g}, {comparison.repeats[0]} and {comparison.repeats[1]} repeats"
        spreads = f"which is {comparison.times:.3g} times the repeat spread of {scale * comparison.spread:.3g} {unit}"
        # No ratio to a spread of zero.
        if comparison.spread == 0.0:
            spreads = "where repeats do not differ at all"
        if comparison.outcome == "too little in common":
            finding = f"too little in common: {100.0 * comparison.common:.3g} % of the way"
        elif comparison.outcome == "the same to rounding":
            finding = (
                f"the same to rounding: {scale * comparison.largest:.2g} {unit} apart at most, and no two repeats by "
                "more than a few operations in single precision cost; not tested"
            )
        elif comparison.outcome == "differs":
            finding = f"differs by {size}, {spreads} ({tested}); most at {across * comparison.worst:.4g} {along}"
        # No more apart than repeats of one renderer: no difference is shown.
        elif comparison.outcome == "within the spread":
            finding = f"within the spread: {size} apart, repeats {scale * comparison.spread:.3g} {unit} ({tested})"
        else:
            finding = (
                f"too few repeats: {size} apart, {spreads}, "
                f"and these repeats cannot give a p below {comparison.smallest_p:.2g} ({tested}); "
                f"{_repeats_needed(comparison)}"
            )
        what = f"{DIRECTION_WORDS[comparison.direction]}, {COLUMN_TITLES[comparison.column]}"
        yield f"- {comparison.first} and {comparison.second}, {what}: {finding}"


def _repeats_needed(comparison: Comparison) -> str:
    """How many repeats were given, and how many more of which it takes."""
    repeats_words = (
        f"given are {comparison.repeats[0]} of {comparison.first} and {comparison.repeats[1]} of {comparison.second}"
    )
    # The correction for many comparisons leaves no number of repeats that is enough.
    if comparison.needed is None:
        return f"{repeats_words}, and among so many renderers no number is enough: compare fewer at once"
    missing_repeats = [
        f"{needed_count - given_count} more of {renderer}"
        for renderer, given_count, needed_count in zip(
            (comparison.first, comparison.second), comparison.repeats, comparison.needed, strict=True
        )
        if needed_count > given_count
    ]
    totals = f"{comparison.needed[0]} and {comparison.needed[1]}"
    return f"{repeats_words}; it takes {' and '.join(missing_repeats)} at the least ({totals})"


def _document(aligned: Aligned, bands: Sequence[Band], comparisons: Sequence[Comparison]) -> Any:
    """Return everything that is drawn as plain data for JSON, without numbers that are not finite."""
    passes = [
        {
            "renderer": aligned.runs[aligned_pass.run].renderer,
            "run": aligned.runs[aligned_pass.run].label,
            "direction": aligned_pass.direction,
            "lap": aligned_pass.lap,
            "start_s": aligned_pass.start,
            "end_s": aligned_pass.end,
            "coverage": aligned_pass.coverage,
        }
        for aligned_pass in aligned.passes
    ]
    document = {
        "by": aligned.by,
        "unit": aligned.unit,
        "grid": aligned.grid,
        "passes": passes,
        "bands": [asdict(band) for band in bands],
        "comparisons": [
            {**asdict(comparison), "times": comparison.times, "outcome": comparison.outcome}
            for comparison in comparisons
        ],
    }
    return without_non_finite(plain(document, "comparison"))[0]
