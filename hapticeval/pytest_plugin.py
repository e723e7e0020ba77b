"""The pytest plugin: an item a verdict, by `pytest --hapticeval mine:R`, by the fixture and by the marker `hapticeval`.

Loaded in every run of pytest where hapticeval is installed: it imports nothing of it until it is used.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import pytest

if TYPE_CHECKING:
    from hapticeval.api import AnyRenderer, Results
    from hapticeval.runner.known import Known
    from hapticeval.runner.results import VerdictEntry
    from hapticeval.suite.case import Case
    from hapticeval.suite.suite import Suite

ROOT = "hapticeval"
"""Where the ids of items begin: `hapticeval::SUITE::CASE::CHECK[RENDERER]`."""

DEFAULT_SUITE = "thesis"
MARKER = (
    "hapticeval(suite='thesis', select=(), known=None, strict=False, renderer=None): make a test of each verdict of a "
    "suite, or of what is selected of it, and pass the fixture `hapticeval`, which judges it"
)


class NotConforming(AssertionError):
    """A verdict that is not as required."""


class KnownFailure(NotConforming):
    """A verdict that fails as the list of known failures has it."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("hapticeval", "conformance of haptic renderers")
    group.addoption(
        "--hapticeval",
        action="append",
        metavar="RENDERER",
        help="judge this renderer, as in `hapticeval run -r`: an item a verdict; may be repeated",
    )
    group.addoption("--hapticeval-suite", action="append", metavar="SUITE", help=f"in this suite, not {DEFAULT_SUITE}")
    group.addoption("--hapticeval-select", action="append", metavar="EXPR", help="only this, as in `hapticeval run -k`")
    group.addoption(
        "--hapticeval-known", metavar="TOML", help="failures that are known, with reasons: expected to fail"
    )
    group.addoption(
        "--hapticeval-strict", action="store_true", help="let warnings fail, and known failures that are none any more"
    )


LISTED = "hapticeval-known"
"""The property of a test with a list of known failures: its file, renderer and suite, and what is outdated on it."""

