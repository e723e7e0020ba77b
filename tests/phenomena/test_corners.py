"""Broken contact and abrupt switch on recordings made by hand, with the fault's size known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made import FAIL, NO, PASS, UNDECIDED, changed, found, outcome, recorded

from hapticeval.geometry.catalogue import circle, from_vertices, star
from hapticeval.phenomena.measures.crossings import find_crossings
from hapticeval.phenomena.observed import Observed
from hapticeval.scene import Scene

SCENE = Scene(model=star())
TIP, NOTCH, NEXT_TIP = SCENE.model.curve.corners[:3]
STEP = 2e-5
BOTH = ("broken-contact", "abrupt-switch")
either_way = pytest.mark.parametrize("backwards", [False, True])


def over_the_tip(*, early=0.0, late=0.0, backwards=False):
    """5 mm under a face towards the tip; the force turns `early` metres before it or stays `late` metres after."""
    ahead, normal = (-TIP.tangent_post, TIP.normal_post) if backwards else (TIP.tangent_pre, TIP.normal_pre)
    x = np.arange(-0.02, 0.02, STEP) + STEP / 3
    hip = TIP.position + x[:, None] * ahead - 5e-3 * normal
    touching = (x <= late)[:, None]
    force = np.where(touching, 5.0 * normal, 0.0)
    force[(x > -early) & (x < 0)] = 5.0 * (TIP.normal_pre if backwards else TIP.normal_post)
    return recorded(hip, np.where(touching, hip + 5e-3 * normal, hip), force)


TO_TIP = (over_the_tip().hip - TIP.position) @ TIP.tangent_pre


@either_way
def test_a_force_that_keeps_to_the_corner_and_is_gone_passes(backwards):
    finding = found("broken-contact", over_the_tip(backwards=backwards), SCENE)
    assert finding.outcome is PASS
    assert "cause" not in finding.evidence


@either_way
@pytest.mark.parametrize("number", range(4))
def test_the_face_before_a_corner_reaches_to_the_corner_before(number, backwards):
    """Along a whole side of a rectangle, long or short, and over its end."""
    model = from_vertices([[0.0, 0.0], [0.2, 0.0], [0.2, 0.05], [0.0, 0.05]])
    corner = model.curve.corners[number]
    ahead, normal = corner.tangent_pre, corner.normal_pre
    if backwards:
        ahead, normal = -corner.tangent_post, corner.normal_post
    x = np.arange(-np.abs(ahead) @ [0.19, 0.04], 0.01, 1e-4) + 3e-5
    hip = corner.position + x[:, None] * ahead - 2e-3 * normal
    touching = (x <= 0.0)[:, None]
    run = recorded(hip, np.where(touching, hip + 2e-3 * normal, hip), np.where(touching, 2.0 * normal, 0.0))
    scene = Scene(model=model)
    assert outcome("broken-contact", run, scene) is PASS
    (crossing,) = find_crossings(Observed(run, scene), convex=True)
    assert crossing.tool[x <= 0.0].all()


@given(distance=st.floats(2e-4, 0.015), backwards=st.booleans())
@settings(max_examples=30)
def test_how_far_too_early_or_too_late_is_measured(distance, backwards):
    for kind, words in (("early", "before"), ("late", "past")):
        finding = found("broken-contact", over_the_tip(**{kind: distance}, backwards=backwards), SCENE)
        assert finding.outcome is FAIL
        assert finding.metric.value == pytest.approx(distance, abs=1.1 * STEP)
        assert words in finding.message


def test_a_force_that_is_there_to_the_end_of_the_recording_is_shown_in_its_last_tick():
    finding = found("broken-contact", over_the_tip(late=1.0), SCENE)
    assert finding.evidence["tick"] == TO_TIP.size - 1
    assert finding.evidence["ticks_to_zero_after_corner"] == np.sum(TO_TIP > 0.0)


def test_a_rigid_tool_on_which_the_hand_rests_before_the_corner_has_lost_nothing():
    deep = over_the_tip()
    on_face = deep.hip + 5e-3 * TIP.normal_pre
    resting = ((TO_TIP > -0.012) & (TO_TIP < -0.008))[:, None]
    rigid = recorded(on_face, on_face, np.where(resting, 0.0, deep.force))
    assert outcome("broken-contact", rigid, SCENE) is PASS
    assert outcome("broken-contact", changed(deep, force=np.where(resting, 0.0, deep.force)), SCENE) is FAIL


BLUNT = Scene(model=from_vertices([[-0.1, 0.0], [-0.1, -0.1], [0.15, -0.1], [0.15, -0.009], [0.0, 0.0]]))
"""A corner of 3.4 degrees at the origin."""


@pytest.mark.parametrize(
    ("height", "lean", "expected"), [(1e-5, 0.0, PASS), (1e-5, 0.01, FAIL), (5e-3, 0.0, FAIL), (None, 0.0, FAIL)]
)
def test_a_rigid_tool_that_hops_from_face_to_face_within_ticks_leaves_no_force_behind(height, lean, expected):
    """4 mm a tick: off the face at each sample and struck between them. A tool a step off, or in its first face's
    plane with its force, is not, nor is a force that leans from every normal there by 0.6 degrees."""
    x = np.arange(-0.0499, 0.05, 4e-3)
    past = x > 0.0
    post = np.array([0.009, 0.15]) / np.hypot(0.009, 0.15)
    hip = np.column_stack([x, np.where(past, -0.06 * x, 0.0)])
    normal = np.array([0.0, 1.0])
    if height is not None:
        hip += np.where(past[:, None], height * post, 0.0)
        normal = post + lean * np.array([post[1], -post[0]])
    else:
        hip[:, 1] = 0.0
    hopping = recorded(hip, hip, 5.0 * np.where(past[:, None], normal, [0.0, 1.0]))
    assert outcome("broken-contact", hopping, BLUNT) is expected


def test_a_force_that_fades_before_the_corner_is_not_kept():
    base = over_the_tip()
    fading = changed(base, force=base.force * np.clip(-TO_TIP / 0.02, 1e-4, 1.0)[:, None])
    finding = found("broken-contact", fading, SCENE)
    assert finding.outcome is FAIL
    assert "falls below half" in finding.message
    gone = found("broken-contact", changed(base, force=base.force * (TO_TIP < -3e-3)[:, None]), SCENE)
    assert "the force is lost 2.9" in gone.message


def test_a_force_that_comes_back_from_the_face_that_was_left_fails():
    base = over_the_tip()
    back = (TO_TIP > 2e-3) & (TO_TIP < 6e-3)
    force, ihip = np.array(base.force), np.array(base.ihip)
    force[back], ihip[back] = 5.0 * TIP.normal_pre, base.hip[back] + 5e-3 * TIP.normal_pre
    finding = found("broken-contact", changed(base, force=force, ihip=ihip), SCENE)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(6e-3, abs=1e-4)


TEETH = np.array([[-5, -5], [-2, -5], [-2, 0], [2, 0], [2, -5], [5, -5], [5, 5], [-5, 5]]) / 1e2
COMB = Scene(model=from_vertices(TEETH))
"""A comb of two teeth with a gap of 40 mm between them, in which both have faces of normals (1, 0) and (-1, 0)."""


def behind_the_tooth(faces):
    """Leftwards through the right tooth and the gap, 5 mm into the left one, and down past that one's end.

    The tool is on the face at x = `faces` (m) of the normal (1, 0), as a function of the way down (n,), m; nan is none.
    """
    across = np.arange(0.06, -0.025, -STEP)
    down = np.arange(0.0, 0.04, STEP) + STEP / 3
    x, way = np.append(across, np.full(down.size, -0.025)), np.append(np.zeros(across.size), down)
    hip = np.column_stack([x, -0.03 - way])
    face = np.where(x > 0.05, np.nan, faces(way))
    ihip = np.column_stack([np.where(np.isnan(face) | (face < x), x, face), hip[:, 1]])
    return recorded(hip, ihip)


@pytest.mark.parametrize("begins", [0, 1, 2])
def test_a_tool_that_another_part_of_the_solid_holds_is_not_asked_of_the_face_that_the_hand_is_under(begins):
    """The outer face of the right tooth bars the way all the time, and beyond the end of both the tool is free."""
    right = behind_the_tooth(lambda way: np.where(way <= 0.02, 0.05, np.nan))
    finding = found("broken-contact", right, Scene(model=from_vertices(np.roll(TEETH, -begins, axis=0))))
    assert finding.outcome is NO
    assert "another face" in finding.message


def test_without_an_ihip_the_force_shows_which_face_the_tool_is_on():
    base = over_the_tip()
    touching = (TO_TIP <= 0.0)[:, None]
    assert outcome("broken-contact", changed(base, ihip=base.hip), SCENE) is PASS
    other = changed(base, ihip=base.hip, force=np.where(touching, 5.0 * TIP.normal_post, 0.0))
    finding = found("broken-contact", other, SCENE)
    assert (finding.outcome, "another face" in finding.message) == (NO, True)


def test_a_tool_may_be_past_the_corner_by_the_declared_resolution():
    """A chamfer of its representation: 0.5 mm before the corner it is 0.2 mm past it, with the force of this face."""
    base = over_the_tip()
    near = ((TO_TIP > -5e-4) & (TO_TIP <= 0.0))[:, None]
    ihip = np.where(near, TIP.position + 2e-4 * TIP.tangent_post, base.ihip)
    finding = found("broken-contact", changed(base, ihip=ihip), SCENE)
    assert (finding.outcome, "another face pushes" in finding.message) == (FAIL, True)
    assert outcome("broken-contact", changed(base, {"resolution": 1e-3}, ihip=ihip), SCENE) is PASS


def test_where_nothing_is_felt_behind_the_tooth_nothing_is_decided():
    right = behind_the_tooth(lambda way: np.where(way <= 0.02, 0.05, np.nan))
    assert outcome("broken-contact", changed(right, force=0.0 * right.force, ihip=right.hip), COMB) is UNDECIDED


@pytest.mark.parametrize("back", [0.05, np.nan])
def test_a_tool_that_comes_to_the_face_and_leaves_it_again_breaks_the_law(back):
    """It pops through to the near tooth, where it is asked for from then on, and back, or lets go, 8 mm early."""
    near = behind_the_tooth(lambda way: np.select([way <= 5e-3, way <= 0.02], [0.05, -0.02], np.nan))
    assert outcome("broken-contact", near, COMB) is PASS
    pops = behind_the_tooth(
        lambda way: np.select([way <= 5e-3, way <= 0.012, way <= 0.02], [0.05, -0.02, back], np.nan)
    )
    finding = found("broken-contact", pops, COMB)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(8e-3, abs=2 * STEP)
    assert ("lost" if np.isnan(back) else "another face pushes") in finding.message


def round_the_notch(*, depth=5e-3, spread=0.0, backwards=False):
    """Along the faces of the notch `depth` under them, the force turning over a `spread` of the arc below."""
    first = np.arctan2(NOTCH.normal_pre[1], NOTCH.normal_pre[0])
    arc = np.arange(0.0, abs(NOTCH.turn), STEP / depth) / abs(NOTCH.turn)
    x = np.arange(-0.02, 0.0, STEP)[:, None]

    def direction(share):
        angle = first + np.asarray(share) * NOTCH.turn
        return np.column_stack([np.cos(angle), np.sin(angle)])

    before, after = NOTCH.position + x * NOTCH.tangent_pre, NOTCH.position - x[::-1] * NOTCH.tangent_post
    ihip = np.vstack([before, np.tile(NOTCH.position, (arc.size, 1)), after])
    place = np.concatenate([np.zeros(len(x)), arc, np.ones(len(x))])
    turned = np.clip((place - 0.5) / spread + 0.5, 0.0, 1.0) if spread else (place > 0.5).astype(float)
    order = slice(None, None, -1 if backwards else 1)
    return recorded((ihip - depth * direction(place))[order], ihip[order], 1e3 * depth * direction(turned)[order])


@given(depth=st.floats(2e-3, 0.012), spread=st.floats(0.2, 1.0), backwards=st.booleans())
@settings(max_examples=30)
def test_the_travel_of_the_switch_is_measured_in_depths(depth, spread, backwards):
    finding = found("abrupt-switch", round_the_notch(depth=depth, spread=spread, backwards=backwards), SCENE)
    assert finding.outcome is FAIL
    wanted = 0.9 * spread * abs(NOTCH.turn)
    assert finding.metric.value == pytest.approx(wanted, abs=4 * STEP / depth)
    assert finding.evidence["switch_takes_s"] == pytest.approx(wanted * depth / STEP * 1e-3, abs=5e-3)


@either_way
def test_a_switch_at_one_point_passes_and_one_that_flickers_does_not(backwards):
    base = round_the_notch(backwards=backwards)
    assert outcome("abrupt-switch", base, SCENE) is PASS
    force = np.array(base.force)
    force[600:900:2] = 5.0 * (NOTCH.normal_pre if backwards else NOTCH.normal_post)
    assert outcome("abrupt-switch", changed(base, force=force), SCENE) is FAIL


@pytest.mark.parametrize(("spread", "expected"), [(0.0, PASS), (0.5, FAIL)])
def test_while_nothing_pushes_no_force_turns(spread, expected):
    """A tool may fly on along the first face, and be met by the second; what leans before and after is no less late."""
    base = round_the_notch(spread=spread)
    force = np.array(base.force)
    middle = len(base) // 2
    force[middle - 20 : middle + 20] = 0.0
    assert outcome("abrupt-switch", changed(base, force=force), SCENE) is expected


def test_a_face_touched_on_the_way_is_not_taken_for_the_face_before_the_corner():
    """Along a face, round the notch and on over the next tip: the corner before the notch is none of its business."""
    notch = round_the_notch(depth=2e-3)
    start, ahead = notch.hip[-1], NEXT_TIP.tangent_pre
    hip = start + (np.arange(0.0, float((NEXT_TIP.position - start) @ ahead) + 0.01, STEP) + STEP / 3)[:, None] * ahead
    before = ((hip - NEXT_TIP.position) @ ahead <= 0.0)[:, None]
    ihip = np.where(before, hip + 2e-3 * NEXT_TIP.normal_pre, hip)
    whole = recorded(np.vstack([notch.hip, hip]), np.vstack([notch.ihip, ihip]))
    force = np.vstack([notch.force, 1e3 * (ihip - hip)])
    assert {outcome(check, changed(whole, force=force), SCENE) for check in BOTH} == {PASS}


def test_where_no_force_is_felt_nothing_is_decided():
    for check, shown in (("broken-contact", over_the_tip()), ("abrupt-switch", round_the_notch())):
        nothing = changed(shown, force=np.zeros_like(shown.force), ihip=shown.hip)
        assert outcome(check, nothing, SCENE) is UNDECIDED


def test_a_path_without_the_scenario_is_not_applicable():
    tip, notch = over_the_tip(), round_the_notch(spread=1.0)
    assert {outcome(check, tip, Scene(model=circle())) for check in BOTH} == {NO}
    assert outcome("broken-contact", changed(tip, rows=slice(0, 500)), SCENE) is NO, "turns back before the tip"
    assert outcome("broken-contact", notch, SCENE) is NO, "passes no tip"
    assert outcome("abrupt-switch", changed(notch, rows=slice(0, 800)), SCENE) is NO, "along one face"
    assert outcome("abrupt-switch", tip, SCENE) is NO, "passes no notch"


def square(points, *, force):
    """Through corners in mm at 20 um a tick, on a square of 100 mm; `force` (n, 2) of the HIPs (n, 2)."""
    corners = np.array(points) / 1e3
    ways = [np.linspace(a, b, max(int(np.linalg.norm(b - a) / STEP), 2)) for a, b in pairwise(corners)]
    hip = np.vstack(ways)
    felt = force(hip)
    return recorded(hip, hip + felt / 1e3, felt)


BOX = Scene(model=from_vertices([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]]))


def up(hip):
    """The force of the upper face up to its right corner, as a rigid tool on that face feels it; none elsewhere."""
    under = np.clip(0.05 - hip[:, 1], 0.0, None) * (hip[:, 0] <= 0.05)
    return np.column_stack([np.zeros(len(hip)), 1e3 * under])


def test_a_corner_that_the_hand_passes_inside_of_the_model_is_none():
    """A rigid tool goes round the corner there: its force stays, and that is right."""
    round_inside = square([[0, 60], [0, 30], [49, 30], [49, 0]], force=up)
    assert outcome("broken-contact", round_inside, BOX) is NO


def test_a_hand_that_comes_from_within_is_not_on_the_face():
    """From the left face through the middle: the left face keeps the tool, and nothing is known of the upper one."""
    from_left = square([[-60, 0], [0, 0], [20, 40], [60, 40]], force=lambda hip: np.zeros_like(hip))
    in_above = square([[20, 60], [20, 40], [60, 40]], force=lambda hip: np.zeros_like(hip))
    assert outcome("broken-contact", from_left, BOX) is UNDECIDED
    assert outcome("broken-contact", in_above, BOX) is UNDECIDED
    assert outcome("broken-contact", square([[20, 60], [20, 40], [60, 40]], force=up), BOX) is PASS


def test_a_tool_beside_the_corner_that_stays_on_the_other_face_is_not_asked_for_this_one():
    """Through the right face beside the corner, up over the upper one, down again and out, held by the right face."""

    def aside(hip):
        return np.column_stack([1e3 * np.clip(0.05 - hip[:, 0], 0.0, None), np.zeros(len(hip))])

    beside = [[50.2, 49.96], [49.96, 49.96], [49.96, 50.02], [49.96, 49.97], [51, 49.97]]
    assert outcome("broken-contact", square(beside, force=aside), BOX) is NO
    below = [[51, 50.2], [49.7, 50.2], [49.7, 49.97], [51, 49.97]]
    assert outcome("broken-contact", square(below, force=up), BOX) is PASS, "on the upper face itself"


def test_a_slope_under_the_face_is_no_loss_of_force():
    """Ever deeper, a spring's first force is far below the usual one; lost it is only where it is gone."""
    deeper = square([[0, 51], [30, 45], [60, 40]], force=up)
    assert outcome("broken-contact", deeper, BOX) is PASS
    lost = square([[0, 51], [30, 45], [60, 40]], force=lambda hip: up(hip) * (hip[:, :1] < 0.04))
    assert outcome("broken-contact", lost, BOX) is FAIL


