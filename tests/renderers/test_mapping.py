"""The mapping renderer: chapter 5's projection with (5.21), its refusals, and what the thesis says of it."""

from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from leading import led

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, from_vertices, line, star
from hapticeval.phenomena.verdict import Outcome
from hapticeval.renderers import conformal, mapping
from hapticeval.renderers.maps.flow import FlowError
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


PLATE = np.array([[-0.1, -0.05], [0.1, -0.05], [0.1, 0.05], [-0.1, 0.05]])


@settings(max_examples=8)
@given(
    st.lists(st.tuples(st.floats(0.2, 0.8), st.integers(1, 3)), min_size=4, max_size=4),
    st.sampled_from([1e-3, 1e-9, 1e-12, 1e-15]),
    st.floats(0.0, 6.3),
)
@example([(0.5, 1)] * 4, 1e-3, 0.7)
def test_a_map_has_no_hole_beside_vertices_on_a_straight_edge(clusters, gap, turn):
    """Collinear and nearly coincident ones: on either side the answer is that on the plain plate."""
    turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    vertices, places, outs = [], [], []
    for corner, after, (at, count) in zip(PLATE, np.roll(PLATE, -1, axis=0), clusters, strict=True):
        way = (after - corner) / np.hypot(*(after - corner))
        on = [corner + at * (after - corner) + gap * j * way for j in range(count)]
        vertices += [corner, *on]
        places += on
        outs += [[way[1], -way[0]]] * count
    crowded, plain = from_vertices((np.array(vertices) @ turned).tolist()), from_vertices((PLATE @ turned).tolist())
    offs = np.array([1e-6, 1e-3, 0.01])[:, np.newaxis, np.newaxis]
    above, below = ((np.array(places) + side * offs * outs).reshape(-1, 2) @ turned for side in (1.0, -1.0))
    for factory in (COARSE, conformal):
        renderer, other = factory(Scene(model=crowded)), factory(Scene(model=plain))
        ihips, forces = led(renderer, above, 1e-3)
        assert np.array_equal(ihips, above)
        assert not forces.any()
        apart = np.linalg.norm(led(renderer, below, 1e-3)[0] - led(other, below, 1e-3)[0], axis=1)
        # Vertices that are rounded off the edge begin lines of the flow: the map is blurred by as much.
        assert apart.max() <= (renderer.resolution if factory is COARSE else 1e-8)


def test_what_it_declares():
    model = cassinian()
    renderer = COARSE(Scene(model=model))
    assert renderer.standoff == 0.0
    assert renderer.surface is model.curve
    assert renderer.resolution == pytest.approx(cassinian().curve.length / 120, rel=1e-6)
    assert mapping.regulation == "transversal"
    assert mapping.variant(regulation="pp-pd").regulation == "pp-pd"
    assert {"cells", "lines", "levels", "gap"} == set(mapping.knobs)


def test_knobs_are_checked(refused):
    with refused(UnknownNameError):
        mapping.with_knobs(cell=100.0)
    with refused(InputError):
        mapping.with_knobs(cells=3.0)(Scene(model=circle()))
    with refused(InputError):
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
        ihips, _ = led(renderer, curve.position(u) + depths * curve.normal(u), 1e-3)
        steps = np.hypot(*np.diff(ihips, axis=0).T)
        assert steps.max() < 2e-5


@pytest.mark.parametrize("model", [dumbbell(0.1), dumbbell(0.5), ellipse(8.0)], ids=["thin", "thick", "8:1"])
def test_a_model_that_the_flow_cannot_map_is_refused(refused, model):
    with refused(FlowError):
        COARSE(Scene(model=model))


def test_the_star_s_tip_is_steep_where_lines_merge_and_less_so_where_they_are_held_apart():
    """The flow drives the lines of both flanks together on the tip's bisector: the finer its grid, the steeper.

    On a coarse one the map is continuous still. On that of the thesis it is not (Table 6.3: corners No), as the
    recorded verdicts have it.
    """
    literal = mapping.with_knobs(cells=100.0)
    steep = outcome("star-convex-corner", "continuous-contact", literal)
    assert steep.outcome is Outcome.PASS
    assert steep.evidence["steep_step_m"] > 500.0 * steep.evidence["hip_step_m"]
    held = mapping.with_knobs(cells=100.0, gap=0.05)
    finding = outcome("star-convex-corner", "continuous-contact", held)
    assert finding.outcome is Outcome.PASS
    assert 10.0 < finding.evidence["steep_step_m"] / finding.evidence["hip_step_m"] < 30.0
    assert outcome("star-concave-corner", "continuous-contact", literal).outcome is Outcome.PASS
