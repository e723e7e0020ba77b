"""The page of one case: all its renderers laid over each other on the model, with a slider over time, and the verdicts.

The scripts in `assets/` draw the runs from the data that the page holds; without script it shows verdicts and numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from hapticeval.errors import HapticevalError, InputError
from hapticeval.files import replacing, write_text, writing
from hapticeval.geometry.model import Model
from hapticeval.phenomena.pages import read_page
from hapticeval.phenomena.sampling import LED
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.reports.atlas_figure import atlas_charts, charts_words, has_charts
from hapticeval.reports.canvas import Look, looks_of
from hapticeval.reports.case_data import Mark, Track, case_text, drawable_recording, sample_tracks
from hapticeval.reports.chart import charts_data
from hapticeval.reports.grid import gravest_first
from hapticeval.reports.templates import (
    ASSETS_FOLDER,
    CHECK_PAGES,
    INDEX,
    PATH_TO_PAGES,
    anchor,
    case_file,
    environment,
)
from hapticeval.runner.results import RunEntry, VerdictEntry

CASE_ASSETS = ("report.css", "case.css", "draw.js", "case.js")
"""Style sheets and scripts of a case page, in the order in which it needs them."""

PAGE_ASSETS = (*CASE_ASSETS, "filter.js")
"""What all pages of a report need."""

VIEW_MARK = '<meta name="generator" content="hapticeval view">'
"""What stands in the page of a view, and in no other: the next view of that folder may write over it."""

HEAD_CHARACTERS = 4096
"""Characters of a page in which its head ends."""


@dataclass(frozen=True)
class Neighbours:
    """Where a page lies among others: titles and addresses of the first screen, and of the cases before and after."""

    home: tuple[str, str] | None = None
    before: tuple[str, str] | None = None
    after: tuple[str, str] | None = None


MOST_SHOWN = 3
"""Renderers that a page shows at first; the others by a tick."""

EVIDENCE_ELSEWHERE = ("time", "tick", "moments")
"""Evidence that does not stand in a check's table: it is shown beside the verdict, or among the closed forms."""


class Cell(NamedTuple):
    """A cell of a table: its value, the number of its column, and over how many rows it reaches."""

    value: Any
    column: int
    rows: int


@dataclass(frozen=True)
class CheckSection:
    """The verdicts of one check: a row each, but those of one outcome that say the same share theirs."""

    name: str
    rows: Sequence[Sequence[VerdictEntry]]

    @property
    def metric(self) -> str:
        """What the check measures, where it is the same for all."""
        # Verdicts in one row share their metric, so that the first tells it.
        names = {row[0].metric.name for row in self.rows if row[0].metric}
        return names.pop() if len(names) == 1 else ""

    @cached_property
    def keys(self) -> Sequence[str]:
        """What the evidence has, but for what stands elsewhere: in the row, or with the closed forms."""
        keys = dict.fromkeys(key for row in self.rows for verdict in row for key in verdict.evidence)
        return [key for key in keys if key not in EVIDENCE_ELSEWHERE]

    @property
    def evidence(self) -> Sequence[tuple[str, Sequence[Cell]]]:
        """Each renderer that has evidence, and what it has by `keys`; one cell for equal ones that meet."""
        with_evidence = [verdict for row in self.rows for verdict in row if verdict.evidence]
        # By column, since a cell spans the equal ones below it; then read row by row.
        columns = [
            list(_spanning_cells([verdict.evidence.get(key) for verdict in with_evidence], number))
            for number, key in enumerate(self.keys)
        ]
        return [
            (verdict.renderer, [cell for cells in columns if (cell := cells[k]) is not None])
            for k, verdict in enumerate(with_evidence)
        ]


class Charts(NamedTuple):
    """The charts of one renderer as the page's script reads them, and what they show in words."""

    renderer: str
    data: str
    words: str


