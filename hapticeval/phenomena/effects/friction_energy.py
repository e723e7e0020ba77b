"""Energy of friction: a hand gets no more out of it than holding the force of a spring for a tick gives."""

from __future__ import annotations

import numpy as np

from hapticeval.effects.catalogue import FRICTION, VISCOUS_FRICTION
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import SINGLE_ROUNDINGS, STEEPER_THAN_SPRING
from hapticeval.phenomena.effects.friction_load import judge_with_lag, load_of, reason_not_judged, viscous_coefficient
from hapticeval.phenomena.sampling import evidence_at, touching
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.recordings.recording import SINGLE, Recording
from hapticeval.scene import Scene


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the work that the hand gets since free space with what holding the force may give."""
    base = runs.base
    return reason_not_judged(base, scene) or judge_with_lag(base, lambda recording: _judge(recording, scene))


def _judge(base: Recording, scene: Scene) -> Finding:
    load = load_of(base, scene)
    free = ~touching(base, scene)
    # The last free row before each contact: there nothing is stored.
    begins = np.flatnonzero(free[:-1] & ~free[1:])
    if not begins.size:
        return undecided("the hand never comes from free space: what is stored is not known")
    moved = np.diff(base.hip, axis=0)
    length = np.linalg.norm(moved, axis=1)
    damping = scene.damping + viscous_coefficient(scene)
    # Across the surface a law may be steeper than the scene's spring: of any that grows with the depth a force that is
    # held gives no more than its change times the way.
    across = np.max(
        [np.abs(np.sum(moved * normals, axis=1)) for normals in (load.normals[:-1], load.normals[1:])], axis=0
    )
    change = np.abs(np.diff(load.normal))
    steep = np.where(change > STEEPER_THAN_SPRING * scene.stiffness * across, change * across, 0.0)
    before = np.concatenate([[0.0], length[:-1]])
    strength = np.linalg.norm(base.force[:-1], axis=1)
    # K |dx|^2 / 2 for a spring held over a tick, and B |dx| |dx before| / dt for a damper
    allowed = 0.5 * scene.stiffness * length**2 + steep + damping / base.dt * length * before
    allowed += SINGLE_ROUNDINGS * SINGLE * strength * length
    # F . dx of a force that is held from row to row, J
    gained = np.sum(base.force[:-1] * moved, axis=1)
    worst, gain, granted = None, 0.0, 0.0
    for begin in begins:
        later = np.flatnonzero(free[begin + 1 :])
        stop = int(begin + 1 + later[0]) if later.size else len(base) - 1
        work, bound = np.cumsum(gained[begin:stop]), np.cumsum(allowed[begin:stop])
        # The tick up to which the hand has got most beyond what is granted.
        row = int(np.argmax(work - bound))
        if worst is None or work[row] - bound[row] > gain - granted:
            worst = int(begin), int(begin) + row + 1
            gain, granted = float(work[row]), float(bound[row])
    assert worst is not None
    span = f"from t = {base.time[worst[0]]:.4g} s to {base.time[worst[1]]:.4g} s"
    what = f"{1e3 * gain:.4g} mJ {span}, where holding the force for a tick may give {1e3 * granted:.4g} mJ"
    return compared(
        Metric(CHECK.metric, gain, "J"),
        granted,
        {**evidence_at(base, worst[1]), "from_time": float(base.time[worst[0]])},
        passes=f"the hand gets no more than a held spring gives: {what}",
        fails=f"gives energy away: the hand gets {what}",
    )


CHECK = Check(
    id="friction-energy",
    phenomenon="none of the six: friction takes energy, and gives none",
    formula="sum of F . dx <= K sum of |dx|^2 / 2 since free space, at every tick",
    citation="thesis 2.6.1, 4.3.3",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    metric="work that the hand has got since free space",
    unit="J",
    judge=judge,
    effects=(FRICTION, VISCOUS_FRICTION),
)
