"""What the tests of recordings share: runs with everything that a real one brings, their journals, and damage."""

import json
from contextlib import contextmanager

import h5py
import numpy as np

from hapticeval.recordings.channels import Signal
from hapticeval.recordings.journal import HEADER_COPIES, Kind, Layout, block_head, opening
from hapticeval.recordings.recording import Clock, Event, Recording

EXTRA = tuple(f"adc{k}" for k in range(7))
STEP = 1_000_000


def real(rows=60):
    """A run with a clock, gaps, joints, scalars, events, and more channels than a group holds in one piece."""
    rng = np.random.default_rng(7)
    channels = {name: rng.normal(size=(rows, 2)) for name in ("hip", "ihip", "force")}
    channels["joint_position"] = rng.normal(size=(rows, 3))
    channels |= {name: rng.normal(size=rows) for name in EXTRA}
    valid = np.ones(rows, dtype=bool)
    valid[5] = False
    channels["hip"][5] = np.nan
    signals = {name: Signal("V", "analogue input", "device", "positive in") for name in EXTRA}
    stamps = 3 * 10**14 + STEP * np.arange(rows) + rng.integers(0, 1000, rows)
    clock = Clock(stamps, anchor=(3 * 10**14, 1_700_000_000 * 10**9), sequence=2 * np.arange(rows))
    events = [Event(0.0101, "mark", "Größe"), Event(0.04, "touch")]
    return Recording.clocked(clock, channels, {"who": "A. Tester"}, valid=valid, signals=signals, events=events)


def assert_same(one, other):
    """The same to the last bit, with all that is stated beside the numbers."""
    assert one.time.tobytes() == other.time.tobytes()
    assert list(one.channels) == list(other.channels)
    for name in one.channels:
        assert one.channels[name].tobytes() == other.channels[name].tobytes()
    assert (dict(one.meta), one.signals, one.events) == (dict(other.meta), other.signals, other.events)
    assert one.measured.tolist() == other.measured.tolist()
    if other.clock is not None:
        for name in ("nanoseconds", "sequence"):
            assert getattr(one.clock, name).tobytes() == getattr(other.clock, name).tobytes()
        assert (one.clock.start, one.clock.anchor) == (other.clock.start, other.clock.anchor)


def journal_parts(layout, table, *, size=10, closed=True, events=()):
    """The blocks of a journal: its opening, `size` rows each, events, and the end."""
    made = [opening(layout)]

    def add(kind, count, payload):
        made.append(block_head(kind, len(made) - 1 + HEADER_COPIES, count, payload) + payload)

    for begin in range(0, len(table), size):
        part = table[begin : begin + size]
        add(Kind.ROWS, len(part), part.tobytes())
    for event in events:
        add(Kind.EVENT, 0, json.dumps(event).encode())
    if closed:
        end = {"how": closed, "next": int(table["sequence"][-1]) + 1, "unwritten": 0, "overrun": 0, "events_lost": 0}
        add(Kind.END, 0, json.dumps(end | {"how": "closed" if closed is True else closed}).encode())
    return made


def journal_of(recording, **more):
    """The blocks of the journal that a recorder would have written of a recording."""
    layout = Layout(dict.fromkeys(recording.channels, 2), {}, recording.meta)
    table = np.zeros(len(recording), dtype=layout.dtype)
    table["sequence"], table["nanoseconds"] = np.arange(len(recording)), recording.nanoseconds
    for name, values in recording.channels.items():
        table[name] = values
    return journal_parts(layout, table, **more)


def flipped(data, *places, bit=0x10):
    """Bytes with one bit wrong in each of some places."""
    hurt = bytearray(data)
    for place in places:
        hurt[place] ^= bit
    return bytes(hurt)


@contextmanager
def matlab73(path):
    """A MATLAB 7.3 file to be filled: HDF5 behind a header of MATLAB's."""
    with h5py.File(path, "w", userblock_size=512) as file:
        yield file
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def matrix73(group, name, values, kind="double"):
    """A matrix in such a file, as MATLAB marks it."""
    dataset = group.create_dataset(name, data=values)
    dataset.attrs["MATLAB_class"] = np.bytes_(kind)
    return dataset
