"""Write files whole or not at all, under safe names and as JSON, and check which files a suite may name."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np

from hapticeval.errors import InputError, printable, unwritable

T = TypeVar("T")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|-?inf|nan", re.IGNORECASE)
SAFE_STEM = re.compile(r"[a-z0-9][a-z0-9._-]{0,59}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary file beside `path` that takes its place when the block ends well, and vanishes otherwise.

    Readers see the old file or the new one, never a part of one. Missing folders are made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # Process and thread in the name: two that write the same file at once do not share a temporary one.
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def creating(path: Path) -> Iterator[Path]:
    """Give a temporary file as `replacing` does, for a file that must not be there yet: recordings are not overwritten.

    Raises `InputError` where there is one, also where another process made it in the meantime.
    """
    refuse_existing(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        yield temporary
        try:
            # A link fails where the name exists: look and creation are one step, which renaming is not.
            os.link(temporary, path)
        except FileExistsError:
            raise existing_file_error(path) from None
        except OSError:  # a file system without links: the look and the renaming are two steps there
            if path.exists():
                raise existing_file_error(path) from None
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def writing(what: Path | str) -> Iterator[None]:
    """Turn what keeps a file from being written, in the block, into a `HapticevalError` that names `what`."""
    try:
        yield
    except OSError as error:
        raise unwritable(str(what), error) from error


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all. Raises `HapticevalError` where it cannot be written."""
    with writing(path), replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def refuse_existing(path: Path) -> None:
    """Raise `InputError` where something stands at `path`."""
    if path.exists() or path.is_symlink():
        raise existing_file_error(path)


def existing_file_error(path: Path) -> InputError:
    """Return the error of a file that must not be there yet."""
    why = "nothing is written over an existing file"
    return InputError(f"{path} is there already", why=why, todo="give another name")


def file_stem(name: str) -> str:
    """Return a name as a file stem that is safe on every file system; different names give different stems.

    Short names of small letters, digits, dots, hyphens and underscores stay as they are. Any other keeps what it can,
    followed by "~" and a digest of the name. Capitals count as unsafe, for some file systems ignore case.
    """
    if SAFE_STEM.fullmatch(name) and not name.endswith("."):
        return name
    # 40 characters at most, a tilde and 12 digits: the tilde makes it differ from every name that is safe as it is.
    safe_part = re.sub(r"[^a-z0-9._-]+", "-", name.lower()).strip("-.")[:40]
    return f"{safe_part}~{hashlib.sha256(name.encode('utf-8', 'surrogatepass')).hexdigest()[:12]}"


def csv_cell(text: str) -> str:
    """Return a text for a CSV file: its control characters written out, and no formula of a spreadsheet, by a quote.

    A number stays as it is, and so do dashes that stand for nothing.
    """
    text = printable(" ".join(text.split()))
    # A spreadsheet runs a cell that begins so, whoever wrote it.
    formula = text.startswith(("=", "+", "-", "@")) and text.strip("-") and not NUMBER.fullmatch(text)
    return f"'{text}" if formula else text


