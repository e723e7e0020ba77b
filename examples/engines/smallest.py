"""Shrink a failing case of each column and check to the smallest path that fails: `make engines-smallest`.

It reads the results that `make engines` left, and writes smallest.csv, from which `make engines` takes the paths of its
page. No clock decides how small a path gets.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from hapticeval.errors import HapticevalError
from hapticeval.examples.engines.measure import COLUMNS, RESULTS, SMALLEST, Smallest, title_of
from hapticeval.runner.results import VerdictEntry, read_results
from hapticeval.search.shrink import Shrink
from hapticeval.search.trial import Bench, Fault
from hapticeval.stimulus.moves import Move, Moves
from hapticeval.stimulus.stimulus import Path as HandPath
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

TRIALS = 80
"""Cases that are tried for a path."""

MOST_POINTS = 12
"""Points up to which a suite's path is shrunk: one of more is a curve, and each of its points would be tried."""


def as_moves(case: Case, check: str) -> Case:
    """Return the case with that check alone, and its path of few points as even moves."""
    alone = replace(case, checks=(check,), published={})
    stimulus = case.build_stimulus(case.build_scene(), None)
    if not isinstance(stimulus, HandPath):
        return alone
    moves = tuple(
        Move(to=point.tolist(), seconds=float(seconds), even=True)
        for point, seconds in zip(stimulus.points[1:], np.diff(stimulus.time), strict=True)
    )
    return replace(alone, trajectory=Moves(start=stimulus.points[0].tolist(), moves=moves))


def candidates(failing: list[VerdictEntry]) -> Iterator[Case]:
    """Yield the cases of verdicts that fail which can be shrunk, the model of fewest triangles first."""
    cases = [load_suite(entry.suite).case(entry.case) for entry in failing]
    scenes = [case.build_scene() for case in cases]
    sizes = [len(scene.model.mesh().cells) for scene in scenes]
    for number in sorted(range(len(cases)), key=lambda number: (sizes[number], number)):
        stimulus = cases[number].build_stimulus(scenes[number], None)
        if not isinstance(stimulus, HandPath) or len(stimulus.points) <= MOST_POINTS:
            yield cases[number]


def fault_of(bench: Bench, case: Case, check: str) -> Fault | None:
    """Return what a check finds wrong in a case; None where it passes, or the renderer breaks."""
    return next((fault for fault in bench(case).faults if fault.check == check), None)


def path_words(case: Case) -> str:
    """Return a path, mm, or an experiment in words."""
    if case.experiment is not None:
        return f"an experiment of {case.experiment.duration:.3g} s"
    assert isinstance(case.trajectory, Moves)
    points = [case.trajectory.start, *(move.to for move in case.trajectory.moves)]
    places = " to ".join("(" + ", ".join(f"{1e3 * x + 0.0:.6g}" for x in point) + ")" for point in points)
    return f"{places} mm in {case.trajectory.seconds:.3g} s"


def shrink_one(bench: Bench, failing: list[VerdictEntry]) -> Smallest | None:
    """Return the smallest path on which a column fails a check as in the first case that can be shrunk."""
    check = failing[0].check
    for case in candidates(failing):
        start = as_moves(case, check)
        fault = fault_of(bench, start, check)
        if fault is None:
            continue

        def same(smaller: Case, fault: Fault = fault) -> Fault | None:
            smaller_fault = fault_of(bench, smaller, check)
            return smaller_fault if smaller_fault is not None and smaller_fault.same(fault) else None

        shrink = Shrink(start, fault, same)
        shrink.run(TRIALS)
        return Smallest(
            title_of(failing[0]), check, case.name, path_words(shrink.case), shrink.fault.message.replace("\n", " ")
        )
    return None


def main() -> None:
    """Shrink what fails in the results of `make engines`, and write smallest.csv."""
    entries = [
        entry
        for entry in read_results(Path(RESULTS)).verdicts
        if entry.level in ("must", "should") and entry.outcome == "fail" and entry.renderer in COLUMNS.values()
    ]
    rows = []
    for column, name in COLUMNS.items():
        with Bench(name, 0, lambda: False) as bench:
            for check in dict.fromkeys(entry.check for entry in entries if entry.renderer == name):
                failing = [entry for entry in entries if (entry.renderer, entry.check) == (name, check)]
                try:
                    row = shrink_one(bench, failing)
                except HapticevalError as error:
                    print(f"{column} {check}: {error}")
                    continue
                if row is not None:
                    rows.append(row)
                    print(*row, sep=": ", flush=True)
    with SMALLEST.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([Smallest._fields, *rows])


if __name__ == "__main__":
    main()
