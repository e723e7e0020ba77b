"""Arguments that several commands take, and what their text means."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from hapticeval.errors import InputError, UnknownNameError, at

if TYPE_CHECKING:
    from hapticeval.geometry.model import Model
    from hapticeval.recordings.recording import Recording
    from hapticeval.types import Array


class SectionedCommand(TyperCommand):
    """A command whose help has a section for each `rich_help_panel` of its options, and one for its exit codes."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write them in the order in which the command has them."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            help_record = parameter.get_help_record(ctx)
            if help_record is not None:
                name, text = help_record
                if isinstance(parameter, TyperOption):
                    sections.setdefault(getattr(parameter, "rich_help_panel", None) or "Options", []).append(
                        help_record
                    )
                else:  # some versions of typer append a Python type
                    sections.setdefault("Arguments", []).append((name.partition(" <")[0], text))
        # False sorts first: arguments and plain options, then the panels in their order.
        for title, rows in sorted(sections.items(), key=lambda section: section[0] not in ("Arguments", "Options")):
            with formatter.section(title):
                formatter.write_dl(rows)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 - click's
        """Write the exit codes as a section, with their words beside them."""
        title, _, body = (self.epilog or "").removeprefix("\b\n").partition(":\n")
        # A digit after two blanks begins a code; lines that are indented more go on with its words.
        codes = re.findall(r"^  (\d)  (.*(?:\n     .*)*)", body, re.MULTILINE)
        with formatter.section(title):
            formatter.write_dl([(code, " ".join(text.split())) for code, text in codes])


class SectionedGroup(TyperGroup):
    """A group of commands whose help has a section for each `rich_help_panel` of them, in the order of the commands."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 - click's
        """Write a section for each panel."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for name, command in self.commands.items():
            panel = getattr(command, "rich_help_panel", None)
            title = panel if isinstance(panel, str) else "Commands"
            panels.setdefault(title, []).append((name, command.get_short_help_str(formatter.width)))
        for title, rows in panels.items():
            with formatter.section(title):
                formatter.write_dl(rows)


option = partial(typer.Option, show_default=False)
argument = partial(typer.Argument, show_default=False)

ModelName = Annotated[
    str,
    argument(
        metavar="MODEL",
        help="A model of the catalogue, as in star or star:points=6,tip_angle=40, or a WKT or GeoJSON file.",
    ),
]

MappingFile = Annotated[
    Path | None,
    option("--mapping", metavar="TOML", help="For a file that is not a recording of ours: which column is what."),
]
MemoryLimit = Annotated[
    float, typer.Option("--memory-limit", metavar="GB", help="Refuse a file whose numbers would take more.", min=0.0)
]

Folder = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where picture and numbers go.")]


def renderers_option(default_words: str) -> Any:
    """Return the option `-r`, whose help says what is done without it."""
    return option(
        "-r",
        "--renderer",
        metavar="NAME",
        help="A renderer: package.module:factory; a name of `hapticeval list renderers`, NAME[+SCHEME]"
        f"[@REPRESENTATION]; lib:PATH, a C library; cmd:COMMAND, a process. May be repeated. "
        f"Without it: {default_words}.",
    )


Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Seed of everything random.", min=0, max=2**32 - 1)]

Verbose = Annotated[
    bool,
    option(
        "-v", "--verbose", help="Show warnings, known failures and what does not apply, too, and each run as it ends."
    ),
]

Scheduler = Annotated[
    str | None,
    option(
        "--scheduler",
        metavar="ADDRESS",
        help="Let the workers of a dask scheduler do it, as of tcp://10.0.0.1:8786; see docs/scale.md.",
        rich_help_panel="Long runs",
    ),
]

Timeout = Annotated[
    float,
    typer.Option(
        "--timeout",
        metavar="SECONDS",
        help="End a renderer that takes longer in a case: it hangs.",
        min=0.1,
        rich_help_panel="Long runs",
    ),
]

TrialName = Annotated[
    str | None,
    option("--trial", metavar="NAME", help="Which of several trials in the file: its name, or its number from 0."),
]

FormatName = Annotated[
    str | None,
    option(
        "--format",
        metavar="NAME",
        help="Its format, where it cannot be recognised: a name, or module:function of an importer of yours.",
    ),
]


TouchedModel = Annotated[
    str | None,
    option(
        "--model",
        metavar="MODEL",
        help="What was touched, as in star:points=6, or a WKT or GeoJSON file, where the recording does not say.",
    ),
]

SuiteCase = Annotated[
    str | None, option("--suite-case", metavar="SUITE/CASE", help="Take model, scene and checks from a case.")
]

