"""LuGre friction: its step against an explicit one and an integrator, its steady state, and where it is passive."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leading import led as led_along
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.lugre import LuGre
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.checks.passivity import active_by_nature
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.phenomena.verdict import Level
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Experiment, Hand, Path

TEXTBOOK = LuGre(1.5, 1.0, stribeck=1e-3, stiffness=1e5, damping=316.0, viscosity=0.4)
"""The paper's forces at a press of 1 N: F_s = 1.5 N, F_c = 1 N."""

DEPTH = 1e-3


def led(law, x, dt=1e-3, *, depth=DEPTH, kind="line"):
    """The force (n,), N, of bristles along a plane that is pressed with 1 N, led to x (n,) from rest at x[0]."""
    scene = Scene(model=make_model(kind), effects=(law,))
    x = np.asarray(x, dtype=float)
    hips = np.column_stack([np.concatenate([[x[0], x[0]], x]), np.full(x.size + 2, -1.0) * depth])
    hips[0, 1] = depth
    _, forces = led_along(make_renderer(resolve("minimum-distance"), scene), hips, dt)
    return forces[2:, 0]


def euler(law, speed, ticks, dt=1e-3):
    """The deflections (m) of an explicit step at one speed and a press of 1 N."""
    z, found = 0.0, []
    for _ in range(ticks):
        z += dt * (speed - law.stiffness * abs(speed) * z / float(law.limit(speed)))
        found.append(z)
    return np.array(found)


def test_explicit_euler_diverges_where_the_exponential_step_does_not():
    """Above 2 g / (sigma0 dt), 20 mm/s: at 19.9 mm/s the explicit step holds, at 20.1 it has left any bound in 2 s."""
    smooth = replace(TEXTBOOK, mu_s=1.0, mu_k=1.0, damping=0.0, viscosity=0.0)
    assert 2.0 / (smooth.stiffness * 1e-3) == pytest.approx(0.02)
    assert np.abs(euler(smooth, 0.0199, 2000)).max() < 3e-5
    assert np.abs(euler(smooth, 0.0201, 3000)).max() > 1e2
    for speed in (0.0199, 0.0201, 0.5):
        force = led(smooth, speed * 1e-3 * np.arange(3000))
        assert np.abs(force).max() <= 1.0 + 1e-12
        assert force[-1] == pytest.approx(-1.0, rel=1e-12)


@pytest.mark.parametrize("speed", [1e-4, 1e-3, 0.02, 0.3, -0.05])
def test_the_force_settles_at_the_stribeck_curve(speed):
    force = led(TEXTBOOK, speed * 1e-3 * np.arange(4000))
    asked = (1.0 + 0.5 * math.exp(-((speed / 1e-3) ** 2))) * np.sign(speed) + 0.4 * speed
    assert -force[-1] == pytest.approx(asked, rel=1e-9)


def test_the_step_is_exact_for_a_held_speed():
    """Against an integrator of the equation, tick by tick at another speed each."""
    law = LuGre(0.5, 0.3, stribeck=5e-3, stiffness=5e3, damping=6.0, viscosity=4.0)
    speeds = np.concatenate([[0.0], np.random.default_rng(3).normal(0.0, 0.02, 60)])
    force = led(law, np.cumsum(speeds) * 1e-3)
    z = 0.0
    for k, v in enumerate(speeds):
        g = float(law.limit(v))
        z = float(solve_ivp(lambda _, z: v - 5e3 * abs(v) * z / g, (0.0, 1e-3), [z], rtol=1e-10, atol=1e-16).y[0, -1])  # noqa: B023
        asked = 5e3 * z + 6.0 * (v - 5e3 * abs(v) * z / g) + 4.0 * v
        assert -force[k] == pytest.approx(asked, rel=1e-7, abs=1e-9), k


