"""The integrators' work-precision plot: error between samples against time, one panel per device."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hapticeval.reports.canvas import figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEM = "integrators"
LOOKS = {
    "euler": ("#999999", "o"),
    "semi-implicit-euler": ("#555555", "s"),
    "rk4": ("#56b4e9", "^"),
    "cash-karp": ("#d55e00", "D"),
    "dormand-prince": ("#0072b2", "v"),
    "verner": ("#cc79a7", "<"),
    "dop853": ("#009e73", "P"),
}
INK, MARK = "#1a1a1a", "#e69f00"
MS = 1e3


def write_precision(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """Draw a study of the integrators into `directory` as SVG and PNG, with its numbers as JSON; the paths written.

    `document` is that of `study_integrators`. Raises `HapticevalError` where a file cannot be written.
    """
    devices = document["devices"]
    width = 0.6 + 4.2 * len(devices)
    with figure(width, 4.6) as made:
        panels = made.subplots(1, len(devices), squeeze=False, sharey=True)[0]
        made.subplots_adjust(left=0.7 / width, right=0.985, top=0.92, bottom=0.235, wspace=0.05)
        for axes, device in zip(panels, devices, strict=True):
            _draw_panel(axes, device, document)
        panels[0].set_ylabel("relative error after a tick, largest")
        handles, labels = panels[0].get_legend_handles_labels()
        made.legend(handles, labels, loc="lower center", ncols=4, frameon=False, handlelength=1.6)
        return save_figure(made, directory, STEM, document=document)


def _draw_panel(axes: Axes, device: Mapping[str, Any], document: Mapping[str, Any]) -> None:
    default = document["default"]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(True, which="major", linewidth=0.4, color="#dddddd")
    axes.set_axisbelow(True)
    for method in device["methods"]:
        colour, marker = LOOKS[method["name"]]
        places = [(MS * point["seconds_per_second"], point["error"]) for point in method["points"]]
        times, errors = zip(*places, strict=True)
        label = f"{method['name']} (order {method['order']})"
        axes.plot(times, errors, color=colour, marker=marker, markersize=4, linewidth=0.9, label=label)
        if method["name"] == default["method"]:
            at = next(
                place
                for place, point in zip(places, method["points"], strict=True)
                if point["tolerance"] == default["tolerance"]
            )
            axes.plot(
                *at, "o", markersize=13, markerfacecolor="none", markeredgecolor=INK, markeredgewidth=1.4,
                label=f"what closed loops use: {method['name']}, tolerance {default['tolerance']:.0e}",
            )  # fmt: skip
    axes.axhline(document["target"], color=MARK, linewidth=1.0, zorder=1.5)
    axes.annotate(
        f"{document['target']:g}: what closed loops promise", (0.99, document["target"]),
        xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7,
    )  # fmt: skip
    axes.set_xlabel("computing time a simulated second (ms)")
    axes.set_title(f"{device['device']}, ticks of {MS * document['dt']:g} ms", fontsize=9)
