"""Coulomb friction on the answers of any renderer: closed forms, cone, energy, corners, and the same bits."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import honest
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from leading import led

from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.friction import Friction
from hapticeval.effects.lugre import LuGre
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.experiments import build_path
from hapticeval.stimulus.stimulus import Path

DEPTH, STIFFNESS = 1e-3, 1000.0
SQUARE = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.0], [0.0, 0.0], [0.0, 0.1], [-0.1, 0.1]]


def scene_of(kind, *effects, model=None, **more):
    return Scene(model=make_model(kind, **(model or {})), effects=effects, **more)


def answers(scene, hips, *, base="minimum-distance", dt=1e-3):
    """IHIPs and forces along HIPs that start in free space."""
    return led(make_renderer(resolve(base), scene), np.asarray(hips, dtype=float), dt)


def to_and_fro(laps=2, rate=1000, depth=DEPTH):
    """A hand that is pressed into a plane and led 10 mm to either side, `laps` times in 2 s each."""
    time = np.arange(2 * laps * rate + 1) / rate
    hips = np.column_stack([0.01 * np.sin(np.pi * time), np.full(time.size, -depth)])
    return np.vstack([[[0.0, depth]], hips])


def work(hips, forces, rows):
    """Of the hand, J, with the force as a motor holds it, and by trapezoids."""
    moved, held = np.diff(hips, axis=0)[rows], forces[:-1][rows]
    mean = 0.5 * (forces[1:] + forces[:-1])[rows]
    return -np.sum(held * moved), -np.sum(mean * moved)


# Closed forms on a plane


@pytest.mark.parametrize(
    ("friction", "held", "trapezoids", "closed"),
    [
        (Friction(0.5, 0.5), 18.991e-3, 19.0e-3, True),
        (Friction(0.5, 0.3), 11.677e-3, 11.68e-3, True),
        (Friction(0.5, 0.3, stick=1.0), 15.046e-3, 15.053e-3, False),
        (Friction(0.3, 0.3), 11.636e-3, 11.64e-3, True),
    ],
)
def test_a_cycle_s_work(friction, held, trapezoids, closed):
    """mu_s = mu_k: 4 mu K d (A - mu d). Else each half has a jump, K d^2 (mu_s^2 - mu_k^2) / 2, and a slide."""
    hips = to_and_fro()
    _, forces = answers(scene_of("line", friction), hips)
    found = work(hips, forces, slice(-2000, None))
    assert found[0] == pytest.approx(held, rel=1e-3)
    assert found[1] == pytest.approx(trapezoids, rel=2e-4)
    s, k = friction.mu_s, friction.mu_k
    form = STIFFNESS * DEPTH * (DEPTH * (s**2 - k**2) + 2.0 * k * (0.02 - (s + k) * DEPTH))
    assert (found[1] == pytest.approx(form, rel=2e-4)) == closed
    if s == k:
        assert form == pytest.approx(4.0 * s * STIFFNESS * DEPTH * (0.01 - s * DEPTH))


@pytest.mark.parametrize("speed", [0.047, 0.031, 0.013])
def test_the_letter_of_the_thesis_is_a_sawtooth(speed):
    """From mu_k up by v dt / d a tick to mu_s: v / ((mu_s - mu_k) d) teeth a second, but for whole ticks."""
    hips = np.column_stack([speed * 1e-3 * np.arange(3000), np.full(3000, -DEPTH)])
    hips[0] = 0.0, DEPTH
    steps = math.floor(0.2 * DEPTH / (speed * 1e-3)) + 1
    _, forces = answers(scene_of("line", Friction(0.5, 0.3, stick=1.0)), hips)
    share = -forces[1000:, 0] / forces[1000:, 1]
    teeth = np.flatnonzero(np.diff(share) < 0.0)
    assert set(np.diff(teeth)) == {steps}
    assert share.mean() == pytest.approx(0.3 + 0.5 * (steps - 1) * speed * 1e-3 / DEPTH, rel=1e-3)
    _, forces = answers(scene_of("line", Friction(0.5, 0.3)), hips)
    np.testing.assert_allclose(-forces[1000:, 0] / forces[1000:, 1], 0.3, rtol=1e-12)


def test_the_example_of_the_thesis():
    """K = 1000, mu = 0.5 / 0.3, on a plane: inside the static cone it sticks, outside it goes to the kinetic one."""
    scene = scene_of("line", Friction(0.5, 0.3))
    for x, ihip, force in ((0.4e-3, 0.0, (-0.4, 1.0)), (0.6e-3, 0.3e-3, (-0.3, 1.0))):
        ihips, forces = answers(scene, [[0.0, 1e-3], [0.0, -DEPTH], [x, -DEPTH]])
        np.testing.assert_allclose(ihips[2], [ihip, 0.0], atol=1e-18)
        np.testing.assert_allclose(forces[2], force, rtol=1e-13)


def test_who_turns_back_sticks_at_a_share_of_the_kinetic_cone():
    """Sliding at 0.3, the hand turns: beyond 0.6 of that the tool needs 0.5 to break loose again, before it 0.3."""
    for back, loose in ((0.1e-3, 0.3), (0.15e-3, 0.5)):
        way = np.concatenate([np.arange(0.0, 2e-3, 1e-5), 2e-3 - np.arange(0.0, back, 1e-5)])
        way = np.concatenate([way, np.arange(2e-3 - back, 4e-3, 1e-5)])
        hips = np.vstack([[0.0, DEPTH], np.column_stack([way, np.full(way.size, -DEPTH)])])
        _, forces = answers(scene_of("line", Friction(0.5, 0.3)), hips)
        share = -forces[:, 0] / np.maximum(forces[:, 1], 1e-9)
        assert share[250:].max() == pytest.approx(loose, abs=0.011)


# Any surface, any renderer


def wander(seed, dimension):
    """A hand that wanders in and out of the surface of a model of 0.2 m, in steps of up to 0.4 mm."""
    rng = np.random.default_rng(seed)
    start = rng.normal(size=dimension)
    start *= 0.1005 / np.linalg.norm(start)
    velocity, point, points = np.zeros(dimension), start, [start]
    for push in rng.normal(0.0, 4e-5, (400, dimension)):
        velocity = 0.98 * velocity + push - 2e-3 * (np.linalg.norm(point) - 0.0985) * point / np.linalg.norm(point)
        velocity *= min(1.0, 4e-4 / max(np.linalg.norm(velocity), 1e-12))
        point = point + velocity
        points.append(point)
    return np.array(points)


SEEDS = st.integers(0, 2**31)
FRICTIONS = st.builds(
    lambda mu_s, share, stick: Friction(mu_s, share * mu_s, stick),
    st.floats(0.05, 2.0), st.floats(0.0, 1.0), st.sampled_from([0.3, 0.6, 1.0]),
)  # fmt: skip


@pytest.mark.parametrize("kind", ["circle", "ellipse", "star", "sphere", "torus"])
@settings(max_examples=25)
@given(friction=FRICTIONS, seed=SEEDS)
# mu_k F_n is a billionth of the force that it is a part of
@example(friction=Friction(mu_s=1.0, mu_k=1.18e-9, stick=0.3), seed=33)
# on the star the nearest point jumps past a tip, and the hand pulls the tool away from it
@example(friction=Friction(mu_s=0.05, mu_k=0.02, stick=0.3), seed=14)
# and nothing at all, and a number that is none when it is multiplied
@example(friction=Friction(mu_s=1.0, mu_k=0.0, stick=0.3), seed=33)
@example(friction=Friction(mu_s=1.0, mu_k=1e-320, stick=0.3), seed=33)
def test_the_cone_is_never_left_and_the_hand_gets_no_more_than_a_held_spring_gives(kind, friction, seed):
    model = make_model(kind)
    hips = wander(seed, model.dimension)
    recording = play(make_renderer(resolve("minimum-distance"), scene := Scene(model=model, effects=(friction,))),
                     Path(1e-3 * np.arange(len(hips)), hips), 1e-3, scene=scene)  # fmt: skip
    moved = np.diff(hips, axis=0)
    gained = np.cumsum(np.sum(recording.force[:-1] * moved, axis=1))
    assert np.all(gained <= 0.5 * STIFFNESS * np.cumsum(np.sum(moved**2, axis=1)) + 1e-12)
    np.testing.assert_allclose(recording.force, STIFFNESS * (recording.ihip - hips), atol=1e-11)
    for check in ("friction-cone", "friction-break-away", "friction-sticking", "friction-sliding", "friction-energy"):
        finding = OWN_CHECKS[check](Runs(recording), scene)
        assert finding.outcome is not Outcome.FAIL, finding.message


@settings(max_examples=25)
@given(angle=st.floats(0.0, 2.0 * np.pi), seed=SEEDS)
def test_a_turned_hand_gets_the_turned_answer(angle, seed):
    scene = scene_of("circle", Friction(0.6, 0.4))
    hips = wander(seed, 2)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    ihips, forces = answers(scene, hips)
    turned = answers(scene, hips @ turn.T)
    np.testing.assert_allclose(turned[0], ihips @ turn.T, atol=1e-12)
    np.testing.assert_allclose(turned[1], forces @ turn.T, atol=1e-9)


@pytest.mark.parametrize("base", ["constraint@curve", "minimum-distance+square-root", "mapping", "constraint"])
def test_any_renderer_s_answers_get_it(base):
    """Round a circle at 2 mm: at rest in the kinetic cone of the renderer's own normal force."""
    angle = np.linspace(0.0, 1.2, 900)
    hips = np.column_stack([np.cos(angle), np.sin(angle)]) * np.r_[0.1005, np.full(899, 0.098)][:, np.newaxis]
    scene = scene_of("circle", Friction(0.5, 0.3))
    ihips, forces = answers(scene, hips, base=base)
    normal = ihips / np.linalg.norm(ihips, axis=1)[:, np.newaxis]
    across = np.sum(forces * normal, axis=1)
    along = normal[:, 0] * forces[:, 1] - normal[:, 1] * forces[:, 0]
    np.testing.assert_allclose(along[100:], -0.3 * across[100:], rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(ihips[1:], axis=1), 0.1, rtol=1e-12)


