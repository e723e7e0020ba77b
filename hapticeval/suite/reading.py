"""Suites read from TOML files: sweeps and variants become cases; mistakes are refused with file and case."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path as FilePath
from typing import Annotated, Any

from msgspec import UNSET, Meta, Struct, UnsetType, structs

from hapticeval.closed_forms import CLOSED_FORMS
from hapticeval.documents import convert, read_toml
from hapticeval.errors import InputError, UnknownNameError, at
from hapticeval.files import file_below
from hapticeval.phenomena.registry import CHECKS, unknown_check
from hapticeval.stimulus.paths import Positive
from hapticeval.suite.case import Case, CaseEntries, Published
from hapticeval.suite.outline import Heading, find_suites, suites_named
from hapticeval.suite.suite import Names, Row, Suite


class Entry(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the tables of a suite file."""


class Depth(Entry, frozen=True, kw_only=True):
    """One entry of a `sweep`: the case at another depth (m) of its trajectory."""

    label: Annotated[str, Meta(pattern=r"^[a-z0-9.-]+$")]
    depth: Positive
    published: Published = {}


class CaseTable(CaseEntries, frozen=True, kw_only=True):
    """A `[[case]]` table."""

    sweep: Annotated[tuple[Depth, ...], Meta(min_length=1)] | None = None
    variants: tuple[str, ...] = ()


class Variant(Entry, frozen=True, kw_only=True):
    """A `[variant.NAME]` table: what is different in a variant of the cases that name it."""

    title: str
    scene: dict[str, Any]
    shows: str | UnsetType = UNSET
    citation: str | UnsetType = UNSET
    judged: bool | UnsetType = UNSET


class SuiteFile(Entry, frozen=True, kw_only=True):
    """A suite file as it is written."""

    title: str
    case: Annotated[list[CaseTable], Meta(min_length=1)]
    version: Annotated[str, Meta(pattern=r"^[0-9]+\.[0-9]+$")] = ""
    changes: dict[str, str] = {}
    citation: str = ""
    renderers: Names = ()
    variant: dict[str, Variant] = {}
    row: tuple[Row, ...] = ()


def load_suite(name_or_path: str) -> Suite:
    """Return a suite by its name or by the path of a TOML file.

    Raises `UnknownNameError` for neither, and `InputError`, naming file and case, for a file that is not TOML, does
    not fit the types of this room, or names unknown checks or models.
    """
    known = find_suites()
    file = known.get(name_or_path)
    if file is None:
        file = FilePath(name_or_path)
        if file.suffix != ".toml":
            raise UnknownNameError("suite", name_or_path, known)
        if not file.is_file():
            raise InputError(f"no suite file {file}", todo=f"check the path, or use one of: {', '.join(known)}")
    entries = read_toml(file)
    if not entries:
        raise InputError(
            f"the suite file {file} is empty", todo="write a title and [[case]] tables, as in docs/suites.md"
        )
    suite_file: SuiteFile = convert(entries, SuiteFile, file.name, todo="see docs/suites.md and docs/robots.md")
    with at(file.name):
        cases = tuple(case for table in suite_file.case for case in _cases(table, suite_file.variant, file.parent))
        names = [case.name for case in cases]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"it has two cases named '{name}'", todo="give each case a name of its own")
        for row in suite_file.row:
            with at(f"row '{row.title}'"):
                _check_row(row, cases)
    return Suite(
        name=file.stem,
        title=suite_file.title,
        citation=suite_file.citation,
        cases=cases,
        rows=suite_file.row,
        renderers=suite_file.renderers,
        version=suite_file.version,
        changes=suite_file.changes,
    )


def load_suites(names: Iterable[str]) -> tuple[Suite, ...]:
    """Return the suites of names, groups and paths, each once. Raises as `suites_named` and `load_suite` do."""
    return tuple(map(load_suite, dict.fromkeys(member for name in names for member in suites_named(name))))


def case_named(text: str) -> Case:
    """Return the case that SUITE/CASE or FILE.toml/CASE names. Raises `InputError` as `load_suite` and `Suite.case`."""
    suite, slash, name = text.rpartition("/")
    if not slash:
        raise InputError(
            f"'{text}' names no case", why="a case is named SUITE/CASE", todo="see `hapticeval list cases`"
        )
    return load_suite(suite).case(name)


