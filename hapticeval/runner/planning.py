"""What will run: the selected cases of the suites, each through each renderer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from hapticeval.discovery import own_renderers, resolve, resolve_installed
from hapticeval.errors import InputError, NothingSelectedError, at
from hapticeval.renderer import RendererFactory
from hapticeval.runner.known import NONE_KNOWN, Known, read_known
from hapticeval.runner.options import DEFAULT_OPTIONS, RunOptions
from hapticeval.runner.results import ResultsDocument, RunKey
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suites
from hapticeval.suite.selection import covering, select
from hapticeval.suite.suite import Suite


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
