"""Run every property of the tests with fresh seeds, round after round, until the minutes are over.

    make fuzz MINUTES=30
    .venv/bin/python tests/fuzz.py 30 tests/geometry -k polygon     further arguments are pytest's
    .venv/bin/python tests/fuzz.py ideal 11 10000                   the ideal contact in what a search of seed 11 draws
    .venv/bin/python tests/fuzz.py ideal 11 10000 4322              the same from example 4322 on

A property that fails is shrunk, listed at the end with the command that repeats it, and left out of the rounds that
follow; hypothesis keeps its smallest example in .hypothesis/examples, and damaged files stay in .hypothesis/kept.
Ctrl-C ends the exploration after the property that is running, as the end of the time does; a second one at once.
Exit codes are pytest's: 0 nothing found, 1 something found, 2 ended by the second Ctrl-C.

The ideal rigid contact fails no check in what a search draws: `ideal` judges it there, and prints each example in which
it does as a case that can be pasted.
"""

from __future__ import annotations

import itertools
import os
import random
import signal
import sys
import time

import pytest

OPTIONS = (
    "-m",
    "hypothesis and not slow",
    "--hypothesis-profile=fuzz",
    "-o",
    "faulthandler_timeout=300",
    "-p",
    "no:xdist",
)


class Rounds:
    """A pytest plugin that runs the collected tests again and again, in a new order each time."""

    def __init__(self, minutes: float) -> None:
        self.seconds = 60.0 * minutes
        self.found: list[str] = []
        self.stopped = False
        self.terminal = os.dup(2)  # what tests print is caught

    def interrupted(self, *_: object) -> None:
        """Not an exception: a command that is being tested would take it for its own."""
        signal.signal(signal.SIGINT, signal.default_int_handler)
        self.stopped = True
        os.write(self.terminal, b"\ninterrupted: ending after this property; Ctrl-C again ends at once\n")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool | None:
        if session.testsfailed or session.config.option.collectonly:
            return None
        self.write = session.config.get_terminal_writer().line
        modules = {item.path: [each for each in session.items if each.path == item.path] for item in session.items}
        end = time.monotonic() + self.seconds
        signal.signal(signal.SIGINT, self.interrupted)
        for number in itertools.count(1):
            order = [item for path in random.sample(list(modules), len(modules)) for item in modules[path]]
            order = [item for item in order if item.nodeid not in self.found]
            if not order:
                return True
            left = (end - time.monotonic()) / 60.0
            self.write(f"\nround {number}: {len(order)} properties, {left:.1f} minutes left, {len(self.found)} found")
            for item, following in itertools.pairwise([*order, None]):
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
                if self.stopped or time.monotonic() >= end:
                    return True
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and report.nodeid not in self.found:
            self.found.append(report.nodeid)
            self.write(f"found: {report.nodeid}", flush=True)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        terminalreporter.section(f"{len(self.found)} properties fail")
        for nodeid in self.found:
            terminalreporter.line(f"repeat: .venv/bin/pytest --hypothesis-profile=fuzz '{nodeid}'")


def judge_ideal(seed: int, count: int, first: int = 1) -> int:
    """Judge the ideal rigid contact in examples `first` to `count` of a search; return how many show a failure."""
    from hapticeval.discovery import resolve
    from hapticeval.phenomena.verdict import Outcome
    from hapticeval.runner.judging import judge
    from hapticeval.search.drawing import draw_cases, judgeable

    ideal, failing = resolve("ideal"), 0
    for number, case in enumerate(itertools.islice(draw_cases((), judgeable(), seed), first - 1, count), first):
        judged = judge(ideal, "ideal", "fuzz", case)
        told = [] if judged.error is None else [f"error: {judged.error.what}"]
        for verdict in judged.verdicts:
            if judged.error is None and verdict.outcome in (Outcome.FAIL, Outcome.ERROR):
                told.append(f"{verdict.check}: {verdict.finding.message}")
        failing += bool(told)
        if told or number % 100 == 0 or number == count:
            print(
                f"seed {seed}: {number} examples, {failing} failing, {time.process_time():.0f} s",
                *told,
                sep="\n  ",
                flush=True,
            )
        if told:
            print(f"  {case!r}", flush=True)
    return failing


if __name__ == "__main__":
    if sys.argv[1:2] == ["ideal"]:
        sys.exit(judge_ideal(*map(int, sys.argv[2:5])) > 0)
    sys.exit(pytest.main([*OPTIONS, *sys.argv[2:]], plugins=[Rounds(float(sys.argv[1]))]))
