"""Closed form: the sampled loop, extrapolated to continuous time, moves as the equations in print say."""

from __future__ import annotations

import numpy as np

from hapticeval.closed_forms import CLOSED_FORMS
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.refinement import extrapolated
from hapticeval.phenomena.sampling import LED, place
from hapticeval.phenomena.surface_motion import SurfaceMotion
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.scene import Scene

TOLD = 5
"""Moments that the evidence lists."""

COARSE = 1e-3
"""A tolerance above a thousandth of the way travelled compares nothing."""


def judge(runs: Runs, scene: Scene) -> Finding:
    """The largest distance between the extrapolated run and the closed form that the case names."""
    base = runs.base
    if runs.law is None:
        return Finding(Outcome.NOT_APPLICABLE, "no closed form is named for this renderer here")
    form = CLOSED_FORMS[runs.law]
    if base.meta.get("source") in LED:
        return Finding(Outcome.NOT_APPLICABLE, "a closed form is about a tool that moves by itself")
    if SurfaceMotion(base, scene).pushed.any():
        return Finding(Outcome.INCONCLUSIVE, "the operator pushes, and the closed form knows no operator")
    found = extrapolated(runs, lambda recording: recording.hip)
    if found is None:
        return Finding(Outcome.INCONCLUSIVE, "the run cannot be repeated with finer sampling, or ends early there")
    hips, correction = found
    time = base.time - base.time[0]
    expected = form.motion(scene, base.hip[0], base.velocity[0], time).hip
    way = float(np.max(np.linalg.norm(expected - expected[0], axis=1)))
    apart = np.linalg.norm(hips - expected, axis=1)
    tick = int(np.argmax(apart))
    bound = correction * np.sqrt(hips.shape[1]) + 1e-10 * way
    moments = np.linspace(0, len(base) - 1, TOLD).astype(int)
    boundary = scene.model.boundary
    evidence: dict[str, object] = {
        **place(base, tick),
        "law": form.name,
        "citation": form.citation,
        "sampled_apart_m": float(np.max(np.linalg.norm(base.hip - expected, axis=1))),
        "moments": [
            {
                "time": float(time[k]),
                "measured": [float(x) for x in hips[k]],
                "closed_form": [float(x) for x in expected[k]],
                "measured_distance": float(boundary.signed_distance(hips[k : k + 1])[0]),
                "closed_form_distance": float(boundary.signed_distance(expected[k : k + 1])[0]),
            }
            for k in moments
        ],
    }
    metric = Metric("distance between the extrapolated run and the closed form", float(apart[tick]), "m")
    if not bound <= COARSE * way:
        message = f"refinement does not settle the run: it is known to {1e3 * bound:.3g} mm only"
        return Finding(Outcome.INCONCLUSIVE, message, metric, bound, evidence)
    if metric.value <= bound:
        return Finding(
            Outcome.PASS, f"the run tends to ({form.name}) as the tick does to zero", metric, bound, evidence
        )
    message = f"the run tends to something {1e3 * metric.value:.3g} mm away from ({form.name})"
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


CHECK = Check(
    id="closed-form",
    phenomenon="Closed form of the closed loop",
    asks="Sampled ever faster, does the run tend to the closed-form motion that is in print for this renderer?",
    formula="Tables 6.1 and 6.2, (7.28), (7.38); on other curves n'' = kappa (1 + n kappa) s'^2 + ...",
    citation="thesis (6.19) to (6.21), (6.24) to (6.27), (7.28), (7.38)",
    channels=("hip", "velocity"),
    siblings="the same experiment at 2, 4 and 8 times the sampling rate",
    metric="distance between the extrapolated run and the closed form",
    unit="m",
    bound=(
        "A law that is sampled and held moves as in continuous time but for errors in whole powers of the tick. "
        "Richardson's extrapolation from T, T/2, T/4 and T/8 removes the first three; its last correction is the "
        "error of the value before, and so larger than what is left, and is the tolerance, with 1e-10 of the way "
        "travelled for rounding. A tolerance above a thousandth of the way is inconclusive."
    ),
    judge=judge,
)