def test_no_friction_is_left_of_a_renderer_that_pulls():
    """With a damper a hand that leaves fast is pulled back: the tool is where the renderer has it then."""
    scene = scene_of("line", Friction(0.5, 0.5), damping=30.0)
    hips = [[0.0, 1e-3], [0.0, -1e-3], [0.3e-3, -1e-3], [0.6e-3, -0.5e-3]]
    velocities = np.diff(hips, axis=0, prepend=hips[:1]) / 1e-3
    renderer = make_renderer(resolve("minimum-distance+pp-pd"), scene)
    renderer.reset(np.array(hips[0]))
    found = [renderer.step(np.array(hip), velocity, 1e-3) for hip, velocity in zip(hips, velocities, strict=True)]
    assert found[2].ihip[0] == 0.0
    assert found[3].force[1] < 0.0
    assert (found[3].ihip[0], found[3].force[0]) == (0.6e-3, 0.0)


@pytest.mark.parametrize("effect", [Friction(0.5, 0.3), ViscousFriction(5.0)])
def test_a_tool_that_trails_in_free_space_is_free(effect):
    """An answer of two ticks ago: its IHIP is not the HIP, and there is no contact while it has no force."""
    scene = scene_of("line", effect)
    late = honest.factory("late-2", honest.Spring)
    hips = np.column_stack([np.linspace(0.0, 0.02, 60), np.linspace(5e-3, -1e-3, 60)])
    plain, rubbed = (play(make_renderer(late, each), Path(1e-3 * np.arange(60.0), hips), 1e-3)
                     for each in (scene_of("line"), scene))  # fmt: skip
    free = ~np.any(plain.force, axis=1)
    assert 40 < free.sum() < 60
    assert np.array_equal(rubbed.ihip[free], plain.ihip[free])
    assert not rubbed.force[free].any()
    assert np.any(rubbed.force[~free, 0])


