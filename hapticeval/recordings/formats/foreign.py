"""Importers of other people: loaded by name, run, and held to what a `Table` means; every error says where it is."""

from __future__ import annotations

import inspect
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path, PurePath
from typing import Any

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.formats.table import Table
from hapticeval.recordings.units import parse_unit


def load(name: str) -> Callable[[Path], Table]:
    """The function that `package.module:function` names; the current directory is looked in too.

    Raises `InputError` where it cannot be imported, for whatever reason, and where it cannot be called.
    """
    module, _, function = name.partition(":")
    if not module or not function:
        raise InputError(f"'{name}' does not name an importer", todo="name it package.module:function")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        read = getattr(import_module(module), function)
    except (Exception, SystemExit) as error:
        place = _place(error)
        raise InputError(
            f"cannot load the format '{name}'",
            why=f"{type(error).__name__}: {error}" + (f" ({place})" if place else ""),
            todo=f"see that `python -c 'from {module} import {function}'` works",
        ) from error
    if not callable(read):
        raise InputError(
            f"cannot load the format '{name}'",
            why=f"it is of type {type(read).__name__}",
            todo="name a function that takes a path and gives a Table",
        )
    return read  # type: ignore[no-any-return]


def run(read: Callable[[Path], Table], path: Path) -> Table:
    """What an importer gives of a file, whole and sound.

    Raises `InputError`, naming the importer and the line in its own file, for whatever it raises; and for what is no
    `Table`, a column that no other fits, and units and notes of columns that are not there or are no units.
    """
    name = called(read)
    with telling(f"the importer {name}", read):
        try:
            table = read(path)
        except OSError as error:
            if str(error.filename) != str(path):
                raise
            raise InputError(f"cannot read {path}", why=error.strerror or str(error), todo="check the path") from error
    if not isinstance(table, Table):
        given = "None" if table is None else f"a {type(table).__name__}"
        raise InputError(
            f"the importer {name} gave {given}",
            why="it must give a hapticeval.recordings.formats.Table",
            todo='end it with for instance: return Table({"t": times, "x": positions}, units={"t": "ms"})',
        )
    _check(table, name)
    return table


def called(read: Any) -> str:
    """A function by its module and name, as `--format` takes it."""
    name = getattr(read, "__qualname__", type(read).__qualname__)
    return f"{getattr(read, '__module__', type(read).__module__)}:{name}"


@contextmanager
def telling(what: str, function: Any) -> Iterator[None]:
    """Have all that is raised in the block become an `InputError` that says so of `what`, and where in `function`."""
    try:
        yield
    except HapticevalError as error:
        why = "; ".join(filter(None, (error.why, _place(error, function))))
        raise InputError(f"{what}: {error.what}", why=why, todo=error.todo) from error
    except (Exception, SystemExit) as error:
        raise InputError(
            f"{what} raised {type(error).__name__}: {error}", why=_place(error, function), todo="mend it there"
        ) from error


def _place(error: BaseException, function: Any = None) -> str:
    """Where an error came from: the innermost line in the file of `function`, else the innermost of all."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename != __file__ and "importlib" not in frame.filename
    ]
    code = getattr(inspect.unwrap(function), "__code__", None) if callable(function) else None
    own = [frame for frame in frames if code is not None and frame.filename == code.co_filename]
    if not frames:
        return ""
    last = (own or frames)[-1]
    return f"in {PurePath(last.filename).name}, line {last.lineno}, in {last.name}: {last.line}"


def _check(table: Table, name: str) -> None:
    """Raise `InputError` for what is no name, no unit or no row, and for columns that fit no other."""
    for column in table.columns:
        if not isinstance(column, str):
            raise InputError(f"the importer {name} named a column {column!r}", why="a name is a text")
    if table.columns and not any(map(table.rows, table.columns)):
        raise InputError(f"the importer {name} gave no row", why="a recording has at least one")
    _check_lengths(table, name)
    for kind, told in (("a unit", table.units), ("a note", table.notes)):
        for column in told:
            if column not in table.columns:
                raise InputError(
                    f"the importer {name} gave {kind} of the column '{column}', which is not there",
                    why=f"its columns are: {', '.join(table.columns)}",
                    todo="see the name",
                )
    for column, unit in table.units.items():
        try:
            parse_unit(unit if isinstance(unit, str) else str(unit))
        except InputError as error:
            raise InputError(
                f"the importer {name} gave the column '{column}' an {error.what}"
                if error.what.startswith("unknown")
                else f"the importer {name}: of the column '{column}' {error.what}",
                why=error.why,
                todo='write it in SI units and their parts, as in mm, deg/s, N m or "25.4 mm"; '
                "or leave it out, and the mapping says what it is",
            ) from error


def _check_lengths(table: Table, name: str) -> None:
    """Every column must have another of its length: a signal its clock, and a clock its signal."""
    rows = {column: table.rows(column) for column in table.columns}
    counts = Counter(rows.values())
    most = max(counts, key=lambda size: counts[size], default=0)
    alone = [column for column, size in rows.items() if counts[size] == 1]
    if len(rows) > 1 and alone:
        column = next((each for each in alone if rows[each] != most), alone[-1])
        others = sorted(size for size in counts if size != rows[column])
        raise InputError(
            f"the importer {name} gave a column '{column}' of {rows[column]} rows that no other column fits",
            why=f"the others have {', '.join(map(str, others))} rows, and nothing tells which of them are its",
            todo="give a number in each row, nan where there is none; of signals on several clocks give each its clock",
        )
