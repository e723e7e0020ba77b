"""The commands that read recordings: inspect, convert, view, compare."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.commands.arguments import (
    Folder,
    FormatName,
    MappingFile,
    MemoryLimit,
    SceneEntries,
    SuiteCase,
    TouchedModel,
    TrialName,
    argument,
    load_within,
    model_named,
    option,
)
from hapticeval.commands.terminal import lines, paragraphs, say, wrote_lines
from hapticeval.errors import InputError
from hapticeval.files import file_stem
from hapticeval.quantity import format_quantity
from hapticeval.recordings.memory import DEFAULT_LIMIT
from hapticeval.table import Table as WordTable

if TYPE_CHECKING:
    from hapticeval.geometry.curve import Curve
    from hapticeval.recordings.formats import Table
    from hapticeval.recordings.integrity.consistency import ConsistencyTest
    from hapticeval.recordings.overlay import Overlay
    from hapticeval.recordings.recording import Recording
    from hapticeval.replay.viewing import Viewed
    from hapticeval.runner.results import VerdictEntry


INSPECT_CODES = """\b
Exit codes:
  0  sound, as far as can be told
  1  something is suspicious, or rows are missing
  2  wrong usage, or unreadable
"""

CONVERT_CODES = """\b
Exit codes:
  0  converted
  1  converted, but rows are lost or masked, the run ended early, or something is suspicious
  2  wrong usage, or unreadable; nothing is written
