"""The mapping renderer: chapter 5's projection with (5.21), its refusals, and what the thesis says of it."""

from functools import cache

import numpy as np
import pytest

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, line, star
from hapticeval.geometry.maps.flow import FlowError
from hapticeval.phenomena.verdict import Outcome
from hapticeval.renderers import mapping
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.suite.reading import load_suite

COARSE = mapping.with_knobs(cells=60.0)


def outcome(case_name, check, factory):
    case = next(case for case in load_suite("thesis").cases if case.name == case_name)
    verdicts = judge(factory, "mapping", "thesis", case).verdicts
    return next(verdict.finding for verdict in verdicts if verdict.check == check)


@cache
def rendered(name):
    model = {"cassinian": cassinian(), "star": star()}[name]
    return model.curve, COARSE(Scene(model=model, stiffness=800.0, damping=3.0))


@pytest.mark.parametrize("name", ["cassinian", "star"])
def test_the_force_lies_along_the_normal_however_deep(name):
    """Transversal regulation (5.21), its signs corrected: it pushes out."""
    curve, renderer = rendered(name)
    hips = np.random.default_rng(3).uniform(-0.09, 0.09, (500, 2))
    hips = hips[curve.contains(hips)]
    for hip in hips[:100]:
        renderer.reset(hip)
        ihip, force = renderer.step(hip, np.zeros(2), 1e-3)
        u = curve.nearest([ihip])
        if min(abs(corner.u - u[0]) for corner in curve.corners or [type("", (), {"u": 9.0})]) < 1e-6:
            continue
        normal = curve.normal(u)[0]
        assert force == pytest.approx(-800.0 * ((hip - ihip) @ normal) * normal, abs=1e-9)


def test_what_it_declares():
    model = cassinian()
    renderer = COARSE(Scene(model=model))
    assert renderer.standoff == 0.0
    assert renderer.surface is model.curve
    assert renderer.resolution == pytest.approx(cassinian().curve.length / 120, rel=1e-6)
    assert mapping.regulation == "transversal"
    assert mapping.variant(regulation="pp-pd").regulation == "pp-pd"
    assert {"cells", "lines", "levels", "gap"} == set(mapping.knobs)


def test_knobs_are_checked():
    with pytest.raises(UnknownNameError, match="cells"):
        mapping.with_knobs(cell=100.0)
    with pytest.raises(InputError, match="cells = 3"):
        mapping.with_knobs(cells=3.0)(Scene(model=circle()))
    with pytest.raises(InputError, match="not for this projection"):
        mapping.variant(representation="polygon")


def test_the_line_is_exact():
    renderer = mapping(Scene(model=line(), stiffness=50.0, bilateral=True))
    for y in (-0.003, 0.004):
        ihip, force = renderer.step(np.array([0.2, y]), np.zeros(2), 1e-3)
        assert ihip == pytest.approx([0.2, 0.0], abs=1e-16)
        assert force == pytest.approx([0.0, -50.0 * y])


def test_a_bilateral_scene_is_continuous_through_the_surface():
    curve = ellipse(2.0).curve
    renderer = COARSE(Scene(model=ellipse(2.0), bilateral=True))
    for u in (0.1, 1.0, 2.5):
        depths = np.linspace(-1e-4, 1e-4, 41)[:, np.newaxis]
        ihips, _ = renderer.run(curve.position(u) + depths * curve.normal(u), 1e-3)
        steps = np.hypot(*np.diff(ihips, axis=0).T)
        assert steps.max() < 2e-5


@pytest.mark.parametrize("model", [dumbbell(0.1), dumbbell(0.5), ellipse(8.0)], ids=["thin", "thick", "8:1"])
def test_a_model_that_the_flow_cannot_map_is_refused(model):
    with pytest.raises(FlowError, match="conformal"):
        COARSE(Scene(model=model))


def test_the_mapping_column_of_table_6_3_on_smooth_models():
    for case in ("cassinian-deep-slide", "cassinian-depth-sweep-45mm"):
        assert outcome(case, "continuous-contact", COARSE).outcome is Outcome.PASS
    assert outcome("cassinian-deep-slide", "memoryless", COARSE).outcome is Outcome.PASS
    assert outcome("circle-constraint", "centripetal-force", COARSE).outcome is Outcome.FAIL


def test_the_star_s_tip_pops_through_where_lines_merge_and_is_continuous_where_they_are_held_apart():
    """Thesis Table 6.3: corners No. The flow drives the lines of both flanks together on the tip's bisector.

    The finer the flow's grid, the steeper: on a coarse one the map is continuous still.
    """
    finding = outcome("star-convex-corner", "continuous-contact", mapping)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value > 1e-3
    literal = mapping.with_knobs(cells=100.0)
    steep = outcome("star-convex-corner", "continuous-contact", literal)
    assert steep.outcome is Outcome.PASS
    assert steep.evidence["jump_in_hip_steps"] > 500.0
    held = mapping.with_knobs(cells=100.0, gap=0.05)
    finding = outcome("star-convex-corner", "continuous-contact", held)
    assert finding.outcome is Outcome.PASS
    assert 10.0 < finding.evidence["jump_in_hip_steps"] < 30.0
    assert outcome("star-concave-corner", "continuous-contact", literal).outcome is Outcome.PASS
