"""A scene: the rigid model, the gains, and what the contact is like."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from hapticeval.devices.device import Device
from hapticeval.devices.imperfections import Imperfections
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.errors import InputError
from hapticeval.geometry.model import Model


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What a renderer is given, and what a check measures it against.

    `stiffness` K_p (N/m) and `damping` K_d (N s/m) are the gains of (4.6); `mass` (kg) is the virtual tool's;
    `restitution` is c_r of (3.5); `bilateral` holds the tool on the surface from both sides, as in section 6.3,
    where a unilateral contact only pushes outwards; `sampling_time` (s) is that of the haptic thread; `viscosity` b_d
    (kg/s) is that of the surface (7.18), for renderers that assign tangential dynamics.

    An experiment adds the robot: `device`, a point mass of the tool's `mass` where None, the `inner_loop` that turns
    the renderer's force into joint torques, and the `imperfections` that the scene calls for.

    Raises `InputError` for a gain or a mass that is negative, zero where it may not be, or not finite.
    """

    model: Model
    stiffness: float = 1000.0
    damping: float = 0.0
    mass: float = 0.1
    restitution: float = 0.0
    bilateral: bool = False
    sampling_time: float = 1e-3
    viscosity: float = 0.0
    device: Device | None = None
    inner_loop: InnerLoop = InnerLoop.STATIC
    imperfections: Imperfections = field(default_factory=Imperfections)

    def __post_init__(self) -> None:
        for name, unit, zero_allowed in (
            ("stiffness", "N/m", False),
            ("damping", "N s/m", True),
            ("mass", "kg", False),
            ("restitution", "", True),
            ("sampling_time", "s", False),
            ("viscosity", "kg/s", True),
        ):
            value = getattr(self, name)
            if not math.isfinite(value) or value < 0.0 or (value == 0.0 and not zero_allowed):
                raise InputError(
                    f"{name} = {value!r} {unit}".rstrip(),
                    why=f"it must be finite and {'not negative' if zero_allowed else 'positive'}",
                )
        if self.restitution > 1.0:
            raise InputError(
                f"restitution = {self.restitution!r}",
                why="a collision that creates energy is not passive: c_r of (3.5) lies between 0 and 1",
            )

    @property
    def requirements(self) -> tuple[Requirement, ...]:
        """What this scene asks of a renderer, in the order of `REQUIREMENTS`."""
        return tuple(each for each in REQUIREMENTS.values() if each.asked(self))

    @property
    def robot(self) -> Device:
        """The device of an experiment: the scene's, or a point mass of the virtual tool's mass."""
        return PointMass(self.mass, self.model.dimension) if self.device is None else self.device


@dataclass(frozen=True)
class Requirement:
    """One thing that a scene may ask of a renderer, under the `name` by which a renderer declares that it supports it.

    `meaning` completes "the scene asks for NAME: ..."; `asked` decides whether a scene does.
    """

    name: str
    meaning: str
    asked: Callable[[Scene], bool]


PLANE, SPACE, FORCE_SENSOR = "plane", "space", "force-sensor"

REQUIREMENTS = {
    each.name: each
    for each in (
        Requirement(PLANE, "the model is a plane curve", lambda scene: scene.model.dimension == 2),
        Requirement(SPACE, "the model is a surface in space", lambda scene: scene.model.dimension == 3),
        Requirement("bilateral", "the surface holds the tool from both sides", lambda scene: scene.bilateral),
        Requirement(
            "viscosity", "the surface brakes the tool that slides along it (7.18)", lambda scene: scene.viscosity > 0.0
        ),
        Requirement(
            FORCE_SENSOR,
            "the hand's force is measured, and the tool moves along the surface as under that force (8.6)",
            lambda scene: scene.imperfections.force_sensor is not None,
        ),
    )
}
"""All requirements by name. Whatever more a scene may call for is registered here, and nowhere else."""
