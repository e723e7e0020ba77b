"""Continuous contact (section 3.2): the contact point traces a continuous path until the contact is broken."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.sampling import (
    LAG_TICKS,
    NO_IHIP,
    believed_standoff,
    hip_step,
    hip_steps,
    lacks_ihip,
    off_surface,
    place,
    standoff,
    touching,
)
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.recordings.recording import SINGLE, Recording
from hapticeval.scene import Scene

REFINEMENTS = (1, 2, 4, 8, 16, 32)
MINI = 1.5
"""A jump up to this many edges or cells of the renderer's representation is a mini pop-through: between neighbours."""
STILL = 1e-3
"""HIP steps below this share of the largest one are no motion that could be amplified."""
TENTH = math.log2(1.1)
STAYS, SHRINKS = 0.15, 0.25
"""Slopes of log2(jump) against log2(step): a jump has 0, a Hoelder map of order a has a, a Lipschitz map 1."""


def largest_jump(recording: Recording, scene: Scene) -> tuple[float, int]:
    """The largest IHIP step between two samples in contact, m, and the tick at its end (0 if there is none)."""
    contact = touching(recording, scene)
    both = contact[1:] & contact[:-1]
    if not both.any():
        return 0.0, 0
    steps = np.where(both, np.linalg.norm(np.diff(recording.ihip, axis=0), axis=1), 0.0)
    tick = int(np.argmax(steps)) + 1
    return float(steps[tick - 1]), tick


def amplification(recording: Recording, scene: Scene) -> float:
    """The largest ratio of IHIP step to HIP step between two samples in contact: how far a map stretches; 0 if none."""
    contact = touching(recording, scene)
    steps = hip_steps(recording)
    both = contact[1:] & contact[:-1] & (steps > STILL * np.max(steps, initial=0.0))
    if not both.any():
        return 0.0
    return float(np.max(np.linalg.norm(np.diff(recording.ihip, axis=0), axis=1)[both] / steps[both]))


def judge(runs: Runs, scene: Scene) -> Finding:
    """Refine the HIP trajectory until the largest jump is within the bound, or is seen to stay."""
    base = runs.base
    jump, tick = largest_jump(base, scene)
    if tick == 0:
        return Finding(Outcome.INCONCLUSIVE, "the tool is never in contact for two samples in a row")
    if lacks_ihip(base, scene):
        return Finding(Outcome.INCONCLUSIVE, NO_IHIP, evidence=place(base, tick))
    step = hip_step(base, scene)
    stray = _off_the_surface(base, scene)
    if stray is not None:
        return stray
    off = standoff(base, scene)
    bound = LAG_TICKS * step + off
    evidence: dict[str, object] = {
        **place(base, tick),
        "ihip_before": [float(x) for x in base.ihip[tick - 1]],
        "jump_m": jump,
        "hip_step_m": step,
        "amplification": amplification(base, scene),
        "jump_in_hip_steps": jump / float(max(hip_steps(base)[tick - 1], 1e-12)),
    }
    if runs.refine is None:
        return _judge_fixed(base, scene, tick, Metric("largest IHIP jump", jump, "m"), bound, evidence)
    jumps = [jump]
    for factor in REFINEMENTS[1:]:
        fine = runs.refine(factor)
        jumps.append(largest_jump(fine, scene)[0])
        # Lag shrinks with the step and a jump does not, so the finest run sets the bound.
        bound = LAG_TICKS * hip_step(fine, scene) + off
        slope = _slope(jumps)
        # h, h/2 and h/4 are always run; finer ones only while it is neither small nor seen to stay.
        if factor >= 4 and (jumps[-1] <= bound or slope < STAYS):
            break
    slope = _slope(jumps)
    evidence |= {"jumps_m": jumps, "refinements": list(REFINEMENTS[: len(jumps)]), "slope": slope}
    left = jumps[-1] if slope < STAYS or jumps[-1] <= bound else _limit(jumps)
    metric = Metric("IHIP jump that refinement leaves", left, "m")
    where = f"{1e3 * left:.3g} mm at t = {base.time[tick]:.4g} s"
    if left > bound:
        outcome = Outcome.FAIL if slope < STAYS or slope > SHRINKS else Outcome.INCONCLUSIVE
        mini = left <= MINI * base.resolution
        evidence["severity"] = "mini" if mini else "major"
        message = (
            f"{'mini ' if mini else ''}pop-through: the IHIP jumps {where}, "
            f"and the jump stays when the HIP moves in finer steps"
        )
        if outcome is Outcome.INCONCLUSIVE:
            message = f"steep: the IHIP moves {where} in one step, and refinement does not settle it"
        return Finding(outcome, message, metric, bound, evidence)
    if slope < STAYS and left > bound - off:
        message = f"a jump of {where} stays, within the declared standoff of {1e3 * off:.3g} mm"
    elif jumps[-1] > bound:
        message = f"continuous but steep: refinement takes the largest IHIP step down to {1e3 * jumps[-1]:.3g} mm"
    else:
        message = f"continuous: the largest IHIP step is {jump / step if step else 0.0:.3g} times the largest HIP step"
    return Finding(Outcome.PASS, message, metric, bound, evidence)


