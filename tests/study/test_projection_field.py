"""Projection fields against closed forms: where projections jump, how near that is, and how much they amplify."""

import json
import math

import numpy as np
import pytest

from hapticeval.cli import main
from hapticeval.commands.arguments import model_named
from hapticeval.discovery import resolve
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import cassinian, circle, ellipse, from_vertices, line, make_model, star
from hapticeval.scene import Scene
from hapticeval.study.projection_field.field import (
    field_of,
    jumps_between,
    lines_of_constant_projection,
    shallow_angles,
)
from hapticeval.study.projection_field.study import Projector, has_memory, make_projector, study_field, surface_of

MM = 1e-3


def field(model, *, name="minimum-distance", start=None, cells=120):
    renderer = resolve(name)(Scene(model=model))
    surface = surface_of(renderer, model.curve)
    return field_of(make_projector(renderer, surface, dt=1e-3, origin=start), surface, cells=cells, start=start)


def test_a_circle_is_singular_at_its_centre_alone_and_amplifies_by_the_distance_from_there():
    found = field(circle())
    np.testing.assert_allclose(found.singular.points, [[0.0, 0.0]], atol=1e-9)
    assert found.singular.segments.shape == (0, 2, 2)
    assert found.share_near(5 * MM) == pytest.approx(0.05**2, rel=2e-3)
    lattice = found.lattice
    radius = np.hypot(*np.moveaxis(lattice.nodes, -1, 0))
    kept = lattice.contact & (radius > 2 * MM)
    np.testing.assert_allclose(found.amplification[kept], 0.1 / radius[kept], rtol=5e-3)
    assert found.summary(within=MM)["amplification"]["median"] == pytest.approx(math.sqrt(2.0), rel=0.01)


def test_a_square_jumps_on_its_bisectors():
    found = field(from_vertices([[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]]))
    x, y = found.singular.segments.reshape(-1, 2).T
    off = np.minimum(np.abs(x - y), np.abs(x + y - 0.1))
    assert off.max() < 1e-6 + 0.1 / 120  # junctions are placed to within a cell, all else to rounding
    assert np.median(off) < 1e-9
    assert found.discontinuity.length == pytest.approx(0.2 * math.sqrt(2.0), rel=0.02)
    # two diagonals with their corners in the square, less the middle counted twice
    width = 2 * MM
    closed = 2 * (0.01 - (0.1 - math.sqrt(2.0) * width) ** 2) - (2 * width) ** 2
    assert found.share_near(width) == pytest.approx(closed / 0.01, rel=0.02)


def test_the_medial_axis_of_an_ellipse():
    found = field(ellipse(ratio=2.0), cells=200)
    a, b = 0.1, 0.05
    half = a - b * b / a
    ends = found.singular.segments.reshape(-1, 2)
    np.testing.assert_allclose(ends[:, 1], 0.0, atol=1e-6)
    assert np.abs(ends[:, 0]).max() == pytest.approx(half, abs=1.2 * 0.2 / 200)
    closed = (4 * half * MM + math.pi * MM**2) / (math.pi * a * b)
    assert found.share_near(MM) == pytest.approx(closed, rel=0.015)
    assert found.singular.jumps.max() == pytest.approx(2 * b, rel=1e-3)


def test_a_star_jumps_on_the_bisectors_of_its_tips_and_rests_in_its_notches():
    found = field(star(), cells=150)
    ends = found.singular.segments.reshape(-1, 2)
    angle = np.degrees(np.arctan2(ends[:, 1], ends[:, 0])) - 90.0
    radius = np.hypot(*ends.T)
    off = radius * np.sin(np.radians((angle + 36.0) % 72.0 - 36.0))
    assert np.abs(off).max() < 1.5 * 0.2 / 150
    assert found.discontinuity.length == pytest.approx(0.5, rel=0.02)
    notch = np.linalg.norm(found.surface.corners[1].position)
    # the longest is that at the centre, from notch to neighbouring notch
    assert found.singular.jumps.max() == pytest.approx(2.0 * notch * math.sin(math.radians(36.0)), rel=0.01)
    assert 0.24 < found.summary(within=MM)["amplification"]["rest_share"] < 0.27


def test_lines_of_constant_projection_are_the_normals_of_a_smooth_curve():
    found = field(cassinian())
    curve = found.surface
    assert len(found.lines) >= 96
    for points in lines_of_constant_projection(found.lattice, found.singular, count=24):
        feet = curve.position(curve.nearest(points[1:-1]))
        spread = np.linalg.norm(feet - feet[0], axis=1)
        assert spread.max() < 1.5 * MM
    jumps = found.singular.segments.reshape(-1, 2)
    off = np.abs(jumps).min(axis=1)
    assert off.max() < 0.2 / 120  # where lines meet, the place is known to within a cell
    assert np.median(off) < 1e-8


def test_a_jump_stays_when_its_place_is_halved_and_a_steep_map_does_not():
    def steps(points):
        return np.column_stack([np.where(points[:, 0] < 0.03, 1.0, 1.01), 0.0 * points[:, 0] - 5.0])

    def steep(points):
        return np.column_stack([np.cbrt(points[:, 0] - 0.03), 0.0 * points[:, 0] - 5.0])

    a, b = np.array([[0.0, 0.0]]), np.array([[0.1, 0.0]])
    place, jump = jumps_between(steps, a, b, steps(a), steps(b))
    np.testing.assert_allclose(place, [[0.03, 0.0]], atol=1e-6)
    np.testing.assert_allclose(jump, [0.01])
    _, jump = jumps_between(steep, a, b, steep(a), steep(b))
    np.testing.assert_array_equal(jump, [0.0])


