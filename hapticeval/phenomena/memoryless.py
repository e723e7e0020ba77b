"""Memoryless: the IHIP depends on the HIP alone, so that the projection fits a look-up table (Table 6.3)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.sampling import LAG_TICKS, NO_IHIP, hip_step, lacks_ihip, place, placement, touching
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the IHIPs of HIPs that were reached forwards and backwards along the same points."""
    if runs.reverse is None:
        return Finding(Outcome.INCONCLUSIVE, "one recording reaches each HIP only once; it takes a second path to tell")
    base, back = runs.base, runs.reverse()
    if lacks_ihip(base, scene):
        return Finding(Outcome.INCONCLUSIVE, NO_IHIP)
    step = hip_step(base, scene)
    found = cKDTree(back.hip).query(base.hip)
    distance, match = np.asarray(found[0]), np.asarray(found[1])
    contact = touching(base, scene) | touching(back, scene)[match]
    answered = (np.arange(len(base)) < len(base) - LAG_TICKS) & (match < len(back) - LAG_TICKS)
    common = np.flatnonzero((distance <= step) & contact & answered)
    if common.size == 0:
        return Finding(Outcome.INCONCLUSIVE, "no HIP in contact is reached along both paths")
    apart, other = _apart(base, back, common, match[common])
    worst = int(np.argmax(apart))
    tick = int(common[worst])
    metric = Metric("distance between the IHIPs of one HIP", float(apart[worst]), "m")
    bound = placement(base, scene)
    share = float(np.mean(apart > bound))
    evidence: dict[str, object] = {
        **place(base, tick),
        "ihip_other_path": [float(x) for x in back.ihip[other[worst]]],
        "hips_compared": int(common.size),
        "share_apart": share,
    }
    if metric.value <= bound:
        return Finding(Outcome.PASS, "the same HIP gives the same IHIP on both paths", metric, bound, evidence)
    message = (
        f"the same HIP gives IHIPs {1e3 * metric.value:.3g} mm apart, by the way it was reached "
        f"({100 * share:.3g} per cent of the HIPs)"
    )
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


def _apart(base: Recording, back: Recording, common: IntArray, match: IntArray) -> tuple[Array, IntArray]:
    """How far apart the answers to one HIP are on the two paths, m, and which row of the other has the closest.

    The answer to a HIP is given in its own row or up to three later, on either path.
    """
    best = np.full(common.size, np.inf)
    closest = match.copy()
    for late in range(LAG_TICKS + 1):
        for other in range(LAG_TICKS + 1):
            distance = np.linalg.norm(base.ihip[common + late] - back.ihip[match + other], axis=1)
            nearer = distance < best
            best[nearer], closest[nearer] = distance[nearer], match[nearer] + other
    return best, closest


CHECK = Check(
    id="memoryless",
    phenomenon="none of the six: a property of the projection",
    asks="Is the IHIP a function of the current HIP only, so that it can be looked up in a table?",
    formula="IHIP(HIP) is the same on every path that leads to the HIP; compare (4.2) with (4.3)",
    citation="thesis 5.1, 6.2; Table 6.3 'suitable for LUT'",
    channels=("hip", "ihip", "force where it was recorded"),
    siblings="the same HIPs in the opposite order",
    metric="distance between the IHIPs of one HIP",
    unit="m",
    bound=(
        "3 HIP steps + standoff, between the closest two of the IHIPs that either path has in the HIP's own row and in "
        "the three after it: a proxy may lag by three ticks. The last three rows of a path, whose answers may come "
        "after its end, are not compared."
    ),
    judge=judge,
    level=Level.INFO,
)
