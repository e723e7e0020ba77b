"""Files of any kind as recordings, every number in SI and every row where it was; and recordings as other files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticeval.errors import InputError, UnknownNameError, at
from hapticeval.files import creating, csv_cell, writing
from hapticeval.quantity import plural
from hapticeval.recordings.formats import Table, formats, read_table
from hapticeval.recordings.formats.trials import trial_of
from hapticeval.recordings.hdf5 import (
    DAMAGE,
    FORMAT,
    SIGNATURE,
    DamagedError,
    metadata_json,
    read_recording,
    salvage,
    write_recording,
)
from hapticeval.recordings.importing.mapping import POSE, FileMapping, Source, TimeBase, read_mapping
from hapticeval.recordings.journal import BLOCK_MARK, MAGIC, recover
from hapticeval.recordings.memory import first_bytes
from hapticeval.recordings.quantization import rounded_as
from hapticeval.recordings.recording import Clock, Recording, columns_of
from hapticeval.recordings.world import POSE_CHANNELS, in_body, rotation_rows
from hapticeval.types import Array, BoolArray, IntArray


def load(
    path: Path | str,
    *,
    mapping: Path | str | None = None,
    format: str | None = None,
    trial: str | None = None,
    salvaging: bool = False,
) -> Recording:
    """Return the recording in a file of any kind: ours, the journal of a recorder, or a foreign one by its mapping.

    `trial` is one of a foreign file that holds several, by name or number, in place of that of the mapping.
    A journal gives what is whole of it. So does one of our files that is cut short or damaged where `salvaging` is
    asked for; otherwise it is an error. Either way the recording's events of kind `lost` report what is missing. Raises
    `InputError` for a foreign file without a mapping and one of ours with it, and as `recover`, `read_recording`,
    `salvage`, `read_table`, `read_mapping` and `convert` do.
    """
    path = Path(path)
    if not is_ours(path):
        return _foreign(path, mapping, format, trial)
    if mapping is not None:
        raise InputError(f"{path} is a recording already", why="it needs no mapping", todo="leave --mapping out")
    if _is_journal(first_bytes(path)):
        return recover(path)
    try:
        return read_recording(path)
    except DamagedError:
        if not salvaging:
            raise
        return salvage(path)


def _foreign(path: Path, mapping: Path | str | None, format: str | None, trial: str | None) -> Recording:
    """Return the recording that a mapping makes of a file of somebody else's. Raises `InputError` without a mapping."""
    if mapping is None:
        raise InputError(
            f"{path} is not a recording of hapticeval's",
            why="it does not state which column is what, in which unit and with which sign",
            todo=f"write a mapping: hapticeval inspect {path.name} --write-mapping mapping.toml; then give --mapping",
        )
    file_mapping = read_mapping(mapping)
    format_name = format or file_mapping.document.format
    known, head = formats(), first_bytes(path)
    stated = known.get(format_name or "")
    # A format that is recognised by its bytes can be seen to be another one before its columns are missed.
    if format is None and stated is not None and stated.recognises and not stated.fits(path, head):
        detected = next((candidate for candidate in known.values() if candidate.fits(path, head)), None)
        if detected is not None:
            raise InputError(
                f"{path} is in the format '{detected.name}' ({detected.about}), and the mapping {Path(mapping).name} "
                f"is for '{format_name}'",
                why="its columns have other names there",
                todo=f"propose a mapping of its own: hapticeval inspect {path.name} --write-mapping mapping.toml",
            )
    table, trial = read_table(path, format=format_name), trial or file_mapping.document.trial
    return convert(table if trial is None else trial_of(table, trial), file_mapping, file=path.name)


def is_ours(path: Path | str) -> bool:
    """Return whether a file is a recording or a journal that hapticeval wrote, and so states itself what is in it.

    Raises `InputError` where it is missing or empty.
    """
    head = first_bytes(Path(path))
    if not head.startswith(SIGNATURE):
        return _is_journal(head)
    import h5py

    try:
        with h5py.File(path, "r") as file:
            stated = file.attrs.get("format", b"")
    except DAMAGE:
        # A damaged file of ours still has the name of the format among its first bytes.
        return FORMAT.encode() in head
    return (stated.decode(errors="replace") if isinstance(stated, bytes) else str(stated)) == FORMAT


def _is_journal(head: bytes) -> bool:
    """Return whether a file begins as journals do, or its first block does: one wrong byte hides no journal."""
    return head.startswith(MAGIC) or head[len(MAGIC) :].startswith(BLOCK_MARK)


