"""Whatever a file holds, the commands read it or refuse it: no traceback, no warning of a library.

Files of every format are damaged, spliced and grown. One that breaks a reader is kept in `.hypothesis/kept`.
"""

import io
import shutil
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import cache, partial
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import example, given, note, settings
from hypothesis import strategies as st
from recording_files import journal_of, matlab73, matrix73
from scipy.io import savemat

from hapticeval.cli import main
from hapticeval.errors import HapticevalError
from hapticeval.recordings.formats import read_table
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.importing.convert import convert
from hapticeval.recordings.importing.mapping import parse_mapping
from hapticeval.recordings.recording import Clock, Recording
from hapticeval.reports.canvas import save_figure

KEPT = Path(".hypothesis/kept").absolute()
ROWS = 12
TIME = 0.002 * np.arange(ROWS)
HIP = np.column_stack([0.1 * np.cos(TIME), 0.1 * np.sin(TIME)])
FORCE = 1e3 * (0.1 - HIP)
NAMES, TABLE = ["t", "x", "y", "fx", "fy"], np.column_stack([TIME, HIP, FORCE])
COLUMNS = dict(zip(NAMES, TABLE.T, strict=True))
CHANNELS = {"hip": ("m", ["x", "y"]), "force": ("N", ["fx", "fy"])}
MAPPING = {name: {"columns": columns, "unit": unit, "sign": 1} for name, (unit, columns) in CHANNELS.items()}
RUN = Recording.clocked(
    Clock(2_000_000 * np.arange(ROWS)),
    {"hip": HIP, "ihip": HIP, "force": FORCE},
    {"renderer": "mine", "scene": {"stiffness": 1000.0, "model": {"kind": "circle", "size": 0.2}}},
)


def lines(*head, row):
    return "\n".join([*head, *(row(k, *values) for k, values in enumerate(TABLE))]).encode()


def text(separator):
    return lines(separator.join(NAMES), row=lambda _, *values: separator.join(f"{x:.9g}" for x in values)) + b"\n"


def hdf5(path):
    with h5py.File(path, "w") as file:
        for name, values in COLUMNS.items():
            file.create_dataset(f"run/{name}", data=values, chunks=(4,), compression="gzip")
        file["t"] = TIME
        file["t"].attrs["units"] = "s"


def mat73(path):
    with matlab73(path) as file:
        for name, values in COLUMNS.items():
            matrix73(file, name, values[None])


WRITERS = {
    "comma.csv": text(","),
    "german.csv": text(";").replace(b".", b","),
    "spaces.dat": text("  "),
    "device.txt": lines(
        "TIME POSITION FORCE", row=lambda _, *v: "{:.5f} {:.5f} {:.5f} 0.0 {:.5f} {:.5f} 0.0".format(*v)
    ),
    "record.txt": lines(row=lambda k, *_: f"{k}\t{k}.0 0.0 -1.0\t\t5.0 5.0 6.0\t\t7.0 8.0 9.0\t\t(null)") + b"\n",
    "a.svc": lines(f"{ROWS}", row=lambda k, *_: f"{10 + k:.6f} {20 + k:.6f} {8 * k:.6f} 1 500.0 520.0 0.25"),
    "ours.journal": b"".join(journal_of(RUN, size=4, closed=False)),
    "a.h5": hdf5,
    "a73.mat": mat73,
    "a5.mat": lambda path: savemat(path, {"run": COLUMNS, **COLUMNS}),
    "packed5.mat": lambda path: savemat(path, COLUMNS, do_compression=True),
    "a.npz": lambda path: np.savez(path, **COLUMNS),
    "packed.npz": lambda path: np.savez_compressed(path, **COLUMNS),
    "ours.h5": lambda path: write_recording(path, RUN),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder for the files; what is readable is drawn once, and not in two formats."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hapticeval.reports.integrity_figure.save_figure", partial(save_figure, kinds=("svg",)))
        yield tmp_path_factory.mktemp("files")


