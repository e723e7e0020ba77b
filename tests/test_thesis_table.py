"""The whole suite on the reference renderers: Table 6.3 comes out of the checks, and every verdict is as published."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hapticeval.discovery import resolve
from hapticeval.phenomena.verdict import Outcome, Verdict
from hapticeval.renderer import Response
from hapticeval.runner.judging import judge
from hapticeval.runner.table import fill_table
from hapticeval.suite.reading import load_suite

SUITE = load_suite("thesis")


@cache
def verdicts(name: str) -> tuple[Verdict, ...]:
    found = []
    for case in SUITE.cases:
        judged = judge(resolve(name), name, SUITE.name, case)
        assert judged.error is None
        found += judged.verdicts
    return tuple(found)


@pytest.mark.parametrize("name", ["minimum-distance", "constraint", "mapping"])
def test_the_columns_of_table_6_3_come_out(name):
    table = fill_table([SUITE], verdicts(name))
    assert {title: cells.get(name) for title, cells in table.items()} == {
        row.title: row.published[name] for row in SUITE.rows
    }


def test_set_stabilisation_is_the_first_to_account_for_centripetal_acceleration():
    """It projects as minimum distance does, and a star has no curvature for it: nothing is said of corners."""
    table = fill_table([SUITE], verdicts("set-stabilisation"))
    assert {title: cells.get("set-stabilisation") for title, cells in table.items()} == {
        "Resists Pop-Through on Curves": "No",
        "Resists Pop-Through on Corners": None,
        "Suitable for LUT": "Yes",
        "Accounts for Centripetal Acceleration": "Yes",
    }


@pytest.mark.parametrize(
    "name", ["minimum-distance", "constraint", "mapping", "conformal", "ideal", "set-stabilisation"]
)
def test_every_verdict_is_as_required_or_as_published(name):
    assert [verdict for verdict in verdicts(name) if not verdict.as_expected] == []


def test_every_published_failure_is_of_a_renderer_that_really_fails():
    """A published outcome that nothing could contradict would be no comparison."""
    published = [v for name in ("minimum-distance", "constraint") for v in verdicts(name) if v.published is not None]
    assert {v.published for v in published} == {Outcome.PASS, Outcome.FAIL}
    assert all(v.finding.metric is not None for v in published)


def judged_outcomes(make, case_name):
    case = next(case for case in SUITE.cases if case.name == case_name)
    return {v.check: v for v in judge(make, "mine", "thesis", case).verdicts}


class Single:
    """A renderer that computes and answers in single precision."""

    def __init__(self, inner):
        self.inner = inner

    def reset(self, hip):
        self.inner.reset(hip)

    def step(self, hip, velocity, dt):
        answer = self.inner.step(hip, velocity, dt)
        return Response(*(np.asarray(part, dtype=np.float32) for part in answer))


class Late:
    """A proxy whose IHIP is a tick late, with a spring to the present HIP, as peers have it."""

    def __init__(self, inner, stiffness, ticks=1):
        self.inner, self.stiffness, self.ticks = inner, stiffness, ticks

    def reset(self, hip):
        self.inner.reset(hip)
        self.kept = []

    def step(self, hip, velocity, dt):
        self.kept.append(self.inner.step(hip, velocity, dt).ihip)
        ihip = self.kept[-1 - min(self.ticks, len(self.kept) - 1)]
        touching = np.any(self.kept[-1] != hip)
        return Response(ihip if touching else hip, self.stiffness * (ihip - hip) if touching else 0.0 * hip)


@pytest.mark.parametrize(
    ("case", "check"),
    [
        ("star-convex-corner", "continuous-contact"),
        ("star-convex-corner", "broken-contact"),
        ("star-concave-corner", "contact-normal-force"),
        ("plane-press", "contact-normal-force"),
    ],
)
def test_single_precision_costs_no_verdict(case, check):
    outcomes = judged_outcomes(lambda scene: Single(resolve("constraint")(scene)), case)
    assert outcomes[check].outcome is Outcome.PASS, outcomes[check].finding.message


def test_single_precision_still_flies_before_it_hits():
    outcomes = judged_outcomes(lambda scene: Single(resolve("constraint")(scene)), "plane-impact")
    assert outcomes["impulsive-collision"].outcome is Outcome.FAIL


@pytest.mark.parametrize("ticks", [1, 3])
@pytest.mark.parametrize(
    ("case", "check", "base"),
    [
        ("cassinian-shallow-slide", "contact-normal-force", "constraint@curve"),
        ("cassinian-shallow-slide", "continuous-contact", "constraint@curve"),
        ("star-convex-corner", "broken-contact", "constraint"),
        ("cassinian-deep-slide", "memoryless", "minimum-distance"),
    ],
)
def test_a_proxy_that_is_late_costs_no_verdict(case, check, base, ticks):
    outcomes = judged_outcomes(lambda scene: Late(resolve(base)(scene), scene.stiffness, ticks), case)
    assert outcomes[check].outcome is Outcome.PASS, outcomes[check].finding.message


def test_a_claimed_standoff_is_no_licence():
    def claiming(scene):
        inner = resolve("minimum-distance")(scene)
        wrapped = Single(inner)
        wrapped.standoff, wrapped.resolution = 1.0, 10.0
        return wrapped

    assert judged_outcomes(claiming, "star-convex-corner")["continuous-contact"].outcome is Outcome.FAIL
    assert judged_outcomes(claiming, "star-convex-corner")["broken-contact"].outcome is Outcome.FAIL


def test_a_force_without_a_contact_point_is_not_called_continuous():
    class ForceOnly(Single):
        def step(self, hip, velocity, dt):
            return Response(hip, self.inner.step(hip, velocity, dt).force)

    outcomes = judged_outcomes(lambda scene: ForceOnly(resolve("minimum-distance")(scene)), "cassinian-deep-slide")
    assert outcomes.pop("passivity").outcome is Outcome.PASS, "a force alone does work"
    assert {v.outcome for v in outcomes.values()} == {Outcome.INCONCLUSIVE}
    assert not outcomes["continuous-contact"].as_expected
