"""`hapticeval record`: what it writes, what it refuses before anything starts, and what it keeps when a run breaks."""

import os
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.commands.record import describe_step_times
from hapticeval.devices.parallelogram import ENCODER_COUNTS
from hapticeval.hardware import device, udp
from hapticeval.hardware import live as live_module
from hapticeval.hardware.live import LiveRun
from hapticeval.hardware.wiring import read_wiring
from hapticeval.recordings import recorder as recorder_module
from hapticeval.recordings.hdf5 import read_recording

sys.path.insert(0, str(Path(__file__).parents[1] / "hardware"))

DRIVERS = f"""
import os, signal, sys, time
sys.path.insert(0, {str(Path(__file__).parents[1] / "hardware")!r})
import numpy as np
from robots import twin_of, wired

class Fine:
    def __init__(self):
        self.twin, self.count = twin_of(wired()), 0
    def read(self):
        self.count += 1
        return self.twin.read()
    def write(self, command):
        self.twin.write(command)
    def close(self):
        pass

class Skipping(Fine):
    def read(self):
        if self.count == 20:
            super().read()
        return super().read()

class Radians(Fine):
    def __init__(self):
        open("opened", "w").close()
        super().__init__()
    def read(self):
        reading = super().read()
        return reading._replace(raw=wired().joints(reading.raw))
    def write(self, command):
        pass

class Broken(Fine):
    def read(self):
        if self.count == 20:
            raise OSError("cable off")
        return super().read()

class Dead(Fine):
    def read(self):
        raise OSError("no power")

class Stopped(Fine):
    def read(self):
        if self.count == 20:
            os.kill(os.getpid(), signal.SIGINT)
        return super().read()

class StoppedOften(Stopped):
    def write(self, command):
        if not command.any():
            os.kill(os.getpid(), signal.SIGINT)
            open("stopped", "w").close()
        super().write(command)
    def close(self):
        os.kill(os.getpid(), signal.SIGINT)
        open("closed", "w").close()

class AmplifierOff(Fine):
    def write(self, command):
        if self.count > 20:
            raise OSError("no current")
        super().write(command)

class StoppedAtOnce:
    def __init__(self):
        os.kill(os.getpid(), signal.SIGINT)

class Missing:
    def __init__(self):
        raise RuntimeError("no card in slot 3")

class Wrong:
    pass

def breaking(scene):
    class Renderer:
        def reset(self, hip):
            self.steps = 0
        def step(self, hip, velocity, dt):
            self.steps += 1
            return hip, np.full(2, np.nan if self.steps == 20 else 0.0)
    return Renderer()

def answering(force):
    def made(scene):
        class Renderer:
            def reset(self, hip):
                pass
            def step(self, hip, velocity, dt):
                return hip, force(scene, hip)
        return Renderer()
    return made

forceless = answering(lambda scene, hip: np.zeros(2))
not_finite = answering(lambda scene, hip: np.full(2, np.nan))
of_three = answering(lambda scene, hip: np.zeros(3))
raising = answering(lambda scene, hip: 1 / 0)
pulling = answering(lambda scene, hip: -scene.stiffness * scene.model.boundary.signed_distance(hip[None])[0]
                    * -hip / np.linalg.norm(hip))

def slow(scene):
    class Renderer:
        def reset(self, hip):
            pass
        def step(self, hip, velocity, dt):
            time.sleep(0.003)
            return hip, np.zeros(2)
    return Renderer()
"""

RIG = """
[device]
kind = "parallelogram-2dof"
counts_per_turn = 262144
offsets = [1210, -340]
directions = [1, -1]
torque_per_command = 0.35
silent_cycles = 60000
l1 = 0.31
"""

