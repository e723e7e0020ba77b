"""Sliding friction: a tool that slides is braked by mu_k times the normal force, against its motion (4.20)."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.catalogue import FRICTION
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import SLIDING_ROUNDING, SLIDING_TICKS, TELLING_SHARE
from hapticeval.phenomena.effects.friction_load import HAND, ihip_precision, judge_with_lag, load_of, reason_not_judged
from hapticeval.phenomena.sampling import evidence_at
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare F_t at every tick in which the IHIP moves with mu_k F_n against that motion."""
    late = ((*HAND, "ihip"), ("force",))
    return reason_not_judged(runs.base, scene) or judge_with_lag(
        runs.base, lambda recording: _judge(recording, scene), late
    )


def _judge(base: Recording, scene: Scene) -> Finding:
    friction = scene.effect(FRICTION)
    load = load_of(base, scene)
    step = np.diff(base.ihip, axis=0, prepend=base.ihip[:1])
    # The slip ds of a tick, along the surface.
    step -= np.sum(step * load.normals, axis=1)[:, np.newaxis] * load.normals
    length = np.linalg.norm(step, axis=1)
    # (4.20): F_t = -mu_k F_n ds / |ds|
    braking = friction.mu_k * load.normal
    shape = scene.model.boundary.closest_point(base.ihip).shape
    bend, twist = _curvature(shape)
    # Below this way, m, an IHIP has not moved: the rounding of its coordinates.
    place = 8.0 * ihip_precision(base) * np.max(np.abs(base.hip))
    # How far, m, the HIP may lie from the IHIP along the surface: the slip and the spring's length.
    lag = length + (load.size + np.maximum(load.normal, 0.0)) / scene.stiffness
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        deviation = (
            np.linalg.norm(load.tangential + braking[:, np.newaxis] * step / length[:, np.newaxis], axis=1) / braking
        )
        # The tangent plane turns by curvature times that way; of first order only where it twists.
        turned = twist * lag + (bend * lag) ** 2
        allowed = load.other / braking + turned + place / length + SLIDING_ROUNDING
    slides = load.pressed & np.roll(load.pressed, 1) & (length > place) & (braking > 0.0) & (allowed <= TELLING_SHARE)
    slides[0] = False
    # A slip over a corner has two directions.
    for corner in scene.model.boundary.corners:
        slides &= np.linalg.norm(base.ihip - corner.position, axis=1) > length + place
    ticks = np.flatnonzero(slides)
    if ticks.size < SLIDING_TICKS:
        return undecided(f"the tool slides in {ticks.size} ticks only, away from corners")
    worst = int(ticks[np.argmax((deviation - allowed)[ticks])])
    # The force against the motion, N, for the message.
    against = -float(np.sum(load.tangential[worst] * step[worst])) / float(length[worst])
    comparison = f"{against:.4g} N against its motion, where mu_k = {friction.mu_k:g} makes {braking[worst]:.4g} N"
    return compared(
        Metric(CHECK.metric, float(deviation[worst]), ""),
        float(allowed[worst]),
        {
            **evidence_at(base, worst),
            "against_N": against,
            "asked_N": float(braking[worst]),
            "normal_N": float(load.normal[worst]),
            "ticks": int(ticks.size),
        },
        passes=f"a tool that slides is braked by mu_k F_n in {ticks.size} ticks; at the worst {comparison}",
        fails=f"a tool that slides at t = {base.time[worst]:.4g} s (tick {worst}) feels {comparison}",
    )


def _curvature(shape: Array) -> tuple[Array, Array]:
    """Return the largest curvatures (n,), 1/m, of operators (n, N, N), and half of what the principal ones differ by.

    In the plane there is but one, and no way aside.
    """
    largest = np.abs(np.linalg.eigvalsh(shape)).max(axis=1)
    if shape.shape[1] == 2:
        return largest, np.zeros_like(largest)
    # (k1 - k2)^2 = 2 tr(W^2) - tr(W)^2
    difference_squared = 2.0 * np.sum(shape**2, axis=(1, 2)) - np.trace(shape, axis1=1, axis2=2) ** 2
    return largest, 0.5 * np.sqrt(np.maximum(difference_squared, 0.0))


CHECK = Check(
    id="friction-sliding",
    phenomenon="none of the six: kinetic friction, thesis 4.3.3",
    formula="F_t = -mu_k F_n ds/|ds| at every tick in which the IHIP moves by ds along the surface",
    citation="thesis (4.20), Figure 4.9",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    metric="what F_t is off mu_k F_n against the motion, as a share of it",
    unit="",
    judge=judge,
    effects=(FRICTION,),
)
