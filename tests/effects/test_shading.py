"""Force shading: interpolated unit normals on polygons, put on the answers of any renderer (4.15)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from leading import led

from hapticeval.discovery import resolve
from hapticeval.effects.shading import Shading, facets, mesh_corners
from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.boundary import spread_over_sphere
from hapticeval.geometry.catalogue import make_model, star
from hapticeval.geometry.solids import icosphere, prism
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer

RADIUS, STIFFNESS = 0.1, 1000.0


def regular(n):
    angle = 2.0 * np.pi * np.arange(n) / n
    return make_model("polygon", vertices=(RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])).tolist())


def shaded(model, crease=180.0, **more):
    return Scene(model=model, effects=(Shading(crease),), stiffness=STIFFNESS, **more)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def interpolated(table, along):
    """The unit normal, (4.15) renormalised, `along` m from the start of the outline, of its facets."""
    row = table[np.searchsorted(table[:, 0], along, side="right") - 1]
    share = (along - row[0]) / row[1]
    return unit((1.0 - share) * row[4:6] + share * row[6:8])


class OfOneFacet:
    """A spring to the line of the first facet, whatever is nearer: the renderer of the closed form."""

    def __init__(self, scene):
        first, second = scene.model.boundary.pieces[:2, 3:5]
        self.tangent = (second - first) / np.linalg.norm(second - first)
        self.normal = np.array([self.tangent[1], -self.tangent[0]])
        self.first, self.stiffness = first, scene.stiffness

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        ihip = hip - ((hip - self.first) @ self.normal) * self.normal
        return Response(ihip, self.stiffness * (ihip - hip))

    def at(self, along, depth):
        """Points `along` (k,), m, from the start of the facet and `depth` (k,), m, under it."""
        return self.first + np.outer(along, self.tangent) - np.outer(depth, self.normal)


def way_round(length, shallow, deep, each=400):
    """From the facet's middle to its end at `shallow`, down to `deep`, back, and up: (along, depth)."""
    share = np.linspace(0.0, 1.0, each)[:-1]
    middle, end = 0.5 * length, length * (1.0 - 1e-9)
    ways = [(middle, end, shallow, shallow), (end, end, shallow, deep), (end, middle, deep, deep)]
    ways.append((middle, middle, deep, shallow))
    along = np.concatenate([a + share * (b - a) for a, b, *_ in ways] + [[middle]])
    depth = np.concatenate([c + share * (d - c) for *_, c, d in ways] + [[shallow]])
    return along, depth


def work(force, hips):
    return float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(hips, axis=0)))


@pytest.mark.parametrize(("n", "mj"), [(3, 49.5), (8, 7.536), (20, 1.219), (40, 0.3052), (80, 0.0763)])
def test_a_loop_gives_the_work_of_the_closed_form(n, mj):
    """K (d2 - d1)(L/2) tan(theta/2) - K/2 (d2^2 - d1^2)(1 - cos theta), theta = pi/n: once round and back."""
    scene = shaded(regular(n))
    base = OfOneFacet(scene)
    theta, length = math.pi / n, 2.0 * RADIUS * math.sin(math.pi / n)
    shallow, deep = 0.5e-3, 1.5e-3
    hips = base.at(*way_round(length, shallow, deep))
    there, back = (led(make_renderer(OfOneFacet, scene), each, 1e-3)[1] for each in (hips, hips[::-1]))
    closed = STIFFNESS * (deep - shallow) * 0.5 * length * math.tan(0.5 * theta)
    closed -= 0.5 * STIFFNESS * (deep**2 - shallow**2) * (1.0 - math.cos(theta))
    assert closed == pytest.approx(1e-3 * mj, rel=1e-3)
    assert abs(work(there, hips)) == pytest.approx(closed, rel=2e-5)
    assert work(back, hips[::-1]) == pytest.approx(-work(there, hips), rel=1e-9)


def test_a_facet_crossed_at_constant_depth_gives_nothing():
    scene = shaded(regular(8))
    base = OfOneFacet(scene)
    along = np.linspace(1e-6, 2.0 * RADIUS * math.sin(math.pi / 8) - 1e-6, 2001)
    hips = base.at(along, np.full(along.size, 1e-3))
    assert work(led(make_renderer(OfOneFacet, scene), hips, 1e-3)[1], hips) == pytest.approx(0.0, abs=1e-12)


