"""The force of LuGre friction along a recorded hand's path: what `friction-force` and `friction-work` compare with.

The bristles' mean deflection z, m, and the force F_t, N, at the hand's velocity v along the surface (Canudas de Wit et
al. 1995; `hapticeval.effects.lugre` says more):

    z' = v - sigma0 |v| z / g(v),   F_t = -(sigma0 z + sigma1(v) z' + sigma2 v).

While v and F_n are constant, z goes to z_ss = g v / (sigma0 |v|) as exp(-sigma0 |v| t / g).
"""

from __future__ import annotations

import math
from operator import mul
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.phenomena.measures.surface_force import SurfaceForce
from hapticeval.types import Array, BoolArray

if TYPE_CHECKING:
    from hapticeval.effects.lugre import LuGre


def lugre_force(friction: LuGre, surface_force: SurfaceForce, dt: float, parts: int) -> Array:
    """Return -F_t of LuGre friction at each tick, (n, N), N, for a speed that is held over each of `parts` of a tick.

    With one part that is the speed of the tick, else it goes straight from the last to that of the tick. `dt` is in s.
    """
    velocity, pressed = surface_force.velocity, surface_force.normal_force > 0.0
    normal_force = np.where(pressed, surface_force.normal_force, 1.0)[:, np.newaxis]
    decay, settled = _bend_in_a_tick(friction, velocity, normal_force, dt, parts)
    # Where the hand presses less they slip: sigma0 |z| <= mu_s F_n.
    longest = friction.mu_s / friction.stiffness * normal_force[:, 0]
    z = _bend_on(pressed, surface_force.unit_normals, decay, settled, longest)
    speed = np.linalg.norm(velocity, axis=1)[:, np.newaxis]
    # z' = v - sigma0 |v| z / g(v)
    rate = velocity - friction.stiffness * speed / (normal_force * friction.limit(speed)) * z
    # sigma0 z + sigma1(v) z' + sigma2 v
    force = friction.stiffness * z + friction.damping_at(speed) * rate + friction.viscosity * velocity
    return np.where(pressed[:, np.newaxis], force, 0.0)


def _bend_in_a_tick(
    friction: LuGre, velocity: Array, normal_force: Array, dt: float, parts: int
) -> tuple[Array, Array]:
    """Return `decay` (n, 1) and `settled` (n, N), m: in each tick z becomes decay z + settled.

    `velocity` (n, N), m/s, is the hand's, and `normal_force` (n, 1), N, is F_n.
    """
    velocity_before = np.concatenate([velocity[:1], velocity[:-1]])
    decay, settled = np.ones((len(velocity), 1)), np.zeros_like(velocity)
    for part in range(parts):
        # The speed in the middle of the part.
        mean = velocity if parts == 1 else velocity_before + (part + 0.5) / parts * (velocity - velocity_before)
        speed = np.linalg.norm(mean, axis=1)[:, np.newaxis]
        # |z_ss| = g(v) / sigma0, where g grows with F_n, and z_ss itself
        steady_length = normal_force * friction.limit(speed) / friction.stiffness
        steady = np.divide(steady_length * mean, speed, out=np.zeros_like(mean), where=speed > 0.0)
        # z = z_ss + (z - z_ss) exp(-sigma0 |v| t / g), over t = dt / parts
        part_decay = np.exp(-speed * dt / (parts * steady_length))
        decay, settled = decay * part_decay, steady + (settled - steady) * part_decay
    return decay, settled


def _bend_on(pressed: BoolArray, unit_normals: Array, decay: Array, settled: Array, longest: Array) -> Array:
    """Return z (n, N), m, at the end of each tick, of bristles that are straight where nothing presses.

    `pressed` (n,) and `unit_normals` (n, N) are those of the ticks, `decay` and `settled` of `_bend_in_a_tick`, and
    `longest` (n,), m, is the length that F_n holds. In plain numbers: rows are short, and each needs the one before.
    """
    straight = [0.0] * settled.shape[1]
    tiny, z, deflections = np.finfo(float).tiny, straight, []
    columns = (pressed, unit_normals, decay[:, 0], settled, longest)
    for touches, normal, shrink, gain, limit in zip(*(column.tolist() for column in columns), strict=True):
        # The bristles turn with the surface: z - (n . z) n is stretched to the length of z, or what F_n holds of it.
        across = sum(map(mul, z, normal))
        along = [component - across * direction for component, direction in zip(z, normal, strict=True)]
        # With the decay that is z(t + dt) = decay z(t) + settled.
        factor = shrink * min(math.hypot(*z), limit) / max(math.hypot(*along), tiny)
        z = [factor * part + more for part, more in zip(along, gain, strict=True)] if touches else straight
        deflections.append(z)
    return np.array(deflections)