WIRED = f"""
[device]
kind = "parallelogram-2dof"
counts_per_turn = {ENCODER_COUNTS}
silent_cycles = 60000
"""
"""As the twin is wired, with patience for a busy machine."""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with drivers and a wiring; nothing is taken to be gone because the machine is busy."""
    monkeypatch.chdir(tmp_path)
    for module, name in ((device, "FIRST_PATIENCE"), (udp, "SILENCE_SECONDS"), (udp, "UNHEARD_SECONDS")):
        monkeypatch.setattr(module, name, 60.0)
    monkeypatch.setattr("hapticeval.devices.device.BOUNDARY_POINTS", 100)
    (tmp_path / "mycard.py").write_text(DRIVERS)
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "wired.toml").write_text(WIRED)
    yield tmp_path
    sys.modules.pop("mycard", None)
    while str(tmp_path) in sys.path:
        sys.path.remove(str(tmp_path))


def names(folder):
    return {file.name for file in folder.iterdir() if file.is_file()}


def record(*arguments, seconds="0.1"):
    return main(["record", "-o", "run.h5", "--seconds", seconds, *arguments])


def driven(driver, *arguments, seconds="0.1"):
    return record("--device", driver, "--wiring", "wired.toml", *arguments, seconds=seconds)


@pytest.mark.parametrize("pace", [[], ["--real-time"]])
def test_the_twin_is_recorded(here, capsys, pace):
    code = record("--device", "twin", "--who", "Ann", *pace, seconds="0.3")
    said = capsys.readouterr().out
    assert code in ((0, 1) if pace else (0,))
    assert "wrote run.h5" in said
    run = read_recording(here / "run.h5")
    missed = run.clock.missed
    assert (code == 1) == bool(missed or "cycles missed" in said)
    assert len(run) + missed >= 290
    assert pace or (len(run), missed) == (300, 0)
    assert np.any(run.force != 0.0)
    assert set(run.channels) == {
        "hip", "velocity", "ihip", "force", "sent_force",
        "joint_position", "commanded_torque", "joint_torque", "raw",
    }  # fmt: skip
    assert (run.meta["who"], run.meta["device"], run.meta["device_parameters"]["hardware"]) == (
        "Ann", "parallelogram-2dof", "twin",
    )  # fmt: skip
    assert (run.meta["resolution"], run.meta["standoff"]) == (0.0, 0.0)
    assert sorted(names(here)) == ["mycard.py", "rig.toml", "run.h5", "wired.toml"]


def test_in_simulated_time_the_same_command_gives_the_same_recording(here):
    """Whatever the machine does beside it: the renderer takes three cycles' time a step."""
    recordings = []
    for _ in range(2):
        assert record("-r", "mycard:slow") == 0
        recordings.append(read_recording(here / "run.h5"))
        (here / "run.h5").unlink()
    one, other = recordings
    np.testing.assert_allclose(one.time, 1e-3 * np.arange(100), rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(one.time, other.time)
    for name, values in one.channels.items():
        np.testing.assert_array_equal(values, other.channels[name], err_msg=name)


def test_what_it_writes_is_sound_and_follows(unpictured, here, capsys):
    assert driven("mycard:Fine", seconds="1.5") == 0
    capsys.readouterr()
    assert main(["inspect", "run.h5"]) == 0, capsys.readouterr().out
    assert main(["replay", "run.h5", "--as-recorded"]) == 0
    assert capsys.readouterr().out.count("follows to the last bit") == 2


def test_a_model_of_a_file_is_recorded_as_one_that_can_be_made_again(here, capsys):
    corners = "-0.05 -0.05, 0.05 -0.05, 0.05 0.05, -0.05 0.05, -0.05 -0.05"
    (here / "plate.wkt").write_text(f"POLYGON (({corners}))")
    assert record("--model", "plate.wkt") == 0
    assert main(["replay", "run.h5", "--as-recorded"]) == 0, capsys.readouterr().err
    assert main(["view", "run.h5", "--model", "plate.wkt"]) == 0, capsys.readouterr().err
    (here / "plate.wkt").rename(here / "other.wkt")
    assert main(["replay", "run.h5", "--as-recorded", "--model", "other.wkt"]) == 0, capsys.readouterr().err


def test_a_wiring_from_a_file(here):
    code = record("--wiring", "rig.toml", "--device", "twin")
    assert code in (0, 1)
    run = read_recording(here / "run.h5")
    parameters = run.meta["device_parameters"]
    assert (parameters["offsets"], parameters["directions"], parameters["l1"]) == ([1210, -340], [1, -1], 0.31)
    step = 2.0 * np.pi / 262_144
    expected = (run.channels["raw"] - [1210, -340]) * [1, -1] * step
    np.testing.assert_allclose(run.channels["joint_position"], expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("there", ["run.h5", "run.journal"])
def test_nothing_is_written_over(here, capsys, there):
    (here / there).write_text("mine")
    assert driven("mycard:Dead") == 2
    assert f"{there} is there already" in capsys.readouterr().err
    assert (here / there).read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--device", "udp://nowhere", "--wiring", "wired.toml"], "udp://HOST:PORT"),
        (["--device", "mycard", "--wiring", "wired.toml"], "does not name a driver"),
        (["--device", "nocard:Driver", "--wiring", "wired.toml"], "driver 'nocard:Driver': cannot import"),
        (["--device", "mycard:Wrong", "--wiring", "wired.toml"], "which is not hardware"),
        (["--device", "mycard:Missing", "--wiring", "wired.toml"], "no card in slot 3"),
        (["--device", "mycard:Dead", "--wiring", "wired.toml"], "raised OSError: no power in cycle 1"),
        (["--model", "circle:size=2"], "does not lie in the functional workspace"),
        (["--model", "sphere"], "3 dimensions, and parallelogram-2dof 2"),
        (["--model", "sphere"], "give --robot parallelogram-3dof"),
        (["--model", "sphere", "--wiring", "rig.toml"], "another kind in rig.toml"),
        (["--robot", "parallelogram-4dof"], "unknown device"),
        (["-r", "ideal"], "cannot run on hardware"),
        (["-r", "no-such-renderer"], "unknown renderer"),
        (["--robot", "parallelogram-2dof", "--wiring", "rig.toml"], "both say which robot"),
        (["--wiring", "mycard.py"], "is not TOML"),
    ],
)
def test_what_cannot_run_says_so_and_leaves_nothing(here, capsys, arguments, words):
    assert record(*arguments) == 2
    assert words in capsys.readouterr().err
    assert not {"run.h5", "run.journal"} & names(here)