def _off_the_surface(base: Recording, scene: Scene) -> Finding | None:
    """A failure where the IHIP leaves the surface: a path through the solid is no contact point's, however smooth."""
    distance, tick = off_surface(base, scene)
    rounding = 4.0 * SINGLE * scene.model.size
    allowed = LAG_TICKS * hip_step(base, scene) + believed_standoff(base, scene) + rounding
    if distance <= allowed:
        return None
    message = f"the IHIP in contact lies {1e3 * distance:.3g} mm off the surface at t = {base.time[tick]:.4g} s"
    metric = Metric("distance of the IHIP in contact from the surface", distance, "m")
    return Finding(Outcome.FAIL, message, metric, allowed, place(base, tick))


def _slope(jumps: list[float]) -> float:
    """How fast the jump shrinks with the step: log2 a halving, fitted over all refinements.

    Where the samples fall beside a steep place shifts single jumps; over all of them that averages out.
    """
    if min(jumps) <= 0.0:
        return math.inf
    halvings = np.arange(len(jumps))
    return -float(np.polyfit(halvings, np.log2(jumps), 1)[0])


def _limit(jumps: list[float]) -> float:
    """What is left at infinite refinement if jump = limit + c r^k (Aitken on the last three), within [0, finest].

    Where the last three do not fall ever more slowly, the phase of sampling beside a steep place has moved them: then a
    law jump = c r^k that fits all refinements to a tenth leaves nothing.
    """
    coarse, middle, fine = jumps[-3:]
    curvature = coarse + fine - 2.0 * middle
    if curvature > 0.0:
        return min(max((coarse * fine - middle * middle) / curvature, 0.0), fine)
    halvings = np.arange(len(jumps))
    logs = np.log2(jumps)
    spread = float(np.std(logs - np.polyval(np.polyfit(halvings, logs, 1), halvings)))
    return 0.0 if spread < TENTH else fine


COARSENINGS = (1, 2, 4)
"""Every sample, every second, every fourth: what a fixed recording offers in place of finer ones."""


def coarsened_slope(recording: Recording, scene: Scene, tick: int) -> float:
    """How fast the largest IHIP step around `tick` grows with the samples left out: log2 a doubling; 0 is a jump.

    Over the widest window that all steps fit in; steps that leave the contact are none.
    """
    contact = touching(recording, scene)
    widest = COARSENINGS[-1]
    jumps = []
    for width in COARSENINGS:
        starts = np.arange(max(tick - widest, 0), min(tick + widest, len(recording)) - width)
        held = [start for start in starts if contact[start : start + width + 1].all()]
        if not held:
            break
        jumps.append(float(np.max(np.linalg.norm(recording.ihip[np.add(held, width)] - recording.ihip[held], axis=1))))
    return -_slope(jumps) if len(jumps) > 1 else math.nan


