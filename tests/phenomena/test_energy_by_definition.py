"""What the check of energy is made of: gains of a span by their shares, what is stored, laps that spend a store."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made import FAIL, PASS, UNDECIDED, changed, recorded
from test_helpers_by_definition import LINE, slide

from hapticeval.phenomena.checks.passivity import judge_law
from hapticeval.phenomena.decisions import RIGID_WORK_SHARE
from hapticeval.phenomena.measures.closed_paths import SampledWork
from hapticeval.phenomena.measures.gained_work import Gain, Span, gain_over, stored_before
from hapticeval.phenomena.observed import Observed

ALONG = Span(1, 3, "since free space")


def sums(smooth, **more):
    """Running sums at one rate; those that are not given are zero."""
    none = np.zeros(len(smooth))
    names = ("held", "error", "crossed", "path", "effort")
    return SimpleNamespace(smooth=np.array(smooth), **{name: np.array(more.get(name, none)) for name in names})


class TestGain:
    """Work at a tick, a half and a quarter of it, over rows 1 to 3; what stands before is no part of it."""

    def gain(self, *works, span=ALONG, stored=0.0, rounding=(0.0, 0.0, 0.0, 0.0), **finest):
        base = sums([5.0, 5.0, 6.0, 7.0], held=[1.0, 1.0, 3.0, 6.0])
        *coarser, last = ([7.0, 7.0, *(7.0 + np.array(work))] for work in works)
        runs = [base, *map(sums, coarser), sums(last, **finest)]
        return gain_over(runs, span, np.array(rounding), stored)

    def test_a_lag_of_first_order_is_taken_off(self):
        """W = 2 + 4 h in the last row, and 1 + 4 h in the one before."""
        gain = self.gain([5.0, 6.0], [3.0, 4.0], [2.0, 3.0])
        assert (gain.span, gain.last) == (ALONG, 3)
        assert gain.law == pytest.approx(2.0)
        assert gain.correction == gain.open == pytest.approx(1.0)
        # By the base run: held 5, by the trapezoid 2
        assert (gain.hold, gain.lag) == (pytest.approx(3.0), pytest.approx(0.0))
        assert gain.excess == pytest.approx(1.0)
        assert replace(gain, stored=0.5).excess == pytest.approx(0.5)

    def test_of_a_higher_order_the_correction_is_half_of_what_the_limit_moved_by(self):
        """By 1 and then by 0.2: the limit moved from 2 to 1.4 below it."""
        gain = self.gain([0.0, 5.0], [0.0, 4.0], [0.0, 3.8])
        assert gain.law == pytest.approx(3.6)
        assert gain.correction == pytest.approx(0.5 * abs(-0.4 + 1.0))

    def test_what_does_not_settle_is_open_by_the_larger_change_and_by_all_where_it_shrinks(self):
        grows = self.gain([0.0, 4.0], [0.0, 4.5], [0.0, 6.0])
        assert (grows.law, grows.correction) == (pytest.approx(6.0), pytest.approx(1.5))
        wavers = self.gain([0.0, 9.0], [0.0, 4.0], [0.0, 8.6])
        assert (wavers.law, wavers.correction) == (pytest.approx(8.6), pytest.approx(5.0))
        shrinks = self.gain([0.0, 6.0], [0.0, 5.9], [0.0, 4.0])
        assert shrinks.correction == math.inf
        assert not shrinks.telling
        within = self.gain([0.0, 6.0], [0.0, 5.9], [0.0, 4.0], error=[0.0, 1.0, 1.5, 3.0])
        assert (within.law, within.correction) == (pytest.approx(2.1), pytest.approx(1.9)), "the error explains it"

    def test_error_and_rounding_are_open_and_what_crosses_is_that_of_the_finest_run(self):
        more = {"error": [0.0, 1.0, 1.5, 3.0], "crossed": [0.0, 2.0, 3.0, 9.0], "effort": [1.0, 1.0, 2.0, 5.0]}
        gain = self.gain(*[[0.0, 6.0]] * 3, rounding=(0.0, 0.1, 0.2, 0.4), **more)
        assert gain.open == pytest.approx(2.0 + 0.3)
        assert (gain.crossed, gain.effort) == (pytest.approx(7.0), pytest.approx(4.0))

    @pytest.mark.parametrize(("stored", "row"), [(0.0, 2), (2.9, 2), (3.1, 3)])
    def test_the_row_that_is_farthest_beyond_what_is_open_counts_and_the_last_where_none_is(self, stored, row):
        works = [[3.0, 1.0]] * 3
        assert self.gain(*works, stored=stored).last == row
        assert self.gain(*works, stored=stored, span=Span.of_lap(1, 3)).last == 3, "a lap has one end only"

    def gain_of(self, **more):
        numbers = {"hold": 0.1, "lag": 0.2, "law": 1.0, "correction": 0.1, "open": 0.3, "stored": 0.0, "crossed": 2.0}
        return Gain(ALONG, 3, **{**numbers, "effort": 0.0, **more})

    @pytest.mark.parametrize(
        ("numbers", "tells"),
        [
            ({"open": 0.19}, True),
            ({"open": 0.21}, False),
            ({"open": 0.21, "effort": 0.22 / RIGID_WORK_SHARE}, True),
            ({"open": 0.21, "effort": 0.2 / RIGID_WORK_SHARE}, False),
            ({"open": 0.21, "stored": 1.11}, True),
            ({"open": 0.21, "stored": 1.09}, False),
        ],
    )
    def test_a_gain_is_told_where_a_tenth_of_what_crossed_is_open_or_it_is_within_what_was_stored(self, numbers, tells):
        assert self.gain_of(**numbers).telling is tells

    def test_the_way_that_gives_most_beyond_what_is_open_is_told(self):
        base = Observed(slide(), LINE)
        small, large = self.gain_of(law=0.45, open=0.1), self.gain_of(law=0.4, open=0.0)
        lap, unclear = replace(self.gain_of(law=0.1, open=0.0), span=Span.of_lap(1, 3)), self.gain_of(law=9.0, open=1.0)
        finding = judge_law(base, [small, large, lap, unclear], [small, large, lap])
        assert (finding.outcome, finding.metric.value, finding.bound) == (FAIL, 0.4, 0.0)
        assert (finding.evidence["ways"], finding.evidence["laps"]) == (3, 1)
        assert (finding.evidence["tick"], finding.evidence["from_time"]) == (3, pytest.approx(1e-3))
        assert "round (0.15, -1) mm until t = 0.003 s, the hand gets 400 mJ" in finding.message
        assert (finding.evidence["hold_J"], finding.evidence["lag_J"]) == (0.1, 0.2)
        none = self.gain_of(law=0.1, open=0.1)
        assert judge_law(base, [none], [none]).outcome is PASS
        open_one = judge_law(base, [none, unclear, self.gain_of(law=3.0, open=1.0)], [none])
        assert open_one.outcome is UNDECIDED
        assert "does not settle 2 of 3 ways, as since free space from t = 0.001 s to 0.003 s" in open_one.message
        assert judge_law(base, [unclear], []).outcome is UNDECIDED


def test_a_force_below_the_floor_stores_what_a_spring_does_and_a_lap_that_does_not_close_its_gap_s_work():
    base = slide(count=12)
    assert stored_before(Observed(base, LINE), Span(2, 9, ALONG.what)) == pytest.approx(1.0 / 2000.0)
    soft = changed(base, meta={"spring": "error", "stiffness_least": 0.5, "stiffness_largest": 2.0})
    assert stored_before(Observed(soft, LINE), Span(2, 9, ALONG.what)) == pytest.approx(1.0 / 1000.0)
    force = np.array(base.force)
    for row in (2, 9):
        # 1 N at one end and 3 N at the other, over 0.7 mm.
        force[[2, 9], 1] = 1.0
        force[row, 1] = 3.0
        assert stored_before(Observed(changed(base, force=force), LINE), Span.of_lap(2, 9)) == pytest.approx(3.0 * 7e-4)


def test_work_is_summed_by_the_trapezoid_and_as_held_at_the_rows_of_the_base_run():
    """At twice the rate: rows 0, 2 and 4 are those of the base run."""
    hip = 1e-3 * np.column_stack([[0.0, 1.0, 2.0, 2.0, 3.0], np.full(5, -1.0)])
    force = np.column_stack([[1.0, 3.0, -2.0, 5.0, 1.0], np.zeros(5)])
    work = SampledWork(Observed(recorded(hip, hip * [1.0, 0.0], force, dt=5e-4), LINE), 2)
    np.testing.assert_allclose(work.smooth, 1e-3 * np.array([0.0, 2.5, 5.5]))
    np.testing.assert_allclose(work.held, 1e-3 * np.array([0.0, 4.0, 9.0]))
    np.testing.assert_allclose(work.crossed, 1e-3 * np.array([0.0, 2.5, 5.5]))
    np.testing.assert_allclose(work.path, 1e-3 * np.array([0.0, 2.0, 3.0]))
    np.testing.assert_allclose(work.effort, 1e-3 * np.array([0.0, 4.0, 9.0]))
    # Second differences of the force, -7, 12 and -11 N, along the steps that follow.
    np.testing.assert_allclose(work.error, 0.5e-3 * np.array([0.0, 7.0, 18.0]))
    assert not work.free.any()
