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
keeps whole rows. One reader serves both: `read_recording` refuses a file that lacks anything, and `salvage` gives what
is whole.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from hapticeval.errors import HapticevalError, InputError, UnknownNameError, unwritable
from hapticeval.files import creating, plain, replacing
from hapticeval.recordings.channels import CHANNELS, Signal
from hapticeval.recordings.memory import first_bytes, reserve
from hapticeval.recordings.recording import Clock, Event, Recording, runs_of
from hapticeval.types import Array, BoolArray

T = TypeVar("T")
SIGNATURE = b"\x89HDF\r\n\x1a\n"
FORMAT = "hapticeval recording"
FORMAT_VERSION = 2
ROWS_A_CHUNK = 4096
"""One flipped byte costs so many rows of a signal: the fewest that read as fast as larger blocks do."""

GZIP_LEVEL = 1
"""Higher ones save under 1 % of a noisy signal, and read a quarter slower."""

NEW_FILE: dict[str, Any] = {"mode": "w", "libver": ("v110", "v110"), "rdcc_nbytes": 0}
"""How a file is opened for writing: without a cache blocks are written when they are full, in the order of the rows."""

ROW_TYPES = {"time": np.float64, "nanoseconds": np.int64, "sequence": np.int64, "valid": np.uint8}
"""Datasets beside the channels that have a row per sample, and the type of their numbers."""

DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError, MemoryError)
"""h5py raises any of these for one and the same damage, by where it strikes."""

LOST_EVENT = "lost"
"""The kind of the events that report losses, so that a recording made of a damaged file goes on reporting them."""


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
    try:
        with (replacing if replace else creating)(path) as temporary, h5py.File(temporary, **NEW_FILE) as file:
            _write(file, recording)
    except OSError as error:
        raise unwritable(f"the recording {path}", error) from error


def recording_bytes(recording: Recording) -> bytes:
    """Return the bytes of the file that `write_recording` writes, to send them to another machine."""
    import h5py

    with h5py.File("in memory", **NEW_FILE, driver="core", backing_store=False) as file:
        _write(file, recording)
        file.flush()
        return bytes(file.id.get_file_image())


def _write(file: Any, recording: Recording) -> None:
    """Write everything into an open file: first what names the rows, then the rows, block by block."""
    meta = np.frombuffer(metadata_json(recording.meta).encode(), dtype=np.uint8)
    file.attrs["format"] = np.bytes_(FORMAT)
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["rows"] = len(recording)
    # As bytes of fixed length: the heap of texts of variable length has no checksum.
    _dataset(file, "meta", meta)[...] = meta
    if recording.events:
        table = _event_table(recording.events)
        _dataset(file, "events", table)[...] = table
    signals = _signals(file, recording)
    file.flush()  # so that what names and finds the rows lies before them, where a cut file still has it
    _fill(signals, len(recording))


def _signals(file: Any, recording: Recording) -> list[tuple[Any, Any]]:
    """Make the datasets of everything that has rows, still empty; return each with its numbers."""
    clock, datasets = recording.clock, list[tuple[Any, Any]]()

    def add(holder: Any, name: str, values: Any, **words: str) -> Any:
        # Made now and filled in `_fill`, so that the blocks of all signals lie beside each other.
        datasets.append((_dataset(holder, name, values, **words), values))
        return datasets[-1][0].attrs

    if clock is None:
        add(file, "time", recording.time, unit="s")
    else:
        stated = add(file, "nanoseconds", clock.nanoseconds, unit="ns")
        stated["start"] = np.int64(clock.zero)
        if clock.anchor is not None:
            stated["anchor"] = np.array(clock.anchor, dtype=np.int64)
        if clock.sequence is not None:
            add(file, "sequence", clock.sequence, unit="1")
    if recording.valid is not None:
        add(file, "valid", recording.valid.astype(np.uint8), unit="1")
    group = file.create_group("channels", track_order=True)
    for name, values in recording.channels.items():
        add(group, name, values, **{key: value for key, value in recording.signals[name]._asdict().items() if value})
    return datasets


