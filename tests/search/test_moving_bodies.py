"""A search on bodies that move: what is drawn, and that a body that need not move is at rest in what is kept."""

from __future__ import annotations

from itertools import islice

import pytest

from hapticeval.documents import convert
from hapticeval.search.drawing import draw_cases
from hapticeval.search.shrink import SLOWEST_BODY, Shrink
from hapticeval.search.trial import Fault
from hapticeval.suite.case import Case

FAULT = Fault(check="contact-kept", kind="contact-kept", message="it is let go", time=0.3)


def moving(motion):
    path = {"kind": "moves", "start": [0.11, 0.0], "moves": [{"to": [0.09, 0.0], "seconds": 0.5}]}
    entries = {"name": "drawn", "title": "drawn", "model": {"kind": "circle"}, "checks": ["contact-kept"]}
    return convert({**entries, "trajectory": path, "scene": {"damping": 2.0, "motion": motion}}, Case, "case")


def shrunk(case, fails):
    shrink = Shrink(case, FAULT, lambda case: FAULT if fails(case.scene.get("motion")) else None)
    shrink.run()
    return shrink.case.scene


@pytest.mark.parametrize("dimension", [2, 3])
def test_paths_are_drawn_on_bodies_that_slide_and_spin(dimension):
    cases = list(islice(draw_cases([], ("contact-kept",), 0, dimension=dimension, moving=True), 12))
    kinds = {case.scene["motion"]["kind"] for case in cases}
    assert kinds == {"slide", "spin"}
    for case in cases:
        assert case.build_scene().motion.dimension == dimension
    again = islice(draw_cases([], ("contact-kept",), 0, dimension=dimension, moving=True), 12)
    assert [case.scene for case in again] == [case.scene for case in cases]
    assert all(not case.scene for case in islice(draw_cases([], ("contact-kept",), 0, dimension=dimension), 12))


def test_a_fault_that_needs_no_motion_is_kept_with_a_body_at_rest():
    scene = shrunk(moving({"kind": "slide", "velocity": [0.7, -0.31]}), lambda motion: True)
    assert scene == {"damping": 2.0}


def test_a_fault_that_needs_one_is_kept_with_the_slowest_that_shows_it():
    slow = shrunk(
        moving({"kind": "slide", "velocity": [0.73, -0.31]}),
        lambda motion: motion is not None and abs(motion["velocity"][0]) >= 0.1,
    )
    assert slow["motion"]["velocity"][1] == 0.0
    assert 0.1 <= slow["motion"]["velocity"][0] < 0.2
    turned = shrunk(moving({"kind": "spin", "rate": -1.7, "centre": [0.03, 0.0]}), lambda motion: motion is not None)
    assert turned["motion"]["centre"] == [0.0, 0.0]
    assert SLOWEST_BODY <= -turned["motion"]["rate"] < 2.0 * SLOWEST_BODY
