"""Devices by name, as suites and the command line give them."""

import math

import pytest

from hapticeval.devices.catalogue import device_named, make_device, parameters_of
from hapticeval.devices.device import Device
from hapticeval.devices.parallelogram import BaseInertia, Dynamics, Parallelogram2, Parallelogram3
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import InputError


@pytest.mark.parametrize(
    ("kind", "parameters", "dimension"),
    [
        ("point-mass", {"mass": 0.1, "dimension": 3}, 3),
        ("parallelogram-2dof", {}, 2),
        ("parallelogram-3dof", {}, 3),
    ],
)
def test_every_device_is_one_and_knows_its_name(kind, parameters, dimension):
    device = make_device(kind, **parameters)
    assert isinstance(device, Device)
    assert (device.name, device.dimension) == (kind, dimension)


def test_table_a1_can_be_overridden_one_by_one():
    device = make_device("parallelogram-3dof", b1=0.0, l4=0.4, dynamics="printed", base_inertia="cos")
    assert isinstance(device, Parallelogram3)
    assert (device.constants.b1, device.constants.l4, device.constants.d1) == (0.0, 0.4, 0.799)
    assert (device.dynamics, device.base_inertia) == (Dynamics.PRINTED, BaseInertia.COS)


def test_the_defaults_are_table_a1_with_lagrangian_dynamics():
    assert make_device("parallelogram-2dof") == Parallelogram2()
    constants = Parallelogram2().constants
    assert (constants.l1, constants.l4) == (0.300, 0.346)
    assert (constants.b1, constants.b2, constants.b3) == (0.461, 0.105, 0.0336)
    assert (constants.d1, constants.d2, constants.d3) == (0.799, 0.204, 0.01825)
    assert Parallelogram3().dynamics is Dynamics.LAGRANGIAN
    assert Parallelogram3().base_inertia is BaseInertia.SIN


def test_parameters_are_listed_by_name():
    assert parameters_of("point-mass") == ("mass", "dimension")
    assert set(parameters_of("parallelogram-2dof")) == {
        "dynamics", "base_inertia", "l1", "l4", "b1", "b2", "b3", "d1", "d2", "d3",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("paralelogram-3dof", {}),
        ("parallelogram-3dof", {"l2": 0.3}),
        ("parallelogram-3dof", {"dynamics": "lagrange"}),
        ("parallelogram-3dof", {"base_inertia": "tan"}),
        ("parallelogram-3dof", {"dynamics": ["printed"]}),
        ("parallelogram-2dof", {"mass": 1.0}),
        ("parallelogram-2dof", {"l1": 0.0}),
        ("parallelogram-2dof", {"l1": -0.3}),
        ("parallelogram-2dof", {"l4": math.inf}),
        ("parallelogram-2dof", {"b2": -0.1}),
        ("parallelogram-2dof", {"b2": math.nan}),
        ("parallelogram-2dof", {"d3": 0.0}),
        ("parallelogram-2dof", {"d3": "heavy"}),
        ("point-mass", {}),
        ("point-mass", {"mass": -1.0}),
        ("point-mass", {"mass": 1.0, "dimension": 4}),
        ("point-mass", {"mass": math.nan}),
    ],
)
def test_what_is_no_device_is_refused(refused, kind, parameters):
    with refused(InputError):
        make_device(kind, **parameters)


def test_a_device_can_be_named_in_one_string():
    assert device_named("parallelogram-2dof") == Parallelogram2()
    assert device_named("point-mass:mass=0.2, dimension=3") == PointMass(0.2, 3)
    device = device_named("parallelogram-3dof:dynamics=printed,b1=0.4")
    assert isinstance(device, Parallelogram3)
    assert (device.dynamics, device.constants.b1) == (Dynamics.PRINTED, 0.4)


@pytest.mark.parametrize("text", ["point-mass:mass", "point-mass:=1", "point-mass:mass=", "point-mass:mass=1,"])
def test_a_string_that_names_no_device_message_where(refused, text):
    with refused(InputError):
        device_named(text)
