"""Height and bump maps: the one is the force of a potential, the other is not, and neither may be aliased unseen."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from leading import led
from numpy.polynomial.legendre import leggauss

from hapticeval.discovery import resolve
from hapticeval.documents import convert
from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.reliefs import BumpMap, HeightMap
from hapticeval.errors import DomainError, InputError, RefusalError
from hapticeval.geometry.catalogue import make_model
from hapticeval.renderer import Response
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.suite.case import Case

HIGH, WAVE, STIFFNESS = 20e-6, 0.5e-3, 1000.0
SINE = {"wavelength": WAVE, "amplitude": HIGH}
PROFILE = tuple(HIGH * np.cos(2 * np.pi * (np.arange(12) / 12)) + 5e-6 * np.sin(4 * np.pi * (np.arange(12) / 12)))
NODES, WEIGHTS = leggauss(40)


def rendered(effect, model, name="minimum-distance", **scene):
    return make_renderer(resolve(name), Scene(model=model, effects=(effect,), **scene))


def answer(renderer, point):
    renderer.reset(point)
    return renderer.step(point, np.zeros(point.size), 1e-3)


def on_line(s, d):
    """Point and its derivatives by arc length and depth: the line's runs towards negative x."""
    return np.array([-s, -d]), np.array([-1.0, 0.0]), np.array([0.0, -1.0])


def on_circle(radius):
    def at(s, d):
        out, along = (
            np.array([np.cos(s / radius), np.sin(s / radius)]),
            np.array([-np.sin(s / radius), np.cos(s / radius)]),
        )
        return (radius - d) * out, (1.0 - d / radius) * along, -out

    return at


def loop_work(force, at, length, start=0.0, depths=(0.5e-3, 1.5e-3)):
    """The work, J, that the hand gets in, along, out and back: by Gauss's rule on each side of the rectangle."""
    shallow, deep = depths
    corners = [(start, shallow), (start, deep), (start + length, deep), (start + length, shallow), (start, shallow)]
    total = 0.0
    for one, other in pairwise(corners):
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            s, d = np.array(one) + np.subtract(other, one) * (node + 1.0) / 2.0
            ds, dd = np.subtract(other, one) * weight / 2.0
            point, by_s, by_d = at(s, d)
            total += float(force(point) @ (ds * by_s + dd * by_d))
    return total


@pytest.mark.parametrize("relief", [SINE, {"wavelength": WAVE, "profile": PROFILE}])
@pytest.mark.parametrize("size", [None, 0.04, 0.2])
def test_a_height_map_gives_and_takes_nothing_round_a_loop(relief, size):
    model = make_model("line") if size is None else make_model("circle", size=size)
    renderer = rendered(HeightMap(**relief), model)
    at = on_line if size is None else on_circle(size / 2)
    smooth = "amplitude" in relief
    cell = WAVE / 12 if size is None else 1e-6 * math.pi * size
    for length, start in ((WAVE / 4, 0.0), (WAVE / 2, -WAVE / 4), (1.3e-4, 2e-5)) if smooth else ((cell, 0.0),):
        assert abs(loop_work(lambda p: answer(renderer, p).force, at, length, start)) < 1e-13


def test_without_the_curvature_s_share_a_height_map_gives_four_microjoules_a_loop():
    """From a trough to the next crest, on a circle of 20 mm: what the share 1 / (1 - kappa d) is for."""
    radius = 0.02
    at, wave = on_circle(radius), 2 * math.pi * radius / round(2 * math.pi * radius / WAVE)
    renderer = rendered(HeightMap(**SINE), make_model("circle", size=2 * radius))

    def without(point):
        force, out = answer(renderer, point).force, point / np.linalg.norm(point)
        along = np.array([-out[1], out[0]])
        return (force @ out) * out + (force @ along) * (np.linalg.norm(point) / radius) * along

    assert abs(loop_work(without, at, wave / 2, -wave / 4)) == pytest.approx(4.0e-6, rel=0.02)


def test_a_bump_map_gives_what_its_closed_form_says():
    """.0106 mJ a loop, a quarter of a wave long, between .5 and 1.5 mm."""
    renderer = rendered(BumpMap(**SINE), make_model("line"))
    found = loop_work(lambda p: answer(renderer, p).force, on_line, WAVE / 4)
    steep = math.atan(2 * math.pi * HIGH / WAVE)
    closed = STIFFNESS * (1e-3 * WAVE / (2 * math.pi) * steep - 0.5 * (1.5e-3**2 - 0.5e-3**2) * (1 - math.cos(steep)))
    assert -found == pytest.approx(closed, rel=1e-9)
    assert closed == pytest.approx(-1.0567e-5, rel=1e-4)