def test_a_folder_that_cannot_be_made_is_an_error_of_one_line(here, capsys):
    (here / "file").write_text("")
    assert main(["record", "-o", "file/deep/run.h5", "--seconds", "0.01"]) == 2
    said = capsys.readouterr().err
    assert "cannot record to file/deep/run.journal" in said
    assert "Traceback" not in said


@pytest.mark.filterwarnings("ignore::hapticeval.recordings.recorder.LossWarning")
def test_a_writer_that_dies_ends_the_run_at_once(here, capsys, monkeypatch):
    made = []
    start = recorder_module.Recorder._started
    monkeypatch.setattr(recorder_module.Recorder, "_started", lambda self: made.append(start(self)) or made[-1])
    step = live_module._Loop.step

    def dying(self, *arguments):
        if self.tick == 20:
            made[0].kill()
            made[0].wait()
        step(self, *arguments)

    monkeypatch.setattr(live_module._Loop, "step", dying)
    assert record("--device", "mycard:Fine", "--wiring", "wired.toml", "--seconds", "60") == 1
    assert "ended early: the writer's process ended with code -9, and nothing is recorded" in capsys.readouterr().out
    recording = read_recording(here / "run.h5")
    assert 20 <= len(recording) < 600  # of 60,000; all that were taken
    assert any(event.kind == "ended" and "the writer's process" in event.text for event in recording.events)


@pytest.mark.parametrize(
    ("arguments", "lines"),
    [
        (["--device", "mycard:Radians"], ['kind = "parallelogram-2dof"']),
        (["--device", "udp://127.0.0.1:9"], ['kind = "parallelogram-2dof"']),
        (
            ["--device", "mycard:Fine", "--robot", "parallelogram-3dof:b1=0.4,dynamics=printed"],
            ['kind = "parallelogram-3dof"', "b1 = 0.4", 'dynamics = "printed"'],
        ),
        (["--device", "mycard:Fine", "--robot", "point-mass:mass=0.1"], ['kind = "point-mass"', "mass = 0.1"]),
    ],
)
def test_what_is_not_the_twin_needs_a_wiring_and_is_shown_one(here, capsys, arguments, lines):
    assert record(*arguments) == 2
    said = capsys.readouterr().err
    assert f"--device {arguments[1]} needs a --wiring" in said
    assert not {"run.h5", "run.journal", "opened"} & names(here)
    shown = here / "shown.toml"
    shown.write_text("\n".join(line for line in said.splitlines() if line.startswith("    ")))
    assert [line.strip() for line in shown.read_text().splitlines() if "#" not in line] == lines
    assert read_wiring(shown).counts_per_turn is None


