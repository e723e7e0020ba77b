"""Recordings as HDF5 files, checksummed throughout, so that a damaged file is never read as a run.

Every dataset carries the fletcher32 filter, and the 1.10 file format checksums what lies between them: names,
units, shapes. Texts are of fixed length: those of variable length lie in a heap that has no checksum, where one
wrong byte can keep the HDF5 library reading for ever. A file holds

    /                   attributes `format` = "hapticeval recording", `format_version` = 2, `rows`
    /time               (n,) float64, `unit` = "s", where no clock was read; otherwise
    /nanoseconds        (n,) int64, `unit` = "ns", `start`, `anchor` (stamp and wall clock), and
    /sequence           (n,) int64
    /valid              (n,) uint8, where some rows are not valid
    /channels/<name>    (n,) or (n, k) float64, attributes `unit`, `meaning`, `frame`, `sign`: a dataset a signal
    /events             `time` (s), `kind`, `text` (UTF-8), where there are any
    /meta               (m,) uint8: `Recording.meta` as JSON in UTF-8

The rows lie in blocks of `ROWS_A_CHUNK`, all signals of one block before the next, so that a file that is cut short
keeps whole rows.
"""

from __future__ import annotations

import json
import math
import os
import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.files import creating, plain, replacing
from hapticeval.recordings.memory import reserve
from hapticeval.recordings.recording import CHANNELS, Clock, Event, Recording, Signal, among

SIGNATURE = b"\x89HDF\r\n\x1a\n"
END_OF_FILE = {0: 40, 1: 44, 2: 28, 3: 28}
"""Where in a superblock of each version the end of the file stands, with offsets of eight bytes."""

WIDTH = {0: 13, 1: 13, 2: 9, 3: 9}
"""Where the version says how wide an offset is."""

FORMAT = "hapticeval recording"
FORMAT_VERSION = 2
ROWS_A_CHUNK = 4096
"""One flipped byte costs so many rows of a signal: the fewest that read as fast as larger blocks do."""

GZIP_LEVEL = 1
"""Higher ones save under 1 % of a noisy signal, and read a quarter slower."""

TOLD = ("meaning", "frame", "sign")
DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError, MemoryError)
"""h5py speaks of one and the same damage in all of these, by where it strikes."""


class DamagedError(InputError):
    """A recording of ours that is cut short or damaged: what is whole of it `salvage` finds."""


def write_recording(path: Path, recording: Recording, *, replace: bool = False) -> None:
    """Write a recording so that it reads back bit for bit; the file is there whole or not at all.

    The same recording gives the same bytes. Raises `InputError` where there is a file already, unless it may
    `replace` it, and, naming the key, for a `meta` that JSON cannot hold; `HapticevalError` where the file cannot be
    written.
    """
    import h5py

    path = Path(path)
    try:
        meta = json.dumps(plain(recording.meta, "meta"), allow_nan=False, sort_keys=True)
    except ValueError as error:
        raise InputError(f"the meta of a recording holds a number that is not finite: {error}") from error
    try:
        with (
            (replacing if replace else creating)(path) as temporary,
            # without a cache, chunks are written when they are full: in the order of the rows
            h5py.File(temporary, "w", libver=("v110", "v110"), rdcc_nbytes=0) as file,
        ):
            file.attrs["format"] = np.bytes_(FORMAT)
            file.attrs["format_version"] = FORMAT_VERSION
            file.attrs["rows"] = len(recording)
            _create(file, "meta", np.frombuffer(meta.encode(), dtype=np.uint8))
            _create(file, "events", _event_table(recording.events))
            signals = _signals(file, recording)
            file.flush()  # so that what names and finds the rows lies before them, where a cut file still has it
            _fill(signals, len(recording))
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        raise HapticevalError(f"cannot write the recording {path}", why=why) from error


def _signals(file: Any, recording: Recording) -> list[tuple[Any, Any]]:
    """The datasets of everything that has rows, still empty, each with its numbers."""
    made: list[tuple[Any, Any]] = []
    clock = recording.clock
    if clock is None:
        made.append((_reserve(file, "time", recording.time, unit="s"), recording.time))
    else:
        stamps = _reserve(file, "nanoseconds", clock.nanoseconds, unit="ns")
        stamps.attrs["start"] = np.int64(clock.zero)
        if clock.anchor is not None:
            stamps.attrs["anchor"] = np.array(clock.anchor, dtype=np.int64)
        made.append((stamps, clock.nanoseconds))
        if clock.sequence is not None:
            made.append((_reserve(file, "sequence", clock.sequence, unit="1"), clock.sequence))
    if recording.valid is not None:
        valid = recording.valid.astype(np.uint8)
        made.append((_reserve(file, "valid", valid, unit="1"), valid))
    group = file.create_group("channels", track_order=True)
    for name, values in recording.channels.items():
        signal = recording.signals[name]
        told = {key: value for key, value in signal._asdict().items() if value}
        made.append((_reserve(group, name, values, **told), values))
    return made


