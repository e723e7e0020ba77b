"""Importers of other people that break, or give what is no table: each error names which, what and where."""

import sys
from importlib import import_module

import pytest

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.recordings import formats as registry
from hapticeval.recordings.formats import formats, read_table

RAISING = {
    "raises": ('Table({"t": [float(line) for line in path.read_text().split()]})', " raised ValueError: could not con"),
    "deep": ("json.loads(path.read_text())", " raised JSONDecodeError"),
    "leaves": ("sys.exit(3)", " raised SystemExit: 3"),
    "elsewhere": ('open("calibration.cfg")', " raised FileNotFoundError"),
    "texts": ('Table({"t": ["a"]})', ": column 't' is of shape (1,)"),
    "refuses": ('refuse("version 7 is too new", "it has frames")', ": version 7 is too new\n  why: it has frames; "),
}
UNSOUND = {
    "none": ("None", " gave None"),
    "columns": ("COLUMNS", " gave a dict"),
    "numbers": ("Table({1: [0, 1]})", " named a column 1"),
    "rowless": ('Table({"t": [], "x": []})', " gave no row"),
    "unequal": ('Table({"t": [0, 1, 2], "x": [1.0, 2.0]})', " gave a column 'x' of 2 rows that no other column fits"),
    "longer": (
        'Table({**COLUMNS, "y": [1.0, 2.0, 3.0, 4.0]})',
        " gave a column 'y' of 4 rows that no other",
    ),
    "stranger": ('Table(COLUMNS, units={"y": "mm"})', " gave a unit or a note of the column 'y', which is not there"),
    "noted": ('Table(COLUMNS, notes={"y": "stick"})', " gave a unit or a note of the column 'y', which is not there"),
    "furlong": ('Table(COLUMNS, units={"x": "furlong"})', ", unit of the column 'x': unknown unit 'furlong'"),
    "unitless": ('Table(COLUMNS, units={"x": ""})', ", unit of the column 'x': a unit is missing"),
}
MINE = """
import json, sys
from hapticeval.errors import HapticevalError
from hapticeval.recordings.formats import Table
COLUMNS = {"t": [0, 1, 2], "x": [1.0, 2.0, 3.0]}
number = 7
def refuse(what, why): raise HapticevalError(what, why=why)
def good(path): return Table(COLUMNS, units={"t": "ms", "x": "25.4 mm"}, notes={"x": "of the stick"})
def clocks(path): return Table({**COLUMNS, "s": [0, 2], "f": [1.0, 2.0]})
def peeks(head): return head[99]
"""
MINE += "".join(f"def {name}(path): return {body}\n" for name, (body, _) in {**RAISING, **UNSOUND}.items())


def line_of(function):
    return next(k for k, line in enumerate(MINE.splitlines(), start=1) if line.startswith(f"def {function}("))


@pytest.fixture
def here(here, monkeypatch):
    formats()  # those of ours are known before what is known is put back
    monkeypatch.setattr(registry, "REGISTERED", dict(registry.REGISTERED))
    monkeypatch.setattr(sys, "path", list(sys.path))
    (here / "stick.py").write_text(MINE)
    (here / "run.acme").write_text("0 one\n")
    yield here
    for module in ("stick", "broken"):
        sys.modules.pop(module, None)


@pytest.mark.parametrize("name", RAISING)
def test_what_an_importer_raises_is_reported_with_its_line(here, capsys, name):
    """The innermost line of the importer's own file, not that of a library which it called."""
    assert main(["inspect", "run.acme", "--format", f"stick:{name}"]) == 2
    shown = capsys.readouterr().err
    assert f"the importer stick:{name}{RAISING[name][1]}" in shown
    assert f"in stick.py, line {line_of('refuse' if name == 'refuses' else name)}, in " in shown
    assert "Traceback" not in shown


@pytest.mark.parametrize("name", UNSOUND)
def test_what_is_no_table_is_refused(here, name):
    with pytest.raises(InputError) as caught:
        read_table("run.acme", format=f"stick:{name}")
    assert caught.value.what.startswith(f"the importer stick:{name}{UNSOUND[name][1]}")


def test_what_is_a_table_is_taken(refused, here):
    assert dict(read_table("run.acme", format="stick:good").units) == {"t": "ms", "x": "25.4 mm"}
    assert set(read_table("run.acme", format="stick:clocks").columns) == {"t", "x", "s", "f"}
    with refused(InputError):  # which is no fault of the importer
        read_table("gone.acme", format="stick:raises")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("stick:nothing", "has no attribute 'nothing'"),
        ("stick:number", "is of type int"),
        ("stick:", "does not name an importer"),
        ("broken:read", "ZeroDivisionError: division by zero\n  why: in broken.py, line 2"),
    ],
)
def test_what_cannot_be_loaded_is_refused(here, capsys, name, words):
    (here / "broken.py").write_text("\nx = 1 / 0\n")
    assert main(["inspect", "run.acme", "--format", name]) == 2
    assert words in capsys.readouterr().err


def test_what_recognises_a_format_may_break_too(refused, here, monkeypatch):
    monkeypatch.syspath_prepend(str(here))
    stick = import_module("stick")
    registry.importer("sticks", about="a stick's log", recognises=stick.peeks)(stick.good)
    with refused(InputError) as caught:
        read_table("run.acme")
    assert f"in stick.py, line {line_of('peeks')}" in caught.value.why
