"""The integrators' work-precision plot: error between samples against time, a panel a device."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hapticeval.errors import HapticevalError
from hapticeval.files import replacing
from hapticeval.reports.figures import STYLE

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

    `document` is that of `hapticeval.devices.precision.study`. Raises `HapticevalError` where a file cannot be written.
    """
    paths = [directory / f"{STEM}.{kind}" for kind in ("svg", "png", "json")]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with replacing(paths[2]) as temporary:
            temporary.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        _draw(document, paths[:2])
    except OSError as error:
        raise HapticevalError(f"cannot write into {directory}", why=error.strerror or str(error)) from error
    return paths


def _draw(document: Mapping[str, Any], paths: Sequence[Path]) -> None:
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    devices = document["devices"]
    settings: Any = dict(STYLE)
    with rc_context(settings):
        figure = Figure(figsize=(0.6 + 4.2 * len(devices), 4.6), facecolor="white")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(devices), squeeze=False, sharey=True)[0]
        figure.subplots_adjust(left=0.7 / (0.6 + 4.2 * len(devices)), right=0.985, top=0.92, bottom=0.235, wspace=0.05)
        for axes, device in zip(panels, devices, strict=True):
            _draw_panel(axes, device, document)
        panels[0].set_ylabel("relative error after a tick, largest")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False, handlelength=1.6)
        for path in paths:
            metadata = {"Date": None} if path.suffix == ".svg" else None
            with replacing(path) as temporary:
                figure.savefig(temporary, format=path.suffix[1:], dpi=160, metadata=metadata)


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
