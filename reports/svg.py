"""Matplotlib's SVG made fit to stand many times in one page: small, themed by the page, with ids of its own."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from html import escape
from types import MappingProxyType

THEME: Mapping[str, str] = MappingProxyType(
    {
        "ink": "#010101",
        "quiet": "#020202",
        "grid": "#030303",
        "model": "#040404",
        "ray": "#050505",
        "paper": "#060606",
        "hip": "#0072b2",
        "ihip": "#d55e00",
        "one": "#009e73",
        "two": "#cc79a7",
        "three": "#56b4e9",
        "mark": "#e69f00",
    }
)
"""Role -> the colour that it is drawn in, which becomes `var(--fig-<role>)`: the page says what it looks like.

Curves are in the colour-blind-safe palette of Okabe and Ito; the greys are mere stand-ins, told apart by their last
digit.
"""


PAPER: Mapping[str, str] = MappingProxyType(
    {
        **THEME,
        "ink": "#1c1f23",
        "quiet": "#6b7280",
        "grid": "#e3e6ea",
        "model": "#eef0f3",
        "ray": "#9aa3ae",
        "paper": "#ffffff",
    }
)
"""The same for a figure that stands alone: the page's light colours in place of the stand-ins."""

COLOURS: ContextVar[Mapping[str, str]] = ContextVar("COLOURS", default=THEME)
"""Which of the two a figure is drawn in."""


def drawn(role: str) -> str:
    """Return the colour to draw a role in; on a page `inlined` turns it into the page's."""
    return COLOURS.get()[role]


def inlined(svg: str, *, prefix: str, title: str) -> str:
    """An `<svg>` element for an HTML page, from a whole SVG file.

    Coordinates are rounded to a hundredth of a point, ids that nothing refers to are dropped and the others start
    with `prefix`, and style rules that would reach beyond the figure go; `title` is what a screen reader says.
    """
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<[^>]+>", lambda tag: re.sub(r"-?\d+\.\d{3,}", _rounded, tag[0]), svg)
    svg = svg.replace("xlink:href", "href")
    svg = re.sub(r"font: ([\d.]+)px [^;\"]*", r"font-size: \1px", svg)
    used = {
        name: f"{prefix}-{index}" for index, name in enumerate(dict.fromkeys(re.findall(r'[("]#([^")]+)[)"]', svg)))
    }
    svg = re.sub(r' id="([^"]+)"', lambda found: f' id="{used[found[1]]}"' if found[1] in used else "", svg)
    svg = re.sub(r'([("])#([^")]+)([)"])', lambda found: f"{found[1]}#{used[found[2]]}{found[3]}", svg)
    for role, stand_in in THEME.items():
        svg = svg.replace(stand_in, f"var(--fig-{role})")
    svg = re.sub(r' d="[^"C]*"', lambda path: path[0].replace(" L ", " "), svg)
    svg = re.sub(r'style="[^"]*"', lambda style: re.sub(r"([:;]) ", r"\1", style[0]), svg)
    svg = re.sub(r">\s+<", "><", svg)
    svg = re.sub(r"\s*\n\s*", " ", svg).replace("<defs></defs>", "").replace("<defs/>", "")
    box = re.search(r'viewBox="[^"]*"', svg)
    assert box is not None
    label = escape(title, quote=True)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {box[0]} class="figure" role="img" aria-label="{label}">'
    return head + svg[svg.index(">") + 1 :].strip()


def classed(elements: Sequence[str]) -> tuple[list[str], str]:
    """The same elements with their `style` attributes as classes of the page, and the rules of those classes."""
    classes: dict[str, str] = {}

    def named(found: re.Match[str]) -> str:
        return f' class="{classes.setdefault(found[1], f"z{len(classes)}")}"'

    def without_styles(tag: re.Match[str]) -> str:
        return re.sub(r' style="([^"]*)"', named, tag[0])

    changed = [re.sub(r"<[a-z][^<>]*>", without_styles, element) for element in elements]
    return changed, "\n".join(f".{name} {{{style}}}" for style, name in classes.items())


def _rounded(found: re.Match[str]) -> str:
    text = f"{float(found[0]):.2f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text
