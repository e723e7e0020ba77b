"""Continuous contact on maps whose continuity is known beforehand."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made import FAIL, PASS, UNDECIDED, changed, found, outcome, recorded

from hapticeval.geometry.catalogue import circle, line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.continuous_contact import amplification
from hapticeval.phenomena.lag import delayed
from hapticeval.phenomena.measures.jumps import Remains, jump_at_rate, look_closer
from hapticeval.phenomena.observed import Observed
from hapticeval.scene import Scene
from hapticeval.simulation.playback import Closeup, play
from hapticeval.stimulus.stimulus import Path

SCENE = Scene(model=line())
ROUND = Scene(model=circle())
CHECK = "continuous-contact"


def led(answer, meta=None, height=0.0):
    """HIPs moving 40 mm along x in 2 s, 1 mm deep, and `simulate(x)` as the IHIP's place along x: by the factor."""

    def record(factor):
        x = np.linspace(0.0, 0.04, 2000 * factor + 1)
        hip = np.column_stack([x, np.full_like(x, -1e-3)])
        return recorded(hip, np.column_stack([answer(x), 0 * x + height]), dt=1e-3 / factor, meta=meta)

    return record


def runs(record):
    return Runs(record(1), refine=record)


def judged(answer, **more):
    return found(CHECK, runs(led(answer, **more)), SCENE)


@given(size=st.floats(1e-4, 0.05), where=st.floats(0.002, 0.038))
@settings(max_examples=30)
def test_a_jump_stays_whatever_its_size_and_place(size, where):
    finding = judged(lambda x: x + size * (x > where))
    assert finding.outcome is FAIL
    assert size - 1e-9 <= finding.metric.value <= size + 2.1e-5  # and the HIP's own step
    assert finding.evidence["time"] == pytest.approx(50.0 * where, abs=2e-3)
    assert finding.margin < 0.0


def test_a_jump_is_told_in_steps_of_the_hand_there_and_with_the_places_around_it():
    """Each HIP step is a hundredth longer than the one before, and the IHIP jumps by 5 mm in the tick 30."""
    x = np.concatenate([[0.0], np.cumsum(1e-4 * 1.01 ** np.arange(60))])
    hip = np.column_stack([x, np.full_like(x, -1e-3)])
    ihip = np.column_stack([x + 5e-3 * (np.arange(61) >= 30), np.zeros(61)])
    evidence = found(CHECK, recorded(hip, ihip), SCENE).evidence
    step = 1e-4 * 1.01**29
    assert evidence["tick"] == 30
    assert evidence["jump_m"] == pytest.approx(5e-3 + step)
    assert evidence["jump_in_hip_steps"] == pytest.approx((5e-3 + step) / step)
    assert evidence["amplification"] == pytest.approx((5e-3 + step) / step)
    assert evidence["hip_step_m"] == pytest.approx(1e-4 * 1.01**59)
    assert (evidence["ihip_before"], evidence["ihip"]) == (ihip[29].tolist(), ihip[30].tolist())


def test_a_pass_says_that_it_is_of_the_contact_and_since_when_there_was_none():
    """Continuous as long as it lasts: who reads nothing else is told that the tool was let go inside the model."""

    kept = judged(lambda x: x)
    assert kept.outcome is PASS
    assert kept.message.startswith("continuous while in contact")
    assert "contact-kept" not in kept.message

    def record(factor):
        whole = led(lambda x: x)(factor)
        gone = whole.hip[:, 0] >= 0.03
        return changed(whole, ihip=np.where(gone[:, None], whole.hip, whole.ihip), force=whole.force * ~gone[:, None])

    finding = found(CHECK, runs(record), SCENE)
    assert finding.outcome is PASS
    assert finding.message.endswith("; inside the model without contact at t = 1.5 s, which contact-kept judges")
    assert finding.evidence["let_go_tick"] == 1500
    assert outcome("contact-kept", record(1), SCENE) is FAIL


@given(slope=st.floats(0.0, 100.0), where=st.floats(0.002, 0.038))
@settings(max_examples=20)
def test_a_steep_but_continuous_map_passes(slope, where):
    assert judged(lambda x: x + slope * np.clip(x - where, 0.0, 1e-3)).outcome is PASS


@pytest.mark.parametrize("slope", [0.5, 1.0, 11.0])
def test_the_amplification_is_the_steepest_stretch(slope):
    finding = judged(lambda x: 0.3 * x + slope * np.clip(x - 0.02, 0.0, 5e-3))
    assert finding.evidence["amplification"] == pytest.approx(0.3 + slope)


