"""Judge renderers from Python: the same runs as the command line's, on names, classes and instances in memory."""

from __future__ import annotations

import dataclasses
import pickle
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from msgspec.structs import replace

from hapticeval.discovery import resolve
from hapticeval.errors import InputError, UnknownNameError, describe_error
from hapticeval.renderer import Renderer, RendererFactory, TrajectoryRenderer
from hapticeval.runner.events import Event, Interrupted, JobFinished, RunFinished
from hapticeval.runner.execution import execute
from hapticeval.runner.folder import COUNTEREXAMPLES, locked_folder, remove_reports
from hapticeval.runner.known import Known, read_known
from hapticeval.runner.known import write_known as write_listed
from hapticeval.runner.planning import Plan, RunOptions, as_tuple, plan
from hapticeval.runner.results import (
    RESULTS_FILE,
    ResultsDocument,
    RunEntry,
    RunKey,
    VerdictEntry,
    read_results,
    unknown_renderer,
    write_results,
)
from hapticeval.runner.resuming import read_earlier_run
from hapticeval.runner.standing import Standing, counts_in_words
from hapticeval.runner.work import Work, run_job
from hapticeval.suite import DEFAULT_SUITE
from hapticeval.suite.case import Case
from hapticeval.suite.outline import find_suites
from hapticeval.suite.suite import Suite
from hapticeval.workers import default_workers

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from hapticeval.recordings.recording import Recording

AnyRenderer: TypeAlias = "str | RendererFactory | Renderer | TrajectoryRenderer"
"""A name as of `hapticeval run -r`, a class or factory that takes a scene, or a renderer that is made."""


def run(
    renderers: AnyRenderer | Sequence[AnyRenderer] | Mapping[str, AnyRenderer] = (),
    *,
    suites: str | Suite | Sequence[str | Suite] = DEFAULT_SUITE,
    watch: Callable[[Event], None] | None = None,
    **options: Any,
) -> Results:
    """Judge renderers in the cases of suites, as `hapticeval run` does, and return what was found.

    - `renderers`: one or several. A mapping names them, others are called as they are written. Without any, each suite
      runs its own.
    - `suites`: names, groups, TOML files or `load_suite`'s.
    - `watch`: called with each event of the run.
    - `options`: those of `RunOptions` by name, such as `output="results"`, `seed=3` or `select="star-*"`. Renderers
      that are not names run in this process, unless `workers` are given.

    On Ctrl-C what is finished is kept, and the results are not `complete`. Raises `InputError` for arguments that are
    none of these, and as `plan` and `locked_folder` do; what a renderer gets wrong is in the results.
    """
    named = _name_renderers(renderers)
    # Names are resolved in each process; what is none is a factory, which has to travel there.
    factories = {name: factory for name, factory in named.items() if not isinstance(factory, str)}
    chosen = RunOptions.of(**options)
    # Without workers the factories stay in this process: anything may run.
    if chosen.workers or chosen.scheduler is not None:
        _refuse_unpicklable(factories)
    elif factories:
        # A class of a notebook cannot travel to another process.
        chosen = dataclasses.replace(chosen, workers=0)
    # Locked before the plan is made, which takes seconds: of two runs that begin together one is refused.
    with locked_folder(chosen.output):
        planned = plan(as_tuple(suites, "suites", (str, Suite)), tuple(named), chosen, factories=factories)
        # The results that the folder holds now, before this run writes its own.
        if chosen.failed_first and chosen.output is not None and (chosen.output / RESULTS_FILE).exists():
            planned = planned.failed_first(read_results(chosen.output))
        return _carry_out(planned, watch, run_job)


def plot_document(
    file: str | Path,
    renderers: Sequence[str] = (),
    *,
    labels: Mapping[str, str] | None = None,
    width: str | None = None,
    height: str | None = None,
    font_size: float | None = None,
) -> Figure:
    """Return a figure for a paper of a JSON document; see `Results.plot` for labels and sizes.

    - results.json of a run: its grid of renderers by phenomena
    - bench.json of `hapticeval bench`: error against time, a panel a renderer
    - limits-*.json of `hapticeval study limits`: the stiffness up to which a loop is stable

    `renderers` are those of the first two that are drawn, all if none are named; `labels` are for these two. Raises
    `InputError` for a document that is none of these or damaged, and `UnknownNameError` for a renderer that is not in
    it.
    """
    from hapticeval.files import parse_json
    from hapticeval.reports.paper import paper_accuracy
    from hapticeval.reports.study_figures import paper_limits
    from hapticeval.study.bench.document import BENCH_FILE, read_bench

    path = Path(file)
    sizes: dict[str, Any] = {"width": width, "height": height, "font_size": font_size}
    if path.name == RESULTS_FILE:
        return Results.read(path.parent).plot_grid(renderers, labels=labels, **sizes)
    if path.name == BENCH_FILE:
        judged = read_results(path.parent).renderers if (path.parent / RESULTS_FILE).exists() else ()
        return paper_accuracy(read_bench(path.parent), renderers, judged=judged, labels=labels, **sizes)
    document = parse_json(path, todo="run the command again that wrote it")
    try:
        return paper_limits(document, **sizes)
    except (KeyError, TypeError, IndexError, ValueError) as error:
        raise InputError(
            f"{path} cannot be drawn",
            why=f"it is not a document of `hapticeval study limits`, or damaged: {describe_error(error)}",
            todo=f"give {RESULTS_FILE}, {BENCH_FILE} or limits-*.json",
        ) from error


