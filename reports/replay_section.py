"""What a replay adds to a case on the page: which recording, how its clock was kept, how far each renderer is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hapticeval.quantity import quantity
from hapticeval.recordings.compare.difference import Difference
from hapticeval.runner.results import Replay, RunEntry

COLUMNS = (
    "renderer",
    "IHIP, rms",
    "IHIP, at most",
    "where",
    "force, rms",
    "force, at most",
    "where",
    "contact differs",
)


@dataclass(frozen=True)
class Section:
    """The table of differences to the recorded run, and what has to be said of it."""

    file: str
    note: str
    facts: str
    rows: Sequence[Sequence[str]]
    suspicious: Sequence[str]


def replay_section(runs: Sequence[RunEntry]) -> Section | None:
    """The section of a case whose runs (documents of the results) are a replay; None for any other case."""
    told = [(run.renderer, run.replay) for run in runs if run.replay]
    if not told:
        return None
    first = told[0][1]
    replayed = [(name, each) for name, each in told if each.difference is not None]
    comparable = any(each.difference.ihip or each.difference.force for _, each in replayed)
    rows = [[name, *_apart(each.difference)] for name, each in replayed] if comparable else []
    # The recorded run has a note of its own, about itself; that of a replayed one holds for the table.
    return Section(
        first.file,
        replayed[0][1].note if replayed else first.note,
        _facts(first),
        rows,
        first.suspicious,
    )


def _facts(replay: Replay) -> str:
    count = replay.stretches
    stretches = "in one stretch" if count == 1 else f"in {count} stretches, the renderer reset at the start of each"
    left = replay.rows_left_out
    why = "; ".join(replay.left_out) or "gaps, and rows that are no measurement"
    out = "" if not left else f"; {left} rows are left out ({why})"
    return f"{replay.rows} samples, {quantity(replay.seconds, 's')}, {stretches}{out}. Clock: {replay.clock}."


def _apart(difference: Difference) -> list[str]:
    cells = []
    for found, unit in ((difference.ihip, "m"), (difference.force, "N")):
        if found is None:
            cells += ["not recorded", "", ""]
        elif found.max == 0.0:
            cells += ["equal to the last bit", "", ""]
        else:
            where = f"t = {found.time:.4g} s, row {found.row}"
            cells += [quantity(found.rms, unit), quantity(found.max, unit), where]
    share = difference.contact
    return [*cells, "" if share is None else f"differs in {100.0 * share:.3g} %"]
