"""Numbers of a recording, its clock and its memory, worked out anew, and on each side of every threshold in them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import InputError
from hapticeval.recordings.channels import CHANNELS, Signal, check_metadata, declared
from hapticeval.recordings.difference import difference
from hapticeval.recordings.hdf5 import read_recording, write_recording
from hapticeval.recordings.memory import GIGABYTE, HEAD_BYTES, first_bytes, limited, reserve
from hapticeval.recordings.quantization import (
    coarsest,
    common_divisor,
    decimal_step,
    numeric_step,
    single_precision_step,
)
from hapticeval.recordings.recording import (
    SINGLE,
    Clock,
    Event,
    Recording,
    backward_difference,
    check_finite,
    check_increasing,
    columns_of,
    runs_of,
)
from hapticeval.recordings.stretches import Stretch, continuing_steps, describe_clock, nominal_step, steps, stretches

MS = 1e-3


def plain(time, **more):
    zero = np.zeros((len(time), 2))
    return Recording(np.asarray(time, dtype=float), {"hip": zero, "ihip": zero, "force": zero}, **more)


@given(mask=st.lists(st.booleans(), max_size=20))
def test_runs_are_the_rows_that_hold_as_long_as_they_go(mask):
    runs = runs_of(np.array(mask, dtype=bool))
    assert [row for first, end in runs for row in range(first, end)] == [row for row, on in enumerate(mask) if on]
    assert all(first < end for first, end in runs)
    assert all(before < first for (_, before), (first, _) in pairwise(runs))


def test_a_velocity_is_the_difference_to_the_row_before():
    values, time = np.array([[0.0, 0.0], [1.0, 2.0], [1.0, 6.0]]), np.array([0.0, 0.5, 1.5])
    assert backward_difference(values, time).tolist() == [[0.0, 0.0], [2.0, 4.0], [0.0, 4.0]]


@pytest.mark.parametrize(("share", "apart"), [(0.9, False), (1.1, True)])
def test_the_hip_in_single_precision_is_still_the_hip(share, apart):
    hip = np.array([[0.5, -2.0], [0.0, 0.0]])
    ihip = hip + np.array([[0.0, 0.0], [share * 4.0 * SINGLE * 2.0, 0.0]])
    recording = Recording([0.0, MS], {"hip": hip, "ihip": ihip, "force": 0.0 * hip})
    assert recording.apart.tolist() == [False, apart]
    assert recording.contact.tolist() == [False, apart]


def test_what_was_not_recorded_does_not_decide_the_contact(refused):
    hip, felt = np.zeros((3, 2)), np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    assert Recording([0, 1, 2], {"hip": hip, "force": felt}).contact.tolist() == [False, True, False]
    assert Recording([0, 1, 2], {"hip": hip, "ihip": hip + felt}).contact.tolist() == [False, True, False]
    reported = Recording([0, 1, 2], {"hip": hip, "ihip": hip, "force": felt, "contact": [1.0, 0.0, 0.0]})
    assert reported.contact.tolist() == [True, False, False]
    masked = Recording([0, 1, 2], {"hip": hip, "force": felt}, valid=np.array([True, False, True]))
    assert not masked.contact.any()
    with refused(InputError):
        _ = Recording([0, 1], {"hip": hip[:2]}).contact


def test_sampling_times_are_the_median_and_of_one_row_the_declared_one():
    assert plain([0.0, 1.0, 2.0, 9.0]).dt == 1.0
    assert plain([0.0], meta={"dt": 0.25}).dt == 0.25
    assert plain([0.0]).dt == 1e-3
    holed = plain([0.0, 5.0, 7.0], valid=np.array([True, False, True]))
    assert holed.dt == 7.0


def test_columns_are_named_by_axis_joint_and_number():
    recording = Recording(
        [0.0, 1.0],
        {"hip": [[1.0, 2.0], [3.0, 4.0]], "joint_torque": [[5.0], [6.0]], "grip": [7.0, 8.0]},
        signals={"grip": Signal("N", "grip force")},
    )
    columns = columns_of(recording)
    assert list(columns) == ["hip.x", "hip.y", "joint_torque.0", "grip"]
    assert {name: (column.unit, column.values.tolist()) for name, column in columns.items()} == {
        "hip.x": ("m", [1.0, 3.0]),
        "hip.y": ("m", [2.0, 4.0]),
        "joint_torque.0": ("N m", [5.0, 6.0]),
        "grip": ("N", [7.0, 8.0]),
    }


@pytest.mark.parametrize(
    "widths",
    [
        {"hip": 4},
        {"hip": 2, "force": 3},
        {"hip": 2, "joint_position": 2, "joint_velocity": 3},
        {"hip": 0},
    ],
)
def test_channels_of_a_frame_have_its_width(refused, widths):
    with refused(InputError):
        Recording([0.0, 1.0, 2.0], {name: np.zeros((3, width)) for name, width in widths.items()})


class TestClocks:
    def test_seconds_count_from_the_zero_and_missed_cycles_from_first_to_last(self):
        clock = Clock(np.array([5, 7, 10]) * 10**9, 4 * 10**9, None, np.array([1, 3, 9]))
        assert clock.seconds.tolist() == [1.0, 3.0, 6.0]
        assert clock.missed == 6
        assert clock.part(slice(1, None)).seconds.tolist() == [3.0, 6.0]
        assert Clock(np.array([5, 7])).zero == 5
        assert Clock(np.array([5, 7])).missed is None

    @pytest.mark.parametrize(("hole", "count"), [(4.0, 1), (4.01, 2)])
    def test_a_hole_of_more_than_four_steps_ends_a_stretch(self, hole, count):
        time = np.concatenate([MS * np.arange(10), MS * (9 + hole) + MS * np.arange(10)])
        parts = stretches(plain(time))
        assert len(parts) == count
        assert continuing_steps(plain(time)).sum() == 20 - count
        assert parts[-1].end == 20
        assert len(parts[0]) == (20 if count == 1 else 10)

    def test_a_stretch_has_two_rows_or_more_that_are_sound(self):
        sound = np.array([True, True, False, True, False, True, True, True])
        parts = stretches(plain(MS * np.arange(8.0)), sound)
        assert [(part.first, part.end) for part in parts] == [(0, 2), (5, 8)]
        assert parts[1].rows == slice(5, 8)
        assert parts[1].times(plain(MS * np.arange(8.0))) == "0.005 to 0.007 s"

    def test_a_declared_step_counts_where_the_median_bears_it_out(self):
        regular = MS * np.arange(9.0)
        assert nominal_step(plain(regular, meta={"dt": 1e-3 + 5e-10})) == 1e-3 + 5e-10
        assert nominal_step(plain(regular, meta={"dt": 1.1e-3})) == 1e-3
        third = np.arange(9.0) / 3000.0
        assert nominal_step(plain(third)) == pytest.approx(1.0 / 3000.0, rel=1e-6)

    def test_of_a_log_that_lacks_cycles_the_step_is_that_of_a_cycle(self):
        cycles = np.array([0, 1, 5, 9, 13])
        clock = Clock(cycles * 10**6, None, None, cycles)
        zero = np.zeros((5, 2))
        recording = Recording.clocked(clock, {"hip": zero, "ihip": zero, "force": zero})
        assert recording.dt == pytest.approx(4e-3)
        assert nominal_step(recording) == pytest.approx(1e-3)

    def test_steps_are_one_number_where_the_clock_is_regular_to_its_stamps(self):
        regular, whole = plain(MS * np.arange(6.0)), Stretch(0, 6)
        assert steps(regular, whole) == 1e-3
        assert describe_clock(regular, (whole,)) == "regular, 1 ms"
        bent = np.array([0.0, 1.0, 2.0, 3.5, 4.5, 5.5]) * MS
        np.testing.assert_allclose(steps(plain(bent), whole), np.array([1.0, 1.0, 1.0, 1.5, 1.0, 1.0]) * MS)
        assert describe_clock(plain(bent), (whole,)).startswith("irregular, 1 to 1.5 ms (median 1 ms)")
        assert steps(plain(MS * np.arange(6.0) + 4e-10 * (np.arange(6) % 2)), whole) == 1e-3, "within a nanosecond"


@pytest.mark.parametrize("event", [Event(0.5, "x" * 40), Event(0.5, "x", "y" * 40), Event(-1.0, "ü", "é" * 9)])
def test_an_event_comes_back_whatever_of_it_is_long(tmp_path, event):
    write_recording(tmp_path / "a.h5", plain([0.0, 1.0], events=(Event(0.0, "z"), event)))
    assert set(read_recording(tmp_path / "a.h5").events) == {Event(0.0, "z"), event}


class TestMemory:
    def test_what_is_beyond_the_limit_is_refused_with_the_gigabytes_that_are_enough(self, refused):
        with limited(0.5):
            reserve(GIGABYTE // 2, "it")
            with pytest.raises(InputError) as caught:
                reserve(GIGABYTE // 2 + 1, "it")
            assert caught.value.what == "it would take 0.5 GB of memory"
            assert caught.value.todo.endswith("--memory-limit 0.6")
            with limited(9.0):
                reserve(5 * GIGABYTE, "it")
            with refused(InputError):
                reserve(GIGABYTE // 2 + 1, "it")
        reserve(2 * GIGABYTE, "it")
        with refused(InputError):
            reserve(2 * GIGABYTE + 1, "it")

    def test_a_format_is_told_by_the_first_bytes(self, refused, tmp_path):
        (tmp_path / "long").write_bytes(b"ab" * HEAD_BYTES)
        assert first_bytes(tmp_path / "long") == b"ab" * (HEAD_BYTES // 2)
        assert HEAD_BYTES == 65536
        (tmp_path / "empty").touch()
        with refused(InputError):
            first_bytes(tmp_path / "empty")
        assert first_bytes(tmp_path) == b"folder\nempty\nlong"
        with refused(InputError):
            first_bytes(tmp_path / "none")


def test_runs_are_apart_by_the_mean_square_and_the_worst_row(refused):
    hip = np.zeros((4, 2))
    one = Recording([0.0, 1.0, 2.0, 3.0], {"hip": hip, "ihip": hip, "force": hip})
    other_force = np.array([[3.0, 4.0], [0.0, 0.0], [0.0, 0.0]])
    other = Recording([1.0, 2.0, 5.0], {"hip": hip[:3], "ihip": hip[:3] + other_force / 1e3, "force": other_force})
    found = difference(other, one)
    assert (found.rows, found.contact) == (2, 0.5)
    assert (found.force.max, found.force.time, found.force.row) == (5.0, 1.0, 1)
    assert found.force.rms == pytest.approx(5.0 / np.sqrt(2.0))
    assert found.ihip.max == pytest.approx(5e-3)
    bare = Recording([1.0, 2.0], {"hip": hip[:2], "force": hip[:2]})
    assert (difference(bare, one).ihip, difference(bare, one).contact) == (None, None)
    with refused(InputError):
        difference(Recording([0.5], {"hip": hip[:1]}), one)


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [
        ("dt", [1e-9, 5, np.float64(1.0)], [0.0, -1.0, np.nan, np.inf, True, "1"]),
        ("standoff", [0.0, 1e-3], [-1e-9, np.inf, False]),
        ("force_resolution", [0, 0.1], [-0.1, None]),
        ("spring", ["error"], [1, None]),
        ("scene", [{}], [[], "x"]),
        ("when", ["2025-01-31T14:05:00+01:00"], ["soon", 2025, None]),
    ],
)
def test_metadata_is_of_its_kind(refused, key, good, bad):
    for value in good:
        assert check_metadata({key: value}) == {key: value}
    for value in bad:
        with refused(InputError):
            check_metadata({key: value})


@pytest.mark.parametrize(
    ("name", "signal"),
    [
        ("grip", None),
        ("grip", ("", "no unit")),
        ("grip", ("N", 3)),
        ("hip", ("mm", "hand", "world")),
        ("hip", ("m", "hand", "device")),
        ("2grip", ("N", "grip")),
        ("g" * 81, ("N", "grip")),
        ("grip", ("N", "grip", "moon")),
    ],
)
def test_a_channel_is_known_or_declared_soundly(refused, name, signal):
    with refused(InputError):
        declared(name, {} if signal is None else {name: signal})
    assert declared("hip", {}) is CHANNELS["hip"]
    assert declared("g" * 80, {"g" * 80: ("N", "grip")}) == Signal("N", "grip")
    turned = declared("force", {"force": ("N", "force", "world", "-F_h")})
    assert turned.sign == "-F_h"


class TestQuanta:
    @pytest.mark.parametrize("values", [[0.0, 1.0, 2.0], [0.0, 1.0, 1.0, 2.0, 2.0]])
    def test_three_different_numbers_are_on_no_lattice(self, values):
        assert numeric_step(np.array(values)) is None
        assert numeric_step(np.array([*values, np.nan, np.inf])) is None
        assert numeric_step(np.array([*values, 3.0])) == 1.0

    def test_a_quantum_is_the_largest_that_all_steps_are_multiples_of(self):
        assert numeric_step(np.array([0.0, 6.0, 16.0, 31.0])) == pytest.approx(1.0), "steps of 6, 10 and 15"
        assert numeric_step(np.array([-40.0, -28.0, 0.0, 20.0])) == pytest.approx(4.0), "of 12, 28 and 20"
        assert common_divisor(np.array([4.0, 6.0, 10.0]), 1e-3) == 2.0
        assert common_divisor(np.array([4.0, 6.0, 10.5]), 1e-3) == 0.5
        assert common_divisor(np.array([5.0]), 1e-3) == 5.0

    @pytest.mark.parametrize(("off", "quantum"), [(0.015, 1.0), (0.025, None)])
    def test_values_lie_on_a_lattice_within_a_fiftieth_of_its_step(self, off, quantum):
        """The remainder that is left is below what counts as a step, 1e-7 of the range."""
        values = np.concatenate([np.arange(20.0), [20.0 + off], np.arange(22.0, 40.0), [1e6]])
        step = numeric_step(values)
        assert step == (None if quantum is None else pytest.approx(quantum, rel=1e-3))

    @pytest.mark.parametrize(("copies", "quantum"), [(49, 1.0), (51, None)])
    def test_a_lattice_has_no_more_than_fifty_numbers_in_a_step(self, copies, quantum):
        """Three steps, and around each point so many numbers that only rounding tells apart."""
        points = np.repeat(np.arange(4.0), [copies * 3 - 3, 1, 1, 1])
        values = points + 1e-9 * np.arange(points.size)
        step = numeric_step(values)
        assert step == (None if quantum is None else pytest.approx(1.0, rel=1e-3))

    def test_zeros_and_gaps_say_nothing_of_how_many_digits_a_column_has(self):
        single = np.float32(np.linspace(1.0, 3.0, 60)).astype(float)
        padded = np.concatenate([np.zeros(500), single, [np.nan]])
        assert single_precision_step(padded) == single_precision_step(single) == np.spacing(np.float32(3.0))
        assert single_precision_step(np.zeros(9)) == 0.0
        assert single_precision_step(single[:49]) == 0.0, "of so few nothing is said"
        assert single_precision_step(single[:50]) > 0.0

    @pytest.mark.parametrize(("digits", "step"), [(3, 1e-2), (5, 1e-4)])
    def test_numbers_of_a_text_are_known_to_the_last_digit_of_the_largest(self, digits, step):
        values = np.unique([float(f"{number:.{digits - 1}e}") for number in np.linspace(1.0, 9.87654321, 300)])
        assert decimal_step(values) == pytest.approx(step)
        assert decimal_step(np.sqrt(values)) == 0.0

    def test_the_coarsest_of_several_columns_counts_and_of_none_there_is_none(self):
        columns = np.column_stack([0.5 * np.arange(60.0), 0.25 * np.arange(60.0)])
        assert coarsest(columns) == pytest.approx(0.5)
        assert coarsest(np.zeros((5, 0))) == 0.0


@pytest.mark.parametrize(
    ("time", "valid", "told"),
    [
        ([0.0, 1.0, 1.0, 2.0], None, "at row 2: 1 s, then 1 s"),
        ([0.0, 1.0, 2.0, 1.5], None, "at row 3: 2 s, then 1.5 s"),
        ([0.0, 9.0, 1.0, 0.5], [True, False, True, True], "at row 3: 1 s, then 0.5 s"),
    ],
)
def test_the_first_sound_row_that_does_not_increase_is_named_with_the_one_before(time, valid, told):
    with pytest.raises(InputError) as caught:
        check_increasing("time", np.array(time), None if valid is None else np.array(valid))
    assert caught.value.what == f"time does not increase {told}"
    check_increasing("time", np.array([0.0, 9.0, 1.0]), np.array([True, False, True]))


@pytest.mark.parametrize(
    ("values", "valid", "row"),
    [
        ([[0.0, 1.0], [2.0, np.nan], [np.inf, 0.0]], None, 1),
        ([[0.0, 1.0], [2.0, np.nan], [np.inf, 0.0]], [True, False, True], 2),
        ([0.0, 1.0, -np.inf], [False, True, True], 2),
    ],
)
def test_the_first_sound_row_that_is_not_finite_is_named(values, valid, row):
    mask = None if valid is None else np.array(valid)
    with pytest.raises(InputError, match=f"^hip is not finite at row {row}: "):
        check_finite("hip", np.array(values), mask)
    check_finite("hip", np.array(values), np.arange(3) < 1)
    check_finite("hip", np.zeros((3, 2)))
