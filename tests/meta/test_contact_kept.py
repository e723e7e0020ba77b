"""Letting go of the hand must fail, with where, how deep and how long; what is late or coarse must not be blamed."""

from __future__ import annotations

from dataclasses import replace

import honest
import numpy as np
import pytest
from broken import LETTING_GO, free_where, spoiled
from hypothesis import given, settings
from hypothesis import strategies as st
from made import STIFFNESS, outcome, recorded

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import cassinian, circle, ellipsoid, from_vertices, line, sphere, star, torus
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.measures.free_space import follow
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

DT = 1e-3


def along(*points, duration=0.5):
    points = np.array(points, dtype=np.float64)
    far = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return Path(far * (duration / far[-1]), points)


def finding_of(make, model, path, **more):
    scene = Scene(model=model, **more)
    return CHECKS["contact-kept"](Runs(play(make(scene), path, DT, scene=scene)), scene)


L_SHAPE = [[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.1, 0.1], [0.1, 0.2], [0.0, 0.2]]
PLACES = {
    "polygon": (from_vertices(L_SHAPE), along([0.15, 0.13], [0.15, 0.085], [0.01, 0.05], [-0.02, 0.05])),
    "star": (star(), along([0.03, 0.12], [0.008, 0.066], [0.03, 0.02], [0.06, 0.08])),
    "line": (line(), along([-0.05, 0.01], [0.0, -0.01], [0.03, -0.01], [0.04, 0.01])),
    "cassinian": (cassinian(), along([0.11, -0.02], [0.09, 0.0], [0.08, 0.02], [0.11, 0.03])),
    "sphere": (sphere(), along([0.0, 0.02, 0.12], [0.0, 0.0, 0.09], [0.05, 0.02, 0.07], [0.09, 0.03, 0.09])),
    "ellipsoid": (ellipsoid(), along([0.0, 0.0, 0.06], [0.02, 0.01, 0.03], [0.05, 0.0, 0.03], [0.05, 0.0, 0.07])),
    "torus": (torus(), along([0.0, 0.07, 0.04], [0.0, 0.07, 0.02], [0.03, 0.055, 0.02], [0.03, 0.055, 0.05])),
}
"""A hand that is led in, slides and is led out again."""
BASES = {"minimum-distance": PLACES, "constraint@curve": [n for n, (m, _) in PLACES.items() if m.dimension == 2]}
BUILT_IN = [(base, name) for base, names in BASES.items() for name in names]


@pytest.mark.parametrize(("base", "place"), BUILT_IN)
def test_a_renderer_that_keeps_its_contact_passes(base, place):
    finding = finding_of(resolve(base), *PLACES[place])
    assert finding.outcome is Outcome.PASS, finding.message


@pytest.mark.parametrize("place", ["polygon", "cassinian", "torus"])
@pytest.mark.parametrize("fault", sorted(set(LETTING_GO) - {"trails"}))
def test_a_renderer_that_lets_go_fails(fault, place):
    finding = finding_of(spoiled(fault), *PLACES[place])
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == LETTING_GO[fault][0]
    assert finding.metric.value > finding.bound


@pytest.mark.parametrize("place", ["polygon", "line", "sphere"])
@pytest.mark.parametrize("change", sorted(set(honest.HONEST) - {"late-1", "late-2"}))
def test_an_honest_renderer_is_not_blamed(change, place):
    finding = finding_of(honest.factory(change, resolve("minimum-distance")), *PLACES[place])
    assert finding.outcome is (Outcome.INCONCLUSIVE if change == "force-only" else Outcome.PASS), finding.message


