"""What installed packages register: their entry points, by group."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any


def entries_of(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, of all installed packages, in the order of `sys.path`."""
    return _entries_in(tuple(sys.path), group)


@lru_cache(maxsize=16)
def _entries_in(folders: tuple[str, ...], group: str) -> tuple[EntryPoint, ...]:
    return tuple(_all_entries_in(folders).select(group=group))


@lru_cache(maxsize=4)
def _all_entries_in(folders: tuple[str, ...]) -> Any:  # noqa: ARG001
    # Looked through once (20 ms) for a sys.path: a test or a notebook that adds a folder sees its entry points too.
    return entry_points()  # of another type before Python 3.12, and from there on EntryPoints


def by_name(entries: Iterable[EntryPoint]) -> dict[str, EntryPoint]:
    """Return entry points by name, in alphabetical order; of two of a name the last."""
    return {entry.name: entry for entry in sorted(entries, key=lambda entry: entry.name)}
