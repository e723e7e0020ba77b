"""Marks: the times that the evidence of verdicts names, numbered alike in the figure and beside the verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hapticeval.runner.results import VerdictEntry
from hapticeval.types import Array


@dataclass(frozen=True)
class Mark:
    """A time (s) that a verdict's evidence names; `number` is shown beside it, and beside the verdict."""

    number: int
    time: float
    failed: bool


def marks_of(verdicts: Sequence[VerdictEntry]) -> dict[str, Mark]:
    """The marks of one run's verdicts, by check; verdicts whose evidence names no time have none."""
    timed = [verdict for verdict in verdicts if type(verdict.evidence.get("time")) in (int, float)]
    return {
        verdict.check: Mark(number, float(verdict.evidence["time"]), verdict.outcome == "fail")
        for number, verdict in enumerate(timed, start=1)
    }


def labels(numbers: Sequence[int], places: Sequence[Array], near: float) -> list[tuple[Array, str]]:
    """Where to write which numbers: marks closer than `near` to one another share a label, as in "1,3"."""
    groups: list[tuple[Array, list[int]]] = []
    for number, place in zip(numbers, places, strict=True):
        for where, together in groups:
            if np.linalg.norm(place - where) < near:
                together.append(number)
                break
        else:
            groups.append((place, [number]))
    return [(where, ",".join(map(str, together))) for where, together in groups]
