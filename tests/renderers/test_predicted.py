"""Set stabilisation where the tool will be: what a late force and a late velocity add to the speed is gone."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

from hapticeval.closed_forms import form_of
from hapticeval.devices.catalogue import make_device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import read_effects
from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.catalogue import make_model
from hapticeval.renderers.stabilisation_laws import velocity_lag
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment
from hapticeval.suite.reading import load_suite

PLAIN, PREDICTED = "set-stabilisation", "set-stabilisation+predicted"
SPEED, RADIUS, DT = 0.5, 0.1, 1e-3
OMEGA = SPEED / RADIUS
ROBOTS = {"circle": "parallelogram-2dof", "sphere": "parallelogram-3dof"}


def scene_of(model="circle", *, robot=False, **imperfections):
    """The gains of 7.3 about a model 200 mm across, on a point mass or the linearised robot."""
    effects = read_effects({"imperfections": imperfections})[1] if imperfections else ()
    device = {"device": make_device(ROBOTS[model]), "inner_loop": InnerLoop.LINEARISED} if robot else {}
    return Scene(
        model=make_model(model, size=2.0 * RADIUS), stiffness=50.0, damping=4.47, mass=0.1, bilateral=True,
        sampling_time=DT, effects=effects, **device,
    )  # fmt: skip


def slid(name, scene, *, seconds=1.0, speed=SPEED):
    """A tool that starts on the surface, along it, and is left alone."""
    size = scene.model.dimension
    position, velocity = RADIUS * np.eye(size)[0], speed * np.eye(size)[1]
    return simulate_closed_loop(
        resolve(name)(scene), Experiment(seconds, position, velocity, np.zeros(1), np.zeros((1, size))), scene, DT
    )


def growth(recording):
    """The c (s) of d(omega)/dt = c omega^3, once the distance has settled: 1/omega^2 falls by 2 c t."""
    settled = recording.time >= 0.3
    time, speed = recording.time[settled], np.linalg.norm(recording.velocity[settled], axis=1)
    squares = (RADIUS / speed) ** 2
    return (squares[0] - squares[-1]) / (2.0 * (time[-1] - time[0]))


K, D, R = sympy.symbols("k d R", positive=True)


def law(place, velocity):
    """The force over the mass about circle or sphere of radius R, as `stabilisation_laws` derives it."""
    distance = sympy.sqrt(place.dot(place))
    normal, n = place / distance, distance - R
    across = normal.dot(velocity)
    along = velocity - across * normal
    # W = I / R: the foot moves at 1 / (1 + n / R) of the tool's speed along the surface.
    foot = along / (1 + n / R)
    return (-K * n - D * across - foot.dot(along) / R) * normal + 2 * across * foot / R


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
def test_the_lag_turns_into_speed_and_the_prediction_takes_it_away(space):
    """To the first order of all lags: omega' = (2 tau + h) omega^3 without, and nothing with the prediction.

    A tool runs on a circle of radius R + n, with n the distance at which the spring balances what the damper makes of
    the late velocity. The force is that of what was seen h ago, the velocity that of h + tau ago.
    """
    t, h, tau, small, n, omega = sympy.symbols("t h tau epsilon n omega", real=True)
    radius = R + small * n
    path = sympy.Matrix([radius * sympy.cos(omega * t), radius * sympy.sin(omega * t), *([0] if space else [])])
    normal, tangent = path / radius, path.diff(t) / (radius * omega)
    seen, rate = path.subs(t, t - small * h), path.diff(t).subs(t, t - small * (h + tau))
    ahead = rate + small * (tau + h) * path.diff(t, 2).subs(t, t - small * h)

    def first_order(expression):
        return sympy.simplify(sympy.diff(expression, small).subs({small: 0, t: 0}))

    for place, velocity, gain in ((seen, rate, 2 * tau + h), (seen + small * h * ahead, ahead, 0)):
        force = law(place, velocity)
        (balanced,) = sympy.solve(first_order(force.dot(normal) + radius * omega**2), n)
        along = first_order(force.dot(tangent)).subs(n, balanced)
        assert sympy.simplify(along - gain * R * omega**3) == 0


@pytest.mark.parametrize("cutoff", [0.0, 400.0, 200.0, 100.0])
@pytest.mark.parametrize("delay", [0.0, 5e-4])
def test_a_late_loop_gains_speed_as_derived(cutoff, delay):
    """c = 2 tau + T/2 + d, on the point mass: the derivation is of the first order, and omega c is 0.02 at the most."""
    scene = scene_of(**({"velocity_cutoff": cutoff} if cutoff else {}), **({"delay": delay} if delay else {}))
    expected = 2.0 * velocity_lag(cutoff, DT) + 0.5 * DT + delay
    assert growth(slid(PLAIN, scene)) == pytest.approx(expected, rel=0.02)
    assert abs(growth(slid(PREDICTED, scene))) < 0.02 * expected


@pytest.mark.parametrize("model", ["circle", "sphere"])
def test_on_the_robot_little_is_left_of_it(model):
    """A turn at 50 Hz: what the robot's own bias makes of the late velocity is not in the law, and is left."""
    scene = scene_of(model, robot=True, velocity_cutoff=50.0)
    gained = {}
    for name in (PLAIN, PREDICTED):
        speed = np.linalg.norm(slid(name, scene).velocity, axis=1)
        gained[name] = speed[-1] / speed[0] - 1.0
    assert gained[PLAIN] > 0.2
    assert abs(gained[PREDICTED]) < 0.15 * gained[PLAIN]


