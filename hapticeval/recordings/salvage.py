"""What is whole of a recording that was cut short or damaged: found block by block, and only where it is asked for."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hapticeval.errors import HapticevalError, InputError
from hapticeval.recordings.channels import CHANNELS, Signal
from hapticeval.recordings.clock import Clock
from hapticeval.recordings.hdf5 import DAMAGE, TOLD, check_format, check_signature, damaged, read_events, text
from hapticeval.recordings.losses import Loss, Salvaged
from hapticeval.recordings.recording import Event, Recording
from hapticeval.types import BoolArray

SUPERBLOCK = struct.Struct("<8sBBBBQQQQI")
"""Versions 2 and 3: signature, version, sizes, flags, base, extension, end of file, root, checksum."""


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
            found = _scan(file)
    except (HapticevalError, *DAMAGE):
        return _ending(path)
    losses = [str(loss) for loss in _losses(found, 0.0)]
    told = [cut] if cut else []
    return "; ".join(told + [text.partition(":")[0] for text in losses[:5]] + ["and more"] * (len(losses) > 5))


@dataclass
class _Found:
    """What a scan could read: numbers with a mask of the rows that are whole, by name; None where nothing is."""

    count: int
    base: str
    signals: dict[str, tuple[Any, BoolArray] | None]
    chunk: int


def _salvaged(path: Path, file: Any, cut: str) -> Salvaged:
    found = _scan(file)
    version = int(file.attrs["format_version"])
    group = file if version == 1 else file["channels"]
    stamps = found.signals[found.base]
    names = [name for name in found.signals if name not in ("time", "nanoseconds", "sequence", "valid")]
    whole = {name: each for name in names if (each := found.signals[name]) is not None and each[1].any()}
    kept = np.zeros(found.count, dtype=bool) if stamps is None else stamps[1].copy()
    if whole:
        kept &= np.any([mask for _, mask in whole.values()], axis=0)
    if stamps is None or not kept.any():
        raise damaged(path, "no row of it is whole" + (f": {cut}" if cut else ""))
    valid = np.all([mask[kept] for _, mask in whole.values()], axis=0) if whole else np.ones(kept.sum(), dtype=bool)
    said = found.signals.get("valid")
    if "valid" in found.signals:
        valid &= np.zeros(kept.sum(), bool) if said is None else (said[0] != 0)[kept] & said[1][kept]
    clock = _clock(file, found, kept) if found.base == "nanoseconds" else None
    time = clock.seconds if clock is not None else stamps[0][kept]
    step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    losses = _losses(found, step)
    events, meta = (), {}
    try:
        events = read_events(file)
    except DAMAGE as error:
        losses.append(Loss("the events", str(error), None, None))
    try:
        meta = json.loads(bytes(file["meta"][:]).decode())
    except DAMAGE as error:
        losses.append(Loss("the meta", str(error), None, None))
    if cut:
        losses.insert(0, Loss("the end of the file", cut, None, None))
    lost = tuple(Event(float(time[-1]), "lost", str(loss)) for loss in losses)
    recording = Recording(
        time,
        {name: values[kept] for name, (values, _) in whole.items()},
        meta,
        clock=clock,
        valid=valid,
        signals={name: _signal(group[name], name, version) for name in whole},
        events=events + lost,
    )
    return Salvaged(recording, tuple(losses))


def _clock(file: Any, found: _Found, kept: BoolArray) -> Clock:
    stamps = file["nanoseconds"]
    values = found.signals["nanoseconds"]
    sequence = found.signals.get("sequence")
    assert values is not None
    numbers = None
    if sequence is not None and sequence[1][kept].all():
        numbers = sequence[0][kept]
    anchor = [int(x) for x in stamps.attrs["anchor"]] if "anchor" in stamps.attrs else None
    return Clock(
        values[0][kept], int(stamps.attrs["start"]), None if anchor is None else (anchor[0], anchor[1]), numbers
    )


def _signal(dataset: Any, name: str, version: int) -> Signal:
    if version == 1:
        return CHANNELS[name]
    return Signal(text(dataset, "unit") or "", *(text(dataset, key) or "" for key in TOLD))


def _scan(file: Any) -> _Found:
    """Read every block of every signal, and note those that cannot be read."""
    base = "nanoseconds" if "nanoseconds" in file else "time"
    count, chunk = int(file[base].shape[0]), int(file[base].chunks[0])
    signals = {name: _blocks(file, name, count, chunk) for name in (base, "sequence", "valid") if name in file}
    if int(file.attrs["format_version"]) == 1:
        group, names = file, [name for name in CHANNELS if name in file]
    else:
        group = file["channels"]
        names = list(group)
    for name in names:
        signals[name] = _blocks(group, name, count, chunk)
    return _Found(count, base, signals, chunk)


def _blocks(group: Any, name: str, count: int, chunk: int) -> tuple[Any, BoolArray] | None:
    try:
        dataset = group[name]
        shape, dtype = dataset.shape, dataset.dtype
        if shape[:1] != (count,) or dtype not in (np.float64, np.int64, np.uint8):
            return None
        if name in CHANNELS and text(dataset, "unit") != CHANNELS[name].unit:
            return None
        values = np.full(shape, np.nan if dtype == np.float64 else 0, dtype=dtype)
    except DAMAGE:
        return None
    whole = np.zeros(count, dtype=bool)
    for begin in range(0, count, chunk):
        try:
            values[begin : begin + chunk] = dataset[begin : begin + chunk]
        except DAMAGE:
            continue
        whole[begin : begin + chunk] = True
    return values, whole


def _losses(found: _Found, step: float) -> list[Loss]:
    losses = []
    for name, each in found.signals.items():
        if each is None:
            losses.append(Loss(f"'{name}'", "whole", found.count, found.count * step))
            continue
        bad = np.diff(np.concatenate([[False], ~each[1], [False]]).astype(np.int8))
        for begin, end in zip(np.flatnonzero(bad == 1), np.flatnonzero(bad == -1), strict=True):
            losses.append(
                Loss(f"'{name}'", f"rows {begin} to {end - 1}", int(end - begin), float((end - begin) * step))
            )
    return losses


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, str]]:
    """The file, where its end is missing as far as it goes, and in words how far that is (empty for all of it)."""
    import h5py

    cut = _ending(path)
    with path.open("rb") as raw, h5py.File(_Padded(raw, path) if cut else path, "r") as file:
        check_format(path, file)
        yield file, cut


def _ending(path: Path) -> str:
    size, told = path.stat().st_size, _told_size(path)
    return f"the file ends at byte {size} of {told}" if size < told else ""


def _told_size(path: Path) -> int:
    with path.open("rb") as opened:
        head = opened.read(SUPERBLOCK.size)
    if len(head) < SUPERBLOCK.size or head[8] not in (2, 3):
        return 0
    return int(SUPERBLOCK.unpack(head)[7])


class _Padded(io.RawIOBase):
    """A file that is cut short, read as if it went on with bytes that no checksum takes for data."""

    def __init__(self, raw: Any, path: Path) -> None:
        self.raw, self.size, self.at = raw, _told_size(path), 0

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
        view[len(got) :] = b"\xff" * (len(view) - len(got))
        self.at += len(view)
        return len(view)