@example(angles=[1.0, 0.99999, 1.0, 1.0], place=0.0, depth=1e-5, crease=1.0)
@example(angles=[1.0, 0.25, 1.0, 0.25], place=0.0, depth=1e-5, crease=1.0)
@given(
    angles=st.lists(st.floats(0.15, 1.0), min_size=4, max_size=12),
    place=st.floats(0.0, 1.0, exclude_max=True),
    depth=st.floats(1e-5, 3e-3),
    crease=st.floats(1.0, 180.0),
)
def test_the_force_is_as_large_as_without_and_along_the_interpolated_normal(angles, place, depth, crease):
    turn = 2.0 * np.pi * np.cumsum(angles) / np.sum(angles)
    model = make_model("polygon", vertices=(RADIUS * np.column_stack([np.cos(turn), np.sin(turn)])).tolist())
    curve = model.curve
    foot, normal = (each(curve.parameter(place * curve.length)) for each in (curve.position, curve.normal))
    hip = foot - depth * normal
    scene = shaded(model, crease)
    plain = resolve("minimum-distance")(Scene(model=model, stiffness=STIFFNESS))
    renderer = make_renderer(resolve("minimum-distance"), scene)
    for each in (plain, renderer):
        each.reset(hip)
    ihip, force = plain.step(hip, np.zeros(2), 1e-3)
    same, found = renderer.step(hip, np.zeros(2), 1e-3)
    size = np.linalg.norm(force)
    table, along = facets(curve, crease), float(curve.arc_length(curve.nearest(ihip[np.newaxis]))[0])
    # at a corner the tool rests on two facets
    assume(np.abs(np.append(table[:, 0], curve.length) - along).min() > 1e-9)
    shaded_normal = interpolated(table, along)
    assert np.array_equal(same, ihip)
    assert np.linalg.norm(found) == pytest.approx(size, rel=1e-12)
    # Under a corner the tool may be nearly on a face, and the direction to it is rounding: the foot's place along a
    # face, which is up to twice the radius long, is off by up to four roundings of that.
    rounding = 4.0 * STIFFNESS * np.finfo(float).eps * 2.0 * RADIUS
    np.testing.assert_allclose(found, size * shaded_normal, atol=1e-9 * size + rounding)


def test_the_interpolated_normal_is_unit():
    """A golden number: 3/4 (-1/2, s) + 1/4 (1/2, s) with s = sqrt(3)/2, of which (4.15) keeps the norm of .9013878."""
    model = regular(6)
    foot = np.array([-0.025, 0.1 * math.sqrt(0.75)])
    row = facets(model.curve, 180.0)[1]
    assert np.linalg.norm(0.25 * row[4:6] + 0.75 * row[6:8]) == pytest.approx(0.901387818866, rel=1e-11)
    renderer = make_renderer(resolve("minimum-distance"), shaded(model))
    renderer.reset(foot)
    force = renderer.step(foot - [0.0, 1e-3], np.zeros(2), 1e-3).force
    np.testing.assert_allclose(force, [-0.277350098113, 0.960768922831], atol=1e-11)


def test_edges_that_turn_more_than_the_crease_stay_sharp():
    """A star: its tips turn by 120 degrees, its notches by 48."""
    model = star()
    turns = np.degrees([abs(corner.turn) for corner in model.boundary.corners])
    assert set(np.round(turns)) == {48.0, 120.0}
    table = facets(model.curve, 60.0)
    sharp = [np.array_equal(row[2:4], row[first : first + 2]) for row in table for first in (4, 6)]
    assert sum(sharp) == 10
    assert np.array_equal(facets(model.curve, 10.0)[:, 4:], np.tile(table[:, 2:4], 2))
    assert facets(model.curve, 48.0)[:, 4:] == pytest.approx(table[:, 4:]), "an edge that turns as much is smooth"


