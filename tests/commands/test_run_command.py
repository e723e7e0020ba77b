"""The command line from outside: what it prints, what it writes, and the exit code that a gate reads."""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hapticeval import __version__
from hapticeval.cli import main
from hapticeval.commands import terminal
from hapticeval.errors import HapticevalError
from hapticeval.kernel_cache import kernel_folder
from hapticeval.phenomena.inherent import limits_of
from hapticeval.phenomena.pages import page_file, read_page
from hapticeval.phenomena.registry import CHECKS
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.runner.folder import locked_folder
from hapticeval.runner.results import RESULTS_FILE, read_results

pytestmark = pytest.mark.usefixtures("in_process")


def run(*arguments):
    return main(["run", "slides.toml", "--no-report", *arguments])


def words(text):
    return " ".join(text.split())


def test_the_version_is_the_package_s(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"hapticeval {__version__}\n"


def test_on_github_wrong_input_is_an_annotation_of_the_job(monkeypatch, capsys):
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    assert main(["run", "-r", "no_such_module:Thing"]) == 2
    shown = capsys.readouterr()
    assert shown.err.startswith("error: ")
    first_line = shown.err.splitlines()[0].removeprefix("error: ")
    assert shown.out.startswith(f"::error title=hapticeval::{first_line}%0A")
    monkeypatch.setenv("GITHUB_ACTIONS", "")
    assert main(["run", "-r", "no_such_module:Thing"]) == 2
    assert capsys.readouterr().out == ""


def test_a_good_renderer_passes_and_its_reports_can_be_written_anew(here, capsys):
    assert main(["run", "slides.toml", "-r", "local_mine:Good"]) == 0
    shown = capsys.readouterr()
    assert "4 of 4 planned verdicts ran: 3 passed, 1 shown and not judged; none not as expected" in shown.out
    assert "times real time" in shown.out
    assert "[3/3] slides: 3 runs: 3 passed, 1 shown and not judged" in shown.err
    results = read_results(here / "results")
    assert (results.ran, results.planned, results.complete) == (4, 4, True)
    written = [Path(line.removeprefix("wrote ")) for line in shown.out.splitlines() if line.startswith("wrote ")]
    assert written[0].name == RESULTS_FILE
    reports = written[1:]
    assert reports
    for path in reports:
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert main(["report", "results"]) == 0
    assert capsys.readouterr().out.splitlines() == [f"wrote {path}" for path in reports]
    assert all(path.exists() for path in reports)


@pytest.mark.parametrize(
    ("arguments", "code", "expected"),
    [
        (
            ["-r", "local_mine:Jumps", "-k", "flat/continuous-contact"],
            1,
            [
                "fail: local_mine:Jumps on slides/flat/continuous-contact\n"
                "  IHIP jump that refinement leaves = 20 mm, bound 0.1425 mm"
            ],
        ),
        (
            ["-r", "local_mine:Differs"],
            1,
            [
                "differs: local_mine:Differs on slides/flat/continuous-contact: pass, published fail",
                "1 not as expected",
            ],
        ),
        (
            ["-r", "local_mine:Jumps", "-r", "local_mine:Breaks"],
            3,
            [
                "broke: local_mine:Breaks on 3 cases: 4 verdicts lost\n",
                "first on slides/flat, then slides/flat-back, then slides/flat-again\n",
                "OSError: the sensor is gone at tick 106 (counted from 0), HIP (10.07, -1) mm",
                "fail: local_mine:Jumps on slides/flat/continuous-contact",
            ],
        ),
        (["-r", "local_mine:nothing"], 3, ["which is not a renderer: it has no reset and no step"]),
        (["-r", "constraint", "-r", "ideal", "-k", "flat"], 0, ["2 runs"]),
    ],
)
def test_the_summary_and_the_exit_code(here, capsys, arguments, code, expected):
    assert run(*arguments) == code
    shown = capsys.readouterr()
    for text in expected:
        assert text in shown.out + shown.err
    assert "error: local_mine:Breaks" not in shown.out, "a run that broke is shown once, not once per check"


PACES = """
import time
from local_mine import Good
class Slow(Good):
    def step(self, hip, velocity, dt):
        time.sleep(1.5e-3)
        return super().step(hip, velocity, dt)
class SlowAtFirst(Good):
    warm = False
    def step(self, hip, velocity, dt):
        if not self.warm:
            time.sleep(0.3)
        self.warm = True
        return super().step(hip, velocity, dt)
"""


def test_a_renderer_that_is_too_slow_is_named_and_one_that_begins_slowly_is_not(here, capsys):
    (here / "local_paces.py").write_text(PACES)
    assert run("-r", "local_paces:Slow", "-r", "local_paces:SlowAtFirst", "-k", "flat/continuous-contact") == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "too slow" in line)
    times = re.fullmatch(
        r"too slow: half of the steps of local_paces:Slow take .* ms or more, (.*) times the sampling time of 1 ms, "
        r"on slides/flat; timed beside the other work of this run",
        line,
    )
    assert float(times[1]) > 1.5, "what it sleeps"


