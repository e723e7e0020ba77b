"""Journals that were cut, killed or damaged: what is whole comes back bit for bit, and nothing else does."""

import re

import numpy as np
import pytest
from recording_files import STEP, flipped, journal_parts

from hapticeval.errors import InputError
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.hdf5 import read_recording, write_recording
from hapticeval.recordings.journal import MAGIC, Kind, Layout, block_head, opening, recover
from hapticeval.recordings.provenance import describe_losses

LAYOUT = Layout(
    {"hip": 2, "joint_position": 3, "grip": 0},
    {"grip": Signal("N", "grip force", "device", "positive closes")},
    {"who": "A. Tester", "dt": 1e-3},
    anchor=(5_000_000_000, 1_700_000_000_000_000_000),
)
ROWS = 10


def rows(count=50):
    table = np.zeros(count, dtype=LAYOUT.dtype)
    table["sequence"] = np.arange(count)
    table["nanoseconds"] = 6_000_000_000 + STEP * np.arange(count)
    rng = np.random.default_rng(1)
    for name in LAYOUT.channels:
        table[name] = rng.normal(size=table[name].shape)
    return table


def parts(table, **more):
    return journal_parts(LAYOUT, table, **more)


def write(tmp_path, data):
    path = tmp_path / "run.journal"
    path.write_bytes(data)
    return path


def assert_rows(recording, table):
    """Every row of the recording is one of the table, bit for bit: found by its sequence number."""
    chosen = table[recording.clock.sequence]
    assert recording.nanoseconds.tobytes() == np.ascontiguousarray(chosen["nanoseconds"]).tobytes()
    for name in LAYOUT.channels:
        assert recording.channels[name].tobytes() == np.ascontiguousarray(chosen[name]).tobytes()


def test_a_whole_journal_comes_back_whole(tmp_path):
    table = rows()
    path = write(tmp_path, b"".join(parts(table, events=[(6_010_000_000, "mark", "Größe")])))
    recording = recover(path)
    assert describe_losses(recording) == ()
    assert len(recording) == 50
    assert_rows(recording, table)
    assert recording.time[[0, 1, -1]].tolist() == [0.0, 0.001, 0.049]
    assert [(event.time, event.kind, event.text) for event in recording.events] == [(0.01, "mark", "Größe")]
    assert recording.signals["grip"] == LAYOUT.signals["grip"]
    assert recording.clock.anchor == LAYOUT.anchor
    assert recording.clock.missed == 0
    assert dict(recording.meta) == {"who": "A. Tester", "dt": 1e-3}
    (loss,) = describe_losses(recover(write(tmp_path, path.read_bytes() + b"more")))
    assert "it breaks off inside a block" in loss


def test_no_flipped_byte_is_read_as_data_and_costs_more_than_its_block(tmp_path):
    table = rows()
    good = b"".join(parts(table))
    begin = len(opening(LAYOUT))
    for place in range(0, len(good), 13):
        path = write(tmp_path, flipped(good, place, bit=0x20))
        recording = recover(path)
        assert_rows(recording, table)
        missing = 50 - len(recording)
        assert missing == (ROWS if begin <= place < len(good) - len(parts(table)[-1]) else 0)
        losses = describe_losses(recording)
        counted = [re.fullmatch(r".*: (\d+) rows \((\S+) s\)", loss) for loss in losses]
        assert [(int(count[1]), float(count[2])) for count in counted if count] == [(ROWS, 1e-3 * ROWS)] * (missing > 0)
        assert bool(losses) == (place >= len(MAGIC))


def test_a_journal_cut_anywhere_keeps_its_whole_blocks(tmp_path):
    table = rows()
    made = parts(table)
    good = b"".join(made)
    ends = np.cumsum([len(part) for part in made])
    for size in range(int(ends[1]), len(good), 11):
        recording = recover(write(tmp_path, good[:size]))
        kept = ROWS * int(np.count_nonzero(ends[1:-1] <= size))
        assert len(recording) == kept
        assert_rows(recording, table)
        (loss,) = describe_losses(recording)
        assert loss.startswith("the end, ")
        assert f"from cycle {kept} on" in loss
        broken = size - int(ends[np.count_nonzero(ends <= size) - 1])
        how = f"bytes {size - broken} to {size - 1}: it breaks off inside a block" if broken else "was not closed"
        assert how in loss


def test_blocks_that_are_gone_without_a_trace_are_missed(tmp_path):
    table = rows()
    made = parts(table)
    del made[2:4]
    recording = recover(write(tmp_path, b"".join(made)))
    assert_rows(recording, table)
    (loss,) = describe_losses(recording)
    assert loss.endswith(": 20 rows (0.02 s)")
    assert recording.clock.missed == 20