def test_the_finding_names_where_how_deep_and_how_long():
    """On a plane the numbers are known: in at 10 mm depth, let go at 0.299 s for the remaining time inside."""
    path = along([0.0, 0.01], [0.0, -0.01], [0.0, 0.01], duration=0.8)
    finding = finding_of(spoiled("drops"), line(), path)
    evidence = finding.evidence
    assert evidence["kind"] == "let go"
    assert evidence["time"] == pytest.approx(0.299, abs=1e-9)
    np.testing.assert_allclose(evidence["hip"], [0.0, 0.01 - 0.05 * 0.299], atol=1e-9)
    np.testing.assert_allclose(evidence["last_ihip"], [0.0, 0.0], atol=1e-9)
    assert finding.metric.value == pytest.approx(0.01, rel=1e-6)
    assert evidence["deepest_m"] == pytest.approx(0.01, rel=1e-6)
    assert evidence["farthest_time"] == pytest.approx(0.4)
    # Inside until t = 0.6 s; the last three ticks are within the way that lag is granted.
    assert evidence["lost_s"] == pytest.approx(0.6 - 0.299, abs=0.006)
    assert evidence["times_lost"] == 1
    assert "let go" not in finding.message
    assert "10 mm past the surface" in finding.message


def test_a_tick_without_contact_is_found_each_time():
    finding = finding_of(spoiled("flickers"), *PLACES["line"])
    inside = np.sum(PLACES["line"][0].boundary.signed_distance(PLACES["line"][1].sampled(DT)[1]) < -1e-3)
    assert finding.evidence["lost_ticks"] == finding.evidence["times_lost"]
    assert finding.evidence["lost_ticks"] >= int(inside) // 100


THIN = from_vertices([[-0.1, 0.0], [0.1, 0.0], [0.1, 5e-5], [-0.1, 5e-5]])
DISC = ellipsoid(a=0.1, b=0.1, c=4e-5)


@pytest.mark.parametrize(("model", "up"), [(THIN, [0.0, 1.0]), (DISC, [0.0, 0.0, 1.0])], ids=["plate", "disc"])
def test_a_plate_thinner_than_a_step_of_the_hand_is_not_passed(model, up):
    up = np.array(up)
    path = along(0.02 * up, -0.02 * up, duration=0.2)  # 0.2 mm a tick
    finding = finding_of(resolve("minimum-distance"), model, path)
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == "tunnelled"
    assert finding.evidence["deepest_m"] < 5e-5
    assert finding.metric.value == pytest.approx(0.02, rel=0.02)
    if model.dimension == 2:
        assert finding_of(resolve("constraint"), model, path).outcome is Outcome.PASS


@pytest.mark.parametrize("start", [0.0, 1e-5, 2e-5])
def test_a_contact_on_the_back_of_a_plate_does_not_let_the_tool_through(start):
    """The one tick in which the hand is within the plate, at 10 or 20 of 50 um, the nearest point is behind it."""
    path = along([0.0, 0.02 + start], [0.0, start - 0.02], duration=0.2)
    finding = finding_of(resolve("minimum-distance"), THIN, path)
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == "tunnelled"
    assert finding_of(resolve("constraint"), THIN, path).outcome is Outcome.PASS


def test_a_hand_that_goes_round_a_plate_is_free():
    """In three ticks past its edge, once close by and once so that the chord of one step cuts the edge."""
    for gap in (2e-4, -5e-5):
        path = along([0.05, 0.02], [0.1 + gap, 0.001], [0.1 + gap, -0.001], [0.05, -0.02], duration=0.3)
        finding = finding_of(resolve("minimum-distance"), THIN, path)
        assert finding.outcome in (Outcome.PASS, Outcome.INCONCLUSIVE), (gap, finding.message)


def test_contact_may_end_at_a_sharp_tip_far_from_the_hand():
    """Under a face and past the tip the hand is 10 mm from the tool when its way opens, and outside long before."""
    scene = Scene(model=star())
    corner = scene.model.boundary.corners[0]
    start = corner.position - 0.03 * corner.tangent_pre - 0.01 * corner.normal_pre
    path = along(start, start + 0.05 * corner.tangent_pre, duration=1.0)
    assert finding_of(resolve("constraint"), star(), path).outcome is Outcome.PASS

    # Lets go 6 mm before the tip, where the hand is outside already, on the other side of the wedge.
    early = free_where(lambda tick: bool((tick.hip - corner.position) @ corner.tangent_pre > -0.0055))
    finding = finding_of(spoiled(early, "constraint"), star(), path)
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == "tunnelled"
    assert finding.metric.value == pytest.approx(0.01, rel=1e-3)


