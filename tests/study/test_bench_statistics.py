"""The comparison of two benches on samples whose truth is known, and the pure functions beside it."""

import itertools
import math
import re

import numpy as np
import pytest
from msgspec.structs import replace

from hapticeval.study.bench.compare import (
    SIGNIFICANCE,
    Shift,
    _outside_count,
    compare_benches,
    estimate_shift,
    holm,
    judge_shift,
)
from hapticeval.study.bench.document import BenchResults, SettingEntry
from hapticeval.study.bench.judge import cheapest_setting, convergence_order, describe, pareto_front

ROUNDS = 8


def autocorrelated(random, *, rounds=ROUNDS, steps=50, median=5000.0):
    """Times in which a whole round is slow or quick together, with a long tail, as a machine's are."""
    slow = np.exp(0.02 * random.standard_normal((rounds, 1)))
    tail = 1.0 + 0.1 * random.pareto(2.0, (rounds, steps))
    return (median * slow * tail).astype(np.int64)


def document(samples, errors=None):
    entries = [
        SettingEntry(
            renderer="r", model="star", settings={}, label=f"r {key}",
            errors={"ihip": {"max": (errors or {}).get(key, 0.1)}},
            claims=None, proven=None, step=None, batch=None, memory_bytes=None, build_seconds=[], key=key, front=[],
            problem=None,
        )
        for key in dict.fromkeys(name.partition("/")[0] for name in samples)
    ]  # fmt: skip
    return BenchResults(
        complete=True, reason=None, quick=True, seed=0, rounds=1, environment={}, machine={}, command={}, references=[],
        settings=entries, orders=[], answers=[], timing={},
    )  # fmt: skip


def bench(random, count, factor=1.0):
    return {f"s{k}/step": autocorrelated(random, median=5000.0 * (factor if k == 0 else 1.0)) for k in range(count)}


def test_two_benches_of_the_same_code_hardly_ever_differ():
    random = np.random.default_rng(1)
    runs = 60
    alarms = 0
    for _ in range(runs):
        now, before = bench(random, 10), bench(random, 10)
        alarms += any(
            each.verdict != "not significant" for each in compare_benches(document(now), now, document(before), before)
        )
    assert alarms <= SIGNIFICANCE * runs


def test_the_rank_test_itself_holds_its_level_without_the_least_worth():
    random = np.random.default_rng(2)
    ps = [
        estimate_shift(np.median(autocorrelated(random), axis=1), np.median(autocorrelated(random), axis=1)).p
        for _ in range(400)
    ]
    assert 0.02 < np.mean(np.array(ps) < SIGNIFICANCE) < 0.08


@pytest.mark.parametrize(("factor", "expected"), [(1.3, "worse"), (0.75, "better")])
def test_a_shift_is_found_where_it_is_and_nowhere_else(factor, expected):
    random = np.random.default_rng(3)
    found = 0
    for _ in range(20):
        now, before = bench(random, 10, factor), bench(random, 10)
        changes = compare_benches(document(now), now, document(before), before)
        found += changes[0].verdict == expected
        assert all(each.verdict == "not significant" for each in changes[1:])
    assert found == 20


def test_the_interval_covers_the_ratio():
    random = np.random.default_rng(4)
    covered = 0
    for _ in range(300):
        now = 1.2 * np.exp(0.05 * random.standard_normal(ROUNDS))
        before = np.exp(0.05 * random.standard_normal(ROUNDS))
        found = estimate_shift(now, before)
        assert found.low <= found.ratio <= found.high
        covered += found.low <= 1.2 <= found.high
    assert 0.92 <= covered / 300 <= 0.985


@pytest.mark.parametrize(("n", "m"), [(3, 3), (4, 4), (5, 3), (4, 6)])
def test_the_rank_of_the_interval_is_exact(n, m):
    """Against all ways in which n of n + m ranks can be the first sample's."""
    statistics = [
        sum(a > b for a in chosen for b in set(range(n + m)) - set(chosen))
        for chosen in itertools.combinations(range(n + m), n)
    ]
    largest = max(
        (c for c in range(n * m + 1) if np.mean(np.array(statistics) <= c - 1) <= SIGNIFICANCE / 2.0), default=0
    )
    assert _outside_count(n, m) == largest


