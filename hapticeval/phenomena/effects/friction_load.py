"""What presses a tool on a surface with friction and what pulls it along, as a recording's forces and IHIPs tell it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hapticeval.effects.catalogue import FRICTION, LUGRE, VISCOUS_FRICTION
from hapticeval.phenomena.check import without_ihip
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.sampling import above_force_floor, lacks_ihip
from hapticeval.phenomena.verdict import Finding, Outcome, undecided
from hapticeval.recordings.recording import SINGLE, Recording, backward_difference
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

FRICTIONS = (FRICTION, VISCOUS_FRICTION, LUGRE)
"""The effects that brake a tool along the surface."""

DOUBLE = float(np.finfo(np.float64).eps)


def viscous_coefficient(scene: Scene) -> float:
    """Return the coefficient (N s/m) of the scene's viscous friction; zero where it calls for none."""
    friction = scene.effect(VISCOUS_FRICTION)
    return 0.0 if friction is None else float(friction.coefficient)


@dataclass(frozen=True)
class Load:
    """The force of each tick, (n,), as parts across and along the surface at the IHIP.

    - `pressed` (n,): where the force is above the floor.
    - `normal` (n,), N: the part across, positive where the surface pushes, and on a bilateral one also where it pulls.
    - `tangential` (n, N), N: the part along; `size` (n,), N, its length, and at a corner what leaves the fan of
      normals.
    - `velocity` (n, N), m/s: the hand's along the surface.
    - `normals` (n, N): the outward unit normals.
    - `other` (n,), N: what the scene's dampers may add, and rounding.
    """

    pressed: BoolArray
    normal: Array
    tangential: Array
    size: Array
    velocity: Array
    normals: Array
    other: Array


def load_of(base: Recording, scene: Scene) -> Load:
    """Return the load of every tick; zero where the force is not above the floor."""
    pressed = above_force_floor(base, scene)
    velocity = base.velocity if "velocity" in base.channels else backward_difference(base.hip, base.time)
    rows = np.flatnonzero(pressed)
    ihip, force = base.ihip[rows], base.force[rows]
    normals = scene.model.boundary.closest_point(ihip).normal
    # F_n = n . F, and F_t = F - F_n n
    across = np.sum(force * normals, axis=1)
    # A bilateral surface may pull: its force is turned round, so that it presses.
    push = np.where((across < 0.0) & scene.bilateral, -1.0, 1.0)[:, np.newaxis] * force
    if scene.model.boundary.corners:
        # At a corner the normal may be any of the fan: |F| cos and |F| sin of the angle outside of it.
        angle = scene.model.boundary.normal_cone(ihip, np.zeros(rows.size))(push)
        strength = np.linalg.norm(force, axis=1)
        normal, size = strength * np.cos(angle), strength * np.sin(angle)
    else:
        normal = np.sum(push * normals, axis=1)
        size = np.linalg.norm(force - across[:, np.newaxis] * normals, axis=1)
    moving = velocity[rows] - np.sum(velocity[rows] * normals, axis=1)[:, np.newaxis] * normals
    damping = scene.damping + viscous_coefficient(scene)
    # Rounding of positions as a force, K |x|, and of the force itself.
    reach = scene.stiffness * float(np.max(np.abs(base.hip))) + np.linalg.norm(force, axis=1)
    parts = (
        normal,
        force - across[:, np.newaxis] * normals,
        size,
        moving,
        normals,
        damping * np.linalg.norm(moving, axis=1) + 8.0 * ihip_precision(base) * reach,
    )
    filled = []
    for part in parts:
        # Zero in ticks without a force above the floor.
        column = np.zeros((len(base), *part.shape[1:]))
        column[rows] = part
        filled.append(column)
    return Load(pressed, *filled)


def ihip_precision(base: Recording) -> float:
    """Return the relative precision of the recorded IHIPs: that of single numbers where all of them are such."""
    return SINGLE if np.array_equal(base.ihip, base.ihip.astype(np.float32)) else DOUBLE


HAND = ("hip", "velocity")
"""The channels that are of the hand, and so on time."""


def judge_with_lag(
    base: Recording, judge: Callable[[Recording], Finding], on_time: tuple[tuple[str, ...], ...] = (HAND,)
) -> Finding:
    """Judge a recording, and where it fails, one with channels held back by up to three ticks: a lag is granted.

    Each of `on_time` are channels that may be on time where the others are late. A renderer that is late gives and
    takes energy for that alone: see `passivity`. Where all fail, the finding is that without a lag.
    """
    finding = judge(base)
    for lag in range(1, LAG_TICKS + 1):
        rows = np.maximum(np.arange(len(base)) - lag, 0)
        for names in on_time:
            if finding.outcome is not Outcome.FAIL:
                return finding
            # Held back by `lag` rows, so that they meet the late ones.
            held_back = {name: base.channels[name][rows] for name in names if name in base.channels}
            again = judge(Recording(base.time, {**base.channels, **held_back}, base.meta))
            if again.outcome is Outcome.PASS:
                late = "IHIP" if "force" in names else "force"
                return replace(again, message=f"{again.message}; the {late} is {lag} ticks late")
    return finding


def reason_not_judged(base: Recording, scene: Scene) -> Finding | None:
    """Return why a check of friction has no question, or no answer, here; None where it can be judged."""
    others = scene.answer_effects_except(*FRICTIONS)
    if others:
        message = f"the scene calls for {' and '.join(others)} too, whose force along the surface is no friction"
        return Finding(Outcome.NOT_APPLICABLE, message)
    if not above_force_floor(base, scene).any():
        return undecided("no force above the floor: the tool never presses on the surface")
    if lacks_ihip(base, scene):
        return without_ihip(base)
    return None
