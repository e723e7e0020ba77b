"""What an examination of a recording finds: how bad it is, where, and what to do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any


def plural(count: int, noun: str) -> str:
    """For instance `1 row`, `2 rows`."""
    return f"{count} {noun}{'s' * (count != 1)}"


class Severity(StrEnum):
    """`fault`: those rows are no measurement; `suspicious`: a person should look; `note`: good to know."""

    FAULT = "fault"
    SUSPICIOUS = "suspicious"
    NOTE = "note"


@dataclass(frozen=True)
class Fault:
    """One finding: `kind` in a word or two, the channel and column, the rows [first, end), and the times there.

    `first` is None for what concerns the whole recording. `measures` are the numbers behind it.
    """

    kind: str
    severity: Severity
    message: str
    todo: str = ""
    channel: str = ""
    first: int | None = None
    end: int | None = None
    time: tuple[float, float] | None = None
    measures: Mapping[str, Any] = field(default_factory=dict)

    @property
    def place(self) -> str:
        """For instance `row 120 to 131, 0.12 to 0.131 s`."""
        if self.first is None or self.end is None:
            return "all"
        rows = f"row {self.first}" if self.end - self.first <= 1 else f"rows {self.first} to {self.end - 1}"
        if self.time is None:
            return rows
        begin, end = self.time
        return f"{rows}, {begin:.6g} s" if begin == end else f"{rows}, {begin:.6g} to {end:.6g} s"
