"""The work that a relief of the surface gives the hand round a loop: none for a potential, and how much otherwise."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.catalogue import BUMP_MAP, HEIGHT_MAP
from hapticeval.phenomena.check import Check, Runs, required
from hapticeval.phenomena.decisions import FINER_RATES, LOOP_KNOWN
from hapticeval.phenomena.measures.closed_paths import SampledWork, later_laps
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_row
from hapticeval.phenomena.verdict import Finding, compared, shown_only, undecided
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Sum the work of each lap in contact after the first, and judge the one in which the hand gains most."""
    from hapticeval.effects.reliefs import Relief

    base, refine = runs.observed(scene), required(runs.refine)
    relief = next(effect for effect in scene.effects if effect.kind in CHECK.effects)
    assert isinstance(relief, Relief)
    pressed = base.pressed
    loops = [rows for rows in later_laps(base.hip, scene.model.size) if pressed[slice(*rows)].all()]
    if not loops:
        return undecided("the hand goes round no closed loop in contact twice: the work of a loop cannot be measured")
    # First and last rows of all laps, (k,) each.
    first, last = np.array(loops).T
    for finest in FINER_RATES:
        half, full = (SampledWork(Observed(refine(factor), scene), factor) for factor in (finest // 2, finest))
        before, work, error, crossed, path, effort = (
            sums[last] - sums[first]
            for sums in (half.smooth, full.smooth, full.error, full.crossed, full.path, full.effort)
        )
        # The last step of refinement, the trapezoid's own error, and single precision.
        allowed = np.abs(work - before) + error + base.rounding_floor(effort, scene.stiffness * path)
        gains = work > allowed
        # Decided where a gain is certain, or what is open is a thousandth of what crosses.
        if gains.any() or np.all(allowed <= LOOP_KNOWN * crossed):
            break
    else:
        return undecided("refinement does not settle the work of a lap")
    worst = worst_row(work - allowed)
    gain = float(work[worst])
    # Above this speed, m/s, a wave is shorter than two ticks of the hand's way.
    limit = relief.fastest(base.dt)
    evidence = {
        **base.evidence_at(int(last[worst])),
        "from_time": float(base.time[first[worst]]),
        "crossed_J": float(crossed[worst]),
        "laps": len(loops),
        "aliases_above_m_s": limit,
    }
    what = f"waves of {1e3 * relief.finest:.4g} mm"
    share_gained = f"{1e3 * gain:.4g} mJ of the {1e3 * crossed[worst]:.3g} mJ that cross"
    finding = compared(
        CHECK.measured(gain),
        float(allowed[worst]),
        evidence,
        passes=f"{what}: a lap gives the hand nothing ({1e3 * gain:.2g} mJ, {1e3 * allowed[worst]:.2g} mJ open)",
        fails=f"{what}: in the lap that ends at t = {base.time[last[worst]]:.4g} s the hand gets {share_gained}",
    )
    why = relief.active(scene.damping)
    # A relief that is active by its law gives energy whatever the renderer does: shown only.
    return finding if why is None else shown_only(finding, why)


CHECK = Check(
    id="texture-work",
    phenomenon="none of the six: what a relief of the surface gives to the hand, thesis 4.3.2",
    formula="W = sum of F.dx over a closed lap <= 0 as h -> 0; of a potential U = K (d + h)^2 / 2 it is 0",
    citation="thesis 4.3.2, (4.16)",
    channels=("hip", "force"),
    siblings={"refine": "the same stimulus at 2 and 4, and while undecided 8 and 16 times the sampling rate"},
    needs={"refine": undecided("the recording cannot be refined: the sampling's share in the work is not known")},
    effects=(HEIGHT_MAP, BUMP_MAP),
    metric="work that the hand gets in a lap",
    unit="J",
    judge=judge,
)
