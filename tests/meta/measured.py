"""What checks measure beside their metric, the numbers of evidence and message, at places of every kind of finding.

They stand in `measured.csv` beside this file: of each kind, which is a check's outcome with the words of its message
and the names of its evidence, the first few places of suites, of broken renderers, and of what tests ask a check about,
as it is and shaken (`shaken.py`). Where a change means to change one of them, run the tests that fail with
HAPTICEVAL_PUBLISH=1, in one process, and look at the difference.
"""

from __future__ import annotations

import csv
import os
import re
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from publishing import publishing
from shaken import off_by_rounding, shaken

from hapticeval.errors import InputError
from hapticeval.files import replacing
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.verdict import Finding
from hapticeval.scene import Scene

TABLE = Path(__file__).with_name("measured.csv")
EACH = OF_ONE = 2
"""Places of each kind of finding, and of those of one renderer or test."""
CLOSE, ROUNDING = 2e-3, 1e-9
"""Share by which numbers of a simulation may differ between two machines, and size, in SI units, that is rounding."""
EXACT, TINY = 1e-5, 1e-12
"""The same of recordings that tests make; a short simulation among them differed by 1.2e-6 on another processor."""

CHAOTIC = "comes-to-rest"
"""A loop that does not come to rest makes rounding grow: no number of it is the same on another machine."""
FIRST_CALLS, SHAKES = 4, 8
"""Findings of a check that one test may record, for a test may ask for many, and how often each is shaken."""
QUICK = 0.015
"""What takes longer to judge, s of the processor, is not asked once more."""
MOST_NUMBERS = 60

LONGEST_MESSAGE, USUAL_MESSAGE = 200, 120
"""Characters of a message at the most, and in the median."""

NUMBER = re.compile(r"(?<![\w.])-?(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?(?:e[+-]?\d+)?")


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
        return bool(self.numbers) and abs(self.numbers.get("metric", 1.0)) > self.least_metric

    @property
    def least_metric(self) -> float:
        """Size up to which a metric is rounding, in the metric's unit."""
        return max(ROUNDING, 1e-6 * abs(self.numbers.get("bound", 0.0)))

    @property
    def text(self) -> str:
        return " ".join(f"{name}={value:.9g}" for name, value in self.numbers.items())