def test_the_normal_of_a_bump_map_is_renormalised():
    """(4.16) with a slope of 0.1: F = (.0995, .995) K d, not (.1, 1)."""
    renderer = rendered(BumpMap(wavelength=1e-3, amplitude=0.1e-3 / (2 * math.pi)), make_model("line"))
    force = answer(renderer, np.array([0.0, -1e-3])).force
    np.testing.assert_allclose(force, (0.099503719021, 0.99503719021), rtol=1e-10)


@pytest.mark.parametrize("kind", ["sphere", "torus", "ellipsoid", "circle", "ellipse", "cassinian"])
def test_the_force_is_minus_the_gradient_of_the_potential(kind):
    model = make_model(kind)
    size = model.dimension
    direction = (1.0, 0.3, -0.2) if size == 3 else ()
    renderer = rendered(HeightMap(wavelength=2e-3, amplitude=5e-5, direction=direction), model)
    surface = model.boundary.closest_point(model.boundary.points(9))
    unit = np.array(direction) / np.linalg.norm(direction or (1.0,))
    wave = 2e-3 if size == 3 else model.boundary.girth / round(model.boundary.girth / 2e-3)

    def potential(point):
        found = model.boundary.closest_point(point[np.newaxis])
        curve = None if size == 3 else model.curve
        at = found.foot[0] @ unit if curve is None else float(curve.arc_length(curve.nearest(point[np.newaxis]))[0])
        return 0.5 * STIFFNESS * (-found.distance[0] + 5e-5 * math.sin(2 * math.pi * at / wave)) ** 2

    for foot, normal in zip(surface.foot, surface.normal, strict=True):
        point, step = foot - 1e-3 * normal, 1e-6
        ends = [[potential(point + k * step * axis) for k in (-2, -1, 1, 2)] for axis in np.eye(size)]
        slope = [(e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * step) for e in ends]
        np.testing.assert_allclose(answer(renderer, point).force, -np.array(slope), atol=2e-10)


def test_contact_is_with_the_relief():
    """A crest is met outside of the bare surface, and a trough lets go inside of it."""
    renderer = rendered(HeightMap(**SINE), make_model("line"))
    crest, trough = -WAVE / 4, WAVE / 4
    for height, ihip, force in ((0.5 * HIGH, HIGH, STIFFNESS * 0.5 * HIGH), (1.5 * HIGH, 1.5 * HIGH, 0.0)):
        found = answer(renderer, np.array([crest, height]))
        np.testing.assert_allclose(found.ihip, (crest, ihip), atol=1e-15)
        np.testing.assert_allclose(found.force, (0.0, force), atol=1e-15)
    point = np.array([trough, -0.5 * HIGH])
    assert np.array_equal(answer(renderer, point), (point, np.zeros(2)))
    held = rendered(HeightMap(**SINE), make_model("line"), bilateral=True)
    np.testing.assert_allclose(answer(held, point).force, (0.0, -0.5 * STIFFNESS * HIGH), atol=1e-15)


@pytest.mark.parametrize("scheme", ["pp-v", "pp-pd", "pp-d"])
def test_the_base_s_damper_is_kept(scheme):
    hips = np.column_stack([1e-5 * np.arange(200), -1e-3 - 5e-4 * np.sin(np.arange(200) / 30)])
    scene = {"damping": 2.0}
    model = make_model("line")
    bare = led(resolve(f"minimum-distance+{scheme}")(Scene(model=model, **scene)), hips, 1e-3)[1]
    spring = led(resolve("minimum-distance")(Scene(model=model)), hips, 1e-3)[1]
    raised = led(rendered(HeightMap(**SINE), model, f"minimum-distance+{scheme}", **scene), hips, 1e-3)[1]
    raised_spring = led(rendered(HeightMap(**SINE), model), hips, 1e-3)[1]
    assert np.abs(bare - spring).max() > 1e-3
    np.testing.assert_allclose(raised - raised_spring, bare - spring, atol=1e-14)


