"""The pytest plugin: one test per verdict, by `pytest --hapticeval mine:R`, the fixture or the marker `hapticeval`.

Loaded in every run of pytest where hapticeval is installed: it imports a name of it, and nothing more until it is used.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, product
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

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

LAST_JUDGED = pytest.StashKey[tuple[object, str, "Case", "Results"]]()
"""What was judged last, with its results: renderer, suite and case. The next test often is another verdict of it."""


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker, and take ids of ours from the arguments, which are paths otherwise."""
    config.addinivalue_line("markers", MARKER)
    chosen_ids = [argument for argument in config.args if argument.partition("::")[0] == ITEM_ROOT]
    if config.getoption("hapticeval"):
        # An id of ours is not a path: pytest would look for a file of that name.
        config.args[:] = [argument for argument in config.args if argument not in chosen_ids]
    elif any("::" in node_id for node_id in chosen_ids):
        raise pytest.UsageError(f"{chosen_ids[0]} needs --hapticeval RENDERER")
    config.stash[CHOSEN_IDS] = [node_id for node_id in chosen_ids if node_id != ITEM_ROOT]


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    """Collect our items beside those of files."""
    outcome = yield
    if isinstance(collector, pytest.Session) and collector.config.getoption("hapticeval"):
        report = cast("Any", outcome).get_result()
        report.result.append(Verdicts.from_parent(collector, name=ITEM_ROOT, nodeid=ITEM_ROOT))


@dataclass(frozen=True)
class Question:
    """A verdict that is asked for: of a check in a case of a suite, with the list of what is `known` to fail."""

    suite: Suite
    case: Case
    check: str
    known: Known
    known_file: Path | None
    strict: bool

    @property
    def place(self) -> str:
        """What selects it: SUITE/CASE/CHECK."""
        return f"{self.suite.name}/{self.case.name}/{self.check}"


def questions_of(
    suite: str | Sequence[str], select: str | Sequence[str], known: str | Path | None, *, folder: Path, strict: bool
) -> list[Question]:
    """Return what is asked for. Paths of suites and of the list count from `folder`. Raises `HapticevalError`."""
    from hapticeval.runner.known import NONE_KNOWN, read_known
    from hapticeval.suite.reading import load_suites
    from hapticeval.suite.selection import select as selected

    suites = load_suites(_suites_in(folder, suite))
    file = None if known is None else folder / known
    listed = NONE_KNOWN if file is None else read_known(file)
    listed.check(suites)
    cases = selected(suites, _as_names(select))
    return [
        Question(its_suite, case, check, listed, file, strict) for its_suite, case in cases for check in case.checks
    ]


def _as_names(names: str | Sequence[str]) -> Sequence[str]:
    return (names,) if isinstance(names, str) else tuple(names)


def _suites_in(folder: Path, suite: str | Sequence[str]) -> list[str]:
    return [str(folder / name) if name.endswith(".toml") else name for name in _as_names(suite)]


class Verdicts(pytest.Collector):
    """All verdicts on the renderers that the command line names."""

    def collect(self) -> Iterator[VerdictItem]:
        """Yield those that the command line chooses. Raises `CollectError` for what the user got wrong."""
        from hapticeval.discovery import resolve
        from hapticeval.errors import HapticevalError

        options, chosen_ids = self.config.getoption, self.config.stash[CHOSEN_IDS]
        try:
            # A name that leads nowhere is an error of the collection, not of every verdict.
            for name in options("hapticeval"):
                resolve(name)
            questions = questions_of(
                options("hapticeval_suite") or DEFAULT_SUITE,
                options("hapticeval_select") or (),
                options("hapticeval_known"),
                folder=self.config.invocation_params.dir,
                strict=options("hapticeval_strict"),
            )
        except HapticevalError as error:
            raise self.CollectError(str(error)) from error
        # Those of a case follow one another, by renderer: it is judged once.
        question_of = {
            f"{ITEM_ROOT}::{question.place.replace('/', '::')}[{renderer}]": (renderer, question)
            for _, of_case in groupby(questions, key=lambda question: (question.suite.name, question.case.name))
            for renderer, question in product(options("hapticeval"), list(of_case))
        }
        for chosen_id in chosen_ids:
            if not any(_within(node_id, chosen_id) for node_id in question_of):
                raise self.CollectError(
                    f"no verdict has the id {chosen_id}: `pytest --hapticeval ... --collect-only` has all"
                )
        for node_id, (renderer, question) in question_of.items():
            if not chosen_ids or any(_within(node_id, chosen_id) for chosen_id in chosen_ids):
                name = node_id.removeprefix(f"{ITEM_ROOT}::")
                yield VerdictItem.from_parent(self, name=name, nodeid=node_id, renderer=renderer, question=question)


