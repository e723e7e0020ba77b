"""Runs by place instead of time: aligned exactly where that may be, and compared by the spread of their repeats."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import comb

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.compare.align import GRID_POINTS, Abscissa, Run, align
from hapticeval.recordings.compare.permutation import DEALS, LEVEL, Distances, least_p, needed, permutation_p
from hapticeval.recordings.compare.spread import bands, compare
from hapticeval.recordings.recording import Recording

CIRCLE = make_model("circle").curve
RADIUS, DEPTH, STIFFNESS = 0.1, 0.001, 1000.0
ANGLE = np.linspace(0.1, 2.0, 500)
UNITS = tuple((side, k) for side in (0, 1) for k in range(4))
PLACE = (ANGLE - ANGLE[0]) / np.ptp(ANGLE)


def lap(angle, *, dt=1e-3, size=None, standing=None):
    """A spring contact on the circle of 0.1 m at the given HIP angles (n,); `size` (n,) is the force, N."""
    angle = np.asarray(angle, dtype=float)
    size = np.full(angle.size, STIFFNESS * DEPTH) if size is None else size
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    hip = RADIUS * outward - (size / STIFFNESS)[:, None] * outward
    time = dt * np.arange(angle.size) if standing is None else standing
    return Recording(time, {"hip": hip, "ihip": RADIUS * outward, "force": size[:, None] * outward})


def slide(angle, **options):
    return Run("run 7", "one", lap(angle, **options))


def aligned(*runs, by="angle", **options):
    return align(runs, Abscissa(by, curve=CIRCLE), **options)


def ways(found):
    """Direction, lap and coverage of each pass that covers anything."""
    return [(each.direction, each.lap, each.coverage) for each in found.passes if each.coverage > 0.01]


def paused(angle, *pauses):
    """A clock with a pause of 50 ms before each of some rows."""
    time = 1e-3 * np.arange(len(angle))
    for first in pauses:
        time[first:] += 0.05
    return time


def about(*expected):
    return [(direction, lap, pytest.approx(coverage, abs=0.01)) for direction, lap, coverage in expected]


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.sampled_from([1, -1]), st.sampled_from(["angle", "arc"]))
def test_a_function_of_place_is_found_again_whatever_the_clock(seed, direction, by):
    rng = np.random.default_rng(seed)
    angle = direction * np.cumsum(rng.uniform(1e-3, 4e-3, 1500))
    found = aligned(slide(angle, size=1.0 + 0.2 * np.sin(3.0 * angle)), by=by)
    scale = RADIUS if by == "arc" else 1.0
    assert {each.direction for each in found.passes} == {direction}
    for each in found.passes:
        place = found.grid[each.mask] / scale
        # Linear between samples at most 4 mrad apart: h^2 / 8 times the second derivative, 0.2 * 9.
        np.testing.assert_allclose(
            each.columns["magnitude"][each.mask], 1.0 + 0.2 * np.sin(3.0 * place), atol=1.01 * 4e-3**2 / 8 * 1.8
        )
        np.testing.assert_allclose(np.cos(each.columns["direction"][each.mask] - place), 1.0, atol=1e-9)
        assert all(np.isfinite(column).all() for column in each.columns.values())
        assert all(np.all(column[~each.mask] == 0.0) for column in each.columns.values())


def test_laps_are_counted_and_a_sector_across_the_cut_of_the_angles_stays_in_one_piece():
    found = aligned(slide(np.linspace(0.0, 6.0 * math.pi, 9001)))
    assert ways(found) == about((1, 0, 1.0), (1, 1, 1.0), (1, 2, 1.0))
    turn = 2.0 * math.pi
    found = aligned(slide(np.linspace(-0.6, 0.7, 1000)), slide(np.linspace(turn - 0.5, turn + 0.6, 900)))
    assert found.grid[-1] - found.grid[0] == pytest.approx(1.3)
    assert ways(found) == about((1, 0, 1.0), (1, 0, 1.1 / 1.3))


def test_a_hand_that_turns_back_is_refused_at_the_place_or_split():
    angle = np.concatenate([np.linspace(0.0, 1.0, 500), np.linspace(1.0, 0.7, 200), np.linspace(0.7, 1.5, 400)])
    with pytest.raises(InputError) as caught:
        aligned(slide(angle))
    assert "run 7 turns back by 17.19 degrees at 57.3 degrees, t = 0.5 s" in str(caught.value)
    assert "give --split: every way between two turns is then a pass" in caught.value.todo
    assert "so that it takes {} and {} runs".format(*needed(1, 1, tests=2, level=LEVEL)) in caught.value.todo
    assert ways(aligned(slide(angle), split=True)) == about((1, 0, 1 / 1.5), (-1, 0, 0.3 / 1.5), (1, 1, 0.8 / 1.5))
    fro = 0.5 - 0.5 * np.cos(np.linspace(0.0, 4.0 * math.pi, 4000))
    assert [each[:2] for each in ways(aligned(slide(fro), split=True))] == [(1, 0), (-1, 0), (1, 1), (-1, 1)]
    trembling = np.linspace(0.0, 1.0, 4000) + np.random.default_rng(5).uniform(-3e-4, 3e-4, 4000)
    assert ways(aligned(slide(trembling))) == about((1, 0, 1.0))


def test_a_gap_ends_neither_a_lap_nor_a_way_unless_the_hand_begins_anew(refused):
    angle = np.linspace(0.0, 4.0 * math.pi, 4001)
    found = aligned(slide(angle, standing=paused(angle, 500, 1500, 3000)))
    assert [each[:2] for each in ways(found)] == [(1, 0), (1, 1)]
    back = np.concatenate([np.linspace(0.0, 1.0, 500), np.linspace(0.999, 0.7, 200)])
    with refused(InputError):
        aligned(slide(back, standing=paused(back, 500)))
    parts = aligned(slide(back, standing=paused(back, 500)), split=True)
    assert [each[:2] for each in ways(parts)] == [(1, 0), (-1, 0)]
    anew = np.concatenate([np.linspace(0.0, 1.0, 500), np.linspace(0.0, 1.1, 500)])
    assert ways(aligned(slide(anew, standing=paused(anew, 500)))) == about((1, 0, 1.0 / 1.1), (1, 1, 1.0))


@pytest.mark.parametrize(("pops", "row"), [(True, 50), (False, 75)])
def test_nothing_is_interpolated_across_a_jump(pops, row):
    """Of the IHIP, a pop-through, or of the force alone, from a row on."""
    angle = np.linspace(0.0, 1.0, 101)
    log = lap(angle)
    ihip, force = np.array(log.ihip), np.array(log.force)
    if pops:
        ihip[row:] = RADIUS * np.column_stack([np.cos(angle + 0.5), np.sin(angle + 0.5)])[row:]
        force[row:] = STIFFNESS * (ihip - log.hip)[row:]
    else:
        force[row:] *= 30.0
    jumping = Recording(log.time, {"hip": log.hip, "ihip": ihip, "force": force})
    (only,) = align([Run("x", "one", jumping)], Abscissa("angle")).passes
    grid = np.linspace(0.0, 1.0, GRID_POINTS)
    assert 6 <= np.count_nonzero(~only.mask) <= 8
    assert np.all((grid[~only.mask] > angle[row - 1] - 1e-12) & (grid[~only.mask] < angle[row] + 1e-12))
    sizes = only.columns["magnitude"][only.mask]
    before = grid[only.mask] < angle[row - 1] + 1e-12
    assert np.ptp(sizes[before]) < 1e-9
    assert np.all(sizes[~before] > 20.0 * sizes[0])


def test_gaps_free_space_and_rows_that_are_no_measurement_are_left_out():
    angle = np.linspace(0.0, 1.0, 1001)
    time = 1e-3 * np.arange(1001) + 0.3 * (np.arange(1001) >= 600)
    size = np.where((angle > 0.2) & (angle < 0.3), 0.0, 1.0)
    found = aligned(slide(angle, standing=time, size=size))
    places = np.concatenate([found.grid[each.mask] for each in found.passes])
    assert not np.any((places > 0.2) & (places < 0.3))
    assert not np.any((places > angle[599]) & (places < angle[600]))
    assert sum(each.coverage for each in found.passes) == pytest.approx(0.9, abs=0.01)
    log, valid = lap(angle), (np.arange(1001) < 400) | (np.arange(1001) >= 450)
    channels = {**log.channels, "force": np.where(valid[:, None], log.force, np.nan)}
    found = align([Run("x", "one", Recording(log.time, channels, valid=valid))], Abscissa("angle"))
    assert all(np.isfinite(each.columns["magnitude"]).all() for each in found.passes)
    assert sum(each.coverage for each in found.passes) == pytest.approx(0.95, abs=0.01)


def test_the_centre_must_not_be_on_the_way(refused):
    hip = np.column_stack([np.linspace(-0.05, 0.05, 200), np.full(200, 1e-9)])
    recording = Recording(1e-3 * np.arange(200), {"hip": hip, "ihip": hip, "force": np.ones((200, 2))})
    with refused(InputError):
        align([Run("through", "one", recording)], Abscissa("angle"))
    assert align([Run("through", "one", recording)], Abscissa("angle", centre=(0.0, -0.2))).passes


def test_a_phase_is_any_column_of_a_channel(refused):
    hip = np.column_stack([np.linspace(0.0, 0.1, 300), np.full(300, -0.001)])
    ihip = np.column_stack([hip[:, 0], np.zeros(300)])
    recording = Recording(1e-3 * np.arange(300), {"hip": hip, "ihip": ihip, "force": 1000.0 * (ihip - hip)})
    found = align([Run("line", "one", recording)], Abscissa("hip:0"))
    assert found.unit == "m"
    assert found.passes[0].coverage == 1.0
    np.testing.assert_allclose(found.passes[0].columns["depth"], 0.001)
    with refused(InputError):
        align([Run("line", "one", recording)], Abscissa("hip:5"))
    with refused(InputError):
        Abscissa("angles")
    with refused(InputError):
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


def test_runs_that_never_touch_are_refused(refused):
    recording = lap(np.linspace(0.0, 1.0, 100), size=np.zeros(100))
    with refused(InputError):
        align([Run("free", "one", recording)], Abscissa("angle"))
    with refused(InputError):
        align([], Abscissa("angle"))


def run(renderer, number, size, *, turned=0.0, angle=ANGLE):
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    push = size[:, None] * np.column_stack([np.cos(angle + turned), np.sin(angle + turned)])
    hip = 0.1 * outward - 1e-3 * push
    recording = Recording(1e-3 * np.arange(angle.size), {"hip": hip, "ihip": hip + 1e-3 * push, "force": push})
    return Run(f"{renderer} {number}", renderer, recording)


def hands(rng, renderer, count, *, more=0.0, turned=0.0, trembling=0.0):
    """Runs that share a shape and differ by a smooth random push each, as hands do, and `trembling` in direction."""
    made = []
    for number in range(count):
        push = 2.0 + 0.2 * rng.standard_normal() + 0.2 * np.sin(6.0 * PLACE + rng.uniform(0.0, 6.28))
        made.append(
            run(renderer, number, push + more, turned=turned + (trembling and trembling * rng.standard_normal()))
        )
    return made


def compared(*groups, seed=0):
    aligned = align([each for group in groups for each in group], Abscissa("angle"))
    return {(each.first, each.second, each.column): each for each in compare(aligned, seed=seed)}


def test_a_difference_beyond_the_repeats_is_found_with_its_size():
    rng = np.random.default_rng(1)
    found = compared(hands(rng, "a", 6), hands(rng, "b", 6, more=1.5))["a", "b", "magnitude"]
    assert found.outcome == "differs"
    assert found.difference == pytest.approx(1.5, abs=0.3)
    assert found.times == pytest.approx(found.difference / found.spread)
    assert found.p == pytest.approx(2.0 / comb(12, 6)), "both complete separations are the most extreme deals"
    assert found.repeats == (6, 6)


def test_false_alarms_are_as_rare_as_the_level_says():
    rng = np.random.default_rng(3)
    alarms = 0
    for _ in range(300):
        points = rng.standard_normal((4, 8))  # four columns that vary apart from each other
        columns = {f"c{k}": Distances(np.abs(each[:, None] - each), UNITS) for k, each in enumerate(points)}
        p, least = permutation_p(columns, seed=0)
        assert least == 2.0 / comb(8, 4)
        alarms += min(p.values()) < 0.05
    # p < 0.05 in any column has a probability of 2 / 70 at most: 8.6 of 300, 20 or more with a chance of 6e-4. Each
    # column tested by itself would give some 32.
    assert alarms < 20


def test_of_more_deals_than_are_looked_at_random_ones_decide_and_the_same_for_a_seed():
    units = tuple((side, k) for side in (0, 1) for k in range(12))
    assert comb(24, 12) > DEALS
    apart = np.repeat([0.0, 10.0], 12) + np.tile(np.linspace(0.0, 1.0, 12), 2)
    alike = np.tile(np.linspace(0.0, 1.0, 12), 2)
    columns = {name: Distances(np.abs(each[:, None] - each), units) for name, each in (("x", apart), ("y", alike))}
    p, least = permutation_p(columns, seed=0)
    assert (p["x"], least) == (1.0 / (DEALS + 1), 1.0 / (DEALS + 1))
    assert p["y"] > 0.5
    assert permutation_p(columns, seed=0) == (p, least)


def test_one_column_that_differs_is_found_among_those_that_do_not():
    rng = np.random.default_rng(13)
    found = compared(hands(rng, "a", 4, trembling=0.05), hands(rng, "b", 4, more=3.0, trembling=0.05))
    assert found["a", "b", "magnitude"].outcome == "differs"
    assert found["a", "b", "direction"].outcome == "within the spread"


def test_the_other_way_is_another_test():
    rng = np.random.default_rng(14)
    there = [*hands(rng, "a", 4), *hands(rng, "b", 4, more=9.0)]
    back = [run(each.renderer, f"{k} back", np.linalg.norm(each.recording.force, axis=1), angle=ANGLE[::-1])
            for k, each in enumerate(there)]  # fmt: skip
    found = compare(align([*there, *back], Abscissa("angle")))
    assert {each.direction for each in found} == {1, -1}
    assert [each.p for each in found if each.column == "magnitude"] == [pytest.approx(2.0 * 2.0 / comb(8, 4))] * 2


def test_a_turned_force_is_found_across_the_cut_of_the_angles():
    rng = np.random.default_rng(4)
    groups = hands(rng, "a", 5, turned=math.pi - 1.0), hands(rng, "b", 5, turned=math.pi - 0.9)
    found = compared(*groups)["a", "b", "direction"]
    assert found.outcome == "differs"
    assert found.difference == pytest.approx(0.1, abs=1e-3)


def test_what_cannot_be_compared_is_refused_with_what_it_takes(refused):
    rng = np.random.default_rng(18)
    with refused(InputError):
        compared(hands(rng, "a", 4), hands(rng, "b", 1))
    with refused(InputError):
        compared(hands(rng, "a", 4))
    one, *others = hands(rng, "a", 4)
    with refused(InputError):
        compared([one, *others, Run("again", "a", one.recording)], hands(rng, "b", 4))


def test_too_few_repeats_are_called_so_and_as_many_as_are_asked_for_can_decide():
    rng = np.random.default_rng(6)
    found = compared(hands(rng, "a", 3), hands(rng, "b", 3, more=9.0))["a", "b", "magnitude"]
    assert found.outcome == "too few repeats"
    assert found.smallest_p == found.p == pytest.approx(0.1)
    assert (found.repeats, found.needed) == ((3, 3), (4, 3))
    enough = compared(hands(rng, "a", 4), hands(rng, "b", 3, more=9.0))["a", "b", "magnitude"]
    assert enough.outcome == "differs"
    assert enough.p == pytest.approx(1.0 / comb(7, 3))
    found = compared(hands(rng, "a", 5), hands(rng, "b", 5, more=9.0), hands(rng, "c", 5, more=18.0))
    assert found["a", "b", "magnitude"].p == pytest.approx(3.0 * 2.0 / comb(10, 5)), "three pairs are three tests"


@settings(max_examples=100)
@given(st.integers(1, 12), st.integers(1, 12), st.integers(1, 499), st.floats(0.01, 0.2))
def test_the_repeats_that_are_needed_are_the_fewest(first, second, tests, level):
    found = needed(first, second, tests=tests, level=level)
    if found is None:
        assert tests / (DEALS + 1) >= level
        return
    assert found[0] >= max(first, 2)
    assert found[1] >= max(second, 2)
    assert tests * least_p(*found) < level
    fewer = [
        (a, b)
        for a in range(max(first, 2), sum(found))
        for b in range(max(second, 2), sum(found) - a)
        if tests * least_p(a, b) < level
    ]
    assert fewer == []


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize(("ways", "enough"), [(1, (4, 3)), (2, (5, 3))])
def test_one_run_of_each_is_said_to_be_too_few(refused, gaps, ways, enough):
    """And the stretches between the gaps of a run are no laps."""
    angle = ANGLE if ways == 1 else np.concatenate([ANGLE, ANGLE[-2::-1]])
    size = np.full(angle.size, 2.0)
    runs = [run("a", 0, size, angle=angle), run("b", 0, size + 1.0, angle=angle)]
    runs = [torn(torn(each, 100, 20), 400, 30) if gaps else each for each in runs]
    with refused(InputError) as caught:
        compare(align(runs, Abscissa("angle"), split=ways == 2))
    assert "takes {} of 'a' and {} of 'b' at the least".format(*enough) in caught.value.todo


def shifted(each, number, *, by, single=False):
    """A repeat of another renderer whose force differs by `by` of its size."""
    recording = each.recording
    force = recording.force * (1.0 + by)
    ihip = recording.ihip
    if single:
        force, ihip = (np.asarray(values, dtype=np.float32).astype(float) for values in (force, ihip))
    return Run(f"b {number}", "b", Recording(recording.time, {"hip": recording.hip, "ihip": ihip, "force": force}))


def jogged(each, number):
    """The run again, in the last bit elsewhere: no copy."""
    recording = each.recording
    hip = recording.hip.copy()
    hip[:, 0] = np.nextafter(hip[:, 0], np.inf if number % 2 else -np.inf)
    hip[number, 1] = np.nextafter(hip[number, 1], np.inf)
    return Run(each.label, each.renderer, Recording(recording.time, {**recording.channels, "hip": hip}))


@pytest.mark.parametrize(("by", "single", "outcome"), [
    *((by, False, "differs") for by in (1e-3, 1e-5)), (1e-3, True, "differs"),
    *((by, False, "the same to rounding") for by in (0.0, 1e-16, 1e-8)),
    *((by, True, "the same to rounding") for by in (0.0, 1e-8)),
])  # fmt: skip
def test_what_is_beyond_single_precision_is_a_difference(by, single, outcome):
    one = hands(np.random.default_rng(20), "a", 1)[0]
    first = [jogged(Run(f"a {k}", "a", one.recording), k) for k in range(4)]
    second = [shifted(each, k, by=by, single=single) for k, each in enumerate(first)]
    found = compared(first, second)["a", "b", "magnitude"]
    assert found.outcome == outcome
    assert (0.0 <= found.rounding <= 1.0) == (outcome == "the same to rounding") == (found.p == 1.0)
    if outcome == "differs":
        assert found.largest == pytest.approx(by * np.max(np.linalg.norm(one.recording.force, axis=1)), rel=0.01)


@settings(max_examples=5)
@given(st.floats(-math.pi, math.pi), st.floats(-0.5, 0.5), st.integers(0, 100))
def test_all_curves_of_a_panel_lie_on_one_branch(turned, apart, seed):
    """Forth and back, wherever the angles are cut: what differs by little is drawn beside each other.

    The push of 3 N at most shifts the hand by 3 mm, so that its angle at 0.1 m says where it is to 0.03 rad.
    """
    rng = np.random.default_rng(seed)
    there = [*hands(rng, "a", 2, turned=turned), *hands(rng, "b", 2, turned=turned + apart)]
    back = [
        run(each.renderer, f"{k} back", np.full(ANGLE.size, 2.0), turned=turned - apart, angle=ANGLE[::-1])
        for k, each in enumerate(there)
    ]
    drawn = [b for b in bands(align([*there, *back], Abscissa("angle"))) if b.column == "direction"]
    assert {(b.renderer, b.direction) for b in drawn} == {(name, way) for name in "ab" for way in (1, -1)}
    for one in drawn:
        for other in drawn:
            both = (one.count > 0) & (other.count > 0)
            assert np.max(np.abs(one.median - other.median)[both]) < 2.0 * abs(apart) + 2.0 * 0.03


def test_laps_of_a_run_are_no_repeats(refused):
    """By one hand in one mood: they say how it varies within a run, and not whether another run would be as far off."""
    angle, rng = np.linspace(0.0, 10.0 * math.pi, 9000), np.random.default_rng(8)

    def groups(count):
        return [
            [
                run(name, k, 2.0 + more + 0.1 * np.sin(angle * 0.37 + rng.uniform(0, 6.28)), angle=angle)
                for k in range(count)
            ]
            for name, more in (("a", 0.0), ("b", 1.0))
        ]

    with refused(InputError):
        compared(*groups(1))
    assert compared(*groups(2))["a", "b", "magnitude"].repeats == (2, 2)


def test_the_band_is_the_median_between_the_extremes():
    runs = [run("a", k, np.full(ANGLE.size, size)) for k, size in enumerate((1.0, 2.0, 4.0))]
    found = next(b for b in bands(align(runs, Abscissa("angle"))) if b.column == "magnitude")
    seen = found.count == 3
    assert seen.mean() > 0.95
    np.testing.assert_allclose(found.median[seen], 2.0, rtol=1e-4)
    np.testing.assert_allclose(found.low[seen], 1.0, rtol=1e-4)
    np.testing.assert_allclose(found.high[seen], 4.0, rtol=1e-4)


def test_runs_over_other_places_are_not_compared(refused):
    rng = np.random.default_rng(10)
    far = [run("b", k, 2.0 + 0.1 * rng.standard_normal(500), angle=ANGLE + 1.88) for k in range(3)]
    near = [run("c", k, 2.0 + 0.1 * rng.standard_normal(500)) for k in range(3)]
    found = compared(hands(rng, "a", 3), far, near)
    assert found["a", "b", "magnitude"].outcome == "too little in common"
    assert found["a", "c", "magnitude"].outcome == "too few repeats"
    with refused(InputError):
        compared(hands(rng, "a", 3), far)


def test_a_stray_way_back_does_not_stop_the_comparison():
    rng = np.random.default_rng(12)
    back = run("b", 9, np.full(500, 2.0), angle=ANGLE[::-1])
    found = align([*hands(rng, "a", 4), *hands(rng, "b", 4), back], Abscissa("angle"))
    assert {each.direction for each in found.passes} == {1, -1}
    assert {each.direction for each in compare(found)} == {1}


def test_the_test_agrees_with_scipys_where_there_is_one_column():
    from scipy.stats import permutation_test

    rng = np.random.default_rng(15)
    for sizes in ((4, 4), (3, 5)):
        points = rng.standard_normal((sum(sizes), 3)) + np.arange(sum(sizes))[:, None] * 0.2
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)

        def energy(a, b, apart=apart):
            a, b = a.astype(int), b.astype(int)
            return 2 * apart[np.ix_(a, b)].mean() - apart[np.ix_(a, a)].mean() - apart[np.ix_(b, b)].mean()

        units = tuple((int(k >= sizes[0]), k) for k in range(sum(sizes)))
        p, least = permutation_p({"x": Distances(apart, units)}, seed=0)
        groups = np.arange(sizes[0]), np.arange(sizes[0], sum(sizes))
        theirs = permutation_test(groups, energy, vectorized=False, n_resamples=np.inf, alternative="greater")
        assert p["x"] == pytest.approx(float(theirs.pvalue))
        assert least == (2.0 if sizes[0] == sizes[1] else 1.0) / comb(8, sizes[0])


def turned(each, number, name, *, by):
    """The run again as a repeat of `name`, bit for bit but for its clock and a force that is turned by `by`, rad."""
    recording = each.recording
    spin = np.array([[math.cos(by), -math.sin(by)], [math.sin(by), math.cos(by)]])
    channels = {**recording.channels, "force": recording.force @ spin.T} if by else recording.channels
    return Run(f"{name} {number}", name, Recording(recording.time + number, channels))


def torn(each, first, length):
    """The run with a gap in its clock: it is felt in two stretches."""
    time = each.recording.time.copy()
    time[first:] += 1e-3 * length
    return Run(each.label, each.renderer, Recording(time, each.recording.channels))


@settings(max_examples=4)
@given(st.integers(0, 1000), st.floats(-4.5, -0.5), st.booleans())
def test_repeats_that_agree_to_the_bit_still_separate_renderers(seed, power, gaps):
    """By any amount above what counts as rounding; and the clock's gaps, elsewhere in each, hide none of it."""
    rng = np.random.default_rng(seed)
    one = hands(rng, "a", 1)[0]
    first = [jogged(turned(one, k, "a", by=0.0), k) for k in range(4)]
    for by, outcome in ((10.0**power, "differs"), (0.0, "the same to rounding")):
        second = [jogged(turned(one, k + 4, "b", by=by), k + 4) for k in range(4)]
        runs = [torn(each, int(rng.integers(50, 450)), 20) if gaps else each for each in (*first, *second)]
        found = compared(runs)["a", "b", "direction"]
        assert found.outcome == outcome
        assert found.largest == pytest.approx(by, rel=1e-3, abs=1e-12)
        assert (found.rounding > 1.0) == (outcome == "differs")
