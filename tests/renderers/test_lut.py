"""Look-up tables (thesis 6.2): near the exact projection, and never between two of its sheets."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hand_paths import star_shaped, walks
from hypothesis import given, settings
from leading import led

from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, from_vertices, make_model, star
from hapticeval.renderers import conformal, constraint, minimum_distance
from hapticeval.renderers.disk import by_conformal_map, by_flow_map
from hapticeval.renderers.lut import (
    ASK,
    BORDER,
    FREE,
    HELD,
    IN_MEMORY,
    MARKED,
    OFF,
    OUT,
    PROBED_RAISE,
    TOUCHES,
    Grid,
    Source,
    Table,
    empty,
    fill,
    grid_of,
    grid_over,
    tabulate,
    tabulated,
)
from hapticeval.renderers.nearest import nearest
from hapticeval.scene import Scene

MODELS = {"cassinian": cassinian(), "star": star(), "dumbbell": dumbbell()}
PROJECTIONS = {"minimum-distance": nearest, "conformal": by_conformal_map}
COARSE = 2e-3
everything = pytest.mark.parametrize(("projection", "model"), [(p, m) for p in PROJECTIONS for m in MODELS])


def answers(table, hips):
    """IHIPs (n, N), normals (n, N) and contact (n,) for hips (n, N), m, from a table alone, in plane and space.

    Written anew from what its arrays mean: a HIP off the grid is in free space, or, `everywhere`, taken as that of the
    nearest cell. In a marked cell the nearest node answers: a point of the surface.
    """
    n = table.grid.dimension
    cell_counts = np.array(table.grid.cells)
    grid_coordinates = (hips - table.grid.origin) / table.grid.cell
    on_grid = np.all((grid_coordinates >= 0.0) & (grid_coordinates <= cell_counts), axis=1)
    clipped = np.clip(np.nan_to_num(grid_coordinates), 0.0, cell_counts)
    cell = np.minimum(clipped.astype(np.int64), cell_counts - 1)
    share, kinds = clipped - cell, table.cells[tuple(cell.T[::-1])]
    kinds = np.where(on_grid, kinds, HELD + MARKED if table.everywhere else FREE)
    # in a marked cell the nearest node alone
    share = np.where((kinds >= MARKED)[:, np.newaxis], share > 0.5, share)
    answer = np.zeros((len(hips), 2 * n))
    for corner in itertools.product((0, 1), repeat=n):
        weight = np.prod(np.where(corner, share, 1.0 - share), axis=1)
        answer += weight[:, np.newaxis] * table.nodes[tuple((cell + corner).T[::-1])]
    ihips, normals = answer[:, :n], answer[:, n:]
    with np.errstate(invalid="ignore"):
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    behind = np.sum((hips - ihips) * normals, axis=1) < 0.0
    contact = (kinds != FREE) & (behind | (kinds & BORDER == 0)) & ~np.isnan(hips).any(axis=1)
    return np.where(contact[:, None], ihips, hips), np.where(contact[:, None], normals, 0.0), contact


def table_of(projection, model, *, cell=COARSE, bilateral=False):
    return tabulated(PROJECTIONS[projection], Scene(model=MODELS[model], bilateral=bilateral), "curve", cell=cell)


def exact_of(projection, model, *, bilateral=False):
    return PROJECTIONS[projection](Scene(model=MODELS[model], bilateral=bilateral), "curve")


def sphere(radius):
    """Minimum distance on a sphere about the origin; at its centre any direction is as good."""

    def project(points):
        far = np.linalg.norm(points, axis=1, keepdims=True)
        rays = np.divide(points, far, out=np.tile((1.0, 0.0, 0.0), (len(points), 1)), where=far > 0.0)
        return radius * rays, rays

    return Source(project=project, distance=lambda points: np.linalg.norm(points, axis=1) - radius)


def scattered(count=20_000, reach=0.12, seed=1):
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 2))


@everything
def test_no_ihip_is_further_off_the_surface_than_declared(projection, model):
    """With the exact projection where the table does not interpolate, and without."""
    made = table_of(projection, model)
    assert 0.0 < made.standoff <= PROBED_RAISE * OFF * COARSE + 1e-6
    for ihips, normals, contact in (made.trace(scattered()), answers(made.table, scattered())):
        assert np.max(np.abs(MODELS[model].curve.signed_distance(ihips[contact]))) <= made.standoff
        np.testing.assert_allclose(np.hypot(*normals[contact].T), 1.0, atol=1e-12)


@settings(max_examples=25)
@given(vertices=star_shaped(), hips=walks())
def test_on_any_polygon_too(vertices, hips):
    model = from_vertices(vertices)
    made = tabulated(nearest, Scene(model=model), "curve", cell=4e-3)
    for ihips, normals, contact in (made.trace(hips), answers(made.table, hips)):
        assert np.all(np.abs(model.curve.signed_distance(ihips[contact])) <= made.standoff + 1e-12)
        np.testing.assert_allclose(np.hypot(*normals[contact].T), 1.0, atol=1e-12)


def test_a_naive_table_smears_between_the_sheets():
    made = table_of("minimum-distance", "cassinian")
    table = made.table
    naive = Table(table.grid, table.nodes, table.cells & (HELD + BORDER), standoff=table.standoff)
    ihips, _, contact = answers(naive, scattered(200_000, 0.1))
    off = np.abs(MODELS["cassinian"].curve.signed_distance(ihips[contact]))
    assert np.max(off) > 0.02
    assert np.max(off) > 200.0 * made.standoff


@everything
def test_contact_is_decided_as_by_the_exact_surface(projection, model):
    made, hips = table_of(projection, model), scattered(50_000, 0.1)
    distance = MODELS[model].curve.signed_distance(hips)
    _, _, contact = made.trace(hips)
    differs = contact != (distance < 0.0)
    assert np.all(np.abs(distance[differs]) <= made.standoff)
    _, _, alone = answers(made.table, hips)
    assert np.all(np.abs(distance[alone != (distance < 0.0)]) <= COARSE)


@everything
def test_where_the_table_does_not_interpolate_the_exact_projection_answers(projection, model):
    made, exact = table_of(projection, model), exact_of(projection, model)
    hips = scattered()
    asked = made.table.look_up(hips)[2] == ASK
    assert 0.01 < np.mean(asked) < 0.25
    for ours, theirs in zip(made.trace(hips), exact.trace(hips), strict=True):
        np.testing.assert_array_equal(ours[asked], theirs[asked])


def test_the_error_falls_with_the_square_of_the_cell():
    model, cells = MODELS["cassinian"], (4e-3, 2e-3, 1e-3)
    hips = scattered(40_000, 0.1)
    exact, normals, contact = exact_of("minimum-distance", "cassinian").trace(hips)
    # away from the focal points, where the projection stretches by less than 2
    stretched = -model.curve.signed_distance(hips) * model.curve.curvature(model.curve.nearest(hips))
    counted = contact & (stretched < 0.5)
    tables = [table_of("minimum-distance", "cassinian", cell=cell).table for cell in cells]
    answers = [table.look_up(hips) for table in tables]
    for _, _, status in answers:
        counted &= status == TOUCHES
    assert np.count_nonzero(counted) > 0.7 * np.count_nonzero(contact)
    errors = [float(np.sqrt(np.mean(np.sum((ihips - exact)[counted] ** 2, axis=1)))) for ihips, _, _ in answers]
    angles = []
    for _, ours, _ in answers:
        cross = ours[:, 0] * normals[:, 1] - ours[:, 1] * normals[:, 0]
        angles.append(math.degrees(float(np.quantile(np.abs(np.arcsin(cross[counted])), 0.99))))
    orders = -np.diff(np.log2([errors, angles]), axis=1)
    np.testing.assert_allclose(orders, 2.0, atol=0.2)
    assert errors[1] < 2e-5
    assert angles[1] < 0.3


def test_what_is_far_outside_or_no_number_is_free_space():
    far = np.array([[5.0, -7.0], [1e300, 1e300], [-1e300, 0.0], [math.inf, 0.0], [math.nan, 0.0], [0.0, math.nan]])
    for table in (table_of("minimum-distance", "star").table, empty(Grid((0.0, 0.0), 1.0, (3, 2)))):
        ihips, normals, contact = answers(table, far)
        assert not contact.any()
        np.testing.assert_array_equal(ihips, far)
        np.testing.assert_array_equal(normals, 0.0)
        assert np.all(table.look_up(far)[2] == OUT)


def test_the_last_node_belongs_to_the_last_cell():
    table = empty(Grid((0.0, 0.0), 1.0, (3, 2)))
    table.cells[:] = HELD
    table.nodes[..., 0] = np.arange(4.0)
    table.nodes[..., 1] = np.arange(3.0)[:, None]
    table.nodes[..., 2] = 1.0
    corners = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 2.0], [3.0, 2.0], [1.25, 0.75]])
    ihips, _, contact = answers(table, corners)
    assert contact.all()
    np.testing.assert_allclose(ihips, corners, atol=1e-15)


def test_bilateral_contact_is_everywhere_and_smooth_across_the_surface():
    made = table_of("minimum-distance", "cassinian", bilateral=True)
    exact = exact_of("minimum-distance", "cassinian", bilateral=True)
    model = MODELS["cassinian"]
    u = np.linspace(0.0, 2.0 * math.pi, 300)
    across = [model.curve.position(u) + t * model.curve.normal(u) for t in (-1e-6, 1e-6)]
    hips = np.concatenate([*across, [[0.4, 0.1], [-1.0, -1.0]]])
    ihips, _, contact = made.trace(hips)
    assert contact.all()
    np.testing.assert_array_equal(ihips[-2:], exact.trace(hips[-2:])[0])
    assert np.max(np.hypot(*(ihips[:300] - ihips[300:600]).T)) < 1e-5
    ihips, _, contact = answers(made.table, hips)
    assert contact.all()
    assert np.max(np.abs(model.curve.signed_distance(ihips))) <= made.standoff


def test_in_space_between_eight_nodes():
    table = empty(grid_over((-0.1,) * 3, (0.1,) * 3, 8e-3))
    standoff = fill(table, sphere(0.1))
    table = replace(table, standoff=standoff)
    hips = np.random.default_rng(2).uniform(-0.13, 0.13, (20_000, 3))
    ihips, normals, contact = answers(table, hips)
    radius = np.linalg.norm(hips, axis=1)
    differs = contact != (radius < 0.1)
    assert np.all(np.abs(radius[differs] - 0.1) <= standoff)
    assert np.max(np.abs(np.linalg.norm(ihips[contact], axis=1) - 0.1)) <= standoff <= PROBED_RAISE * OFF * 8e-3
    shallow = contact & (radius > 0.08)
    np.testing.assert_allclose(normals[shallow], hips[shallow] / radius[shallow, None], atol=2e-3)
    np.testing.assert_array_equal(ihips[~contact], hips[~contact])
    np.testing.assert_array_equal(answers(table, np.full((1, 3), math.nan))[2], False)
    # the centre, where every direction is as near as any other, is not interpolated
    assert table.cells[tuple(count // 2 for count in table.cells.shape)] & MARKED


def test_slabs_of_any_thickness_give_the_same_table(monkeypatch):
    source = sphere(0.1)
    whole, slabs = (empty(grid_over((-0.1,) * 3, (0.1,) * 3, 2e-2)) for _ in range(2))
    fill(whole, source)
    monkeypatch.setattr("hapticeval.renderers.lut.SLAB", 500)
    fill(slabs, source)
    np.testing.assert_array_equal(whole.cells, slabs.cells)
    np.testing.assert_array_equal(whole.nodes, slabs.nodes)


def test_memory_is_that_of_6_2():
    """M = 16 N prod(D_i / Delta_i) bytes: 5.12 MB in the plane and 3.07 GB in space, and here the end nodes."""
    assert Grid((0.0, 0.0), 0.5e-3, (400, 400)).node_bytes == 5_145_632
    assert Grid((0.0, 0.0, 0.0), 0.5e-3, (400, 400, 400)).node_bytes == 3_095_097_648
    table = table_of("minimum-distance", "cassinian").table
    assert table.nbytes == table.grid.node_bytes + table.grid.cell_bytes
    assert table.nbytes == pytest.approx(32 * (0.2 / COARSE) ** 2, rel=0.1)
    assert grid_over((-0.1, -0.1), (0.1, 0.1), 0.5e-3).cells == (402, 402)


def test_a_table_is_made_once_for_a_model_and_its_settings():
    made = table_of("minimum-distance", "dumbbell")
    assert table_of("minimum-distance", "dumbbell").table is made.table
    assert table_of("minimum-distance", "dumbbell", bilateral=True).table is not made.table
    assert table_of("conformal", "dumbbell").table is not made.table


def test_a_flow_map_in_a_table():
    scene, settings = Scene(model=MODELS["cassinian"]), {"cells": 60}
    made = tabulated(by_flow_map, scene, "curve", cell=COARSE, **settings)
    exact, hips = by_flow_map(scene, "curve", **settings), scattered()
    ihips, _, contact = made.trace(hips)
    truth, _, _ = exact.trace(hips)
    assert np.max(np.abs(scene.model.curve.signed_distance(ihips[contact]))) <= made.standoff
    assert np.sqrt(np.mean(np.sum((ihips - truth)[contact] ** 2, axis=1))) < 1e-4
    assert made.resolution == max(COARSE, exact.resolution)


def test_at_shallow_depth_the_transversal_scheme_is_the_more_normal_one():
    angle, depth = np.linspace(0.0, 2.0 * math.pi, 997), 2e-4
    rays = np.column_stack([np.cos(angle), np.sin(angle)])
    off = {}
    for regulation in ("pp", "transversal"):
        family = minimum_distance.variant(representation="lut", regulation=regulation)
        _, forces = led(family(Scene(model=CIRCLE)), (0.1 - depth) * rays, 1e-3)
        across = np.abs(forces[:, 0] * rays[:, 1] - forces[:, 1] * rays[:, 0])
        off[regulation] = math.degrees(float(np.max(across / np.hypot(*forces.T))))
    assert off["transversal"] < 1e-3
    assert off["pp"] > 100.0 * off["transversal"]


@pytest.mark.parametrize("family", [minimum_distance, conformal])
def test_the_representation_lut_of_a_family_without_memory(family):
    renderer = family.variant(representation="lut")(Scene(model=circle()))
    assert (renderer.resolution, renderer.regulation.name) == (0.5e-3, family.regulation)
    assert 0.0 < renderer.standoff < 4e-5
    assert renderer.surface is renderer.projection.surface
    coarse = family.variant(representation="lut").with_knobs(cell=4e-3)(Scene(model=circle()))
    assert coarse.resolution == 4e-3
    assert renderer.standoff < coarse.standoff


def test_what_remembers_has_no_table(refused):
    with refused(InputError):
        constraint.variant(representation="lut")


@pytest.mark.parametrize("cell", [0.0, -1e-3, math.nan, math.inf, 0.5])
def test_a_cell_that_is_no_size_is_refused(refused, cell):
    with refused(InputError):
        tabulate(exact_of("minimum-distance", "star", bilateral=True), cell=cell)


def test_a_table_that_would_not_fit_in_memory_is_refused(refused):
    with refused(InputError):
        tabulate(exact_of("minimum-distance", "star", bilateral=True), cell=1e-6)


def test_arrays_that_do_not_fit_are_refused(refused):
    table = empty(Grid((0.0, 0.0), 1.0, (3, 2)))
    with refused(InputError):
        Table(table.grid, table.nodes[1:], table.cells)


CIRCLE = circle()


def of_solid(kind, *, cell, **parameters):
    scene = Scene(model=make_model(kind, **parameters))
    low, high = np.reshape(scene.model.boundary.bounds, (2, 3))
    hips = np.random.default_rng(4).uniform(low - 0.01, high + 0.01, (20_000, 3))
    return scene.model, tabulated(nearest, scene, "curve", cell=cell), nearest(scene, "curve"), hips


@pytest.mark.parametrize("kind", ["cube", "l-block"])
def test_on_a_solid_of_flat_faces_a_table_is_exact_where_it_answers_and_marked_where_faces_are_as_near(kind):
    model, made, exact, hips = of_solid(kind, cell=5e-3)
    (ihips, normals, status), (feet, true, contact) = made.table.look_up(hips), exact.trace(hips)
    answered = (status == TOUCHES) & contact
    assert 0.2 < np.mean(answered[contact]) < 0.9
    np.testing.assert_allclose(ihips[answered], feet[answered], atol=1e-15)
    # Round a concave edge, on which the IHIP then is, the normal turns.
    flat = answered & (np.sort(np.abs(true), axis=1)[:, -1] == 1.0)
    assert np.mean(flat[answered]) > 0.9
    aside = np.linalg.norm(normals - true, axis=1)[flat]
    assert np.quantile(aside, 0.95) < 1e-12
    assert made.standoff < 1e-15
    # Deeper than a cell, a HIP whose neighbours a cell away project elsewhere is asked of the projection itself.
    deep = model.boundary.signed_distance(hips) < -1e-2
    beside = [exact.trace(hips + step)[0] - feet for step in 5e-3 * np.vstack([np.eye(3), -np.eye(3)])]
    far = np.max([np.linalg.norm(each, axis=1) for each in beside], axis=0) < 2 * 5e-3
    assert np.mean(status[deep & far] == ASK) < np.mean(status[deep & ~far] == ASK)
    for ours, theirs in zip(made.trace(hips)[::2], exact.trace(hips)[::2], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_in_space_too_the_error_falls_with_the_square_of_the_cell():
    errors = []
    for cell in (8e-3, 4e-3):
        model, made, exact, hips = of_solid("sphere", cell=cell)
        (ihips, _, status), (feet, _, contact) = made.table.look_up(hips), exact.trace(hips)
        counted = (status == TOUCHES) & contact & (model.boundary.signed_distance(hips) > -0.03)
        errors.append(float(np.sqrt(np.mean(np.sum((ihips - feet)[counted] ** 2, axis=1)))))
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 2.0, atol=0.1)


def test_the_loop_in_space_answers_as_the_whole_table_does():
    _, made, _, hips = of_solid("l-block", cell=5e-3)
    (ihips, normals, status), (means, directions, contact) = made.table.look_up(hips), answers(made.table, hips)
    alone = status != ASK
    assert np.array_equal((status == TOUCHES)[alone], contact[alone])
    np.testing.assert_allclose(ihips[alone], means[alone], atol=1e-15)
    np.testing.assert_allclose(normals[alone], directions[alone], atol=1e-12)


def test_the_memory_of_a_table_in_space_is_known_before_it_is_made(refused):
    boundary = make_model("cube").boundary
    assert tabulated(nearest, Scene(model=make_model("cube")), "curve", cell=5e-3).table.nbytes == (
        grid_of(boundary, 5e-3).nbytes
    )
    assert grid_of(boundary).cell == 2e-3
    fine = minimum_distance.variant(representation="lut").with_knobs(cell=2e-4)
    with refused(RefusalError) as caught:
        fine(Scene(model=make_model("cube")))
    fits = float(caught.value.todo.split(": ")[1].split()[0])
    assert 0.8 * IN_MEMORY < grid_of(boundary, fits).nbytes < IN_MEMORY
    assert "space" in fine.supports
