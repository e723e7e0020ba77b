"""How soon a search meets the first failure of each renderer on each check that it is published to fail."""

from __future__ import annotations

import pytest

from hapticeval.phenomena.verdict import Outcome
from hapticeval.search.drawing import draw_cases, judgeable
from hapticeval.search.trial import Bench
from hapticeval.suite.reading import load_suite

MOST = 500

PUBLISHED = sorted(
    {
        (renderer, check)
        for suite in ("thesis", "generated")
        for case in load_suite(suite).cases
        for renderer, outcomes in case.published.items()
        for check, outcome in outcomes.items()
        if outcome == Outcome.FAIL and check in judgeable()
    }
)


def first_failure(renderer: str, check: str) -> int:
    """Return after how many examples a search with the seed 0 meets it."""
    with Bench(renderer, 0, lambda: False) as bench:
        for number, case in enumerate(draw_cases((), [check], 0), 1):
            if check in [fault.check for fault in bench(case).faults]:
                return number
            assert number < MOST, f"{renderer} fails {check} in none of {MOST} examples"
    raise AssertionError


@pytest.mark.parametrize(("renderer", "check"), PUBLISHED)
@pytest.mark.slow
def test_how_soon_the_first_failure_is_met(benchmark, renderer, check):
    """In a process of its own, with its start and the preparation of each model, kernels compiled: within 10 s."""
    benchmark.extra_info["examples"] = benchmark.pedantic(lambda: first_failure(renderer, check), rounds=1)
