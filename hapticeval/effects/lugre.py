"""LuGre friction: bristles that bend before they slide, with a state, a Stribeck curve and viscous friction.

Canudas de Wit, Olsson, Astrom, Lischinsky: A new model for control of systems with friction, IEEE Trans. Automatic
Control 40 (1995). The thesis names no such model. With v the hand's velocity along the surface and z, m, the bristles'
mean deflection, a vector along the surface:

    z' = v - sigma0 |v| z / g(v),   g(v) = F_n (mu_k + (mu_s - mu_k) exp(-(v / v_s)^2)),
    F_t = -(sigma0 z + sigma1(v) z' + sigma2 v),   sigma1(v) = sigma1 exp(-(v / fade)^2).

The paper's F_s and F_c are forces. Here they are mu_s F_n and mu_k F_n, as a hand presses as it likes; F_n is the
renderer's force along its error. sigma0, sigma1 and sigma2 stay those of the paper, N/m and N s/m.

A form with all three proportional to F_n, as in tyre models, would store sigma0 F_n z^2 / 2, which grows at a bent
bristle when the hand presses harder: it gives energy.

With a stiffness that does not depend on F_n the bristles store sigma0 z^2 / 2. Where the hand presses less than before
they slip, to |z| <= mu_s F_n / sigma0, which takes energy out.

**The step** is exact for a speed that is held over the tick: z(dt) = z_ss + (z - z_ss) exp(-sigma0 |v| dt / g), z_ss =
g v / (sigma0 |v|).

An explicit Euler step has the factor 1 - sigma0 |v| dt / g in its place, and diverges above the speed 2 g / (sigma0
dt): 20 mm/s at 1 kHz for sigma0 = 1e5 N/m and g = 1 N.

**Passivity.** With sigma0 z^2 / 2 stored and |z| <= mu_s F_n / sigma0, F_t.v <= -(stored)' - v^2 (sigma2 - sigma1(v)
(mu_s F_n / g(v) - 1)). So it is passive if sigma1(v) (mu_s F_n / g(v) - 1) <= sigma2 at every speed: F_n cancels.

Without `fade` that is sigma2 >= sigma1 (mu_s - mu_k) / mu_k, which parameters in textbooks do not keep. With a fade
short against v_s the damping is gone before g has fallen (Olsson, Control systems with friction, Lund 1996, section
3.5).

All of this is of continuous time. What a force that is held for a tick adds is that of a spring sigma0 and of a damper
sigma1 + sigma2: a loop with a light tool takes neither at the stiffness of steel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hapticeval.effects.catalogue import FRICTION, VISCOUS_FRICTION
from hapticeval.effects.effect import Alters, Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.laws import ChangeData, Closest

RELATIVE_SPEEDS = np.logspace(-6.0, 3.0, 4096)
"""Speeds, in v_s, at which a damping that fades is held against sigma2: 0.5 % apart, so to 1e-5 at its maximum."""


@dataclass(frozen=True)
class LuGre(Effect):
    """Friction of bristles: `stiffness` sigma0 (N/m), `damping` sigma1 and `viscosity` sigma2 (N s/m); see the module.

    `mu_s` and `mu_k` are shares of the normal force, `stribeck` is v_s (m/s). With `fade` (m/s) the damping is
    sigma1 exp(-(v / fade)^2). Raises `InputError` for numbers out of range and mu_k > mu_s.
    """

    mu_s: float = number("")
    mu_k: float = number("")
    stribeck: float = number("m/s")
    stiffness: float = number("N/m")
    damping: float = number("N s/m", zero=True)
    viscosity: float = number("N s/m", zero=True)
    fade: float | None = number("m/s", default=None)

    kind: ClassVar[str] = "lugre"
    stage: ClassVar[Stage] = Stage.ANSWER
    alters: ClassVar[frozenset[Alters]] = frozenset({Alters.MOTION})
    linear: ClassVar[bool] = False
    words: ClassVar[str] = (
        "LuGre friction with mu_s {mu_s}, mu_k {mu_k}, v_s {stribeck}, sigma0 {stiffness}, sigma1 {damping} and sigma2 "
        "{viscosity}"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mu_k > self.mu_s:
            raise InputError(
                f"the lugre's mu_k = {self.mu_k!r} is above mu_s = {self.mu_s!r}",
                why="g(v) falls from mu_s F_n to mu_k F_n with the speed (Stribeck)",
                todo="give mu_k <= mu_s",
            )

    def fits(self, scene: Calling) -> None:
        """Raise `InputError` in a scene that calls for another friction."""
        for effect in scene.effects:
            if effect.kind in (FRICTION, VISCOUS_FRICTION):
                raise InputError(
                    f"the scene calls for '{self.kind}' and '{effect.kind}'",
                    why="LuGre is a whole model of friction, dry and viscous, and both would count it twice",
                    todo="leave one out",
                )

    def limit(self, speed: Array | float) -> Array:
        """Return the coefficient of friction that a steady speed meets, g(v) / F_n, (n,), at speeds (n,), m/s."""
        return np.asarray(self.mu_k + (self.mu_s - self.mu_k) * np.exp(-((speed / self.stribeck) ** 2)))

    def damping_at(self, speed: Array | float) -> Array:
        """Return the bristles' damping sigma1(v), (n,), N s/m, which fades with the speed, at speeds (n,), m/s."""
        return np.asarray(self.damping * np.exp(-((speed / (self.fade or np.inf)) ** 2)))

    @property
    def needed(self) -> float:
        """The sigma2, N s/m, from which on it is passive: the largest sigma1(v) (mu_s F_n / g(v) - 1)."""
        if self.fade is None:
            return self.damping * (self.mu_s - self.mu_k) / self.mu_k
        speed = self.stribeck * RELATIVE_SPEEDS
        return float(np.max(self.damping_at(speed) * (self.mu_s / self.limit(speed) - 1.0)))

    def active(self, damping: float) -> str | None:  # noqa: ARG002 - a renderer's damper need not be along the surface
        """Return that the bristles' damping may drive the hand, where their viscosity does not outweigh it."""
        if self.viscosity >= self.needed:
            return None
        return (
            f"LuGre friction with sigma2 = {self.viscosity:g} N s/m is active: it is passive for sigma2 >= "
            + ("sigma1 (mu_s - mu_k) / mu_k" if self.fade is None else "the largest sigma1(v) (mu_s F_n / g(v) - 1)")
            + f" = {self.needed:.4g} N s/m"
        )

    def change(self, scene: Calling) -> Part:
        """Assemble the bristles: `params` and `state` as `bend_bristles` takes them."""
        params = [
            self.stiffness,
            self.damping,
            self.viscosity,
            self.mu_s,
            self.mu_k,
            self.stribeck,
            self.fade or np.inf,
            float(scene.bilateral),
        ]
        return Part(bend_bristles, np.array(params), state=np.zeros((3, scene.model.dimension)))


