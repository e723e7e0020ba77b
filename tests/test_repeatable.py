"""Hypothesis draws the same examples in every run of the tests, whatever ran before."""

from __future__ import annotations

import sys
from types import ModuleType

import hypothesis
from hypothesis import given, settings
from hypothesis import strategies as st


def drawn() -> list[tuple[int, float]]:
    """What a property is given, in the order in which it is."""
    found = []

    @settings(max_examples=500)
    @given(st.integers(-(2**40), 2**40), st.floats(-1e9, 1e9))
    def notes(number, real):
        found.append((number, real))

    notes()
    return found


def test_the_examples_are_the_same_each_time_whatever_modules_are_loaded(tmp_path, monkeypatch):
    before = drawn()
    (tmp_path / "mine.py").write_text("HERE = 123456789, 0.123456789\n" * 3)
    module = ModuleType("mine")
    module.__file__ = str(tmp_path / "mine.py")
    monkeypatch.setitem(sys.modules, "mine", module)
    assert len(before) == 500
    assert drawn() == before, (
        f"hypothesis {hypothesis.__version__} draws numbers from the modules that are loaded, "
        "and tests/conftest.py does not keep it from that any more: replace what asks for them there"
    )
