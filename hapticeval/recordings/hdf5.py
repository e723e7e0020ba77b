"""Recordings as HDF5 files, checksummed throughout, so that a damaged file is never read as a run.

Every dataset carries the fletcher32 filter, and the 1.10 file format checksums what lies between them: names,
units, shapes. Texts are of fixed length: those of variable length lie in a heap that has no checksum, where one
wrong byte can keep the HDF5 library reading for ever. A file holds

    /                   attributes `format` = "hapticeval recording", `format_version` = 2, `rows`
    /time               (n,) float64, `unit` = "s", where no clock was read; otherwise
    /nanoseconds        (n,) int64, `unit` = "ns", `start`, `anchor` (stamp and wall clock), and
    /sequence           (n,) int64
    /valid              (n,) uint8, where some rows are not valid
    /channels/<name>    (n,) or (n, k) float64, attributes `unit`, `meaning`, `frame`, `sign`: one dataset per signal
    /events             `time` (s), `kind`, `text` (UTF-8), where there are any
    /meta               (m,) uint8: `Recording.meta` as JSON in UTF-8

The rows lie in blocks of `ROWS_A_CHUNK`, all signals of one block before the next, so that a file that is cut short
keeps whole rows.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, InputError, UnknownNameError
from hapticeval.files import creating, plain, replacing
from hapticeval.recordings.memory import first_bytes, reserve
from hapticeval.recordings.recording import CHANNELS, Clock, Event, Recording, Signal

SIGNATURE = b"\x89HDF\r\n\x1a\n"
FORMAT = "hapticeval recording"
FORMAT_VERSION = 2
ROWS_A_CHUNK = 4096
"""One flipped byte costs so many rows of a signal: the fewest that read as fast as larger blocks do."""

GZIP_LEVEL = 1
"""Higher ones save under 1 % of a noisy signal, and read a quarter slower."""

ROW_TYPES = {"time": np.float64, "nanoseconds": np.int64, "sequence": np.int64, "valid": np.uint8}
"""Datasets beside the channels that have a row per sample, and the type of their numbers."""

DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError, MemoryError)
"""h5py raises any of these for one and the same damage, by where it strikes."""


class DamagedError(InputError):
    """A recording of ours that is cut short or damaged: `salvage` finds what is whole of it."""


def metadata_json(meta: Any) -> str:
    """Return the `meta` of a recording as JSON. Raises `InputError`, naming the key, for what JSON cannot hold."""
    try:
        return json.dumps(plain(meta, "meta"), allow_nan=False, sort_keys=True)
    except ValueError as error:
        raise InputError(f"the meta of a recording holds a number that is not finite: {error}") from error


def write_recording(path: Path, recording: Recording, *, replace: bool = False) -> None:
    """Write a recording so that it reads back bit for bit; the file is there whole or not at all.

    The same recording gives the same bytes. Raises `InputError` where there is a file already, unless it may
    `replace` it, and, naming the key, for a `meta` that JSON cannot hold; `HapticevalError` where the file cannot be
    written.
    """
    import h5py

    path = Path(path)
    meta = np.frombuffer(metadata_json(recording.meta).encode(), dtype=np.uint8)
    try:
        with (
            (replacing if replace else creating)(path) as temporary,
            # without a cache, chunks are written when they are full: in the order of the rows
            h5py.File(temporary, "w", libver=("v110", "v110"), rdcc_nbytes=0) as file,
        ):
            file.attrs["format"] = np.bytes_(FORMAT)
            file.attrs["format_version"] = FORMAT_VERSION
            file.attrs["rows"] = len(recording)
            _dataset(file, "meta", meta)[...] = meta
            if recording.events:
                table = _event_table(recording.events)
                _dataset(file, "events", table)[...] = table
            signals = _signals(file, recording)
            file.flush()  # so that what names and finds the rows lies before them, where a cut file still has it
            _fill(signals, len(recording))
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        raise HapticevalError(f"cannot write the recording {path}", why=why) from error


def _signals(file: Any, recording: Recording) -> list[tuple[Any, Any]]:
    """Make the datasets of everything that has rows, still empty; return each with its numbers."""
    clock, made = recording.clock, list[tuple[Any, Any]]()
    if clock is None:
        made.append((_dataset(file, "time", recording.time, unit="s"), recording.time))
    else:
        stamps = _dataset(file, "nanoseconds", clock.nanoseconds, unit="ns")
        stamps.attrs["start"] = np.int64(clock.zero)
        if clock.anchor is not None:
            stamps.attrs["anchor"] = np.array(clock.anchor, dtype=np.int64)
        made.append((stamps, clock.nanoseconds))
        if clock.sequence is not None:
            made.append((_dataset(file, "sequence", clock.sequence, unit="1"), clock.sequence))
    if recording.valid is not None:
        valid = recording.valid.astype(np.uint8)
        made.append((_dataset(file, "valid", valid, unit="1"), valid))
    group = file.create_group("channels", track_order=True)
    for name, values in recording.channels.items():
        words = {key: value for key, value in recording.signals[name]._asdict().items() if value}
        made.append((_dataset(group, name, values, **words), values))
    return made


def _fill(datasets: Sequence[tuple[Any, Any]], count: int) -> None:
    for begin in range(0, count, ROWS_A_CHUNK):
        for dataset, values in datasets:
            dataset[begin : begin + ROWS_A_CHUNK] = values[begin : begin + ROWS_A_CHUNK]


def _dataset(holder: Any, name: str, values: Any, **words: str) -> Any:
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
    for key, value in words.items():
        dataset.attrs[key] = np.bytes_(value.encode())
    return dataset


def _event_table(events: Iterable[Event]) -> Any:
    rows = [(event.time, event.kind.encode(), event.text.encode()) for event in events]
    kind, text = max(len(row[1]) for row in rows), max([1, *(len(row[2]) for row in rows)])
    return np.array(rows, dtype=[("time", "<f8"), ("kind", f"S{kind}"), ("text", f"S{text}")])


def read_recording(path: Path, *, channels: Sequence[str] | None = None) -> Recording:
    """Read a recording that `write_recording` wrote, or only some of its `channels`.

    Raises `InputError` that says which: the file is missing, is no HDF5 file, is cut short or damaged (and in which
    rows of which signal), is someone else's HDF5 file, was written by a newer format, lacks a channel that is asked
    for, or holds one in a unit other than ours.
    """
    import h5py

    path = Path(path)
    check_signature(path)
    try:
        with h5py.File(path, "r", rdcc_nbytes=0) as file:
            check_format(path, file)
            return _read(path, file, channels)
    except HapticevalError:
        raise
    except DAMAGE as error:
        from hapticeval.recordings.salvage import described

        raise _damaged(path, described(path) or str(error)) from error


def _read(path: Path, file: Any, wanted: Sequence[str] | None) -> Recording:
    group, count = file["channels"], int(file.attrs["rows"])
    known = list(group)
    for name in wanted or ():
        if name not in known:
            raise UnknownNameError(f"channel of {path.name}", name, known)
    names = known if wanted is None else list(dict.fromkeys(wanted))
    check_inside(path, file, [group[name] for name in names])

    def rows(dataset: Any, name: str, dtype: Any) -> Any:
        if dataset.dtype != dtype:
            raise _damaged(path, f"'{name}' is of type {dataset.dtype}, not {np.dtype(dtype)}")
        if dataset.shape[0] != count:
            raise _damaged(path, f"'{name}' has {dataset.shape[0]} rows of {count}")
        values = dataset[()]
        values.flags.writeable = False
        return values

    beside = {name: rows(file[name], name, dtype) for name, dtype in ROW_TYPES.items() if name in file}
    signals = {name: read_signal(group[name], name) for name in names}
    values = {name: rows(group[name], name, np.float64) for name in names}
    clock = read_clock(file, beside["nanoseconds"], beside.get("sequence")) if "nanoseconds" in beside else None
    if clock is None and text(file["time"], "unit") != "s":
        raise _damaged(path, "its time is not in seconds")
    return Recording(
        beside["time"] if clock is None else clock.seconds,
        values,
        read_meta(file),
        clock=clock,
        valid=beside["valid"] != 0 if "valid" in beside else None,
        signals=signals,
        events=read_events(file),
    )


def check_inside(path: Path, file: Any, channels: Iterable[Any]) -> None:
    """Raise `InputError` for a recording whose numbers lie in another file, or take more memory than is allowed."""
    size = 0
    for dataset in [*channels, *(file[name] for name in (*ROW_TYPES, "events", "meta") if name in file)]:
        if dataset.file.id != file.id or lies_elsewhere(dataset):
            raise InputError(
                f"{path}: '{dataset.name}' lies in another file",
                why="hapticeval writes recordings whole, and reads no file that another one names",
                todo="record it again, or copy the numbers into one file",
            )
        size += dataset.dtype.itemsize * math.prod(dataset.shape)
    reserve(size, str(path))


def lies_elsewhere(dataset: Any) -> bool:
    """Return whether an HDF5 data set takes its numbers from other files, by path: any path of the machine."""
    return bool(dataset.external) or dataset.is_virtual


def read_signal(dataset: Any, name: str) -> Signal:
    """Return the signal that a dataset's attributes state. Raises `InputError` for a known channel in other units."""
    unit = text(dataset, "unit")
    if name in CHANNELS and unit != CHANNELS[name].unit:
        raise InputError(
            f"{dataset.file.filename}: '{name}' is in {unit!r}, not in {CHANNELS[name].unit!r}",
            why="recordings are in SI units",
            todo="write the file with hapticeval",
        )
    return Signal(unit or "", *(text(dataset, key) or "" for key in ("meaning", "frame", "sign")))


