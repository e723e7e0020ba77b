"""What suites once let pass is stopped, at a must, in words that say what it is; what is right beside it is not."""

from __future__ import annotations

import re

import numpy as np
import pytest
from broken import Tick
from made import FAIL, PASS
from msgspec.structs import replace
from overlooked import OVERLOOKED, VARIES, promising

from hapticeval.phenomena.verdict import Level
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite


def judged(make, place, check):
    suite, _, name = place.partition("/")
    (verdict,) = judge(make, "outside", suite, replace(load_suite(suite).case(name), checks=(check,))).verdicts
    return verdict


PLACES = [(name, place) for name, overlooked in OVERLOOKED.items() for place in overlooked.places]


@pytest.mark.parametrize(("name", "place"), PLACES)
def test_it_is_stopped_in_words_that_say_what_it_is(name, place):
    wrong = OVERLOOKED[name]
    verdict = judged(wrong.make, place, wrong.check)
    assert verdict.outcome is FAIL, verdict.finding.message
    assert re.search(wrong.words, verdict.finding.message)
    assert verdict.inherent == ""
    # Who declares nothing is not held to pushing alone.
    assert verdict.level is Level.MUST or wrong.check == "never-pulls"


def by_place(tick: Tick):
    """The stiffness leaps between two numbers every two millimetres."""
    return tick.ihip, (1.7 if 1e3 * tick.ihip[0] % 4.0 < 2.0 else 0.6) * tick.force


def by_depth(tick: Tick):
    """The stiffness grows with the depth."""
    return tick.ihip, min(0.6 + 200.0 * float(np.linalg.norm(tick.ihip - tick.hip)), 1.8) * tick.force


def late(fault, ticks):
    """What `fault` makes of an answer, with the force so many ticks late, or between two."""

    def make(tick: Tick):
        ihip, force = fault(tick)
        past = tick.memory.setdefault("past", [])
        past.append(force)
        whole, share = divmod(ticks, 1.0)
        one, two = (past[max(0, len(past) - 1 - int(whole) - more)] for more in (0, 1))
        return ihip, (1.0 - share) * one + share * two

    return make


@pytest.mark.parametrize("place", ["field/press-and-leave", "solids/pebble"])
@pytest.mark.parametrize("ticks", [0.0, 2.0, 2.6, 3.0])
@pytest.mark.parametrize("fault", [by_place, by_depth])
def test_a_stiffness_that_is_declared_to_vary_may_vary_with_place_and_depth(fault, ticks, place):
    verdict = judged(promising(late(fault, ticks), **VARIES), place, "force-magnitude")
    assert verdict.outcome is PASS, verdict.finding.message