def test_a_hand_that_rests_amplifies_nothing():
    """Where the HIP hardly moves the IHIP may still catch up; that is lag and no stretch."""
    hip = np.array([[0.0, -1e-3], [1e-3, -1e-3], [1e-3, -1e-3], [2e-3, -1e-3]])
    ihip = np.array([[0.0, 0.0], [0.5e-3, 0.0], [1e-3, 0.0], [2e-3, 0.0]])
    assert amplification(Observed(recorded(hip, ihip), SCENE)) == pytest.approx(1.0)
    assert amplification(Observed(recorded(hip), SCENE)) == 0.0
    # From the second sample in contact on, whatever was before.
    entering = np.where(np.arange(len(hip))[:, np.newaxis] < 2, hip, ihip)
    assert amplification(Observed(recorded(hip, entering), SCENE)) == pytest.approx(1.0)


def test_the_steepest_map_met_in_practice_passes():
    """A Hoelder map of order 1/3, as a conformal map at a 60-degree tip."""
    finding = judged(lambda x: 0.1 * np.cbrt(x - 0.02))
    assert finding.outcome is PASS
    assert finding.evidence["slope"] == pytest.approx(1 / 3, abs=0.05)


def test_a_jump_hidden_under_long_steps_is_found():
    """At the coarsest sampling the steep ramp steps farther than the jump; refinement shrinks only the ramp."""
    assert judged(lambda x: x + 50.0 * np.clip(x - 0.01, 0.0, 2e-3) + 6e-4 * (x > 0.03)).outcome is FAIL


