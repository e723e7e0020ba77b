"""Look-up tables in files: what was saved is read, damage is one clear error, and only what is touched is loaded."""

import json
import math
import shutil
import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
from lut_sources import sphere

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import star
from hapticeval.renderers.family import by_minimum_distance
from hapticeval.renderers.lut import LutProjection
from hapticeval.renderers.lut_build import fill, tabulate
from hapticeval.renderers.lut_file import FRONT, MAGIC, START, VERSION, create, finish, load, save
from hapticeval.renderers.lut_table import empty, grid_over
from hapticeval.scene import Scene

STAR = star()


@pytest.fixture(scope="module")
def table():
    return tabulate(by_minimum_distance(Scene(model=STAR, bilateral=True), "curve"), cell=4e-3)


@pytest.fixture
def path(table, tmp_path):
    save(table, tmp_path / "star.lut")
    return tmp_path / "star.lut"


def test_what_was_saved_is_what_is_loaded(table, path):
    loaded = load(path)
    assert (loaded.grid, loaded.everywhere, loaded.standoff) == (table.grid, table.everywhere, table.standoff)
    np.testing.assert_array_equal(loaded.nodes, table.nodes)
    np.testing.assert_array_equal(loaded.cells, table.cells)
    hips = np.random.default_rng(1).uniform(-0.12, 0.12, (5000, 2))
    for ours, theirs in zip(loaded.answers(hips), table.answers(hips), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    projection = LutProjection(loaded, STAR.curve, resolution=loaded.grid.cell)
    ihips, _, contact = projection.trace(hips)
    assert np.max(np.abs(STAR.curve.signed_distance(ihips[contact]))) <= loaded.standoff


def test_the_file_is_laid_out_as_documented(table, path):
    raw = path.read_bytes()
    magic, version, length, checksum = struct.unpack_from("<8sIII", raw)
    assert (magic, version) == (b"HEVALLUT", 1)
    header = raw[20 : 20 + length]
    assert zlib.crc32(header) == checksum
    fields = json.loads(header)
    columns, rows = fields["cells"]
    nodes = np.frombuffer(raw, "<f8", (rows + 1) * (columns + 1) * 4, 4096).reshape(rows + 1, columns + 1, 4)
    np.testing.assert_array_equal(nodes, table.nodes)
    assert raw[4096 + nodes.nbytes :] == table.cells.tobytes()
    assert fields["origin"] == list(table.grid.origin)
    assert (fields["cell"], fields["everywhere"], fields["standoff"]) == (4e-3, False, table.standoff)


def refused(path):
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(path) in caught.value.what
    assert caught.value.why
    return str(caught.value)


def rewritten(path, **changes):
    """The same file with another header, whose checksum is right."""
    raw = bytearray(path.read_bytes())
    _, _, length, _ = FRONT.unpack_from(raw)
    fields = {**json.loads(raw[FRONT.size : FRONT.size + length]), **changes}
    header = json.dumps({name: value for name, value in fields.items() if value != "gone"}).encode()
    raw[:START] = (FRONT.pack(MAGIC, VERSION, len(header), zlib.crc32(header)) + header).ljust(START, b"\0")
    path.write_bytes(raw)


def test_a_file_that_is_not_there(tmp_path):
    assert "cannot read" in refused(tmp_path / "none.lut")
    assert "cannot read" in refused(tmp_path)


@pytest.mark.parametrize("content", [b"", b"HEVAL", b"not a table at all" * 1000])
def test_another_kind_of_file(tmp_path, content):
    (tmp_path / "other").write_bytes(content)
    assert "does not begin with HEVALLUT" in refused(tmp_path / "other")


def test_another_version(path):
    raw = bytearray(path.read_bytes())
    raw[8:12] = struct.pack("<I", 2)
    path.write_bytes(raw)
    assert "version 2" in refused(path)


def test_a_damaged_header(path):
    raw = bytearray(path.read_bytes())
    raw[25] ^= 1
    path.write_bytes(raw)
    assert "checksum" in refused(path)


@pytest.mark.parametrize("length", [8, 100, START - 1])
def test_cut_short_in_the_header(path, length):
    path.write_bytes(path.read_bytes()[:length])
    assert "cut short" in refused(path)


@pytest.mark.parametrize("missing", [1, 5000])
def test_cut_short_behind_it(path, missing):
    path.write_bytes(path.read_bytes()[:-missing])
    assert "cut short" in refused(path)


def test_something_behind_the_end(path):
    path.write_bytes(path.read_bytes() + b"x")
    assert "does not belong there" in refused(path)


@pytest.mark.parametrize(
    "changes",
    [
        {"cells": [10]},
        {"cells": [0, 10]},
        {"cells": ["many", 10]},
        {"cells": 7},
        {"cell": -1.0},
        {"cell": math.nan},
        {"cell": "gone"},
        {"origin": [0.0]},
        {"origin": [0.0, math.inf]},
        {"standoff": math.nan},
    ],
    ids=str,
)
def test_a_header_that_describes_no_grid(path, changes):
    rewritten(path, **changes)
    refused(path)


@pytest.mark.parametrize("header", [b"[1, 2]", b"{", b"\xff"])
def test_a_header_that_is_no_object(path, header):
    raw = bytearray(path.read_bytes())
    raw[:START] = (FRONT.pack(MAGIC, VERSION, len(header), zlib.crc32(header)) + header).ljust(START, b"\0")
    path.write_bytes(raw)
    assert "header" in refused(path)


def test_any_byte_of_the_front_may_be_damaged(path):
    raw = path.read_bytes()
    _, _, length, _ = FRONT.unpack_from(raw)
    rng = np.random.default_rng(5)
    for place in range(FRONT.size + length):
        damaged = bytearray(raw)
        damaged[place] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        with pytest.raises(InputError):
            load(path)


def test_a_table_that_was_not_finished(tmp_path):
    path = tmp_path / "new" / "half.lut"
    table = create(path, grid_over((-0.1,) * 3, (0.1,) * 3, 2e-2))
    assert "not finished" in refused(path)
    finish(table, path, standoff=fill(table, sphere(0.1)))
    whole = empty(table.grid)
    whole = replace(whole, standoff=fill(whole, sphere(0.1)))
    loaded = load(path)
    assert loaded.standoff == whole.standoff
    np.testing.assert_array_equal(loaded.nodes, whole.nodes)
    np.testing.assert_array_equal(loaded.cells, whole.cells)


def test_three_gigabytes_of_which_little_is_touched(tmp_path):
    grid = grid_over((-0.1,) * 3, (0.1,) * 3, 0.5e-3)
    assert grid.node_bytes > 3.09e9
    path = tmp_path / "sphere.lut"
    if shutil.disk_usage(tmp_path).free < 8e9:
        pytest.skip("the disk has no room for a 3 GB file, should it not know sparse ones")
    with pytest.raises(InputError, match="2 GiB"):
        empty(grid)
    table = create(path, grid)
    standoff = fill(table, sphere(0.1), first=(390, 195, 195), last=(402, 207, 207))
    finish(table, path, standoff=standoff)
    if path.stat().st_blocks * 512 > 1e9:
        pytest.skip("the file system does not know sparse files")
    loaded = load(path)
    assert loaded.nbytes == grid.node_bytes + grid.cell_bytes
    hips = np.random.default_rng(3).uniform((0.0955, -0.002, -0.002), (0.0995, 0.002, 0.002), (1000, 3))
    before = resident()
    ihips, normals, contact = loaded.answers(hips)
    assert contact.all()
    assert np.max(np.abs(np.linalg.norm(ihips, axis=1) - 0.1)) <= standoff < 1e-5
    np.testing.assert_allclose(normals, hips / np.linalg.norm(hips, axis=1)[:, None], atol=1e-5)
    # what was never filled is free space
    assert not loaded.answers(-hips)[2].any()
    if before is not None:
        assert resident() - before < 100e6


def resident():
    """Bytes of this process that are in memory, where the system tells."""
    try:
        with open("/proc/self/statm") as file:  # noqa: PTH123
            return int(file.read().split()[1]) * 4096
    except OSError:
        return None
