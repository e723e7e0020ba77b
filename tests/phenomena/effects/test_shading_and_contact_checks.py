"""Checks of force shading and of what begins with a contact: what they measure, and where they have no question."""

from __future__ import annotations

import math

import honest
import numpy as np
import pytest
from made import changed, recorded
from struck_and_shaded import CASES, MIDDLE

from hapticeval.discovery import resolve
from hapticeval.effects.transients import MATERIALS, ContactImpulse, ContactTransient
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.transient import find_contacts, fit
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

SHADING = ("shading-direction", "shading-magnitude", "shading-work")
STRUCK = ("transient-onset", "transient-impulse", "transient-vibration")


def findings_by_check(case, renderer="minimum-distance"):
    """Findings by check of a case of `struck_and_shaded`."""
    make = resolve(renderer) if isinstance(renderer, str) else renderer
    judged = judge(make, "it", "made", CASES[case])
    assert judged.error is None
    return {verdict.check: verdict.finding for verdict in judged.verdicts}


def judged(effects, points, duration, *, model="line", **more):
    """The finding of a check along a path in a scene with effects."""
    scene = Scene(model=make_model(model), effects=effects, **more)
    path = Path(np.linspace(0.0, duration, len(points)), np.array(points))

    def run(chosen):
        return play(make_renderer(resolve("minimum-distance"), chosen), path, 1e-3, scene=chosen)

    return lambda check: CHECKS[check](Runs(run(scene), without=lambda kind: run(scene.without(kind))), scene)


def test_the_work_of_a_loop_is_told_and_is_the_closed_form_s():
    """From the middle to x = 30 mm of half a facet of 38.27 mm, where the normal is turned by psi."""
    finding = findings_by_check("facet-loop")["shading-work"]
    theta, half, end, shallow, deep = math.pi / 8, 0.1 * math.sin(math.pi / 8), 0.03, 0.5e-3, 1.5e-3
    slope = end / half * math.tan(theta)
    along = 1000.0 * (deep - shallow) * half * (math.sqrt(1.0 + slope**2) - 1.0) / math.tan(theta)
    closed = along - 500.0 * (deep**2 - shallow**2) * (1.0 - 1.0 / math.sqrt(1.0 + slope**2))
    assert abs(finding.evidence["shading_adds_J"]) == pytest.approx(closed, rel=1e-5)
    assert f"not passive: once round this loop it gives the hand {1e3 * closed:.4g} mJ" in finding.message
    assert finding.evidence["loops"] == 2
    assert pytest.approx(half / math.tan(theta)) == MIDDLE


def test_the_slide_shows_how_far_an_unshaded_force_would_turn():
    finding = findings_by_check("facet-slide")["shading-direction"]
    assert finding.evidence["turns_without_rad"] == pytest.approx(math.pi / 4, rel=1e-9)
    assert finding.metric.value < 0.1


@pytest.mark.parametrize("change", ["lists", "standoff", "sunk", "force-only"])
@pytest.mark.parametrize("case", CASES)
def test_an_honest_renderer_is_not_blamed(case, change):
    """Late ones are in the kill matrix; one that keeps its tool to itself has no place on a facet."""
    outcomes = {finding.outcome for finding in findings_by_check(case, honest.factory(change, honest.Spring)).values()}
    hidden = change == "force-only" and case.startswith("facet")
    assert outcomes == {Outcome.INCONCLUSIVE if hidden else Outcome.PASS}


@pytest.mark.parametrize("renderer", ["minimum-distance+pp-pd", "minimum-distance+square-root"])
@pytest.mark.parametrize("case", CASES)
def test_any_law_is_held_against_itself(case, renderer):
    outcomes = {finding.outcome for finding in findings_by_check(case, renderer).values()}
    assert outcomes <= {Outcome.PASS, Outcome.NOT_APPLICABLE}


@pytest.mark.parametrize("check", SHADING + STRUCK)
def test_a_scene_without_such_an_effect_is_not_asked(check):
    ask = judged((), [[0.0, 0.01], [0.0, -0.01]], 0.1)
    assert ask(check).outcome is Outcome.NOT_APPLICABLE


@pytest.mark.parametrize("check", STRUCK)
def test_without_a_contact_or_a_force_to_compare_with_nothing_is_decided(check):
    ring = ContactTransient(material="wood")
    scene = Scene(model=make_model("line"), effects=(ring,))
    assert ": no contact begins" in judged((ring,), [[0.0, 0.01], [0.0, 0.005]], 0.1)(check).message
    assert judged((ring,), [[0.0, -0.001], [0.0, -0.005]], 0.1)(check).message.startswith("no contact begins")
    path = Path(np.array([0.0, 0.1]), np.array([[0.0, 0.01], [0.0, -0.01]]))
    run = play(make_renderer(resolve("minimum-distance"), scene), path, 1e-3)
    assert CHECKS[check](Runs(run), scene).outcome is Outcome.INCONCLUSIVE


