"""Where devices can be, what bounds them, and whether models lie in there."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hapticeval.devices.device import (
    checked_joints,
    fit_in_workspace,
    require_in_workspace,
)
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3, ParallelogramParameters
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import DomainError, InputError
from hapticeval.examples.studies.reach import trace_section
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
    exact = np.linalg.norm(trace_section(FLAT, 40_000), axis=1).min()
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
