"""The devices that suites name: the point mass and the parallelogram robot of section 2.5.5."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any

from hapticeval.devices.device import Device
from hapticeval.devices.parallelogram import (
    BaseInertia,
    Dynamics,
    Parallelogram2,
    Parallelogram3,
    ParallelogramParameters,
)
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.validate import checked_number

TABLE_A1 = tuple(field.name for field in fields(ParallelogramParameters))


def point_mass(mass: float, dimension: int = 2) -> PointMass:
    """Make a mass (kg) in 2 or 3 dimensions. Raises `InputError` for a mass that is not finite and positive."""
    mass, n = checked_number("mass", mass), checked_number("dimension", dimension)
    if mass <= 0.0:
        raise InputError(f"mass = {mass!r} kg", why="it must be positive")
    if n not in (2.0, 3.0):
        raise InputError(f"dimension = {dimension!r}", why="a point moves in the plane, 2, or in space, 3")
    return PointMass(mass, int(n))


def parallelogram_2dof(
    *, dynamics: str = Dynamics.LAGRANGIAN, base_inertia: str = BaseInertia.SIN, **constants: float
) -> Parallelogram2:
    """Make the robot with its base locked; `constants` are those of Table A.1, see `ParallelogramParameters`."""
    return Parallelogram2(ParallelogramParameters(**constants), Dynamics(dynamics), BaseInertia(base_inertia))


def parallelogram_3dof(
    *, dynamics: str = Dynamics.LAGRANGIAN, base_inertia: str = BaseInertia.SIN, **constants: float
) -> Parallelogram3:
    """Make the robot with its base turning; `constants` are those of Table A.1, see `ParallelogramParameters`."""
    return Parallelogram3(ParallelogramParameters(**constants), Dynamics(dynamics), BaseInertia(base_inertia))


DEVICES: Mapping[str, Callable[..., Device]] = MappingProxyType(
    {
        PointMass.name: point_mass,
        Parallelogram2.name: parallelogram_2dof,
        Parallelogram3.name: parallelogram_3dof,
    }
)


def make_device(kind: str, **parameters: Any) -> Device:
    """Make a device by the name and parameters that a suite file gives.

    `point-mass` has `mass` (kg) and `dimension`; `parallelogram-2dof` and `parallelogram-3dof` have the parameters of
    Table A.1, `dynamics` and `base_inertia`. Raises `UnknownNameError` for an unknown kind and `InputError` for
    parameters that it does not have, lacks, or cannot be made from.
    """
    if kind not in DEVICES:
        raise UnknownNameError("device", kind, DEVICES)
    known = parameters_of(kind)
    for parameter in parameters:
        if parameter not in known:
            raise UnknownNameError(f"parameter of device '{kind}'", parameter, known)
    for name, choices in (("dynamics", Dynamics), ("base_inertia", BaseInertia)):
        if name in parameters and parameters[name] not in list(choices):
            raise UnknownNameError(f"{name} of device '{kind}'", str(parameters[name]), choices)
    _require_parameters(kind, parameters, lambda name: f"give {name}, for instance {name} = 0.1")
    return DEVICES[kind](**parameters)


def device_named(text: str) -> Device:
    """Make a device by `kind` or `kind:name=value,...`, as command lines give it; a value is a number or a word.

    Raises `InputError` for what is not written so, and as `make_device` does.
    """
    kind, _, settings = text.partition(":")
    parameters: dict[str, float | str] = {}
    for part in settings.split(",") if settings else []:
        name, equals, value = (text_part.strip() for text_part in part.partition("="))
        if not (name and equals and value):
            raise InputError(
                f"device '{text}': '{part}' is not name=value", todo="write for instance parallelogram-3dof:b1=0.4"
            )
        try:  # a number, or else a word such as `lagrangian`
            parameters[name] = float(value)
        except ValueError:
            parameters[name] = value
    if kind in DEVICES:
        # refused here as on a command line, before `make_device` words it as for a suite file
        start = f"{text.rstrip(':')}{',' if settings else ':'}"
        _require_parameters(kind, parameters, lambda name: f"write for instance {start}{name}=0.1")
    return make_device(kind, **parameters)


def _require_parameters(kind: str, parameters: Mapping[str, Any], todo: Callable[[str], str]) -> None:
    """Raise `InputError` for the first parameter that a device of the catalogue lacks and cannot do without."""
    for name, parameter in inspect.signature(DEVICES[kind]).parameters.items():
        required = parameter.default is inspect.Parameter.empty and parameter.kind is not inspect.Parameter.VAR_KEYWORD
        if required and name not in parameters:
            raise InputError(f"device '{kind}' lacks the parameter '{name}'", todo=todo(name))


def parameters_of(kind: str) -> tuple[str, ...]:
    """Return the names of the parameters that a device of the catalogue may be given."""
    named: list[str] = []
    for name, parameter in inspect.signature(DEVICES[kind]).parameters.items():
        named += TABLE_A1 if parameter.kind is inspect.Parameter.VAR_KEYWORD else [name]
    return tuple(named)