def _judge_fixed(
    base: Recording, scene: Scene, tick: int, metric: Metric, bound: float, evidence: dict[str, object]
) -> Finding:
    """The weaker test, for a recording that cannot be refined: the jump against the HIP step.

    Near a convex surface of curvature kappa, projecting from depth d stretches distances by 1 / (1 - kappa d); where
    kappa d comes close to 1 a long step may be honest, and one recording cannot tell. Nor can it where the step grows
    when samples are left out: a jump stays as long as it is, and a steep way does not.
    """
    ends = scene.model.boundary.frame(base.ihip[tick - 1 : tick + 1])
    depth = float(np.linalg.norm(base.hip[tick] - base.ihip[tick]))
    bent = depth * max(0.0, float(np.linalg.eigvalsh(ends.shape).max()))
    stretch = 1.0 / (1.0 - bent) if bent < 0.9 else math.inf
    if math.isfinite(stretch):
        bound += (stretch - 1.0) * LAG_TICKS * hip_step(base, scene)
    jump = metric.value
    note = "judged on one sampling only, which is the weaker test"
    if jump <= bound:
        return Finding(Outcome.PASS, f"no jump beyond the HIP's own steps; {note}", metric, bound, evidence)
    if math.isinf(stretch):
        message = f"the IHIP moves {1e3 * jump:.3g} mm in one step near the medial axis; {note}"
        return Finding(Outcome.INCONCLUSIVE, message, metric, bound, evidence)
    slope = coarsened_slope(base, scene, tick)
    evidence["coarsened_slope"] = slope
    if not slope < STAYS:
        message = f"the IHIP moves {1e3 * jump:.3g} mm in one step, and whether finer HIP steps shrink it is not known"
        return Finding(Outcome.INCONCLUSIVE, f"{message}; {note}", metric, bound, evidence)
    return Finding(Outcome.FAIL, f"pop-through of {1e3 * jump:.3g} mm; {note}", metric, bound, evidence)


CHECK = Check(
    id="continuous-contact",
    phenomenon="Continuous Contact Point",
    asks="Does the IHIP trace a continuous path while the contact lasts, or does it pop through?",
    formula="J(h) = max |IHIP(t + h) - IHIP(t)| in contact; J at h, h/2, h/4, ... tends to 0",
    citation="thesis 3.2, Figure 3.2; pop-through: 4.1.2, 4.1.3, 6.1.3",
    channels=("hip", "ihip", "force where it was recorded"),
    siblings="the same trajectory at 2, 4 and, while undecided, 8, 16 and 32 times the sampling rate",
    metric="IHIP jump that refinement leaves",
    unit="m",
    bound=(
        "3 HIP steps of the finest run + standoff. Three ticks of lag are allowed to a proxy, and shrink with the "
        "step; a surface known to within a standoff places the IHIP no better than that (the declared standoff "
        "counts as far as the IHIPs really lie off the model, and up to a fiftieth of its size; an IHIP in contact "
        "that lies farther off fails at once, for a smooth path through the solid is none along its surface). A "
        "jump up to 1.5 of the renderer's declared edges or cells is reported as mini pop-through (4.1.2): from one"
        " facet to the next; a longer one as major. Where the largest jump stays above that, its slope under "
        "refinement decides: log2 J falls by 0 a halving for a jump, by 1 for a Lipschitz map and by 1/3 for the "
        "steepest continuous map met (a conformal map at a 60-degree tip); below 0.15 it is a jump, above 0.25 the "
        "jump's limit is extrapolated (Aitken). A recording that cannot be refined is judged on its own sampling, the "
        "weaker test: with the bound widened by what projecting on a convex surface stretches, a longer step is a jump "
        "where leaving samples out around it leaves it as it is, and otherwise undecided."
    ),
    judge=judge,
)
