"""The whole part of a recording of ours that was cut short or damaged: read block by block, and only on request."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.hdf5 import (
    DAMAGE,
    ROW_TYPES,
    check_format,
    check_inside,
    check_signature,
    read_clock,
    read_events,
    read_meta,
    read_signal,
)
from hapticeval.recordings.memory import reserve
from hapticeval.recordings.recording import Event, Recording, runs_of
from hapticeval.types import BoolArray

LOST = "lost"
"""The kind of the events that report losses, so that a recording made of a damaged file goes on reporting them."""

MISSING = ("time out of order", "without a number")
"""Of what an import leaves out, the rows that the file should have had: gaps are as they were meant."""


@dataclass(frozen=True)
class Loss:
    """A part that cannot be read: `what` and `where` in words, and how many `rows` and `seconds` are missing.

    They are None where nobody can know: what followed the end of a file that was never closed.
    """

    what: str
    where: str
    rows: int | None
    seconds: float | None

    def __str__(self) -> str:
        if self.rows is None:
            return f"{self.what}, {self.where}"
        span = "" if self.seconds is None else f" ({self.seconds:.3g} s)"
        return f"{self.what}, {self.where}: {self.rows} rows{span}"


@dataclass(frozen=True)
class Salvaged:
    """A recording made of what is whole of a file, and the `losses`; a sound file has none."""

    recording: Recording
    losses: tuple[Loss, ...]


def describe_losses(recording: Recording) -> tuple[str, ...]:
    """Return what is lost of the file that a recording was made of, in words."""
    return tuple(event.text for event in recording.events if event.kind == LOST)


def describe_warnings(recording: Recording) -> tuple[str, ...]:
    """Return the warnings of the import of a foreign file: rows that are cut off, cells without a number."""
    return tuple(str(text) for text in recording.meta.get("import", {}).get("warnings", ()))


def incomplete(recording: Recording) -> bool:
    """Return whether rows are lost or masked, cycles have no row, the run ended early, or the import warned."""
    left_out = recording.meta.get("import", {}).get("left out", {})
    ended = any(event.kind == "ended" for event in recording.events)
    missed = recording.clock is not None and recording.clock.missed
    return bool(
        missed or ended or describe_losses(recording) or describe_warnings(recording) or left_out.keys() & set(MISSING)
    )


def salvage(path: Path) -> Salvaged:
    """Return the sound part of an HDF5 recording, and what is lost, which its events report too (kind `lost`).

    Rows whose stamps are lost are left out; where single signals are lost, the rows are not valid there; a signal of
    which nothing is left is absent. Raises `InputError` where nothing is whole, and for a file of somebody else's.
    """
    path = Path(path)
    check_signature(path)
    try:
        with _opened(path) as (file, cut):
            return _salvaged(path, file, cut)
    except HapticevalError:
        raise
    except DAMAGE as error:
        raise InputError(f"nothing of {path} can be read", why=str(error), todo="copy it again") from error


def described(path: Path) -> str:
    """Return where a damaged file is damaged, in words; empty where that is not known."""
    try:
        with _opened(path) as (file, cut):
            parts = [cut, *(f"{loss.what}, {loss.where}" for loss in _losses(_scan(path, file), 0.0))]
    except (HapticevalError, *DAMAGE):
        return _cut(path)[0]
    parts = [each for each in parts if each]
    return "; ".join(parts[:5] + ["and more"] * (len(parts) > 5))


class _Part(NamedTuple):
    """The readable part of a signal: its numbers (n, ...), and which rows of them are whole, (n,)."""

    values: Any
    whole: BoolArray
    signal: Signal | None = None


class _Found(NamedTuple):
    """The parts of a file: those `beside` the channels and the `channels`; None where nothing of one is whole.

    `kept` (n,) are the rows with a stamp of the `base` and a number in any channel.
    """

    base: str
    beside: dict[str, _Part | None]
    channels: dict[str, _Part | None]
    kept: BoolArray


def _scan(path: Path, file: Any) -> _Found:
    """Read every block of every signal, and note those that cannot be read."""
    base = "nanoseconds" if "nanoseconds" in file else "time"
    count, chunk = int(file[base].shape[0]), int(file[base].chunks[0])

    def part(group: Any, name: str, *, channel: bool) -> _Part | None:
        try:
            dataset = group[name]
            signal = read_signal(dataset, name) if channel else None
            if dataset.shape[:1] != (count,) or dataset.dtype != (np.float64 if channel else ROW_TYPES[name]):
                return None
            check_inside(path, file, [dataset])
            values = np.full(dataset.shape, np.nan if dataset.dtype == np.float64 else 0, dtype=dataset.dtype)
        except (HapticevalError, *DAMAGE):
            return None
        whole = np.zeros(count, dtype=bool)
        for begin in range(0, count, chunk):
            rows = slice(begin, begin + chunk)
            try:
                values[rows] = dataset[rows]
            except DAMAGE:
                continue
            whole[rows] = True
        return _Part(values, whole, signal) if whole.any() else None

    beside = {name: part(file, name, channel=False) for name in (base, "sequence", "valid") if name in file}
    channels = {name: part(file["channels"], name, channel=True) for name in file["channels"]}
    stamps, masks = beside[base], [each.whole for each in channels.values() if each is not None]
    kept = np.zeros(count, dtype=bool) if stamps is None else stamps.whole
    return _Found(base, beside, channels, kept & np.any(masks, axis=0) if masks else kept)


def _salvaged(path: Path, file: Any, cut: str) -> Salvaged:
    found = _scan(path, file)
    kept, stamps = found.kept, found.beside[found.base]
    if stamps is None or not kept.any():
        why = "no row of it is whole" + (f": {cut}" if cut else "")
        raise InputError(f"nothing of {path} can be read", why=why, todo="copy it again")
    clock = None
    if found.base == "nanoseconds":
        sequence = found.beside.get("sequence")
        counted = sequence.values[kept] if sequence is not None and sequence.whole[kept].all() else None
        clock = read_clock(file, stamps.values[kept], counted)
    time = stamps.values[kept] if clock is None else clock.seconds
    parts = {name: part for name, part in found.channels.items() if part is not None and part.whole[kept].any()}
    valid = np.all([part.whole[kept] for part in parts.values()], axis=0) & np.ones(time.size, dtype=bool)
    if "valid" in found.beside:
        marked = found.beside["valid"]
        valid &= False if marked is None else ((marked.values != 0) & marked.whole)[kept]
    losses = [Loss("the end of the file", cut, None, None)] if cut else []
    losses += _losses(found, float(np.median(np.diff(time))) if time.size > 1 else 0.0)
    events = _readable(lambda: read_events(file), "the events", losses) or ()
    meta = _readable(lambda: read_meta(file), "the meta", losses) or {}
    recording = Recording(
        time,
        {name: part.values[kept] for name, part in parts.items()},
        meta,
        clock=clock,
        valid=valid,
        signals={name: part.signal for name, part in parts.items() if part.signal is not None},
        events=events + tuple(Event(float(time[-1]), LOST, str(loss)) for loss in losses),
    )
    return Salvaged(recording, tuple(losses))


def _readable(read: Callable[[], Any], what: str, losses: list[Loss]) -> Any:
    """Return what `read` gives; None, and one loss more, where that is damaged."""
    try:
        return read()
    except DAMAGE as error:
        losses.append(Loss(what, str(error), None, None))
        return None


def _losses(found: _Found, step: float) -> list[Loss]:
    """Return first the rows that are lost altogether, then what single signals lack of the others."""
    kept = found.kept
    if not kept.any():
        return [Loss("every signal", f"all of its {kept.size} rows", kept.size, kept.size * step)]
    missing = {"every signal": ~kept}
    for name, part in {**found.beside, **found.channels}.items():
        missing[f"'{name}'"] = kept if part is None else kept & ~part.whole
    alike: dict[tuple[int, int], list[str]] = {}
    for name, rows in missing.items():
        for run in runs_of(rows):
            alike.setdefault(run, []).append(name)
    return [
        Loss(", ".join(names), f"rows {begin} to {end - 1}", end - begin, (end - begin) * step)
        for (begin, end), names in alike.items()
    ]


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, str]]:
    """Open the file, a cut one filled up with bytes that no checksum takes for data; give it, and where it is cut."""
    import h5py

    cut, lacking = _cut(path)
    reserve(path.stat().st_size + lacking if cut else 0, str(path))
    with h5py.File(io.BytesIO(path.read_bytes() + b"\xff" * lacking) if cut else path, "r") as file:
        check_format(path, file)
        yield file, cut


def _cut(path: Path) -> tuple[str, int]:
    """Return in words where a file of ours ends too early, and how many bytes it lacks; "" and 0 for a whole one.

    Bytes 28 to 35 of the superblock, which is of version 3 in our files, give the end of the file.
    """
    with path.open("rb") as opened:
        head = opened.read(36)
    size, end = path.stat().st_size, int.from_bytes(head[28:36], "little") if head[8:9] in (b"\x02", b"\x03") else 0
    return (f"the file ends at byte {size} of {end}", end - size) if size < end else ("", 0)
