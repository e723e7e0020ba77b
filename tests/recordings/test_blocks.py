"""Blocks inflated beside the HDF5 library: the same numbers, and no damage passes."""

from __future__ import annotations

import contextlib

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.recordings.blocks import FEW, read_rows

ROWS, BLOCK = 1000, 32
OURS = {"compression": "gzip", "shuffle": True, "fletcher32": True}


def numbers(shape, dtype):
    return np.random.default_rng(5).integers(0, 250, size=shape).astype(dtype) / (7 if dtype == np.float64 else 1)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("blocks") / "run.h5"
    with h5py.File(path, "w", libver=("v110", "v110"), rdcc_nbytes=0) as file:
        for kind in ("<f8", "<i8", "u1"):
            for width in ((), (1,), (3,)):
                values = numbers((ROWS, *width), np.dtype(kind)).astype(kind)
                file.create_dataset(
                    f"{kind[1:]} {len(width)} {sum(width)}", data=values, chunks=(BLOCK, *width), **OURS
                )
        table = numbers((ROWS, 4), np.float64)
        file.create_dataset("other filters", data=table, chunks=(BLOCK, 4), compression="gzip")
        file.create_dataset("in columns", data=table, chunks=(BLOCK, 2), **OURS)
        file.create_dataset("big endian", data=table.astype(">f8"), chunks=(BLOCK, 4), **OURS)
        file.create_dataset("contiguous", data=table)
        half = file.create_dataset("half written", shape=(ROWS, 4), dtype="<f8", chunks=(BLOCK, 4), **OURS)
        half[: ROWS // 2] = table[: ROWS // 2]
        odd = file.create_dataset("a block unfiltered", shape=(ROWS, 4), dtype="<f8", chunks=(BLOCK, 4), **OURS)
        odd[...] = table
        odd.id.write_direct_chunk((BLOCK, 0), table[:BLOCK].tobytes(), filter_mask=7)
    return path


@given(data=st.data())
@settings(max_examples=200, deadline=None)
def test_the_library_reads_the_same(path, data):
    with h5py.File(path) as file:
        dataset = file[data.draw(st.sampled_from(sorted(file)))]
        begin = data.draw(st.integers(0, ROWS - 1))
        end = data.draw(st.integers(begin + 1, ROWS))
        found = read_rows(dataset, begin, end)
        assert found.dtype == dataset.dtype
        np.testing.assert_array_equal(found, dataset[begin:end])


def test_long_stretches_of_ours_are_not_left_to_the_library(path, monkeypatch):
    with h5py.File(path) as file:
        dataset = file["f8 1 3"]
        wanted = dataset[:]
        monkeypatch.setattr(h5py.Dataset, "__getitem__", None)
        np.testing.assert_array_equal(read_rows(dataset, 0, ROWS), wanted)
        with pytest.raises(TypeError):
            read_rows(dataset, 0, FEW * BLOCK - 1)


@given(where=st.floats(0.0, 1.0), bit=st.integers(0, 7))
@settings(max_examples=100, deadline=None)
def test_no_flipped_bit_of_a_block_is_read_as_data(path, tmp_path_factory, where, bit):
    with h5py.File(path) as file:
        found = []
        file["f8 1 3"].id.chunk_iter(lambda stored: found.append((stored.byte_offset, stored.size)))
        wanted = file["f8 1 3"][:]
    at, size = found[len(found) // 2]
    hurt = bytearray(path.read_bytes())
    place = at + int(where * (size - 1))
    hurt[place] ^= 1 << bit
    copy = tmp_path_factory.mktemp("hurt") / "run.h5"
    copy.write_bytes(hurt)
    with h5py.File(copy) as file:
        # Flipped for nothing: the library's own checksum, and what fills up the last byte of the stream before its own.
        spare = place >= at + size - 9
        with contextlib.suppress(OSError) if spare else pytest.raises(OSError, match="damaged"):
            np.testing.assert_array_equal(read_rows(file["f8 1 3"], 0, ROWS), wanted)
