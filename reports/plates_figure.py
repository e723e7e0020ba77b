"""The thinnest plate that renderers hold, over speed and push, as a picture: a panel for a renderer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hapticeval.files import file_stem
from hapticeval.reports.canvas import CURVES, MARKERS, THEME, figure, save_figure


def write_plates(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """Draw the document of `hapticeval study plates` into `directory` as SVG and PNG, with the numbers as JSON.

    Where no thickness is held the mark is a cross over the thickest plate. Return the paths written. Raises
    `HapticevalError` where a file cannot be written.
    """
    panels = document["renderers"]
    thickest = 1e3 * document["thickest"]
    across = min(len(panels), 3)
    down = -(-len(panels) // across)
    with figure(3.4 * across + 0.4, 3.2 * down, layout="constrained") as fig:
        grid = fig.subplots(down, across, squeeze=False, sharex=True, sharey=True)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes, (name, borders) in zip(grid.flat, panels.items(), strict=False):
            pushes = dict.fromkeys(border["push"] for border in borders)
            for role, marker, push in zip(CURVES, MARKERS, pushes, strict=False):
                of_push = [border for border in borders if border["push"] == push]
                with_thickness = [border for border in of_push if border["thinnest"] is not None]
                lost_speeds = [border["speed"] for border in of_push if border["thinnest"] is None]
                thicknesses = [1e3 * border["thinnest"] for border in with_thickness]
                look: dict[str, Any] = {"color": THEME[role]}
                speeds = [border["speed"] for border in with_thickness]
                axes.plot(speeds, thicknesses, marker=marker, label=f"{push:g} N", **look)
                axes.plot(lost_speeds, [1.3 * thickest] * len(lost_speeds), "x", **look)
            axes.set(xscale="log", yscale="log", title=name.rpartition(":")[2])
            axes.set_ylim(1e3 * document["thinnest"] / 1.2, 1.5 * thickest)
            axes.axhline(thickest, color=THEME["quiet"], linewidth=0.8, linestyle=":")
        for axes in grid[-1]:
            axes.set_xlabel("speed of the hand (m/s)")
        for axes in grid[:, 0]:
            axes.set_ylabel("thinnest plate held (mm)\ncross: none up to the dotted line")
        grid[0, -1].legend(title="push", loc="lower right")
        return save_figure(fig, directory, file_stem("plates-" + "-".join(panels)), document=document)
