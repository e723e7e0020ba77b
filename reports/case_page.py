"""The page of one case: all its renderers laid over each other on the model, with a slider over time, and the verdicts.

Without script the page shows figures and verdicts; the script in `assets/` moves HIP and IHIP over the same data.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from hapticeval.errors import HapticevalError, InputError
from hapticeval.files import replacing
from hapticeval.geometry.model import Model
from hapticeval.phenomena.sampling import LED
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.reports.atlas_figure import atlas_svg, charts_words, has_charts
from hapticeval.reports.canvas import classed
from hapticeval.reports.case_data import Packer, Track, fineness, packed_runs, placed, tracks
from hapticeval.reports.case_figure import Look, Panel, Place, compact, look, panels, panels_svg, plane_svg
from hapticeval.reports.case_model import packed_model
from hapticeval.reports.places import ASSETS as ASSET_FOLDER
from hapticeval.reports.places import INDEX, ROOT, case_file
from hapticeval.reports.plane import refusal_svg
from hapticeval.reports.scene_words import ended_words, figures_cited, robot_words, scene_words
from hapticeval.reports.templates import environment
from hapticeval.runner.results import RunEntry, VerdictEntry

ASSETS = ("report.css", "case.css", "uPlot.min.css", "uPlot.iife.min.js", "case.js")
"""Style sheets and scripts of a case page, in the order in which it needs them."""

OURS = {INDEX, ASSET_FOLDER}
"""What a folder of a view holds."""

LICENCES = ("LICENSE-uPlot.txt",)


@dataclass(frozen=True)
class Around:
    """Where a page lies among others: titles and addresses of the first screen, and of the cases before and after."""

    home: tuple[str, str] | None = None
    before: tuple[str, str] | None = None
    after: tuple[str, str] | None = None


@dataclass(frozen=True)
class CheckRow:
    """Verdicts of one check that have one outcome in common, and say the same; most often it is one."""

    verdicts: Sequence[VerdictEntry]

    @property
    def first(self) -> VerdictEntry:
        """The verdict that says what all do."""
        return self.verdicts[0]


def write_case_page(
    folder: Path,
    case: tuple[str, str],
    entries: Sequence[RunEntry],
    recordings: Mapping[str, Recording | str],
    *,
    verdicts: Mapping[str, Sequence[VerdictEntry]],
    order: Sequence[str] = (),
    around: Around | None = None,
) -> Path:
    """Write the page of a case (suite and name) below `folder`, see `places.case_file`, and return its path.

    `entries` are the runs of the case; `recordings` and `verdicts` are by renderer, and a text in place of a recording
    is the reason why there is none. `order` lists all renderers of the report, so that each looks the same on every
    page. It needs the files that `write_assets` puts beside it. Raises `HapticevalError` where it cannot be written.
    """
    path = folder / case_file(*case)
    section = case_section(case, entries, recordings, verdicts=verdicts, order=order)
    _write_page(path, section, entries[0], around or Around(), ROOT)
    return path


def write_view(
    folder: Path, entry: RunEntry, recording: Recording, verdicts: Sequence[VerdictEntry], *, note: str = ""
) -> Path:
    """Write one recorded run as `folder`/index.html, with all that the page needs beside it, and return its path.

    Raises `InputError` for a folder that holds other files than those of an earlier page.
    """
    held_there = {each.name for each in folder.iterdir()} if folder.is_dir() else {""} if folder.exists() else set()
    if held_there and not held_there >= OURS:
        raise InputError(
            f"'{folder}' is not empty and holds no page of an earlier view",
            why="files that hapticeval did not write are never overwritten",
            todo="name a new or an empty folder with -o",
        )
    case, path = (entry.suite, entry.case), folder / INDEX
    section = case_section(case, [entry], {entry.renderer: recording}, verdicts={entry.renderer: verdicts}, note=note)
    write_assets(folder)
    _write_page(path, section, entry, Around(), "")
    return path


def _write_page(path: Path, section: str, first: RunEntry, around: Around, root: str) -> None:
    text = environment().get_template("case_page.html.j2").render(
        section=section, around=around, first=first, files=ASSETS, root=root
    )  # fmt: skip
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise HapticevalError(f"cannot write {path}", why=error.strerror or str(error)) from error


def write_assets(folder: Path) -> None:
    """Write styles, scripts and their licences into `folder`/assets, once for all pages."""
    try:
        (folder / ASSET_FOLDER).mkdir(parents=True, exist_ok=True)
        for name in (*ASSETS, *LICENCES):
            with replacing(folder / ASSET_FOLDER / name) as temporary:
                temporary.write_bytes(asset(name))
    except OSError as error:
        raise HapticevalError(f"cannot write {folder / 'assets'}", why=error.strerror or str(error)) from error


def asset(name: str) -> bytes:
    """Return the content of one of `ASSETS`: a page that stands alone holds them all."""
    files = resources.files("hapticeval.reports")
    return (files / name if name == "report.css" else files / "assets" / name).read_bytes()


def case_section(
    case: tuple[str, str],
    entries: Sequence[RunEntry],
    recordings: Mapping[str, Recording | str],
    *,
    verdicts: Mapping[str, Sequence[VerdictEntry]],
    order: Sequence[str] = (),
    prefix: str = "c",
    note: str = "",
) -> str:
    """Return what a page shows of a case, as an HTML element; `prefix` keeps the ids of several apart.

    A `note` stands beside the scene. Everything that comes from results is escaped.
    """
    from hapticeval.phenomena.registry import CHECKS

    names = [entry.renderer for entry in entries]
    columns = list(dict.fromkeys([*order, *names]))
    looks = {name: look(columns.index(name)) for name in names}
    given = [verdict for name in names for verdict in verdicts.get(name, ())]
    whole = {name: placed(each) for name, each in recordings.items() if isinstance(each, Recording) and _shown(each)}
    problems = {name: each for name, each in recordings.items() if isinstance(each, str)}
    times = {name: [t for v in verdicts.get(name, ()) if (t := time_of(v)) is not None] for name in whole}
    model = model_of(entries[0])
    if model is not None and any(each.dimension != model.dimension for each in whole.values()):
        model = None
    is_led = any(each.meta.get("source") in LED for each in whole.values())
    surface = model if entries[0].scene.bilateral and not is_led else None
    found = tracks({name: whole[name] for name in names if name in whole}, times, held_on=surface)
    crosses = {
        entry.renderer: entry.refusal.position
        for entry in entries
        if entry.refusal is not None and entry.refusal.position is not None
    }
    places = _places(given, {each.name for each in found})
    figures: dict[str, str] = {}
    data: dict[str, Any] = {}
    label = "/".join(case)
    if found:
        shown = panels(found, held=surface is not None)
        title = f"{label}: {', '.join(each.name for each in found)}"
        figures = {
            "plane": plane_svg(
                found, model, looks, places, crosses=crosses, prefix=f"{prefix}p", title=f"{title}: paths on the model"
            ),
            "plots": panels_svg(
                found, shown, looks, places, prefix=f"{prefix}t", title=f"{title}: force and motion against time"
            ),
        }
        data = {**_document(found, shown, model, looks, names), "crosses": crosses}
    elif crosses and model is not None and model.dimension == 2:
        title = f"{label}: the outline of the model, and where renderers refuse it"
        figures = {"refused": refusal_svg(model, next(iter(crosses.values())), prefix=f"{prefix}p", title=title)}
    charts: list[tuple[str, str, str]] = []
    for name, each in whole.items():
        if model is not None and has_charts(each):
            title, key = f"{name} in {label}: the charts", f"charts of {name}"
            figures[key] = compact(atlas_svg(each, model, prefix=f"{prefix}a{len(charts)}", title=title))
            charts.append((name, key, charts_words(each)))
    figures, rules = _classed(figures, prefix)
    return environment().get_template("case_section.html.j2").render(
        suite=case[0], name=case[1], entries=entries, looks=looks, verdicts=verdicts, problems=problems, model=model,
        checks=_by_check(given), known=CHECKS, figures=figures, rules=rules, data=_script(data), charts=charts,
        time_of=time_of, prefix=prefix, numbers={name: k for k, name in enumerate(names)}, note=note,
        scene_words=scene_words, robot_words=robot_words, ended_words=ended_words, figures_cited=figures_cited,
        places={(each.renderer, each.time): each.number for each in places},
        tracks={each.name for each in found},
    )  # fmt: skip


def _classed(figures: Mapping[str, str], prefix: str) -> tuple[dict[str, str], str]:
    """Return the figures with their styles as classes of names that begin with `prefix`, and the rules of these."""
    elements, rules = classed(list(figures.values()))
    rules = re.sub(r"font-family:[^;}]*;|stroke-dashoffset:0;", "", rules)  # the page's font, as in every figure
    named = [re.sub(r'class="z(\d+)"', rf'class="{prefix}\1"', each) for each in elements]
    return dict(zip(figures, named, strict=True)), re.sub(r"^\.z(\d+)", rf".{prefix}\1", rules, flags=re.MULTILINE)


def _script(document: dict[str, Any]) -> str:
    """JSON that cannot end the element of the page that holds it."""
    return json.dumps(document, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _shown(recording: Recording) -> bool:
    return "hip" in recording.channels and bool(recording.measured.any())


def model_of(entry: RunEntry) -> Model | None:
    """Return the model of a run; None where this version cannot make it."""
    from hapticeval.geometry.catalogue import make_model

    try:
        return make_model(entry.model["kind"], **entry.model_parameters)
    except HapticevalError:
        return None


def time_of(verdict: VerdictEntry) -> float | None:
    """Return the time, s, that a verdict's evidence names; None where it names none."""
    time: Any = verdict.evidence.get("time")
    return float(time) if type(time) in (int, float) else None


