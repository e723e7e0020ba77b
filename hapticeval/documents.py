"""TOML documents that people write, as typed values; what does not fit is refused, with place and likely meaning.

`convert` is the one door from TOML and JSON values to types.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

from hapticeval.errors import InputError, UnknownNameError, at, unreadable

T = TypeVar("T")

LONGEST_QUOTE = 80
"""Characters of a value that a message shows."""

DEEPEST_NESTING = 64
"""Tables and lists within each other, *chosen*: ours have ten at the most, and Python's stack ends at some hundreds."""

LARGEST_BITS = 1023
"""Binary digits of a whole number that any float holds."""

LARGEST_TOML = 16_000_000
"""Bytes of a TOML file, *chosen*: what people write has a thousandth of it."""

LARGEST_JSON = 1_000_000_000
"""Bytes of a JSON file, *chosen*: results of a hundred thousand verdicts have a tenth of it."""

_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
DEEP_KEY = re.compile(rf"(?:^|[\[{{,])[ \t]*+{_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{DEEPEST_NESTING},}}", re.MULTILINE)
"""A key of more parts than tables may be deep, as a.a.a: Python's reader takes time and memory by their square."""

UNUSABLE = re.compile(r"[0-9]{308}|\\[uU][0-9a-fA-F]*?[dD][89a-fA-F][0-9a-fA-F]{2}")
"""What a text has that may hold a number or a character of `refuse_unusable`: most have none, and are not walked."""


def read_text(file: Path, *, largest: int) -> str:
    """Return the text of a file in UTF-8 of at most so many bytes.

    Raises `InputError` for what is not a file, as a pipe or a device that never ends, for a larger one, and for one
    that cannot be read; `UnicodeDecodeError` for another encoding.
    """
    try:
        if file.exists() and not file.is_file():
            raise InputError(f"{file} is not a file", why="a pipe, a device or a folder is not read as a document")
        if file.stat().st_size > largest:
            size = f"it has {file.stat().st_size:,} bytes, and {largest:,} are the most"
            raise InputError(
                f"{file} is too large", why=size, todo="name another file: no document of ours has so many"
            )
        return file.read_text(encoding="utf-8")
    except OSError as error:
        # A name that is too long for the system is too long for a message.
        raise unreadable(str(file) if len(file.name) <= LONGEST_QUOTE else shortened(file.name), error) from error
    except MemoryError as error:
        raise too_large_for_memory(str(file)) from error


def shortened(text: str) -> str:
    """Return a text as a message quotes it."""
    return text if len(text) <= LONGEST_QUOTE else f"{text[:LONGEST_QUOTE]}..."


def too_large_for_memory(place: str) -> InputError:
    """Return the error of a document that takes more memory than there is."""
    return InputError(f"{place} takes more memory than there is", todo="name a smaller file")


def refuse_unusable(document: Any, text: str, place: str) -> None:
    """Raise `InputError`, naming the entry, for a whole number that no float holds, and half of a character.

    `text` is what the document was read from. Neither can be computed with or written again.
    """
    if UNUSABLE.search(text):
        for path, value in _entries(document, ()):
            fault = _unusable(value)
            if fault:
                raise InputError(f"{':'.join([place, *_readable_places(document, list(path))])} {fault}")


