"""What will run: the selected cases of the suites, each through each renderer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from msgspec.structs import replace

from hapticeval.discovery import own_renderers, resolve
from hapticeval.errors import InputError, NothingSelectedError
from hapticeval.suite.case import Case
from hapticeval.suite.installed import suites_named
from hapticeval.suite.reading import load_suite
from hapticeval.suite.suite import Suite


@dataclass(frozen=True)
class Job:
    """One renderer through one case."""

    suite: str
    case: Case
    renderer: str


@dataclass(frozen=True)
class Plan:
    """What will run. `suites` are whole; `jobs` hold only the selected cases, with only the selected checks.

    With `strict` a warning stops a gate, as a failure does.
    """

    suites: tuple[Suite, ...]
    renderers: tuple[str, ...]
    jobs: tuple[Job, ...]
    select: tuple[str, ...]
    seed: int
    strict: bool = False

    @property
    def planned(self) -> int:
        """Number of verdicts."""
        return sum(len(job.case.checks) for job in self.jobs)


def plan(
    suites: Sequence[str], renderers: Sequence[str], *, select: Sequence[str] = (), seed: int = 0, strict: bool = False
) -> Plan:
    """Load the suites, see that every renderer can be found, and apply the selection.

    A suite's name may be that of a group: `dynamics` for `dynamics-line` and the others. Where no `renderers` are named
    each suite runs its own, or those that come with the package. `select` holds globs on case names, on `suite/case`,
    or on `case/check`; what any of them matches is run, and everything where there are none. Raises
    `NothingSelectedError` when nothing is left, and what `load_suite` and `resolve` raise.
    """
    members = dict.fromkeys(name for given in suites for name in suites_named(given))
    loaded = tuple(load_suite(name) for name in members)
    _refuse_namesakes(loaded)
    chosen = {suite.name: tuple(dict.fromkeys(renderers or suite.renderers or own_renderers())) for suite in loaded}
    names = tuple(dict.fromkeys(name for each in chosen.values() for name in each))
    for name in names:
        resolve(name)
    jobs = tuple(
        Job(suite.name, selected, name)
        for suite in loaded
        for case in suite.cases
        for selected in _selected(case, suite.name, select)
        for name in chosen[suite.name]
    )
    if not jobs:
        cases = sorted({case.name for suite in loaded for case in suite.cases})
        raise NothingSelectedError(
            f"nothing matches -k {' -k '.join(map(repr, select))}" if select else "no suites or no renderers are named",
            why=f"the cases are: {', '.join(cases)}" if cases else "",
            todo="a glob is matched against the whole name: try -k '*slide*' or -k '*/memoryless'",
        )
    for case in {(job.suite, job.case.name): job.case for job in jobs}.values():
        case.check_stimulus()
    return Plan(loaded, names, jobs, tuple(select), seed, strict)


def _refuse_namesakes(suites: Sequence[Suite]) -> None:
    """Two suites of one name would write over each other's recordings and verdicts."""
    names = [suite.name for suite in suites]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two suites are named '{name}'", todo="rename one of the files, or run them apart")


def _selected(case: Case, suite: str, select: Sequence[str]) -> Iterator[Case]:
    if not select or any(fnmatchcase(f"{suite}/{case.name}" if "/" in glob else case.name, glob) for glob in select):
        yield case
        return
    checks = tuple(check for check in case.checks if any(fnmatchcase(f"{case.name}/{check}", glob) for glob in select))
    if checks:
        yield replace(case, checks=checks)