SceneEntries = Annotated[
    list[str] | None,
    option(
        "--scene",
        metavar="KEY=VALUE",
        help="An entry of the scene, such as stiffness=1000, in SI units; may be repeated.",
    ),
]


def load_within(
    memory_limit: float,
    file: Path,
    mapping: Path | None,
    format_: str | None,
    *,
    trial: str | None = None,
    salvaging: bool = False,
) -> Recording:
    """Read a recording or a foreign file by the options above; see `load`, `at_the_hand` and `recordings.memory`."""
    from hapticeval.hardware.wiring import at_the_hand
    from hapticeval.recordings.importing.convert import load
    from hapticeval.recordings.memory import limited

    with limited(memory_limit):
        return at_the_hand(load(file, mapping=mapping, format=format_, trial=trial, salvaging=salvaging))


def model_named(text: str) -> Model:
    """Make a model from `kind`, `kind:name=value,...`, or the name of a WKT or GeoJSON file.

    The values are numbers; those of `mesh:file=part.stl,unit=mm` are text.

    Raises `UnknownNameError` for an unknown kind that is not a file either, `InputError` for values that are not
    numbers, and as the catalogue does.
    """
    from hapticeval.geometry.catalogue import KINDS_FROM_USER, MODELS, from_geojson, from_wkt, make_model
    from hapticeval.geometry.mesh_input import FILE_ENDINGS

    file = Path(text)
    kind, _, entries = text.partition(":")
    # The number of a length in a mesh file may be mm, inches or m.
    if file.suffix.lower() in FILE_ENDINGS and kind != "mesh":
        raise InputError(
            f"the mesh file {file} has no unit", why="the format has none", todo=f"write mesh:file={file},unit=mm"
        )
    if kind == "mesh":
        # Values stay text; of (name, "=", value) the first and the last.
        return make_model(kind, **dict(part.partition("=")[::2] for part in entries.split(",")))
    try:
        is_file = file.is_file()
    except OSError:  # longer than any file's name, as a document is that was given in place of its file
        is_file = False
    # An ending alone says that a file is meant, so that a missing one is reported as such.
    if file.suffix in (".wkt", ".geojson", ".json") or is_file:
        try:
            content = file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise InputError(f"cannot read the model file {file}", why=why, todo="check the path") from error
        with at(str(file)):
            return (from_wkt if file.suffix == ".wkt" else from_geojson)(content, name=file.stem)
    drawable = {name for name in MODELS if name not in KINDS_FROM_USER}
    if kind not in drawable:
        raise UnknownNameError("model", kind, drawable)
    parameters: dict[str, float] = {}
    for part in entries.split(",") if entries else []:
        name, equals, value = part.partition("=")
        try:
            parameters[name.strip()] = float(value)
        except ValueError:
            # Reported below, as an entry without "=" is.
            equals = ""
        if not equals:
            raise InputError(
                f"model '{text}': '{part}' is not name=number", todo="write for instance star:points=6,tip_angle=40"
            )
    return make_model(kind, **parameters)


def model_title(text: str) -> str:
    """Return what a model is called in titles: a file by its stem, another as it was written."""
    return Path(text).stem if Path(text).is_file() else text


def parse_point(text: str, dimension: int, *, option: str) -> Array:
    """Return the point (`dimension`,), m, of `0.05,-0.02`. Raises `InputError`, naming the option, otherwise."""
    import numpy as np

    try:
        point = np.array([float(part) for part in text.split(",")])
    except ValueError:
        # No point has this shape: reported below.
        point = np.empty(0)
    if point.shape != (dimension,) or not np.isfinite(point).all():
        example = ",".join(("0.05", "-0.02", "0.01")[:dimension])
        raise InputError(
            f"{option} {text}", why=f"it is not {dimension} finite numbers", todo=f"write metres: {option} {example}"
        )
    return point


def parse_knobs(options: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Return the values by knob of `vertices=40,80,160` or `cell=1mm,0.5mm`. Raises `InputError` for anything else."""
    chosen: dict[str, tuple[float, ...]] = {}
    for option in options:
        knob, equals, text = option.partition("=")
        try:
            values = tuple(_number_or_length(part) for part in text.split(","))
        except (ValueError, InputError):
            # Reported below with the other mistakes.
            values = ()
        if not knob or not equals or not values or not all(0.0 < value < float("inf") for value in values):
            raise InputError(
                f"--knob {option}",
                why="it is a knob's name, '=' and positive numbers with commas between",
                todo="for instance --knob vertices=40,80,160",
            )
        chosen[knob.strip()] = values
    return chosen


def _number_or_length(text: str) -> float:
    """Return a plain number, or the metres of a length with its unit."""
    from hapticeval.quantity import parse_length

    try:
        return float(text)
    except ValueError:
        return parse_length(text, option="--knob")
