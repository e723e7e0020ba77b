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

WINDOW = 2 * LAG_TICKS
"""A lag of three ticks on either path sets the answers to one HIP up to six ticks apart."""


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
    common = np.flatnonzero((distance <= step) & contact)
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
    """How far each IHIP is from the closest one of the other path within the window, m, and which that is."""
    best = np.full(common.size, np.inf)
    closest = match.copy()
    for shift in range(-WINDOW, WINDOW + 1):
        index = np.clip(match + shift, 0, len(back) - 1)
        distance = np.linalg.norm(base.ihip[common] - back.ihip[index], axis=1)
        nearer = distance < best
        best[nearer], closest[nearer] = distance[nearer], index[nearer]
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
        "3 HIP steps + standoff, to the closest IHIP of the other path within six ticks of the same HIP: a proxy may "
        "lag by three ticks, in opposite directions on the two paths, and a jump only shifted in time is no memory."
    ),
    judge=judge,
    level=Level.INFO,
)
