"""Contact impulse: a pulse when a contact begins, which takes the momentum of a collision out of the device (4.21)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.devices.parallelogram import Parallelogram
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.effect import Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError
from hapticeval.quantity import format_quantity


@dataclass(frozen=True)
class ContactImpulse(Effect):
    """Add (1 + c_r) v m_n along the normal in the tick in which a contact begins, once a contact.

    v is the speed of the approach along the normal, c_r the scene's restitution, and m_n = 1 / (n' J M⁻¹ J' n) the mass
    that the scene's device shows there, which is the tool's where the scene has none.

    A force above `cap` (N) is not given: what it holds back goes into the ticks that follow, as long as the contact
    lasts.
    """

    cap: float = number("N", finite=False, default=math.inf)

    kind: ClassVar[str] = "contact-impulse"
    stage: ClassVar[Stage] = Stage.ANSWER
    refusals: ClassVar[Mapping[int, str]] = {1: "a contact begins where the device does not reach: it has no inertia"}
    linear: ClassVar[bool] = False

    def fits(self, scene: Calling) -> None:
        """Refuse a contact that never begins, and a device whose inertia is not known to compiled code."""
        refuse_bilateral(self, scene)
        if not isinstance(scene.robot, PointMass | Parallelogram):
            raise InputError(
                f"a contact-impulse on a {scene.robot.name}",
                why="its inertia at a place is not known",
                todo="use a point mass or a parallelogram",
            )

    def change(self, scene: Calling) -> Part:
        """Assemble the blow: `params` are the cap, 1 + c_r and the device's."""
        from hapticeval.effects.transient_kernels import STATE, give_impulse

        params = [self.cap, 1.0 + scene.restitution, *scene.robot.parameters]
        return Part(give_impulse, np.array(params), state=np.zeros((STATE, scene.model.dimension)))

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe it with its cap."""
        return f"contact impulses{capped(self.cap)}"


def capped(cap: float) -> str:
    """Return the words with which messages add a cap (N) on the force; none for an infinite one."""
    return "" if math.isinf(cap) else f" of at most {format_quantity(cap, 'N')}"


def refuse_bilateral(effect: Effect, scene: Calling) -> None:
    """Raise `InputError` where the surface holds the tool from both sides: no contact begins there."""
    if scene.bilateral:
        raise InputError(
            f"a {effect.kind} on a bilateral constraint",
            why="the tool is held on the surface always, so that no contact begins",
            todo="leave out the effect, or bilateral",
        )
