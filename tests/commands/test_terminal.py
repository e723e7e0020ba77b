"""The terminal as a sink of events, and the closing summary, without a run; and the exit code of results."""

import io
import itertools

import pytest
from result_entries import apart, changed, run_entry

from hapticeval.api import Results
from hapticeval.commands import terminal
from hapticeval.errors import HapticevalError, RendererError
from hapticeval.phenomena.verdict import Finding, Level, Outcome, Verdict
from hapticeval.runner.events import AtWork, Interrupted, JobFinished, RunFinished, RunStarted
from hapticeval.runner.results import (
    Command,
    Environment,
    Problem,
    ResultsDocument,
    RunEntry,
    SceneEntry,
    Timing,
    VerdictEntry,
)

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
        "verdicts": apart(verdicts),
        "table": {},
        "timing": Timing(simulated_seconds=6.0, wall_seconds=2.0, times_real_time=3.0),
    }
    return ResultsDocument(**{**whole, **more})


def job(*verdicts, error=None):
    optional = ("device", "inner_loop", "effects")
    scene = SceneEntry(**{name: 1.0 for name in SceneEntry.__struct_fields__ if name not in optional})
    run = dict.fromkeys(RunEntry.__struct_fields__) | {"suite": "s", "case": "c", "renderer": "r", "scene": scene}
    run |= {"model": {"kind": "line"}, "error": None if error is None else Problem.of(error)}
    return JobFinished(RunEntry(**run), verdicts, error)


@pytest.mark.parametrize(
    ("done", "errors", "code"),
    [
        (results(verdict(Outcome.PASS)), [], 0),
        (results(verdict(Outcome.INCONCLUSIVE, level=Level.INFO), verdict(Outcome.NOT_APPLICABLE)), [], 0),
        (results(verdict(Outcome.INCONCLUSIVE)), [], 1),
        (results(verdict(Outcome.FAIL, level=Level.SHOULD)), [], 0),
        (results(verdict(Outcome.FAIL, published=Outcome.FAIL)), [], 1),
        (results(verdict(Outcome.FAIL, inherent="a theorem")), [], 0),
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
    runs = [run_entry(case=str(number), error=Problem.of(error)) for number, error in enumerate(errors)]
    assert Results(changed(done, runs=runs)).exit_code == code


@pytest.mark.parametrize(
    ("outcome", "published", "code"),
    [
        (Outcome.FAIL, None, 1),
        (Outcome.INCONCLUSIVE, None, 1),
        (Outcome.NOT_APPLICABLE, None, 0),
        (Outcome.PASS, None, 0),
        (Outcome.FAIL, Outcome.FAIL, 1),
    ],
)
def test_a_strict_run_lets_warnings_count(outcome, published, code):
    should = verdict(outcome, level=Level.SHOULD, published=published)
    assert Results(results(should)).exit_code == 0
    assert Results(results(should, strict=True)).exit_code == code
    assert Results(results(verdict(outcome, level=Level.INFO, published=published), strict=True)).exit_code == 0


@pytest.mark.parametrize(
    ("event", "line"),
    [
        (Interrupted(2), f"interrupted: 2 runs that had begun are being finished, {AGAIN}"),
        (Interrupted(1), f"interrupted: 1 run that had begun is being finished, {AGAIN}"),
        (
            Interrupted(2, seconds=83.0),
            f"interrupted: 2 runs that had begun are being finished, the first at work for 83 s, {AGAIN}",
        ),
        (Interrupted(1, grace=5.0), f"interrupted: 1 run that had begun is being finished, for 5 s at most, {AGAIN}"),
        (Interrupted(0), "interrupted: what is done is kept"),
        (Interrupted(2, at_once=True), "stopped: 2 runs that had begun are given up; what is done is kept"),
        (
            Interrupted(2, at_once=True, runs=(("s", "c", "r"), ("s", "d", "r"))),
            "stopped: 2 runs that had begun are given up (r on s/c, and 1 other run); what is done is kept",
        ),
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
    monkeypatch.setattr(terminal, "BAR_AFTER", patience)
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


def lines(*events, verbose=False):
    stream = io.StringIO()
    with terminal.Terminal(stream, verbose=verbose) as sink:
        for event in events:
            sink(event)
    return stream.getvalue().splitlines()


RUN = [
    RunStarted(5, 3, jobs_of={"s": 2, "t": 1}),
    job(verdict(Outcome.PASS), verdict(Outcome.FAIL)),
    job(verdict(Outcome.ERROR), error=BROKE),
    RunFinished(results(verdict(Outcome.PASS))),
]
BROKEN = "[2/3] r on s/c: broke: it raised at tick 3 (counted from 0), HIP (0, 100) mm"


def test_a_line_a_suite_where_there_is_no_terminal():
    assert lines(*RUN) == [
        "3 runs, 5 verdicts planned",
        BROKEN,
        "[2/3] s: 2 runs: 1 in error, 1 failed, 1 passed",
    ]


def test_a_renderer_that_breaks_everywhere_alike_has_one_line():
    again = RendererError("it raised", tick=5, hip=(0.0, 0.2))
    other = RendererError("it raised", why="elsewhere")
    jobs = [job(verdict(Outcome.ERROR), error=each) for each in (BROKE, again, other)]
    assert len(lines(RunStarted(3, 3, jobs_of={"s": 3}), *jobs)) == 4


def test_what_is_waited_for_is_told_now_and_then():
    stream = io.StringIO()
    with terminal.Terminal(stream) as sink:
        for what in ("one", "two"):
            for tenth in range(121):
                sink.waiting(what, 0.1 * tenth, 60.0)
    assert stream.getvalue().splitlines() == [
        f"{what}: {seconds} of 60 s" for what in ("one", "two") for seconds in (5, 10)
    ]


def test_what_is_at_work_has_a_line_after_each_silence(monkeypatch):
    """A minute in which a second run begins: the lines that come by themselves count as no silence."""
    clock = itertools.count(1000.0, 5.0)
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now)
    stream = io.StringIO()
    now = next(clock)
    with terminal.Terminal(stream) as sink:
        sink(RunStarted(4, 4))
        for now in itertools.islice(clock, 12):
            others = [("s", "other", "r")] if now > 1030.0 else []
            sink(AtWork(1, (("s", "c", "r"), *others), now - 1000.0))
        sink.searching(20.4, 60.0, "3 examples, 1 found")
        now = next(clock) + 30.0
        sink.drawn(3, 7)
    assert stream.getvalue().splitlines() == [
        "4 runs, 4 verdicts planned",
        "[1/4] at work for 30 s: r on s/c",
        "[1/4] at work for 60 s: r on s/c, and 1 other run",
        "[3/7] drawing figures",
    ]


def test_a_suite_that_was_not_finished_has_its_line_at_the_end():
    assert lines(RUN[0], RUN[1], RUN[-1])[1:] == ["[1/3] s: 1 of 2 runs: 1 failed, 1 passed"]


def test_a_line_a_run_where_it_is_verbose():
    assert lines(*RUN, verbose=True)[1:] == ["[1/3] r on s/c: 1 failed, 1 passed", BROKEN]
