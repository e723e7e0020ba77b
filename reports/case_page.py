"""The page of one case: all its renderers laid over each other on the model, with a slider over time, and the verdicts.

Without script the page shows figures and verdicts; the script in `assets/` moves HIP and IHIP over the same data.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
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
from hapticeval.reports.atlas_figure import atlas_svg, charts_words, has_charts
from hapticeval.reports.canvas import Look, looks_of
from hapticeval.reports.case_data import Track, drawable_recording, model_document, sample_tracks, tracks_document
from hapticeval.reports.case_figure import (
    Panel,
    Place,
    case_panels,
    panels_svg,
    plane_svg,
)
from hapticeval.reports.grid import gravest_first
from hapticeval.reports.plane import refusal_svg
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

CASE_ASSETS = ("report.css", "case.css", "uPlot.min.css", "uPlot.iife.min.js", "case.js")
"""Style sheets and scripts of a case page, in the order in which it needs them."""

PAGE_ASSETS = (*CASE_ASSETS, "filter.js")
"""What all pages of a report need."""

VIEW_MARK = '<meta name="generator" content="hapticeval view">'
"""What stands in the page of a view, and in no other: the next view of that folder may write over it."""

HEAD_CHARACTERS = 4096
"""Characters of a page in which its head ends."""

LICENCES = ("LICENSE-uPlot.txt",)
"""Licences of scripts that are not ours, written beside them."""


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

    @property
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
    """The charts of one renderer: the name of their figure among `CaseView.figures`, and what they show in words."""

    renderer: str
    figure: str
    words: str


@dataclass(frozen=True, kw_only=True)
class CaseView:
    """All that `case_section.html.j2` shows of a case.

    Of the case:

    - `case`: its suite and name; `entries`: its runs, one of each renderer, drawn by its `looks`.
    - `model`: None where this version cannot make it; a `note` stands beside the scene.
    - `enclosing_names` tell ids apart on a page of several cases.

    What is drawn:

    - `ticked_names`: renderers that are shown at first, of the `drawn_names`; `own_tools`: those whose hand is no hand.
    - `problems`: why there is no recording, by renderer.
    - `figures`: SVG elements by name; `data`: what the page's script reads, as JSON.
    - `parts`: which runs are too long to be drawn whole, see `_drawn_parts`; `charts`: those that walk over a sphere's.

    What is said of it:

    - `verdicts` by renderer, and by check as `checks`; the `worst` of those with a place.
    - `questions` by check, which link to where `check_pages` tells of them; empty for no link.
    - `place_numbers`: the mark in the figures by renderer and time (s).
    """

    case: tuple[str, str]
    entries: Sequence[RunEntry]
    looks: Mapping[str, Look]
    model: Model | None
    note: str
    enclosing_names: Sequence[str]
    ticked_names: Sequence[str]
    drawn_names: Sequence[str]
    own_tools: Sequence[str]
    problems: Mapping[str, str]
    figures: Mapping[str, str]
    data: str
    parts: Mapping[tuple[float, float], Sequence[str]]
    charts: Sequence[Charts]
    verdicts: Mapping[str, Sequence[VerdictEntry]]
    checks: Sequence[CheckSection]
    questions: Mapping[str, str]
    check_pages: str
    worst: VerdictEntry | None
    place_numbers: Mapping[tuple[str, float], int]

    @property
    def numbers(self) -> Mapping[str, int]:
        """The number of each renderer's run in the script's data."""
        return {entry.renderer: number for number, entry in enumerate(self.entries)}

    def place(self, renderer: str, check: str) -> str:
        """Return the id of a verdict."""
        return anchor(*self.enclosing_names, renderer, check)

    def lost(self, entry: RunEntry) -> list[VerdictEntry]:
        """Return the verdicts that a run lost by breaking."""
        return list(filter(entry.lost, self.verdicts.get(entry.renderer, ())))


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
    folder: Path, entry: RunEntry, recording: Recording, verdicts: Sequence[VerdictEntry], *, note: str = ""
) -> Path:
    """Write one recorded run as `folder`/index.html, with all that the page needs beside it, and return its path.

    Raises `InputError` for a folder that holds other files than those of an earlier page.
    """
    is_empty = not any(folder.iterdir()) if folder.is_dir() else not folder.exists()
    if not is_empty and not holds_earlier_view(folder):
        raise InputError(
            f"'{folder}' is not empty and holds no page of an earlier view",
            why="files that hapticeval did not write are never overwritten",
            todo="name a new or an empty folder with -o",
        )
    section = case_section([entry], {entry.renderer: recording}, verdicts={entry.renderer: verdicts}, note=note)
    write_assets(folder)
    _write_page(folder / INDEX, section, entry, Neighbours(), "", mark=VIEW_MARK)
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
    """Write scripts, their licences and the sheets into `folder`/assets, once."""
    for name in (*PAGE_ASSETS, *LICENCES):
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
    prefix: str = "c",
    enclosing_names: Sequence[str] = (),
    note: str = "",
    check_pages: str = "",
) -> str:
    """Return what a page shows of a case, an HTML element; `entries` are its runs, one at least.

    On a page of several cases, `prefix` and the `enclosing_names` tell ids apart.

    A `note` stands beside the scene. Checks link to where `check_pages` tells of them, if it is given.
    Everything that comes from results is escaped.
    """
    from hapticeval.phenomena.registry import CHECKS

    names = [entry.renderer for entry in entries]
    # What a break left without a verdict stands with the error; what was judged in spite of it, with the others.
    judged = [verdict for entry in entries for verdict in verdicts.get(entry.renderer, ()) if not entry.lost(verdict)]
    drawable = _drawable_recordings(recordings)
    is_led = any(recording.meta.get("source") in LED for recording in drawable.values())
    # A renderer's look is its place in the whole report, not on this page.
    drawing = _plan_drawing(entries, drawable, verdicts, judged, looks=looks_of([*order, *names]), is_led=is_led)
    timed = [verdict for verdict in judged if verdict.time is not None and verdict.renderer in drawing.names]
    worst = next(iter(gravest_first(timed)), None)
    case = entries[0].suite, entries[0].case
    label = "/".join(case)
    charts = _draw_charts(drawable, drawing.model, prefix=prefix, label=label)
    view = CaseView(
        case=case,
        entries=entries,
        looks=drawing.looks,
        model=drawing.model,
        note=note,
        enclosing_names=enclosing_names,
        ticked_names=differing_renderers(judged, drawing.names, worst),
        drawn_names=drawing.names,
        own_tools=[name for name, recording in drawable.items() if is_led and recording.own_tool],
        problems={name: reason for name, reason in recordings.items() if isinstance(reason, str)},
        figures=_case_figures(drawing, prefix=prefix, label=label) | {chart.figure: svg for chart, svg in charts},
        data=_script_data(drawing, names) if drawing.tracks else "",
        parts=_drawn_parts(drawing.tracks),
        charts=[chart for chart, _ in charts],
        verdicts=verdicts,
        checks=_check_sections(judged),
        questions={v.check: read_page(CHECKS[v.check]).question for v in judged if v.check in CHECKS},
        check_pages=check_pages,
        worst=worst,
        place_numbers={(place.renderer, place.time): place.number for place in drawing.places},
    )
    return environment().get_template("case_section.html.j2").render(view=view)


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What figures and script draw of a case: its `tracks` on the `model` and in `panels`, each run by its look.

    `places` are numbered; `crosses` are points, m, by renderer: where it refuses the model.
    """

    tracks: Sequence[Track]
    panels: Sequence[Panel]
    model: Model | None
    looks: Mapping[str, Look]
    places: Sequence[Place]
    crosses: Mapping[str, Sequence[float]]

    @property
    def names(self) -> Sequence[str]:
        """The renderers of which something is drawn."""
        return [track.name for track in self.tracks]


