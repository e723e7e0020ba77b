"""What may be declared of a force: a range that asks something, what its bound is, and a dead band at any step."""

from __future__ import annotations

import force_sizes
import numpy as np
import pytest
from asked import finding, verdicts
from broken import scaled, spoiled
from honest import Spring, declaring
from hypothesis import given, settings
from hypothesis import strategies as st
from made import FAIL, PASS
from outsiders import CASES, case

from hapticeval.discovery import resolve
from hapticeval.errors import RendererError
from hapticeval.phenomena.verdict import Level
from hapticeval.renderer import Declaration, wrapped
from hapticeval.renderer import Spring as Along
from hapticeval.suite.reading import load_suite

SIZE = "force-magnitude"


@pytest.mark.parametrize(("times", "edge"), [(3.0, 0.8), (0.2, 0.6)])
def test_the_bound_is_the_edge_of_the_declared_range_that_is_left(times, edge):
    make = declaring(spoiled(scaled(lambda tick: times), Spring), stiffness_range=(0.4, 1.8))
    found = finding(make, "slide", SIZE)
    assert found.outcome is FAIL
    assert found.bound == pytest.approx(edge, abs=0.05)


@pytest.mark.parametrize(("shares", "asks_little"), [((0.5, 1.5), False), ((1.0 / 32.0, 32.0), True)])
def test_a_range_that_says_next_to_nothing_is_named_as_such(shares, asks_little):
    kicks = declaring(force_sizes.faulty("hard-kick"), stiffness_range=shares)
    assert ("of K, which asks little" in finding(kicks, "thesis/plane-impact", SIZE).message) is asks_little


@pytest.mark.parametrize(
    ("shares", "sound"),
    [((1.0 / 32.0, 32.0), True), ((0.99 / 32.0, 2.0), False), ((0.5, 32.1), False), ((1e-6, np.inf), False)],
)
def test_a_range_that_would_ask_nothing_is_refused(refused, shares, sound):
    renderer = Spring(CASES["slide"].build_scene())
    renderer.declares = Declaration(stiffness_range=shares)
    if sound:
        assert wrapped(renderer).declares is renderer.declares
    else:
        with refused(RendererError):
            wrapped(renderer)


def test_what_the_gradient_declares_is_between_its_softest_and_its_stiffest():
    """Of `homothetic` it is H^2 / h^2: 478 to 1,582 N/m on the Cassinian, as docs/continuous-and-passive.md has it."""
    said = wrapped(resolve("homothetic")(load_suite("thesis").case("cassinian-loops").build_scene())).declares
    assert said.spring is Along.NORMAL
    assert said.stiffness_range == pytest.approx((0.478, 1.582), rel=2e-3)


@settings(max_examples=12)
@given(step=st.floats(0.02e-3, 0.2e-3), deepest=st.floats(2e-3, 4e-3))
def test_a_dead_band_is_judged_alike_whatever_the_step_of_the_path(step, deepest):
    """The hand slides in the band: undeclared that fails a must, and declared nothing is left of it."""
    points = [[0.0, 1e-3], [0.0, -0.05e-3], [0.01, -0.05e-3], [0.01, -deepest], [0.012, -deepest]]
    seconds = 1e-3 * np.linalg.norm(np.diff(points, axis=0), axis=1).sum() / step
    path = {"kind": "points", "points": points, "duration": float(seconds)}
    band = case("band", {"kind": "line"}, (SIZE,), trajectory=path)
    bare = verdicts(lambda scene: force_sizes.Coarse(scene, declared=False), band)[SIZE]
    assert (bare.outcome, bare.level) == (FAIL, Level.MUST), bare.finding.message
    assert "dead band" in bare.finding.message
    assert finding(force_sizes.Coarse, band, SIZE).outcome is PASS