def test_a_renderer_that_refuses_all_that_there_is_has_not_passed(here, capsys):
    alone = ["run", "--no-report", "-k", "star-convex-corner", "-r", "set-stabilisation"]
    assert main(alone) == 2
    shown = capsys.readouterr().out
    assert "refuses: set-stabilisation on thesis/star-convex-corner" in shown
    assert "what to do: choose a smooth model" in shown
    assert main([*alone, "-r", "constraint"]) == 0


@pytest.mark.parametrize(
    ("arguments", "code", "what"),
    [
        (["run", "thesi", "-r", "local_mine:Good"], 2, "unknown suite 'thesi'"),
        (["run", "absent.toml", "-r", "local_mine:Good"], 2, "absent.toml"),
        (["run", "slides.toml", "-r", "constrait"], 2, "unknown renderer 'constrait'"),
        (["run", "slides.toml", "-r", "local_mine:Absent"], 2, "has no 'Absent'"),
        (["run", "slides.toml", "-r", "local_empty:R"], 2, "local_empty.py, where there is no class and no function"),
        (["run", "slides.toml", "-r", "libmine.so"], 2, "did you mean lib:./libmine.so?"),
        (["run", "slides.toml", "-r", "./local_mine.py"], 2, "did you mean local_mine:Good or local_mine:Differs or"),
        (["run", "slides.toml", "-r", "local_mine:Good", "-o", "."], 2, "'.' is not empty"),
        (["run", "slides.toml", "-r", "local_mine:Good", "-o", "slides.toml"], 2, "'slides.toml' is a file"),
        (["run", "slides.toml", "-r", "local_mine:Good", "-o", "slides.toml/b"], 2, "cannot write into the folder"),
        (["run", "slides.toml", "-r", "local_mine:Good", "-k", "flat", "-k", "flta"], 4, "nothing matches -k 'flta'"),
        (["run", "--seed", "-1"], 2, "--seed"),
        (["explain", "continuous-contct"], 2, "continuous-contact"),
        (["report", "absent"], 2, "absent"),
        (["list", "everything"], 2, "unknown listing 'everything'"),
        (["list", "chekcs"], 2, "did you mean checks?"),
    ],
)
def test_wrong_usage_and_input(here, capsys, arguments, code, what):
    (here / "local_empty.py").touch()
    assert main(arguments) == code
    shown = capsys.readouterr()
    assert what in shown.err
    assert shown.out == ""
    assert not (here / "results").exists()


def test_what_was_judged_is_told_where_reports_cannot_be_written(here, capsys, monkeypatch):
    def fill_disk(*_, **__):
        raise HapticevalError("cannot write the report", why="No space left on device")

    monkeypatch.setattr("hapticeval.api.Results.report", fill_disk)
    assert main(["run", "slides.toml", "-r", "local_mine:Good", "-o", "out"]) == 2
    shown = capsys.readouterr()
    assert "4 of 4 planned verdicts ran" in shown.out
    assert "wrote out/results.json" in shown.out
    assert "what to do: the verdicts are kept: hapticeval report out writes the reports" in shown.err


def test_a_list_of_known_failures_that_cannot_be_written_costs_no_second_run(here, capsys):
    (here / "a_file").touch()
    assert run("-r", "local_mine:Jumps", "-o", "out", "-k", "flat", "--write-known", "a_file/known.toml") == 2
    assert "with --resume -o out nothing is judged again" in capsys.readouterr().err


def test_only_an_earlier_run_is_overwritten(here):
    assert run("-r", "local_mine:Jumps", "-o", "out", "-k", "flat") == 1
    assert run("-r", "local_mine:Good", "-o", "out", "-k", "flat") == 0
    assert [run.renderer for run in read_results(here / "out").runs] == ["local_mine:Good"]
    for number, text in enumerate(("", "[]", '{"verdicts": []}', '{"score": 3}')):
        folder = here / f"foreign{number}"
        folder.mkdir()
        (folder / RESULTS_FILE).write_text(text)
        assert run("-r", "local_mine:Good", "-o", folder.name) == 2
        assert (folder / RESULTS_FILE).read_text() == text
    (here / "foreign0" / RESULTS_FILE).write_text('{"format_version": 0, "planned": 1, "verdicts": []}')
    with locked_folder(here / "foreign0"):
        pass


