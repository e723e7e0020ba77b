"""Continuous contact along drawn ways past corners, what a look at a place costs, and a law that is not its step."""

from __future__ import annotations

from functools import partial
from pathlib import Path as FilePath

import jumping
import numpy as np
import pytest
from honest import Spring
from jumping import HONEST, Late, LawApart, LawWithStep, Moved, Switches
from made import FAIL, PASS, found
from msgspec.structs import replace

from hapticeval.geometry.catalogue import star
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.verdict import Finding, Outcome
from hapticeval.renderers import conformal
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation.playback import Closeup, play
from hapticeval.stimulus.experiments import build_path
from hapticeval.stimulus.stimulus import Path
from hapticeval.suite.reading import load_suite

DT = 1e-3
STAR = Scene(model=star())
CASE = load_suite("thesis").case("cassinian-shallow-slide")


def finding_of(renderer, scene: Scene, path: Path) -> Finding:
    base = play(renderer, path, DT, scene=scene)
    look = Closeup.of(renderer, base, scene)
    runs = Runs(base, refine=lambda k: play(renderer, path, DT / k, scene=scene), look=look)
    return found("continuous-contact", runs, scene)


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
    assert finding_of(conformal(STAR), STAR, past_a_corner(seed)).outcome is PASS


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
    assert finding.outcome is FAIL, finding.message
    assert finding.metric.value >= 0.4e-3


@pytest.mark.parametrize("rule", HONEST)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_memory_is_no_jump(rule, seed):
    finding = finding_of(jumping.factory(rule, inner=conformal)(STAR), STAR, past_a_corner(seed))
    assert finding.outcome is PASS, finding.message


class Counted(Spring):
    count = 0

    def step(self, hip, velocity, dt):
        self.count += 1
        return super().step(hip, velocity, dt)


@pytest.mark.parametrize(("depth", "share"), [(0.0008, 1.1), (0.025, 6.0), (0.035, 8.0)])
def test_a_place_costs_a_small_multiple_of_the_path(depth, share):
    """Without steep places, with nothing else, and with a jump: on the thesis's path at several depths, in 2 s."""
    scene = CASE.build_scene()
    trajectory = replace(CASE.trajectory, depth=depth, duration=2.0)
    renderer = Counted(scene)
    finding = finding_of(renderer, scene, trajectory.path(scene.model.boundary, FilePath()))
    assert finding.outcome is (FAIL if depth > 0.03 else PASS)
    assert renderer.count <= share * 2001


def test_a_law_that_is_not_its_step_breaks_the_contract():
    judged = judge(LawApart, "law-apart", "thesis", CASE)
    assert {verdict.outcome for verdict in judged.verdicts} == {Outcome.ERROR}
    assert judged.error.exit_code == 3
    assert judged.error.tick is not None
    assert judged.error.hip is not None
    assert "law and step() differ" in judged.error.what
    assert judge(LawWithStep, "with-step", "thesis", CASE).error is None
