"""Files that hold several trials: which there are, and one of them as a table of its own.

Trials are groups of a file, or elements of an array of structures, that have the same columns, as `data/demo_0/pos` and
`data/demo_1/pos`, with a clock each or of different lengths; or rows that a column numbers, as `episode_index`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hapticeval.errors import UnknownNameError
from hapticeval.recordings.formats import Table

GROUP = re.compile(r"(?P<trial>.*?\d\]?)[/.](?P<column>.+)")
"""A path whose first part that ends with a number, `data/demo_0` or `trials[0]`, is that of a trial."""

CLOCK_LEAF = re.compile(r"(.*[/._])?(t|time|timestamp|stamp|clock)s?", re.IGNORECASE)
NUMBERED = re.compile(r"(.*[/._])?(trial|episode|demo|run)(_?(index|id|number|nr))?", re.IGNORECASE)
"""The name of a clock within a trial, and of a column that numbers the trials."""


def trials(table: Table) -> list[str]:
    """Return the names of the trials of a table, in its order; none where it holds one run."""
    groups = _groups(table)
    if len(groups) > 1:
        return list(groups)
    numbering = _numbering(table)
    return [] if numbering is None else [f"{number:g}" for number in np.unique(table[numbering])]


def trial_of(table: Table, trial: str) -> Table:
    """Return one trial of a table, by its name, its last part or its number from 0, under the names within it.

    Raises `UnknownNameError`, with those that there are, for any other.
    """
    names = trials(table)
    last_parts = {re.split(r"[/.]", name)[-1]: name for name in names}
    place = int(trial) if trial.isdecimal() and trial not in names else -1
    name = trial if trial in names else last_parts.get(trial) or (names[place] if 0 <= place < len(names) else None)
    if name is None:
        raise UnknownNameError("trial", trial, names)
    groups = _groups(table)
    if len(groups) > 1:
        columns = groups[name]
        return replace(
            table,
            columns={inner: table[outer] for inner, outer in columns.items()},
            units=_renamed(table.units, columns),
            notes=_renamed(table.notes, columns),
            topics=_renamed(table.topics, columns),
        )
    numbering = _numbering(table)
    assert numbering is not None  # else it has no trials
    rows = table[numbering] == float(name)
    return replace(table, columns={column: table[column][rows] for column in table.columns})


def trials_remark(names: list[str]) -> str:
    """Return the remark on a file of several trials."""
    listed = ", ".join(names if len(names) < 6 else [*names[:3], "...", names[-1]])
    return f"it holds {len(names)} trials, {listed}: choose one by its name, or its number from 0: --trial {names[0]}"


def _groups(table: Table) -> Mapping[str, Mapping[str, str]]:
    """Return the columns of each group that is like the first, by the name within it: its name in the table."""
    groups: dict[str, dict[str, str]] = {}
    for name in table.columns:
        if match := GROUP.fullmatch(name):
            groups.setdefault(match["trial"], {})[match["column"]] = name
    first = next(iter(groups.values()), {})
    alike = {trial: columns for trial, columns in groups.items() if columns.keys() == first.keys()}
    # Signals of one scope are alike, too: trials have each a clock, or a length of its own.
    lengths = {table.rows(next(iter(columns.values()))) for columns in alike.values()}
    return alike if len(lengths) > 1 or any(map(CLOCK_LEAF.fullmatch, first)) else {}


def _numbering(table: Table) -> str | None:
    """Return the column that numbers the trials: a whole number that only rises, with several rows to each."""
    for name, values in table.columns.items():
        numbers = np.asarray(values)
        if NUMBERED.fullmatch(name) and numbers.size and np.array_equal(numbers, np.rint(numbers)):
            steps = np.diff(numbers)
            if np.all(steps >= 0) and 0 < np.count_nonzero(steps) < 0.5 * numbers.size:
                return name
    return None


def _renamed(words: Mapping[str, str], columns: Mapping[str, str]) -> dict[str, str]:
    return {inner: words[outer] for inner, outer in columns.items() if outer in words}