def test_two_runs_in_one_folder_exclude_each_other_and_the_second_names_the_first(here, capsys):
    with locked_folder(here / "out"):
        # Before anything is planned, which takes seconds: not even the suite is looked for.
        assert run("no-such-suite", "-r", "local_mine:Good", "-o", "out") == 2
        assert "another command writes into 'out'" in capsys.readouterr().err
        assert run("-r", "local_mine:Good", "-o", "out", "-k", "flat") == 2
        told = capsys.readouterr().err
        assert "another command writes into 'out'" in told
        assert not Path("/proc/locks").exists() or f"process {os.getpid()}" in told
        assert list((here / "out").iterdir()) == []
        assert run("-r", "local_mine:Good", "-o", "beside", "-k", "flat") == 0
    assert not (here / "out").exists(), "it was made for nothing, and is gone"
    assert run("-r", "local_mine:Good", "-o", "out", "-k", "flat") == 0
    assert run("-r", "local_mine:Good", "-o", "out", "-k", "flat") == 0
    assert "replaces the run of local_mine:Good, " in capsys.readouterr().err


@pytest.mark.parametrize("locked", [".", "counterexamples"])
def test_a_search_waits_for_nobody_who_writes_there(here, capsys, locked):
    # A report of this folder shows what a search leaves in it.
    (here / RESULTS_FILE).write_text('{"format_version": 0, "planned": 1, "verdicts": []}')
    asked = ["search", "-r", "constraint", "--check", "never-pulls", "--model", "circle", "--examples", "1"]
    with locked_folder(here / locked, for_results=False):
        assert main(asked) == 2
        assert f"another command writes into '{locked}'" in capsys.readouterr().err


def test_a_page_of_a_recording_waits_for_nobody_who_writes_there(here, capsys):
    still = Recording(np.arange(50) * 1e-3, {"hip": np.zeros((50, 2)), "force": np.zeros((50, 2))})
    write_recording(here / "still.h5", still)
    with locked_folder(here / "page", for_results=False):
        assert main(["view", "still.h5", "-o", "page"]) == 2
        assert "another command writes into 'page'" in capsys.readouterr().err
    assert main(["view", "still.h5", "-o", "page"]) == 0


def test_two_runs_exclude_each_other_where_the_system_cannot_lock_a_folder(here, capsys, monkeypatch):
    monkeypatch.setattr("hapticeval.runner.folder.fcntl", None)
    with locked_folder(here / "out"):
        assert run("-r", "local_mine:Good", "-o", "out", "-k", "flat") == 2
        told = capsys.readouterr().err
        assert f"another command writes into 'out': process {os.getpid()}" in told
        assert "remove out/run.lock" in told
    # One that was killed leaves the file behind; who removes it may go on.
    (here / "out").mkdir()
    (here / "out" / "run.lock").write_text("4711\n")
    assert run("-r", "local_mine:Good", "-o", "out", "-k", "flat") == 2
    assert "process 4711" in capsys.readouterr().err
    (here / "out" / "run.lock").unlink()
    assert run("-r", "local_mine:Good", "-o", "out", "-k", "flat") == 0


def test_the_same_command_gives_the_same_verdicts(here, monkeypatch):
    documents = []
    for cores in (1, 2):
        monkeypatch.setattr("hapticeval.runner.execution.default_workers", lambda cores=cores: cores)
        run("-r", "local_mine:Jumps", "-r", "local_mine:Good", "-k", "flat*", "--seed", "7")
        documents.append(read_results(here / "results"))
    assert documents[0].verdicts == documents[1].verdicts
    assert documents[0].seed == documents[1].seed == 7


@pytest.mark.parametrize(
    ("what", "entry"),
    [
        ("renderers", "minimum-distance"),
        ("suites", "thesis"),
        ("cases", "cassinian-deep-slide"),
        ("checks", "continuous-contact"),
        ("devices", "parallelogram-2dof"),
        ("models", "cassinian"),
        ("effects", "height-map"),
        ("formats", "matlab5"),
    ],
)
def test_there_is_a_list_of_everything(capsys, what, entry):
    assert main(["list", what]) == 0
    out = capsys.readouterr().out
    assert any(line.split()[:1] == [entry] for line in out.splitlines())
    assert "broken:" not in out


