"""Entries of results.json with everything that a test does not care about filled in."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import msgspec

from hapticeval.phenomena.verdict import Verdict
from hapticeval.runner.results import Command, Environment, ResultsDocument, RunEntry, SceneEntry, Timing, VerdictEntry

SCENE = SceneEntry(stiffness=1000.0, damping=0.0, mass=0.1, bilateral=False, restitution=0.0, sampling_time=1e-3)


def changed(entry: Any, **changes: Any) -> Any:
    """The entry with some of its fields replaced."""
    return msgspec.structs.replace(entry, **changes)


def run_entry(**changes: Any) -> RunEntry:
    """A run of a renderer `r` in the case `c` of the suite `s`, without a recording."""
    given: dict[str, Any] = {
        "suite": "s",
        "case": "c",
        "renderer": "r",
        "recording": None,
        "simulated_seconds": 2.0,
        "wall_seconds": 0.125,
        "stimulus": "trajectory",
        "title": "A case",
        "shows": None,
        "citation": "6.1.2",
        "model": {"kind": "cassinian"},
        "depth_of": "model",
        "judged": True,
        "scene": SCENE,
        "closed_form": None,
        "ended": None,
        "error": None,
        "refusal": None,
    }
    return RunEntry(**{**given, **changes})


def apart(verdicts: Iterable[VerdictEntry]) -> list[VerdictEntry]:
    """The verdicts, each of a case of its own where a test has given several the same."""
    taken: set[tuple[str, ...]] = set()
    listed = []
    for verdict in verdicts:
        free = verdict
        while (*free.key, free.check) in taken:
            free = changed(free, case=f"{free.case}'")
        taken.add((*free.key, free.check))
        listed.append(free)
    return listed


def results_of(*verdicts: Verdict | VerdictEntry, strict: bool = False, **changes: Any) -> ResultsDocument:
    """Complete results with these verdicts."""
    given: dict[str, Any] = {
        "planned": len(verdicts),
        "ran": len(verdicts),
        "complete": True,
        "reason": None,
        "environment": Environment(python="3.11", platform="Linux", cpu_count=2, versions={"hapticeval": "0.1.0"}),
        "seed": 3,
        "command": Command(suites=["s"], renderers=["r"], select=[], strict=strict),
        "runs": [],
        "verdicts": apart(VerdictEntry.of(each) if isinstance(each, Verdict) else each for each in verdicts),
        "table": {},
        "timing": Timing(simulated_seconds=6.0, wall_seconds=2.0, times_real_time=3.0),
    }
    return ResultsDocument(**{**given, **changes})