def _fill(datasets: Sequence[tuple[Any, Any]], count: int) -> None:
    for begin in range(0, count, ROWS_A_CHUNK):
        for dataset, values in datasets:
            dataset[begin : begin + ROWS_A_CHUNK] = values[begin : begin + ROWS_A_CHUNK]


def _reserve(holder: Any, name: str, values: Any, **told: str) -> Any:
    dataset = holder.create_dataset(
        name,
        shape=values.shape,
        dtype=values.dtype,
        chunks=(min(len(values), ROWS_A_CHUNK), *values.shape[1:]),
        compression="gzip",
        compression_opts=GZIP_LEVEL,
        shuffle=True,
        fletcher32=True,
        track_times=False,
    )
    for key, value in told.items():
        dataset.attrs[key] = np.bytes_(value.encode())
    return dataset


def _create(holder: Any, name: str, values: Any) -> None:
    if len(values):
        _reserve(holder, name, values)[...] = values


def _event_table(events: Iterable[Event]) -> Any:
    rows = [(event.time, event.kind.encode(), event.text.encode()) for event in events]
    kind = max([1, *(len(row[1]) for row in rows)])
    words = max([1, *(len(row[2]) for row in rows)])
    return np.array(rows, dtype=[("time", "<f8"), ("kind", f"S{kind}"), ("text", f"S{words}")])


def read_recording(path: Path, *, channels: Sequence[str] | None = None, rows: slice | None = None) -> Recording:
    """Read a recording that `write_recording` wrote, or only some of its `channels` and `rows` of it.

    A part is on the time base of the whole, and no more than it is read. Raises `InputError` that says which: the
    file is missing, is no HDF5 file, is cut short or damaged (and in which rows of which signal), is someone else's
    HDF5 file, was written by a newer format, lacks a channel that is asked for, or holds one in a unit other than ours.
    """
    import h5py

    path = Path(path)
    check_signature(path)
    try:
        with h5py.File(path, "r", rdcc_nbytes=0) as file:
            check_format(path, file)
            return _Reader(path, file, rows).recording(channels)
    except HapticevalError:
        raise
    except DAMAGE as error:
        from hapticeval.recordings.salvage import described

        raise damaged(path, described(path) or str(error)) from error


class _Reader:
    """An open file, the rows of it that are wanted, and what is in it."""

    def __init__(self, path: Path, file: Any, rows: slice | None) -> None:
        self.path, self.file, self.group = path, file, file["channels"]
        base = file["nanoseconds" if "nanoseconds" in file else "time"]
        self.count = int(base.shape[0])
        if self.count != int(file.attrs["rows"]):
            raise damaged(path, f"it has {self.count} rows, and says {int(file.attrs['rows'])}")
        begin, end, step = slice(None).indices(self.count) if rows is None else rows.indices(self.count)
        if step != 1 or begin >= end:
            raise InputError(
                f"{path} has {self.count} rows, and none of them is in {rows}",
                todo="give rows that follow each other",
            )
        self.begin, self.end = begin, end

    def recording(self, wanted: Sequence[str] | None) -> Recording:
        known = list(self.group)
        for name in wanted or ():
            if name not in known:
                raise UnknownNameError(f"channel of {self.path.name}", name, known)
        names = known if wanted is None else list(dict.fromkeys(wanted))
        check_inside(self.path, self.file, (self.group[name] for name in names), self.end - self.begin)
        signals = {name: read_signal(self.group[name], name) for name in names}
        values = {name: self.rows(self.group[name], name, np.float64) for name in names}
        meta = json.loads(bytes(self.file["meta"][:]).decode())
        clock, time = self.clock()
        until = np.inf if self.end == self.count else self.time_of(self.end)
        events = among(self.events(), -np.inf if self.begin == 0 else float(time[0]), until)
        valid = self.rows(self.file["valid"], "valid", np.uint8) != 0 if "valid" in self.file else None
        return Recording(time, values, meta, clock=clock, valid=valid, signals=signals, events=events)

    def rows(self, dataset: Any, name: str, dtype: Any) -> Any:
        if dataset.dtype != dtype:
            raise damaged(self.path, f"'{name}' is of type {dataset.dtype}, not {np.dtype(dtype)}")
        if dataset.shape[0] != self.count:
            raise damaged(self.path, f"'{name}' has {dataset.shape[0]} rows of {self.count}")
        values = dataset[self.begin : self.end]
        values.flags.writeable = False
        return values

    def clock(self) -> tuple[Clock | None, Any]:
        if "nanoseconds" not in self.file:
            if text(self.file["time"], "unit") != "s":
                raise damaged(self.path, "its time is not in seconds")
            return None, self.rows(self.file["time"], "time", np.float64)
        stamps = self.file["nanoseconds"]
        sequence = self.rows(self.file["sequence"], "sequence", np.int64) if "sequence" in self.file else None
        anchor = tuple(int(x) for x in stamps.attrs["anchor"]) if "anchor" in stamps.attrs else None
        clock = Clock(
            self.rows(stamps, "nanoseconds", np.int64),
            int(stamps.attrs["start"]),
            anchor if anchor is None else (anchor[0], anchor[1]),
            sequence,
        )
        return clock, clock.seconds

    def time_of(self, row: int) -> float:
        if "nanoseconds" not in self.file:
            return float(self.file["time"][row])
        stamps = self.file["nanoseconds"]
        return (int(stamps[row]) - int(stamps.attrs["start"])) / 1e9

    def events(self) -> tuple[Event, ...]:
        return read_events(self.file)


