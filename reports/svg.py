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

UNITS_PER_POINT = 5.0
"""Units of an element in a point."""

CORNER_TOLERANCE = 2.5
"""Units that a line may be off where fewer corners do: half of its width."""

CLIP_MARGIN = 5.0
"""Units by which a line may leave its axes before it is clipped."""

LONG_PATH = 60
"""Characters of a line from which on it is not written twice."""

NAMESPACE = "{http://www.w3.org/2000/svg}"
LINK = "{http://www.w3.org/1999/xlink}href"
LENGTHS = ("x", "y", "dx", "dy", "width", "height", "viewBox", "r", "cx", "cy")
"""Attributes that hold lengths or places, in points."""

LENGTHS_OF_STYLE = ("font-size", "stroke-width", "stroke-dasharray", "stroke-dashoffset")
"""Properties of a style that hold lengths, in points."""

SKIPPED_TAGS = ("metadata", "style", "title")
"""Elements of which nothing is seen."""

NUMBER = r"-?\d*\.?\d+(?:e-?\d+)?"
"""A number as matplotlib writes it."""


def inline_svg(svg: str, *, prefix: str, title: str, colours: Mapping[str, str]) -> str:
    """Return an `<svg>` element for an HTML page, from a whole SVG file of matplotlib.

    Lines lose corners that nobody sees, marks of one look become one element, and so do straight lines. Ids that
    nothing refers to go.

    - `prefix`: what the other ids start with
    - `title`: what a screen reader reads out
    - `colours`: colours of the file, and what they are on the page, which gives the font too
    """
    root = ET.fromstring(svg)
    body = _Body({name: node for node in root.iter() if (name := node.get("id"))}, prefix, colours)
    # From the inside out: what is seen, joined by look, repeats shared, texts in groups.
    elements = _texts_grouped(_repeats_shared(_lines_joined(body.seen(root)), prefix))
    box = _numbers_in_units(root.get("viewBox", ""))
    # matplotlib leaves out the width of a line of 1 pt.
    head = f'<svg viewBox="{box}" stroke-width="{UNITS_PER_POINT:g}" class="figure" role="img"'
    text = "".join(node.text() for node in (*body.defs(), *elements))
    return f'{head} aria-label="{escape(title, quote=True)}">{text}</svg>'


