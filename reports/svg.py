"""Figures of matplotlib as small elements of a page: in the page's colours, without what nobody sees.

Everything in an element counts in whole fifths of a point.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from itertools import groupby, pairwise

import numpy as np

from hapticeval.types import Array

UNIT = 5.0
"""Units of an element in a point."""

WITHIN = 2.5
"""Units that a line may be off where fewer corners do: half of its width."""

BEYOND = 5.0
"""Units by which a line may leave its axes before it is clipped."""

LONG = 60
"""Characters of a line from which on it is not written twice."""

NAMESPACE = "{http://www.w3.org/2000/svg}"
LINK = "{http://www.w3.org/1999/xlink}href"
LENGTHS = ("x", "y", "dx", "dy", "width", "height", "viewBox", "r", "cx", "cy")
LENGTHS_OF_STYLE = ("font-size", "stroke-width", "stroke-dasharray", "stroke-dashoffset")
LEFT_OUT = ("metadata", "style", "title")
NUMBER = r"-?\d*\.?\d+(?:e-?\d+)?"


def inlined(svg: str, *, prefix: str, title: str, colours: Mapping[str, str]) -> str:
    """Return an `<svg>` element for an HTML page, from a whole SVG file of matplotlib.

    Lines lose corners that nobody sees, marks of one look become one element, and so do straight lines. Ids that
    nothing refers to go; the others start with `prefix`. `colours` maps colours of the file to those of the page;
    `title` is what a screen reader reads out. The page gives the font.
    """
    root = ET.fromstring(svg)
    body = _Body({name: each for each in root.iter() if (name := each.get("id"))}, prefix, colours)
    elements = _grouped(_shared(_joined(body.seen(root)), prefix))
    box = _scaled(root.get("viewBox", ""))
    # matplotlib leaves out the width of a line of 1 pt.
    head = f'<svg viewBox="{box}" stroke-width="{UNIT:g}" class="figure" role="img"'
    text = "".join(each.text() for each in (*body.defs(), *elements))
    return f'{head} aria-label="{escape(title, quote=True)}">{text}</svg>'


def classed(elements: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the same elements with their `style` attributes as classes, and the styles by class.

    A class is named after its style, so that elements of several pages can share a sheet. What refers to a marker of
    its own page stays as it is.
    """
    styles: dict[str, str] = {}

    def named(found: re.Match[str]) -> str:
        name = f"z{np.base_repr(zlib.crc32(found[1].encode()), 36).lower()}"
        if styles.setdefault(name, found[1]) != found[1]:
            return found[0]
        return f" class={name}{' ' if found[2] else ''}{found[2]}"

    return [
        re.sub(r"<[a-z][^<>]*>", lambda tag: re.sub(r' style="(?!marker)([^"]*)"(/?)', named, tag[0]), element)
        for element in elements
    ], styles


def sheet(styles: Mapping[str, str]) -> str:
    """Return the style sheet of classes."""
    return "".join(f".{name}{{{style}}}\n" for name, style in sorted(styles.items()))


@dataclass
class _Element:
    """An element to be: `strokes` are the corners (n, 2) of the strokes of a path and whether each is closed.

    Where it is places that are marked, and not a line, `marker` is what marks them.
    """

    tag: str
    attributes: dict[str, str]
    strokes: list[tuple[Array, bool]] = field(default_factory=list)
    words: str = ""
    inside: Sequence[_Element] = ()
    marker: str = ""

    @property
    def straight(self) -> bool:
        """Whether it is straight lines, and nothing else."""
        plain = self.attributes.keys() == {"style"} and "fill:none" in self.attributes["style"]
        return plain and bool(self.strokes) and all(len(points) == 2 for points, _ in self.strokes)

    @cached_property
    def drawn(self) -> str:
        """The strokes as the text of a path: all corners of marks, and of lines those that are seen."""
        if self.marker:
            return _drawn(self.strokes, 0.0)
        whole = _drawn(self.strokes, WITHIN)
        if len(whole) < LONG or "fill:none" not in self.attributes.get("style", ""):
            return whole
        return min(whole, _drawn(_once(self.strokes), WITHIN), key=len)

    def text(self) -> str:
        """The element as it stands in a page."""
        given = {**({"d": self.drawn} if self.strokes else {}), **self.attributes}
        head = self.tag + "".join(f' {name}="{escape(value, quote=True)}"' for name, value in given.items())
        inside = escape(self.words, quote=False) + "".join(each.text() for each in self.inside)
        return f"<{head}>{inside}</{self.tag}>" if inside or self.tag == "text" else f"<{head}/>"


