"""From a result folder to its reports: reads results and recordings, runs nothing."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

from hapticeval.errors import HapticevalError, unwritable
from hapticeval.files import write_text
from hapticeval.recordings.recording import Recording
from hapticeval.reports.canvas import Look, looks_of
from hapticeval.reports.case_page import (
    PAGE_ASSETS,
    Neighbours,
    asset,
    case_section,
    run_text,
    write_assets,
    write_case_page,
)
from hapticeval.reports.effects_figure import effect_plots
from hapticeval.reports.exports import write_tables
from hapticeval.reports.grid import worst_verdicts
from hapticeval.reports.junit import junit
from hapticeval.reports.pages import MOST_FAILURES, Counterexample, Drawing, ReportView, Single, render_pages
from hapticeval.reports.table import markdown
from hapticeval.reports.templates import INDEX, PAGES_FOLDER, PATH_TO_PAGES, case_file
from hapticeval.runner.results import RESULTS_FILE, ResultsDocument, RunEntry, VerdictEntry, read_results
from hapticeval.study.bench.document import BENCH_FILE, read_bench
from hapticeval.workers import Answer, ProcessEnded, Workers

REPLAY = "replay"
"""The folder below a result folder that holds a replay, of which the first page has the outcome."""

THESIS = "thesis"
"""The folder below a result folder that holds what the thesis shows, which the first page links."""

SINGLE_FILE = "report.html"
"""The report as one file."""

DRAWING_LOOK_SECONDS = 0.1
"""Seconds between two looks at whether the drawing is to stop."""

MOST_DRAWN = 200
"""Cases that are drawn at most: those with the worst failures, then the first. A page without figures takes little."""

DRAWING_MODULES = ("h5py", "jinja2", "markdown_it", "shapely")
"""What each process that draws needs, and this one for the first page: imported once, before they are copied of it."""

NOT_DRAWN = (
    f"of many cases {MOST_DRAWN} are drawn, the worst first: `hapticeval figure SUITE/CASE --from DIR` draws others"
)
"""Stands in the figure's place on the page of a case that is not drawn."""

DRAWING_STOPPED = "not drawn, as the drawing was interrupted: hapticeval report draws it"
"""Stands in the figure's place where the user has stopped the drawing."""

DRAWING_DIED = "the process that drew this figure has ended, for lack of memory perhaps"
"""Stands in the figure's place where the process that drew it has ended."""


@dataclass(frozen=True)
class Page:
    """The page of one case to write below `pages`; with None, the part of it that a page of all cases holds."""

    directory: Path
    pages: Path | None
    runs: tuple[RunEntry, ...]
    verdicts: Mapping[str, Sequence[VerdictEntry]]
    order: Sequence[str]
    neighbours: Neighbours
    drawn: bool = True

    def make(self) -> str:
        """Read the recordings and write the page; without figures if it is not to be `drawn`."""
        if not self.drawn:
            return self.fallback(NOT_DRAWN)
        return self._write({run.renderer: _recording_or_problem(self.directory, run) for run in self._recorded})

    def fallback(self, why: str) -> str:
        """Write the page with `why` in place of its figures."""
        return self._write({run.renderer: why for run in self._recorded})

    @property
    def _recorded(self) -> Sequence[RunEntry]:
        # One that broke where a check ran it once more has its recording.
        return [run for run in self.runs if run.recording is not None or not run.error]

    def _write(self, recordings: Mapping[str, Recording | str]) -> str:
        """Return the case's section of a single page, or write its own page, from these recordings."""
        judgement: dict[str, Any] = {"verdicts": self.verdicts, "order": self.order}
        # On one page for all, ids tell cases apart by suite and case.
        if self.pages is None:
            return case_section(self.runs, recordings, **judgement, enclosing_names=self.runs[0].key[:2])
        write_case_page(self.pages, self.runs, recordings, **judgement, neighbours=self.neighbours)
        return ""


@dataclass(frozen=True)
class Picture:
    """The figure of a verdict to draw for the first page: its run, with a mark where the verdict points."""

    directory: Path
    run: RunEntry
    verdict: VerdictEntry
    look: Look

    def make(self) -> Drawing:
        """Read the recording and return what is drawn of it; in its place stands what the user can mend."""
        if self.run.recording is None:
            return Drawing()
        recording = _recording_or_problem(self.directory, self.run)
        if isinstance(recording, str):
            return Drawing(problem=recording)
        title = f"{'/'.join(self.run.key)}: HIP and IHIP on the model"
        return Drawing(data=run_text(self.run, recording, self.verdict.time, self.look, title))

    def fallback(self, why: str) -> Drawing:
        """Return `why` for the figure's place."""
        return Drawing(problem=why)


