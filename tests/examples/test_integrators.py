"""The integrators' study: what it holds, what is drawn of it, and the program."""

from __future__ import annotations

import json
from functools import partial

import pytest

from hapticeval.devices.integration import STEP_TOLERANCE
from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.errors import HapticevalError
from hapticeval.examples.studies import integrators
from hapticeval.examples.studies.integrators import DEFAULT, LOOKS, METHODS, write_precision


@pytest.fixture(scope="module")
def document():
    return integrators.study_integrators([Parallelogram2()], ticks=10, rounds=1)


def test_a_study_shows_that_the_default_keeps_its_promise_and_that_less_does_not(document):
    methods = {method["name"]: method["points"] for method in document["devices"][0]["methods"]}
    assert methods.keys() == METHODS.keys() == LOOKS.keys()
    chosen = next(point for point in methods[DEFAULT] if point["tolerance"] == STEP_TOLERANCE)
    assert chosen["error"] < document["target"] < methods["euler"][-1]["error"]
    for points in methods.values():
        assert points[-1]["error"] <= points[0]["error"]
        assert all(point["seconds_per_second"] > 0.0 and point["steps_per_tick"] >= 1.0 for point in points)


def test_a_study_is_drawn_with_its_numbers_beside_it(document, tmp_path):
    svg, png, numbers = write_precision(tmp_path / "new", document)
    assert json.loads(numbers.read_text()) == document
    assert png.read_bytes().startswith(b"\x89PNG")
    text = svg.read_text()
    assert all(name in text for name in METHODS)
    assert "what closed loops use: cash-karp" in text
    again = write_precision(tmp_path, document)[0]
    assert again.read_text() == text


def test_a_folder_that_cannot_be_is_an_error(refused, document, tmp_path):
    (tmp_path / "file").write_text("")
    with refused(HapticevalError):
        write_precision(tmp_path / "file", document)


def test_the_command_shows_where_the_default_stands(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(integrators, "study_integrators", partial(integrators.study_integrators, ticks=5, rounds=1))
    assert integrators.main(["-o", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "parallelogram-2dof: closed loops use cash-karp" in shown
    assert "parallelogram-3dof: closed loops use cash-karp" in shown
    assert shown.count("wrote ") == 3
