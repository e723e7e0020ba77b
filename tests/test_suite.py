"""Suites: what is installed, and what a file may get wrong."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.suite import find_suites, load_suite

CASE = """
title = "mine"
[[case]]
name = "one"
title = "One"
model = { kind = "circle" }
checks = ["continuous-contact"]
trajectory = { kind = "points", points = [[0.12, 0.0], [0.08, 0.02]], duration = 1 }
"""


def load(tmp_path, text):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    return load_suite(str(file))


def test_the_thesis_suite_has_the_cases_of_chapter_6():
    suite = load_suite("thesis")
    names = {case.name for case in suite.cases}
    assert {
        "cassinian-shallow-slide",
        "cassinian-deep-slide",
        "star-concave-corner",
        "star-convex-corner",
        "ambiguous-push",
        "plane-press",
        "plane-impact",
        "line-constraint",
        "circle-constraint",
        "circle-slide",
    } <= names
    assert any(name.startswith("cassinian-depth-sweep-") for name in names)
    assert all(case.citation and case.shows for case in suite.cases)
    assert [case.name for case in suite.cases if not case.judged] == ["ambiguous-push"]
    assert "thesis" in find_suites()


def test_a_minimal_file_is_a_suite(tmp_path):
    suite = load(tmp_path, CASE)
    (case,) = suite.cases
    assert (suite.name, case.judged, case.depth_of) == ("mine", True, "model")
    path = case.build_stimulus(case.build_scene(), object())
    np.testing.assert_allclose(path.sampled(1.0)[1], [[0.12, 0.0], [0.08, 0.02]])


def test_unknown_suites_suggest_the_closest():
    with pytest.raises(UnknownNameError, match="did you mean thesis"):
        load_suite("thesys")


def test_a_missing_file_is_said(tmp_path):
    with pytest.raises(InputError, match="no suite file"):
        load_suite(str(tmp_path / "none.toml"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('title = "mine"', 'title = "mine', "not TOML"),
        ("[[case]]", "[[cases]]", "does not fit"),
        ('kind = "circle"', 'kind = "circel"', "case 'one'.*circel"),
        ('kind = "circle"', 'kind = "circle", size = -1', "case 'one'"),
        ('kind = "circle"', 'kind = "circle", size = 1e300', "case 'one'"),
        ('kind = "circle"', 'kind = "circle", colour = "red"', "case 'one'"),
        ("continuous-contact", "continous-contact", "case 'one'.*continous-contact"),
        ("duration = 1", "duration = 0", "case 'one'"),
        ("duration = 1", "speed = 1", "case 'one'.*speed"),
        ("duration = 1", "duration = -1", "case 'one'.*duration.*-1"),
        ('checks = ["continuous-contact"]', "checks = []", "case 'one'"),
        ('name = "one"', 'name = "One two"', "One two"),
        ('title = "One"', 'title = "One"\nscene = { stiffness = -1.0 }', "stiffness"),
        ('title = "One"', 'title = "One"\nscene = { stifness = 1.0 }', "stifness"),
        ('title = "One"', 'title = "One"\nscene = { restitution = 2.0 }', "restitution"),
    ],
)
def test_what_a_file_gets_wrong_is_named(tmp_path, old, new, message):
    assert old in CASE
    with pytest.raises(InputError, match=f"(?s){message}"):
        load(tmp_path, CASE.replace(old, new))


def test_two_cases_of_one_name_are_refused(tmp_path):
    with pytest.raises(InputError, match="two cases named 'one'"):
        load(tmp_path, CASE + CASE.split("\n", 2)[2])


def test_a_trajectory_in_3d_is_refused_on_a_plane_model(tmp_path):
    suite = load(tmp_path, CASE.replace("[[0.12, 0.0], [0.08, 0.02]]", "[[0.12, 0.0, 0.0], [0.08, 0.02, 0.0]]"))
    case = suite.cases[0]
    with pytest.raises(InputError, match="3D on a 2D model"):
        case.build_stimulus(case.build_scene(), object())


def test_a_sweep_makes_a_case_a_depth(tmp_path):
    text = CASE.replace(
        'trajectory = { kind = "points", points = [[0.12, 0.0], [0.08, 0.02]], duration = 1 }',
        'trajectory = { kind = "scaled", from_angle = 0, to_angle = 90, duration = 1 }\n'
        'sweep = [{ label = "a", depth = 0.01 }, { label = "b", depth = 0.02 }]',
    )
    cases = load(tmp_path, text).cases
    assert [case.name for case in cases] == ["one-a", "one-b"]
    radii = [
        np.linalg.norm(case.build_stimulus(case.build_scene(), object()).sampled(0.5)[1], axis=1) for case in cases
    ]
    np.testing.assert_allclose(radii[0], 0.09)
    np.testing.assert_allclose(radii[1], 0.08)
