"""A scene: the rigid model, the gains, and what the contact is like."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, TypeVar, overload

from hapticeval.devices.device import Device
from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.catalogue import EFFECTS, VISCOSITY, in_order
from hapticeval.effects.effect import Effect, Stage
from hapticeval.errors import InputError
from hapticeval.geometry.model import Model
from hapticeval.stimulus.motions import AnyMotion

E = TypeVar("E", bound=Effect)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What a renderer is given, and what a check measures it against.

    - `stiffness` K_p (N/m) and `damping` K_d (N s/m): the gains of (4.6);
    - `mass` (kg): the virtual tool's;
    - `restitution`: c_r of (3.5), the share of the speed that a collision gives back;
    - `bilateral`: whether the surface holds the tool from both sides, as in section 6.3; else it only pushes outwards;
    - `sampling_time` (s): that of the haptic thread;
    - `effects`: what the scene calls for beside that, at most one of a kind. They are put into the order of the
      catalogue, without those that are off.

    - `motion`: how the body moves that the model is the frame of; None at rest.

    An experiment adds the robot: `device`, a point mass of the tool's `mass` where None, and the `inner_loop` that
    turns the renderer's force into joint torques. `believed` is the device that the inner loop takes it for, where that
    is another one: of the same kind, with the same lengths, and with other inertias or dampings.

    Raises `InputError` for a gain or a mass that is negative, zero where it may not be, or not finite, and for effects
    that make no sense together or on the device.
    """

    model: Model
    stiffness: float = 1000.0
    damping: float = 0.0
    mass: float = 0.1
    restitution: float = 0.0
    bilateral: bool = False
    sampling_time: float = 1e-3
    device: Device | None = None
    inner_loop: InnerLoop = InnerLoop.STATIC
    believed: Device | None = None
    effects: tuple[Effect, ...] = ()
    motion: AnyMotion | None = None

    def __post_init__(self) -> None:
        for name, unit, zero_allowed in (
            ("stiffness", "N/m", False),
            ("damping", "N s/m", True),
            ("mass", "kg", False),
            ("restitution", "", True),
            ("sampling_time", "s", False),
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
        if self.believed is not None and self.believed.name != self.robot.name:
            raise InputError(
                f"the inner loop believes in a {self.believed.name}, and the device is a {self.robot.name}",
                why="other inertias and dampings can be believed in, and no other robot",
            )
        if self.motion is not None:
            self.motion.check(dimension=self.model.dimension, size=self.model.size, dt=self.sampling_time)
        # The scene is frozen: this is the one way to put the effects in order.
        object.__setattr__(self, "effects", in_order(self.effects))
        for effect in self.effects:
            # First the effect on the device, then the effects with one another and with the gains.
            effect.check(self.robot)
            effect.fits(self)

    def answer_effects_except(self, *kinds: str) -> list[str]:
        """Return the kinds of the scene's effects that change a renderer's answers, without these `kinds`."""
        return [effect.kind for effect in self.effects if effect.stage is Stage.ANSWER and effect.kind not in kinds]

    @overload
    def effect(self, kind: type[E]) -> E | None: ...

    @overload
    def effect(self, kind: str) -> Any: ...

    def effect(self, kind: type[E] | str) -> Any:
        """Return the scene's effect of that class or kind; None where it does not call for it.

        By its kind an effect is asked for without importing it.
        """
        # A class of effects carries its kind as an attribute.
        of = kind if isinstance(kind, str) else kind.kind
        return next((effect for effect in self.effects if effect.kind == of), None)

    @property
    def viscosity(self) -> float:
        """Return b_d of (7.18) of the surface, kg/s; zero where the scene calls for none."""
        effect = self.effect(VISCOSITY)
        return 0.0 if effect is None else float(effect.coefficient)

    @property
    def senses_force(self) -> bool:
        """Whether a sensor tells the renderer the hand's force (8.6)."""
        return any(effect.stage is Stage.FEEL for effect in self.effects)

    def with_effects(self, *effects: Effect) -> Scene:
        """Return the scene with these effects, in place of its own of the same kinds."""
        kinds = {effect.kind for effect in effects}
        return replace(self, effects=(*(effect for effect in self.effects if effect.kind not in kinds), *effects))

    def without(self, kind: str) -> Scene:
        """Return the scene without its effect of that kind."""
        return replace(self, effects=tuple(effect for effect in self.effects if effect.kind != kind))

    @property
    def requirements(self) -> dict[str, str]:
        """Return what this scene asks of a renderer: name -> meaning, to complete "the scene asks for NAME: ..."."""
        # Effects of the stage ANSWER are put on the answers of any renderer, and so ask nothing of it.
        names = [PLANE if self.model.dimension == 2 else SPACE]
        names += [BILATERAL] if self.bilateral else []
        names += [] if self.motion is None else [MOVING]
        names += [effect.kind for effect in self.effects if effect.stage is not Stage.ANSWER]
        known = requirements()
        # Kinds without a meaning in the catalogue ask nothing of a renderer.
        return {name: known[name] for name in names if name in known}

    @property
    def robot(self) -> Device:
        """The device of an experiment: the scene's, or a point mass of the virtual tool's mass."""
        return PointMass(self.mass, self.model.dimension) if self.device is None else self.device

    @property
    def believed_robot(self) -> Device:
        """The device that the inner loop takes the robot for: the robot itself where nothing else is said."""
        return self.robot if self.believed is None else self.believed


PLANE, SPACE, BILATERAL, MOVING = "plane", "space", "bilateral", "moving"


def requirements() -> dict[str, str]:
    """Return all that a scene may ask of a renderer, under the names by which a renderer declares to support it."""
    return {
        PLANE: "the model is a plane curve",
        SPACE: "the model is a surface in space",
        BILATERAL: "the surface holds the tool from both sides",
        MOVING: "the body moves",
        **{kind: entry.meaning for kind, entry in EFFECTS.items() if entry.meaning},
    }