def _drawable_recordings(recordings: Mapping[str, Recording | str]) -> dict[str, Recording]:
    """Return the recordings that have a hand path and something measured, as they can be drawn, by renderer."""
    return {
        name: drawable_recording(recording)
        for name, recording in recordings.items()
        if isinstance(recording, Recording) and "hip" in recording.channels and recording.measured.any()
    }


def _plan_drawing(
    entries: Sequence[RunEntry],
    drawable: Mapping[str, Recording],
    verdicts: Mapping[str, Sequence[VerdictEntry]],
    judged: Sequence[VerdictEntry],
    *,
    looks: Mapping[str, Look],
    is_led: bool,
) -> Drawing:
    """Return what is drawn of the `drawable` recordings, with the samples that `verdicts` name.

    Of the verdicts `judged` it marks the places; `is_led` where the hand follows a path.
    """
    model = model_of(entries[0], next(iter(drawable.values()), None))
    # A foreign recording may be of another space than the model that its entry names.
    if model is not None and any(recording.dimension != model.dimension for recording in drawable.values()):
        model = None
    times = {name: [t for v in verdicts.get(name, ()) if (t := v.time) is not None] for name in drawable}
    tracks = sample_tracks(
        {entry.renderer: drawable[entry.renderer] for entry in entries if entry.renderer in drawable},
        times,
        # A bilateral surface holds the tool, unless the hand is led and only the IHIP is held.
        held_on=model if entries[0].scene.bilateral and not is_led else None,
    )
    return Drawing(
        tracks=tracks,
        panels=case_panels(tracks) if tracks else (),
        model=model,
        looks=looks,
        places=_failed_places(judged, {track.name for track in tracks}),
        crosses={
            entry.renderer: entry.refusal.position
            for entry in entries
            if entry.refusal is not None and entry.refusal.position is not None
        },
    )


