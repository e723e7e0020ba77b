"""The cause that is named is the one that was planted, with its number; where nothing is off nothing is named."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from planted_causes import (
    COUPLED_FAULTS,
    FAULTS,
    IHIP_FAULTS,
    Planted,
    Situation,
    as_logged,
    draw_situation,
    is_planted,
    with_coupled_tool,
)

from hapticeval.diagnosis import Diagnosis, diagnose, right_contact
from hapticeval.diagnosis.fits import low_passed

SEEDS = (3, 14, 15, 92)


@pytest.fixture(scope="module", params=SEEDS)
def situation(request: pytest.FixtureRequest) -> Situation:
    return draw_situation(np.random.default_rng(request.param), seconds=2.0)


def names(diagnosis: Diagnosis) -> list[str]:
    return [diagnosis.kind, *(cause.kind for cause in diagnosis.alike)]


def is_off(planted: Planted, situation: Situation, share: float) -> bool:
    asked = situation.contact.force
    return bool(np.linalg.norm(planted.force - asked) > share * np.linalg.norm(asked))


def test_a_right_contact_is_not_diagnosed(situation: Situation) -> None:
    contact = situation.contact
    assert not diagnose(contact, contact.force, contact.point).off
    # as single precision answers it
    assert not diagnose(
        contact, contact.force.astype(np.float32).astype(float), contact.point.astype(np.float32).astype(float)
    ).off


@pytest.mark.parametrize(("kind", "faults"), [(kind, faults) for faults in (FAULTS, IHIP_FAULTS) for kind in faults])
def test_a_planted_fault_is_named(kind: str, faults: dict, situation: Situation) -> None:
    planted = faults[kind](situation)
    if not is_off(planted, situation, 1e-4):
        pytest.skip("this path does not show the fault")
    found = diagnose(situation.contact, planted.force, planted.ihip)
    # A cause that explains the same rows as exactly is no mistake, and the planted one is listed beside it or implied.
    assert any(is_planted(kind, name) for name in names(found)) or (found.cause and found.share > 1.0 - 1e-9), (
        found.sentence
    )


@pytest.mark.parametrize("kind", COUPLED_FAULTS)
def test_a_planted_fault_of_a_tied_tool_is_named(kind: str, situation: Situation) -> None:
    tied = with_coupled_tool(situation)
    assert not diagnose(tied.contact, tied.contact.force, tied.contact.point).off
    planted = COUPLED_FAULTS[kind](tied)
    found = diagnose(tied.contact, planted.force, planted.ihip)
    assert any(is_planted(kind, name) for name in names(found)), found.sentence


def test_most_planted_faults_of_a_log_are_named_and_none_wrongly(situation: Situation) -> None:
    results = Counter[str]()
    wrong = []
    for kind, plant in FAULTS.items():
        planted = plant(situation)
        hip, force = as_logged(planted, situation)
        contact = right_contact(
            situation.model.boundary,
            situation.contact.time,
            hip,
            stiffness=situation.contact.stiffness,
            damping=situation.damping,
        )
        if not is_off(planted, situation, 0.02):
            continue
        found = diagnose(contact, force, noisy=True)
        named = any(is_planted(kind, name) for name in names(found))
        results[named] += 1
        if not named and found.cause is not None:
            wrong.append(f"{kind}: {found.sentence}")
    assert results[True] >= 0.85 * results.total(), (results, wrong)
    assert len(wrong) <= 0.05 * results.total(), wrong


def test_a_right_log_raises_no_alarm(situation: Situation) -> None:
    hip, force = as_logged(Planted(situation.contact.force, None), situation)
    contact = right_contact(
        situation.model.boundary,
        situation.contact.time,
        hip,
        stiffness=situation.contact.stiffness,
        damping=situation.damping,
    )
    assert not diagnose(contact, force, noisy=True).off


def test_numbers_are_those_planted(situation: Situation) -> None:
    contact = situation.contact
    drag = diagnose(contact, contact.force - 2.0 * contact.slide, contact.point)
    assert drag.kind == "drag"
    assert drag.cause is not None
    assert drag.cause.numbers["drag"] == pytest.approx([2.0])
    late = np.concatenate([np.repeat(contact.force[:1], 7, axis=0), contact.force[:-7]])
    lag = diagnose(contact, late, contact.point)
    assert lag.cause is not None
    assert lag.cause.numbers["ticks"] == pytest.approx(7.0)
    assert "7 ms late" in lag.sentence


def test_a_damper_between_tool_and_hand_is_told_by_the_tool_s_own_points(situation: Situation) -> None:
    """F = K (p - h) + B (p' - h'), as a virtual coupling gives it, with a tool that sinks in and is late."""
    led = situation.contact
    point = low_passed(led.point, 0.1) + 0.05 * (led.hip - led.point)
    speed = np.concatenate([led.velocity[:1], np.diff(point, axis=0) / np.diff(led.time)[:, None]])
    force = led.stiffness * (point - led.hip) + 7.0 * (speed - led.velocity)
    contact = right_contact(
        situation.model.boundary, led.time, led.hip, led.velocity, stiffness=led.stiffness, points=point
    )
    diagnosis = diagnose(contact, force)
    assert diagnosis.kind == "coupling damping"
    assert diagnosis.sentence == "a damper of 7 N s/m acts between tool and hand"
    softer = diagnose(contact, force - 0.2 * led.stiffness * (point - led.hip))
    assert set(softer.kind.split(" + ")) == {"gain", "coupling damping"}
    # In a scene with a damper along the normal, which the coupling's takes the place of.
    asked = right_contact(
        situation.model.boundary, led.time, led.hip, led.velocity, stiffness=led.stiffness, damping=3.0, points=point
    )
    replaced = diagnose(asked, force)
    assert set(replaced.kind.split(" + ")) == {"normal damping", "coupling damping"}
    assert replaced.cause is not None
    assert replaced.cause.numbers["normal damping"] == pytest.approx([-3.0])
    # The tool's own spring without that damper begins where it should.
    assert diagnose(asked, led.stiffness * (point - led.hip)).kind == "normal damping"


def test_a_random_renderer_is_called_random(situation: Situation) -> None:
    contact, rng = situation.contact, np.random.default_rng(1)
    first, second = (contact.force * (1.0 + 0.1 * rng.standard_normal((len(contact.force), 1))) for _ in range(2))
    diagnosis = diagnose(contact, first, contact.point, again=lambda: second)
    assert diagnosis.kind == "random"
    assert diagnosis.cause is not None
    assert diagnosis.cause.numbers["share"] == pytest.approx(0.1, rel=0.1)


def test_what_another_renderer_does_as_well_is_not_random(situation: Situation) -> None:
    contact, rng = situation.contact, np.random.default_rng(1)
    noise = 0.1 * rng.standard_normal((len(contact.force), 1))
    first, second = (contact.force * (1.0 + noise + 0.03 * rng.standard_normal(noise.shape)) for _ in range(2))
    assert diagnose(contact, first, contact.point, again=lambda: second).kind == "unexplained"
    # What a cause explains is not asked about.
    assert diagnose(contact, 1.1 * contact.force, contact.point, again=pytest.fail).kind == "gain"
