"""What follows from the triangles that a renderer was given is not held against it, and all else is."""

from __future__ import annotations

from functools import cache

import pytest
from msgspec.structs import replace
from pieces import GodObject, Hopping, Nearest, Unhurried

from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.renderer import wrapped
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite

SUITE = load_suite("unilateral-surfaces")


@cache
def finding_of(make: type[GodObject], case: str) -> Finding:
    judged = judge(make, "god-object", SUITE.name, replace(SUITE.case(case), checks=("continuous-contact",)))
    assert judged.error is None
    return judged.verdicts[0].finding


@pytest.mark.parametrize("case", ["torus-slide", "sphere-deep", "ellipsoid-deep", "torus-deep"])
def test_a_god_object_on_the_given_triangles_is_left_alone(case):
    finding = finding_of(GodObject, case)
    assert finding.outcome is Outcome.PASS, finding.message


def test_one_that_is_a_tick_late_is_left_alone():
    assert finding_of(Unhurried, "sphere-deep").outcome is Outcome.PASS


def test_a_hop_of_its_own_is_stopped():
    assert finding_of(Hopping, "sphere-deep").outcome is Outcome.FAIL


def test_on_pieces_that_it_chose_itself_it_is_blamed():
    """One whose surface is a mesh by its own choice has no `pieces`."""

    class Chosen(GodObject):
        def __init__(self, scene: Scene) -> None:
            super().__init__(scene)
            del self.pieces

    scene = SUITE.case("sphere-deep").build_scene()
    assert wrapped(Chosen(scene)).pieces is None
    assert wrapped(GodObject(scene)).pieces is not None
    assert finding_of(Chosen, "sphere-deep").outcome is Outcome.FAIL


def test_a_pop_through_is_no_step_of_the_pieces():
    assert finding_of(Nearest, "torus-deep").outcome is Outcome.FAIL
