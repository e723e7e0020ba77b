"""Files that would run code, read other files, or take all memory: refused before any of that."""

import io
import os
import re
import resource
import struct
import subprocess
import sys
import textwrap
import zipfile
import zlib

import h5py
import numpy as np
import pytest
from recording_files import matlab73
from scipy.io import savemat

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.recordings.formats import MOST_COLUMNS, read_table
from hapticeval.recordings.hdf5 import read_recording, salvage, write_recording
from hapticeval.recordings.importing.convert import load
from hapticeval.recordings.memory import limited
from hapticeval.recordings.recording import Recording

MAPPING = """
format = "{format}"
[time]
rate = 1000
[channels.hip]
columns = ["x", "y"]
unit = "m"
sign = 1
"""


def run_of(path, **more):
    meta = {"source": "file", "scene": {"stiffness": 1000.0, "model": {"kind": "circle"}}, **more}
    values = 0.01 * np.column_stack([np.sin(np.arange(60.0)), np.cos(np.arange(60.0))])
    write_recording(path, Recording(np.arange(60) * 1e-3, dict.fromkeys(("hip", "ihip", "force"), values), meta))
    return path


@pytest.mark.parametrize("code", ["runpy:run_path", "os:system", "here:read"])
def test_a_mapping_names_no_code(refused, tmp_path, code):
    (tmp_path / "log.csv").write_text("open('ran', 'w')\nx,y\n1,2\n")
    (tmp_path / "here.py").write_text("open('ran', 'w')\ndef read(path): ...\n")
    (tmp_path / "m.toml").write_text(MAPPING.format(format=code))
    with refused(InputError) as caught:
        load("log.csv", mapping="m.toml")
    assert f"--format {code}" in caught.value.todo
    assert not (tmp_path / "ran").exists()


def test_the_mapping_proposed_for_code_of_yours_leaves_it_to_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "mine_too.py").write_text(
        "from hapticeval.recordings.formats import Table\n"
        "def read(path): return Table({'t': [0., 1., 2.], 'x': [0., 1., 4.]}, units={'t': 'ms', 'x': 'mm'})\n"
    )
    (tmp_path / "log.acme").write_text("0\n")
    command = ["inspect", "log.acme", "--format", "mine_too:read"]
    assert main([*command, "--write-mapping", "m.toml"]) == 0
    assert not re.search("^format", (tmp_path / "m.toml").read_text(), re.MULTILINE)
    assert main(["convert", *command[1:], "--mapping", "m.toml", "-o", "log.h5"]) == 0


@pytest.mark.parametrize("name", ["os:abort", "subprocess:call", "constraint_of_mine:make"])
def test_a_recording_names_no_code(tmp_path, capsys, name):
    (tmp_path / "constraint_of_mine.py").write_text("open('ran', 'w')\n")
    run_of(tmp_path / "a.h5", renderer=name)
    assert main(["replay", "a.h5", "--as-recorded"]) == 2
    assert f"a.h5 names the renderer '{name}', which is not installed" in capsys.readouterr().err
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("where", ["../outside.csv", "{absolute}", "link.csv"])
def test_a_suite_reads_below_its_folder(refused, tmp_path, where):
    from hapticeval.stimulus.paths import file_below

    (tmp_path / "suite").mkdir()
    outside = tmp_path / "outside.csv"
    outside.write_text("t,x,y\n0,0,0\n1,1,1\n")
    (tmp_path / "suite" / "link.csv").symlink_to(outside)
    (tmp_path / "suite" / "path.csv").write_text(outside.read_text())
    with refused(InputError):
        file_below(tmp_path / "suite", where.format(absolute=outside))
    assert file_below(tmp_path / "suite", "path.csv").is_file()


def bomb_h5(path):
    with h5py.File(path, "w") as file:  # never written: a few bytes that read as gigabytes of zeros
        file.create_dataset("x", shape=(200_000_000, 4), dtype=np.float64, chunks=(1_000_000, 4), compression="gzip")


