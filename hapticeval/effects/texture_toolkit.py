"""Model files of the Penn Haptic Texture Toolkit (Culbertson, Lopez Delgado and Kuchenbecker, 2014) as textures.

An XML file holds one texture: a `modelSet` of `mu`; of `numMod` models, each a `model` with line spectral frequencies
`ARlsf` and `MAlsf` (lists of `value`), `var`, `gain` where there is an `MAlsf`, `speedMod` (mm/s) and `forceMod` (N);
and of `numTri` triangles `tri`, each three `value`s, which count models from 1 in the order of `speedList` and
`forceList`.

The rate for which the frequencies were computed is not in it. The toolkit's licence forbids to pass its files on: none
is here, and what is made of one is the user's own.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, fromstring

from hapticeval.effects.texture import Filter, Texture
from hapticeval.errors import InputError, at, unreadable

MOST_FILE_BYTES = 4 * 2**20
"""Bytes of a model file at the most: theirs have some 100 kB."""


def read_toolkit(file: Path, *, rate: float) -> Texture:
    """Read a model file whose frequencies are for samples at `rate` (Hz): 10,000 as measured, or as it was resampled.

    Speeds become m/s. Raises `InputError`, naming file and entry, for what cannot be read, is not a model file, or is
    no sound texture.
    """
    try:
        if file.stat().st_size > MOST_FILE_BYTES:
            raise InputError(
                f"{file} has {file.stat().st_size} bytes", why=f"a model file has {MOST_FILE_BYTES} at the most"
            )
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        raise unreadable(str(file), error) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{file.name}: it is not text in UTF-8", why=str(error)) from error
    with at(file.name):
        if "<!" in text.replace("<!--", ""):
            raise InputError(
                "it declares a document type", why="a model file has none, and entities may expand without end"
            )
        try:
            root = fromstring(text)
        except ParseError as error:
            raise InputError("it is not XML", why=str(error)) from error
        if root.tag != "modelSet":
            raise InputError(f"its root is '{root.tag}'", why="that of a model file is 'modelSet'")
        models = root.findall("model")
        speeds, forces = _numbers(root, "speedList"), _numbers(root, "forceList")
        counts = {"numMod": len(models), "numTri": len(root.findall("tri"))}
        for name, count in counts.items():
            if round(_number(root, name)) != count:
                raise InputError(f"{name} is {_number(root, name):g}, and it has {count}")
        filters = tuple(_filter(model, number) for number, model in enumerate(models, 1))
        order = _order(filters, speeds, forces)
        triangles = [_triangle(entry, number) for number, entry in enumerate(root.findall("tri"), 1)]
        return Texture(
            title=file.stem.removeprefix("Models_"),
            rate=rate,
            friction=_number(root, "mu"),
            filters=tuple(filters[k] for k in order),
            triangles=tuple(triangles),
        )


def _filter(model: Element, number: int) -> Filter:
    with at(f"model {number}"):
        ma = _numbers(model, "MAlsf") if model.find("MAlsf") is not None else ()
        return Filter(
            speed=1e-3 * _number(model, "speedMod"),
            force=_number(model, "forceMod"),
            variance=_number(model, "var"),
            ar=_numbers(model, "ARlsf"),
            ma=ma,
            gain=_number(model, "gain") if ma else 1.0,
        )


def _order(filters: tuple[Filter, ...], speeds: tuple[float, ...], forces: tuple[float, ...]) -> list[int]:
    """Return the models in the order of the two lists, which is what triangles count in."""
    order = []
    for speed, force in zip(speeds, forces, strict=False):
        distances = [math.hypot(filter_.speed - 1e-3 * speed, filter_.force - force) for filter_ in filters]
        order.append(distances.index(min(distances)))
    if not len(speeds) == len(forces) == len(filters) or sorted(order) != list(range(len(filters))):
        raise InputError(
            f"its lists have {len(speeds)} speeds and {len(forces)} forces for {len(filters)} models",
            why="each model is at one speed and force of the lists",
        )
    return order


def _triangle(entry: Element, number: int) -> tuple[int, int, int]:
    with at(f"tri {number}"):
        corners = [_float(element.text) for element in entry.findall("value")]
        if len(corners) != 3 or not all(corner == round(corner) for corner in corners):
            raise InputError(f"it has the values {corners}", why="a triangle is three models, counted from 1")
        one, two, three = (round(corner) - 1 for corner in corners)
        return one, two, three


def _numbers(entry: Element, name: str) -> tuple[float, ...]:
    element = _child(entry, name)
    with at(name):
        return tuple(_float(value.text) for value in element.findall("value"))


def _number(entry: Element, name: str) -> float:
    element = _child(entry, name)
    with at(name):
        return _float(element.text)


def _child(entry: Element, name: str) -> Element:
    element = entry.find(name)
    if element is None:
        raise InputError(f"it has no {name}")
    return element


def _float(text: str | None) -> float:
    try:
        return float(text or "")
    except ValueError:
        raise InputError(f"{text!r} is not a number") from None
