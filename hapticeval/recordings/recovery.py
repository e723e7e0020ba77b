"""From a journal to a recording: all that is whole, and in words what is not."""

from __future__ import annotations

import json
import mmap
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.journal import MAGIC, UNCLOSED, Block, Hole, Kind, Layout, blocks
from hapticeval.recordings.losses import LOST, Loss, Salvaged
from hapticeval.recordings.recording import Clock, Event, Recording
from hapticeval.types import BoolArray, IntArray


def finish(journal: Path, path: Path) -> Salvaged:
    """Write what `recover` gives as an HDF5 recording, and leave the journal as it is.

    Raises `InputError` where `path` is there already, and what `recover` and `write_recording` raise.
    """
    salvaged = recover(journal)
    write_recording(path, salvaged.recording)
    return salvaged


def recover(path: Path) -> Salvaged:
    """What is whole of a journal, however it ended, and what is lost, which its events say as well (kind `lost`).

    Rows with a number that is not finite, or a stamp that does not increase, are kept and not valid. Raises
    `InputError` for a file that is no journal, one whose header is lost, and one without a whole row.
    """
    path = Path(path)
    try:
        with path.open("rb") as opened:
            return _recovered(path, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ))
    except ValueError as error:  # what mmap says of an empty file
        if path.stat().st_size:
            raise
        raise InputError(f"{path} is empty", todo="give a journal that a recorder wrote") from error
    except OSError as error:
        raise InputError(f"cannot read the journal {path}", why=error.strerror or str(error)) from error


@dataclass
class _Read:
    """What was found, block by block; `holes` each with the number of whole row blocks before it."""

    layout: Layout | None = None
    rows: list[Any] = field(default_factory=list)
    row_blocks: list[Block] = field(default_factory=list)
    events: list[tuple[int, str, str]] = field(default_factory=list)
    holes: list[tuple[Hole, int]] = field(default_factory=list)
    end: dict[str, Any] | None = None


def _recovered(path: Path, data: mmap.mmap) -> Salvaged:
    read = _Read()
    number = 0
    for block in blocks(data):
        if isinstance(block, Hole):
            read.holes.append((block, len(read.row_blocks)))
            continue
        if block.number > number and not (read.holes and read.holes[-1][0].end == block.at):
            read.holes.append((Hole(block.at, block.at, None), len(read.row_blocks)))
        number = block.number + 1
        _take(read, block)
    if read.layout is None:
        known = data[: len(MAGIC)] == MAGIC
        raise InputError(
            f"{path} is a journal whose header is lost" if known else f"{path} is not a journal",
            why="without it nobody knows what the numbers are" if known else "a recorder's journal begins otherwise",
            todo="copy it again" if known else "give a file that a recorder wrote",
        )
    if not read.row_blocks:
        raise InputError(
            f"no row of the journal {path} is whole",
            why=""
            if read.holes
            else "its header is whole, and no rows follow: its recorder has just begun, or "
            "was stopped before it had any",
            todo="copy it again" if read.holes else "look again when the recorder has run for a second",
        )
    rows = np.concatenate([np.frombuffer(block.payload, dtype=read.layout.dtype) for block in read.row_blocks])
    ends = np.cumsum([block.rows for block in read.row_blocks])
    return _made(read, read.layout, rows, _losses(read, rows, ends, len(data)))


def _take(read: _Read, block: Block) -> None:
    if block.kind == Kind.HEADER:
        read.layout = read.layout or Layout.decoded(bytes(block.payload))
    elif block.kind == Kind.ROWS:
        read.row_blocks.append(block)
    elif block.kind == Kind.EVENT:
        stamp, kind, text = json.loads(bytes(block.payload))
        read.events.append((stamp, kind, text))
    elif block.kind == Kind.END:
        read.end = json.loads(bytes(block.payload))


def _losses(read: _Read, rows: Any, ends: IntArray, size: int) -> list[Loss]:
    """What each hole took, read off the sequence numbers and stamps on its sides."""
    sequence, stamps = rows["sequence"], rows["nanoseconds"]
    step = float(np.median(np.diff(stamps))) / 1e9 if len(rows) > 1 else 0.0
    losses = []
    for hole, before in read.holes:
        where = f"bytes {hole.at} to {hole.end - 1}" if hole.end > hole.at else f"before byte {hole.at}"
        last = int(ends[before - 1]) - 1 if before else -1
        if hole.end == size and before == len(ends):
            losses.append(_tail(hole, where, int(sequence[-1]) + 1))
            continue
        if last + 1 == len(rows):
            count = None if read.end is None else int(read.end["next"] - read.end["unwritten"] - sequence[-1]) - 1
        else:
            count = int(sequence[last + 1]) - (int(sequence[last]) + 1 if before else 0)
        if count:
            losses.append(Loss("damaged", f"{where}, after row {last}", count, count * step))
        elif hole.at >= len(MAGIC):
            losses.append(Loss("damaged", f"{where}, no row among them", None, None))
    if read.end is not None and read.end["unwritten"]:
        count = int(read.end["unwritten"])
        losses.append(Loss("the end", "rows that the recorder could not write", count, count * step))
    if read.end is None and not (losses and losses[-1].rows is None):
        where = f"the journal was not closed: what came from cycle {sequence[-1] + 1} on is unknown"
        losses.append(Loss("the end", where, None, None))
    return losses


def _tail(hole: Hole, where: str, following: int) -> Loss:
    block = f"a block of {hole.rows} rows" if hole.rows else "a block"
    told = f"{where}: it breaks off inside {block}; what came from cycle {following} on is unknown"
    return Loss("the end", told, None, None)


def _made(read: _Read, layout: Layout, rows: Any, losses: Sequence[Loss]) -> Salvaged:
    stamps = np.ascontiguousarray(rows["nanoseconds"])
    clock = Clock(stamps, layout.start, layout.anchor, np.ascontiguousarray(rows["sequence"]))
    channels = {name: np.ascontiguousarray(rows[name]) for name in layout.channels}
    valid = _increasing(stamps)
    for values in channels.values():
        finite = np.isfinite(values)
        valid &= finite if finite.ndim == 1 else finite.all(axis=1)
    events = [Event((stamp - clock.zero) / 1e9, kind, text) for stamp, kind, text in read.events]
    last = float(clock.seconds[-1])
    if read.end is not None and read.end["how"] != "closed":
        unknown = f": what came after cycle {int(rows['sequence'][-1])} is unknown"
        events.append(Event(last, "ended", read.end["how"] + unknown * (read.end["how"] == UNCLOSED)))
    if not valid.all():
        events.append(Event(last, "not-valid", f"{np.count_nonzero(~valid)} rows are not finite or out of order"))
    events += [Event(last, LOST, str(loss)) for loss in losses]
    recording = Recording.clocked(clock, channels, layout.meta, valid=valid, signals=layout.signals, events=events)
    return Salvaged(recording, tuple(losses))


def _increasing(stamps: IntArray) -> BoolArray:
    """The rows whose stamp lies after all before it."""
    out = np.ones(stamps.size, dtype=bool)
    out[1:] = stamps[1:] > np.maximum.accumulate(stamps)[:-1]
    return out
