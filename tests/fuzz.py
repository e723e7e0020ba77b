"""Run every property of the tests with fresh seeds, round after round, until the minutes are over.

    make fuzz MINUTES=30
    .venv/bin/python tests/fuzz.py 30 tests/geometry -k polygon     further arguments are pytest's
    .venv/bin/python tests/fuzz.py ideal 11 10000                   the ideal contact in what a search of seed 11 draws
    .venv/bin/python tests/fuzz.py ideal 11 10000 4322              the same from example 4322 on
    .venv/bin/python tests/fuzz.py ideal-in-space 11 10000          the same on solids and surfaces
    .venv/bin/python tests/fuzz.py constraint-in-space 11 10000     the god-object there
    .venv/bin/python tests/fuzz.py ideal-moving 11 10000        both on bodies that slide and spin: constraint-moving
    .venv/bin/python tests/fuzz.py agreement 11 1000            the god-object and the ideal contact, and -in-space
    .venv/bin/python tests/fuzz.py medial-axis 11 1000              pops of the nearest point against brute force

A property that fails is shrunk, listed at the end with the command that repeats it, and left out of the rounds that
follow; hypothesis keeps its smallest example in .hypothesis/examples, and damaged files stay in .hypothesis/kept.
Ctrl-C ends the exploration after the property that is running, as the end of the time does; a second one at once.
Exit codes are pytest's: 0 nothing found, 1 something found, 2 ended by the second Ctrl-C.

The ideal rigid contact fails no check in what a search draws: `ideal` judges it there, and prints each example in which
it does as a case that can be pasted. The god-object on solids fails what a spring fails by a theorem, and jumps where a
rigid tool that follows the hand jumps as far (thesis 4.1.3): nothing else. On bodies that move, `agreement` compares it
with the ideal contact of a tool that weighs next to nothing: but for such jumps they are one (`meta/massless.py`). The
nearest point pops where its path crosses the medial axis, as `meta/medial_axis.py` finds it by brute force, and nowhere
else.
"""

from __future__ import annotations

import itertools
import os
import random
import signal
import sys
import time

import msgspec
import numpy as np
import pytest
from meta.massless import compare
from meta.medial_axis import least_distance_to_focus, worst_crossing

from hapticeval.discovery import resolve
from hapticeval.errors import RefusalError
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.surface import Surface
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Level, Outcome, Verdict
from hapticeval.recordings.recording import Recording
from hapticeval.renderer import RendererFactory
from hapticeval.runner.judging import Judged, judge
from hapticeval.search.drawing import draw_cases, judgeable, judges_paths
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.case import Case

