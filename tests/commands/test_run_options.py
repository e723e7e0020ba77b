"""The options of `run` for the work on a renderer, and for a gate: what runs, what is written, the exit code."""

import os
import re
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from hapticeval.cli import main
from hapticeval.commands.watching import files_behind, run_again
from hapticeval.runner.known import read_known
from hapticeval.runner.results import read_results

JUMPS = ["run", "slides.toml", "-r", "local_mine:Jumps", "--no-report"]
PLACES = {f"slides/{case}/continuous-contact" for case in ("flat", "flat-back", "flat-again")}


def cases(folder="results"):
    return [run.case for run in read_results(Path(folder)).runs]


def test_no_report_writes_the_results_alone(here, capsys):
    assert main(JUMPS) == 1
    assert {path.name for path in (here / "results").iterdir()} == {"results.json", "recordings"}
    assert capsys.readouterr().out.endswith("\nwrote results/results.json\n")


def test_quick_takes_few_cases_that_have_every_check(here):
    assert main(["run", "slides.toml", "-r", "local_mine:Good", "--quick"]) == 0
    assert cases() == ["flat"]
    assert not (here / "results" / "report").exists()


def test_an_expression_leaves_out(here):
    assert main(["run", "slides.toml", "-r", "local_mine:Good", "--no-report", "-k", "not flat-back"]) == 0
    assert cases() == ["flat", "flat-again"]


def test_x_stops_at_the_first_verdict_that_is_not_as_required(here, capsys, monkeypatch):
    monkeypatch.setattr("hapticeval.runner.execution.default_workers", lambda: 1)
    assert main([*JUMPS, "-x"]) == 1
    results = read_results(here / "results")
    assert [run.case for run in results.runs] == ["flat"]
    assert results.reason == "it ends at the first verdict that stops the gate (-x)"
    assert main([*JUMPS[:3], "local_mine:Good", "--no-report", "-x"]) == 0


def test_failed_first_begins_with_what_failed_the_last_time(here):
    (here / "local_mine.py").write_text((here / "local_mine.py").read_text() + LATE)
    late = [*JUMPS[:3], "local_mine:Late", "--no-report", "--failed-first"]
    assert main(late) == 1
    assert cases() == ["flat", "flat-back", "flat-again"]
    assert main(late) == 1
    assert cases() == ["flat-back", "flat", "flat-again"]


LATE = """
class Late(Good):
    def reset(self, hip):
        self.back = hip[0] > 0.015
    def step(self, hip, velocity, dt):
        made = super().step(hip, velocity, dt)
        return (made[0] + [0.02 * (hip[0] < 0.0101), 0.0], made[1]) if self.back else made
"""


@pytest.mark.usefixtures("in_process")
def test_known_failures_are_listed_excused_and_dropped(here, capsys):
    assert main([*JUMPS, "--write-known", "known.toml"]) == 0
    listed = read_known(here / "known.toml").entries
    assert {place for _, place in listed} >= PLACES
    shown = capsys.readouterr()
    assert shown.out.endswith("wrote results/results.json\nwrote known.toml\n")
    assert re.findall(r"\d+ failed[a-z ]*", shown.out + shown.err) == [f"{len(listed)} failed as known"], "counted once"
    assert main([*JUMPS, "--write-known", "other.toml", "--verbose"]) == 0
    assert " failed" not in capsys.readouterr().err
    assert {each.standing for each in read_results(here / "results").verdicts} <= {"known", "pass", "not-judged"}

    text = (here / "known.toml").read_text().replace("not explained yet", "a renderer that jumps")
    (here / "known.toml").write_text(text)
    assert main([*JUMPS, "--known", "known.toml", "--strict"]) == 0
    assert main([*JUMPS, "--write-known", "known.toml"]) == 0
    assert "a renderer that jumps" in (here / "known.toml").read_text(), "reasons stay"

    good = [*JUMPS[:3], "local_mine:Good", "--no-report"]
    (here / "known.toml").write_text(text.replace("local_mine:Jumps", "local_mine:Good"))
    capsys.readouterr()
    assert main([*good, "--known", "known.toml"]) == 0
    assert "known, and pass now: local_mine:Good on slides/flat/continuous-contact" in capsys.readouterr().out
    assert main([*good, "--known", "known.toml", "--strict"]) == 1
    assert main([*good, "--write-known", "known.toml"]) == 0
    assert read_known(here / "known.toml").entries == {}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[known]]\nrenderer = "r"\nreason = ""\nverdicts = ["slides/flat/memoryless"]\n', "is empty"),
        ('[[known]]\nrenderer = "r"\nreason = "x"\nverdicts = ["slides/flta/memoryless"]\n', "did you mean flat"),
        ("[[known]", "known.toml is not TOML"),
    ],
)
def test_a_list_that_cannot_be_meant_stops_the_run_before_it_begins(here, capsys, text, message):
    (here / "known.toml").write_text(text)
    assert main([*JUMPS, "--known", "known.toml"]) == 2
    assert message in capsys.readouterr().err
    assert not (here / "results").exists()


def test_a_renderer_that_is_listed_and_does_not_run_is_named(here, capsys):
    listed = '[[known]]\nrenderer = "local_mine:Gud"\nreason = "x"\nverdicts = ["slides/flat/memoryless"]\n'
    (here / "known.toml").write_text(listed)
    main([*JUMPS, "--known", "known.toml"])
    assert "known.toml lists 'local_mine:Gud' (1 verdict), which does not run here" in capsys.readouterr().err


def test_a_list_that_is_not_there_is_refused(here, capsys):
    assert main([*JUMPS, "--known", "absent.toml"]) == 2
    assert "what to do: make it of what fails now: --write-known absent.toml" in capsys.readouterr().err


def test_what_is_watched_of_a_renderer(here):
    assert files_behind(["local_mine:Good+pp"]) == [here / "local_mine.py"]
    package = here / "mypackage" / "inner"
    package.mkdir(parents=True)
    for file in (package.parent / "__init__.py", package / "__init__.py", package / "law.py"):
        file.touch()
    assert files_behind(["mypackage.inner.law:make"]) == sorted(package.parent.rglob("*.py"))
    assert "mypackage" not in sys.modules
    assert files_behind(["absent:Good", "lib:./absent.so"]) == []
    assert files_behind(["lib:slides.toml", "cmd:python local_mine.py"]) == [Path("local_mine.py"), Path("slides.toml")]
    assert any(file.name == "discovery.py" for file in files_behind(["constraint"])), "that of an entry point"


def test_a_change_runs_it_again(tmp_path, capfd):
    """In a process of its own each time, until Ctrl-C, and with the exit code of the last."""
    file, runs = tmp_path / "mine.py", tmp_path / "runs"
    file.write_text("5")
    runs.write_text("")

    def once():
        runs.write_text(f"{runs.read_text()}{os.getpid()} ")
        return int(file.read_text())

    def change():
        while len(runs.read_text().split()) < 1:
            time.sleep(0.02)
        time.sleep(0.1)
        file.write_text("77")
        while len(runs.read_text().split()) < 2:
            time.sleep(0.02)
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGINT)

    hand = threading.Thread(target=change)
    hand.start()
    assert run_again(once, lambda: [file, tmp_path / "absent.toml"]) == 77
    hand.join()
    assert len(set(runs.read_text().split()) - {str(os.getpid())}) == 2
    assert "exit code 5; watching 1 file, Ctrl-C ends it" in capfd.readouterr().err
