"""What a replay says in words: how far each renderer is from the recorded run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hapticeval.phenomena.check import LACKS
from hapticeval.replay import OPEN_LOOP, RECORDED
from hapticeval.runner.results import Results


def differences(results: Results) -> str:
    """A line a renderer, under a note that the hand would have reacted; empty where nothing was compared."""
    unjudged = lacking(results)
    rows = [
        [run["renderer"], *(_apart(run["replay"]["difference"][name], *unit) for name, unit in UNITS.items())]
        for run in results.runs
        if run.get("replay") and run["replay"]["difference"] is not None
    ]
    if not rows:
        return "\n".join([*unjudged, OPEN_LOOP])
    table = [["against the recorded run", "IHIP", "force"], *rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in table]
    return "\n".join([*lines, *unjudged, OPEN_LOOP])


def lacking(results: Results) -> list[str]:
    """A line a channel for want of which checks could not judge the recorded run."""
    checks: dict[str, list[str]] = {}
    for verdict in results.verdicts:
        if verdict["renderer"] == RECORDED and LACKS in verdict["evidence"]:
            checks.setdefault(verdict["evidence"][LACKS], []).append(verdict["check"])
    return [
        f"the recording has no channel '{channel}': its own run is not judged by {', '.join(names)}"
        for channel, names in checks.items()
    ]


UNITS: Mapping[str, tuple[str, float]] = {"ihip": ("mm", 1e3), "force": ("N", 1.0)}


def _apart(found: Mapping[str, Any] | None, unit: str, scale: float) -> str:
    if found is None:
        return "not recorded"
    if found["max"] == 0.0:
        return "equal to the last bit"
    return (
        f"rms {scale * found['rms']:.3g} {unit}, at most {scale * found['max']:.3g} {unit} at t = {found['time']:.4g} s"
    )