class Aside:
    """A spring to a point of the line that lies 1 mm aside from 10 mm on, where it is deep."""

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        if hip[1] >= 0.0:
            return Response(hip, np.zeros(2))
        ihip = np.array([hip[0] + 1e-3 * (hip[0] > 0.01 and hip[1] < -5e-4), 0.0])
        return Response(ihip, STIFFNESS * (ihip - hip))


def test_a_height_map_needs_the_nearest_point(refused):
    scene = Scene(model=make_model("cassinian"), effects=(HeightMap(**SINE),))
    for name in ("mapping", "constraint", "minimum-distance+square-root", "minimum-distance@polygon"):
        with refused(RefusalError):
            make_renderer(resolve(name), scene)
    make_renderer(resolve("constraint@curve"), scene)
    make_renderer(resolve("mapping"), Scene(model=scene.model, effects=(BumpMap(**SINE),)))
    aside = make_renderer(lambda _: Aside(), Scene(model=make_model("line"), effects=(HeightMap(**SINE),)))
    with refused(DomainError):
        led(aside, np.array([[0.0, -1e-3], [0.02, -1e-3]]), 1e-3)


def case(speed, kind="line", **effect):
    points = [[0.0, -1e-3], [0.06, -1e-3]]
    document = {
        "name": "fast", "title": "Fast", "model": {"kind": kind}, "checks": ["contact-kept"],
        "scene": {"effects": [{"kind": "height-map", **effect}]},
        "trajectory": {"kind": "points", "points": points, "duration": 0.06 / speed},
    }  # fmt: skip
    return convert(document, Case, "case")


@pytest.mark.parametrize(("speed", "beat", "felt"), [(0.3, 600.0, 400.0), (0.499, 998.0, 2.0)])
def test_a_path_that_would_alias_the_relief_is_refused(refused, speed, beat, felt):
    """|f - 1000 round(f / 1000)| at f = v / wavelength."""
    with refused(InputError) as caught:
        case(speed, **SINE).check_stimulus()
    assert f"{beat:.4g} Hz" in caught.value.why
    assert f"felt as {felt:.4g} Hz" in caught.value.why


def test_a_path_within_the_limit_passes_and_harmonics_count(refused):
    case(0.24, **SINE).check_stimulus()
    case(0.12, wavelength=WAVE, profile=list(PROFILE)).check_stimulus()
    assert HeightMap(wavelength=WAVE, profile=PROFILE).finest == pytest.approx(WAVE / 2)
    with refused(InputError):
        case(0.13, wavelength=WAVE, profile=list(PROFILE)).check_stimulus()
    assert HeightMap(**SINE).fastest(1e-3) == pytest.approx(0.25)


@pytest.mark.parametrize(
    "document",
    [
        {"wavelength": 0.0, "amplitude": HIGH},
        {"wavelength": WAVE, "amplitude": -HIGH},
        {"wavelength": WAVE, "amplitude": math.nan},
        {"wavelength": WAVE},
        {"wavelength": WAVE, "profile": []},
        {"wavelength": WAVE, "amplitude": HIGH, "profile": PROFILE},
        {"wavelength": WAVE, "profile": [0.0, math.nan, 0.0, 0.0]},
        {"wavelength": WAVE, "profile": [0.0, HIGH]},
    ],
)
@pytest.mark.parametrize("kind", ["height-map", "bump-map"])
def test_bad_numbers_are_refused(refused, kind, document):
    with refused(InputError):
        make_effect({"kind": kind, **document})


def test_a_profile_may_stand_in_a_file(tmp_path):
    (tmp_path / "profile.csv").write_text("h\n" + "\n".join(map(repr, map(float, PROFILE))) + "\n")
    read = make_effect({"kind": "height-map", "wavelength": WAVE, "file": "profile.csv"}, tmp_path)
    assert read == HeightMap(wavelength=WAVE, profile=PROFILE)
    assert make_effect(json.loads(json.dumps(read.document()))) == read


def test_a_relief_fits_its_model(refused):
    with refused(InputError):
        Scene(model=make_model("star"), effects=(HeightMap(**SINE),))
    assert Scene(model=make_model("star"), effects=(BumpMap(**SINE),)).effects
    for kind, direction in (("line", (1.0, 0.0)), ("sphere", (1.0, 0.0)), ("sphere", (0.0, 0.0, 0.0))):
        with refused(InputError):
            Scene(model=make_model(kind), effects=(HeightMap(**SINE, direction=direction),))
    assert Scene(model=make_model("line"), effects=(HeightMap(wavelength=WAVE, amplitude=0.0),)).effects == ()