def merge(folders: Sequence[str | Path], output: str | Path) -> Results:
    """Make one result folder of several: of the shards of a run, or of runs on other suites, cases or renderers.

    Raises `InputError` for what cannot be one: see `runner.merging`.
    """
    from hapticeval.runner.merging import merge_into

    with locked_folder(Path(output)):
        remove_reports(Path(output))
        return Results(merge_into([Path(folder) for folder in folders], Path(output)), Path(output))


def judge(
    renderer: AnyRenderer, *, cases: str | Case | Sequence[str | Case] = f"{DEFAULT_SUITE}/*", **options: Any
) -> Results:
    """Judge one renderer in cases: globs on `case` or `suite/case` of the installed suites, or cases of `load_suite`.

    See `run` for the `options` and the rest.
    """
    listed = as_tuple(cases, "cases", (str, Case))
    chosen_cases = tuple(case for case in listed if isinstance(case, Case))
    globs = tuple(glob for glob in listed if isinstance(glob, str))
    suite = Suite(name="cases", title="Cases", citation="", cases=chosen_cases, rows=())
    # Cases make a suite of their own here, globs choose from the installed ones: a run takes one or the other.
    if chosen_cases and globs:
        raise InputError("cases are globs and `Case`s", why="these come from different suites", todo="give one kind")
    if chosen_cases:
        return run([renderer], suites=suite, **options)
    return run([renderer], suites=tuple(find_suites()), select=globs, **options)


def carry_out(planned: Plan, *, watch: Callable[[Event], None] | None = None, work: Work = run_job) -> Results:
    """Run the jobs of a plan and return the results; see `run` for `watch`, and `execute` for `work`."""
    with locked_folder(planned.options.output):
        return _carry_out(planned, watch, work)


def _carry_out(planned: Plan, watch: Callable[[Event], None] | None, work: Work) -> Results:
    """Run the jobs of a plan whose folder, if it has one, is locked."""
    output = planned.options.output
    # Before anything is removed: an earlier run of another plan is refused, and its reports stay.
    earlier = read_earlier_run(planned, output) if planned.options.resume and output is not None else None
    if output is not None:
        remove_reports(output)
    recordings: dict[RunKey, Recording] = {}
    stopped = False
    for event in execute(planned, work=work, earlier=earlier):
        if watch is not None:
            watch(event)
        if isinstance(event, JobFinished):
            if watch is None and event.warnings:
                print(*event.warnings.values(), sep="\n", file=sys.stderr)
            if event.recording is not None:
                recordings[event.run.key] = event.recording
        elif isinstance(event, Interrupted):
            # With workers the first Ctrl-C lets what has begun end, and the second gives it up.
            stopped = event.at_once
        elif isinstance(event, RunFinished):
            document = event.results
    return Results(document, folder=output, recordings=recordings, stopped=stopped)