def bend_bristles(
    data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array
) -> int:  # fmt: skip
    """Bend the bristles by one tick and add their force to `force`: the module's model, by its exact step.

    The signature is that of `Effect.change`: `hip` and `ihip` (N,), m, `velocity` (N,), m/s, `dt`, s, `force` (N,), N.

    - `data.params` (8,): sigma0 (N/m), sigma1 and sigma2 (N s/m), mu_s, mu_k, v_s and fade (m/s), and 1 where the
      surface is bilateral.
    - `data.state` (3, N): z, m, and place (m) and outward unit normal of the IHIP.
    """
    stiffness, damping, viscosity, static, kinetic = data.params[:5]
    deflection, normal, dimension = data.state[0], data.state[2], hip.shape[0]
    error_squared, force_squared = 0.0, 0.0  # |IHIP - HIP|^2, m^2; N^2
    for i in range(dimension):
        error_squared += (ihip[i] - hip[i]) ** 2
        force_squared += force[i] ** 2
    if force_squared == 0.0:  # free space: the bristles are straight when the next contact begins
        deflection[:] = 0.0
        return 0
    closest.function(closest.data, ihip, data.state[1:3])
    force_on_error, force_on_normal, velocity_on_normal = 0.0, 0.0, 0.0
    deflection_squared, deflection_on_normal = 0.0, 0.0
    for i in range(dimension):
        force_on_error += force[i] * (ihip[i] - hip[i])  # N m, until it is divided by the error's length
        force_on_normal += force[i] * normal[i]
        velocity_on_normal += velocity[i] * normal[i]
        deflection_on_normal += deflection[i] * normal[i]
        deflection_squared += deflection[i] ** 2
    # F_n: the force's part along the error or along the normal, whichever is larger; zero where a unilateral surface
    # would pull
    normal_force = abs(force_on_error) / np.sqrt(error_squared) if error_squared > 0.0 else 0.0
    normal_force = max(normal_force, abs(force_on_normal)) if force_on_normal > 0.0 or data.params[7] == 1.0 else 0.0
    tangential_squared, speed_squared = 0.0, 0.0  # of z and of the velocity along the surface: m^2, (m/s)^2
    for i in range(dimension):
        tangential_squared += (deflection[i] - deflection_on_normal * normal[i]) ** 2
        speed_squared += (velocity[i] - velocity_on_normal * normal[i]) ** 2
    tangential_length, speed = np.sqrt(tangential_squared), np.sqrt(speed_squared)
    # they slip to |z| <= mu_s F_n / sigma0 where the hand presses less than before
    deflection_length = min(np.sqrt(deflection_squared), static * normal_force / stiffness)
    # g(v) and sigma1(v) of the module
    sliding_force = normal_force * (kinetic + (static - kinetic) * np.exp(-((speed / data.params[5]) ** 2)))
    damping *= np.exp(-((speed / data.params[6]) ** 2))
    relaxation_rate = stiffness * speed / sliding_force if sliding_force > 0.0 else 0.0  # sigma0 |v| / g, 1/s
    for i in range(dimension):
        tangential_velocity = velocity[i] - velocity_on_normal * normal[i]
        # the bristles turn with the surface: z is laid along it, and keeps its length
        deflection[i] = (deflection[i] - deflection_on_normal * normal[i]) * (
            deflection_length / tangential_length if tangential_length > 0.0 else 0.0
        )
        # z(dt) = z_ss + (z - z_ss) exp(-sigma0 |v| dt / g), with z_ss = g v / (sigma0 |v|)
        if sliding_force > 0.0 and speed > 0.0:
            deflection[i] += (sliding_force * tangential_velocity / (stiffness * speed) - deflection[i]) * -np.expm1(
                -relaxation_rate * dt
            )
        # F_t = -(sigma0 z + sigma1(v) z' + sigma2 v)
        force[i] -= (
            stiffness * deflection[i]
            + damping * (tangential_velocity - relaxation_rate * deflection[i] if sliding_force > 0.0 else 0.0)
            + viscosity * tangential_velocity
        )
    return 0