def write_reports(
    directory: Path,
    *,
    single_file: bool = False,
    progress: Callable[[int, int], None] | None = None,
    workers: int = 2,
    stopped: Callable[[], bool] | None = None,
    counterexamples: Sequence[Counterexample] = (),
) -> list[Path]:
    """Write table.md, junit.xml, tables/ and report/ beside the results in `directory`; return the paths written.

    report/index.html is the first page, and each case has a page of its own.

    - `single_file`: report.html holds all pages instead
    - `progress`: called with how many of how many cases are drawn, which takes nearly all of the time
    - `workers`: the processes over which the drawing is spread
    - `stopped`: asked again and again whether to give up drawing; the pages are then written without what is left, or,
      where an earlier report is there, that stays and `KeyboardInterrupt` is raised
    - `counterexamples`: shown on the first page, as is what a recording gave that was replayed into replay/, and
      linked what `hapticeval reproduce` has left in thesis/

    A recording that is missing or damaged is reported in its figure's place. Raises `InputError` as `read_results`
    does, and `HapticevalError` where a file cannot be written.
    """
    directory = Path(directory)
    results = read_results(directory)
    bench = read_bench(directory) if (directory / BENCH_FILE).exists() else None
    effects = effect_plots(directory, results)
    replayed_results = read_results(directory / REPLAY) if (directory / REPLAY / RESULTS_FILE).exists() else None
    # An earlier report stays until the new one is complete.
    with _replacing_folder(directory / PAGES_FOLDER, single_file) as pages:
        orders: list[Page | Picture] = [*_case_pages(directory, results, None if single_file else pages)]
        orders += _failure_pictures(directory, results)
        is_first = not (directory / (SINGLE_FILE if single_file else PAGES_FOLDER)).exists()
        outcomes = _carry_out(orders, progress or (lambda *_: None), workers, stopped, without_figures=is_first)
        drawings = {
            (*order.run.key, order.verdict.check): drawing
            for order, drawing in zip(orders, outcomes, strict=True)
            if isinstance(order, Picture) and isinstance(drawing, Drawing)
        }
        sections = [outcome for outcome in outcomes if not isinstance(outcome, Drawing)]
        view = ReportView(
            results,
            drawings,
            bench=bench,
            effects=effects,
            counterexamples=counterexamples,
            replayed=replayed_results,
            has_thesis=(directory / THESIS / INDEX).exists(),
            single=_single_page(sections) if single_file else None,
        )
        texts = render_pages(view)
        written = {"table.md": markdown(results), "junit.xml": junit(results)}
        if single_file:
            written[SINGLE_FILE] = texts[INDEX]
        else:
            write_assets(pages)
            for name, text in texts.items():
                write_text(pages / name, text)
    # After the folder, so that a run that is stopped leaves the earlier files alone.
    for name, content in written.items():
        write_text(directory / name, content)
    tables = write_tables(directory, results)
    index = [] if single_file else [directory / PAGES_FOLDER / INDEX]
    return [*(directory / name for name in written), *index, tables]


def _single_page(bodies: Sequence[str]) -> Single:
    """Return what a page holds beside the results that needs nothing else: styles, scripts and the cases."""
    texts = {name: asset(name).decode() for name in PAGE_ASSETS}
    return Single(
        [text for name, text in texts.items() if name.endswith(".css")],
        [text for name, text in texts.items() if name.endswith(".js")],
        bodies,
    )


