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
        """Return the joint torques (N,), N m or N, that `force` (N,), N, asks for at `joints` and `rates` (N,).

        - static: Jᵀ F;
        - compensated: Jᵀ F + bias - M J⁻¹ J̇ q̇, so that M̂ ÿ = F + F_o (2.12);
        - linearised: M J⁻¹ (v - J̇ q̇) + bias with v = F / `mass` (6.14), so that ÿ = v. With the hand's force `push`
          (N,), as a sensor gives it, v = (F + push) / mass and -Jᵀ push (8.6), so that m_tool ÿ = F + F_o (8.8). The
          other two make nothing of it.

        These are the numbers of a closed loop, from the same kernel.
        """
        from hapticeval.devices.inner_loop_kernels import Inner, torque
        from hapticeval.devices.motion_kernels import DRIFT, JACOBIAN, POSITION, VELOCITY, plant_of, scratch_of

        q, rate, response = (np.array(vector, dtype=np.float64) for vector in (joints, rates, force))
        sensed = None if push is None else np.array(push, dtype=np.float64)
        plant, scratch, out = plant_of(device), scratch_of(device.dimension), np.empty(device.dimension)
        rows = scratch.rows
        # the kernel takes J and J̇ q̇ from the scratch, where a closed loop's sensing has left them
        plant.kinematics(
            plant.parameters, q, rate, rows[POSITION], rows[VELOCITY], scratch.squares[JACOBIAN], rows[DRIFT]
        )
        torque(Inner(self.code, mass, device.parameters), plant, q, rate, response, sensed, scratch, out)
        return out

    def torques(
        self, device: Device, joints: Array, rates: Array, force: Array, *, mass: float, push: Array | None = None
    ) -> Array:
        """Return what `torque` does, (n, N), N m or N, for each of n rows of its arguments (n, N), ten times as fast.

        The kernel's types are looked up once for all rows.
        """
        from hapticeval.compiled import specialised
        from hapticeval.devices.inner_loop_kernels import Inner, torque
        from hapticeval.devices.motion_kernels import DRIFT, JACOBIAN, POSITION, VELOCITY, plant_of, scratch_of

        q, rate, response = (np.array(rows, dtype=np.float64) for rows in (joints, rates, force))
        sensed = [None] * len(q) if push is None else np.array(push, dtype=np.float64)
        inner, plant, scratch = (
            Inner(self.code, mass, device.parameters),
            plant_of(device),
            scratch_of(device.dimension),
        )
        position, velocity, drift = (scratch.rows[row] for row in (POSITION, VELOCITY, DRIFT))
        out = np.empty_like(q)
        if not len(q):
            return out
        step = specialised(torque, inner, plant, q[0], rate[0], response[0], sensed[0], scratch, out[0])
        for joints_row, rates_row, response_row, push_row, out_row in zip(q, rate, response, sensed, out, strict=True):
            plant.kinematics(
                plant.parameters, joints_row, rates_row, position, velocity, scratch.squares[JACOBIAN], drift
            )
            step(inner, plant, joints_row, rates_row, response_row, push_row, scratch, out_row)
        return out
