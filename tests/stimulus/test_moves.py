"""Moves of a hand: where they lead, how fast they are, and what their acceleration is made of."""

from __future__ import annotations

import itertools
import math
from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.documents import convert
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import circle
from hapticeval.stimulus.moves import (
    HAND_BAND,
    LARGEST_ACCELERATION,
    LARGEST_SPEED,
    PEAK_ACCELERATION_FACTOR,
    PEAK_SPEED_FACTOR,
    SHORTEST_MOVE,
    Move,
    Moves,
    Tremor,
    share_covered,
    shortest_duration,
)

DT = 1e-3
SHARE = np.linspace(0.0, 1.0, 100_001)


def above_band(moves: Moves) -> float:
    """The share of the acceleration's power above 10 Hz, of a path at 1 kHz with the hand at rest before and after."""
    points = moves.path().sampled(DT)[1]
    still = np.pad(points, ((2, 2), (0, 0)), mode="edge")
    acceleration = np.diff(still, n=2, axis=0)
    count = 2**17
    power = np.sum(np.abs(np.fft.rfft(acceleration, n=count, axis=0)) ** 2, axis=1)
    frequency = np.fft.rfftfreq(count, DT)
    return float(power[frequency > HAND_BAND].sum() / power.sum())


def test_a_move_starts_and_ends_at_rest_and_peaks_as_its_law_says():
    way = share_covered(SHARE)
    speed = np.gradient(way, SHARE)
    acceleration = np.gradient(speed, SHARE)
    assert (way[0], way[-1]) == (0.0, pytest.approx(1.0, abs=1e-12))
    assert np.all(np.diff(way) > -1e-15)
    assert speed.max() == pytest.approx(PEAK_SPEED_FACTOR, rel=1e-6)
    assert acceleration.max() == pytest.approx(PEAK_ACCELERATION_FACTOR, rel=1e-6)
    assert np.abs(acceleration[[1, -2]]).max() < 1e-5


def same_way(seconds):
    return Moves(start=[0.0], moves=tuple(Move(to=[0.01 * k], seconds=seconds) for k in range(1, 60)))


def test_of_one_move_half_a_per_mille_lies_above_where_the_docstring_says():
    band = [above_band(Moves(start=[0.0], moves=(Move(to=[0.01], seconds=s / HAND_BAND),))) for s in (3.8, 3.83)]
    assert band[1] <= 5e-4 < band[0]


def test_the_shortest_moves_one_after_the_other_keep_to_the_band_and_shorter_ones_do_not():
    back = Moves(start=[0.0], moves=tuple(Move(to=[0.01 * (k % 2)], seconds=SHORTEST_MOVE) for k in range(1, 60)))
    assert (
        max(above_band(same_way(SHORTEST_MOVE)), above_band(back)) <= 1e-3 < above_band(same_way(0.97 * SHORTEST_MOVE))
    )


@given(
    ends=st.lists(st.tuples(*[st.integers(-300, 300)] * 2), min_size=2, max_size=6),
    hertz=st.sampled_from([None, 8.0, 12.0]),
)
def test_moves_of_the_shortest_duration_are_a_hands(ends, hertz):
    tremor = None if hertz is None else Tremor(amplitude=[1.2e-4, 1.6e-4], hertz=hertz)
    points = [[x / 1e3, y / 1e3] for x, y in ends]
    lengths = [math.dist(*pair) for pair in itertools.pairwise(points)]
    moves = Moves(
        start=points[0],
        moves=tuple(
            Move(to=to, seconds=shortest_duration(length, tremor))
            for to, length in zip(points[1:], lengths, strict=True)
        ),
        tremor=tremor,
    )
    path = moves.path()
    time = np.arange(0.0, path.duration, 1e-3)
    place = np.column_stack([np.interp(time, path.time, column) for column in path.points.T])
    velocity = np.diff(place, axis=0) / 1e-3
    acceleration = np.diff(velocity, axis=0) / 1e-3
    assert np.linalg.norm(velocity, axis=1).max(initial=0.0) <= LARGEST_SPEED * (1.0 + 1e-6)
    # Points of a path are a quarter of a millisecond apart, with straight ways between: a chord's error, twice.
    assert np.linalg.norm(acceleration, axis=1).max(initial=0.0) <= LARGEST_ACCELERATION * 1.07
    assert np.array_equal(path.points[[0, -1]], [points[0], points[-1]]) or tremor is not None
    assert path.points[-1] == pytest.approx(points[-1], abs=1e-12)
    assert moves.seconds == pytest.approx(path.duration)
    assert moves.length == pytest.approx(sum(lengths))
    assert tremor is not None or moves.length == 0.0 or above_band(moves) <= 1e-3


def test_even_moves_are_straight_in_time_and_a_rest_rests():
    moves = Moves(
        start=[0.0, 0.0],
        moves=(Move(to=[0.1, 0.0], seconds=1.0, even=True), Move(to=[0.1, 0.0], seconds=0.5)),
    )
    path = moves.path()
    assert path.time.tolist() == [0.0, 1.0, 1.5]
    assert path.points.tolist() == [[0.0, 0.0], [0.1, 0.0], [0.1, 0.0]]


def test_tremor_adds_its_sine_and_none_at_the_ends():
    moves = Moves(
        start=[0.0, 0.0], moves=(Move(to=[0.0, 0.0], seconds=2.0),), tremor=Tremor(amplitude=[3e-4, 4e-4], hertz=10.0)
    )
    points = moves.path().points
    assert np.linalg.norm(points, axis=1).max() == pytest.approx(5e-4, rel=1e-3)
    assert points[[0, -1]].tolist() == [[0.0, 0.0], [0.0, 0.0]]
    spectrum = np.abs(np.fft.rfft(moves.path().sampled(DT)[1][:2000, 0]))
    assert np.fft.rfftfreq(2000, DT)[np.argmax(spectrum)] == 10.0


@pytest.mark.parametrize(
    "table",
    [
        {"start": [0, 0], "moves": []},
        {"start": [0, 0], "moves": [{"to": [1, 1], "seconds": 0}]},
        {"start": [0, 0], "moves": [{"to": [1, 1], "seconds": 1, "fast": True}]},
        {"start": [0, 0], "moves": [{"to": [1, 1, 1], "seconds": 1}]},
        {"start": [0, 0], "moves": [{"to": [1, 1], "seconds": 1}], "tremor": {"amplitude": [1e-4, 0], "hertz": 20}},
        {"start": [0, 0], "moves": [{"to": [1, 1], "seconds": 1}], "tremor": {"amplitude": [0, 0, 0], "hertz": 9}},
    ],
)
def test_tables_that_are_no_moves_are_refused(table):
    with pytest.raises(InputError):
        convert(table, Moves, "trajectory").path(circle().boundary, FilePath())


def test_a_tremor_that_leaves_no_room_for_moves_is_refused(refused):
    with refused(InputError):
        shortest_duration(0.1, Tremor(amplitude=[0.1, 0.0], hertz=12.0))
