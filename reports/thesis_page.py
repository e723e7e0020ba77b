"""The page of what the thesis shows: its items in order, each with pictures, tables, and how it compares.

Pictures are of runs that were made: paths on a model, and quantities over time or angle. `PICTURES` has them by the
names that items of `study/thesis/items.toml` use.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from hapticeval.files import write_text
from hapticeval.geometry.model import Model
from hapticeval.recordings.recording import Recording
from hapticeval.reports.atlas_figure import atlas_charts
from hapticeval.reports.canvas import MM, figure, looks_of, save_figure
from hapticeval.reports.case_data import surface_motion
from hapticeval.reports.case_page import asset
from hapticeval.reports.chart import Axis, Chart, Curve, draw_chart, look_style
from hapticeval.reports.run_figure import RAYS
from hapticeval.reports.templates import environment
from hapticeval.study.thesis.printed import Part, chapter_of, slug_of
from hapticeval.types import Array

# ruff: noqa: ARG001 - every picture has these arguments

NEWTON = 1.0
"""Millimetres of a force of 1 N on a model: at 1 kN/m the spring's force then ends at the IHIP."""

Picture: TypeAlias = Callable[[Mapping[str, Recording], Model], Chart]
"""Draws what renderers did on a case, by their names."""

Y1, Y2 = Axis(label="y₁ (mm)"), Axis(label="y₂ (mm)")
"""Axes of a chart of places, which is drawn in one scale."""


def _line(points: Array, **style: Any) -> Curve:
    return Curve(x=MM * points[:, 0], y=MM * points[:, 1], **style)


def _surface(model: Model, hips: Array) -> Curve:
    """Return the model's outline; of an open one the part that the hands were over."""
    if model.boundary.closed:
        points = model.boundary.points(max(2000, 8 * len(model.boundary.corners)))
        return _line(np.vstack([points, points[:1]]), role="ink", width=1.0)
    return _line(model.boundary.closest_point(hips[np.argsort(hips[:, 0])]).foot, role="ink", width=1.0)