def _check_row(row: Row, cases: tuple[Case, ...]) -> None:
    """Raise `InputError` where a pattern of the row has none of its checks, or one of its checks is in no case."""
    _check_known("check", row.checks, CHECKS)
    named = [case for case in cases if any(fnmatchcase(case.name, pattern) for pattern in row.cases)]
    # Each pattern has to meet one of the row's checks, and each check a case of any pattern.
    for pattern, checks in [
        *((pattern, row.checks) for pattern in row.cases),
        *(("*", (check,)) for check in row.checks),
    ]:
        if not any(fnmatchcase(case.name, pattern) and set(checks) & set(case.checks) for case in named):
            names = "' or '".join(checks)
            raise InputError(
                f"it asks for '{names}' in '{pattern}'",
                why="no case of that name has that check",
                todo=f"the cases are: {', '.join(case.name for case in cases)}",
            )


def _check_known(kind: str, names: Iterable[str], known: Iterable[str]) -> None:
    for name in names:
        if name not in known:
            raise unknown_check(name) if known is CHECKS else UnknownNameError(kind, name, known)


def _cases(table: CaseTable, variants: Mapping[str, Variant], folder: FilePath) -> Iterator[Case]:
    """Yield the case and its variants, or one case for each entry of its sweep. Raises `InputError` with its name."""
    entries = {name: getattr(table, name) for name in CaseEntries.__struct_fields__}
    # It may be written over several lines.
    entries["shows"] = " ".join(table.shows.split())
    if isinstance(table.model.get("file"), str):
        with at(f"case '{table.name}'"):
            entries["model"] = {**table.model, "file": str(file_below(folder, table.model["file"]).resolve())}
    case = Case(**entries, folder=folder)
    with at(f"case '{case.name}'"):
        _check_known("check", case.checks, CHECKS)
        _check_known("variant", table.variants, variants)
        _check_known("closed form", case.closed_form.values(), CLOSED_FORMS)
        if (case.trajectory is None) is (case.experiment is None):
            raise InputError(
                f"it has {'neither' if case.trajectory is None else 'both'} a trajectory and an experiment",
                why="the hand is led along a path, or it pushes",
                todo="give one of them",
            )
        # UNSET: of a kind without a depth. None: of a kind with one, which a sweep has to give.
        depth = getattr(case.trajectory, "depth", UNSET)
        if table.sweep is not None and depth is UNSET:
            raise InputError("a sweep is over the depth of a trajectory", todo="write one case for each")
        if table.sweep is None and depth is None:
            raise InputError("its trajectory needs a depth", todo="give depth, or a sweep")
    if table.sweep is None:
        yield _checked(case)
    for depth_entry in table.sweep or ():
        yield _checked(_swept(case, depth_entry))
    for label in table.variants if table.sweep is None else ():
        yield _checked(_varied(case, label, variants[label]))


def _swept(case: Case, at_depth: Depth) -> Case:
    """Return the case at another depth."""
    # What is in print for this depth goes before what is for all of them.
    published_tables = (case.published, at_depth.published)
    renderers = dict.fromkeys(renderer for published in published_tables for renderer in published)
    trajectory: Any = case.trajectory
    name, title = Heading(case.name, case.title).swept(at_depth.label, at_depth.depth)
    return structs.replace(
        case,
        name=name,
        title=title,
        trajectory=structs.replace(trajectory, depth=at_depth.depth),
        published={
            renderer: {**published_tables[0].get(renderer, {}), **published_tables[1].get(renderer, {})}
            for renderer in renderers
        },
    )


def _varied(case: Case, label: str, variant: Variant) -> Case:
    """Return the case in the scene of a variant, without published outcomes and closed forms: those are of the case."""
    name, title = Heading(case.name, case.title).varied(label, variant.title)
    words = {name: getattr(variant, name) for name in ("shows", "citation", "judged")}
    return structs.replace(
        case,
        name=name,
        title=title,
        scene={**case.scene, **variant.scene},
        # a closed form is of the case's own scene
        checks=tuple(check for check in case.checks if not CHECKS[check].needs_closed_form),
        published={},
        closed_form={},
        # what a variant does not say stays the case's
        **{name: value for name, value in words.items() if value is not UNSET},
    )


def _checked(case: Case) -> Case:
    """Return the case. Raises `InputError`, naming it, for an outcome of a check that it lacks, and for its scene."""
    with at(f"case '{case.name}'"):
        for renderer, outcomes in case.published.items():
            for check in outcomes:
                if check not in case.checks:
                    raise InputError(
                        f"an outcome of '{check}' is published for '{renderer}'",
                        why="the case does not have that check",
                        todo=f"its checks are: {', '.join(case.checks)}",
                    )
        case.build_scene()
    return case
