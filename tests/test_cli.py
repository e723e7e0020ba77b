"""The command line from outside: what it prints, what it writes, and the exit code that a gate reads."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from result_entries import results_of, run_entry

from hapticeval import __version__
from hapticeval.cli import main
from hapticeval.commands import output, running, terminal
from hapticeval.errors import HapticevalError, RendererError
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.runner.events import Interrupted, JobFinished, RunFinished, RunStarted
from hapticeval.runner.results import FILE, ResultsDocument, VerdictEntry, read_results

SUITE = """
title = "Two slides"
[[case]]
name = "flat"
title = "Along a plane"
model = { kind = "line" }
checks = ["continuous-contact", "memoryless"]
trajectory = { kind = "points", points = [[0.0, -0.001], [0.02, -0.001]], duration = 0.2 }
[case.published."local_mine:Differs"]
continuous-contact = "fail"

[[case]]
name = "flat-back"
title = "And back"
model = { kind = "line" }
checks = ["continuous-contact"]
trajectory = { kind = "points", points = [[0.02, -0.001], [0.0, -0.001]], duration = 0.2 }
"""

MINE = """
import numpy as np

class Good:
    def __init__(self, scene):
        self.stiffness = scene.stiffness
    def reset(self, hip):
        pass
    def step(self, hip, velocity, dt):
        ihip = np.array([hip[0], max(hip[1], 0.0)])
        return ihip, self.stiffness * (ihip - hip)

class Differs(Good):
    pass

class Jumps(Good):
    def step(self, hip, velocity, dt):
        ihip = np.array([0.0 if hip[0] < 0.0101 else 0.02, 0.0])
        return ihip, self.stiffness * (ihip - hip)

class Breaks(Good):
    def step(self, hip, velocity, dt):
        if hip[0] > 0.01:
            raise OSError("the sensor is gone")
        return super().step(hip, velocity, dt)

def nothing(scene):
    return 3
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A current directory with a renderer module and a suite, and no trace of them afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("COLUMNS", "100")
    (tmp_path / "local_mine.py").write_text(MINE)
    (tmp_path / "slides.toml").write_text(SUITE)
    yield tmp_path
    sys.modules.pop("local_mine", None)


def run(*arguments: str) -> int:
    return main(["run", "slides.toml", *arguments])


def words(text: str) -> str:
    return " ".join(text.split())


def test_help_teaches_by_examples_and_lists_the_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert "hapticeval run -r mymodule:factory" in text
    assert [line.split()[0] for line in text.splitlines() if line[:5].strip().isdigit()] == list("01234")