def test_it_scales_with_the_press_and_lets_go_with_it():
    """Half the press, half the force; bristles that a lighter press does not hold slip to what it holds."""
    law = LuGre(0.5, 0.3, stribeck=5e-3, stiffness=5e3, damping=0.0, viscosity=0.0)
    x = 0.02 * 1e-3 * np.arange(500)
    np.testing.assert_allclose(led(law, x, depth=2e-3)[-1], 2.0 * led(law, x)[-1], rtol=1e-9)
    hips = np.array([[0.0, 1e-3], [0.0, -2e-3], [1e-3, -2e-3], [1e-3, -1e-3], [1e-3, -0.2e-3]])
    scene = Scene(model=make_model("line"), effects=(law,))
    force = led_along(make_renderer(resolve("minimum-distance"), scene), hips, 1e-3)[1][:, 0]
    assert -force[2] == pytest.approx(0.3 * 2.0 * (1.0 - math.exp(-5e3 * 1e-3 / 0.6)), rel=1e-9)
    np.testing.assert_allclose(-force[3:], [0.5 * 1.0, 0.5 * 0.2], rtol=1e-9)


def test_bristles_turn_with_the_surface():
    """Round a sphere at a constant depth: against the way, as large as on a plane."""
    law = LuGre(0.5, 0.3, stribeck=5e-3, stiffness=5e3, damping=1.0, viscosity=1.0)
    angle = np.linspace(0.0, 1.0, 2000)
    tilt = np.array([[1.0, 0.0], [0.0, 0.6], [0.0, 0.8]])
    hips = np.column_stack([np.cos(angle), np.sin(angle)]) @ tilt.T * np.r_[0.101, np.full(1999, 0.098)][:, np.newaxis]
    scene = Scene(model=make_model("sphere"), effects=(law,))
    _, forces = led_along(make_renderer(resolve("minimum-distance"), scene), hips, 1e-3)
    way = (np.column_stack([-np.sin(angle), np.cos(angle)]) @ tilt.T)[1000]
    speed = 0.098 * (angle[1] - angle[0]) / 1e-3
    asked = 2.0 * float(law.limit(speed)) + speed
    np.testing.assert_allclose(forces[1000] @ way, -asked, rtol=1e-3)


# Passivity


def test_the_textbook_s_numbers_are_active_and_the_effect_says_which_would_not_be():
    assert TEXTBOOK.needed == pytest.approx(316.0 * 0.5)
    assert "sigma2 >= sigma1 (mu_s - mu_k) / mu_k = 158 N s/m" in TEXTBOOK.active(0.0)
    assert replace(TEXTBOOK, viscosity=158.0).active(0.0) is None
    assert replace(TEXTBOOK, mu_s=1.0).active(0.0) is None
    # From the largest deflection, at 100 mm/s, it drives the hand with 14.3 N.
    z, v = 1.5e-5, 0.1
    rate = v - 1e5 * v * z / float(TEXTBOOK.limit(v))
    assert 1e5 * z + 316.0 * rate + 0.4 * v == pytest.approx(-14.3, abs=0.05)


@pytest.mark.parametrize("fade", [1e-5, 1e-4, 1e-3, 0.1])
def test_the_viscosity_that_a_fading_damping_needs(fade):
    law = replace(TEXTBOOK, fade=fade)

    def deficit(speed):
        return -float(law.damping_at(speed) * (law.mu_s / law.limit(speed) - 1.0))

    best = minimize_scalar(lambda log: deficit(math.exp(log)), bounds=(-16.0, 0.0), method="bounded",
                           options={"xatol": 1e-10})  # fmt: skip
    assert law.needed == pytest.approx(-best.fun, rel=1e-4)
    assert (law.active(0.0) is None) == (fade <= 1e-4), "a damping that fades within a tenth of v_s mends it"


def gained(law, x, dt):
    """The work, J, that the hand has got at each sample, with the force as it changes from one to the next."""
    force = led(law, x, dt)
    return np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(x))])


