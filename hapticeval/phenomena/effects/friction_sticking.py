"""Sticking friction: a tool that is pulled by less than the friction holds stays where it is, for however long."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.catalogue import FRICTION
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import CREEP_SPEED, STICKING_SHARE, STICKING_TIME, TELLING_SHARE
from hapticeval.phenomena.effects.friction_load import load_of, reason_not_judged
from hapticeval.phenomena.sampling import evidence_at, listed
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure how far the IHIP moves while the force along the surface is small."""
    base, friction = runs.base, scene.effect(FRICTION)
    reason = reason_not_judged(base, scene)
    if reason is not None:
        return reason
    load = load_of(base, scene)
    # |F_t| / (mu_k F_n); 0 where nothing presses
    pulled = load.size / np.where(load.normal > 0.0, friction.mu_k * load.normal, np.inf)
    sticks = load.pressed & (load.normal > 0.0) & (pulled <= STICKING_SHARE)
    # First rows and rows behind the last of the stretches that stick, by turns.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], sticks, [False]]).astype(int)))
    creeps = []
    for first, stop in zip(edges[::2], edges[1::2], strict=True):
        seconds = float(base.time[stop - 1] - base.time[first])
        # Long enough to tell creep from bending, and pulled hard enough to creep.
        if seconds >= STICKING_TIME and float(np.median(pulled[first:stop])) >= TELLING_SHARE:
            away = np.linalg.norm(base.ihip[first:stop] - base.ihip[first], axis=1)
            creeps.append((float(away.max()) / seconds, first, stop, float(away.max()), seconds))
    if not creeps:
        return undecided(
            f"the tool is nowhere held for {STICKING_TIME:g} s by a tenth to {STICKING_SHARE:g} of what the friction "
            "holds"
        )
    worst, first, stop, away, seconds = max(creeps)
    share = float(np.median(pulled[first:stop]))
    what = (
        f"{1e6 * away:.3g} um in {seconds:.4g} s at {share:.2f} of the kinetic cone, from t = {base.time[first]:.4g} s"
    )
    return compared(
        Metric(CHECK.metric, worst, "m/s"),
        CREEP_SPEED,
        {
            **evidence_at(base, int(first)),
            "to_time": float(base.time[stop - 1]),
            "to_ihip": listed(base.ihip[stop - 1]),
            "drift_m": away,
            "share": share,
        },
        passes=f"a tool that sticks stays: {what}",
        fails=f"a tool that should stick creeps: {what}",
    )


CHECK = Check(
    id="friction-sticking",
    phenomenon="none of the six: static friction, thesis 4.3.3",
    formula="|ihip(t) - ihip(t0)| <= 1 um in 10 s while |F_t| <= 0.6 mu_k F_n",
    citation="thesis (4.18), (4.19)",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    metric="how fast the IHIP creeps while it is held",
    unit="m/s",
    judge=judge,
    effects=(FRICTION,),
)
