"""The figure of a refusal: the model that a renderer will not take, and where it saw why."""

from __future__ import annotations

from hapticeval.geometry.model import Model
from hapticeval.reports.canvas import MM, figure, page_svg
from hapticeval.reports.plane import draw_body, show
from hapticeval.reports.svg import drawn


def refusal_svg(model: Model, position: tuple[float, ...] | None, *, prefix: str = "f", title: str = "") -> str:
    """The model's outline as an SVG element, with a cross at `position` (m) where there is one."""
    xmin, ymin, xmax, ymax = (MM * bound for bound in model.boundary.bounds)
    edge = 0.06 * max(xmax - xmin, ymax - ymin)
    view = (xmin - edge, ymin - edge, xmax + edge, ymax + edge)
    with figure(8.0, 2.8, page=True) as made:
        axes = made.add_axes((0.08, 0.18, 0.55, 0.77))
        axes.set_aspect("equal")
        draw_body(axes, model, view)
        if position is not None:
            axes.plot(MM * position[0], MM * position[1], "x", color=drawn("ihip"), markersize=11, markeredgewidth=2.2)
        axes.set_xlabel("y₁ (mm)")
        axes.set_ylabel("y₂ (mm)")
        show(axes, view)
        return page_svg(made, prefix=prefix, title=title)