def jerk(dt):
    """Bend the bristles slowly to the most, and draw them at 100 mm/s for 0.2 ms."""
    slow = np.arange(0.0, 6e-5, 1e-3 * dt)
    return np.concatenate([slow, slow[-1] + 0.1 * dt * np.arange(1, int(2e-4 / dt))])


def test_a_jerk_gets_energy_out_of_the_textbook_s_numbers_alone():
    dt = 1e-6
    x = jerk(dt)
    before = int(6e-5 / (1e-3 * dt)) - 1
    active = gained(TEXTBOOK, x, dt)
    assert active[-1] - active[before] > 1e5 * 1.5e-5**2 / 2.0, "more than the bristles had stored"
    for passive in (replace(TEXTBOOK, viscosity=158.0), replace(TEXTBOOK, fade=1e-4)):
        quiet = gained(passive, x, dt)
        assert quiet.max() <= 1e-9
        assert quiet[-1] - quiet[before] < 1e5 * 1.5e-5**2 / 2.0


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31), share=st.floats(1.0, 3.0), ratio=st.floats(1.0, 3.0))
def test_passive_numbers_never_give_more_than_they_got(seed, share, ratio):
    """On any way, at 100 kHz, where 10 nJ is what sampling may add: a thousandth of what the bristles store."""
    law = LuGre(0.3 * ratio, 0.3, stribeck=5e-3, stiffness=5e3, damping=5.0, viscosity=0.0)
    law = replace(law, viscosity=share * law.needed)
    rng = np.random.default_rng(seed)
    speed = 0.02 * np.repeat(rng.normal(size=40), 25)
    assert gained(law, np.cumsum(speed) * 1e-5, 1e-5).max() <= 1e-8


def test_a_scene_with_active_friction_shows_passivity_only():
    scene = Scene(model=make_model("line"), effects=(TEXTBOOK,))
    assert "LuGre friction with sigma2 = 0.4 N s/m is active" in active_by_nature(scene)
    points = np.array([[0.0, 1e-3], [0.0, -1e-3], [0.01, -1e-3], [0.01, 1e-3]])
    renderer = make_renderer(resolve("minimum-distance"), scene)
    run = play(renderer, Path(np.array([0.0, 0.02, 0.1, 0.12]), points), 1e-3, scene=scene)
    finding = OWN_CHECKS["passivity"](Runs(run), scene)
    assert finding.level is Level.INFO
    assert "shown only, for LuGre" in finding.message


def test_it_does_not_creep():
    """100 g, pressed with 1 N and pulled with 0.17 N of 0.3: once bent, the bristles hold it where it is."""
    law = LuGre(0.5, 0.3, stribeck=5e-3, stiffness=5e3, damping=6.0, viscosity=4.0)
    scene = Scene(model=make_model("line"), effects=(law,))
    rest = Hand(path=Path(np.array([0.0, 1.0]), np.zeros((2, 2))), stiffness=0.0, damping=4.0)
    pushes = np.array([[0.0, 0.0], [0.0, -1.0], [0.17, -1.0]])
    trial = Experiment(12.0, np.array([0.0, 5e-4]), np.zeros(2), np.array([0.0, 0.4, 0.8]), pushes, rest)
    run = simulate_closed_loop(make_renderer(resolve("minimum-distance"), scene), trial, scene, 1e-3)
    held = run.hip[2000:, 0]
    assert held[0] > 2e-5
    assert np.ptp(held) < 1e-6


@pytest.mark.parametrize(
    "numbers",
    [
        {"mu_s": 0.3, "mu_k": 0.5},
        {"mu_k": 0.0},
        {"stribeck": 0.0},
        {"stiffness": math.nan},
        {"damping": -1.0},
        {"fade": 0.0},
    ],
)
def test_what_is_no_friction_is_refused(refused, numbers):
    with refused(InputError):
        make_effect(TEXTBOOK.document() | numbers)


def test_a_document_of_it_gives_it_again():
    for law in (TEXTBOOK, replace(TEXTBOOK, fade=1e-4)):
        assert make_effect(law.document()) == law
