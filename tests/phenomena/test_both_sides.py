"""A recording on each side of a threshold that decides: just within it and just beyond."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import FAIL, NO, PASS, UNDECIDED, changed, found, outcome, recorded
from scipy.linalg import expm
from test_corners import NOTCH, SCENE, round_the_notch
from test_dynamic_checks import CIRCLE, EXPERIMENT, LINE
from test_dynamic_checks import run as run_law
from test_forces import PLANE, ROUND, collision, orbit

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.centripetal_force import assigned_response
from hapticeval.phenomena.decisions import (
    DIED_OUT_SHARE,
    HOLD_TICKS,
    RETURN_RATIO,
    SLIDE_SHARE,
    STATIC_SHARE,
    TELLING_SHARE,
)
from hapticeval.phenomena.inherent import Region, region_of
from hapticeval.phenomena.measures.jumps import largest_jump
from hapticeval.phenomena.measures.surface_motion import SurfaceMotion
from hapticeval.phenomena.observed import Observed
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene


def orbits(share, *, noise=0.0, speed=0.5):
    """Round the circle at three speeds with `share` of the centripetal force paid for by position error."""
    rows = {factor: orbit(share, speed=speed * factor, noise=noise) for factor in (1.0, 0.75, 0.5)}
    return Runs(rows[1.0], at_speed=rows.__getitem__)


def test_the_fastest_of_the_speeds_decides_how_far_the_normal_turns_in_a_tick():
    finding = found("centripetal-force", orbits(0.5), ROUND)
    assert finding.bound == pytest.approx(HOLD_TICKS * 0.5 / 0.1 * 1e-3, rel=1e-3), "kappa v T at 0.5 m/s"


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("errors", "decides"), [(1.5, False), (1.9, False), (2.1, True), (2.5, True)])
def test_within_two_standard_errors_of_the_bound_the_share_is_undecided(side, errors, decides):
    """The fit is linear: what is added to the share comes out of it."""
    noise = 2e-5
    first = found("centripetal-force", orbits(0.0, noise=noise), ROUND)
    top = first.evidence["kappa_v2_m_over_K_m"]
    share = first.evidence["centripetal_error_m"] / top
    wanted = first.bound + side * errors * first.evidence["standard_error"]
    finding = found("centripetal-force", orbits(wanted - share, noise=noise), ROUND)
    missing = finding.evidence.get("force_missing_at_zero_error", 0.0)
    assert missing <= finding.bound, "what the force lacks at the start decides nothing here"
    assert finding.outcome is ((FAIL if side > 0.0 else PASS) if decides else UNDECIDED)


def test_the_message_has_the_share_and_what_it_costs():
    finding = found("centripetal-force", orbits(0.5), ROUND)
    share, top = finding.metric.value, finding.evidence["kappa_v2_m_over_K_m"]
    assert share == pytest.approx(0.5, rel=0.01)
    assert top == pytest.approx(10.0 * 0.5**2 * 0.1 / 50.0, rel=0.01), "m kappa v^2 / K"
    words = (
        f"{100.0 * share:.3g} per cent of the centripetal force comes from position error: {1e3 * share * top:.3g} mm"
    )
    assert finding.message == f"{words} at the top speed"


@pytest.mark.parametrize(("speed", "decides"), [(6.6, True), (6.7, False)])
def test_a_bound_above_a_tenth_tells_nothing(speed, decides):
    """1.5 kappa v T is a tenth at 6.67 m/s round 0.1 m."""
    found_there = found("centripetal-force", orbits(0.5, speed=speed), ROUND)
    assert (found_there.bound <= TELLING_SHARE) is decides
    assert found_there.outcome is (FAIL if decides else UNDECIDED)


@pytest.mark.parametrize(("count", "expected"), [(7, UNDECIDED), (8, NO)])
def test_eight_samples_are_the_least_from_which_a_share_is_told(count, expected):
    """In eight on a line there is nothing to be told either, which is known then."""
    along = np.column_stack([np.linspace(0.0, 0.01, count), np.zeros(count)])
    moves = {"velocity": np.tile([0.1, 0.0], (count, 1)), "operator_force": np.zeros((count, 2))}
    base = recorded(along, force=np.zeros((count, 2)), meta=EXPERIMENT, **moves)
    assert outcome("centripetal-force", base, LINE) is expected


@given(damping=st.sampled_from([0.5, 4.0, 30.0]), seed=st.integers(0, 99))
def test_a_cost_counts_as_the_assigned_dynamics_answer_to_it(damping, seed):
    """m n'' + K_d n' + K_p n = f under a force that is held from sample to sample, from equilibrium with the first."""
    scene, dt = Scene(model=LINE.model, stiffness=50.0, damping=damping, mass=0.1, bilateral=True), 1e-3
    force = np.cumsum(np.random.default_rng(seed).standard_normal(60))
    base = recorded(np.zeros((force.size, 2)), dt=dt)
    motion = np.array([[0.0, 1.0, 0.0], [-500.0, -damping / 0.1, 10.0], [0.0, 0.0, 0.0]])
    step, state, expected = expm(motion * dt), np.array([force[0] / 50.0, 0.0, 0.0]), []
    for push in force:
        expected.append(state[0])
        state = step @ np.array([state[0], state[1], push])
    np.testing.assert_allclose(assigned_response(force, Observed(base, scene)), expected, rtol=1e-7, atol=1e-12)


