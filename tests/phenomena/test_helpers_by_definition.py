"""What checks are made of, held against its definition, worked out anew, and on each side of every threshold in it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import changed, recorded
from scipy.signal import get_window
from scipy.special import polygamma
from scipy.stats import chi2

from hapticeval.geometry.catalogue import circle, from_vertices, line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.continuous_contact import coarsened_slope, limit_of_jumps
from hapticeval.phenomena.checks.texture import spectrum_bound, welch_of
from hapticeval.phenomena.checks.transient import prony
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.lag import (
    Lag,
    believed_lag,
    beside_straight,
    delayed,
    largest_in_lag,
    likely_force_lags,
    resting_ticks,
)
from hapticeval.phenomena.measures.closed_paths import LapRun, laps
from hapticeval.phenomena.measures.jumps import (
    aitken,
    lets_go,
    suspect_stretches,
)
from hapticeval.phenomena.measures.restated import nudge_directions
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import note_cut_standoff
from hapticeval.scene import Scene

LINE = Scene(model=line(), stiffness=1000.0, mass=0.1)
"""Solid below y = 0; its size is 0.2 m."""


@pytest.mark.parametrize("begin", [0, 30])
def test_a_long_stretch_is_looked_at_in_parts_the_worst_first(begin):
    steps = np.zeros(begin + 20)
    steps[begin:] = 2.0
    steps[begin + 12] = 5.0
    parts = list(suspect_stretches(steps, np.ones(begin + 20), 4))
    assert parts[0] == (begin + 10, begin + 13)
    assert sorted(row for first, last in parts for row in range(first, last + 1)) == list(range(begin, begin + 20))
    assert all(last - first < 4 for first, last in parts)


@pytest.mark.parametrize("worst", [0, 3, 10, 18, 19])
def test_a_part_is_as_long_as_may_be_wherever_the_worst_is(worst):
    steps = np.full(20, 2.0)
    steps[worst] = 5.0
    first, last = next(suspect_stretches(steps, np.ones(20), 4))
    assert last - first == 3
    assert first <= worst <= last


@given(limit=st.floats(0.0, 2.0), scale=st.floats(0.1, 2.0), ratio=st.floats(0.1, 0.9))
def test_aitken_finds_the_limit_of_a_geometric_sequence(limit, scale, ratio):
    found = aitken(*(limit + scale * ratio**k for k in range(3)))
    assert found == pytest.approx(limit, abs=1e-9 * (limit + scale) / (1.0 - ratio) ** 2)


@given(steps=st.lists(st.floats(0.0, 1.0), min_size=2, max_size=12))
def test_a_step_counts_whole_for_three_ticks_and_fades_from_then_on(steps):
    hip = np.column_stack([np.concatenate([[0.0], np.cumsum(steps)]), np.zeros(len(steps) + 1)])
    moved = [0.0, *steps]
    expected = [
        max(moved[j] * (1.0 if i - j <= 3 else math.exp(-(i - j - 3) / 3.0)) for j in range(i + 1))
        for i in range(len(moved))
    ]
    np.testing.assert_allclose(Observed(recorded(hip), LINE).recent_steps, expected, rtol=1e-9, atol=1e-12)


def slide(*, depth=1e-3, step=1e-4, count=12, aside=0.0):
    """A hand that moves along the line, `depth` under it, with its contact point above it but for `aside`."""
    along = step * np.arange(count)
    hip = np.column_stack([along, np.full(count, -depth)])
    return recorded(hip, np.column_stack([along + aside, np.zeros(count)]))


@pytest.mark.parametrize(("rows", "tick"), [(slice(0, None), 6), (slice(2, 12), 6), (slice(7, 12), None)])
def test_a_contact_that_was_had_is_let_go_where_the_hand_is_deep(rows, tick):
    base = slide()
    gone = np.arange(12) >= 6
    ihip = np.where(gone[:, np.newaxis], base.hip, base.ihip)
    released = changed(base, ihip=ihip, force=1000.0 * (ihip - base.hip))
    assert lets_go(Observed(released, LINE), rows, 0.9e-3) == tick
    assert lets_go(Observed(released, LINE), rows, 1.1e-3) is None


class TestContact:
    """A hand in free space, and a tool that is or is not with it."""

    @pytest.mark.parametrize(
        ("height", "declared", "holds"),
        [(2e-4, 1e-3, False), (2e-4, 0.0, True), (-2e-4, 1e-3, True), (5e-3, 1e-3, True)],
    )
    def test_a_tool_that_stands_off_is_free_with_the_hand_outside_and_as_near(self, height, declared, holds):
        hip = np.column_stack([np.zeros(6), np.full(6, height)])
        ihip = np.column_stack([np.zeros(6), np.full(6, max(height, 0.0) + 1e-3)])
        base = recorded(hip, ihip, meta={"standoff": declared} if declared else {})
        assert Observed(base, LINE).contact.all()
        assert Observed(base, LINE).holding.tolist() == [holds] * 6


class TestFreeSpace:
    @given(
        st.lists(st.sampled_from([-2e-3, 2e-3]), min_size=1, max_size=24),
        st.lists(st.booleans(), min_size=24, max_size=24),
        st.lists(st.booleans(), min_size=24, max_size=24),
    )
    def test_a_hand_is_pushed_in_free_space_that_feels_a_force_at_its_tool_outside_for_three_ticks(
        self, heights, pushed, apart
    ):
        rows, count = range(len(heights)), len(heights)
        hip = np.column_stack([1e-4 * np.arange(count), heights])
        ihip = hip + np.where(np.array(apart[:count])[:, np.newaxis], [0.0, 1e-3], 0.0)
        force = np.where(np.array(pushed[:count])[:, np.newaxis], [0.0, 1.0], 0.0)
        base = Observed(recorded(hip, ihip, force), LINE)
        free = [heights[row] > 0.0 and not apart[row] for row in rows]
        expected = [
            pushed[row] and not apart[row] and all(free[max(row - LAG_TICKS, 0) : row + LAG_TICKS + 1]) for row in rows
        ]
        assert base.pushed_in_free_space.tolist() == expected

    @pytest.mark.parametrize("through", [None, 0, 3, 8])
    @pytest.mark.parametrize("away", [1e-3, 5e-2])
    def test_a_hand_stays_free_that_neither_is_inside_nor_leaps_through(self, away, through):
        """From side to side of a plate of 2 mm, in one step of all."""
        plate = Scene(model=from_vertices([[-0.1, -1e-3], [0.1, -1e-3], [0.1, 1e-3], [-0.1, 1e-3]]))
        height = np.full(10, 1e-3 + away)
        if through is not None:
            height[through + 1 :] *= -1.0
        hip = np.column_stack([1e-3 * np.arange(10), height])
        base = recorded(hip, meta={"source": "playback"})
        assert Observed(base, plate).stays_free is (through is None)
        assert not Observed(changed(base, meta={"source": "log"}), plate).stays_free


def test_all_checks_read_one_object_that_finds_each_quantity_once_and_lets_nobody_write_to_it():
    runs = Runs(recorded([[0.0, -1e-3]] * 4, [[0.0, 5e-4]] * 4))
    base = runs.observed(LINE)
    assert base is runs.observed(LINE)
    assert base is not runs.observed(Scene(model=line()))
    assert base.holding is base.holding
    with pytest.raises(ValueError, match="read-only"):
        base.holding[0] = False


def test_a_standoff_counts_up_to_a_fiftieth_of_the_size_and_as_far_as_it_shows():
    base = recorded([[0.0, -1e-3]] * 4, [[0.0, 5e-4]] * 4, meta={"standoff": 9e-3})
    assert Observed(base, LINE).believed_standoff == pytest.approx(LINE.model.size / 50.0)
    assert Observed(base, LINE).standoff == pytest.approx(5e-4)
    assert Observed(base, LINE).position_tolerance == pytest.approx(5e-4), "the hand rests"
    note = note_cut_standoff(9e-3, LINE)
    assert note == "it declares a standoff of 9 mm, of which 4 mm count, a fiftieth of the model's size"
    assert note_cut_standoff(LINE.model.size / 50.0, LINE) == ""
    moving = slide()
    assert Observed(moving, LINE).position_tolerance == pytest.approx(3e-4), "three steps"
    np.testing.assert_allclose(Observed(moving, LINE).hip_steps, 1e-4)


def test_a_resolution_counts_up_to_a_sixteenth_of_the_outline():
    scene = Scene(model=circle(size=0.2), stiffness=1000.0)
    sixteenth = math.pi * 0.2 / 16.0
    for declared, counts in ((0.01, 0.01), (0.1, sixteenth)):
        base = recorded(np.zeros((3, 2)), meta={"resolution": declared})
        assert Observed(base, scene).resolution == pytest.approx(counts, rel=1e-6)


class TestLaps:
    def round(self, count, *, drift=0.0, period=10, before=3):
        angle = 2.0 * np.pi * np.arange(count * period + 1) / period
        way = 0.01 * np.column_stack([np.cos(angle), np.sin(angle)])
        way[:, 0] += drift * np.arange(len(way)) / period
        lead = np.column_stack([0.01 + 0.001 * np.arange(before, 0, -1), np.zeros(before)])
        return np.vstack([lead, way])

    def test_two_laps_are_the_least(self):
        assert laps(self.round(1), 0.2) == []
        assert laps(self.round(2), 0.2) == [LapRun(3, 10, 2)]
        assert laps(self.round(4), 0.2) == [LapRun(3, 10, 4)]

    @pytest.mark.parametrize(("drift", "count"), [(0.4e-9 * 0.2, 1), (2.5e-9 * 0.2, 0)])
    def test_points_are_the_same_within_a_billionth_of_the_size(self, drift, count):
        assert len(laps(self.round(2, drift=drift), 0.2)) == count

    @pytest.mark.parametrize(("period", "count"), [(2, 0), (3, 1)])
    def test_to_and_fro_between_two_rows_is_no_lap(self, period, count):
        assert len(laps(self.round(4, period=period), 0.2)) == count

    @pytest.mark.parametrize(("radius", "count"), [(0.8e-9 * 0.2, 0), (5e-9 * 0.2, 1)])
    def test_a_hand_that_stays_at_a_point_makes_none(self, radius, count):
        way = self.round(3, before=0)
        assert len(laps(way / 0.01 * radius, 0.2)) == count

    def test_a_hand_that_rests_or_goes_there_and_back_makes_none(self):
        still = 1e-11 * np.tile(np.arange(26.0), 20)
        there = np.linspace(0.0, 1.0, 101)
        creeping = 1e-10 + 1e-11 * np.abs(np.arange(200) % 10 - 5.0)
        for along in (np.zeros(2), np.zeros(500), still, creeping, np.append(there, there[::-1])):
            assert laps(along[:, np.newaxis] * [1.0, 0.0], 0.2) == []

    def test_laps_both_ways_are_two_runs(self):
        both = np.vstack([self.round(3), self.round(3, before=0)[-2::-1]])
        assert laps(both, 0.2) == [LapRun(3, 10, 3), LapRun(33, 10, 3)]


class TestLag:
    @given(values=st.lists(st.sampled_from([0.0, 1.0]), min_size=1, max_size=9))
    def test_ticks_of_rest_are_counted_up_to_three(self, values):
        expected, rest = [], 0
        for i, value in enumerate(values):
            rest = 0 if i == 0 or value != values[i - 1] else rest + 1
            expected.append(min(rest, 3))
        assert resting_ticks(np.array(values)[:, np.newaxis]).tolist() == expected

    @given(values=st.lists(st.floats(0.0, 9.0), min_size=4, max_size=12), earlier=st.integers(0, 2))
    def test_the_largest_in_lag_is_of_three_ticks_to_either_side(self, values, earlier):
        expected = [max(values[max(i - 3 - earlier, 0) : i + 4]) for i in range(len(values))]
        assert largest_in_lag(np.array(values), earlier=earlier).tolist() == expected

    def test_a_value_between_two_ticks_may_be_off_by_half_of_the_second_difference(self):
        values = np.zeros((20, 2))
        values[10:, 0] = np.arange(10)  # it bends in row 10
        np.testing.assert_allclose(beside_straight(values), [0.5 * (7 <= row <= 13) for row in range(20)])

    @pytest.mark.parametrize(("left", "lag"), [(0.09, 1.0), (0.11, 0.0)])
    def test_a_lag_is_believed_that_leaves_a_tenth(self, left, lag):
        believed, misfit = believed_lag(lambda ticks: left + (1.0 - left) * abs(ticks - 1.0), 0.0)
        assert believed == pytest.approx(lag)
        assert misfit == pytest.approx(left if lag else 1.0)

    def test_values_before_the_first_row_are_the_first_and_after_the_last_the_last(self):
        values = np.array([[0.0], [1.0], [4.0]])
        rows = np.arange(3)
        assert delayed(values, rows, 0.25).ravel().tolist() == [0.0, 0.75, 3.25]
        assert delayed(values, rows, 1.0).ravel().tolist() == [0.0, 0.0, 1.0]
        assert delayed(values, rows, -0.5).ravel().tolist() == [0.5, 2.5, 4.0]

    def test_a_force_is_as_late_as_the_oldest_hand_that_it_is_made_of(self):
        assert Lag(1.0, 0.5, 0.25).force == 1.25
        assert Lag(0.0, 1.5, 1.0).force == 1.5
        assert Lag(0.5, -1.0, -1.0).force == 0.0

    def test_without_a_force_none_is_late(self):
        free = recorded(np.abs(slide().hip))
        assert likely_force_lags(free, Observed(free, LINE).pressed) == []
        assert (Observed(free, LINE).lag.force_hip, Observed(free, LINE).lag.force_ihip) == (0.0, 0.0)

    def test_what_is_exact_has_none(self):
        assert believed_lag(lambda ticks: 1e-3 * abs(ticks - 1.0), 1e-3) == (0.0, 1e-3)
        assert believed_lag(lambda ticks: 1e-3 * abs(ticks - 1.0), 0.9e-3)[0] == pytest.approx(1.0)


@pytest.mark.parametrize(("scatter", "law"), [(1.02, True), (1.3, False)])
def test_a_power_law_within_a_tenth_leaves_nothing(scatter, law):
    jumps = [scatter ** (-1) ** k * 2.0 ** (-0.5 * k) for k in range(6)]
    assert (limit_of_jumps(jumps) == 0.0) is law


class TestLeavingOutSamples:
    def stepping(self, exponent, count=17):
        """A tool that moves from the middle row on as the power `exponent` of the time to it."""
        time = np.arange(count) - count // 2
        along = 1e-4 * np.sign(time) * np.abs(time) ** exponent
        hip = np.column_stack([1e-6 * time, np.full(count, -1e-3)])
        return recorded(hip, np.column_stack([along, np.zeros(count)]))

    def test_a_smooth_way_grows_with_the_samples_left_out_and_a_jump_does_not(self):
        assert coarsened_slope(Observed(self.stepping(1.0), LINE), 8) == pytest.approx(1.0)
        assert coarsened_slope(Observed(self.stepping(0.0), LINE), 8) == pytest.approx(0.5, abs=0.1), (
            "from -1 over 0 to 1"
        )

    def test_a_contact_that_is_too_short_tells_nothing(self):
        assert math.isnan(coarsened_slope(Observed(self.stepping(1.0, count=2), LINE), 1))
        assert coarsened_slope(Observed(self.stepping(1.0, count=3), LINE), 1) == pytest.approx(1.0)


@given(decay=st.floats(5.0, 80.0), frequency=st.floats(20.0, 200.0), phase=st.floats(0.0, 6.0))
def test_pronys_method_is_exact_of_a_decaying_sinusoid(decay, frequency, phase):
    time = 1e-3 * np.arange(20)
    found = prony(np.exp(-decay * time) * np.cos(2.0 * np.pi * frequency * time + phase), 1e-3)
    assert found == pytest.approx((decay, 2.0 * np.pi * frequency), rel=1e-5)


@pytest.mark.parametrize(("count", "windows"), [(100, 1), (256, 1), (384, 2), (4096, 31), (10000, 77)])
def test_a_welch_estimate_s_chance_is_that_of_its_windows(count, windows):
    window = get_window("hann", 256)
    power = window**2 / (window @ window)
    # Squared correlations: of a window with one half later, and of a bin with its two neighbours.
    overlap = (window[:128] @ window[128:] / (window @ window)) ** 2
    aside = [abs(power @ np.exp(2j * np.pi * k * np.arange(256) / 256.0)) ** 2 for k in (1, 2)]
    variance = (1.0 + 2.0 * (1.0 - 1.0 / windows) * overlap) / windows
    freedom = 126.0 / (1.0 + 2.0 * sum(squared**2 for squared in aside))
    rms = 10.0 / math.log(10.0) * math.sqrt(polygamma(1, 1.0 / variance))
    assert spectrum_bound(count) == pytest.approx(rms * math.sqrt(chi2.isf(1e-3, freedom) / freedom), rel=1e-9)


def test_what_welch_tends_to_is_flat_of_white_noise_and_has_the_power_of_any():
    white = np.zeros(256)
    white[0] = 3.0
    np.testing.assert_allclose(welch_of(white), 6.0)
    coloured = 0.9 ** np.arange(256)
    density = (1.0 - 0.81) / np.abs(1.0 - 0.9 * np.exp(-2j * np.pi * np.arange(129) / 256.0)) ** 2
    # The window smears neighbouring bins: not where the density bends.
    np.testing.assert_allclose(welch_of(coloured)[20:], 2.0 * density[20:], rtol=0.02)


@pytest.mark.parametrize(("dimension", "count"), [(2, 8), (3, 26)])
def test_the_hand_is_nudged_along_axes_and_diagonals_and_by_a_quarter(dimension, count):
    nudges = nudge_directions(dimension)
    lengths = np.linalg.norm(nudges, axis=1)
    np.testing.assert_allclose(lengths, [1.0] * count + [0.25] * count)
    assert len(np.unique(np.round(nudges, 9), axis=0)) == 2 * count
    np.testing.assert_allclose(nudges.sum(axis=0), 0.0, atol=1e-12)


UP, DOWN = 1.0 + 4e-16, 1.0 - 4e-16
"""One, rounded up and down: which of two equally bad places is larger is a matter of the machine."""
