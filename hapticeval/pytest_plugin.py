"""The pytest plugin: one test per verdict, by `pytest --hapticeval mine:R`, the fixture or the marker `hapticeval`.

Loaded in every run of pytest where hapticeval is installed: it imports a name of it, and nothing more until it is used.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import pytest

from hapticeval.suite import DEFAULT_SUITE

if TYPE_CHECKING:
    from hapticeval.api import AnyRenderer, Results
    from hapticeval.runner.known import Known
    from hapticeval.runner.results import VerdictEntry
    from hapticeval.suite.case import Case
    from hapticeval.suite.suite import Suite

ITEM_ROOT = "hapticeval"
"""Where the ids of items begin: `hapticeval::SUITE::CASE::CHECK[RENDERER]`."""

MARKER = (
    "hapticeval(suite='thesis', select=(), known=None, strict=False, renderer=None): make a test of each verdict of a "
    "suite, or of what is selected of it, and pass the fixture `hapticeval`, which judges it"
)


class NotConforming(AssertionError):
    """A verdict that is not as required."""


class KnownFailure(NotConforming):
    """A verdict that fails as the list of known failures has it."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options `--hapticeval...`."""
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


KNOWN_PROPERTY = "hapticeval-known"
"""The property of a test with a list of known failures: its file, renderer and suite, and what is outdated on it."""

