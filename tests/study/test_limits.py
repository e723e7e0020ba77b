"""Stability limits against closed forms of the sampled mass and damper, and against the robot's golden numbers."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import gammainc

from hapticeval.cli import main
from hapticeval.devices.catalogue import make_device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.discovery import resolve
from hapticeval.effects.actuators import Delay, JointFriction, Saturation
from hapticeval.effects.sensors import Encoder
from hapticeval.errors import InputError, RendererError
from hapticeval.geometry.catalogue import make_model
from hapticeval.scene import Scene
from hapticeval.study.limits.loop import Place, SampledLoop, passive_stiffness, port_damping, robot_at
from hapticeval.study.limits.published import (
    losses_along,
    over_friction,
    passive_with_encoders,
    stable_with_delay,
    try_hands,
)
from hapticeval.study.limits.search import eigenvalue_limit, family_of, simulated_limit

WALL = Place(np.zeros(2), np.array([0.0, 1.0]))


@dataclass(frozen=True)
class Damped(PointMass):
    """A mass on a viscous bed."""

    viscosity: float = 0.3

    def bias(self, joints, rates):
        return self.viscosity * np.asarray(rates)


class Crooked:
    """A renderer whose force grows with the square of the scene's stiffness."""

    supports = ("bilateral",)

    def __init__(self, scene):
        self.stiffness = scene.stiffness

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        return np.array([hip[0], 0.0]), np.array([0.0, -1e-2 * self.stiffness**2 * hip[1]])


def scene(mass=0.15, viscosity=0.3, **rest):
    return Scene(model=make_model("line"), device=Damped(mass, 2, viscosity), **rest)


def limit(scene, renderer="minimum-distance+pp", place=WALL):
    family = family_of(resolve(renderer), scene, place)
    return eigenvalue_limit(SampledLoop(scene, robot_at(scene.robot, place.point)), family)


def held_spring_limit(mass, viscosity, dt):
    """K at which the product of the poles of z^2 - (1 + e - K a) z + (e + K c) reaches one: (1 - e) / c.

    With x = b T / m, e = exp(-x) and c = m / b^2 (1 - e - x e), whose terms cancel but for their second order: the
    bracket is the incomplete gamma function of order two.
    """
    x = viscosity * dt / mass
    return -math.expm1(-x) / (mass / viscosity**2 * float(gammainc(2.0, x)))


@settings(max_examples=25)
@given(mass=st.floats(0.05, 5.0), viscosity=st.floats(0.05, 5.0), dt=st.sampled_from([2.5e-4, 1e-3, 4e-3]))
def test_a_held_spring_on_a_damped_mass_has_its_textbook_limit_and_passivity_is_stricter(mass, viscosity, dt):
    sampled = scene(mass, viscosity, sampling_time=dt)
    found = limit(sampled)
    assert found == pytest.approx(held_spring_limit(mass, viscosity, dt), rel=1e-5)
    passive = passive_stiffness(sampled, robot_at(sampled.robot, WALL.point), WALL.normal)
    assert passive == pytest.approx(2.0 * viscosity / dt, rel=1e-6)
    assert passive <= found * (1.0 + 1e-6)


def test_a_delay_of_one_tick_has_the_roots_of_its_cubic():
    mass, viscosity, dt = 0.15, 0.3, 1e-3
    late = replace(scene(mass, viscosity), effects=(Delay(dt),))
    found = limit(late)
    decay = math.exp(-viscosity * dt / mass)
    a = dt / viscosity - mass / viscosity**2 * (1.0 - decay)
    c = mass / viscosity**2 * (1.0 - decay) - dt / viscosity * decay
    roots = np.abs(np.roots([1.0, -(1.0 + decay), decay + found * a, found * c]))
    assert max(roots) == pytest.approx(1.0, abs=1e-7)


@settings(max_examples=25)
@given(mass=st.floats(0.05, 2.0), share=st.floats(0.05, 0.95) | st.floats(1.05, 1.5))
def test_a_damped_wall_on_a_free_mass_fills_its_triangle(mass, share):
    """Jury on z^2 - (2 - B T/m - K T^2/2m) z + (1 - B T/m + K T^2/2m): K < 2 B / T, and B < 2 m / T."""
    dt = 1e-3
    damping = share * 2.0 * mass / dt
    free = Scene(model=make_model("line"), device=PointMass(mass), mass=mass, damping=damping)
    expected = 2.0 * damping / dt if share < 1.0 else 0.0
    assert limit(free, "minimum-distance+pp-pd") == pytest.approx(expected, rel=1e-4)


def test_without_losses_no_held_spring_is_stable():
    undamped = Scene(model=make_model("line"), device=PointMass(0.1))
    assert limit(undamped) == 0.0
    assert port_damping(robot_at(undamped.robot, WALL.point), WALL.normal, 1e-3) == 0.0


