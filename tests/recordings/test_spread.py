"""Renderers against the spread of repeats: found where it is, silent where it is the hand's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import comb

from hapticeval.errors import InputError
from hapticeval.recordings.compare.align import Abscissa, Run, align
from hapticeval.recordings.compare.permutation import DEALS, Distances, least_p, needed, permuted
from hapticeval.recordings.compare.spread import bands, compare
from hapticeval.recordings.recording import Recording

ANGLE = np.linspace(0.1, 2.0, 500)
UNITS = tuple((side, k) for side in (0, 1) for k in range(4))
PLACE = (ANGLE - ANGLE[0]) / np.ptp(ANGLE)


def run(renderer, number, size, *, turned=0.0, angle=ANGLE):
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    push = size[:, None] * np.column_stack([np.cos(angle + turned), np.sin(angle + turned)])
    hip = 0.1 * outward - 1e-3 * push
    recording = Recording(1e-3 * np.arange(angle.size), {"hip": hip, "ihip": hip + 1e-3 * push, "force": push})
    return Run(f"{renderer} {number}", renderer, recording)


def hands(rng, renderer, count, *, more=0.0, turned=0.0, trembling=0.0):
    """Runs that share a shape and differ by a smooth random push each, as hands do, and `trembling` in direction."""
    made = []
    for number in range(count):
        push = 2.0 + 0.2 * rng.standard_normal() + 0.2 * np.sin(6.0 * PLACE + rng.uniform(0.0, 6.28))
        made.append(
            run(renderer, number, push + more, turned=turned + (trembling and trembling * rng.standard_normal()))
        )
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
    alarms = 0
    for _ in range(300):
        points = rng.standard_normal((4, 8))  # four columns that vary apart from each other
        columns = {f"c{k}": Distances(np.abs(each[:, None] - each), UNITS) for k, each in enumerate(points)}
        p, least = permuted(columns, seed=0)
        assert least == 2.0 / comb(8, 4)
        alarms += min(p.values()) < 0.05
    # p < 0.05 in any column has a probability of 2 / 70 at most: 8.6 of 300, 20 or more with a chance of 6e-4. Each
    # column tested by itself would give some 32.
    assert alarms < 20


def test_one_column_that_differs_is_found_among_those_that_do_not():
    rng = np.random.default_rng(13)
    found = compared(hands(rng, "a", 4, trembling=0.05), hands(rng, "b", 4, more=3.0, trembling=0.05))
    assert found["a", "b", "magnitude"].outcome == "differs"
    assert found["a", "b", "direction"].outcome == "within the spread"


def test_the_other_way_is_another_test():
    rng = np.random.default_rng(14)
    there = [*hands(rng, "a", 4), *hands(rng, "b", 4, more=9.0)]
    back = [run(each.renderer, f"{k} back", np.linalg.norm(each.recording.force, axis=1), angle=ANGLE[::-1])
            for k, each in enumerate(there)]  # fmt: skip
    found = compare(align([*there, *back], Abscissa("angle"), points=101))
    assert {each.direction for each in found} == {1, -1}
    assert [each.p for each in found if each.column == "magnitude"] == [pytest.approx(2.0 * 2.0 / comb(8, 4))] * 2


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


def test_a_run_that_is_given_twice_is_no_repeat():
    rng = np.random.default_rng(16)
    one, *others = hands(rng, "a", 4)
    with pytest.raises(InputError, match="a 0 and again are the same run"):
        compared([one, *others, Run("again", "a", one.recording)], hands(rng, "b", 4))


def test_too_few_repeats_are_said_to_be_so():
    rng = np.random.default_rng(6)
    found = compared(hands(rng, "a", 3), hands(rng, "b", 3, more=9.0))["a", "b", "magnitude"]
    assert found.outcome == "too few repeats to tell"
    assert found.least == pytest.approx(0.1)
    assert found.p == pytest.approx(0.1)
    assert (found.repeats, found.needed) == ((3, 3), (4, 3))


def test_so_many_repeats_as_are_asked_for_can_decide_and_fewer_cannot():
    rng = np.random.default_rng(17)
    enough = compared(hands(rng, "a", 4), hands(rng, "b", 3, more=9.0))["a", "b", "magnitude"]
    assert enough.outcome == "differs"
    assert enough.p == pytest.approx(1.0 / comb(7, 3))


@settings(max_examples=100)
@given(st.integers(1, 12), st.integers(1, 12), st.integers(1, 499), st.floats(0.01, 0.2))
def test_the_repeats_that_are_needed_are_the_fewest(first, second, tests, level):
    found = needed(first, second, tests=tests, level=level)
    if found is None:
        assert tests / (DEALS + 1) >= level
        return
    assert found[0] >= max(first, 2)
    assert found[1] >= max(second, 2)
    assert tests * least_p(*found) < level
    fewer = [
        (a, b)
        for a in range(max(first, 2), sum(found))
        for b in range(max(second, 2), sum(found) - a)
        if tests * least_p(a, b) < level
    ]
    assert fewer == []


@settings(max_examples=30)
@given(st.integers(2, 5), st.integers(2, 5), st.integers(0, 1000))
def test_the_least_p_is_that_of_complete_separation_whatever_the_distances(first, second, seed):
    rng = np.random.default_rng(seed)
    points = np.concatenate([rng.uniform(0.0, 1.0, first), 1e6 + rng.uniform(0.0, 1.0, second)])
    units = tuple((int(k >= first), k) for k in range(first + second))
    p, least = permuted({"x": Distances(np.abs(points[:, None] - points), units)}, seed=0)
    assert least == least_p(first, second)
    assert p["x"] >= least
    if abs(first - second) < 2:  # with 2 and 5 another deal of the names may part them as well
        assert p["x"] == pytest.approx(least)


def test_a_single_repeat_is_told_how_many_it_takes():
    rng = np.random.default_rng(18)
    with pytest.raises(InputError, match="'b' has a single repeat, 'a' 4") as caught:
        compared(hands(rng, "a", 4), hands(rng, "b", 1))
    assert "takes 3 of 'b' and 4 of 'a' at the least" in caught.value.todo


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize(("ways", "enough"), [(1, (4, 3)), (2, (5, 3))])
def test_one_run_of_each_is_said_to_be_too_few(gaps, ways, enough):
    """And the stretches between the gaps of a run are no laps."""
    angle = ANGLE if ways == 1 else np.concatenate([ANGLE, ANGLE[-2::-1]])
    size = np.full(angle.size, 2.0)
    runs = [run("a", 0, size, angle=angle), run("b", 0, size + 1.0, angle=angle)]
    runs = [torn(torn(each, 100, 20), 400, 30) if gaps else each for each in runs]
    with pytest.raises(InputError, match="one repeat of 'a' and one of 'b' are too few to compare") as caught:
        compare(align(runs, Abscissa("angle"), points=101, split=ways == 2))
    assert "takes {} of 'a' and {} of 'b' at the least".format(*enough) in caught.value.todo


def shifted(each, number, *, by, single=False):
    """A repeat of another renderer whose force differs by `by` of its size."""
    recording = each.recording
    force = recording.force * (1.0 + by)
    ihip = recording.ihip
    if single:
        force, ihip = (np.asarray(values, dtype=np.float32).astype(float) for values in (force, ihip))
    return Run(f"b {number}", "b", Recording(recording.time, {"hip": recording.hip, "ihip": ihip, "force": force}))


@settings(max_examples=30)
@given(st.integers(0, 1000), st.sampled_from([0.0, 1e-16, 1e-15, 3e-15]))
def test_what_rounding_makes_is_no_difference(seed, by):
    """Repeats on rails: the hand does not vary at all, and only rounding tells two renderers apart."""
    rng = np.random.default_rng(seed)
    one = hands(rng, "a", 1)[0]
    first = [shifted(one, k, by=1e-16 * k) for k in range(4)]
    first = [Run(f"a {k}", "a", each.recording) for k, each in enumerate(first)]
    first = [Run(each.label, "a", jogged(each.recording, k)) for k, each in enumerate(first)]
    second = [shifted(each, k, by=by) for k, each in enumerate(first)]
    found = compared(first, second)
    assert {each.outcome for each in found.values()} == {"the same to rounding"}
    assert all(0.0 <= each.rounding <= 1.0 and each.p == 1.0 for each in found.values())


def jogged(recording, number):
    """The same at another time, and in the last bit elsewhere: no copy."""
    hip = recording.hip.copy()
    hip[:, 0] = np.nextafter(hip[:, 0], np.inf if number % 2 else -np.inf)
    hip[number, 1] = np.nextafter(hip[number, 1], np.inf)
    return Recording(recording.time, {"hip": hip, "ihip": recording.ihip, "force": recording.force})


@pytest.mark.parametrize(("by", "single", "outcome"), [
    (1e-6, False, "differs"), (1e-8, False, "differs"), (1e-10, False, "differs"),
    (0.0, True, "the same to rounding"), (1e-8, True, "the same to rounding"), (1e-3, True, "differs"),
])  # fmt: skip
def test_what_the_numbers_resolve_is_a_difference(by, single, outcome):
    one = hands(np.random.default_rng(20), "a", 1)[0]
    first = [Run(f"a {k}", "a", jogged(one.recording, k)) for k in range(4)]
    second = [shifted(each, k, by=by, single=single) for k, each in enumerate(first)]
    found = compared(first, second)["a", "b", "magnitude"]
    assert found.outcome == outcome
    assert (found.rounding <= 1.0) == (outcome == "the same to rounding")
    if outcome == "differs":
        assert found.largest == pytest.approx(by * np.max(np.linalg.norm(one.recording.force, axis=1)), rel=0.01)


@settings(max_examples=30)
@given(st.floats(-math.pi, math.pi), st.floats(-0.5, 0.5), st.integers(0, 100))
def test_all_curves_of_a_panel_lie_on_one_branch(turned, apart, seed):
    """Forth and back, wherever the angles are cut: what differs by little is drawn beside each other.

    The push of 3 N at most shifts the hand by 3 mm, so that its angle at 0.1 m says where it is to 0.03 rad.
    """
    rng = np.random.default_rng(seed)
    there = [*hands(rng, "a", 2, turned=turned), *hands(rng, "b", 2, turned=turned + apart)]
    back = [
        run(each.renderer, f"{k} back", np.full(ANGLE.size, 2.0), turned=turned - apart, angle=ANGLE[::-1])
        for k, each in enumerate(there)
    ]
    drawn = [b for b in bands(align([*there, *back], Abscissa("angle"), points=101)) if b.column == "direction"]
    assert {(b.renderer, b.direction) for b in drawn} == {(name, way) for name in "ab" for way in (1, -1)}
    for one in drawn:
        for other in drawn:
            both = (one.count > 0) & (other.count > 0)
            assert np.max(np.abs(one.median - other.median)[both]) < 2.0 * abs(apart) + 2.0 * 0.03


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
    assert found.outcome == "the runs differ", "another run of the same renderer may be as far off"


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


def test_the_test_agrees_with_scipys_where_there_is_one_column():
    from scipy.stats import permutation_test

    rng = np.random.default_rng(15)
    for sizes in ((4, 4), (3, 5)):
        points = rng.standard_normal((sum(sizes), 3)) + np.arange(sum(sizes))[:, None] * 0.2
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)

        def energy(a, b, apart=apart):
            a, b = a.astype(int), b.astype(int)
            return 2 * apart[np.ix_(a, b)].mean() - apart[np.ix_(a, a)].mean() - apart[np.ix_(b, b)].mean()

        units = tuple((int(k >= sizes[0]), k) for k in range(sum(sizes)))
        p, least = permuted({"x": Distances(apart, units)}, seed=0)
        groups = np.arange(sizes[0]), np.arange(sizes[0], sum(sizes))
        theirs = permutation_test(groups, energy, vectorized=False, n_resamples=np.inf, alternative="greater")
        assert p["x"] == pytest.approx(float(theirs.pvalue))
        assert least == (2.0 if sizes[0] == sizes[1] else 1.0) / comb(8, sizes[0])


def turned(each, number, name, *, by):
    """The run again as a repeat of `name`, bit for bit but for its clock and a force that is turned by `by`, rad."""
    recording = each.recording
    spin = np.array([[math.cos(by), -math.sin(by)], [math.sin(by), math.cos(by)]])
    channels = {**recording.channels, "force": recording.force @ spin.T} if by else recording.channels
    return Run(f"{name} {number}", name, Recording(recording.time + number, channels))


def torn(each, first, length):
    """The run with a gap in its clock: it is felt in two stretches."""
    time = each.recording.time.copy()
    time[first:] += 1e-3 * length
    return Run(each.label, each.renderer, Recording(time, each.recording.channels))


@settings(max_examples=8)
@given(st.integers(0, 1000), st.floats(-9.0, -0.5), st.booleans())
def test_repeats_that_agree_to_the_bit_still_tell_renderers_apart(seed, power, gaps):
    """By any amount far above what the numbers resolve; and the clock's gaps, elsewhere in each, hide none of it."""
    rng = np.random.default_rng(seed)
    one = hands(rng, "a", 1)[0]
    first = [jiggled(turned(one, k, "a", by=0.0), k) for k in range(4)]
    for by, outcome in ((10.0**power, "differs"), (0.0, "the same to rounding")):
        second = [jiggled(turned(one, k + 4, "b", by=by), k + 4) for k in range(4)]
        runs = [torn(each, int(rng.integers(50, 450)), 20) if gaps else each for each in (*first, *second)]
        found = compared(runs)["a", "b", "direction"]
        assert found.outcome == outcome
        assert found.largest == pytest.approx(by, rel=1e-3, abs=1e-12)
        assert (found.rounding > 1.0) == (outcome == "differs")


def jiggled(each, number):
    """In the last bit elsewhere: no copy."""
    return Run(each.label, each.renderer, jogged(each.recording, number))
