"""Renderers against the spread of repeats: found where it is, silent where it is the hand's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import comb

from hapticeval.errors import InputError
from hapticeval.recordings.abscissa import Abscissa
from hapticeval.recordings.alignment import Run, align
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.spread import bands, compare

ANGLE = np.linspace(0.1, 2.0, 500)
PLACE = (ANGLE - ANGLE[0]) / np.ptp(ANGLE)


def run(renderer, number, size, *, turned=0.0, angle=ANGLE):
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    push = size[:, None] * np.column_stack([np.cos(angle + turned), np.sin(angle + turned)])
    hip = 0.1 * outward - 1e-3 * push
    recording = Recording(1e-3 * np.arange(angle.size), {"hip": hip, "ihip": hip + 1e-3 * push, "force": push})
    return Run(f"{renderer} {number}", renderer, recording)


def hands(rng, renderer, count, *, more=0.0, turned=0.0):
    """Runs that share a shape and differ by a smooth random push each, as hands do."""
    made = []
    for number in range(count):
        push = 2.0 + 0.2 * rng.standard_normal() + 0.2 * np.sin(6.0 * PLACE + rng.uniform(0.0, 6.28))
        made.append(run(renderer, number, push + more, turned=turned))
    return made


def compared(*groups, seed=0):
    aligned = align([each for group in groups for each in group], Abscissa("angle"), points=101)
    return {(each.first, each.second, each.column): each for each in compare(aligned, seed=seed)}


def test_a_difference_beyond_the_repeats_is_found_with_its_size():
    rng = np.random.default_rng(1)
    found = compared(hands(rng, "a", 6), hands(rng, "b", 6, more=1.5))["a", "b", "magnitude"]
    assert found.outcome == "differs"
    assert found.difference == pytest.approx(1.5, abs=0.3)
    assert found.times == pytest.approx(found.difference / found.spread)
    assert found.p == pytest.approx(2.0 / comb(12, 6)), "both complete separations are the most extreme deals"
    assert found.basis == "runs"
    assert found.repeats == (6, 6)


def test_hands_that_differ_are_no_difference_of_renderers():
    rng = np.random.default_rng(2)
    found = compared(hands(rng, "a", 6), hands(rng, "b", 6))["a", "b", "magnitude"]
    assert found.outcome == "within the spread"
    assert found.p > 0.05


def test_false_alarms_are_as_rare_as_the_level_says():
    rng = np.random.default_rng(3)
    alarms = [
        compared(hands(rng, "a", 4), hands(rng, "b", 4))["a", "b", "magnitude"].outcome == "differs" for _ in range(40)
    ]
    # p < 0.05 has probability 2 / 70 under exchange; seven or more of 40 a chance of 1.3e-4.
    assert sum(alarms) < 7


def test_a_turned_force_is_found_across_the_cut_of_the_angles():
    rng = np.random.default_rng(4)
    groups = hands(rng, "a", 5, turned=math.pi - 1.0), hands(rng, "b", 5, turned=math.pi - 0.9)
    found = compared(*groups)["a", "b", "direction"]
    assert found.outcome == "differs"
    assert found.difference == pytest.approx(0.1, abs=1e-3)


def test_a_single_repeat_is_refused():
    rng = np.random.default_rng(5)
    with pytest.raises(InputError, match="'b' has a single repeat") as caught:
        compared(hands(rng, "a", 4), hands(rng, "b", 1))
    assert "could be the hand's" in caught.value.why
    with pytest.raises(InputError, match="two renderers"):
        compared(hands(rng, "a", 4))


def test_too_few_repeats_are_said_to_be_so():
    rng = np.random.default_rng(6)
    found = compared(hands(rng, "a", 3), hands(rng, "b", 3, more=9.0))["a", "b", "magnitude"]
    assert found.outcome == "too few repeats to tell"
    assert found.least == pytest.approx(0.1)
    assert found.p == pytest.approx(0.1)


def test_many_pairs_are_not_tested_for_free():
    rng = np.random.default_rng(7)
    found = compared(hands(rng, "a", 5), hands(rng, "b", 5, more=9.0), hands(rng, "c", 5, more=18.0))
    assert found["a", "b", "magnitude"].p == pytest.approx(3.0 * 2.0 / comb(10, 5))


def test_laps_of_a_single_run_stand_in_for_repeats_and_are_named():
    angle = np.linspace(0.0, 10.0 * math.pi, 9000)
    rng = np.random.default_rng(8)
    groups = [
        [run(name, 0, 2.0 + more + 0.1 * np.sin(angle * 0.37 + rng.uniform(0, 6.28)), angle=angle)]
        for name, more in (("a", 0.0), ("b", 1.0))
    ]
    found = compared(*groups)["a", "b", "magnitude"]
    assert found.basis == "laps of one run"
    assert found.repeats[0] >= 5
    assert found.outcome == "differs"


def test_laps_are_no_repeats_where_there_are_several_runs():
    angle = np.linspace(0.0, 6.0 * math.pi, 6000)
    rng = np.random.default_rng(9)
    groups = [
        [run(name, k, np.full(angle.size, 2.0 + rng.normal()), angle=angle) for k in range(4)] for name in ("a", "b")
    ]
    found = compared(*groups)["a", "b", "magnitude"]
    assert found.repeats == (4, 4)


def test_the_band_is_the_median_between_the_extremes():
    runs = [run("a", k, np.full(ANGLE.size, size)) for k, size in enumerate((1.0, 2.0, 4.0))]
    found = next(b for b in bands(align(runs, Abscissa("angle"), points=101)) if b.column == "magnitude")
    seen = found.count == 3
    assert seen.mean() > 0.95
    np.testing.assert_allclose(found.median[seen], 2.0, rtol=1e-4)
    np.testing.assert_allclose(found.low[seen], 1.0, rtol=1e-4)
    np.testing.assert_allclose(found.high[seen], 4.0, rtol=1e-4)


def test_runs_over_other_places_are_not_compared():
    rng = np.random.default_rng(10)
    far = [run("b", k, 2.0 + 0.1 * rng.standard_normal(500), angle=ANGLE + 1.88) for k in range(3)]
    near = [run("c", k, 2.0 + 0.1 * rng.standard_normal(500)) for k in range(3)]
    found = compared(hands(rng, "a", 3), far, near)
    assert found["a", "b", "magnitude"].outcome == "too little in common"
    assert found["a", "c", "magnitude"].outcome == "too few repeats to tell"
    with pytest.raises(InputError, match="same places"):
        compared(hands(rng, "a", 3), far)


def test_a_stray_way_back_does_not_stop_the_comparison():
    rng = np.random.default_rng(12)
    back = run("b", 9, np.full(500, 2.0), angle=ANGLE[::-1])
    found = align([*hands(rng, "a", 4), *hands(rng, "b", 4), back], Abscissa("angle"), points=101)
    assert {each.direction for each in found.passes} == {1, -1}
    assert {each.direction for each in compare(found)} == {1}
