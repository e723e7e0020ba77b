"""What will run: the options of a run, checked once, here; and the cases that they select, each with each renderer."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from hapticeval.discovery import own_renderers, resolve, resolve_installed
from hapticeval.errors import InputError, NothingSelectedError, UnknownNameError, at
from hapticeval.renderer import RendererFactory
from hapticeval.runner.known import NONE_KNOWN, Known, read_known
from hapticeval.runner.results import ResultsDocument, RunKey
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suites
from hapticeval.suite.selection import covering, select
from hapticeval.suite.suite import Suite


@dataclass(frozen=True, order=True)
class Shard:
    """Part `number` of `count`, counted from 1."""

    number: int
    count: int

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Return the shard of a text as 3/16. Raises `InputError` for any other."""
        match = re.fullmatch(r"([1-9]\d*)/([1-9]\d*)", text)
        if match is None or int(match[1]) > int(match[2]):
            raise InputError(
                f"--shard {text}", why="it is the number of a part and how many there are", todo="write 3/16, 1/1"
            )
        return cls(int(match[1]), int(match[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def of(self, jobs: Sequence[Job]) -> tuple[Job, ...]:
        """Return the jobs of this shard, in the order of the plan.

        Jobs are dealt out by turns in the order of a digest of their names: shards differ by one job at most, and none
        has all the jobs of a slow renderer. Raises `NothingSelectedError` where none is left for it.
        """
        if self.number > len(jobs):
            raise NothingSelectedError(
                f"shard {self} is empty", why=f"there are {len(jobs)} jobs", todo="make fewer shards"
            )
        # A digest orders as if at random, and the same everywhere: neighbours in the plan go to different shards.
        dealt_order = sorted(range(len(jobs)), key=lambda number: _digest(jobs[number].key))
        return tuple(jobs[number] for number in sorted(dealt_order[self.number - 1 :: self.count]))


def _digest(key: RunKey) -> bytes:
    return sha256("\0".join(key).encode()).digest()


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """The options of a run, whoever begins it: the command line, Python or pytest.

    What is run:

    - `select`: expressions over names of cases and checks, see `suite.selection`; any of them selects.
    - `quick`: few of the selected cases, which have every check between them.
    - `shard`: the part of all this that is run, see `api.merge`.
    - `seed`: of it each job's own is made.

    What stops a gate, and the run:

    - `strict`: warnings count too.
    - `known`: a file of known failures, see `runner.known`.
    - `exit_first`: end at the first verdict that stops a gate.
    - `failed_first`: begin with what did so in the results that `output` holds.

    How it is done; no verdict depends on these:

    - `output`: the folder for results.json and the recordings; None to write nothing.
    - `resume`: keep what an earlier run into `output` has finished.
    - `workers`: how many processes share the jobs, one for each processor if None; with 0 this one does them.
    - `timeout`: seconds after which a job is ended, its verdicts errors; not in this process.
    - `scheduler`: the address of a dask scheduler whose workers do the jobs.

    Raises `InputError` for a number that is out of its range, and for `resume` without `output`.
    """

    select: tuple[str, ...] = ()
    quick: bool = False
    shard: Shard | None = None
    seed: int = 0
    strict: bool = False
    known: Path | None = None
    exit_first: bool = False
    failed_first: bool = False
    output: Path | None = None
    resume: bool = False
    workers: int | None = None
    timeout: float = math.inf
    scheduler: str | None = None

    def __post_init__(self) -> None:
        for name, value in (("seed", self.seed), ("workers", 0 if self.workers is None else self.workers)):
            if not isinstance(value, int) or value < 0:
                raise InputError(f"{name} = {value!r}", why="it is a whole number, and not negative")
        if not self.timeout > 0.0:
            raise InputError(f"timeout = {self.timeout!r}", why="it is seconds that a case may take, and positive")
        if self.resume and self.output is None:
            raise InputError("there is nothing to resume", why="results lie in no folder", todo="name one: output=...")

    @classmethod
    def of(cls, **options: Any) -> RunOptions:
        """Return the options as a user writes them: one expression or several, paths and the shard "3/16" as text.

        Raises `UnknownNameError` for an option that is none of these, and `InputError` for a value that it cannot be.
        """
        names = [option.name for option in fields(cls)]
        for name in options:
            if name not in names:
                raise UnknownNameError("option", name, names)
        return cls(
            **{
                name: OPTION_READERS[name](value) if name in OPTION_READERS else value
                for name, value in options.items()
            }
        )


DEFAULT_OPTIONS = RunOptions()


def as_tuple(values: Any, what: str, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    """Return one or several as a tuple. Raises `InputError` for what is of none of the `kinds`."""
    listed = tuple(values) if isinstance(values, list | tuple | set | frozenset) else (values,)
    for value in listed:
        if not isinstance(value, kinds):
            raise InputError(f"{what}: {value!r}", why=f"it is not a {' or '.join(kind.__name__ for kind in kinds)}")
    return listed


def _read_path(value: str | Path | None) -> Path | None:
    return None if value is None else Path(value)


OPTION_READERS: Mapping[str, Callable[[Any], Any]] = {
    "select": lambda value: as_tuple(value, "select", (str,)),
    "known": _read_path,
    "output": _read_path,
    "shard": lambda value: Shard.parse(value) if isinstance(value, str) else value,
}
"""How an option that a user writes as text or as a list becomes its value."""


@dataclass(frozen=True)
class Job:
    """One renderer through one case."""

    suite: str
    case: Case
    renderer: str
    factory: RendererFactory | None = None
    """What makes the renderer, where its name alone does not tell."""

    @property
    def key(self) -> RunKey:
        """Suite, case and renderer."""
        return self.suite, self.case.name, self.renderer


@dataclass(frozen=True)
class Plan:
    """What will run: `suites` with all their cases, and `jobs` for the selected cases, with the selected checks.

    - `options`: how; of a shard `jobs` hold its part only.
    - `known`: failures that stop no gate: those of the options' file, and those that packages ship.
    - `cases_and_renderers`: those of the whole plan for each suite.
    """

    suites: tuple[Suite, ...]
    renderers: tuple[str, ...]
    jobs: tuple[Job, ...]
    options: RunOptions = DEFAULT_OPTIONS
    known: Known = NONE_KNOWN
    cases_and_renderers: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = field(default_factory=dict)

    @property
    def planned(self) -> int:
        """Number of verdicts that the jobs are to give."""
        return sum(len(job.case.checks) for job in self.jobs)

    def failed_first(self, earlier: ResultsDocument) -> Plan:
        """Return the plan with the jobs first that have a verdict in `earlier` results that stops a gate."""
        failed = {verdict.key for verdict in earlier.verdicts if earlier.stops(verdict)}
        # A stable sort: apart from that, the plan keeps its order.
        jobs = sorted(self.jobs, key=lambda job: job.key not in failed)
        return replace(self, jobs=tuple(jobs))


def plan(
    suites: Sequence[str | Suite],
    renderers: Sequence[str] = (),
    options: RunOptions = DEFAULT_OPTIONS,
    *,
    factories: Mapping[str, RendererFactory] | None = None,
) -> Plan:
    """Load the suites, see that every renderer can be found, and apply what the options choose.

    - `suites`: suites, their names or paths, or the name of a group: `dynamics` for `dynamics-line` and the others.
    - `renderers`: their names; if there are none each suite runs its own, or those that come with the package.
    - `factories`: what makes renderers whose names alone do not tell.

    Raises `NothingSelectedError` where nothing is left, and what `load_suite`, `resolve`, `select`, `read_known`,
    `Known.check` and, for the renderers that a suite names, `resolve_installed` raise.
    """
    known = NONE_KNOWN if options.known is None else read_known(options.known)
    factory_by_name = factories or {}
    loaded = (
        *load_suites(suite for suite in suites if isinstance(suite, str)),
        *(suite for suite in suites if not isinstance(suite, str)),
    )
    _refuse_namesakes(loaded)
    known.check(loaded)
    # Renderers named here go before those that the suite names, and these before the package's own.
    renderers_by_suite = {
        suite.name: tuple(dict.fromkeys(renderers or suite.renderers or own_renderers())) for suite in loaded
    }
    names = tuple(dict.fromkeys(name for renderer_names in renderers_by_suite.values() for name in renderer_names))
    for suite in loaded:
        for name in renderers_by_suite[suite.name]:
            # Named by the suite's file alone: a file must not have code imported from anywhere.
            if name not in (*renderers, *factory_by_name) and name in suite.renderers:
                resolve_installed(name, source=f"suite '{suite.name}'")
    for name in names:
        if name not in factory_by_name:
            resolve(name)
    selected_cases = select(loaded, options.select)
    jobs = tuple(
        Job(suite.name, case, name, factory_by_name.get(name))
        for suite, case in (covering(selected_cases) if options.quick else selected_cases)
        for name in renderers_by_suite[suite.name]
    )
    if not jobs:
        raise NothingSelectedError("no suites or no renderers are named")
    cases: dict[str, dict[str, None]] = {suite.name: {} for suite in loaded}
    for job in jobs:
        cases[job.suite][job.case.name] = None
    # Of the whole plan, before a shard takes its part.
    cases_and_renderers = {name: (tuple(cases[name]), renderers_by_suite[name]) for name in cases}
    for (name, _), case in {(job.suite, job.case.name): job.case for job in jobs}.items():
        with at(f"suite '{name}'"):
            # Before any job begins, and once for all renderers.
            case.check_stimulus()
    own_jobs = jobs if options.shard is None else options.shard.of(jobs)
    return Plan(loaded, names, own_jobs, options, known.with_shipped(), cases_and_renderers)


def _refuse_namesakes(suites: Sequence[Suite]) -> None:
    """Raise `InputError` for two suites of one name: they would write over each other's recordings and verdicts."""
    names = [suite.name for suite in suites]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two suites are named '{name}'", todo="rename one of the files, or run them apart")
