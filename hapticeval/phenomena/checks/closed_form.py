"""Closed form: the sampled loop, extrapolated to continuous time, moves as the equations in print say."""

from __future__ import annotations

import numpy as np

from hapticeval.closed_forms import CLOSED_FORMS
from hapticeval.effects.effect import Alters
from hapticeval.phenomena.check import Check, Runs, Situation, required
from hapticeval.phenomena.decisions import EXTRAPOLATION_ROUNDING, FORM_TOLERANCE
from hapticeval.phenomena.measures.refinement import extrapolated
from hapticeval.phenomena.measures.surface_motion import SurfaceMotion
from hapticeval.phenomena.sampling import listed, mm, worst_row
from hapticeval.phenomena.verdict import Finding, compared, not_applicable, undecided
from hapticeval.scene import Scene

MOMENTS = 5
"""Moments that the evidence lists."""


UNREPEATABLE = "the run cannot be repeated with finer sampling, or ends early there"


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure the largest distance between the extrapolated run and the closed form of its law."""
    base = runs.observed(scene)
    form = CLOSED_FORMS[required(runs.closed_form)]
    if SurfaceMotion(base).pushed.any():
        return undecided("the operator pushes, and the closed form knows no operator")
    extrapolation = extrapolated(runs, lambda recording: recording.hip)
    if extrapolation is None:
        return undecided(UNREPEATABLE)
    hips, correction = extrapolation
    time = base.time - base.time[0]
    # From the recorded start: the closed form solves the same initial value problem.
    expected = form.motion(scene, base.hip[0], base.velocity[0], time).hip
    travel = float(np.max(np.linalg.norm(expected - expected[0], axis=1)))
    # Both at the base run's samples, (n, N): the extrapolation is to continuous time.
    distance_from_form = np.linalg.norm(hips - expected, axis=1)
    tick = worst_row(distance_from_form)
    # The correction is that of the worst coordinate: over all N of them a length is sqrt(N) times that.
    bound = correction * np.sqrt(hips.shape[1]) + EXTRAPOLATION_ROUNDING * travel
    distance = base.boundary.signed_distance
    evidence: dict[str, object] = {
        **base.evidence_at(tick),
        "law": form.name,
        "citation": form.citation,
        "sampled_apart_m": float(np.max(np.linalg.norm(base.hip - expected, axis=1))),
        "moments": [
            {
                "time": float(time[k]),
                "measured": listed(hips[k]),
                "closed_form": listed(expected[k]),
                "measured_distance": float(distance(hips[k : k + 1])[0]),
                "closed_form_distance": float(distance(expected[k : k + 1])[0]),
            }
            for k in np.linspace(0, len(base) - 1, MOMENTS).astype(int)
        ],
    }
    metric = CHECK.measured(distance_from_form[tick])
    # Written so that an infinite or undefined bound is undecided, too.
    if not bound <= FORM_TOLERANCE * travel:
        message = f"refinement does not settle the run: it is known to {mm(bound)} only"
        return undecided(message, metric, bound, evidence)
    return compared(
        metric,
        bound,
        evidence,
        passes=f"the run tends to ({form.name}) as the tick does to zero",
        fails=f"the run tends to something {mm(metric.value)} away from ({form.name})",
    )


CHECK = Check(
    id="closed-form",
    phenomenon="Closed form of the closed loop",
    formula="Tables 6.1 and 6.2, (7.28), (7.38); on other curves n'' = kappa (1 + n kappa) s'^2 + ...",
    citation="thesis (6.19) to (6.21), (6.24) to (6.27), (7.28), (7.38)",
    channels=("hip", "velocity"),
    reads_also=("operator_force",),
    siblings={
        "closed_form": "the closed form that the case names, or that of the law which the renderer declares to be",
        "refine": "the same experiment at 2, 4 and 8 times the sampling rate",
    },
    needs={
        "closed_form": not_applicable(
            "no closed form is named for this renderer here, and it declares to be no law that has one",
        ),
        "refine": undecided(UNREPEATABLE),
    },
    not_for={Situation.LED: "a closed form is about a tool that moves by itself"},
    holds=True,
    not_with=(Alters.FREE_SPACE, Alters.MOTION),
    metric="distance between the extrapolated run and the closed form",
    unit="m",
    judge=judge,
)
