"""The energy that passive environments may give: never more, and more where the force is turned."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hapticeval.recordings.energy_balance import Port, balance, find_rests
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
    force = force + np.random.default_rng(seed).normal(scale=noise or 1e-100, size=force.shape)
    return np.round(hip / step) * step if step else hip, force


def passive(hip, force):
    """Whether a passive environment may have given what the force gave; True where nothing bounds that."""
    gifts = balance(hip, force, TIME)
    return not gifts or any(gift.explained for gift in gifts)


KNOTS = st.integers(0, 10_000).map(lambda seed: np.random.default_rng(seed).uniform(-0.03, 0.03, (7, 2)))


def up_to(most):
    """A number up to `most`, or none: below 1e-150 N the square of a force is no number any more."""
    return st.just(0.0) | st.floats(1e-12, most)


@settings(max_examples=25)
@given(
    knots=KNOTS,
    stiffness=up_to(500.0),
    damping=up_to(10.0),
    mass=up_to(1.0),
    noise=up_to(0.05),
    step=st.sampled_from([0.0, 1e-6, 2e-5]),
    lag=st.integers(0, 3),
)
def test_no_passive_environment_gives_energy(knots, stiffness, damping, mass, noise, step, lag):
    hip, force = pushed(eased(knots), stiffness=stiffness, damping=damping, mass=mass, noise=noise, step=step, lag=lag)
    assert passive(hip, force)


@settings(max_examples=20)
@given(knots=KNOTS, stiffness=st.floats(0.0, 20.0), damping=st.floats(5.0, 10.0), step=st.sampled_from([0.0, 1e-6]))
def test_what_takes_energy_is_known_by_it_either_way(knots, stiffness, damping, step):
    """The hand comes back to where it began, which only a damper notices: 1.5 L^2 in a way of L in a second, for each
    N s/m, where the spring is loaded with no more than 20 N/m times 0.042 m times L."""
    knots[-1] = knots[0]
    ways = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    assume(5.0 * 1.5 * np.sum(ways**2) > 0.2 * 20.0 * 0.042 * np.sum(ways))  # twice what a late loop may give away
    hip, force = pushed(eased(knots), stiffness=stiffness, damping=damping, noise=0.005, step=step)
    assert passive(hip, force)
    assert not passive(hip, -force)


def test_the_energy_is_what_the_damper_took():
    hip, force = pushed(WAY, stiffness=30.0, damping=8.0)
    taken = 8.0 * np.sum(np.gradient(hip[:, 0], DT) ** 2) * DT
    gift = balance(hip, -force, TIME)[0]
    assert gift.energy == pytest.approx(taken, rel=0.01)
    assert 0.0 < gift.open < 0.3 * taken
    assert TIME[gift.last] - TIME[gift.first] == pytest.approx(6.0, abs=0.1)


WAY = eased(np.array([[0.0], [0.02], [0.0], [0.02], [0.0], [0.02], [0.0]]))
"""Thrice to and fro, with a rest at each end."""

ANYWHERE = eased(np.random.default_rng(1).uniform(-0.02, 0.02, (7, 1)))
PLANE = eased(np.random.default_rng(0).uniform(-0.03, 0.03, (7, 2)))
HOLLOW = eased(np.array([[-0.03], [-0.03], [0.0], [0.0], [0.0], [0.0], [0.0]]))


@pytest.mark.parametrize(
    ("hip", "force"),
    [
        # a lossless spring that is always loaded
        (0.05 + ANYWHERE, pushed(0.05 + ANYWHERE, stiffness=400.0, damping=0.0)[1]),
        # a latch that is passed once, from rest far off into a hollow and to rest there: what it gives it had stored
        (HOLLOW, -800.0 * HOLLOW * np.exp(-((HOLLOW / 0.008) ** 2))),
        # a mass on a spring near its own frequency: where the hand turns round there is hardly any force on it
        pushed(PLANE, stiffness=2.0, damping=0.0, mass=0.25, step=2e-5),
    ],
)
def test_what_may_have_been_stored_is_no_gift(hip, force):
    assert passive(hip, force)
    assert passive(hip, -force)


def test_a_motor_gives_energy_with_either_sign():
    """A spring that pushes back and forth by itself."""
    force = np.where((TIME // 2.0 % 2 == 0)[:, None], 5.0, -5.0) * np.gradient(WAY, DT, axis=0)
    assert not passive(WAY, force)
    assert not passive(WAY, -force)


@settings(max_examples=20)
@given(knots=KNOTS, stiffness=st.floats(50.0, 2000.0))
def test_a_lossless_wall_is_judged_from_free_space_on(knots, stiffness):
    """It takes on the way in, and gives back no more: with the other sign it gives first."""
    hip = eased(knots)
    hip[:, 1] += 0.01 - hip[0, 1]  # free at first
    assume(np.any(hip[:, 1] < -1e-3))
    force = np.column_stack([np.zeros(6000), np.maximum(-stiffness * hip[:, 1], 0.0)])
    assert passive(hip, force)
    assert not passive(hip, -force)


def test_a_late_force_is_free_as_long_as_it_says_so():
    """A lossless wall that is touched for a few ticks gives nothing at the lag that its force has."""
    hip = 0.01 * np.cos(2.0 * np.pi * 20.0 * TIME)[:, None] + 0.0097
    force = np.where(hip < 0.0, -1000.0 * hip, 0.0)
    late = np.concatenate([np.zeros((LAG_TICKS, 1)), force[:-LAG_TICKS]])
    assert passive(hip, force)
    assert balance(hip, late, TIME)[LAG_TICKS].energy == pytest.approx(0.0, abs=1e-9)


class TestPort:
    """What crosses a port, summed up anew: by every pair of rows."""

    def port(self, seed, *, share=0.1):
        random = np.random.default_rng(seed)
        place, force = np.cumsum(random.standard_normal((2, 14, 2)), axis=1)
        return Port(1e-3 * place, force, (1e-4, 0.05), share), 1e-3 * place, force

    def left_open(self, place, force, first, last):
        """Rounding of places and of forces, noise, and a tenth for the loop's delay."""
        rows = slice(first, last + 1)
        moved, turned = np.diff(place[rows], axis=0), np.diff(force[rows], axis=0)
        size = np.linalg.norm(force, axis=1)
        half_quantum = 0.5 * np.sqrt(2.0)
        noise = 5.0 * np.median(np.abs(np.diff(force, n=2, axis=0)), axis=0).max() / 0.6745 / np.sqrt(6.0)
        works = np.sum(0.5 * (force[rows][1:] + force[rows][:-1]) * moved, axis=1)
        return (
            half_quantum * 1e-4 * (np.linalg.norm(turned, axis=1).sum() + size[first] + size[last])
            + half_quantum * 0.05 * np.linalg.norm(moved, axis=1).sum()
            + noise * np.sqrt(np.sum(moved**2))
            + 0.1 * np.abs(works).sum(),
            works.sum(),
        )

    @pytest.mark.parametrize("seed", range(12))
    def test_the_gift_farthest_beyond_what_is_open_is_found(self, seed):
        port, place, force = self.port(seed)
        free, rests = [0, 3, 7, 13], np.array([1, 5, 8, 12])
        gifts = []
        for first in free:
            for last in range(first + 1, 14):
                left, work = self.left_open(place, force, first, last)
                gifts.append((work - left, work, first, last))
        (found,) = port._free(free)
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
            between.append((work - back - left - 0.01 * np.ptp(all_work), work - back, first, last))
        (found,) = port._rests(rests)
        best = max(between)
        assert (found.excess, found.energy) == (pytest.approx(best[0]), pytest.approx(best[1]))
        assert (found.first, found.last) == best[2:]

    def test_of_two_rows_no_noise_is_known(self):
        place, force = np.array([[0.0], [1e-3]]), np.array([[1.0], [1.0]])
        # 1 N over 1 mm, of which a loop's delay may make a tenth
        (found,) = Port(place, force, (0.0, 0.0), 0.0)._free([0])
        assert (found.energy, found.open) == (pytest.approx(1e-3), pytest.approx(1e-4))

    @pytest.mark.parametrize("count", [3, 4, 5])
    def test_of_three_rows_and_more_it_is_told_by_how_the_force_bends(self, count):
        """By turns 0 and 1 N it bends by 2 N in each row; the steps are a millimetre each."""
        place, force = 1e-3 * np.arange(float(count))[:, np.newaxis], np.arange(count)[:, np.newaxis] % 2.0
        port = Port(place, force, (0.0, 0.0), 0.0)
        noise = 5.0 * 2.0 / 0.6745 / np.sqrt(6.0)
        work = 0.5e-3 * (count - 1)
        assert port.open(0, count - 1) == pytest.approx(noise * 1e-3 * np.sqrt(count - 1.0) + 0.1 * work)

    def test_two_rests_are_enough_and_the_best_of_rests_and_free_rows_counts(self):
        for seed in range(6):
            port, _, _ = self.port(seed)
            rests, free = np.array([1, 12]), [0, 7]
            assert not [*port._rests(rests[:1])]
            both = [*port._rests(rests), *port._free(free)]
            assert len(both) == 2
            assert port.largest(rests, free).excess == max(violation.excess for violation in both)

    @pytest.mark.parametrize(("rows", "known"), [(19, False), (20, True)])
    def test_twenty_rows_without_a_force_are_free_up_to_the_last_of_them(self, rows, known):
        """Before, a force across the way gives nothing, and after it one along the way 1 mJ a step."""
        place = 1e-3 * np.column_stack([np.arange(60.0), np.zeros(60)])
        force = np.zeros((60, 2))
        force[30:, 0] = 1.0
        force[: 30 - rows, 1] = 1.0
        gifts = balance(place, force, DT * np.arange(60.0))
        if not known:
            assert gifts == ()
            return
        gift = gifts[0]
        assert len(gifts) == 4
        assert (gift.first, gift.last, gift.how) == (29, 59, "free of force at the first")
        assert gift.energy == pytest.approx(29.5e-3)
        assert not gift.explained

    def test_all_stretches_without_a_force_are_looked_at(self):
        """Twice free, and given 30 mJ after the second time alone; taken as much after the first."""
        place = 1e-3 * np.arange(120.0)[:, np.newaxis]
        force = np.zeros((120, 1))
        force[30:60], force[90:] = -1.0, 1.0
        assert balance(place, force, DT * np.arange(120.0))[0].first == 89

    @pytest.mark.parametrize("count", range(6))
    def test_a_few_rows_bound_nothing(self, count):
        place = 1e-3 * np.arange(float(count))[:, np.newaxis]
        assert balance(place, 0.0 * place, DT * np.arange(float(count))) == ()

    def test_where_no_two_rows_bound_what_is_stored_there_is_none(self):
        port, _, _ = self.port(0)
        assert port.largest(np.array([4]), [13]) is None
        assert port.largest(np.array([4]), [12]).last == 13


