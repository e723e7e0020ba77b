"""From a result folder to its reports: reads results and recordings, runs nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hapticeval.costs import FILE as BENCH
from hapticeval.costs import Costs, read_costs
from hapticeval.errors import HapticevalError
from hapticeval.files import replacing
from hapticeval.reports.figures import figure_svg
from hapticeval.reports.html import Drawing, RunKey, render_html
from hapticeval.reports.junit import junit
from hapticeval.reports.marks import Mark, marks_of
from hapticeval.reports.refusal import refusal_svg
from hapticeval.reports.table import markdown
from hapticeval.results import Results, read_results

FEW = 3
"""Up to so many figures are drawn here: starting processes would take longer."""


@dataclass(frozen=True)
class Order:
    """One figure to draw."""

    key: RunKey
    file: Path | None
    model: Mapping[str, Any]
    marks: tuple[Mark, ...]
    prefix: str
    position: tuple[float, ...] | None = None


def write_reports(
    directory: Path, *, progress: Callable[[int, int], None] | None = None, workers: int = 2
) -> list[Path]:
    """Write table.md, junit.xml and report.html beside the results in `directory`; the paths written.

    `progress` is told how many of how many figures are drawn, which take nearly all of the time and are spread
    over `workers` processes. A recording that is missing or damaged is said so in its figure's place. Raises
    `InputError` as `read_results` does, and `HapticevalError` where a file cannot be written.
    """
    directory = Path(directory)
    results = read_results(directory)
    texts = {
        "table.md": markdown(results),
        "junit.xml": junit(results),
        "report.html": render_html(results, _drawn(directory, results, progress, workers), costs=_bench(directory)),
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


def _bench(directory: Path) -> Costs | None:
    """The bench beside the results, where there is one."""
    return read_costs(directory) if (directory / BENCH).exists() else None


def _drawn(
    directory: Path, results: Results, progress: Callable[[int, int], None] | None, workers: int
) -> dict[RunKey, Drawing]:
    orders = list(_orders(directory, results))
    tell = progress or _say_nothing
    tell(0, len(orders))
    drawings: dict[RunKey, Drawing] = {}
    if workers < 2 or len(orders) <= FEW:
        for order in orders:
            drawings[order.key] = draw(order)
            tell(len(drawings), len(orders))
        return drawings
    with ProcessPoolExecutor(max_workers=min(workers, len(orders))) as pool:
        pending = {pool.submit(draw, order): order for order in orders}
        for future in as_completed(pending):
            drawings[pending[future].key] = future.result()
            tell(len(drawings), len(orders))
    return drawings


def _say_nothing(done: int, total: int) -> None:
    pass


def _orders(directory: Path, results: Results) -> Iterator[Order]:
    for index, run in enumerate(results.runs):
        key = (run["suite"], run["case"], run["renderer"])
        refusal = run.get("refusal")
        if refusal is not None:
            position = None if refusal["position"] is None else tuple(refusal["position"])
            yield Order(key, None, run["model"], (), f"f{index}", position)
        elif run["recording"] is not None:
            given = [
                verdict
                for verdict in results.verdicts
                if (verdict["suite"], verdict["case"], verdict["renderer"]) == key
            ]
            yield Order(key, directory / run["recording"], run["model"], tuple(marks_of(given).values()), f"f{index}")


def draw(order: Order) -> Drawing:
    """Read a recording and draw it; what the user can mend is told in the figure's place."""
    from hapticeval.geometry.catalogue import make_model
    from hapticeval.recordings.hdf5 import read_recording
    from hapticeval.recordings.recording import REQUIRED

    suite, case, renderer = order.key
    try:
        recording = None if order.file is None else read_recording(order.file)
        rest = {name: each for name, each in order.model.items() if name != "kind"}
        model = make_model(order.model["kind"], **rest.get("parameters", rest))
    except HapticevalError as error:
        return Drawing(
            problem=" ".join(part for part in (f"{error.what}:", error.why) if part).replace(
                f"{order.file.parent}/" if order.file else "", ""
            )
        )
    if recording is None:
        title = f"{renderer} refuses the model of {suite}/{case}: its outline, and where the reason was seen"
        return Drawing(svg=refusal_svg(model, order.position, prefix=order.prefix, title=title))
    lacking = [name for name in REQUIRED if name not in recording.channels]
    if lacking:
        return Drawing(problem=f"the recording has no channel '{lacking[0]}'")
    title = f"{renderer} in {suite}/{case}: HIP, IHIP, response force and steps against time"
    return Drawing(svg=figure_svg(recording, model, marks=order.marks, prefix=order.prefix, title=title))
