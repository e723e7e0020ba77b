"""What a replay says in words: how far each renderer is from the recorded run."""

from __future__ import annotations

from hapticeval.recordings.compare.difference import Apart
from hapticeval.replay import OPEN_LOOP, RECORDED
from hapticeval.runner.judging import LACKS
from hapticeval.runner.results import ResultsDocument


def differences(results: ResultsDocument) -> str:
    """A line a renderer, under a note that the hand would have reacted; empty where nothing was compared."""
    unjudged = lacking(results)
    rows = [
        [run.renderer, _apart(run.replay.difference.ihip, "mm", 1e3), _apart(run.replay.difference.force, "N", 1.0)]
        for run in results.runs
        if run.replay is not None and run.replay.difference is not None
    ]
    if not rows:
        return "\n".join([*unjudged, OPEN_LOOP])
    table = [["against the recorded run", "IHIP", "force"], *rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in table]
    return "\n".join([*lines, *unjudged, OPEN_LOOP])


def lacking(results: ResultsDocument) -> list[str]:
    """A line a channel for want of which checks could not judge the recorded run."""
    checks: dict[str, list[str]] = {}
    for verdict in results.verdicts:
        if verdict.renderer == RECORDED and LACKS in verdict.evidence:
            checks.setdefault(verdict.evidence[LACKS], []).append(verdict.check)
    return [
        f"the recording has no channel '{channel}': its own run is not judged by {', '.join(names)}"
        for channel, names in checks.items()
    ]


def _apart(found: Apart | None, unit: str, scale: float) -> str:
    if found is None:
        return "not recorded"
    if found.max == 0.0:
        return "equal to the last bit"
    return f"rms {scale * found.rms:.3g} {unit}, at most {scale * found.max:.3g} {unit} at t = {found.time:.4g} s"
