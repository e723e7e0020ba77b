"""A run that is killed in its middle: what is saved is the run up to there, and is judged like it."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from robots import recorded, twin_of, wired

from hapticeval.cli import main
from hapticeval.errors import InputError
from hapticeval.recordings.hdf5 import read_recording, write_recording
from hapticeval.recordings.journal import recover
from hapticeval.replay.as_recorded import as_recorded
from hapticeval.replay.job import prepare_replay, replay_plan
from hapticeval.replay.subject import make_replay_case

pytestmark = pytest.mark.system

CYCLES, KILLED = 1500, 700

WIRED = '[device]\nkind = "parallelogram-2dof"\ncounts_per_turn = 262144\n'
"""As the twin is wired."""

DOOMED = f"""
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {str(Path(__file__).parent)!r})
from robots import recorded, twin_of, wired

class Killed:
    def __init__(self):
        self.twin, self.count = twin_of(wired()), 0
    def read(self):
        self.count += 1
        if self.count > {KILLED}:
            os.kill(os.getpid(), signal.SIGKILL)
        return self.twin.read()
    def write(self, command):
        self.twin.write(command)
    def close(self):
        pass

recorded(Path(sys.argv[1]), Killed(), wired(), cycles={CYCLES}, name="killed")
"""


def until(condition, process=None):
    deadline = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < deadline
        assert process is None or process.poll() is None
        time.sleep(0.02)


def closed(journal):
    """Whether the writer, which outlives the loop, has written all that it had."""
    try:
        return any(event.kind == "ended" for event in recover(journal).events)
    except InputError:  # not even its first rows
        return False


def verdicts(path, folder):
    """The checks of a replay, by column and check: outcome, metric and bound."""
    made = make_replay_case(path, read_recording(path))
    plan = replay_plan(made, ["minimum-distance+pp-pd", "constraint"])
    work = prepare_replay(made)
    found = {}
    folder.mkdir()
    for job in plan.jobs:
        for verdict in work(job, folder, 0)[0].verdicts:
            found[job.renderer, verdict.check] = (verdict.outcome, verdict.finding.metric, verdict.finding.bound)
    return found


STARTING = f"""
import multiprocessing, os, signal, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from hapticeval.hardware.udp import running
from robots import twin_of, wired

with running(twin_of(wired())):
    print(multiprocessing.active_children()[0].pid, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_twin_of_a_loop_that_is_killed_before_it_begins_ends():
    done = subprocess.run([sys.executable, "-c", STARTING], capture_output=True, text=True, check=False, timeout=120.0)
    assert done.returncode == -signal.SIGKILL
    twin = Path(f"/proc/{int(done.stdout)}")
    until(lambda: not twin.exists() or "(zombie)" in (twin / "status").read_text())


def test_a_killed_run_is_the_run_up_to_there(tmp_path):
    _, whole = recorded(tmp_path, twin_of(wired()), wired(), cycles=CYCLES, name="whole")
    write_recording(tmp_path / "whole.h5", whole)
    follows = as_recorded(make_replay_case(tmp_path / "whole.h5", whole))
    assert follows.follows
    assert [each.largest for each in follows.channels] == [0.0, 0.0]
    done = subprocess.run([sys.executable, "-c", DOOMED, str(tmp_path)], check=False, timeout=120.0)
    assert done.returncode == -signal.SIGKILL
    journal = tmp_path / "killed.journal"
    until(lambda: closed(journal))
    saved = recover(journal)
    # At most a second may be lost. What was in the memory is written by the process beside the loop: nothing is.
    assert len(saved) == KILLED
    for name, values in saved.channels.items():
        np.testing.assert_array_equal(values, whole.channels[name][:KILLED], err_msg=name)
    # The same stretch of the run that was not killed, under the same name, gives the same verdicts.
    assert main(["convert", str(journal), "-o", str(tmp_path / "run.h5")]) in (0, 1)
    (tmp_path / "there").mkdir()
    write_recording(tmp_path / "there" / "run.h5", whole.part(slice(0, KILLED)))
    ours = verdicts(tmp_path / "run.h5", tmp_path / "a")
    assert ours == verdicts(tmp_path / "there" / "run.h5", tmp_path / "b")
    assert len(ours) > 12
    assert {outcome for outcome, _, _ in ours.values()} > {"pass"}


def test_the_command_killed_in_the_middle(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    journal = tmp_path / "run.journal"
    (tmp_path / "patient.toml").write_text(f"{WIRED}silent_cycles = 60000\n")
    pace = ["--device", "twin", "--real-time", "--wiring", "patient.toml", "--seconds", "600"]
    command = [sys.executable, "-m", "hapticeval", "record", *pace, "-o", "run.h5"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        until(lambda: journal.exists() and journal.stat().st_size > 60_000, process)
        process.kill()
    until(lambda: closed(journal))
    assert not Path("run.h5").exists()
    assert main(["convert", "run.journal", "-o", "whole.h5"]) in (0, 1)
    assert main(["replay", "run.journal", "--as-recorded"]) == 0
    told = capsys.readouterr().out
    assert told.count("follows to the last bit") == 2
    assert main(["replay", "whole.h5", "-r", "minimum-distance+pp-pd", "-o", "results"]) in (0, 1)
    assert "equal to the last bit" in capsys.readouterr().out
