"""Text formats: what they hold, where they end, and what they are not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.recordings import formats as registry_module
from hapticeval.recordings.formats import Table, importer, read_table
from hapticeval.recordings.formats.text import is_whole
from hapticeval.recordings.importing.convert import convert
from hapticeval.recordings.importing.mapping import parse_mapping

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)


def written(tmp_path, name, text):
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return tmp_path / name


def column(table, name):
    return table[name].tolist()


@pytest.mark.parametrize(
    ("text", "names", "second"),
    [
        ("t,x\n0,1\n1,2.5\n", ["t", "x"], [1.0, 2.5]),
        ("0,1\n1,2.5\n", ["c0", "c1"], [1.0, 2.5]),
        ("t;x\r\n0;1\r\n1;2,5\r\n", ["t", "x"], [1.0, 2.5]),
        ("t\tx\n0\t1\n1\t2.5\n", ["t", "x"], [1.0, 2.5]),
        ("# made by a logger\n# t x\n0 1\n1 2.5\n", ["t", "x"], [1.0, 2.5]),
        ("0  1\n 1   2.5\n", ["c0", "c1"], [1.0, 2.5]),
        ("\n\nt,x\n\n0,1\n1,2.5\n", ["t", "x"], [1.0, 2.5]),
        ("Rig 7 of the lab\nt,x\n0,1\n1,2.5\n", ["t", "x"], [1.0, 2.5]),
        ("t,x\n0,1\n1,2.5\n".encode("utf-16"), ["t", "x"], [1.0, 2.5]),
        ('"time, s","f, N (hand)"\n0,1\n1,2.5\n', ["time, s", "f, N (hand)"], [1.0, 2.5]),
    ],
)
def test_delimited_text_is_read_whatever_its_dialect(tmp_path, text, names, second):
    table = read_table(written(tmp_path, "a.csv", text))
    assert list(table.columns) == names
    assert column(table, names[1]) == second
    assert table.warnings == ()


@pytest.mark.parametrize("width", [600, 9000])
def test_a_header_of_any_length_is_one(tmp_path, width):
    names = [f"channel number {k}" for k in range(width)]
    rows = "".join(",".join(f"{k + row}" for k in range(width)) + "\n" for row in range(3))
    table = read_table(written(tmp_path, "a.csv", ",".join(names) + "\n" + rows))
    assert list(table.columns) == names
    assert column(table, names[-1]) == [width - 1, width, width + 1]


def test_a_word_among_the_rows_costs_its_row(tmp_path):
    rows = [f"{k},{k * 0.5}" for k in range(300)]
    rows[150] = "PAUSED"
    table = read_table(written(tmp_path, "a.csv", "t,x\n" + "\n".join(rows) + "\n"))
    assert table.rows("x") == 300
    assert np.flatnonzero(np.isnan(table["x"])).tolist() == [150]
    assert column(table, "x")[151] == 75.5


def test_decimal_commas_beside_a_word(tmp_path):
    table = read_table(written(tmp_path, "a.csv", "t;x\n0,0;1,5\n0,1;ERR\n0,2;2,5\n"))
    assert column(table, "x")[::2] == [1.5, 2.5]
    assert column(table, "t") == [0.0, 0.1, 0.2]
    assert "1 cell without a number in 'x', first at row 1: 'ERR'" in table.warnings[0]


@pytest.mark.parametrize("named", [False, True])
def test_rows_and_columns_that_are_swapped(tmp_path, named):
    """13 signals in 13 lines of 500 numbers each."""
    values = np.random.default_rng(0).normal(size=(13, 500)).round(6)
    lines = [",".join([f"s{k}"] * named + [repr(x) for x in row.tolist()]) for k, row in enumerate(values)]
    table = read_table(written(tmp_path, "a.csv", "\n".join(lines) + "\n"))
    assert list(table.columns) == [f"s{k}" if named else f"c{k}" for k in range(13)]
    assert np.array_equal(table["s7" if named else "c7"], values[7])
    assert "its 13 rows are taken for the signals" in table.remarks[0]


@pytest.mark.parametrize("format", [None, "csv", "devicelog", "svc", "hdurecord"])
@pytest.mark.parametrize("text", ["\n\n\n", "  ", "\r\n \r\n", "# only a remark\n", "1", "POSITION", "t,x\n", "\0\0\0"])
def test_a_file_without_a_row_is_refused(tmp_path, format, text):
    mapping = {"time": {"column": "t", "unit": "s"}, "channels": {"hip": {"columns": ["x"], "unit": "m", "sign": 1}}}
    with pytest.raises(InputError):
        convert(read_table(written(tmp_path, "a.csv", text), format=format), parse_mapping(mapping))


def test_units_in_the_header_are_the_files_own_word(tmp_path):
    table = read_table(written(tmp_path, "a.csv", "t [ms],x (mm),f\n0,1,2\n1,2,3\n"))
    assert dict(table.units) == {"t [ms]": "ms", "x (mm)": "mm"}
    second = read_table(written(tmp_path, "b.csv", "t,x,f\ns,mm,\n0,1,2\n1,2,3\n"))
    assert dict(second.units) == {"t": "s", "x": "mm"}
    assert column(second, "x") == [1.0, 2.0]


@settings(max_examples=40)
@given(rows=st.lists(st.tuples(NUMBERS, NUMBERS), min_size=2, max_size=12))
def test_numbers_come_back_bit_for_bit(tmp_path_factory, rows):
    text = "a,b\n" + "".join(f"{a!r},{b!r}\n" for a, b in rows)
    table = read_table(written(tmp_path_factory.mktemp("csv"), "a.csv", text))
    for k, name in enumerate("ab"):
        assert column(table, name) == [row[k] for row in rows]


@settings(max_examples=50)
@given(cut=st.integers(1, 60))
def test_a_file_cut_anywhere_gives_only_rows_that_were_written(tmp_path_factory, cut):
    rows = [(k * 0.25, 1000.0 + 0.37 * k * k) for k in range(12)]
    text = "t,x\n" + "".join(f"{t!r},{x!r}\n" for t, x in rows)
    table = read_table(written(tmp_path_factory.mktemp("cut"), "a.csv", text[:-cut]))
    found = list(zip(column(table, "t"), column(table, "x"), strict=True))
    assert found == rows[: len(found)]
    lost = text[-cut:].count("\n")
    assert len(found) == len(rows) - lost
    assert bool(table.warnings) == (not text[:-cut].endswith("\n"))


def test_a_last_row_of_fixed_decimals_needs_no_line_end():
    before = ["0.00 1.250", "0.01 1.260"]
    assert is_whole("0.02 1.270", before)
    assert not is_whole("0.02 1.27", before)
    assert not is_whole("0.02", before)
    assert not is_whole("3 7", ["1 5", "2 6"])


def test_an_empty_cell_is_nan_and_located(tmp_path):
    table = read_table(written(tmp_path, "a.csv", "t,x\n0,1\n1,\n2,oops\n3,4\n"))
    assert np.isnan(table["x"]).tolist() == [False, True, True, False]
    assert "2 cells without a number in 'x', first at row 1" in table.warnings[0]


def test_what_is_no_table_of_numbers_is_named(tmp_path):
    table = read_table(written(tmp_path, "a.csv", "t,state,x\n0,free,1\n1,touch,2\n"))
    assert list(table.columns) == ["t", "x"]
    assert "'state' is text" in table.remarks[0]
    with pytest.raises(InputError, match="more cells") as caught:
        read_table(written(tmp_path, "a.csv", "t,x\n0,1\n1,2,3\n"))
    assert "line 3" in caught.value.why
    with pytest.raises(InputError, match="two columns named 'x'"):
        read_table(written(tmp_path, "a.csv", "x,x\n0,1\n1,2\n"))


def test_nanoseconds_of_a_wall_clock_stay_whole(tmp_path):
    stamp = 1_700_000_000_123_456_789
    table = read_table(written(tmp_path, "a.csv", f"t,x\n{stamp},1\n{stamp + 1},2\n"))
    assert table["t"].dtype == np.int64
    assert table["t"].tolist() == [stamp, stamp + 1]


DEVICELOG = "TIME POSITION FORCE BUTTONS\n0.00000 0.10000 0.20000 0.30000 0.00000 -1.50000 0.00000 1\n"


def test_a_devicelog_has_three_numbers_a_vector(tmp_path):
    table = read_table(
        written(tmp_path, "log.txt", DEVICELOG + DEVICELOG.splitlines()[1].replace("0.0", "0.1", 1) + "\n")
    )
    assert table.format == "devicelog"
    assert list(table.columns) == ["TIME", *(f"POSITION.{a}" for a in "xyz"), *(f"FORCE.{a}" for a in "xyz"), "BUTTONS"]
    assert column(table, "FORCE.y") == [-1.5, -1.5]
    assert dict(table.units) == {"TIME": "s"}
    with pytest.raises(InputError, match=r"row 1 \(line 3\)"):
        read_table(written(tmp_path, "log.txt", DEVICELOG + "0.01 0.1\n"))


def hdu(rows, text="(null)"):
    vector = "%f %f %f\t\t"
    return "".join(
        f"{k}\t{vector % (k, 0, -1)}{vector % (2 * k, 5, 6)}{vector % (7, 8, 9)}{text}\n" for k in range(rows)
    )


def test_an_hdurecord_has_force_first_and_no_clock(tmp_path):
    table = read_table(written(tmp_path, "record.txt", hdu(4)))
    assert table.format == "hdurecord"
    assert column(table, "force.x") == [0.0, 1.0, 2.0, 3.0]
    assert column(table, "position.x") == [0.0, 2.0, 4.0, 6.0]
    assert table.units["position.x"] == "mm"
    assert table.units["velocity.z"] == "mm/s"
    assert "tick" not in table.units


def test_the_text_and_the_end_of_an_hdurecord(tmp_path):
    table = read_table(written(tmp_path, "record.txt", hdu(3, "0.5, 7")))
    assert column(table, "text[1]") == [7.0, 7.0, 7.0]
    assert "text" in read_table(written(tmp_path, "words.txt", hdu(3, "touching"))).warnings[0]
    cut = read_table(written(tmp_path, "record.txt", hdu(5)[:-12]))
    assert cut.rows("tick") == 4
    assert "within line 5" in cut.warnings[0]


def svc(rows, promised=None):
    lines = [f"{10 + k:.6f} {20 + k:.6f} {0.008 * k:.6f} 1 500.000000 520.000000 0.250000" for k in range(rows)]
    return "\n".join([str(rows if promised is None else promised), *lines])


def test_handwriting_promises_its_rows(tmp_path):
    table = read_table(written(tmp_path, "a.svc", svc(5)))
    assert table.format == "svc"
    assert table.warnings == ()
    assert column(table, "x") == [10.0, 11.0, 12.0, 13.0, 14.0]
    assert dict(table.units) == {}, "tablets differ: s and mm, or ms and counts"
    short = read_table(written(tmp_path, "b.svc", svc(5, promised=9)))
    assert "promises 9 rows, 5 are whole" in short.warnings[-1]


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (b"\x89PNG\r\n\x1a\n0000", "a PNG picture"),
        (b"%PDF-1.7", "a PDF document"),
        (b"PAR1....", "a Parquet file"),
        (b"<!DOCTYPE html><p>404", "a web page"),
        (b"\x1f\x8b\x08", "a gzip archive"),
        (b'{"a": 1}', "a JSON file"),
        (b"SQLite format 3\x00", "an SQLite database"),
    ],
)
@pytest.mark.parametrize("name", ["run.csv", "run.mat", "run.xyz"])
def test_a_file_that_is_something_else_says_what_it_is(tmp_path, head, words, name):
    with pytest.raises(InputError, match=words):
        read_table(written(tmp_path, name, head + b"\n" * 8))


def test_empty_and_missing_files_say_so(tmp_path):
    with pytest.raises(InputError, match="is empty"):
        read_table(written(tmp_path, "a.csv", ""))
    with pytest.raises(InputError, match="cannot read"):
        read_table(tmp_path / "none.csv")
    with pytest.raises(InputError, match="is text without a row of numbers, no recording"):
        read_table(written(tmp_path, "a.csv", "only words here\nand there\n"))


FRESH = """
from hapticeval.recordings.formats import Table, importer

