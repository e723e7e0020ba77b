"""What all figures share: colours, the looks of renderers, matplotlib's style, and how their files are written."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from hapticeval.files import replacing, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MM = 1e3
"""Millimetres in a metre: figures show lengths in mm, everything else is in m."""

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
"""Role -> the colour that it is drawn in; on a page that is `var(--fig-<role>)`, and the sheet defines how it looks.

Curves have the colours of Okabe and Ito, which the colour-blind tell apart; no two roles share a colour. The
page has a light and a dark side: there the sheet has others for some roles.
"""

INK, QUIET = THEME["ink"], THEME["quiet"]
"""The colours of what is read, and of what stands beside it."""

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
"""What is drawn -> its colour in a study's figure, a file of its own. Renderers have those of `THEME`: `looks_of`."""

CURVES = ("ihip", "hip", "one", "two", "ink", "three", "mark")
"""Roles of what is drawn beside each other, in the order in which they are taken: those that look alike come late."""

LINE_DASHES = ((), (6, 2), (2, 2), (6, 2, 2, 2))
"""Lengths of lines and gaps, in points."""

MARKERS: Mapping[str, str] = MappingProxyType(
    {
        "o": "M13 6a4 4 0 1 0 8 0a4 4 0 1 0-8 0z",
        "s": "M13 2h8v8h-8z",
        "D": "M17 1l5 5-5 5-5-5z",
        "^": "M17 1l5 9h-10z",
        "v": "M17 11l5-9h-10z",
        "P": "M15.5 1h3v3.5h3.5v3h-3.5v3.5h-3v-3.5h-3.5v-3h3.5z",
        "X": "M13 1l4 3.5 4-3.5 1.5 2-3 3 3 3-1.5 2-4-3.5-4 3.5-1.5-2 3-3-3-3z",
    }
)
"""matplotlib's markers, and the path of each in the middle of a swatch of 34 by 12 px."""


@dataclass(frozen=True)
class Look:
    """How a renderer is drawn on all pages: the role of its colour, its dashes and its marker."""

    role: str
    dash: tuple[int, ...]
    marker: str

    @property
    def shape(self) -> str:
        """The path of its marker in a swatch of 34 by 12 px."""
        return MARKERS[self.marker]


def looks_of(names: Iterable[str]) -> dict[str, Look]:
    """Return the look of each renderer of a report, in their order: no two of 49 share both colour and marker.

    Neighbours differ in colour, marker and dashes. Each time the colours begin anew, the markers go on by one.
    """
    count, shapes = len(CURVES), tuple(MARKERS)
    return {
        name: Look(CURVES[k % count], LINE_DASHES[k % len(LINE_DASHES)], shapes[(k + k // count) % len(shapes)])
        for k, name in enumerate(dict.fromkeys(names))
    }


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

FONT_SIZES = ("font.size", "axes.labelsize", "axes.titlesize", "xtick.labelsize", "ytick.labelsize", "legend.fontsize")
"""matplotlib's settings for the sizes of text."""

UNDATED: Mapping[str, dict[str, None]] = MappingProxyType({".svg": {"Date": None}, ".pdf": {"CreationDate": None}})
"""Metadata that leave out when a file was made."""

BOXED: Mapping[str, Any] = {"axes.spines.top": True, "axes.spines.right": True}
"""Settings of a figure whose axes have all four sides."""


@contextmanager
def figure(
    width: float, height: float, *, settings: Mapping[str, Any] | None = None, **options: Any
) -> Iterator[Figure]:
    """Make a figure of `width` by `height` inches in the common style, to be drawn and saved inside the block.

    `settings` are matplotlib's rcParams on top of the style, `options` arguments of its `Figure`.
    """
    from matplotlib.figure import Figure

    with in_style(settings):
        yield Figure(figsize=(width, height), facecolor="white", **options)


def in_style(settings: Mapping[str, Any] | None = None) -> AbstractContextManager[None]:
    """Return a context in which matplotlib draws in the common style, and with its rcParams `settings` on top."""
    from matplotlib import rc_context

    style: Any = {**STYLE, **(settings or {})}
    return rc_context(style)


def svg_element(svg: str, *, prefix: str, title: str) -> str:
    """Return the text of an SVG file of matplotlib as an element for a page, whose colours and font it takes.

    - `prefix`: what its ids start with, so that no two figures of a page share one
    - `title`: what a screen reader reads out
    """
    box = re.search(r'viewBox="([^"]*)"', svg)
    assert box is not None, "matplotlib writes a viewBox"
    # What stands between the tags of the root, without metadata and the one style that the page's sheet has.
    body = svg[svg.index(">", svg.index("<svg")) + 1 : svg.rindex("</svg>")]
    body = re.sub(r"<metadata>.*?</metadata>|<defs>\s*<style.*?</defs>", "", body, flags=re.DOTALL)
    body = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{prefix}-", body).replace("xlink:href", "href")
    body = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font-size: \1", body)
    # Each role has a colour of its own, so that a colour in the file tells its role.
    for role, colour in {**THEME, "paper": "#ffffff"}.items():
        body = body.replace(colour, f"var(--fig-{role})")
    # The width of the box (x, y, width, height): a pixel a point at least.
    width = f"min-width:{box[1].split()[2]}px"
    head = (
        f'<svg viewBox="{box[1]}" class="figure" style="{width}" role="img" aria-label="{escape(title, quote=True)}">'
    )
    return f"{head}{body}</svg>"


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
    for path in paths:
        # An earlier file stays whole until the new one is complete.
        with writing(f"into {directory}"), replacing(path) as temporary:
            content = texts.get(path.suffix[1:])
            if content is not None:
                temporary.write_text(content + "\n", encoding="utf-8")
            else:
                metadata = UNDATED.get(path.suffix)
                fig.savefig(temporary, format=path.suffix[1:], dpi=dpi, metadata=metadata)
    return paths


def colour_of(role: str) -> str:
    """Return the colour in which a file has a role of `THEME`; `svg_element` turns it into the page's own."""
    return THEME[role]
