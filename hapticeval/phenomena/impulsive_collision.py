"""Impulsive collision (3.5)-(3.7): a new contact takes the normal momentum out of the tool at once."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.sampling import LAG_TICKS, place, touching, unsettled_by_path
from hapticeval.phenomena.verdict import Finding, Metric, Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array

WINDOW_TICKS = LAG_TICKS + 1
"""A sampled renderer meets the contact at the sample after it, its answer acts until the next, and may be late."""


def judge(runs: Runs, scene: Scene) -> Finding:
    """Momentum along the normal that the first ticks of contact take out, against (3.5)."""
    base = runs.base
    if base.meta.get("source") == "playback":
        return Finding(Outcome.NOT_APPLICABLE, "a hand led along a given path has no momentum to lose")
    unsettled = unsettled_by_path(base)
    if unsettled is not None:
        return Finding(Outcome.INCONCLUSIVE, unsettled)
    contact = touching(base, scene)
    struck = int(np.argmax(contact))
    if not contact.any() or struck == 0:
        return Finding(Outcome.INCONCLUSIVE, "the tool does not fly freely into the surface")
    end = struck + WINDOW_TICKS
    if end >= len(base):
        return Finding(Outcome.INCONCLUSIVE, "the recording ends with the collision")
    frame = scene.model.boundary.frame(base.ihip[struck : struck + 1])
    normal = frame.normal[0]
    along = base.velocity @ normal
    approach = -float(along[struck])
    if approach <= 0.0:
        return Finding(Outcome.INCONCLUSIVE, "the tool does not move into the surface when it meets it")
    wanted = (1.0 + scene.restitution) * scene.mass * approach
    pushed = _operator_impulse(base, normal, struck, end)
    taken = scene.mass * float(along[end] - along[struck]) - pushed
    velocity = base.velocity[struck]
    turning = abs(float(velocity @ frame.shape[0] @ velocity)) * WINDOW_TICKS * base.dt
    bound = turning / approach + 1e-6
    # A tool that stays in contact has the operator's push answered as well; one that bounces off has not.
    answered = wanted + max(0.0, -pushed)
    missing = max(wanted - taken, taken - answered, 0.0) / wanted
    metric = Metric("share of the impulse of (3.5) missing after four ticks", missing, "")
    stopped = np.flatnonzero(along[struck:] >= 0.0)
    leaves = np.flatnonzero(~contact[struck:])
    evidence: dict[str, object] = {
        **place(base, struck),
        "approach_speed_m_s": approach,
        "impulse_wanted_Ns": wanted,
        "impulse_in_window_Ns": taken,
        "peak_force_N": float(np.max(base.force[struck:] @ normal)),
        "stopped_after_ms": 1e3 * float(base.time[struck + stopped[0]] - base.time[struck]) if stopped.size else None,
    }
    if leaves.size:
        evidence["apparent_restitution"] = float(along[struck + leaves[0]]) / approach
        evidence["impulse_over_contact_Ns"] = scene.mass * float(along[struck + leaves[0]] - along[struck])
    if metric.value <= bound:
        message = f"{taken:.3g} N s of {wanted:.3g} N s are taken out within {WINDOW_TICKS} ticks"
        return Finding(Outcome.PASS, message, metric, bound, evidence)
    when = f"stops after {evidence['stopped_after_ms']:.3g} ms" if stopped.size else "is not stopped"
    message = f"{taken:.3g} N s of {wanted:.3g} N s are taken out within {WINDOW_TICKS} ticks; the tool {when}"
    if leaves.size:
        message += f" and leaves with restitution {evidence['apparent_restitution']:.2f}"
    return Finding(Outcome.FAIL, message, metric, bound, evidence)


def _operator_impulse(recording: Recording, normal: Array, start: int, end: int) -> float:
    """Impulse (N s) of the operator along the normal over the window, outwards."""
    if "operator_force" not in recording.channels:
        return 0.0
    return float(np.sum(recording.channels["operator_force"][start:end] @ normal)) * recording.dt


CHECK = Check(
    id="impulsive-collision",
    phenomenon="Impulsive Collision Force",
    asks="Does a first contact cancel or reverse the tool's momentum along the normal at once?",
    formula="p_post - p_pre = -(1 + c_r) m (v . n_e) n_e  (3.5), and (3.6) with the sign and factor of (3.5)",
    citation="thesis 3.2.2, (3.5)-(3.7)",
    channels=("hip", "ihip", "force", "velocity", "operator_force where it was recorded"),
    siblings="none",
    metric="share of the impulse of (3.5) missing after four ticks",
    unit="",
    bound=(
        "m kappa v_t^2 over the window / (m v_n) + 1e-6: while it slides on, the tool turns with the surface. The "
        "window is four ticks: a sampled renderer meets the contact at the first sample after it, its force acts until "
        "the next, and it may lag by three. The operator's push over the window is taken out of the momentum's change, "
        "and a tool that stays in contact may have it answered. A spring needs a quarter period, pi/2 sqrt(m / K_p)."
    ),
    judge=judge,
)
