"""The sign of a force by physics: what passive environments give, and what is found of one that is turned."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hapticeval.cli import main
from hapticeval.recordings.energy_balance import EnergyGift, PassivityTest, _Port, _resting, balance
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.integrity.force_sign import force_signs
from hapticeval.recordings.integrity.report import examine
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.stretches import LAG_TICKS

DT = 1e-3
TIME = DT * np.arange(6000)


def eased(knots, *, each=1.0):
    """A hand that rests at each knot (k, N) and goes straight to the next in `each` s, with no speed at the ends."""
    share = np.clip(TIME / each, 0.0, len(knots) - 1.0 - 1e-9)
    leg, part = share.astype(int), share % 1.0
    smooth = part - np.sin(2.0 * np.pi * part) / (2.0 * np.pi)
    return knots[leg] + smooth[:, None] * (knots[leg + 1] - knots[leg])


def pushed(hip, *, stiffness, damping, mass=0.0, seed=0, noise=0.0, step=0.0, lag=0):
    """The force on the hand of a spring to the origin, a damper and a mass on it, of what the sensor makes of it."""
    velocity = np.gradient(hip, DT, axis=0)
    force = -stiffness * hip - damping * velocity - mass * np.gradient(velocity, DT, axis=0)
    force = np.concatenate([np.repeat(force[:1], lag, axis=0), force[: len(force) - lag]])
    force = force + np.random.default_rng(seed).normal(scale=noise or 1e-300, size=force.shape)
    return np.round(hip / step) * step if step else hip, force


def signed(hip, force, **meta):
    (judged,) = force_signs(Recording(TIME, {"hip": hip, "force": force}, meta))
    assert (judged.issue is not None and judged.issue.kind == "force sign") == (judged.sign < 0)
    return judged.sign


KNOTS = st.integers(0, 10_000).map(lambda seed: np.random.default_rng(seed).uniform(-0.03, 0.03, (7, 2)))


@settings(max_examples=25)
@given(
    knots=KNOTS,
    stiffness=st.floats(0.0, 500.0),
    damping=st.floats(0.0, 10.0),
    mass=st.floats(0.0, 1.0),
    noise=st.floats(0.0, 0.05),
    step=st.sampled_from([0.0, 1e-6, 2e-5]),
    lag=st.integers(0, 3),
)
def test_no_passive_environment_is_suspected_and_none_is_believed_when_turned(
    knots, stiffness, damping, mass, noise, step, lag
):
    hip, force = pushed(eased(knots), stiffness=stiffness, damping=damping, mass=mass, noise=noise, step=step, lag=lag)
    assert signed(hip, force) >= 0
    assert signed(hip, -force) <= 0


@settings(max_examples=20)
@given(knots=KNOTS, stiffness=st.floats(0.0, 20.0), damping=st.floats(5.0, 10.0), step=st.sampled_from([0.0, 1e-6]))
def test_what_takes_energy_is_known_by_it_either_way(knots, stiffness, damping, step):
    """The hand comes back to where it began, which only a damper notices: 1.5 L^2 in a way of L in a second, for each
    N s/m, where the spring is loaded with no more than 20 N/m times 0.042 m times L."""
    knots[-1] = knots[0]
    ways = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    assume(5.0 * 1.5 * np.sum(ways**2) > 0.2 * 20.0 * 0.042 * np.sum(ways))  # twice what a late loop may give away
    hip, force = pushed(eased(knots), stiffness=stiffness, damping=damping, noise=0.005, step=step)
    assert (signed(hip, force), signed(hip, -force)) == (1, -1)


def test_the_energy_is_what_the_damper_took():
    hip, force = pushed(WAY, stiffness=30.0, damping=8.0)
    taken = 8.0 * np.sum(np.gradient(hip[:, 0], DT) ** 2) * DT
    (issue,) = examine(Recording(TIME, {"hip": hip, "force": -force})).issues
    assert issue.kind == "force sign"
    assert issue.measures["energy"] == pytest.approx(taken, rel=0.01)
    assert 0.0 < issue.measures["open"] < 0.3 * taken
    assert issue.time[1] - issue.time[0] == pytest.approx(6.0, abs=0.1)


WAY = eased(np.array([[0.0], [0.02], [0.0], [0.02], [0.0], [0.02], [0.0]]))
"""Thrice to and fro, with a rest at each end."""

ANYWHERE = eased(np.random.default_rng(1).uniform(-0.02, 0.02, (7, 1)))
PLANE = eased(np.random.default_rng(0).uniform(-0.03, 0.03, (7, 2)))
HOLLOW = eased(np.array([[-0.03], [-0.03], [0.0], [0.0], [0.0], [0.0], [0.0]]))


@pytest.mark.parametrize(
    ("hip", "force", "words"),
    [
        # a lossless spring that is always loaded
        (0.05 + ANYWHERE, pushed(0.05 + ANYWHERE, stiffness=400.0, damping=0.0)[1], "with neither sign"),
        # a motor: a spring that pushes back and forth by itself gives energy with either sign
        (
            WAY,
            np.where((TIME // 2.0 % 2 == 0)[:, None], 5.0, -5.0) * np.gradient(WAY, DT, axis=0),
            "with either sign",
        ),
        # a latch that is passed once, from rest far off into a hollow and to rest there: what it gives it had stored
        (HOLLOW, -800.0 * HOLLOW * np.exp(-((HOLLOW / 0.008) ** 2)), ""),
        # a mass on a spring near its own frequency: where the hand turns round there is hardly any force on it
        (*pushed(PLANE, stiffness=2.0, damping=0.0, mass=0.25, step=2e-5), ""),
    ],
)
def test_what_may_be_passive_either_way_is_not_suspected(hip, force, words):
    assert signed(hip, force) == signed(hip, -force) == 0
    (judged,) = force_signs(Recording(TIME, {"hip": hip, "force": force}))
    assert words in judged.words


@settings(max_examples=20)
@given(knots=KNOTS, stiffness=st.floats(50.0, 2000.0))
def test_a_lossless_wall_is_judged_from_free_space_on(knots, stiffness):
    """It takes on the way in, and gives back no more: with the other sign it gives first."""
    hip = eased(knots)
    hip[:, 1] += 0.01 - hip[0, 1]  # free at first
    assume(np.any(hip[:, 1] < -1e-3))
    force = np.column_stack([np.zeros(6000), np.maximum(-stiffness * hip[:, 1], 0.0)])
    assert (signed(hip, force), signed(hip, -force)) == (1, -1)


def test_a_late_force_is_free_as_long_as_it_says_so():
    """A lossless wall that is touched for a few ticks gives nothing at the lag that its force has."""
    hip = 0.01 * np.cos(2.0 * np.pi * 20.0 * TIME)[:, None] + 0.0097
    force = np.where(hip < 0.0, -1000.0 * hip, 0.0)
    late = np.concatenate([np.zeros((LAG_TICKS, 1)), force[:-LAG_TICKS]])
    assert all(each.as_logged.explained for each in balance(hip, force, TIME))
    assert balance(hip, late, TIME)[LAG_TICKS].as_logged.energy == pytest.approx(0.0, abs=1e-9)


def test_a_sensor_that_reads_so_much_in_free_motion_is_not_trusted():
    hip, force = pushed(WAY, stiffness=0.0, damping=2.0)
    assert signed(hip, -force) == -1
    assert signed(hip, -force, force_floor=float(np.max(np.abs(force)))) == 0


def test_the_force_of_the_hand_is_judged_by_its_own_sense():
    hip, force = pushed(WAY, stiffness=30.0, damping=8.0, noise=0.01)
    of_hand = pushed(hip, stiffness=30.0, damping=8.0, noise=0.01, seed=1)[1]
    for sense in (1.0, -1.0):
        signs = force_signs(Recording(TIME, {"hip": hip, "force": force, "operator_force": -sense * of_hand}))
        assert {each.channel: each.sign for each in signs} == {"force": 1, "operator_force": int(sense)}
        assert [each.issue.channel for each in signs if each.issue] == ["operator_force"] * (sense < 0.0)


def slide(*, rows=600, sign=1.0, **meta):
    """Along a disc of 50 mm and always on it, without a rest; the renderer's force is a spring's."""
    turn = 0.2 + 4e-3 * np.arange(rows)
    outward = np.column_stack([np.cos(turn), np.sin(turn)])
    depth = 2e-3 + 1e-3 * np.sin(np.arange(rows) * 0.017)
    hip, ihip = (0.05 - depth)[:, None] * outward, 0.05 * outward
    return Recording(DT * np.arange(rows), {"hip": hip, "ihip": ihip, "force": sign * 800.0 * (ihip - hip)}, meta)


def test_a_force_that_points_into_what_is_touched_is_suspected():
    assert force_signs(slide())[0].sign == 1
    (judged,) = force_signs(slide(sign=-1.0))
    assert judged.sign == -1
    assert "away from the IHIP, into what is touched, in 600 of 600 rows" in judged.issue.message
    (judged,) = force_signs(slide(sign=-1.0, scene={"bilateral": True}))  # such a surface may pull
    assert (judged.sign, judged.issue) == (0, None)


def test_rows_that_are_no_measurement_do_not_count():
    made = slide()
    force = made.force.copy()
    valid = np.arange(600) < 500
    force[~valid] *= -1e3
    broken = Recording(made.time, {**made.channels, "force": force}, valid=valid)
    assert force_signs(broken)[0].sign == 1
    assert balance(made.hip[:1], made.force[:1], made.time[:1]) == ()


@pytest.mark.parametrize(("quantum", "known"), [(1e-6, 1), (2e-4, 0)])
def test_a_push_counts_only_where_the_tool_is_seen_to_move(quantum, known):
    """Six slow pushes, of which a coarse encoder shows no way in; a sensor that reads too much to count energy."""
    place = 0.003 * np.sin(2.0 * np.pi * TIME - 1.2)[:, None]
    force = 0.15 + np.where(place > 0.001, -800.0 * (place - 0.001), 0.0)
    hip = np.round(place / quantum) * quantum
    assert (signed(hip, force, force_floor=0.3), signed(hip, -force, force_floor=0.3)) == (known, -known)


def test_inspect_describes_it_and_ends_with_1(unpictured, capsys):
    hip, force = pushed(WAY, stiffness=30.0, damping=8.0, noise=0.01)
    made = Recording(TIME, {"hip": hip, "force": force}, {"dt": DT})
    write_recording("right.h5", made)
    write_recording("wrong.h5", replace(made, channels={"hip": hip, "force": -force}))
    assert main(["inspect", "right.h5"]) == 0
    assert "sign of force: right" in capsys.readouterr().out
    assert main(["inspect", "wrong.h5"]) == 1
    shown = capsys.readouterr().out
    assert "suspicious: force sign force (rows" in shown
    assert "the environment would have given" in shown
    assert "no sign was changed" in shown


class TestPort:
    """What crosses a port, summed up anew: by every pair of rows."""

    def port(self, seed, *, share=0.1, floor=0.02):
        random = np.random.default_rng(seed)
        place, force = np.cumsum(random.standard_normal((2, 14, 2)), axis=1)
        return _Port(1e-3 * place, force, (1e-4, 0.05), floor, share), 1e-3 * place, force

    def left_open(self, place, force, first, last):
        """Rounding of places and of forces, the reading in free motion, noise, and a tenth for the loop's delay."""
        rows = slice(first, last + 1)
        moved, turned = np.diff(place[rows], axis=0), np.diff(force[rows], axis=0)
        size = np.linalg.norm(force, axis=1)
        half_quantum = 0.5 * np.sqrt(2.0)
        noise = 5.0 * np.median(np.abs(np.diff(force, n=2, axis=0)), axis=0).max() / 0.6745 / np.sqrt(6.0)
        works = np.sum(0.5 * (force[rows][1:] + force[rows][:-1]) * moved, axis=1)
        return (
            half_quantum * 1e-4 * (np.linalg.norm(turned, axis=1).sum() + size[first] + size[last])
            + (0.02 + half_quantum * 0.05) * np.linalg.norm(moved, axis=1).sum()
            + noise * np.sqrt(np.sum(moved**2))
            + 0.1 * np.abs(works).sum(),
            works.sum(),
        )

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize("seed", range(6))
    def test_the_gift_farthest_beyond_what_is_open_is_found(self, seed, sign):
        port, place, force = self.port(seed)
        free, rests = [0, 3, 7, 13], np.array([1, 5, 8, 12])
        gifts = []
        for first in free:
            for last in range(first + 1, 14):
                left, work = self.left_open(place, force, first, last)
                gifts.append((sign * work - left, sign * work, first, last))
        (found,) = port._free(sign, free)
        best = max(gifts)
        assert (found.excess, found.energy) == (pytest.approx(best[0]), pytest.approx(best[1]))
        assert (found.first, found.last) == best[2:]
        assert found.explained is bool(best[0] <= 0.0)
        between = []
        works = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(place, axis=0), axis=1)
        all_work = np.concatenate([[0.0], np.cumsum(works)])
        for first, last in itertools.combinations(rests.tolist(), 2):
            left, work = self.left_open(place, force, first, last)
            back = np.linalg.norm(force, axis=1).max() * np.linalg.norm(place[last] - place[first])
            # A rest of a tenth of the largest speed leaves a hundredth of the kinetic energy.
            between.append((sign * work - back - left - 0.01 * np.ptp(all_work), sign * work - back, first, last))
        (found,) = port._rests(sign, rests)
        best = max(between)
        assert (found.excess, found.energy) == (pytest.approx(best[0]), pytest.approx(best[1]))
        assert (found.first, found.last) == best[2:]

    def test_of_two_rows_no_noise_is_known(self):
        place, force = np.array([[0.0], [1e-3]]), np.array([[1.0], [1.0]])
        # 1 N over 1 mm, of which a loop's delay may make a tenth
        (found,) = _Port(place, force, (0.0, 0.0), 0.0, 0.0)._free(1.0, [0])
        assert (found.energy, found.open) == (pytest.approx(1e-3), pytest.approx(1e-4))

    @pytest.mark.parametrize("count", [3, 4, 5])
    def test_of_three_rows_and_more_it_is_told_by_how_the_force_bends(self, count):
        """By turns 0 and 1 N it bends by 2 N in each row; the steps are a millimetre each."""
        place, force = 1e-3 * np.arange(float(count))[:, np.newaxis], np.arange(count)[:, np.newaxis] % 2.0
        port = _Port(place, force, (0.0, 0.0), 0.0, 0.0)
        noise = 5.0 * 2.0 / 0.6745 / np.sqrt(6.0)
        work = 0.5e-3 * (count - 1)
        assert port.open(0, count - 1) == pytest.approx(noise * 1e-3 * np.sqrt(count - 1.0) + 0.1 * work)

    def test_two_rests_are_enough_and_the_best_of_rests_and_free_rows_counts(self):
        for seed in range(6):
            port, _, _ = self.port(seed)
            rests, free = np.array([1, 12]), [0, 7]
            assert not [*port._rests(1.0, rests[:1])]
            both = [*port._rests(1.0, rests), *port._free(1.0, free)]
            assert len(both) == 2
            assert port.largest(1.0, rests, free).excess == max(violation.excess for violation in both)

    @pytest.mark.parametrize(("rows", "known"), [(19, False), (20, True)])
    def test_twenty_rows_without_a_force_are_free_up_to_the_last_of_them(self, rows, known):
        """Before, a force across the way gives nothing, and after it one along the way 1 mJ a step."""
        place = 1e-3 * np.column_stack([np.arange(60.0), np.zeros(60)])
        force = np.zeros((60, 2))
        force[30:, 0] = 1.0
        force[: 30 - rows, 1] = 1.0
        tests = balance(place, force, DT * np.arange(60.0))
        if not known:
            assert tests == ()
            return
        gift = tests[0].as_logged
        assert (gift.first, gift.last, gift.how) == (29, 59, "free of force at the first")
        assert gift.energy == pytest.approx(29.5e-3)
        assert len(tests) == 4
        assert (tests[0].as_logged.explained, tests[0].turned.explained, tests[0].sign) == (False, True, -1)
        assert tests[0].active is tests[0].as_logged

    def test_all_stretches_without_a_force_are_looked_at(self):
        """Twice free, and given 30 mJ after the second time alone; taken as much after the first."""
        place = 1e-3 * np.arange(120.0)[:, np.newaxis]
        force = np.zeros((120, 1))
        force[30:60], force[90:] = -1.0, 1.0
        assert balance(place, force, DT * np.arange(120.0))[0].as_logged.first == 89

    def test_what_gives_energy_is_told_of_the_sign_that_is_not_passive(self):
        gives, takes = (EnergyGift(energy, 0.5, 0, 1, "at rest at both") for energy in (1.0, 0.0))
        for as_logged, turned, sign, active in (
            (takes, gives, 1, gives),
            (gives, takes, -1, gives),
            (gives, replace(gives, first=1), 0, gives),
        ):
            test = PassivityTest(as_logged, turned)
            assert (test.sign, test.active) == (sign, active)
            assert test.active.excess == 0.5

    @pytest.mark.parametrize("count", range(6))
    def test_a_few_rows_bound_nothing(self, count):
        place = 1e-3 * np.arange(float(count))[:, np.newaxis]
        assert balance(place, 0.0 * place, DT * np.arange(float(count))) == ()

    def test_where_no_two_rows_bound_what_is_stored_there_is_none(self):
        port, _, _ = self.port(0)
        assert port.largest(1.0, np.array([4]), [13]) is None
        assert port.largest(1.0, np.array([4]), [12]).last == 13