WANTED = pytest.StashKey[list[str]]()
"""The ids that the command line names."""


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker, and take ids of ours from the arguments, which are paths otherwise."""
    config.addinivalue_line("markers", MARKER)
    config.stash[WANTED] = [each for each in config.args if each == ROOT or each.startswith(f"{ROOT}::")]
    if config.getoption("hapticeval"):
        config.args[:] = [each for each in config.args if each not in config.stash[WANTED]]
    elif any("::" in each for each in config.stash[WANTED]):
        raise pytest.UsageError(f"{config.stash[WANTED][0]} needs --hapticeval RENDERER")


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    """Collect our items beside those of files."""
    outcome = yield
    if isinstance(collector, pytest.Session) and collector.config.getoption("hapticeval"):
        report = cast("Any", outcome).get_result()
        report.result.append(Renderers.from_parent(collector, name=ROOT, nodeid=ROOT))


class Renderers(pytest.Collector):
    """The root of all verdicts of the renderers that the command line names."""

    def collect(self) -> Iterator[pytest.Collector]:
        """Yield the suites. Raises `CollectError` for what the user got wrong."""
        from hapticeval.discovery import resolve
        from hapticeval.errors import HapticevalError

        options = self.config.getoption
        try:
            for name in options("hapticeval"):
                resolve(name)
            asked = Asked.of(
                options("hapticeval_suite") or DEFAULT_SUITE,
                options("hapticeval_select") or (),
                options("hapticeval_known"),
                folder=self.config.invocation_params.dir,
                strict=options("hapticeval_strict"),
            )
        except HapticevalError as error:
            raise self.CollectError(str(error)) from error
        suites = {suite.name: suite for suite, _ in asked.cases}
        found = [_Suite.from_parent(self, name=name, asked=asked) for name in suites]
        wanted = [each for each in self.config.stash[WANTED] if each != ROOT]
        ids = [item.nodeid for suite in found for case in suite.collect() for item in case.collect()]
        for each in wanted:
            if not any(_within(one, each) for one in ids):
                raise self.CollectError(
                    f"no verdict has the id {each}: `pytest --hapticeval ... --collect-only` has all"
                )
        yield from found


def _within(nodeid: str, wanted: str) -> bool:
    """Return whether an id is the wanted one or below it; that of a check may lack its renderer."""
    return nodeid == wanted or nodeid.startswith((f"{wanted}::", f"{wanted}["))


class _Suite(pytest.Collector):
    """A suite."""

    def __init__(self, *, asked: Asked, **names: Any) -> None:
        super().__init__(**names)
        self.asked = asked

    def collect(self) -> Iterator[_Case]:
        for suite, case in self.asked.cases:
            if suite.name == self.name:
                yield _Case.from_parent(self, name=case.name, asked=self.asked, suite=suite, case=case)


class _Case(pytest.Collector):
    """A case of a suite."""

    def __init__(self, *, asked: Asked, suite: Suite, case: Case, **names: Any) -> None:
        super().__init__(**names)
        self.asked, self.suite, self.case = asked, suite, case

    def collect(self) -> Iterator[VerdictItem]:
        wanted = [each for each in self.config.stash[WANTED] if each != ROOT]
        for renderer in self.config.getoption("hapticeval"):
            for check in self.case.checks:
                name = f"{check}[{renderer}]"
                # Given whole, for an id of its parts is not the one that pytest reads of --last-failed.
                nodeid = f"{self.nodeid}::{name}"
                item = VerdictItem.from_parent(self, name=name, nodeid=nodeid, renderer=renderer, check=check)
                if not wanted or any(_within(item.nodeid, each) for each in wanted):
                    yield item


class VerdictItem(pytest.Item):
    """The verdict of one check on one renderer in one case."""

    def __init__(self, *, parent: _Case, renderer: str, check: str, **names: Any) -> None:
        super().__init__(parent=parent, **names)
        self.case, self.renderer, self.check = parent, renderer, check
        asked, place = parent.asked, f"{parent.suite.name}/{parent.case.name}/{check}"
        self.add_marker(pytest.mark.hapticeval)
        if self.config.pluginmanager.hasplugin("xdist"):
            self.add_marker(pytest.mark.xdist_group(f"{renderer} {parent.suite.name}/{parent.case.name}"))
        entry = asked.known.entries.get((renderer, place))
        if entry is not None:
            self.add_marker(pytest.mark.xfail(reason=entry.reason, raises=KnownFailure, strict=asked.strict))

    def runtest(self) -> None:
        """Judge the case, unless the item before was of it, and take the verdict."""
        case = self.case
        results = _judged(self.config, self.renderer, case.suite, case.case)
        conclude(self, results, self.check, case.asked)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the verdict in words, without a traceback of ours."""
        return str(excinfo.value) if isinstance(excinfo.value, NotConforming) else super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return what heads the failure."""
        return self.path, None, self.nodeid


@dataclass(frozen=True)
class Asked:
    """What is to be judged: the cases with their suites, and what is known to fail."""

    cases: Sequence[tuple[Suite, Case]]
    known: Known
    strict: bool
    listed: Path | None = None
    """The file of what is known."""

    @classmethod
    def of(
        cls,
        suite: str | Sequence[str],
        select: str | Sequence[str],
        known: str | Path | None,
        *,
        folder: Path,
        strict: bool,
    ) -> Asked:
        """Load suites and the list of known failures, whose paths count from `folder`. Raises `HapticevalError`."""
        from hapticeval.runner.known import NONE_KNOWN, read_known
        from hapticeval.suite.reading import load_suites
        from hapticeval.suite.selection import select as selected

        names = [str(folder / name) if name.endswith(".toml") else name for name in _several(suite)]
        suites = load_suites(names)
        listed = NONE_KNOWN if known is None else read_known(folder / known)
        listed.check(suites)
        return cls(selected(suites, _several(select)), listed, strict, None if known is None else folder / known)


def _several(given: str | Sequence[str]) -> Sequence[str]:
    return (given,) if isinstance(given, str) else tuple(given)


class _Last(NamedTuple):
    """The case that was judged last, of which the next item is as well if it is of the same renderer."""

    renderer: object
    place: tuple[str, Case]
    results: Results


LAST = pytest.StashKey[_Last]()


def _judged(config: pytest.Config, renderer: AnyRenderer, suite: Suite, case: Case) -> Results:
    """Return what the checks of a case find, judged once for items that follow one another."""
    from hapticeval import api

    last = config.stash.get(LAST, None)
    if last is None or last.renderer is not renderer or last.place != (suite.name, case):
        results = api.run([renderer], suites=replace(suite, cases=(case,), rows=()), workers=0)
        if results.stopped:
            raise KeyboardInterrupt
        last = config.stash[LAST] = _Last(renderer, (suite.name, case), results)
    return last.results


def conclude(node: pytest.Item, results: Results, check: str, asked: Asked) -> VerdictEntry:
    """Raise, skip or expect a failure as the verdict of a check has it; return one that is as required.

    Raises `KnownFailure` and `NotConforming`; what only warns, or fails as published, is expected to fail.
    """
    __tracebackhide__ = True
    verdict = asked.known.marked(next(each for each in results.verdicts if each.check == check))
    _note(node, asked.listed, [verdict])
    if verdict.stops(strict=asked.strict) and not (verdict.outdated and verdict.outcome == "pass"):
        raise NotConforming(described(node.config, results, verdict))
    if verdict.outcome == "not-applicable":
        pytest.skip(verdict.message)
    if verdict.standing == "known":
        raise KnownFailure(described(node.config, results, verdict))
    if verdict.outcome != "pass":
        standing = "as published" if verdict.published else f"level {verdict.level}"
        pytest.xfail(f"{verdict.outcome}, {standing}: {verdict.message}")
    return verdict


def described(config: pytest.Config, results: Results, verdict: VerdictEntry) -> str:
    """Return verdict, metric, bound, place, the picture's path, and how to see it again."""
    lines = [f"{verdict.check} on {verdict.renderer}, {verdict.suite}/{verdict.case}: {verdict.outcome}"]
    lines += [f"  {text}" for text in (verdict.message, verdict.measured, _where(verdict)) if text]
    if verdict.published and not verdict.known:
        lines.append(f"  published: {verdict.published}")
    if verdict.outdated:
        lines.append(f"  known to fail, and does not any more: take it off the list ({verdict.known})")
    lines.append(f"  picture: {_picture(config, results, verdict)}")
    lines.append(f"  explained by: hapticeval explain {verdict.check}")
    return "\n".join(lines)