def _case_figures(drawing: Drawing, *, prefix: str, label: str) -> dict[str, str]:
    """Draw paths and plots of what was recorded; without any of it, in the plane, where renderers refuse the model."""
    tracks, model, looks, places, crosses = (
        drawing.tracks, drawing.model, drawing.looks, drawing.places, drawing.crosses,
    )  # fmt: skip
    if tracks:
        return {
            "plane": plane_svg(
                tracks, model, looks, places, crosses=crosses, prefix=f"{prefix}p", title=f"{label}: paths on the model"
            ),
            "plots": panels_svg(
                tracks,
                drawing.panels,
                looks,
                places,
                prefix=f"{prefix}t",
                title=f"{label}: force and motion against time",
            ),
        }
    # Nothing was recorded: every renderer refused, and some say where.
    if crosses and model is not None and model.dimension == 2:
        title = f"{label}: the outline of the model, and where renderers refuse it"
        return {"refused": refusal_svg(model, next(iter(crosses.values())), prefix=f"{prefix}p", title=title)}
    return {}


def _draw_charts(
    drawable: Mapping[str, Recording], model: Model | None, *, prefix: str, label: str
) -> list[tuple[Charts, str]]:
    """Draw the charts of each renderer that has some, as SVG elements beside what tells of them."""
    charts: list[tuple[Charts, str]] = []
    for name, recording in drawable.items():
        if model is not None and has_charts(recording):
            svg = atlas_svg(recording, model, prefix=f"{prefix}a{len(charts)}", title=f"{name} in {label}: the charts")
            charts.append((Charts(name, f"charts of {name}", charts_words(recording)), svg))
    return charts


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


def _failed_places(verdicts: Iterable[VerdictEntry], drawn_renderers: set[str]) -> list[Place]:
    """Number the places where something failed; verdicts of one place share its number."""
    place_by_key: dict[tuple[str, float], Place] = {}
    for verdict in verdicts:
        time = verdict.time
        if time is not None and verdict.outcome is Outcome.FAIL and verdict.renderer in drawn_renderers:
            key = (verdict.renderer, time)
            # Numbers from 1 in the order of the verdicts.
            place_by_key.setdefault(key, Place(len(place_by_key) + 1, *key))
    return list(place_by_key.values())


def _drawn_parts(tracks: Sequence[Track]) -> dict[tuple[float, float], list[str]]:
    """Return which runs are too long to be drawn whole, by the seconds drawn of their beginning and their end."""
    parts: dict[tuple[float, float], list[str]] = {}
    for track in tracks:
        if track.left_out is not None:
            first, last = track.left_out
            # s drawn at the beginning and at the end; each sample stands for one dt.
            seconds = first - float(track.time[0]) + track.dt, float(track.time[-1]) - last + track.dt
            parts.setdefault(seconds, []).append(track.name)
    return parts


def _check_sections(verdicts: Sequence[VerdictEntry]) -> list[CheckSection]:
    """Return the verdicts by check: first the checks that are not as expected, then those that failed."""
    checks: dict[str, dict[tuple[Any, ...], list[VerdictEntry]]] = {}
    for verdict in verdicts:
        # Only verdicts that show nothing of their own can share a row.
        is_bare = verdict.metric is None and verdict.time is None
        key = (verdict.outcome, verdict.message, verdict.level) if is_bare else (verdict.renderer,)
        checks.setdefault(verdict.check, {}).setdefault(key, []).append(verdict)
    sections = [CheckSection(check, list(rows.values())) for check, rows in checks.items()]
    return sorted(sections, key=lambda section: min(_urgency_rank(row[0]) for row in section.rows))


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


def _script_data(drawing: Drawing, names: Sequence[str]) -> str:
    """Return what the page's script reads, as JSON: paths and runs, panels and model; `names` are those of all runs."""
    # Keys are what assets/case.js reads.
    drawn = tracks_document(drawing.tracks)
    for run in drawn["runs"]:
        look = drawing.looks[run["name"]]
        run |= {"number": names.index(run["name"]), "role": look.role, "dash": look.dash, "marker": look.marker}
    document = {
        **drawn,
        "dimension": int(drawing.tracks[0].hip.shape[1]),
        "panels": [
            {
                "label": panel.label,
                "terms": [(term.script_name, term.label) for term in panel.terms],
                "range": panel.powers,
            }
            for panel in drawing.panels
        ],
        "model": model_document(drawing.model, drawing.tracks),
        "crosses": drawing.crosses,
    }
    # As JSON writes it in a script element, which "<" could end.
    return json.dumps(document, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