def test_the_constraint_is_drawn_for_a_place_of_the_tool_and_sees_no_jump_on_a_star():
    model = star()
    face = 0.5 * (model.curve.corners[0].position + model.curve.corners[-1].position)
    found = field(model, name="constraint", start=face, cells=40)
    assert found.singular.jumps.size == 0
    assert found.singular.points.shape == (0, 2)
    ahead = field(cassinian(), name="constraint@curve", start=np.array([0.1, 0.0]), cells=40)
    np.testing.assert_allclose(ahead.singular.jumps.max(), 0.1, atol=0.03)


def test_memory_is_noticed(refused):
    scene = Scene(model=cassinian())
    for name, remembers in (("minimum-distance", False), ("constraint", True)):
        renderer = resolve(name)(scene)
        surface = surface_of(renderer, scene.model.curve)
        assert has_memory(renderer, surface, dt=1e-3) is remembers
        origin = None if remembers else np.array([0.1, 0.0])
        with refused(InputError):
            make_projector(renderer, surface, dt=1e-3, origin=origin)


def test_a_batch_and_single_ticks_give_one_field():
    scene = Scene(model=star())
    renderer = resolve("minimum-distance")(scene)
    hips = np.random.default_rng(1).uniform(-0.05, 0.05, (50, 2))
    singles = np.vstack([Projector(renderer, dt=1e-3)(hip[None]) for hip in hips])
    np.testing.assert_array_equal(Projector(renderer, dt=1e-3)(hips), singles)


def test_models_by_name(refused, tmp_path):
    assert len(model_named("star:points=6").curve.corners) == 12
    file = tmp_path / "square.wkt"
    file.write_text("POLYGON ((0 0, 0.1 0, 0.1 0.1, 0 0.1, 0 0))")
    assert len(model_named(str(file)).curve.corners) == 4
    with refused(UnknownNameError):
        model_named("cassinan")
    with refused(UnknownNameError):
        model_named("star:pionts=6")
    for wrong in ("star:points", "star:points=six"):
        with refused(InputError):
            model_named(wrong)
    with refused(InputError):
        model_named(str(tmp_path / "nothing.wkt"))
    open_outline = tmp_path / "open.wkt"
    open_outline.write_text("POLYGON ((0 0, 1 0, 1 1))")
    with refused(InputError):
        model_named(str(open_outline))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--from", "0.1"], "--from 0.1"),
        (["--from", "a,b"], "--from a,b"),
        (["--from", "0.1,0", "--s", "0.1"], "both --from and --s"),
        ([], "remembers"),
        (["--s", "0.1", "--knob", "grid=50"], "knob of constraint 'grid'"),
    ],
)
def test_wrong_usage_is_refused(options, message, tmp_path, capsys):
    assert main(["study", "field", "constraint", "cassinian", *options, "-o", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_line_and_an_ideal_contact_have_no_field(refused):
    with refused(InputError):
        study_field("ideal", circle(), within=MM)
    surface = line().curve
    with refused(InputError):
        field_of(lambda hips: hips, surface)
    with refused(InputError):
        field_of(lambda hips: hips, circle().curve, cells=20)


def test_the_picture_and_its_numbers(tmp_path):
    from hapticeval.reports.study_figures import caption, write_field

    found, document = study_field("minimum-distance@polygon", cassinian(), within=MM, knobs={"vertices": 24}, cells=60)
    files = write_field(tmp_path, found, document)
    assert [file.suffix for file in files] == [".svg", ".png", ".json"]
    assert json.loads(files[2].read_text())["singular"]["share_within"] == document["singular"]["share_within"]
    assert "minimum-distance@polygon vertices 24 on cassinian" in document["title"]
    assert f"{100 * document['singular']['share_within']:.3g} %" in caption(document)
    first = files[0].read_bytes()
    write_field(tmp_path, found, document)
    assert files[0].read_bytes() == first


@pytest.mark.parametrize("name", ["circle", "ellipse", "cassinian"])
def test_the_nearest_point_is_normal_at_every_depth(name):
    surface = make_model(name).curve
    angles = shallow_angles(lambda hips: surface.position(surface.nearest(hips)), surface)
    assert [round(each.depth, 6) for each in angles] == [0.0005, 0.005]
    assert max(each.p95 for each in angles) < 1e-3


def test_a_projection_that_leans_is_told_by_its_angle():
    """IHIPs moved along a circle by tan(20 degrees) of the depth lean by 20 degrees, less what the circle curves."""
    surface = make_model("circle").curve

    def leaning(hips):
        depth = 0.1 - np.linalg.norm(hips, axis=1)
        s = surface.arc_length(surface.nearest(hips)) + np.tan(np.radians(20.0)) * depth
        return surface.position(surface.parameter(s))

    shallow, deep = shallow_angles(leaning, surface)
    assert shallow.median == pytest.approx(20.0, abs=0.2)
    assert deep.median == pytest.approx(20.0, abs=1.5)