CHOSEN_IDS = pytest.StashKey[list[str]]()
"""The ids that the command line names."""


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker, and take ids of ours from the arguments, which are paths otherwise."""
    config.addinivalue_line("markers", MARKER)
    config.stash[CHOSEN_IDS] = [
        argument for argument in config.args if argument == ITEM_ROOT or argument.startswith(f"{ITEM_ROOT}::")
    ]
    if config.getoption("hapticeval"):
        # An id of ours is no path: pytest would look for a file of that name.
        config.args[:] = [argument for argument in config.args if argument not in config.stash[CHOSEN_IDS]]
    elif any("::" in node_id for node_id in config.stash[CHOSEN_IDS]):
        raise pytest.UsageError(f"{config.stash[CHOSEN_IDS][0]} needs --hapticeval RENDERER")


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    """Collect our items beside those of files."""
    outcome = yield
    if isinstance(collector, pytest.Session) and collector.config.getoption("hapticeval"):
        report = cast("Any", outcome).get_result()
        # The root beside the directories and files that pytest has collected itself.
        report.result.append(Renderers.from_parent(collector, name=ITEM_ROOT, nodeid=ITEM_ROOT))


class Renderers(pytest.Collector):
    """The root of all verdicts of the renderers that the command line names."""

    def collect(self) -> Iterator[pytest.Collector]:
        """Yield the suites. Raises `CollectError` for what the user got wrong."""
        from hapticeval.discovery import resolve
        from hapticeval.errors import HapticevalError

        options = self.config.getoption
        try:
            # A name that leads nowhere is an error of the collection, not of every verdict.
            for name in options("hapticeval"):
                resolve(name)
            selection = Selection.of(
                options("hapticeval_suite") or DEFAULT_SUITE,
                options("hapticeval_select") or (),
                options("hapticeval_known"),
                folder=self.config.invocation_params.dir,
                strict=options("hapticeval_strict"),
            )
        except HapticevalError as error:
            raise self.CollectError(str(error)) from error
        suites = {suite.name: suite for suite, _ in selection.cases}
        suite_collectors = [_Suite.from_parent(self, name=name, selection=selection) for name in suites]
        chosen_ids = [node_id for node_id in self.config.stash[CHOSEN_IDS] if node_id != ITEM_ROOT]
        # Collected here for the check of the ids alone; pytest collects again for itself.
        ids = [
            verdict_item.nodeid
            for suite in suite_collectors
            for case in suite.collect()
            for verdict_item in case.collect()
        ]
        for chosen_id in chosen_ids:
            if not any(_within(one, chosen_id) for one in ids):
                raise self.CollectError(
                    f"no verdict has the id {chosen_id}: `pytest --hapticeval ... --collect-only` has all"
                )
        yield from suite_collectors


def _within(nodeid: str, chosen_id: str) -> bool:
    """Return whether an id is the wanted one or below it; that of a check may lack its renderer."""
    return nodeid == chosen_id or nodeid.startswith((f"{chosen_id}::", f"{chosen_id}["))


class _Suite(pytest.Collector):
    """Collects the cases of a suite."""

    def __init__(self, *, selection: Selection, **names: Any) -> None:
        super().__init__(**names)
        self.selection = selection

    def collect(self) -> Iterator[_Case]:
        for suite, case in self.selection.cases:
            if suite.name == self.name:
                yield _Case.from_parent(self, name=case.name, selection=self.selection, suite=suite, case=case)


class _Case(pytest.Collector):
    """Collects the verdicts of a case: one for each renderer and check."""

    def __init__(self, *, selection: Selection, suite: Suite, case: Case, **names: Any) -> None:
        super().__init__(**names)
        self.selection, self.suite, self.case = selection, suite, case

    def collect(self) -> Iterator[VerdictItem]:
        chosen_ids = [node_id for node_id in self.config.stash[CHOSEN_IDS] if node_id != ITEM_ROOT]
        for renderer in self.config.getoption("hapticeval"):
            for check in self.case.checks:
                name = f"{check}[{renderer}]"
                # Given whole, for an id of its parts is not the one that pytest reads of --last-failed.
                nodeid = f"{self.nodeid}::{name}"
                verdict_item = VerdictItem.from_parent(self, name=name, nodeid=nodeid, renderer=renderer, check=check)
                if not chosen_ids or any(_within(verdict_item.nodeid, chosen_id) for chosen_id in chosen_ids):
                    yield verdict_item


class VerdictItem(pytest.Item):
    """The verdict of one check on one renderer in one case."""

    def __init__(self, *, parent: _Case, renderer: str, check: str, **names: Any) -> None:
        super().__init__(parent=parent, **names)
        self.case, self.renderer, self.check = parent, renderer, check
        selection, place = parent.selection, f"{parent.suite.name}/{parent.case.name}/{check}"
        self.add_marker(pytest.mark.hapticeval)
        # With --dist loadgroup all verdicts of one run go to one process: the case is judged once.
        if self.config.pluginmanager.hasplugin("xdist"):
            self.add_marker(pytest.mark.xdist_group(f"{renderer} {parent.suite.name}/{parent.case.name}"))
        entry = selection.known.entries.get((renderer, place))
        if entry is not None:
            # xfail by `raises`: only the failure that is on the list is expected, no other.
            self.add_marker(pytest.mark.xfail(reason=entry.reason, raises=KnownFailure, strict=selection.strict))

    def runtest(self) -> None:
        """Judge the case, unless the item before was of it, and take the verdict."""
        case = self.case
        results = _judge_case(self.config, self.renderer, case.suite, case.case)
        conclude(self, results, self.check, case.selection)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the verdict in words, without a traceback of ours."""
        return str(excinfo.value) if isinstance(excinfo.value, NotConforming) else super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return what heads the failure."""
        return self.path, None, self.nodeid


@dataclass(frozen=True)
class Selection:
    """What is to be judged: the cases with their suites, and what is known to fail."""

    cases: Sequence[tuple[Suite, Case]]
    known: Known
    strict: bool
    known_file: Path | None = None
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
    ) -> Selection:
        """Load suites and the list of known failures, whose paths count from `folder`. Raises `HapticevalError`."""
        from hapticeval.runner.known import NONE_KNOWN, read_known
        from hapticeval.suite.reading import load_suites
        from hapticeval.suite.selection import select as selected

        names = [str(folder / name) if name.endswith(".toml") else name for name in _as_names(suite)]
        suites = load_suites(names)
        listed = NONE_KNOWN if known is None else read_known(folder / known)
        listed.check(suites)
        return cls(selected(suites, _as_names(select)), listed, strict, None if known is None else folder / known)


def _as_names(names: str | Sequence[str]) -> Sequence[str]:
    return (names,) if isinstance(names, str) else tuple(names)


class _LastJudged(NamedTuple):
    """The results of the case that was judged last: the next test often is another verdict of it."""

    renderer: object
    place: tuple[str, Case]
    results: Results


LAST_JUDGED = pytest.StashKey[_LastJudged]()


def _judge_case(config: pytest.Config, renderer: AnyRenderer, suite: Suite, case: Case) -> Results:
    """Return the results of a renderer in a case, judged once for all tests of it that follow one another."""
    from hapticeval import api

    # pytest runs items in order, so that the verdicts of one case follow one another: one result is enough to keep.
    last = config.stash.get(LAST_JUDGED, None)
    if last is None or last.renderer is not renderer or last.place != (suite.name, case):
        results = api.run([renderer], suites=replace(suite, cases=(case,), rows=()), workers=0)
        if results.stopped:
            raise KeyboardInterrupt
        last = config.stash[LAST_JUDGED] = _LastJudged(renderer, (suite.name, case), results)
    return last.results


def conclude(node: pytest.Item, results: Results, check: str, selection: Selection) -> VerdictEntry:
    """Raise, skip or expect a failure as the verdict of a check has it; return one that is as required.

    Raises `KnownFailure` and `NotConforming`; what only warns, or is inherent, is expected to fail.
    """
    __tracebackhide__ = True
    verdict = selection.known.marked(next(entry for entry in results.verdicts if entry.check == check))
    _note_known(node, selection.known_file, [verdict])
    # A verdict that passes though it is listed is told by the strict xfail mark, not here.
    standing = verdict.standing
    if verdict.stops(strict=selection.strict) and standing != "outdated":
        raise NotConforming(describe_verdict(node.config, results, verdict))
    # What does not stop: not applicable is skipped, known and warned-of failures are expected, and the rest passes.
    if verdict.outcome == "not-applicable":
        pytest.skip(verdict.message)
    if standing == "known":
        raise KnownFailure(describe_verdict(node.config, results, verdict))
    if verdict.outcome != "pass":
        why = f"inherent, for {verdict.inherent}" if standing == "inherent" else f"level {verdict.level}"
        pytest.xfail(f"{verdict.outcome}, {why}: {verdict.message}")
    return verdict


def describe_verdict(config: pytest.Config, results: Results, verdict: VerdictEntry) -> str:
    """Describe a verdict for a failed test: metric, bound, place, the picture's path, and how to see it again."""
    lines = [f"{verdict.check} on {verdict.renderer}, {verdict.suite}/{verdict.case}: {verdict.outcome}"]
    lines += [f"  {text}" for text in (verdict.message, verdict.measured, _describe_place(verdict)) if text]
    if verdict.published and not verdict.known:
        lines.append(f"  published: {verdict.published}")
    if verdict.standing == "outdated":
        lines.append(f"  known to fail, and does not any more: take it off the list ({verdict.known})")
    lines.append(f"  picture: {_draw_picture(config, results, verdict)}")
    lines.append(f"  explained by: hapticeval explain {verdict.check}")
    return "\n".join(lines)


