"""How a case of a suite becomes one that a search can shrink, and what is said of the smallest path."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from hapticeval.examples.engines.smallest import MOST_POINTS, as_moves, candidates, path_words
from hapticeval.stimulus.moves import Moves
from hapticeval.suite.reading import load_suite

CASES = {case.name: case for case in load_suite("solids").cases}


@pytest.mark.parametrize("name", ["cube-edge", "plate"])
def test_a_path_of_points_becomes_the_same_path_of_even_moves(name):
    case = CASES[name]
    moved = as_moves(case, "contact-kept")
    assert moved.checks == ("contact-kept",)
    assert isinstance(moved.trajectory, Moves)
    before, after = (each.build_stimulus(each.build_scene(), None).sampled(1e-3)[1] for each in (case, moved))
    np.testing.assert_allclose(after, before, atol=1e-12)


def test_an_experiment_stays_what_it_is():
    moved = as_moves(CASES["cube-impact"], "impulsive-collision")
    assert moved.experiment == CASES["cube-impact"].experiment
    assert path_words(moved).startswith("an experiment of ")


def test_the_plainest_model_comes_first_and_curves_are_left_out():
    failing = [SimpleNamespace(suite="solids", case=name) for name in ("icosphere-80", "cube-edge", "plate")]
    assert [case.name for case in candidates(failing)][:2] == ["cube-edge", "plate"]
    curve = SimpleNamespace(suite="field", case="round-a-ball")
    points = len(next(case for case in load_suite("field").cases if case.name == "round-a-ball").trajectory.points)
    assert bool(list(candidates([curve]))) is (points <= MOST_POINTS)


def test_a_path_is_said_in_millimetres():
    assert path_words(as_moves(CASES["plate"], "contact-kept")) == "(0, 0, 21) to (4, 2, -19) mm in 0.02 s"
