"""Checks of friction: honest renderers pass them, and what a wrong law does is seen; the rest is in the kill matrix."""

from __future__ import annotations

import honest
import numpy as np
import pytest
import rubbing
from made import FAIL, NO, PASS, UNDECIDED, changed, recorded

from hapticeval.discovery import resolve
from hapticeval.effects.friction import Friction
from hapticeval.effects.lugre import LuGre
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

FRICTION = [name for name in OWN_CHECKS if name.startswith("friction-")]
DRY = [name for name in FRICTION if Friction.kind in OWN_CHECKS[name].effects]
QUICK = ("plane-to-and-fro", "plane-press", "viscous-plane")
SCENE = Scene(model=make_model("line"), effects=(Friction(0.5, 0.3),))


def laps(depth=1e-3, reach=0.01, laps=3, speed=0.04):
    """Into a plane and `laps` times to and fro: a path in whole ticks at 40 mm/s."""
    points = [[0.0, depth], [0.0, -depth], *([[reach, -depth], [-reach, -depth]] * laps), [-reach, depth]]
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return Path(np.concatenate([[0.0], np.cumsum(length / speed)]), np.array(points))


def led(scene, path=None, renderer="minimum-distance"):
    made = make_renderer(resolve(renderer), scene)
    return play(made, path or laps(), scene.sampling_time, scene=scene)


def outcome(check, run, scene=SCENE):
    return OWN_CHECKS[check](Runs(run), scene).outcome


@pytest.mark.parametrize("name", ["lists", "standoff", "sunk"])
def test_no_honest_renderer_is_blamed(name):
    """At a distance friction is what the scene's law makes it; late and in single precision, see the kill matrix."""
    for case in map(rubbing.CASES.get, QUICK):
        found = judge(honest.factory(name, rubbing.Rubbing), name, "effects-friction", case)
        assert {v.check: v.outcome for v in found.verdicts} == dict.fromkeys(case.checks, PASS), case.name


def test_a_force_without_an_ihip_decides_nothing():
    found = judge(honest.factory("force-only", rubbing.Rubbing), "", "", rubbing.CASES["plane-to-and-fro"])
    assert {verdict.outcome for verdict in found.verdicts} == {UNDECIDED}


@pytest.mark.parametrize("check", FRICTION)
def test_a_scene_without_friction_is_not_asked(check):
    plain = Scene(model=make_model("line"))
    assert outcome(check, led(plain), plain) is NO


@pytest.mark.parametrize("check", DRY)
def test_a_hand_that_never_touches_or_only_presses_decides_nothing(check):
    away = recorded(np.full((50, 2), 0.01))
    assert outcome(check, away) is UNDECIDED
    press = Path(np.array([0.0, 0.05, 2.0]), np.array([[0.0, 1e-3], [0.0, -1e-3], [0.0, -1e-3]]))
    assert outcome(check, led(SCENE, press)) is (PASS if check == "friction-energy" else UNDECIDED)


def test_a_frictionless_renderer_that_claims_friction_is_found():
    plain = led(Scene(model=make_model("line")))
    assert outcome("friction-sliding", plain) is FAIL
    assert outcome("friction-work", plain) is FAIL


@pytest.mark.parametrize(("mu_s", "expected"), [(0.539, PASS), (0.541, FAIL)])
def test_what_breaks_loose_too_early_is_found(mu_s, expected):
    """The tool slides from 0.46 on in the tick before, and a hand of 40 mm/s leaves 2 K |dx| = 0.08 N of it open."""
    assert outcome("friction-break-away", led(SCENE), SCENE.with_effects(Friction(mu_s, 0.3))) is expected


@pytest.mark.parametrize(("speed", "expected"), [(0.0499, PASS), (0.0501, UNDECIDED)])
def test_a_hand_that_moves_too_fast_shows_no_break_away(speed, expected):
    """From 50 mm/s on 0.1 N are open: half of what mu_k F_n = 0.3 N lacks of 0.5 N."""
    assert outcome("friction-break-away", led(SCENE, laps(speed=speed))) is expected


@pytest.mark.parametrize(("factor", "expected"), [(1.0 + 1e-15, PASS), (1.001, FAIL), (0.999, FAIL)])
def test_a_viscous_force_is_exact(factor, expected):
    scene = Scene(model=make_model("line"), effects=(ViscousFriction(4.0),))
    assert outcome("friction-force", led(scene), scene.with_effects(ViscousFriction(4.0 * factor))) is expected


def test_a_law_that_rounding_hides_or_that_is_never_asked_decides_nothing():
    scene = Scene(model=make_model("line"), effects=(ViscousFriction(4.0),))
    press = Path(np.array([0.0, 0.05, 1.0]), np.array([[0.0, 1e-3], [0.0, -1e-3], [0.0, -1e-3]]))
    assert outcome("friction-force", led(scene, press), scene) is UNDECIDED
    assert outcome("friction-force", recorded(np.full((50, 2), 0.01)), scene) is UNDECIDED
    damped = Scene(model=make_model("line"), damping=1.0, effects=scene.effects)
    assert outcome("friction-force", led(damped), damped) is NO


@pytest.mark.parametrize("factor", [0.998, 1.002])
@pytest.mark.parametrize("effect", [Friction(0.5, 0.5), Friction(0.5, 0.3), ViscousFriction(4.0)])
def test_two_thousandths_of_the_work_are_found(effect, factor):
    """The same run in a scene whose friction is 0.2 % off."""
    scene = Scene(model=make_model("line"), effects=(effect,))
    run = led(scene)
    assert outcome("friction-work", run, scene) is PASS
    if isinstance(effect, Friction):
        other = Friction(effect.mu_s * max(factor, 1.0), effect.mu_k * factor)
    else:
        other = ViscousFriction(effect.coefficient * factor)
    assert outcome("friction-work", run, scene.with_effects(other)) is FAIL


def test_the_work_of_bristles_is_found():
    law = {"stribeck": 5e-3, "stiffness": 5e3, "damping": 2.0, "viscosity": 2.0}
    scene = Scene(model=make_model("line"), effects=(LuGre(0.5, 0.3, **law),))
    run = led(scene)
    assert outcome("friction-work", run, scene) is PASS
    assert outcome("friction-work", run, scene.with_effects(LuGre(0.5, 0.305, **law))) is FAIL


@pytest.mark.parametrize("angle", [1e-3, -1e-3])
def test_a_brake_that_points_aside_is_found(angle):
    scene = Scene(model=make_model("sphere"), effects=(Friction(0.5, 0.3),))
    path = Path(np.array([0.0, 0.1, 1.1]), np.array([[0.101, 0.0, 0.0], [0.0985, 0.0, 0.0], [0.09, 0.03, 0.01]]))
    run = led(scene, path)
    assert outcome("friction-sliding", run, scene) is PASS
    normal = scene.model.boundary.closest_point(run.ihip).normal
    turned = run.force * np.cos(angle) + np.cross(normal, run.force) * np.sin(angle)
    across = np.sum(run.force * normal, axis=1)[:, np.newaxis] * normal * (1.0 - np.cos(angle))
    assert outcome("friction-sliding", changed(run, force=turned + across), scene) is FAIL