class _Body:
    """What is seen of a file's elements, of which `named` have ids; `defs` gives what they refer to."""

    def __init__(self, named: Mapping[str, ET.Element], prefix: str, colours: Mapping[str, str]) -> None:
        self.named, self.prefix, self.colours = named, prefix, colours
        self.used: dict[tuple[str, str], str] = {}

    def seen(self, parent: ET.Element, clip: str = "") -> Iterator[_Element]:
        """Return what is seen of the children of `parent`, which `clip` clips: without groups that only group."""
        for child in parent:
            tag = child.tag.removeprefix(NAMESPACE)
            inner = child.get("clip-path", clip)[4:-1]
            style = self._style(child.get("style", ""))
            if tag == "g" and not child.attrib.keys() - {"id", "clip-path"}:
                yield from self.seen(child, f"url({inner})" if inner else "")
            elif tag == "path":
                made = _Element("path", {"style": style} if style else {})
                self._draw(made, child.get("d", ""), inner)
                if made.strokes or "d" in made.attributes:
                    yield made
            elif tag == "use" and self._glyph(child) is not None:
                made = _Element("use", {"href": self._refer(child.get(LINK, ""))[4:-1]})
                if moved := _moved(child.get("transform", "")):
                    made.attributes["transform"] = moved
                yield made
            elif tag == "use" and child.get(LINK, "")[1:] in self.named:
                made = self._mark(child, style)
                self._clip(made, inner)
                yield made
            elif tag not in ("defs", "use", *LEFT_OUT):
                yield self._other(child, tag, style, inner)

    def _glyph(self, use: ET.Element) -> str | None:
        """How the shape that is used is moved where it is defined, as letters are; None for marks, which are not."""
        shape = self.named.get(use.get(LINK, "")[1:])
        return None if shape is None else shape.get("transform")

    def _mark(self, use: ET.Element, style: str) -> _Element:
        """A place that is marked; a tick, which is a single line, becomes that line."""
        link = use.get(LINK, "")
        place = UNIT * np.array([[float(use.get("x", "0")), float(use.get("y", "0"))]])
        d = self.named[link[1:]].get("d", "")
        strokes = [] if re.search("[A-KN-Yac-y]", d) else _strokes(d)
        if len(strokes) == 1 and len(strokes[0][0]) == 2:
            shape = _merged(style, self._style(self.named[link[1:]].get("style", "")), "fill:none")
            return _Element("path", {"style": shape}, [(place + strokes[0][0], False)])
        return _Element("path", {}, [(place, False)], marker=self._refer(link, style))

    def _other(self, child: ET.Element, tag: str, style: str, clip: str) -> _Element:
        """A text, a picture, or a group that moves what it holds."""
        made = _Element(tag, {"style": style} if style else {})
        for name, value in child.items():
            if name in LENGTHS:
                made.attributes[name] = _scaled(value)
            elif name == "transform":
                made.attributes |= {name: moved} if (moved := _moved(value)) else {}
            elif name == LINK:
                made.attributes["href"] = value
            elif name not in ("id", "style", "clip-path"):
                made.attributes[name] = value
        if clip and tag not in ("text", "tspan", "rect"):
            made.attributes["clip-path"] = self._refer(clip)
        made.words = child.text if child.text and child.text.strip() else ""
        made.inside = _joined(self.seen(child))
        return made

    def _draw(self, made: _Element, d: str, clip: str) -> None:
        style = made.attributes.get("style", "")
        if not d.strip() or ("fill:none" in style and "stroke:" not in style):
            return
        if re.search("[A-KN-Yac-y]", d):
            made.attributes["d"] = _curve(d)
        else:
            made.strokes = [each for each in _strokes(d) if len(each[0]) > 1]
        self._clip(made, clip)

    def _clip(self, made: _Element, clip: str) -> None:
        """Clip what leaves the rectangle that it is clipped by, and nothing else."""
        box = self.named[clip[1:]].find(f"{NAMESPACE}rect") if clip else None
        if box is None:
            return
        x, y, width, height = (UNIT * float(box.get(name, "0")) for name in ("x", "y", "width", "height"))
        low, high = np.array([x, y]) - BEYOND, np.array([x + width, y + height]) + BEYOND
        if not made.strokes or any(np.any((points < low) | (points > high)) for points, _ in made.strokes):
            made.attributes["clip-path"] = self._refer(clip)

    def _refer(self, link: str, style: str = "") -> str:
        name = self.used.setdefault((link[1:], style), f"{self.prefix}-{len(self.used)}")
        return f"url(#{name})"

    def defs(self) -> Iterator[_Element]:
        """Return what the elements refer to, as one element if anything."""
        made = []
        for (old, style), name in self.used.items():
            given = self.named[old]
            if moved := given.get("transform"):
                letter = _Element("path", {"id": name, "transform": _moved(moved)})
                self._draw(letter, given.get("d", ""), "")
                made.append(letter)
            elif given.tag == f"{NAMESPACE}path":
                own = _merged(style, self._style(given.get("style", "")))
                shape = _Element("path", {"style": own} if own else {})
                self._draw(shape, given.get("d", ""), "")
                how = {"id": name, "markerUnits": "userSpaceOnUse"}
                made.append(_Element("marker", how, inside=[shape]))
            else:
                made.append(_Element("clipPath", {"id": name}, inside=list(self.seen(given))))
        if made:
            yield _Element("defs", {}, inside=made)

    def _style(self, style: str) -> str:
        """A style with the page's colours and font, in units."""
        style = re.sub(r"font: ([\d.]+px) [^;]*", r"font-size:\1", style)
        kept = []
        for part in style.split(";"):
            name, _, value = (each.strip() for each in part.partition(":"))
            if not name or name == "font-family" or (name, value) == ("stroke-dashoffset", "0"):
                continue
            for colour, role in self.colours.items():
                value = value.replace(colour, role)
            kept.append(f"{name}:{_scaled(value) if name in LENGTHS_OF_STYLE else value}")
        return ";".join(kept)