def test_who_gives_no_ihip_gets_the_tool_s_place():
    """A renderer that answers the HIP as its IHIP: the press is its force across the surface."""
    scene = scene_of("circle", Friction(0.5, 0.3))
    angle = np.linspace(0.0, 0.4, 200)
    hips = np.column_stack([np.cos(angle), np.sin(angle)]) * np.r_[0.101, np.full(199, 0.098)][:, np.newaxis]
    runs = [play(make_renderer(make, scene), Path(1e-3 * np.arange(200.0), hips), 1e-3)
            for make in (honest.Spring, honest.factory("force-only", honest.Spring))]  # fmt: skip
    np.testing.assert_allclose(runs[0].force, runs[1].force, atol=1e-12)
    np.testing.assert_allclose(runs[0].ihip, runs[1].ihip, atol=1e-15)


def test_in_a_corner_both_sides_hold():
    """Drawn into a concave corner and up its other side, the tool rests in the corner, and then climbs."""
    scene = scene_of("polygon", Friction(0.5, 0.3), model={"vertices": SQUARE})
    corners = np.array([[0.02, 0.001], [0.02, -0.0015], [-0.0015, -0.0015], [-0.0015, 0.02], [0.001, 0.02]])
    path = Path(np.array([0.0, 0.1, 0.6, 1.1, 1.2]), corners)
    run = play(make_renderer(resolve("minimum-distance"), scene), path, 1e-3, scene=scene)
    climbs = np.flatnonzero(run.ihip[:, 1] > 1e-3)[0]
    assert np.linalg.norm(run.ihip[600:climbs], axis=1).min() < 1e-12
    assert np.all(np.abs(run.ihip[120:climbs, 1]) < 1.1e-3)
    assert OWN_CHECKS["friction-cone"](Runs(run), scene).outcome is Outcome.PASS


class Scripted:
    """Answers what it was given, tick by tick: points on the surface, and 1 N along the normal there."""

    def __init__(self, ihips, normals):
        self.answers = list(zip(ihips, normals, strict=True))

    def reset(self, hip):
        self.tick = 0

    def step(self, hip, velocity, dt):
        ihip, force = self.answers[self.tick]
        self.tick += 1
        return Response(ihip, force)


