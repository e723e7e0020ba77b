"""The constraint projection: tips, notches, plates, several edges a step, folds, and where pop-through starts."""

import math

import numpy as np
import pytest
from hand_paths import plate, star_shaped, touching, walks
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from leading import led

from hapticeval.geometry.catalogue import EXACT_MAKERS, cassinian, circle, dumbbell, ellipse, from_vertices, line, star
from hapticeval.geometry.kernels import evaluate_many
from hapticeval.renderers import constraint
from hapticeval.renderers.outline import cut_at_valleys, third_bounds
from hapticeval.scene import Scene

CASSINIAN = cassinian()
SMOOTH = [CASSINIAN, circle(), ellipse(3.0), dumbbell()]
exact = constraint.variant(representation="curve")


def jumps(ihips):
    return np.hypot(*np.diff(ihips, axis=0).T)


@settings(max_examples=100)
@given(vertices=star_shaped(), hips=walks())
def test_a_tool_at_rest_has_no_way_downhill(vertices, hips):
    model = from_vertices(vertices)
    ihips, forces = led(constraint(Scene(model=model)), hips, 1e-3)
    polygon = model.polygon()
    on = touching(hips, ihips, forces)
    for hip, ihip in zip(hips[on], ihips[on], strict=True):
        error = hip - ihip
        for edge, tangent in enumerate(polygon.edges):
            tangent = tangent / math.hypot(*tangent)
            start = polygon.vertices[edge]
            end = polygon.vertices[(edge + 1) % len(polygon.vertices)]
            away, left = ihip - start, end - ihip
            if abs(away[0] * tangent[1] - away[1] * tangent[0]) > 1e-12 or not (
                away @ tangent > -1e-12 and left @ tangent > -1e-12
            ):
                continue
            if left @ tangent > 1e-12:
                assert error @ tangent <= 1e-12
            if away @ tangent > 1e-12:
                assert error @ tangent >= -1e-12
            if min(away @ tangent, left @ tangent) > 1e-12:
                assert error[0] * tangent[1] - error[1] * tangent[0] <= 1e-15


@settings(max_examples=100)
@given(
    st.floats(1e-7, 5e-3),
    st.floats(-0.08, 0.08),
    st.floats(-0.08, 0.08),
    st.floats(1e-6, 0.3),
    st.floats(1e-6, 0.3),
    st.floats(0.0, 6.28),
)
def test_no_segment_is_too_fast_for_a_thin_plate(thickness, x0, x1, above, below, angle):
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    model = from_vertices(plate(thickness).curve.pieces[:, 3:5] @ turn)
    hips = np.array([[x0, above], [x1, -thickness - below], [x0, -thickness - below], [x0, above]]) @ turn
    ihips, forces = led(constraint(Scene(model=model)), hips, 1e-3)
    assert touching(hips, ihips, forces).tolist() == [False, True, True, False]
    np.testing.assert_allclose(ihips[1:3] @ turn.T, [[x1, 0.0], [x0, 0.0]], atol=1e-15)


def test_a_thin_neck_of_a_curve_is_not_fallen_through():
    model = dumbbell(neck=0.001)
    hips = np.array([[0.0, 0.05], [0.001, -0.05], [0.0, 0.05]])
    ihips, forces = led(exact(Scene(model=model)), hips, 1e-3)
    assert touching(hips, ihips, forces).tolist() == [False, True, False]
    assert ihips[1] == pytest.approx((0.001, 0.001 * 0.038), abs=1e-12)


@pytest.mark.parametrize("depth", [1e-4, 1e-3, 1e-2, 2e-2])
def test_a_tip_lets_go_within_one_sample(depth):
    model = star()
    tip = next(corner for corner in model.curve.corners if corner.convex)
    along = np.arange(-299.5, 300.0) * 1e-4
    hips = tip.position + along[:, None] * tip.tangent_pre - depth * tip.normal_pre
    touched = tip.position + along[0] * tip.tangent_pre + 1e-3 * tip.normal_pre
    ihips, forces = led(constraint(Scene(model=model)), np.vstack([touched, hips]), 1e-3)
    on = touching(hips, ihips[1:], forces[1:])
    np.testing.assert_array_equal(on, along < 0.0)
    faces = tip.position + along[on, None] * tip.tangent_pre
    np.testing.assert_allclose(ihips[1:][on], faces, atol=1e-12)
    np.testing.assert_allclose(np.hypot(*forces[1:][on].T), 1000.0 * depth, rtol=1e-9)


