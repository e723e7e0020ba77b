"""Renderers that are right and late, coarse in their numbers, or at a declared distance: no check may blame them."""

from __future__ import annotations

from contextlib import suppress

import honest
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from made import recorded

from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, line, star
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

SCENES = {
    model.name: Scene(model=model) for model in (circle(), ellipse(), cassinian(), dumbbell(neck=0.3), line(), star())
}


def shallow(model, first, second, depth, duration):
    """From 2 mm outside to `depth` inside, along the surface at it, and out again; (first, second) are shares of it."""
    curve = model.curve
    along = first + np.linspace(0.0, second, 9)
    u = curve.parameter(along * curve.length) if curve.closed else 0.1 * along
    at, normal = curve.position(u), curve.normal(u)
    depths = np.array([-2e-3, *[depth] * 7, -2e-3])[:, None]
    return Path(np.linspace(0.0, duration, 9), at - depths * normal)


@pytest.mark.parametrize("change", sorted(honest.HONEST))
@given(
    name=st.sampled_from(sorted(SCENES)),
    first=st.floats(0.0, 1.0),
    second=st.floats(0.02, 0.1),
    depth=st.floats(1e-4, 2e-3),
    duration=st.sampled_from([0.1, 0.3]),
)
@settings(max_examples=12, deadline=None)
def test_what_is_right_points_along_the_normal_at_any_speed(change, name, first, second, depth, duration):
    scene = SCENES[name]
    made = honest.factory(change, resolve("minimum-distance"))(scene)
    found = CHECKS["contact-normal-force"](
        Runs(play(made, shallow(scene.model, first, second, depth, duration), 1e-3)), scene
    )
    assert found.outcome is not Outcome.FAIL, found


@pytest.mark.parametrize("change", sorted(set(honest.HONEST) - {"force-only"}))
@pytest.mark.parametrize("renderer", ["minimum-distance", "conformal"])
@given(
    name=st.sampled_from(["circle", "ellipse", "cassinian"]),
    first=st.floats(0.0, 1.0),
    second=st.floats(0.02, 0.1),
    rests=st.booleans(),
)
@settings(max_examples=8, deadline=None)
def test_an_answer_that_comes_late_on_both_ways_is_no_memory(change, renderer, name, first, second, rests):
    """Deep inside, where the tool goes much faster than the hand; also of a hand that rests on its way."""
    scene = SCENES[name]
    path = shallow(scene.model, first, second, 0.01, 0.3)
    _, hips = path.sampled(1e-3)
    if rests:
        hips = np.vstack([hips[:150], np.repeat(hips[150:151], 20, axis=0), hips[151:]])
    led = Path(1e-3 * np.arange(len(hips)), hips)
    made = honest.factory(change, resolve(renderer))(scene)
    runs = Runs(play(made, led, 1e-3), reverse=lambda: play(made, led.reversed(), 1e-3))
    found = CHECKS["memoryless"](runs, scene)
    assert found.outcome is Outcome.PASS, found


@pytest.mark.parametrize(("change", "height"), [("standoff", 1e-4), ("sunk", -1e-4)])
def test_the_stand_ins_stand_off_as_they_declare(change, height):
    scene = Scene(model=circle())
    answer = honest.factory(change, honest.Spring)(scene).step(np.array([0.0, 0.09]), np.zeros(2), 1e-3)
    assert scene.model.boundary.signed_distance(answer.ihip[np.newaxis])[0] == pytest.approx(height)


@pytest.mark.parametrize("duration", [8.0, 4.0, 1.0])
def test_the_same_path_gets_the_same_verdict_at_any_speed(duration):
    """A degree beside the normal, all along a lobe of the Cassinian: 3 steps of 0.1 mm turn it by half of that."""
    scene = SCENES["cassinian"]
    path = shallow(scene.model, 0.95, 0.1, 1e-3, duration)
    right = play(resolve("minimum-distance")(scene), path, 1e-3)
    turn = np.radians(1.0)
    turned = right.force @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    wrong = type(right)(right.time, {**right.channels, "force": turned}, right.meta)
    assert CHECKS["contact-normal-force"](Runs(right), scene).outcome is Outcome.PASS
    assert CHECKS["contact-normal-force"](Runs(wrong), scene).outcome is Outcome.FAIL


@settings(max_examples=40)
@example(rows=4, seed=0, source="playback", off=True)
@example(rows=1, seed=0, source=None, off=True)
@given(
    rows=st.integers(1, 8),
    seed=st.integers(0, 2**32 - 1),
    source=st.sampled_from(["playback", "experiment", None]),
    off=st.booleans(),
)
def test_a_recording_of_a_few_rows_is_judged_or_refused(rows, seed, source, off):
    """Fewer rows than any window of ticks: nothing is looked up beyond them, whatever the answers are."""
    rng = np.random.default_rng(seed)
    hip = np.column_stack([np.linspace(0.0, 0.01, rows), rng.uniform(-4e-3, 2e-3, rows)])
    ihip = np.column_stack([hip[:, 0], np.maximum(hip[:, 1], 0.0)]) + off * rng.normal(0.0, 1e-3, (rows, 2))
    force = rng.uniform(0.0, 2.0, (rows, 1)) * 1000.0 * (ihip - hip)
    base = recorded(hip, ihip, force, meta={} if source is None else {"source": source})
    for check in CHECKS.values():
        with suppress(InputError):
            assert check(Runs(base), Scene(model=line())).outcome in Outcome