def _joined(elements: Iterable[_Element]) -> list[_Element]:
    """Straight lines of one look become one path, and so do marks."""
    found: list[_Element] = []
    first: dict[tuple[str, ...], _Element] = {}
    for each in elements:
        if not each.marker and not each.straight:
            found.append(each)
            continue
        key = each.attributes.get("style", ""), each.marker
        if key not in first:
            first[key] = each
            found.append(each)
            continue
        first[key].strokes += each.strokes
        first[key].attributes |= each.attributes
    for each in found:
        if each.marker:
            places = np.concatenate([points for points, _ in each.strokes])
            all_of_them = "marker" if len(places) > 1 else "marker-start"
            each.attributes["style"] = f"{all_of_them}:{each.marker};fill:none"
            if len(places) == 1:
                places = np.repeat(places, 2, axis=0)  # a path without a line shows no mark
            each.strokes = [(places, False)]
    return found


def _shared(elements: Sequence[_Element], prefix: str) -> Iterator[_Element]:
    """Long lines that lie on one another are written once, and used."""
    names: dict[str, str] = {}
    texts = [each.drawn if each.strokes and not each.marker else "" for each in elements]
    for name, count in Counter(texts).items():
        if count > 1 and len(name) > LONG:
            names[name] = f"{prefix}-s{len(names)}"
    if names:
        yield _Element("defs", {}, inside=[_Element("path", {"id": name, "d": d}) for d, name in names.items()])
    for each, d in zip(elements, texts, strict=True):
        yield _Element("use", {"href": f"#{names[d]}", **each.attributes}) if d in names else each