def test_a_notch_holds_the_tool_for_the_whole_arc():
    notch = next(corner for corner in star().curve.corners if not corner.convex)
    depth, angle = 0.01, math.radians(48.0)
    start = math.atan2(-notch.normal_pre[1], -notch.normal_pre[0])
    turn = start - np.linspace(-0.2, angle + 0.2, 1001)
    hips = notch.position + depth * np.column_stack([np.cos(turn), np.sin(turn)])
    ihips, forces = led(constraint(Scene(model=star())), hips, 1e-3)
    inside = (turn <= start) & (turn >= start - angle)
    np.testing.assert_allclose(ihips[inside], np.broadcast_to(notch.position, (inside.sum(), 2)), atol=1e-15)
    assert np.all(np.hypot(*(ihips[~inside] - notch.position).T) > 1e-9)
    assert np.max(jumps(ihips)) <= np.max(jumps(hips))
    np.testing.assert_allclose(np.hypot(*forces[inside].T), 10.0, rtol=1e-9)


def test_a_notch_stops_a_tool_that_would_slide_past_in_one_step():
    # an L: the tool on the lower face is stopped by the wall, however far the hand goes into it
    model = from_vertices([(0, -0.1), (0.2, -0.1), (0.2, 0.1), (0.1, 0.1), (0.1, 0.0), (0.0, 0.0)])
    hips = np.array([[0.02, 0.01], [0.03, -0.01], [0.15, -0.02], [0.15, 0.05], [0.11, 0.12], [0.09, 0.05]])
    ihips, forces = led(constraint(Scene(model=model)), hips, 1e-3)
    expected = [(0.02, 0.01), (0.03, 0.0), (0.1, 0.0), (0.1, 0.05), (0.11, 0.12), (0.09, 0.05)]
    np.testing.assert_allclose(ihips, expected, atol=1e-15)
    np.testing.assert_allclose(forces[2], (-50.0, 20.0), atol=1e-9)


def test_a_tool_that_is_let_go_runs_into_what_stands_in_its_way():
    # released above the left block, the hand is already inside the right one
    model = from_vertices([(0, 0), (0.3, 0), (0.3, 0.1), (0.2, 0.1), (0.2, 0.05), (0.1, 0.05), (0.1, 0.1), (0, 0.1)])
    hips = np.array([[0.05, 0.11], [0.08, 0.09], [0.25, 0.08]])
    ihips, _ = led(constraint(Scene(model=model)), hips, 1e-3)
    np.testing.assert_allclose(ihips[1], (0.08, 0.1), atol=1e-15)
    # over the edge of the left block it flies to the hand, and meets the wall of the right one
    np.testing.assert_allclose(ihips[2], (0.2, 0.08), atol=1e-15)


@pytest.mark.parametrize("representation", ["polygon", "curve"])
@settings(max_examples=50)
@given(start=st.integers(0, 39), edges=st.integers(-8, 8), depth=st.floats(1e-6, 2e-3))
def test_one_long_step_ends_where_many_short_ones_do(representation, start, edges, depth):
    model = circle()
    polygon = model.polygon(40)
    middles = polygon.vertices + 0.5 * polygon.edges
    inward = -middles / np.hypot(*middles.T)[:, None]
    angle = math.atan2(middles[start, 1], middles[start, 0])
    turns = angle + np.linspace(0.0, edges * math.pi / 20.0, 200)
    radius = np.hypot(*middles[0]) - depth
    hips = radius * np.column_stack([np.cos(turns), np.sin(turns)])
    renderer = constraint.variant(representation=representation)(Scene(model=model))
    short, _ = led(renderer, hips, 1e-3)
    long, _ = led(renderer, hips[[0, -1]], 1e-3)
    np.testing.assert_allclose(long[-1], short[-1], atol=1e-12)
    foot = hips[-1] - inward[(start + edges) % 40] * (depth if representation == "polygon" else 0.1 - radius)
    np.testing.assert_allclose(long[-1], foot, atol=1e-12)


