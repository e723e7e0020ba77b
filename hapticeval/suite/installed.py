"""The suites that come with the package, by name and by group."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from itertools import takewhile
from pathlib import Path as FilePath
from types import MappingProxyType

from hapticeval.errors import UnknownNameError


def find_suites() -> Mapping[str, FilePath]:
    """The suites that are installed, by name."""
    folder = FilePath(str(resources.files("hapticeval.suites")))
    return MappingProxyType({file.stem: file for file in sorted(folder.glob("*.toml"))})


def suites_named(name_or_path: str) -> tuple[str, ...]:
    """Return the suite of that name or path, or the group of suites whose names begin with it and a hyphen.

    Raises `UnknownNameError` for a name of neither.
    """
    known = find_suites()
    # A suite of just that name goes before a group.
    if name_or_path in known or FilePath(name_or_path).suffix == ".toml":
        return (name_or_path,)
    group = tuple(name for name in known if name.startswith(f"{name_or_path}-"))
    if not group:
        raise UnknownNameError("suite", name_or_path, [*known, *suite_groups()])
    return group


def suite_groups() -> Mapping[str, tuple[str, ...]]:
    """Return the groups of installed suites: a group is named by the words with which all its suites' names begin.

    Suites are of one group where the first word is the same. Where the group's name is a suite's, there is no group.
    """
    known = find_suites()
    families: dict[str, list[str]] = {}
    for name in known:
        families.setdefault(name.partition("-")[0], []).append(name)
    groups: dict[str, tuple[str, ...]] = {}
    for names in families.values():
        # The words of all names at the first place, then at the second, and so on.
        words = zip(*(name.split("-") for name in names), strict=False)
        group = "-".join(
            first for first, *_ in takewhile(lambda words_at_one_place: len(set(words_at_one_place)) == 1, words)
        )
        if group not in known:
            groups[group] = tuple(names)
    return groups