def test_the_worst_of_several_crossings_counts():
    there_and_again = [[20, 60], [20, 40], [60, 40], [60, 60], [20, 60], [20, 40], [60, 40]]

    def second_lost(hip):
        late = np.arange(len(hip)) > len(hip) // 2
        return up(hip) * ~(late & (hip[:, 0] > 0.045))[:, None]

    assert outcome("broken-contact", square(there_and_again, force=up), BOX) is PASS
    assert outcome("broken-contact", square(there_and_again, force=second_lost), BOX) is FAIL


@pytest.mark.parametrize("ticks", [0, 1, 3, 4, 7])
def test_how_many_ticks_a_force_of_whatever_direction_remains_past_the_corner_is_counted(ticks):
    """Three ticks of lag are granted, and no fourth."""
    base = over_the_tip()
    past = int(np.argmax(TO_TIP > 0.0))
    force = np.array(base.force)
    force[past : past + ticks] = 5.0 * TIP.normal_post
    finding = found("broken-contact", changed(base, force=force), SCENE)
    assert finding.evidence["ticks_to_zero_after_corner"] == ticks
    assert finding.evidence["remains_after_corner_m"] == pytest.approx(TO_TIP[past + ticks - 1] if ticks else 0.0)
    assert finding.outcome is (FAIL if ticks > 3 else PASS)


