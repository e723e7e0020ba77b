"""The suites that come with the package, by name and by group."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path as FilePath
from types import MappingProxyType

from hapticeval.errors import UnknownNameError


def find_suites() -> Mapping[str, FilePath]:
    """The suites that are installed, by name."""
    folder = FilePath(str(resources.files("hapticeval.suites")))
    return MappingProxyType({file.stem: file for file in sorted(folder.glob("*.toml"))})


def suites_named(name_or_path: str) -> tuple[str, ...]:
    """The suite of that name or path, or the group of suites whose names begin with it and a hyphen.

    Raises `UnknownNameError` for a name of neither.
    """
    known = find_suites()
    if name_or_path in known or FilePath(name_or_path).suffix == ".toml":
        return (name_or_path,)
    group = tuple(name for name in known if name.startswith(f"{name_or_path}-"))
    if not group:
        raise UnknownNameError("suite", name_or_path, [*known, *suite_groups()])
    return group


def suite_groups() -> Mapping[str, tuple[str, ...]]:
    """The groups of installed suites: what stands before the hyphen, and the names that begin so."""
    groups: dict[str, list[str]] = {}
    for name in find_suites():
        first, hyphen, _ = name.partition("-")
        if hyphen:
            groups.setdefault(first, []).append(name)
    return {first: tuple(names) for first, names in groups.items() if len(names) > 1}
