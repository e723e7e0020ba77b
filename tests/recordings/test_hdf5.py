"""Our own files: all of a run comes back bit for bit, no damage is read as a run, and what is whole is salvaged."""

import json

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from recording_files import assert_same, flipped, real

from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.recordings import hdf5
from hapticeval.recordings.channels import CHANNELS
from hapticeval.recordings.hdf5 import read_recording, salvage, write_recording
from hapticeval.recordings.memory import limited
from hapticeval.recordings.provenance import describe_losses
from hapticeval.recordings.recording import Recording

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | FINITE | st.text(),
    lambda children: st.lists(children, max_size=3) | st.dictionaries(st.text(), children, max_size=3),
    max_leaves=6,
)


@pytest.fixture(autouse=True)
def _short_blocks(monkeypatch):
    monkeypatch.setattr(hdf5, "ROWS_A_CHUNK", 16)


@pytest.fixture
def path(tmp_path):
    write_recording(tmp_path / "run.h5", real())
    return tmp_path / "run.h5"


def simple(rows=12, meta=None):
    points = np.column_stack([np.sin(np.arange(rows)), np.cos(np.arange(rows))])
    channels = {"hip": points, "ihip": points * 1.5, "force": -points}
    return Recording(np.arange(rows) * 1e-3, channels, meta or {"renderer": "constraint", "name": "Größe"})


@st.composite
def recordings(draw):
    rows, dimension = draw(st.integers(1, 40)), draw(st.sampled_from([2, 3]))
    names = ["hip", "ihip", "force", *draw(st.sets(st.sampled_from(["velocity", "operator_force"])))]
    start, step = draw(st.floats(-1e6, 1e6)), draw(st.floats(1e-3, 10.0))
    channels = {name: draw(hnp.arrays(np.float64, (rows, dimension), elements=FINITE)) for name in names}
    return Recording(start + step * np.arange(rows), channels, draw(st.dictionaries(st.text(), PLAIN, max_size=4)))


@settings(max_examples=40)
@given(recording=recordings())
def test_reads_back_bit_for_bit(tmp_path_factory, recording):
    path = tmp_path_factory.mktemp("run") / "deep" / "run.h5"
    write_recording(path, recording)
    assert_same(read_recording(path), recording)
    assert [file.name for file in path.parent.iterdir()] == ["run.h5"]


def test_all_of_a_real_run_comes_back_and_makes_the_same_bytes(path):
    assert_same(read_recording(path), real())
    write_recording(path.with_name("again.h5"), real())
    assert path.with_name("again.h5").read_bytes() == path.read_bytes()


def test_other_programs_find_units_and_meaning(tmp_path):
    write_recording(tmp_path / "run.h5", simple())
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["format_version"] == 2
        assert file["time"].attrs["unit"] == b"s"
        for name in ("hip", "ihip", "force"):
            dataset = file["channels"][name]
            assert dataset.attrs["unit"].decode() == CHANNELS[name].unit
            assert dataset.attrs["meaning"].decode() == CHANNELS[name].meaning
            assert dataset.attrs["frame"] == b"world"
            assert (dataset.fletcher32, dataset.shuffle, dataset.compression) == (True, True, "gzip")
        assert json.loads(bytes(file["meta"][:]))["renderer"] == "constraint"


def test_some_channels_read_no_more_than_they_are(refused, path):
    """Damage elsewhere in the file does not matter to them, which shows that nothing there is read."""
    with h5py.File(path) as file:
        places = [chunk(file["channels/ihip"], row)[0] + 8 for row in range(4)]
    path.write_bytes(flipped(path.read_bytes(), *places))
    with refused(InputError):
        read_recording(path)
    part = read_recording(path, channels=["force", "adc3"])
    assert list(part.channels) == ["force", "adc3"]
    assert part.force.tobytes() == real().force.tobytes()
    with refused(UnknownNameError):
        read_recording(path, channels=["hip", "adc9"])