def _describe_place(verdict: VerdictEntry) -> str:
    """Return time, HIP and IHIP of the evidence, for instance `at t = 2.572 s, HIP (10, 20) mm`."""
    from hapticeval.errors import in_mm

    evidence = verdict.evidence
    # Evidence comes from checks of other people too: each entry is looked at before it is formatted.
    parts = [f"t = {evidence['time']:.4g} s"] if isinstance(evidence.get("time"), float) else []
    for name in ("hip", "ihip"):
        point = evidence.get(name)
        if isinstance(point, list) and all(isinstance(coordinate, float) for coordinate in point):
            parts.append(f"{name.upper()} {in_mm(point)}")
    return f"at {', '.join(parts)}" if parts else ""


def _draw_picture(config: pytest.Config, results: Results, verdict: VerdictEntry) -> str:
    """Draw the run with its marks below pytest's cache, and return the path, or why there is none."""
    from hapticeval.files import file_stem

    name = file_stem(f"{verdict.suite}-{verdict.case}-{verdict.renderer}")
    # -p no:cacheprovider takes the cache away.
    cache = getattr(config, "cache", None)
    if cache is None:
        return "none, for pytest has no cache"
    file = Path(cache.mkdir("hapticeval")) / f"{name}.svg"
    try:
        results.plot(f"{verdict.suite}/{verdict.case}", verdict.renderer).savefig(file)
    except Exception as error:  # a picture that cannot be drawn must not hide the verdict
        return f"none: {error}"
    return os.path.relpath(file)