def test_joint_angles_need_two_lines_of_wiring(here):
    (here / "two.toml").write_text('[device]\nkind = "parallelogram-2dof"\n')
    assert record("--device", "mycard:Radians", "--wiring", "two.toml") == 0
    run = read_recording(here / "run.h5")
    np.testing.assert_array_equal(run.channels["joint_position"], run.channels["raw"])
    assert run.signals["raw"].unit == "rad"


def test_a_unit_that_is_wrong_points_to_the_wiring(unpictured, here, capsys):
    """Radians under a wiring for counts: the hand of a robot that moves does not."""
    assert driven("mycard:Radians", "--model", "line") in (0, 1)
    main(["inspect", "run.h5"])
    said = capsys.readouterr().out
    assert "see the wiring that it was recorded with: counts_per_turn" in said
    assert "mapping" not in said


def test_a_socket_with_nobody_behind_it(here, capsys, monkeypatch):
    monkeypatch.setattr(udp, "SILENCE_SECONDS", 0.1)
    assert driven("udp://127.0.0.1:9") == 2
    assert "is silent" in capsys.readouterr().err
    assert not {"run.h5", "run.journal"} & names(here)


def test_cycles_that_were_missed_are_shown(here, capsys):
    assert driven("mycard:Skipping") == 1
    said = capsys.readouterr().out
    assert "1 cycles missed" in said
    assert "a cycle comes every 1 ms\n  what to do: " in said
    assert read_recording(here / "run.h5").clock.missed == 1


@pytest.mark.parametrize(
    ("median", "longest", "words"),
    [
        (2e-3, 9e-3, "a step took 2 ms in the median, 9 ms at the longest; a cycle comes every 1 ms"),
        (2e-3, 9e-3, "what to do: a --rate below 1000, or a faster renderer"),
        (2e-4, 9e-3, "fewer other programs"),
        (2e-4, 9e-4, "no step was too long"),
    ],
)
def test_why_cycles_were_missed(median, longest, words):
    assert words in describe_step_times(LiveRun(100, 7, "", median, longest), 1000.0)


def test_a_slow_renderer_is_seen_from_its_steps(here, capsys):
    """It takes at least 3 ms a step, and the twin goes on each millisecond."""
    assert driven("twin", "--real-time", "-r", "mycard:slow", seconds="0.3") == 1
    said = capsys.readouterr().out
    assert "cycles missed" in said
    assert "what to do: a --rate below 1000, or a faster renderer" in said


def test_ctrl_c_on_the_twin_finishes_it_too(here):
    journal, over = here / "run.journal", threading.Event()

    def stop():
        while not (journal.exists() and journal.stat().st_size > 20_000) and not over.is_set():
            time.sleep(0.02)
        if not over.is_set():
            os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=stop)
    thread.start()
    try:
        assert record("--device", "twin", seconds="600") == 1
    finally:
        over.set()
        thread.join()
    run = read_recording(here / "run.h5")
    assert len(run) > 50
    assert [event.text for event in run.events if event.kind == "ended"] == ["interrupted by the user"]


def test_however_often_ctrl_c_is_pressed_the_motors_are_stopped(here, capsys):
    assert driven("mycard:StoppedOften") == 1
    assert "interrupted by the user" in capsys.readouterr().out
    assert {"run.h5", "stopped", "closed"} <= names(here)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_second_ctrl_c_leaves_the_run_in_the_journal(here, capsys, monkeypatch):
    def pressed(*_):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("hapticeval.recordings.hdf5.write_recording", pressed)
    assert driven("mycard:Stopped") == 1
    shown = capsys.readouterr().err
    assert "interrupted: the run is kept in run.journal: hapticeval convert run.journal -o run.h5" in shown
    monkeypatch.undo()
    os.chdir(here)
    main(["convert", "run.journal", "-o", "run.h5"])
    assert 19 <= len(read_recording(here / "run.h5")) <= 21


