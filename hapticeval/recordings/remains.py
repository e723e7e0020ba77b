"""What a file that is cut short still has for its mapping: rows that line up again, and what each channel lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.recordings.formats import Table
from hapticeval.recordings.losses import Loss
from hapticeval.recordings.mapping import FileMapping, Source, TimeBase
from hapticeval.types import Array, BoolArray

AGAIN = "copy the file again from where it was recorded"


@dataclass(frozen=True)
class Remains:
    """A table and a mapping that fit each other; `short` (n,) marks the rows that some channel lacks."""

    table: Table
    mapping: FileMapping
    short: BoolArray | None = None
    losses: tuple[Loss, ...] = ()


def remains(table: Table, mapping: FileMapping) -> Remains:
    """All that is there of the mapped columns: as it is of a whole file.

    Of one that is cut, rows without a stamp, or without a number in any channel, are left out; where single channels
    end before the others NaN follows; a channel of which nothing is left is absent. How many rows a lost column had
    the file says, or else its clock. Raises `InputError` where the time or every channel is lost, and for columns that
    were never of one length; `UnknownNameError` for a column that the file never had.
    """
    if not table.promised and not table.open_ended:
        return Remains(table, mapping)
    clock = _clock(table, mapping)
    channels = {name: _aligned(table, source, clock, mapping.time) for name, source in mapping.channels.items()}
    extents = {name: _extent(table, source.columns) for name, source in channels.items() if source.time is None}
    gaps = None if mapping.gaps is None else _extent(table, mapping.gaps[:1])
    for source in channels.values():
        _same_length(table, source.columns, clock.rows if source.time is None else _promised(table, source.time))
    if mapping.gaps is not None:
        _same_length(table, mapping.gaps[:1], clock.rows)
    if gaps is not None and not gaps.there:
        raise InputError("the column of [gaps] is lost", why="; ".join(table.warnings), todo=AGAIN)
    kept = min(clock.there, max((extent.there for extent in extents.values()), default=clock.there))
    losses = clock.losses(extents, gaps, kept)
    columns = dict(table.columns)
    for name, source in channels.items():
        if source.time is None:
            columns |= {column: _to_length(table, column, kept) for column in source.columns}
            continue
        own = _extent(table, (*source.columns, source.time))
        extents[name] = own
        if own.there:
            rows = table.rows(source.time)
            columns |= {column: _to_length(table, column, rows) for column in source.columns}
        if own.of is None or own.there < own.of:
            losses.append(_own_loss(table, name, source, own, mapping.time.factor))
    there = {name: source for name, source in channels.items() if extents[name].there}
    if not there or not kept:
        raise InputError("nothing of any mapped channel is left", why="; ".join(table.warnings), todo=AGAIN)
    if mapping.time.column is not None:
        columns[mapping.time.column] = table[mapping.time.column][:kept]
    ends = [extents[name].there for name, source in there.items() if source.time is None]
    if mapping.gaps is not None and gaps is not None:
        columns[mapping.gaps[0]] = _to_length(table, mapping.gaps[0], kept)
        ends.append(gaps.there)
    return Remains(
        replace(table, columns=columns, promised={}, open_ended=False),
        replace(mapping, channels=there),
        np.arange(kept) >= min(ends, default=kept),
        tuple(losses),
    )


class _Extent(NamedTuple):
    """How many rows are there, of how many; None where the file does not say it any more."""

    there: int
    of: int | None


def _extent(table: Table, columns: Sequence[str | float]) -> _Extent:
    """The rows that all of some columns have."""
    names = [str(name) for name in columns]
    there = min(0 if table.lacks(name) else table.rows(name) for name in names)
    known = [_promised(table, name) for name in names]
    return _Extent(there, max((rows for rows in known if rows is not None), default=None))


def _promised(table: Table, name: str) -> int | None:
    """How many rows a column had."""
    return table.promised.get(name, None if table.lacks(name) else table.rows(name))


def _same_length(table: Table, columns: Sequence[str | float], rows: int | None) -> None:
    """Raise `InputError` for a column that never had as many rows as its clock."""
    for name in map(str, columns):
        had = _promised(table, name)
        if rows is not None and had not in (None, rows):
            raise InputError(
                f"the column '{name}' had {had} rows, the time {rows}",
                why="they were recorded on different clocks",
                todo='give the channel its own: time = "COLUMN", and resample = "hold" or "linear"',
            )


@dataclass(frozen=True)
class _Clock:
    """The recording's clock: `times` (s) of the rows that have one, of so many `rows` in all."""

    times: Array
    rows: int

    @property
    def there(self) -> int:
        return self.times.size

    def losses(self, extents: dict[str, _Extent], gaps: _Extent | None, kept: int) -> list[Loss]:
        """First the rows that are left out altogether, then what single channels lack of the others."""
        runs = {(kept, self.rows): ["every signal"]} if kept < self.rows else {}
        for name, extent in extents.items():
            if extent.there < kept:
                runs.setdefault((extent.there, kept), []).append(f"'{name}'")
        if gaps is not None and gaps.there < kept:
            runs.setdefault((gaps.there, kept), []).append("where the gaps are")
        return [
            Loss(", ".join(names), f"rows {begin} to {end - 1}", end - begin, seconds(self.times, begin, end))
            for (begin, end), names in runs.items()
        ]


