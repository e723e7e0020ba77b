"""Alignment by place instead of time: exact where it may be, and silent where nothing was felt."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.compare.align import Abscissa, Run, align
from hapticeval.recordings.compare.permutation import LEVEL, needed
from hapticeval.recordings.recording import Recording

CIRCLE = make_model("circle").curve
RADIUS, DEPTH, STIFFNESS = 0.1, 0.001, 1000.0


def lap(angle, *, dt=1e-3, size=None, standing=None):
    """A spring contact on the circle of 0.1 m at the given HIP angles (n,); `size` (n,) is the force, N."""
    angle = np.asarray(angle, dtype=float)
    size = np.full(angle.size, STIFFNESS * DEPTH) if size is None else size
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    hip = RADIUS * outward - (size / STIFFNESS)[:, None] * outward
    time = dt * np.arange(angle.size) if standing is None else standing
    return Recording(time, {"hip": hip, "ihip": RADIUS * outward, "force": size[:, None] * outward})


def run(angle, **options):
    return Run("run 7", "one", lap(angle, **options))


def aligned(*runs, by="angle", **options):
    return align(runs, Abscissa(by, curve=CIRCLE), **options)


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.sampled_from([1, -1]), st.sampled_from(["angle", "arc"]))
def test_a_function_of_place_is_found_again_whatever_the_clock(seed, direction, by):
    rng = np.random.default_rng(seed)
    angle = direction * np.cumsum(rng.uniform(1e-3, 4e-3, 1500))
    found = aligned(run(angle, size=1.0 + 0.2 * np.sin(3.0 * angle)), by=by)
    scale = RADIUS if by == "arc" else 1.0
    assert {each.direction for each in found.passes} == {direction}
    for each in found.passes:
        place = found.grid[each.mask] / scale
        # Linear between samples at most 4 mrad apart: h^2 / 8 times the second derivative, 0.2 * 9.
        np.testing.assert_allclose(
            each.columns["magnitude"][each.mask], 1.0 + 0.2 * np.sin(3.0 * place), atol=1.01 * 4e-3**2 / 8 * 1.8
        )
        np.testing.assert_allclose(each.columns["leaning"][each.mask], 0.0, atol=1e-5)
        np.testing.assert_allclose(np.cos(each.columns["direction"][each.mask] - place), 1.0, atol=1e-9)
        assert all(np.isfinite(column).all() for column in each.columns.values())
        assert all(np.all(column[~each.mask] == 0.0) for column in each.columns.values())


def test_laps_are_told_apart_and_cover_the_circle_once_each():
    found = aligned(run(np.linspace(0.0, 6.0 * math.pi, 9001)))
    assert [each.lap for each in found.passes if each.coverage > 0.01] == [0, 1, 2]
    assert [each.coverage for each in found.passes][:3] == pytest.approx([1.0, 1.0, 1.0], abs=0.01)
    assert found.period == 2.0 * math.pi


def test_a_sector_across_the_seam_of_the_angles_stays_in_one_piece():
    found = aligned(run(np.linspace(-0.6, 0.7, 1000)), run(np.linspace(2.0 * math.pi - 0.5, 2.0 * math.pi + 0.6, 900)))
    assert len(found.passes) == 2
    assert found.grid[-1] - found.grid[0] == pytest.approx(1.3)
    assert found.passes[0].coverage > 0.99
    assert found.passes[1].coverage == pytest.approx(1.1 / 1.3, abs=0.01)


def test_a_hand_that_turns_back_is_refused_at_the_place():
    angle = np.concatenate([np.linspace(0.0, 1.0, 500), np.linspace(1.0, 0.7, 200), np.linspace(0.7, 1.5, 400)])
    with pytest.raises(InputError) as caught:
        aligned(run(angle))
    assert "run 7 turns back by 17.19 degrees at 57.3 degrees, t = 0.5 s" in str(caught.value)
    assert "give --split: every way between two turns is then a pass" in caught.value.todo
    assert "so that it takes {} and {} runs".format(*needed(1, 1, tests=2, level=LEVEL)) in caught.value.todo
    parts = aligned(run(angle), split=True).passes
    assert [each.direction for each in parts] == [1, -1, 1]
    assert [each.coverage for each in parts] == pytest.approx([1.0 / 1.5, 0.3 / 1.5, 0.8 / 1.5], abs=0.01)


def test_a_gap_ends_neither_a_lap_nor_a_way():
    angle = np.linspace(0.0, 4.0 * math.pi, 4001)
    time = 1e-3 * np.arange(angle.size)
    for first in (500, 1500, 3000):
        time[first:] += 0.05
    found = aligned(run(angle, standing=time))
    assert [each.lap for each in found.passes if each.coverage > 0.01] == [0, 1]
    back = np.concatenate([np.linspace(0.0, 1.0, 500), np.linspace(0.999, 0.7, 200)])
    time = 1e-3 * np.arange(back.size)
    time[500:] += 0.05
    with pytest.raises(InputError, match="turns back by 17"):
        aligned(run(back, standing=time))
    parts = aligned(run(back, standing=time), split=True).passes
    assert [(each.direction, each.lap) for each in parts] == [(1, 0), (-1, 0)]


def test_what_begins_anew_after_a_gap_is_another_pass_of_the_run():
    angle = np.concatenate([np.linspace(0.0, 1.0, 500), np.linspace(0.0, 1.1, 500)])
    time = 1e-3 * np.arange(angle.size)
    time[500:] += 2.0
    found = aligned(run(angle, standing=time)).passes
    assert [(each.direction, each.lap) for each in found] == [(1, 0), (1, 1)]
    assert [each.coverage for each in found] == pytest.approx([1.0 / 1.1, 1.0], abs=0.01)


def test_the_ways_of_a_run_that_goes_to_and_fro_are_numbered():
    angle = 0.5 - 0.5 * np.cos(np.linspace(0.0, 4.0 * math.pi, 4000))
    parts = aligned(run(angle), split=True).passes
    assert [(each.direction, each.lap) for each in parts] == [(1, 0), (-1, 0), (1, 1), (-1, 1)]


def test_a_hand_that_trembles_by_less_than_the_grid_does_not_turn():
    rng = np.random.default_rng(5)
    angle = np.linspace(0.0, 1.0, 4000) + rng.uniform(-3e-4, 3e-4, 4000)
    assert np.any(np.diff(angle) < 0.0)
    found = aligned(run(angle))
    assert [each.direction for each in found.passes] == [1]
    assert found.passes[0].coverage > 0.99


def test_nothing_is_interpolated_across_a_pop_through():
    angle = np.linspace(0.0, 1.0, 401)
    recording = lap(angle)
    ihip, force = np.array(recording.ihip), np.array(recording.force)
    beyond = np.column_stack([np.cos(angle + 0.5), np.sin(angle + 0.5)])
    ihip[200:] = RADIUS * beyond[200:]
    force[200:] = STIFFNESS * (ihip - recording.hip)[200:]
    found = align(
        [Run("jumps", "one", Recording(recording.time, {"hip": recording.hip, "ihip": ihip, "force": force}))],
        Abscissa("angle"),
        points=1601,
    )
    (only,) = found.passes
    hidden = found.grid[~only.mask]
    assert 3 <= hidden.size <= 5
    assert np.all((hidden > angle[199] - 1e-12) & (hidden < angle[200] + 1e-12))
    sizes = only.columns["magnitude"][only.mask]
    before = found.grid[only.mask] < angle[199] + 1e-12
    assert np.ptp(sizes[before]) < 1e-9
    assert np.all(sizes[~before] > 20.0 * sizes[0])


def test_a_jump_of_the_force_alone_is_not_interpolated_either():
    angle = np.linspace(0.0, 1.0, 401)
    recording = lap(angle)
    force = np.array(recording.force)
    force[300:] *= 30.0
    channels = {**recording.channels, "force": force}
    found = align([Run("x", "one", Recording(recording.time, channels))], Abscissa("angle"), points=1601)
    sizes = found.passes[0].columns["magnitude"][found.passes[0].mask]
    assert not np.any((sizes > 1.001) & (sizes < 29.999))


def test_gaps_and_free_space_are_left_out():
    angle = np.linspace(0.0, 1.0, 1001)
    time = 1e-3 * np.arange(1001)
    time[600:] += 0.3
    size = np.where((angle > 0.2) & (angle < 0.3), 0.0, 1.0)
    found = aligned(run(angle, standing=time, size=size))
    seen = [found.grid[each.mask] for each in found.passes]
    places = np.concatenate(seen)
    assert not np.any((places > 0.2) & (places < 0.3))
    assert not np.any((places > angle[599]) & (places < angle[600]))
    assert sum(each.coverage for each in found.passes) == pytest.approx(0.9, abs=0.01)


def test_rows_that_are_no_measurement_are_not_used():
    recording = lap(np.linspace(0.0, 1.0, 1001))
    valid = np.ones(1001, dtype=bool)
    valid[400:450] = False
    force = np.array(recording.force)
    force[~valid] = np.nan
    masked = Recording(recording.time, {**recording.channels, "force": force}, valid=valid)
    found = align([Run("x", "one", masked)], Abscissa("angle"))
    assert all(np.isfinite(each.columns["magnitude"]).all() for each in found.passes)
    assert sum(each.coverage for each in found.passes) == pytest.approx(0.95, abs=0.01)


def test_the_centre_must_not_be_on_the_way():
    hip = np.column_stack([np.linspace(-0.05, 0.05, 200), np.full(200, 1e-9)])
    recording = Recording(1e-3 * np.arange(200), {"hip": hip, "ihip": hip, "force": np.ones((200, 2))})
    with pytest.raises(InputError, match=r"passes the centre at t = 0\.0"):
        align([Run("through", "one", recording)], Abscissa("angle"))
    assert align([Run("through", "one", recording)], Abscissa("angle", centre=(0.0, -0.2))).passes


def test_a_phase_is_any_column_of_a_channel():
    hip = np.column_stack([np.linspace(0.0, 0.1, 300), np.full(300, -0.001)])
    ihip = np.column_stack([hip[:, 0], np.zeros(300)])
    recording = Recording(1e-3 * np.arange(300), {"hip": hip, "ihip": ihip, "force": 1000.0 * (ihip - hip)})
    found = align([Run("line", "one", recording)], Abscissa("hip:0"))
    assert (found.unit, found.period) == ("m", None)
    assert found.passes[0].coverage == 1.0
    np.testing.assert_allclose(found.passes[0].columns["depth"], 0.001)
    with pytest.raises(InputError, match="no column 5"):
        align([Run("line", "one", recording)], Abscissa("hip:5"))
    with pytest.raises(InputError, match="--by angle"):
        Abscissa("angles")
    with pytest.raises(InputError, match="--model"):
        Abscissa("arc")


def test_a_foot_that_leaps_over_the_medial_axis_is_not_bridged():
    """Down through an ellipse the nearest point changes sides at the long axis: the arc length leaps."""
    model = make_model("ellipse", ratio=2.0)
    y = np.linspace(0.03, -0.03, 601)
    hip = np.column_stack([np.full(601, 0.02), y])
    foot = model.curve.position(model.curve.nearest(hip))
    recording = Recording(1e-3 * np.arange(601), {"hip": hip, "ihip": foot, "force": 1000.0 * (foot - hip)})
    found = align([Run("x", "one", recording)], Abscissa("arc", curve=model.curve), split=True)
    s = model.curve.arc_length(model.curve.nearest(hip))
    leap = int(np.argmax(np.abs(np.diff(s))))
    low, high = sorted((float(s[leap]), float(s[leap + 1])))
    assert high - low > 0.5 * model.curve.length, "the shorter way leads over the start of the curve"
    places = np.concatenate([found.grid[each.mask] % model.curve.length for each in found.passes])
    assert places.size > 20
    assert not np.any((places < low - 1e-4) | (places > high + 1e-4))


def test_runs_that_never_touch_are_refused():
    recording = lap(np.linspace(0.0, 1.0, 100), size=np.zeros(100))
    with pytest.raises(InputError, match="touches"):
        align([Run("free", "one", recording)], Abscissa("angle"))
    with pytest.raises(InputError, match="no runs"):
        align([], Abscissa("angle"))