class TestRests:
    def there_and_on(self, moves, rests, on, *, step=1e-4):
        return np.cumsum([0.0] + [step] * moves + [0.0] * rests + [step] * on)[:, np.newaxis]

    def test_a_rest_is_where_the_hand_moves_by_a_share_of_its_largest_speed_over_ten_milliseconds(self):
        """At 0.1 m/s to row 10 and from row 30 on; over five rows to either side it stands in rows 15 to 25."""
        place = self.there_and_on(10, 20, 10)
        rows, share = _resting(place, DT * np.arange(41), 0.0)
        assert (rows.tolist(), share) == ([15], 0.03)
        # Two quanta in the window: 60 um in 10 ms are 6 mm/s of 100.
        assert _resting(place, DT * np.arange(41), 3e-5)[1] == pytest.approx(0.06)

    @pytest.mark.parametrize(("count", "rests"), [(19, 0), (20, 1)])
    def test_what_is_shorter_than_two_windows_has_none(self, count, rests):
        place = self.there_and_on(5, 14, 0)[:count]
        rows, share = _resting(place, DT * np.arange(float(count)), 0.0)
        assert rows.size == rests
        assert share == (0.03 if rests else 0.0)
        assert _resting(0.0 * place, DT * np.arange(float(count)), 1e-3)[1] == 0.0, "a hand that never moves"

    def test_of_a_slow_clock_a_speed_is_taken_from_row_to_row(self):
        place = self.there_and_on(0, 2, 7)
        rows, _ = _resting(place, 0.02 * np.arange(10), 0.0)
        assert rows.tolist() == [1]