def test_a_contact_that_is_shorter_than_the_ringing_decides_no_impulse():
    ask = judged((ContactTransient(material="wood"),), [[0.0, 0.01], [0.0, -0.005], [0.0, 0.01]], 0.2)
    assert ask("transient-onset").outcome is Outcome.PASS
    assert "no contact lasts as long" in ask("transient-impulse").message


@pytest.mark.parametrize(("late", "known"), [(0, 0), (1, 1), (2, 1)])
def test_who_answers_a_contact_may_know_the_speed_of_the_tick_after_and_of_none_later(late, known):
    """The hand falls, faster in each tick, through a plane; an impulse of m v (4.21) is that of one of the speeds."""
    speed = np.linspace(0.1, 0.3, 9)
    hip = np.column_stack([np.zeros(9), 1e-4 * (3.5 - np.arange(9))])
    velocity = np.column_stack([np.zeros(9), -speed])
    plain = recorded(hip, np.where(hip > 0.0, hip, 0.0), velocity=velocity)
    force, (impulse,) = np.array(plain.force), (ContactImpulse(),)
    scene = Scene(model=make_model("line"), effects=(impulse,), mass=0.1)
    force[4, 1] += scene.mass * speed[4 + late] / 1e-3
    (struck,) = find_contacts(Observed(changed(plain, force=force), scene), Observed(plain, scene), impulse)
    assert struck.begin == 4
    assert struck.speed == pytest.approx(speed[4 + known])


@pytest.mark.parametrize(("late", "granted"), [(0, 1), (2, 3), (4, 5), (5, 1)])
def test_what_a_contact_starts_may_be_as_late_as_its_force_and_a_tick_more(late, granted):
    """Up to the three ticks of a lag and the one in which it begins; a later force is another contact's."""
    hip = np.column_stack([np.zeros(12), 1e-4 * (3.5 - np.arange(12))])
    force = 1000.0 * np.where(np.arange(12)[:, np.newaxis] >= 4 + late, np.maximum(-hip, 0.0), 0.0)
    plain = recorded(hip, np.where(hip > 0.0, hip, 0.0), force, velocity=np.gradient(hip, 1e-3, axis=0))
    scene = Scene(model=make_model("line"), effects=(ContactImpulse(),), mass=0.1)
    (struck,) = find_contacts(Observed(plain, scene), Observed(plain, scene), ContactImpulse())
    assert (struck.begin, struck.granted) == (4, granted)


def test_an_impulse_is_told_in_its_unit():
    """The tool's 0.1 kg at 0.2 m/s, stopped by 10 N at the most: 20 mN s."""
    finding = judged((ContactImpulse(cap=10.0),), [[0.0, 0.0051], [0.0, -0.0149]], 0.1)("transient-impulse")
    assert finding.message == "a contact at 0.2 m/s is given 20 mN s, as it should be, and 10 N at the most"
    assert finding.evidence["impulse_Ns"] == pytest.approx(0.02, rel=1e-9)


@pytest.mark.parametrize("material", MATERIALS)
def test_the_fit_s_interval_holds_the_true_numbers_as_often_as_it_should(material):
    """With noise of .1 % of the peak, 300 times: 99 % of the intervals hold decay and frequency."""
    amplitude, decay, frequency = MATERIALS[material]
    omega, random, time = 2.0 * math.pi * frequency, np.random.default_rng(5), 1e-3 * np.arange(round(21e3 / decay))
    wave = amplitude * np.exp(-decay * time) * np.sin(omega * time + 0.3)
    hits = np.zeros(2)
    for _ in range(300):
        noisy = wave + 1e-3 * np.abs(wave).max() * random.standard_normal(time.size)
        seen = fit(noisy, 1e-3, decay, frequency)
        hits += [
            abs(seen.decay - decay) <= seen.decay_open,
            abs(seen.frequency - frequency) <= seen.frequency_open,
        ]
    # Of 300 draws at .99 fewer than 290 come with a chance of 1 in 1,000; the floor of the noise only widens them.
    assert np.all(hits >= 290)
    assert seen.decay_open < 0.005 * decay
    assert seen.frequency_open < 0.001 * frequency