def test_a_lagging_proxy_that_moves_in_every_third_tick_passes():
    assert judged(lambda x: x[3 * (np.arange(x.size) // 3)]).outcome is PASS


@pytest.mark.parametrize(("size", "severity"), [(1e-3, "mini"), (0.03, "major")])
def test_a_jump_between_neighbouring_facets_is_a_mini_pop_through(size, severity):
    finding = judged(lambda x: x + size * (x > 0.02), meta={"resolution": 0.015})
    assert (finding.outcome, finding.evidence["severity"]) == (FAIL, severity)


@pytest.mark.parametrize(("size", "severity"), [(1e-3, "mini"), (0.03, "major")])
def test_one_recording_too_tells_a_jump_over_the_declared_facets_from_a_longer_one(size, severity):
    record = led(lambda x: x + size * (x > 0.02), meta={"resolution": 0.015})
    finding = found(CHECK, Runs(record(1)), SCENE)
    assert (finding.outcome, finding.evidence["severity"]) == (FAIL, severity)
    assert ("over facets of 15 mm that the renderer declares" in finding.message) == (severity == "mini")


def test_a_jump_within_the_declared_standoff_passes_and_is_reported():
    """The surface stands off as far as it declares."""

    def jumps(x):
        return x + 1e-3 * (x > 0.02)

    declared, silent = (judged(jumps, height=1.2e-3, meta=meta) for meta in ({"standoff": 1.2e-3}, {}))
    assert declared.outcome is PASS
    assert "standoff" in declared.message
    assert silent.outcome is FAIL
    assert "pop-through: the IHIP jumps 1" in silent.message
    assert "off the surface" in silent.message


def spoiled(record, factors, spoil):
    """The recordings of `record`, those at some factors with another IHIP."""

    def at(factor):
        made = record(factor)
        return recorded(made.hip, spoil(made), dt=1e-3 / factor) if factor in factors else made

    return runs(at)


def test_a_jump_that_finer_runs_of_the_whole_lack_depends_on_the_rate():
    pops = spoiled(led(lambda x: x), (1,), lambda made: made.ihip + (made.hip[:, :1] > 0.02) * [0.01, 0.0])
    lost = spoiled(
        led(lambda x: x + 0.01 * (x > 0.02)),
        (2, 4, 8, 16, 32),
        lambda made: np.where(made.hip[:, :1] <= 0.01, made.ihip, made.hip),
    )
    for run in (pops, lost):
        finding = found(CHECK, run, SCENE)
        assert finding.outcome is FAIL
        assert "depends on the sampling rate" in finding.message
        assert finding.metric.value == pytest.approx(0.01, abs=1e-4)


def test_a_jump_in_the_last_tick_that_finer_runs_lack_depends_on_the_rate():
    run = spoiled(led(lambda x: x), (1,), lambda made: made.ihip + (made.hip[:, :1] == 0.04) * [0.01, 0.0])
    finding = found(CHECK, run, SCENE)
    assert finding.outcome is FAIL
    assert "depends on the sampling rate: the IHIP jumps 10 mm at t = 2 s" in finding.message


def test_an_ihip_in_another_unit_is_asked_for_its_unit_and_no_finer_runs_are_made():
    radius = 0.5 * ROUND.model.size
    angle = np.linspace(0.0, 1.0, 500)
    around = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    base = recorded(0.9 * around, 1e3 * around)
    finding = found(CHECK, Runs(base, refine=lambda factor: pytest.fail("asked for a finer run")), ROUND)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(999.0 * radius)
    assert "is its unit the metre?" in finding.message


class Restless:
    """The nearest point of a line, and from half a second on a place 10 mm aside, whatever the hand does."""

    def __init__(self, scene):
        self.stiffness = scene.stiffness

    def reset(self, hip):
        self.time = 0.0

    def step(self, hip, velocity, dt):
        self.time += dt
        ihip = np.array([hip[0] + 0.01 * (self.time > 0.5), 0.0]) if hip[1] < 0.0 else hip
        return ihip, self.stiffness * (ihip - hip)


def test_a_jump_under_a_resting_hand_is_found():
    path = Path([0.0, 0.2, 1.0], [[0.0, 0.001], [0.02, -0.002], [0.02, -0.002]])
    renderer = Restless(SCENE)
    base = play(renderer, path, 1e-3, scene=SCENE)
    run = Runs(
        base,
        refine=lambda k: play(renderer, path, 1e-3 / k, scene=SCENE),
        look=Closeup.of(renderer, base, SCENE),
    )
    finding = found(CHECK, run, SCENE)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(0.01)
    assert finding.evidence["time"] == pytest.approx(0.5, abs=2e-3)


class Stretched(Restless):
    """The nearest point of a line, which moves five times as fast along a tenth of a millimetre."""

    def step(self, hip, velocity, dt):
        ihip = np.array([hip[0] + 4.0 * np.clip(hip[0] - 0.0101, 0.0, 1e-4), 0.0]) if hip[1] < 0.0 else hip
        return ihip, self.stiffness * (ihip - hip)


def test_what_is_measured_of_a_steep_stretch_and_its_evidence_are_of_one_tick():
    """Its fast steps are 1e-4 m of the hand and five of the tool: over the bound, and finer ones shrink them."""
    path, renderer = Path([0.0, 0.01, 0.2], [[0.0, 0.001], [0.001, -0.002], [0.02, -0.002]]), Stretched(SCENE)
    base = play(renderer, path, 1e-3, scene=SCENE)
    look = Closeup.of(renderer, base, SCENE)
    finding = found(CHECK, Runs(base, refine=lambda k: play(renderer, path, 1e-3 / k, scene=SCENE), look=look), SCENE)
    assert finding.outcome is PASS
    assert finding.metric.value == pytest.approx(finding.evidence["jump_m"])
    assert finding.metric.value <= finding.bound < finding.evidence["steep_step_m"] == pytest.approx(5e-4)
    assert f"moves 0.5 mm at t = {finding.evidence['steep_time']:.4g} s" in finding.message


def test_a_smooth_path_through_the_solid_is_no_contact():
    """The chord that a smeared table draws across a circle is continuous, and not on the surface."""
    x = np.linspace(-0.08, 0.08, 4001)
    chord = recorded(np.column_stack([x, 0 * x + 0.05]), np.column_stack([x, 0 * x + 0.06]))
    finding = found(CHECK, Runs(chord, refine=lambda factor: chord), ROUND)
    assert finding.outcome is FAIL
    assert finding.metric.value == pytest.approx(0.04, abs=1e-4)


def test_a_jump_between_two_contacts_is_no_pop_through():
    base = led(lambda x: x + 0.01 * (x > 0.02))(1)
    ihip = np.array(base.ihip)
    ihip[1000:1010] = base.hip[1000:1010]
    broken = recorded(base.hip, ihip)
    assert outcome(CHECK, Runs(broken, refine=lambda factor: broken), SCENE) is not FAIL
    assert outcome(CHECK, recorded(base.hip), SCENE) is UNDECIDED, "without any contact"


# One recording, of which no finer one can be had

EVEN = 1e-4 * np.arange(200.0)
LATER = np.arange(200) >= 100


@pytest.mark.parametrize("stretch", [0.0, 1.0, 2.5])
@pytest.mark.parametrize(
    ("jump", "expected"),
    [
        (0.02 * LATER, FAIL),
        (0.02 * (np.arange(200) >= 199), FAIL),
        *[
            (0.02 * np.sign(ramp) * np.abs(ramp) ** power, UNDECIDED)
            for ramp in (np.clip((np.arange(200) - 100) / width, -1.0, 1.0) for width in (8, 20))
            for power in (1.0, 1.0 / 3.0)
        ],
        (0.0, PASS),
    ],
)
def test_one_recording_is_judged_by_what_leaving_samples_out_does(stretch, jump, expected):
    """However the tool moves beside it samples left out make a jump no longer, and a steep stretch they do."""
    hip = np.column_stack([EVEN, 0 * EVEN - 1e-3])
    base = recorded(hip, np.column_stack([stretch * EVEN + jump, 0 * EVEN]), meta={"source": "file"})
    finding = found(CHECK, base, SCENE)
    assert finding.outcome is expected
    assert "weaker" in finding.message


def test_one_recording_near_the_medial_axis_is_inconclusive():
    """At the centre of the circle every IHIP step is honest."""
    angle = np.linspace(0.0, 2.0, 50)
    ihip = 0.1 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert outcome(CHECK, recorded(1e-3 * ihip, ihip), ROUND) is UNDECIDED


def test_a_declared_standoff_makes_no_contact_point_of_the_hand():
    """4 mm are believed; a force 1 to 3 mm deep with the IHIP at the hand is no contact 1 to 3 mm off the surface."""
    x = np.linspace(0.0, 0.02, 2001)
    hip = np.column_stack([x, -1e-3 - 0.1 * x])
    shallow = recorded(hip, hip, -1e3 * hip * [0.0, 1.0], meta={"standoff": 4e-3})
    assert outcome(CHECK, shallow, SCENE) is UNDECIDED
    level = changed(shallow, hip=hip * [1.0, 0.0] - [0.0, 2e-3], ihip=hip * [1.0, 0.0] - [0.0, 2e-3])
    assert outcome(CHECK, level, SCENE) is PASS, "a rigid contact 2 mm off"


# What is looked at again, and what is no contact any more


@pytest.mark.parametrize(
    ("tick", "rows"), [(0, (0, 64)), (512, (0, 576)), (513, (1, 577)), (935, (423, 999)), (999, (487, 999))]
)
def test_half_a_second_before_a_jump_and_64_ticks_after_are_led_along_at_another_rate(tick, rows):
    asked = []

    class Look:
        recording = changed(led(lambda x: x)(1), rows=slice(0, 1000))

        def refined(self, first, last, factor, *, lag):
            asked.append((first, last, factor, lag))
            return self

    assert jump_at_rate(4, Look(), SCENE, tick) == pytest.approx(2e-5)
    assert asked == [(*rows, 4, 3)]


@pytest.mark.parametrize(
    ("contact", "force", "lingers"),
    [
        ((5, 10), (5, 13), (10, 13)),
        ((5, 10), (5, 18), (10, 18)),
        ((5, 10), (12, 14), (12, 14)),
        ((5, 10), (13, 15), None),
        ((5, 10), (11, 13), (11, 13)),
        ((0, 0), (0, 3), None),
        ((17, 20), (0, 3), None),
    ],
)
def test_a_force_that_begins_or_goes_on_within_three_ticks_after_a_contact_lingers(contact, force, lingers):
    """The IHIP is off the hand in rows of `contact`; in rows of `force` there is one, outside of the model."""
    rows = np.arange(20)

    def within(ends):
        return (rows >= ends[0]) & (rows < ends[1])

    hip = np.column_stack([np.zeros(20), np.full(20, 1e-3)])
    made = recorded(hip, hip + within(contact)[:, None] * [0.0, 1e-4], within(force)[:, None] * [0.0, 5.0])
    assert np.array_equal(Observed(made, SCENE).lingering, within(lingers or (0, 0)))


@pytest.mark.parametrize("last", [12, 19])
def test_for_how_long_the_contact_was_lost_is_told_to_the_end_of_the_recording(last):
    """At 1 kHz, and the last row as long as any: ticks 10 to `last` are lost 1 mm inside."""
    rows = np.arange(20)
    hip = np.column_stack([np.zeros(20), np.full(20, -1e-3)])
    lost = (rows >= 10) & (rows <= last)
    made = recorded(hip, np.where(lost[:, None], hip, hip * [1.0, 0.0]))
    finding = found("contact-kept", made, SCENE)
    assert finding.outcome is FAIL
    assert finding.evidence["lost_s"] == pytest.approx(1e-3 * (last - 9))
    assert finding.evidence["lost_ticks"] == last - 9


class Look:
    """A path that finer steps lead along straight, except from tick to tick of `kept`: there the tool is elsewhere."""

    def __init__(self, recording, kept=(0, 0)):
        self.recording, self.kept = recording, kept

    def refined(self, first, last, factor, *, lag):
        rows = np.append(first + np.arange((last - first) * factor + 1) / factor, np.full(lag, float(last)))
        astray = self.kept[0] <= first and last <= self.kept[1]
        ihip = delayed(self.recording.ihip, rows) + np.array([1.0 if astray else 0.0, 0.0])
        return Look(recorded(delayed(self.recording.hip, rows), ihip, dt=1e-3 / factor))


def stepping(steps):
    """The hand goes 10 um a tick, 1 mm deep, and the tool `steps` (n,), m, on the surface."""
    hip = np.column_stack([1e-5 * np.arange(steps.size), np.full(steps.size, -1e-3)])
    return recorded(hip, np.column_stack([np.cumsum(steps), np.zeros(steps.size)]))


def test_each_part_of_a_long_stretch_has_its_own_worst_step():
    """512 steps are too long, the one of tick 400 most; finer steps explain those near it, and of tick 150 none does.

    Tick 272 is the first of the part round tick 400, and has a longer step than tick 150.
    """
    steps = np.full(700, 1e-5)
    steps[100:612] = 1e-4
    steps[[150, 272, 400]] = 1.5e-4, 2e-4, 3e-4
    look = Look(stepping(steps), kept=(0, 271))
    place = look_closer(look, Observed(look.recording, SCENE), bounds=np.full(700, 8e-5), standoff=0.0)
    assert (place.kind, place.tick) == (Remains.UNRESOLVED, 150)
    assert place.remaining == pytest.approx(1.5e-4)


def test_a_jump_in_the_last_tick_is_placed_there():
    """The step before is longer, and within its bound."""
    steps, bounds = np.full(100, 1e-5), np.full(100, 8e-5)
    steps[-2:], bounds[-2] = (3e-4, 1e-4), 1e-3
    look = Look(stepping(steps), kept=(0, 99))
    place = look_closer(look, Observed(look.recording, SCENE), bounds=bounds, standoff=0.0)
    assert (place.kind, place.tick) == (Remains.UNRESOLVED, 99)


def test_a_jump_just_before_a_longer_step_that_is_allowed_is_placed_where_it_is():
    """Two ticks behind the jump the hand leaps, and the tool with it: that step is within a bound of its own."""
    steps, bounds = np.full(100, 1e-5), np.full(100, 8e-5)
    steps[[50, 52]], bounds[52] = (3e-4, 2e-2), 3e-2
    look = Look(stepping(steps), kept=(0, 99))
    place = look_closer(look, Observed(look.recording, SCENE), bounds=bounds, standoff=0.0)
    assert (place.kind, place.tick) == (Remains.UNRESOLVED, 50)


class Sharp:
    """A hand along a line and a tool that jumps by 0.3 mm at `edge`, m, however finely the steps are divided."""

    def __init__(self, hip, asked, *, edge=5.013e-4, dt=1e-3):
        jumped = hip[:, :1] > edge
        self.recording = recorded(hip, hip * [1.0, 0.0] + 3e-4 * jumped * [1.0, 0.0], dt=dt)
        self.asked, self.dt = asked, dt

    def refined(self, first, last, factor, *, lag):
        self.asked.append((first, last, factor, lag))
        rows = np.append(first + np.arange((last - first) * factor + 1) / factor, np.full(lag, float(last)))
        return Sharp(delayed(self.recording.hip, rows), self.asked, dt=self.dt / factor)


@pytest.mark.parametrize(("begin", "row", "first"), [(0, 51, 47), (49, 2, 0)])
def test_a_jump_is_looked_into_from_a_lag_before_its_step_on_in_ever_finer_steps(begin, row, first):
    """The step to 0.51 mm: four parts of it, four of those, then 64 at once, until single precision ends."""
    hip, asked = np.column_stack([1e-5 * np.arange(begin, 80.0), np.full(80 - begin, -1e-3)]), []
    sharp = Sharp(hip, asked)
    place = look_closer(sharp, Observed(sharp.recording, SCENE), bounds=np.full(80 - begin, 8e-5), standoff=0.0)
    assert (place.kind, place.tick) == (Remains.STAYS, row)
    assert place.remaining == pytest.approx(3e-4, rel=1e-3)
    assert asked[0] == (first, row, 4, 3)
    assert [factor for *_, factor, _ in asked[:2]] == [4, 4]
    assert {lag for *_, lag in asked} == {3}
    # Each look begins three of its own ticks and one before the step that is looked into.
    assert all(last - first <= 4 for first, last, *_ in asked)
    assert all(later.halvings > sooner.halvings for sooner, later in pairwise(place.scales))
