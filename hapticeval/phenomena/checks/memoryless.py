"""Memory: whether the same HIP gives the same IHIP by another way (Table 6.3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hapticeval.effects.effect import Alters
from hapticeval.phenomena.check import Check, Runs, required, without_ihip
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import listed, mm, worst_row
from hapticeval.phenomena.verdict import Finding, Level, Outcome, compared, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the IHIPs of HIPs that were reached forwards and backwards along the same points (Table 6.3)."""
    from scipy.spatial import cKDTree

    base, reversed_run = runs.observed(scene), Observed(required(runs.reverse)(), scene)
    if base.lacks_ihip:
        return without_ihip(base)
    # For each HIP the nearest one of the way back; the sampled points need not be the same.
    distance, match = map(np.asarray, cKDTree(reversed_run.hip).query(base.hip))
    contact = base.contact | reversed_run.contact[match]
    answered = (np.arange(len(base)) < len(base) - LAG_TICKS) & (match < len(reversed_run) - LAG_TICKS)
    # Within a HIP step, in contact on either path, and with the rows in which a late answer may stand.
    common = np.flatnonzero((distance <= base.hip_step) & contact & answered)
    if common.size == 0:
        return undecided("no HIP in contact is reached along both paths")
    answer_distances, other = _closest_answers(base, reversed_run, common, match[common])
    worst = worst_row(answer_distances)
    metric = CHECK.measured(answer_distances[worst])
    bound = base.position_tolerance
    share = float(np.mean(answer_distances > bound))
    finding = compared(
        metric,
        bound,
        {
            **base.evidence_at(int(common[worst])),
            "ihip_other_path": listed(reversed_run.ihip[other[worst]]),
            "hips_compared": int(common.size),
            "share_apart": share,
        },
        passes="the same HIP gives the same IHIP on both paths",
        fails=f"the same HIP gives IHIPs {mm(metric.value)} apart, by the way it was reached "
        f"({100 * share:.3g} per cent of the HIPs)",
    )
    # Who declares to be without memory is held to it.
    declared = base.meta.get("memory") == "none"
    return replace(finding, level=Level.MUST) if declared and finding.outcome is Outcome.FAIL else finding


def _closest_answers(
    base: Observed, reversed_run: Observed, common: IntArray, match: IntArray
) -> tuple[Array, IntArray]:
    """Return how far apart the answers to one HIP are on the two paths, (n,), m, and the row of the other's closest.

    The answer to a HIP is given in its own row or up to three later, on either path.
    """
    late = np.arange(LAG_TICKS + 1)
    # All pairs of a lag on one path and a lag on the other: (n, lags, lags, N).
    first = base.ihip[common[:, np.newaxis, np.newaxis] + late[:, np.newaxis]]
    other = match[:, np.newaxis] + late
    distance = np.linalg.norm(first - reversed_run.ihip[other[:, np.newaxis]], axis=3).reshape(common.size, -1)
    best = np.argmin(distance, axis=1)
    rows = np.arange(common.size)
    return distance[rows, best], other[rows, best % late.size]


CHECK = Check(
    id="memoryless",
    phenomenon="none of the six: a property of the projection",
    formula="IHIP(HIP) is the same on every path that leads to the HIP; compare (4.2) with (4.3)",
    citation="thesis 5.1, 6.2; Table 6.3 'suitable for LUT'",
    channels=("hip", "ihip"),
    reads_also=("force",),
    siblings={"reverse": "the same HIPs in the opposite order"},
    needs={
        "reverse": undecided("one recording reaches each HIP only once; a second path is needed to decide"),
    },
    # A force in free space may be: it is the same on both ways.
    not_with=(Alters.CONTACT_POINT,),
    metric="distance between the IHIPs of one HIP",
    unit="m",
    judge=judge,
    level=Level.INFO,
)