def test_what_the_push_may_give_a_tool_while_the_normal_turns_is_granted_to_a_collision():
    """Round 0.1 m at 0.1 m/s the normal turns by 4 mrad within the four ticks that a collision may take."""
    flat = collision(ticks=4)
    angle = 1e-3 * np.arange(len(flat))
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    along = np.column_stack([-out[:, 1], out[:, 0]])
    force = flat.force[:, 1:] * out
    moves = {"velocity": 0.1 * along + flat.velocity[:, 1:] * out}
    ihip = np.where(flat.force[:, 1:] > 0.0, 0.1 * out, 0.101 * out)
    bounds = []
    for push in (0.0, 0.02):
        base = recorded(0.101 * out, ihip, force, meta=flat.meta, operator_force=push * along, **moves)
        bounds.append(found("impulsive-collision", base, Scene(model=ROUND.model)).bound)
    given = 4 * 0.02 * 1e-3
    assert bounds[1] - bounds[0] == pytest.approx(given * 4e-3 / 0.1 / 0.3, rel=0.05)


def flickering(first, last):
    """The force turns at the notch, and is that of the first face once more from so many ticks after to so many after.

    In the thirty ticks before it is of neither face, so that the first face is left there.
    """
    base = round_the_notch(depth=5e-3)
    force = np.array(base.force)
    turned = int(np.argmax(np.abs(force[:, 0] - force[0, 0]) > 1e-9))
    force[turned - 30 : turned] = 2.5 * (NOTCH.normal_pre + NOTCH.normal_post)
    force[turned + first : turned + last] = force[0]
    return changed(base, force=force), turned


@pytest.mark.parametrize(
    ("first", "last", "ends"),
    [(2, 2, 0), (2, 3, 0), (2, 4, 0), (2, 14, 14)],
    ids=["not at all", "one tick", "two ticks", "farther than three HIP steps"],
)
def test_what_flickers_at_one_place_is_one_switch_which_ends_where_the_force_turned(first, last, ends):
    flicker, turned = flickering(first, last)
    evidence = found("abrupt-switch", flicker, SCENE).evidence
    assert evidence["time"] == pytest.approx((turned + ends) * 1e-3)
    assert evidence["switch_starts_s"] == pytest.approx((turned - 31) * 1e-3)


def off_the_line(late):
    """A tool that is 10 mm off for the first half of a run of 2 s, and then as `late` says, in units of 10 mm."""
    time = np.arange(2001) * 1e-3
    n = 0.01 * np.where(time > 1.0, late(time), 1.0)
    hip = np.column_stack([3.0 * time, n])
    return recorded(hip, force=0.0 * hip, meta=EXPERIMENT, velocity=np.tile([3.0, 0.0], (time.size, 1)))


@pytest.mark.parametrize(("ratio", "expected"), [(0.99 * RETURN_RATIO, PASS), (1.01 * RETURN_RATIO, FAIL)])
def test_what_falls_as_one_over_the_root_of_time_is_between_staying_and_coming(ratio, expected):
    assert outcome("constraint-stability", off_the_line(lambda time: ratio), LINE) is expected