def read_clock(file: Any, stamps: Any, sequence: Any) -> Clock:
    """Return the clock of stamps (n,), ns, and cycle numbers (n,) or None, with what the open file states of it."""
    stated = file["nanoseconds"].attrs
    anchor = (int(stated["anchor"][0]), int(stated["anchor"][1])) if "anchor" in stated else None
    return Clock(stamps, int(stated["start"]), anchor, sequence)


def read_events(file: Any) -> tuple[Event, ...]:
    """Return the events of an open file."""
    if "events" not in file:
        return ()
    return tuple(Event(float(row["time"]), row["kind"].decode(), row["text"].decode()) for row in file["events"][:])


def read_meta(file: Any) -> dict[str, Any]:
    """Return the metadata of an open file."""
    meta: dict[str, Any] = json.loads(bytes(file["meta"][:]).decode())
    return meta


def check_signature(path: Path) -> None:
    """Raise `InputError` unless there is a file that begins as HDF5 files do."""
    if not first_bytes(path).startswith(SIGNATURE):
        raise InputError(
            f"{path} is not an HDF5 file",
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
        newer = version > FORMAT_VERSION
        raise InputError(
            f"{path} has recording format {version}; this hapticeval reads format {FORMAT_VERSION}",
            why="a newer hapticeval wrote it" if newer else "no such format was released",
            todo="update hapticeval" if newer else "record it again",
        )


def text(holder: Any, name: str) -> str | None:
    """Return a text attribute; None where there is none."""
    value = holder.attrs.get(name)
    return value.decode() if isinstance(value, bytes) else value


def _damaged(path: Path, why: str) -> DamagedError:
    return DamagedError(
        f"the recording {path} is cut short or damaged",
        why=why,
        todo=f"copy it again; or take what is whole of it: hapticeval convert {path} --salvage -o {path.stem}-whole.h5",
    )