"""


def inspect(
    file: Annotated[Path, argument(metavar="FILE", help="A recording, or a foreign file.")],
    mapping: MappingFile = None,
    write_mapping: Annotated[
        Path | None, option("--write-mapping", metavar="TOML", help="Write the proposed mapping here.")
    ] = None,
    format_: FormatName = None,
    trial: TrialName = None,
    memory_limit: MemoryLimit = DEFAULT_LIMIT,
    model: Annotated[
        str | None, option("--model", metavar="MODEL", help="What was touched, as in circle:size=0.2.")
    ] = None,
    stiffness: Annotated[float | None, option("--stiffness", metavar="N/M", help="K_p, where K_d is zero.")] = None,
    against: Annotated[
        list[Path] | None, option("--against", metavar="FILE", help="Another recording: is a signal copied?")
    ] = None,
    directory: Folder = Path(),
) -> None:
    """Examine a recording: clock, channels, units, and what has to follow from what.

    Of a foreign file without a mapping it shows the columns and proposes a mapping; of a damaged recording, and of the
    journal of a run that crashed, it examines what is whole.

    \b
    Examples:
      hapticeval inspect run7.h5
      hapticeval inspect log.mat --write-mapping rig.toml
      hapticeval inspect log.mat --mapping rig.toml
      hapticeval inspect run7.h5 --model circle:size=0.2 --stiffness 1000 --against run6.h5
    """
    from hapticeval.hardware.wiring import at_the_hand
    from hapticeval.recordings.formats import read_table
    from hapticeval.recordings.importing.convert import is_ours, load
    from hapticeval.recordings.memory import limited

    if stiffness is not None and not 0.0 < stiffness < math.inf:
        why, todo = "a stiffness is finite and positive, N/m", "give that of the scene, or leave it out"
        raise InputError(f"--stiffness {stiffness:g}", why=why, todo=todo)
    with limited(memory_limit):
        # A foreign file can only be shown: which column is what is not known.
        if mapping is None and not is_ours(file):
            raise typer.Exit(_show_foreign_file(read_table(file, format=format_), file, trial, write_mapping))
        recording = at_the_hand(load(file, mapping=mapping, format=format_, trial=trial, salvaging=True))
        # One mapping serves for all foreign files of a rig.
        others = {
            other.name: at_the_hand(load(other, mapping=None if is_ours(other) else mapping)) for other in against or []
        }
    raise typer.Exit(_examine_recording(recording, file, model, stiffness, others, directory))


def _show_foreign_file(table: Table, file: Path, trial: str | None, write_mapping: Path | None) -> int:
    """Show the columns, and a mapping to begin with."""
    from hapticeval.files import creating, writing
    from hapticeval.recordings.formats import formats
    from hapticeval.recordings.formats.trials import trial_of, trials, trials_remark
    from hapticeval.recordings.importing.proposal import propose

    several = trials(table) if trial is None else []
    table = table if trial is None else trial_of(table, trial)
    text = propose(table, file=file.name, trial=trial)
    parts = [f"{file}: {formats()[table.format].about if table.format in formats() else table.format}", text]
    parts += [f"remark: {trials_remark(several)}"] if several else []
    # A warning makes the exit code 1, a remark does not.
    parts += [f"remark: {remark}" for remark in table.remarks] + [f"suspicious: {text}" for text in table.warnings]
    if write_mapping is not None:
        with writing(write_mapping), creating(write_mapping) as temporary:
            temporary.write_text(text, encoding="utf-8")
        parts.append(f"wrote {write_mapping}")
    else:
        parts.append(f"To keep it: hapticeval inspect {file.name} --write-mapping mapping.toml")
    say(lines(parts))
    return 1 if table.warnings else 0


def _examine_recording(
    recording: Recording,
    file: Path,
    model: str | None,
    stiffness: float | None,
    others: dict[str, Recording],
    directory: Path,
) -> int:
    """Print what an examination shows, draw it, and return the exit code: 1 where something is suspicious."""
    from hapticeval.recordings.integrity.contacts import impacts
    from hapticeval.recordings.integrity.report import describe_contacts, describe_report, examine, sound_intervals
    from hapticeval.recordings.provenance import spring_of
    from hapticeval.reports.integrity_figure import write_integrity

    # N/m where the force is that of a spring alone; else None, and the damping in words.
    spring, damped = spring_of(recording)
    report = examine(
        recording,
        device=_recorded_robot(recording),
        model=_touched_model(recording, model),
        stiffness=spring if stiffness is None else stiffness,
        others=others,
    )
    report = replace(
        report, checks=(*report.checks, *_impossible_tests(recording, damped if stiffness is None else ""))
    )
    soundness = sound_intervals(recording, report)
    parts = [describe_report(report, soundness, title=file.name)]
    # Impacts on the wall are listed one by one.
    if recording.dimension == 1 and {"wall_force", "force"} & recording.channels.keys():
        parts.append(describe_contacts(impacts(recording)))
    written = write_integrity(directory, recording, report, soundness, title=file.name, stem=_picture_stem(file))
    say(paragraphs(*parts, wrote_lines(written)))
    return int(report.suspicious)


def _picture_stem(file: Path) -> str:
    """The name of the picture: the file's without its ending, where no other file beside it would have the same."""
    neighbours = file.parent.iterdir() if file.parent.is_dir() else ()
    alike = {
        other.name
        for other in neighbours
        if other.stem.casefold() == file.stem.casefold() and other.suffix not in (".toml", ".png", ".svg")
    }
    # Another name is made into a stem from the title.
    plain = re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]*", file.stem)
    return file.stem if plain and alike <= {file.name} else ""


def _recorded_robot(recording: Recording) -> Any:
    """The robot that a recording names, or why there is none."""
    from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3, ParallelogramParameters

    kinds = {"parallelogram-2dof": Parallelogram2, "parallelogram-3dof": Parallelogram3}
    kind = kinds.get(str(recording.meta.get("device")))
    if kind is None:
        return None
    # A recording of a later version may have more parameters.
    known = ParallelogramParameters.__dataclass_fields__
    parameters = recording.meta.get("device_parameters", {})
    return kind(ParallelogramParameters(**{name: value for name, value in parameters.items() if name in known}))


def _touched_model(recording: Recording, name: str | None) -> Any:
    """Return the model that is named, else the one that the recording names; None where neither does."""
    from hapticeval.geometry.catalogue import make_model
    from hapticeval.recordings.provenance import LINE_MODEL, model_of

    if name is not None:
        touched = model_named(name)
        # A hand in one dimension stands before a wall, which is a line of the plane.
        walled = recording.dimension == 1 and touched.name == LINE_MODEL
        if recording.dimension != touched.dimension and not walled:
            raise InputError(
                f"the recording is in {recording.dimension}D, the model '{name}' in {touched.dimension}D",
                why="hand and model must live in the same space",
                todo="give the wall: --model line" if recording.dimension == 1 else "give another model with --model",
            )
        return touched
    recorded_model = model_of(recording)
    return None if recorded_model is None else make_model(**recorded_model)


