"""Format 2: everything a real run brings, parts of a file, files of format 1, and what is whole of a damaged one."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.recordings import hdf5
from hapticeval.recordings.hdf5 import read_recording, write_recording
from hapticeval.recordings.recording import Clock, Event, Recording, Signal
from hapticeval.recordings.salvage import salvage

BLOCK = 16
EXTRA = tuple(f"adc{k}" for k in range(7))


@pytest.fixture(autouse=True)
def _short_blocks(monkeypatch):
    monkeypatch.setattr(hdf5, "ROWS_A_CHUNK", BLOCK)


def real(rows=60):
    """A run with a clock, gaps, joints, scalars, events, and more channels than a group holds in one piece."""
    rng = np.random.default_rng(7)
    channels = {name: rng.normal(size=(rows, 2)) for name in ("hip", "ihip", "force")}
    channels["joint_position"] = rng.normal(size=(rows, 3))
    channels |= {name: rng.normal(size=rows) for name in EXTRA}
    valid = np.ones(rows, dtype=bool)
    valid[5] = False
    channels["hip"][5] = np.nan
    signals = {name: Signal("V", "analogue input", "device", "positive in") for name in EXTRA}
    clock = Clock(
        3 * 10**14 + 1_000_000 * np.arange(rows) + rng.integers(0, 1000, rows),
        anchor=(3 * 10**14, 1_700_000_000 * 10**9),
        sequence=2 * np.arange(rows),
    )
    events = [Event(0.0101, "mark", "Größe"), Event(0.04, "touch")]
    return Recording.clocked(clock, channels, {"who": "A. Tester"}, valid=valid, signals=signals, events=events)


def assert_same(one, other):
    assert one.time.tobytes() == other.time.tobytes()
    assert list(one.channels) == list(other.channels)
    for name in one.channels:
        assert one.channels[name].tobytes() == other.channels[name].tobytes()
    assert dict(one.meta) == dict(other.meta)
    assert one.signals == other.signals
    assert one.events == other.events
    assert (one.valid is None) == (other.valid is None)
    assert one.valid is None or one.valid.tobytes() == other.valid.tobytes()
    for name in ("nanoseconds", "sequence"):
        assert getattr(one.clock, name).tobytes() == getattr(other.clock, name).tobytes()
    assert (one.clock.start, one.clock.anchor) == (other.clock.start, other.clock.anchor)


def assert_from(recording, original):
    """Every valid row is one of the original's, bit for bit: found by its stamp."""
    rows = np.searchsorted(original.nanoseconds, recording.nanoseconds)
    assert np.array_equal(original.nanoseconds[rows], recording.nanoseconds)
    sound = np.ones(len(recording), bool) if recording.valid is None else recording.valid
    for name, values in recording.channels.items():
        assert values[sound].tobytes() == original.channels[name][rows][sound].tobytes()


def test_all_of_a_real_run_comes_back(tmp_path):
    write_recording(tmp_path / "run.h5", real())
    assert_same(read_recording(tmp_path / "run.h5"), real())


def test_a_part_reads_no_more_than_it_is(tmp_path):
    """Damage elsewhere in the file does not matter to it, which shows that nothing there is read."""
    path = tmp_path / "run.h5"
    write_recording(path, real())
    few = read_recording(path, channels=["force", "adc3"])
    assert list(few.channels) == ["force", "adc3"]
    with pytest.raises(UnknownNameError, match="'adc9'") as caught:
        read_recording(path, channels=["hip", "adc9"])
    assert "did you mean adc" in caught.value.todo
    with h5py.File(path) as file:
        hurt = [chunk(file["channels/ihip"], row) for row in range(4)]
    flip(path, [place + 8 for place, _ in hurt])
    with pytest.raises(InputError, match="damaged"):
        read_recording(path)
    part = read_recording(path, channels=["hip", "force"])
    assert part.force.tobytes() == real().force.tobytes()


def test_nothing_is_written_over_a_recording(tmp_path):
    path = tmp_path / "run.h5"
    write_recording(path, real())
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"run\.h5 is there already"):
        write_recording(path, real(30))
    assert path.read_bytes() == before
    write_recording(path, real(30), replace=True)
    assert len(read_recording(path)) == 30
    assert [file.name for file in tmp_path.iterdir()] == ["run.h5"]


