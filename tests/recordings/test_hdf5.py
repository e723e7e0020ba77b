import json

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.hdf5 import read_recording, write_recording
from hapticeval.recordings.recording import CHANNELS, Recording

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | FINITE | st.text(),
    lambda children: st.lists(children, max_size=3) | st.dictionaries(st.text(), children, max_size=3),
    max_leaves=6,
)


@st.composite
def recordings(draw):
    rows, dimension = draw(st.integers(1, 40)), draw(st.sampled_from([2, 3]))
    names = ["hip", "ihip", "force", *draw(st.sets(st.sampled_from(["velocity", "operator_force"])))]
    start, step = draw(st.floats(-1e6, 1e6)), draw(st.floats(1e-3, 10.0))
    channels = {name: draw(hnp.arrays(np.float64, (rows, dimension), elements=FINITE)) for name in names}
    meta = draw(st.dictionaries(st.text(), PLAIN, max_size=4))
    return Recording(start + step * np.arange(rows), channels, meta)


def small():
    rows = np.arange(12.0)
    points = np.column_stack([np.sin(rows), np.cos(rows)])
    channels = {"hip": points, "ihip": points * 1.5, "force": -points}
    return Recording(rows * 1e-3, channels, {"renderer": "constraint", "dt": 1e-3, "name": "Größe"})


def assert_same(one, other):
    assert one.time.tobytes() == other.time.tobytes()
    assert set(one.channels) == set(other.channels)
    for name in one.channels:
        assert one.channels[name].tobytes() == other.channels[name].tobytes()
    assert dict(one.meta) == dict(other.meta)


@settings(max_examples=40, deadline=None)
@given(recording=recordings())
def test_reads_back_bit_for_bit(tmp_path_factory, recording):
    path = tmp_path_factory.mktemp("run") / "deep" / "run.h5"
    write_recording(path, recording)
    assert_same(read_recording(path), recording)
    assert [file.name for file in path.parent.iterdir()] == ["run.h5"]


def test_the_same_recording_gives_the_same_bytes(tmp_path):
    write_recording(tmp_path / "a.h5", small())
    write_recording(tmp_path / "b.h5", small())
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_a_long_recording_spans_chunks_and_is_compressed(tmp_path):
    time = np.arange(20_000) * 1e-3
    points = np.column_stack([np.cos(time), np.sin(time)])
    recording = Recording(time, {"hip": points, "ihip": points, "force": 0.0 * points})
    write_recording(tmp_path / "run.h5", recording)
    assert_same(read_recording(tmp_path / "run.h5"), recording)
    assert (tmp_path / "run.h5").stat().st_size < 0.7 * 7 * 8 * time.size


def test_other_programs_find_units_and_meaning(tmp_path):
    write_recording(tmp_path / "run.h5", small())
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["format_version"] == 2
        assert file["time"].attrs["unit"] == b"s"
        for name in ("hip", "ihip", "force"):
            dataset = file["channels"][name]
            assert dataset.attrs["unit"].decode() == CHANNELS[name].unit
            assert dataset.attrs["meaning"].decode() == CHANNELS[name].meaning
            assert dataset.attrs["frame"] == b"world"
            assert dataset.fletcher32
            assert dataset.shuffle
            assert dataset.compression == "gzip"
        assert json.loads(bytes(file["meta"][:]))["renderer"] == "constraint"


def test_no_flipped_byte_is_read_as_a_run(tmp_path):
    path, damaged = tmp_path / "run.h5", tmp_path / "damaged.h5"
    write_recording(path, small())
    good = path.read_bytes()
    found = 0
    for place in range(0, len(good), 7):
        damaged.write_bytes(good[:place] + bytes([good[place] ^ 0x10]) + good[place + 1 :])
        try:
            assert_same(read_recording(damaged), small())
        except InputError:
            found += 1
    assert found > 100


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.7, 0.99])
def test_a_file_cut_short_is_said_to_be(tmp_path, share):
    path = tmp_path / "run.h5"
    write_recording(path, small())
    good = path.read_bytes()
    path.write_bytes(good[: int(share * len(good))])
    with pytest.raises(InputError, match=r"cut short|not an HDF5|empty"):
        read_recording(path)


def test_each_wrong_file_is_named_for_what_it_is(tmp_path):
    with pytest.raises(InputError, match=r"cannot read.*gone\.h5"):
        read_recording(tmp_path / "gone.h5")
    (tmp_path / "text.h5").write_text("time,x,y\n0,1,2\n")
    with pytest.raises(InputError, match="not an HDF5 file"):
        read_recording(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["pressure"] = [1.0, 2.0]
    with pytest.raises(InputError, match="not a hapticeval recording") as caught:
        read_recording(tmp_path / "other.h5")
    assert "pressure" in caught.value.why
    write_recording(tmp_path / "newer.h5", small())
    with h5py.File(tmp_path / "newer.h5", "r+") as file:
        file.attrs["format_version"] = 3
    with pytest.raises(InputError, match=r"format 3.*reads format 2") as caught:
        read_recording(tmp_path / "newer.h5")
    assert caught.value.todo == "update hapticeval"


def test_wrong_units_and_lengths_are_refused(tmp_path):
    path = tmp_path / "run.h5"
    write_recording(path, small())
    with h5py.File(path, "r+") as file:
        file["channels/hip"].attrs["unit"] = "mm"
    with pytest.raises(InputError, match=r"'hip' is in 'mm', not in 'm'"):
        read_recording(path)
    write_recording(path, small(), replace=True)
    with h5py.File(path, "r+") as file:
        del file["channels/force"]
        file["channels/force"] = np.zeros((11, 2))
        file["channels/force"].attrs["unit"] = "N"
    with pytest.raises(InputError, match="damaged") as caught:
        read_recording(path)
    assert "'force' has 11 rows of 12" in caught.value.why


def test_meta_that_json_cannot_hold_is_refused_and_leaves_nothing(tmp_path):
    base = small()
    for meta in ({"bound": float("inf")}, {"model": object()}):
        with pytest.raises(InputError, match="meta"):
            write_recording(tmp_path / "run.h5", Recording(base.time, base.channels, meta))
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    write_recording(path, small())

    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(h5py.Group, "create_dataset", full)
    with pytest.raises(HapticevalError, match="cannot write"):
        write_recording(path, small(), replace=True)
    monkeypatch.undo()
    assert_same(read_recording(path), small())
    assert [file.name for file in tmp_path.iterdir()] == ["run.h5"]