def test_few_rounds_give_no_bounded_interval():
    found = estimate_shift(np.array([2.0, 2.1, 2.2]), np.array([1.0, 1.1, 1.2]))
    assert (found.low, found.high) == (0.0, math.inf)
    assert found.p == pytest.approx(0.1)


def test_holm():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def test_a_small_shift_is_not_called_however_sure():
    assert judge_shift(Shift(1.05, 1.04, 1.06, 1e-9), 1e-9, worth=0.1) == "not significant"
    assert judge_shift(Shift(1.2, 1.1, 1.3, 1e-9), 1e-9, worth=0.1) == "worse"
    assert judge_shift(Shift(1.2, 0.9, 1.5, 0.2), 0.2, worth=0.1) == "not significant"


def test_errors_are_compared_as_they_are():
    random = np.random.default_rng(5)
    samples = bench(random, 3)
    changes = compare_benches(document(samples, {"s1": 0.2}), samples, document(samples, {"s2": 0.100001}), samples)
    changed = {each.label: (each.verdict, each.ratio) for each in changes if each.what == "IHIP error"}
    assert changed["r s1"] == ("worse", pytest.approx(2.0))
    assert changed["r s2"][0] == "better"
    assert "r s0" not in changed


def test_what_changed_is_told_with_its_interval_and_what_did_not_is_counted():
    random = np.random.default_rng(3)
    before, now = bench(random, 3), bench(random, 3, factor=2.0)
    changes = compare_benches(document(now, {"s1": 0.05}), now, document(before), before)
    words = describe(replace(document(now), comparison=changes, timing={"wall_seconds": 1.0}))
    assert re.search(r"worse: r s0 on the star, step: (1\.9|2)\d* times \[1\.\d+, 2\.\d+\], p = ", words)
    assert "better: r s1 on the star, IHIP error: 0.5 times\n" in words
    assert "compared: 2 of 4 not significant" in words


def test_only_what_both_have_is_compared():
    random = np.random.default_rng(6)
    now, before = bench(random, 3), bench(random, 2)
    assert [each.label for each in compare_benches(document(now), now, document(before), before)] == ["r s0", "r s1"]


def brute_front(times, errors):
    return sorted(
        k
        for k in range(len(times))
        if not any(
            (times[j] <= times[k] and errors[j] <= errors[k] and (times[j], errors[j]) != (times[k], errors[k]))
            or ((times[j], errors[j]) == (times[k], errors[k]) and j < k)
            for j in range(len(times))
        )
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_front_is_what_none_beats(seed):
    times, errors = np.random.default_rng(seed).integers(1, 12, (2, 40)).tolist()
    found = pareto_front(times, errors)
    assert sorted(found) == brute_front(times, errors)
    assert [times[k] for k in found] == sorted(times[k] for k in found)


def test_a_time_that_is_not_finite_is_never_on_the_front():
    assert pareto_front([math.inf, 1.0], [0.0, 1.0]) == [1]
    assert pareto_front([], []) == []


def test_the_cheapest_setting_that_will_do():
    times, errors = [1.0, 2.0, 2.04, 9.0], [1.0, 0.09, 0.01, 0.0]
    assert cheapest_setting(times, errors, within=0.1) == 2  # as quick as the one before, and more accurate
    assert cheapest_setting(times, errors, within=2.0) == 0
    assert cheapest_setting(times, errors, within=0.001) == 3
    assert cheapest_setting(times, errors, within=0.001, budget=5.0) is None
    assert cheapest_setting([], [], within=1.0) is None


@pytest.mark.parametrize("p", [0.5, 1.0, 2.0])
def test_the_order_of_a_power_law(p):
    counts, cells = [20, 40, 80], [4e-3, 2e-3, 1e-3]
    assert convergence_order(counts, [7.0 * n**-p for n in counts]) == pytest.approx(p)
    assert convergence_order(cells, [7.0 * h**p for h in cells]) == pytest.approx(p)


def test_no_order_of_two_settings_or_of_exact_ones():
    assert convergence_order([10, 20], [1.0, 0.5]) is None
    assert convergence_order([10, 20, 40], [1.0, 0.5, 0.0]) is None
