"""A suite: cases, and the rows of the summary table that they fill."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from msgspec import Meta, Struct

from hapticeval.errors import UnknownNameError
from hapticeval.suite.case import Case

Names = Annotated[tuple[str, ...], Meta(min_length=1)]


class Row(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A row of the summary table: Yes where each `check` passes in all `cases` (globs), with what is in print."""

    title: str
    check: str | Names
    cases: Names
    published: dict[str, Literal["Yes", "No"]] = {}

    @property
    def checks(self) -> tuple[str, ...]:
        """The ids of its checks."""
        return (self.check,) if isinstance(self.check, str) else self.check


@dataclass(frozen=True, kw_only=True)
class Suite:
    """The cases of a suite file, and the rows of the table that they fill; `renderers` run where none are named.

    Within one `version` a renderer that stays the same keeps its verdicts, see `suites/POLICY.md`; "" for none.
    `changes` says by version, in words, what it changed.
    """

    name: str
    title: str
    citation: str
    cases: tuple[Case, ...]
    rows: tuple[Row, ...]
    renderers: tuple[str, ...] = ()
    version: str = ""
    changes: Mapping[str, str] = field(default_factory=dict)

    def case(self, name: str) -> Case:
        """Return the case of that name. Raises `UnknownNameError`, with the closest, where there is none."""
        case_by_name = {case.name: case for case in self.cases}
        if name not in case_by_name:
            raise UnknownNameError(f"case of {self.name}", name, case_by_name)
        return case_by_name[name]