@dataclass(frozen=True, repr=False)
class Results:
    """The verdicts of a run: `document` is results.json as typed values, `folder` where that lies, if it does.

    `stopped`: the user gave the run up.
    """

    document: ResultsDocument
    folder: Path | None = None
    recordings: Mapping[RunKey, Recording] = field(default_factory=dict)
    stopped: bool = False

    @classmethod
    def read(cls, folder: str | Path) -> Results:
        """Return the results of an earlier run in `folder`. Raises `InputError` as `read_results` does."""
        return cls(read_results(Path(folder)), Path(folder))

    @property
    def complete(self) -> bool:
        """Whether every planned verdict was reached."""
        return self.document.complete

    @property
    def verdicts(self) -> Sequence[VerdictEntry]:
        """All verdicts, in the order of the plan."""
        return self.document.verdicts

    @property
    def exit_code(self) -> int:
        """What `hapticeval run` returns: 0 where all is as it must be; see `hapticeval run --help`.

        What stopped a case outranks a verdict: 3 where a renderer broke, else 2 where its input was not usable or every
        run was refused.
        """
        document = self.document
        # 1: a verdict is not as it must be, or the run was cut short. 2: every run was refused. Else an error's own.
        differs = not document.complete or bool(document.stopping)
        codes = [run.error.exit_code for run in document.runs if run.error]
        return max([int(differs or self.stopped), 2 * int(document.all_refused), *codes])

    def frame(self) -> pd.DataFrame:
        """Return one row per verdict, metric, bound and margin in `unit` (SI), the metric's name in `metric`."""
        import pandas as pd

        names = ("suite", "case", "renderer", "check", "level", "outcome")
        last = ("bound", "margin", "published", "as_expected", "message")
        rows = [
            {
                **{name: getattr(verdict, name) for name in names},
                "metric": verdict.metric and verdict.metric.name,
                "value": verdict.metric and verdict.metric.value,
                "unit": verdict.metric and verdict.metric.unit,
                **{name: getattr(verdict, name) for name in last},
            }
            for verdict in self.verdicts
        ]
        columns = [*names, "metric", "value", "unit", *last]
        return pd.DataFrame(rows, columns=columns).astype({"value": float, "bound": float, "margin": float})

    def table(self) -> pd.DataFrame:
        """Return the summary table: Yes or No per row of the suites and renderer, empty where it was not decided.

        Rows that no renderer decided are left out."""
        import pandas as pd

        # A row is empty where no renderer decided it.
        rows = {title: row for title, row in self.document.table.items() if row}
        return pd.DataFrame(
            [[row.get(name, "") for name in self.document.renderers] for row in rows.values()],
            index=list(rows),
            columns=self.document.renderers,
        )

    def recording(self, case: str | None = None, renderer: str | None = None) -> Recording:
        """Return the recording of a run: `case` or `suite/case`, and the renderer; what is needed to tell runs apart.

        Raises `UnknownNameError` for one that did not run, and `InputError` where it recorded nothing.
        """
        run = self._run(case, renderer)
        if run.key in self.recordings:
            return self.recordings[run.key]
        if self.folder is None or run.recording is None:
            # Why there is no recording: the renderer broke, or refused the case.
            problem = run.error or run.refusal
            raise InputError(f"{run.renderer} recorded nothing on {run.case}", why=problem.what if problem else "")
        from hapticeval.recordings.hdf5 import read_recording

        return read_recording(self.folder / run.recording)

    def plot(
        self,
        case: str | None = None,
        renderer: str | None = None,
        *,
        renderers: Sequence[str] | None = None,
        check: str | None = None,
        labels: Mapping[str, str] | None = None,
        width: str | None = None,
        height: str | None = None,
        font_size: float | None = None,
    ) -> Figure:
        """Return a figure of a run: the paths on the model, the force, and the steps or the depth, against time.

        Marks, numbered where they are several, stand where verdicts that do not pass point. With any of the further
        options it is a figure for a paper, as `hapticeval figure` draws it: the `renderers` (all that have run, if none
        are named) over each other, a mark where the verdict of `check` points, of real `width` and `height` ("88mm",
        "3.5in"), with text of `font_size` points. `labels` says by a renderer's name how the legend calls it.

        Raises as `recording` and `parse_paper_length` do, and `UnknownNameError` for a check that did not run, and for
        a label of a renderer that is not drawn.
        """
        from hapticeval.reports.canvas import looks_of
        from hapticeval.reports.run_figure import SCREEN_WIDTH, run_figure

        sizes: dict[str, Any] = {"width": width, "height": height, "font_size": font_size}
        looks = looks_of(self.document.renderers)
        if any(choice is not None for choice in (renderers, check, labels, *sizes.values())):
            named = [renderer] if renderer is not None else []
            entries = self._runs_to_draw(case, [*named, *(renderers or ())])
            runs = [self._drawn_run(run, [] if check is None else [check]) for run in entries]
            options = {"looks": looks, "labels": labels, "mark_words": f"where {check} does not pass", **sizes}
        else:
            entries = [self._run(case, renderer)]
            runs = [self._drawn_run(entries[0], None)]
            title = f"{entries[0].renderer} on {entries[0].suite}/{entries[0].case}"
            options = {"looks": looks, "title": title, "width": SCREEN_WIDTH}
        return run_figure(runs, entries[0].build_model(runs[0].recording), **options)

    def _runs_to_draw(self, case: str | None, renderers: Sequence[str]) -> Sequence[RunEntry]:
        """Return the runs of one case; of all renderers that recorded something, if none are named."""
        if renderers:
            entries = [self._run(case, name) for name in dict.fromkeys(renderers)]
        else:
            entries = [run for run in self._runs(case) if run.recording or run.key in self.recordings]
        if not entries or len({(run.suite, run.case) for run in entries}) > 1:
            raise InputError(
                f"{len(entries)} runs with a recording to draw", why="a figure is of one case", todo="name suite/case"
            )
        return entries

    def _drawn_run(self, run: RunEntry, checks: Sequence[str] | None) -> Any:
        """Return what is drawn of a run, with the marks of these checks, of all if None; one check has its outcome."""
        from hapticeval.reports.run_figure import DrawnRun, marks_of

        verdicts = {verdict.check: verdict for verdict in self.document.verdicts_of.get(run.key, [])}
        for check in checks or ():
            if check not in verdicts:
                raise UnknownNameError(f"check of {run.suite}/{run.case}", check, verdicts)
        chosen = [verdict for name, verdict in verdicts.items() if checks is None or name in checks]
        recording = self.recording(f"{run.suite}/{run.case}", run.renderer)
        outcome = str(chosen[0].outcome) if checks and chosen else ""
        return DrawnRun(run.renderer, recording, marks_of(chosen, recording), outcome)

    def plot_grid(
        self,
        renderers: Sequence[str] = (),
        *,
        labels: Mapping[str, str] | None = None,
        width: str | None = None,
        height: str | None = None,
        font_size: float | None = None,
    ) -> Figure:
        """Return the grid of renderers by phenomena as a figure for a paper; see `plot` for labels and sizes.

        Raises `UnknownNameError` for a renderer that did not run, and as `parse_paper_length` does.
        """
        from hapticeval.reports.grid import phenomenon_grid
        from hapticeval.reports.paper import paper_grid

        grid = phenomenon_grid(self.document)
        return paper_grid(grid, renderers, labels=labels, width=width, height=height, font_size=font_size)

    def latex(
        self,
        table: str = "phenomena",
        *,
        renderers: Sequence[str] = (),
        rows: Sequence[str] = (),
        width: str | None = None,
    ) -> str:
        """Return a table for a paper as LaTeX (booktabs), as `hapticeval table` writes it.

        `table` is phenomena, summary, hard-cases, closed-forms or verdicts; `rows` are globs on the first cell of a
        row, `width` is that of a line, such as "88mm". Raises `UnknownNameError` for a table or a renderer that is not
        there.
        """
        from hapticeval.reports.exports import latex_table

        return latex_table(self.document, table, renderers=renderers, rows=rows, width=width)

    @property
    def file(self) -> Path:
        """The path of results.json. Raises `InputError` for results that lie in no folder."""
        if self.folder is None:
            raise InputError("these results lie in no folder", todo="run with output='results'")
        return self.folder / RESULTS_FILE

    def report(
        self,
        *,
        single_file: bool = False,
        progress: Callable[[int, int], None] | None = None,
        stopped: Callable[[], bool] | None = None,
    ) -> list[Path]:
        """Write table.md, junit.xml, report/ and tables/ beside results.json, and return all their paths.

        With `single_file` report.html holds the pages of report/. The counterexamples of a search into
        counterexamples/ are shown. See `write_reports`.

        Raises `InputError` for results that lie in no folder.
        """
        from hapticeval.reports import write_reports

        folder = self.file.parent
        with locked_folder(folder):
            written = write_reports(
                folder,
                single_file=single_file,
                progress=progress,
                workers=default_workers(),
                stopped=stopped,
                counterexamples=_read_counterexamples(folder),
            )
        return [self.file, *written]

    def write_known(self, file: str | Path) -> Results:
        """List in `file` all that stops the gate now, and return the results with these failures known.

        Reasons that the file has stay, what passes now leaves it: see `Known.renewed`. Raises as `read_known` does.
        """
        listed = read_known(Path(file)) if Path(file).exists() else Known(source=Path(file).name)
        # Marked anew by the list that is written: what has just been listed is known from here on.
        listed = listed.with_shipped().renewed(self.document)
        write_listed(Path(file), listed)
        # Outdated entries left the list; their marks go too.
        outdated = Standing.OUTDATED
        current = [
            replace(verdict, known=None) if verdict.standing is outdated else verdict for verdict in self.verdicts
        ]
        document = replace(self.document, verdicts=list(map(listed.marked, current)))
        if self.folder is not None:
            write_results(self.folder, document)
        return Results(document, self.folder, self.recordings, self.stopped)

    def __repr__(self) -> str:
        document = self.document
        tally = counts_in_words(verdict.standing for verdict in self.verdicts)
        incomplete = "" if self.complete else f", incomplete: {document.reason}"
        return f"<Results of {', '.join(document.renderers)}: {tally}{incomplete}>"

    def _repr_html_(self) -> str:
        """Return the summary and the verdicts as HTML tables, for a notebook."""
        from html import escape

        verdicts = self.frame()[["case", "renderer", "check", "outcome", "metric", "value", "unit", "bound", "message"]]
        table = self.table()
        tables = [frame.to_html(na_rep="", index=frame is table) for frame in (table, verdicts) if not frame.empty]
        return "\n".join([f"<p>{escape(repr(self)[1:-1])}</p>", *tables])

    def _runs(self, case: str | None) -> list[RunEntry]:
        runs = [run for run in self.document.runs if case in (None, run.case, f"{run.suite}/{run.case}")]
        if not runs:
            raise UnknownNameError("case", str(case), {run.case for run in self.document.runs})
        return runs

    def _run(self, case: str | None, renderer: str | None) -> RunEntry:
        runs = self._runs(case)
        # None for what the caller leaves open: enough where one run alone fits.
        matching_runs = [run for run in runs if renderer in (None, run.renderer)]
        if not matching_runs:
            raise unknown_renderer(str(renderer), {run.renderer for run in runs})
        if len(matching_runs) > 1:
            raise InputError(
                f"{len(matching_runs)} runs are of the case '{case}'"
                if case
                else f"there are {len(matching_runs)} runs",
                why=f"they are {', '.join(f'{run.renderer} on {run.suite}' for run in matching_runs)}",
                todo="name suite/case, and the renderer",
            )
        return matching_runs[0]


