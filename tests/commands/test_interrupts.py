"""Ctrl-C on the commands that run jobs: what they say at once, what they finish, and what they keep."""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time

import pytest

from hapticeval.cli import main
from hapticeval.runner.results import RESULTS_FILE, read_results

pytestmark = pytest.mark.system

WAITING = (
    "interrupted: 1 run that had begun is being finished, for 5 s at most, what is done is kept; "
    "press Ctrl-C again to stop at once\n"
)
STOPPED = "stopped: 1 run that had begun is given up (local_mine:Waits on "


class Command:
    """The command in a process group of its own, on one core, so that its jobs come one after another."""

    def __init__(self, process, stdout):
        self.process = process
        self.stdout = stdout
        assert process.stderr is not None
        self.stderr = process.stderr

    def says(self, start):
        """The first line from now on that begins so."""
        for line in self.stderr:
            if line.startswith(start):
                return line
        raise AssertionError(f"it ended, and never said {start}")

    def until(self, condition):
        while not condition():
            assert self.process.poll() is None
            time.sleep(0.02)

    def ctrl_c(self):
        os.killpg(self.process.pid, signal.SIGINT)

    def leaves(self):
        """Whether there still are processes of the group, after its first has ended."""
        try:
            os.killpg(self.process.pid, 0)
        except ProcessLookupError:
            return False
        return True

    def ends(self):
        """Exit code, what is left of stderr, and stdout."""
        err = self.stderr.read()
        code = self.process.wait()
        self.stdout.seek(0)
        return code, err, self.stdout.read()


@contextlib.contextmanager
def command(arguments, *, program=("-m", "hapticeval")):
    one = min(os.sched_getaffinity(0))
    with (
        tempfile.TemporaryFile("w+") as out,
        subprocess.Popen(
            [sys.executable, *program, *arguments],
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=lambda: os.sched_setaffinity(0, {one}),
        ) as process,
    ):
        kill = threading.Timer(300.0, lambda: os.killpg(process.pid, signal.SIGKILL))  # a hang must not be for ever
        kill.start()
        try:
            yield Command(process, out)
        finally:
            kill.cancel()
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


RUN = ["run", "slides.toml", "-v", "-r", "local_mine:Waits"]


def waiting(here, run):
    """Wait until the second of three jobs stands still."""
    run.says("[1/3]")
    run.until((here / "waiting").exists)


def cases(here):
    """The cases of the verdicts that are kept, of a run that says why it is incomplete."""
    results = read_results(here / "results")
    assert (results.complete, results.reason) == (False, "interrupted by the user")
    return [verdict.case for verdict in results.verdicts]


def test_what_has_begun_is_finished_and_the_rest_is_not_begun(here):
    with command(RUN) as run:
        waiting(here, run)
        run.ctrl_c()
        assert run.says("interrupted") == WAITING
        (here / "go").touch()
        code, err, out = run.ends()
    assert code == 1, err
    assert "[2/3] local_mine:Waits on slides/flat-back: 1 pass" in err
    assert "Traceback" not in err
    assert "3 of 4 planned verdicts ran (incomplete: interrupted by the user)" in out
    assert cases(here) == ["flat", "flat", "flat-back"]
    assert (here / "results" / "report" / "index.html").exists()


def test_a_second_one_stops_at_once(here):
    with command(RUN) as run:
        waiting(here, run)
        run.ctrl_c()
        assert run.says("interrupted") == WAITING
        run.ctrl_c()
        assert run.says("stopped").startswith(STOPPED)
        code, err, out = run.ends()
        with pytest.raises(ProcessLookupError):
            os.kill(int((here / "waiting").read_text()), 0)
    assert code == 1, err
    assert NO_REPORTS in err
    assert "Traceback" not in err
    assert "2 of 4 planned verdicts ran (incomplete: interrupted by the user)" in out
    assert f"wrote results/{RESULTS_FILE}" in out
    assert cases(here) == ["flat", "flat"]
    assert main(["report", "results"]) == 0
    assert (here / "results" / "report" / "index.html").exists()


def test_a_replay_says_and_does_the_same(here):
    assert main(["run", "slides.toml", "-r", "constraint", "-k", "flat-back", "-o", "first"]) == 0
    log = "first/recordings/slides/flat-back/constraint.h5"
    with command(["replay", log, "-v", "-r", "local_mine:Waits", "-r", "constraint", "-o", "results"]) as replay:
        waiting(here, replay)
        replay.ctrl_c()
        assert replay.says("interrupted") == WAITING
        replay.ctrl_c()
        assert replay.says("stopped").startswith(STOPPED)
        code, err, _ = replay.ends()
    assert code == 1, err
    assert "Traceback" not in err
    assert cases(here)
    assert [run.renderer for run in read_results(here / "results").runs] == ["recorded"]


DRAWS = """
import sys, time
from pathlib import Path
from hapticeval.cli import main
from hapticeval.reports import write

def draw(order):
    Path("drawing").touch()
    time.sleep(3600.0)

write.draw = draw
sys.exit(main())
"""

NO_REPORTS = "no reports are written: hapticeval report results makes them of what is kept"
NO_FIGURES = "interrupted: figures are left out; hapticeval report results draws them"
ONCE = ["run", "slides.toml", "-r", "constraint", "-k", "flat*"]


def page_of(here):
    """What the page of a case says; its address is there."""
    (page,) = (here / "results" / "report").glob("**/flat.html")
    return page.read_text()


@pytest.mark.parametrize("arguments", [ONCE, ["report", "results"]])
def test_ctrl_c_while_figures_are_drawn_keeps_the_page_without_them(here, arguments):
    assert main(ONCE) == 0
    with command(arguments, program=["-c", DRAWS]) as run:
        run.until((here / "drawing").exists)
        run.ctrl_c()
        code, err, out = run.ends()
        assert not run.leaves()
    assert code == 1, err
    # An earlier report, which has its figures, stays.
    assert (NO_FIGURES if arguments == ONCE else NO_REPORTS) in err
    assert "Traceback" not in err
    assert ("not drawn, as the drawing was interrupted" in page_of(here)) == (arguments == ONCE)
    assert arguments != ONCE or "4 of 4 planned verdicts ran: 3 passed" in out
    assert read_results(here / "results").complete


@pytest.mark.parametrize("stops", ["the run, then the figures", "waiting", "drawing"])
def test_an_impatient_user_sees_no_traceback(here, stops):
    """One for the run and one for its figures; or again and again until the process ends, in either."""
    if stops == "drawing":
        (here / "go").touch()
    with command(RUN, program=["-c", DRAWS]) as run:
        if stops == "the run, then the figures":
            waiting(here, run)
            run.ctrl_c()
            assert run.says("interrupted") == WAITING
            (here / "go").touch()
            run.until((here / "drawing").exists)
            run.ctrl_c()
        else:
            run.until((here / stops).exists)
            while run.process.poll() is None:
                run.ctrl_c()
                time.sleep(0.002)
        code, err, out = run.ends()
        assert not run.leaves()
    assert code == 1, err
    assert (NO_REPORTS if stops == "waiting" else NO_FIGURES) in err
    assert "Traceback" not in err
    assert "KeyboardInterrupt" not in err
    ran = {"waiting": 2, "drawing": 4}.get(stops, 3)
    assert f"{ran} of 4 planned verdicts ran" in out
    assert f"wrote results/{RESULTS_FILE}" in out