def convert(table: Table, mapping: FileMapping, *, file: str = "") -> Recording:
    """Return the recording that a mapping makes of a table.

    Rows without a number in a mapped column, and those of `[gaps]`, are kept and marked as not valid; `meta["import"]`
    counts them. Raises `UnknownNameError` for a column that is not there, with the closest, and `InputError` for

    - a table without a row, or without a valid one;
    - columns of different length or of different topics, and a channel on another clock;
    - a time that does not increase.
    """
    document = mapping.document
    # Each column is looked up where it is named, so that an error says of what it is.
    for name, source in mapping.channels.items():
        with at(f"[channels.{name}]"):
            for column in source.columns:
                table[column]
    first = next(iter(mapping.channels.values())).columns[0]
    stamps, valid = _stamps(table, document.time, mapping.factor, table.rows(first))
    if not stamps.size:
        raise InputError(
            f"{file or 'the file'} has no row",
            why=f"the column '{document.time.column or first}' is empty",
            todo="record or copy it again",
        )
    # Each row is counted under the first reason that makes it invalid.
    counts = {"time out of order": int(np.sum(~valid)), "without a number": 0}
    channels = {}
    for name, source in mapping.channels.items():
        channels[name] = _values(table, mapping, name, source, stamps)
        if name == POSE_CHANNELS[0] and POSE in document.channels:
            channels[name] = rotation_rows(channels[name], len(document.channels[POSE]["translation"]))
        # One component without a number makes a row of the channel none.
        empty = ~np.isfinite(channels[name]).reshape(stamps.size, -1).all(axis=1)
        counts["without a number"] += int(np.sum(empty & valid))
        valid &= ~empty
    if document.gaps is not None:
        _same_clock(table, document.time, document.gaps.column, stamps)
        gap = table[document.gaps.column] == document.gaps.where
        counts["in a gap"] = int(np.sum(gap & valid))
        valid &= ~gap
    if not valid.any():
        raise InputError("not one row is valid", why=str(counts), todo="look at the columns: hapticeval inspect FILE")
    more = {
        "warnings": [text for text in table.warnings if text not in table.cells],
        "cells": list(table.cells),
        "resampled": {name: source.resample for name, source in mapping.channels.items() if source.resample},
    }
    notes = {
        "format": table.format,
        "mapping": document.title,
        "rows": int(stamps.size),
        "left out": {key: count for key, count in counts.items() if count},
        "columns": {name: list(source.columns) for name, source in mapping.channels.items()},
        **{key: value for key, value in more.items() if value},
    }
    meta = {"source": "file", **({"file": file} if file else {}), **document.meta, "import": notes}
    if document.device is not None:
        known = {key: value for key, value in document.device.items() if key != "kind"}
        meta |= {"device": document.device["kind"], "device_parameters": known}
    clock = Clock(stamps, start=int(stamps[valid][0]) if document.time.start == "zero" else 0)
    signals = {name: source.signal for name, source in mapping.channels.items()}
    recording = Recording.clocked(clock, channels, meta, valid=valid, signals=signals)
    return in_body(recording) if POSE in document.channels else recording


def _stamps(table: Table, time: TimeBase, factor: float, rows: int) -> tuple[IntArray, BoolArray]:
    """Return stamps, ns, and which of them are in order."""
    if time.column is None:
        assert time.rate is not None
        # ns a row; without a clock the rows are taken to be evenly spaced.
        step = 1e9 / max(time.rate, LEAST_RATE)
        _check_latest(rows * step)
        return np.rint(np.arange(rows) * step).astype(np.int64), np.ones(rows, dtype=bool)
    stamps, known = nanoseconds(table[time.column], factor)
    # A row is in order where it is later than all before it: after a step back, rows up to the old time are not.
    never = np.iinfo(np.int64).min
    latest = np.maximum.accumulate(np.where(known, stamps, never))
    # A time that is not a number repeats the latest: zero would be a step back, and a gap after it.
    stamps = np.where(known | (latest == never), stamps, latest)
    ordered = known.copy()
    ordered[1:] &= stamps[1:] > latest[:-1]
    repeats = int(np.sum(np.diff(stamps[known]) == 0))
    if repeats and repeats == np.sum(~ordered) and time.disorder == "refuse":
        raise _equal_stamps(time.column, stamps, repeats)
    if not ordered.all() and time.disorder == "refuse":
        row, count = int(np.argmin(ordered)), int(np.sum(~ordered))
        before = f"{1e-9 * stamps[row - 1]:.9g} s, then " if row else ""
        now = f"does not increase at row {row}: {before}{1e-9 * stamps[row]:.9g} s"
        todo = 'mark them as no measurement: [time] disorder = "mask"; or mend the file'
        anew = known[row] and stamps[row] <= stamps[0]
        raise InputError(
            f"the time '{time.column}' {now if known[row] else f'is not a number at row {row}'}",
            why=f"{plural(count, 'row')} out of order or without a time, and nothing is sorted or re-timed silently",
            todo="make a file of each run: the clock begins anew there" if anew else todo,
        )
    return stamps, ordered


