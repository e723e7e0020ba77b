"""The command that computes what the thesis shows, and says how it compares with the print."""

from __future__ import annotations

import importlib
import io
import json
import shlex
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.commands import draw
from hapticeval.commands.arguments import Folder, argument, option
from hapticeval.commands.terminal import Terminal, columns, lines, paragraphs, say, wrote_lines
from hapticeval.errors import RefusalError
from hapticeval.files import writing
from hapticeval.study.thesis.printed import (
    ITEMS_FILE,
    Claim,
    Comparison,
    Item,
    Part,
    full_name,
    items_named,
    read_items,
    slug_of,
)

if TYPE_CHECKING:
    from hapticeval.recordings.recording import Recording
    from hapticeval.runner.results import VerdictEntry
    from hapticeval.suite.suite import Suite

REPRODUCE_CODES = """\b
Exit codes:
  0  all comes out as printed, or differs for a reason that is given
  1  something differs, and no reason is given
  2  wrong usage: the message says what, why, and what to do
"""

STUDY_MODULES = {"field": draw.__name__, **{name: f"hapticeval.examples.studies.{name}" for name in ("flow", "device")}}
"""The module of each study, by the name that a line of an item has for it; its function is called so as well."""


def reproduce(
    names: Annotated[
        list[str] | None,
        argument(metavar="NAME...", help="figure-6.22, table-6.3, 6.22, '(4.12)', chapter-6, or all."),
    ] = None,
    listed: Annotated[bool, option("--list", help="List what the thesis numbers, and compute nothing.")] = False,
    directory: Folder = Path("thesis"),
) -> None:
    """Compute figures, tables and experiments of the thesis, and compare them with the print.

    DIR/index.html shows them in the order of the thesis: pictures, what comes out here, what is in print, and why they
    differ where they do. All of them take about a minute of a processor.

    \b
    Examples:
      hapticeval reproduce figure-6.22
      hapticeval reproduce table-6.3 chapter-7 -o thesis
      hapticeval reproduce --list
    """
    if listed or not names:
        say(columns((place, item.title) for place, item in read_items().items()))
        return
    from hapticeval.reports.thesis_page import write_thesis_page

    chosen = {place for name in names for place in items_named(name)}
    items = {place: item for place, item in read_items().items() if place in chosen}
    with writing(directory):  # before minutes of work
        directory.mkdir(parents=True, exist_ok=True)
    with Terminal() as terminal:
        parts = list(Reproduction(items, directory).carry_out(terminal))
    for part in parts:
        rows = [(f"  {'=' if comparison.agrees else '!'}", comparison.words) for comparison in part.comparisons]
        text = columns(rows) if rows else f"  {part.item.not_computed or 'drawn'}"
        say(lines([f"{part.name}  {part.item.title}", text, ""]))
    say(paragraphs(wrote_lines([write_thesis_page(directory, parts)])))
    raise typer.Exit(int(not all(comparison.explained for part in parts for comparison in part.comparisons)))


