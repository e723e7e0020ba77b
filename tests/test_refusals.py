"""The list of refusals: each row is of a test that is there, and a text that changed is seen."""

from __future__ import annotations

from pathlib import Path

import pytest
import refusals

from hapticeval.errors import InputError


def test_each_row_is_of_a_test_that_is_there():
    folder = Path(__file__).parent
    for test, _ in refusals.read_table(refusals.TABLE):
        file, _, name = test.partition("::")
        assert f"def {name.split('[')[0].split('::')[-1]}(" in (folder / file).read_text(encoding="utf-8"), test


def test_a_text_that_changed_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(refusals, "TABLE", tmp_path / "refusals.csv")
    refusals.write_texts("a.py::test", ["the size is -1 / why: it must be positive"])
    for size, same in ((-1, True), (-2, False)):
        told = refusals.Refusals("a.py::test", {})
        with told(InputError):
            raise InputError(f"the size is {size}", why="it must be positive")
        if same:
            told.compare()
        else:
            with pytest.raises(AssertionError, match="make tables"):
                told.compare()


def test_a_folder_of_the_test_does_not_show(tmp_path):
    told = refusals.Refusals("a.py::test", {"FOLDER": tmp_path, "TEMPORARY": tmp_path.parent})
    with told(InputError):
        raise InputError(f"no file {tmp_path}/a.stl, nor {tmp_path.parent}/shared17/b.stl")
    assert told.texts == ["no file FOLDER/a.stl, nor TEMPORARY/shared/b.stl"]


def test_the_line_that_raised_does_not_show():
    told = refusals.Refusals("a.py::test", {})
    with told(InputError):
        raise InputError("the step() raised", why='in test_a.py, line 79, in step: raise KeyError("a.py, line 3")')
    assert told.texts == ['the step() raised / why: in test_a.py, line LINE, in step: raise KeyError("a.py, line 3")']