def _selection_of(marker: pytest.Mark, folder: Path) -> Selection:
    """Return what a marker asks for. Raises `UsageError` for what it cannot mean."""
    from hapticeval.errors import HapticevalError

    options = {"suite": DEFAULT_SUITE, "select": (), "known": None, "strict": False, "renderer": None, **marker.kwargs}
    # Five options are all: a sixth key is a word that the marker does not know.
    if marker.args or len(options) > 5:
        raise pytest.UsageError(f"@pytest.mark.hapticeval takes no others than {MARKER.partition(':')[0]}")
    try:
        return Selection.of(
            options["suite"], options["select"], options["known"], folder=folder, strict=options["strict"]
        )
    except HapticevalError as error:
        raise pytest.UsageError(f"@pytest.mark.hapticeval: {error}") from error


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make a test of each verdict that the marker asks for."""
    marker = metafunc.definition.get_closest_marker("hapticeval")
    if marker is None or "hapticeval" not in metafunc.fixturenames:
        return
    selection = _selection_of(marker, metafunc.definition.path.parent)
    # One parameter a verdict: its id is that of the verdict.
    places = [(selection, suite, case, check) for suite, case in selection.cases for check in case.checks]
    ids = [f"{suite.name}/{case.name}/{check}" for _, suite, case, check in places]
    metafunc.parametrize("hapticeval", places, ids=ids, indirect=True)


@pytest.fixture
def hapticeval(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """Judge a renderer: a class, a factory, an instance or a name.

    With the marker `hapticeval` a test is one verdict: `hapticeval(Mine)` returns it, or fails as it does. Without, it
    judges all cases that `suite` and `select` name, fails with all that is not as required, and returns the results.
    """
    place = getattr(request, "param", None)
    config = request.config
    # Without the marker there are no parameters: the fixture judges all cases at once.
    if place is None:

        def judge_all(renderer: AnyRenderer, **options: Any) -> Results:
            __tracebackhide__ = True
            return _judge_all(request.node, request.path.parent, renderer, **options)

        return judge_all
    selection, suite, case, check = place
    marker = request.node.get_closest_marker("hapticeval")

    def judge(renderer: AnyRenderer | None = None) -> VerdictEntry:
        __tracebackhide__ = True
        judged_renderer = marker.kwargs.get("renderer") if renderer is None else renderer
        if judged_renderer is None:
            raise pytest.UsageError("hapticeval(RENDERER): no renderer is given, and none by the marker")
        results = _judge_case(config, judged_renderer, suite, case)
        name = results.document.renderers[0]
        # The renderer is known only now, and with it what of the list is about it.
        entry = selection.known.entries.get((name, f"{suite.name}/{case.name}/{check}"))
        if entry is not None:
            request.applymarker(pytest.mark.xfail(reason=entry.reason, raises=KnownFailure, strict=selection.strict))
        return conclude(request.node, results, check, selection)

    return judge


def _judge_all(
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
    names = [str(folder / name) if name.endswith(".toml") else name for name in _as_names(suite)]
    listed = None if known is None else folder / known
    results = api.run(
        [renderer],
        suites=names,
        select=_as_names(select),
        known=listed,
        strict=strict,
        workers=0,
    )
    if results.stopped:
        raise KeyboardInterrupt
    _note_known(node, listed, results.verdicts)
    wrong = _worst_first(verdict for verdict in results.verdicts if results.document.stops(verdict))
    if wrong:
        raise NotConforming("\n".join(describe_verdict(node.config, results, verdict) for verdict in wrong))
    return results


def _note_known(node: pytest.Item, listed: Path | None, verdicts: Iterable[VerdictEntry]) -> None:
    """Leave notes with a test for the terminal summary of known failures, in a way that xdist carries along."""
    from hapticeval.runner.known import describe_outdated

    if listed is None:
        return
    notes = [
        (
            str(listed),
            verdict.renderer,
            verdict.suite,
            *(describe_outdated(verdict) if verdict.standing == "outdated" else ()),
        )
        for verdict in verdicts
    ]
    # User properties travel from xdist's processes with the report; the stash does not.
    node.user_properties += [(KNOWN_PROPERTY, note) for note in dict.fromkeys(notes)]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print which known failures are outdated, and which are of renderers and suites that did not run."""
    reports = [report for reports in terminalreporter.stats.values() for report in reports]
    properties = [user_property for report in reports for user_property in getattr(report, "user_properties", ())]
    notes = dict.fromkeys(tuple(value) for name, value in properties if name == KNOWN_PROPERTY)
    if not notes:
        return
    from hapticeval.runner.known import read_known

    lines: list[str] = []
    for file in dict.fromkeys(note[0] for note in notes):
        ran = [note[1:3] for note in notes if note[0] == file]
        # What ran with this list: entries of other renderers and suites were not planned.
        renderers, suites = ({pair[at] for pair in ran} for at in (0, 1))
        known = read_known(Path(file))
        lines += known.remarks(sorted(renderers), sorted(suites))
    lines += [f"{head}\n  {todo}" for _, _, _, head, todo in (note for note in notes if len(note) > 3)]
    if lines:
        terminalreporter.write_sep("=", "known failures of hapticeval")
        for line in lines:
            terminalreporter.write_line(line)


def _worst_first(verdicts: Iterable[VerdictEntry]) -> list[VerdictEntry]:
    return sorted(verdicts, key=lambda verdict: verdict.severity, reverse=True)