def test_ctrl_c_before_the_first_row_leaves_nothing(here, capsys):
    assert driven("mycard:StoppedAtOnce") == 1
    assert "interrupted: nothing was recorded" in capsys.readouterr().err
    assert not {"run.h5", "run.journal"} & names(here)


def test_motors_that_do_not_answer_are_reported_once(here, capsys):
    assert driven("mycard:AmplifierOff") == 2
    shown = capsys.readouterr().err
    assert "the motors may still be on" in shown
    assert shown.count("raised OSError") == 1


@pytest.mark.parametrize("renderer", ["not_finite", "of_three", "raising"])
def test_a_renderer_that_breaks_at_once_is_reported_without_a_warning(here, capsys, renderer):
    assert driven("mycard:Fine", "-r", f"mycard:{renderer}") == 3
    shown = capsys.readouterr().err
    assert shown.startswith("error: the renderer")
    assert not {"run.h5", "run.journal"} & names(here)


@pytest.mark.parametrize("name", ["run.csv", "run", "run.journal", "run.h5.mat"])
def test_a_recording_has_the_name_of_one(here, capsys, name):
    assert main(["record", "-o", name, "--device", "twin"]) == 2
    shown = capsys.readouterr().err
    assert f"-o {name} does not end in .h5" in shown
    assert "hapticeval convert makes .csv" in shown
    assert not names(here) & {name, "run.journal"}


@pytest.mark.parametrize(
    ("arguments", "code", "rows", "out", "err"),
    [
        (["mycard:Broken"], 2, 20, "wrote run.h5", "cable off"),
        (["mycard:Fine", "-r", "mycard:breaking"], 3, 19, "wrote run.h5", "not finite"),
        (["mycard:Stopped"], 1, 21, "interrupted by the user", ""),
    ],
)
def test_a_run_that_ends_early_leaves_what_was_recorded(here, capsys, arguments, code, rows, out, err):
    assert driven(*arguments) == code
    said = capsys.readouterr()
    assert out in said.out
    assert err in said.err
    run = read_recording(here / "run.h5")
    assert rows - 1 <= len(run) <= rows
    assert any((err or out) in event.text for event in run.events)
    assert not Path("run.journal").exists()


@pytest.mark.parametrize(
    ("arguments", "warning"),
    [
        ([], ""),
        (["-r", "mycard:forceless"], ""),
        (["-r", "mycard:pulling"], "warning: the renderer's force pulls the hand into the surface"),
        (["--stiffness", "300"], ""),
        (["--stiffness", "20000"], "cannot hold"),
    ],
)
def test_a_force_that_the_loop_cannot_hold_is_warned_about(here, capsys, arguments, warning):
    assert driven("mycard:Fine", *arguments) in (0, 1)
    said = capsys.readouterr()
    assert "a step took" in said.out
    assert arguments or "what to do" not in said.out
    assert warning in said.err if warning else "warning" not in said.err


def test_an_experiment_of_the_thesis_is_recorded_with_its_phases(here, capsys):
    """Pushed by the hand of the case, on its robot, held on its circle: and it follows from its renderer."""
    assert main(["record", "--experiment", "circle-pushed-slow", "-r", "set-stabilisation", "-o", "run.h5"]) == 0
    run = read_recording(here / "run.h5")
    assert [(event.time, event.text) for event in run.events] == [(0.0, "pushed along"), (0.1, "slides")]
    assert (run.meta["scene"]["bilateral"], run.meta["inner_loop"], len(run)) == (True, "linearised", 6000)
    distance = np.abs(np.linalg.norm(run.hip, axis=1) - 0.1)
    assert np.max(distance) < 1e-3
    assert np.linalg.norm(run.velocity[110]) == pytest.approx(0.25, rel=0.05)
    assert main(["replay", "run.h5", "--as-recorded"]) == 0, capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["circle-pushed", "--model", "line"], "--experiment and --model are both given"),
        (["circle-pushed", "--seconds", "2"], "--experiment and --seconds are both given"),
        (["circle-pushd"], "unknown case of experiments"),
    ],
)
def test_an_experiment_says_all_by_itself(here, capsys, arguments, words):
    assert main(["record", "-o", "run.h5", "--experiment", *arguments]) == 2
    assert words in capsys.readouterr().err