def test_linearisation_replaces_the_device_by_the_tool():
    """Whatever the device, what is left is the tool's mass: the same limit as a point mass of that mass has."""
    shared = {"damping": 4.47, "mass": 0.1}
    robot = scene(inner_loop=InnerLoop.LINEARISED, viscosity=1e-9, **shared)
    ideal = Scene(model=make_model("line"), device=PointMass(0.1), **shared)
    scheme = "minimum-distance+pp-pd"
    assert limit(robot, scheme) == pytest.approx(limit(ideal, scheme), rel=1e-4)


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.6])
def test_gains_turn_with_the_wall(angle):
    place = Place(np.zeros(2), np.array([math.cos(angle), math.sin(angle)]))
    family = family_of(resolve("minimum-distance+pp-pd"), replace(scene(), damping=3.0), WALL)
    turned = family.facing(place).at(1000.0)
    np.testing.assert_allclose(turned.now, 1000.0 * np.outer(place.normal, place.normal), atol=1e-6)
    np.testing.assert_allclose(turned.rate, 3.0 * np.outer(place.normal, place.normal), atol=1e-6)


@pytest.mark.parametrize("factory", [resolve("ideal"), Crooked])
def test_a_renderer_without_gains_in_proportion_to_the_stiffness_is_refused(refused, factory):
    with refused(InputError):
        family_of(factory, scene(), WALL)


def robot_scene(**rest):
    return Scene(model=make_model("line"), device=make_device("parallelogram-2dof"), stiffness=1000.0, **rest)


def test_the_robot_at_home_has_the_golden_bound_and_the_thesis_exceeds_it():
    """2 eig(B) / T at home, |z| = 1.000718 at 1 kN/m, and 560 within, 562 beyond."""
    scene = robot_scene()
    robot = robot_at(scene.robot, WALL.point)
    assert passive_stiffness(scene, robot, np.array([0.0, 1.0])) == pytest.approx(561.328477, abs=1e-5)
    assert passive_stiffness(scene, robot, np.array([1.0, 0.0])) == pytest.approx(2333.333333, abs=1e-5)
    loop, family = SampledLoop(scene, robot), family_of(resolve("minimum-distance+pp"), scene, WALL)
    assert loop.growth(family.at(1000.0)) == pytest.approx(1.000718, abs=5e-7)
    assert loop.growth(family.at(560.0)) < 1.0 < loop.growth(family.at(562.0))


def test_on_the_thesis_circle_the_weakest_wall_has_the_golden_range():
    scene = robot_scene()
    weakest = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False):
        robot = robot_at(scene.robot, 0.1 * np.array([np.cos(angle), np.sin(angle)]))
        walls = np.linspace(0.0, np.pi, 90, endpoint=False)
        weakest.append(min(passive_stiffness(scene, robot, np.array([np.cos(w), np.sin(w)])) for w in walls))
    assert min(weakest) == pytest.approx(524.85, abs=0.2)
    assert max(weakest) == pytest.approx(561.33, abs=1.5)


def test_the_loop_itself_loses_stability_where_its_eigenvalues_say():
    scene = robot_scene()
    found = simulated_limit(resolve("minimum-distance+pp"), scene, WALL)
    family = family_of(resolve("minimum-distance+pp"), scene, WALL)
    assert found == pytest.approx(
        eigenvalue_limit(SampledLoop(scene, robot_at(scene.robot, WALL.point)), family), rel=2e-3
    )


@pytest.mark.parametrize("kind", ["circle", "cassinian"])
@pytest.mark.parametrize("renderer", ["minimum-distance+pp-pd", "set-stabilisation"])
def test_on_a_bent_constraint_the_limit_is_that_of_the_line(kind, renderer):
    """The tool is free along it, and across it the triangle of Jury holds: K < 2 B / T, by eigenvalues and in the loop.

    The robot is linearised, its torques held: that its own damping acts within a tick changes the limit by b T / d of
    a joint at the most, 0.2 per cent.
    """
    held = Scene(
        model=make_model(kind), device=make_device("parallelogram-2dof"), inner_loop=InnerLoop.LINEARISED,
        stiffness=50.0, damping=4.47, mass=0.1, bilateral=True,
    )  # fmt: skip
    place = Place(np.array([0.1, 0.0]), np.array([1.0, 0.0]))
    loop, family = SampledLoop(held, robot_at(held.robot, place.point)), family_of(resolve(renderer), held, place)
    assert loop.growth(family.at(50.0)) < 1.0
    assert eigenvalue_limit(loop, family) == pytest.approx(8940.0, rel=2e-3)
    assert simulated_limit(resolve(renderer), held, place) == pytest.approx(8940.0, rel=2e-3)