def test_a_new_contact_at_the_first_crossing_is_no_loss():
    """From the upper block the hand jumps past its edge into the lower one, all within one tick."""
    model = from_vertices([[0.0, 0.0], [0.3, 0.0], [0.3, 0.02], [0.1, 0.02], [0.1, 0.1], [0.0, 0.1]])
    hip = np.array([[0.09, 0.11], [0.09, 0.095], [0.13, 0.015], [0.14, 0.015]])
    ihip = np.array([[0.09, 0.11], [0.09, 0.1], [0.13, 0.02], [0.14, 0.02]])
    recording = Recording(DT * np.arange(4), {"hip": hip, "ihip": ihip, "force": 1000.0 * (ihip - hip)}, {"dt": DT})
    scene = Scene(model=model)
    assert CHECKS["contact-kept"](Runs(recording), scene).outcome is Outcome.PASS


ROWS = np.array(
    [
        (0.01, 0.01, 0.0),  # free
        (0.01, 0.03, 0.0),  # a tool that trails
        (-0.01, 0.25, 0.0),  # and still does while the hand is in
        (-0.01, 0.0, 0.0),  # a tool on the surface, given without a force
        (-0.01, -0.01, 5.0),  # a force alone
        (-0.01, -0.01, 1e-9),  # noise inside
        (0.01, 0.01, 1e-9),  # and outside
    ]
)
"""Heights of the hand and of the tool, m, and a force, N."""


@pytest.mark.parametrize(
    ("report", "contact", "trailing"),
    [(None, [3, 4], [1, 2]), (0.0, [4], [1, 2]), (1.0, range(7), [])],
    ids=["none", "denied", "claimed"],
)
def test_contact_is_what_is_reported_or_a_force_above_the_floor_or_a_tool_held_back(report, contact, trailing):
    hip, ihip, force = (np.column_stack([np.zeros(7), column]) for column in ROWS.T)
    run = recorded(hip, ihip, force, **({} if report is None else {"contact": np.full(7, report)}))
    base = Observed(run, Scene(model=line()))
    assert np.flatnonzero(base.contact).tolist() == list(contact)
    assert np.flatnonzero(base.trailing).tolist() == trailing
    held = Scene(model=line(), bilateral=True)
    assert Observed(run, held).contact.all()
    assert not Observed(run, held).trailing.any()
    assert outcome("contact-kept", run, held) is Outcome.NOT_APPLICABLE


class TestTrailing:
    def test_it_is_found_once_and_as_what_it_is(self):
        scene = Scene(model=line())
        path = along([-0.3, 0.02], [0.0, 0.02], [0.0, -0.005], duration=0.2)
        recording = play(spoiled("trails")(scene), path, DT, scene=scene)
        finding = CHECKS["contact-kept"](Runs(recording), scene)
        assert finding.outcome is Outcome.FAIL
        assert finding.evidence["kind"] == "trails"
        assert finding.metric.value > 0.02
        assert "off the surface" not in CHECKS["continuous-contact"](Runs(recording), scene).message
        assert Observed(recording, scene).trailing.any()
        assert not (Observed(recording, scene).contact & Observed(recording, scene).trailing).any()


def test_a_hand_that_stays_outside_is_right_to_feel_nothing():
    finding = finding_of(resolve("minimum-distance"), circle(), along([0.2, -0.1], [0.2, 0.1]))
    assert finding.outcome is Outcome.PASS
    assert "metre" not in finding.message
    # A log in millimetres that were taken for metres.
    far = finding_of(resolve("minimum-distance"), circle(), along([0.0, 101.0], [10.0, 99.0]))
    assert far.outcome is Outcome.NOT_APPLICABLE
    assert "is its unit the metre?" in far.message


def on_hull(name):
    """The factory of a renderer that takes the L for its convex hull, as physics engines do."""
    hull = from_vertices([corner for corner in L_SHAPE if corner != [0.1, 0.1]])
    return lambda scene: resolve(name)(replace(scene, model=hull))


IN_THE_NOTCH = ([0.13, 0.13], [0.2, 0.2], [0.13, 0.13])
"""A stay in the notch of the L: the hull's edge is 28 mm outside of it, and the L 30 mm."""


