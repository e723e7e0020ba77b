"""What recording costs a loop, and how soon a native recording is open beside the same numbers as CSV."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from append_study import measure

from hapticeval.recordings.channels import Signal
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Clock, Recording

ROWS, COLUMNS, PERIOD = 1_000_000, 20, 50_000
ALLOWED = 2.0
"""Decompressing, which h5py does too, is most of the time; 0.6 was measured with two cores."""


@pytest.mark.parametrize("saturated", [False, True], ids=["as it is", "all cores busy"])
def test_appending_in_a_loop(benchmark, saturated):
    """Five seconds of 1 kHz. `append_study.py` does it for ten minutes."""
    figures = []
    benchmark.pedantic(lambda: figures.append(measure(5.0, saturated=saturated)), rounds=1)
    benchmark.extra_info.update(figures[0]._asdict())
    print(f"\n{figures[0]}")
    assert figures[0].lost == 0


HARNESS = """
import json, sys, time
import h5py, pandas
from pathlib import Path
from hapticeval.recordings.hdf5 import read_recording
def raw(path):
    kept = []
    with h5py.File(path) as file:
        file.visititems(lambda _, item: kept.append(item[()]) if isinstance(item, h5py.Dataset) else None)
    return kept
def peak():
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))
before, begin = peak(), time.perf_counter()
kept = {action}
print(json.dumps([time.perf_counter() - begin, (peak() - before) / 1024]))
"""


def opened(action: str) -> tuple[float, float]:
    """Seconds and MB (the process's peak, less that before) of the best of three runs, each a process of its own."""
    runs = [
        json.loads(subprocess.check_output([sys.executable, "-c", HARNESS.format(action=action)])) for _ in range(3)
    ]
    return min(seconds for seconds, _ in runs), min(memory for _, memory in runs)


def write_both(folder: Path) -> None:
    """Ten channels of two columns: smooth motion with noise in its last digits, and the same numbers as text."""
    rng = np.random.default_rng(0)
    motion = np.sin(np.linspace(0.0, 20.0 * np.pi, PERIOD))[:, None] * np.linspace(0.05, 1.0, COLUMNS)
    motion += 1e-6 * rng.normal(size=motion.shape)
    lines = [",".join(map(repr, row)) for row in motion.tolist()]
    with (folder / "run.csv").open("w") as file:
        file.write(",".join(["time", *(f"column{k}" for k in range(COLUMNS))]) + "\n")
        file.writelines(f"{0.001 * row:.3f},{lines[row % PERIOD]}\n" for row in range(ROWS))
    values = np.tile(motion, (ROWS // PERIOD, 1))
    names = ["hip", "ihip", "force", *(f"other{k}" for k in range(7))]
    recording = Recording.clocked(
        Clock(1_000_000 * np.arange(ROWS)),
        {name: values[:, 2 * k : 2 * k + 2] for k, name in enumerate(names)},
        signals={name: Signal("1", "another signal") for name in names[3:]},
    )
    write_recording(folder / "run.h5", recording)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the peak memory from /proc")
@pytest.mark.slow
def test_opening_a_million_rows(benchmark, tmp_path):
    """All of it in less than `ALLOWED` times what h5py takes for the numbers alone.

    Hip and force alone take less than a tenth of the memory that pandas takes for all the numbers as CSV.
    """
    write_both(tmp_path)
    figures = {}

    def run():
        figures["pandas"] = opened(f"pandas.read_csv({str(tmp_path / 'run.csv')!r})")
        figures["raw"] = opened(f"raw({str(tmp_path / 'run.h5')!r})")
        figures["whole"] = opened(f"read_recording(Path({str(tmp_path / 'run.h5')!r}))")
        figures["part"] = opened(f"read_recording(Path({str(tmp_path / 'run.h5')!r}), channels=['hip', 'force'])")

    benchmark.pedantic(run, rounds=1)
    benchmark.extra_info.update({f"{name} (s, MB)": figure for name, figure in figures.items()})
    print(f"\n{figures}")
    assert benchmark.disabled or figures["whole"][0] < ALLOWED * figures["raw"][0]
    assert benchmark.disabled or figures["part"][1] < 0.1 * figures["pandas"][1]