@contextmanager
def _replacing_folder(path: Path, unused: bool) -> Iterator[Path]:
    """Make a folder beside `path` that takes its place when the block ends well; nothing where it is `unused`."""
    if unused:
        yield path
        return
    # Beside it, on the same disk, so that the replacement is one rename.
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.mkdir(parents=True)
        yield temporary
        # A folder can only take the place of one that is gone.
        shutil.rmtree(path, ignore_errors=True)
        temporary.replace(path)
    except OSError as error:
        raise unwritable(str(path), error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _case_pages(directory: Path, results: ResultsDocument, pages: Path | None) -> Iterator[Page]:
    """Yield a page for each case, with links to the first page and to the cases before and after."""
    cases: dict[tuple[str, str], list[RunEntry]] = {}
    for run in results.runs:
        cases.setdefault((run.suite, run.case), []).append(run)
    # Suite and case of each failure, worst first, without repeats.
    failing = dict.fromkeys(verdict.key[:2] for verdict in worst_verdicts(results, len(results.verdicts)))
    # Failing cases first, then the others in their order, as many as are drawn.
    drawn = set(islice(dict.fromkeys([*failing, *cases]), MOST_DRAWN))
    links = [(runs[0].title, PATH_TO_PAGES + case_file(*case)) for case, runs in cases.items()]
    for number, (case, runs) in enumerate(cases.items()):
        neighbours = Neighbours(
            home=("All results", PATH_TO_PAGES + INDEX),
            before=links[number - 1] if number else None,
            after=links[number + 1] if number + 1 < len(links) else None,
        )
        verdicts = {run.renderer: results.verdicts_of.get(run.key, []) for run in runs}
        yield Page(
            directory,
            pages,
            tuple(runs),
            verdicts,
            results.renderers,
            neighbours,
            case in drawn,
        )


def _failure_pictures(directory: Path, results: ResultsDocument) -> list[Picture]:
    """Return one figure to draw for each failure that the first page shows."""
    runs = {run.key: run for run in results.runs}
    looks = looks_of(results.renderers)
    return [
        Picture(directory, runs[verdict.key], verdict, looks[verdict.renderer])
        for verdict in worst_verdicts(results, MOST_FAILURES)
        if verdict.key in runs
    ]


def _carry_out(
    orders: Sequence[Page | Picture],
    progress: Callable[[int, int], None],
    workers: int,
    stopped: Callable[[], bool] | None,
    *,
    without_figures: bool,
) -> list[str | Drawing]:
    """Spread the orders over processes, and return what came of each in their order.

    Once it is `stopped`, what is left is made `without_figures`, or else `KeyboardInterrupt` is raised.
    """
    progress(0, len(orders))
    for module in DRAWING_MODULES if orders else ():
        import_module(module)
    outcome_by_number: dict[int, str | Drawing] = {}
    remaining = iter(enumerate(orders))
    with Workers(draw, workers) as crew:
        while True:
            # As many as there are idle processes.
            for number, order in islice(remaining, crew.free):
                crew.begin(number, order)
            if stopped is not None and stopped():
                if not without_figures:
                    raise KeyboardInterrupt
                break
            # Nothing is at work and nothing waits: results in the order of the orders.
            if not crew.busy:
                return [outcome_by_number[number] for number in range(len(orders))]
            for answer in crew.answers(DRAWING_LOOK_SECONDS):
                outcome_by_number[answer.call] = _outcome_of(answer, orders[answer.call])
                progress(len(outcome_by_number), len(orders))
    # Behind the processes: none of them still writes a page.
    return [
        outcome_by_number[number] if number in outcome_by_number else order.fallback(DRAWING_STOPPED)
        for number, order in enumerate(orders)
    ]


def draw(order: Page | Picture) -> str | Drawing:
    """Carry out an order."""
    return order.make()


def _outcome_of(answer: Answer[str | Drawing], order: Page | Picture) -> str | Drawing:
    """Return what a process made of an order; what stands in its place where the process died."""
    # The process died: the page is written without its figures, here.
    if isinstance(answer.error, ProcessEnded):
        return order.fallback(DRAWING_DIED)
    if answer.error is not None:
        raise answer.error
    assert answer.value is not None
    return answer.value


def _recording_or_problem(directory: Path, run: RunEntry) -> Recording | str:
    """Read a run's recording, or return the reason why there is none to draw."""
    from hapticeval.recordings.hdf5 import read_recording

    if run.recording is None:
        return "no recording was kept"
    try:
        return read_recording(directory / run.recording)
    except HapticevalError as error:
        return _problem_words(directory, run, error)


def _problem_words(directory: Path, run: RunEntry, error: HapticevalError) -> str:
    """Return an error in one line, without the place of the result folder."""
    problem = " ".join(part for part in (f"{error.what}:", error.why) if part)
    # The report reads the same wherever the folder lies.
    return problem if run.recording is None else problem.replace(f"{(directory / run.recording).parent}/", "")
