"""Where devices can be, what bounds them, and whether models lie in there."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hapticeval.devices.device import checked_joints
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3, ParallelogramParameters
from hapticeval.devices.point_mass import PointMass
from hapticeval.devices.workspace import (
    fit_in_workspace,
    lattice,
    nearest_limit,
    nearest_singularity,
    require_in_workspace,
)
from hapticeval.errors import DomainError, InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.model import Model
from hapticeval.geometry.surface import Surface

FLAT, DEEP, POINT = Parallelogram2(), Parallelogram3(), PointMass(0.1, 2)


def sphere(radius):
    return Model("sphere", {}, Surface("sphere", "sphere", (radius,)))


def inside(device, joints):
    return np.array([device.margin(np.array(pose)) > 0.0 for pose in joints])


def test_the_functional_configuration_space_is_open():
    assert inside(FLAT, [(0, 0), (0.5, -0.5), (0.5, -0.49), (2.4, 2.0), (0, -1.0)]).tolist() == [
        True, False, True, False, False,
    ]  # fmt: skip
    assert inside(DEEP, [(0, 0, 0), (2.4, 0, 0), (0, 1.2, 1.1)]).tolist() == [True, False, False]
    assert inside(POINT, [(1e9, 0)]).all()


def test_membership_is_that_of_the_definition():
    """(2.30) and (2.33), written out once more, on random joints."""
    joints = np.random.default_rng(0).uniform(-3.0, 3.0, (5000, 3))
    base, shoulder, elbow = joints.T
    expected = (np.abs(base) < 2.4) & (np.abs(shoulder) < 2.4) & (elbow > -1) & (elbow < 2.3)
    expected &= (np.abs(shoulder - elbow) < 1) & (0.3 * np.sin(shoulder) < 0.346 * np.cos(elbow))
    assert expected.sum() > 100
    assert np.array_equal(inside(DEEP, joints), expected)


def test_the_nearest_limit_and_singularity():
    limit = nearest_limit(FLAT, (2.3, 2.0))
    assert limit is not None
    assert (limit.what, limit.singular) == ("x1", False)
    assert limit.distance == pytest.approx(0.1)
    assert nearest_limit(POINT, (0, 0)) is None
    assert POINT.limits((0, 0)) == ()
    assert nearest_singularity(POINT, (0, 0)) == math.inf
    assert nearest_singularity(FLAT, (0.2, 0.2)) == pytest.approx(math.pi / 2.0 / math.sqrt(2.0))
    assert nearest_singularity(FLAT, (1.0, -1.0)) == pytest.approx((2.0 - math.pi / 2.0) / math.sqrt(2.0))
    assert nearest_singularity(DEEP, (0, 0, 0)) == pytest.approx(0.346 / math.hypot(0.3, 0.346))


@pytest.mark.parametrize("device", [FLAT, DEEP], ids=["2dof", "3dof"])
def test_no_singularity_is_nearer_than_reported(device):
    """The sign of det J stays as it is within that distance, also outside of the limits."""
    rng = np.random.default_rng(8)
    for joints in rng.uniform(-1.0, 1.0, (60, device.dimension)):
        radius = nearest_singularity(device, joints)
        moves = rng.normal(size=(40, device.dimension))
        moves *= (1.0 - 1e-9) * radius / np.linalg.norm(moves, axis=1, keepdims=True)
        signs = {np.sign(np.linalg.det(device.jacobian(joints + move))) for move in [*moves, 0.0 * joints]}
        assert len(signs) == 1


def test_the_size_of_the_workspace_is_the_integral_of_the_jacobian():
    """∫ |det J| dx over (2.38) and (2.33): ℓ₁ ℓ₄ cos(x₁ - x₂) in the plane, and r times that with the base turning."""

    shares = (np.arange(1000) + 0.5) / 1000
    elbow = (-1.0 + 3.3 * shares)[:, None]
    low, high = elbow - 1.0, np.minimum(elbow + 1.0, 2.4)
    shoulder = low + (high - low) * shares
    cell = 3.3 / 1000 * (high - low) / 1000
    plane = 0.3 * 0.346 * np.cos(shoulder - elbow) * cell
    reach = 0.346 * np.cos(elbow) - 0.3 * np.sin(shoulder)
    assert FLAT.size() == pytest.approx(plane.sum(), rel=1e-5)
    assert DEEP.size() == pytest.approx(4.8 * (plane * np.maximum(reach, 0.0)).sum(), rel=1e-5)


def test_the_outline_is_the_edge():
    """Every point of it is just reached: a step in is inside, a step out is not."""
    outline = FLAT.section(200)
    middle = FLAT.position((0.2, 0.4))
    for here, after in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        along = after - here
        outward = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        if np.cross([*along, 0.0], [*(middle - here), 0.0])[2] < 0.0:
            outward = -outward
        point = 0.5 * (here + after)
        # chords stray from the curve by their sagitta, a quarter of a millimetre at the most here
        reachable = [FLAT.margin(_joints(point + sign * 1e-3 * outward)) > 0.0 for sign in (-1.0, 1.0)]
        assert reachable in ([True, False], [False, True])


def _joints(point):
    try:
        return tuple(FLAT.joints(point))
    except DomainError:
        return (math.nan, math.nan)


def test_with_the_base_turning_the_section_ends_at_its_axis():
    outline = DEEP.section()
    assert outline[:, 0].min() == pytest.approx(-0.346)
    assert np.sum(np.abs(outline[:, 0] + 0.346) < 1e-12) == 2
    assert outline[:, 0].max() == pytest.approx(FLAT.section()[:, 0].max())


def test_a_lattice_goes_through_home_and_stays_inside():
    for device in (FLAT, DEEP):
        poses = lattice(device, clearance=0.2)
        assert min(device.margin(pose) for pose in poses) > 0.2
        assert (poses == 0.0).all(axis=1).any()
    assert np.array_equal(lattice(POINT), [(0.0, 0.0)])


def test_a_lattice_is_all_of_its_box_that_is_clear():
    """Against every node of the box around (2.30)."""
    for device, axes in ((FLAT, [(-2.2, 2.4), (-1.0, 2.2)]), (DEEP, [(-2.4, 2.4), (-2.2, 2.4), (-1.0, 2.2)])):
        steps = [np.arange(round(low / 0.2), round(high / 0.2) + 1) for low, high in axes]
        nodes = 0.2 * np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, device.dimension)
        expected = [pose for pose in nodes if device.margin(pose) > 0.15]
        assert np.array_equal(lattice(device, clearance=0.15), expected)


@pytest.mark.parametrize("kind", ["circle", "cassinian", "star", "ellipse", "dumbbell", "line"])
def test_the_models_of_the_catalogue_lie_in_the_workspace(kind):
    fit = fit_in_workspace(FLAT, make_model(kind))
    assert fit.holds
    assert fit.margin > 0.2
    require_in_workspace(FLAT, make_model(kind))


def test_a_circle_too_large_is_refused_with_the_first_point_out_of_reach(refused):
    fit = fit_in_workspace(FLAT, make_model("circle", size=0.5))
    assert not fit.holds
    assert (fit.row, fit.margin) == (0, -math.inf)
    assert_allclose(fit.point, (0.25, 0.0), atol=1e-15)
    assert "links reach" in fit.why
    with refused(DomainError):
        require_in_workspace(FLAT, make_model("circle", size=0.5))


def test_the_largest_circle_about_home():
    """Bisection against the distance of the outline from home."""
    exact = np.linalg.norm(FLAT.section(40_000), axis=1).min()
    low, high = 0.1, 0.3
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if fit_in_workspace(FLAT, make_model("circle", size=2.0 * middle)).holds else (low, middle)
        )
    assert low == pytest.approx(exact, abs=1e-4)


def test_spheres(refused):
    assert fit_in_workspace(DEEP, sphere(0.05)).holds
    fit = fit_in_workspace(DEEP, sphere(0.4))
    assert not fit.holds
    with refused(DomainError):
        require_in_workspace(DEEP, sphere(0.4))


def test_points_are_tried_in_order(refused):
    fit = fit_in_workspace(FLAT, [(0.0, 0.0), (-0.05, 0.0), (5.0, 0.0), (6.0, 0.0)])
    assert (fit.holds, fit.row, fit.point) == (False, 2, (5.0, 0.0))
    fit = fit_in_workspace(FLAT, [(0.0, 0.0), (0.1, 0.0), (-0.05, 0.0)])
    assert (fit.holds, fit.row) == (True, 1)
    assert fit.margin == FLAT.margin(FLAT.joints((0.1, 0.0)))
    with refused(DomainError):
        require_in_workspace(FLAT, [(5.0, 0.0)])
    assert fit_in_workspace(POINT, make_model("circle", size=100.0)).margin == math.inf


def test_of_an_unbounded_line_only_a_part_must_lie_inside():
    """A robot of 2 mm reaches little of it, and the point with the greatest margin is named."""
    small = Parallelogram2(ParallelogramParameters(l1=1e-3, l4=1e-3))
    assert not fit_in_workspace(small, [(-0.1, 0.0), (0.1, 0.0)]).holds
    fit = fit_in_workspace(small, make_model("line"))
    assert fit.holds
    assert abs(fit.point[0]) < 2e-3
    assert fit.margin == small.margin(small.joints(fit.point))


def test_what_is_no_place_is_refused(refused):
    with refused(InputError):
        fit_in_workspace(FLAT, sphere(0.05))
    with refused(InputError):
        fit_in_workspace(FLAT, [(0.0, 0.0, 0.0)])
    with refused(InputError):
        fit_in_workspace(FLAT, [(0.0, math.nan)])


def test_joints_are_checked_for_any_device():
    assert checked_joints(POINT, (1, 2)).dtype == np.float64
    for device, joints in ((POINT, (0, 0, 0)), (POINT, (0, math.inf)), (FLAT, ("a", "b"))):
        with pytest.raises(InputError):
            checked_joints(device, joints)
    with pytest.raises(DomainError):
        checked_joints(FLAT, (2.5, 2.0))
