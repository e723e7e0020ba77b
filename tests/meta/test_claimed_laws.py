"""Which closed form a law that a renderer declares has, in which scenes: what it is then held to is in the verdicts."""

from dataclasses import replace

import pytest
from lawbreakers import Stabilised
from made import NO

from hapticeval.closed_forms import SOLVED_LAWS, form_of
from hapticeval.devices.catalogue import make_device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.sensors import Encoder
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.geometry.catalogue import make_model
from hapticeval.renderer import Declaration
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite


def test_who_claims_no_law_is_not_asked_for_one():
    case = load_suite("dynamics-circle").case("circle-off")
    found = judge(lambda scene: Stabilised(scene, claims=False), "mine", "dynamics-circle", case)
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
