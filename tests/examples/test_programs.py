"""The programs of `examples/studies`: the help of each has an example that runs it, and its exit codes."""

from __future__ import annotations

import re
from importlib import import_module

import pytest

PROGRAMS = ["flow", "device", "texture", "plates", "rates", "integrators"]


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_help_of_a_program_has_an_example_and_its_exit_codes(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    module = import_module(f"hapticeval.examples.studies.{name}")
    assert module.main(["--help"]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"Usage: python -m hapticeval.examples.studies.{name} ")
    assert f"  python -m hapticeval.examples.studies.{name}" in out.split("Example", 1)[1]
    assert re.findall(r"^  (\d)  \w", out.split("\nExit codes:\n", 1)[1], re.MULTILINE)[0] == "0"


def test_what_a_user_got_wrong_is_shown_without_a_traceback(capsys):
    from hapticeval.examples.studies.texture import main

    assert main(["no-such-texture"]) == 2
    assert capsys.readouterr().err.startswith("error: ")
