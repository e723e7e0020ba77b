"""Broken contact and abrupt switch on edges and vertices of solids: as in the plane, with the fault's size known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leading import led
from made import FAIL, NO, PASS, UNDECIDED, changed, found, outcome, recorded

from hapticeval.geometry.catalogue import make_model, mesh
from hapticeval.geometry.mesh_tool import IN_FREE_SPACE
from hapticeval.phenomena.measures.crossings import (
    find_crossings,
    shift_touching,
)
from hapticeval.phenomena.observed import Observed
from hapticeval.renderers import constraint
from hapticeval.rigid_contact import ideal
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

STEP, DEPTH = 2e-5, 3e-3
CUBE = Scene(model=make_model("cube"))
NOTCHED = Scene(model=make_model("l-block"))
STAR, PRISM = (Scene(model=make_model(kind, **more)) for kind, more in (("star", {}), ("extruded", {"length": 1.0})))
UP = np.array([0.0, 0.0, 1.0])
RING = ((0, 1), (1, 2), (2, 3), (3, 0))


def over_the_top(towards, *, early=0.0, late=0.0):
    """3 mm under the top of a cube and over its border at the middle of an edge, or over a vertex, along `towards`.

    The force is lost `early` metres before or `late` metres after, square to the edge.
    """
    ahead = np.array([*towards, 0.0]) / np.linalg.norm(towards)
    end = 0.05 / np.max(np.abs(ahead)) * ahead + 0.05 * UP
    x = (np.arange(-0.02, 0.02, STEP) + STEP / 3)[:, None]
    hip = end + x * ahead - DEPTH * UP
    square = x * np.max(np.abs(ahead))
    held = (square <= late) & ((square <= -early) | (square > 0.0))
    return recorded(hip, np.where(held, hip + DEPTH * UP, hip))


@pytest.mark.parametrize("towards", [(1.0, 0.0), (-1.0, 0.4), (0.3, 1.0), (1.0, 1.0), (-1.0, 1.0)])
def test_a_force_that_keeps_to_the_edge_or_the_vertex_and_is_gone_passes(towards):
    base = over_the_top(towards)
    assert outcome("broken-contact", base, CUBE) is PASS
    (crossing,) = find_crossings(Observed(base, CUBE), convex=True)
    assert crossing.turn == pytest.approx(0.5 * np.pi)
    assert np.array_equal(crossing.normal_pre, UP)
    assert np.abs(crossing.place).max() == pytest.approx(0.05, abs=1e-12)


@given(distance=st.floats(2e-4, 0.012), angle=st.floats(0.0, 6.28))
@settings(max_examples=30)
def test_how_far_too_early_or_too_late_is_measured_square_to_the_edge(distance, angle):
    towards = (np.cos(angle), np.sin(angle))
    for kind, words in (("early", "before"), ("late", "past")):
        finding = found("broken-contact", over_the_top(towards, **{kind: distance}), CUBE)
        assert finding.outcome is FAIL
        assert finding.metric.value == pytest.approx(distance, abs=1.1 * STEP)
        assert words in finding.message


@pytest.mark.parametrize(("ticks", "count"), [(3, 0), (4, 1)])
def test_a_hand_that_is_past_the_edge_for_longer_than_a_lag_has_passed_it(ticks, count):
    base = over_the_top((1.0, 0.0))
    past = int(np.argmax(base.hip[:, 0] > 0.05))
    crossings = find_crossings(Observed(changed(base, rows=slice(0, past + ticks)), CUBE), convex=True)
    assert [(crossing.crossed, crossing.end) for crossing in crossings] == count * [(past, past + ticks)]


def test_a_hand_that_goes_round_the_edge_inside_or_lifts_off_passes_none():
    ways = [[[0, 0, 60], [0, 0, 47], [47, 0, 47], [47, 0, 0]], [[0, 0, 60], [0, 0, 47], [40, 0, 47], [40, 0, 60]]]
    for points in ways:
        hip = np.vstack([np.linspace(a, b, 400) for a, b in pairwise(points)]) / 1e3
        assert outcome("broken-contact", recorded(hip), CUBE) is NO


@given(backwards=st.booleans(), drift=st.floats(-0.3, 0.3), late=st.floats(-5e-3, 5e-3))
@settings(max_examples=20)
def test_on_an_extruded_star_it_is_what_it_is_in_the_plane(backwards, drift, late):
    corner = STAR.model.curve.corners[0]
    ahead, normal = (-corner.tangent_post, corner.normal_post) if backwards else (corner.tangent_pre, corner.normal_pre)
    x = (np.arange(-0.02, 0.02, STEP) + STEP / 3)[:, None]
    hip = corner.position + x * ahead - DEPTH * normal
    flat = recorded(hip, np.where(x <= late, hip + DEPTH * normal, hip))
    high = np.linspace(0.0, drift * 0.04, len(hip))
    lifted = recorded(np.column_stack([flat.hip, high]), np.column_stack([flat.ihip, high]))
    plane, space = found("broken-contact", flat, STAR), found("broken-contact", lifted, PRISM)
    assert space.outcome is plane.outcome
    assert space.metric.value == pytest.approx(plane.metric.value, abs=1e-12)


def round_the_notch(*, along=0.0, spread=0.0):
    """Under the faces of the notch of an L, the force turning over a `spread` of the arc, the hand moving `along` it.

    All of the way along the edge (m) is gone half way round the arc.
    """
    edge = np.array([-0.01, -0.01])
    x, turn = np.arange(0.0, 0.02, STEP)[::-1, None], np.arange(0.0, 0.5 * np.pi, STEP / DEPTH)
    place = np.concatenate([np.zeros(len(x)), turn / turn[-1], np.ones(len(x))])
    tool = np.vstack([edge + x * [1, 0], np.tile(edge, (turn.size, 1)), edge + x[::-1] * [0, 1]])
    waits = int(along / STEP)
    middle = int(np.argmax(place > 0.5))
    rows = np.concatenate([np.arange(middle), np.full(waits, middle), np.arange(middle, len(place))])
    high = np.concatenate([np.zeros(middle), STEP * np.arange(waits), np.full(len(place) - middle, STEP * waits)])
    place, tool = place[rows], np.column_stack([tool[rows], high])

    def direction(share):
        return np.column_stack([np.sin(0.5 * np.pi * share), np.cos(0.5 * np.pi * share), np.zeros(len(share))])

    turned = np.clip((place - 0.5) / spread + 0.5, 0.0, 1.0) if spread else (place > 0.5).astype(float)
    return recorded(tool - DEPTH * direction(place), tool, 1e3 * DEPTH * direction(turned))


def test_a_crossing_of_a_notch_begins_under_the_first_face_and_ends_under_the_second():
    """Along x to the edge under a face that looks up, and down along y under one that looks along x."""
    base = round_the_notch()
    (crossing,) = find_crossings(Observed(base, NOTCHED), convex=False)
    assert np.array_equal(crossing.normal_pre, [0.0, 1.0, 0.0])
    assert np.array_equal(crossing.normal_post, [1.0, 0.0, 0.0])
    assert crossing.turn == pytest.approx(0.5 * np.pi)
    under = (base.hip @ [0.0, -1.0, 0.0]) - 0.01
    np.testing.assert_allclose(crossing.under[crossing.first : crossing.crossed], under[: crossing.crossed], atol=1e-12)
    assert crossing.under[crossing.first] == pytest.approx(DEPTH)
    assert (crossing.first, crossing.end) == (0, len(base))
    assert np.flatnonzero(crossing.tool).tolist() == list(range(np.count_nonzero(crossing.tool)))
    np.testing.assert_allclose(crossing.steps, np.linalg.norm(np.diff(base.hip, axis=0), axis=1))


@given(spread=st.floats(0.2, 1.0), along=st.sampled_from([0.0, 0.02]))
@settings(max_examples=15)
def test_the_travel_of_the_switch_is_measured_without_the_way_along_the_edge(spread, along):
    finding = found("abrupt-switch", round_the_notch(spread=spread, along=along), NOTCHED)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(0.9 * spread * 0.5 * np.pi, abs=4 * STEP / DEPTH)
    assert finding.evidence["turn_deg"] == pytest.approx(90.0)


def test_a_recording_that_ends_while_the_tool_rests_on_the_edge_has_no_switch():
    ends_there = changed(round_the_notch(), rows=slice(0, 1100))
    assert outcome("abrupt-switch", ends_there, NOTCHED) is NO


@pytest.mark.parametrize("count", [1, 2])
def test_a_hand_on_a_face_is_looked_at_from_either_side_of_it(count):
    top = CUBE.model.boundary
    hips = np.column_stack([np.linspace(0.0, 0.01, 4), np.zeros(4), np.full(4, 0.06)])
    assert all(shifted is hips for shifted in shift_touching(hips, top, 1e-6))
    hips[1 : 1 + count, 2] = 0.05
    for shifted, side in zip(shift_touching(hips, top, 1e-6), (-1.0, 1.0), strict=True):
        expected = np.where(np.abs(hips[:, 2] - 0.05) < 1e-9, side * 2e-6, 0.01)
        np.testing.assert_allclose(top.signed_distance(shifted), expected, atol=1e-12)


def test_a_switch_at_one_point_passes():
    assert outcome("abrupt-switch", round_the_notch(), NOTCHED) is PASS
    assert outcome("abrupt-switch", changed(round_the_notch(), rows=slice(0, 900)), NOTCHED) is NO
    assert outcome("abrupt-switch", over_the_top((1.0, 0.0)), CUBE) is NO
    silent = round_the_notch()
    assert outcome("abrupt-switch", changed(silent, force=0.0 * silent.force, ihip=silent.hip), NOTCHED) is UNDECIDED


SECTION = [[-0.02, 0.0], [-0.02, 0.03], [-0.05, 0.03], [-0.05, -0.05], [0.05, -0.05], [0.05, 0.03], [0.02, 0.03],
           [0.02, 0.0]]  # fmt: skip
TROUGH = Scene(model=make_model("extruded", model={"kind": "polygon", "vertices": SECTION}, length=0.1))


def across_a_trough(leans, *, height=0.0):
    """Along the floor of a trough, from beside the left wall, then up the right one: a tool that the hand is.

    The mean force of a tick leans to the right where `leans` (n,), m along the floor, says so.
    """
    floor, wall = np.arange(-0.02, 0.02, STEP), np.arange(STEP, 0.01, STEP)
    x = np.concatenate([floor, np.full(wall.size, 0.02)])
    hip = np.column_stack([x, np.concatenate([np.zeros(floor.size), wall]), np.full(x.size, height)])
    force = np.where((np.arange(x.size) < floor.size)[:, None], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0])
    force[np.searchsorted(floor, leans)] = [0.5, 0.5, 0.0]
    return recorded(hip, force=force)


def test_a_third_face_that_is_touched_between_two_samples_begins_no_switch():
    base = across_a_trough([-0.02 + 1.5 * STEP])
    (crossing,) = find_crossings(Observed(base, TROUGH), convex=False)
    np.testing.assert_array_equal(crossing.normal_pre, [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(crossing.normal_post, [-1.0, 0.0, 0.0])
    assert outcome("abrupt-switch", base, TROUGH) is PASS
    # Where the left wall is too far away to be touched, that force is the contact's own.
    assert outcome("abrupt-switch", across_a_trough([-0.015]), TROUGH) is FAIL
    # Beside a third face, the end of the trough, a switch that takes its time is one as well.
    late, beside = np.arange(0.0185, 0.02 - STEP, STEP), 0.05 - 0.5 * STEP
    assert outcome("abrupt-switch", across_a_trough(late[-1:], height=beside), TROUGH) is PASS
    assert outcome("abrupt-switch", across_a_trough(late, height=beside), TROUGH) is FAIL


@pytest.mark.parametrize("kind", ["cube", "l-block", "icosphere", "extruded"])
def test_the_rigid_tool_that_shows_the_edges_is_where_the_constraint_projection_is(kind):
    scene = Scene(model=make_model(kind))
    random = np.random.default_rng(5)
    hips = random.uniform(-0.08, 0.08, 3) + np.cumsum(0.012 * random.normal(size=(400, 3)), axis=0)
    _, features, tools = scene.model.boundary.rigid_tool(hips)
    ihips, _ = led(constraint(scene), hips, 1e-3)
    np.testing.assert_array_equal(tools, ihips)
    assert np.array_equal(features == IN_FREE_SPACE, (ihips == hips).all(axis=1))


@pytest.mark.parametrize("turn", [np.roll(np.eye(3), shift, axis=0) for shift in range(3)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_face_of_a_solid_is_one_from_which_an_edge_is_passed(turn, sign):
    base = over_the_top((1.0, 0.2))
    turned = recorded(sign * base.hip @ turn, sign * base.ihip @ turn)
    (crossing,) = find_crossings(Observed(turned, CUBE), convex=True)
    np.testing.assert_array_equal(crossing.normal_pre, sign * UP @ turn)
    assert outcome("broken-contact", turned, CUBE) is PASS


@pytest.mark.parametrize("roll", range(4))
@pytest.mark.parametrize("backwards", [False, True])
def test_every_face_may_be_the_first_or_the_second_at_a_concave_edge(roll, backwards):
    """Whichever number a face has: the facets of the mesh are numbered anew."""
    mesh = NOTCHED.model.boundary
    base = round_the_notch()
    rows = slice(None, None, -1 if backwards else 1)
    facets = (mesh.facets + roll) % (mesh.facets.max() + 1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mesh, "facets", facets)
        (crossing,) = find_crossings(Observed(recorded(base.hip[rows], base.ihip[rows]), NOTCHED), convex=False)
    assert crossing.turn == pytest.approx(0.5 * np.pi)


def test_the_mean_force_of_a_sample_in_which_the_next_contact_begins_does_not_remain_from_the_last():
    """Off the end of an L's foot, and then against its leg, which has the same normal: within a sample."""
    corners = np.array([[0.07, -0.03, 0.03], [0.04, -0.02, 0.03], [-0.02, 0.03, 0.02]])
    recording = ideal(NOTCHED).simulate(Path([0.0, 0.4, 0.8], corners), 1e-3)
    (crossing,) = find_crossings(Observed(recording, NOTCHED), convex=True)
    pushed = np.linalg.norm(recording.force, axis=1) > 0.0
    assert not pushed[crossing.crossed : crossing.end - 1].any()
    assert pushed[crossing.end - 1]
    assert outcome("broken-contact", recording, NOTCHED) is PASS
    stays = recording.force.copy()
    stays[crossing.end - 2] = stays[crossing.first + 10]
    assert outcome("broken-contact", changed(recording, force=stays), NOTCHED) is FAIL