@pytest.mark.parametrize(
    ("late", "words"),
    [
        (lambda time: 1.45, "the distance grows: 10 mm, then 14.5 mm"),
        (lambda time: 1.0 - 0.45 * (time > 1.5), "the tool stands 10 mm off the surface and comes no nearer"),
        (lambda time: 1.0 - 0.55 * (time > 1.5), "the tool does not come to the surface: up to 10 mm off, then up to"),
        (lambda time: np.where(time > 1.5, -0.45, 1.0), "the tool does not come to the surface"),
        (lambda time: np.where(time > 1.5, -0.55, 1.0), "the tool swings about the surface, 10 mm to either side, and"),
        (lambda time: np.where(time > 1.5, 0.55, -1.0), "the tool swings about the surface, 10 mm to either side, and"),
        (
            lambda time: np.where(time > 1.5, -1.005, 1.0),
            "the tool swings about the surface, 10.1 mm to either side, and is",
        ),
        (
            lambda time: np.where(time > 1.5, -1.02, 1.0),
            "the tool swings about the surface, 10.2 mm to either side, after",
        ),
    ],
)
def test_in_what_way_a_tool_does_not_come_is_said(late, words):
    finding = found("constraint-stability", off_the_line(late), LINE)
    assert finding.outcome is FAIL
    assert finding.message.startswith(words)


@pytest.mark.parametrize(("count", "expected"), [(7, UNDECIDED), (8, FAIL)])
def test_eight_samples_are_the_least_in_which_a_tool_can_stay(count, expected):
    """Of a scene whose dynamics would have died out in them."""
    scene = Scene(model=LINE.model, stiffness=1e5, damping=200.0, mass=0.1, bilateral=True)
    base = changed(off_the_line(lambda time: 1.0), rows=slice(count))
    finding = found("constraint-stability", base, scene)
    assert finding.outcome is expected, finding.message
    assert ("too short to decide" in finding.message) == (expected is UNDECIDED)


def moves_across(height):
    """Round the circle, the tool `height` m off it, with no force recorded: one recording alone."""
    time = np.arange(1001) * 1e-3
    n = height * np.exp(-10.0 * time)
    out = np.column_stack([np.cos(5.0 * time), np.sin(5.0 * time)])
    along = np.column_stack([-out[:, 1], out[:, 0]])
    velocity = -10.0 * n[:, None] * out + 5.0 * (1.0 + n)[:, None] * along
    force = -0.1 * 25.0 * out
    return recorded((1.0 + n)[:, None] * out, force=force, meta=EXPERIMENT, velocity=velocity)


@pytest.mark.parametrize(("share", "asked"), [(0.9, False), (1.1, True)])
def test_a_tool_that_is_no_farther_off_than_a_held_force_lets_it_does_not_move_across(share, asked):
    held = SurfaceMotion(Observed(moves_across(1e-4), CIRCLE)).held_distance()
    finding = found("decoupling", moves_across(share * held), CIRCLE)
    assert (finding.message != "the tool does not move across the surface") is asked


@pytest.mark.parametrize(("off", "asked"), [(0.9e-9, False), (1.1e-9, True)])
def test_rounding_is_no_motion_across(off, asked):
    """A billionth of the model's size, 2 m, on a line along which no force has to turn."""
    size = LINE.model.size
    time = np.arange(1001) * 1e-3
    hip = np.column_stack([time, off * size * np.exp(-10.0 * time)])
    base = recorded(hip, force=0.0 * hip, meta=EXPERIMENT, velocity=np.gradient(hip, 1e-3, axis=0))
    assert (found("decoupling", base, LINE).message != "the tool does not move across the surface") is asked


@pytest.mark.parametrize(("share", "felt"), [(0.0, False), (0.9e-9, False), (1.1e-9, True)])
def test_an_operators_force_that_adds_up_to_rounding_is_not_felt(share, felt):
    """A billionth of the momentum, in all of the run: a force that is told from its change has its rounding."""
    base = moves_across(1e-4)
    momentum = CIRCLE.mass * np.linalg.norm(base.velocity, axis=1).max()
    push = np.zeros_like(base.hip)
    push[:, 0] = share * momentum / (len(base) * base.dt)
    assert SurfaceMotion(Observed(changed(base, operator_force=push), CIRCLE)).pushed.any() == felt


def test_what_the_sensors_are_wrong_by_is_no_motion_across():
    base = moves_across(1e-3)
    farther = changed(base, measured_hip=base.hip + np.array([2e-3, 0.0]))
    messages = [found("decoupling", each, CIRCLE).message for each in (base, farther)]
    assert [message == "the tool does not move across the surface" for message in messages] == [False, True]


def test_one_recording_alone_is_granted_what_a_held_force_may_have_given_until_the_tool_is_home():
    base = moves_across(1e-2)
    motion = SurfaceMotion(Observed(base, CIRCLE))
    finding = found("decoupling", Runs(base), CIRCLE)
    home = int(np.flatnonzero(motion.distance > DIED_OUT_SHARE * motion.distance[0])[-1])
    assert finding.evidence["settled_by_refinement"] is False
    assert finding.evidence["moves_across_until_s"] == pytest.approx(base.time[home])
    assert finding.bound == pytest.approx(motion.held_speed[home] / 5.0 + 1e-9, rel=1e-12)