OPTIONS = (
    "-m",
    "hypothesis and not slow",
    "--hypothesis-profile=fuzz",
    "-o",
    "faulthandler_timeout=300",
    # A property that hangs fails, and the rounds go on.
    "-o",
    "timeout_method=signal",
    "-p",
    "no:xdist",
    # What is imported above has imported hypothesis, whose asserts pytest then leaves as they are.
    "-W",
    "ignore::pytest.PytestAssertRewriteWarning",
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


SELDOM = {"numerical-stability", "mirror-image", "vertex-order", "two-at-once", "time-subdivision"}
"""Checks that run an example again up to sixty times, in other scenes: most of the time that one takes."""

SELDOM_EVERY = 7
"""They are asked in each example of this number: prime to the twelve of a model, so that all kinds have their turn."""

ENTRIES = {
    "ideal": ("ideal", 2),
    "ideal-in-space": ("ideal", 3),
    "constraint-in-space": ("constraint", 3),
    "ideal-moving": ("ideal", 2),
    "constraint-moving": ("constraint", 3),
    "agreement": ("constraint@curve", 2),
    "agreement-in-space": ("constraint", 3),
    "medial-axis": ("minimum-distance", 3),
}
"""By entry: the renderer that is judged, and the dimension of what a search draws."""


def jumps_with_rigid_tool(judged: Judged, case: Case, verdict: Verdict) -> bool:
    """Return whether the IHIP jumps where a rigid tool that follows the hand over the mesh does, and no farther."""
    tick, jump = verdict.finding.evidence.get("tick"), verdict.finding.evidence.get("jump_m")
    mesh = case.build_scene().model.boundary
    if verdict.check != "continuous-contact" or jump is None or not isinstance(mesh, Mesh):
        return False
    tools = mesh.rigid_tool(judged.recording.hip)[2]
    return bool(np.linalg.norm(tools[tick] - tools[tick - 1]) > 0.99 * jump)


def pushes_from_afar(recording: Recording, case: Case) -> list[str]:
    """Return where a rigid contact pushes, or is, where it cannot: off the surface throughout a sample, or inside."""
    scene = case.build_scene()
    distance = scene.model.boundary.signed_distance(recording.hip)
    told = [f"the tool is {-distance.min():.3g} m inside"] if distance.min() < -1e-9 and not scene.bilateral else []
    # The force of a row is the mean until the next: it touches within the way of a step from either.
    speed = np.linalg.norm(recording.velocity, axis=1)
    reach = 2.0 * recording.dt * np.maximum(speed[1:], speed[:-1]) + 1e-9
    forces = np.linalg.norm(recording.force, axis=1)[:-1]
    afar = (np.minimum(distance[1:], distance[:-1]) > reach) & (forces > 1e-9)
    return told + [f"the contact pushes from afar at t = {recording.time[row]} s" for row in np.flatnonzero(afar)[:1]]


def wrongs_of_ideal_or_god_object(name: str, judged: Judged, case: Case) -> list[str]:
    """Return what `ideal` or `constraint` shows in an example that it may not show."""
    told = []
    for verdict in judged.verdicts:
        fails = verdict.outcome in (Outcome.FAIL, Outcome.ERROR) and not verdict.inherent
        # What is shown for information alone is no failure: a god-object has a memory.
        if judged.error is None and fails and (name == "ideal" or verdict.level is not Level.INFO):
            if name == "constraint" and jumps_with_rigid_tool(judged, case, verdict):
                continue
            told.append(f"{verdict.check}: {verdict.finding.message}")
    if name == "ideal" and judged.recording is not None:
        told += pushes_from_afar(judged.recording, case)
    return told


def wrongs_of_nearest_point(judged: Judged, case: Case) -> list[str] | None:
    """Return where continuous-contact and brute force differ about a path; None where brute force cannot decide."""
    boundary = case.build_scene().model.boundary
    if judged.recording is None or not isinstance(boundary, Mesh | Surface):
        return None
    (verdict,), hips = judged.verdicts, judged.recording.hip
    crossing, fails = worst_crossing(boundary, hips), verdict.outcome is Outcome.FAIL
    # Near a whole circle of nearest points the map is as steep as one likes: no brute force tells it from a jump.
    near_focus = isinstance(boundary, Surface) and least_distance_to_focus(boundary, hips) < 1e-4
    if crossing is None or near_focus or not crossing.decided:
        return None
    pops = crossing.jump > crossing.allowed
    if fails == pops:
        return []
    return [f"{crossing} by brute force; the verdict: {verdict.outcome}, {verdict.finding.message}"]


def wrongs_of_agreement(god_object: RendererFactory, case: Case) -> list[str] | None:
    """Return where the god-object and the ideal contact part for no reason; None where one refuses the model."""
    scene = case.build_scene()
    path = case.build_stimulus(scene, None)
    assert isinstance(path, Path)
    try:
        return compare(scene, path, god_object, resolve("ideal")).differences
    except RefusalError:
        return None


def wrongs_as_judged(entry: str, renderer: RendererFactory, case: Case) -> list[str] | None:
    """Return what an entry's renderer shows in an example that it may not show; None where that is left open."""
    name, _ = ENTRIES[entry]
    judged = judge(renderer, name, "fuzz", case)
    if judged.error is not None:
        return [f"error: {judged.error.what}"]
    if judged.refusal is not None:
        return None
    if entry == "medial-axis":
        return wrongs_of_nearest_point(judged, case)
    return wrongs_of_ideal_or_god_object(name, judged, case)


def judge_drawn(entry: str, seed: int, count: int, first: int = 1) -> int:
    """Judge an entry's renderer in examples `first` to `count` of a search; return how many show a failure.

    An example that is refused, or that brute force cannot decide, is counted as left out.
    """
    name, dimension = ENTRIES[entry]
    agrees, moving = entry.startswith("agreement"), entry.startswith("agreement") or entry.endswith("-moving")
    renderer, failing, left_out = resolve(name), 0, 0
    asked = ("continuous-contact",) if agrees or entry == "medial-axis" else judgeable()
    if moving:  # in experiments bodies rest
        asked = tuple(name for name in asked if judges_paths(CHECKS[name]))
    cases = draw_cases((), asked, seed, dimension=dimension, moving=moving)
    for number, case in enumerate(itertools.islice(cases, first - 1, count), first):
        if number % SELDOM_EVERY:
            case = msgspec.structs.replace(case, checks=tuple(check for check in case.checks if check not in SELDOM))
        told = wrongs_of_agreement(renderer, case) if agrees else wrongs_as_judged(entry, renderer, case)
        left_out += told is None
        failing += bool(told)
        if told or number % 100 == 0 or number == count:
            print(
                f"seed {seed}: {number} examples, {left_out} left out, {failing} failing, {time.process_time():.0f} s",
                *(told or ()),
                sep="\n  ",
                flush=True,
            )
        if told:
            print(f"  {case!r}", flush=True)
    return failing


if __name__ == "__main__":
    if sys.argv[1] in ENTRIES:
        sys.exit(judge_drawn(sys.argv[1], *map(int, sys.argv[2:5])) > 0)
    sys.exit(pytest.main([*OPTIONS, *sys.argv[2:]], plugins=[Rounds(float(sys.argv[1]))]))