def seconds(times: Array, begin: int, end: int) -> float | None:
    """How long rows `begin` to `end` (exclusive) took: by their times, or the median step where these are lost."""
    steps = np.diff(times)
    step = float(np.median(steps)) if steps.size else 0.0
    span = (end - begin) * step
    if end <= times.size:
        span = float(times[end - 1] - times[begin - 1]) if begin else float(times[end - 1] - times[0]) + step
    return span if np.isfinite(span) and span > 0.0 else None


def _clock(table: Table, mapping: FileMapping) -> _Clock:
    time = mapping.time
    if time.column is not None:
        rows = _promised(table, time.column)
        times = _times(table, time.column, time.factor)  # an error where the column is lost
        return _Clock(times, max(rows or 0, times.size))
    assert time.rate is not None
    known = [_extent(table, source.columns).of for source in mapping.channels.values() if source.time is None]
    rows = max((rows for rows in known if rows is not None), default=0)
    return _Clock(np.arange(rows) / time.rate, rows)


def _times(table: Table, column: str, factor: float) -> Array:
    """Seconds since the first row."""
    values = table[column]
    out: Array = factor * (values - values[0]).astype(np.float64)
    return out


def _aligned(table: Table, source: Source, clock: _Clock, time: TimeBase) -> Source:
    """A channel whose own clock is the recording's after all, as one without a clock of its own."""
    if source.time is None or source.time == time.column:
        return replace(source, time=None)
    if time.column is None or table.lacks(source.time) or _promised(table, source.time) != clock.rows:
        return source
    own, main = table[source.time], table[time.column]
    both = min(own.size, main.size)
    return replace(source, time=None) if np.array_equal(own[:both], main[:both]) else source


def _to_length(table: Table, column: str, rows: int) -> Array:
    """A column's first rows, followed by NaN where it has fewer."""
    values = table.columns.get(column, ())
    out = np.full(rows, np.nan)
    there = np.asarray(values)[:rows]
    if there.size == rows:
        return there
    out[: there.size] = there
    return out


def _own_loss(table: Table, name: str, source: Source, own: _Extent, factor: float) -> Loss:
    """What is lost of a channel on a clock of its own."""
    assert source.time is not None
    where = f"all that followed row {own.there - 1}" if own.there else "all of it"
    if own.of is None:
        return Loss(f"'{name}'", f"{where}, how many rows is not known", None, None)
    times = np.empty(0) if table.lacks(source.time) else _times(table, source.time, factor)
    where = f"rows {own.there} to {own.of - 1} of its clock '{source.time}'"
    return Loss(f"'{name}'", where, own.of - own.there, seconds(times, own.there, own.of))