def test_what_is_damaged_is_told_with_its_bytes_its_row_and_what_is_lost(tmp_path):
    made = parts(rows())
    ends = np.cumsum([len(part) for part in made])
    good = b"".join(made)
    hurt = flipped(good, int(ends[2]) + 40)
    where = f"damaged, bytes {ends[2]} to {ends[3] - 1}, after row 19"
    assert describe_losses(recover(write(tmp_path, hurt))) == (f"{where}: 10 rows (0.01 s)",)
    # Also where what comes after it is gone, and with it the count of all.
    last = f"the end, bytes {ends[4]} to {ends[4] + 9}: it breaks off inside a block"
    assert describe_losses(recover(write(tmp_path, hurt[: ends[4] + 10]))) == (
        f"{where}: 10 rows (0.01 s)",
        f"{last}; what came from cycle 40 on is unknown",
    )
    gone = b"".join([*made[:2], *made[3:]])
    assert describe_losses(recover(write(tmp_path, gone))) == (
        f"damaged, before byte {ends[1]}, after row 9: 10 rows (0.01 s)",
    )
    marked = parts(rows(), events=[(6_010_000_000, "mark", "x")])
    begin = sum(map(len, marked[:6]))
    no_event = b"".join([*marked[:6], b"?" * len(marked[6]), *marked[7:]])
    assert describe_losses(recover(write(tmp_path, no_event))) == (
        f"damaged, bytes {begin} to {begin + len(marked[6]) - 1}, no row among them",
    )


@pytest.mark.parametrize(("rows_left", "took"), [(1, "0 s"), (2, "0.001 s"), (3, "0.001 s")])
def test_of_a_single_row_no_time_is_known_that_a_lost_one_would_have_taken(tmp_path, rows_left, took):
    made = parts(rows(rows_left + 1), size=1)
    (loss,) = describe_losses(recover(write(tmp_path, b"".join([*made[: rows_left + 1], *made[rows_left + 2 :]]))))
    assert loss.endswith(f"after row {rows_left - 1}: 1 rows ({took})")


def test_one_header_is_enough_and_none_is_not(refused, tmp_path):
    good = b"".join(parts(rows()))
    first, second = len(MAGIC) + 30, (len(opening(LAYOUT)) + len(MAGIC)) // 2 + 30
    for place in (first, second):
        assert len(recover(write(tmp_path, flipped(good, place)))) == 50
    with refused(InputError):
        recover(write(tmp_path, flipped(good, first, second)))


def test_cycles_without_a_row_are_counted_and_no_damage(tmp_path):
    table = rows()[np.r_[0:17, 30:50]]
    recording = recover(write(tmp_path, b"".join(parts(table))))
    assert describe_losses(recording) == ()
    assert recording.clock.missed == 13


def test_rows_that_are_no_measurement_are_kept_and_not_valid(tmp_path):
    table = rows()
    table["hip"][3, 1] = np.nan
    table["grip"][20] = np.inf
    table["nanoseconds"][7] = table["nanoseconds"][6]
    table["nanoseconds"][30] = 0
    recording = recover(write(tmp_path, b"".join(parts(table))))
    assert np.flatnonzero(~recording.valid).tolist() == [3, 7, 20, 30]
    assert [rows.start for rows in recording.sound_rows()] == [0, 4, 8, 21, 31]
    assert recording.events[-1].text == "4 rows are not finite or out of order"
    write_recording(tmp_path / "run.h5", recording)
    again = read_recording(tmp_path / "run.h5")
    assert again.valid.tolist() == recording.valid.tolist()
    assert np.isnan(again.hip[3, 1])


def test_a_journal_that_was_not_closed_becomes_a_recording(tmp_path):
    table = rows()
    journal = write(tmp_path, b"".join(parts(table, closed=False)))
    write_recording(tmp_path / "run.h5", recover(journal))
    recording = read_recording(tmp_path / "run.h5")
    assert describe_losses(recording)
    assert_rows(recording, table)
    assert recording.events == recover(journal).events
    assert recording.clock.anchor == LAYOUT.anchor


def test_other_files_are_named_for_what_they_are(refused, tmp_path):
    with refused(InputError):
        recover(tmp_path / "gone")
    with refused(InputError):
        recover(write(tmp_path, b""))
    with refused(InputError):
        recover(write(tmp_path, b"time,x,y\n" * 50))
    with refused(InputError):
        recover(write(tmp_path, opening(LAYOUT)))
    payload = LAYOUT.encoded().replace(b'"version": 1', b'"version": 9')
    with refused(InputError):
        recover(write(tmp_path, MAGIC + block_head(Kind.HEADER, 0, 0, payload) + payload))


def test_a_channel_has_4096_columns_at_the_most():
    assert Layout({"joint_position": 4096}).dtype.itemsize == 16 + 8 * 4096
    with pytest.raises(InputError, match="4097"):
        Layout({"joint_position": 4097})


@pytest.mark.parametrize(
    ("channels", "meta"),
    [
        ({"torque": 2}, {}),
        ({"hip": -1}, {}),
        ({"hip": 0}, {}),
        ({"hip": 2}, {"gain": float("inf")}),
        ({"hip": 2}, {"gain": object()}),
    ],
)
def test_layouts_that_cannot_be_recorded_are_refused(refused, channels, meta):
    with refused(InputError):
        opening(Layout(channels, meta=meta))
