"""The closed loop against the solutions of thesis Tables 6.1 and 6.2, checked, and corrected where misprinted."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.compiled import compiled
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.parallelogram import ENCODER_STEP, Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass
from hapticeval.discovery import resolve
from hapticeval.effects.actuators import Delay, JointFriction, Saturation
from hapticeval.effects.catalogue import read_effects
from hapticeval.effects.sensors import Encoder, ForceSensor, VelocityFilter
from hapticeval.errors import DomainError, InputError, RefusalError, RendererError, RunawayError
from hapticeval.geometry.catalogue import circle, line, make_model
from hapticeval.laws import law_data
from hapticeval.renderer import CompiledStep, Response
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment, Hand, Path

K, D = 500.0, 44.7


def final(name, model, position, velocity, time, dt, **robot):
    scene = Scene(model=model, stiffness=K, damping=D, mass=1.0, bilateral=True, **robot)
    rest = Experiment(time, np.array(position), np.array(velocity), np.zeros(1), np.zeros((1, 2)))
    recording = simulate_closed_loop(resolve(name)(scene), rest, scene, dt)
    assert recording.time[-1] == pytest.approx(time, abs=1e-12)
    return recording.hip[-1], recording.velocity[-1]


def continuous(name, model, position, velocity, time, **robot):
    """The limit of no sampling: the held force is wrong by c1 T + c2 T^2 + ..., eliminated from four runs."""
    steps = (1e-3, 5e-4, 2.5e-4, 1.25e-4)
    runs = [np.concatenate(final(name, model, position, velocity, time, dt, **robot)) for dt in steps]
    first = [2.0 * fine - coarse for coarse, fine in pairwise(runs)]
    second = [(4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(first)]
    return (8.0 * second[1] - second[0]) / 7.0, np.abs(runs[1] - runs[0]), np.abs(runs[2] - runs[1])


CIRCLE = pytest.mark.parametrize(
    ("scheme", "r", "theta", "rate"),
    [
        ("pp", 1.01038366961, 2.28837605467, 4.89775850843),
        ("pp-v", 1.00000247881, 0.111444857817, 9.82847598e-10),
        ("pp-d", 1.01838386010, 1.83829638290, 2.76900536881),
        ("pp-pd", 1.04394916959, 2.32569936046, 4.58787205567),
    ],
)


@CIRCLE
def test_circle_reaches_the_continuous_solution_as_sampling_refines(scheme, r, theta, rate):
    """Table 6.2 at t = 0.5 s, r_c = 1 m, 5 m/s along the circle."""
    state, coarse, fine = continuous(f"minimum-distance+{scheme}@curve", circle(size=2.0), (1.0, 0.0), (0.0, 5.0), 0.5)
    hip, velocity = state[:2], state[2:]
    assert np.hypot(*hip) == pytest.approx(r, abs=2e-6)
    assert np.arctan2(hip[1], hip[0]) == pytest.approx(theta, abs=2e-6)
    assert (hip[0] * velocity[1] - hip[1] * velocity[0]) / (hip @ hip) == pytest.approx(rate, abs=2e-5)
    assert np.max(fine) < 0.6 * np.max(coarse)


@CIRCLE
def test_the_robot_under_feedback_linearisation_reaches_it_too(scheme, r, theta, rate):
    """Table 6.2 again, r_c = 0.1 m and 0.5 m/s: exactly a tenth of it, on the parallelogram (6.17)."""
    robot = {"device": Parallelogram2(), "inner_loop": InnerLoop.LINEARISED}
    state, coarse, fine = continuous(
        f"minimum-distance+{scheme}@curve", circle(size=0.2), (0.1, 0.0), (0.0, 0.5), 0.5, **robot
    )
    hip, velocity = state[:2], state[2:]
    assert np.hypot(*hip) == pytest.approx(0.1 * r, abs=2e-7)
    assert np.arctan2(hip[1], hip[0]) == pytest.approx(theta, abs=2e-6)
    assert (hip[0] * velocity[1] - hip[1] * velocity[0]) / (hip @ hip) == pytest.approx(rate, abs=2e-5)
    assert np.max(fine) < 0.6 * np.max(coarse)


@pytest.mark.parametrize(
    ("scheme", "y1", "y2", "rate1", "rate2"),
    [
        ("pp", 0.5, -0.43960172525948, 3.0, 1.8371612815547),
        ("pp-d", 0.5, 6.8715367402718e-5, 3.0, -1.4038703463303e-3),
        ("pp-pd", 0.5, 6.8715367402718e-5, 3.0, -1.4038703463303e-3),
        ("transversal", 0.5, 6.8715367402718e-5, 3.0, -1.4038703463303e-3),
        ("pp-v", -0.93288590605346, 6.8715367402718e-5, 5.8971148e-10, -1.4038703463303e-3),
    ],
)
def test_line_reaches_the_closed_form_as_sampling_refines(scheme, y1, y2, rate1, rate2):
    """Table 6.1 at t = 0.5 s from (-1, 0) with (3, 10) m/s."""
    state, _, _ = continuous(f"constraint+{scheme}", line(), (-1.0, 0.0), (3.0, 10.0), 0.5)
    np.testing.assert_allclose(state, [y1, y2, rate1, rate2], atol=2e-5)


def test_a_held_spring_grows_as_its_sampled_eigenvalue_says():
    """PP alone at 1 kHz: |z| = 1.000124992188 a tick, so an undamped loop gains energy."""
    dt, ticks = 1e-3, 4000
    scene = Scene(model=line(), stiffness=K, mass=1.0, bilateral=True)
    start = Experiment(ticks * dt, np.array([0.0, 1e-3]), np.zeros(2), np.zeros(1), np.zeros((1, 2)))
    recording = simulate_closed_loop(resolve("constraint")(scene), start, scene, dt)
    # The quadratic form of the sampled map y+ = y + T v - a y/2, v+ = v - a y/T is multiplied by z z* a tick.
    a = K * dt * dt
    y, v = recording.hip[:, 1], recording.velocity[:, 1] * dt
    form = a * y**2 + v**2 - 0.5 * a * y * v
    growth = (form[-1] / form[0]) ** (1.0 / (2 * ticks))
    assert growth == pytest.approx(1.000124992188, abs=1e-12)


def test_centripetal_error_of_a_steady_orbit():
    """PP+PD settles on r = 1.043947486858864 (K_p r^3 (r - r_c) = L^2) in the limit of no sampling."""
    state, _, _ = continuous("minimum-distance+pp-pd@curve", circle(size=2.0), (1.0, 0.0), (0.0, 5.0), 2.0)
    assert np.hypot(*state[:2]) == pytest.approx(1.04394748686, abs=2e-6)


class Constant:
    def __init__(self, force):
        self.force = np.array(force)

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        return Response(hip, self.force)


@given(
    force=st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    slope=st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    mass=st.floats(0.05, 5.0),
)
def test_a_point_mass_integrates_a_ramp_exactly(force, slope, mass):
    """With a constant renderer and a linear push the motion is a cubic, whatever the sampling."""
    force, slope = np.array(force), np.array(slope)
    ramp = Experiment(
        0.5, np.zeros(2), np.array([0.3, -0.1]), np.array([0.0, 0.5]), np.array([[0.0, 0.0], 0.5 * slope])
    )
    recording = simulate_closed_loop(Constant(force), ramp, Scene(model=line(), mass=mass), 0.01)
    t = recording.time[:, None]
    expected = np.array([0.3, -0.1]) * t + (force * t**2 / 2 + slope * t**3 / 6) / mass
    np.testing.assert_allclose(recording.hip, expected, atol=1e-12 * (1 + np.abs(expected).max()))
    moved = mass * np.diff(recording.velocity, axis=0)
    pushed = 0.01 * (recording.force + recording.channels["operator_force"])[:-1]
    np.testing.assert_allclose(moved, pushed, atol=1e-12)


def test_a_loop_that_runs_away_is_stopped_at_its_tick(refused):
    class Explosive:
        def reset(self, hip):
            pass

        def step(self, hip, velocity, dt):
            return Response(hip, 1e9 * hip)

    push = Experiment(1.0, np.array([1e-3, 0.0]), np.zeros(2), np.zeros(1), np.zeros((1, 2)))
    recording = simulate_closed_loop(Explosive(), push, Scene(model=line(), mass=0.1), 1e-3)
    ended = recording.meta["ended"]
    assert (ended["tick"], ended["ran_away"]) == (len(recording), True)
    assert "ran away" in ended["what"]
    far = replace(push, position=np.array([1e12, 0.0]))
    with refused(RunawayError):
        simulate_closed_loop(Explosive(), far, Scene(model=line(), mass=0.1), 1e-3)


@pytest.mark.parametrize("effects", [{}, {"encoder_step": 1e-4}])
def test_a_loop_far_from_the_origin_runs_as_one_at_it(effects):
    """What running away means is measured from the start: coordinates of 1e6 m leave 1e-10 m to be told."""
    square = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    found = []
    for origin in (np.zeros(2), np.array([1e6, -1e6])):
        scene = Scene(model=make_model("polygon", vertices=(square + origin).tolist()), damping=5.0)
        scene = replace(scene, effects=read_effects({"imperfections": effects})[1])
        push = Experiment(
            0.2, origin + np.array([0.01, 0.0505]), np.array([0.05, -0.1]), np.zeros(1), np.array([[0.0, -1.0]])
        )
        found.append(simulate_closed_loop(resolve("minimum-distance")(scene), push, scene, 1e-3).hip - origin)
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)
    assert found[0][:, 1].min() < 0.05


@pytest.mark.parametrize("origin", [0.0, 1e6])
@pytest.mark.parametrize("size", [1e-2, 0.2])
@pytest.mark.parametrize("effects", [{}, {"velocity_cutoff": 400.0}])
def test_a_loop_runs_away_at_a_million_model_sizes_wherever_it_is(origin, size, effects):
    class Explosive:
        def reset(self, hip):
            self.hip = hip

        def step(self, hip, velocity, dt):
            return Response(hip, 1e9 * (hip - origin))

    vertices = origin + size * np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    scene = Scene(
        model=make_model("polygon", vertices=vertices.tolist()), effects=read_effects({"imperfections": effects})[1]
    )
    push = Experiment(1.0, np.array([origin + 1e-3, origin]), np.zeros(2), np.zeros(1), np.zeros((1, 2)))
    recording = simulate_closed_loop(Explosive(), push, scene, 1e-3)
    assert recording.meta["ended"]["ran_away"]
    assert 0 < len(recording) < 10
    assert abs(recording.hip[-1, 0] - origin) < 1e6 * size


@compiled
def counting_spring(data, hip, velocity, push, dt, ihip, force):
    """A spring and a damper to the origin that counts its ticks, refuses beyond a radius and breaks at a tick."""
    reals, memory = data.params, data.state
    memory[0] += 1.0
    distance = 0.0
    for i in range(hip.shape[0]):
        distance += hip[i] * hip[i]
        ihip[i] = memory[0] * 1e-6
        force[i] = -reals[0] * hip[i] - reals[1] * velocity[i] - 0.5 * push[i]
    if distance > reals[2] * reals[2]:
        return 2
    if memory[0] > reals[3]:
        force[0] = np.nan
    return 0


class Spring:
    """`counting_spring` with its law, or in Python without."""

    domain_exits = {2: "beyond the radius"}  # noqa: RUF012

    def __init__(self, *, law, stiffness=300.0, damping=3.0, radius=1e3, breaks=1e9):
        self.data = law_data((stiffness, damping, radius, breaks), state=1)
        if law:
            self.law = CompiledStep(counting_spring, self.data, self.domain_exits)

    def reset(self, hip):
        self.data.state[:] = 0.0
        self.push = np.zeros(hip.size)

    def observe_force(self, push):
        self.push = push

    def step(self, hip, velocity, dt):
        ihip, force = np.empty_like(hip), np.empty_like(hip)
        number = counting_spring(self.data, hip, velocity, self.push, dt, ihip, force)
        if number:
            raise DomainError(self.domain_exits[number])
        return Response(ihip, force)


DEVICES = (PointMass(0.3), PointMass(0.3, 3), Parallelogram2(), Parallelogram3())
EFFECTS = {
    "none": (),
    "all": (
        Encoder(ENCODER_STEP),
        VelocityFilter(80.0),
        Saturation(0.5),
        Delay(1.4e-3),
        JointFriction(0.02),
        ForceSensor(step=0.01, noise=0.02, cutoff=300.0, seed=3),
    ),
}


def trial(size, *, hand=False, push=0.0, duration=0.1, speed=0.3):
    position, velocity, way = np.zeros(size), np.zeros(size), np.zeros((3, size))
    position[0], velocity[1] = 0.02, speed
    way[:, :2] = (0.02, 0.0), (0.05, 0.02), (0.0, 0.03)
    grip = Hand(path=Path(np.linspace(0.0, duration, 3), way), stiffness=300.0, damping=3.0) if hand else None
    force = np.zeros((2, size))
    force[1] = push
    return Experiment(duration, position, velocity, np.array([0.0, duration]), force, grip)


def same(one, other):
    assert one.channels.keys() == other.channels.keys()
    assert dict(one.meta) == dict(other.meta)
    assert np.array_equal(one.time, other.time)
    for name, values in one.channels.items():
        assert np.array_equal(values, other.channels[name]), name


@pytest.mark.parametrize("effects", EFFECTS)
@pytest.mark.parametrize("hand", [False, True], ids=["pushed", "drawn"])
@settings(deadline=None, max_examples=15)
@given(
    device=st.sampled_from(DEVICES),
    loop=st.sampled_from(InnerLoop),
    stiffness=st.floats(0.0, 500.0),
    push=st.floats(0.1, 3.0),
)
def test_a_compiled_law_gives_the_numbers_of_its_renderer_in_python(effects, hand, device, loop, stiffness, push):
    """To the last bit, in every channel; and the loop of the plain point mass is the same in either way."""
    scene = Scene(model=line(), mass=1.0, device=device, inner_loop=loop, effects=EFFECTS[effects])
    pushed = trial(device.dimension, hand=hand, push=push)
    runs = [simulate_closed_loop(Spring(law=law, stiffness=stiffness), pushed, scene, 1e-3) for law in (True, False)]
    same(*runs)
    assert len(runs[0]) == 101


@pytest.mark.parametrize("law", [True, False], ids=["compiled", "python"])
@pytest.mark.parametrize("device", DEVICES, ids=lambda device: f"{device.name}{device.dimension}")
def test_a_refusal_ends_the_run_at_its_tick(law, device):
    scene = Scene(model=line(), mass=1.0, device=device)
    away = trial(device.dimension, push=0.1, speed=0.5)
    whole = simulate_closed_loop(Spring(law=law, stiffness=0.0, damping=0.0), away, scene, 1e-3)
    ended = simulate_closed_loop(Spring(law=law, stiffness=0.0, damping=0.0, radius=0.03), away, scene, 1e-3)
    tick = int(np.argmax(np.linalg.norm(whole.hip, axis=1) > 0.03))
    assert 0 < tick == len(ended)
    told = dict(ended.meta["ended"])
    why = told.pop("why")
    assert told == {"tick": tick, "time": whole.time[tick], "what": "beyond the radius"}
    if law:
        place = ", ".join(f"{x:.6g}" for x in whole.hip[tick])
        assert why == f"the hand is at ({place}) m, where the renderer is not defined"
    for name, values in ended.channels.items():
        assert np.array_equal(values, whole.channels[name][:tick])
    assert "ended" not in whole.meta


@pytest.mark.parametrize("law", [True, False], ids=["compiled", "python"])
@pytest.mark.parametrize("device", DEVICES[1:3], ids=lambda device: device.name)
def test_a_refusal_at_the_start_is_an_error(refused, law, device):
    with refused(DomainError):
        simulate_closed_loop(
            Spring(law=law, radius=0.01), trial(device.dimension), Scene(model=line(), device=device), 1e-3
        )


@pytest.mark.parametrize("law", [True, False], ids=["compiled", "python"])
def test_an_answer_that_is_not_finite_is_told_with_its_tick(refused, law):
    scene = Scene(model=line(), device=Parallelogram2())
    with refused(RendererError) as caught:
        simulate_closed_loop(Spring(law=law, breaks=7), trial(2), scene, 1e-3)
    assert caught.value.tick == 7


@pytest.mark.parametrize("law", [True, False], ids=["compiled", "python"])
def test_a_robot_that_leaves_its_workspace_ends_the_run(law):
    """Driven outwards at 0.9 m/s it meets a joint limit; all recorded joints are inside, the next are not."""
    device = Parallelogram2()
    scene = Scene(model=line(), mass=1.0, device=device)
    recording = simulate_closed_loop(
        Spring(law=law, stiffness=-200.0, damping=0.0), trial(2, duration=2.0, speed=0.9), scene, 1e-3
    )
    assert 0 < len(recording) == recording.meta["ended"]["tick"] < 2001
    assert recording.meta["ended"]["time"] == pytest.approx(1e-3 * len(recording))
    joints = recording.channels["joint_position"]
    assert all(device.margin(q) > 0.0 for q in joints)
    beyond = joints[-1] + 1e-3 * recording.channels["joint_velocity"][-1]
    assert device.margin(beyond) < 0.1 * device.margin(joints[0])
    assert "parallelogram-2dof" in recording.meta["ended"]["what"]


def test_a_start_outside_of_the_workspace_is_an_error(refused):
    scene = Scene(model=line(), device=Parallelogram2())
    outside = Experiment(0.1, np.array([2.0, 0.0]), np.zeros(2), np.zeros(1), np.zeros((1, 2)))
    with refused(DomainError):
        simulate_closed_loop(Spring(law=True), outside, scene, 1e-3)


def test_an_experiment_in_another_dimension_than_the_device_is_an_error(refused):
    with refused(InputError):
        simulate_closed_loop(Spring(law=True), trial(2), Scene(model=line(), device=Parallelogram3()), 1e-3)


@pytest.mark.parametrize("device", DEVICES, ids=lambda device: f"{device.name}{device.dimension}")
def test_an_experiment_starts_where_and_as_fast_as_it_says(device):
    started = trial(device.dimension)
    recording = simulate_closed_loop(Spring(law=True), started, Scene(model=line(), device=device), 1e-3)
    np.testing.assert_allclose(recording.hip[0], started.position, atol=1e-15)
    np.testing.assert_allclose(recording.velocity[0], started.velocity, atol=1e-15)


@settings(deadline=None, max_examples=25)
@given(
    device=st.sampled_from(DEVICES),
    stiffness=st.floats(1.0, 2000.0),
    damping=st.floats(0.0, 20.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_hand_at_rest_is_passive(device, stiffness, damping, seed):
    """With no renderer's force, kinetic energy and that in the hand's grip only fall, to the accuracy of the motion."""
    rng = np.random.default_rng(seed)
    size = device.dimension
    position, velocity = 0.03 * rng.standard_normal(size), 0.5 * rng.standard_normal(size)
    home = 0.02 * rng.standard_normal(size)
    grip = Hand(path=Path([0.0, 1.0], [home, home]), stiffness=stiffness, damping=damping)
    held = Experiment(0.1, position, velocity, np.zeros(1), np.zeros((1, size)), grip)
    recording = simulate_closed_loop(Constant(np.zeros(size)), held, Scene(model=line(), device=device), 1e-3)
    joints = recording.channels.get("joint_position", recording.hip)
    rates = recording.channels.get("joint_velocity", recording.velocity)
    kinetic = np.array([0.5 * v @ device.inertia(q) @ v for q, v in zip(joints, rates, strict=True)])
    energy = kinetic + 0.5 * stiffness * np.sum((recording.hip - home) ** 2, axis=1)
    assert np.diff(energy).max() <= 4e-9 * energy.max()


def test_the_hand_s_force_is_its_mean_over_the_tick():
    """Momentum: what the point mass gains in a tick is the force's impulse, the operator's and the renderer's."""
    drawn = trial(2, hand=True, push=1.0)
    recording = simulate_closed_loop(Spring(law=True), drawn, Scene(model=line(), mass=0.3), 1e-3)
    gained = 0.3 * np.diff(recording.velocity, axis=0)
    given_ = 1e-3 * (recording.force + recording.channels["operator_force"])[:-1]
    assert np.abs(gained - given_).max() < 1e-8 * np.abs(gained).max()


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), hand=st.booleans())
def test_the_point_mass_is_linear_in_force(seed, hand):
    """From rest at the origin, the answer to the sum of two pushes is the sum of the answers."""
    one, two = np.random.default_rng(seed).standard_normal((2, 5, 2))
    times = np.linspace(0.0, 0.1, 5)
    grip = Hand(path=Path([0.0, 1.0], np.zeros((2, 2))), stiffness=200.0, damping=1.0) if hand else None

    def hips(force):
        pushed = Experiment(0.1, np.zeros(2), np.zeros(2), times, force, grip)
        return simulate_closed_loop(Spring(law=True), pushed, Scene(model=line(), mass=0.3), 1e-3).hip

    size = np.abs(hips(one)).max() + np.abs(hips(two)).max()
    # Each tick is exact, or with a hand true to 1e-9 between samples: a hundred of them in a stable loop.
    assert np.abs(hips(one + two) - hips(one) - hips(two)).max() <= (1e-7 if hand else 1e-12) * size