def test_each_wrong_file_is_named_for_what_it_is(refused, tmp_path, path):
    with refused(InputError):
        read_recording(tmp_path / "gone.h5")
    (tmp_path / "text.h5").write_text("time,x,y\n0,1,2\n")
    with refused(InputError):
        read_recording(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["pressure"] = [1.0, 2.0]
    with refused(InputError):
        read_recording(tmp_path / "other.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 3
    with refused(InputError):
        read_recording(path)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("channels/hip", np.zeros((12, 2))),
        ("channels/force", np.zeros((11, 2))),
        ("channels/force", np.zeros((12, 2), dtype=np.float32)),
        ("time", np.arange(12.0)),
    ],
)
def test_wrong_units_lengths_and_types_are_refused(refused, tmp_path, name, values):
    path = tmp_path / "run.h5"
    write_recording(path, simple())
    with h5py.File(path, "r+") as file:
        del file[name]
        file[name] = values
        file[name].attrs["unit"] = {"channels/force": "N"}.get(name, "mm")
    with refused(InputError):
        read_recording(path)


@pytest.mark.parametrize("meta", [{"bound": float("inf")}, {"model": object()}])
def test_meta_that_json_cannot_hold_is_refused_and_leaves_nothing(refused, tmp_path, meta):
    with refused(InputError):
        write_recording(tmp_path / "run.h5", simple(meta=meta))
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_written_over_a_recording_unless_it_may_be_replaced(refused, path, monkeypatch):
    before = path.read_bytes()
    with refused(InputError):
        write_recording(path, simple())

    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(h5py.Group, "create_dataset", full)
        with refused(HapticevalError):
            write_recording(path, simple(), replace=True)
    assert path.read_bytes() == before
    write_recording(path, simple(), replace=True)
    assert len(read_recording(path)) == 12
    assert [file.name for file in path.parent.iterdir()] == ["run.h5"]


