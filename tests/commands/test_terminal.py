"""The terminal as a sink of events, and the closing summary, without a run; and the exit code of results."""

import io
from pathlib import Path

import pytest

from hapticeval.api import Results
from hapticeval.commands import terminal
from hapticeval.errors import HapticevalError, RendererError
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.runner.events import Interrupted, JobFinished, RunStarted
from hapticeval.runner.results import Command, Environment, ResultsDocument, RunEntry, SceneEntry, Timing, VerdictEntry

BROKE = RendererError("it raised", tick=3, hip=(0.0, 0.1))
AGAIN = "what is done is kept; press Ctrl-C again to stop at once"


def verdict(outcome, *, metric=None, bound=None, **more):
    names = {"renderer": "r", "suite": "s", "case": "c", "check": "memoryless", "level": Level.MUST}
    return VerdictEntry.of(
        Verdict(**{**names, "finding": Finding(outcome, "what was seen", metric=metric, bound=bound), **more})
    )


def results(*verdicts, strict=False, **more):
    whole = {
        "planned": len(verdicts),
        "ran": len(verdicts),
        "complete": True,
        "reason": None,
        "environment": Environment(python="", platform="", cpu_count=None, versions={}),
        "seed": 0,
        "command": Command(suites=[], renderers=[], select=[], strict=strict),
        "runs": [],
        "verdicts": list(verdicts),
        "table": {},
        "timing": Timing(simulated_seconds=6.0, wall_seconds=2.0, times_real_time=3.0),
    }
    return ResultsDocument(**{**whole, **more})


def job(*verdicts, error=None):
    optional = ("device", "inner_loop", "effects")
    scene = SceneEntry(**{name: 1.0 for name in SceneEntry.__struct_fields__ if name not in optional})
    run = dict.fromkeys(RunEntry.__struct_fields__) | {"suite": "s", "case": "c", "renderer": "r", "scene": scene}
    return JobFinished(RunEntry(**{**run, "model": {"kind": "line"}}), verdicts, error)


@pytest.mark.parametrize(
    ("done", "errors", "code"),
    [
        (results(verdict(Outcome.PASS)), [], 0),
        (results(verdict(Outcome.INCONCLUSIVE, level=Level.INFO), verdict(Outcome.NOT_APPLICABLE)), [], 0),
        (results(verdict(Outcome.INCONCLUSIVE)), [], 1),
        (results(verdict(Outcome.FAIL, level=Level.SHOULD)), [], 0),
        (results(verdict(Outcome.FAIL, published=Outcome.FAIL)), [], 0),
        (results(verdict(Outcome.FAIL)), [], 1),
        (results(verdict(Outcome.ERROR)), [], 1),
        (results(verdict(Outcome.PASS, published=Outcome.FAIL)), [], 1),
        (results(verdict(Outcome.PASS), planned=2, complete=False, reason="interrupted"), [], 1),
        (results(verdict(Outcome.FAIL)), [BROKE], 3),
        (results(verdict(Outcome.ERROR)), [HapticevalError("no such file")], 2),
        (results(verdict(Outcome.ERROR)), [HapticevalError("no such file"), BROKE], 3),
    ],
)
def test_exit_codes(done, errors, code):
    assert Results(done, errors=tuple(errors)).exit_code == code


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
def test_a_strict_run_lets_warnings_count(outcome, published, code):
    should = verdict(outcome, level=Level.SHOULD, published=published)
    assert Results(results(should)).exit_code == 0
    assert Results(results(should, strict=True)).exit_code == code
    assert Results(results(verdict(outcome, level=Level.INFO, published=published), strict=True)).exit_code == 0


def test_warnings_have_a_mark_of_their_own():
    should = verdict(Outcome.FAIL, level=Level.SHOULD)
    shown = terminal.summary(results(should), [])
    assert "warning: fail: r on s/c/" in shown
    assert "none not as expected, 1 warning\n" in shown
    assert "1 warning that count" in terminal.summary(results(should, strict=True), [])


def test_the_summary_says_what_is_not_as_it_must_be():
    done = results(
        verdict(Outcome.PASS),
        verdict(Outcome.FAIL, metric=Metric("jump", 0.0123456, "m"), bound=0.001),
        verdict(Outcome.NOT_APPLICABLE),
        verdict(Outcome.NOT_APPLICABLE, case="d"),
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
        "not applicable: memoryless (2 times): what was seen",
        "",
        "4 of 5 planned verdicts ran (incomplete: interrupted by the user): 1 pass, 1 fail, 2 not-applicable; "
        "1 not as expected",
        "simulated 6.0 s in 2.0 s: 3.0 times real time",
        "",
        "wrote out/report.html",
    ]


def test_a_metric_that_json_cannot_hold_is_left_to_the_message():
    endless = verdict(Outcome.FAIL, metric=Metric("jump", float("inf"), "m"), bound=0.001)
    assert "jump =" not in terminal.summary(results(endless), [])


def test_lines_where_there_is_no_terminal():
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


@pytest.mark.parametrize(
    ("event", "line"),
    [
        (Interrupted(2), f"interrupted: 2 runs that had begun are being finished, {AGAIN}"),
        (Interrupted(1), f"interrupted: 1 run that had begun is being finished, {AGAIN}"),
        (Interrupted(0), "interrupted: what is done is kept"),
        (Interrupted(2, at_once=True), "stopped: 2 runs that had begun are given up; what is done is kept"),
    ],
)
def test_an_interrupt_is_answered(event, line):
    stream = io.StringIO()
    with terminal.Terminal(stream) as sink:
        sink(event)
    assert stream.getvalue() == f"{line}\n"


class Tty(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(("patience", "shown"), [(0.0, True), (3600.0, False)])
def test_a_bar_on_a_terminal_when_it_takes_long(monkeypatch, patience, shown):
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