def _within(node_id: str, chosen_id: str) -> bool:
    """Return whether an id is the wanted one or below it; that of a check may lack its renderer."""
    return node_id == chosen_id or node_id.startswith((f"{chosen_id}::", f"{chosen_id}["))


class VerdictItem(pytest.Item):
    """The verdict of one check on one renderer in one case."""

    def __init__(self, *, renderer: str, question: Question, **names: Any) -> None:
        super().__init__(**names)
        self.renderer, self.question = renderer, question
        self.add_marker(pytest.mark.hapticeval)
        # With --dist loadgroup all verdicts of one run go to one process: the case is judged once.
        if self.config.pluginmanager.hasplugin("xdist"):
            self.add_marker(pytest.mark.xdist_group(f"{renderer} {question.suite.name}/{question.case.name}"))

    def runtest(self) -> None:
        """Judge the case, unless the item before was of it, and take the verdict."""
        judge(self, self.question, self.renderer)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the verdict in words, without a traceback of ours."""
        return str(excinfo.value) if isinstance(excinfo.value, NotConforming) else super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return what heads the failure."""
        return self.path, None, self.nodeid


def judge(node: pytest.Item, question: Question, renderer: AnyRenderer) -> VerdictEntry:
    """Raise, skip or expect a failure as the verdict that is asked for has it; return one that is as required.

    Raises `KnownFailure` and `NotConforming`; what only warns, or is inherent, is expected to fail. A case is judged
    once for all tests of it that follow one another.
    """
    from hapticeval import api

    __tracebackhide__ = True
    suite, case, stash = question.suite, question.case, node.config.stash
    last = stash.get(LAST_JUDGED, None)
    if last is None or last[0] is not renderer or last[1:3] != (suite.name, case):
        results = api.run([renderer], suites=replace(suite, cases=(case,), rows=()), workers=0)
        if results.stopped:
            raise KeyboardInterrupt
        last = stash[LAST_JUDGED] = (renderer, suite.name, case, results)
    results = last[3]
    verdict = question.known.marked(next(entry for entry in results.verdicts if entry.check == question.check))
    entry = question.known.entries.get((verdict.renderer, question.place))
    if entry is not None:
        # xfail by `raises`: only the failure that is on the list is expected, no other.
        node.add_marker(pytest.mark.xfail(reason=entry.reason, raises=KnownFailure, strict=question.strict))
    _note_known(node, question.known_file, [verdict])
    standing = verdict.standing
    # A verdict that passes though it is listed is told by the strict xfail mark, not here.
    if verdict.stops(strict=question.strict) and standing != "outdated":
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
    from hapticeval.errors import in_mm

    evidence = verdict.evidence
    # Evidence comes from checks of other people too: each entry is looked at before it is formatted.
    parts = [f"t = {evidence['time']:.4g} s"] if isinstance(evidence.get("time"), float) else []
    for name in ("hip", "ihip"):
        point = evidence.get(name)
        if isinstance(point, list) and all(isinstance(coordinate, float) for coordinate in point):
            parts.append(f"{name.upper()} {in_mm(point)}")
    place = f"at {', '.join(parts)}" if parts else ""
    published = f"published: {verdict.published}" if verdict.published and not verdict.known else ""
    outdated = f"known to fail, and does not any more: take it off the list ({verdict.known})"
    lines = [
        verdict.message,
        verdict.measured,
        place,
        published,
        outdated if verdict.standing == "outdated" else "",
        f"picture: {_draw_picture(config, results, verdict)}",
        f"explained by: hapticeval explain {verdict.check}",
    ]
    head = f"{verdict.check} on {verdict.renderer}, {verdict.suite}/{verdict.case}: {verdict.outcome}"
    return "\n".join([head, *(f"  {line}" for line in lines if line)])


