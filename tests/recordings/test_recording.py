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


def test_what_a_recording_has_beside_channels_and_meta_is_given_by_name():
    with pytest.raises(TypeError, match="positional"):
        Recording(ROWS, channels(), {}, {})


@pytest.mark.parametrize(
    "changes",
    [
        {"time": [0.0, 1.0, 1.0, 2.0]},
        {"time": [0.0, np.nan, 1.0, 2.0]},
        {"time": np.zeros((4, 2))},
        {"time": []},
        {"force": np.full((4, 2), np.inf)},
        {"force": np.zeros((4, 3))},
        {"force": np.zeros((3, 2))},
        {"force": np.zeros((4, 1))},
        dict.fromkeys(REQUIRED, np.zeros((4, 4))),
        {"torque": np.zeros((4, 2))},
        {"joint_position": np.zeros((4, 6)), "joint_torque": np.zeros((4, 5))},
        {"joint_position": np.zeros(4)},
        {"grip": np.zeros((4, 1, 1)), "signals": {"grip": Signal("N", "")}},
        {"signals": {"grip": Signal("N", "grip force")}},
        {"signals": {"force": Signal("mN", "force", "world")}},
        {"signals": {"force": Signal("N", "force", "device")}},
        {**GRIP, "signals": {"grip": Signal("N", "", "tool")}},
        {**GRIP, "signals": {"grip": Signal("", "?")}},
        {"a/b": np.zeros(4), "signals": {"a/b": Signal("1", "")}},
        {"hip": GAP, "valid": np.array([1, 1, 0, 1], bool)},
        {"time": [0.0, 3.0, 1.0, 2.0], "valid": np.array([1, 1, 0, 1], bool)},
        {"valid": np.array([1, 1, 0], bool)},
        {"valid": np.array([1, 1, 0, 1])},
        {"clock": (ROWS,)},
        {"clock": (STAMPS[:0],)},
        {"clock": (np.array([2**63], dtype=np.uint64),)},
        {"clock": (STAMPS, None, None, STAMPS[:3])},
        {"clock": ([0, 5, 5, 6],)},
        {"clock": (STAMPS, None, None, [0, 2, 1, 3])},
        {"clock": (10**17 + STAMPS, 0)},  # doubles there lie 15 ns apart
        *({"events": [event]} for event in
          [(np.nan, "touch"), (0.0, ""), (0.0, "a\0"), ("1", "touch"), (0.0, "touch", None)]),
        *({"meta": {key: value}} for key, value in
          [("dt", 0.0), ("dt", "1 ms"), ("standoff", -1.0), ("standoff", True), ("when", "yesterday"), ("who", 7),
           ("gains", [1000.0]), ("resolution", np.inf)]),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_by_row_and_channel(refused, changes):
    with refused(InputError):
        make_recording(**changes)


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


def test_hardware_may_lack_channels_until_they_are_asked_for(refused):
    given = channels()
    del given["ihip"]
    recording = Recording(ROWS, given)
    recording.require("hip", "force")
    for ask in (lambda: recording.ihip, lambda: recording.require(*REQUIRED)):
        with refused(MissingChannelError) as caught:
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


def test_time_is_that_of_the_clock_and_nothing_re_times_it(refused):
    recording = Recording.clocked(CLOCK, channels())
    assert recording.time.tolist() == [0.0, 0.001, 0.002, 0.003]
    assert recording.nanoseconds.tolist() == [10**15 + k * 10**6 for k in range(4)]
    assert recording.clock.missed == 2
    with refused(InputError):
        Recording(ROWS, channels(), clock=CLOCK)
    assert make_recording(clock=(np.array([5, 7, 9, 12]) * 10**9, 0)).time.tolist() == [5.0, 7.0, 9.0, 12.0]
    assert make_recording(np.array([0.0, 1e-9, 0.5, 1.0])).nanoseconds.tolist() == [0, 1, 500_000_000, 10**9]


def test_rows_that_are_no_measurement_are_kept_as_they_came_and_never_judged(refused):
    hip = np.arange(12.0).reshape(6, 2)
    hip[2] = np.nan
    valid = np.array([1, 1, 0, 1, 0, 1], bool)
    recording = Recording([0.0, 1.0, 2.0, 2.0, 1.5, 3.0], {"hip": hip, "ihip": hip, "force": 0.0 * hip}, valid=valid)
    assert np.isnan(recording.hip[2]).all()
    assert recording.sound_rows() == (slice(0, 2), slice(3, 4), slice(5, 6))
    assert recording.contact.tolist() == [False] * 6
    assert recording.dt == 1.0
    with refused(InputError):
        _ = recording.velocity
    with refused(InputError):
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


def test_parts_share_the_time_base_and_split_the_events(refused):
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
        with refused(InputError):
            recording.part(rows)
