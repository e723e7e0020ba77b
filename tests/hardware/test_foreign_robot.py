"""`hapticeval record` on a robot of others, in another process behind a socket, that misbehaves in every known way."""

from __future__ import annotations

import functools
import json
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from robots import wired

from hapticeval.cli import main
from hapticeval.devices.parallelogram import ENCODER_COUNTS, MOTOR_TORQUE
from hapticeval.hardware.device import ZEROS
from hapticeval.recordings.hdf5 import read_recording

pytestmark = pytest.mark.system

HERTZ, CYCLES, AT = 200, 150, 60
GOOD_BYE = 2**64 - 1
INSIDE = (0.09, 0.01)
"""m: where the robot stands, 9.4 mm inside the circle."""

WIRED = f"""
[device]
kind = "parallelogram-2dof"
counts_per_turn = {ENCODER_COUNTS}
silent_cycles = 400
soft_start = 0.1
"""
"""With the limits of one who states none, and two seconds of patience: machines that test are busy."""


class Robot:
    """The program that runs: its `port`, and what it was commanded, once it has ended."""

    def __init__(self, how):
        raw = wired().raw(wired().device.joints(np.array(INSIDE))).tolist()
        order = {"how": how, "raw": raw, "hertz": HERTZ}
        program = Path(__file__).parent / "foreign_robot.py"
        self.process = subprocess.Popen(
            [sys.executable, "-S", str(program), json.dumps(order)], stdout=subprocess.PIPE, text=True
        )
        self.port = int(self.process.stdout.readline())

    def commands(self):
        """Counts (n,) and torques (n, 2), N m, that came."""
        out, _ = self.process.communicate(timeout=60.0)
        counts, *torques = zip(*json.loads(out), strict=True)
        return list(counts), np.array(torques).T


@contextmanager
def robot(how):
    program = Robot(how)
    try:
        yield program
    finally:
        program.process.kill()
        program.process.wait()


def arguments(port, *more):
    cycles = ["--rate", str(HERTZ), "--seconds", str(CYCLES / HERTZ)]
    return ["record", "--device", f"udp://127.0.0.1:{port}", "--wiring", "rig.toml", *cycles, "-o", "run.h5", *more]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text(WIRED)
    return tmp_path


def assert_stopped(counts, torques):
    """Zeros at the end: some to the last reading, and the good-bye."""
    assert counts[-1] == GOOD_BYE
    last = torques[-1 - ZEROS :]
    np.testing.assert_array_equal(last, np.zeros_like(last))
    assert len(last) == 1 + ZEROS


def assert_sent_as_recorded(run, counts, torques):
    """What came is what the recording says was sent: within the motors' limits, from zero on."""
    sent = run.channels["joint_torque"]
    answers = torques[: len(sent)]
    np.testing.assert_array_equal(answers, sent)
    assert np.max(np.abs(answers)) <= MOTOR_TORQUE
    np.testing.assert_array_equal(answers[0], [0.0, 0.0])
    assert np.all(np.diff([count for count in counts if count != GOOD_BYE]) >= 0)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("behaves", ""),
        ("repeats", "late or repeated"),
        ("is late", "late or repeated"),
        ("strangers", "from another sender, 127.0.0.1:"),
        ("lengths", "of another length, 36 bytes where a reading has 44"),
        ("versions", "of another version, b'HCR2'"),
        ("far counts", "counted more than 400 cycles ahead"),
    ],
)
def test_what_the_network_does_ends_no_run(here, capsys, how, words):
    with robot(how) as program:
        # 1 where this machine was too busy to see every cycle.
        code = main(arguments(program.port, "--stiffness", "1000000"))
        counts, torques = program.commands()
    said = capsys.readouterr()
    assert code in (0, 1), said.err
    assert "missed" in said.out or code == 0
    assert words in said.out
    assert ("dropped" in said.out) == bool(words)
    # The hand stands 9.4 mm inside, at 1 MN/m.
    assert "limits scaled the force" in said.out
    assert "the soft start scaled the force in" in said.out
    run = read_recording(here / "run.h5")
    # More where the last cycles were missed.
    assert CYCLES <= len(run) + run.clock.missed < CYCLES + 50
    assert np.max(np.abs(run.channels["commanded_torque"])) > 1000.0
    assert_sent_as_recorded(run, counts, torques)
    assert_stopped(counts, torques)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("silent", "has not come back for 0.5 s"),
        ("leaves", "a reading is off the workspace"),
        ("jumps", "the hand jumped by"),
        ("nonsense", "they must be finite"),
    ],
)
def test_a_reading_that_is_doubtful_ends_the_run_with_zeros(here, capsys, how, words):
    if how == "silent":
        (here / "rig.toml").write_text(WIRED.replace("400", "100"))
    with robot(how) as program:
        code = main(arguments(program.port))
        counts, torques = program.commands()
    said = capsys.readouterr()
    assert code == 3
    assert words in said.err
    assert "wrote run.h5" in said.out
    run = read_recording(here / "run.h5")
    assert AT // 2 <= len(run) + run.clock.missed <= AT - 1
    # By the robot's clock, as the rows are.
    assert [event.time <= run.time[-1] + 0.5 for event in run.events if event.kind == "ended"] == [True]
    assert_sent_as_recorded(run, counts, torques)
    assert_stopped(counts, torques)


def test_a_command_above_a_limit_is_refused_where_that_is_asked_for(here, capsys):
    with robot("behaves") as program:
        code = main(arguments(program.port, "--refuse-above"))
        counts, torques = program.commands()
    assert code == 3
    assert "the renderer asks for" in capsys.readouterr().err
    assert not (here / "run.h5").exists()
    np.testing.assert_array_equal(torques, np.zeros_like(torques))
    assert_stopped(counts, torques)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_program_that_is_asked_to_end_sends_zeros(here, number):
    with robot("behaves") as program:
        command = [sys.executable, "-m", "hapticeval", *arguments(program.port), "--seconds", "600"]
        # What `nohup` has its programs ignore, those that they start ignore too.
        heed = functools.partial(signal.signal, number, signal.SIG_DFL)
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heed
        ) as recording:
            deadline = time.monotonic() + 120.0
            while not ((here / "run.journal").exists() and (here / "run.journal").stat().st_size > 20_000):
                assert recording.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.05)
            recording.send_signal(number)
            out, _ = recording.communicate(timeout=60.0)
        counts, torques = program.commands()
    assert recording.returncode == 1
    assert "interrupted by the user" in out
    assert len(read_recording(here / "run.h5")) > 20
    assert np.any(torques != 0.0)
    assert_stopped(counts, torques)