def flattened(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of evidence, by names that say where they are, without spaces."""
    if isinstance(value, int | float):
        yield "-".join(name.split()), float(value)
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flattened(f"{name}.{key}", inner)
    elif isinstance(value, list | tuple):
        for number, inner in enumerate(value):
            yield from flattened(f"{name}.{number}", inner)


def row_of(finding: Finding) -> Row:
    words = re.sub(r"\s+", "-", NUMBER.sub("#", finding.message))
    said = {f"#{number}": float(text.replace(",", "")) for number, text in enumerate(NUMBER.findall(finding.message))}
    evidence = dict(flattened("", dict(finding.evidence)))
    bound = {} if finding.bound is None else {"bound": float(finding.bound)}
    metric = {} if finding.metric is None else {"metric": float(finding.metric.value)}
    level = "" if finding.level is None else finding.level.value
    names = ",".join(sorted(finding.evidence))
    kind = f"{finding.outcome.value} {level} {words} {names}"
    return Row(f"{zlib.crc32(kind.encode()):08x}", metric | bound | evidence | said)


def wanted() -> bool:
    """Whether this run compares or records findings: an aid for who reviews a change, and no part of the gate."""
    return bool(os.environ.get("HAPTICEVAL_MEASURES")) or publishing()


@cache
def recorded() -> dict[Place, Row]:
    rows = csv.reader(TABLE.read_text(encoding="utf-8").splitlines()) if TABLE.exists() else ()
    return {
        Place(*place): Row(kind, {name: float(number) for name, number in (word.split("=") for word in words.split())})
        for *place, kind, words in rows
    }


def compare(suite: str, renderer: str, findings: Mapping[tuple[str, str], Finding]) -> None:
    """Assert that what is measured of a renderer, by case and check, is what is recorded of it, where it is."""
    if not wanted():
        return
    rows = {Place(suite, renderer, *place): row_of(finding) for place, finding in findings.items()}
    if publishing():
        told = {place: row for place, row in rows.items() if row.tells and place.check != CHAOTIC}
        withdraw(rows.keys() - told.keys())
        publish(told)
    for place, row in rows.items():
        agree(place, row, CLOSE, ROUNDING)


def agree(place: Place, row: Row, close: float, rounding: float) -> None:
    """Assert that a row has the numbers that are recorded of its place, where it is; those that are new may be."""
    if place in recorded():
        before = recorded()[place].numbers
        # Of a metric that is rounding another place is the worst elsewhere; of zeros the first is it anywhere.
        if 0.0 < abs(before.get("metric", 0.0)) <= recorded()[place].least_metric:
            assert not row.tells, place
            before = {name: number for name, number in before.items() if name == "bound"}
        numbers = {name: row.numbers.get(name) for name in before}
        assert numbers == pytest.approx(before, rel=close, abs=rounding, nan_ok=True), place


class Call(NamedTuple):
    """What a test asked a check, and what was found."""

    check: Check
    runs: Runs
    scene: Scene
    seconds: float

    def row(self, seed: int | None = None, change: Callable[[Runs], Runs] = lambda runs: runs) -> Row:
        """Return what the check finds, shaken by a seed and changed; nothing where it refuses what a shake leaves.

        So it may what a test asked of it with a part of it replaced.
        """
        try:
            runs = self.runs if seed is None else shaken(self.runs, self.scene, seed)
            return row_of(self.check(change(runs), self.scene))
        except (InputError, ValueError):  # a channel that it reads is missing, or siblings do not fit each other
            return Row("", {})

    def is_sound(self, row: Row, seed: int | None) -> bool:
        """Return whether a row stays the same, a hundred times closer than is asked, for numbers off by rounding."""
        other = self.row(seed, off_by_rounding)
        same = pytest.approx(other.numbers, rel=0.01 * EXACT, abs=0.01 * TINY, nan_ok=True)
        return row.kind == other.kind and row.numbers == same


@contextmanager
def watched(test: str) -> Iterator[None]:
    """Assert that what a test asks checks about has the findings that are recorded, as it is and shaken."""
    calls: dict[tuple[str, int], Call] = {}
    counts: Counter[str] = Counter()
    ask = Check.__call__

    def listen(check: Check, runs: Runs, scene: Scene) -> Finding:
        began = time.process_time()
        finding = ask(check, runs, scene)
        if counts[check.id] < FIRST_CALLS:
            calls[check.id, counts[check.id]] = Call(check, runs, scene, time.process_time() - began)
        counts[check.id] += 1
        return finding

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Check, "__call__", listen)
        yield
    for (check, number), call in calls.items():
        for shake in range(SHAKES + 1):
            place = Place("tests", test, f"{number}.{shake}", check)
            if place not in recorded() and not publishing():
                continue
            seed = zlib.crc32(" ".join(place).encode()) if shake else None
            if publishing() and place not in recorded() and call.seconds > QUICK:
                continue
            row = call.row(seed)
            if publishing() and is_wanted(place, row):
                if 0 < len(row.numbers) < MOST_NUMBERS and call.is_sound(row, seed):
                    publish({place: row})
                else:
                    withdraw([place])
            agree(place, row, EXACT, TINY)
            assert place not in recorded() or row.kind == recorded()[place].kind, f"{place}: other words"


def is_wanted(place: Place, row: Row) -> bool:
    """Return whether a place is recorded already, or one of the first of its kind."""
    table = recorded()
    alike = [there for there, other in table.items() if other.kind == row.kind and there.check == place.check]
    of_one = sum(there[:2] == place[:2] for there in alike)
    return place in table or (len(alike) < EACH and of_one < OF_ONE)


def publish(rows: Mapping[Place, Row]) -> None:
    """Record what is measured at places that are recorded, and at the first places of each kind."""
    table = recorded()
    for place, row in rows.items():
        if is_wanted(place, row):
            table[place] = row
    write(table.items())


def withdraw(places: Iterable[Place]) -> None:
    """Take out of the table what is recorded at places that tell nothing any more."""
    table = recorded()
    gone = [place for place in places if table.pop(place, None) is not None]
    if gone:
        write(table.items())


def write(table: Iterable[tuple[Place, Row]]) -> None:
    with replacing(TABLE) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows((*place, row.kind, row.text) for place, row in table)