@pytest.mark.parametrize("leans", [slice(0, 5), slice(-5, None)])
def test_a_force_that_leans_as_it_comes_or_goes_is_no_part_of_the_switch(leans):
    for spread in (0.0, 0.5):
        base = round_the_notch(spread=spread)
        force = np.array(base.force)
        force[leans] = 2.0 * NOTCH.tangent_pre
        leaning, upright = (found("abrupt-switch", each, SCENE) for each in (changed(base, force=force), base))
        assert leaning.outcome is upright.outcome
        assert leaning.metric.value == pytest.approx(upright.metric.value, abs=1e-9)


@pytest.mark.parametrize(("ticks", "crossings"), [(2, 1), (1, 1), (0, 0)])
def test_one_tick_under_the_first_face_shows_whence_the_hand_comes_and_none_does_not(ticks, crossings):
    """The recording begins so many ticks before the zone of the corner between the two faces."""
    notch = round_the_notch()
    zone = int(np.argmax((notch.hip - NOTCH.position) @ NOTCH.tangent_pre > -1e-9))
    begun = changed(notch, rows=slice(zone - ticks, None))
    assert len(find_crossings(Observed(begun, SCENE), convex=False)) == crossings
    back_again = recorded(np.vstack([begun.hip, notch.hip[::-1]]), np.vstack([begun.ihip, notch.ihip[::-1]]))
    assert len(find_crossings(Observed(back_again, SCENE), convex=False)) == crossings + 1
