"""Who declares to be a law is held to its closed form: gains that no other check of a closed loop tells are found."""

from dataclasses import replace
from functools import cache

import honest
import pytest
from lawbreakers import Stabilised

from hapticeval.closed_forms import SOLVED_LAWS, form_of
from hapticeval.devices.catalogue import make_device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.discovery import resolve
from hapticeval.effects.sensors import Encoder
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.verdict import Level, Outcome
from hapticeval.renderer import Declaration
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite

OFF = (
    "dynamics-circle/circle-off",
    "dynamics-circle/circle-off-robot",
    "dynamics-line/line",
    "dynamics-sphere/sphere-off-robot",
)
"""Cases in which a law of this kind has to come home to the surface."""

PASS, FAIL, NO = Outcome.PASS, Outcome.FAIL, Outcome.NOT_APPLICABLE
ours = resolve("set-stabilisation")


class OtherGains:
    """Our set stabilisation, made with gains that are so many times the scene's."""

    supports = ours.supports

    def __init__(self, **factors):
        self.factors = factors

    def __call__(self, scene):
        gains = {gain: factor * getattr(scene, gain) for gain, factor in self.factors.items()}
        return ours(replace(scene, **gains))


WRONG = {
    "half of K_p": OtherGains(stiffness=0.5),
    "three times K_d": OtherGains(damping=3.0),
    "2 % more of K_d": OtherGains(damping=1.02),
}
HONEST = {
    "ours": ours,
    "by hand": Stabilised,
    "with lists": honest.factory("lists", ours),
}


@cache
def verdicts(place, name):
    suite, case = place.split("/")
    (judged,) = [each for each in load_suite(suite).cases if each.name == case]
    found = judge((WRONG | HONEST)[name], "mine", suite, judged)
    assert found.error is None
    return found.verdicts


@pytest.mark.parametrize("place", OFF)
@pytest.mark.parametrize("name", WRONG)
def test_other_gains_than_those_of_the_claimed_law_are_stopped_by_a_must_and_by_nothing_else(place, name):
    failed = {verdict.check: verdict for verdict in verdicts(place, name) if verdict.outcome is FAIL}
    assert set(failed) == {"closed-form"}, "all else is asked of any gains"
    assert failed["closed-form"].level is Level.MUST
    assert not failed["closed-form"].as_expected


IN_PLANE = [place for place in OFF if "sphere" not in place]


@pytest.mark.parametrize(
    ("place", "name"), [(place, name) for name in HONEST for place in (IN_PLANE if name == "by hand" else OFF)]
)
def test_the_law_itself_is_not_blamed_whoever_wrote_it(place, name):
    assert {verdict.outcome for verdict in verdicts(place, name)} == {PASS}


def test_who_claims_no_law_is_not_asked_for_one():
    (judged,) = [each for each in load_suite("dynamics-circle").cases if each.name == "circle-off"]
    found = judge(lambda scene: Stabilised(scene, claims=False), "mine", "dynamics-circle", judged)
    assert {verdict.check: verdict.outcome for verdict in found.verdicts}["closed-form"] is NO
    assert found.closed_form is None


CIRCLE = Scene(model=make_model("circle"), bilateral=True)
ROBOT = replace(CIRCLE, device=make_device("parallelogram-2dof"))
LINE = replace(CIRCLE, model=make_model("line"))


@pytest.mark.parametrize(
    ("law", "scene", "form"),
    [
        ("pp", LINE, "6.19"),
        ("pp-d", LINE, "6.21"),
        ("pp-pd-c", LINE, "6.21"),
        ("set-stabilisation", LINE, "7.28"),
        ("pp-d", CIRCLE, "6.27"),
        ("pp-pd-c", CIRCLE, "pp-pd-c-on-curve"),
        ("set-stabilisation", replace(CIRCLE, model=make_model("cassinian")), "set-stabilisation-on-curve"),
        ("pp", replace(CIRCLE, model=make_model("sphere")), "pp-on-sphere"),
        ("pp", replace(CIRCLE, model=make_model("torus")), None),
        ("pp", replace(CIRCLE, model=make_model("star")), None),
        ("pp", replace(CIRCLE, bilateral=False), None),
        ("pp", replace(CIRCLE, device=PointMass(2.0 * CIRCLE.mass, 2)), None),
        ("set-stabilisation", replace(CIRCLE, effects=(Viscosity(0.1),)), "7.38"),
        ("set-stabilisation", replace(CIRCLE, effects=(Encoder(step=1e-6),)), None),
        ("set-stabilisation", replace(ROBOT, inner_loop=InnerLoop.LINEARISED), "7.38"),
        ("set-stabilisation", ROBOT, None),
    ],
)
def test_a_law_has_the_form_in_print_where_its_assumptions_hold(law, scene, form):
    found = form_of(law, scene)
    assert (None if found is None else found.name) == form


@pytest.mark.parametrize("law", [None, *SOLVED_LAWS])
def test_a_law_that_is_declared_is_one_that_there_is(law):
    assert not Declaration(closed_form=law).faults


@pytest.mark.parametrize("law", ["pd", "", 7.38])
def test_another_is_refused(law):
    assert Declaration(closed_form=law).faults
