"""Abrupt switch (section 3.2.1): in a concave corner the force turns from face to face at one point of space."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.corner_crossing import angle_between, find_crossing
from hapticeval.phenomena.sampling import (
    NO_IHIP,
    hip_step,
    hip_steps,
    lacks_ihip,
    loaded,
    place,
    placement,
)
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.scene import Scene

REACHED = 0.05
"""Share of the corner's turn within which a direction counts as a face's: far above rounding, far below a switch."""


def judge(runs: Runs, scene: Scene) -> Finding:
    """HIP travel from where the force leaves n_pre for the first time to where it reaches n_post for good."""
    base = runs.base
    if all(corner.convex for corner in scene.model.boundary.corners):
        return Finding(Outcome.NOT_APPLICABLE, "the model has no concave corner")
    if lacks_ihip(base, scene):
        return Finding(Outcome.INCONCLUSIVE, NO_IHIP)
    strong = loaded(base, scene)
    crossing = find_crossing(base, scene.model.boundary, strong, convex=False)
    if crossing is None:
        return Finding(Outcome.INCONCLUSIVE, "no force is felt near a concave corner")
    pressed = crossing.first + np.flatnonzero(strong[crossing.first : crossing.end])
    tolerance = REACHED * crossing.turn
    pre = angle_between(base.force[pressed], crossing.normal_pre) <= tolerance
    post = angle_between(base.force[pressed], crossing.normal_post) <= tolerance
    if not pre[0] or not post[-1]:
        return Finding(Outcome.INCONCLUSIVE, "the force does not go from the first face's normal to the second's")
    left = int(pressed[np.argmin(pre) - 1])
    reached = int(pressed[post.size - int(np.argmin(post[::-1]))])
    travel = float(np.sum(hip_steps(base)[left:reached]))
    depths = np.linalg.norm(base.hip - base.ihip, axis=1)
    depth = max(float(np.median(depths[pressed[pressed <= left]])), hip_step(base, scene))
    metric = Metric("HIP travel of the switch in penetration depths", travel / depth, "depths")
    bound = placement(base, scene) / depth
    evidence: dict[str, object] = {
        **place(base, reached),
        "corner": [float(x) for x in crossing.corner.position],
        "switch_starts_s": float(base.time[left]),
        "switch_takes_s": float(base.time[reached] - base.time[left]),
        "travel_m": travel,
        "depth_m": depth,
        "turn_deg": float(np.degrees(crossing.turn)),
    }
    if metric.value <= bound:
        message = f"the force switches within {1e3 * travel:.3g} mm of HIP travel"
        return Finding(Outcome.PASS, message, metric, bound, evidence)
    message = (
        f"the force turns over {1e3 * travel:.3g} mm of HIP travel ({travel / depth:.3g} depths, "
        f"{base.time[reached] - base.time[left]:.3g} s): the corner is rounded"
    )
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


CHECK = Check(
    id="abrupt-switch",
    phenomenon="Abrupt Switch",
    asks="Sliding into a concave corner: does the force turn from one face's normal to the other's at one HIP?",
    formula="travel of the HIP while n_e turns from n_pre to n_post, in penetration depths; 0 for rigid contact",
    citation="thesis 3.2.1, Figure 3.5; Figures 6.6, 6.7, 6.9",
    channels=("hip", "ihip", "force"),
    siblings="none",
    metric="HIP travel of the switch in penetration depths",
    unit="depths",
    bound=(
        "(3 HIP steps + standoff) / depth: between two samples the turn cannot be seen, "
        "and a corner is known no better than the renderer's own surface. Resting on the corner while the HIP goes "
        "round it turns the force over an arc as long as the corner's turn (rad) times the depth, whatever the depth. "
        "The switch lasts from where the force first leaves n_pre, by more than 5 per cent of the turn, to where it is "
        "within 5 per cent of n_post for good."
    ),
    judge=judge,
)
