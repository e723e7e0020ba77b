"""Titles and cases of suite files, read without building a scene, to list them quickly."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from hapticeval.documents import read_toml


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