@pytest.mark.parametrize("model", SMOOTH, ids=lambda m: m.name)
@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.01, 0.6))
def test_shallow_paths_on_smooth_curves_are_minimum_distance(model, seed, share):
    curve = model.curve
    rng = np.random.default_rng(seed)
    s = (rng.uniform() + np.cumsum(rng.uniform(-0.002, 0.004, 400))) * curve.length
    u = curve.parameter(s)
    reach = 1.0 / np.max(np.abs(curve.curvature(curve.parameter(np.linspace(0, curve.length, 999)))))
    hips = curve.position(u) - share * min(reach, 0.01) * curve.normal(u)
    ihips, _ = led(exact(Scene(model=model)), hips, 1e-3)
    np.testing.assert_allclose(ihips, curve.position(u), atol=1e-11)


FINE = 16_000
RINGS = {m.name: m.curve.position(np.linspace(*m.curve.u_range, FINE, endpoint=False)) for m in SMOOTH}


@pytest.mark.parametrize("model", SMOOTH, ids=lambda m: m.name)
@example(start=0, x=-0.03055326726826875, y=-0.08282934421543278)
@settings(max_examples=50)
@given(start=st.integers(0, FINE // 4 - 1), x=st.floats(-0.12, 0.12), y=st.floats(-0.12, 0.12))
def test_a_march_stops_at_the_first_minimum_that_a_fine_walk_finds(model, start, x, y):
    ring = RINGS[model.name]
    renderer = exact(Scene(model=model, bilateral=True))
    renderer.reset(ring[4 * start])
    ihip = renderer.step(np.array([x, y]), np.zeros(2), 1e-3).ihip
    # A minimum may lie between the start and the next point of the ring, which then goes the other way.
    normal = model.curve.normal(np.array([4 * start / FINE * np.ptp(model.curve.u_range)]))[0]
    rises = np.dot([-normal[1], normal[0]], ring[4 * start] - (x, y)) > 0.0
    assume(rises == (np.hypot(*(ring[4 * start + 1] - (x, y))) > np.hypot(*(ring[4 * start - 1] - (x, y)))))
    step = np.max(np.hypot(*(ring - np.roll(ring, 1, axis=0)).T))
    coarse, fine = _walked(ring[::4], start, (x, y)), _walked(ring, 4 * start, (x, y))
    assume(np.hypot(*(coarse - fine)) < 12.0 * step)  # else a barrier too low for the walk to see
    assert np.hypot(*(ihip - fine)) < 2.0 * step


def _walked(ring, k, hip):
    far = np.hypot(*(ring - hip).T)
    assume(abs(far[(k + 1) % len(ring)] - far[k - 1]) > 1e-12)  # at a maximum rounding chooses the way
    way = 1 if far[(k + 1) % len(ring)] < far[k - 1] else -1
    while far[(k + way) % len(ring)] < far[k]:
        k = (k + way) % len(ring)
    return ring[k]


@pytest.mark.parametrize(
    "model",
    [
        *(maker() for maker in EXACT_MAKERS if maker().dimension == 2 and maker().boundary.closed),
        *(ellipse(3.0), cassinian(a_n=1.05), cassinian(a_n=1.0 + 1e-7), cassinian(lobes=7, a_n=1.3)),
    ],
    ids=lambda model: model.name,
)
def test_the_bounds_that_keep_a_march_safe_hold(model):
    whole = model.curve.pieces
    cut = cut_at_valleys(whole)
    assert len(cut) == len(whole) or model.name == "cassinian"
    # A part reaches from where the one before it ends, over all of the whole.
    assert np.array_equal(cut[1:, 1], cut[:-1, 2])
    assert (cut[0, 1], cut[-1, 2]) == (whole[0, 1], whole[-1, 2])
    count = 20_001 if len(cut) == len(whole) else 2_001
    for piece, (mixed, third) in zip(cut, third_bounds(cut), strict=True):
        us = np.linspace(piece[1], piece[2], count)
        rows = evaluate_many(np.array([piece]), us)
        slope = np.diff(rows[:, 4:6], axis=0) / np.diff(us)[:, None]
        scale = max(1e-12, np.max(np.hypot(rows[:, 2], rows[:, 3])) ** 2)
        assert np.max(3.0 * np.abs(np.sum(rows[:, 2:4] * rows[:, 4:6], axis=1))) <= mixed + 1e-9 * scale
        assert np.max(np.hypot(*slope.T)) <= third * (1.0 + 1e-6) + 1e-9


@pytest.mark.parametrize("above", [1e-3, 1e-6, 1e-9])
def test_beside_valleys_that_are_nearly_cusps_the_tool_rests_where_no_way_leads_closer(above):
    """The hand leaps from lobe to lobe, and the tool gets in a tick to where the error stands on the surface."""
    model = cassinian(a_n=1.0 + above)
    hips = np.array([[0.09, 0.0], [0.0, 0.09], [-0.0389196, 0.0073582], [0.0073582, -0.0389196]])
    curve = model.curve
    ihips, _ = led(exact(Scene(model=model)), hips, 1e-3)
    for hip, ihip in zip(hips, ihips, strict=True):
        (u,) = curve.nearest(ihip[None])
        _, _, dx, dy, *_ = evaluate_many(curve.pieces, np.array([u]))[0]
        along = np.array([dx, dy]) / np.hypot(dx, dy)
        assert abs((hip - ihip) @ along) <= 1e-6 * np.hypot(*(hip - ihip)), (hip, ihip)


def _pop(renderer, depth):
    """The largest IHIP jump (m) and the angle (degrees) at which the path (1 - d) y(s), -45 to 45 degrees, ends."""
    hips = (1.0 - depth) * CASSINIAN.curve.position(np.linspace(-math.pi / 4.0, math.pi / 4.0, 4001))
    ihips, _ = led(renderer, hips, 1e-3)
    return np.max(jumps(ihips)), math.degrees(math.atan2(ihips[-1, 1], ihips[-1, 0]))


@pytest.mark.parametrize(
    ("depth", "jump", "end"),
    [(0.25, 0.00069, 45.0), (0.265, 0.0175, 45.0), (0.345, 0.0562, 45.0), (0.35, 0.00004, -31.8)],
)
def test_where_the_exact_cassinian_pops_and_where_it_sticks(depth, jump, end):
    largest, angle = _pop(exact(Scene(model=CASSINIAN)), depth)
    assert largest == pytest.approx(jump, rel=0.05)
    assert angle == pytest.approx(end, abs=0.1)


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.75])
def test_where_the_cassinian_of_40_edges_pops_and_where_it_sticks(phase):
    u = (np.arange(40) + phase) * (2.0 * math.pi / 40)
    renderer = constraint(Scene(model=from_vertices(CASSINIAN.curve.position(u))))
    depths = np.round(np.arange(0.20, 0.30, 0.005), 3)
    answers = [_pop(renderer, depth) for depth in depths]
    stuck = [d for d, (_, end) in zip(depths, answers, strict=True) if end < 0.0]
    popped = [d for d, (j, end) in zip(depths, answers, strict=True) if end > 0.0 and j > 0.025]
    assert 0.235 <= popped[0] <= 0.24
    assert 0.25 <= popped[-1] <= 0.26
    assert 0.255 <= stuck[0] <= 0.27


