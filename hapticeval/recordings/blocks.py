"""The blocks of a dataset, inflated on all cores: the HDF5 library does it on one, and is most of a long reading.

A block that went through shuffle, deflate and fletcher32, in that order, is a zlib stream and four bytes of fletcher32.
The stream carries a checksum of its own (Adler-32), which tells here whether a byte of it is wrong.
"""

from __future__ import annotations

import math
import os
import zlib
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from hapticeval.types import ByteArray
from hapticeval.workers import cores

FLETCHER = 4
FEW = 16
"""So many blocks are read as fast by the library."""


class Block(NamedTuple):
    """Which row of the dataset a block begins with, and which bytes of the file it is."""

    row: int
    at: int
    size: int


def read_rows(dataset: Any, begin: int, end: int) -> Any:
    """Rows `begin` to `end` (exclusive) of an HDF5 dataset, as the library reads them.

    Raises `OSError` for a block that is damaged, and otherwise what the library raises.
    """
    if end - begin < FEW * (dataset.chunks or (end,))[0] or not _can_tell(dataset) or not _is_known(dataset):
        return dataset[begin:end]
    rows = dataset.chunks[0]
    blocks = [block for block in _blocks(dataset) if begin < block.row + rows and block.row < end]
    if len(blocks) < (end - 1) // rows - begin // rows + 1:  # what was never written reads as zeros
        return dataset[begin:end]
    file = dataset.file.id.get_vfd_handle()
    out = np.empty((end - begin, *dataset.shape[1:]), dtype=dataset.dtype)

    def fill(share: list[Block]) -> None:
        for block in share:
            planes = _inflated(os.pread(file, block.size, block.at), (out.itemsize, *dataset.chunks))
            first, last = max(block.row, begin), min(block.row + rows, end)
            numbers = out[first - begin : last - begin].view(np.uint8).reshape(-1, out.itemsize)
            for place, plane in enumerate(planes[:, first - block.row : last - block.row]):
                numbers[:, place] = plane.ravel()

    count = cores()
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(fill, (blocks[k::count] for k in range(count))))  # raises what a block raised
    return out


def _can_tell(dataset: Any) -> bool:
    """Whether the system reads at a place, and the HDF5 library says where the blocks are: from 1.12.3 and 1.14 on."""
    return hasattr(os, "pread") and hasattr(dataset.id, "chunk_iter")


def _is_known(dataset: Any) -> bool:
    """Whether the blocks hold whole rows, and went through the three filters that are undone here."""
    from h5py import h5z

    made = dataset.id.get_create_plist()
    filters = [made.get_filter(k)[0] for k in range(made.get_nfilters())]
    known = [h5z.FILTER_SHUFFLE, h5z.FILTER_DEFLATE, h5z.FILTER_FLETCHER32]
    return filters == known and dataset.chunks[1:] == dataset.shape[1:] and dataset.dtype.isnative


def _blocks(dataset: Any) -> list[Block]:
    """Those that all three filters were applied to."""
    found: list[Block] = []

    def note(stored: Any) -> None:
        if stored.filter_mask == 0:
            found.append(Block(stored.chunk_offset[0], stored.byte_offset, stored.size))

    dataset.id.chunk_iter(note)
    return found


def _inflated(stored: bytes, shape: tuple[int, ...]) -> ByteArray:
    """The bytes of a block, sorted as they lie there: first the first byte of every number, then every second one."""
    try:
        planes = np.frombuffer(zlib.decompress(stored[:-FLETCHER], bufsize=math.prod(shape)), dtype=np.uint8)
        return planes.reshape(shape)
    except (zlib.error, ValueError) as error:
        raise OSError(f"a block of {len(stored)} bytes is damaged: {error}") from error