def _on_model(*, forces: bool) -> Picture:
    """Return a picture of the first run's HIP on the model, with lines to the IHIP, or with the force."""

    def picture(recordings: Mapping[str, Recording], model: Model) -> Chart:
        ((name, recording),) = recordings.items()
        hip, rows = recording.hip, np.flatnonzero(recording.contact)
        rows = rows[:: max(len(rows) // RAYS, 1)]
        ends = hip + recording.force * NEWTON / MM if forces else recording.ihip
        # NaN between the lines.
        rays = np.stack([hip[rows], ends[rows], np.full_like(hip[rows], np.nan)], axis=1).reshape(-1, 2)
        role, label = ("ihip", "force") if forces else ("ray", "")
        curves = [_surface(model, hip), _line(rays, role=role, width=1.0, label=label)]
        curves.append(_line(hip, role="hip", dash=(4, 2), label="HIP"))
        if not forces:
            curves.append(_line(ends[rows], role="ihip", marker="o", size=4.0, line=False, label="IHIP"))
        return Chart(title=name, x=Y1, y=Y2, curves=curves)

    return picture


def _styles(recordings: Mapping[str, Recording]) -> list[tuple[dict[str, Any], Recording]]:
    """Return the look of each run's curve: earlier ones are wider, so that all are seen where they coincide."""
    return [
        (look_style(look) | {"marker": "", "label": name, "width": 1.2 + 0.8 * (len(recordings) - k)}, recordings[name])
        for k, (name, look) in enumerate(looks_of(recordings).items())
    ]


def _hands(recordings: Mapping[str, Recording], model: Model) -> Chart:
    """Return where the hands went: that is what differs where a surface holds them from both sides."""
    hips = np.vstack([recording.hip for recording in recordings.values()])
    curves = [_line(recording.hip[::4], **style) for style, recording in _styles(recordings)]
    return Chart(title="positions", x=Y1, y=Y2, curves=[_surface(model, hips), *curves])


def _over(title: str, label: str, value: Callable[[Recording, Model], Array], *, angle: bool = False) -> Picture:
    """Return a picture of one quantity of each run over time, or over the HIP's polar angle where they touch."""

    def picture(recordings: Mapping[str, Recording], model: Model) -> Chart:
        curves = []
        for style, recording in _styles(recordings):
            rows = recording.contact if angle else np.ones(len(recording), dtype=np.bool_)
            across = np.degrees(np.unwrap(np.arctan2(*recording.hip.T[1::-1]))) if angle else recording.time
            curves.append(Curve(x=across[rows], y=value(recording, model)[rows], **style))
        x = Axis(label="HIP's polar angle (°)" if angle else "time (s)", tight=True)
        return Chart(title=title, x=x, y=Axis(label=label), curves=curves)

    return picture


def _force(recordings: Mapping[str, Recording], model: Model) -> Chart:
    """Return the components of the first run's force over time."""
    ((name, recording),) = recordings.items()
    curves = [
        Curve(x=recording.time, y=column, role=role, label=f"F{'₁₂₃'[k]}", dash=(6, 2) if k else ())
        for k, (column, role) in enumerate(zip(recording.force.T, ("hip", "ihip", "one"), strict=False))
    ]
    return Chart(title=name, x=Axis(label="time (s)", tight=True), y=Axis(label="force (N)", zero=True), curves=curves)


def _speed(recording: Recording, model: Model) -> Array:
    """Return the velocity along the surface (n,), m/s, positive where it is largest."""
    along = surface_motion(recording, model)[1]
    return np.asarray(along * np.sign(along[np.argmax(np.abs(along))]))


def _distance(recording: Recording, model: Model) -> Array:
    return MM * surface_motion(recording, model)[0]


def _direction(recording: Recording, model: Model) -> Array:
    return np.asarray(np.degrees(np.arctan2(*recording.force.T[1::-1])))


def _size(recording: Recording, model: Model) -> Array:
    return np.asarray(np.linalg.norm(recording.force, axis=1))


def _chart_places(recordings: Mapping[str, Recording], model: Model) -> Chart:
    """Return where on a sphere each chart is at work, in the plane of the run, and where it switched."""
    ((name, recording),) = recordings.items()
    side, chart = recording.ihip[:, [0, 2]], recording.channels["chart"]
    curves = [
        _line(np.where((chart == number)[:, None], side, np.nan), role=role, width=3.0, label=f"chart {number}")
        for number, role in ((1, "hip"), (2, "ihip"))
    ]
    switches = side[1:][np.diff(chart) != 0.0]
    curves.append(_line(switches, role="ink", marker="o", line=False, label="switches"))
    return Chart(title=name, x=Y1, y=Axis(label="y₃ (mm)"), curves=curves)


def _atlas(number: int) -> Picture:
    return lambda recordings, model: atlas_charts(next(iter(recordings.values())), model)[number]


PICTURES: Mapping[str, Picture] = MappingProxyType(
    {
        "paths": _on_model(forces=False),
        "forces": _on_model(forces=True),
        "hands": _hands,
        "force": _force,
        "distance": _over("distance from the surface", "distance (mm)", _distance),
        "along": _over("velocity along the surface", "velocity (m/s)", _speed),
        "direction": _over("direction of the force", "direction (°)", _direction, angle=True),
        "size": _over("size of the force", "force (N)", _size, angle=True),
        "chart places": _chart_places,
        **{name: _atlas(k) for k, name in enumerate(("transversal", "chart 1", "chart 2", "torques"))},
    }
)
"""Pictures by name."""


def outline_chart(title: str, lines: Sequence[Array]) -> Chart:
    """Return a chart of closed lines (n, 2), m: the first is the model's, the others are thin."""
    styles = [{"role": "ink", "width": 1.6}, *[{"role": "hip", "width": 1.0}] * (len(lines) - 1)]
    curves = [_line(np.vstack([line, line[:1]]), **style) for line, style in zip(lines, styles, strict=True)]
    return Chart(title=title, x=Y1, y=Y2, curves=curves)


def grid_chart(points: Array, surface: Array) -> Chart:
    """Return a chart of the places (n, 2), m, that encoders know, with a surface (k, 2), m, among them."""
    dots = _line(points, role="hip", marker="o", size=3.0, line=False, label="places that encoders know")
    return Chart(title="", x=Y1, y=Y2, curves=[dots, _line(surface, role="ink", label="surface")])


def write_chart(directory: Path, stem: str, chart: Chart) -> Path:
    """Draw a chart into `directory` as SVG; return the path. Raises `HapticevalError` where it cannot be written."""
    places = chart.x is Y1
    with figure(3.6, 3.4 if places else 2.5, layout="constrained") as fig:
        axes = fig.add_subplot()
        draw_chart(axes, chart, legend=False)
        if places:
            axes.set_aspect("equal", adjustable="datalim")
        axes.set_title(chart.title, fontsize=8.5, loc="left")
        handles = [handle for part in fig.axes for handle in part.get_legend_handles_labels()[0]]
        if handles:
            fig.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=6.5, handlelength=2.4)
        return save_figure(fig, directory, stem, kinds=("svg",))[0]


def write_thesis_page(directory: Path, parts: Sequence[Part]) -> Path:
    """Write index.html beside the pictures in `directory`; return its path.

    Raises `HapticevalError` where it cannot be written.
    """
    chapters = [(name, list(parts)) for name, parts in groupby(parts, key=lambda part: chapter_of(part.name))]
    comparisons = [comparison for part in parts for comparison in part.comparisons]
    counts = {
        "claims": len(comparisons),
        "agree": sum(one.agrees for one in comparisons),
        "explained": sum(one.explained and not one.agrees for one in comparisons),
    }
    page = directory / "index.html"
    text = environment().get_template("thesis.html.j2").render(
        chapters=chapters, counts=counts, slug_of=slug_of, style=asset("report.css").decode()
    )  # fmt: skip
    write_text(page, text)
    return page