@cache
def undamaged_bytes(folder, name):
    if isinstance(WRITERS[name], bytes):
        return WRITERS[name]
    WRITERS[name](folder / name)
    return (folder / name).read_bytes()


WORDS = [*b'nan -inf 1e999 0x10 " , ; # ?'.split(), b"\t", b"\r", b"\n\n", b"\xff\xfe", b"\xef\xbb\xbf"]
WORDS += [b"\x00" * 8, b"\xff" * 8, b"99999999999999999999", "é°ß".encode(), "é°".encode("latin-1"), b"1,5"]
places, spans, words = (
    st.floats(0.0, 1.0),
    st.integers(0, 64),
    st.one_of(st.sampled_from(WORDS), st.binary(max_size=16)),
)
damages = st.one_of(
    st.tuples(st.just("cut"), places),
    st.tuples(st.just("double"), places, spans),
    st.tuples(st.just("write"), places, spans, words),  # in place of so many bytes
    st.tuples(st.just("splice"), places, st.sampled_from(list(WRITERS))),
)


def damaged(folder, data, kind, place, *rest):
    at = int(place * len(data))
    if kind == "splice":
        return data[:at] + undamaged_bytes(folder, rest[0])[at:]
    if kind == "write":
        return data[:at] + rest[1] + data[at + rest[0] :]
    return data[: at + rest[0]] + data[at:] if kind == "double" else data[:at]


def survives(folder, name, data):
    """Inspecting the file, and converting it, ends with an exit code."""
    path = folder / f"hurt-{name}"
    path.write_bytes(data)
    err = io.StringIO()
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(err):
            assert main(["inspect", str(path), "-o", str(folder)]) in (0, 1, 2)
            with suppress(HapticevalError):
                convert(read_table(path), parse_mapping({"time": {"column": "t", "unit": "s"}, "channels": MAPPING}))
    except BaseException:
        KEPT.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, KEPT / name)
        note(f"the file is kept as {KEPT / name}")
        raise
    assert "Traceback" not in err.getvalue()


@pytest.mark.system
@settings(max_examples=20)
@given(hurt=st.lists(damages, max_size=4))
@pytest.mark.parametrize("name", WRITERS)
def test_a_damaged_file_is_read_or_refused(folder, name, hurt):
    data = undamaged_bytes(folder, name)
    for damage in hurt:
        data = damaged(folder, data, *damage)
    survives(folder, name, data)


numbers = st.one_of(st.floats(), st.integers(), st.sampled_from(["", "nan", "ERR", "1,5", "-", "1e5", '"2"', "0x1F"]))


OVERFLOWS = [[0.0, 3.7491161670501375e297], [0.0, -1.7976931348248246e308]]
"""The step between the two numbers is none."""


@example(rows=OVERFLOWS, separator=",", header="", end="\n", encoding="utf-8")
@example(rows=[[row[1]] for row in OVERFLOWS], separator=",", header="time", end="\n", encoding="utf-8")
@settings(max_examples=30)
@given(
    rows=st.lists(st.lists(numbers, min_size=1, max_size=4), min_size=1, max_size=8),
    separator=st.sampled_from([",", ";", "\t", " ", ", ", "|"]),
    header=st.one_of(st.just(""), st.text(max_size=40)),
    end=st.sampled_from(["\n", "\r\n", "\r", ""]),
    encoding=st.sampled_from(["utf-8", "utf-16", "utf-8-sig"]),
)
def test_any_text_is_read_or_refused(folder, rows, separator, header, end, encoding):
    lines = [header, *(separator.join(str(cell) for cell in row) for row in rows)]
    survives(folder, "any.csv", (end or "\n").join(lines).encode(encoding, errors="replace") + end.encode())


@settings(max_examples=30)
@given(data=st.binary(max_size=300), name=st.sampled_from(list(WRITERS)))
@example(data=b"", name="a.h5")
def test_any_bytes_are_read_or_refused(folder, data, name):
    survives(folder, name, data)