@dataclass(frozen=True, kw_only=True)
class CaseView:
    """All that `case_section.html.j2` shows of a case.

    - `entries`: its runs, one of each renderer, drawn by its `looks`; `verdicts`: by renderer.
    - `recordings`: those that can be drawn; `problems`: why there is no recording. Both by renderer.
    - `model`: None where this version cannot make it; a `note` stands beside the scene.
    - `tracks`: what is drawn of the runs.
    - `enclosing_names` tell ids apart on a page of several cases.
    - `check_pages`: the page that tells of checks; empty for no links there.
    """

    entries: Sequence[RunEntry]
    verdicts: Mapping[str, Sequence[VerdictEntry]]
    looks: Mapping[str, Look]
    recordings: Mapping[str, Recording]
    problems: Mapping[str, str]
    model: Model | None
    note: str
    tracks: Sequence[Track]
    enclosing_names: Sequence[str]
    check_pages: str

    @property
    def case(self) -> tuple[str, str]:
        """Suite and name of the case."""
        return self.entries[0].suite, self.entries[0].case

    @property
    def numbers(self) -> Mapping[str, int]:
        """The number of each renderer's run in the script's data."""
        return {entry.renderer: number for number, entry in enumerate(self.entries)}

    def place(self, renderer: str, check: str) -> str:
        """Return the id of a verdict."""
        return anchor(*self.enclosing_names, renderer, check)

    # What is said of it.

    def lost(self, entry: RunEntry) -> list[VerdictEntry]:
        """Return the verdicts that a run lost by breaking."""
        return list(filter(entry.lost, self.verdicts.get(entry.renderer, ())))

    @cached_property
    def judged(self) -> Sequence[VerdictEntry]:
        """The verdicts that were given, also in spite of a break; what it left without one stands with the error."""
        return [v for entry in self.entries for v in self.verdicts.get(entry.renderer, ()) if not entry.lost(v)]

    @cached_property
    def worst(self) -> VerdictEntry | None:
        """The gravest verdict with a place that is drawn."""
        timed = [
            verdict for verdict in self.judged if verdict.time is not None and verdict.renderer in self.drawn_names
        ]
        return next(iter(gravest_first(timed)), None)

    @property
    def checks(self) -> Sequence[CheckSection]:
        """The verdicts by check: first the checks that are not as expected, then those that failed."""
        rows_by_check: dict[str, dict[tuple[Any, ...], list[VerdictEntry]]] = {}
        for verdict in self.judged:
            # Only verdicts that show nothing of their own can share a row.
            is_bare = verdict.metric is None and verdict.time is None
            key = (verdict.outcome, verdict.message, verdict.level) if is_bare else (verdict.renderer,)
            rows_by_check.setdefault(verdict.check, {}).setdefault(key, []).append(verdict)
        sections = [CheckSection(check, list(rows.values())) for check, rows in rows_by_check.items()]
        return sorted(sections, key=lambda section: min(_urgency_rank(row[0]) for row in section.rows))

    @cached_property
    def questions(self) -> Mapping[str, str]:
        """What each check asks; without those not installed."""
        from hapticeval.phenomena.registry import CHECKS

        return {v.check: read_page(CHECKS[v.check]).question for v in self.judged if v.check in CHECKS}

    def item(self, verdict: VerdictEntry) -> str:
        """Return the item of its check's page that a failure is about, "" of a verdict that is none."""
        from hapticeval.phenomena.registry import item_words

        return item_words(verdict.check, verdict.evidence) if verdict.outcome is Outcome.FAIL else ""

    # What is drawn.

    @property
    def own_tools(self) -> Sequence[str]:
        """The renderers whose hand is no hand, on a given path."""
        own_tools = [name for name, recording in self.recordings.items() if recording.own_tool]
        return own_tools if _is_led(self.recordings) else []

    @cached_property
    def drawn_names(self) -> Sequence[str]:
        """The renderers of which something is drawn."""
        return [track.name for track in self.tracks]

    @cached_property
    def ticked_names(self) -> Sequence[str]:
        """The renderers that are shown at first."""
        return differing_renderers(self.judged, self.drawn_names, self.worst)

    @property
    def parts(self) -> Mapping[tuple[float, float], Sequence[str]]:
        """Which runs are too long to be drawn whole, by the seconds drawn of their beginning and their end."""
        names_by_seconds: dict[tuple[float, float], list[str]] = {}
        for track in self.tracks:
            if track.left_out is not None:
                first, last = track.left_out
                # s drawn at the beginning and at the end; each sample stands for one dt.
                seconds = first - float(track.time[0]) + track.dt, float(track.time[-1]) - last + track.dt
                names_by_seconds.setdefault(seconds, []).append(track.name)
        return names_by_seconds

    @cached_property
    def place_numbers(self) -> Mapping[tuple[str, float], int]:
        """The mark in the figures by renderer and time (s) of a failure; verdicts of one place share theirs."""
        failed = [verdict for verdict in self.judged if verdict.outcome is Outcome.FAIL]
        keys = [(verdict.renderer, verdict.time) for verdict in failed if verdict.time is not None]
        drawn_keys = dict.fromkeys(key for key in keys if key[0] in self.drawn_names)
        # Numbers from 1 in the order of the verdicts.
        return {key: number for number, key in enumerate(drawn_keys, start=1)}

    @property
    def crosses(self) -> Mapping[str, Sequence[float]]:
        """Points, m, by renderer: where it refuses the model."""
        refusals = {entry.renderer: entry.refusal for entry in self.entries if entry.refusal is not None}
        return {name: refusal.position for name, refusal in refusals.items() if refusal.position is not None}

    @property
    def is_drawn(self) -> bool:
        """Whether there is a picture: of runs, or of a plane model that renderers refuse at a place."""
        return bool(self.tracks) or bool(self.crosses and self.model is not None and self.model.dimension == 2)

    @property
    def charts(self) -> Iterator[Charts]:
        """The charts of each renderer that walks over a sphere's."""
        for name, recording in self.recordings.items():
            if self.model is not None and has_charts(recording):
                yield Charts(name, charts_data(atlas_charts(recording, self.model)), charts_words(recording))

    @property
    def data(self) -> str:
        """What the page's script reads, as JSON: paths and runs, panels and model."""
        title = f"{'/'.join(self.case)}: paths on the model"
        return case_text(title, self.tracks, self.model, self.looks, numbers=self.numbers, crosses=self.crosses)