def test_the_cases_of_a_suite_are_listed(here, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["list", "cases", "thesis", "slides.toml"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("thesis\n  cassinian-shallow-slide ")
    assert "\n\nslides.toml\n  flat " in out
    assert max(map(len, out.splitlines())) <= 80
    assert main(["list", "checks", "thesis"]) == 2
    assert "write hapticeval list checks, or list cases SUITE" in capsys.readouterr().err
    assert main(["list", "cases", "thesi"]) == 2
    assert "did you mean thesis?" in capsys.readouterr().err


FIRST_PAGE = [
    "run", "list", "explain", "report", "figure", "table", "diff", "history", "search", "bench", "new", "doctor",
    "header", "record", "inspect", "replay", "view", "compare", "convert", "reproduce", "merge", "badge", "cache",
    "study",
]  # fmt: skip
STUDIES = ["field", "limits"]
COMMANDS = [*([name] for name in FIRST_PAGE if name != "study"), *(["study", name] for name in STUDIES)]


def test_the_help_teaches_by_examples_and_has_every_command_on_a_line_of_80_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert "hapticeval run -r mymodule:factory" in text
    assert re.findall(r"^ +(\d)  ", text, re.MULTILINE) == list("01234")
    sections = text.split("\nJudge:\n", 1)[1].split("\n  The --help of each", 1)[0]
    lines = [line for line in sections.splitlines() if line.startswith("  ")]
    assert [line.split()[0] for line in lines] == FIRST_PAGE
    assert all(line.endswith(".") and not line.endswith("...") and len(line) <= 80 for line in lines)
    assert main(["study", "--help"]) == 0
    listed = capsys.readouterr().out.split("Commands:\n", 1)[1].splitlines()
    assert [line.split()[0] for line in listed if line.strip()] == STUDIES


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_the_help_of_a_command_has_an_example_and_its_exit_codes(capsys, command):
    assert main([*command, "--help"]) == 0
    out = capsys.readouterr().out
    assert f"  hapticeval {' '.join(command)}" in out.split("Example", 1)[1]
    assert re.findall(r"^  (\d)  \w", out.split("\nExit codes:\n", 1)[1], re.MULTILINE)[0] == "0"


@pytest.mark.parametrize("name", CHECKS)
def test_explain_prints_what_is_asked_first_and_where_the_rest_is(capsys, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["explain", name]) == 0
    out = capsys.readouterr().out
    check, page = CHECKS[name], read_page(CHECKS[name])
    texts = (page.question, check.formula, page.bound, check.citation, check.metric)
    # A reader's first screen, whose last line is for the next command; the path of an installed page may take two.
    head, *rest = out.splitlines()
    assert len(rest) <= 22
    assert head == f"{name} ({check.level}), more in {page_file(check)}"
    causes = words(out.split("\nif it fails", 1)[1])
    assert all(words(f"{item.number}. {item.title}") in causes for item in page.items)
    assert out.count("\ninherent") == len(limits_of(name))
    assert all(words(because) in words(out) for because in limits_of(name).values())
    assert all(words(text) in words(out) for text in (*texts, *check.siblings.values(), *check.channels))
    assert len(out.split("\nbound ", 1)[1].split("\nif it fails", 1)[0].splitlines()) <= 7


@pytest.mark.parametrize("arguments", [["list", "checks"], ["--version"]])
def test_a_reader_that_has_gone_away_is_no_error(arguments):
    command = [sys.executable, "-m", "hapticeval", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_the_first_run_says_that_it_compiles(here, capsys, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(here))
    assert terminal.kernels_are_new()
    kernel_folder().mkdir(parents=True)
    (kernel_folder() / "kernels.bend.nbi").touch()
    assert not terminal.kernels_are_new()
    assert main(["cache"]) == 0
    assert ": 1 file, 0 B" in capsys.readouterr().out
    assert main(["cache", "--clear"]) == 0
    assert not kernel_folder().exists()
    assert main(["cache", "--clear"]) == 0
    capsys.readouterr()
    monkeypatch.setattr(terminal, "kernels_are_new", lambda: True)
    assert run("-r", "local_mine:Good", "-k", "flat") == 0
    assert capsys.readouterr().err.startswith("compiling kernels as they are first used, once")


def test_ctrl_c_that_no_command_answers_is_answered_in_a_word(capsys, monkeypatch):
    monkeypatch.setattr("hapticeval.commands.listing.columns", lambda _: signal.raise_signal(signal.SIGINT))
    assert main(["list", "checks"]) == 1
    assert capsys.readouterr().err == "interrupted\n"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