def digest_of(file: Path) -> str:
    """Return the SHA-256 of a file's content, in hexadecimal digits. Raises `OSError`."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def plain(value: Any, place: str = "value") -> Any:
    """Return a value in JSON's own types: dict, list, str, int, float, bool, None; numpy's are converted.

    Floats are kept as they are, the non-finite ones too: see `without_non_finite`. Raises `InputError`, naming
    the place, for a type that JSON has no counterpart of.
    """
    # bool before int, of which it is a subclass.
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        # Subclasses, such as of StrEnum, become the plain type.
        return str(value)
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value)
    if isinstance(value, np.generic | np.ndarray):
        # tolist gives Python's own numbers, in nested lists.
        return plain(value.tolist(), place)
    if isinstance(value, Mapping):
        return {str(key): plain(entry, f"{place}.{key}") for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry, f"{place}[{index}]") for index, entry in enumerate(value)]
    raise InputError(
        f"{place} is a {type(value).__name__}",
        why="only numbers, text, lists and mappings can be written as JSON",
        todo="convert it before it is handed over",
    )


def without_non_finite(value: Any, place: str = "value") -> tuple[Any, list[str]]:
    """Return a plain value with null for each NaN or infinity, and what these were: ["evidence.gain = inf", ...]."""
    # JSON has no number for it: null, and the place with the value in words.
    if isinstance(value, float) and not math.isfinite(value):
        return None, [f"{place} = {value}"]
    non_finite: list[str] = []
    if isinstance(value, dict):
        mapping = {}
        for key, entry in value.items():
            mapping[key], more = without_non_finite(entry, f"{place}.{key}")
            non_finite += more
        return mapping, non_finite
    if isinstance(value, list):
        items = []
        for index, entry in enumerate(value):
            finite, more = without_non_finite(entry, f"{place}[{index}]")
            items.append(finite)
            non_finite += more
        return items, non_finite
    return value, non_finite


def write_json(path: Path, document: Any) -> Path:
    """Write a typed `document` as JSON, whole or not at all, and return the path; null stands for non-finite numbers.

    Raises `InputError` for a document that its type would not take, and `HapticevalError` where it cannot be written.
    """
    import msgspec

    from hapticeval.documents import convert

    # Reading it back is the check: a typed struct does not check its fields when it is made.
    text = msgspec.json.encode(document)
    try:
        msgspec.json.decode(text, type=type(document))
    except msgspec.ValidationError:
        convert(json.loads(text), type(document), path.name)  # names the place
        raise
    with writing(path), replacing(path) as temporary:
        temporary.write_bytes(msgspec.json.format(text, indent=1) + b"\n")
    return path


def read_json(path: Path, kind: type[T], *, version: int, command: str) -> T:
    """Read a document of type `kind` that `hapticeval COMMAND -o FOLDER` wrote into its folder.

    Raises `InputError`, naming file and place, for a folder or file that is not there, JSON that is broken, another
    `format_version` than `version`, and what does not fit the type.
    """
    folder = path.parent
    todo = f"name the folder that `hapticeval {command} -o` wrote"
    again = f"run `hapticeval {command}` again: the file was cut, damaged or edited"
    if not folder.is_dir():
        why = "it is a file" if folder.exists() else "there is no such folder"
        raise InputError(f"no result folder '{folder}'", why=why, todo=todo)
    if not path.exists():
        raise InputError(f"'{folder}' holds no {path.name}", why=f"`hapticeval {command}` writes it", todo=todo)
    document = parse_json(path, todo=again)
    # What is not a table is left to `convert`, whose message is better.
    file_version = document.get("format_version") if isinstance(document, dict) else version
    if file_version != version:
        # An older format was never released: such a file is damaged or edited.
        newer = isinstance(file_version, int) and file_version > version
        raise InputError(
            f"{path} has format {file_version!r}; this hapticeval reads format {version}",
            why="a newer hapticeval wrote it" if newer else "no such format was released",
            todo="update hapticeval" if newer else again,
        )
    from hapticeval.documents import convert

    return convert(document, kind, str(path), todo=f"run `hapticeval {command}` again, or mend that entry")


def parse_json(path: Path, *, todo: str) -> Any:
    """Return what a JSON file holds. Raises `InputError` with that `todo` where it cannot be read or is not JSON."""
    from hapticeval.documents import LARGEST_JSON, check_depth, read_text, refuse_unusable, too_large_for_memory

    try:
        text = read_text(path, largest=LARGEST_JSON)
        # Python reads NaN and Infinity, which are not JSON: refused.
        document = json.loads(text, parse_constant=_refuse_constant)
    except MemoryError as error:
        raise too_large_for_memory(str(path)) from error
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise InputError(f"{path} is not JSON: {place}", why=error.msg, todo=todo) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not JSON text", why=str(error), todo=todo) from error
    check_depth(document, str(path))
    refuse_unusable(document, text, str(path))
    return document


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"it holds {name}, which is not a JSON number")


def file_below(folder: Path, name: str) -> Path:
    """Return the path of a file that a suite names. Raises `InputError` unless it lies below `folder`."""
    file = folder / name
    try:
        # Both resolved: neither ".." nor a link leads out of the folder.
        below, odd = file.resolve().is_relative_to(folder.resolve()), file.exists() and not file.is_file()
    except (OSError, ValueError) as error:  # a name too long for the system, or with a null character
        from hapticeval.documents import shortened

        why = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise InputError(f"the file '{printable(shortened(name))}' cannot be looked for", why=why) from error
    if not below:
        raise InputError(
            f"the file '{name}' is not below the suite's folder {folder}",
            why="a suite may come from anyone, and reads no other files of this machine",
            todo="copy the file beside the suite",
        )
    if odd:
        raise InputError(f"'{name}' is not a file", why="a pipe, a device or a folder has no rows to read")
    return file
