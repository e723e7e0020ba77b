"""Break-away: a tool that sticks is not let go before the force along the surface reaches mu_s times that across it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from hapticeval.effects.catalogue import FRICTION
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import LAG_TICKS, STICKING_SHARE, TELLING_SHARE
from hapticeval.phenomena.effects.friction_load import Load, ihip_precision, load_of, reason_not_judged
from hapticeval.phenomena.sampling import evidence_at, hip_steps
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, IntArray


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the force along the surface with mu_s F_n (4.18) where a tool that stuck begins to slide."""
    base, friction = runs.base, scene.effect(FRICTION)
    reason = reason_not_judged(base, scene)
    if reason is not None:
        return reason
    load = load_of(base, scene)
    # Ticks in which the tool begins to slide, after it has surely stuck.
    slips = _break_away_ticks(base, load, scene, min(STICKING_SHARE, friction.stick) * friction.mu_k)
    # |F_t| / (mu_s F_n): 1 on the edge of the static cone (4.18)
    share = np.divide(load.size, friction.mu_s * load.normal, where=load.normal > 0.0, out=np.zeros(len(base)))
    # In the tick before, of a channel that is late too, the hand was a step less far, or two where that is between two.
    feet = np.diff(scene.model.boundary.closest_point(base.hip).foot, axis=0)
    step = _largest_within_lag(np.concatenate([[0.0], np.maximum(hip_steps(base), np.linalg.norm(feet, axis=1))]))
    # How much the normal force, N, changes in a tick near it.
    press = _largest_within_lag(np.abs(np.diff(load.normal, prepend=load.normal[:1])))
    holds = friction.mu_s * load.normal[slips - 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        # 2 K |dx| + mu_s |dF_n| and rounding: what the force may have lacked in the tick before.
        open_ = 2.0 * scene.stiffness * step[slips] + friction.mu_s * press[slips] + load.other[slips - 1]
        allowed = np.where(holds > 0.0, open_ / holds, np.inf)
    # Known to a tenth, or to half of what lies between the static and the kinetic cone.
    clear = allowed <= max(TELLING_SHARE, 0.5 * (1.0 - friction.mu_k / friction.mu_s))
    if not clear.any():
        return undecided(
            "the tool nowhere begins to slide, after it has stuck, while the hand moves and presses evenly"
        )
    shortfall = 1.0 - _largest_within_lag(share)[slips]
    worst = int(np.argmax(np.where(clear, shortfall - allowed, -np.inf)))
    tick = int(slips[worst])
    reached = (1.0 - float(shortfall[worst])) * friction.mu_s
    return compared(
        Metric(CHECK.metric, max(float(shortfall[worst]), 0.0), ""),
        float(allowed[worst]),
        {**evidence_at(base, tick), "reached": reached, "slips": int(np.count_nonzero(clear))},
        passes=(
            f"a tool that sticks is held up to mu_s = {friction.mu_s:g}: it slides from {reached:.3g} times the force "
            "across the surface on"
        ),
        fails=(
            f"a tool that sticks is let go too early: it slides at t = {base.time[tick]:.4g} s (tick {tick}), and the "
            f"force along the surface has reached {reached:.3g} times that across it, where mu_s = {friction.mu_s:g}"
        ),
    )


def _break_away_ticks(base: Recording, load: Load, scene: Scene, surely: float) -> IntArray:
    """Return the ticks in which a tool that has stuck begins to slide, away from corners.

    It has stuck when it rested for longer than the granted lag, and was pulled by less than the share `surely` of F_n.
    """
    # Below this way, m, an IHIP has not moved: the rounding of its coordinates.
    place = 8.0 * ihip_precision(base) * float(np.max(np.abs(base.hip)))
    length = np.linalg.norm(np.diff(base.ihip, axis=0, prepend=base.ihip[:1]), axis=1)
    pressed = load.pressed & (load.normal > 0.0)
    # What is no contact ends a rest as well as a motion does.
    moves = (length > place) | ~pressed | ~np.roll(pressed, 1)
    sticks = pressed & (load.size <= surely * load.normal)
    near = np.zeros(len(base), dtype=bool)
    # At a corner the tool may change its face: there a step is no slip.
    for corner in scene.model.boundary.corners:
        near |= np.linalg.norm(base.ihip - corner.position, axis=1) <= length + place
    ticks = np.flatnonzero(moves)
    return np.array(
        [
            tick
            for before, tick in pairwise(ticks)
            if tick - before > LAG_TICKS + 1
            and pressed[before : tick + 1].all()
            and sticks[before:tick].any()
            and not near[tick - 1 : tick + 1].any()
        ],
        dtype=np.int64,
    )


def _largest_within_lag(values: Array) -> Array:
    """Return the largest of `values` (n,) from a tick and the granted lag before each to the granted lag after it."""
    padded = np.pad(values, (LAG_TICKS + 1, LAG_TICKS), mode="edge")
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 2 * LAG_TICKS + 2).max(axis=1))


CHECK = Check(
    id="friction-break-away",
    phenomenon="none of the six: static friction, thesis 4.3.3",
    formula="|F_t| >= mu_s F_n - 2 K |dx| - mu_s |dF_n| in the tick before a tool that sticks begins to slide",
    citation="thesis (4.18), (4.19), Figure 4.9",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    metric="what the force along the surface lacks of mu_s F_n when the tool begins to slide, as a share of it",
    unit="",
    judge=judge,
    effects=(FRICTION,),
)
