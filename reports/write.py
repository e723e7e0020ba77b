"""From a result folder to its reports: reads results and recordings, runs nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from hapticeval.errors import HapticevalError
from hapticeval.files import replacing
from hapticeval.reports.atlas_figure import atlas_svg, charts_words, has_charts
from hapticeval.reports.comparison import comparison_svg
from hapticeval.reports.effects_figure import effect_plots
from hapticeval.reports.junit import junit
from hapticeval.reports.page import Drawing, render_html
from hapticeval.reports.plane import refusal_svg
from hapticeval.reports.run_figure import figure_svg, marks_of
from hapticeval.reports.table import markdown
from hapticeval.runner.results import ResultsDocument, RunEntry, RunKey, VerdictEntry, read_results
from hapticeval.study.bench.document import FILE as BENCH
from hapticeval.study.bench.document import read_bench
from hapticeval.study.effects.document import FILE as COSTS
from hapticeval.study.effects.document import read_costs
from hapticeval.workers import Answer, Ended, Workers

PATIENCE = 0.1
"""Seconds after which it is seen at the latest that the drawing is to stop."""


@dataclass(frozen=True)
class Order:
    """One figure to draw: of a run with its verdicts, or of `several` runs of one case, whose key has no renderer."""

    key: RunKey
    directory: Path
    runs: tuple[RunEntry, ...]
    verdicts: tuple[VerdictEntry, ...]
    prefix: str

    @property
    def several(self) -> bool:
        """Return whether all renderers of a case are drawn side by side."""
        return not self.key[2]


def write_reports(
    directory: Path,
    *,
    progress: Callable[[int, int], None] | None = None,
    workers: int = 2,
    stopped: Callable[[], bool] | None = None,
) -> list[Path]:
    """Write table.md, junit.xml and report.html beside the results in `directory`; return the paths written.

    `progress` is called with how many of how many figures are drawn, which take nearly all of the time and are spread
    over `workers` processes. `stopped` is asked again and again whether to give up, which then raises
    `KeyboardInterrupt` as Ctrl-C does. A recording that is missing or damaged is reported in its figure's place. Raises
    `InputError` as `read_results` does, and `HapticevalError` where a file cannot be written.
    """
    directory = Path(directory)
    results = read_results(directory)
    drawings = _drawn(list(_orders(directory, results)), progress or (lambda *_: None), workers, stopped)
    bench = read_bench(directory) if (directory / BENCH).exists() else None
    effects = effect_plots(directory, results)
    costs = read_costs(directory) if (directory / COSTS).exists() else None
    texts = {
        "table.md": markdown(results),
        "junit.xml": junit(results),
        "report.html": render_html(results, drawings, bench=bench, effects=effects, costs=costs),
    }
    for name, text in texts.items():
        try:
            with replacing(directory / name) as temporary:
                temporary.write_text(text, encoding="utf-8")
        except OSError as error:
            raise HapticevalError(f"cannot write {directory / name}", why=error.strerror or str(error)) from error
    return [directory / name for name in texts]


def _drawn(
    orders: list[Order], progress: Callable[[int, int], None], workers: int, stopped: Callable[[], bool] | None
) -> dict[RunKey, Drawing]:
    progress(0, len(orders))
    drawings: dict[RunKey, Drawing] = {}
    waiting = iter(enumerate(orders))
    with Workers(draw, workers) as crew:
        while True:
            for number, order in islice(waiting, crew.free):
                crew.begin(number, order)
            if stopped is not None and stopped():
                raise KeyboardInterrupt
            if not crew.busy:
                return drawings
            for answer in crew.answers(PATIENCE):
                drawings[orders[answer.call].key] = _answered(answer)
                progress(len(drawings), len(orders))


def _answered(answer: Answer[Drawing]) -> Drawing:
    if isinstance(answer.error, Ended):
        return Drawing(problem="the process that drew this figure has ended, for lack of memory perhaps")
    if answer.error is not None:
        raise answer.error
    assert answer.value is not None
    return answer.value


def _orders(directory: Path, results: ResultsDocument) -> Iterator[Order]:
    """One figure for each run, and one for each case in which a constraint holds the tools of several renderers."""
    cases: dict[tuple[str, str], list[RunEntry]] = {}
    for index, run in enumerate(results.runs):
        # Where a refusal names no place its reason lies in the scene, and an outline shows nothing of it; of a model in
        # space there is none.
        if len(run.refusal.position or ()) == 2 if run.refusal else run.recording is not None:
            yield Order(run.key, directory, (run,), tuple(results.verdicts_of.get(run.key, ())), f"f{index}")
        if run.stimulus == "experiment" and run.scene.bilateral and run.recording is not None:
            cases.setdefault((run.suite, run.case), []).append(run)
    for index, (case, runs) in enumerate(cases.items()):
        if len(runs) > 1:
            yield Order((*case, ""), directory, tuple(runs), (), f"c{index}")


def draw(order: Order) -> Drawing:
    """Read what is to be drawn and draw it; what the user can mend is reported in the figure's place."""
    try:
        return _draw(order)
    except HapticevalError as error:
        problem = " ".join(part for part in (f"{error.what}:", error.why) if part)
        for run in order.runs:
            if run.recording is not None:
                problem = problem.replace(f"{(order.directory / run.recording).parent}/", "")
        return Drawing(problem=problem)


def _draw(order: Order) -> Drawing:
    from hapticeval.geometry.catalogue import make_model
    from hapticeval.recordings.channels import REQUIRED
    from hapticeval.recordings.hdf5 import read_recording

    run = order.runs[0]
    place, prefix = f"{run.suite}/{run.case}", order.prefix
    recordings = {
        each.renderer: read_recording(order.directory / each.recording)
        for each in order.runs
        if each.recording is not None and not each.refusal
    }
    model = make_model(run.model["kind"], **run.model_parameters)
    if order.several:
        title = f"{place}: paths of all renderers, distance from the surface and speed along it"
        return Drawing(svg=comparison_svg(recordings, model, prefix=prefix, title=title))
    if run.refusal is not None and run.refusal.position is not None:
        title = f"{run.renderer} refuses the model of {place}: its outline, and where the reason was seen"
        return Drawing(svg=refusal_svg(model, run.refusal.position, prefix=prefix, title=title))
    recording = recordings[run.renderer]
    lacking = [name for name in REQUIRED if name not in recording.channels]
    if lacking:
        return Drawing(problem=f"the recording has no channel '{lacking[0]}'")
    title = f"{run.renderer} in {place}: HIP, IHIP, response force and steps against time"
    marks = tuple(marks_of(order.verdicts).values())
    svg = figure_svg(recording, model, marks=marks, prefix=prefix, title=title)
    if not has_charts(recording):
        return Drawing(svg=svg)
    title = f"{run.renderer} in {place}: distance, coordinates and torques in the two charts of the sphere"
    charts = atlas_svg(recording, model, prefix=f"{prefix}a", title=title)
    return Drawing(svg=svg, charts=charts, found=charts_words(recording))