def _grouped(elements: Iterable[_Element]) -> Iterator[_Element]:
    """Texts of one look that follow one another have it from a group."""
    for style, run in groupby(elements, lambda each: each.attributes.get("style", "") if each.tag == "text" else ""):
        members = list(run)
        if not style or len(members) == 1:
            yield from members
            continue
        for each in members:
            del each.attributes["style"]
        yield _Element("g", {"style": style}, inside=members)


def _merged(*styles: str) -> str:
    """Several styles as one, of which the later count."""
    parts = (part.partition(":") for style in styles for part in style.split(";") if part)
    return ";".join(f"{name}:{value}" for name, value in {name: value for name, _, value in parts}.items())


def _strokes(d: str) -> list[tuple[Array, bool]]:
    """The corners of each stroke of a path of straight lines."""
    return [
        (UNIT * np.array([float(each) for each in re.findall(NUMBER, stroke)]).reshape(-1, 2), "z" in stroke)
        for stroke in d.split("M")[1:]
    ]


def _once(strokes: Sequence[tuple[Array, bool]]) -> list[tuple[Array, bool]]:
    """The strokes of a line in whole units, without what lies on itself: laps that are all alike are one."""
    found: list[tuple[Array, bool]] = []
    seen: set[frozenset[tuple[int, ...]]] = set()
    for points, closed in strokes:
        corners = [tuple(each) for each in np.rint(points).astype(np.int64).tolist()]
        edges = [frozenset(pair) for pair in pairwise(corners)]
        again = np.zeros(len(edges), dtype=bool)
        for k, edge in enumerate(edges):
            again[k] = edge in seen and len(edge) == 2
            seen.add(edge)
        if closed or not again.any():
            found.append((points, closed))
            continue
        bounds = np.flatnonzero(np.diff(again, prepend=True, append=True))
        found += [(points[first : last + 1], False) for first, last in bounds.reshape(-1, 2)]
    return found


def _drawn(strokes: Sequence[tuple[Array, bool]], within: float) -> str:
    """The text of a path: each corner by its distance from the last, without those that lines miss by `within`.

    Of several strokes those go that are dots.
    """
    from shapely import get_coordinates, linestrings, simplify

    parts: list[str] = []
    at = np.zeros(2, dtype=np.int64)
    for points, closed in strokes:
        if within and len(points) > 2:
            points = get_coordinates(simplify(linestrings(points), within, preserve_topology=False))
        whole = np.rint(points).astype(np.int64)
        if within and len(strokes) > 1 and int(np.ptp(whole, axis=0).max()) <= 1:
            continue
        steps = np.diff(np.vstack([at, whole]), axis=0)
        kept = [steps[0], *(each for each in steps[1:] if each.any() or not within)]
        parts.append("m" + " ".join(f"{x} {y}" for x, y in kept).replace(" -", "-") + ("z" if closed else ""))
        at = whole[0] if closed else whole[-1]
    return "".join(parts)


def _curve(d: str) -> str:
    return re.sub(r"\s*([A-Za-z])\s*", r"\1", _scaled(" ".join(d.split()))).replace(" -", "-")


def _scaled(value: str) -> str:
    """Every number of a text in units."""
    return re.sub(NUMBER, lambda found: f"{round(UNIT * float(found[0]))}", value)


def _moved(value: str) -> str:
    """A transform in units; empty where it does nothing."""
    made = []
    for name, inside in re.findall(r"(\w+)\(([^)]*)\)", value):
        numbers = re.findall(NUMBER, inside)
        plain = {"translate": 0, "rotate": 1, "matrix": 4}.get(name, len(numbers))
        if name == "rotate" and float(numbers[0]) == 0.0:
            continue
        made.append(f"{name}({' '.join([*numbers[:plain], *(_scaled(each) for each in numbers[plain:])])})")
    return " ".join(made)