def _equal_stamps(column: str, stamps: IntArray, repeats: int) -> InputError:
    """Return the error of a clock that never goes back and gives several rows one time, as one of few digits does."""
    rising = np.diff(stamps)
    step, row = 1e-9 * float(np.median(rising[rising > 0])) if np.any(rising > 0) else 0.0, int(np.argmin(rising)) + 1
    rate = (stamps.size - 1) / max(1e-9 * float(stamps[-1] - stamps[0]), 1e-9)
    mean = f"about {rate:.4g} rows a second, if they are evenly spaced"
    few = 'mark them as no measurement: [time] disorder = "mask"'
    return InputError(
        f"the time '{column}' has equal stamps: {plural(repeats, 'row')} of {stamps.size} have the time of the row "
        f"before, first row {row}",
        why=f"it counts in steps of {step:.4g} s, and nothing is re-timed silently",
        todo=f"state their rate, in Hz, in place of column and unit: [time] rate = ... ({mean}); or {few}",
    )


def nanoseconds(values: NDArray[Any], factor: float) -> tuple[IntArray, BoolArray]:
    """Return times (n,) in units of `factor` s as whole ns, and which of them are numbers, (n,) each.

    Integers of whole nanoseconds stay exact. Raises `InputError` for a time that 64 bits do not hold.
    """
    # ns per unit of the column.
    scale = factor * 1e9
    known = np.isfinite(values)
    with np.errstate(over="ignore"):
        _check_latest(float(np.max(np.abs(values[known].astype(np.float64)), initial=0.0)) * scale)
    # Whole units of whole ns: integers all the way, as a float cannot hold ns since 1970.
    if values.dtype.kind == "i" and abs(scale - round(scale)) < 1e-9 * scale:
        return values.astype(np.int64) * round(scale), np.ones(values.size, dtype=bool)
    return np.rint(np.where(known, values, 0.0) * scale).astype(np.int64), known


def _check_latest(latest: float) -> None:
    """Raise `InputError` for a time (ns) that no stamp holds."""
    if latest > LAST_NANOSECOND:
        raise InputError(
            f"a time is {1e-9 * latest:.3g} s",
            why="a clock counts nanoseconds in 64 bits, which hold 292 years",
            todo="see the unit of the time, and its scale or rate",
        )


def _values(table: Table, mapping: FileMapping, name: str, source: Source, stamps: IntArray) -> Array:
    """Return a channel (n,) or (n, k) in SI, on the clock of the recording."""
    own: IntArray | None = None
    for column in source.columns:
        if source.time is None:
            _same_clock(table, mapping.document.time, column, stamps)
        elif table.topics.get(column) != table.topics.get(source.time) or table.rows(column) != table.rows(source.time):
            raise InputError(
                f"the clock '{source.time}' of '{name}' is not that of its column '{column}'",
                why=f"{_described(table, column)}, {_described(table, source.time)}",
                todo="name the clock of the same topic",
            )
    if source.time is not None:
        stated, known = nanoseconds(table[source.time], mapping.factor)
        # A clock that equals the recording's stamp for stamp needs no resampling.
        own = None if known.all() and np.array_equal(stated, stamps) else stated
    columns = []
    for column, factor, offset in zip(source.columns, source.factor, source.offset, strict=True):
        with np.errstate(over="ignore"):  # what no number holds is masked, as a cell without a number
            values = factor * table[column].astype(np.float64) + offset
        columns.append(values if own is None else _resampled(name, source, own, values, stamps))
    # A vector keeps its second axis, (n, 1), even in one dimension.
    if len(columns) == 1 and source.signal.frame not in ("world", "joint"):
        return columns[0]
    vectors = np.column_stack(columns)
    if source.axes is None:
        return vectors
    # Before the offset, which hides how many digits a text has.
    measured = np.column_stack(
        [factor * table[column] for column, factor in zip(source.columns, source.factor, strict=True)]
    )
    return rounded_as(vectors @ source.axes.T, measured)


def _resampled(name: str, source: Source, own: IntArray, values: Array, stamps: IntArray) -> Array:
    """Return values on another clock brought onto the recording's, NaN outside of what was measured."""
    if source.resample is None:
        raise InputError(
            f"the channel '{name}' is on the clock '{source.time}', which is not the recording's",
            why="nothing is re-timed silently",
            todo='choose how: resample = "hold" (the latest value) or "linear"',
        )
    if not own.size or np.any(np.diff(own) <= 0):
        raise InputError(f"the clock '{source.time}' of '{name}' is empty, or does not increase")
    # No value is held or extrapolated beyond what was measured.
    inside = (stamps >= own[0]) & (stamps <= own[-1])
    if source.resample == "hold":
        resampled = values[np.clip(np.searchsorted(own, stamps, side="right") - 1, 0, own.size - 1)]
    else:
        # ns from the first stamp: differences of int64 are exact, and small enough for doubles.
        resampled = np.interp((stamps - own[0]).astype(np.float64), (own - own[0]).astype(np.float64), values)
    return np.where(inside, resampled, np.nan)