@pytest.mark.parametrize("number", [0, 1])
def test_a_tool_that_is_led_past_a_corner_rests_in_it(number):
    """A renderer's IHIP passes a tip, or a valley, between two ticks: the tool goes there, where both faces hold it."""
    scene = scene_of("star", Friction(0.5, 0.5))
    corner = scene.model.curve.corners[number]
    faces = (corner.tangent_pre, corner.normal_pre, -4e-4), (corner.tangent_post, corner.normal_post, 2.5e-4)
    ihips = [corner.position + length * tangent for tangent, _, length in faces]
    normals = [normal for _, normal, _ in faces]
    hips = [ihip - 1e-3 * normal for ihip, normal in zip(ihips, normals, strict=True)]
    renderer = make_renderer(lambda _: Scripted(ihips, normals), scene)
    renderer.reset(hips[0])
    _, found = (renderer.step(hip, np.zeros(2), 1e-3) for hip in hips)
    np.testing.assert_allclose(found.ihip, corner.position, atol=1e-15)
    np.testing.assert_allclose(found.force, normals[1] + STIFFNESS * (corner.position - ihips[1]), atol=1e-7)


@pytest.mark.parametrize("base", ["mapping", "minimum-distance@lut", "constraint"])
def test_round_tips_and_valleys_the_cone_holds(base):
    scene = scene_of("star", Friction(0.5, 0.5))
    path = build_path({"kind": "scaled", "depth": 2e-3, "from_angle": 0, "to_angle": 170, "duration": 2.0},
                      scene.model.boundary, FilePath())  # fmt: skip
    run = play(make_renderer(resolve(base), scene), path, 1e-3, scene=scene)
    assert OWN_CHECKS["friction-cone"](Runs(run), scene).outcome is Outcome.PASS


@pytest.mark.parametrize("hip", [-1e-3, 1e-3])
def test_a_surface_that_holds_from_both_sides_rubs_from_both(hip):
    scene = scene_of("line", Friction(0.5, 0.3), bilateral=True)
    hips = np.column_stack([np.linspace(0.0, 5e-3, 200), np.full(200, hip)])
    _, forces = answers(scene, hips)
    np.testing.assert_allclose(forces[150:, 0], -0.3, rtol=1e-12)
    np.testing.assert_allclose(forces[150:, 1], -1e3 * hip, rtol=1e-12)


# What is refused


@pytest.mark.parametrize(
    "numbers",
    [
        {"mu_s": -0.1, "mu_k": 0.1},
        {"mu_s": 0.3, "mu_k": 0.5},
        {"mu_s": float("nan"), "mu_k": 0.1},
        {"mu_s": math.inf, "mu_k": 0.1},
        {"mu_s": 0.5, "mu_k": 0.5, "stick": 0.0},
        {"mu_s": 0.5, "mu_k": 0.5, "stick": 1.2},
        {"mu_s": 0.5},
        {"mu_s": "rough", "mu_k": 0.1},
    ],
)
def test_what_is_no_friction_is_refused(refused, numbers):
    with refused(InputError):
        make_effect({"kind": "friction", **numbers})


def test_two_models_of_dry_friction_are_refused_and_none_is_left_out(refused):
    lugre = LuGre(0.5, 0.4, stribeck=0.01, stiffness=1e3, damping=1.0, viscosity=1.0)
    for effects in ((Friction(0.5, 0.3), lugre), (lugre, Friction(0.5, 0.3)), (ViscousFriction(1.0), lugre)):
        with refused(InputError):
            scene_of("line", *effects)
    assert scene_of("line", Friction(0.0, 0.0), ViscousFriction(0.0), lugre).effects == (lugre,)


# Viscous friction


@pytest.mark.parametrize("kind", ["circle", "sphere"])
def test_viscous_friction_brakes_the_hand_along_the_surface(kind):
    scene = scene_of(kind, ViscousFriction(3.0))
    hips = np.zeros((50, scene.model.dimension))
    hips[:, 0], hips[:, 1] = np.r_[0.101, np.full(49, 0.098)], np.linspace(0.0, 5e-3, 50)
    plain = answers(scene_of(kind), hips)
    ihips, forces = answers(scene, hips)
    velocity = np.diff(hips, axis=0, prepend=hips[:1]) / 1e-3
    normal = ihips / np.linalg.norm(ihips, axis=1)[:, np.newaxis]
    along = velocity - np.sum(velocity * normal, axis=1)[:, np.newaxis] * normal
    assert np.array_equal(ihips, plain[0])
    np.testing.assert_allclose(forces[1:], (plain[1] - 3.0 * along)[1:], atol=1e-12)
    assert not forces[0].any()