class TestRests:
    def there_and_on(self, moves, rests, on, *, step=1e-4):
        return np.cumsum([0.0] + [step] * moves + [0.0] * rests + [step] * on)[:, np.newaxis]

    def test_a_rest_is_where_the_hand_moves_by_a_share_of_its_largest_speed_over_ten_milliseconds(self):
        """At 0.1 m/s to row 10 and from row 30 on; over five rows to either side it stands in rows 15 to 25."""
        place = self.there_and_on(10, 20, 10)
        rows, share = find_rests(place, DT * np.arange(41), 0.0)
        assert (rows.tolist(), share) == ([15], 0.03)
        # Two quanta in the window: 60 um in 10 ms are 6 mm/s of 100.
        assert find_rests(place, DT * np.arange(41), 3e-5)[1] == pytest.approx(0.06)

    @pytest.mark.parametrize(("count", "rests"), [(19, 0), (20, 1)])
    def test_what_is_shorter_than_two_windows_has_none(self, count, rests):
        place = self.there_and_on(5, 14, 0)[:count]
        rows, share = find_rests(place, DT * np.arange(float(count)), 0.0)
        assert rows.size == rests
        assert share == (0.03 if rests else 0.0)
        assert find_rests(0.0 * place, DT * np.arange(float(count)), 1e-3)[1] == 0.0, "a hand that never moves"

    def test_of_a_slow_clock_a_speed_is_taken_from_row_to_row(self):
        place = self.there_and_on(0, 2, 7)
        rows, _ = find_rests(place, 0.02 * np.arange(10), 0.0)
        assert rows.tolist() == [1]