@pytest.mark.parametrize(("height", "normals"), [(1e-5, [UP]), (0.0, []), (-1e-5, [(1.0, 0.0, 0.0)])])
def test_a_hand_that_comes_over_an_edge_in_the_plane_of_a_face_is_under_no_face_that_can_be_told(height, normals):
    """Along the top of a cube from outside, down, and out over the next side: did it go in through the top?"""
    over = 0.05 + height
    points = np.array([[0.08, 0.0, over], [0.03, 0.0, over], [0.03, 0.03, 0.049], [0.03, 0.07, 0.049]])
    hip = np.vstack([np.linspace(a, b, 500) for a, b in pairwise(points)])
    crossings = find_crossings(Observed(recorded(hip), CUBE), convex=True)
    assert [tuple(crossing.normal_pre) for crossing in crossings] == [tuple(normal) for normal in normals]


def test_a_rigid_tool_that_flies_over_a_ring_in_the_plane_of_its_top_is_not_held_by_the_bore():
    """It meets the ring from outside later: of the bore's wall, which its hand never went through, nothing is asked."""
    ring = [(0.1, -0.05), (0.1, 0.05), (0.0683, 0.05), (0.0683, -0.05)]
    corners = [[r * x, r * y, z] for r, z in ring for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    quads = [(4 * a + k, 4 * a + (k + 1) % 4, 4 * b + (k + 1) % 4, 4 * b + k) for a, b in RING for k in range(4)]
    nut = Scene(model=mesh(corners, [row for a, b, c, d in quads for row in ((a, b, c), (a, c, d))]))
    points = [[0.0, 0.007, 0.05], [-0.0773, 0.0843, 0.05], [-0.0306, 0.0377, -0.0161], [-0.0306, 0.0377, 0.093]]
    recording = ideal(nut).simulate(Path([0.0, 0.6, 1.2, 1.8], np.array(points)), 1e-3)
    assert [event["kind"] for event in recording.meta["events"]] == ["impact", "leave"]
    assert outcome("broken-contact", recording, nut) is not FAIL


def test_a_tool_that_came_in_through_an_edge_stays_on_either_face_for_as_long_as_it_is_inside():
    """In the plane of one side past the edge, then in that of the other, under both, and out through the top."""
    corners = [[0.05, 0.065, 0.012], [0.05, 0.0497, 0.012], [0.0497, 0.05, 0.012], [0.0475, -0.032, 0.012]]
    path = Path(0.6 * np.arange(5.0), [*corners, [0.036, -0.036, 0.056]])
    base = play(constraint(CUBE), path, 1e-3, scene=CUBE)
    on_side = (base.ihip[:, 0] == 0.05) & (base.hip[:, 0] < 0.049)
    assert on_side.any()
    assert outcome("broken-contact", base, CUBE) is NO
    # Of a hand that comes in under the other side alone, it is not where a rigid tool is.
    aside = base.hip - np.array([1e-3, 0.0, 0.0])
    ihip = np.where((base.force != 0.0).any(axis=1)[:, None], base.ihip, aside)
    assert outcome("broken-contact", recorded(aside, ihip), CUBE) is FAIL