def _impossible_tests(recording: Recording, damped: str) -> list[ConsistencyTest]:
    """Checks that the recording's own words ask for, and cannot be given."""
    from hapticeval.recordings.integrity.consistency import KINEMATICS_RELATION, SPRING_RELATION, ConsistencyTest

    tests = [ConsistencyTest(SPRING_RELATION, why=damped)] if damped else []
    name = recording.meta.get("device")
    if name is not None and "joint_position" in recording.channels and _recorded_robot(recording) is None:
        why = f"the device '{name}' is none whose kinematics are known"
        tests.append(ConsistencyTest(KINEMATICS_RELATION, why=why))
    return tests


def convert(
    file: Annotated[Path, argument(metavar="FILE", help="A recording, or a foreign file.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The file to write: .h5, .mat, .csv or .npz.")
    ],
    mapping: MappingFile = None,
    format_: FormatName = None,
    trial: TrialName = None,
    memory_limit: MemoryLimit = DEFAULT_LIMIT,
    salvage: Annotated[
        bool, typer.Option("--salvage", help="Of a recording that is cut short or damaged take what is whole.")
    ] = False,
) -> None:
    """Convert a foreign file or a journal to a recording, or a recording to .mat, .csv or .npz.

    Nothing is written over. What the file lacks is shown, and stays in the recording.

    \b
    Examples:
      hapticeval convert log.mat --mapping rig.toml -o run7.h5
      hapticeval convert run7.journal -o run7.h5
      hapticeval convert run7.h5 -o run7.csv
      hapticeval convert cut.h5 --salvage -o whole.h5
    """
    from hapticeval.files import refuse_existing
    from hapticeval.recordings.importing.convert import export
    from hapticeval.recordings.integrity.report import describe_conversion
    from hapticeval.recordings.provenance import incomplete

    refuse_existing(output)
    recording = load_within(memory_limit, file, mapping, format_, trial=trial, salvaging=salvage)
    # What is suspicious is told, and converted all the same.
    export(output, recording)
    say(f"{describe_conversion(recording)}\nwrote {output}")
    raise typer.Exit(int(incomplete(recording)))


VIEW_CODES = """\b
Exit codes:
  0  the page is written, whatever it shows
  2  wrong usage, or the recording cannot be read
"""


def view(
    file: Annotated[Path, argument(metavar="FILE", help="A recording, or a foreign file.")],
    other: Annotated[Path | None, argument(metavar="OTHER", help="Another run on the same model, over it.")] = None,
    model: TouchedModel = None,
    suite_case: SuiteCase = None,
    scene: SceneEntries = None,
    mapping: MappingFile = None,
    format_: FormatName = None,
    memory_limit: MemoryLimit = DEFAULT_LIMIT,
    directory: Annotated[
        Path | None, option("-o", "--output", metavar="DIR", help="Where the page goes: view-FILE.")
    ] = None,
) -> None:
    """Show a recording in a page: the hand and the tool on the model, force and motion against time.

    What the recording says of its scene decides what is judged; without a model or a stiffness it is shown alone. One
    of one dimension is shown before its wall. With a second one both are laid over each other, with the verdicts of
    both. The page needs no network.

    \b
    Examples:
      hapticeval view run7.h5
      hapticeval view run6.h5 run7.h5
      hapticeval view log.mat --mapping rig.toml --scene stiffness=2000
      hapticeval view signal.svc --mapping handwriting.toml --model circle
    """
    from hapticeval.reports.case_page import write_view
    from hapticeval.runner.folder import locked_folder

    files = [file] if other is None else [file, other]
    directory = directory or Path("-".join(["view", *(file_stem(one.stem) for one in files)]))
    recordings = _load_all(files, memory_limit, mapping, format_)
    runs = _viewed_runs(files, recordings, model=model, suite_case=suite_case, scene=scene)
    if other is not None:
        _require_one_model(runs)
        # On one page each goes by its file's name.
        titles = _titles(files)
        title = f"Recordings {' and '.join(titles)}"
        runs = [run.called(name, title=title) for run, name in zip(runs, titles, strict=True)]
    reasons = list(dict.fromkeys(run.unjudged for run in runs if run.unjudged))
    with locked_folder(directory, for_results=False):
        page = write_view(
            directory,
            [run.entry for run in runs],
            {run.entry.renderer: run.recording for run in runs},
            verdicts={run.entry.renderer: run.verdicts for run in runs},
            note=" ".join(reasons),
        )
    suspicions = [f"suspicious: {finding}" for run in runs for finding in run.suspicious]
    say(lines([*suspicions, *reasons, f"wrote {page}"]))