@importer("acme", about="log of an ACME stick", suffixes=(".acme",))
def read_acme(path):
    rows = [line.split("|") for line in path.read_text().splitlines()]
    return Table(
        {"t": [float(row[0]) for row in rows], "x": [float(row[1]) for row in rows]},
        units={"t": "ms"},
    )
"""


def test_a_fresh_importer_is_a_few_lines(tmp_path, monkeypatch):
    monkeypatch.setattr(registry_module, "KNOWN", dict(registry_module.KNOWN))
    monkeypatch.syspath_prepend(tmp_path)
    written(tmp_path, "acme_logs.py", FRESH)
    path = written(tmp_path, "run.acme", "0|1.5\n10|2.5\n")
    table = read_table(path, format="acme_logs:read_acme")
    assert (dict(table.units), column(table, "x")) == ({"t": "ms"}, [1.5, 2.5])
    assert table.format == "acme_logs:read_acme"
    assert read_table(path).format == "acme"  # known from now on, by its suffix


def test_names_are_given_once_and_suggested(tmp_path, monkeypatch):
    monkeypatch.setattr(registry_module, "KNOWN", dict(registry_module.KNOWN))
    with pytest.raises(InputError, match="is there already"):
        importer("svc", about="another")(lambda path: Table({}))
    with pytest.raises(UnknownNameError, match="matlab"):
        read_table(written(tmp_path, "a.csv", "0,1\n"), format="matlab")
    with pytest.raises(UnknownNameError) as caught:
        read_table(written(tmp_path, "a.csv", "time,pos_x\n0,1\n1,2\n"))["posx"]
    assert "pos_x" in caught.value.todo


@pytest.mark.parametrize("values", [[[1.0, 2.0]], ["a"]])
def test_a_column_must_be_numbers(values):
    with pytest.raises(InputError, match="'x' is of shape"):
        Table({"x": values})
