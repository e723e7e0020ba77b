"""A suite: cases, and the rows of the summary table that they fill."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hapticeval.suite.case import Case


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of the summary table: Yes where `checks` pass in all `cases` (globs), with what is in print."""

    title: str
    checks: tuple[str, ...]
    cases: tuple[str, ...]
    published: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A file of cases and the rows of the table that they fill; `renderers` are run where none are named."""

    name: str
    title: str
    citation: str
    cases: tuple[Case, ...]
    rows: tuple[Row, ...]
    renderers: tuple[str, ...] = ()