def _load_all(files: Sequence[Path], limit: float, mapping: Path | None, format_: str | None) -> list[Recording]:
    """Return the recordings of files; a mapping and a format are for those that are not ours."""
    from hapticeval.recordings.importing.convert import is_ours

    if len(files) == 1:
        return [load_within(limit, files[0], mapping, format_)]
    return [load_within(limit, file, *((None, None) if is_ours(file) else (mapping, format_))) for file in files]


def _titles(files: Sequence[Path]) -> list[str]:
    """Return what files are called: by their stems, where these tell them apart."""
    stems = [file.stem for file in files]
    return stems if len(set(stems)) == len(stems) else [str(file) for file in files]


def _viewed_runs(
    files: Sequence[Path],
    recordings: Sequence[Recording],
    *,
    model: str | None,
    suite_case: str | None = None,
    scene: Sequence[str] | None,
) -> list[Viewed]:
    """Return runs as they were recorded, judged where model and stiffness are known."""
    from hapticeval.replay.viewing import view_recording

    models = [None if model is None else _touched_model(recording, model) for recording in recordings]
    return [
        view_recording(
            file, recording, suite_case=suite_case, scene=scene or (), model=None if touched is None else touched.table
        )
        for file, recording, touched in zip(files, recordings, models, strict=True)
    ]


def _require_one_model(runs: Sequence[Viewed]) -> None:
    """Raise `InputError` where two runs are not on one model: a page draws both on it."""
    tables = [dict(run.entry.model) for run in runs]
    if tables[0] != tables[1]:
        raise InputError(
            "the two recordings are not on the same model",
            why=f"one page draws both on it; the first names {tables[0]}, the second {tables[1]}",
            todo="name that of both, as in --model circle:size=0.2; or view each by itself",
        )


CHANNEL_WORDS = {"hip": "hand", "ihip": "tool", "force": "force"}
"""What the channels are called."""

COMPARE_CODES = """\b
Exit codes:
  0  compared, however far apart they are
  2  wrong usage or input: the message says what, why, and what to do
"""


def compare(
    first: Annotated[Path, argument(metavar="A", help="A recording, or a foreign file.")],
    second: Annotated[Path, argument(metavar="B", help="Another one.")],
    over: Annotated[
        str, typer.Option("--over", metavar="time|way", help="Over time, or over the way along the surface.")
    ] = "time",
    model: TouchedModel = None,
    scene: SceneEntries = None,
    mapping: MappingFile = None,
    memory_limit: MemoryLimit = DEFAULT_LIMIT,
    output: Annotated[
        Path | None, option("-o", "--output", metavar="FILE", help="Draw both into it: .svg, .pdf or .png.")
    ] = None,
) -> None:
    """Put two recordings side by side: path, force, contact, how far apart they are and where, and their verdicts.

    Over time each counts from its own zero. Over the way along the surface it is the first pass of each, so that hands
    of different speed can be compared. A delay or a gain that explains a difference is named. Verdicts are those of
    replay.

    \b
    Examples:
      hapticeval compare run6.h5 run7.h5
      hapticeval compare run6.h5 run7.h5 --over way -o both.svg
      hapticeval compare a.csv b.csv --mapping rig.toml --model circle:size=0.2 --scene stiffness=1000
    """
    from hapticeval.commands.paper import FIGURE_ENDINGS
    from hapticeval.recordings.overlay import overlay
    from hapticeval.reports.overlay_figure import write_overlay

    if over not in ("time", "way"):
        raise InputError(f"--over {over}", why="it is none of time, way", todo="write --over time or --over way")
    if output is not None and output.suffix not in FIGURE_ENDINGS:
        why = f"a figure is {', '.join(FIGURE_ENDINGS)}"
        raise InputError(f"-o {output}", why=why, todo="name a file with such an ending")
    files = (first, second)
    recordings = _load_all(files, memory_limit, mapping, None)
    laid = overlay(recordings[0], recordings[1], curve=_shared_curve(recordings, model) if over == "way" else None)
    titles = _titles(files)
    draws_hip = "hip" in laid.gaps
    judged = _viewed_runs(files, recordings, model=model, scene=scene) if draws_hip else []
    verdicts = [{verdict.check: verdict for verdict in run.verdicts} for run in judged]
    rows = [
        [check, *(_verdict_words(of_run.get(check)) for of_run in verdicts)]
        for check in dict.fromkeys(check for of_run in verdicts for check in of_run)
        if any(check in of_run and of_run[check].outcome != "not-applicable" for of_run in verdicts)
    ]
    table = WordTable("verdicts", ("verdict", *titles), rows).markdown if rows else ""
    reasons = [f"{run.entry.title}: {run.unjudged}" for run in judged if run.unjudged]
    written = [] if output is None else write_overlay(output, laid, titles)
    say(paragraphs(_overlay_words(laid, titles), table, lines(reasons), wrote_lines(written)))