class Reproduction:
    """Items of the thesis, and what is run for them: each case once by each renderer."""

    def __init__(self, items: Mapping[str, Item], directory: Path) -> None:
        self.items, self.directory = items, directory
        self.recordings: dict[tuple[str, str], Recording] = {}
        self.verdicts: dict[tuple[str, str, str], VerdictEntry] = {}
        self.answers: dict[tuple[str, str], dict[str, tuple[str, str | None]]] = {}

    def carry_out(self, terminal: Terminal) -> Iterator[Part]:
        """Run what is needed, then yield the items one by one, drawn and compared."""
        needed = self._needed()
        total = len(needed) + len(self.items)
        for number, ((suite, renderer), places) in enumerate(needed.items()):
            terminal.working(number, total, f"{renderer} on {suite}")
            self._run(suite, renderer, sorted(places))
        for number, (name, item) in enumerate(self.items.items(), start=len(needed)):
            terminal.still(number, total, name)
            yield self._show(name, item)

    def _needed(self) -> dict[tuple[str, str], set[str]]:
        """Return what is to run, by suite and renderer: each case with a check."""
        needed: dict[tuple[str, str], set[str]] = {}
        for item in self.items.values():
            for case, renderer, check in (*item.runs(), *_cells_of(item)):
                suite, _, name = case.partition("/")
                check = check or suite_of(suite).case(name).checks[0]
                needed.setdefault((suite, renderer), set()).add(f"{Path(suite).stem}/{name}/{check}")
        return needed

    def _run(self, suite: str, renderer: str, places: Sequence[str]) -> None:
        from hapticeval import api

        results = api.run([renderer], suites=suite_of(suite), select=" or ".join(places), workers=0)
        if not results.complete:
            raise KeyboardInterrupt
        for run in results.document.runs:
            self.recordings[f"{suite}/{run.case}", renderer] = results.recording(f"{run.suite}/{run.case}")
        for verdict in results.verdicts:
            self.verdicts[f"{suite}/{verdict.case}", renderer, verdict.check] = verdict
        for title, row in results.document.table.items():
            published = results.document.published_table.get(title, {}).get(renderer)
            self.answers.setdefault((suite, title), {})[renderer] = (row.get(renderer, "--"), published)

    def _show(self, name: str, item: Item) -> Part:
        typed = [self._type(line, f"{slug_of(name)}-{number}") for number, line in enumerate(item.studies, start=1)]
        pictures = [*(picture for _, picture, _ in typed), *self._draw(item, slug_of(name), len(typed))]
        comparisons = [self._decide(item, claim, [document for document, _, _ in typed]) for claim in item.claims]
        return Part(name, item, pictures, [text for _, _, text in typed], [*comparisons, *self._cells(item)])

    def _type(self, line: str, stem: str) -> tuple[dict[str, Any], Path, str]:
        """Type a line: return the document that it writes, with what it `came_to`, its picture and its text."""
        words, folder = shlex.split(line), self.directory / stem
        name = words[words.index("study") + 1] if "study" in words else words[2].rpartition(".")[2]
        program = typer.Typer(add_completion=False)
        program.command()(getattr(importlib.import_module(STUDY_MODULES[name]), name))
        document: dict[str, Any] = {"came_to": "a map"}
        with redirect_stdout(io.StringIO()) as text:
            try:
                typer.main.get_command(program)([*words[3:], "-o", str(folder)], standalone_mode=False)
            except RefusalError as error:
                document["came_to"] = error.what
        for file in folder.glob("*.json"):
            document |= json.loads(file.read_text(encoding="utf-8"))
        picture = next(folder.glob("*.svg")).replace(self.directory / f"{stem}.svg")
        shutil.rmtree(folder)
        return document, picture, f"$ {line}\n{text.getvalue().partition(chr(10) + 'wrote')[0].strip()}"

    def _draw(self, item: Item, slug: str, count: int) -> list[Path]:
        """Draw what an item shows of runs, of a model's outlines, and of encoders; `count` pictures are there."""
        from hapticeval.reports.thesis_page import PICTURES, grid_chart, outline_chart, write_chart
        from hapticeval.study.thesis.measures import encoder_grid, outlines

        charts = []
        for case in item.drawn_cases:
            model = case_of(case).build_scene().model
            runs = {name: self.recordings[case, name] for name in map(full_name, item.renderers)}
            for picture, name in product(item.each, runs):
                charts.append(PICTURES[picture]({name: runs[name]}, model))
            charts += [PICTURES[picture](runs, model) for picture in item.together]
        for kind in item.outlines:
            charts.append(outline_chart(f"{item.model}, {kind}", outlines(item.model, kind, item.depths)))
        if item.grid:
            charts.append(grid_chart(*encoder_grid(item.grid)))
        return [write_chart(self.directory, f"{slug}-{k}", chart) for k, chart in enumerate(charts, start=count + 1)]

    def _decide(self, item: Item, claim: Claim, documents: Sequence[Mapping[str, Any]]) -> Comparison:
        """Decide a claim by a verdict, by what a study wrote, or by a measure."""
        from hapticeval.study.thesis.measures import Run, measure

        case, renderer = claim.case or item.case, item.renderer_of(claim)
        if claim.check:
            verdict = self.verdicts[case, renderer, claim.check]
            agrees, words = verdict.outcome == claim.outcome, f"{verdict.outcome}: {verdict.message}"
            return Comparison(claim=claim, agrees=agrees, ours=words)
        if claim.entry:
            value: Any = documents[claim.study - 1]
            for key in claim.entry.split("."):
                value = value[key]
            if isinstance(value, str):
                return Comparison(claim=claim, agrees=claim.value in value, ours=value)
            return claim.compare(len(value) if isinstance(value, list) else value)
        if not (case and renderer):
            return claim.compare(measure(claim.measure, None, claim.options))
        scene = case_of(case).build_scene()
        names = renderer, full_name(claim.options.get("from", renderer))
        one, other = (Run(name, scene, self.recordings[case, name]) for name in names)
        return claim.compare(measure(claim.measure, one, claim.options, other))

    def _cells(self, item: Item) -> Iterator[Comparison]:
        """Yield the cells of the table of the suite that an item is, row by row, beside those in print."""
        for (suite, title), answers in self.answers.items():
            for name in map(full_name, item.renderers if suite == item.suite else ()):
                ours, published = answers.get(name, ("--", None))
                if published is not None:
                    claim = Claim(says=title, of=name, value=published)
                    yield Comparison(claim=claim, agrees=ours == published, ours=ours)


def _cells_of(item: Item) -> Iterator[tuple[str, str, str]]:
    """Yield case, renderer and check of all that decides the printed rows of the suite that an item is."""
    for row in suite_of(item.suite).rows if item.suite else ():
        for renderer, case in product(item.renderers, suite_of(item.suite).cases if row.published else ()):
            if any(fnmatchcase(case.name, glob) for glob in row.cases):
                yield from ((f"{item.suite}/{case.name}", full_name(renderer), check)
                            for check in row.checks if check in case.checks)  # fmt: skip


def suite_of(name: str) -> Suite:
    """Return a suite by its name; a file of cases for the thesis alone lies beside `items.toml`."""
    from hapticeval.suite.reading import load_suite

    return load_suite(str(ITEMS_FILE.with_name(name)) if name.endswith(".toml") else name)


def case_of(place: str) -> Any:
    """Return a case by SUITE/CASE."""
    suite, _, name = place.partition("/")
    return suite_of(suite).case(name)
