"""The rate of a loop that misses cycles and is late: by the numbers of its cycles, without a bias."""

from __future__ import annotations

import numpy as np
import pytest

from hapticeval.recordings.integrity.report import examine
from hapticeval.recordings.recording import Clock, Recording


def test_missed_cycles_and_late_rows_do_not_change_the_rate():
    random = np.random.default_rng(4)
    keep = np.concatenate([[True], random.random(5000) > 0.1, [True]])
    sequence = np.flatnonzero(keep)
    # Whoever was late reads the newest packet: the row after a gap comes up to a cycle late, the next one in time.
    late = np.concatenate([[False], np.diff(sequence) > 1]) * random.uniform(0.0, 0.9, sequence.size)
    late[-1] = 0.0
    stamps = np.rint(1e6 * (sequence + late)).astype(np.int64)
    clock = Clock(stamps, sequence=sequence)
    made = Recording.clocked(clock, {"grip": np.zeros(sequence.size)}, {"dt": 1e-3}, signals={"grip": ("N", "grip")})
    report = examine(made)
    assert report.timing.rate == pytest.approx(1000.0, rel=1e-6)
    assert "rate" not in {fault.kind for fault in report.faults}
    missing = np.diff(sequence) - 1
    gaps = [fault.measures["missing"] for fault in report.faults if fault.kind == "gap"]
    assert set(gaps) <= set(missing[missing > 0].tolist())
    assert sum(gaps) == report.timing.missing


def test_a_rate_that_is_wrong_is_still_told():
    sequence = np.arange(1000)
    clock = Clock((1.05e6 * sequence).astype(np.int64), sequence=sequence)
    made = Recording.clocked(clock, {"grip": np.zeros(1000)}, {"dt": 1e-3}, signals={"grip": ("N", "grip")})
    assert {fault.kind for fault in examine(made).faults} == {"rate"}