def test_a_hand_draws_any_recording_s_path():
    """m e'' + b e' + k e = m y_d'', critically damped: |e| <= m a / k, and a dt / (w exp 1) for the path's corners."""
    angle = np.linspace(0.0, 2.0 * np.pi, 1001)
    drawn = simulate_closed_loop(
        Constant(np.zeros(2)), trial(2, push=1.0, duration=0.5), Scene(model=line(), mass=0.3), 1e-3
    )
    circle_ = 0.05 * np.column_stack([np.cos(angle), np.sin(angle)])
    stiffness, mass = 5000.0, 0.1
    omega = np.sqrt(stiffness / mass)
    for time, path in ((drawn.time, drawn.hip), (1e-3 * np.arange(1001), circle_)):
        rate = np.diff(path, axis=0) / 1e-3
        hand = Hand(path=Path(time, path), stiffness=stiffness, damping=2.0 * np.sqrt(stiffness * mass))
        led = Experiment(float(time[-1]), path[0], rate[0], np.zeros(1), np.zeros((1, 2)), hand)
        recording = simulate_closed_loop(Constant(np.zeros(2)), led, Scene(model=line(), mass=mass), 1e-3)
        bend = np.abs(np.diff(rate, axis=0) / 1e-3).max()
        bound = np.sqrt(2.0) * bend * (mass / stiffness + 1e-3 / (omega * np.e))
        assert np.linalg.norm(recording.hip - path, axis=1).max() <= bound
        assert bound < 2e-3


class RefusesLate:
    """Refuses the scene at a tick of its own."""

    def __init__(self, tick):
        self.tick = tick

    def reset(self, hip):
        self.answers = 0

    def step(self, hip, velocity, dt):
        self.answers += 1
        if self.answers > self.tick:
            raise RefusalError("this scene", why="it is not for it")
        return Response(hip, 0.0 * hip)


@pytest.mark.parametrize("device", [PointMass(0.3), Parallelogram2()], ids=["point-mass", "robot"])
def test_a_refusal_after_the_first_tick_of_a_loop_is_the_renderer_s_fault(refused, device):
    scene = Scene(model=line(), device=device)
    with pytest.raises(RefusalError):
        simulate_closed_loop(RefusesLate(0), trial(2), scene, 1e-3)
    with refused(RendererError) as caught:
        simulate_closed_loop(RefusesLate(7), trial(2), scene, 1e-3)
    assert caught.value.tick == 7
