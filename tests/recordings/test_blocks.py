"""Blocks inflated beside the HDF5 library: the same numbers, and no damage passes."""

from __future__ import annotations

import contextlib

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.recordings.blocks import FEW, FLETCHER, read_rows

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


@pytest.fixture(scope="module")
def hurt(path, tmp_path_factory):
    """A function: what a file gives where some bits of a byte of its middle block are flipped."""
    copy = tmp_path_factory.mktemp("hurt") / "run.h5"
    with h5py.File(path) as file:
        found = []
        file["f8 1 3"].id.chunk_iter(lambda stored: found.append((stored.byte_offset, stored.size)))
    at, size = found[len(found) // 2]

    def read(place, bits):
        made = bytearray(path.read_bytes())
        made[at + place % size] ^= bits
        copy.write_bytes(made)
        with h5py.File(copy) as file:
            return read_rows(file["f8 1 3"], 0, ROWS)

    return read


@given(place=st.integers(0), bit=st.integers(0, 7))
@settings(max_examples=100, deadline=None)
def test_no_flipped_bit_of_a_block_is_read_as_data(path, hurt, place, bit):
    """Some are flipped for nothing: of the library's checksum, or where a stream may say the same in two ways."""
    with h5py.File(path) as file:
        wanted = file["f8 1 3"][:]
    with contextlib.suppress(OSError):
        np.testing.assert_array_equal(hurt(place, 1 << bit), wanted)


@pytest.mark.parametrize("place", [0, 40, -FLETCHER - 1, -FLETCHER - 4])
def test_a_block_whose_start_or_checksum_is_wrong_is_refused(hurt, place):
    with pytest.raises(OSError, match="damaged"):
        hurt(place, 0xFF)
