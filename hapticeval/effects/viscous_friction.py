"""What brakes in proportion to the speed along the surface: the viscosity of (7.18), and viscous friction.

Renderers assign the former to the tool; the latter is a force against the hand's motion, F_t = -b v_t.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hapticeval.effects.effect import Alters, Calling, Effect, Part, Stage, number
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.laws import ChangeData, Closest


@dataclass(frozen=True)
class Viscosity(Effect):
    """Brake the tool along the surface with b_d = `coefficient` (kg/s): renderers assign it to the sliding tool."""

    coefficient: float = number("kg/s", zero=True, short="viscosity")

    kind: ClassVar[str] = "viscosity"
    words: ClassVar[str] = "viscosity {coefficient}"

    @property
    def off(self) -> bool:
        """Whether its coefficient is zero: it then changes nothing."""
        return self.coefficient == 0.0


@dataclass(frozen=True)
class ViscousFriction(Effect):
    """Brake the hand along the surface with b = `coefficient` (N s/m) while there is contact.

    v_t is the part of the hand's velocity along the surface at the IHIP. Of `viscosity`, the b_d of (7.18), it differs
    in that it is put on any renderer's answers. A damper that is held for a tick gives at most (b/dt) sum of |dHIP|^2.
    """

    coefficient: float = number("N s/m", zero=True)

    kind: ClassVar[str] = "viscous-friction"
    stage: ClassVar[Stage] = Stage.ANSWER
    alters: ClassVar[frozenset[Alters]] = frozenset({Alters.MOTION})
    words: ClassVar[str] = "viscous friction {coefficient}"

    @property
    def off(self) -> bool:
        """Whether its coefficient is zero: it then changes nothing."""
        return self.coefficient == 0.0

    def change(self, scene: Calling) -> Part:
        """Assemble the brake."""
        return Part(
            brake, np.array([self.coefficient, float(scene.bilateral)]), state=np.zeros((2, scene.model.dimension))
        )


def brake(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """Add -b v_t to the force where there is contact, with v_t the part of the hand's velocity along the surface.

    The signature is that of `Effect.change`: `velocity` (N,), m/s, `ihip` (N,), m, `force` (N,), N. `data.params`
    (2,) are b (N s/m), and 1 where the surface is bilateral, so that there is contact always; `data.state` (2, N)
    takes place (m) and outward unit normal of the IHIP.
    """
    touching = data.params[1] == 1.0
    for i in range(hip.shape[0]):
        touching = touching or force[i] != 0.0
    if not touching:
        return 0
    closest.function(closest.data, ihip, data.state)
    velocity_on_normal = 0.0
    for i in range(hip.shape[0]):
        velocity_on_normal += velocity[i] * data.state[1, i]
    for i in range(hip.shape[0]):
        force[i] -= data.params[0] * (velocity[i] - velocity_on_normal * data.state[1, i])
    return 0
