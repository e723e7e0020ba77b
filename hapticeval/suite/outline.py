"""Suites without building a scene: which are installed, and the titles and cases of files, to list them quickly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import resources
from itertools import takewhile
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from hapticeval.documents import read_toml
from hapticeval.errors import UnknownNameError


def find_suites() -> Mapping[str, Path]:
    """The suites that are installed, by name."""
    folder = Path(str(resources.files("hapticeval.suites")))
    return MappingProxyType({file.stem: file for file in sorted(folder.glob("*.toml"))})


def suites_named(name_or_path: str) -> tuple[str, ...]:
    """Return the suite of that name or path, or the group of suites whose names begin with it and a hyphen.

    Raises `UnknownNameError` for a name of neither.
    """
    known = find_suites()
    # A suite of just that name goes before a group.
    if name_or_path in known or Path(name_or_path).suffix == ".toml":
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


class Heading(NamedTuple):
    """Name and title of a case."""

    name: str
    title: str

    def swept(self, label: str, depth: float) -> Heading:
        """Return name and title of the case at another depth (m) of a sweep, which has that label."""
        return Heading(f"{self.name}-{label}", f"{self.title}: {1e3 * depth:.3g} mm")

    def varied(self, label: str, title: str) -> Heading:
        """Return name and title of the case in the scene of a variant, which has that label and title."""
        return Heading(f"{self.name}-{label}", f"{self.title}, {title}")


class Outline(NamedTuple):
    """A suite: its title, version and citation, and its cases, each with whether it is judged."""

    title: str
    version: str
    citation: str
    cases: tuple[tuple[Heading, bool], ...]


def outline(file: Path) -> Outline:
    """Return what lists show of a sound suite file; `load_suite` reads any other, and says what is wrong."""
    document = read_toml(file)
    variants = document.get("variant", {})
    cases = tuple(case for table in document["case"] for case in _cases(table, variants))
    return Outline(document["title"], document.get("version", ""), document.get("citation", ""), cases)


def _cases(table: dict[str, Any], variants: dict[str, Any]) -> Iterator[tuple[Heading, bool]]:
    heading, judged = Heading(table["name"], table["title"]), table.get("judged", True)
    # A sweep stands in the place of its case; variants stand beside it.
    if "sweep" in table:
        yield from (
            (heading.swept(depth_entry["label"], depth_entry["depth"]), judged) for depth_entry in table["sweep"]
        )
        return
    yield heading, judged
    for label in table.get("variants", ()):
        yield heading.varied(label, variants[label]["title"]), variants[label].get("judged", judged)
