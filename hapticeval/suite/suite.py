"""A suite: cases, the rows of the summary table that they fill, and what they ask as digests, with the files named.

Another machine must have the files as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from hapticeval.errors import UnknownNameError
from hapticeval.files import digest_of
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


def files_of(case: Case) -> dict[str, str]:
    """Return the digest of each file that a case names, by its path."""
    # Any text of a case may name a file; what names none has no digest.
    named = {str((case.folder / text).resolve()) for text in _texts(msgspec.to_builtins(case, enc_hook=str)) if text}
    return {path: digest for path in sorted(named) if (digest := _digest_of(path)) is not None}


def digest_of_suite(suite: Suite) -> str:
    """Return a digest of all that a suite says, word by word, its files included, wherever its folder is."""
    return _digest(suite.cases, suite.rows)


def digest_of_case(case: Case) -> str:
    """Return a digest of what a case asks of a renderer, its files included: all but what is said about it."""
    bare_case = msgspec.structs.replace(case, title="", shows="", citation="", published={})
    if bare_case.experiment is not None:
        experiment = msgspec.structs.replace(bare_case.experiment, phases=())
        bare_case = msgspec.structs.replace(bare_case, experiment=experiment)
    return _digest([bare_case])


def _digest(cases: Sequence[Case], rows: Sequence[Row] = ()) -> str:
    """Return a digest of cases and rows without the cases' folders; the files that they name count by their content."""
    # What was moved to another folder asks the same.
    entries = [msgspec.to_builtins(msgspec.structs.replace(case, folder=Path()), enc_hook=str) for case in cases]
    for entry in entries:
        # Phases that are not named say nothing: a case was the same before there were any.
        if entry["experiment"] is not None and not entry["experiment"]["phases"]:
            del entry["experiment"]["phases"]
    text = msgspec.json.encode([rows, entries], enc_hook=str).decode()
    for folder in {str(case.folder.resolve()) for case in cases}:
        text = text.replace(folder, "")
    files = {digest for case in cases for digest in files_of(case).values()}
    return sha256("\n".join([text, *sorted(files)]).encode()).hexdigest()[:16]


def _texts(value: Any) -> Iterator[str]:
    """Yield all texts in a document, at any depth."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, entry in value.items():
            # what files count from is not one of them
            if name != "folder":
                yield from _texts(entry)
    elif isinstance(value, list | tuple):
        for entry in value:
            yield from _texts(entry)


@lru_cache(maxsize=4096)
def _digest_of(path: str) -> str | None:
    """Return the digest of a file's content, read once a process; None for what is not a file."""
    try:
        return digest_of(Path(path)) if Path(path).is_file() else None
    except OSError:
        return None
