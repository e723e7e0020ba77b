"""Continuous contact on renderers that are led: what jumps is found, whatever its memory, and what does not is not."""

from __future__ import annotations

from functools import partial
from pathlib import Path as FilePath

import jumping
import numpy as np
import pytest
from honest import Spring
from jumping import BROKEN, HONEST, Bends, Late, LawApart, LawWithStep, LetsGo, Moved, Rises, Switches, single
from msgspec.structs import replace

from hapticeval.geometry.catalogue import circle, make_model, star
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import CHECKS
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.renderers import conformal
from hapticeval.runner.judging import judge as judge_case
from hapticeval.scene import Scene
from hapticeval.simulation.playback import Closeup, play
from hapticeval.stimulus.experiments import build_path
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.reading import load_suite

DT = 1e-3
ROUND = Scene(model=circle())
ANGLES = np.radians(np.linspace(60.0, 77.0, 2000))
ARC = Path(np.linspace(0.0, 0.42, ANGLES.size), 0.09 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]))
"""10 mm under a circle, 30 mm far along it: so deep, a map may take the contact point 100 mm aside."""
STAR = Scene(model=star())


def finding_of(renderer, scene: Scene, path: Path) -> Finding:
    base = play(renderer, path, DT, scene=scene)
    look = Closeup.of(renderer, base, scene)
    runs = Runs(base, refine=lambda k: play(renderer, path, DT / k, scene=scene), look=look)
    return CHECKS["continuous-contact"](runs, scene)


def past_a_corner(seed: int, scene: Scene = STAR) -> Path:
    """Straight through a tip from wall to wall, or along a wall and on past the tip, somewhere inside."""
    rng = np.random.default_rng(seed)
    corners = [corner for corner in scene.model.curve.corners if corner.convex]
    corner = corners[rng.integers(len(corners))]
    if rng.random() < 0.3:
        spec = {
            "kind": "corner",
            "corner": scene.model.curve.corners.index(corner),
            "depth": rng.uniform(0.002, 0.015),
            "before": rng.uniform(0.02, 0.03),
            "after": 0.012,
            "duration": rng.uniform(0.3, 1.5),
        }
        return build_path(spec, scene.model.boundary, FilePath())
    walls = corner.position + np.outer(rng.uniform(0.008, 0.035, 2), [1.0, 1.0]) * [
        -corner.tangent_pre,
        corner.tangent_post,
    ]
    shares = np.sort(rng.uniform([0.05, 0.75], [0.25, 0.95]))
    ends = walls[0] + shares[:, np.newaxis] * (walls[1] - walls[0])
    if rng.random() < 0.5:
        ends = ends[::-1]
    length = float(np.linalg.norm(ends[1] - ends[0]))
    return Path(np.array([0.0, length / rng.uniform(0.02, 0.2)]), ends)


FEW = range(2)
MANY = [pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 200)]


@pytest.mark.parametrize("seed", [*FEW, *MANY])
def test_a_conformal_map_is_continuous_past_any_corner(seed):
    """Hoelder of order 1/3 at each tip of 60 degrees, whose bisector the hand crosses."""
    assert finding_of(conformal(STAR), STAR, past_a_corner(seed)).outcome is Outcome.PASS


@pytest.mark.parametrize("seed", [*FEW, *MANY])
def test_no_jump_of_half_a_millimetre_is_missed_beside_a_corner(seed):
    rng = np.random.default_rng(1000 + seed)
    size = rng.uniform(0.5e-3, 3e-3)
    path = past_a_corner(seed)
    answered = play(conformal(STAR), path, DT, scene=STAR)
    touched = np.flatnonzero(answered.contact)
    curve = STAR.model.curve
    s = np.unwrap(curve.arc_length(curve.nearest(answered.ihip[touched])), period=curve.length)
    way = np.abs(s - s[0])
    rule = partial(Switches, size, float(rng.uniform(0.1, 0.9) * way.max()), float(s[0]), curve.length)
    jumper = Moved(STAR, rng.choice([rule, lambda: Late(2, rule())]), conformal)
    finding = finding_of(jumper, STAR, path)
    assert finding.outcome is Outcome.FAIL, finding.message
    assert finding.metric.value >= 0.4e-3


@pytest.mark.parametrize("rule", HONEST)
def test_a_memory_is_no_jump(rule):
    assert finding_of(jumping.factory(rule)(ROUND), ROUND, ARC).outcome is Outcome.PASS
    for seed in (1, 2):
        finding = finding_of(jumping.factory(rule, inner=conformal)(STAR), STAR, past_a_corner(seed))
        assert finding.outcome is Outcome.PASS, finding.message


@pytest.mark.parametrize(
    ("kind", "rule"),
    [*((Moved, rule) for rule in BROKEN), (single, "switches")],
)
def test_a_jump_is_found(kind, rule):
    finding = finding_of(jumping.factory(rule, kind)(ROUND), ROUND, ARC)
    assert finding.outcome is Outcome.FAIL
    assert ("depends on the sampling rate" in finding.message) == ("pop" in rule)
    assert finding.metric.value == pytest.approx(0.01 if "pop" in rule else 0.5e-3, abs=1.2e-4)


