"""Live runs on drivers that break, hang, lie, or are stopped: the motors come to rest and what was recorded is kept."""

from __future__ import annotations

import functools
import os
import signal
import threading
import time

import numpy as np
import pytest
from robots import PATIENCE, scene_of, twin_of, wired

from hapticeval.errors import DomainError, HapticevalError, RefusalError, RendererError
from hapticeval.hardware import device as guard
from hapticeval.hardware.device import ZEROS, HardwareDevice, Reading
from hapticeval.hardware.live import channels, run, signals
from hapticeval.recordings.journal import recover
from hapticeval.recordings.recorder import Recorder

AT = 40


class Driver:
    """A twin that does what `trick` says in cycle `AT`, and remembers what it was told."""

    def __init__(self, trick=None, *, stop=None):
        self.twin, self.trick, self.stop = twin_of(wired()), trick, stop
        self.cycle, self.commands, self.closed = 0, [], 0

    def read(self):
        self.cycle += 1
        reading = self.twin.read()
        if self.cycle == AT and self.trick is not None:
            return self.trick(reading)
        return reading

    def write(self, command):
        if self.stop is not None and self.cycle >= AT:
            self.stop()
        self.commands.append(np.array(command))
        self.twin.write(command)

    def close(self):
        self.closed += 1


class Pushing:
    """A renderer that pushes all the time, and does what `trick` says at step `AT`."""

    def __init__(self, trick=None):
        self.trick, self.steps = trick, 0

    def reset(self, hip):
        self.steps = 0

    def step(self, hip, velocity, dt):
        self.steps += 1
        if self.steps == AT and self.trick is not None:
            return self.trick(hip)
        return hip, np.array([1.0, 0.5])


def live(tmp_path, driver, renderer=None, cycles=100):
    """What a live run gives or raises, and what was recorded of it."""
    wiring = wired()
    given = None
    with Recorder(tmp_path / "run.journal", channels(2), signals=signals(wiring)) as recorder:
        try:
            scene = scene_of(wiring)
            given = run(
                lambda: driver, wiring, renderer or Pushing(), scene, recorder, cycles=cycles, patience=PATIENCE
            )
        except HapticevalError as error:
            given = error
        summary = recorder.close()
    return given, recover(tmp_path / "run.journal") if summary.rows else None


def raising(error):
    def raise_it(*_):
        raise error

    return raise_it


def assert_at_rest(driver):
    np.testing.assert_array_equal(driver.commands[-ZEROS:], np.zeros((ZEROS, 2)))
    assert driver.closed == 1


def test_the_motors_rest_at_the_end(tmp_path):
    driver = Driver()
    assert isinstance(driver.twin, HardwareDevice)
    before = signal.getsignal(signal.SIGALRM)
    done, recording = live(tmp_path, driver)
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert (done.cycles, done.missed, done.ended, len(recording)) == (100, 0, "", 100)
    assert np.any(driver.commands[-ZEROS - 1] != 0.0)
    assert_at_rest(driver)


@pytest.mark.parametrize(
    ("trick", "code"),
    [
        (raising(OSError("unplugged")), 2),
        (lambda reading: None, 2),
        (lambda reading: reading._replace(raw=np.array([1.0, np.nan])), 3),
        (lambda reading: reading._replace(raw=np.zeros(3)), 2),
        (lambda reading: reading._replace(raw="counts"), 2),
        (lambda reading: reading._replace(raw=[*reading.raw[:1] + 4000.0, *reading.raw[1:]]), 3),
        (lambda reading: reading._replace(raw=[*reading.raw[:1] + 100_000.0, *reading.raw[1:]]), 3),
    ],
    ids=["raises", "nothing", "no number", "joints", "text", "jump", "off the workspace"],
)
def test_a_driver_that_breaks_is_named_with_its_cycle(refused, tmp_path, trick, code):
    driver = Driver(trick)
    error, recording = live(tmp_path, driver)
    assert isinstance(error, HapticevalError)
    assert error.exit_code == code
    with refused(HapticevalError):
        raise error
    assert_at_rest(driver)
    assert len(recording) == AT - 1
    assert [event.kind for event in recording.events] == ["ended"]


@pytest.fixture
def patience(monkeypatch):
    """So much of it that only what hangs is ever broken off, however slow the machine is."""
    monkeypatch.setattr(guard, "FIRST_PATIENCE", PATIENCE)


def hang(*_):
    """Wait for longer than the guard does, whose time then passes quickly."""
    left, again = signal.getitimer(signal.ITIMER_REAL)
    assert 0.0 < left <= again == PATIENCE
    signal.setitimer(signal.ITIMER_REAL, 0.01, again)
    time.sleep(600.0)


