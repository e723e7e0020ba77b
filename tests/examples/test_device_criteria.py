"""The criteria of Table 3.1 against golden numbers, closed forms and brute force."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hapticeval.devices.parallelogram import ENCODER_STEP, BaseInertia, Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import DomainError, InputError
from hapticeval.examples.studies.device_criteria import (
    CLEARANCE,
    cartesian_damping,
    cartesian_inertia,
    criteria,
    over_workspace,
    peak_acceleration,
    peak_force,
    position_resolution,
)
from hapticeval.examples.studies.reach import lattice


def test_in_the_plane_at_home():
    at = criteria(Parallelogram2(), (0, 0))
    assert_allclose(at.masses, (0.152444117745, 2.266666666667), atol=5e-13)
    assert_allclose(np.abs(at.directions), [[0, 1], [1, 0]], atol=1e-15)
    assert_allclose(at.stiffest, (561.328477, 2333.333333), atol=5e-7)
    assert_allclose(np.abs(at.resistance_directions), [[0, 1], [1, 0]], atol=1e-15)
    assert_allclose(1e6 * at.resolution, (7.19053, 8.29308), atol=1e-5)
    assert at.anisotropy == pytest.approx(2.266666666667 / 0.152444117745, rel=1e-11)
    assert at.manipulability == pytest.approx(0.1038, rel=1e-14)


def test_in_the_plane_elsewhere():
    at = criteria(Parallelogram2(), (0.3, 0.2))
    assert_allclose(at.masses, (0.152334728018, 2.291129356962), atol=5e-13)
    assert_allclose(at.stiffest, (559.569, 2364.233), atol=5e-4)
    assert_allclose(1e6 * at.resolution, (8.51696, 10.25272), atol=1e-5)


def test_the_stiffness_of_chapter_6_exceeds_the_bound_all_around_the_circle():
    """The weakest direction on the circle of 0.1 m allows 524.85 to 561.33 N/m: never the 1 kN/m of chapter 6."""
    device = Parallelogram2()
    angles = np.linspace(0.0, 2.0 * math.pi, 721)
    points = 0.1 * np.column_stack([np.cos(angles), np.sin(angles)])
    weakest = [criteria(device, device.joints(point)).stiffest[0] for point in points]
    assert min(weakest) == pytest.approx(524.85, abs=0.01)
    assert max(weakest) == pytest.approx(561.33, abs=0.01)


@pytest.mark.parametrize(("form", "middle"), [("sin", 6.674128771426), ("cos", 6.826572889171)])
def test_in_space_at_home(form, middle):
    at = criteria(Parallelogram3(base_inertia=BaseInertia(form)), (0, 0, 0))
    assert_allclose(at.inertia, np.diag((2.266666666667, middle, 0.152444117745)), atol=5e-13)
    assert_allclose(np.diag(at.damping) * 2000.0, (2333.333333, 7701.560360, 561.328477), atol=5e-7)
    assert_allclose(at.stiffest, (561.328477, 2333.333333, 7701.560360), atol=5e-7)


def test_a_point_mass_is_its_mass():
    at = criteria(PointMass(0.1, 3), (0.2, 0.0, -0.1), torque_limit=5.0)
    assert np.array_equal(at.inertia, 0.1 * np.eye(3))
    assert not at.damping.any()
    assert not at.stiffest.any()
    assert at.anisotropy == 1.0
    assert at.margin == math.inf
    assert at.force is not None
    assert at.acceleration is not None
    assert (at.force.worst, at.acceleration.worst) == (5.0, pytest.approx(50.0))
    assert at.force.best == pytest.approx(5.0 * math.sqrt(3.0))


@pytest.mark.parametrize("peak_of", [peak_force, peak_acceleration])
@pytest.mark.parametrize(
    ("device", "joints"), [(Parallelogram2(), (0.3, -0.2)), (Parallelogram3(), (0.5, 0.3, 0.2))], ids=["2dof", "3dof"]
)
def test_peaks_are_those_of_all_torques(device, joints, peak_of):
    """In 20,000 directions: none gives less than the worst or more than the best."""
    peak = peak_of(device, joints, 0.3)
    pose = np.array(joints)
    jacobian = device.jacobian(pose)
    torques_of = jacobian.T if peak_of is peak_force else device.inertia(pose) @ np.linalg.inv(jacobian)
    directions = np.random.default_rng(0).normal(size=(20_000, device.dimension))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    largest = 0.3 / np.abs(directions @ torques_of.T).max(axis=1)
    assert peak.worst <= largest.min() <= 1.02 * peak.worst
    assert 0.97 * peak.best <= largest.max() <= peak.best * (1.0 + 1e-12)
    for size, direction in ((peak.worst, peak.worst_direction), (peak.best, peak.best_direction)):
        assert np.linalg.norm(direction) == pytest.approx(1.0)
        assert np.abs(torques_of @ (size * direction)).max() == pytest.approx(0.3)
    assert_allclose(np.abs(peak.corners @ torques_of.T), 0.3)
    assert len(peak.corners) == 2**device.dimension


def test_peaks_at_home_by_hand():
    """Forces τ / ℓ, accelerations ℓ τ / d: 0.033 N m make 0.095 N, where a millimetre at 1 kN/m asks for 1 N."""
    force = peak_force(Parallelogram2(), (0, 0), 0.033)
    assert force.worst == pytest.approx(0.033 / 0.346)
    assert_allclose(np.abs(force.worst_direction), (0, 1), atol=1e-15)
    acceleration = peak_acceleration(Parallelogram2(), (0, 0), 0.033)
    assert acceleration.worst == pytest.approx(0.3 * 0.033 / 0.204)
    assert_allclose(np.abs(acceleration.worst_direction), (1, 0), atol=1e-15)


def test_resolution_is_the_largest_step_that_a_count_makes():
    device, joints = Parallelogram3(), np.array([0.5, 0.3, 0.2])
    steps = ENCODER_STEP * np.stack(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
    moved = np.array([device.position(joints + step) for step in steps]) - device.position(joints)
    assert_allclose(position_resolution(device, joints), np.abs(moved).max(axis=0), rtol=1e-4)


def test_over_the_workspace():
    """M̂ and B̂ of the plane have bounds by hand: 561.33 N/m is the most that the weakest direction ever allows."""
    device = Parallelogram2()
    spread = over_workspace(device, torque_limit=0.3)
    assert spread["stiffest"].largest == pytest.approx(561.328477, abs=1e-6)
    assert spread["manipulability"].largest == pytest.approx(0.1038)
    assert spread["force"].smallest == pytest.approx(0.3 / 0.346)
    poses = lattice(device, clearance=CLEARANCE)
    heaviest = [criteria(device, pose).masses[-1] for pose in poses]
    assert spread["heaviest"] == (min(heaviest), np.median(heaviest), max(heaviest))
    assert all(each.smallest <= each.median <= each.largest for each in spread.values())
    assert "force" not in over_workspace(device)
    assert over_workspace(PointMass(0.1, 2))["heaviest"].largest == pytest.approx(0.1)


@pytest.mark.parametrize(
    "call",
    [
        lambda device, joints: criteria(device, joints),
        lambda device, joints: cartesian_inertia(device, joints),
        lambda device, joints: cartesian_damping(device, joints),
        lambda device, joints: peak_force(device, joints, 1.0),
        lambda device, joints: peak_acceleration(device, joints, 1.0),
        lambda device, joints: position_resolution(device, joints),
    ],
)
def test_a_singular_pose_is_an_error_and_no_division_by_zero(refused, call):
    with refused(DomainError):
        call(Parallelogram3(), (0.0, 0.9, math.acos(0.3 * math.sin(0.9) / 0.346)))
    with refused(InputError):
        call(Parallelogram3(), (0.0, math.nan, 0.0))


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_a_torque_limit_that_is_none_is_refused(refused, value):
    with refused(InputError):
        criteria(Parallelogram2(), (0, 0), torque_limit=value)