@pytest.mark.parametrize("begin", [0, 1], ids=["inside of the hull", "outside"])
@pytest.mark.parametrize("name", ["minimum-distance", "coupled"])
def test_the_hull_of_a_notch_is_felt_in_free_space(name, begin):
    """Spring or coupled tool alike: the IHIP stays at the hull, or is pushed to it, and the hand is pushed for long."""
    path = along(*IN_THE_NOTCH[begin:], duration=0.8)
    finding = finding_of(on_hull(name), from_vertices(L_SHAPE), path)
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["kind"] == "haunts"
    assert finding.metric.unit == "N"
    assert finding.metric.value > 0.75 * 1000.0 * 0.028
    assert finding_of(resolve(name), from_vertices(L_SHAPE), path).outcome is not Outcome.FAIL


@pytest.mark.parametrize("stiffness", [100.0, 1000.0])
@pytest.mark.parametrize("duration", [0.05, 0.2, 0.6])
def test_a_coupled_tool_that_is_free_trails_a_hand_that_turns_round(stiffness, duration):
    """Its inertia is felt, and is no contact's."""
    zigzag = along([0.2, 0.2], [0.13, 0.13], [0.2, 0.13], [0.13, 0.14], [0.13, 0.2], duration=duration)
    scene = Scene(model=from_vertices(L_SHAPE), stiffness=stiffness)
    recording = play(resolve("coupled")(scene), zigzag, DT, scene=scene)
    assert np.linalg.norm(recording.force, axis=1).max() > 0.01
    finding = CHECKS["contact-kept"](Runs(recording), scene)
    # Nothing is touched, and something felt: nothing shows whether contact is kept.
    assert finding.outcome is Outcome.INCONCLUSIVE, finding.message


def test_a_claimed_standoff_is_no_licence():
    def claims(scene):
        made = spoiled("drops")(scene)
        made.standoff = 1.0
        return made

    finding = finding_of(claims, circle(), along([0.0, 0.11], [0.0, 0.09], [0.01, 0.09]))
    assert finding.outcome is Outcome.FAIL


class PlainProxy:
    """A proxy that looks for contact only on the hand's way in from free space: reset inside, it knows no surface."""

    def __init__(self, scene):
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness
        self.resets, self.asked = [], []

    def reset(self, hip):
        self.resets.append(hip)
        self.free, self.touches = bool(self.boundary.signed_distance(hip[np.newaxis])[0] >= 0.0), False

    def step(self, hip, velocity, dt):
        self.asked.append((hip, velocity))
        frame = self.boundary.closest_point(hip[np.newaxis])
        outside = bool(frame.distance[0] >= 0.0)
        self.touches = not outside and (self.touches or self.free)
        self.free = outside
        ihip = frame.foot[0] if self.touches else hip
        return Response(ihip, self.stiffness * (ihip - hip))


class TestStartInside:
    def test_a_plain_reset_loses_nothing(self):
        scene = Scene(model=star())
        path = along([0.0, 0.06], [0.01, 0.05])
        recording = play(PlainProxy(scene), path, DT, scene=scene)
        whole = play(resolve("minimum-distance")(scene), path, DT, scene=scene)
        np.testing.assert_array_equal(recording.hip, path.sampled(DT)[1])
        np.testing.assert_allclose(recording.ihip, whole.ihip, atol=1e-12)
        assert not play(PlainProxy(scene), path, DT).contact.any()

    @pytest.mark.parametrize("place", PLACES)
    def test_it_is_reset_outside_and_led_in_to_rest(self, place):
        model, path = PLACES[place]
        inside = Path(path.time[1:] - path.time[1], path.points[1:])
        scene = Scene(model=model)
        proxy = PlainProxy(scene)
        recording = play(proxy, inside, DT, scene=scene)
        hips, velocities = map(np.array, zip(*proxy.asked, strict=True))
        before = len(hips) - len(recording)
        assert before > 0
        assert model.boundary.signed_distance(np.array(proxy.resets))[0] > 0.0
        assert np.all(np.diff(model.boundary.signed_distance(hips[: before + 1])) < 1e-12), "straight in"
        assert recording.contact[0]
        np.testing.assert_array_equal(velocities[before - 1 : before + 1], 0.0)

    def test_a_hand_outside_and_a_bilateral_one_are_not_led(self):
        for model, path, bilateral in ((*PLACES["line"], False), (line(), along([0.0, -0.01], [0.1, -0.01]), True)):
            scene = Scene(model=model, bilateral=bilateral)
            proxy = PlainProxy(scene)
            play(proxy, path, DT, scene=scene)
            np.testing.assert_array_equal(proxy.resets, path.points[:1])


