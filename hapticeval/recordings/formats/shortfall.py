"""How many rows of which columns a file that is cut short lacks, in words, and in time where a clock is whole."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.recordings.formats.text import CLOCKS, missing, step_of

FEW = 4
"""So many columns, and groups of columns, are named; the others are counted."""


def shortfall(columns: Mapping[str, ArrayLike], promised: Mapping[str, int], units: Mapping[str, str]) -> str:
    """For instance `of the 5000 rows of 'force' 2100 are there: 2900 rows (2.9 s) missing`; empty where none is lost.

    `columns` hold what is there and `promised` how many rows those should have that lack some.
    """
    alike: dict[tuple[int, int], list[str]] = {}
    for name, rows in promised.items():
        alike.setdefault((rows, np.size(columns.get(name, ()))), []).append(name)
    told = []
    for (rows, there), names in list(alike.items())[:FEW]:
        step, unit = _step(columns, promised, units, rows)
        kept = {0: "none is", 1: "1 is"}.get(there, f"{there} are")
        told.append(f"of the {rows} rows of {_listed(names)} {kept} there: {missing(rows - there, step, unit)} missing")
    if len(alike) > FEW:
        told.append(f"and so on for {sum(map(len, list(alike.values())[FEW:]))} more columns")
    return "; ".join(told)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - FEW} more" if len(names) > FEW else ""
    return ", ".join(f"'{name}'" for name in names[:FEW]) + more


def _step(
    columns: Mapping[str, ArrayLike], promised: Mapping[str, int], units: Mapping[str, str], rows: int
) -> tuple[float | None, str]:
    """The step of the clock, by its name, of columns of so many rows, and its unit."""
    for name, values in columns.items():
        leaf = re.split(r"[./]", re.sub(r"\s*[\[(].*", "", name))[-1].strip().lower()
        if leaf in CLOCKS and promised.get(name, np.size(values)) == rows:
            return step_of(np.asarray(values)), units.get(name, "in the unit of its clock")
    return None, ""
