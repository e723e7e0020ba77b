"""Importers of other people that break, or give what is no table: each error says which, what and where."""

from __future__ import annotations

import sys
from importlib import import_module

import pytest

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.recordings import formats as registry_module
from hapticeval.recordings.formats import formats, read_table

MINE = """
import json
import numpy as np
from hapticeval.errors import HapticevalError
from hapticeval.recordings.formats import Table, importer

COLUMNS = {"t": [0, 1, 2], "x": [1.0, 2.0, 3.0]}

def good(path): return Table(COLUMNS, units={"t": "ms", "x": "25.4 mm"}, notes={"x": "of the stick"})
def raises(path): return Table({"t": [float(line) for line in path.read_text().split()]})
def deep(path): return json.loads(path.read_text())
def leaves(path): raise SystemExit(3)
def refuses(path): raise HapticevalError("version 7 is too new", why="it has frames", todo="save it as version 6")
def elsewhere(path): return open("calibration.cfg")
def none(path): return None
def columns(path): return COLUMNS
def texts(path): return Table({"t": ["a"]})
def numbers(path): return Table({1: [0, 1]})
def rowless(path): return Table({"t": [], "x": []})
def unequal(path): return Table({"t": [0, 1, 2], "x": [1.0, 2.0]})
def longer(path): return Table({**COLUMNS, "y": [1.0, 2.0, 3.0, 4.0]})
def clocks(path): return Table({**COLUMNS, "s": [0, 2], "f": [1.0, 2.0]})
def stranger(path): return Table(COLUMNS, units={"y": "mm"})
def noted(path): return Table(COLUMNS, notes={"y": "of the stick"})
def furlong(path): return Table(COLUMNS, units={"x": "furlong"})
def unitless(path): return Table(COLUMNS, units={"x": ""})
number = 7

def peeks(head): return head[99]
"""


def line_of(text):
    return next(k for k, line in enumerate(MINE.splitlines(), start=1) if text in line)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    formats()  # those of ours are known before what is known is put back
    monkeypatch.setattr(registry_module, "KNOWN", dict(registry_module.KNOWN))
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "stick.py").write_text(MINE)
    (tmp_path / "run.acme").write_text("0 one\n")
    yield tmp_path
    for module in ("stick", "broken"):
        sys.modules.pop(module, None)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("raises", "the importer stick:raises raised ValueError: could not convert string to float: 'one'"),
        ("deep", "the importer stick:deep raised JSONDecodeError"),
        ("leaves", "the importer stick:leaves raised SystemExit: 3"),
        ("elsewhere", "the importer stick:elsewhere raised FileNotFoundError"),
        ("texts", "the importer stick:texts: column 't' is of shape (1,)"),
        ("refuses", "the importer stick:refuses: version 7 is too new\n  why: it has frames; "),
    ],
)
def test_what_an_importer_raises_is_told_with_its_line(here, capsys, name, words):
    """The line of the importer's own file, not that of a library which it called."""
    assert main(["inspect", "run.acme", "--format", f"stick:{name}"]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert f"in stick.py, line {line_of(f'def {name}(')}, in " in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("none", "the importer stick:none gave None"),
        ("columns", "the importer stick:columns gave a dict"),
        ("numbers", "the importer stick:numbers named a column 1"),
        ("rowless", "the importer stick:rowless gave no row"),
        ("unequal", "the importer stick:unequal gave a column 'x' of 2 rows that no other column fits"),
        ("longer", "the importer stick:longer gave a column 'y' of 4 rows that no other column fits"),
        ("stranger", "the importer stick:stranger gave a unit or a note of the column 'y', which is not there"),
        ("noted", "the importer stick:noted gave a unit or a note of the column 'y', which is not there"),
        ("furlong", "the importer stick:furlong, unit of the column 'x': unknown unit 'furlong'"),
        ("unitless", "the importer stick:unitless, unit of the column 'x': a unit is missing"),
    ],
)
def test_what_is_no_table_is_refused(here, name, words):
    with pytest.raises(InputError) as caught:
        read_table("run.acme", format=f"stick:{name}")
    assert caught.value.what.startswith(words)


def test_what_is_a_table_is_taken(here):
    assert dict(read_table("run.acme", format="stick:good").units) == {"t": "ms", "x": "25.4 mm"}
    assert set(read_table("run.acme", format="stick:clocks").columns) == {"t", "x", "s", "f"}
    with pytest.raises(InputError, match=r"cannot read gone\.acme"):  # which is no fault of the importer
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
def test_what_cannot_be_loaded_says_why(here, capsys, name, words):
    (here / "broken.py").write_text("\nx = 1 / 0\n")
    assert main(["inspect", "run.acme", "--format", name]) == 2
    assert words in capsys.readouterr().err


def test_what_recognises_a_format_may_break_too(here, monkeypatch):
    monkeypatch.syspath_prepend(str(here))
    stick = import_module("stick")
    registry_module.importer("sticks", about="a stick's log", recognises=stick.peeks)(stick.good)
    with pytest.raises(InputError, match=r"what recognises the format 'sticks' raised IndexError") as caught:
        read_table("run.acme")
    assert f"in stick.py, line {line_of('def peeks(')}" in caught.value.why
