"""The passive renderers in a sampled loop: largest stable stiffness, what random pushes gain, chatter in a notch.

The numbers of docs/continuous-and-passive.md are those of `pushed` for 30 seeds and of `chatter`.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from leading import led

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import cassinian, ellipse, star
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment
from hapticeval.study.limits.loop import Place, SampledLoop, robot_at
from hapticeval.study.limits.search import eigenvalue_limit, family_of

K, T, MASS = 1000.0, 1e-3, 0.1
MODELS = {each.name: each for each in (cassinian(), ellipse(), star())}
NAMES = {
    "minimum-distance": "minimum-distance+pp-pd",
    "constraint": "constraint+pp-pd@curve",
    **{each: each for each in ("conformal", "mapping", "homothetic", "combescure")},
}
"""Renderer: the same with a damper along the normal, which the others' schemes have."""


@pytest.mark.parametrize("u", [0.0, 0.3, np.pi / 4.0])
def test_the_largest_stable_stiffness_of_homothetic_is_that_of_the_others_times_h2_over_its_mean(u):
    scene = Scene(model=MODELS["cassinian"], stiffness=K, damping=2.0, mass=MASS)
    curve = scene.model.curve
    place = Place(curve.position(u), curve.normal(u))
    loop = SampledLoop(scene, robot_at(scene.robot, place.point))
    limits = {
        name: eigenvalue_limit(loop, family_of(resolve(NAMES[name]), scene, place))
        for name in ("minimum-distance", "homothetic", "combescure")
    }
    support = resolve("homothetic")(scene).projection.potential[0]
    ratio = float(place.point @ place.normal) ** 2 / support**2
    assert limits["combescure"] == pytest.approx(limits["minimum-distance"], rel=1e-3)
    assert limits["homothetic"] == pytest.approx(ratio * limits["minimum-distance"], rel=1e-3)


def push(seed, model):
    """A random push (2 s) from free space into a model and back, 6 N or so towards the origin."""
    rng = np.random.default_rng(seed)
    time, angle = np.linspace(0.0, 2.0, 41), rng.uniform(0.0, 2.0 * np.pi)
    foot = model.curve.position(model.curve.nearest([0.1 * np.array([np.cos(angle), np.sin(angle)])]))[0]
    walk = np.cumsum(rng.normal(size=(41, 2)) * 2.0, axis=0)
    walk -= np.linspace(0.0, 1.0, 41)[:, np.newaxis] * walk[-1]
    inwards = np.sin(0.5 * np.pi * time)[:, np.newaxis] * -6.0 * rng.uniform(0.5, 2.0) * foot / np.linalg.norm(foot)
    return Experiment(2.0, 1.05 * foot, np.zeros(2), time, inwards + walk)


@cache
def spring(name, model):
    base = NAMES[name].replace("pp-pd", "pp")
    return resolve(base)(Scene(model=MODELS[model], stiffness=K, mass=MASS))


def pushed(name, model, seed, *, damping=5.0):
    """What the spring's part gives the hand from free space to free space, J.

    As it is held for a tick, as a trapezoid has it, and the most that hold can give: half its largest slope times the
    sum of |dx|^2.
    """
    scene = Scene(model=MODELS[model], stiffness=K, damping=damping, mass=MASS)
    hips = simulate_closed_loop(resolve(NAMES[name])(scene), push(seed, MODELS[model]), scene, T).hip
    _, forces = led(spring(name, model), hips, T)
    last = np.flatnonzero(~np.any(forces != 0.0, axis=1))[-1]
    hips, forces = hips[: last + 1], forces[: last + 1]
    moved, change = np.diff(hips, axis=0), np.diff(forces, axis=0)
    held = float(np.sum(forces[:-1] * moved))
    felt = np.any(forces != 0.0, axis=1)
    size = np.where(felt[:-1] | felt[1:], np.linalg.norm(moved, axis=1), 0.0)
    slope = float(np.max(np.linalg.norm(change, axis=1) / np.maximum(size, 1e-9)))
    return held, held + 0.5 * float(np.sum(change * moved)), 0.5 * slope * float(np.sum(size**2))


@pytest.mark.parametrize("model", ["cassinian", "ellipse"])
@pytest.mark.parametrize("name", ["homothetic", "combescure"])
@pytest.mark.parametrize("seed", range(4))
def test_random_pushes_gain_what_hold_gives_and_no_more(name, model, seed):
    held, smooth, most = pushed(name, model, seed)
    assert held <= most
    # the trapezoid of a gradient is off by a third of the change of its slope: small beside hold
    assert abs(smooth) <= 0.05 * most


def test_random_pushes_gain_more_of_a_map_whose_force_is_no_gradient():
    """Over these pushes; which of them go round so that they lose is chance."""
    found = np.array(
        [[pushed(name, "cassinian", seed)[1] for seed in range(4)] for name in ("conformal", "homothetic")]
    )
    assert np.abs(found[0]).max() > 10.0 * np.abs(found[1]).max()


def chatter(name, dt, *, damping=5.0):
    """The sideways swing (m) of a hand pushed with 5 N into a notch of the star; how often (1/s) the force turns."""
    model = MODELS["star"]
    corner = next(each for each in model.curve.corners if not each.convex).position
    way = -corner / np.linalg.norm(corner)
    side = np.array([-way[1], way[0]])
    scene = Scene(model=model, stiffness=K, damping=damping, mass=MASS)
    force = np.array([np.zeros(2), 5.0 * way])
    given = Experiment(3.0, corner - 1e-3 * way + 1e-4 * side, np.zeros(2), np.array([0.0, 0.5]), force)
    run = simulate_closed_loop(resolve(NAMES[name])(scene), given, scene, dt)
    late = slice(2 * len(run) // 3, None)
    angles = np.unwrap(np.arctan2(run.force[late, 1], run.force[late, 0]))
    return float(np.ptp(run.hip[late] @ side)), float(np.sum(np.abs(np.diff(angles)) > 0.3) / (angles.size * dt))


def test_a_force_that_switches_its_direction_chatters_in_a_notch_and_less_the_faster_it_is_sampled():
    for name in ("homothetic", "combescure", "conformal"):
        (wide, often), (narrow, oftener) = chatter(name, 1e-3), chatter(name, 2.5e-4)
        assert often > 20.0
        assert oftener > 2.0 * often
        assert narrow < 0.2 * wide
    for name in ("minimum-distance", "constraint"):
        assert chatter(name, 1e-3)[1] == 0.0