def test_the_version_is_the_package_s(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"hapticeval {__version__}\n"


def test_a_good_renderer_passes(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-r", "local_mine:Good") == 0
    told = capsys.readouterr()
    assert "3 of 3 planned verdicts ran: 3 pass; none not as expected" in told.out
    assert "times real time" in told.out
    assert "[2/2] local_mine:Good on slides/flat-back: 1 pass" in told.err
    results = read_results(here / "results")
    assert (results.ran, results.planned, results.complete) == (3, 3, True)
    written = [Path(line.removeprefix("wrote ")) for line in told.out.splitlines() if line.startswith("wrote ")]
    assert written
    assert all(path.is_file() for path in written)


def test_a_failure_is_exit_code_1_with_metric_and_bound(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-r", "local_mine:Jumps", "-k", "flat/continuous-contact") == 1
    out = capsys.readouterr().out
    assert "fail: local_mine:Jumps on slides/flat/continuous-contact" in out
    assert "IHIP jump that refinement leaves = 0.02 m, bound 0.00015 m" in out


def test_a_pass_where_a_failure_is_published_differs(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-r", "local_mine:Differs") == 1
    out = capsys.readouterr().out
    assert "differs: local_mine:Differs on slides/flat/continuous-contact: pass, published fail" in out
    assert "1 not as expected" in out


def test_a_broken_renderer_outranks_a_failure(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-r", "local_mine:Jumps", "-r", "local_mine:Breaks") == 3
    out = capsys.readouterr().out
    assert "broke: local_mine:Breaks on slides/flat\n" in out
    assert "OSError: the sensor is gone at tick 101 (counted from 0), HIP (0.0101, -0.001) m" in out
    assert "error: local_mine:Breaks" not in out, "a run that broke is told once, not once a check"
    assert "fail: local_mine:Jumps on slides/flat/continuous-contact" in out


def test_what_is_no_renderer_is_a_broken_one(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-r", "local_mine:nothing") == 3
    assert "which is no renderer" in capsys.readouterr().out


def test_a_selection_that_leaves_nothing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-r", "local_mine:Good", "-k", "nothing-*") == 4
    assert "what to do" in capsys.readouterr().err
    assert not (here / "results").exists()


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["run", "thesi", "-r", "local_mine:Good"], "unknown suite 'thesi'"),
        (["run", "absent.toml", "-r", "local_mine:Good"], "absent.toml"),
        (["run", "slides.toml", "-r", "constrait"], "unknown renderer 'constrait'"),
        (["run", "slides.toml", "-r", "local_mine:Absent"], "has no 'Absent'"),
        (["run", "slides.toml", "-r", "local_mine:Good", "-o", "."], "'.' is not empty"),
        (["run", "slides.toml", "-r", "local_mine:Good", "-o", "slides.toml"], "'slides.toml' is a file"),
        (["run", "slides.toml", "-r", "local_mine:Good", "-o", "slides.toml/below"], "cannot write into the folder"),
        (["run", "--seed", "-1"], "--seed"),
        (["explain", "continuous-contct"], "continuous-contact"),
        (["report", "absent"], "absent"),
        (["list", "everything"], "unknown listing 'everything'"),
        (["list", "chekcs"], "did you mean checks?"),
    ],
)
def test_wrong_usage_and_input_is_exit_code_2(
    here: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], what: str
) -> None:
    assert main(arguments) == 2
    told = capsys.readouterr()
    assert what in told.err
    assert told.out == ""


def test_only_an_earlier_run_is_overwritten(here: Path) -> None:
    assert run("-r", "local_mine:Jumps", "-o", "out") == 1
    assert run("-r", "local_mine:Good", "-o", "out") == 0
    assert [run.renderer for run in read_results(here / "out").runs] == ["local_mine:Good"] * 2
    foreign = here / "foreign"
    foreign.mkdir()
    (foreign / FILE).write_text('{"score": 3}')
    assert run("-r", "local_mine:Good", "-o", "foreign") == 2
    assert (foreign / FILE).read_text() == '{"score": 3}'


def test_the_same_command_gives_the_same_verdicts(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    documents = []
    for cores in (1, 2):
        monkeypatch.setattr("hapticeval.workers.cores", lambda cores=cores: cores)
        run("-r", "local_mine:Jumps", "-r", "local_mine:Good", "--seed", "7")
        documents.append(read_results(here / "results"))
    assert documents[0].verdicts == documents[1].verdicts
    assert documents[0].seed == documents[1].seed == 7


def test_reports_are_written_anew(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-r", "local_mine:Good") == 0
    first = [line for line in capsys.readouterr().out.splitlines() if line.startswith("wrote ")]
    reports = [Path(line.removeprefix("wrote ")) for line in first if not line.endswith(FILE)]
    assert reports
    for path in reports:
        path.unlink()
    assert main(["report", "results"]) == 0
    assert capsys.readouterr().out.splitlines() == [f"wrote {path}" for path in reports]
    assert all(path.is_file() for path in reports)


@pytest.mark.parametrize(
    ("what", "entry"),
    [
        ("renderers", "minimum-distance"),
        ("suites", "thesis"),
        ("cases", "thesis/cassinian-deep-slide"),
        ("checks", "continuous-contact"),
        ("devices", "parallelogram-2dof"),
        ("models", "cassinian"),
    ],
)
def test_there_is_a_list_of_everything(capsys: pytest.CaptureFixture[str], what: str, entry: str) -> None:
    assert main(["list", what]) == 0
    out = capsys.readouterr().out
    assert any(line.split()[0] == entry for line in out.splitlines())
    assert "broken:" not in out


COMMANDS = [
    "run", "list", "explain", "report", "record", "inspect", "convert", "replay", "compare", "bench", "field", "flow",
    "device", "limits", "integrators",
]  # fmt: skip


def test_the_help_tells_every_command_on_a_line_of_80_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["--help"]) == 0
    lines = capsys.readouterr().out.split("Commands:\n", 1)[1].split("\n\n", 1)[0].splitlines()
    assert [line.split()[0] for line in lines] == COMMANDS
    assert all(line.endswith(".") and not line.endswith("...") and len(line) <= 80 for line in lines)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_has_an_example_and_its_exit_codes(
    capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert main([command, "--help"]) == 0
    out = capsys.readouterr().out
    assert f"  hapticeval {command}" in out.split("Example", 1)[1]
    assert "\n    0  " in out.split("Exit codes:", 1)[1]


@pytest.mark.parametrize("name", CHECKS)
def test_explain_prints_all_that_a_check_says(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["explain", name]) == 0
    out = capsys.readouterr().out
    check = CHECKS[name]
    for text in (
        check.asks,
        check.formula,
        check.citation,
        check.bound,
        check.metric,
        *check.siblings.values(),
        *check.channels,
    ):
        assert words(text) in words(out)
    assert max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize("arguments", [["list", "checks"], ["--version"]])
def test_a_reader_that_has_gone_away_is_no_error(arguments: list[str]) -> None:
    command = [sys.executable, "-m", "hapticeval", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


# The sink of events, without a run.


def finding(outcome: Outcome, metric: Metric | None = None, bound: float | None = None) -> Finding:
    return Finding(outcome, "what was seen", metric=metric, bound=bound)


def verdict(outcome: Outcome, **more: Any) -> Verdict:
    names = {"renderer": "r", "suite": "s", "case": "c", "check": "memoryless", "level": Level.MUST}
    return Verdict(**{**names, "finding": finding(outcome), **more})


def job(*verdicts: Verdict, error: HapticevalError | None = None) -> JobFinished:
    return JobFinished(run_entry(), tuple(map(VerdictEntry.of, verdicts)), error)


AGAIN = "what is done is kept; press Ctrl-C again to stop at once"
BROKE = RendererError("it raised", tick=3, hip=(0.0, 0.1))


@pytest.mark.parametrize(
    ("done", "errors", "code"),
    [
        (results_of(verdict(Outcome.PASS)), [], 0),
        (results_of(verdict(Outcome.INCONCLUSIVE, level=Level.INFO), verdict(Outcome.NOT_APPLICABLE)), [], 0),
        (results_of(verdict(Outcome.INCONCLUSIVE)), [], 1),
        (results_of(verdict(Outcome.FAIL, level=Level.SHOULD)), [], 0),
        (results_of(verdict(Outcome.FAIL, published=Outcome.FAIL)), [], 0),
        (results_of(verdict(Outcome.FAIL)), [], 1),
        (results_of(verdict(Outcome.ERROR)), [], 1),
        (results_of(verdict(Outcome.PASS, published=Outcome.FAIL)), [], 1),
        (results_of(verdict(Outcome.PASS), planned=2, complete=False, reason="interrupted"), [], 1),
        (results_of(verdict(Outcome.FAIL)), [BROKE], 3),
        (results_of(verdict(Outcome.ERROR)), [HapticevalError("no such file")], 2),
        (results_of(verdict(Outcome.ERROR)), [HapticevalError("no such file"), BROKE], 3),
    ],
)
def test_exit_codes(done: ResultsDocument, errors: list[HapticevalError], code: int) -> None:
    assert terminal.exit_code(done, errors) == code


@pytest.mark.parametrize(
    ("outcome", "published", "code"),
    [
        (Outcome.FAIL, None, 1),
        (Outcome.INCONCLUSIVE, None, 1),
        (Outcome.NOT_APPLICABLE, None, 0),
        (Outcome.PASS, None, 0),
        (Outcome.FAIL, Outcome.FAIL, 0),
    ],
)
def test_a_strict_run_lets_warnings_count(outcome: Outcome, published: Outcome | None, code: int) -> None:
    should = verdict(outcome, level=Level.SHOULD, published=published)
    assert terminal.exit_code(results_of(should), []) == 0
    assert terminal.exit_code(results_of(should, strict=True), []) == code
    info = verdict(outcome, level=Level.INFO, published=published)
    assert terminal.exit_code(results_of(info, strict=True), []) == 0


def test_warnings_have_a_mark_of_their_own() -> None:
    should = verdict(Outcome.FAIL, level=Level.SHOULD)
    told = terminal.summary(results_of(should), [])
    assert "warning: fail: r on s/c/" in told
    assert "none not as expected, 1 warning\n" in told
    assert "1 warning that count" in terminal.summary(results_of(should, strict=True), [])


def test_the_summary_says_what_is_not_as_it_must_be() -> None:
    jump = finding(Outcome.FAIL, Metric("jump", 0.0123456, "m"), 0.001)
    done = results_of(
        verdict(Outcome.PASS),
        verdict(Outcome.FAIL, finding=jump),
        planned=5,
        complete=False,
        reason="interrupted by the user",
        table={"Resists": {"one": "Yes", "another": "No"}, "Suitable": {"one": "No"}},
        published_table={"Resists": {"another": "Yes"}, "Suitable": {"one": "No"}},
    )
    assert terminal.summary(done, [Path("out/report.html")]).splitlines() == [
        "          one  another",
        "Resists   Yes  No (published Yes)",
        "Suitable  No   -",
        "",
        "fail: r on s/c/memoryless",
        "  jump = 0.01235 m, bound 0.001 m",
        "  what was seen",
        "",
        "2 of 5 planned verdicts ran (incomplete: interrupted by the user): 1 pass, 1 fail; 1 not as expected",
        "simulated 6.0 s in 2.0 s: 3.0 times real time",
        "",
        "wrote out/report.html",
    ]


def test_a_metric_that_json_cannot_hold_is_left_to_the_message() -> None:
    endless = finding(Outcome.FAIL, Metric("jump", float("inf"), "m"), 0.001)
    assert "jump =" not in terminal.summary(results_of(verdict(Outcome.FAIL, finding=endless)), [])


def test_lines_where_there_is_no_terminal() -> None:
    stream = io.StringIO()
    with terminal.Terminal(stream) as sink:
        sink(RunStarted(2, 2))
        sink(job(verdict(Outcome.PASS)))
        sink(job(verdict(Outcome.ERROR), error=BROKE))
    assert stream.getvalue().splitlines() == [
        "2 runs, 2 verdicts planned",
        "[1/2] r on s/c: 1 pass",
        "[2/2] r on s/c: broke: it raised at tick 3 (counted from 0), HIP (0, 0.1) m",
    ]
    assert sink.errors == [BROKE]


class Tty(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("event", "line"),
    [
        (Interrupted(2), f"interrupted: 2 runs that had begun are being finished, {AGAIN}"),
        (Interrupted(1), f"interrupted: 1 run that had begun is being finished, {AGAIN}"),
        (Interrupted(0), "interrupted: what is done is kept"),
        (Interrupted(2, at_once=True), "stopped: 2 runs that had begun are given up; what is done is kept"),
    ],
)
def test_an_interrupt_is_answered(event: Interrupted, line: str) -> None:
    stream = io.StringIO()
    with terminal.Terminal(stream) as sink:
        sink(event)
    assert stream.getvalue() == f"{line}\n"
    assert sink.stopped is event.at_once


@pytest.mark.parametrize(("patience", "shown"), [(0.0, True), (3600.0, False)])
def test_a_bar_on_a_terminal_when_it_takes_long(monkeypatch: pytest.MonkeyPatch, patience: float, shown: bool) -> None:
    monkeypatch.setattr(terminal, "PATIENCE", patience)
    monkeypatch.setenv("TERM", "xterm")
    stream = Tty()
    with terminal.Terminal(stream) as sink:
        sink(RunStarted(2, 2))
        sink(job(verdict(Outcome.PASS)))
        sink(Interrupted(1))
        sink.drawn(3, 7)
    assert "being finished" in stream.getvalue()
    assert ("1/2" in stream.getvalue()) is shown
    assert ("3/7" in stream.getvalue()) is shown


def test_results_of_ours_are_known_by_their_entries(tmp_path: Path) -> None:
    file = tmp_path / FILE
    for text, ours in (("", False), ("[]", False), ('{"verdicts": []}', False)):
        file.write_text(text)
        assert output._ours(file) is ours
    file.write_text(json.dumps({"format_version": 0, "planned": 1, "verdicts": []}))
    assert output._ours(file)


def test_a_renderer_that_refuses_all_that_there_is_has_not_passed(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    alone = ["run", "-k", "star-convex-corner", "-r", "set-stabilisation"]
    assert main(alone) == 2
    shown = capsys.readouterr().out
    assert "refuses: set-stabilisation on thesis/star-convex-corner" in shown
    assert "what to do: choose a smooth model" in shown
    assert main([*alone, "-r", "constraint"]) == 0


def test_the_first_run_says_that_it_compiles(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (tmp_path / "geometry" / "__pycache__").mkdir(parents=True)
    assert running.kernels_are_new(tmp_path)
    (tmp_path / "geometry" / "__pycache__" / "kernels.bend.nbi").touch()
    assert not running.kernels_are_new(tmp_path)
    monkeypatch.setattr(running, "kernels_are_new", lambda: True)
    stream = [RunFinished(results_of(verdict(Outcome.PASS)))]
    with terminal.Terminal() as told:
        assert running.watch(iter(stream), told) is stream[0].results
    assert capsys.readouterr().err.startswith("compiling kernels as they are first used, once")


def test_ctrl_c_that_no_command_answers_is_told_in_a_word(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hapticeval.commands.listing.columns", lambda _: signal.raise_signal(signal.SIGINT))
    assert main(["list", "checks"]) == 1
    assert capsys.readouterr().err == "interrupted\n"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