def _name_renderers(renderers: Any) -> dict[str, str | RendererFactory]:
    """Return a name for each renderer, and the factory behind those that are not names themselves."""
    if isinstance(renderers, Mapping):
        # A mapping's key is the name in verdicts; a string value is resolved, unless it is called as it is written.
        factories = {str(name): _factory_of(renderer) for name, renderer in renderers.items()}
        return {
            name: resolve(factory) if isinstance(factory, str) and factory != name else factory
            for name, factory in factories.items()
        }
    listed = list(renderers) if isinstance(renderers, list | tuple) else [renderers]
    named: dict[str, str | RendererFactory] = {}
    for renderer in listed:
        # Classes and functions have a name; an instance goes by its class's.
        kind = renderer if hasattr(renderer, "__name__") else type(renderer)
        name = renderer if isinstance(renderer, str) else kind.__name__
        if name in named and named[name] is not renderer:
            raise InputError(
                f"two renderers are called '{name}'",
                why="verdicts and recordings are told apart by the name",
                todo="give a mapping from names to renderers",
            )
        named[name] = _factory_of(renderer)
    return named


def _factory_of(renderer: Any) -> str | RendererFactory:
    """Return a name or a factory as it is; for an instance of a renderer a factory that returns it."""
    if isinstance(renderer, str):
        return renderer
    if not isinstance(renderer, type) and isinstance(renderer, Renderer | TrajectoryRenderer):
        # An instance is judged as it is, in every scene: it is reset at the start of each run.
        return lambda scene: renderer  # noqa: ARG005 - a factory's
    if callable(renderer):
        return cast("RendererFactory", renderer)
    raise InputError(
        f"{renderer!r} is not a renderer",
        why="it is a name, a class or a factory that takes a scene, or has reset(hip) and step(hip, velocity, dt)",
        todo="see docs/write-a-renderer.md",
    )


def _refuse_unpicklable(factories: Mapping[str, RendererFactory]) -> None:
    """Raise `InputError` for a factory that cannot travel to another process."""
    for name, factory in factories.items():
        try:
            # Closures, lambdas and classes of a notebook fail here, before anything has run.
            pickle.dumps(factory)
        except Exception as error:
            raise InputError(
                f"'{name}' cannot run in a process of its own",
                why="it is not a name, and Python cannot pickle it: as what is made in a function or a notebook",
                todo="leave workers out, or name it package.module:factory",
            ) from error


def _read_counterexamples(folder: Path) -> list[Any]:
    """Return what a search into the folder counterexamples/ has left there, for the report; nothing without one."""
    searched = folder / COUNTEREXAMPLES
    if not searched.is_dir():
        return []
    # Imported where there is something to show: most runs have no search beside them.
    from hapticeval.reports.pages import Counterexample
    from hapticeval.search.counterexample import list_counterexamples

    return [
        Counterexample(entry.counterexample.renderer, entry.line, entry.suite.relative_to(folder), entry.picture)
        for entry in list_counterexamples(searched)
    ]
