"""Who is late by one number of ticks is not blamed, whole or between; a latency that changes hides nothing."""

from __future__ import annotations

import numpy as np
import pytest
from asked import finding, verdicts
from honest import declaring
from hypothesis import example, given, settings
from hypothesis import strategies as st
from latecomers import LateTool, late
from made import FAIL, PASS, UNDECIDED
from msgspec.structs import replace
from outsiders import CASES, LED, case

from hapticeval.discovery import resolve
from hapticeval.renderer import Spring
from hapticeval.suite.case import Case


@settings(max_examples=8)
@given(ihip=st.floats(0.0, 3.0), force=st.floats(0.0, 3.0))
def test_channels_that_are_late_by_themselves_do_not_change_the_direction(ihip, force):
    said = finding(late(ihip=ihip, force=force), "slide", "contact-normal-force")
    assert said.outcome is PASS, said.message


def tiny(size: float) -> Case:
    slide = CASES["slide"]
    points = (np.array(slide.trajectory.points) * size / 0.2).tolist()
    return replace(slide, model={"kind": "circle", "size": size}, trajectory=replace(slide.trajectory, points=points))


def outcomes(make, place):
    return {check: verdict.outcome for check, verdict in verdicts(make, place).items()}


@pytest.mark.parametrize("name", ["ideal", "minimum-distance", "constraint"])
def test_no_verdict_depends_on_the_size_of_everything(name):
    """The force floor goes with the model's size, as all tolerances do."""
    small, usual, large = (outcomes(resolve(name), tiny(size)) for size in (1e-6, 0.2, 1e3))
    assert small == usual == large
    assert {usual[check] for check in ("contact-kept", "continuous-contact", "contact-normal-force")} == {PASS}


SQUARE = {"kind": "polygon", "vertices": [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]}
RELEASE = case(
    "release",
    SQUARE,
    LED,
    trajectory={
        "kind": "points",
        "points": [[0.06, 0.11], [0.07, 0.095], [0.105, 0.095], [0.12, 0.095]],
        "duration": 0.4,
    },
)
"""5 mm under a face and out past its edge: the tool is free there, and the hand 5 mm away from it."""


TOOL = resolve("constraint")


@pytest.mark.parametrize(
    "ticks", [{}, {"force": 1.0}, {"force": 3.0}, {"ihip": 1.0}, {"ihip": 3.0}, {"ihip": 2.0, "force": 2.0}], ids=str
)
def test_after_a_release_a_channel_has_three_ticks_to_end_the_contact_too(ticks):
    checks = ("contact-kept", "continuous-contact", "contact-normal-force", "memoryless", "reset-clears")
    prompt = verdicts(late(TOOL), RELEASE, *checks)
    for check, verdict in verdicts(late(TOOL, **ticks), RELEASE, *checks).items():
        assert verdict.outcome in (prompt[check].outcome, UNDECIDED), verdict.finding.message


@pytest.mark.parametrize("ticks", [{"ihip": 5.0}, {"force": 5.0}], ids=str)
def test_more_than_three_ticks_are_a_fault(ticks):
    assert FAIL in outcomes(late(TOOL, **ticks), RELEASE).values()


lags = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.0, 3.0))


@settings(max_examples=8)
@given(ihip=lags, force=lags, tool=lags)
# Between two ticks a place on a circle is off the straight line, by more than rounding.
@example(ihip=1.5, force=0.0, tool=0.0)
def test_a_declared_spring_may_be_late_by_one_number_of_ticks_a_channel(ihip, force, tool):
    for make in (late(ihip=ihip, force=ihip), late(force=force), late(ihip=ihip), late(kind=LateTool, ihip=tool)):
        for place in ("slide", "press"):
            said = finding(declaring(make, spring=Spring.ERROR), place, "force-magnitude")
            assert said.outcome is PASS, said.message


def test_a_run_that_ends_in_contact_does_not_know_what_a_late_ihip_would_have_been():
    for ticks in (0.5, 1.0, 3.0):
        said = finding(declaring(late(ihip=ticks), spring=Spring.ERROR), "solids/cube-cut-off", "force-magnitude")
        assert said.outcome is PASS, said.message
