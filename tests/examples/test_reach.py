"""Where the parallelogram robot reaches: limits, singularities, the outline, its size, and a lattice of poses."""

import math

import numpy as np
import pytest

from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import DomainError
from hapticeval.examples.studies.reach import (
    lattice,
    nearest_limit,
    nearest_singularity,
    trace_section,
    workspace_size,
)

FLAT, DEEP, POINT = Parallelogram2(), Parallelogram3(), PointMass(0.1, 2)


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
    assert workspace_size(FLAT) == pytest.approx(plane.sum(), rel=1e-5)
    assert workspace_size(DEEP) == pytest.approx(4.8 * (plane * np.maximum(reach, 0.0)).sum(), rel=1e-5)


def test_the_outline_is_the_edge():
    """Every point of it is just reached: a step in is inside, a step out is not."""
    outline = trace_section(FLAT, 200)
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
    outline = trace_section(DEEP)
    assert outline[:, 0].min() == pytest.approx(-0.346)
    assert np.sum(np.abs(outline[:, 0] + 0.346) < 1e-12) == 2
    assert outline[:, 0].max() == pytest.approx(trace_section(FLAT)[:, 0].max())


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
