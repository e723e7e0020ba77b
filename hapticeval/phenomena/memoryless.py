"""Memoryless: the IHIP depends on the HIP alone, so that the projection fits a look-up table (Table 6.3)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.sampling import hip_step, place, placement
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:  # noqa: ARG001
    """Compare the IHIPs of HIPs that were reached forwards and backwards along the same points."""
    if runs.reverse is None:
        return Finding(Outcome.INCONCLUSIVE, "one recording reaches each HIP only once; it takes a second path to tell")
    base, back = runs.base, runs.reverse()
    step = hip_step(base)
    found = cKDTree(back.hip).query(base.hip)
    distance, match = np.asarray(found[0]), np.asarray(found[1])
    common = np.flatnonzero((distance <= step) & (base.contact | back.contact[match]))
    if common.size == 0:
        return Finding(Outcome.INCONCLUSIVE, "no HIP in contact is reached along both paths")
    apart = np.linalg.norm(base.ihip[common] - back.ihip[match[common]], axis=1)
    worst = int(np.argmax(apart))
    tick = int(common[worst])
    metric = Metric("distance between the IHIPs of one HIP", float(apart[worst]), "m")
    bound = placement(base)
    evidence: dict[str, object] = {
        **place(base, tick),
        "ihip_other_path": [float(x) for x in back.ihip[match[tick]]],
        "hips_compared": int(common.size),
        "share_apart": float(np.mean(apart > bound)),
    }
    if metric.value <= bound:
        return Finding(Outcome.PASS, "the same HIP gives the same IHIP on both paths", metric, bound, evidence)
    message = (
        f"the same HIP gives IHIPs {1e3 * metric.value:.3g} mm apart, by the way it was reached "
        f"({100 * float(np.mean(apart > bound)):.3g} per cent of the HIPs)"
    )
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


CHECK = Check(
    id="memoryless",
    phenomenon="none of the six: a property of the projection",
    asks="Is the IHIP a function of the current HIP only, so that it can be looked up in a table?",
    formula="IHIP(HIP) is the same on every path that leads to the HIP; compare (4.2) with (4.3)",
    citation="thesis 5.1, 6.2; Table 6.3 'suitable for LUT'",
    channels=("hip", "ihip", "force"),
    siblings="the same HIPs in the opposite order",
    metric="distance between the IHIPs of one HIP",
    unit="m",
    bound="3 HIP steps + declared standoff: a proxy may lag by three ticks, in opposite directions on the two paths.",
    judge=judge,
)
