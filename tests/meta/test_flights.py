"""A tool that is let go at an edge flies to the next face: no pop-through, as a leap while it is pressed is one."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from made import FAIL, PASS

from hapticeval import Response, resolve
from hapticeval.runner.judging import judge
from hapticeval.suite.case import Case

PLANE = {
    "kind": "polygon",
    "vertices": [[-0.05, -0.05], [0.05, -0.05], [0.05, -0.01], [-0.01, -0.01], [-0.01, 0.05], [-0.05, 0.05]],
}
"""Two legs: the lower one ends at x = 5 cm, and above it, from y = -1 cm on, the other one begins at x = -1 cm."""
MODELS = [PLANE, {"kind": "l-block", "thickness": 0.04}]


def finding_of(make, model, check, points, duration):
    """Judge a renderer by one check on a way straight between points (m), in seconds."""
    case = {
        "name": "past-the-edge",
        "title": "Past the edge of a leg",
        "model": model,
        "checks": [check],
        "trajectory": {"kind": "points", "points": points, "duration": duration},
    }
    judged = judge(make, "mine", "flights", msgspec.convert(case, Case))
    assert judged.error is None, judged.error
    return judged.verdicts[0].finding


def continuity(make, model, *, aslant=0.0):
    """Judge whether contact is continuous: in through the end of one leg, deep to the other, and up past the edge."""
    points = [[0.06, -0.03], [-0.02, -0.03], [-0.02 + aslant, 0.01]]
    level = [] if model is PLANE else [0.0]
    return finding_of(make, model, "continuous-contact", [[*point, *level] for point in points], 2.0)


class Leaps:
    """A god-object's answers, but from where the hand is `early` (m) below the edge on: at the other leg already."""

    supports = frozenset({"plane", "space"})
    early, aside = 2e-3, 0.0

    def __init__(self, scene):
        self.proxy, self.stiffness = resolve("constraint")(scene), scene.stiffness

    def reset(self, hip):
        self.proxy.reset(hip)

    def step(self, hip, velocity, dt):
        ihip, force = self.proxy.step(hip, velocity, dt)
        if hip[0] < -0.01 and -0.01 - self.early < hip[1] < 0.0:
            ihip = np.array([-0.01, max(hip[1], -0.01) + self.aside, *hip[2:]])
            force = self.stiffness * (ihip - hip)
        return Response(ihip, force)


class LandsElsewhere(Leaps):
    """One that leaps when the edge is past, and lands 5 mm higher than its flight leads."""

    early, aside = 0.0, 5e-3


@pytest.mark.parametrize("aslant", [0.0, 5e-3, -5e-3])
@pytest.mark.parametrize("model", MODELS, ids=["plane", "space"])
def test_a_god_object_that_flies_from_an_edge_to_the_next_face_is_left_alone(model, aslant):
    finding = continuity(resolve("constraint"), model, aslant=aslant)
    assert finding.outcome is PASS, finding.message


@pytest.mark.parametrize("make", [Leaps, LandsElsewhere])
@pytest.mark.parametrize("model", MODELS, ids=["plane", "space"])
def test_a_leap_while_it_is_pressed_or_to_another_place_is_a_pop_through(model, make):
    finding = continuity(make, model)
    assert finding.outcome is FAIL, finding.message
    assert finding.metric.value > 0.05


@pytest.mark.parametrize("model", MODELS, ids=["plane", "space"])
def test_the_nearest_point_that_jumps_through_the_solid_is_a_pop_through(model):
    finding = continuity(resolve("minimum-distance"), model)
    assert finding.outcome is FAIL, finding.message


class Undeclared:
    """The virtual proxy, a ball of 0.5 mm, that does not declare its radius."""

    supports = frozenset({"space"})

    def __init__(self, scene):
        ball = resolve("virtual-proxy")(scene)
        self.reset, self.step = ball.reset, ball.step


@pytest.mark.parametrize(("make", "expected"), [(resolve("virtual-proxy"), PASS), (Undeclared, FAIL)])
def test_a_ball_touches_the_next_face_while_the_hand_is_yet_outside(make, expected):
    """It grazes the edge of the upper leg, and comes down on the lower one, whose normal is the same."""
    points = [[-0.0129, 0.0558, 0.0178], [0.0185, -0.0128, 0.0227]]
    finding = finding_of(make, MODELS[1], "broken-contact", points, 0.25)
    assert finding.outcome is expected, finding.message