@pytest.mark.parametrize("crease", [30.0, 60.0, 180.0])
def test_the_force_turns_without_a_jump_through_a_notch(crease):
    """Round a notch of the star the base's force turns where it stands; shaded or sharp, it does so no faster."""
    model = star()
    corner = next(each for each in model.boundary.corners if not each.convex)
    angle = np.linspace(0.0, 2.0 * np.pi, 4001)
    inwards = -(corner.normal_pre + corner.normal_post)
    centre = corner.position + 0.002 * inwards / np.linalg.norm(inwards)
    hips = centre + 0.0015 * np.column_stack([np.cos(angle), np.sin(angle)])
    force = led(make_renderer(resolve("minimum-distance"), shaded(model, crease)), hips, 1e-3)[1]
    directions = unit(force)
    turn = np.arccos(np.clip(np.sum(directions[1:] * directions[:-1], axis=1), -1.0, 1.0))
    assert turn.max() < 0.02


@pytest.mark.parametrize("kind", ["circle", "line", "dumbbell", "sphere"])
def test_a_boundary_without_facets_is_refused_by_name(refused, kind):
    scene = Scene(model=make_model(kind), effects=(Shading(),))
    with refused(RefusalError):
        make_renderer(resolve("minimum-distance"), scene)


@pytest.mark.parametrize("crease", [0.0, -1.0, math.nan, math.inf, 181.0, "60"])
def test_a_crease_that_is_no_angle_is_refused(refused, crease):
    with refused(InputError):
        Shading(crease)


# Triangle meshes


def prism_of(n):
    outline = regular(n).boundary.pieces[:, 3:5]
    vertices, triangles = prism(outline, 0.1)
    return make_model("mesh", vertices=vertices.tolist(), triangles=triangles.tolist())


@pytest.mark.parametrize("n", [5, 8])
def test_a_prism_is_shaded_as_its_cross_section_is(n):
    """Its sides are cut into triangles, which changes no normal, and its caps are sharp."""
    hips = np.column_stack([np.linspace(0.11, 0.07, 120), np.linspace(-0.04, 0.05, 120)])
    flat = led(make_renderer(resolve("minimum-distance"), shaded(regular(n), 75.0)), hips, 1e-3)
    there = np.column_stack([hips, np.linspace(-0.011, 0.013, 120)])
    found = led(make_renderer(resolve("minimum-distance"), shaded(prism_of(n), 75.0)), there, 1e-3)
    assert np.abs(flat[1]).max() > 5.0
    np.testing.assert_allclose(found[1][:, :2], flat[1], atol=1e-9)
    assert np.abs(found[1][:, 2]).max() < 1e-9


def test_a_mesh_of_a_sphere_is_shaded_towards_the_sphere():
    """Vertices lie on it: shaded normals are a third as far off the sphere's as the triangles' own, or less."""
    vertices, triangles = icosphere(2, RADIUS)
    model = make_model("mesh", vertices=vertices.tolist(), triangles=triangles.tolist())
    feet = 0.98 * spread_over_sphere(60) * RADIUS
    scene = shaded(model, 60.0)
    plain = resolve("minimum-distance")(Scene(model=model, stiffness=STIFFNESS))
    renderer = make_renderer(resolve("minimum-distance"), scene)
    off = []
    for made in (plain, renderer):
        made.reset(1.2 * feet[0])
        forces = np.array([made.step(hip, np.zeros(3), 1e-3).force for hip in feet])
        off.append(np.arccos(np.clip(np.sum(unit(forces) * unit(feet), axis=1), -1.0, 1.0)))
    assert off[1].max() < off[0].max() / 3.0
    ihips = np.array([renderer.step(hip, np.zeros(3), 1e-3).ihip for hip in feet])
    base = STIFFNESS * (ihips - feet)
    # the shares of a triangle's corners at a foot solve a linear system
    corners, table = model.boundary.vertices[model.boundary.triangles], mesh_corners(model.boundary, 60.0)
    shares = np.linalg.solve(corners.transpose(0, 2, 1)[:, np.newaxis], ihips[np.newaxis, :, :, np.newaxis])[..., 0]
    own = np.argmax(shares.min(axis=2), axis=0)
    normals = np.sum(shares[own, np.arange(60), :, np.newaxis] * table[own, :9].reshape(60, 3, 3), axis=1)
    size = np.linalg.norm(base, axis=1)
    np.testing.assert_allclose(forces, size[:, np.newaxis] * unit(normals), atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(forces, axis=1), size, rtol=1e-12)
