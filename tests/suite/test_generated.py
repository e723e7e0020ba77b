"""Trajectories that are drawn: the same for the same seed, one path after the other, on any model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hapticeval.documents import convert
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import make_model
from hapticeval.strategies import examples, hand_paths
from hapticeval.suite.case import Generated
from hapticeval.suite.reading import load_suite

HERE = Path()


def path(kind="star", **table):
    return convert({"kind": "generated", "seed": 3, **table}, Generated, "trajectory").path(
        make_model(kind).boundary, HERE
    )


@pytest.mark.parametrize("kind", ["star", "line", "sphere"])
def test_a_seed_always_gives_the_same_path_and_another_another(kind):
    first, second, other = path(kind, examples=3), path(kind, examples=3), path(kind, examples=3, seed=4)
    assert np.array_equal(first.points, second.points)
    assert first.points.shape != other.points.shape or not np.array_equal(first.points, other.points)


def test_it_leads_through_every_example_from_start_to_end():
    drawn = examples(hand_paths(make_model("star"), parts=["slide", "graze"], most_parts=2), 4, seed=3)
    points = path(examples=4, parts=["slide", "graze"], most=2).points
    for moves in drawn:
        for end in (moves.start, moves.moves[-1].to):
            assert np.min(np.linalg.norm(points - end, axis=1)) == 0.0
    assert np.array_equal(points[[0, -1]], [drawn[0].start, drawn[-1].moves[-1].to])


def test_what_is_not_said_is_twenty_paths_of_at_most_three_parts_of_a_hand():
    said = path("line", examples=20, most=3, strategy="hand", parts=())
    assert np.array_equal(path("line").points, said.points)


def test_one_that_trembles_is_the_same_path_with_a_tremor():
    trembling = path(strategy="hand-with-tremor", examples=12)
    assert np.linalg.norm(np.diff(trembling.points, axis=0), axis=1).max() < 1e-3


@pytest.mark.parametrize(
    ("table", "error"),
    [
        ({"seed": -1}, InputError),
        ({"strategy": "foot"}, UnknownNameError),
        ({"examples": 0}, InputError),
        ({"parts": ["jump"]}, UnknownNameError),
        ({"most": 0}, InputError),
    ],
)
def test_tables_that_mean_nothing_are_refused(table, error):
    with pytest.raises(error):
        path(**table)


def test_the_suite_has_a_case_for_each_smooth_or_cornered_plane_model_of_the_catalogue():
    cases = load_suite("generated").cases
    assert {case.model["kind"] for case in cases} >= {"star", "cassinian", "circle", "ellipse", "dumbbell", "line"}
    assert all(isinstance(case.trajectory, Generated) for case in cases)
