"""The comparison of two benches whose times are known, and the pure functions beside it."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from hapticeval.study.bench.document import BenchResults, SettingEntry, Times
from hapticeval.study.bench.judge import (
    TIME_WORTH,
    cheapest_setting,
    compare_benches,
    convergence_order,
    describe,
    judge_times,
    pareto_front,
)

QUIET = Times(median=1e-7, p99=2e-7, rounds=[1e-7])


def times(*rounds):
    return Times(median=sorted(rounds)[len(rounds) // 2], p99=2.0 * max(rounds), rounds=list(rounds))


def document(steps, errors=None):
    entries = [
        SettingEntry(
            renderer="r", model="star", settings={}, label=f"r {key}",
            errors={"ihip": {"max": (errors or {}).get(key, 0.1)}}, claims=None, proven=None, step=step,
            memory_bytes=None, build_seconds=[], key=key, front=False, problem=None,
        )
        for key, step in steps.items()
    ]  # fmt: skip
    return BenchResults(
        complete=True, reason=None, quick=True, seed=0, rounds=1, environment={}, machine={}, command={}, references=[],
        settings=entries, orders=[], answers=[], timing={"wall_seconds": 1.0}, empty=QUIET,
    )  # fmt: skip


SECONDS = st.floats(1e-6, 1e-3)
ROUNDS = st.lists(SECONDS, min_size=1, max_size=6).map(lambda rounds: times(*rounds))


@given(now=ROUNDS, before=ROUNDS, noise=st.floats(0.0, 1e-4))
def test_who_is_called_slower_is_slower_in_every_round_and_by_more_than_luck(now, before, noise):
    verdict = judge_times(now, before, noise=noise)
    assert judge_times(before, now, noise=noise) == {"worse": "better", "better": "worse"}.get(verdict, verdict)
    if verdict == "worse":
        assert all(one > other for one, other in itertools.product(now.rounds, before.rounds))
        assert now.median > before.median * (1.0 + TIME_WORTH)
        assert now.median - before.median > noise


@pytest.mark.parametrize(
    ("now", "noise", "expected"),
    [
        ([1.2e-5, 1.3e-5], 0.0, "worse"),
        ([1.2e-5, 1.3e-5], 1e-5, "the same"),  # less than what a call that does nothing varies by
        ([0.99e-5, 1.3e-5], 0.0, "the same"),  # a round is as quick as before
        ([1.08e-5, 1.09e-5], 0.0, "the same"),  # less than the same code differs by
        ([0.5e-5, 0.6e-5], 0.0, "better"),
    ],
)
def test_times_on_each_side_of_what_counts(now, noise, expected):
    assert judge_times(times(*now), times(1e-5, 1e-5), noise=noise) == expected


def test_errors_are_compared_as_they_are():
    steps = {key: times(1e-5) for key in ("s0", "s1", "s2")}
    changes = compare_benches(document(steps, {"s1": 0.2}), document(steps, {"s2": 0.100001}))
    changed = {change.label: (change.verdict, change.ratio) for change in changes if change.what == "IHIP error"}
    assert changed["r s1"] == ("worse", pytest.approx(2.0))
    assert changed["r s2"][0] == "better"
    assert "r s0" not in changed


def test_what_changed_is_told_and_what_did_not_is_counted():
    before = document({key: times(1e-5, 1.1e-5) for key in ("s0", "s1", "s2")})
    now = document({"s0": times(2e-5, 2.2e-5), "s1": times(1e-5), "s2": times(1e-5)}, {"s1": 0.05})
    words = describe(replace(now, comparison=compare_benches(now, before)))
    assert "worse: r s0 on the star, step: 2 times\n" in words
    assert "better: r s1 on the star, IHIP error: 0.5 times\n" in words
    assert "compared: 2 of 4 the same" in words


def test_only_what_both_have_is_compared():
    steps = {key: times(1e-5) for key in ("s0", "s1", "s2")}
    assert [change.label for change in compare_benches(document(steps), document({"s0": times(1e-5), "s3": None}))] == [
        "r s0"
    ]


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
