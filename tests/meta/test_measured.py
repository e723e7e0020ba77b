"""The net of recorded findings itself: its places are there, and what shakes a run does so alike each time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made import recorded
from measured import row_of
from shaken import SHAKES, off_by_rounding, shaken

from hapticeval.geometry.catalogue import circle
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.scene import Scene

ROOM = Path(__file__).parents[1]
SCENE = Scene(model=circle())


def slide(rate: int = 1) -> Runs:
    angle = np.linspace(0.0, 1.0, 300 * rate)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    base = recorded(0.098 * out, 0.1 * out, dt=1e-3 / rate, velocity=np.zeros_like(out))
    return Runs(base, refine=lambda factor: slide(rate * factor).base)


@pytest.mark.parametrize("make", SHAKES, ids=lambda make: make.__name__)
def test_each_shake_is_the_same_each_time(make):
    for seed in range(5):
        first, second = (make(np.random.default_rng(seed), SCENE)(slide().base, 1) for _ in range(2))
        assert first.channels.keys() == second.channels.keys()
        assert all(np.array_equal(first.channels[name], second.channels[name]) for name in first.channels)


def test_seeds_shake_differently_and_finer_siblings_alike():
    texts = set()
    for seed in range(40):
        runs = shaken(slide(), SCENE, seed)
        if runs.base.channels.keys() >= {"hip", "ihip", "force"}:
            texts.add(row_of(CHECKS["force-magnitude"](runs, SCENE)).text)
    assert len(texts) > 15
    finer = [shaken(slide(), SCENE, seed).refine for seed in range(40)]
    assert all(refine(2).dt > 0.0 for refine in finer if refine is not None)


def test_rounding_leaves_equal_numbers_equal_and_others_within_a_few_units_in_the_last_place():
    base = slide().base
    other = off_by_rounding(Runs(base)).base
    assert not np.array_equal(other.hip, base.hip)
    np.testing.assert_allclose(other.hip, base.hip, rtol=1e-14)
    free = recorded(base.hip)
    assert np.array_equal(off_by_rounding(Runs(free)).base.hip, off_by_rounding(Runs(free)).base.ihip)