def _entries(value: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield each key and value within a document that is not too deep, with the keys that lead there."""
    pairs = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else ()
    yield path, value
    for key, entry in pairs:
        if isinstance(value, Mapping):
            yield path, key
        yield from _entries(entry, (*path, str(key)))


def _unusable(value: Any) -> str:
    if isinstance(value, int) and value.bit_length() > LARGEST_BITS:
        return f"holds a whole number of {len(str(abs(value)))} digits, which no float can hold"
    if isinstance(value, str) and any("\ud800" <= character <= "\udfff" for character in value):
        return "holds half of a character (a lone surrogate), which is not text"
    return ""


def read_toml(file: Path) -> Mapping[str, Any]:
    """Read a TOML file. Raises `InputError`, naming it, for one that is unreadable, not TOML, or nested too deep."""
    try:
        text = read_text(file, largest=LARGEST_TOML)
        if DEEP_KEY.search(text):
            raise too_deep(file.name)
        document = tomllib.loads(text)
    except RecursionError:
        raise too_deep(file.name) from None
    except MemoryError as error:
        raise too_large_for_memory(file.name) from error
    except ValueError as error:  # of TOML, of UTF-8, of a number of thousands of digits
        todo = "mend it there: name = value, a text in quotes, a list in [ ]; the file is in UTF-8"
        raise InputError(f"{file.name} is not TOML", why=str(error), todo=todo) from error
    check_depth(document, file.name)
    refuse_unusable(document, text, file.name)
    return document


def toml_text(value: Any) -> str:
    """Return a JSON value as TOML, on one line; entries of a table that are None are left out."""
    if isinstance(value, Mapping):
        pairs = (f"{name} = {toml_text(entry)}" for name, entry in value.items() if entry is not None)
        return f"{{ {', '.join(pairs)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_text, value))}]"
    if isinstance(value, float):
        return repr(value)  # infinity too, which JSON has no word for
    # Strings, whole numbers and truth values are written as in JSON, but that the delete character is escaped as well.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def parse_json(text: str | bytes, place: str) -> Any:
    """Return the value of a JSON text. Raises `InputError` for one that is not JSON, or nested too deep.

    `place` names the text in messages.
    """
    try:
        document = json.loads(text)
    except RecursionError:
        raise too_deep(place) from None
    except ValueError as error:  # of JSON, of UTF-8, of a number of thousands of digits
        raise InputError(f"{place} is not JSON", why=str(error)) from error
    except MemoryError as error:
        raise too_large_for_memory(place) from error
    check_depth(document, place)
    refuse_unusable(document, text if isinstance(text, str) else text.decode(errors="replace"), place)
    return document


def check_depth(document: Any, place: str) -> None:
    """Raise `InputError` for plain values nested deeper than `DEEPEST_NESTING`, before a reader recurses into them."""
    # Breadth first, level by level: this check must not recurse either.
    level, depth = [document], 0
    while level := [entry for value in level for entry in _children(value)]:
        depth += 1
        if depth > DEEPEST_NESTING:
            raise too_deep(place)


def _children(value: Any) -> Iterable[Any]:
    return value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else ()


def too_deep(place: str) -> InputError:
    """Return the error of a document with too many tables and lists within each other."""
    return InputError(
        f"{place} is nested more than {DEEPEST_NESTING} levels deep", why="no document of ours needs that many"
    )


def convert(data: Any, kind: type[T] | Any, place: str, *, todo: str = "") -> T:
    """Return plain values (of TOML or JSON) as an instance of `kind`, a type that `msgspec.convert` takes.

    Raises `InputError` that names the entry below `place`, what it is and what it should be; `todo` is the advice. An
    unknown entry, kind or choice is an `UnknownNameError` with the closest known ones.
    """
    try:
        converted: T = msgspec.convert(data, kind)
    except OverflowError as error:
        raise InputError(f"{place} holds a whole number that no float can hold", why=str(error), todo=todo) from error
    except msgspec.ValidationError as error:
        # msgspec ends its messages with the path, as in " - at `$.cases[0].depth`".
        what, _, path = str(error).partition(" - at `$")
        steps = _steps(data, re.findall(r"\.?([^.\[\]`]+|\.\.\.)", path), what)
        with at(":".join([place, *_readable_places(data, steps)])):
            raise _misfit_error(data, kind, steps, what, todo) from error
    return converted


def _steps(data: Any, path: list[str], what: str) -> list[str]:
    """Return the keys that lead to an entry; for "...", msgspec's word for a mapping's key, the key that was meant."""
    quoted = re.search("'.*'", what)
    steps = []
    for step in path:
        # In a mapping msgspec names no key: take the entry that holds what the message quotes.
        if step == "..." and quoted is not None and isinstance(data, Mapping):
            step = next((str(key) for key, value in data.items() if quoted[0] in repr(value)), step)
        steps.append(step)
        data = _entry_at(data, step)
    return steps


def _readable_places(data: Any, steps: list[str]) -> Iterator[str]:
    """Yield where an entry is, for a message, as in ` case 'press'` and ` trajectory.depth`."""
    place = ""
    for step in steps:
        data = _entry_at(data, step)
        # An item of a list is named by its own name where it has one, and else by its index.
        names = [data[key] for key in ("name", "title", "label") if key in data] if isinstance(data, Mapping) else []
        if step.isdigit() and names:
            yield f" {place} '{names[0]}'"
            place = ""
        else:
            place += f"[{step}]" if step.isdigit() else f".{step}" if place else step
    if place:
        yield f" {place}"


def _entry_at(data: Any, step: str) -> Any:
    try:
        # A step is a key of a table or an index of a list; one that leads nowhere gives None.
        return data[int(step)] if isinstance(data, list) else data[step]
    except (KeyError, IndexError, TypeError, ValueError):
        return None


def _misfit_error(data: Any, kind: Any, steps: list[str], what: str, todo: str) -> InputError:
    """Return the error for the entry at `steps` of `data`, which msgspec refuses with the words `what`."""
    value, expected = data, inspect.type_info(kind)
    for step in steps:
        expected, value = _entry_type(expected, value, step), _entry_at(value, step)
    # Case 1: an entry that the table has not. The close names are those of its fields.
    unknown = re.fullmatch(r"Object contains unknown field `(.*)`", what)
    if unknown:
        struct = _matching_type(expected, value)
        known = [field.encode_name for field in struct.fields] if isinstance(struct, inspect.StructType) else []
        return UnknownNameError("entry", unknown[1], known)
    # Case 2: a word or a kind that is none of the choices.
    choices = list(_choices(expected))
    if what.startswith("Invalid") and choices:
        return UnknownNameError("kind" if steps[-1:] == ["kind"] else "choice", str(value), choices)
    # Case 3: a value of a wrong type or out of its range. msgspec's words, and the value where it is short to show.
    text = repr(value)
    quoted_value = "" if isinstance(value, Mapping | list) or value is None else f", and it is {shortened(text)}"
    return InputError(what[0].lower() + what[1:] + quoted_value, todo=todo)


def _entry_type(expected: Any, value: Any, step: str) -> Any:
    """Return the type of the entry `step` of a `value` of type `expected`, or None; of `kind` the whole union."""
    expected = _matching_type(expected, value)
    if isinstance(expected, inspect.StructType):
        return next((field.type for field in expected.fields if field.encode_name == step), None)
    # A tag that is none of the union's leaves the struct unknown: its choices are those of the whole union.
    if isinstance(expected, inspect.UnionType) and step == "kind":
        return expected
    # The type of a mapping's values or of a list's items; None for a scalar.
    return getattr(expected, "value_type", getattr(expected, "item_type", None))


def _matching_type(expected: Any, value: Any) -> Any:
    """Return which of several types a value is of, by its kind or its being a table or a list; else `expected`."""
    if not isinstance(expected, inspect.UnionType):
        return expected
    structs: list[Any] = [member for member in expected.types if isinstance(member, inspect.StructType)]
    tagged = [
        struct for struct in structs if isinstance(value, Mapping) and value.get(str(struct.tag_field)) == struct.tag
    ]
    lists: list[Any] = [member for member in expected.types if isinstance(value, list) and hasattr(member, "item_type")]
    # In this order: the table with the kind that it names, a list for a list, the only table that there is.
    return next(iter(tagged + lists + structs[:1] * (len(structs) == 1)), expected)


def _choices(expected: Any) -> Iterator[str]:
    """Yield the kinds of tables, or the words, that a type allows."""
    for member in expected.types if isinstance(expected, inspect.UnionType) else [expected]:
        if isinstance(member, inspect.StructType) and member.tag is not None:
            yield str(member.tag)
        elif isinstance(member, inspect.LiteralType):
            yield from map(str, member.values)
        elif isinstance(member, inspect.EnumType):
            yield from (str(choice.value) for choice in member.cls)