@settings(max_examples=25)
@given(
    angle=st.floats(0.0, 6.28),
    depth=st.floats(1e-3, 0.05),
    aside=st.floats(-0.05, 0.05),
    shape=st.sampled_from(["circle", "cassinian", "star", "polygon"]),
)
def test_a_rigid_tool_is_held_outside_of_the_solid_and_nowhere_else(angle, depth, aside, shape):
    """Law: a held tool is on the surface, no neighbour of it is nearer to the hand, and a free one's way is outside."""
    model = {"circle": circle(), "cassinian": cassinian(), "star": star(), "polygon": from_vertices(L_SHAPE)}[shape]
    ahead = np.array([np.cos(angle), np.sin(angle)])
    start = 0.4 * ahead
    hand = (0.12 - depth) * ahead + aside * np.array([-ahead[1], ahead[0]])
    grain = 2e-5
    held = follow(model.boundary, start, hand, grain)
    inside = float(model.boundary.signed_distance(hand[np.newaxis])[0]) < -1e-9
    if inside:
        assert held is not None
    if held is None:
        return
    assert abs(float(model.boundary.signed_distance(held[np.newaxis])[0])) < 1e-9
    for other in model.boundary.around(held, grain):
        assert np.linalg.norm(other - hand) > np.linalg.norm(held - hand) - 1e-9


@settings(max_examples=8)
@given(share=st.floats(0.05, 0.95), depth=st.floats(1e-3, 0.02), seed=st.integers(0, 2**16))
def test_contact_dropped_anywhere_is_found_there(share, depth, seed):
    """Along a random chord under the surface of a sphere: the tick of the loss, and the depth there and later."""
    rng = np.random.default_rng(seed)
    ends = rng.normal(size=(2, 3))
    ends *= (0.1 - depth) / np.linalg.norm(ends, axis=1)[:, np.newaxis]
    scene = Scene(model=sphere())
    whole = play(resolve("minimum-distance")(scene), along(*ends), DT, scene=scene)
    from_tick = int(share * len(whole))
    channels = {name: np.array(values) for name, values in whole.channels.items()}
    channels["ihip"][from_tick:] = channels["hip"][from_tick:]
    channels["force"][from_tick:] = 0.0
    finding = CHECKS["contact-kept"](Runs(Recording(whole.time, channels, whole.meta)), scene)
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["tick"] == from_tick
    lost = 0.1 - np.linalg.norm(whole.hip[from_tick:], axis=1)
    assert finding.evidence["deepest_m"] == pytest.approx(lost.max(), rel=1e-9)
    assert finding.evidence["lost_ticks"] == pytest.approx(len(whole) - from_tick, abs=3)


@given(late=st.integers(1, 9), size=st.sampled_from([0.9e-6, 1.1e-6, 1e-3]))
def test_a_force_in_free_space_fails_from_the_fourth_tick_after_a_contact_on(late, size):
    """Three ticks are granted, and the force of a depth of 1 um is the least that counts."""
    height = 1e-3 * np.concatenate([np.arange(20.0, -11.0, -1.0), np.arange(-9.0, 21.0)])
    hip = np.column_stack([np.zeros(height.size), height])
    ihip = np.maximum(hip, 0.0)
    force = STIFFNESS * (ihip - hip)
    last = int(np.flatnonzero(height < 0.0)[-1])
    force[last + late, 1] += STIFFNESS * size
    ghost = late > 4 and size > 1e-6  # the tick after the last inside is on the surface, where nothing is outside
    run = recorded(hip, ihip, force, meta={"source": "playback"})
    assert outcome("contact-kept", run, Scene(model=line())) is (Outcome.FAIL if ghost else Outcome.PASS)