def test_a_file_that_another_process_makes_in_the_meantime_stays(refused, tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    fill = hdf5._fill

    def slowly(*arguments):
        fill(*arguments)
        path.write_bytes(b"theirs")

    monkeypatch.setattr(hdf5, "_fill", slowly)
    with refused(InputError):
        write_recording(path, real())
    assert path.read_bytes() == b"theirs"
    assert [file.name for file in tmp_path.iterdir()] == ["run.h5"]


# Damage


def chunk(dataset, number):
    info = dataset.id.get_chunk_info(number)
    return info.byte_offset, info.size


def assert_from(recording, original):
    """Every valid row is one of the original's, bit for bit: found by its stamp."""
    rows = np.searchsorted(original.nanoseconds, recording.nanoseconds)
    assert np.array_equal(original.nanoseconds[rows], recording.nanoseconds)
    for name, values in recording.channels.items():
        assert values[recording.measured].tobytes() == original.channels[name][rows][recording.measured].tobytes()


def test_a_flipped_byte_is_located_and_costs_its_block_of_that_signal(refused, path):
    with h5py.File(path) as file:
        place, size = chunk(file["channels/force"], 1)
    path.write_bytes(flipped(path.read_bytes(), place + size // 2))
    with refused(InputError) as caught:
        read_recording(path)
    recording = salvage(path)
    assert describe_losses(recording) == (caught.value.why,)
    assert np.flatnonzero(~recording.valid).tolist() == [5, *range(16, 32)]
    assert np.isnan(recording.force[16:32]).all()
    assert_from(recording, real())


@pytest.mark.parametrize("name", ["nanoseconds", "sequence", "valid", "channels/force"])
def test_a_dataset_that_states_more_rows_than_memory_holds_is_refused(path, name):
    with h5py.File(path, "r+") as file:
        kept = file[name]
        attributes, dtype = dict(kept.attrs), kept.dtype
        del file[name]
        huge = file.create_dataset(name, shape=(30_000_000, *kept.shape[1:]), dtype=dtype, chunks=True)
        huge.attrs.update(attributes)
    with limited(0.01), pytest.raises(InputError, match="would take"):
        read_recording(path)


def test_rows_without_stamps_are_left_out(path):
    with h5py.File(path) as file:
        place, _ = chunk(file["nanoseconds"], 2)
    path.write_bytes(flipped(path.read_bytes(), place + 4))
    recording = salvage(path)
    (loss,) = describe_losses(recording)
    assert loss.startswith("every signal, rows 32 to 47: 16 rows")
    assert recording.clock.sequence.tolist() == [2 * k for k in (*range(32), *range(48, 60))]
    assert_from(recording, real())


@pytest.mark.parametrize("name", ["sequence", "valid"])
def test_rows_whose_number_or_mark_is_lost_are_kept_without_it(path, name):
    with h5py.File(path) as file:
        place, _ = chunk(file[name], 1)
    path.write_bytes(flipped(path.read_bytes(), place + 4))
    recording = salvage(path)
    (loss,) = describe_losses(recording)
    assert loss.startswith(f"'{name}', rows 16 to 31: 16 rows")
    assert (recording.clock.sequence is None) == (name == "sequence")
    assert np.flatnonzero(~recording.valid).tolist() == [5, *(range(16, 32) if name == "valid" else ())]


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_a_file_cut_short_keeps_the_first_rows_of_every_signal(refused, tmp_path, monkeypatch, share):
    monkeypatch.setattr(hdf5, "ROWS_A_CHUNK", 100)
    path, original = tmp_path / "run.h5", real(2000)
    write_recording(path, original)
    good = path.read_bytes()
    size = int(share * len(good))
    path.write_bytes(good[:size])
    with refused(InputError) as caught:
        read_recording(path)
    if share < 0.1:
        with pytest.raises(InputError):
            salvage(path)
        return
    assert caught.value.why.startswith(f"the file ends at byte {size} of {len(good)}")
    recording = salvage(path)
    assert list(recording.channels) == list(original.channels)
    assert_from(recording, original)
    sound = np.flatnonzero(recording.valid)
    assert sound.tolist() == [row for row in range(int(sound[-1]) + 1) if row != 5]
    # of the block in which the file ends some signals are whole; names and places of all are the first tenth
    assert len(recording) - (sound[-1] + 1) in (0, 100)
    assert 2000 * (share - 0.1) - 100 <= sound[-1] + 1 <= 2000 * share
    ended, *losses = describe_losses(recording)
    assert ended == f"the file ends at byte {size} of {len(good)}"
    counted = [int(loss.partition(": ")[2].split()[0]) for loss in losses if loss.startswith("every signal")]
    assert sum(counted) == 2000 - len(recording)


@pytest.mark.system
def test_whatever_byte_is_wrong_only_what_was_written_is_read(tmp_path):
    path, damaged, original = tmp_path / "run.h5", tmp_path / "damaged.h5", real(40)
    write_recording(path, original)
    good = path.read_bytes()
    found = saved = 0
    for place in range(8, len(good), 83):
        damaged.write_bytes(flipped(good, place, bit=0x04))
        try:
            assert_same(read_recording(damaged), original)
            continue
        except InputError:
            found += 1
        try:
            recording = salvage(damaged)
        except InputError:
            continue
        assert describe_losses(recording)
        assert_from(recording, original)
        saved += 1
    assert found > 20
    assert saved > 20


@pytest.mark.parametrize(("count", "why"), [(1, "0"), (5, "0; 1; 2; 3; 4"), (6, "0; 1; 2; 3; 4; and more")])
def test_five_losses_are_named_at_the_most_and_one_where_no_row_is_whole(tmp_path, monkeypatch, count, why):
    losses = [str(number) for number in range(count)]
    monkeypatch.setattr(hdf5, "_read", lambda path, selected: (real(), losses))
    with pytest.raises(InputError) as caught:
        read_recording(tmp_path / "run.h5")
    assert caught.value.why == why
    monkeypatch.setattr(hdf5, "_read", lambda path, selected: (None, losses))
    with pytest.raises(InputError) as caught:
        salvage(tmp_path / "run.h5")
    assert caught.value.why == "no row of it is whole; 0"


@pytest.mark.parametrize(
    ("version", "end", "told"),
    [
        (2, 100, ("", 0)),
        (3, 101, ("the file ends at byte 100 of 101", 1)),
        (2, 70000, ("the file ends at byte 100 of 70000", 69900)),
        (0, 101, ("", 0)),
        (3, 99, ("", 0)),
    ],
)
def test_a_file_s_end_stands_in_its_superblock(tmp_path, version, end, told):
    """In bytes 28 to 35, of versions 2 and 3 alone."""
    path = tmp_path / "run.h5"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes([version]) + b"?" * 19 + end.to_bytes(8, "little") + b"?" * 64)
    assert hdf5._cut_short(path) == told


def test_a_recording_in_memory_leaves_no_file_and_is_the_same_as_one_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert hdf5.recording_bytes(real()).startswith(b"\x89HDF")
    assert not list(tmp_path.iterdir())


def test_metadata_are_written_in_the_order_of_their_names():
    assert hdf5.metadata_json({"who": "A", "dt": 1e-3, "scene": {"b": 1, "a": 2}}) == (
        '{"dt": 0.001, "scene": {"a": 2, "b": 1}, "who": "A"}'
    )
