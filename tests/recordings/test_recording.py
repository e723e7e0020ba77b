"""The recording: what it refuses, what follows from its channels, and that it cannot be changed."""

import pickle

import numpy as np
import pytest

from hapticeval.errors import InputError
from hapticeval.phenomena.check import Runs
from hapticeval.recordings.channels import CHANNELS, REQUIRED, Signal
from hapticeval.recordings.recording import Clock, Event, MissingChannelError, Recording

ROWS = np.arange(4.0)
CLOCK = Clock(10**15 + 1_000_000 * np.arange(4), anchor=(10**15, 1_700_000_000 * 10**9), sequence=[0, 1, 4, 5])


def channels(**more):
    return {**{name: np.zeros((4, 2)) for name in ("hip", "ihip", "force")}, **more}


def make_recording(time=ROWS, *, clock=None, valid=None, signals=None, events=(), meta=None, **more):
    """A recording with some of its channels changed; of a clock (stamps, and more of it) where one is given."""
    given = {"valid": valid, "signals": signals or {}, "events": tuple(events)}
    if clock is not None:
        return Recording.clocked(Clock(*clock), channels(**more), meta, **given)
    return Recording(time, channels(**more), meta or {}, **given)


GRIP = {"grip": np.zeros(4)}
STAMPS = np.arange(4)
GAP = np.column_stack([[0.0, np.nan, 1.0, 2.0]] * 2)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"time": [0.0, 1.0, 1.0, 2.0]}, "time does not increase at row 2: 1 s, then 1 s"),
        ({"time": [0.0, np.nan, 1.0, 2.0]}, "not finite at row 1"),
        ({"time": np.zeros((4, 2))}, "time base of shape"),
        ({"time": []}, "time base of shape"),
        ({"force": np.full((4, 2), np.inf)}, "force is not finite at row 0"),
        ({"force": np.zeros((4, 3))}, "has shape"),
        ({"force": np.zeros((3, 2))}, "has shape"),
        ({"force": np.zeros((4, 1))}, "one column per dimension, as 'hip' has"),
        (dict.fromkeys(REQUIRED, np.zeros((4, 4))), "4 dimensions"),
        ({"torque": np.zeros((4, 2))}, "does not know the channel 'torque'"),
        ({"joint_position": np.zeros((4, 6)), "joint_torque": np.zeros((4, 5))}, "'joint_torque' has shape"),
        ({"joint_position": np.zeros(4)}, "'joint_position' has shape"),
        ({"grip": np.zeros((4, 1, 1)), "signals": {"grip": Signal("N", "")}}, "'grip' has shape"),
        ({"signals": {"grip": Signal("N", "grip force")}}, "'grip' is declared, but there is no such channel"),
        ({"signals": {"force": Signal("mN", "force", "world")}}, "'force' is declared in mN"),
        ({"signals": {"force": Signal("N", "force", "device")}}, "'force' is declared in N, frame device"),
        ({**GRIP, "signals": {"grip": Signal("N", "", "tool")}}, "in the frame 'tool'"),
        ({**GRIP, "signals": {"grip": Signal("", "?")}}, "give it a unit"),
        ({"a/b": np.zeros(4), "signals": {"a/b": Signal("1", "")}}, "cannot name a channel"),
        ({"hip": GAP, "valid": np.array([1, 1, 0, 1], bool)}, "hip is not finite at row 1"),
        ({"time": [0.0, 3.0, 1.0, 2.0], "valid": np.array([1, 1, 0, 1], bool)}, "increase at row 3: 3 s, then 2 s"),
        ({"valid": np.array([1, 1, 0], bool)}, "for each of 4 rows"),
        ({"valid": np.array([1, 1, 0, 1])}, "valid is of type int64"),
        ({"clock": (ROWS,)}, "stamps of a clock are of type float64"),
        ({"clock": (STAMPS[:0],)}, "stamps of shape"),
        ({"clock": (np.array([2**63], dtype=np.uint64),)}, "do not fit"),
        ({"clock": (STAMPS, None, None, STAMPS[:3])}, "3 sequence numbers for 4 stamps"),
        ({"clock": ([0, 5, 5, 6],)}, "the clock does not increase at row 2: 5 ns, then 5 ns"),
        ({"clock": (STAMPS, None, None, [0, 2, 1, 3])}, "the sequence number does not increase at row 2: 2, then 1"),
        ({"clock": (10**17 + STAMPS, 0)}, "time does not increase at row 1"),  # doubles there lie 15 ns apart
        *(({"events": [event]}, "an event") for event in
          [(np.nan, "touch"), (0.0, ""), (0.0, "a\0"), ("1", "touch"), (0.0, "touch", None)]),
        *(({"meta": {key: value}}, f"meta: {key} = ") for key, value in
          [("dt", 0.0), ("dt", "1 ms"), ("standoff", -1.0), ("standoff", True), ("when", "yesterday"), ("who", 7),
           ("gains", [1000.0]), ("resolution", np.inf)]),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_by_row_and_channel(changes, words):
    with pytest.raises(InputError) as caught:
        make_recording(**changes)
    assert words in str(caught.value)