def _same_clock(table: Table, time: TimeBase, column: str, stamps: IntArray) -> None:
    """Raise `InputError` for a column whose rows are not those of the time: by their number, or by their topic."""
    # Columns of different topics may have equally many rows, and are still at different times.
    alone = time.column is None
    topics = {table.topics.get(name) for name in (column, time.column) if name is not None}
    if table.rows(column) != stamps.size or (not alone and len(topics) > 1):
        clock = f"the time has {stamps.size} rows" if time.column is None else _described(table, time.column)
        raise InputError(
            f"the column '{column}' is not on the clock of the time" + ("" if alone else f" '{time.column}'"),
            why=f"{_described(table, column)}, {clock}; as many rows are not the same times",
            todo='give the channel its own: time = "COLUMN", and resample = "hold" or "linear"',
        )


def _described(table: Table, column: str) -> str:
    topic = f" of the topic '{table.topics[column]}'" if column in table.topics else ""
    return f"'{column}' has {table.rows(column)} rows{topic}"


LAST_NANOSECOND = 9.2e18
"""Nanoseconds that a stamp holds, with 0.2 % to spare."""

LEAST_RATE = 1e-12
"""Hz below which a second row is later than any stamp."""

LONGEST_NAME = 31
"""Names in MATLAB 5 files end here."""


def export(path: Path | str, recording: Recording) -> Path:
    """Write a recording as the ending of `path` says; each column states its unit.

    Only .h5 keeps everything; the others keep the stamps, the channels, which rows are valid, and the meta as JSON
    where they have a place for it. Raises `InputError` where the file is there already, `UnknownNameError` for another
    ending, and `HapticevalError` where it cannot be written.
    """
    path = Path(path)
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        raise UnknownNameError("file ending", path.suffix, WRITERS)
    with writing(path):
        write(path, recording)
    return path


def _exported(recording: Recording) -> dict[str, tuple[Array, str]]:
    """Return every column by name, with its unit: `hip.x`, `joint_torque.0`, `grip`."""
    columns: dict[str, tuple[Array, str]] = {"time": (recording.time, "s")}
    columns |= {name: (column.values, column.unit) for name, column in columns_of(recording).items()}
    if recording.valid is not None:
        columns["valid"] = (recording.valid.astype(np.float64), "1")
    return columns


def _csv(path: Path, recording: Recording) -> None:
    import pandas as pd

    columns = {csv_cell(f"{name} [{unit}]"): values for name, (values, unit) in _exported(recording).items()}
    with creating(path) as temporary:
        # Its doubles read back to the same bits.
        pd.DataFrame(columns).to_csv(temporary, index=False, na_rep="nan")


def _npz(path: Path, recording: Recording) -> None:
    arrays: dict[str, Any] = {"hapticeval": np.array(metadata_json(recording.meta))}
    for name, (values, unit) in _exported(recording).items():
        arrays |= {name: values, f"unit:{name}": np.array(unit)}
    with creating(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _mat(path: Path, recording: Recording) -> None:
    """Write a structure `recording` with `time`, a field per channel, `units` of the same fields, and meta as JSON."""
    from scipy.io import savemat

    for name in recording.channels:
        if len(name) > LONGEST_NAME or not name.replace("_", "").isalnum():
            raise InputError(
                f"the channel '{name}' cannot be a field of a MATLAB structure",
                why=f"fields have letters, digits and '_', {LONGEST_NAME} at the most",
                todo="write .h5, .npz or .csv",
            )
    # Columns (n, 1), as MATLAB has vectors.
    fields: dict[str, Any] = {"time": recording.time[:, None], **recording.channels}
    if recording.valid is not None:
        fields["valid"] = recording.valid.astype(np.uint8)[:, None]
    units = {"time": "s", **{name: recording.signals[name].unit for name in recording.channels}}
    contents = {"recording": fields, "units": units, "hapticeval": metadata_json(recording.meta)}
    with creating(path) as temporary, temporary.open("wb") as file:
        stream: Any = file
        savemat(stream, contents, do_compression=True, oned_as="column")


WRITERS: Mapping[str, Callable[[Path, Recording], None]] = {
    ".h5": write_recording,
    ".hdf5": write_recording,
    ".mat": _mat,
    ".csv": _csv,
    ".npz": _npz,
}
"""How each ending is written."""