def test_the_lag_of_a_filter_is_that_of_its_weights():
    cutoff = 80.0
    decay = math.exp(-2.0 * math.pi * cutoff * DT)
    weights = (1.0 - decay) * decay ** np.arange(2000)
    lag = 0.5 * DT + DT * np.sum(np.arange(2000) * weights)
    assert velocity_lag(cutoff, DT) == pytest.approx(lag, rel=1e-12)


@pytest.mark.parametrize("model", ["circle", "sphere"])
def test_the_tool_moves_as_the_closed_form_says(model):
    """Of the sampled loop itself, with no extrapolation: a hundredth of what the plain law is off by."""
    scene = scene_of(model)
    form = form_of("set-stabilisation", scene)
    off = {}
    for name in (PLAIN, PREDICTED):
        run = slid(name, scene)
        expected = form.motion(scene, run.hip[0], run.velocity[0], run.time).hip
        off[name] = np.max(np.linalg.norm(run.hip - expected, axis=1))
    assert off[PREDICTED] < 0.01 * off[PLAIN]


@pytest.mark.parametrize(("suite", "case"), [("dynamics-circle", "circle-off"), ("dynamics-sphere", "sphere-off")])
def test_it_passes_what_set_stabilisation_is_asked(suite, case):
    (found,) = [each for each in load_suite(suite).cases if each.name == case]
    verdicts = judge(resolve(PREDICTED), PREDICTED, suite, found).verdicts
    outcomes = {verdict.check: verdict.finding.outcome.value for verdict in verdicts}
    assert set(outcomes.values()) == {"pass"}, outcomes


def test_it_needs_a_constraint_and_a_tool_that_moves(refused):
    with refused(RefusalError):
        resolve(PREDICTED)(Scene(model=make_model("circle")))
    robot = {"device": make_device("parallelogram-2dof")}
    with refused(RefusalError):
        resolve(PREDICTED)(Scene(model=make_model("circle"), bilateral=True, stiffness=50.0, damping=4.47, **robot))
    with refused(InputError):
        resolve(PREDICTED)(Scene(model=make_model("circle"), bilateral=True, stiffness=50.0, damping=150.0))
    with refused(InputError):
        resolve(f"{PREDICTED}@atlas")


@pytest.mark.parametrize("damping", [4.47, 40.0, 90.0, 110.0, 130.0, 150.0])
def test_the_gains_that_are_refused_are_those_that_are_unstable(damping):
    """Sampled at 1 ms, a tool 1 mm off a line."""
    scene = Scene(model=make_model("line"), bilateral=True, stiffness=50.0, damping=damping, mass=0.1)
    try:
        renderer = resolve(PREDICTED)(scene)
    except InputError:
        renderer = None
    n, rate, before = 1e-3, 0.0, 0.0
    for _ in range(3000):
        ahead = rate + 0.5 * DT * before
        before = -(50.0 * (n + 0.5 * DT * ahead) + damping * ahead) / 0.1
        n, rate = n + DT * rate + 0.5 * DT**2 * before, rate + DT * before
    assert (abs(n) < 1e-3) == (renderer is not None)