@pytest.mark.parametrize(
    ("kind", "exponent"),
    [(Moved, 1 / 2), (single, 1 / 6), (single, 1 / 3)],
)
def test_a_hoelder_map_from_one_sixth_on_is_continuous(kind, exponent):
    finding = finding_of(kind(ROUND, partial(Bends, exponent)), ROUND, ARC)
    assert finding.outcome is Outcome.PASS, finding.message


@pytest.mark.parametrize("exponent", [0.05, 0.13])
def test_below_it_is_steep_and_not_broken(exponent):
    finding = finding_of(Moved(ROUND, partial(Bends, exponent)), ROUND, ARC)
    assert finding.outcome is Outcome.INCONCLUSIVE
    assert finding.message.startswith("steep")
    assert finding.evidence["slope"] == pytest.approx(exponent, abs=0.02)
    assert f"in a HIP step {finding.evidence['refinements'][-1]} times finer than the path's" in finding.message


@pytest.mark.parametrize("over", [0.1, 0.5])
def test_a_jump_rounded_over_less_than_coordinates_resolve_stays(over):
    """As a share of 5e-8 m, to which single precision holds the path's coordinates."""
    finding = finding_of(Moved(ROUND, partial(Rises, 5e-8 * over)), ROUND, ARC)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("over", [3.0, 10.0, 30.0, 1000.0])
def test_a_rise_over_more_than_coordinates_resolve_is_continuous(over):
    finding = finding_of(Moved(ROUND, partial(Rises, 5e-8 * over)), ROUND, ARC)
    assert finding.outcome is Outcome.PASS, finding.message


@pytest.mark.parametrize("kind", ["cassinian", "dumbbell"])
def test_a_conformal_map_is_continuous_a_micrometre_beside_its_centre(kind):
    """The contact point goes half round the model within a few micrometres of the hand's way."""
    scene = Scene(model=make_model(kind, size=0.1))
    along, across = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    path = Path([0.0, 0.4], 1e-6 * across + np.outer([-0.08, 0.08], along))
    finding = finding_of(conformal(scene), scene, path)
    assert finding.outcome is Outcome.PASS, finding.message
    assert "steep" in finding.message


def test_a_jump_in_the_middle_of_a_steep_place_is_found():
    """Exponent 1/2, and half a millimetre more on the far side."""

    class Both(Bends):
        def __call__(self, s, tick, dt):
            moved = super().__call__(s, tick, dt)
            return moved + 0.5e-3 * (s > self.begun + self.at)

    finding = finding_of(Moved(ROUND, partial(Both, 0.5)), ROUND, ARC)
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value == pytest.approx(0.5e-3, rel=0.1)


def test_a_jump_at_the_origin_is_looked_at_no_closer_than_elsewhere():
    """The centre of a circle, where every direction is as near."""
    finding = finding_of(Spring(ROUND), ROUND, Path([0.0, 0.02], [[0.0, 0.001], [0.0, 0.0]]))
    assert finding.outcome is Outcome.FAIL
    assert finding.metric.value > 0.1


class Counted(Spring):
    count = 0

    def step(self, hip, velocity, dt):
        self.count += 1
        return super().step(hip, velocity, dt)


@pytest.mark.parametrize(("depth", "share"), [(0.0008, 1.1), (0.025, 6.0), (0.035, 8.0)])
def test_a_place_costs_a_small_multiple_of_the_path(depth, share):
    """Without steep places, with nothing else, and with a jump: on the thesis's path at several depths, in 2 s."""
    case = next(case for case in load_suite("thesis").cases if case.name == "cassinian-shallow-slide")
    scene = case.build_scene()
    trajectory = replace(case.trajectory, depth=depth, duration=2.0)
    renderer = Counted(scene)
    finding = finding_of(renderer, scene, trajectory.path(scene.model.boundary, FilePath()))
    assert finding.outcome is (Outcome.FAIL if depth > 0.03 else Outcome.PASS)
    assert renderer.count <= share * 2001


@pytest.mark.parametrize("name", ["star-concave-corner", "cassinian-shallow-slide"])
def test_a_law_that_is_not_its_step_breaks_the_contract(name):
    case = next(case for case in load_suite("thesis").cases if case.name == name)
    judged = judge_case(LawApart, "law-apart", "thesis", case)
    assert {verdict.outcome for verdict in judged.verdicts} == {Outcome.ERROR}
    assert judged.error.exit_code == 3
    assert judged.error.tick is not None
    assert judged.error.hip is not None
    assert "law and step() differ" in judged.error.what
    assert judge_case(LawWithStep, "with-step", "thesis", case).error is None


@pytest.mark.parametrize("name", ["cassinian-shallow-slide", "ellipse-slide", "circle-slide"])
def test_what_is_judged_is_what_drives_the_hardware(name):
    """Its `run` is right: it is not asked."""
    case = next(case for case in load_suite("thesis").cases if case.name == name)
    judged = judge_case(LetsGo, "lets-go", "thesis", case)
    assert not all(verdict.as_expected for verdict in judged.verdicts)
    assert {v.check for v in judged.verdicts if v.outcome is Outcome.FAIL} >= {"contact-kept"}
