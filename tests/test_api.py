"""Judging from Python: names, classes and instances, in memory or into a folder, and what the results give."""

import signal
import threading

import numpy as np
import pytest
from honest import Spring
from slides import CASES, HEAD

import hapticeval
from hapticeval import InputError, NothingSelectedError, UnknownNameError
from hapticeval.runner.events import JobFinished


class Nearest(Spring):
    """A renderer that nobody registered."""


SUITE = (
    HEAD
    + CASES["flat"]
    + CASES["flat-back"]
    + """
[[row]]
title = "Slides"
check = "continuous-contact"
cases = ["*"]
published = { Nearest = "No" }
"""
)


@pytest.fixture
def suite(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(SUITE)
    return hapticeval.load_suite("mine.toml")


def test_a_class_is_judged_in_memory_and_leaves_no_file(refused, suite, tmp_path):
    before = set(tmp_path.iterdir())
    results = hapticeval.run(Nearest, suites=suite)
    assert (results.complete, results.exit_code) == (True, 0)
    frame = results.frame()
    assert list(frame.case) == ["flat", "flat", "flat-back"]
    assert set(frame.renderer) == {"Nearest"}
    assert set(frame.outcome) == {"pass"}
    assert (frame.margin.dropna() == (frame.bound - frame.value).dropna()).all()
    assert results.table().to_dict() == {"Nearest": {"Slides": "Yes"}}
    recording = results.recording("mine/flat")
    assert recording.meta["case"] == "flat"
    assert len(recording) == 201
    assert results.plot("flat").get_suptitle() == "Nearest on mine/flat"
    with refused(InputError):
        results.plot()
    alone = hapticeval.run(Nearest, suites=suite, select="flat-back")
    assert alone.recording().meta["case"] == "flat-back"
    page = results._repr_html_()
    assert page.count("<table") == 2
    assert "Results of Nearest: 2 passed, 1 shown and not judged" in page
    assert set(tmp_path.iterdir()) == before
    with refused(InputError):
        results.report()


def test_a_class_has_the_verdicts_of_its_name(refused, suite, tmp_path, monkeypatch):
    """By name it runs in processes and into a folder, which can be read and reported on later."""
    hapticeval.run({"constraint": "constraint", "of-mine": Nearest}, suites="mine.toml", output="out")
    again = hapticeval.Results.read("out")
    assert set(again.frame().renderer) == {"constraint", "of-mine"}
    alone = hapticeval.run(["constraint", Nearest], suites=[suite])
    names = ["case", "check", "outcome", "value", "bound"]
    assert again.frame()[names].equals(alone.frame()[names])
    np.testing.assert_array_equal(again.recording("flat", "of-mine").force, alone.recording("flat", "Nearest").force)
    assert {path.name for path in again.report()} == {"results.json", "table.md", "junit.xml", "index.html", "tables"}
    with refused(InputError):
        hapticeval.run(Nearest, suites=suite, output=tmp_path)


def test_instances_factories_and_names_are_renderers_too(suite):
    made = Nearest(suite.case("flat").build_scene())

    def factory(scene):
        return Nearest(scene)

    results = hapticeval.run(
        {"made": made, "factory": factory, "constraint": "constraint"}, suites=suite, select="flat"
    )
    assert set(results.frame().groupby("renderer").outcome.unique().map(tuple)) == {("pass",)}
    assert list(hapticeval.run(factory, suites=suite, select="flat-back").frame().renderer) == ["factory"]


def test_one_renderer_is_judged_in_cases_of_any_suite_or_of_ones_own(suite):
    results = hapticeval.judge("constraint", cases=["thesis/plane-press"], workers=0)
    assert set(results.frame().suite) == {"thesis"}
    assert results.exit_code == 0
    own = hapticeval.judge(Nearest, cases=[suite.case("flat-back")])
    assert [(verdict.case, verdict.outcome) for verdict in own.verdicts] == [("flat-back", "pass")]


def test_what_breaks_is_in_the_results(refused, suite):
    class Breaks(Nearest):
        def step(self, hip, velocity, dt):
            raise OSError("the sensor is gone")

    results = hapticeval.run(Breaks, suites=suite)
    assert results.exit_code == 3
    assert set(results.frame().outcome) == {"error"}
    with refused(InputError):
        results.recording("flat")


@pytest.mark.parametrize(
    ("call", "kind"),
    [
        (lambda suite: hapticeval.run(3, suites=suite), InputError),
        (lambda suite: hapticeval.run([Nearest, type("Nearest", (), {})]), InputError),
        (lambda suite: hapticeval.run("constrait", suites=suite), UnknownNameError),
        (lambda suite: hapticeval.run(Nearest, suites="thesys"), UnknownNameError),
        (lambda suite: hapticeval.run(Nearest, suites=3), InputError),
        (lambda suite: hapticeval.run(Nearest, suites=suite, select="flta"), NothingSelectedError),
        (lambda suite: hapticeval.run(Nearest, suites=suite, select=3), InputError),
        (lambda suite: hapticeval.run(Nearest, suites=suite, seed=-1), InputError),
        (lambda suite: hapticeval.run(Nearest, suites=suite, workers=1.5), InputError),
        (lambda suite: hapticeval.run(lambda scene: 1, suites=suite, workers=2), InputError),
        (lambda suite: hapticeval.judge(Nearest, cases=["a", suite.cases[0]]), InputError),
    ],
)
def test_what_cannot_be_meant_is_refused(refused, suite, call, kind):
    with refused(kind):
        call(suite)


def test_a_run_is_found_by_its_names(refused, suite):
    results = hapticeval.run(["constraint", "minimum-distance"], suites=suite, select="flat", workers=0)
    assert len(results.recording("flat", "constraint")) == 201
    for names in (("flat",), ("flta",), ("flat", "constrain")):
        with refused(InputError):
            results.recording(*names)


def test_ctrl_c_keeps_what_is_finished(suite):
    class Waits(Nearest):
        def step(self, hip, velocity, dt):
            if hip[0] == 0.02:
                signal.raise_signal(signal.SIGINT)
                threading.Event().wait(60.0)
            return super().step(hip, velocity, dt)

    events = []
    results = hapticeval.run(Waits, suites=suite, watch=events.append)
    assert sum(isinstance(event, JobFinished) for event in events) == 1
    assert (results.complete, results.stopped, results.exit_code) == (False, True, 1)
    assert [verdict.case for verdict in results.verdicts] == ["flat", "flat"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
