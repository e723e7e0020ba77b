"""Foreign files that are cut short: wherever they end, what is given is theirs, and what is lost is told."""

from __future__ import annotations

import re
import zipfile

import h5py
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.recordings.conversion import convert
from hapticeval.recordings.formats import Table, read_table
from hapticeval.recordings.losses import told_losses, told_warnings
from hapticeval.recordings.mapping import parse_mapping

ROWS = 700
STEP = 0.002
RNG = np.random.default_rng(5)
TIME = np.arange(ROWS) * STEP
HIP = RNG.normal(size=(ROWS, 2))
FORCE = RNG.normal(size=(ROWS, 2))
TRUTH = {
    "t": TIME,
    **{f"hip[{k}]": HIP[:, k] for k in range(2)},
    **{f"force[{k}]": FORCE[:, k] for k in range(2)},
}
MAPPING = {
    "time": {"column": "t", "unit": "s"},
    "channels": {
        "hip": {"columns": ["hip[0]", "hip[1]"], "unit": "m", "sign": 1},
        "force": {"columns": ["force[0]", "force[1]"], "unit": "N", "sign": 1},
    },
}
anywhere = st.floats(0.0, 1.0, exclude_max=True)


def h5_plain(path, libver="earliest"):
    with h5py.File(path, "w", libver=libver) as file:
        for name, values in (("t", TIME), ("hip", HIP), ("force", FORCE)):
            file[name] = values


def h5_in_blocks(path, libver="earliest"):
    """As a logger writes it that appends: blocks of all signals, one after the other, partly packed."""
    with h5py.File(path, "w", libver=libver, rdcc_nbytes=0) as file:
        made = [
            (file.create_dataset("t", (ROWS,), "f8", chunks=(64,)), TIME),
            (file.create_dataset("hip", (ROWS, 2), "f8", chunks=(64, 1), compression="gzip"), HIP),
            (file.create_dataset("force", (ROWS, 2), "f8", chunks=(32, 2), shuffle=True), FORCE),
        ]
        file.flush()
        for begin in range(0, ROWS, 64):
            for dataset, values in made:
                dataset[begin : begin + 64] = values[begin : begin + 64]


def h5_of_many_blocks(path):
    """So many that what says where they lie is spread over the file, as it grew."""
    with h5py.File(path, "w", rdcc_nbytes=0) as file:
        file["t"] = TIME
        file["hip"] = HIP
        force = file.create_dataset("force", (ROWS, 2), "f8", chunks=(4, 2))
        for begin in range(0, ROWS, 4):
            force[begin : begin + 4] = FORCE[begin : begin + 4]


def h5_backwards(path):
    """Blocks whose order in the file is not that of their rows."""
    with h5py.File(path, "w", rdcc_nbytes=0) as file:
        file["t"] = TIME
        file["hip"] = HIP
        force = file.create_dataset("force", (ROWS, 2), "f8", chunks=(50, 2))
        for begin in range(ROWS - 50, -1, -50):
            force[begin : begin + 50] = FORCE[begin : begin + 50]


def mat73(path, **how):
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t", TIME[:, None]), ("hip", HIP), ("force", FORCE)):
            chunks = (1, 128) if how else None
            file.create_dataset(name, data=values.T, chunks=chunks, **how).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def mat5(path, *, packed):
    savemat(path, {"t": TIME[:, None], "hip": HIP, "force": FORCE}, do_compression=packed)


WRITERS = {
    "plain.h5": h5_plain,
    "latest.h5": lambda path: h5_plain(path, "latest"),
    "blocks.h5": h5_in_blocks,
    "blocks-latest.h5": lambda path: h5_in_blocks(path, "latest"),
    "many-blocks.h5": h5_of_many_blocks,
    "backwards.h5": h5_backwards,
    "plain73.mat": mat73,
    "packed73.mat": lambda path: mat73(path, compression="gzip"),
    "plain5.mat": lambda path: mat5(path, packed=False),
    "packed5.mat": lambda path: mat5(path, packed=True),
    "plain.npz": lambda path: np.savez(path, t=TIME, hip=HIP, force=FORCE),
    "packed.npz": lambda path: np.savez_compressed(path, t=TIME, hip=HIP, force=FORCE),
}


