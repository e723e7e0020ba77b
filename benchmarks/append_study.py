"""What recording costs a 1 kHz loop: `python benchmarks/append_study.py --seconds 600`.

Times every append of a loop that sleeps until its next millisecond, once with the machine as it is and once with all
its cores kept busy, and how late the loop is without a recorder under the same load.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hapticeval.recordings.journal import recover
from hapticeval.recordings.recorder import LossWarning, Recorder

PERIOD = 1_000_000
CHANNELS = {"hip": 2, "ihip": 2, "force": 2, "velocity": 2, "joint_position": 2, "joint_torque": 2}


class Figures(NamedTuple):
    """Microseconds of an append (all NaN without a recorder), rows lost, and how many cycles began 1 ms late."""

    median: float
    most: float
    worst: float
    lost: int
    late: int
    cycles: int


@contextlib.contextmanager
def busy_cores(saturated: bool) -> Iterator[None]:
    """As many processes as there are cores, that do nothing but run."""
    burners = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1) if saturated
    ]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


def loop(seconds: float, recorder: Recorder | None) -> tuple[np.ndarray, int]:
    """Nanoseconds of each append, and the cycles that began late."""
    count = int(seconds * 1e9 / PERIOD)
    taken = np.zeros(count, dtype=np.int64)
    point, push = np.zeros(2), np.ones(2)
    late = 0
    due = time.perf_counter_ns()
    for cycle in range(count):
        due += PERIOD
        wait = due - time.perf_counter_ns()
        if wait > 0:
            time.sleep(wait * 1e-9)
        begin = time.perf_counter_ns()
        late += begin - due > PERIOD
        point[0] = cycle
        if recorder is not None:
            begin = time.perf_counter_ns()
            recorder.append(point, point, push, push, point, push)
            taken[cycle] = time.perf_counter_ns() - begin
    return taken, late


def measure(seconds: float, *, saturated: bool, record: bool = True) -> Figures:
    """One run. Raises `RuntimeError` where a row that was not said to be lost is not in the journal."""
    with tempfile.TemporaryDirectory() as folder, busy_cores(saturated):
        if not record:
            _, late = loop(seconds, None)
            return Figures(np.nan, np.nan, np.nan, 0, late, int(seconds * 1e9 / PERIOD))
        path = Path(folder) / "run.journal"
        recorder = Recorder(path, CHANNELS)
        taken, late = loop(seconds, recorder)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LossWarning)
            summary = recorder.close()
        recording = recover(path)
        if len(recording) + summary.lost != taken.size or recording.clock.sequence[-1] >= taken.size:
            raise RuntimeError(f"{len(recording)} rows in the journal, {summary}, {taken.size} appended")
        return Figures(*(np.percentile(taken, (50.0, 99.9, 100.0)) / 1e3), summary.lost, late, taken.size)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="of each of the four runs")
    seconds = parser.parse_args().seconds
    print(f"{'machine':10} recorder {'median us':>10} {'99.9 % us':>10} {'worst us':>10} {'lost':>6} {'1 ms late':>9}")
    for saturated in (False, True):
        for record in (True, False):
            delays = measure(seconds, saturated=saturated, record=record)
            print(
                f"{'saturated' if saturated else 'as it is':10} {'yes' if record else 'no':8} {delays.median:10.2f} "
                f"{delays.most:10.2f} {delays.worst:10.1f} {delays.lost:6} {delays.late:7} of {delays.cycles}",
                flush=True,
            )


if __name__ == "__main__":
    main()
