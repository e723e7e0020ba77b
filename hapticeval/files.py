"""What is written to disk: whole or not at all, under safe names, as values that JSON can hold."""

from __future__ import annotations

import hashlib
import math
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError

SAFE = re.compile(r"[a-z0-9][a-z0-9._-]{0,59}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary file beside `path` that takes its place when the block ends well, and vanishes otherwise.

    Readers see the old file or the new one, never a part of one. Missing folders are made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def creating(path: Path) -> Iterator[Path]:
    """As `replacing`, for a file that must not be there yet: what somebody recorded is never written over.

    Raises `InputError` where there is one, also where another process made it in the meantime.
    """
    if path.exists():
        raise _exists(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        yield temporary
        try:
            os.link(temporary, path)
        except FileExistsError:
            raise _exists(path) from None
        except OSError:  # a file system without links: the look and the renaming are two steps there
            if path.exists():
                raise _exists(path) from None
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _exists(path: Path) -> InputError:
    return InputError(
        f"{path} is there already", why="nothing is written over an existing file", todo="give another name"
    )


def file_stem(name: str) -> str:
    """A name as a file stem that is safe on every file system, different names giving different stems.

    Short names of small letters, digits, dots, hyphens and underscores stay as they are; of any other, what can
    be kept is followed by "~" and a digest of the whole. File systems that ignore case are the reason why
    capitals count as unsafe.
    """
    if SAFE.fullmatch(name) and not name.endswith("."):
        return name
    kept = re.sub(r"[^a-z0-9._-]+", "-", name.lower()).strip("-.")[:40]
    return f"{kept}~{hashlib.sha256(name.encode('utf-8', 'surrogatepass')).hexdigest()[:12]}"


def plain(value: Any, place: str = "value") -> Any:
    """The same value in JSON's own types: dict, list, str, int, float, bool, None; numpy's are converted.

    Floats are kept as they are, the non-finite ones too: see `without_non_finite`. Raises `InputError`, naming
    the place, for a type that JSON has no counterpart of.
    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return str(value)
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value)
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist(), place)
    if isinstance(value, Mapping):
        return {str(key): plain(item, f"{place}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, f"{place}[{index}]") for index, item in enumerate(value)]
    raise InputError(
        f"{place} is a {type(value).__name__}",
        why="only numbers, text, lists and mappings can be written as JSON",
        todo="convert it before it is handed over",
    )


def without_non_finite(value: Any, place: str = "value") -> tuple[Any, list[str]]:
    """A plain value with null for each NaN or infinity, and what these were: ["evidence.gain = inf", ...]."""
    if isinstance(value, float) and not math.isfinite(value):
        return None, [f"{place} = {value}"]
    lost: list[str] = []
    if isinstance(value, dict):
        mapping = {}
        for key, item in value.items():
            mapping[key], more = without_non_finite(item, f"{place}.{key}")
            lost += more
        return mapping, lost
    if isinstance(value, list):
        items = []
        for index, item in enumerate(value):
            kept, more = without_non_finite(item, f"{place}[{index}]")
            items.append(kept)
            lost += more
        return items, lost
    return value, lost
