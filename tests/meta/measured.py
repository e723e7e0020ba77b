"""What checks measure beside their metric, the numbers of evidence and message, at places of every kind of finding.

They stand in `measured.csv` beside this file: of each kind, which is a check's outcome with the words of its message
and the names of its evidence, the first few places of suites, of broken renderers, and of what tests ask a check about.
Where a change means to change one of them, run the tests that fail with HAPTICEVAL_PUBLISH=1, in one process, and look
at the difference. Words alone may change without.
"""

from __future__ import annotations

import csv
import os
import re
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from hapticeval.phenomena.verdict import Finding

TABLE = Path(__file__).with_name("measured.csv")
EACH = 2
"""Places of each kind of finding."""
CLOSE, ROUNDING = 2e-3, 1e-9
"""Share by which numbers may differ between two machines, and size, in SI units, under which they are rounding."""

CHAOTIC = "comes-to-rest"
"""A loop that does not come to rest makes rounding grow: no number of it is the same on another machine."""
FIRST_CALLS = 4
"""Findings of a check that one test may record: a property asks for many."""

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


class Place(NamedTuple):
    suite: str
    renderer: str
    case: str
    check: str


class Row(NamedTuple):
    """What is measured at a place: a digest of the kind of finding, and its numbers by name, in their own units."""

    kind: str
    numbers: dict[str, float]

    @property
    def tells(self) -> bool:
        """Whether its worst place is one: of a metric that is rounding it is another on another machine."""
        least = max(ROUNDING, 1e-6 * abs(self.numbers.get("bound", 0.0)))
        return bool(self.numbers) and abs(self.numbers.get("metric", 1.0)) > least

    @property
    def text(self) -> str:
        return " ".join(f"{name}={value:.5g}" for name, value in self.numbers.items())


def flattened(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of evidence, by names that say where they are."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield name, float(value)
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flattened(f"{name}.{key}", inner)
    elif isinstance(value, list | tuple):
        for number, inner in enumerate(value):
            yield from flattened(f"{name}.{number}", inner)


def row_of(finding: Finding) -> Row:
    words = re.sub(r"\s+", "-", NUMBER.sub("#", finding.message))
    said = {f"#{number}": float(text) for number, text in enumerate(NUMBER.findall(finding.message))}
    evidence = dict(flattened("", dict(finding.evidence)))
    bound = {} if finding.bound is None else {"bound": float(finding.bound)}
    metric = {} if finding.metric is None else {"metric": float(finding.metric.value)}
    level = "" if finding.level is None else finding.level.value
    names = ",".join(sorted(finding.evidence))
    kind = f"{finding.outcome.value} {level} {words} {names}"
    return Row(f"{zlib.crc32(kind.encode()):08x}", metric | bound | evidence | said)


@cache
def recorded() -> dict[Place, Row]:
    rows = csv.reader(TABLE.read_text(encoding="utf-8").splitlines()) if TABLE.exists() else ()
    return {
        Place(*place): Row(kind, {name: float(number) for name, number in (word.split("=") for word in words.split())})
        for *place, kind, words in rows
    }


def compare(suite: str, renderer: str, findings: Mapping[tuple[str, str], Finding]) -> None:
    """Assert that what is measured of a renderer, by case and check, is what is recorded of it, where it is."""
    rows = {Place(suite, renderer, *place): row_of(finding) for place, finding in findings.items()}
    if os.environ.get("HAPTICEVAL_PUBLISH"):
        publish(rows)
    for place, row in rows.items():
        if place in recorded():
            before = recorded()[place].numbers
            assert row.numbers == pytest.approx(before, rel=CLOSE, abs=ROUNDING, nan_ok=True), place


_calls: list[Any] = ["", Counter()]
"""The test that is running, and how often it has asked each check."""


def compare_asked(check: str, finding: Finding) -> None:
    """Assert the same of what a test asks a check about, the first few times."""
    test, _, phase = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")
    if _calls[0] != test:
        _calls[:] = test, Counter()
    number = _calls[1][check]
    _calls[1][check] += 1
    if phase == "(call)" and number < FIRST_CALLS:
        compare("tests", test, {(str(number), check): finding})


def publish(rows: Mapping[Place, Row]) -> None:
    """Record what is measured at places that are recorded, and at the first places of each kind."""
    table = recorded()
    for place, row in rows.items():
        alike = sum(other.kind == row.kind and there.check == place.check for there, other in table.items())
        if row.tells and place.check != CHAOTIC and (place in table or alike < EACH):
            table[place] = row
    write(table.items())


def write(table: Iterable[tuple[Place, Row]]) -> None:
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows((*place, row.kind, row.text) for place, row in table)
