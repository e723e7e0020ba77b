"""What is whole of a recording that was cut short or damaged: found block by block, and only where it is asked for."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.channels import Signal
from hapticeval.recordings.hdf5 import (
    DAMAGE,
    check_format,
    check_inside,
    check_signature,
    declared_size,
    ending,
    read_events,
    read_signal,
)
from hapticeval.recordings.recording import Clock, Event, Recording, runs_of
from hapticeval.types import BoolArray


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


LOST = "lost"
"""The kind of the events that tell of losses, so that a recording made of a damaged file goes on saying so."""


def told_losses(recording: Recording) -> tuple[str, ...]:
    """What of the file that a recording was made of is lost, in words."""
    return tuple(event.text for event in recording.events if event.kind == LOST)


def told_warnings(recording: Recording) -> tuple[str, ...]:
    """What the import of a foreign file warned of: rows that are cut off, cells without a number."""
    return tuple(str(text) for text in recording.meta.get("import", {}).get("warnings", ()))


MISSING = ("time out of order", "without a number")
"""Of what an import leaves out, the rows that the file should have had: gaps are as they were meant."""


def incomplete(recording: Recording) -> bool:
    """Whether rows of a recording are lost or masked, cycles have no row, the run ended early, or the import warned."""
    left_out = recording.meta.get("import", {}).get("left out", {})
    ended = any(event.kind == "ended" for event in recording.events)
    missed = recording.clock is not None and recording.clock.missed
    return bool(missed or ended or told_losses(recording) or told_warnings(recording) or left_out.keys() & set(MISSING))


@dataclass(frozen=True)
class Salvaged:
    """What is whole of a file, as a recording, and the `losses`; of a sound file there are none."""

    recording: Recording
    losses: tuple[Loss, ...]


def salvage(path: Path) -> Salvaged:
    """The sound part of an HDF5 recording, and what is lost, which its events say as well (kind `lost`).

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
    """Where a damaged file is damaged, in words; empty where that cannot be said."""
    try:
        with _opened(path) as (file, cut):
            told = [cut, *(f"{loss.what}, {loss.where}" for loss in _losses(_scan(file), 0.0))]
    except (HapticevalError, *DAMAGE):
        return ending(path)
    told = [each for each in told if each]
    return "; ".join(told[:5] + ["and more"] * (len(told) > 5))


class _Part(NamedTuple):
    """What could be read of a signal: its numbers, and which rows of them are whole."""

    values: Any
    whole: BoolArray
    signal: Signal | None


@dataclass
class _Found:
    """What a scan could read. None stands for a part of which nothing is whole."""

    count: int
    base: str
    rows: dict[str, _Part | None]
    channels: dict[str, _Part | None]

    @property
    def kept(self) -> BoolArray:
        """The rows that have a stamp and a number in any channel."""
        stamps = self.rows[self.base]
        masks = [part.whole for part in self.channels.values() if part is not None]
        if stamps is None:
            return np.zeros(self.count, dtype=bool)
        return stamps.whole & np.any(masks, axis=0) if masks else stamps.whole


def _salvaged(path: Path, file: Any, cut: str) -> Salvaged:
    found = _scan(file)
    kept = found.kept
    stamps = found.rows[found.base]
    if stamps is None or not kept.any():
        raise InputError(
            f"nothing of {path} can be read",
            why="no row of it is whole" + (f": {cut}" if cut else ""),
            todo="copy it again",
        )
    clock = _clock(file, found, kept) if found.base == "nanoseconds" else None
    time = clock.seconds if clock is not None else stamps.values[kept]
    parts = {name: part for name, part in found.channels.items() if part is not None and part.whole[kept].any()}
    valid = np.ones(time.size, dtype=bool)
    for part in parts.values():
        valid &= part.whole[kept]
    if "valid" in found.rows:
        said = found.rows["valid"]
        valid &= False if said is None else ((said.values != 0) & said.whole)[kept]
    losses = _losses(found, float(np.median(np.diff(time))) if time.size > 1 else 0.0)
    if cut:
        losses.insert(0, Loss("the end of the file", cut, None, None))
    events: tuple[Event, ...] = ()
    meta: dict[str, Any] = {}
    try:
        events = read_events(file)
    except DAMAGE as error:
        losses.append(Loss("the events", str(error), None, None))
    try:
        meta = json.loads(bytes(file["meta"][:]).decode())
    except DAMAGE as error:
        losses.append(Loss("the meta", str(error), None, None))
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


def _clock(file: Any, found: _Found, kept: BoolArray) -> Clock:
    stamps, sequence = found.rows["nanoseconds"], found.rows.get("sequence")
    assert stamps is not None
    told = file["nanoseconds"].attrs
    anchor = [int(x) for x in told["anchor"]] if "anchor" in told else None
    return Clock(
        stamps.values[kept],
        int(told["start"]),
        None if anchor is None else (anchor[0], anchor[1]),
        sequence.values[kept] if sequence is not None and sequence.whole[kept].all() else None,
    )


def _scan(file: Any) -> _Found:
    """Read every block of every signal, and note those that cannot be read."""
    base = "nanoseconds" if "nanoseconds" in file else "time"
    count, chunk = int(file[base].shape[0]), int(file[base].chunks[0])
    beside = [name for name in (base, "sequence", "valid") if name in file]
    rows = {name: _part(file, name, count, chunk, described=False) for name in beside}
    group = file["channels"]
    return _Found(count, base, rows, {name: _part(group, name, count, chunk, described=True) for name in group})


def _part(group: Any, name: str, count: int, chunk: int, *, described: bool) -> _Part | None:
    try:
        dataset = group[name]
        signal = read_signal(dataset, name) if described else None
        if dataset.shape[:1] != (count,) or dataset.dtype not in (np.float64, np.int64, np.uint8):
            return None
        check_inside(Path(group.file.filename), group.file, [dataset], count)
        values = np.full(dataset.shape, np.nan if dataset.dtype == np.float64 else 0, dtype=dataset.dtype)
    except (HapticevalError, *DAMAGE):
        return None
    whole = np.zeros(count, dtype=bool)
    for begin in range(0, count, chunk):
        try:
            values[begin : begin + chunk] = dataset[begin : begin + chunk]
        except DAMAGE:
            continue
        whole[begin : begin + chunk] = True
    return _Part(values, whole, signal) if whole.any() else None


def _losses(found: _Found, step: float) -> list[Loss]:
    """First the rows that are lost altogether, then what single signals lack of the others."""
    kept = found.kept
    if not kept.any():
        return [Loss("every signal", f"all of its {found.count} rows", found.count, found.count * step)]
    missing = {"every signal": ~kept}
    for name, part in {**found.rows, **found.channels}.items():
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
    """The file, where its end is missing as far as it goes, and in words how far that is (empty for all of it)."""
    import h5py

    cut = ending(path)
    with path.open("rb") as raw, h5py.File(_Padded(raw, path), "r") if cut else h5py.File(path, "r") as file:
        check_format(path, file)
        yield file, cut


class _Padded(io.RawIOBase):
    """A file that is as long as it should be: where it is cut short, bytes follow that no checksum takes for data."""

    def __init__(self, raw: Any, path: Path) -> None:
        self.raw, self.size, self.at = raw, declared_size(path), 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self.at

    def seek(self, offset: int, whence: int = 0) -> int:
        self.at = offset + (0, self.at, self.size)[whence]
        return self.at

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        self.raw.seek(self.at)
        got = self.raw.read(len(view))
        view[: len(got)] = got
        if len(got) < len(view):
            view[len(got) :] = b"\xff" * (len(view) - len(got))
        self.at += len(view)
        return len(view)