def bomb_73(path):
    with matlab73(path) as file:
        x = file.create_dataset("x", shape=(4, 200_000_000), dtype=np.float64, chunks=(4, 1_000_000))
        x.attrs["MATLAB_class"] = np.bytes_("double")


def laughs_73(path):
    """Ten cells of ten cells of ... of a thousand numbers: 10^8 arrays in a file of a few kilobytes."""
    with matlab73(path) as file:
        refs = file.create_group("#refs#")
        node = refs.create_dataset("leaf", data=np.ones((1, 1000)))
        for level in range(8):
            node = refs.create_dataset(f"l{level}", data=np.array([[node.ref] * 10]), dtype=h5py.ref_dtype)
            node.attrs["MATLAB_class"] = np.bytes_("cell")
        file["c"] = node


def bomb_5(path):
    tag = struct.pack("<II", 9, 3_200_000_000)
    head = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, 400_000_000, 1)
    head += struct.pack("<HH4s", 1, 1, b"x") + tag
    packer = zlib.compressobj(9)
    packed = packer.compress(struct.pack("<II", 14, len(head) + 3_200_000_000) + head)
    packed += b"".join(packer.compress(bytes(1 << 22)) for _ in range(30)) + packer.flush()
    header = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + b"\x00\x01IM"
    path.write_bytes(header + struct.pack("<II", 15, len(packed)) + packed)


def bomb_npz(path):
    with path.open("wb") as file:
        np.savez_compressed(file, x=np.zeros(30_000_000))


@pytest.mark.system
@pytest.mark.parametrize("make", [bomb_h5, bomb_73, laughs_73, bomb_5, bomb_npz])
def test_what_takes_more_memory_than_allowed_is_refused_before_it_is_taken(tmp_path, make):
    path = tmp_path / "bomb.dat"
    make(path)
    assert path.stat().st_size < 1_000_000
    code = f"""
        import resource
        from hapticeval.errors import InputError
        from hapticeval.recordings.formats import read_table
        from hapticeval.recordings.memory import limited
        import h5py, scipy.io
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        try:
            with limited(0.1):
                read_table({str(path)!r})
        except InputError as error:
            print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, error.what, "|", error.todo)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=False)
    taken, _, words = done.stdout.partition(" ")
    assert words, done.stderr
    assert int(taken) < 400_000  # kilobytes; the limit is 100 MB, and a copy or two of that much may be made
    assert "would take" in words or "more than 100000 parts" in words


@pytest.mark.parametrize("command", ["inspect", "convert"])
def test_a_pipe_and_a_device_are_refused_and_not_waited_for(tmp_path, capsys, command):
    os.mkfifo(tmp_path / "a.csv")
    for name in ("a.csv", "/dev/zero"):
        assert main([command, name, *(["-o", "b.h5"] if command == "convert" else [])]) == 2
        assert f"{name} is not a file" in capsys.readouterr().err


def test_a_table_of_more_columns_than_any_device_has_is_refused_at_once(refused, tmp_path):
    count = 200_000
    row = ",".join(["1.5"] * count)
    path = tmp_path / "wide.csv"
    path.write_text(",".join(f"x{k}" for k in range(count)) + f"\n{row}\n{row}\n")
    with refused(InputError):
        read_table(path)
    np.savez(tmp_path / "wide.npz", x=np.zeros((MOST_COLUMNS + 2, MOST_COLUMNS + 1), dtype=np.int8))
    with refused(InputError):
        read_table(tmp_path / "wide.npz")


def test_a_text_takes_a_few_times_its_size(refused, tmp_path):
    """Beside the text are the parser's words and its numbers, in 8 bytes of the ten that a cell has, twice."""
    path = tmp_path / "a.csv"
    row = ",".join(f"{k}.123456789" for k in range(1, 9))
    path.write_text("a,b,c,d,e,f,g,h\n" + f"{row}\n" * 300_000)
    code = f"""
        import resource
        from hapticeval.recordings.formats import read_table
        import pandas, numpy
        read_table({str(tmp_path / "small.csv")!r})
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        read_table({str(path)!r})
        print(1000 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before))
    """
    (tmp_path / "small.csv").write_text("a,b\n1.5,2.5\n" * 2)
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 6 * path.stat().st_size
    with limited(0.01), refused(InputError):
        read_table(path)