def _fill(datasets: Sequence[tuple[Any, Any]], count: int) -> None:
    # All signals of one block before the next: a cut file keeps whole rows.
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
        # Bytes of equal significance side by side: noisy doubles pack better.
        shuffle=True,
        fletcher32=True,
        # Without a time of writing the same recording gives the same bytes.
        track_times=False,
    )
    for key, value in words.items():
        dataset.attrs[key] = np.bytes_(value.encode())
    return dataset


def _event_table(events: Iterable[Event]) -> Any:
    rows = [(event.time, event.kind.encode(), event.text.encode()) for event in events]
    # Widths in bytes of UTF-8, one at the least, as HDF5 knows no text of length zero.
    kind, text = max(len(row[1]) for row in rows), max([1, *(len(row[2]) for row in rows)])
    return np.array(rows, dtype=[("time", "<f8"), ("kind", f"S{kind}"), ("text", f"S{text}")])


def read_recording(path: Path, *, channels: Sequence[str] | None = None) -> Recording:
    """Read a recording that `write_recording` wrote, or only some of its `channels`.

    Raises `InputError`, naming what is wrong, for a file that

    - is missing, no HDF5 file, somebody else's, or of a newer format;
    - is cut short or damaged, with the rows of each signal (`DamagedError`);
    - lacks a channel that is asked for, or holds one in a unit other than ours;
    - takes more memory than is allowed.
    """
    path = Path(path)
    recording, losses = _read(path, channels)
    # The strict reader: whatever `salvage` would report as lost is an error here.
    if recording is None or losses:
        raise DamagedError(
            f"the recording {path} is cut short or damaged",
            why="; ".join(losses[:5] + (["and more"] if len(losses) > 5 else [])),
            todo=f"copy it again; or take what is whole: hapticeval convert {path} --salvage -o {path.stem}-whole.h5",
        )
    return recording


def salvage(path: Path) -> Recording:
    """Return the sound part of an HDF5 recording, whose events of kind `lost` report what is missing.

    Rows whose stamps are lost are left out; where single signals are lost, the rows are not valid there; a signal of
    which nothing is left is absent. Raises `InputError` where nothing is whole, and for a file of somebody else's.
    """
    path = Path(path)
    recording, losses = _read(path, None)
    if recording is None:
        why = "; ".join(["no row of it is whole", *losses[:1]])
        raise InputError(f"nothing of {path} can be read", why=why, todo="copy it again")
    return recording


def _read(path: Path, selected: Sequence[str] | None) -> tuple[Recording | None, list[str]]:
    """Return what is whole of a file, None where no row is, and what is lost, in words."""
    if not first_bytes(path).startswith(SIGNATURE):
        raise InputError(
            f"{path} is not an HDF5 file",
            why="a recording starts with the HDF5 signature",
            todo="give a recording that hapticeval wrote",
        )
    try:
        with _opened(path) as (file, losses):
            return _readable_recording(path, file, selected, losses), losses
    except HapticevalError:
        raise
    except DAMAGE as error:
        return None, [_cut_short(path)[0] or str(error)]


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, list[str]]]:
    """Open the file, a cut one filled up with bytes that no checksum takes for data; give it, and what it lacks."""
    import h5py

    cut, lacking = _cut_short(path)
    reserve(path.stat().st_size + lacking if cut else 0, str(path))
    # Filled up to the length that the superblock states, or the library refuses the file as a whole.
    source = io.BytesIO(path.read_bytes() + b"\xff" * lacking) if cut else path
    with h5py.File(source, "r", rdcc_nbytes=0) as file:
        _check_format(path, file)
        yield file, [cut] if cut else []


def _cut_short(path: Path) -> tuple[str, int]:
    """Return in words where a file of ours ends too early, and how many bytes it lacks; "" and 0 for a whole one.

    Bytes 28 to 35 of the superblock, which is of version 3 in our files, give the end of the file.
    """
    with path.open("rb") as opened:
        head = opened.read(36)
    # Byte 8 is the superblock's version: 2 and 3 have the end of the file at bytes 28 to 35, older ones elsewhere.
    size, end = path.stat().st_size, int.from_bytes(head[28:], "little") if head[8:9] in (b"\x02", b"\x03") else 0
    return (f"the file ends at byte {size} of {end}", end - size) if size < end else ("", 0)