def write_case_page(
    folder: Path,
    entries: Sequence[RunEntry],
    recordings: Mapping[str, Recording | str],
    *,
    verdicts: Mapping[str, Sequence[VerdictEntry]],
    order: Sequence[str] = (),
    neighbours: Neighbours | None = None,
) -> None:
    """Write the page of a case below `folder`, in the place of `templates.case_file`.

    - `entries`: the runs of the case, one at least
    - `recordings`, `verdicts`: by renderer; a text in place of a recording is the reason why there is none
    - `order`: all renderers of the report, so that each looks the same on every page

    It needs the files that `write_assets` puts beside it. Raises `HapticevalError` where it cannot be written.
    """
    section = case_section(entries, recordings, verdicts=verdicts, order=order, check_pages=PATH_TO_PAGES + CHECK_PAGES)
    first = entries[0]
    _write_page(folder / case_file(first.suite, first.case), section, first, neighbours or Neighbours(), PATH_TO_PAGES)


def write_view(
    folder: Path,
    entries: Sequence[RunEntry],
    recordings: Mapping[str, Recording],
    *,
    verdicts: Mapping[str, Sequence[VerdictEntry]],
    note: str = "",
) -> Path:
    """Write recorded runs on one model as `folder`/index.html, with all that the page needs, and return its path.

    Raises `InputError` for a folder that holds other files than those of an earlier page.
    """
    # The file by which a command locks the folder, where the system cannot, is none of a user's.
    others = (path for path in folder.iterdir() if path.suffix != ".lock") if folder.is_dir() else ()
    is_empty = not any(others) and (folder.is_dir() or not folder.exists())
    if not is_empty and not holds_earlier_view(folder):
        raise InputError(
            f"'{folder}' is not empty and holds no page of an earlier view",
            why="files that hapticeval did not write are never overwritten",
            todo="name a new or an empty folder with -o",
        )
    section = case_section(entries, recordings, verdicts=verdicts, note=note)
    write_assets(folder)
    _write_page(folder / INDEX, section, entries[0], Neighbours(), "", mark=VIEW_MARK)
    return folder / INDEX


