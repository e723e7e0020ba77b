"""The frame of every figure: style and canvas before it is drawn, files or an element of the page after."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticeval.errors import HapticevalError
from hapticeval.files import replacing
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import continuing_steps
from hapticeval.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MM = 1e3
"""Millimetres in a metre: figures show lengths in mm, everything else is in m."""

INK, QUIET = "#1c1f23", "#6b7280"  # of what is read, and of what stands beside it
PALETTE: Mapping[str, str] = MappingProxyType(
    {
        "model": "#f3f5f7",
        "inside": "#eaf1f7",
        "rests": "#d5dee8",
        "line": "#0072b2",
        "jump": "#d1350f",
        "tool": "#8e3fa8",
        "stop": "#00796b",
        "inertia": "#9a6700",
    }
)
"""Colours of figures that stand alone, in files."""

THEME: Mapping[str, str] = MappingProxyType(
    {
        "ink": "#1c1f23",
        "quiet": "#6b7280",
        "grid": "#e3e6ea",
        "model": "#eef0f3",
        "ray": "#9aa3ae",
        "paper": "#fefefe",
        "hip": "#0072b2",
        "ihip": "#d55e00",
        "one": "#009e73",
        "two": "#cc79a7",
        "three": "#56b4e9",
        "mark": "#e69f00",
    }
)
"""Role -> the colour that it is drawn in, which becomes `var(--fig-<role>)`: the page defines how it looks.

Curves are in the colour-blind-safe palette of Okabe and Ito; no two roles share a colour.
"""

CURVES = ("ihip", "hip", "one", "two", "ink", "three", "mark")
"""Roles of what is drawn beside each other, in the order in which they are taken: those that look alike come late."""

STYLE: Mapping[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "hapticeval",
    "path.simplify_threshold": 0.2,
    "font.size": 8.0,
    "font.family": "sans-serif",
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
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
    "grid.linewidth": 0.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "lines.linewidth": 1.1,
    "axes.unicode_minus": True,
    **dict.fromkeys(("text.color", "axes.labelcolor", "xtick.labelcolor", "ytick.labelcolor"), THEME["ink"]),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), THEME["quiet"]),
    "grid.color": THEME["grid"],
}
"""matplotlib's settings. Curves are simplified to half a point, which keeps every peak and a long recording small."""

UNDATED: Mapping[str, dict[str, None]] = MappingProxyType({".svg": {"Date": None}, ".pdf": {"CreationDate": None}})
"""Metadata that leave out when a file was made."""

BOXED: Mapping[str, Any] = {"axes.spines.top": True, "axes.spines.right": True}
"""Settings of a figure whose axes have all four sides."""


@contextmanager
def figure(
    width: float, height: float, *, page: bool = False, settings: Mapping[str, Any] | None = None, **options: Any
) -> Iterator[Figure]:
    """Make a figure of `width` by `height` inches in the common style, to be drawn and saved inside the block.

    With `page` it is transparent, for `page_svg`; else white, for `save_figure`. `settings` are matplotlib's rcParams
    on top of the style, `options` arguments of its `Figure`.
    """
    from matplotlib.figure import Figure

    with in_style(settings):
        fig = Figure(figsize=(width, height), facecolor="white", **options)
        # On a page its background shows through.
        fig.patch.set_visible(not page)
        yield fig


def in_style(settings: Mapping[str, Any] | None = None) -> AbstractContextManager[None]:
    """Return a context in which matplotlib draws in the common style, and with its rcParams `settings` on top."""
    from matplotlib import rc_context

    style: Any = {**STYLE, **(settings or {})}
    return rc_context(style)


def clear_axes(axes: Axes) -> None:
    """Remove what has been drawn into axes; their place, ticks and labels stay."""
    legend = axes.get_legend()
    # Copied before it is emptied: removing an artist changes its list.
    for kind in (axes.lines, axes.patches, axes.collections, axes.texts, axes.artists, axes.child_axes):
        for artist in list(kind):
            artist.remove()
    if legend is not None:
        legend.remove()


def page_svg(fig: Figure, *, prefix: str, title: str) -> str:
    """Return the figure as an SVG element for a page, see `svg.inline_svg`; the same figure gives the same text."""
    buffer = io.StringIO()
    # Without date and creator, so that the same figure gives the same bytes.
    fig.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return svg_element(buffer.getvalue(), prefix=prefix, title=title)


def svg_element(svg: str, *, prefix: str, title: str) -> str:
    """Return the text of an SVG file of matplotlib as an element for a page, as `page_svg` does for a figure."""
    from hapticeval.reports.svg import inline_svg

    # Each role has a colour of its own, so that a colour in the file tells its role.
    colours = {colour: f"var(--fig-{role})" for role, colour in THEME.items()}
    return inline_svg(svg, prefix=prefix, title=title, colours=colours)


def save_figure(
    fig: Figure,
    directory: Path,
    stem: str,
    *,
    document: Any = None,
    text: str | None = None,
    dpi: int = 160,
    kinds: Sequence[str] = ("svg", "png"),
) -> list[Path]:
    """Write the figure in each of `kinds` into `directory`, `text` as markdown and `document` as JSON where given.

    Return the paths written; the same figure gives the same files. Raises `HapticevalError` where that fails.
    """
    texts = {
        "md": text,
        "json": None if document is None else json.dumps(document, indent=1, ensure_ascii=False),
    }
    paths = [directory / f"{stem}.{kind}" for kind in (*kinds, *(name for name, content in texts.items() if content))]
    try:
        for path in paths:
            # An earlier file stays whole until the new one is complete.
            with replacing(path) as temporary:
                content = texts.get(path.suffix[1:])
                if content is not None:
                    temporary.write_text(content + "\n", encoding="utf-8")
                else:
                    metadata = UNDATED.get(path.suffix)
                    fig.savefig(temporary, format=path.suffix[1:], dpi=dpi, metadata=metadata)
    except OSError as error:
        raise HapticevalError(f"cannot write into {directory}", why=error.strerror or str(error)) from error
    return paths


def colour_of(role: str) -> str:
    """Return the colour to draw a role of `THEME` in; on a page `page_svg` turns it into the page's own."""
    return THEME[role]


def draw_over_time(axes: Axes, recording: Recording, values: Array, role: str, **style: Any) -> None:
    """Draw a channel (n,) against time in s, without a line over a gap: it would show what nobody measured.

    The unit of `values` is that of the axis, such as N or mm; `role` is a key of `THEME`.
    """
    # NaN at each gap breaks the line there.
    cuts = np.flatnonzero(~continuing_steps(recording)) + 1 if len(recording) > 1 else np.zeros(0, dtype=np.intp)
    time, values = (np.insert(series, cuts, np.nan) for series in (recording.time, values))
    axes.plot(time, values, color=colour_of(role), **style)


def legend_above(axes: Axes, *others: Axes, **options: Any) -> None:
    """Put one row of labels above the right end of the axes, with those of the `others` that share its place."""
    handles, labels = axes.get_legend_handles_labels()
    for twin_axes in others:
        twin = twin_axes.get_legend_handles_labels()
        handles, labels = handles + twin[0], labels + twin[1]
    axes.legend(
        handles,
        labels,
        **{"loc": "lower right", "bbox_to_anchor": (1.0, 0.97), "ncols": 4, "borderaxespad": 0.0, **options},
    )