@pytest.fixture(scope="module", params=WRITERS)
def whole(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / request.param
    WRITERS[request.param](path)
    return path


def shortened(path, share):
    cut = path.with_name("cut" + path.suffix)
    data = path.read_bytes()
    cut.write_bytes(data[: int(share * len(data))])
    return cut


@settings(max_examples=40)
@given(share=anywhere)
@example(share=0.999999)
def test_every_cut_gives_an_error_or_rows_from_the_first_on(whole, share):
    cut = shortened(whole, share)
    try:
        table = read_table(cut)
    except InputError:
        return
    assert table.columns
    for name, values in table.columns.items():
        assert np.asarray(values).tobytes() == TRUTH[name][: table.rows(name)].tobytes()
        assert table.promised.get(name, table.rows(name)) == ROWS
        assert (name in table.promised) == (table.rows(name) < ROWS)
    for name in TRUTH.keys() - table.columns.keys():
        at_a_border = cut.suffix == ".mat" and not table.warnings  # between two variables, which nothing in it betrays
        assert at_a_border or table.lacks(name)
        assert table.promised.get(name, ROWS) == ROWS
    assert set(table.promised) <= set(TRUTH)


@settings(max_examples=40)
@given(share=anywhere)
@example(share=0.999999)
def test_every_cut_gives_an_error_or_a_recording_that_says_what_it_lacks(whole, share):
    cut = shortened(whole, share)
    try:
        made = convert(read_table(cut), parse_mapping(MAPPING))
    except (InputError, UnknownNameError):
        return
    rows = len(made)
    assert made.time.tobytes() == load_whole(whole).time[:rows].tobytes()
    lost = {"every signal": (rows, ROWS)} if rows < ROWS else {}
    ends = []
    for name, true in (("hip", HIP), ("force", FORCE)):
        if name not in made.channels:
            lost[f"'{name}'"] = (0, rows)
            continue
        there = np.isfinite(made.channels[name]).all(axis=1)
        ends.append(int(there.sum()))
        assert made.channels[name][: ends[-1]].tobytes() == true[: ends[-1]].tobytes()
        assert not there[ends[-1] :].any()
        if ends[-1] < rows:
            lost[f"'{name}'"] = (ends[-1], rows)
    assert rows == max(ends)
    assert np.array_equal(np.ones(rows, bool) if made.valid is None else made.valid, np.arange(rows) < min(ends))
    assert told(made) == {name: (*run, f"{(run[1] - run[0]) * STEP:.3g}") for name, run in lost.items()}
    if lost:
        assert f"ends at byte {cut.stat().st_size}" in told_warnings(made)[0]


def load_whole(path):
    return convert(read_table(path), parse_mapping(MAPPING))


def told(recording):
    """First and last row and seconds that the recording says are lost, signal by signal."""
    found = {}
    for text in told_losses(recording):
        names, begin, last, rows, span = re.fullmatch(
            r"(.*), rows (\d+) to (\d+): (\d+) rows \((.*) s\)", text
        ).groups()
        assert int(rows) == int(last) + 1 - int(begin)
        found |= {name: (int(begin), int(last) + 1, span) for name in names.split(", ")}
    return found


def test_a_file_that_lacks_a_tenth_gives_most(whole):
    """So that the two tests above do not hold for want of a table."""
    table = read_table(shortened(whole, 0.9))
    assert {"t", "hip[0]", "hip[1]"} <= set(table.columns)


@pytest.mark.parametrize("name", WRITERS)
def test_a_whole_file_lacks_nothing(tmp_path, name):
    WRITERS[name](tmp_path / name)
    table = read_table(tmp_path / name)
    assert (table.warnings, dict(table.promised), table.open_ended) == ((), {}, False)
    assert not told_losses(load_whole(tmp_path / name))


@pytest.mark.parametrize("libver", ["earliest", "v108", "latest"])
@pytest.mark.parametrize("userblock", [0, 512, 2048])
def test_rows_are_told_from_padding_by_the_bytes_of_the_file(tmp_path, libver, userblock):
    """The border between what is and what is not is that of the bytes, whatever comes before the file's own."""
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", libver=libver, userblock_size=userblock) as file:
        file["x"] = np.full((1, ROWS), -1.0).view("i8")  # of nothing but the bytes that padding might have
        begin = file["x"].id.get_offset()
    data = path.read_bytes()
    path = tmp_path / "cut.h5"
    for rows in (1, 2, 333, ROWS - 1):
        for more in (0, 7):
            path.write_bytes(data[: begin + 8 * rows + more])
            assert read_table(path, format="hdf5").rows("x") == rows


def test_a_dataset_that_was_never_written_is_as_in_the_whole_file(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("never", (ROWS,), "f8", fillvalue=3.0)
        file["x"] = HIP
    path.write_bytes(path.read_bytes()[:-400])
    table = read_table(path)
    assert table["never"].tolist() == [3.0] * ROWS
    assert table.promised == {"x[0]": ROWS, "x[1]": ROWS}


def test_groups_compounds_and_units_of_a_cut_file(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        kind = [("t", "f8"), ("hip", "f4", (2,)), ("who", "S3")]
        log = np.zeros(ROWS, dtype=kind)
        log["t"], log["hip"] = TIME, HIP
        dataset = file.create_dataset("rig/log", log.shape, log.dtype)
        dataset.attrs["units"] = "mm"
        dataset[()] = log
        file["rig/again"] = h5py.SoftLink("/rig/log")
        file["rig/up"] = file["/"]
        end = file["rig/log"].id.get_offset() + 100 * log.dtype.itemsize
    path.write_bytes(path.read_bytes()[: end + 5])
    table = read_table(path)
    assert {name: table.rows(name) for name in table.columns} == {
        "rig/log.t": 100, "rig/log.hip[0]": 100, "rig/log.hip[1]": 100
    }  # fmt: skip
    assert table["rig/log.hip[1]"].tolist() == log["hip"][:100, 1].tolist()
    assert table.units["rig/log.t"] == "mm"
    assert "of the 700 rows of 'rig/log.t', 'rig/log.hip[0]'" in table.warnings[0]
    assert "100 are there: 600 rows" in table.warnings[0]


def test_a_file_whose_index_is_lost_says_so(tmp_path):
    path = tmp_path / "a.h5"
    h5_plain(path)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(InputError, match="its own index is lost"):
        read_table(path)


def test_of_many_datasets_those_that_are_still_found_are_given(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for k in range(30):
            file[f"x{k:02}"] = TIME + k
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    table = read_table(path)
    assert 5 < len(table.columns) < 25
    for name in table.columns:
        assert np.array_equal(table[name], (TIME + int(name[1:]))[: table.rows(name)])
    assert "what says where they lie is lost of others in '/'" in table.warnings[0]
    assert table.lacks("x29")


def test_cells_and_structures_of_a_cut_73_file(tmp_path):
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        refs = file.create_group("#refs#")
        signals = file.create_group("scope/signals")
        parts = []
        for k in range(3):
            dataset = refs.create_dataset(f"v{k}", (2, ROWS), "f8")
            dataset.attrs["MATLAB_class"] = np.bytes_("double")
            parts.append(dataset)
        signals.create_dataset("values", data=np.array([[part.ref] for part in parts], dtype=h5py.ref_dtype))
        for k, dataset in enumerate(parts):
            dataset[()] = (HIP + k).T
        end = parts[1].id.get_offset() + 8 * (ROWS + 40)  # forty rows of the second one's second column
        assert signals["values"].id.get_offset() < end
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    path.write_bytes(path.read_bytes()[:end])
    table = read_table(path)
    found = {name: table.rows(name) for name in table.columns}
    stem = "scope.signals[{}].values[{}]".format
    assert found == {stem(0, 0): ROWS, stem(0, 1): ROWS, stem(1, 0): ROWS, stem(1, 1): 40}
    assert np.array_equal(table[stem(1, 1)], HIP[:40, 1] + 1)
    assert set(table.promised) == {stem(1, 1), stem(2, 0), stem(2, 1)}


def test_an_array_with_a_wrong_byte_in_a_cut_archive_is_left_out(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, t=TIME, hip=HIP, force=FORCE)
    data = bytearray(path.read_bytes())
    data[data.index(HIP.tobytes()) + 80] ^= 4
    path.write_bytes(data[:-400])
    table = read_table(path)
    assert set(table.columns) == {"t"} or set(table.columns) == {"t", "force[0]", "force[1]"}
    assert any("'hip' is left out: its checksum is wrong" in text for text in table.warnings)
    assert table.lacks("hip[0]")


def test_an_archive_inside_of_an_array_is_not_taken_for_the_file(tmp_path):
    inner = tmp_path / "inner.npz"
    np.savez(inner, t=-TIME)
    path = tmp_path / "a.npz"
    np.savez(path, t=TIME, inner=np.frombuffer(inner.read_bytes(), dtype=np.uint8), x=HIP)
    data = path.read_bytes()
    path.write_bytes(data[: data.index(inner.read_bytes()) + inner.stat().st_size])
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist() == ["t.npy"]  # the inner one's, as its index is the last
    assert read_table(path)["t"].tolist() == TIME.tolist()


def test_an_archive_without_its_index_says_whether_more_is_missing(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, t=TIME, hip=HIP)
    data = path.read_bytes()
    index = data.index(b"PK\x01\x02")
    path.write_bytes(data[: index + 10])
    assert not read_table(path).open_ended
    assert "within its index" in read_table(path).warnings[0]
    path.write_bytes(data[:index])
    assert read_table(path).open_ended
    assert "is not known" in read_table(path).warnings[0]


@pytest.mark.parametrize("compressed", [False, True])
def test_a_wrong_byte_anywhere_in_an_archive_is_never_read_as_a_number(tmp_path, compressed):
    whole = tmp_path / "a.npz"
    (np.savez_compressed if compressed else np.savez)(whole, t=TIME[:20], hip=HIP[:20])
    data = whole.read_bytes()
    truth = read_table(whole)
    hurt = tmp_path / "b.npz"
    for place in range(0, len(data), 1 if len(data) < 2000 else 3):
        for end in (len(data), len(data) - 30):
            hurt.write_bytes(data[:place] + bytes([data[place] ^ 0x21]) + data[place + 1 : end])
            try:
                table = read_table(hurt, format="npz")
            except InputError:
                continue
            assert all(np.array_equal(table[name], truth[name]) for name in table.columns if name in truth.columns)


def test_a_matlab_file_of_less_than_its_header_says_so(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"t": TIME})
    path.write_bytes(path.read_bytes()[:90])
    with pytest.raises(InputError, match="cut short") as caught:
        read_table(path, format="matlab5")
    assert "90 are there" in caught.value.why


def cut_table(**promised):
    return Table(
        {"t": TIME, "hip[0]": HIP[:300, 0], "hip[1]": HIP[:280, 1], "pen": np.ones(250, int)},
        warnings=("the file ends at byte 9",),
        promised={"hip[0]": ROWS, "hip[1]": ROWS, "pen": ROWS, **promised},
    )


def document(**more):
    return parse_mapping({**MAPPING, "channels": {"hip": MAPPING["channels"]["hip"]}, **more})


def test_a_rate_tells_the_seconds_too():
    made = convert(cut_table(), document(time={"rate": 500}))
    assert len(made) == 280
    assert told(made) == {"every signal": (280, 700, "0.84")}


def test_seconds_are_those_of_the_clock_where_it_is_whole():
    time = np.where(np.arange(ROWS) < 500, TIME, TIME + 10.0)
    table = Table({"t": time, "x": HIP[:300, 0]}, promised={"x": ROWS})
    made = convert(table, document(channels={"hip": {"columns": ["x"], "unit": "m", "sign": 1}}))
    assert told(made) == {"every signal": (300, 700, "10.8")}


def test_rows_of_which_nobody_knows_whether_they_are_a_gap_are_no_measurement():
    made = convert(cut_table(), document(gaps={"column": "pen", "where": 0}))
    assert told(made) == {"every signal": (280, 700, "0.84"), "where the gaps are": (250, 280, "0.06")}
    assert np.array_equal(made.valid, np.arange(280) < 250)
    assert made.meta["import"]["left out"] == {"cut off": 30}
    lost = Table({"t": TIME, "hip[0]": HIP[:, 0], "hip[1]": HIP[:, 1]}, promised={"pen": ROWS})
    with pytest.raises(InputError, match=r"the column of \[gaps\] is lost"):
        convert(lost, document(gaps={"column": "pen", "where": 0}))


def test_a_lost_clock_is_an_error_and_a_misspelt_column_too():
    with pytest.raises(InputError, match="'clock' is not in what is left"):
        convert(cut_table(clock=ROWS), document(time={"column": "clock", "unit": "s"}))
    with pytest.raises(UnknownNameError, match="'pens'"):
        convert(cut_table(), document(gaps={"column": "pens", "where": 0}))


def test_columns_that_never_had_one_length_do_not_line_up_by_a_cut():
    table = Table({"t": TIME[:300], "x": HIP[:300, 0]}, promised={"t": ROWS})
    with pytest.raises(InputError, match="'x' had 300 rows, the time 700"):
        convert(table, document(channels={"hip": {"columns": ["x"], "unit": "m", "sign": 1}}))


def test_a_channel_on_another_clock_ends_where_it_ends():
    slow = TIME[::2]
    table = Table({"t": TIME, "x": HIP[:, 0], "s": slow, "f": FORCE[:100, 0]}, promised={"f": slow.size})
    channels = {
        "hip": {"columns": ["x"], "unit": "m", "sign": 1},
        "force": {"columns": ["f"], "unit": "N", "sign": 1, "time": "s", "resample": "hold"},
    }
    made = convert(table, document(channels=channels))
    assert len(made) == ROWS
    assert told_losses(made) == ("'force', rows 100 to 349 of its clock 's': 250 rows (1 s)",)
    assert np.array_equal(made.valid, np.arange(ROWS) < 200)
    assert np.array_equal(made.force[:200, 0], np.repeat(FORCE[:100, 0], 2))