@pytest.mark.usefixtures("patience")
@pytest.mark.parametrize(
    ("trick", "renderer", "what"), [(hang, None, "the driver's read()"), (None, Pushing(hang), "the renderer")]
)
def test_what_hangs_is_broken_off(tmp_path, trick, renderer, what):
    driver = Driver(trick)
    error, recording = live(tmp_path, driver, renderer)
    assert f"{what} has not come back for 60 s in cycle 40" in str(error)
    assert_at_rest(driver)
    assert len(recording) == AT - 1


def test_a_run_tells_how_long_its_steps_took(tmp_path):
    """The renderer sleeps in all steps, and ten times as long in one of them: no step can have been shorter."""
    nap = 0.002

    class Slow(Pushing):
        def step(self, hip, velocity, dt):
            time.sleep(nap)
            return super().step(hip, velocity, dt)

    done, _ = live(tmp_path, Driver(), Slow(lambda hip: time.sleep(10.0 * nap) or (hip, 0.0 * hip)), cycles=60)
    assert nap <= done.median <= done.longest
    assert 11.0 * nap <= done.longest


def test_it_runs_in_another_thread_too(tmp_path):
    found = []
    thread = threading.Thread(target=lambda: found.append(live(tmp_path, Driver())))
    thread.start()
    thread.join()
    assert found[0][0].cycles == 100


def test_a_write_that_fails_says_that_motors_may_be_on(tmp_path):
    driver = Driver(stop=raising(OSError("bus off")))
    error, recording = live(tmp_path, driver)
    assert "motors may still be on" in str(error)
    assert str(error).count("OSError") == 1  # it failed twice in the same way
    assert driver.closed == 1
    assert len(recording) == AT - 1


def test_a_renderer_that_breaks_is_named_and_one_that_is_not_defined_there_ends_the_run(tmp_path):
    driver = Driver()
    error, recording = live(tmp_path, driver, Pushing(lambda hip: (hip, hip * np.nan)))
    assert isinstance(error, RendererError)
    assert error.tick == AT - 1
    assert_at_rest(driver)
    assert len(recording) == AT - 1
    (tmp_path / "run.journal").unlink()
    done, recording = live(tmp_path, Driver(), Pushing(raising(DomainError("off the map", why="too deep"))))
    assert (done.cycles, done.ended) == (AT - 1, "off the map: too deep")
    assert [(event.kind, event.text) for event in recording.events] == [("ended", "off the map: too deep")]


def test_a_renderer_that_refuses_after_its_first_answer_breaks(tmp_path):
    """A refusal is about a scene; in the middle of a run the motors were on, and it is a fault with its cycle."""
    driver = Driver()
    error, recording = live(tmp_path, driver, Pushing(raising(RefusalError("too fast", why="no time", todo="wait"))))
    assert isinstance(error, RendererError)
    assert error.tick == AT - 1
    assert "too fast" in error.what
    assert_at_rest(driver)
    assert len(recording) == AT - 1


def test_a_robot_that_stands_outside_cannot_start(tmp_path):
    class Elsewhere(Driver):
        def read(self):
            return Reading(0, 1, np.array([60_000.0, 0.0]))

    error, recording = live(tmp_path, Elsewhere())
    assert "cannot start where the robot is" in str(error)
    assert "offsets" in str(error)
    assert recording is None


def test_cycles_that_the_loop_missed_are_counted_and_end_it_in_time(tmp_path):
    class Skipping(Driver):
        def read(self):
            reading = super().read()
            if self.cycle % 10 == 0:
                self.cycle += 1
                reading = self.twin.read()
            return reading

    done, recording = live(tmp_path, Skipping())
    assert (done.cycles, done.missed) == (91, 10)  # the hundredth is missed too, and one more read
    assert recording.clock.missed == 10
    # The velocity is the one over the time that passed: it does not double where a cycle is missing.
    speed = np.linalg.norm(recording.velocity, axis=1)
    assert np.max(np.abs(np.diff(speed))[1:]) < 0.2 * np.max(speed)


@pytest.mark.parametrize("count", [7, 2**64 - 192], ids=["late", "far ahead"])
def test_a_count_that_cannot_be_is_dropped(tmp_path, count):
    done, recording = live(tmp_path, Driver(lambda reading: reading._replace(sequence=count)))
    assert (done.cycles, done.missed, len(recording)) == (99, 1, 99)
    assert len(done.notes) == 1
    assert done.notes[0].startswith("1 readings dropped: ")
    assert [event.text for event in recording.events if event.kind == "note"] == list(done.notes)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_what_asks_the_program_to_end_stops_the_motors_first(tmp_path, number, request):
    # `nohup` has a program ignore SIGHUP, and who started it so wants that.
    request.addfinalizer(functools.partial(signal.signal, number, signal.getsignal(number)))
    signal.signal(number, before := signal.default_int_handler)
    driver = Driver(lambda reading: os.kill(os.getpid(), number) or reading)
    done, _ = live(tmp_path, driver)
    assert done.ended == "interrupted by the user"
    assert AT - 1 <= done.cycles <= AT
    assert_at_rest(driver)
    assert signal.getsignal(number) is before
