"""The integrators' work-precision plot: error between samples against time, one panel per device."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hapticeval.reports.canvas import INK, figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEM = "integrators"
"""The files' name."""

LOOKS = {
    "euler": ("#999999", "o"),
    "semi-implicit-euler": ("#555555", "s"),
    "rk4": ("#56b4e9", "^"),
    "cash-karp": ("#d55e00", "D"),
    "dormand-prince": ("#0072b2", "v"),
    "verner": ("#cc79a7", "<"),
    "dop853": ("#009e73", "P"),
}
"""Colour and marker by integration method."""

TARGET_COLOUR = "#e69f00"
"""Of the line of the error that closed loops promise."""

MILLISECONDS = 1e3
"""Milliseconds in a second."""


def write_precision(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """Draw a study of the integrators into `directory` as SVG and PNG, with its numbers as JSON.

    `document` is that of `study_integrators`. Return the paths written. Raises `HapticevalError` where a file cannot
    be written.
    """
    devices = document["devices"]
    width = 0.6 + 4.2 * len(devices)
    with figure(width, 4.6, settings={"grid.linewidth": 0.4}) as fig:
        panels = fig.subplots(1, len(devices), squeeze=False, sharey=True)[0]
        fig.subplots_adjust(left=0.7 / width, right=0.985, top=0.92, bottom=0.235, wspace=0.05)
        for axes, device in zip(panels, devices, strict=True):
            _draw_panel(axes, device, document)
        panels[0].set_ylabel("relative error after a tick, largest")
        handles, labels = panels[0].get_legend_handles_labels()
        fig.legend(handles, labels, loc="lower center", ncols=4, handlelength=1.6)
        return save_figure(fig, directory, STEM, document=document)


def _draw_panel(axes: Axes, device: Mapping[str, Any], document: Mapping[str, Any]) -> None:
    """Draw one device: each method's error against its computing time, and what closed loops use."""
    default = document["default"]
    axes.set(xscale="log", yscale="log", xlabel="computing time a simulated second (ms)")
    axes.grid(True, which="major")
    for method in device["methods"]:
        name, (colour, marker) = method["name"], LOOKS[method["name"]]
        # ms of computing for each simulated second, and the relative error.
        places = [(MILLISECONDS * point["seconds_per_second"], point["error"]) for point in method["points"]]
        style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 4, "linewidth": 0.9}
        axes.plot(*zip(*places, strict=True), label=f"{name} (order {method['order']})", **style)
        if name == default["method"]:
            # The place of the tolerance that closed loops use among those that were measured.
            used = [point["tolerance"] for point in method["points"]].index(default["tolerance"])
            axes.plot(
                *places[used], "o", markersize=13, markerfacecolor="none", markeredgecolor=INK,
                markeredgewidth=1.4, label=f"what closed loops use: {name}, tolerance {default['tolerance']:.0e}",
            )  # fmt: skip
    target = document["target"]
    # The relative error that closed loops promise.
    axes.axhline(target, color=TARGET_COLOUR, linewidth=1.0, zorder=1.5)
    axes.annotate(
        f"{target:g}: what closed loops promise", (0.99, target), xycoords=("axes fraction", "data"), ha="right",
        va="bottom", fontsize=7,
    )  # fmt: skip
    axes.set_title(f"{device['device']}, ticks of {MILLISECONDS * document['dt']:g} ms", fontsize=9)
