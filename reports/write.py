"""From a result folder to its reports: reads results and recordings, runs nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from hapticeval.errors import HapticevalError
from hapticeval.files import replacing
from hapticeval.geometry.model import Model
from hapticeval.reports.atlas_figure import atlas_svg, charts_words, has_charts
from hapticeval.reports.comparison import comparison_svg
from hapticeval.reports.figures import figure_svg
from hapticeval.reports.html import render_html
from hapticeval.reports.junit import junit
from hapticeval.reports.marks import Mark, marks_of
from hapticeval.reports.refusal import refusal_svg
from hapticeval.reports.shown import Drawing, RunKey
from hapticeval.reports.table import markdown
from hapticeval.runner.results import ResultsDocument, RunEntry, read_results
from hapticeval.study.bench.document import FILE as BENCH
from hapticeval.study.bench.document import BenchResults, read_bench
from hapticeval.workers import Answer, Ended, Workers

PATIENCE = 0.1
"""Seconds after which it is seen at the latest that the drawing is to stop."""


@dataclass(frozen=True)
class Order:
    """One figure to draw."""

    key: RunKey
    file: Path | None
    model: Mapping[str, Any]
    marks: tuple[Mark, ...]
    prefix: str
    position: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Comparison:
    """All renderers of one experiment in one figure; `files` maps them to their recordings.

    The key's renderer is empty.
    """

    key: RunKey
    files: Mapping[str, Path]
    model: Mapping[str, Any]
    prefix: str


def write_reports(
    directory: Path,
    *,
    progress: Callable[[int, int], None] | None = None,
    workers: int = 2,
    stopped: Callable[[], bool] | None = None,
) -> list[Path]:
    """Write table.md, junit.xml and report.html beside the results in `directory`; the paths written.

    `progress` is told how many of how many figures are drawn, which take nearly all of the time and are spread
    over `workers` processes. `stopped` is asked again and again whether to give up, which then raises
    `KeyboardInterrupt` as Ctrl-C does. A recording that is missing or damaged is said so in its figure's place. Raises
    `InputError` as `read_results` does, and `HapticevalError` where a file cannot be written.
    """
    directory = Path(directory)
    results = read_results(directory)
    drawings = _drawn(directory, results, progress, workers, stopped)
    texts = {
        "table.md": markdown(results),
        "junit.xml": junit(results),
        "report.html": render_html(results, drawings, bench=_bench(directory)),
    }
    written = []
    for name, text in texts.items():
        try:
            with replacing(directory / name) as temporary:
                temporary.write_text(text, encoding="utf-8")
        except OSError as error:
            raise HapticevalError(f"cannot write {directory / name}", why=error.strerror or str(error)) from error
        written.append(directory / name)
    return written


def _bench(directory: Path) -> BenchResults | None:
    """The bench beside the results, where there is one."""
    return read_bench(directory) if (directory / BENCH).exists() else None


def _drawn(
    directory: Path,
    results: ResultsDocument,
    progress: Callable[[int, int], None] | None,
    workers: int,
    stopped: Callable[[], bool] | None,
) -> dict[RunKey, Drawing]:
    orders: list[Order | Comparison] = list(_orders(directory, results))
    tell = progress or _say_nothing
    tell(0, len(orders))
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
                tell(len(drawings), len(orders))


def _answered(answer: Answer[Drawing]) -> Drawing:
    if isinstance(answer.error, Ended):
        return Drawing(problem="the process that drew this figure has ended, for lack of memory perhaps")
    if answer.error is not None:
        raise answer.error
    assert answer.value is not None
    return answer.value


def _say_nothing(done: int, total: int) -> None:
    pass


def _orders(directory: Path, results: ResultsDocument) -> Iterator[Order | Comparison]:
    for index, run in enumerate(results.runs):
        key = run.key
        refusal = run.refusal
        if refusal is not None:
            if refusal.position is not None:  # else the reason lies in the scene, and an outline shows nothing of it
                yield Order(key, None, run.model, (), f"f{index}", tuple(refusal.position))
        elif run.recording is not None:
            given = results.verdicts_of.get(key, [])
            yield Order(key, directory / run.recording, run.model, tuple(marks_of(given).values()), f"f{index}")
    yield from _comparisons(directory, results)


def _comparisons(directory: Path, results: ResultsDocument) -> Iterator[Comparison]:
    """One for each case in which a constraint holds the tools of several renderers."""
    cases: dict[tuple[str, str], list[RunEntry]] = {}
    for run in results.runs:
        if run.stimulus == "experiment" and run.scene.bilateral and run.recording is not None:
            cases.setdefault((run.suite, run.case), []).append(run)
    for index, (key, runs) in enumerate(cases.items()):
        if len(runs) > 1:
            files = {run.renderer: directory / run.recording for run in runs}
            yield Comparison((*key, ""), files, runs[0].model, f"c{index}")


def draw(order: Order | Comparison) -> Drawing:
    """Read what is to be drawn and draw it; what the user can mend is told in the figure's place."""
    files = order.files.values() if isinstance(order, Comparison) else [order.file]
    try:
        return _compared(order) if isinstance(order, Comparison) else _alone(order)
    except HapticevalError as error:
        problem = " ".join(part for part in (f"{error.what}:", error.why) if part)
        for file in files:
            problem = problem.replace(f"{file.parent}/" if file else "", "")
        return Drawing(problem=problem)


def _compared(order: Comparison) -> Drawing:
    from hapticeval.recordings.hdf5 import read_recording

    suite, case, _ = order.key
    runs = {renderer: read_recording(file) for renderer, file in order.files.items()}
    title = f"{suite}/{case}: paths of all renderers, distance from the surface and speed along it"
    return Drawing(svg=comparison_svg(runs, _model(order.model), prefix=order.prefix, title=title))


def _model(document: Mapping[str, Any]) -> Model:
    from hapticeval.geometry.catalogue import make_model

    rest = {name: each for name, each in document.items() if name != "kind"}
    return make_model(document["kind"], **rest.get("parameters", rest))


def _alone(order: Order) -> Drawing:
    from hapticeval.recordings.hdf5 import read_recording
    from hapticeval.recordings.recording import REQUIRED

    suite, case, renderer = order.key
    recording = None if order.file is None else read_recording(order.file)
    model = _model(order.model)
    if recording is None:
        title = f"{renderer} refuses the model of {suite}/{case}: its outline, and where the reason was seen"
        return Drawing(svg=refusal_svg(model, order.position, prefix=order.prefix, title=title))
    lacking = [name for name in REQUIRED if name not in recording.channels]
    if lacking:
        return Drawing(problem=f"the recording has no channel '{lacking[0]}'")
    title = f"{renderer} in {suite}/{case}: HIP, IHIP, response force and steps against time"
    svg = figure_svg(recording, model, marks=order.marks, prefix=order.prefix, title=title)
    if not has_charts(recording):
        return Drawing(svg=svg)
    title = f"{renderer} in {suite}/{case}: distance, coordinates and torques in the two charts of the sphere"
    charts = atlas_svg(recording, model, prefix=f"{order.prefix}a", title=title)
    return Drawing(svg=svg, charts=charts, found=charts_words(recording))
