"""Two recordings laid over each other: the path of the hand, force, contact, and how far they are apart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hapticeval.recordings.overlay import Overlay
from hapticeval.reports.canvas import MM, figure, save_figure
from hapticeval.reports.chart import Axis, Chart, Curve, Rule, draw_chart
from hapticeval.types import Array

STYLES = (("hip", ()), ("ihip", (4, 2)))
"""Role and dashes of the first run and of the second."""


def overlay_charts(laid: Overlay, titles: Sequence[str]) -> list[Chart]:
    """Return the charts of an overlay over time (s) or way (mm): paths, as they are in the plane, force, contact."""
    scale = MM if laid.on_surface else 1.0
    x = Axis(label="way along the surface (mm)" if laid.on_surface else "time (s)", tight=True)
    along = scale * laid.along

    def both(first: Array, second: Array, label: str, over: Sequence[Array] = (along, along), axis: Axis = x) -> Chart:
        """Draw two channels (n,) each, mm or N, in one chart."""
        curves = [
            Curve(x=place, y=values, role=role, dash=dash, label=title)
            for place, values, title, (role, dash) in zip(over, (first, second), titles, STYLES, strict=True)
        ]
        return Chart(title=label, x=axis, y=Axis(label=label), curves=curves)

    charts = []
    for name, gap in laid.gaps.items():
        first, second = (run[name] * (1.0 if name == "force" else MM) for run in laid.runs)
        if name == "force":
            charts.append(both(np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1), "force (N)"))
        elif first.shape[1] == 2:
            across = Axis(label=f"{name}, x (mm)")
            charts.append(both(first[:, 1], second[:, 1], f"{name}, y (mm)", (first[:, 0], second[:, 0]), across))
        else:
            axes = zip(first.T, second.T, "xyz", strict=False)
            charts += [both(one, other, f"{name}, {axis} (mm)") for one, other, axis in axes]
        label = f"{name} apart ({'N' if name == 'force' else 'mm'})"
        apart = Curve(x=along, y=np.linalg.norm(second - first, axis=1), role="ink")
        largest = Rule(x=scale * gap.place, role="mark", dash=(4, 2))
        charts.append(Chart(title=label, x=x, y=Axis(label=label, zero=True), curves=[apart], rules=[largest]))
    if laid.touches is not None:
        first, second = (np.where(laid.rows, touches, np.nan) for touches in laid.touches)
        charts.append(both(first, second, "contact"))
    return charts


def write_overlay(file: Path, laid: Overlay, titles: Sequence[str]) -> list[Path]:
    """Draw an overlay of two runs, called `titles`, into a file: SVG, PDF or PNG by its ending. Return its path."""
    charts = overlay_charts(laid, titles)
    with figure(7.2, 1.6 * len(charts) + 0.4, layout="constrained") as fig:
        for axes, chart in zip(fig.subplots(len(charts), 1, squeeze=False)[:, 0], charts, strict=True):
            draw_chart(axes, chart, legend=chart is charts[0])
        return save_figure(fig, file.parent, file.stem, kinds=(file.suffix[1:],))
