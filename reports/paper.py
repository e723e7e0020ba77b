"""The page of every figure for a paper: its real size, one size of text, and fonts that journals take."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from hapticeval.errors import InputError
from hapticeval.quantity import parse_paper_length
from hapticeval.reports.canvas import FONT_SIZES, MM, in_style

INCH = 0.0254
"""Metres in an inch, in which matplotlib measures paper."""

SMALLEST, LARGEST = 0.03, 1.2
"""Metres of a side of a figure: axes and labels need the least, a poster the most."""

WIDTH, FONT_SIZE = "88mm", 8.0
"""Width, of a column of most journals, and points of all text of a figure, where none are asked for."""


class PaperFigure(Figure):
    """A figure that is saved at its real size and in TrueType fonts (Type 42), whatever matplotlib's settings are."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save it as matplotlib does; an image has 300 dots an inch if nothing else is said."""
        with in_style({"pdf.fonttype": 42, "ps.fonttype": 42, "savefig.bbox": None}):
            super().savefig(fname, **{"dpi": 300, **options})


@contextmanager
def paper_page(
    width: str | None, height: str | None, font_size: float | None, *, natural: Callable[[float], float]
) -> Iterator[PaperFigure]:
    """Make a figure to be drawn inside the block; lengths are texts such as "88mm", or None for what is usual.

    `natural` gives the height (m) of a width (m), where none is asked for. Text is `font_size` points high. Raises
    `InputError` for a size that no figure can have, and as `parse_paper_length` does.
    """
    across = parse_paper_length(WIDTH if width is None else width, option="width")
    up = natural(across) if height is None else parse_paper_length(height, option="height")
    points = FONT_SIZE if font_size is None else font_size
    for name, size in (("width", across), ("height", up)):
        if not SMALLEST <= size <= LARGEST:
            limits = f"{MM * SMALLEST:g} to {MM * LARGEST:g} mm"
            raise InputError(f"a figure of {MM * size:.4g} mm {name}", why=f"a side is {limits} long")
    if not 3.0 <= points <= 40.0:
        raise InputError(f"a font of {points:g} points", why="it is 3 to 40 points high")
    with in_style(dict.fromkeys(FONT_SIZES, points)):
        margins = ConstrainedLayoutEngine(w_pad=0.02, h_pad=0.02)
        yield PaperFigure(figsize=(across / INCH, up / INCH), facecolor="white", layout=margins)


def add_legend(fig: Figure, handles: list[Any], *, below: bool = False) -> float:
    """Put the key of all that is drawn above or below the axes, in as many columns as fit; return its height (in)."""
    place: Any = "outside lower left" if below else "outside upper left"
    for columns in range(len(handles), 0, -1):
        legend = fig.legend(
            handles=handles, loc=place, ncols=columns, borderaxespad=0.2, handlelength=2.2, columnspacing=1.2,
            handletextpad=0.5, borderpad=0.1, labelspacing=0.3,
        )  # fmt: skip
        box = legend.get_window_extent()
        if columns == 1 or box.width < 0.98 * fig.bbox.width:
            break
        legend.remove()
    return float(box.height / fig.dpi)