def test_bilateral_contact_follows_from_both_sides():
    angle = np.linspace(0.0, 6.0, 601)
    radius = 0.1 + 0.02 * np.sin(5.0 * angle)
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    renderer = exact(Scene(model=circle(), bilateral=True))
    ihips, forces = led(renderer, radius[:, None] * ray, 1e-3)
    np.testing.assert_allclose(ihips, 0.1 * ray, atol=1e-15)
    np.testing.assert_allclose(forces, 1000.0 * (0.1 - radius)[:, None] * ray, atol=1e-9)


def test_a_run_that_starts_inside_starts_at_the_nearest_point():
    renderer = constraint(Scene(model=plate(0.01)))
    for y, face in ((-0.004, 0.0), (-0.006, -0.01)):
        renderer.reset(np.array([0.0, y]))
        response = renderer.step(np.array([0.001, y]), np.zeros(2), 1e-3)
        np.testing.assert_allclose(response.ihip, (0.001, face), atol=1e-15)


def test_a_hand_that_wanders_in_and_out_of_a_line():
    renderer = constraint(Scene(model=line()))
    x = np.linspace(-1.0, 1.0, 301)
    hips = np.column_stack([x, 0.01 * np.sin(20.0 * x)])
    ihips, _ = led(renderer, hips, 1e-3)
    np.testing.assert_allclose(ihips, np.column_stack([x, np.maximum(hips[:, 1], 0.0)]), atol=1e-15)
