"""Renderers on triangle meshes: the plane's numbers on an extruded outline, and a rigid tool in corners of solids."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from hand_paths import star_shaped, walks
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from leading import led

from hapticeval.errors import RefusalError
from hapticeval.geometry import solids
from hapticeval.geometry.catalogue import from_vertices, make_model
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.model import Model
from hapticeval.renderers import constraint, minimum_distance
from hapticeval.scene import Scene
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment

DT = 1e-3
BASES = {"minimum-distance": minimum_distance, "constraint": constraint}
each_base = pytest.mark.parametrize("base", BASES.values(), ids=BASES)


def solid(vertices, triangles) -> Model:
    return Model("solid", {}, Mesh("solid", vertices, triangles))


@each_base
@pytest.mark.parametrize("scheme", ["pp", "pp-v", "pp-d", "pp-pd"])
@pytest.mark.parametrize("bilateral", [False, True])
@settings(max_examples=12)
@given(vertices=star_shaped(), hips=walks(), high=st.floats(-0.05, 0.05))
def test_on_an_extruded_outline_it_is_the_plane_s_away_from_the_caps(base, scheme, bilateral, vertices, hips, high):
    plane, space = from_vertices(vertices), solid(*solids.prism(np.asarray(vertices), 2.0))
    # A bilateral tool that begins in a corner, and whose hand leaps to where both ways lead down, may take either.
    begin = plane.boundary.closest_point(hips[:1]).foot[0]
    assume(not bilateral or np.linalg.norm(plane.curve.pieces[:, 3:5] - begin, axis=1).min() > 1e-9)
    variant = base.variant(regulation=scheme, representation="polygon")
    flat_ihips, flat_forces = led(variant(Scene(model=plane, bilateral=bilateral)), hips, DT)
    lifted = np.column_stack([hips, np.full(len(hips), high)])
    ihips, forces = led(variant(Scene(model=space, bilateral=bilateral)), lifted, DT)
    scale = np.abs(flat_forces).max() + 1.0
    np.testing.assert_allclose(ihips[:, :2], flat_ihips, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(ihips[:, 2], high, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(forces[:, :2], flat_forces, rtol=0.0, atol=1e-9 * scale)
    np.testing.assert_allclose(forces[:, 2], 0.0, rtol=0.0, atol=1e-9 * scale)


@each_base
@pytest.mark.parametrize("kind", ["cube", "l-block", "icosphere", "extruded"])
@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_run_is_its_steps_and_its_tool_is_on_the_mesh(base, kind, seed):
    scene = Scene(model=make_model(kind))
    hips = walk_in_space(seed, 60)
    renderer = base.variant(representation="curve")(scene)
    ihips, forces = led(renderer, hips, DT)
    renderer.reset(hips[0])
    for row, hip in enumerate(hips):
        velocity = (hip - hips[max(row - 1, 0)]) / DT
        ihip, force = renderer.step(hip, velocity, DT)
        np.testing.assert_array_equal(ihip, ihips[row])
        np.testing.assert_array_equal(force, forces[row])
    touching = (ihips != hips).any(axis=1)
    np.testing.assert_allclose(scene.model.boundary.signed_distance(ihips[touching]), 0.0, atol=1e-15)
    assert np.all(scene.model.boundary.signed_distance(hips[~touching]) > -1e-12)


def walk_in_space(seed, count):
    random = np.random.default_rng(seed)
    return random.uniform(-0.08, 0.08, 3) + np.cumsum(0.012 * random.normal(size=(count, 3)), axis=0)


def pit(directions, depth=0.05):
    """A block with a pit in its top: the room above planes through (0, 0, -depth), whose normals point into it."""
    rays = np.cross(directions, np.roll(directions, -1, axis=0))
    rim = rays * (depth / rays[:, 2])[:, np.newaxis] + [0.0, 0.0, -depth]
    count, out = len(rim), 0.2 * rim[:, :2] / np.linalg.norm(rim[:, :2], axis=1)[:, np.newaxis]
    top, bottom = (np.column_stack([out, np.full(count, z)]) for z in (0.0, -0.2))
    vertices = np.vstack([rim, top, bottom, [[0.0, 0.0, -depth], [0.0, 0.0, -0.2]]])
    a, a1 = np.arange(count), np.roll(np.arange(count), -1)
    b, b1, c, c1 = a + count, a1 + count, a + 2 * count, a1 + 2 * count
    apex, foot = np.full(count, 3 * count), np.full(count, 3 * count + 1)
    rows = [(a, a1, apex), (b, b1, a1), (b, a1, a), (c, c1, b1), (c, b1, b), (foot, c1, c)]
    return solid(vertices, np.concatenate([np.column_stack(each) for each in rows]))


def closest_in_room(normals, away):
    """The point of the room normals x >= 0 closest to `away`, by all sets of up to three planes; how many hold it."""
    if np.all(normals @ away >= 0.0):
        return away, 0
    best, least, number = away, math.inf, 0
    for count in (1, 2, 3):
        for held in map(list, combinations(range(len(normals)), count)):
            gram = normals[held] @ normals[held].T
            shares = np.linalg.solve(gram, -normals[held] @ away)
            shares -= np.linalg.solve(gram, normals[held] @ (away + shares @ normals[held]))
            point = away + shares @ normals[held]
            if np.all(normals @ point >= -1e-15) and np.all(shares >= 0.0) and np.sum((point - away) ** 2) < least:
                best, least, number = point, np.sum((point - away) ** 2), count
    return best, number


def test_in_a_pit_it_rests_where_an_active_set_programme_does():
    """On one, two or three of its faces: a plane, a concave edge, a corner. The room is convex: there is one place."""
    random, apex = np.random.default_rng(11), np.array([0.0, 0.0, -0.05])
    numbers = []
    for _ in range(25):
        steps = random.uniform(1.0, 1.5, random.integers(3, 6))
        angles = random.uniform(0.0, 6.0) + np.cumsum(steps) * (2.0 * math.pi / steps.sum())
        normals = np.column_stack([np.cos(angles), np.sin(angles), np.full(len(angles), random.uniform(0.3, 1.2))])
        normals /= np.linalg.norm(normals, axis=1)[:, np.newaxis]
        hips = apex + np.vstack([[0.0, 0.0, 0.02], random.normal(scale=0.008, size=(40, 3)) - [0.0, 0.0, 0.003]])
        expected, held = zip(*(closest_in_room(normals, hip - apex) for hip in hips), strict=True)
        ihips, _ = led(constraint(Scene(model=pit(normals))), hips, DT)
        np.testing.assert_allclose(ihips - apex, expected, rtol=0.0, atol=1e-14)
        numbers += held
    assert np.bincount(numbers).min() > 60


@pytest.mark.parametrize("thickness", [1e-2, 1e-5, 1e-9])
def test_it_never_passes_a_plate(thickness):
    plate = make_model("box", x=0.4, y=0.4, z=thickness)
    random = np.random.default_rng(12)
    hips = np.cumsum(random.normal(scale=[3e-3, 3e-3, 1e-2], size=(400, 3)), axis=0).clip(-0.15, 0.15)
    hips[0] = [0.0, 0.0, 0.02]
    ihips, _ = led(constraint(Scene(model=plate)), hips, DT)
    assert (hips[:, 2] < -thickness).sum() > 50
    assert (ihips[:, 2] >= 0.5 * thickness - 1e-17).all()
    np.testing.assert_allclose(ihips[:, 2], np.maximum(hips[:, 2], 0.5 * thickness), rtol=0.0, atol=1e-15)


def test_over_a_convex_edge_it_leaves_and_at_a_vertex_it_holds_no_hand_that_is_outside():
    renderer = constraint(Scene(model=make_model("cube", size=0.1)))
    hips = np.linspace([0.0, 0.0, 0.048], [0.06, 0.06, 0.048], 601)
    ihips, forces = led(renderer, np.vstack([[0.0, 0.0, 0.06], hips]), DT)
    inside = hips[:, 0] <= 0.05
    np.testing.assert_allclose(ihips[1:][inside, 2], 0.05, atol=1e-15)
    np.testing.assert_array_equal(ihips[1:][~inside], hips[~inside])
    assert not forces[1:][~inside].any()


@each_base
@pytest.mark.parametrize("kind", ["cube", "icosphere"])
def test_a_tool_that_is_let_fall_on_a_solid_comes_to_rest_on_it_in_closed_loop(base, kind):
    """With a constant push into the top: at rest the spring of the penalty carries it, depth = push / stiffness."""
    model = make_model(kind, size=0.2)
    scene = Scene(model=model, stiffness=400.0, damping=20.0, mass=0.5)
    force = np.tile([0.0, 0.0, -2.0], (1, 1))
    start = np.array([0.0, 0.0, 0.102]) + (0.001 * model.boundary.normals[0] if kind == "cube" else 0.0)
    drop = Experiment(1.0, start, np.zeros(3), np.zeros(1), force)
    renderer = base.variant(regulation="pp-v", representation="curve")(scene)
    recording = simulate_closed_loop(renderer, drop, scene, DT)
    last = recording.hip[-1]
    assert model.boundary.signed_distance([last])[0] == pytest.approx(-2.0 / 400.0, rel=0.02)
    plain = simulate_closed_loop(Plain(renderer), drop, scene, DT)
    np.testing.assert_array_equal(plain.hip, recording.hip)


class Plain:
    """The same renderer without its law: the loop asks it from Python."""

    def __init__(self, renderer):
        self.renderer = renderer
        self.supports = getattr(renderer, "supports", None)

    def reset(self, hip):
        self.renderer.reset(hip)

    def step(self, hip, velocity, dt):
        return self.renderer.step(hip, velocity, dt)


@each_base
def test_smooth_surfaces_have_no_polygon(refused, base):
    with refused(RefusalError):
        base.variant(representation="polygon")(Scene(model=make_model("sphere")))