def test_a_file_that_another_process_makes_in_the_meantime_stays(tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    fill = hdf5._fill

    def slowly(*arguments):
        fill(*arguments)
        path.write_bytes(b"theirs")

    monkeypatch.setattr(hdf5, "_fill", slowly)
    with pytest.raises(InputError, match="is there already"):
        write_recording(path, real())
    assert path.read_bytes() == b"theirs"
    assert [file.name for file in tmp_path.iterdir()] == ["run.h5"]


def chunk(dataset, number):
    info = dataset.id.get_chunk_info(number)
    return info.byte_offset, info.size


def flip(path, places):
    data = bytearray(path.read_bytes())
    for place in places:
        data[place] ^= 0x10
    path.write_bytes(data)


def test_a_flipped_byte_is_located_and_costs_its_block_of_that_signal(tmp_path):
    path = tmp_path / "run.h5"
    write_recording(path, real())
    with h5py.File(path) as file:
        place, size = chunk(file["channels/force"], 1)
    flip(path, [place + size // 2])
    with pytest.raises(InputError, match="damaged") as caught:
        read_recording(path)
    assert caught.value.why == "'force', rows 16 to 31"
    salvaged = salvage(path)
    (loss,) = salvaged.losses
    assert (loss.what, loss.where, loss.rows) == ("'force'", "rows 16 to 31", 16)
    assert loss.seconds == pytest.approx(0.016, rel=1e-2)
    assert len(salvaged.recording) == 60
    assert np.flatnonzero(~salvaged.recording.valid).tolist() == [5, *range(16, 32)]
    assert np.isnan(salvaged.recording.force[16:32]).all()
    assert_from(salvaged.recording, real())
    assert salvaged.recording.events[-1].kind == "lost"


def test_rows_without_stamps_are_left_out(tmp_path):
    path = tmp_path / "run.h5"
    write_recording(path, real())
    with h5py.File(path) as file:
        place, _ = chunk(file["nanoseconds"], 2)
    flip(path, [place + 4])
    salvaged = salvage(path)
    (loss,) = salvaged.losses
    assert (loss.what, loss.where) == ("every signal", "rows 32 to 47")
    assert len(salvaged.recording) == 44
    assert salvaged.recording.clock.sequence.tolist() == [2 * k for k in (*range(32), *range(48, 60))]
    assert_from(salvaged.recording, real())


def test_a_file_cut_short_keeps_the_first_rows_of_every_signal(tmp_path, monkeypatch):
    monkeypatch.setattr(hdf5, "ROWS_A_CHUNK", 100)
    path, original = tmp_path / "run.h5", real(2000)
    write_recording(path, original)
    good = path.read_bytes()
    for share in (0.3, 0.5, 0.7, 0.9, 0.99):
        size = int(share * len(good))
        path.write_bytes(good[:size])
        with pytest.raises(InputError, match="cut short or damaged") as caught:
            read_recording(path)
        assert caught.value.why.startswith(f"the file ends at byte {size} of {len(good)}")
        salvaged = salvage(path)
        recording = salvaged.recording
        assert list(recording.channels) == list(original.channels)
        assert_from(recording, original)
        sound = np.flatnonzero(recording.valid)
        assert sound.tolist() == [row for row in range(int(sound[-1]) + 1) if row != 5]
        # of the block in which the file ends some signals are whole; names and places of all are the first tenth
        assert len(recording) - (sound[-1] + 1) in (0, 100)
        assert 2000 * (share - 0.1) - 100 <= sound[-1] + 1 <= 2000 * share
        missing = 2000 - len(recording)
        assert salvaged.losses[0].what == "the end of the file"
        assert sum(loss.rows or 0 for loss in salvaged.losses if loss.what == "every signal") == missing


def test_whatever_byte_is_wrong_only_what_was_written_is_read(tmp_path):
    path, damaged = tmp_path / "run.h5", tmp_path / "damaged.h5"
    original = real(40)
    write_recording(path, original)
    good = path.read_bytes()
    found = saved = 0
    for place in range(8, len(good), 83):
        damaged.write_bytes(good[:place] + bytes([good[place] ^ 0x04]) + good[place + 1 :])
        try:
            assert_same(read_recording(damaged), original)
            continue
        except InputError:
            found += 1
        try:
            salvaged = salvage(damaged)
        except InputError:
            continue
        assert salvaged.losses
        assert_from(salvaged.recording, original)
        saved += 1
    assert found > 20
    assert saved > 20
