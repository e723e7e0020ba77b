"""A picture of a recording's integrity: its channels with the rows that were found, and the steps of its clock."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.files import file_stem
from hapticeval.recordings.integrity.issue import Fault, Severity
from hapticeval.recordings.integrity.report import Integrity, Soundness
from hapticeval.recordings.recording import Recording, runs_of
from hapticeval.reports.canvas import figure, save_figure
from hapticeval.types import Array, BoolArray

INK, QUIET = "#222222", "#9a9a9a"
LINES = ("#0072b2", "#d55e00", "#009e73")
MARKS = {Severity.FAULT: "#cc3311", Severity.SUSPICIOUS: "#e69f00", Severity.NOTE: "#56b4e9"}
BUCKETS = 2000
"""Points a line: more than the picture has pixels. Each bucket keeps its extremes, so that no spike is lost."""

MOST = 6
"""Channels that are drawn."""


def write_integrity(
    directory: Path, recording: Recording, report: Integrity, soundness: Soundness, *, title: str, stem: str = ""
) -> list[Path]:
    """Draw a report into `directory` as SVG and PNG, named by `stem` or else by the title; the paths written.

    Raises `HapticevalError` where a file cannot be written.
    """
    stem = "integrity-" + (stem or file_stem(re.sub(r"[ :=,.]+", "-", title).strip("-")))
    from matplotlib.patches import Patch

    names = list(recording.channels)[:MOST]
    height = 1.1 + 1.15 * (len(names) + 1)
    with figure(7.2, height, settings={"axes.edgecolor": QUIET}, layout="constrained") as made:
        axes = made.subplots(len(names) + 1, 1, sharex=True, squeeze=False)[:, 0]
        valid = soundness.rows(len(recording))
        for axis, name in zip(axes, names, strict=False):
            _channel(axis, recording, name, valid)
            _marks(axis, [fault for fault in report.faults if fault.channel.partition(".")[0] == name])
        steps = 1e3 * np.diff(recording.nanoseconds) * 1e-9
        axes[-1].plot(recording.time[1:], steps, ".", color=INK, markersize=1.5, rasterized=True)
        axes[-1].set_ylabel("step (ms)")
        axes[-1].set_xlabel("time (s)")
        _marks(axes[-1], [fault for fault in report.faults if fault.channel == "time"])
        left = list(recording.channels)[MOST:]
        told = f"\n(not drawn: {', '.join(left)})" if left else ""
        axes[0].set_title(f"{title}: {'suspicious' if report.suspicious else 'nothing suspicious'}{told}", color=INK)
        there = {fault.severity for fault in report.faults if fault.time is not None}
        handles = [Patch(color=MARKS[each], alpha=0.5, label=str(each)) for each in MARKS if each in there]
        if not valid.all():
            handles.append(Patch(color=QUIET, alpha=0.25, label="left out"))
        if handles:
            made.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
        return save_figure(made, directory, stem, dpi=140)


def _channel(axis: Any, recording: Recording, name: str, valid: BoolArray) -> None:
    """A channel's columns over time, broken where rows are left out, which are shaded."""
    values = recording.channels[name]
    columns = values[:, None] if values.ndim == 1 else values
    world = recording.signals[name].frame == "world"
    for k in range(columns.shape[1]):
        time, thinned = _thinned(recording.time, np.where(valid, columns[:, k], np.nan))
        part = "xyz"[k] if world else str(k)
        axis.plot(time, thinned, color=LINES[k % len(LINES)], linewidth=0.8, label=part)
    if columns.shape[1] > 1:
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, handlelength=1.0, borderpad=0.2)
    axis.set_ylabel(f"{name}\n({recording.signals[name].unit})")
    for first, end in runs_of(~valid):
        axis.axvspan(recording.time[first], recording.time[end - 1], color=QUIET, alpha=0.25, linewidth=0)


def _marks(axis: Any, faults: Sequence[Fault]) -> None:
    """What was found, over its times: a line for a moment, a band for a stretch; at most a hundred."""
    for fault in faults[:100]:
        if fault.time is not None:
            axis.axvspan(*fault.time, color=MARKS[fault.severity], alpha=0.5, linewidth=1.2)


def _thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """At most two points a bucket: its lowest and its highest, in their order."""
    if values.size <= 2 * BUCKETS:
        return time, values
    size = -(-values.size // BUCKETS)
    keep = []
    for first in range(0, values.size, size):
        part = values[first : first + size]
        if np.all(np.isnan(part)):
            keep.append(first)
        else:
            keep += sorted({first + int(np.nanargmin(part)), first + int(np.nanargmax(part))})
    return time[keep], values[keep]
