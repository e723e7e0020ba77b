"""Charts as plain data: a page's script draws them, and matplotlib where a chart leaves as a file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.reports.canvas import MARKERS, Look, colour_of
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, kw_only=True)
class Axis:
    """An axis: its label with the unit, whether it is logarithmic, and what of it is in view.

    - `zero`: zero is in view; `tight`: there is no margin; `range`: these ends
    - `names`: rows 0, 1, ... have names in place of numbers
    """

    label: str
    log: bool = False
    zero: bool = False
    tight: bool = False
    range: tuple[float, float] | None = None
    names: Sequence[str] = ()


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A line through points (n,), broken at NaN, in the colour of a role; with a `marker` one stands at each point.

    - `hollow` markers are not filled; without a `line` there are only markers
    - `steps` go across and then up; a curve on the `right` belongs to the second vertical axis
    """

    x: Sequence[float] | Array
    y: Sequence[float] | Array
    role: str
    label: str = ""
    dash: tuple[float, ...] = ()
    width: float = 1.5
    marker: str = ""
    size: float = 6.0
    hollow: bool = False
    line: bool = True
    steps: bool = False
    right: bool = False
    faint: bool = False


@dataclass(frozen=True, kw_only=True)
class Rule:
    """A straight line across a chart at one `x` or one `y`, and what stands at it."""

    role: str
    x: float | None = None
    y: float | None = None
    text: str = ""
    dash: tuple[float, ...] = ()
    width: float = 1.0


@dataclass(frozen=True)
class Note:
    """Words at a point, which are left out where they would cover others."""

    x: float
    y: float
    text: str


@dataclass(frozen=True, kw_only=True)
class Chart:
    """Curves on two axes or three. `shades` are stretches of x; `height` is in pixels of a page."""

    title: str
    x: Axis
    y: Axis
    curves: Sequence[Curve]
    right: Axis | None = None
    rules: Sequence[Rule] = ()
    shades: Sequence[tuple[float, float]] = ()
    notes: Sequence[Note] = ()
    height: int = 280


def look_style(look: Look) -> dict[str, Any]:
    """Return colour, dashes and marker of a renderer as arguments of a `Curve`."""
    return {"role": look.role, "dash": look.dash, "marker": look.marker}


def charts_data(charts: Iterable[Chart]) -> str:
    """Return charts as JSON for the script of a page, `assets/draw.js`."""
    return script_text([_plain(chart) for chart in charts])


def script_text(document: Any) -> str:
    """Return a document as JSON for a script element, which "<" could end."""
    return json.dumps(document, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _plain(value: Any) -> Any:
    """Return a part of a chart as JSON has it: to six digits, without what is as usual; NaN is null."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, Axis | Curve | Rule | Note | Chart):
        entries = {field.name: getattr(value, field.name) for field in fields(value)}
        usual = {field.name: field.default for field in fields(value)}
        shape = {"shape": MARKERS[value.marker]} if isinstance(value, Curve) and value.marker else {}
        return {name: _plain(entry) for name, entry in entries.items() if entry is not usual[name]} | shape
    if isinstance(value, list | tuple | range):
        return [_plain(entry) for entry in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def draw_chart(axes: Axes, chart: Chart, *, legend: bool = True) -> None:
    """Draw a chart by matplotlib, without its notes, and with a `legend` of what has a label."""
    axes.set(xlabel=chart.x.label, ylabel=chart.y.label)
    axes.grid(True, which="major")
    second = axes.twinx() if chart.right is not None else None
    if second is not None and chart.right is not None:
        second.set_ylabel(chart.right.label)
        second.spines["right"].set_visible(True)
    for begin, end in chart.shades:
        axes.axvspan(begin, end, color=colour_of("model"), zorder=0)
    for curve in chart.curves:
        _draw_curve(second if curve.right and second is not None else axes, curve)
    for rule in chart.rules:
        style: dict[str, Any] = {"color": colour_of(rule.role), "linewidth": rule.width, "zorder": 1.5}
        style["linestyle"] = (0, rule.dash) if rule.dash else "-"
        if rule.x is not None:
            axes.axvline(rule.x, **style)
        if rule.y is not None:
            axes.axhline(rule.y, **style)
    for part, axis, name in ((axes, chart.x, "x"), (axes, chart.y, "y"), (second, chart.right, "y")):
        if part is not None and axis is not None:
            _set_axis(part, axis, name)
    handles = [part.get_legend_handles_labels() for part in (axes, second) if part is not None]
    lines: list[Any] = [line for pair in handles for line in pair[0]]
    labels = [label for pair in handles for label in pair[1]]
    if lines and legend:
        axes.legend(lines, labels, loc="upper right")


def _draw_curve(axes: Axes, curve: Curve) -> None:
    colour = colour_of(curve.role)
    axes.plot(
        curve.x, curve.y, color=colour, alpha=0.6 if curve.faint else 1.0, label=curve.label or "_",
        linestyle=("-" if not curve.dash else (0, curve.dash)) if curve.line else "none", linewidth=0.75 * curve.width,
        marker=curve.marker or None, markersize=0.75 * curve.size, markerfacecolor="white" if curve.hollow else colour,
        drawstyle="steps-post" if curve.steps else "default",
    )  # fmt: skip


def _set_axis(axes: Axes, axis: Axis, name: str) -> None:
    """Set scale and view of the axis of that name, x or y."""
    if axis.log:
        axes.set(**{f"{name}scale": "log"})
    if axis.range is not None:
        axes.set(**{f"{name}lim": axis.range})
    elif axis.tight:
        axes.margins(x=0.0 if name == "x" else None, y=0.0 if name == "y" else None)
    elif axis.zero:
        low, high = getattr(axes, f"get_{name}lim")()
        axes.set(**{f"{name}lim": (min(low, 0.0), max(high, 0.0))})
