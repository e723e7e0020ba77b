"""The bound of Colgate and Schenkel (2.40), for a device that moves in more than one direction."""

from __future__ import annotations

import numpy as np

from hapticeval.devices.inner_loop import InnerLoop
from hapticeval.limits.linear import Robot
from hapticeval.scene import Scene
from hapticeval.types import Array

FREQUENCIES = 400


def port_damping(robot: Robot, normal: Array, dt: float) -> float:
    """b of (2.40), N s/m: the least real part of the device's impedance along `normal`, up to the Nyquist frequency.

    The theorem behind (2.40) asks Re Z(jω) > T / (2 (1 - cos ωT)) Re[(1 - exp(-jωT)) H] at every ω, which for a
    spring K and a damper B is Re Z > K T / 2 + |B| at the worst of them. Z is what is felt along the normal n while the
    tool is free across it, 1 / Z = nᵀ (jω M̂ + B̂)⁻¹ n; where inertia and damping share their axes, Z is b + jω m.
    """
    if not robot.losses.any():
        return 0.0
    inverse = np.linalg.inv(robot.jacobian)
    inertia, losses = (inverse.T @ part @ inverse for part in (robot.inertia, robot.losses))
    frequencies = np.geomspace(1e-3, np.pi / dt, FREQUENCIES)
    impedance = 1j * frequencies[:, None, None] * inertia + losses
    admittance = np.linalg.solve(impedance, np.broadcast_to(normal[:, None], (FREQUENCIES, normal.size, 1)))[..., 0]
    return float(np.min((1.0 / (admittance @ normal)).real))


def passive_stiffness(scene: Scene, robot: Robot, normal: Array) -> float | None:
    """The largest stiffness (N/m) that (2.40) allows, 2 (b - |B|) / (T + 2 d); zero where no stiffness is passive.

    A delay of d s turns the spring's part of the theorem into K T / 2 (cos ωd - cos ω(T + d)) / (1 - cos ωT), which is
    largest at ω = 0, K (T / 2 + d); the damper's stays within |B|. Without delay that is (2.40).
    None for all but the static inner loop: one that compensates the device's damping leaves no b to count on.
    """
    if scene.inner_loop is not InnerLoop.STATIC:
        return None
    damping = port_damping(robot, normal, scene.sampling_time)
    return max(0.0, 2.0 * (damping - scene.damping) / (scene.sampling_time + 2.0 * scene.imperfections.delay))
