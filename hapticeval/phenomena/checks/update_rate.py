"""Update rate: how often the force is renewed, measured where the hand's motion calls for another one."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import FEWEST_CHANGING_TICKS, STALE_TICKS
from hapticeval.phenomena.measures.stiffness import force_coarseness
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Finding, Level, compared, undecided
from hapticeval.quantity import format_number
from hapticeval.recordings.recording import runs_of
from hapticeval.scene import Scene
from hapticeval.types import BoolArray


def calls_for_another_force(recording: Observed) -> BoolArray:
    """Return where the force has to differ from that of the row before, (n,).

    In contact in both rows, the spring to the nearest point of the model changes, and so does the renderer's own where
    it gives an IHIP, by more than positions and forces resolve. A hand at rest, or under a flat face at one depth,
    calls for none, and neither does one whose IHIP goes along with it.
    """
    scene = recording.scene
    contact = recording.contact
    springs = [recording.nearest.foot - recording.hip]
    if "ihip" in recording.channels and recording.apart.any():
        springs.append(recording.ihip - recording.hip)
    coarse = force_coarseness(recording) + 0.5 * recording.log_step("force")
    told_apart = recording.rounding + coarse / scene.stiffness
    calls = np.zeros(len(recording), dtype=bool)
    calls[1:] = contact[1:] & contact[:-1]
    for spring in springs:
        calls[1:] &= np.linalg.norm(np.diff(spring, axis=0), axis=1) > told_apart
    return calls


def judge(runs: Runs, scene: Scene) -> Finding:
    """Take the median of the times for which a force stands while another is called for in every tick."""
    base = runs.observed(scene)
    calls = calls_for_another_force(base)
    renewed = np.zeros(len(base), dtype=bool)
    renewed[1:] = np.any(np.diff(base.force, axis=0) != 0.0, axis=1)
    stood: list[int] = []
    for first, end in runs_of(calls):
        renewals = first + np.flatnonzero(renewed[first:end])
        # What stands at either end of a stretch may have begun before, or go on after it.
        stood += np.diff(renewals).tolist() if renewals.size else [end - first]
    called = int(calls.sum())
    if sum(stood) < FEWEST_CHANGING_TICKS or called == 0:
        return undecided("the hand's motion calls for another force in too few ticks in a row")
    ticks = float(np.median(np.repeat(stood, stood)))
    metric = CHECK.measured(ticks * base.dt)
    rate = 1.0 / metric.value
    evidence = {**base.evidence_at(int(np.flatnonzero(calls)[0])), "rate_Hz": rate, "ticks_called_for": called}
    return compared(
        metric,
        # Half a tick is none: a median of whole ticks is known to that.
        STALE_TICKS * base.dt,
        evidence,
        passes=f"the force is renewed at {format_number(rate, 3)} Hz, the scene's own rate",
        fails=f"stale: the force is renewed at {format_number(rate, 3)} Hz, and the scene's loop runs at "
        f"{format_number(1.0 / base.dt)} Hz; in between the last one stands",
    )


CHECK = Check(
    id="update-rate",
    phenomenon="none of the six: a sampled loop answers the hand of its own tick (2.3)",
    formula="median time for which F stands while IHIP - HIP changes <= 1 / rate",
    citation="thesis 6.1: a new force in every sample of the loop",
    channels=("hip", "force"),
    reads_also=("ihip",),
    metric="time for which a force stands",
    unit="s",
    level=Level.SHOULD,
    judge=judge,
)
