"""The hierarchical table: it holds its error, in a tenth of the memory, and says where it does not interpolate."""

import math
from functools import cache

import numpy as np
import pytest

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, star
from hapticeval.renderers.family import by_conformal, by_minimum_distance
from hapticeval.renderers.lut import LutProjection
from hapticeval.renderers.lut_build import tabulate
from hapticeval.renderers.lut_kernels import ASK, MARKED, OUT, TOUCHES
from hapticeval.renderers.lut_table import grid_over
from hapticeval.renderers.lut_tree import grow
from hapticeval.scene import Scene

MODELS = {"cassinian": cassinian(), "star": star()}
PROJECTIONS = {"minimum-distance": by_minimum_distance, "conformal": by_conformal}
ERROR = 5e-5
HIPS = np.random.default_rng(7).uniform(-0.12, 0.12, (20_000, 2))


def exact(projection, model, *, bilateral=False):
    return PROJECTIONS[projection](Scene(model=MODELS[model], bilateral=bilateral), "curve")


@cache
def tree_of(projection, model, smallest=1e-3):
    return grow(exact(projection, model, bilateral=True), error=ERROR, smallest=smallest)


@pytest.mark.parametrize(("projection", "model"), [(p, m) for p in PROJECTIONS for m in MODELS])
def test_it_holds_the_stated_error_where_it_interpolates(projection, model):
    tree = tree_of(projection, model)
    ihips, normals, status = tree.look_many(HIPS, ask=True)
    truth, _, contact = exact(projection, model).trace(HIPS)
    both = contact & (status == TOUCHES)
    assert np.max(np.hypot(*(ihips - truth)[both].T)) <= ERROR
    np.testing.assert_allclose(np.hypot(*normals[both].T), 1.0, atol=1e-12)
    # what it does not interpolate is a small share, and contact is wrong within the error only
    assert np.mean(status[contact] == ASK) < 0.35
    depth = MODELS[model].curve.signed_distance(HIPS)
    wrong = (status != ASK) & (contact != (status == TOUCHES))
    assert np.all(np.abs(depth[wrong]) <= ERROR)


def test_it_takes_a_tenth_of_the_dense_memory_at_the_same_error():
    # the dense table with the cell of the smallest leaf holds the error over the same area, and no coarser one does
    tree = tree_of("minimum-distance", "cassinian", 0.25e-3)
    xmin, ymin, xmax, ymax = MODELS["cassinian"].curve.bounds
    grid = grid_over((xmin, ymin), (xmax, ymax), 0.25e-3)
    assert tree.nbytes < 0.1 * (grid.node_bytes + grid.cell_bytes)
    truth, _, contact = exact("minimum-distance", "cassinian").trace(HIPS)
    status = tree.look_many(HIPS, ask=True)[2]
    counted = contact & (status == TOUCHES)
    coarse = tabulate(exact("minimum-distance", "cassinian", bilateral=True), cell=1e-3)
    ihips, _, answered = coarse.look_many(HIPS, ask=True)
    amiss = counted & ((answered == ASK) | (np.hypot(*(ihips - truth).T) > ERROR))
    assert np.count_nonzero(amiss) > 0.01 * np.count_nonzero(counted)


def test_a_smaller_leaf_leaves_less_to_the_exact_projection():
    shares = []
    for smallest in (2e-3, 1e-3, 0.5e-3):
        status = tree_of("minimum-distance", "cassinian", smallest).look_many(HIPS, ask=True)[2]
        shares.append(np.mean(status == ASK))
    assert shares[0] > 1.6 * shares[1] > 1.6**2 * shares[2] > 0.0


def test_no_leaf_is_more_than_twice_as_large_as_its_neighbour():
    tree = tree_of("minimum-distance", "cassinian")
    count = 1 << tree.levels
    size = np.zeros((count, count), int)
    stack = [(0, 0, 0, count)]
    while stack:
        node, x, y, side = stack.pop()
        link = tree.links[node]
        if link >= 0:
            half = side // 2
            stack += [(link + k, x + (k & 1) * half, y + (k >> 1) * half, half) for k in range(4)]
        elif link <= -2:
            size[y : y + side, x : x + side] = side
    for one, two in ((size[1:], size[:-1]), (size[:, 1:], size[:, :-1])):
        held = (one > 0) & (two > 0)
        assert np.all(one[held] <= 2 * two[held])
        assert np.all(two[held] <= 2 * one[held])
    assert np.max(size) >= 8
    assert {1, 2, 4, 8} <= set(np.unique(size))
    # only the smallest are marked
    marked = tree.corners[tree.kinds >= MARKED]
    assert np.unique(size[size > 0]).min() == 1
    assert marked.shape[0] > 0


@pytest.mark.parametrize("bilateral", [False, True])
def test_as_a_projection_one_at_a_time_and_in_batch_agree(bilateral):
    both = exact("minimum-distance", "star", bilateral=True)
    tree = grow(both, error=2e-4, smallest=2e-3, everywhere=bilateral)
    projection = LutProjection(
        tree, both.surface, resolution=2e-3, exact=exact("minimum-distance", "star", bilateral=bilateral)
    )
    hips = np.concatenate([HIPS[:3000], [[5.0, -7.0], [0.128, 0.128], [-0.128, 0.0]]])
    ihips, normals, contact = projection.trace(hips)
    for k, hip in enumerate(hips):
        one = projection.project(hip)
        assert (one.ihip, one.normal, one.contact) == (tuple(ihips[k]), tuple(normals[k]), contact[k])
    assert np.max(np.abs(both.surface.signed_distance(ihips[contact]))) <= projection.standoff == 2e-4
    assert contact.all() == bilateral
    alone, _, held = LutProjection(tree, both.surface, resolution=2e-3).trace(hips)
    assert np.max(np.abs(both.surface.signed_distance(alone[held]))) <= 2e-4


def test_outside_its_square_is_free_space():
    tree = tree_of("minimum-distance", "star")
    far = np.array([[5.0, -7.0], [1e300, 0.0], [math.inf, 0.0], [math.nan, 0.0], [0.0, -math.inf]])
    assert np.all(tree.look_many(far, ask=True)[2] == OUT)


@pytest.mark.parametrize(
    ("error", "smallest"), [(0.0, 1e-3), (math.nan, 1e-3), (1.0, 1e-3), (1e-4, 0.0), (1e-4, 1e-6), (1e-4, 1.0)]
)
def test_errors_and_leaves_that_are_no_sizes_are_refused(error, smallest):
    with pytest.raises(InputError, match="a hierarchical table with an error of"):
        grow(exact("minimum-distance", "star", bilateral=True), error=error, smallest=smallest)
