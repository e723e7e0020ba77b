"""`hapticeval inspect`: what a file holds, and whether it can be trusted."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticeval.commands.arguments import FormatName, MappingFile, MemoryLimit
from hapticeval.commands.output import say
from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.memory import LIMIT

if TYPE_CHECKING:
    from hapticeval.recordings.formats import Table
    from hapticeval.recordings.integrity.consistency import Check
    from hapticeval.recordings.recording import Recording

EXIT_CODES = """\b
Exit codes:
  0  sound, as far as can be told
  1  something is suspicious, or rows are missing
  2  wrong usage, or unreadable
"""


def inspect(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording, or a foreign file.", show_default=False)],
    mapping: MappingFile = None,
    write_mapping: Annotated[
        Path | None,
        typer.Option("--write-mapping", metavar="TOML", help="Write the proposed mapping here.", show_default=False),
    ] = None,
    format_: FormatName = None,
    memory_limit: MemoryLimit = LIMIT,
    model: Annotated[
        str | None,
        typer.Option("--model", metavar="MODEL", help="What was touched, as in circle:size=0.2.", show_default=False),
    ] = None,
    stiffness: Annotated[
        float | None,
        typer.Option("--stiffness", metavar="N/M", help="K_p, where K_d is zero.", show_default=False),
    ] = None,
    against: Annotated[
        list[Path] | None,
        typer.Option("--against", metavar="FILE", help="Another recording: is a signal copied?", show_default=False),
    ] = None,
    directory: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where the picture goes.")] = Path(),
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
    from hapticeval.hardware.logs import load
    from hapticeval.recordings.formats import read_table
    from hapticeval.recordings.importing.convert import is_ours
    from hapticeval.recordings.memory import limited

    with limited(memory_limit):
        if mapping is None and not is_ours(file):
            raise typer.Exit(_foreign(read_table(file, format=format_), file, write_mapping))
        recording = load(file, mapping=mapping, format=format_, salvaging=True)
        others = {other.name: load(other, mapping=None if is_ours(other) else mapping) for other in against or []}
    raise typer.Exit(_examined(recording, file, model, stiffness, others, directory))


def _foreign(table: Table, file: Path, write_mapping: Path | None) -> int:
    """Show the columns, and a mapping to begin with."""
    from hapticeval.files import creating
    from hapticeval.recordings.formats import formats
    from hapticeval.recordings.importing.mapping import propose

    text = propose(table, file=file.name)
    parts = [f"{file}: {formats()[table.format].about if table.format in formats() else table.format}", text]
    parts += [f"remark: {remark}" for remark in table.remarks] + [f"suspicious: {text}" for text in table.warnings]
    if write_mapping is not None:
        try:
            with creating(write_mapping) as temporary:
                temporary.write_text(text, encoding="utf-8")
        except OSError as error:
            raise HapticevalError(f"cannot write {write_mapping}", why=error.strerror or str(error)) from error
        parts.append(f"wrote {write_mapping}")
    else:
        parts.append(f"To keep it: hapticeval inspect {file.name} --write-mapping mapping.toml")
    say("\n".join(parts))
    return 1 if table.warnings else 0


def _examined(
    recording: Recording,
    file: Path,
    model: str | None,
    stiffness: float | None,
    others: dict[str, Recording],
    directory: Path,
) -> int:
    from hapticeval.recordings.integrity.contacts import impacts
    from hapticeval.recordings.integrity.report import contacts, examine, sound_intervals, summary
    from hapticeval.recordings.provenance import spring_of
    from hapticeval.reports.integrity_figure import write_integrity

    told, damped = spring_of(recording)
    report = examine(
        recording,
        device=_device(recording),
        model=_model(recording, model),
        stiffness=told if stiffness is None else stiffness,
        others=others,
    )
    report = replace(report, checks=(*report.checks, *_not_asked(recording, damped if stiffness is None else "")))
    soundness = sound_intervals(recording, report)
    parts = [summary(report, soundness, title=file.name)]
    if recording.dimension == 1 and {"wall_force", "force"} & recording.channels.keys():
        parts.append(contacts(impacts(recording)))
    written = write_integrity(directory, recording, report, soundness, title=file.name, stem=_stem(file))
    say("\n\n".join([*parts, "\n".join(f"wrote {path}" for path in written)]))
    return int(report.suspicious)


def _stem(file: Path) -> str:
    """The name of the picture: the file's without its ending, where no other file beside it would have the same."""
    beside = file.parent.iterdir() if file.parent.is_dir() else ()
    alike = {
        other.name
        for other in beside
        if other.stem.casefold() == file.stem.casefold() and other.suffix not in (".toml", ".png", ".svg")
    }
    plain = re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]*", file.stem)
    return file.stem if plain and alike <= {file.name} else ""


def _device(recording: Recording) -> Any:
    """The robot that a recording names, or why there is none."""
    from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3, ParallelogramParameters

    kinds = {"parallelogram-2dof": Parallelogram2, "parallelogram-3dof": Parallelogram3}
    kind = kinds.get(str(recording.meta.get("device")))
    if kind is None:
        return None
    known = ParallelogramParameters.__dataclass_fields__
    said = recording.meta.get("device_parameters", {})
    return kind(ParallelogramParameters(**{name: value for name, value in said.items() if name in known}))


def _model(recording: Recording, name: str | None) -> Any:
    from hapticeval.commands.arguments import model_named
    from hapticeval.geometry.catalogue import make_model
    from hapticeval.recordings.provenance import LINE, model_of

    if name is not None:
        made = model_named(name)
        walled = recording.dimension == 1 and made.name == LINE
        if recording.dimension != made.dimension and not walled:
            raise InputError(
                f"the recording is in {recording.dimension}D, the model '{name}' in {made.dimension}D",
                why="hand and model must live in the same space",
                todo="give the wall: --model line" if recording.dimension == 1 else "give another model with --model",
            )
        return made
    said = model_of(recording)
    return None if said is None else make_model(**said)


def _not_asked(recording: Recording, damped: str) -> list[Check]:
    """Checks that the recording's own words ask for, and cannot be given."""
    from hapticeval.recordings.integrity.consistency import KINEMATICS, SPRING, Check

    found = [Check(SPRING, why=damped)] if damped else []
    name = recording.meta.get("device")
    if name is not None and "joint_position" in recording.channels and _device(recording) is None:
        why = f"the device '{name}' is none whose kinematics are known"
        found.append(Check(KINEMATICS, why=why))
    return found