def test_a_tool_that_slides_to_another_place_shows_nothing_of_this_one():
    """On top of the Cassinian a robot swings up beyond 4,614 N/m, and slides to where 7,700 N/m are stable."""
    held = replace(robot_scene(damping=2.0, bilateral=True), model=make_model("cassinian"))
    place = Place(np.array([0.0, 0.1]), np.array([0.0, 1.0]))
    family = family_of(resolve("combescure"), held, place)
    found = eigenvalue_limit(SampledLoop(held, robot_at(held.robot, place.point)), family)
    assert simulated_limit(resolve("combescure"), held, place) == pytest.approx(found, rel=2e-3)


def test_what_is_not_linear_does_not_decide():
    """Rounding of counts makes a limit cycle at any stiffness, and friction holds a loop that would go on to swing."""
    effects = (Encoder(1e-4), JointFriction(0.02), Saturation(0.1))
    factory, plain = resolve("minimum-distance+pp"), robot_scene()
    assert simulated_limit(factory, replace(plain, effects=effects), WALL) == simulated_limit(factory, plain, WALL)


@pytest.mark.parametrize("loop", [InnerLoop.COMPENSATED, InnerLoop.LINEARISED])
def test_no_bound_counts_on_damping_that_is_compensated(loop):
    compensating = robot_scene(inner_loop=loop)
    assert passive_stiffness(compensating, robot_at(compensating.robot, WALL.point), WALL.normal) is None


@pytest.fixture
def coarse(monkeypatch):
    """Few poses, dampings and frictions."""
    monkeypatch.setattr("hapticeval.study.limits.published.CURVE_FRICTIONS", 4)
    monkeypatch.setattr("hapticeval.study.limits.study.POSES", 5)
    monkeypatch.setattr("hapticeval.study.limits.study.DAMPINGS", 8)


@pytest.mark.usefixtures("coarse")
def test_a_scene_without_the_bound_is_described(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("hapticeval.reports.study_figures.write_limits", lambda *_: [])
    assert main(["study", "limits", "dynamics-circle/circle-robot", "-o", str(tmp_path)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "none: a linearised inner loop compensates" in shown
    assert "(2.40) says nothing about it; without a hand the loop settles" in shown


@pytest.mark.system
@pytest.mark.usefixtures("coarse")
def test_the_command_describes_draws_and_ends_with_one_for_an_unstable_scene(tmp_path, capsys):
    code = main(["study", "limits", "thesis/plane-press", "--device", "parallelogram-2dof", "-o", str(tmp_path)])
    shown = " ".join(capsys.readouterr().out.split())
    assert code == 1
    assert "its 1000 N/m exceed the bound (2.40) of 561.3 N/m" in shown
    assert "unstable" in shown
    document = json.loads(next(tmp_path.glob("*.json")).read_text())
    assert document["workspace"]["axes"] == ["y1", "y2"]
    assert {file.suffix for file in tmp_path.iterdir()} == {".svg", ".png", ".json"}
    picture = next(tmp_path.glob("*.svg")).read_text()
    assert picture.count("times the formula") == 3
    assert "stable: 0.9999 to 1.001 times the formula" in picture
    for letter in ("b: damping of the robot", "B: of the renderer", "T: sampling time", "d: delay", "f_c: ", "Δ: "):
        assert letter in picture


@pytest.mark.usefixtures("coarse")
def test_a_device_without_losses_has_a_limit_of_zero_with_its_reason(tmp_path, capsys):
    """The loop runs away long before its run is over: that is the answer, and no error."""
    code = main(["study", "limits", "thesis/plane-press", "--device", "point-mass:mass=0.1", "-o", str(tmp_path)])
    shown = " ".join(capsys.readouterr().out.split())
    assert code == 1
    assert "no stiffness is stable: a spring held over a step gives back more than it took" in shown
    document = json.loads(next(tmp_path.glob("*.json")).read_text())
    assert (document["eigenvalues"], document["simulated"], document["passive"]) == (0.0, 0.0, 0.0)
    assert max(document["width"][2]["eigenvalues"]) > 1e5, "with damping there is a limit, and the map shows it"
    picture = next(tmp_path.glob("*.svg")).read_text()
    assert "no stiffness is stable at any delay" in picture
    assert "f_c" not in picture, "without encoders there is no line with this letter"


def test_a_renderer_that_breaks_is_no_unstable_loop(refused):
    class Broken(Crooked):
        def step(self, hip, velocity, dt):
            raise ValueError("a fault of its own")

    with refused(RendererError):
        simulated_limit(Broken, scene(), WALL)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["thesis"], "names no case"),
        (["thesis/plane-pres"], "did you mean plane-press"),
        (["thesis/plane-press", "--at", "1"], "it is not 2 finite numbers"),
        (["thesis/plane-press", "--device", "parallelogram-2dof", "--at", "5,0"], "5"),
        (["thesis/plane-press", "-r", "ideal"], "physics of its own"),
        (["thesis/plane-press", "--device", "parallelogram-3dof"], "moves in 3D, and 'line' is in 2D"),
        (["thesis/plane-press", "--device", "point-mass:mass"], "not name=value"),
    ],
)
def test_what_cannot_be_studied_is_refused_at_once(arguments, words, tmp_path, capsys):
    assert main(["study", "limits", *arguments, "-o", str(tmp_path)]) == 2
    assert words in capsys.readouterr().err