def _draw_picture(config: pytest.Config, results: Results, verdict: VerdictEntry) -> str:
    """Draw the run with its marks below pytest's cache, and return the path, or why there is none."""
    from hapticeval.files import file_stem

    # -p no:cacheprovider takes the cache away.
    cache = getattr(config, "cache", None)
    if cache is None:
        return "none, for pytest has no cache"
    file = Path(cache.mkdir("hapticeval")) / f"{file_stem(f'{verdict.suite}-{verdict.case}-{verdict.renderer}')}.svg"
    try:
        results.plot(f"{verdict.suite}/{verdict.case}", verdict.renderer).savefig(file)
    except Exception as error:  # a picture that cannot be drawn must not hide the verdict
        return f"none: {error}"
    return os.path.relpath(file)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make a test of each verdict that the marker asks for. Raises `UsageError` for what it cannot mean."""
    marker = metafunc.definition.get_closest_marker("hapticeval")
    if marker is None or "hapticeval" not in metafunc.fixturenames:
        return
    from hapticeval.errors import HapticevalError

    options = {"suite": DEFAULT_SUITE, "select": (), "known": None, "strict": False, "renderer": None, **marker.kwargs}
    # Five options are all: a sixth key is a word that the marker does not know.
    if marker.args or len(options) > 5:
        raise pytest.UsageError(f"@pytest.mark.hapticeval takes no others than {MARKER.partition(':')[0]}")
    del options["renderer"]
    try:
        questions = questions_of(**options, folder=metafunc.definition.path.parent)
    except HapticevalError as error:
        raise pytest.UsageError(f"@pytest.mark.hapticeval: {error}") from error
    metafunc.parametrize("hapticeval", questions, ids=[question.place for question in questions], indirect=True)


@pytest.fixture
def hapticeval(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """Judge a renderer: a class, a factory, an instance or a name.

    With the marker `hapticeval` a test is one verdict: `hapticeval(Mine)` returns it, or fails as it does. Without, it
    judges all cases that `suite` and `select` name, fails with all that is not as required, and returns the results.
    """
    question = getattr(request, "param", None)

    def judge_one(renderer: AnyRenderer | None = None) -> VerdictEntry:
        __tracebackhide__ = True
        judged_renderer = renderer or request.node.get_closest_marker("hapticeval").kwargs.get("renderer")
        if judged_renderer is None:
            raise pytest.UsageError("hapticeval(RENDERER): no renderer is given, and none by the marker")
        return judge(request.node, cast("Question", question), judged_renderer)

    def judge_all(renderer: AnyRenderer, **options: Any) -> Results:
        __tracebackhide__ = True
        return _judge_all(request.node, request.path.parent, renderer, **options)

    # Without the marker there are no parameters: the fixture judges all cases at once.
    return judge_all if question is None else judge_one


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
    listed = None if known is None else folder / known
    suites = _suites_in(folder, suite)
    results = api.run([renderer], suites=suites, select=_as_names(select), known=listed, strict=strict, workers=0)
    if results.stopped:
        raise KeyboardInterrupt
    _note_known(node, listed, results.verdicts)
    wrong = [verdict for verdict in results.verdicts if results.document.stops(verdict)]
    wrong.sort(key=lambda verdict: verdict.severity, reverse=True)
    if wrong:
        raise NotConforming("\n".join(describe_verdict(node.config, results, verdict) for verdict in wrong))
    return results


def _note_known(node: pytest.Item, listed: Path | None, verdicts: Iterable[VerdictEntry]) -> None:
    """Leave notes with a test for the terminal summary of known failures, in a way that xdist carries along."""
    from hapticeval.runner.known import describe_outdated

    if listed is None:
        return
    notes = dict.fromkeys(
        (
            str(listed),
            verdict.renderer,
            verdict.suite,
            *(describe_outdated(verdict) if verdict.standing == "outdated" else ()),
        )
        for verdict in verdicts
    )
    # User properties travel from xdist's processes with the report; the stash does not.
    node.user_properties += [(KNOWN_PROPERTY, note) for note in notes]


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
        lines += read_known(Path(file)).remarks(sorted(renderers), sorted(suites))
    lines += [f"{head}\n  {todo}" for _, _, _, head, todo in (note for note in notes if len(note) > 3)]
    if lines:
        terminalreporter.write_sep("=", "known failures of hapticeval")
        for line in lines:
            terminalreporter.write_line(line)