def _places(verdicts: Iterable[VerdictEntry], shown: set[str]) -> list[Place]:
    """Number the places where something failed; verdicts of one place share its number."""
    found: dict[tuple[str, float], Place] = {}
    for verdict in verdicts:
        time = time_of(verdict)
        if time is not None and verdict.outcome is Outcome.FAIL and verdict.renderer in shown:
            key = (verdict.renderer, time)
            found.setdefault(key, Place(len(found) + 1, *key))
    return list(found.values())


def _by_check(verdicts: Sequence[VerdictEntry]) -> list[tuple[str, list[CheckRow]]]:
    """The verdicts by check, what is not as expected first, then what failed; those that say the same in one row."""
    checks: dict[str, dict[tuple[Any, ...], list[VerdictEntry]]] = {}
    for verdict in verdicts:
        alike = verdict.metric is None and time_of(verdict) is None
        key = (verdict.outcome, verdict.message, verdict.level) if alike else (verdict.renderer,)
        checks.setdefault(verdict.check, {}).setdefault(key, []).append(verdict)
    found = [(check, [CheckRow(each) for each in rows.values()]) for check, rows in checks.items()]
    return sorted(found, key=lambda each: min(_rank(row.first) for row in each[1]))


def _rank(verdict: VerdictEntry) -> int:
    if not verdict.as_expected:
        return 0
    return 1 if verdict.outcome is Outcome.FAIL else 2


def _document(
    found: Sequence[Track], shown: Sequence[Panel], model: Model | None, looks: Mapping[str, Look], names: Sequence[str]
) -> dict[str, Any]:
    """What the script reads: runs, panels and model, with the numbers of their arrays, and the arrays, packed."""
    packer = Packer()
    runs = packed_runs(found, packer)
    return {
        "dimension": int(found[0].hip.shape[1]),
        "runs": [
            {
                **run,
                "number": names.index(each.name),
                "role": looks[each.name].role,
                "dash": looks[each.name].dash,
                "marker": looks[each.name].marker,
            }
            for run, each in zip(runs, found, strict=True)
        ],
        "panels": [{"label": each.label, "terms": each.terms, "range": each.powers} for each in shown],
        "model": packed_model(model, found, packer),
        "fine": fineness(found),
        **packer.document(),
    }