def test_one_recording_alone_is_granted_what_a_held_force_may_have_given_to_the_speed():
    base = moves_across(1e-2)
    motion = SurfaceMotion(Observed(base, CIRCLE))
    finding = found("tangential-dynamics", Runs(base), CIRCLE)
    assert finding.bound == pytest.approx(motion.held_speed[-1] / motion.foot_speed.max() + 1e-9, rel=1e-12)


@pytest.mark.parametrize(("share", "slides"), [(0.9, False), (1.1, True)])
def test_a_foot_that_goes_no_farther_than_a_share_of_the_model_does_not_slide(share, slides):
    speed = share * SLIDE_SHARE * CIRCLE.model.size
    base = run_law("set-stabilisation", CIRCLE, (1.01, 0.0), (0.0, 1.01 * speed), 1.0, 1e-3)
    for check in ("decoupling", "tangential-dynamics"):
        assert (found(check, base, CIRCLE).message != "the tool does not slide") is slides, check


TIP = SCENE.model.curve.corners[0]
ASIDE = np.array([-TIP.position[1], TIP.position[0]]) / np.linalg.norm(TIP.position)


@pytest.mark.parametrize(
    ("place", "region"),
    [
        (TIP.position + 1e-3 * TIP.normal_pre, Region.FREE),
        (0.999 * TIP.position, Region.CONVEX),
        (0.98 * NOTCH.position, Region.CONCAVE),
        (0.8 * TIP.position, Region.MEDIAL),
        (0.8 * TIP.position + 1e-3 * ASIDE, Region.SURFACE),
    ],
)
def test_a_place_has_the_region_of_the_model_there(place, region):
    """The hand goes by in steps of 0.1 mm, aside: of the tips the axis is a medial one."""
    hips = place + np.outer([-1.5e-4, -0.5e-4, 0.5e-4], ASIDE)
    assert region_of(Observed(recorded(hips), SCENE), 2) is region


def test_the_nearest_point_jumps_from_notch_to_notch_on_the_medial_axis():
    here, there = (corner.position for corner in SCENE.model.curve.corners[1:4:2])
    across = (there - here) / np.linalg.norm(there - here)
    hips = 0.2 * (here + there) + np.outer([-0.5e-4, 0.5e-4], across)
    np.testing.assert_allclose(SCENE.model.boundary.closest_point(hips).foot, [here, there], atol=1e-12)
    assert region_of(Observed(recorded(hips), SCENE), 1) is Region.MEDIAL


def test_what_happened_a_tick_before_is_of_that_tick():
    """The hand crosses the axis of a tip between the first two of three ticks."""
    base = recorded(0.8 * TIP.position + np.outer([-0.5e-4, 0.5e-4, 1.5e-4], ASIDE))
    assert [region_of(Observed(base, SCENE), tick) for tick in range(3)] == [
        Region.SURFACE,
        Region.MEDIAL,
        Region.SURFACE,
    ]


@pytest.mark.parametrize(("steps", "there"), [(2.9, True), (3.1, False)])
def test_a_corner_is_as_near_as_a_contact_point_can_be_placed(steps, there):
    """The foot is so many steps of the hand from the tip."""
    hip = TIP.position - steps * 1e-4 * TIP.tangent_pre - 1e-5 * TIP.normal_pre
    hips = np.array([hip + 1e-4 * TIP.tangent_pre, hip])
    assert (region_of(Observed(recorded(hips), SCENE), 1) is Region.CONVEX) is there


@pytest.mark.parametrize(("standoff", "region"), [(4e-5, Region.FREE), (6e-5, Region.SURFACE)])
def test_three_steps_of_the_hand_and_the_standoff_in_front_of_a_face_are_on_it(standoff, region):
    hips = np.column_stack([1e-4 * np.arange(3), np.full(3, 3.5e-4)])
    assert region_of(Observed(recorded(hips, meta={"standoff": standoff}), PLANE), 2) is region


