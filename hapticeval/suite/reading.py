"""Suites out of TOML files: sweeps and variants become cases, and what cannot be meant is told with file and case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path as FilePath
from typing import Any

from hapticeval.closed_forms.form import CLOSED_FORMS
from hapticeval.documents import read_document
from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.suite.case import Case
from hapticeval.suite.installed import find_suites
from hapticeval.suite.suite import Row, Suite


def load_suite(name_or_path: str) -> Suite:
    """A suite by its name or by the path of a TOML file.

    Raises `UnknownNameError` for neither, and `InputError`, naming file and case, for a file that is not TOML, does
    not fit the schema, or names unknown checks or models.
    """
    known = find_suites()
    file = known.get(name_or_path)
    if file is None:
        file = FilePath(name_or_path)
        if file.suffix != ".toml":
            raise UnknownNameError("suite", name_or_path, known)
        if not file.is_file():
            raise InputError(f"no suite file {file}", todo=f"check the path, or use one of: {', '.join(known)}")
    document = read_document(file, "suite/suite.schema.json")
    variants = document.get("variant", {})
    cases = tuple(case for spec in document["case"] for case in _cases(spec, variants, file))
    _refuse_repeats([case.name for case in cases], file.name)
    rows = tuple(_row(spec, file.name) for spec in document.get("row", []))
    for row in rows:
        _check_row(row, cases, file.name)
    return Suite(
        name=file.stem,
        title=document["title"],
        citation=document.get("citation", ""),
        cases=cases,
        rows=rows,
        renderers=tuple(document.get("renderers", ())),
    )


def _refuse_repeats(names: list[str], file: str) -> None:
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"{file} has two cases named '{name}'", todo="give each case a name of its own")


def _row(spec: Mapping[str, Any], file: str) -> Row:
    checks = (spec["check"],) if isinstance(spec["check"], str) else tuple(spec["check"])
    for check in checks:
        _check_known(check, f"{file}: row '{spec['title']}'")
    return Row(
        title=spec["title"],
        checks=checks,
        cases=tuple(spec["cases"]),
        published=spec.get("published", {}),
    )


def _check_row(row: Row, cases: tuple[Case, ...], file: str) -> None:
    """Raise `InputError` where a pattern of the row has none of its checks, or one of its checks is in no case."""
    asked = [(pattern, row.checks) for pattern in row.cases] + [("*", (check,)) for check in row.checks]
    named = [case for case in cases if any(fnmatchcase(case.name, pattern) for pattern in row.cases)]
    for pattern, checks in asked:
        names = "' or '".join(checks)
        if not any(fnmatchcase(case.name, pattern) and set(checks) & set(case.checks) for case in named):
            raise InputError(
                f"{file}: row '{row.title}' asks for '{names}' in '{pattern}'",
                why="no case of that name has that check",
                todo=f"the cases are: {', '.join(case.name for case in cases)}",
            )


def _check_known(name: str, place: str) -> None:
    if name not in CHECKS:
        error = UnknownNameError("check", name, CHECKS)
        raise InputError(f"{place}: {error.what}", todo=error.todo)


def _cases(spec: Mapping[str, Any], variants: Mapping[str, Any], file: FilePath) -> Iterator[Case]:
    """The case and its variants, or one for each entry of its sweep."""
    place = f"{file.name}: case '{spec['name']}'"
    for label in spec.get("variants", ()):
        if label not in variants:
            error = UnknownNameError("variant", label, variants)
            raise InputError(f"{place}: {error.what}", todo=error.todo)
    for renderer, form in spec.get("closed_form", {}).items():
        if form not in CLOSED_FORMS:
            error = UnknownNameError("closed form", form, CLOSED_FORMS)
            raise InputError(f"{place}: {error.what} for '{renderer}'", todo=error.todo)
    for check in spec["checks"]:
        _check_known(check, place)
    trajectory = spec.get("trajectory")
    if "sweep" not in spec:
        if trajectory is not None and trajectory["kind"] in ("scaled", "arc") and "depth" not in trajectory:
            raise InputError(
                f"{place}: a '{trajectory['kind']}' trajectory needs a depth", todo="give depth, or a sweep"
            )
        yield _case(spec, spec["name"], trajectory, spec.get("published", {}), file)
        for label in spec.get("variants", ()):
            varied = _varied(spec, variants[label])
            yield _case(varied, f"{spec['name']}-{label}", trajectory, {}, file)
        return
    if trajectory is None:
        raise InputError(f"{place}: a sweep is over the depth of a trajectory", todo="write a case an experiment")
    for entry in spec["sweep"]:
        swept = {**trajectory, "depth": entry["depth"]}
        published = {
            renderer: {**spec.get("published", {}).get(renderer, {}), **entry.get("published", {}).get(renderer, {})}
            for renderer in [*spec.get("published", {}), *entry.get("published", {})]
        }
        titled = {**spec, "title": f"{spec['title']}: {1e3 * entry['depth']:.3g} mm"}
        yield _case(titled, f"{spec['name']}-{entry['label']}", swept, published, file)


def _varied(spec: Mapping[str, Any], variant: Mapping[str, Any]) -> Mapping[str, Any]:
    """The case in another scene. What is in print, closed forms too, is about the case as it stands, not about this."""
    scene = {**spec.get("scene", {}), **variant["scene"]}
    checks = [check for check in spec["checks"] if not CHECKS[check].needs_closed_form]
    varied = {**spec, "scene": scene, "checks": checks, "title": f"{spec['title']}, {variant['title']}"}
    varied.pop("closed_form", None)
    for name in ("shows", "citation", "judged"):
        if name in variant:
            varied[name] = variant[name]
    return varied


def _case(
    spec: Mapping[str, Any],
    name: str,
    trajectory: Mapping[str, Any] | None,
    published: Mapping[str, Mapping[str, str]],
    file: FilePath,
) -> Case:
    for renderer, outcomes in published.items():
        for check in outcomes:
            if check not in spec["checks"]:
                raise InputError(
                    f"{file.name}: case '{name}': an outcome of '{check}' is published for '{renderer}'",
                    why="the case does not have that check",
                    todo=f"its checks are: {', '.join(spec['checks'])}",
                )
    case = Case(
        name=name,
        title=spec["title"],
        shows=" ".join(spec.get("shows", "").split()),
        citation=spec.get("citation", ""),
        model=spec["model"],
        depth_of=spec.get("depth_of", "model"),
        scene=spec.get("scene", {}),
        trajectory=trajectory,
        experiment=spec.get("experiment"),
        checks=tuple(spec["checks"]),
        judged=spec.get("judged", True),
        published={
            renderer: {check: Outcome(outcome) for check, outcome in outcomes.items()}
            for renderer, outcomes in published.items()
        },
        closed_form=spec.get("closed_form", {}),
        folder=file.parent,
    )
    try:
        case.build_scene()
    except HapticevalError as error:
        raise InputError(f"{file.name}: case '{name}': {error.what}", why=error.why, todo=error.todo) from error
    return case