def _verdict_words(verdict: VerdictEntry | None) -> str:
    """Return the outcome, with the number that decided it."""
    if verdict is None or verdict.metric is None or verdict.metric.value is None:
        return "-" if verdict is None else str(verdict.outcome)
    return f"{verdict.outcome}, {format_quantity(verdict.metric.value, verdict.metric.unit)}"


def _shared_curve(recordings: Sequence[Recording], model: str | None) -> Curve:
    """Return the curve that both follow. Raises `InputError` where none is known, or they do not follow the same."""
    first, second = (_touched_model(recording, model) for recording in recordings)
    dimensions = {recording.dimension for recording in recordings}
    if first is None or second is None or first.table != second.table or {first.dimension, *dimensions} != {2}:
        names = ["no model" if one is None else f"'{one.name}'" for one in (first, second)]
        raise InputError(
            "the two recordings do not follow the same curve of the plane",
            why=f"a way goes along one of them; the first names {names[0]}, the second {names[1]}",
            todo="name that of both, as in --model circle:size=0.2; or compare over time",
        )
    curve: Curve = first.curve
    return curve


def _overlay_words(laid: Overlay, titles: Sequence[str]) -> str:
    """Return a table of what is apart, in mm and N, and sentences on delay, gain and contact."""
    compared = laid.along[laid.rows]
    scale, unit = (1e3, "mm") if laid.on_surface else (1.0, "s")
    span = f"{scale * compared[0]:.4g} to {scale * compared[-1]:.4g} {unit}{' of way' * laid.on_surface}"
    rows, sentences = [], []
    for name, gap in laid.gaps.items():
        of = "N" if name == "force" else "m"
        sizes = [format_quantity(size, of) for size in (gap.rms, gap.largest)]
        hand = "-" if gap.hip is None else ", ".join(f"{1e3 * place:.4g}" for place in gap.hip)
        rows.append([CHANNEL_WORDS[name], *sizes, f"{scale * gap.place:.4g} {unit}", hand])
        late = "" if gap.delay is None else f"{1e3 * abs(gap.delay):.4g} ms {'late' if gap.delay > 0.0 else 'early'}"
        causes = [late, "" if gap.gain is None else f"{gap.gain:.4g} times as large"]
        if any(causes):
            left = f"{format_quantity(gap.left, of)} rms is left"
            sentences.append(f"{CHANNEL_WORDS[name]}: {titles[1]} is {' and '.join(filter(None, causes))}; {left}")
    if laid.touches is not None:
        share = ((laid.touches[0] != laid.touches[1])[laid.rows]).mean()
        sentences.append(f"contact: one touches where the other does not in {100.0 * share:.3g} % of the rows")
    table = WordTable("apart", ("apart", "rms", "largest", "at", "hand (mm)"), rows)
    return paragraphs(
        f"{titles[1]} against {titles[0]}: {compared.size} rows, {span}", table.markdown, lines(sentences)
    )
