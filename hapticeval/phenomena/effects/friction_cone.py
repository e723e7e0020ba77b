"""Friction cone: the force along the surface is never above mu_s times the force across it (4.18)."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.catalogue import FRICTION
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import CONE_ROUNDING, TELLING_SHARE
from hapticeval.phenomena.effects.friction_load import load_of, reason_not_judged
from hapticeval.phenomena.sampling import evidence_at
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare |F_t| with mu_s F_n at every tick."""
    base, friction = runs.base, scene.effect(FRICTION)
    reason = reason_not_judged(base, scene)
    if reason is not None:
        return reason
    load = load_of(base, scene)
    # |F_t| less what the scene's dampers and rounding may make of it.
    tangential = np.maximum(load.size - load.other, 0.0)
    limit = friction.mu_s * np.maximum(load.normal, 0.0)
    # |F_t| / (mu_s F_n); infinite where nothing presses the tool
    shares = np.divide(tangential, limit, out=np.where(tangential > 0.0, np.inf, 0.0), where=limit > 0.0)
    worst = int(np.argmax(shares))
    share = float(shares[worst])
    # A force that hardly leans shows nothing of the friction.
    if share < TELLING_SHARE:
        return undecided("the tool is hardly pulled along the surface: less than a tenth of what the friction holds")
    return compared(
        Metric(CHECK.metric, share, ""),
        1.0 + CONE_ROUNDING,
        {**evidence_at(base, worst), "normal_N": float(load.normal[worst]), "tangential_N": float(load.size[worst])},
        passes=f"the force stays in the cone of mu_s = {friction.mu_s:g}, and fills it to {share:.4g}",
        fails=(
            f"leaves the cone: {load.size[worst]:.4g} N along the surface at t = {base.time[worst]:.4g} s "
            f"(tick {worst}), where mu_s = {friction.mu_s:g} holds {limit[worst]:.4g} N of {load.normal[worst]:.4g} N "
            "across it"
        ),
    )


CHECK = Check(
    id="friction-cone",
    phenomenon="none of the six: static friction, thesis 4.3.3",
    formula="|F_t| <= mu_s F_n at every tick, with F_n = n.F at the IHIP and F_t = F - F_n n",
    citation="thesis (4.17)-(4.19), Figure 4.9",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    metric="force along the surface as a share of mu_s times that across it",
    unit="",
    judge=judge,
    effects=(FRICTION,),
)
