"""A list of known failures excuses what it holds, and nothing that is worse: held against real renderers."""

import honest
import numpy as np
import pytest
from broken import spoiled
from outsiders import case
from result_entries import results_of

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Outcome
from hapticeval.runner.judging import judge
from hapticeval.runner.known import Known
from hapticeval.runner.results import VerdictEntry

ANGLES = np.linspace(0.0, 0.9, 200)
POINTS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
ROUND = case(
    "round",
    {"kind": "circle"},
    ("continuous-contact",),
    trajectory={"kind": "points", "points": [[0.105, 0.0], *(0.0963 * POINTS).tolist()], "duration": 0.9},
)
"""Round a circle of 0.1 m, 3.7 mm deep."""

facets = resolve("minimum-distance@polygon").with_knobs(vertices=80)
"""Its facets turn by 4.5 degrees: from one to the next the nearest point jumps by 2 tan(2.25 degrees) depths."""


def teleports(tick):
    """In one tick of fifty the tool is 30 mm further along."""
    if tick.number % 50 != 49 or not tick.inside:
        return tick.ihip, tick.force
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    return turn @ tick.ihip, turn @ tick.force


class Deeper(honest.Changed):
    """Takes the hand for three times as deep as it is: the nearest point jumps three times as far."""

    def step(self, hip, velocity, dt):
        ihip, _ = super().step(hip * max(3.0 - 0.2 / np.linalg.norm(hip), 0.0), velocity, dt)
        outside = np.linalg.norm(hip) >= 0.1
        return (hip, np.zeros(2)) if outside else (ihip, self.scene.stiffness * (ihip - hip))


def verdict(make):
    (found,) = judge(make, "mine", "known", ROUND).verdicts
    assert found.outcome is Outcome.FAIL
    return VerdictEntry.of(found)


@pytest.fixture(scope="module")
def listed():
    mini = verdict(facets)
    assert mini.metric.value == pytest.approx(0.29e-3, rel=0.05)
    return Known().renewed(results_of(mini))


def test_a_teleport_is_not_excused_by_a_mini_pop_that_is_known(listed):
    far = listed.marked(verdict(spoiled(teleports, facets)))
    assert far.metric.value == pytest.approx(0.03, rel=0.05)
    assert far.standing == "fail"
    assert far.beyond_known.startswith("another failure than the known one: 'major', and known is 'mini'")
    assert results_of(far).stops(far)


def test_a_mini_pop_three_times_as_far_is_worse(listed):
    far = listed.marked(verdict(lambda scene: Deeper(scene, facets(scene))))
    assert far.standing == "fail"
    assert far.beyond_known.startswith("worse than known: 0.8")


@pytest.mark.parametrize("change", [None, "late-1", "late-3", "single", "lists"])
def test_the_same_mini_pop_is_known_however_it_is_answered(listed, change):
    again = facets if change is None else honest.factory(change, facets)
    assert listed.marked(verdict(again)).standing == "known"
