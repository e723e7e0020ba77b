"""The force of each tick as parts across and along the surface, with what is open of it: what friction is judged by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.effects.catalogue import VISCOUS_FRICTION
from hapticeval.phenomena.decisions import COORDINATE_ROUNDINGS
from hapticeval.phenomena.observed import Observed
from hapticeval.recordings.quantization import are_singles
from hapticeval.recordings.recording import DOUBLE, SINGLE
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


@dataclass(frozen=True, eq=False)
class SurfaceForce:
    """The force of each tick by its parts at the IHIP: all are zero where it is not above the floor.

    - `pressed` (n,): where the force is above the floor.
    - `normal_force` (n,), N: F_n, the part across the surface. It is positive where the surface pushes, and on a
      bilateral one also where it pulls.
    - `tangential_force` (n, N), N: F_t, the part along the surface.
    - `tangential_size` (n,), N: its length, and at a corner what leaves the fan of normals.
    - `velocity` (n, N), m/s: the hand's along the surface.
    - `unit_normals` (n, N): the outward normals.
    - `damper_force` (n,), N: what dampers and viscous friction may add along the surface.
    - `rounding` (n,), N: what rounding leaves open of the force, and of a channel that is late the time between ticks.
    - `leaning` (n,), N: what facets of the declared resolution may turn along the surface.
    """

    pressed: BoolArray
    normal_force: Array
    tangential_force: Array
    tangential_size: Array
    velocity: Array
    unit_normals: Array
    damper_force: Array
    rounding: Array
    leaning: Array

    @property
    def open_force(self) -> Array:
        """Return what dampers and rounding leave open of the force along the surface, (n,), N."""
        return self.damper_force + self.rounding

    def share_of_cone(self, coefficient: float) -> Array:
        """Return |F_t| / (mu F_n), (n,): 1 on the edge of the cone of a `coefficient`, and 0 where nothing presses."""
        edge = np.where(self.normal_force > 0.0, coefficient * self.normal_force, np.inf)
        no_cone = np.where(self.tangential_size > 0.0, np.inf, 0.0)
        with np.errstate(over="ignore"):
            return np.divide(self.tangential_size, edge, out=no_cone, where=edge > 0.0)

    def surely_within(self, coefficient: float) -> BoolArray:
        """Return where the tool is pressed and F_t is in the cone of a `coefficient`, (n,), whatever rounding made."""
        edge = coefficient * self.normal_force
        return np.asarray((self.normal_force > 0.0) & (self.tangential_size + self.rounding <= edge))


def surface_force_of(base: Observed, open_between_ticks: Array | None = None) -> SurfaceForce:
    """Return the force of every tick by its parts; zero where the force is not above the floor.

    `open_between_ticks` (n,), N, is what is not known of the force where a channel was held back by no whole number of
    ticks.
    """
    scene = base.scene
    pressed = base.pressed
    rows = np.flatnonzero(pressed)
    ihip, force, boundary = base.ihip[rows], base.force[rows], base.boundary
    frame = boundary.closest_point(ihip)
    unit_normals = frame.normal
    # F_n = n . F, and F_t = F - F_n n
    across, tangential_force = np.sum(force * unit_normals, axis=1), along_surface(force, unit_normals)
    # A bilateral surface may pull: its force is turned round, so that it presses.
    push = np.where((across < 0.0) & scene.bilateral, -1.0, 1.0)[:, np.newaxis] * force
    strength = np.linalg.norm(force, axis=1)
    if boundary.corners:
        # At a corner the normal may be any of the fan: |F| cos and |F| sin of the angle outside of it.
        angle = boundary.normal_cone(ihip, np.zeros(rows.size))(push)
        normal_force, tangential_size = strength * np.cos(angle), strength * np.sin(angle)
    else:
        normal_force = np.sum(push * unit_normals, axis=1)
        tangential_size = np.linalg.norm(tangential_force, axis=1)
    velocity = along_surface(base.velocity[rows], unit_normals)
    damper_force = (scene.damping + viscous_coefficient(scene)) * np.linalg.norm(velocity, axis=1)
    # Within a facet's length the surface somewhere has the facet's direction: it leans by kappa times that length.
    leaning_angle = np.max(np.abs(np.linalg.eigvalsh(frame.shape)), axis=1) * base.resolution
    rounding = base.rounding_floor(strength, scene.stiffness, share=COORDINATE_ROUNDINGS * ihip_precision(base))
    parts = {
        "normal_force": normal_force,
        "tangential_force": tangential_force,
        "tangential_size": tangential_size,
        "velocity": velocity,
        "unit_normals": unit_normals,
        "damper_force": damper_force,
        "rounding": rounding,
        "leaning": strength * np.sin(np.minimum(leaning_angle, 0.5 * np.pi)),
    }
    # Zero in ticks without a force above the floor.
    columns = {name: np.zeros((len(base), *part.shape[1:])) for name, part in parts.items()}
    for name, part in parts.items():
        columns[name][rows] = part
    if open_between_ticks is None:
        open_between_ticks = np.zeros(len(base))
    columns["rounding"] += open_between_ticks
    return SurfaceForce(pressed=pressed, **columns)


def along_surface(vectors: Array, unit_normals: Array) -> Array:
    """Return `vectors` (n, N) without their part across the surface, v - (n . v) n, for `unit_normals` (n, N)."""
    return np.asarray(vectors - np.sum(vectors * unit_normals, axis=1)[:, np.newaxis] * unit_normals)


def viscous_coefficient(scene: Scene) -> float:
    """Return the coefficient (N s/m) of the scene's viscous friction; zero where it calls for none."""
    friction = scene.effect(VISCOUS_FRICTION)
    return 0.0 if friction is None else float(friction.coefficient)


def ihip_precision(base: Observed) -> float:
    """Return the relative precision of the recorded IHIPs: that of single numbers where all of them are such."""
    return SINGLE if are_singles(base.ihip) else DOUBLE


def ihip_rounding(base: Observed) -> float:
    """Return how far, m, an IHIP may seem to move that does not: the rounding of its coordinates."""
    return COORDINATE_ROUNDINGS * ihip_precision(base) * float(np.max(np.abs(base.hip)))
