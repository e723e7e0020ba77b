"""Inner loops: how a Cartesian force becomes joint torques (thesis 2.5.3, 2.5.4, 6.3.1)."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.devices.device import Device


class InnerLoop(StrEnum):
    """The three of the thesis.

    `static`: τ = Jᵀ F (2.8). `compensated`: the Coriolis, damping and gravity terms are added back (2.11), with the J̇
    that the print of (2.9) lost. `linearised`: feedback linearisation (6.7), (6.17), so that the end-effector moves as
    the virtual tool's mass does. None knows of Coulomb friction.
    """

    STATIC = "static"
    COMPENSATED = "compensated"
    LINEARISED = "linearised"

    @property
    def code(self) -> int:
        """What the kernels call it."""
        return tuple(InnerLoop).index(self)

    def torque(
        self, device: Device, joints: Array, rates: Array, force: Array, *, mass: float, push: Array | None = None
    ) -> Array:
        """Joint torques (N,) that `force` (N,), N, asks for at `joints` and `rates` (N,).

        - static: Jᵀ F;
        - compensated: Jᵀ F + bias - M J⁻¹ J̇ q̇, so that M̂ ÿ = F + F_o (2.12);
        - linearised: M J⁻¹ (v - J̇ q̇) + bias with v = F / `mass` (6.14), so that ÿ = v. With the hand's force `push`
          (N,), as a sensor gives it, v = (F + push) / mass and -Jᵀ push (8.6), so that m_tool ÿ = F + F_o (8.8). The
          other two make nothing of it.

        These are the numbers of a closed loop, from the same kernel.
        """
        from hapticeval.compiled import DYNAMICS, KINEMATICS, first_class
        from hapticeval.devices import dynamics_kernels as kernels

        size = device.dimension
        parameters = device.parameters
        vectors = [np.array(each, dtype=np.float64) for each in (joints, rates, force)]
        sensed = None if push is None else np.array(push, dtype=np.float64)
        squares, rows, out = np.empty((3, size, size)), np.empty((5, size)), np.empty(size)
        first_class(device.kernels.kinematics, KINEMATICS)(
            parameters, vectors[0], vectors[1], rows[2], rows[3], squares[2], rows[4]
        )
        dynamics = first_class(device.kernels.dynamics, DYNAMICS)
        kernels.torque(
            self.code, mass, dynamics, parameters, vectors[0], vectors[1], squares[2], rows[4], vectors[2], sensed,
            squares, rows, out,
        )  # fmt: skip
        return out
