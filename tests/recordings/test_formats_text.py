"""Text formats: what they hold, where they end, and what they are not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.errors import InputError, UnknownNameError
from hapticeval.recordings import formats as registry
from hapticeval.recordings.formats import Table, importer, read_table
from hapticeval.recordings.formats.text import is_whole
from hapticeval.recordings.importing.proposal import clocks

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)
NAN = float("nan")


@pytest.fixture
def table(tmp_path):
    """Read a text as the file of a name."""

    def read(text, name="a.csv", **more):
        (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_table(tmp_path / name, **more)

    return read


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
        (f"t,x\n{1_700_000_000_123_456_789},1\n{1_700_000_000_123_456_790},2.5\n", ["t", "x"], [1.0, 2.5]),
        ("t,x\n" + "0,1\n" * 150 + "PAUSED\n" + "1,2.5\n" * 150, ["t", "x"], [1.0] * 150 + [NAN] + [2.5] * 150),
        ("t;x\n0,0;1,5\n0,1;ERR\n0,2;2,5\n", ["t", "x"], [1.5, NAN, 2.5]),
        ("t,x\n0,1\n1,\n2,oops\n3,4\n", ["t", "x"], [1.0, NAN, NAN, 4.0]),
        ("t,state,x\n0,free,1\n1,touch,2.5\n", ["t", "x"], [1.0, 2.5]),
    ],
)
def test_delimited_text_is_read_whatever_its_dialect(table, text, names, second):
    found = table(text)
    assert list(found.columns) == names
    np.testing.assert_array_equal(found[names[1]], second)
    count = int(np.sum(np.isnan(second)))
    assert [each.partition(" ")[0] for each in found.warnings if "'x'" in each] == [str(count)] * (count > 0)
    assert found.remarks == (("the column 'state' is text, which is left out",) if "state" in str(text) else ())
    assert "123_456_789" not in str(text) or np.diff(found["t"]).tolist() == [1]


def test_a_cell_without_a_number_is_located(table):
    text = "t;x;y\n0,0;1,5;2,5\n0,1;ERR;ERR\n0,2;2,5;3,5\n"
    assert table(text).warnings == ("1 cell without a number in 'x', 'y', first at row 1: 'ERR'",)
    assert "2 cells without a number in 'x', first at row 1" in table("t,x\n0,1\n1,\n2,\n").warnings[0]


@pytest.mark.parametrize("cell", ["1.000,5", "1,000,000", "-12'000.25"])
def test_signs_between_thousands_are_named_and_what_to_do(table, cell):
    (warning,) = table(f"t;x\n0;1\n1;{cell}\n2;3\n").warnings
    assert warning.endswith(f"first at row 1: {cell!r}, so write numbers without a sign between thousands")


@pytest.mark.parametrize("cell", ["2026-03-29T01:59:58.001", "29.03.2026 01:59", "01:59:58"])
def test_a_clock_that_is_a_date_or_a_time_of_the_day_is_named_and_what_to_do(table, cell):
    (remark,) = table(f"stamp;x\n{cell};1\n{cell};2\n").remarks
    assert remark == (
        "the column 'stamp' is text, which is left out: a clock is read where it counts, so write it in seconds"
    )


def test_decimal_commas_between_commas_are_refused_and_a_line_above_numbers_is_not(table, refused):
    with refused(InputError):
        table("t,x\n0,0,1,5\n0,1,2,5\n")
    assert list(table("Rig 7\n0,1\n1,2\n").columns) == ["c0", "c1"]


@pytest.mark.parametrize("width", [600, 9000])
def test_a_header_of_any_length_is_one(table, width):
    names = [f"channel number {k}" for k in range(width)]
    rows = "".join(",".join(f"{k + row}" for k in range(width)) + "\n" for row in range(3))
    found = table(",".join(names) + "\n" + rows)
    assert list(found.columns) == names
    assert found[names[-1]].tolist() == [width - 1, width, width + 1]


@pytest.mark.parametrize("named", [False, True])
def test_rows_and_columns_that_are_swapped(table, named):
    """13 signals in 13 lines of 500 numbers each."""
    values = np.random.default_rng(0).normal(size=(13, 500)).round(6)
    lines = [",".join([f"s{k}"] * named + [repr(x) for x in row.tolist()]) for k, row in enumerate(values)]
    found = table("\n".join(lines) + "\n")
    assert list(found.columns) == [f"s{k}" if named else f"c{k}" for k in range(13)]
    assert np.array_equal(found["s7" if named else "c7"], values[7])
    assert "its 13 rows are taken for the signals" in found.remarks[0]


def test_units_in_the_header_are_the_files_own_word(table):
    assert dict(table("t [ms],x (mm),f\n0,1,2\n1,2,3\n").units) == {"t [ms]": "ms", "x (mm)": "mm"}
    second = table("t,x,f\ns,mm,\n0,1,2\n1,2,3\n")
    assert dict(second.units) == {"t": "s", "x": "mm"}
    assert second["x"].tolist() == [1.0, 2.0]


@settings(max_examples=40)
@given(rows=st.lists(st.tuples(NUMBERS, NUMBERS), min_size=2, max_size=12))
def test_numbers_come_back_bit_for_bit(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    path.write_text("a,b\n" + "".join(f"{a!r},{b!r}\n" for a, b in rows))
    for k, name in enumerate("ab"):
        assert read_table(path)[name].tolist() == [row[k] for row in rows]


@pytest.mark.parametrize("cut", range(1, 61))
def test_a_file_cut_anywhere_gives_only_rows_that_were_written(table, cut):
    rows = [(k * 0.25, 1000.0 + 0.37 * k * k) for k in range(12)]
    text = "t,x\n" + "".join(f"{t!r},{x!r}\n" for t, x in rows)
    found = table(text[:-cut])
    kept = list(zip(found["t"].tolist(), found["x"].tolist(), strict=True))
    assert kept == rows[: len(rows) - text[-cut:].count("\n")]
    whole = text[:-cut].endswith("\n")
    assert [f"within line {len(kept) + 2}, which is left out" in each for each in found.warnings] == [True] * (
        not whole
    )


def test_a_last_row_of_fixed_decimals_needs_no_line_end():
    before = ["0.00 1.250", "0.01 1.260"]
    assert is_whole("0.02 1.270", before)
    assert not any(is_whole(last, before) for last in ("0.02 1.27", "0.02"))
    assert not is_whole("3 7", ["1 5", "2 6"])


LOG = "TIME POSITION FORCE BUTTONS\n0.00000 0.10000 0.20000 0.30000 0.00000 -1.50000 0.00000 1\n"


def test_a_devicelog_has_three_numbers_per_vector(table):
    found = table(LOG + LOG.splitlines()[1].replace("0.0", "0.1", 1) + "\n", "log.txt")
    assert list(found.columns) == ["TIME", *(f"POSITION.{a}" for a in "xyz"), *(f"FORCE.{a}" for a in "xyz"), "BUTTONS"]
    assert found["FORCE.y"].tolist() == [-1.5, -1.5]
    assert dict(found.units) == {"TIME": "s"}


def hdu(rows, text="(null)"):
    vector = "%f %f %f\t\t"
    numbers = (vector % (k, 0, -1) + vector % (2 * k, 5, 6) + vector % (7, 8, 9) for k in range(rows))
    return "".join(f"{k}\t{each}{text}\n" for k, each in enumerate(numbers))


def test_an_hdurecord_has_force_first_and_no_clock(table):
    found = table(hdu(4), "record.txt")
    assert found["force.x"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert found["position.x"].tolist() == [0.0, 2.0, 4.0, 6.0]
    assert {name: found.units.get(name) for name in ("position.x", "velocity.z", "tick")} == {
        "position.x": "mm", "velocity.z": "mm/s", "tick": None}  # fmt: skip
    assert table(hdu(3, "touching it now"), "words.txt").remarks == ("the application's text is left out",)
    cut = table(hdu(5)[:-12], "record.txt")
    assert cut.rows("tick") == 4
    assert "within line 5" in cut.warnings[0]


def test_a_number_above_the_table_is_none_of_its_rows(table):
    """As pen tablets write their rows (.svc)."""
    rows = [f"{10 + k:.6f} {20 + k:.6f} {0.008 * k:.6f} 1 500.000000 520.000000 0.250000" for k in range(5)]
    found = table("\n".join(["5", *rows]), "a.svc")
    assert (found.format, found.warnings, found.remarks) == ("csv", (), ("the line '5' above the table is left out",))
    assert found["c0"].tolist() == [10.0, 11.0, 12.0, 13.0, 14.0]


@pytest.mark.parametrize(
    ("text", "names", "remark"),
    [
        ("Time, elapsed,x,y\n0,1,2\n1,2,3\n", ["Time, elapsed", "x", "y"], ""),
        ("t,x,y,\n0,1,2\n1,2,3\n", ["t", "x", "y"], ""),
        ("t,x,y\n0,1,2,\n1,2,3,\n", ["t", "x", "y"], "'c3' has no number in any row"),
        ("t,x,y,z\n0,1,2\n1,2,3\n", ["c0", "c1", "c2"], "'t,x,y,z' has 4 cells and the rows 3: it names no column"),
        ("x y\n1 0.5 0.25\n2 0.5 0.5\n", ["c0", "c1", "c2"], "'x y' has 2 cells and the rows 3"),
    ],
)
def test_a_header_of_another_width_gives_its_names_or_a_remark(table, text, names, remark):
    found = table(text)
    assert list(found.columns) == names
    assert remark in " ".join(found.remarks)
    assert bool(remark) == bool(found.remarks)


def test_decimal_commas_in_quotes_are_decimals(table):
    found = table('t,x\n"0,0","1,5"\n"0,1","ERR"\n"0,2","2,5"\n')
    np.testing.assert_array_equal(found["x"], [1.5, NAN, 2.5])
    assert found["t"].tolist() == [0.0, 0.1, 0.2]


def test_labview_names_its_columns_below_the_end_of_its_header(table):
    text = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
    text += "Channels\t2\t\t\nSamples\t3\t3\t\nDelta_X\t0.001\t0.001\t\n***End_of_Header***\t\t\t\n"
    text += "X_Value\tPosition\tForce\tComment\n" + "".join(f"{k * 1e-3:.6f}\t{k}.5\t{k}.25\n" for k in range(30))
    found = table(text, "a.lvm")
    assert list(found.columns) == ["X_Value", "Position", "Force"]
    assert found["Force"].tolist() == [k + 0.25 for k in range(30)]


@pytest.mark.parametrize("format", [None, "csv"])
@pytest.mark.parametrize("text", ["\n\n\n", "  ", "\r\n \r\n", "# only a remark\n", "1", "POSITION", "t,x\n", "\0\0\0"])
def test_a_file_without_a_row_has_none(table, format, text):
    try:
        found = table(text, format=format)
    except InputError:
        return
    assert not any(map(found.rows, found.columns))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("t,x\n0,1\n1,2,3\n", "a.csv"),
        ("x,x\n0,1\n1,2\n", "a.csv"),
        ("", "a.csv"),
        ("only words here\nand there\n", "a.csv"),
        *((head + b"\n" * 8, name) for name in ("run.csv", "run.mat", "run.xyz") for head in (
            b"\x89PNG\r\n\x1a\n0000", b"%PDF-1.7", b"PAR1....", b"<!DOCTYPE html><p>404", b"\x1f\x8b\x08",
            b'{"a": 1}', b"SQLite format 3\x00",
        )),
    ],
)  # fmt: skip
def test_what_is_no_table_is_named(refused, table, text, name):
    with refused(InputError):
        table(text, name)


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


def test_a_fresh_importer_is_a_few_lines(table, tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "REGISTERED", dict(registry.REGISTERED))
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "acme_logs.py").write_text(FRESH)
    found = table("0|1.5\n10|2.5\n", "run.acme", format="acme_logs:read_acme")
    assert (dict(found.units), found["x"].tolist()) == ({"t": "ms"}, [1.5, 2.5])
    assert found.format == "acme_logs:read_acme"
    assert read_table(tmp_path / "run.acme").format == "acme"  # known from now on, by its suffix


def test_names_are_given_once_and_suggested(refused, table, monkeypatch):
    monkeypatch.setattr(registry, "REGISTERED", dict(registry.REGISTERED))
    with refused(InputError):
        importer("npz", about="another")(lambda path: Table({}))
    with refused(UnknownNameError):
        table("0,1\n", format="matlab")
    with refused(UnknownNameError):
        table("time,pos_x\n0,1\n1,2\n")["posx"]
    with refused(UnknownNameError):
        table("time,pos_x,lost\n0,1,nan\n1,2,nan\n")["lost"]


@pytest.mark.parametrize("values", [[[1.0, 2.0]], ["a"]])
def test_a_column_must_be_numbers(refused, values):
    with refused(InputError):
        Table({"x": values})


@pytest.mark.parametrize(
    ("seconds", "nanoseconds"),
    [("header.stamp.secs", "header.stamp.nsecs"), ("stamp/sec", "stamp/nanosec"), ("tv_sec", "tv_nsec")],
)
def test_seconds_and_their_nanoseconds_are_one_clock_to_the_nanosecond(tmp_path, seconds, nanoseconds):
    start = 1_700_000_000_999_999_998
    rows = "".join(f"{stamp // 10**9},{stamp % 10**9},{stamp - start}\n" for stamp in range(start, start + 5))
    (tmp_path / "a.csv").write_text(f"{seconds},{nanoseconds},pos_x\n{rows}")
    table = read_table(tmp_path / "a.csv")
    (clock,) = clocks(table)
    assert table[clock].tolist() == list(range(start, start + 5))
    assert table.units[clock] == "ns"


@pytest.mark.parametrize(
    "stamps", [["1.5,3", "2.5,4"], ["1,3000000000", "2,4"], ["1,-1", "2,4"], ["9900000000,1", "1,2"]]
)
def test_numbers_that_are_no_seconds_and_nanoseconds_are_not_joined(tmp_path, stamps):
    (tmp_path / "a.csv").write_text("\n".join(["secs,nsecs", *stamps]))
    assert set(read_table(tmp_path / "a.csv").columns) == {"secs", "nsecs"}