def _where(verdict: VerdictEntry) -> str:
    """Return time, HIP and IHIP of the evidence, for instance `at t = 2.572 s, HIP (10, 20) mm`."""
    from hapticeval.errors import in_mm

    evidence = verdict.evidence
    parts = [f"t = {evidence['time']:.4g} s"] if isinstance(evidence.get("time"), float) else []
    for name in ("hip", "ihip"):
        point = evidence.get(name)
        if isinstance(point, list) and all(isinstance(each, float) for each in point):
            parts.append(f"{name.upper()} {in_mm(point)}")
    return f"at {', '.join(parts)}" if parts else ""


def _picture(config: pytest.Config, results: Results, verdict: VerdictEntry) -> str:
    """Draw the run with its marks below pytest's cache, and return the path, or why there is none."""
    from hapticeval.files import file_stem

    name = file_stem(f"{verdict.suite}-{verdict.case}-{verdict.renderer}")
    cache = getattr(config, "cache", None)
    if cache is None:
        return "none, for pytest has no cache"
    file = Path(cache.mkdir("hapticeval")) / f"{name}.svg"
    try:
        results.plot(f"{verdict.suite}/{verdict.case}", verdict.renderer).savefig(file)
    except Exception as error:  # a picture that cannot be drawn must not hide the verdict
        return f"none: {error}"
    return os.path.relpath(file)


