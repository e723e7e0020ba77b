"""What a reset leaves behind: the second run is the first, to the bit or within a declared scatter, or it is told."""

from __future__ import annotations

import numpy as np
import pytest
from made import FAIL, NO, PASS, UNDECIDED, changed, found, outcome
from test_helpers_by_definition import LINE, slide

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.decisions import NOTABLE_FORCE_SHARE

LATER = slice(4, None)


def off(recording, rows=LATER, *, force=0.0, ihip=0.0, hand=0.0):
    """The same with its force, N, and IHIP, m, along the line, or its HIP, off in some rows."""
    there = np.zeros((len(recording), 1))
    there[rows] = 1.0
    return changed(
        recording,
        hip=recording.hip + hand * there,
        ihip=recording.ihip + ihip * there * [1.0, 0.0],
        force=recording.force + force * there * [1.0, 0.0],
    )


def judged(rows=LATER, *, kept=slice(None), share=1.0, scatter=None, **change):
    """A run of 12 ticks pressed with 1 N, and once more: off by `change`, `share` as hard, and of `kept` rows."""
    base = changed(slide(), meta=scatter)
    again = off(changed(base, force=share * base.force), rows, **change)
    return found("reset-clears", Runs(base, again=lambda: changed(again, rows=kept)), LINE)


def test_the_second_run_is_the_first_to_the_bit():
    assert "to the bit" in judged().message
    assert outcome("reset-clears", slide(), LINE) is NO, "there is none"
    for change in ({"force": 1e-15}, {"ihip": 1e-18}):
        assert judged(**change).outcome is FAIL


@pytest.mark.parametrize("rows", [LATER, slice(4, 5), slice(0, None), slice(0, 1)])
@pytest.mark.parametrize(
    ("change", "name", "unit"),
    [({"force": 0.5}, "force", "N"), ({"ihip": 1e-3}, "IHIP", "m"), ({"ihip": 1e-3, "force": 0.5}, "force", "N")],
)
def test_what_is_left_behind_is_told_with_its_size_and_first_tick(change, name, unit, rows):
    finding = judged(rows, **change)
    size = change["force" if unit == "N" else "ihip"]
    assert (finding.metric.value, finding.metric.unit, finding.bound) == (pytest.approx(size), unit, 0.0)
    assert finding.metric.name.startswith(name)
    assert finding.evidence["first_tick"] == rows.start
    assert f"off by up to {size:.3g} {unit}, first at tick {rows.start}" in finding.message
    assert finding.evidence["ihip_apart_m"] == pytest.approx(change.get("ihip", 0.0))
    assert finding.evidence["force_apart_N"] == pytest.approx(change.get("force", 0.0))


@pytest.mark.parametrize(("share", "words"), [(0.8, "20 per cent softer"), (1.3, "30 per cent stiffer")])
def test_a_force_that_is_softer_on_the_whole_is_told(share, words):
    finding = judged(share=share)
    assert words in finding.message
    assert finding.evidence["force_ratio"] == pytest.approx(share)
    assert "per cent" not in judged(share=1.0 - 0.9 * NOTABLE_FORCE_SHARE).message


def test_runs_of_another_length_differ_from_where_one_ends():
    for scatter in ({}, {"force_scatter": 0.01}):
        finding = judged(kept=slice(0, 9), scatter=scatter)
        assert (finding.outcome, finding.evidence["first_tick"]) == (FAIL, 9)
        assert finding.message.endswith("; it has 9 ticks, and the first 12")


@pytest.mark.parametrize(("share", "expected"), [(0.9, PASS), (1.1, FAIL)])
@pytest.mark.parametrize(
    ("name", "declared", "counts"),
    [("force", 0.05, 0.05), ("force", 9.0, 0.1), ("ihip", 1e-5, 1e-5), ("ihip", 1.0, 4e-3)],
)
def test_a_declared_scatter_counts_up_to_a_tenth_of_the_force_and_a_fiftieth_of_the_model(
    name, declared, counts, share, expected
):
    finding = judged(scatter={f"{name}_scatter": declared}, **{name: share * counts})
    assert finding.outcome is expected
    assert finding.evidence["force_apart_N" if name == "force" else "ihip_apart_m"] == pytest.approx(share * counts)
    assert ("as nearly as the renderer declares" in finding.message) is (expected is PASS)
    assert (finding.margin >= 0.0) is (expected is PASS)


def test_with_a_scatter_a_hand_that_goes_another_way_ends_the_comparison():
    away = {"hand": 1e-6, "force": 5.0}
    assert judged(**away).outcome is FAIL
    assert judged(**away, scatter={"force_scatter": 0.01}).outcome is PASS
    assert judged(kept=slice(0, 9), hand=1e-6, scatter={"force_scatter": 0.01}).outcome is PASS
    # One row is compared where the hands part in the next, and none where they begin apart.
    for rows, expected in ((slice(1, None), PASS), (slice(0, None), UNDECIDED)):
        assert judged(rows, **away, scatter={"force_scatter": 0.01}).outcome is expected


@pytest.mark.parametrize(
    ("fresh_forces", "scatter", "cause"),
    [
        ((0.0, 0.0), 0.0, "left over"),
        ((0.3, 0.3), 0.0, "left over"),
        ((0.0, 1e-9), 0.0, "random"),
        ((0.0, 0.009), 0.01, "left over"),
    ],
)
def test_what_two_new_renderers_do_differently_is_random_and_left_by_no_reset(fresh_forces, scatter, cause):
    first = changed(slide(), {"force_scatter": scatter})
    runs = Runs(
        first,
        again=lambda: off(first, force=0.02),
        fresh=lambda number: off(first, force=fresh_forces[number - 1]),
    )
    finding = found("reset-clears", runs, LINE)
    assert (finding.outcome, finding.evidence["cause"]) == (FAIL, cause)
    assert finding.message.startswith(
        "it is random: the force of two new" if cause == "random" else "a reset leaves something"
    )


def test_a_contact_point_alone_may_be_random():
    first = slide()
    runs = Runs(first, again=lambda: off(first, ihip=3e-9), fresh=lambda number: off(first, ihip=1e-9 * number))
    words = "it is random: the IHIP of two new renderers, asked the same, is up to 1e-09 m"
    assert found("reset-clears", runs, LINE).message.startswith(words)
