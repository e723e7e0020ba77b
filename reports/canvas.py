"""The frame of every figure: style and canvas before it is drawn, files or an element of the page after."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hapticeval.errors import HapticevalError
from hapticeval.files import replacing
from hapticeval.reports.svg import drawn, inlined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MM = 1e3
INK, QUIET = "#1c1f23", "#6b7280"
STYLE: Mapping[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "hapticeval",
    "font.size": 8.0,
    "font.family": "sans-serif",
    "axes.linewidth": 0.6,
    "axes.labelsize": 8.0,
    "axes.formatter.useoffset": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.fontsize": 7.5,
    "lines.linewidth": 1.1,
    "axes.unicode_minus": True,
}
COLOURS = {
    "text.color": "ink",
    "axes.labelcolor": "ink",
    "axes.edgecolor": "quiet",
    "xtick.color": "quiet",
    "ytick.color": "quiet",
    "xtick.labelcolor": "ink",
    "ytick.labelcolor": "ink",
    "grid.color": "grid",
}
"""Roles of matplotlib's colours on the page, see `svg.THEME`."""

BOXED: Mapping[str, Any] = {"axes.spines.top": True, "axes.spines.right": True, "axes.edgecolor": QUIET}
"""Settings of a figure whose axes have all four sides."""


@contextmanager
def figure(
    width: float, height: float, *, page: bool = False, settings: Mapping[str, Any] | None = None, **options: Any
) -> Iterator[Figure]:
    """Make a figure of `width` by `height` inches in the common style, to be drawn and saved inside the block.

    With `page` it is transparent, in the page's colours, for `page_svg`; else white, for `save_figure`. `settings` are
    matplotlib's rcParams on top of the style, `options` arguments of its `Figure`.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    colours = {key: drawn(role) for key, role in COLOURS.items()} if page else {}
    style: Any = {**STYLE, **colours, **(settings or {})}
    with rc_context(style):
        made = Figure(figsize=(width, height), **options)
        if page:
            FigureCanvasSVG(made)
            made.patch.set_visible(False)
        else:
            FigureCanvasAgg(made)
            made.set_facecolor("white")
        yield made


def page_svg(made: Figure, *, prefix: str, title: str) -> str:
    """The figure as an SVG element for a page, see `svg.inlined`; the same figure gives the same text."""
    buffer = io.StringIO()
    made.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return inlined(buffer.getvalue(), prefix=prefix, title=title)


def save_figure(
    made: Figure, directory: Path, stem: str, *, document: Mapping[str, Any] | None = None, dpi: int = 160
) -> list[Path]:
    """Write the figure as SVG and PNG into `directory`, and `document` as JSON where there is one; the paths written.

    The same figure gives the same files. Raises `HapticevalError` where a file cannot be written.
    """
    paths = [directory / f"{stem}.{kind}" for kind in ("svg", "png")]
    try:
        for path in paths:
            metadata = {"Date": None} if path.suffix == ".svg" else None
            with replacing(path) as temporary:
                made.savefig(temporary, format=path.suffix[1:], dpi=dpi, metadata=metadata)
        if document is not None:
            paths.append(directory / f"{stem}.json")
            with replacing(paths[-1]) as temporary:
                temporary.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write into {directory}", why=error.strerror or str(error)) from error
    return paths