class _Part(NamedTuple):
    """The readable part of a signal: its numbers (n, ...), and which rows of them are whole, (n,)."""

    values: Any
    readable: BoolArray
    signal: Signal


def _readable_recording(path: Path, file: Any, selected: Sequence[str] | None, losses: list[str]) -> Recording | None:
    """Return the recording of all rows that have a stamp and a number in any channel, and add what is lost."""
    group, known = file["channels"], list(file["channels"])
    for name in selected or ():
        if name not in known:
            raise UnknownNameError(f"channel of {path.name}", name, known)
    names = known if selected is None else list(dict.fromkeys(selected))
    base = "nanoseconds" if "nanoseconds" in file else "time"
    row_names = [base, *(name for name in ("sequence", "valid") if name in file)]
    count = int(file[base].shape[0])
    holders = [(group, name) for name in names]
    holders += [(file, name) for name in (*row_names, "events", "meta") if name in file]
    # Sizes come first: a damaged shape may state any amount of memory.
    reserve(sum(_attempted(partial(_size, *place), "", []) or 0 for place in holders), str(path))

    def part(holder: Any, name: str) -> _Part | None:
        return _attempted(partial(_part, holder, name, count), f"'{name}'", losses)

    # Channels carry a slash before their names here: one may be called `time` or `valid`.
    parts = {name: part(file, name) for name in row_names} | {f"/{name}": part(group, name) for name in names}
    stamps, channels = parts[base], {name: channel for name in names if (channel := parts[f"/{name}"]) is not None}
    if stamps is None:
        return None
    # A row stays where its stamp and at least one channel can be read.
    readable_rows = (
        stamps.readable & np.any([channel.readable for channel in channels.values()], axis=0)
        if channels
        else stamps.readable
    )
    if not readable_rows.any():
        losses.append(f"every signal, all of its {count} rows")
        return None
    rows = slice(None) if readable_rows.all() else readable_rows
    clock = (
        _clock(file[base].attrs, stamps.values[rows], parts.get("sequence"), rows) if base == "nanoseconds" else None
    )
    time = stamps.values[rows] if clock is None else clock.seconds
    # A channel of which no row is readable is absent from the recording, not full of NaN.
    left = {name: channel for name, channel in channels.items() if channel.readable[rows].any()}
    valid = np.all([channel.readable[rows] for channel in left.values()], axis=0) & np.ones(len(time), dtype=bool)
    if "valid" in parts:
        marked = parts["valid"]
        # A mask that cannot be read vouches for no row.
        valid &= False if marked is None else ((marked.values != 0) & marked.readable)[rows]
    losses += _row_losses(parts, readable_rows, time)
    events = _attempted(lambda: _events(file), "the events", losses) or ()
    meta: Any = _attempted(lambda: json.loads(bytes(_own_dataset(file, "meta")[:]).decode()), "the meta", losses) or {}
    return Recording(
        time,
        {name: channel.values[rows] for name, channel in left.items()},
        meta,
        clock=clock,
        valid=valid,
        signals={name: channel.signal for name, channel in left.items()},
        events=events + tuple(Event(float(time[-1]), LOST_EVENT, loss) for loss in losses),
    )


def _clock(stated: Mapping[str, Any], stamps: Any, sequence: _Part | None, rows: Any) -> Clock:
    """Return the clock that gave the `stamps` (n,), ns, of the `rows`, as the attributes of these state it."""
    anchor = (int(stated["anchor"][0]), int(stated["anchor"][1])) if "anchor" in stated else None
    # Cycle numbers with a hole of their own would show cycles as missed that were not.
    counted = sequence.values[rows] if sequence is not None and sequence.readable[rows].all() else None
    return Clock(stamps, int(stated["start"]), anchor, counted)


def _size(holder: Any, name: str) -> int:
    return int(holder[name].dtype.itemsize * math.prod(holder[name].shape))


