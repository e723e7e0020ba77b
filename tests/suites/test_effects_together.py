"""The suite of all effects at once: what its scenes call for, and cases of the thesis with effects that are off."""

from __future__ import annotations

import pytest
from msgspec.structs import asdict

from hapticeval.suite.outline import find_suites
from hapticeval.suite.reading import load_suite

APART = {
    "height-map": "is the potential of a smooth surface, and shading is of facets",
    "lugre": "excludes the other frictions",
    "viscosity": "is for renderers that assign it",
}
"""Effects that do not go with the others, and why."""

CASES = {case.name: case for case in load_suite("effects-together").cases}
OFF = [name for name in CASES if name.startswith("off-")]


def test_one_scene_calls_for_every_effect_that_goes_with_the_others():
    """Of those that any suite calls for."""
    suites = [load_suite(name) for name in find_suites()]
    called = {effect.kind for suite in suites for case in suite.cases for effect in case.build_scene().effects}
    kinds = {effect.kind for effect in CASES["robot-all"].build_scene().effects}
    assert kinds == called - set(APART)


@pytest.mark.parametrize("name", OFF)
def test_a_case_with_effects_off_is_the_thesis_s_own(name):
    """The same scene, stimulus, checks and outcomes in print: so are the verdicts."""
    case = CASES[name]
    thesis = next(each for each in load_suite("thesis").cases if each.name == name.removeprefix("off-"))
    assert case.scene["effects"]
    scene = case.build_scene()
    assert scene.effects == ()
    assert scene == thesis.build_scene()
    # What the thesis's case is asked beside that is asked there.
    assert set(case.checks) <= set(thesis.checks)
    same = ("model", "trajectory", "experiment", "depth_of", "judged")
    assert {key: asdict(case)[key] for key in same} == {key: asdict(thesis)[key] for key in same}
    assert case.published == {each: thesis.published[each] for each in case.published}