def holds_earlier_view(folder: Path) -> bool:
    """Whether the page of a folder is one that `write_view` wrote: by its mark, which no other page has."""
    try:
        # The mark stands in the page's head, before its data: of some pages these are megabytes.
        with (folder / INDEX).open(encoding="utf-8", errors="replace") as page:
            return VIEW_MARK in page.read(HEAD_CHARACTERS)
    except OSError:
        return False


def _write_page(
    path: Path, section: str, first: RunEntry, neighbours: Neighbours, root: str, *, mark: str = ""
) -> None:
    """Write the page round a case's section; `root` leads from it to the report's folder, a `mark` is for its head."""
    text = environment().get_template("case_page.html.j2").render(
        section=section, neighbours=neighbours, first=first, files=CASE_ASSETS, root=root, mark=mark
    )  # fmt: skip
    write_text(path, text)


def write_assets(folder: Path) -> None:
    """Write scripts and the sheets into `folder`/assets, once."""
    for name in PAGE_ASSETS:
        with writing(folder / ASSETS_FOLDER), replacing(folder / ASSETS_FOLDER / name) as temporary:
            temporary.write_bytes(asset(name))


def asset(name: str) -> bytes:
    """Return the content of one of `CASE_ASSETS`: a page that stands alone holds them all."""
    files = resources.files("hapticeval.reports")
    return (files / name if name == "report.css" else files / "assets" / name).read_bytes()


def case_section(
    entries: Sequence[RunEntry],
    recordings: Mapping[str, Recording | str],
    *,
    verdicts: Mapping[str, Sequence[VerdictEntry]],
    order: Sequence[str] = (),
    enclosing_names: Sequence[str] = (),
    note: str = "",
    check_pages: str = "",
) -> str:
    """Return what a page shows of a case, an HTML element; `entries` are its runs, one at least.

    On a page of several cases the `enclosing_names` tell ids apart.

    A `note` stands beside the scene. Checks link to where `check_pages` tells of them, if it is given.
    Everything that comes from results is escaped.
    """
    drawable = _drawable(recordings)
    model = _fitting_model(entries[0], drawable)
    names = [entry.renderer for entry in entries]
    times = {name: [t for v in verdicts.get(name, ()) if (t := v.time) is not None] for name in drawable}
    failed = [v for name in drawable for v in verdicts.get(name, ()) if v.outcome is Outcome.FAIL]
    faults = {v.time for v in failed if v.time is not None}
    tracks = sample_tracks(
        {name: drawable[name] for name in names if name in drawable},
        times,
        faults=faults,
        held_on=model if _is_held(entries[0], drawable) else None,
    )
    view = CaseView(
        entries=entries,
        verdicts=verdicts,
        # A renderer's look is its place in the whole report, not on this page.
        looks=looks_of([*order, *names]),
        recordings=drawable,
        problems={name: reason for name, reason in recordings.items() if isinstance(reason, str)},
        model=model,
        note=note,
        tracks=tracks,
        enclosing_names=enclosing_names,
        check_pages=check_pages,
    )
    return environment().get_template("case_section.html.j2").render(view=view)