def _attempted(read: Callable[[], T], what: str, losses: list[str]) -> T | None:
    """Return what `read` gives; None, and one loss more, where that is damaged."""
    try:
        return read()
    except HapticevalError as error:
        losses.append(error.what)
    except DAMAGE as error:
        losses.append(f"{what}, {error}")
    return None


def _own_dataset(holder: Any, name: str) -> Any:
    """Return a dataset. Raises `InputError` where its numbers lie in another file: no file may name one to be read."""
    dataset = holder[name]
    if dataset.file.id != holder.file.id or lies_elsewhere(dataset):
        raise InputError(f"'{name}' lies in another file")
    return dataset


def _part(holder: Any, name: str, count: int) -> _Part:
    """Read a dataset of `count` rows as a whole, or block by block where it is damaged.

    Raises `InputError` where it lies in another file, or has another type, length or unit than ours.
    """
    dataset, dtype = _own_dataset(holder, name), ROW_TYPES[name] if holder.name == "/" else np.float64
    if dataset.dtype != dtype:
        raise InputError(f"'{name}' is of type {dataset.dtype}, not {np.dtype(dtype)}")
    if dataset.shape[:1] != (count,):
        raise InputError(f"'{name}' has {len(dataset)} rows of {count}")
    unit = _text(dataset, "unit")
    if name in CHANNELS and unit != CHANNELS[name].unit:
        raise InputError(f"'{name}' is in {unit!r}, not in {CHANNELS[name].unit!r}")
    if name == "time" and unit != "s":
        raise InputError("its time is not in seconds")
    signal = Signal(unit or "", *(_text(dataset, key) or "" for key in ("meaning", "frame", "sign")))
    try:
        values, readable = dataset[()], np.ones(count, dtype=bool)
    except DAMAGE:
        # Damaged somewhere: read it block by block, each with its own checksum.
        values = np.full(dataset.shape, np.nan if dtype == np.float64 else 0, dtype=dtype)
        readable = np.zeros(count, dtype=bool)
        chunk = int(dataset.chunks[0])
        for begin in range(0, count, chunk):
            rows = slice(begin, begin + chunk)
            try:
                values[rows] = dataset[rows]
            except DAMAGE:
                continue
            readable[rows] = True
    values.flags.writeable = False
    return _Part(values, readable, signal)


def _row_losses(parts: dict[str, _Part | None], readable_rows: BoolArray, time: Array) -> Iterator[str]:
    """Yield first the rows that are lost altogether, then what single signals lack of the others."""
    # A signal that is None as a whole was reported where it was read.
    if all(part is None or part.readable.all() for part in parts.values()):
        return
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    missing = {"every signal": ~readable_rows}
    missing |= {
        f"'{name.lstrip('/')}'": readable_rows & ~part.readable for name, part in parts.items() if part is not None
    }
    alike: dict[tuple[int, int], list[str]] = {}
    for name, rows in missing.items():
        for run in runs_of(rows):
            # Signals that lack the same rows are reported together.
            alike.setdefault(run, []).append(name)
    for (begin, end), names in alike.items():
        yield f"{', '.join(names)}, rows {begin} to {end - 1}: {count_lost(end - begin, step)}"


def count_lost(rows: int, step: float) -> str:
    """Return in words how many rows are lost, and what they took, with the sampling time `step`, s."""
    return f"{rows} rows ({rows * step:.3g} s)"


def lies_elsewhere(dataset: Any) -> bool:
    """Return whether an HDF5 data set takes its numbers from other files, by path: any path of the machine."""
    return bool(dataset.external) or dataset.is_virtual


def _events(file: Any) -> tuple[Event, ...]:
    rows = _own_dataset(file, "events")[:] if "events" in file else ()
    return tuple(Event(float(row["time"]), row["kind"].decode(), row["text"].decode()) for row in rows)


def _check_format(path: Path, file: Any) -> None:
    """Raise `InputError` for an open file of somebody else's, or of another version of the format."""
    if _text(file, "format") != FORMAT:
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


def _text(holder: Any, name: str) -> str | None:
    """Return a text attribute; None where there is none."""
    value = holder.attrs.get(name)
    return value.decode() if isinstance(value, bytes) else value
