"""What an examination shows of a recording: each channel over time, what was found there, and what was left out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.files import file_stem
from hapticeval.recordings.integrity.issue import Issue, Severity
from hapticeval.recordings.integrity.report import Integrity, Soundness
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.reports.canvas import INK, figure, save_figure
from hapticeval.types import BoolArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes


LEFT_OUT_COLOUR = "#9a9a9a"
"""Of rows that are not a measurement, or not to be trusted."""

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
