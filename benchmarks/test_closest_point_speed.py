"""One point's place on a boundary, asked from Python: what a renderer in plain Python pays at every tick.

`extra_info` holds the time beside a call of a compiled function that adds two numbers, in the same run.
"""

import timeit

import numba
import numpy as np
import pytest

from hapticeval.geometry.catalogue import KINDS_FROM_USER, MODELS, make_model

KINDS = [kind for kind in MODELS if kind not in KINDS_FROM_USER]


@pytest.fixture(scope="module")
def call() -> float:
    """Seconds of a call that does next to nothing."""
    add = numba.njit(lambda a, b: a + b)
    add(1.0, 2.0)
    return min(timeit.repeat(lambda: add(1.0, 2.0), number=10_000, repeat=9)) / 10_000


@pytest.mark.parametrize("ask", ["closest_point", "signed_distance"])
@pytest.mark.parametrize("kind", KINDS)
def test_one_point(benchmark, call, kind, ask):
    benchmark.group = f"boundary, {ask} of one point"
    model = make_model(kind)
    asked, hip = getattr(model.boundary, ask), np.array([0.03, 0.041, 0.02][: model.dimension])
    benchmark(lambda: asked([hip]))
    if benchmark.stats is not None:
        benchmark.extra_info["trivial calls"] = benchmark.stats.stats.median / call