@given(delay=st.floats(0.0, 3e-3))
@settings(max_examples=25)
def test_delay_only_takes_away_and_the_bound_is_stricter_still(delay):
    late = replace(scene(), effects=(Delay(delay),))
    bound = passive_stiffness(late, robot_at(late.robot, WALL.point), WALL.normal)
    assert bound == pytest.approx(2.0 * 0.3 / (late.sampling_time + 2.0 * delay), rel=1e-6)
    assert bound * (1.0 - 1e-6) <= limit(late) <= limit(scene()) * (1.0 + 1e-6)


@settings(max_examples=10)
@given(viscosity=st.floats(0.1, 2.0), share=st.floats(0.05, 3.0), step=st.sampled_from([1e-6, 1e-5]))
def test_the_worst_hand_is_given_energy_just_above_the_stiffness_of_abbott_and_okamura(viscosity, share, step):
    """The condition is necessary and sufficient: no hand gains below it, and one does a little above."""
    sampled = scene(viscosity=viscosity)
    losses = losses_along(robot_at(sampled.robot, WALL.point), WALL.normal, step)
    assert losses == pytest.approx((viscosity, 1.0, step))
    friction = share * viscosity * step / sampled.sampling_time
    closed_form = passive_with_encoders(losses, friction, sampled.sampling_time)
    hands = try_hands(resolve("minimum-distance+pp"), sampled, WALL, step, losses)
    # The shortest stroke has a thousandth of a count of damping, the longest is a count short in a thousand.
    assert closed_form <= hands.limit(friction) * (1.0 + 1e-9)
    assert hands.limit(friction) <= closed_form * 1.003 + 2.0 * viscosity / sampled.sampling_time * 1e-3


def test_a_hand_gains_from_a_real_wall_above_the_limit_and_not_below():
    """A tool led to and fro over one edge of the encoder, a tick each way: what the held force gives, less friction."""
    dt, step, friction = 1e-3, 1e-5, 2e-3
    losses = losses_along(robot_at(scene().robot, WALL.point), WALL.normal, step)
    limit = passive_with_encoders(losses, friction, dt)
    assert limit == 2.0 * friction / step, "coarse encoders decide here"
    stroke = 1e-4 * step
    depths = 10.5 * step + 0.5 * stroke * np.array([1.0, -1.0] * 50 + [1.0])  # it ends where it began
    for stiffness, gains in ((0.99 * limit, False), (1.01 * limit, True)):
        force = stiffness * step * np.rint(depths / step)
        # The force pushes outwards, against the depth, over the tick that follows its sample.
        given = -np.sum(force[:-1] * np.diff(depths)) - np.sum(
            friction * np.abs(np.diff(depths)) + 0.3 * np.diff(depths) ** 2 / dt
        )
        assert (given > 0.0) == gains


@pytest.mark.system
def test_friction_lets_a_loop_rest_that_is_not_passive(monkeypatch):
    # Two below the corner, it, and four above.
    monkeypatch.setattr("hapticeval.study.limits.published.CURVE_FRICTIONS", 7)
    sampled = robot_scene()
    place = Place(np.zeros(2), np.array([0.0, 1.0]))
    curve = over_friction(resolve("minimum-distance+pp"), sampled, place)
    passive, rest = (np.array(curve[name][1:]) for name in ("closed_form", "let_go"))
    assert np.all(rest > passive)
    assert over_friction(resolve("minimum-distance+pp"), scene(), WALL) is None, "a bare point mass has no encoder"


@pytest.mark.parametrize("delay", [0.0, 0.5e-3, 2e-3])
def test_the_loop_of_the_robot_is_stable_up_to_the_line_of_gil_and_others(delay):
    late = robot_scene().with_effects(Delay(delay))
    place = Place(np.zeros(2), np.array([0.0, 1.0]))
    damping = port_damping(robot_at(late.robot, place.point), place.normal, late.sampling_time)
    assert limit(late, place=place) == pytest.approx(stable_with_delay(damping, late), rel=2e-3)