def run_text(entry: RunEntry, recording: Recording, time: float | None, look: Look, title: str) -> str:
    """Return what a page's script draws of one run, as JSON, with a mark at a time (s); "" without a recorded hand."""
    drawable = _drawable({entry.renderer: recording})
    if not drawable:
        return ""
    model = _fitting_model(entry, drawable)
    times = [] if time is None else [time]
    held_on = model if _is_held(entry, drawable) else None
    tracks = sample_tracks(drawable, {entry.renderer: times}, faults=times, held_on=held_on)
    marks = [Mark(0, moment) for moment in times]
    return case_text(title, tracks, model, {entry.renderer: look}, marks=marks, time=time)


def _drawable(recordings: Mapping[str, Recording | str]) -> dict[str, Recording]:
    """Return what can be drawn of recordings, by renderer: the rows of those with a hand that are measurements."""
    return {
        name: drawable_recording(recording)
        for name, recording in recordings.items()
        if isinstance(recording, Recording) and "hip" in recording.channels and recording.measured.any()
    }


def _fitting_model(entry: RunEntry, recordings: Mapping[str, Recording]) -> Model | None:
    """Return the model of a case; None where it cannot be made, or recordings of others are of another space."""
    model = model_of(entry, next(iter(recordings.values()), None))
    if model is not None and any(recording.dimension != model.dimension for recording in recordings.values()):
        return None
    return model


def _is_held(entry: RunEntry, recordings: Mapping[str, Recording]) -> bool:
    """Return whether a bilateral surface holds the tool; where the hand is led, only the IHIP is held."""
    return entry.scene.bilateral and not _is_led(recordings)


def _is_led(recordings: Mapping[str, Recording]) -> bool:
    """Return whether the hand follows a given path in any of the recordings."""
    return any(recording.meta.get("source") in LED for recording in recordings.values())


def differing_renderers(
    verdicts: Sequence[VerdictEntry], names: Sequence[str], worst: VerdictEntry | None
) -> Sequence[str]:
    """Return up to `MOST_SHOWN` of the renderers `names` that a page shows first: those whose outcomes differ most.

    The one of the `worst` verdict comes first. Each further one has the most outcomes that differ from those of all
    before it; where none differs, two are shown.
    """
    if len(names) <= MOST_SHOWN:
        return names
    outcomes: dict[str, dict[str, Outcome]] = {name: {} for name in names}
    for verdict in verdicts:
        if verdict.renderer in outcomes:
            outcomes[verdict.renderer][verdict.check] = verdict.outcome
    chosen = [names[0] if worst is None else worst.renderer]

    def difference(name: str) -> int:
        """The number of checks with another outcome than the most alike of the chosen has."""
        return min(
            sum(outcomes[name].get(check) != outcomes[other].get(check) for check in outcomes[name]) for other in chosen
        )

    while len(chosen) < MOST_SHOWN:
        # The first of those that differ most.
        candidate = max((name for name in names if name not in chosen), key=difference)
        if difference(candidate) == 0 and len(chosen) > 1:
            break
        chosen.append(candidate)
    return chosen


def model_of(entry: RunEntry, recording: Recording | None) -> Model | None:
    """Return the model of a run; None where this version cannot make it, or its file is gone."""
    try:
        return entry.build_model(recording)
    except HapticevalError:
        return None


def _spanning_cells(values: Sequence[Any], column: int) -> Iterator[Cell | None]:
    """Yield the cells of a column: None where the one above reaches there."""
    for value, alike in groupby(values):
        rows = len(list(alike))
        # The first of equal cells spans them all; the others are left out.
        yield Cell(value, column, rows)
        yield from [None] * (rows - 1)


def _urgency_rank(verdict: VerdictEntry) -> int:
    """Return 0 for a verdict that is not as expected, 1 for another that failed, and else 2."""
    if not verdict.as_expected:
        return 0
    return 1 if verdict.outcome is Outcome.FAIL else 2