def _asked(marker: pytest.Mark, folder: Path) -> Asked:
    """Return what a marker asks for. Raises `UsageError` for what it cannot mean."""
    from hapticeval.errors import HapticevalError

    options = {"suite": DEFAULT_SUITE, "select": (), "known": None, "strict": False, "renderer": None, **marker.kwargs}
    if marker.args or len(options) > 5:
        raise pytest.UsageError(f"@pytest.mark.hapticeval takes no others than {MARKER.partition(':')[0]}")
    try:
        return Asked.of(options["suite"], options["select"], options["known"], folder=folder, strict=options["strict"])
    except HapticevalError as error:
        raise pytest.UsageError(f"@pytest.mark.hapticeval: {error}") from error


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make a test of each verdict that the marker asks for."""
    marker = metafunc.definition.get_closest_marker("hapticeval")
    if marker is None or "hapticeval" not in metafunc.fixturenames:
        return
    asked = _asked(marker, metafunc.definition.path.parent)
    places = [(asked, suite, case, check) for suite, case in asked.cases for check in case.checks]
    ids = [f"{suite.name}/{case.name}/{check}" for _, suite, case, check in places]
    metafunc.parametrize("hapticeval", places, ids=ids, indirect=True)


@pytest.fixture
def hapticeval(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """Judge a renderer: a class, a factory, an instance or a name.

    With the marker `hapticeval` a test is one verdict: `hapticeval(Mine)` returns it, or fails as it does. Without, it
    judges all cases that `suite` and `select` name, fails with all that is not as required, and returns the results.
    """
    given = getattr(request, "param", None)
    config = request.config
    if given is None:

        def judge_all(renderer: AnyRenderer, **options: Any) -> Results:
            __tracebackhide__ = True
            return _whole(request.node, request.path.parent, renderer, **options)

        return judge_all
    asked, suite, case, check = given
    marker = request.node.get_closest_marker("hapticeval")

    def judge(renderer: AnyRenderer | None = None) -> VerdictEntry:
        __tracebackhide__ = True
        wanted = marker.kwargs.get("renderer") if renderer is None else renderer
        if wanted is None:
            raise pytest.UsageError("hapticeval(RENDERER): no renderer is given, and none by the marker")
        results = _judged(config, wanted, suite, case)
        name = results.document.renderers[0]
        entry = asked.known.entries.get((name, f"{suite.name}/{case.name}/{check}"))
        if entry is not None:
            request.applymarker(pytest.mark.xfail(reason=entry.reason, raises=KnownFailure, strict=asked.strict))
        return conclude(request.node, results, check, asked)

    return judge


def _whole(
    node: pytest.Item,
    folder: Path,
    renderer: AnyRenderer,
    *,
    suite: str | Sequence[str] = DEFAULT_SUITE,
    select: str | Sequence[str] = (),
    known: str | Path | None = None,
    strict: bool = False,
) -> Results:
    """Judge a renderer in all cases, and raise `NotConforming` with all that is not as required."""
    from hapticeval import api

    __tracebackhide__ = True
    names = [str(folder / name) if name.endswith(".toml") else name for name in _several(suite)]
    listed = None if known is None else folder / known
    results = api.run(
        [renderer],
        suites=names,
        select=_several(select),
        known=listed,
        strict=strict,
        workers=0,
    )
    if results.stopped:
        raise KeyboardInterrupt
    _note(node, listed, results.verdicts)
    wrong = _worst_first(each for each in results.verdicts if results.document.stops(each))
    if wrong:
        raise NotConforming("\n".join(described(node.config, results, each) for each in wrong))
    return results


def _note(node: pytest.Item, listed: Path | None, verdicts: Iterable[VerdictEntry]) -> None:
    """Leave with a test what the terminal summary says of its list of known failures, also where xdist is between."""
    from hapticeval.runner.known import describe_outdated

    if listed is None:
        return
    notes = [
        (str(listed), each.renderer, each.suite, *(describe_outdated(each) if each.outdated else ()))
        for each in verdicts
    ]
    node.user_properties += [(LISTED, note) for note in dict.fromkeys(notes)]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print what lists of known failures have about renderers and suites that did not run, and what is outdated."""
    reports = [report for reports in terminalreporter.stats.values() for report in reports]
    properties = [each for report in reports for each in getattr(report, "user_properties", ())]
    notes = dict.fromkeys(tuple(value) for name, value in properties if name == LISTED)
    if not notes:
        return
    from hapticeval.runner.known import read_known

    lines: list[str] = []
    for file in dict.fromkeys(note[0] for note in notes):
        ran = [note[1:3] for note in notes if note[0] == file]
        renderers, suites = ({each[at] for each in ran} for at in (0, 1))
        known = read_known(Path(file))
        lines += known.unplanned(sorted(renderers), sorted(suites)) + known.unsized()
    lines += [f"{head}\n  {todo}" for _, _, _, head, todo in (note for note in notes if len(note) > 3)]
    if lines:
        terminalreporter.write_sep("=", "known failures of hapticeval")
        for line in lines:
            terminalreporter.write_line(line)


def _worst_first(verdicts: Iterable[VerdictEntry]) -> list[VerdictEntry]:
    return sorted(verdicts, key=lambda each: each.severity, reverse=True)