@pytest.mark.parametrize(("push", "share", "judged"), [(4.0, 0.09, True), (4.0, 0.11, False), (0.25, 0.09, True)])
def test_a_tool_rests_whose_momentum_may_hide_less_than_a_tenth_of_the_push(push, share, judged):
    """A tool that trembles at v may be given 2 m v in the window of the last rows."""
    rows, window = 1000, int(STATIC_SHARE * 1000)
    trembling = 0.5 * share * push * (window - 1) * 1e-3 / PLANE.mass * np.where(np.arange(rows) % 2, 1.0, -1.0)
    up = np.tile([0.0, 1.0], (rows, 1))
    base = recorded(
        -push / 1e3 * up,
        0.0 * up,
        push * up,
        meta={"source": "experiment"},
        velocity=trembling[:, np.newaxis] * up,
        operator_force=-push * up,
    )
    finding = found("contact-normal-force", base, PLANE)
    assert finding.outcome is PASS
    assert ("equal at rest" in finding.message) is judged


def test_the_step_of_a_hand_is_that_in_contact():
    """1 mm a tick in free space and into contact, 0.1 mm in it."""
    height = np.array([3.0, 2.0, 1.0, -0.5, -0.6, -0.7, -0.6])
    hip = 1e-3 * np.column_stack([np.zeros(7), height])
    ihip = np.where(hip[:, 1:] < 0.0, 0.0, hip)
    assert Observed(recorded(hip, ihip), PLANE).hip_step == pytest.approx(1e-4)
    assert Observed(recorded(hip[:4], ihip[:4]), PLANE).hip_step == pytest.approx(1.5e-3), (
        "one sample in contact is no step"
    )
    assert largest_jump(Observed(recorded(hip[:4], ihip[:4]), PLANE)) == (0.0, 0)


@pytest.mark.parametrize("lowest", [0.1, 0.5])
def test_the_viscosity_that_explains_a_loss_of_speed_is_told_from_first_sample_to_last(lowest):
    """From 1 m/s to `lowest` in 21 samples of constant deceleration a: b = m a t / (the way slid)."""
    speed = np.linspace(1.0, lowest, 21)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 0.02)])
    hip = np.column_stack([way, np.zeros(21)])
    base = recorded(hip, force=0.0 * hip, dt=0.02, meta=EXPERIMENT, velocity=np.column_stack([speed, 0.0 * way]))
    slid = float(np.sum(0.01 * (speed[1:] ** 2 + speed[:-1] ** 2)))
    evidence = found("tangential-dynamics", Runs(base, refine=lambda factor: base), LINE).evidence
    assert evidence["apparent_viscosity_kg_s"] == pytest.approx(0.5 * LINE.mass * (1.0 - lowest**2) / slid, rel=1e-9)


@pytest.mark.parametrize(("declares", "expected"), [({"contact_point": "nearest"}, FAIL), ({}, UNDECIDED)])
@pytest.mark.parametrize("tilt", [0.0, 0.1])
def test_without_an_ihip_the_nearest_point_is_that_of_who_declares_it(declares, expected, tilt):
    rows = np.zeros((100, 2))
    force = rows + 2.0 * np.array([np.sin(tilt), np.cos(tilt)])
    hip = rows + np.array([0.0, -2e-3])
    base = Recording(1e-3 * np.arange(100), {"hip": hip, "force": force}, {"source": "playback", **declares})
    finding = found("contact-normal-force", base, PLANE)
    assert finding.outcome is (expected if tilt or expected is UNDECIDED else PASS)
    assert finding.metric.value == pytest.approx(np.degrees(tilt), abs=1e-6)
    assert "nearest" in finding.evidence
    assert "ihip" not in finding.evidence


def test_who_never_touches_is_nowhere_off_the_surface():
    free = np.tile([0.0, 1e-3], (5, 1))
    assert Observed(recorded(free), PLANE).off_surface == (0.0, 0)
    pressed_once = np.where(np.arange(5)[:, np.newaxis] == 3, [[0.0, -1e-3]], free)
    ihip = np.where(pressed_once < 0.0, 2e-4, pressed_once)
    assert Observed(recorded(pressed_once, ihip), PLANE).off_surface == (pytest.approx(2e-4), 3)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_on_a_constraint_that_holds_from_both_sides_a_late_point_is_found_on_either(side):
    time = 1e-3 * np.arange(300)
    angle = 2.0 * time + 3.0 * time**2
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    scene = Scene(model=ROUND.model, stiffness=1000.0, bilateral=True)
    ihip = 0.1 * out[np.maximum(np.arange(300) - 2, 0)]
    base = recorded((0.1 + side * 2e-3) * out, ihip)
    assert Observed(base, scene).lag.ihip == pytest.approx(2.0, abs=0.02)
