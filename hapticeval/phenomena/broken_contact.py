"""Broken contact (section 3.2.1): over a convex corner the force keeps its direction, then is gone at once."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.corner_crossing import angle_between, find_crossing
from hapticeval.phenomena.sampling import loaded, place, placement
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.scene import Scene

KEPT = 0.05
"""Share of the corner's turn within which a direction still counts as n_pre: far above rounding, far below a switch."""
HELD = 0.5
"""Share of the usual force on the first face below which the force is not kept any more."""


def judge(runs: Runs, scene: Scene) -> Finding:
    """How far from the corner, before or after it, the force stops being what a rigid corner gives."""
    base = runs.base
    if not any(corner.convex for corner in scene.model.boundary.corners):
        return Finding(Outcome.NOT_APPLICABLE, "the model has no convex corner")
    strong = loaded(base, scene)
    crossing = find_crossing(base, scene.model.boundary, strong, convex=True)
    if crossing is None:
        return Finding(Outcome.INCONCLUSIVE, "no force is felt near a convex corner")
    along = (base.hip - crossing.corner.position) @ crossing.ahead
    first, end = crossing.first, crossing.end
    past = np.flatnonzero(along[first:end] > 0.0)
    if along[first] >= 0.0 or past.size == 0:
        return Finding(Outcome.INCONCLUSIVE, "the HIP does not travel from the first face past the corner")
    crossed = first + int(past[0])
    strength = np.linalg.norm(base.force, axis=1)
    usual = float(np.median(strength[first:crossed]))
    first_face = strong & (angle_between(base.force, crossing.normal_pre) <= KEPT * crossing.turn)
    early_ticks = first + np.flatnonzero(~(first_face & (strength >= HELD * usual))[first:crossed])
    early = -float(along[early_ticks[0]]) if early_ticks.size else 0.0
    after = strong[crossed:end]
    gone = int(np.argmax(~after)) if not after.all() else after.size
    # Past the corner no force may remain, and none may come back from the face that was left.
    wrong = first_face[crossed:end] | (np.arange(after.size) < gone)
    late = float(np.max(along[crossed:end], where=wrong, initial=0.0))
    too_early = early >= late
    tick = int(early_ticks[0]) if too_early and early_ticks.size else min(crossed + gone, len(base) - 1)
    metric = Metric("distance from the corner at which n_pre is lost or force remains", max(early, late), "m")
    bound = placement(base, scene)
    evidence: dict[str, object] = {
        **place(base, tick),
        "corner": [float(x) for x in crossing.corner.position],
        "lost_before_corner_m": early,
        "remains_after_corner_m": late,
        "ticks_to_zero_after_corner": gone,
        "force_pre_N": usual,
    }
    if metric.value <= bound:
        message = f"the force keeps n_pre to the corner and is zero {gone} tick(s) after it"
        return Finding(Outcome.PASS, message, metric, bound, evidence)
    if too_early:
        message = f"the force is lost, or leaves n_pre, {1e3 * early:.3g} mm before the corner"
    else:
        message = f"a force remains up to {1e3 * late:.3g} mm past the corner"
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


CHECK = Check(
    id="broken-contact",
    phenomenon="Broken Contact",
    asks="Sliding over a convex corner: does the force keep its direction up to the corner and vanish there at once?",
    formula="F = |F| n_pre for (HIP - corner) . t_pre < 0, then F = 0",
    citation="thesis 3.2.1, Figure 3.4; Figures 6.10, 6.11",
    channels=("hip", "force", "ihip where a standoff is declared"),
    siblings="none",
    metric="distance from the corner at which n_pre is lost or force remains",
    unit="m",
    bound=(
        "3 HIP steps + standoff: a sampled renderer learns of the corner at the next "
        "sample, may lag by three, and cannot know the corner better than its own surface does. A force within "
        "5 per cent of the corner's turn, and of at least half the usual size on the first face, counts as kept; past "
        "the corner every force counts until the first zero, and every one along n_pre thereafter."
    ),
    judge=judge,
)