def test_arrays_are_read_only_and_copies_where_someone_may_write():
    open_below, mine = np.zeros((4, 2)), np.zeros((4, 2))
    view = open_below[:]
    view.flags.writeable = mine.flags.writeable = False
    recording = make_recording(hip=open_below, ihip=view, force=mine)
    open_below[0] = 1.0
    assert recording.hip[0, 0] == recording.ihip[0, 0] == 0.0
    assert recording.force is mine
    with pytest.raises(ValueError, match="read-only"):
        recording.hip[0] = 2.0
    with pytest.raises(ValueError, match="read-only"):
        CLOCK.nanoseconds[0] = 1
    gains = {"stiffness": 1000.0, "steps": [1, 2]}
    recording = make_recording(meta={"gains": gains, "when": "2025-01-31T14:05:00+01:00", "mine": 1})
    gains["steps"].append(3)
    assert recording.meta["gains"] == {"stiffness": 1000.0, "steps": [1, 2]}


def test_hardware_may_lack_channels_until_they_are_asked_for():
    given = channels()
    del given["ihip"]
    recording = Recording(ROWS, given)
    recording.require("hip", "force")
    for ask in (lambda: recording.ihip, lambda: recording.require(*REQUIRED)):
        with pytest.raises(MissingChannelError, match="lacks the channel 'ihip'") as caught:
            ask()
        assert (caught.value.channel, caught.value.why) == ("ihip", "it has: hip, force")


def test_contact_and_velocity_are_made_of_what_was_recorded():
    given = channels()
    given["hip"][:, 0] = given["ihip"][:, 0] = [0.0, 1.0, 3.0, 3.0]
    given["ihip"][1, 0] += 1e-5
    given["force"][2, 1] = 1e-9
    recording = Recording([0.0, 1.0, 2.0, 4.0], given)
    assert recording.contact.tolist() == [False, True, True, False]
    assert recording.velocity[:, 0].tolist() == [0.0, 1.0, 2.0, 0.0]


def test_time_is_that_of_the_clock_and_nothing_re_times_it():
    recording = Recording.clocked(CLOCK, channels())
    assert recording.time.tolist() == [0.0, 0.001, 0.002, 0.003]
    assert recording.nanoseconds.tolist() == [10**15 + k * 10**6 for k in range(4)]
    assert recording.clock.missed == 2
    with pytest.raises(InputError, match="time and its clock differ"):
        Recording(ROWS, channels(), clock=CLOCK)
    assert make_recording(clock=(np.array([5, 7, 9, 12]) * 10**9, 0)).time.tolist() == [5.0, 7.0, 9.0, 12.0]
    assert make_recording(np.array([0.0, 1e-9, 0.5, 1.0])).nanoseconds.tolist() == [0, 1, 500_000_000, 10**9]


def test_rows_that_are_no_measurement_are_kept_as_they_came_and_never_judged():
    hip = np.arange(12.0).reshape(6, 2)
    hip[2] = np.nan
    valid = np.array([1, 1, 0, 1, 0, 1], bool)
    recording = Recording([0.0, 1.0, 2.0, 2.0, 1.5, 3.0], {"hip": hip, "ihip": hip, "force": 0.0 * hip}, valid=valid)
    assert np.isnan(recording.hip[2]).all()
    assert recording.sound_rows() == (slice(0, 2), slice(3, 4), slice(5, 6))
    assert recording.contact.tolist() == [False] * 6
    assert recording.dt == 1.0
    with pytest.raises(InputError, match="gaps has no velocity"):
        _ = recording.velocity
    with pytest.raises(InputError, match="gaps cannot be judged"):
        Runs(recording)
    first = recording.part(recording.sound_rows()[0])
    assert first.valid is None
    assert Runs(first).base.velocity.tolist() == [[0.0, 0.0], [2.0, 2.0]]


def test_joints_scalars_and_one_degree_of_freedom_survive_the_way_between_processes():
    given = {"hip": np.zeros((4, 1)), "force": np.zeros((4, 1)), "joint_position": np.zeros((4, 6)), "pressure": ROWS}
    stated = {"pressure": Signal("1", "pen pressure"), "force": CHANNELS["force"]._replace(sign="-F_h; turned")}
    recording = Recording(ROWS, given, {"dt": 1.0}, signals=stated)
    assert (recording.dimension, recording.signals["joint_position"].frame) == (1, "joint")
    again = pickle.loads(pickle.dumps(recording))
    assert (again.signals, dict(again.meta)) == (recording.signals, {"dt": 1.0})
    assert again.signals["force"] == stated["force"]
    assert again.part(slice(1, 3)).channels["pressure"].tolist() == again.time[1:3].tolist() == [1.0, 2.0]


def test_parts_share_the_time_base_and_split_the_events():
    events = [Event(-0.5, "start"), Event(1.0, "touch", "wall"), Event(2.0, "leave"), Event(9.0, "closed")]
    recording = make_recording(events=events)
    parts = [recording.part(slice(0, 2)), recording.part(slice(2, 4))]
    assert [[event.kind for event in part.events] for part in parts] == [["start", "touch"], ["leave", "closed"]]
    assert parts[1].time.tolist() == [2.0, 3.0]
    clocked = pickle.loads(pickle.dumps(Recording.clocked(CLOCK, channels()))).part(slice(2, None))
    assert clocked.time.tolist() == [0.002, 0.003]
    assert clocked.clock.sequence.tolist() == [4, 5]
    assert clocked.clock.anchor == CLOCK.anchor
    for rows in (slice(3, 3), slice(0, 4, 2), slice(9, 10)):
        with pytest.raises(InputError, match="no rows"):
            recording.part(rows)
