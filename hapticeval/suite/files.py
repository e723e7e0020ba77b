"""The files that a case names: another machine that runs it must have them as well."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

from hapticeval.files import digest_of
from hapticeval.suite.case import Case


def files_of(case: Case) -> dict[str, str]:
    """Return the digest of each file that a case names, by its path."""
    # Any text of a case may name a file; what names none has no digest.
    named = {str((case.folder / text).resolve()) for text in _texts(msgspec.to_builtins(case, enc_hook=str)) if text}
    return {path: digest for path in sorted(named) if (digest := _digest_of(path)) is not None}


def _texts(value: Any) -> Iterator[str]:
    """Yield all texts in a document, at any depth."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, entry in value.items():
            # what files count from is not one of them
            if name != "folder":
                yield from _texts(entry)
    elif isinstance(value, list | tuple):
        for entry in value:
            yield from _texts(entry)


@lru_cache(maxsize=4096)
def _digest_of(path: str) -> str | None:
    """Return the digest of a file's content, read once a process; None for what is no file."""
    try:
        return digest_of(Path(path)) if Path(path).is_file() else None
    except OSError:
        return None
