"""The recording: what it refuses, and that it cannot be changed."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from hapticeval.errors import InputError
from hapticeval.phenomena.check import Runs
from hapticeval.recordings.recording import CHANNELS, REQUIRED, Clock, Event, MissingChannelError, Recording, Signal


def channels():
    return {name: np.zeros((4, 2)) for name in ("hip", "ihip", "force")}


def test_arrays_are_copies_and_read_only():
    hip = np.zeros((4, 2))
    recording = Recording(np.arange(4.0), {**channels(), "hip": hip})
    hip[0] = 1.0
    assert recording.hip[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        recording.hip[0] = 2.0


def test_survives_the_way_between_processes():
    recording = Recording(np.arange(4.0), channels(), {"dt": 1.0})
    again = pickle.loads(pickle.dumps(recording))
    np.testing.assert_array_equal(again.hip, recording.hip)
    assert dict(again.meta) == {"dt": 1.0}


@pytest.mark.parametrize(
    ("time", "changed", "message"),
    [
        (np.array([0.0, 1.0, 1.0, 2.0]), {}, "does not increase at row 2"),
        (np.array([0.0, 1.0, 0.5, 2.0]), {}, "does not increase at row 2"),
        (np.array([0.0, np.nan, 1.0, 2.0]), {}, "not finite at row 1"),
        (np.zeros((4, 2)), {}, "time base of shape"),
        (np.array([]), {}, "time base of shape"),
        (np.arange(4.0), {"force": np.full((4, 2), np.inf)}, "force is not finite at row 0"),
        (np.arange(4.0), {"force": np.zeros((4, 3))}, "has shape"),
        (np.arange(4.0), {"force": np.zeros((3, 2))}, "has shape"),
        (np.arange(4.0), dict.fromkeys(("hip", "ihip", "force"), np.zeros((4, 4))), "4 dimensions"),
        (np.arange(4.0), {"torque": np.zeros((4, 2))}, "does not know the channel 'torque'"),
    ],
)
def test_bad_recordings_are_refused_by_row_and_channel(time, changed, message):
    with pytest.raises(InputError, match=message):
        Recording(time, {**channels(), **changed})


def test_hardware_may_lack_channels_and_says_so_when_asked_for_them():
    given = channels()
    del given["ihip"]
    recording = Recording(np.arange(4.0), given)
    recording.require("hip", "force")
    for ask in (lambda: recording.ihip, lambda: recording.require(*REQUIRED)):
        with pytest.raises(MissingChannelError, match="lacks the channel 'ihip'") as caught:
            ask()
        assert caught.value.channel == "ihip"
        assert caught.value.why == "it has: hip, force"


def test_contact_and_velocity_are_made_of_what_was_recorded():
    given = channels()
    given["hip"][:, 0] = given["ihip"][:, 0] = [0.0, 1.0, 3.0, 3.0]
    given["ihip"][1, 0] += 1e-5
    given["force"][2, 1] = 1e-9
    recording = Recording(np.array([0.0, 1.0, 2.0, 4.0]), given)
    assert recording.contact.tolist() == [False, True, True, False]
    assert recording.velocity[:, 0].tolist() == [0.0, 1.0, 2.0, 0.0]


CLOCK = Clock(10**15 + 1_000_000 * np.arange(4), anchor=(10**15, 1_700_000_000 * 10**9), sequence=[0, 1, 4, 5])


def test_time_is_what_the_clock_says_and_nothing_re_times_it():
    recording = Recording.clocked(CLOCK, channels())
    assert recording.time.tolist() == [0.0, 0.001, 0.002, 0.003]
    assert recording.nanoseconds.tolist() == [10**15 + k * 10**6 for k in range(4)]
    assert recording.clock.missed == 2
    with pytest.raises(InputError, match="time and its clock differ"):
        Recording(np.arange(4.0), channels(), clock=CLOCK)
    with pytest.raises(ValueError, match="read-only"):
        CLOCK.nanoseconds[0] = 1
    started = Recording.clocked(Clock(np.array([5, 7, 9, 12]) * 10**9, start=0), channels())
    assert started.time.tolist() == [5.0, 7.0, 9.0, 12.0]
    assert Recording(np.array([0.0, 1e-9, 0.5, 1.0]), channels()).nanoseconds.tolist() == [0, 1, 500_000_000, 10**9]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Clock(np.array([0.0, 1.0])), "stamps of a clock are of type float64"),
        (lambda: Clock(np.array([], dtype=np.int64)), "stamps of shape"),
        (lambda: Clock(np.arange(4), sequence=np.arange(3)), "3 sequence numbers for 4 stamps"),
        (lambda: Clock(np.array([2**63], dtype=np.uint64)), "do not fit"),
        (
            lambda: Recording.clocked(Clock([0, 5, 5, 6]), channels()),
            "the clock does not increase at row 2: 5 ns, then 5 ns",
        ),
        # doubles around 10^8 s lie 15 ns apart
        (
            lambda: Recording.clocked(Clock(10**17 + np.arange(4), start=0), channels()),
            "time does not increase at row 1",
        ),
        (
            lambda: Recording.clocked(Clock(np.arange(4), sequence=[0, 2, 1, 3]), channels()),
            "the sequence number does not increase at row 2: 2, then 1",
        ),
    ],
)
def test_bad_clocks_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def gapped(**changes):
    hip = np.arange(12.0).reshape(6, 2)
    hip[2] = np.nan
    time = np.array([0.0, 1.0, 2.0, 2.0, 1.5, 3.0])
    given = {"hip": hip, "ihip": hip, "force": 0.0 * hip}
    return Recording(time, given, valid=np.array([1, 1, 0, 1, 0, 1], bool), **changes)


def test_rows_that_are_no_measurement_are_kept_as_they_came_and_never_judged():
    recording = gapped()
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


@pytest.mark.parametrize(
    ("valid", "message"),
    [
        (np.array([1, 1, 1, 0, 0, 1], bool), "hip is not finite at row 2"),
        (np.array([1, 1, 0, 1, 1, 1], bool), "time does not increase at row 4: 2 s, then 1.5 s"),
        (np.array([1, 1, 0, 1, 0], bool), "for each of 6 rows"),
        (np.array([1, 1, 0, 1, 0, 1]), "valid is of type int64"),
    ],
)
def test_gaps_excuse_their_own_rows_alone(valid, message):
    base = gapped()
    with pytest.raises(InputError, match=message):
        Recording(base.time, base.channels, valid=valid)


def test_joints_scalars_and_one_degree_of_freedom():
    given = {
        "hip": np.zeros((4, 1)),
        "force": np.zeros((4, 1)),
        "joint_position": np.zeros((4, 6)),
        "joint_torque": np.zeros((4, 6)),
        "pressure": np.zeros(4),
        "adc": np.zeros((4, 7)),
    }
    signals = {"pressure": Signal("1", "pen pressure"), "adc": Signal("V", "analogue inputs", "device")}
    recording = Recording(np.arange(4.0), given, signals=signals)
    assert recording.dimension == 1
    assert recording.channels["pressure"].shape == (4,)
    assert recording.signals["joint_position"].frame == "joint"
    assert recording.signals["adc"].unit == "V"
    stated = CHANNELS["force"]._replace(sign="the source gives -F_h; turned")
    assert Recording(np.arange(4.0), given, signals={**signals, "force": stated}).signals["force"] == stated
    part = pickle.loads(pickle.dumps(recording)).part(slice(1, 3))
    assert part.signals == recording.signals
    assert part.time.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("changed", "signals", "message"),
    [
        ({"joint_position": np.zeros((4, 6)), "joint_torque": np.zeros((4, 5))}, {}, "'joint_torque' has shape"),
        ({"joint_position": np.zeros(4)}, {}, "'joint_position' has shape"),
        ({"force": np.zeros((4, 1))}, {}, "one column per dimension, as 'hip' has"),
        ({"grip": np.zeros((4, 1, 1))}, {"grip": Signal("N", "")}, "'grip' has shape"),
        ({}, {"grip": Signal("N", "grip force")}, "'grip' is declared, but there is no such channel"),
        ({}, {"force": Signal("mN", "force", "world")}, "'force' is declared in mN"),
        ({}, {"force": Signal("N", "force", "device")}, "'force' is declared in N, frame device"),
        ({"grip": np.zeros(4)}, {"grip": Signal("N", "", "tool")}, "in the frame 'tool'"),
        ({"grip": np.zeros(4)}, {"grip": Signal("", "?")}, "give it a unit"),
        ({"a/b": np.zeros(4)}, {"a/b": Signal("1", "")}, "cannot name a channel"),
    ],
)
def test_channels_and_what_is_said_of_them_must_fit(changed, signals, message):
    with pytest.raises(InputError) as caught:
        Recording(np.arange(4.0), {**channels(), **changed}, signals=signals)
    assert message in str(caught.value)


def test_parts_share_the_time_base_and_split_the_events():
    events = [Event(-0.5, "start"), Event(1.0, "touch", "wall"), Event(2.0, "leave"), Event(9.0, "closed")]
    recording = Recording(np.arange(4.0), channels(), events=events)
    parts = [recording.part(slice(0, 2)), recording.part(slice(2, 4))]
    assert [[event.kind for event in part.events] for part in parts] == [["start", "touch"], ["leave", "closed"]]
    assert parts[1].time.tolist() == [2.0, 3.0]
    clocked = Recording.clocked(CLOCK, channels()).part(slice(2, None))
    assert clocked.time.tolist() == [0.002, 0.003]
    assert clocked.clock.sequence.tolist() == [4, 5]
    assert clocked.clock.anchor == CLOCK.anchor
    for rows in (slice(3, 3), slice(0, 4, 2), slice(9, 10)):
        with pytest.raises(InputError, match="no rows"):
            recording.part(rows)


@pytest.mark.parametrize("event", [(np.nan, "touch"), (0.0, ""), (0.0, "a\0"), ("1", "touch"), (0.0, "touch", None)])
def test_events_without_time_or_kind_are_refused(event):
    with pytest.raises(InputError, match="an event"):
        Recording(np.arange(4.0), channels(), events=(event,))


def test_meta_is_copied_and_what_has_a_meaning_is_checked():
    gains = {"stiffness": 1000.0, "steps": [1, 2]}
    recording = Recording(np.arange(4.0), channels(), {"gains": gains, "when": "2025-01-31T14:05:00+01:00", "mine": 1})
    gains["steps"].append(3)
    assert recording.meta["gains"] == {"stiffness": 1000.0, "steps": [1, 2]}
    for key, value in (
        ("dt", 0.0),
        ("dt", "1 ms"),
        ("standoff", -1.0),
        ("standoff", True),
        ("when", "yesterday"),
        ("who", 7),
        ("gains", [1000.0]),
        ("resolution", np.inf),
    ):
        with pytest.raises(InputError, match=f"meta: {key} = "):
            Recording(np.arange(4.0), channels(), {key: value})


def test_arrays_that_are_locked_already_are_not_copied():
    hip = np.zeros((4, 2))
    hip.flags.writeable = False
    assert Recording(np.arange(4.0), {"hip": hip}).hip is hip
    open_below = np.zeros((4, 2))
    view = open_below[:]
    view.flags.writeable = False
    recording = Recording(np.arange(4.0), {"hip": view})
    open_below[0] = 1.0
    assert recording.hip[0, 0] == 0.0