def styles_as_classes(elements: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the same elements with their `style` attributes as classes, and the styles by class.

    A class is named after its style, so that elements of several pages can share a sheet. What refers to a marker of
    its own page stays as it is.
    """
    styles: dict[str, str] = {}

    def named(match: re.Match[str]) -> str:
        # A checksum as a name: the same style has the same name in every figure and page.
        name = f"z{np.base_repr(zlib.crc32(match[1].encode()), 36).lower()}"
        # Two styles with one checksum: the second keeps its attribute.
        if styles.setdefault(name, match[1]) != match[1]:
            return match[0]
        return f" class={name}{' ' if match[2] else ''}{match[2]}"

    return [
        re.sub(r"<[a-z][^<>]*>", lambda tag: re.sub(r' style="(?!marker)([^"]*)"(/?)', named, tag[0]), element)
        for element in elements
    ], styles


def style_sheet(styles: Mapping[str, str]) -> str:
    """Return the style sheet of classes."""
    return "".join(f".{name}{{{style}}}\n" for name, style in sorted(styles.items()))


@dataclass
class _Element:
    """An element of the page: `strokes` are the corners (n, 2) of the strokes of a path and whether each is closed.

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
            return _path_text(self.strokes, 0.0)
        text = _path_text(self.strokes, CORNER_TOLERANCE)
        # Only a long line can gain, and only one that is not filled may lose its repeats.
        if len(text) < LONG_PATH or "fill:none" not in self.attributes.get("style", ""):
            return text
        return min(text, _path_text(_without_retraced(self.strokes), CORNER_TOLERANCE), key=len)

    def text(self) -> str:
        """The element as it stands in a page."""
        attributes = {**({"d": self.drawn} if self.strokes else {}), **self.attributes}
        head = self.tag + "".join(f' {name}="{escape(value, quote=True)}"' for name, value in attributes.items())
        inside = escape(self.words, quote=False) + "".join(child.text() for child in self.inside)
        return f"<{head}>{inside}</{self.tag}>" if inside or self.tag == "text" else f"<{head}/>"


class _Body:
    """Turns a file's elements into those of a page: `seen` gives what is seen, `defs` what that refers to by id."""

    def __init__(self, named: Mapping[str, ET.Element], prefix: str, colours: Mapping[str, str]) -> None:
        self.named, self.prefix, self.colours = named, prefix, colours
        self.used: dict[tuple[str, str], str] = {}

    def seen(self, parent: ET.Element, clip: str = "") -> Iterator[_Element]:
        """Return what is seen of the children of `parent`, which `clip` clips: without groups that only group."""
        for child in parent:
            tag = child.tag.removeprefix(NAMESPACE)
            # Of "url(#id)" what is within the brackets; a child without one is clipped as its parent.
            inner = child.get("clip-path", clip)[4:-1]
            style = self._style(child.get("style", ""))
            if tag == "g" and not child.attrib.keys() - {"id", "clip-path"}:
                yield from self.seen(child, f"url({inner})" if inner else "")
            elif tag == "path":
                element = _Element("path", {"style": style} if style else {})
                self._draw(element, child.get("d", ""), inner)
                if element.strokes or "d" in element.attributes:
                    yield element
            # A letter of a formula: its shape is defined once and moved to its place.
            elif tag == "use" and self._glyph(child) is not None:
                element = _Element("use", {"href": self._refer(child.get(LINK, ""))[4:-1]})
                if moved := _transform_in_units(child.get("transform", "")):
                    element.attributes["transform"] = moved
                yield element
            # A mark of a line or of an axis, at its place.
            elif tag == "use" and child.get(LINK, "")[1:] in self.named:
                element = self._mark(child, style)
                self._clip(element, inner)
                yield element
            elif tag not in ("defs", "use", *SKIPPED_TAGS):
                yield self._other(child, tag, style, inner)

    def _glyph(self, use: ET.Element) -> str | None:
        """How the shape that is used is moved where it is defined, as letters are; None for marks, which are not."""
        shape = self.named.get(use.get(LINK, "")[1:])
        return None if shape is None else shape.get("transform")

    def _mark(self, use: ET.Element, style: str) -> _Element:
        """Return a place that is marked; a tick, which is a single line, becomes that line."""
        link = use.get(LINK, "")
        place = UNITS_PER_POINT * np.array([[float(use.get("x", "0")), float(use.get("y", "0"))]])
        d = self.named[link[1:]].get("d", "")
        # Any command but M, L and Z: the shape has curves.
        strokes = [] if re.search("[A-KN-Yac-y]", d) else _strokes(d)
        # A tick: joined with others of its look it takes less than a use of each.
        if len(strokes) == 1 and len(strokes[0][0]) == 2:
            shape = _merged_style(style, self._style(self.named[link[1:]].get("style", "")), "fill:none")
            return _Element("path", {"style": shape}, [(place + strokes[0][0], False)])
        return _Element("path", {}, [(place, False)], marker=self._refer(link, style))

    def _other(self, child: ET.Element, tag: str, style: str, clip: str) -> _Element:
        """Return a text, a picture, or a group that moves what it holds."""
        element = _Element(tag, {"style": style} if style else {})
        for name, value in child.items():
            # Lengths and positions are in points in the file.
            if name in LENGTHS:
                element.attributes[name] = _numbers_in_units(value)
            elif name == "transform":
                element.attributes |= {name: moved} if (moved := _transform_in_units(value)) else {}
            elif name == LINK:
                element.attributes["href"] = value
            elif name not in ("id", "style", "clip-path"):
                element.attributes[name] = value
        if clip and tag not in ("text", "tspan", "rect"):
            element.attributes["clip-path"] = self._refer(clip)
        element.words = child.text if child.text and child.text.strip() else ""
        element.inside = _lines_joined(self.seen(child))
        return element

    def _draw(self, element: _Element, d: str, clip: str) -> None:
        """Give an element the strokes or the curve of a path's `d`; nothing where none of it is seen."""
        style = element.attributes.get("style", "")
        # Neither filled nor stroked: nothing is seen of it.
        if not d.strip() or ("fill:none" in style and "stroke:" not in style):
            return
        if re.search("[A-KN-Yac-y]", d):
            element.attributes["d"] = _curve_text(d)
        else:
            element.strokes = [stroke for stroke in _strokes(d) if len(stroke[0]) > 1]
        self._clip(element, clip)

    def _clip(self, element: _Element, clip: str) -> None:
        """Clip what leaves the rectangle that it is clipped by, and nothing else."""
        box = self.named[clip[1:]].find(f"{NAMESPACE}rect") if clip else None
        if box is None:
            return
        x, y, width, height = (UNITS_PER_POINT * float(box.get(name, "0")) for name in ("x", "y", "width", "height"))
        # Half a line's width lies outside of its corners; a clip path only for what goes farther.
        low, high = np.array([x, y]) - CLIP_MARGIN, np.array([x + width, y + height]) + CLIP_MARGIN
        if not element.strokes or any(np.any((points < low) | (points > high)) for points, _ in element.strokes):
            element.attributes["clip-path"] = self._refer(clip)

    def _refer(self, link: str, style: str = "") -> str:
        # The same shape in another style is another definition.
        name = self.used.setdefault((link[1:], style), f"{self.prefix}-{len(self.used)}")
        return f"url(#{name})"

    def defs(self) -> Iterator[_Element]:
        """Return what the elements refer to, as one element if anything."""
        definitions = []
        for (shape_id, style), name in self.used.items():
            node = self.named[shape_id]
            # Only letters are moved where they are defined.
            if moved := node.get("transform"):
                letter = _Element("path", {"id": name, "transform": _transform_in_units(moved)})
                self._draw(letter, node.get("d", ""), "")
                definitions.append(letter)
            elif node.tag == f"{NAMESPACE}path":
                merged_style = _merged_style(style, self._style(node.get("style", "")))
                shape = _Element("path", {"style": merged_style} if merged_style else {})
                self._draw(shape, node.get("d", ""), "")
                attributes = {"id": name, "markerUnits": "userSpaceOnUse"}
                definitions.append(_Element("marker", attributes, inside=[shape]))
            else:
                definitions.append(_Element("clipPath", {"id": name}, inside=list(self.seen(node))))
        if definitions:
            yield _Element("defs", {}, inside=definitions)

    def _style(self, style: str) -> str:
        """Return a style with the page's colours and font, lengths in units."""
        style = re.sub(r"font: ([\d.]+px) [^;]*", r"font-size:\1", style)
        declarations = []
        for part in style.split(";"):
            name, _, value = (part_text.strip() for part_text in part.partition(":"))
            # The page gives the font; an offset of 0 is the default.
            if not name or name == "font-family" or (name, value) == ("stroke-dashoffset", "0"):
                continue
            for colour, role in self.colours.items():
                value = value.replace(colour, role)
            declarations.append(f"{name}:{_numbers_in_units(value) if name in LENGTHS_OF_STYLE else value}")
        return ";".join(declarations)


def _lines_joined(elements: Iterable[_Element]) -> list[_Element]:
    """Join straight lines of one look into one path, and marks of one look into another."""
    joined: list[_Element] = []
    first: dict[tuple[str, ...], _Element] = {}
    for element in elements:
        if not element.marker and not element.straight:
            joined.append(element)
            continue
        # Drawn in the order of the first of a look: what has been over it may come under it.
        key = element.attributes.get("style", ""), element.marker
        if key not in first:
            first[key] = element
            joined.append(element)
            continue
        first[key].strokes += element.strokes
        first[key].attributes |= element.attributes
    for element in joined:
        # Markers stand at the corners of an unseen path: all but the ends need `marker`, one place `marker-start`.
        if element.marker:
            places = np.concatenate([points for points, _ in element.strokes])
            all_of_them = "marker" if len(places) > 1 else "marker-start"
            element.attributes["style"] = f"{all_of_them}:{element.marker};fill:none"
            if len(places) == 1:
                places = np.repeat(places, 2, axis=0)  # a path without a line shows no mark
            element.strokes = [(places, False)]
    return joined


def _repeats_shared(elements: Sequence[_Element], prefix: str) -> Iterator[_Element]:
    """Write long lines that are equal only once, and refer to them."""
    names: dict[str, str] = {}
    texts = [element.drawn if element.strokes and not element.marker else "" for element in elements]
    # Equal paths, as a HIP and an IHIP that move as one.
    for name, count in Counter(texts).items():
        if count > 1 and len(name) > LONG_PATH:
            names[name] = f"{prefix}-s{len(names)}"
    if names:
        yield _Element("defs", {}, inside=[_Element("path", {"id": name, "d": d}) for d, name in names.items()])
    for element, d in zip(elements, texts, strict=True):
        yield _Element("use", {"href": f"#{names[d]}", **element.attributes}) if d in names else element


def _texts_grouped(elements: Iterable[_Element]) -> Iterator[_Element]:
    """Put texts of one look that follow one another into a group that has the look."""
    for style, run in groupby(
        elements, lambda element: element.attributes.get("style", "") if element.tag == "text" else ""
    ):
        members = list(run)
        # A group of one would be longer than the attribute.
        if not style or len(members) == 1:
            yield from members
            continue
        for member in members:
            del member.attributes["style"]
        yield _Element("g", {"style": style}, inside=members)


def _merged_style(*styles: str) -> str:
    """Return several styles as one; where two set the same property, the later counts."""
    parts = (part.partition(":") for style in styles for part in style.split(";") if part)
    return ";".join(f"{name}:{value}" for name, value in {name: value for name, _, value in parts}.items())


def _strokes(d: str) -> list[tuple[Array, bool]]:
    """Return the corners (n, 2), in units, of each stroke of a path of straight lines, and whether it is closed."""
    return [
        (
            UNITS_PER_POINT * np.array([float(number) for number in re.findall(NUMBER, stroke)]).reshape(-1, 2),
            "z" in stroke,
        )
        for stroke in d.split("M")[1:]
    ]


def _without_retraced(strokes: Sequence[tuple[Array, bool]]) -> list[tuple[Array, bool]]:
    """Return the strokes of a line without edges that it has drawn before: laps that are all alike are one."""
    distinct: list[tuple[Array, bool]] = []
    drawn_edges: set[frozenset[tuple[int, ...]]] = set()
    for points, closed in strokes:
        corners = [tuple(corner) for corner in np.rint(points).astype(np.int64).tolist()]
        edges = [frozenset(pair) for pair in pairwise(corners)]
        retraced = np.zeros(len(edges), dtype=bool)
        for k, edge in enumerate(edges):
            # An edge in either direction counts; one of equal corners is a dot, and stays.
            retraced[k] = edge in drawn_edges and len(edge) == 2
            drawn_edges.add(edge)
        if closed or not retraced.any():
            distinct.append((points, closed))
            continue
        # Where new edges begin and end, in turns: each pair is a stroke that is kept.
        bounds = np.flatnonzero(np.diff(retraced, prepend=True, append=True))
        distinct += [(points[first : last + 1], False) for first, last in bounds.reshape(-1, 2)]
    return distinct


def _path_text(strokes: Sequence[tuple[Array, bool]], within: float) -> str:
    """Return the text of a path: each corner by its distance from the last, without those within `within` of a line.

    Of several strokes those go that are dots.
    """
    from shapely import get_coordinates, linestrings, simplify

    parts: list[str] = []
    pen = np.zeros(2, dtype=np.int64)
    for points, closed in strokes:
        if within and len(points) > 2:
            # Douglas and Peucker, in units of a fifth of a point.
            points = get_coordinates(simplify(linestrings(points), within, preserve_topology=False))
        corners = np.rint(points).astype(np.int64)
        if within and len(strokes) > 1 and int(np.ptp(corners, axis=0).max()) <= 1:
            continue
        # Rounded before the differences are taken, so that errors do not add up.
        steps = np.diff(np.vstack([pen, corners]), axis=0)
        moves = [steps[0], *(move for move in steps[1:] if move.any() or not within)]
        parts.append("m" + " ".join(f"{x} {y}" for x, y in moves).replace(" -", "-") + ("z" if closed else ""))
        # z goes back to the stroke's first corner.
        pen = corners[0] if closed else corners[-1]
    return "".join(parts)


def _curve_text(d: str) -> str:
    return re.sub(r"\s*([A-Za-z])\s*", r"\1", _numbers_in_units(" ".join(d.split()))).replace(" -", "-")


def _numbers_in_units(value: str) -> str:
    """Return a text with every number, which is in points, in units."""
    return re.sub(NUMBER, lambda match: f"{round(UNITS_PER_POINT * float(match[0]))}", value)


def _transform_in_units(value: str) -> str:
    """Return a transform with its lengths in units; empty where it does nothing."""
    transforms = []
    for name, inside in re.findall(r"(\w+)\(([^)]*)\)", value):
        numbers = re.findall(NUMBER, inside)
        # How many of the numbers are no lengths: an angle, the four of a turn and scale; all of scale and skew.
        unscaled = {"translate": 0, "rotate": 1, "matrix": 4}.get(name, len(numbers))
        # matplotlib writes a turn of -0 beside most texts.
        if name == "rotate" and float(numbers[0]) == 0.0:
            continue
        transforms.append(
            f"{name}({' '.join([*numbers[:unscaled], *(_numbers_in_units(number) for number in numbers[unscaled:])])})"
        )
    return " ".join(transforms)
