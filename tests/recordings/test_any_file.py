"""Whatever a file holds, the commands read it or say what is wrong with it: no traceback, no warning of a library.

Files of every format are damaged, spliced and grown. One that breaks a reader is kept in `.hypothesis/kept`.
"""

from __future__ import annotations

import io
import shutil
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import cache
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

KEPT = Path(".hypothesis/kept").absolute()
ROWS = 12
TIME = 0.002 * np.arange(ROWS)
HIP = np.column_stack([0.1 * np.cos(TIME), 0.1 * np.sin(TIME)])
FORCE = 1e3 * (0.1 - HIP)
MAPPING = parse_mapping(
    {
        "time": {"column": "t", "unit": "s"},
        "channels": {
            "hip": {"columns": ["x", "y"], "unit": "m", "sign": 1},
            "force": {"columns": ["fx", "fy"], "unit": "N", "sign": 1},
        },
    }
)
COLUMNS = {"t": TIME, "x": HIP[:, 0], "y": HIP[:, 1], "fx": FORCE[:, 0], "fy": FORCE[:, 1]}


def text(separator, *, comma=False):
    def write(path):
        rows = [separator.join(COLUMNS)]
        rows += [separator.join(f"{value:.9g}" for value in row) for row in zip(*COLUMNS.values(), strict=True)]
        written = "\n".join(rows) + "\n"
        path.write_text(written.replace(".", ",") if comma else written)

    return write


def devicelog(path):
    rows = ["TIME POSITION FORCE BUTTONS"]
    rows += [
        f"{t:.5f} {x:.5f} {y:.5f} 0.0 {fx:.5f} {fy:.5f} 0.0 1"
        for t, x, y, fx, fy in zip(*COLUMNS.values(), strict=True)
    ]
    path.write_text("\n".join(rows) + "\n")


def hdurecord(path):
    vectors = (f"{k}\t{f'{k} 0 -1'}\t\t{f'{2 * k} 5 6'}\t\t7 8 9\t\t(null)\n" for k in range(ROWS))
    path.write_text("".join(vectors))


def svc(path):
    rows = (f"{10 + k:.6f} {20 + k:.6f} {8 * k:.6f} 1 500.0 520.0 0.25" for k in range(ROWS))
    path.write_text("\n".join([str(ROWS), *rows]))


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


def ours(path):
    channels = {"hip": HIP, "ihip": HIP, "force": FORCE}
    meta = {"renderer": "mine", "scene": {"stiffness": 1000.0, "model": {"kind": "circle", "size": 0.2}}}
    write_recording(path, Recording.clocked(Clock(2_000_000 * np.arange(ROWS)), channels, meta))


def journal(path):
    run = Recording(TIME, {"hip": HIP, "force": FORCE}, {"renderer": "mine"})
    path.write_bytes(b"".join(journal_of(run, size=4, closed=False)))


WRITERS = {
    "comma.csv": text(","),
    "german.csv": text(";", comma=True),
    "tabs.txt": text("\t"),
    "spaces.dat": text("  "),
    "device.txt": devicelog,
    "record.txt": hdurecord,
    "a.svc": svc,
    "a.h5": hdf5,
    "a73.mat": mat73,
    "a5.mat": lambda path: savemat(path, {"run": COLUMNS, **COLUMNS}),
    "packed5.mat": lambda path: savemat(path, COLUMNS, do_compression=True),
    "a.npz": lambda path: np.savez(path, **COLUMNS),
    "packed.npz": lambda path: np.savez_compressed(path, **COLUMNS),
    "ours.h5": ours,
    "ours.journal": journal,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("files")


@cache
def whole(folder, name):
    path = folder / name
    WRITERS[name](path)
    return path.read_bytes()


places = st.floats(0.0, 1.0)
spans = st.integers(1, 64)
WORDS = [
    b"nan",
    b"-inf",
    b"1e999",
    b"0x10",
    b'"',
    b",",
    b";",
    b"\t",
    b"\r",
    b"\n\n",
    b"#",
    b"\xef\xbb\xbf",
    b"\xff\xfe",
]
WORDS += [b"\x00" * 8, b"\xff" * 8, b"99999999999999999999", "é°ß".encode(), "é°".encode("latin-1"), b"1,5", b"?"]
damages = st.one_of(
    st.tuples(st.just("cut"), places),
    st.tuples(st.just("flip"), places, st.integers(1, 255)),
    st.tuples(st.just("remove"), places, spans),
    st.tuples(st.just("double"), places, spans),
    st.tuples(st.just("insert"), places, st.one_of(st.sampled_from(WORDS), st.binary(max_size=16))),
    st.tuples(st.just("write"), places, st.one_of(st.sampled_from(WORDS), st.binary(max_size=16))),
    st.tuples(st.just("splice"), places, st.sampled_from(list(WRITERS))),
)


def damaged(folder, data, damage):
    kind, place, *rest = damage
    at = int(place * len(data))
    (what,) = rest or (None,)
    match kind:
        case "cut":
            return data[:at]
        case "flip":
            return data[:at] + bytes(byte ^ what for byte in data[at : at + 1]) + data[at + 1 :]
        case "remove":
            return data[:at] + data[at + what :]
        case "double":
            return data[: at + what] + data[at:]
        case "insert":
            return data[:at] + what + data[at:]
        case "write":
            return data[:at] + what + data[at + len(what) :]
        case _:
            return data[:at] + whole(folder, what)[at:]


def survives(folder, name, data):
    """Inspecting the file, and converting it, ends with an exit code."""
    path = folder / f"hurt-{name}"
    path.write_bytes(data)
    out, err = io.StringIO(), io.StringIO()
    try:
        with redirect_stdout(out), redirect_stderr(err):
            assert main(["inspect", str(path), "-o", str(folder)]) in (0, 1, 2)
            with suppress(HapticevalError):
                convert(read_table(path), MAPPING)
    except BaseException:
        KEPT.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, KEPT / name)
        note(f"the file is kept as {KEPT / name}")
        raise
    assert "Traceback" not in err.getvalue()


@settings(max_examples=20)
@given(hurt=st.lists(damages, max_size=4))
@pytest.mark.parametrize("name", WRITERS)
def test_a_damaged_file_is_read_or_refused(folder, name, hurt):
    data = whole(folder, name)
    for damage in hurt:
        data = damaged(folder, data, damage)
    survives(folder, name, data)


numbers = st.one_of(st.floats(), st.integers(), st.sampled_from(["", "nan", "ERR", "1,5", "-", "1e5", '"2"', "0x1F"]))


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
