"""The recording: what it refuses, and that it cannot be changed."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from hapticeval.errors import InputError
from hapticeval.recordings.recording import REQUIRED, MissingChannelError, Recording


def channels(n=4, dimension=2):
    return {name: np.zeros((n, dimension)) for name in ("hip", "ihip", "force")}


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
    for ask in (lambda: recording.ihip, lambda: recording.contact, lambda: recording.require(*REQUIRED)):
        with pytest.raises(MissingChannelError, match="lacks the channel 'ihip'") as caught:
            ask()
        assert caught.value.channel == "ihip"
        assert caught.value.why == "it has: hip, force"


def test_contact_is_force_or_a_distance_between_hip_and_ihip():
    given = channels()
    given["ihip"][1, 0] = 1e-9
    given["force"][2, 1] = 1e-9
    assert Recording(np.arange(4.0), given).contact.tolist() == [False, True, True, False]


def test_velocity_is_differenced_where_it_was_not_recorded():
    given = channels()
    given["hip"][:, 0] = [0.0, 1.0, 3.0, 3.0]
    recording = Recording(np.array([0.0, 1.0, 2.0, 4.0]), given)
    assert recording.velocity[:, 0].tolist() == [0.0, 1.0, 2.0, 0.0]
