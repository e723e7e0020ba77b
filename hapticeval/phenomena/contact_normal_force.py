"""Contact normal force (3.3), (3.4): the force is along the contact normal and balances the operator's push."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.normal_cone import NormalCone
from hapticeval.phenomena.sampling import LAG_TICKS, hip_step, loaded, place, placement
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene

SINGLE = 2.0**-23
"""Spacing of single-precision numbers around 1: what the coarsest honest renderer computes with."""
STATIC_SHARE = 0.2
"""Share of the run, at its end, over which a static equilibrium is looked for."""


def judge(runs: Runs, scene: Scene) -> Finding:
    """Direction first; then, where the run ends in rest under an operator's push, the magnitude."""
    base = runs.base
    strong = np.flatnonzero(loaded(base, scene))
    if strong.size == 0:
        return Finding(Outcome.INCONCLUSIVE, "no force above the floor: the tool never presses on the surface")
    cone = NormalCone(scene.model.curve, placement(base) + base.resolution)
    forces = base.force[strong]
    if scene.bilateral:
        # A bilateral constraint also pulls: the normal then counts up to its sign.
        outwards = cone.deviation(base.ihip[strong], forces)
        deviation = np.minimum(outwards, cone.deviation(base.ihip[strong], -forces))
    else:
        deviation = cone.deviation(base.ihip[strong], forces)
    worst = int(np.argmax(deviation))
    angle = math.degrees(float(deviation[worst]))
    tick = int(strong[worst])
    bound = math.degrees(_rounding(base, scene))
    evidence: dict[str, object] = {**place(base, tick), "samples": int(strong.size)}
    metric = Metric("angle of the force outside the true normals", angle, "deg")
    if angle > bound:
        message = (
            f"the force points {angle:.3g} degrees off every true normal near the IHIP at t = {base.time[tick]:.4g} s"
        )
        return Finding(Outcome.FAIL, message, metric, bound, evidence)
    balance = _static_balance(base, scene)
    if balance is None:
        return Finding(Outcome.PASS, "the force is along the surface normal throughout", metric, bound, evidence)
    difference, allowed, push = balance
    evidence |= {"static_difference_N": difference, "static_bound_N": allowed, "operator_normal_N": push}
    if abs(difference) > allowed:
        message = f"at rest the force is {difference:.3g} N off the operator's normal component of {push:.3g} N (3.3)"
        magnitude = Metric("static force less the operator's normal component", abs(difference), "N")
        return Finding(Outcome.FAIL, message, magnitude, allowed, evidence)
    message = f"normal throughout, and equal at rest to the operator's {push:.3g} N to within {abs(difference):.2g} N"
    return Finding(Outcome.PASS, message, metric, bound, evidence)


def _rounding(recording: Recording, scene: Scene) -> float:
    """Angle (rad) that single-precision positions leave in a force built from HIP and IHIP.

    Two rounded positions of the model's size are subtracted to give a vector as long as the depth; a force that is
    there without a depth was not built so, and has the rounding of its own components only.
    """
    depth = np.linalg.norm(recording.hip - recording.ihip, axis=1)[loaded(recording, scene)]
    deep = depth[depth > 0.0]
    stretch = scene.model.size / float(np.median(deep)) if deep.size else 1.0
    return 1e-6 + 4.0 * SINGLE * max(stretch, 1.0)


def _static_balance(recording: Recording, scene: Scene) -> tuple[float, float, float] | None:
    """(force + operator force along the normal, what the momentum allows, operator's push), N; None if not at rest.

    Over a window of W seconds the mean of all forces is m (v_end - v_start) / W, so a tool whose speed stays below
    v_max may show up to 2 m v_max / W. At rest means that this is a small part of the operator's push.
    """
    if "operator_force" not in recording.channels or scene.bilateral:
        return None
    count = max(int(STATIC_SHARE * len(recording)), 2)
    window = slice(len(recording) - count, len(recording))
    ihip, velocity = recording.ihip[window], recording.velocity[window]
    travel = float(np.linalg.norm(np.ptp(ihip, axis=0)))
    if travel > LAG_TICKS * hip_step(recording) + recording.standoff or not recording.contact[window].all():
        return None
    normal = np.asarray(scene.model.curve.normal(scene.model.curve.nearest(ihip[-1:])))[0]
    force = float(np.mean(recording.force[window] @ normal))
    push = -float(np.mean(recording.channels["operator_force"][window] @ normal))
    speed = float(np.max(np.abs(velocity @ normal)))
    allowed = 2.0 * scene.mass * speed / (count * recording.dt) + SINGLE * abs(push)
    if push <= 0.0 or allowed > 0.1 * push:
        return None
    return force - push, allowed, push


CHECK = Check(
    id="contact-normal-force",
    phenomenon="Contact Normal Force",
    asks="Is the force along the surface's normal, and at rest equal to the operator's push along it?",
    formula="F_n = -(n_e . F_o) n_e (3.3), with n_e = n_c (3.4); at a corner n_e lies between the faces' normals",
    citation="thesis 3.2.1, (3.3), (3.4), Figures 3.3 to 3.5; (6.1)",
    channels=("hip", "ihip", "force", "operator_force where it was recorded"),
    siblings="none",
    metric="angle of the force outside the true normals; at rest, the difference in newtons",
    unit="deg",
    bound=(
        "The true normals are those of the model within 3 HIP steps + standoff + resolution of arc around the IHIP: "
        "a facet's direction is taken by the true surface somewhere along that facet (mean value theorem), and across "
        "a corner every direction between the faces' normals is an equivalent normal. Outside of them the force may "
        "point by the rounding of single-precision positions: 1e-6 rad + 4 * 2^-23 * model size / depth. At rest the "
        "mean force over a window W may differ by 2 m v_max / W, the momentum that the window cannot account for. "
        "Forces below K_p * 1 um are not judged."
    ),
    judge=judge,
)