def check_inside(path: Path, file: Any, channels: Iterable[Any], rows: int) -> None:
    """Raise `InputError` for a recording whose numbers lie in another file, or take more memory than is allowed."""
    beside = [file[name] for name in ("time", "nanoseconds", "sequence", "valid", "events", "meta") if name in file]
    size = 0
    for dataset in [*channels, *beside]:
        if dataset.file.id != file.id or lies_elsewhere(dataset):
            raise InputError(
                f"{path}: '{dataset.name}' lies in another file",
                why="hapticeval writes recordings whole, and reads no file that another one names",
                todo="record it again, or copy the numbers into one file",
            )
        count = dataset.shape[0] if dataset.name in ("/events", "/meta") else rows
        size += dataset.dtype.itemsize * count * math.prod(dataset.shape[1:])
    reserve(size, str(path))


def lies_elsewhere(dataset: Any) -> bool:
    """Whether the numbers of an HDF5 data set are taken from other files, by path: any path of the machine."""
    return bool(dataset.external) or dataset.is_virtual


def read_signal(dataset: Any, name: str) -> Signal:
    """What the attributes of a dataset say it is. Raises `InputError` for a known channel in a unit other than ours."""
    unit = text(dataset, "unit")
    if name in CHANNELS and unit != CHANNELS[name].unit:
        raise InputError(
            f"{dataset.file.filename}: '{name}' is in {unit!r}, not in {CHANNELS[name].unit!r}",
            why="recordings are in SI units",
            todo="write the file with hapticeval",
        )
    return Signal(unit or "", *(text(dataset, key) or "" for key in TOLD))


def read_events(file: Any) -> tuple[Event, ...]:
    """The events of an open file."""
    if "events" not in file:
        return ()
    return tuple(Event(float(row["time"]), row["kind"].decode(), row["text"].decode()) for row in file["events"][:])


def check_signature(path: Path) -> None:
    """Raise `InputError` unless there is a file that begins as HDF5 files do."""
    try:
        with path.open("rb") as opened:
            signature = opened.read(len(SIGNATURE))
    except OSError as error:
        raise InputError(
            f"cannot read the recording {path}", why=error.strerror or str(error), todo="check the path"
        ) from error
    if signature != SIGNATURE:
        raise InputError(
            f"{path} is not an HDF5 file" if signature else f"{path} is empty",
            why="a recording starts with the HDF5 signature",
            todo="give a recording that hapticeval wrote",
        )


def check_format(path: Path, file: Any) -> None:
    """Raise `InputError` for an open file of somebody else's, or of another version of the format."""
    if text(file, "format") != FORMAT:
        raise InputError(
            f"{path} is an HDF5 file, but not a hapticeval recording",
            why=f"it lacks the attribute format = '{FORMAT}'; it holds: {', '.join(file) or 'nothing'}",
            todo="give a recording that hapticeval wrote",
        )
    version = int(file.attrs["format_version"])
    if version != FORMAT_VERSION:
        raise InputError(
            f"{path} has recording format {version}; this hapticeval reads format {FORMAT_VERSION}",
            why="a newer hapticeval wrote it" if version > FORMAT_VERSION else "no such format was released",
            todo="update hapticeval" if version > FORMAT_VERSION else "record it again",
        )


def text(holder: Any, name: str) -> str | None:
    """A text attribute; None where there is none."""
    value = holder.attrs.get(name)
    return value.decode() if isinstance(value, bytes) else value


def damaged(path: Path, why: str) -> DamagedError:
    """The error of a file that cannot be read as a run."""
    return DamagedError(
        f"the recording {path} is cut short or damaged",
        why=why,
        todo=f"copy it again; or take what is whole of it: hapticeval convert {path} --salvage -o {path.stem}-whole.h5",
    )


def declared_size(path: Path) -> int:
    """The length of an HDF5 file by its own superblock, in bytes; zero where that does not state it."""
    with path.open("rb") as opened:
        head = opened.read(4096 + 64)
    at = 0
    while head[at : at + 8] != SIGNATURE:  # what comes before is the user's: nothing, 512 bytes, or twice as many ...
        at = max(512, 2 * at)
        if at >= len(head):
            return 0
    version = head[at + 8] if at + 8 < len(head) else None
    if version not in END_OF_FILE or head[at + WIDTH[version] : at + WIDTH[version] + 1] != b"\x08":
        return 0
    told = head[at + END_OF_FILE[version] :][:8]
    return int(struct.unpack("<Q", told)[0]) if len(told) == 8 else 0


def ending(path: Path) -> str:
    """In words, where a file ends before it should; empty where it does not."""
    size, told = path.stat().st_size, declared_size(path)
    return f"the file ends at byte {size} of {told}" if size < told else ""