def test_the_limit_is_an_option(tmp_path, capsys):
    np.savez(tmp_path / "a.npz", t=np.arange(100_000.0), x=np.zeros(100_000))
    assert main(["inspect", "a.npz", "--memory-limit", "0.001"]) == 2
    assert "would take 0.0016 GB" in capsys.readouterr().err
    assert main(["inspect", "a.npz"]) == 0
    run_of(tmp_path / "a.h5")
    for command in (["inspect", "a.h5"], ["convert", "a.h5", "-o", "b.csv"], ["replay", "a.h5"]):
        assert main([*command, "--memory-limit", "0.000001"]) == 2
        assert "the limit for one file is 1e-06 GB" in capsys.readouterr().err


def test_a_recording_that_declares_a_far_end_is_not_filled_up_to_it(refused, tmp_path):
    path = run_of(tmp_path / "a.h5")
    data = path.read_bytes()
    path.write_bytes(data[:28] + (3 * 10**9).to_bytes(8, "little") + data[36:])
    with refused(InputError):
        salvage(path)


@pytest.mark.parametrize("kind", ["external", "virtual", "link"])
def test_no_other_file_is_read_through_an_hdf5_file(refused, tmp_path, kind):
    secret = tmp_path / "secret"
    secret.write_bytes(np.arange(60.0).tobytes())
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = np.arange(60.0)

    def put(group, name):
        if kind == "external":
            group.create_dataset(name, shape=(60,), dtype=np.float64, external=[(str(secret), 0, 480)])
        elif kind == "virtual":
            layout = h5py.VirtualLayout(shape=(60,), dtype=np.float64)
            layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", shape=(60,))
            group.create_virtual_dataset(name, layout)
        else:
            group[name] = h5py.ExternalLink(str(tmp_path / "other.h5"), "x")

    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["t"] = np.arange(60.0)
        put(file, "x")
    table = read_table(tmp_path / "foreign.h5")
    assert list(table.columns) == ["t"]
    assert "'x' lies in another file, which is not opened" in table.warnings[0]
    ours = run_of(tmp_path / "ours.h5")
    with h5py.File(ours, "r+") as file:
        put(file["channels"], "odd")
        if kind != "link":
            file["channels/odd"].attrs["unit"] = np.bytes_("N")
    with refused(InputError):
        read_recording(ours)
    assert "odd" not in salvage(ours).channels


def test_groups_within_groups_have_an_end(refused, tmp_path):
    path = tmp_path / "deep.h5"
    with h5py.File(path, "w") as file:
        group = file
        for _ in range(200):
            group = group.create_group("g")
        group["x"] = np.arange(60.0)
    with refused(InputError):
        read_table(path)
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(60.0)
        file.create_group("a")["again"] = file["/"]  # a group that holds itself
    assert list(read_table(path).columns) == ["t"]


def test_structures_within_structures_do_not_end_the_process(tmp_path):
    """scipy reads them by recursion in C: five thousand cells in each other, 280 kB, were a segmentation fault.

    How deep it comes before that is a matter of the stack, so that the text of the error is not the same everywhere.
    """

    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    flags = element(6, struct.pack("<II", 1, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    body = element(14, element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b""))
    for _ in range(5000):
        body = element(14, flags + body)
    path = tmp_path / "deep.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + b"\x00\x01IM" + body)
    with pytest.raises(InputError, match="cut short or damaged"):
        read_table(path)
    shallow = {"a": {"b": {"c": np.arange(20.0)}}}
    savemat(path, shallow)
    assert list(read_table(path).columns) == ["a.b.c"]


def test_an_array_that_declares_more_than_it_holds_is_damaged(refused, tmp_path):
    """A header of 10^12 numbers over eighty bytes."""
    path = tmp_path / "a.npz"
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("x.npy", stream.getvalue() + bytes(80))
    with refused(InputError):
        read_table(path)
    assert path.stat().st_size < 1000
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 8_000_000
