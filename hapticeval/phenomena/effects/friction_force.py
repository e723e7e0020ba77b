"""The force of viscous and of LuGre friction: in every tick that of the law, for the hand's speed along the surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hapticeval.effects.catalogue import FRICTION, LUGRE, VISCOUS_FRICTION
from hapticeval.effects.effect import Stage
from hapticeval.phenomena.check import Check, Runs, Sibling
from hapticeval.phenomena.decisions import BRISTLE_PARTS, LAG_TICKS, TELLING_SHARE, WHOLE_LAG
from hapticeval.phenomena.effects.friction_load import Load, load_of, reason_not_judged, viscous_coefficient
from hapticeval.phenomena.effects.friction_work import lugre_force
from hapticeval.phenomena.effects.relief import straight_way_doubt
from hapticeval.phenomena.lag import believed_lag, delayed
from hapticeval.phenomena.sampling import evidence_at
from hapticeval.phenomena.verdict import Finding, Metric, Outcome, compared, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the force along the surface with that of the law at every tick in contact."""
    base = runs.base
    reason = reason_not_judged(base, scene)
    if reason is not None:
        return reason
    if scene.damping > 0.0:
        return Finding(Outcome.NOT_APPLICABLE, f"a damper of {scene.damping:g} N s/m brakes too")
    if any(effect.stage is Stage.SENSE for effect in scene.effects):
        return undecided("the renderer answers the speed that its sensors show, and not the hand's")
    (kind,) = (effect.kind for effect in scene.effects if effect.kind in CHECK.effects)
    load = load_of(base, scene)
    tangential = load.tangential
    if runs.without is not None:
        plain = runs.without(kind).force
        # What the renderer itself gives along the surface, without the friction, is not the law's.
        tangential = tangential - (plain - np.sum(plain * load.normals, axis=1)[:, np.newaxis] * load.normals)
    # What the queue of a late renderer begins with is not of the law.
    judged = load.pressed & (np.arange(len(base)) >= LAG_TICKS)
    law = _friction_law(base, load, scene)
    straight = law(0.0, BRISTLE_PARTS)
    strength = np.linalg.norm(straight, axis=1)
    rounding = load.other - viscous_coefficient(scene) * np.linalg.norm(load.velocity, axis=1)
    # The law with a held speed and with one that goes straight: what sampling leaves open.
    doubt = rounding + np.linalg.norm(law(0.0, 1) - straight, axis=1)
    if not (judged & (doubt <= TELLING_SHARE * strength)).any():
        return undecided("the law's force is nowhere ten times what sampling and rounding leave open of it")

    def late(parts: int) -> tuple[float, float]:
        """Return the lag that explains what is off, and the misfit with it."""
        return believed_lag(
            lambda lag: float(np.linalg.norm((tangential + law(lag, parts))[judged], axis=1).mean()),
            float(doubt[judged].mean()),
        )

    # The lag of whichever of the two fits better.
    lag = min(late(1), late(BRISTLE_PARTS), key=lambda lag_and_misfit: lag_and_misfit[1])[0]
    if lag:
        stepped, straight = law(lag, 1), law(lag, BRISTLE_PARTS)
        doubt = rounding + np.linalg.norm(stepped - straight, axis=1)
        # Between ticks it is not known which value the renderer had.
        if abs(lag - round(lag)) > WHOLE_LAG:
            doubt += straight_way_doubt(straight)
    # The speed of a tick may be taken as held since the last, or as going there straight.
    deviation = np.linalg.norm(tangential + straight, axis=1)
    worst = int(np.argmax(np.where(judged, deviation - doubt, -np.inf)))
    what = (
        f"at t = {base.time[worst]:.4g} s (tick {worst}) it is {deviation[worst]:.3g} N off the {strength[worst]:.3g} "
        f"N that the {kind} makes of {1e3 * np.linalg.norm(load.velocity[worst]):.3g} mm/s"
    )
    return compared(
        Metric(CHECK.metric, float(deviation[worst]), "N"),
        float(doubt[worst]),
        {**evidence_at(base, worst), "law_N": float(strength[worst]), "lag_ticks": float(lag)},
        passes=f"the force along the surface is that of the {kind} in every tick",
        fails=f"the force along the surface is another than the law's: {what}",
    )


def _friction_law(base: Recording, load: Load, scene: Scene) -> Callable[[float, int], Array]:
    """Return -F_t of the law (n, N), N, as a function of a lag in ticks and the parts of a tick: see `lugre_force`."""
    lugre = scene.effect(LUGRE)
    rows = np.arange(len(base), dtype=np.int64)

    def law(lag: float, parts: int) -> Array:
        moving = delayed(load.velocity, rows, lag) if lag else load.velocity
        if lugre is None:
            return viscous_coefficient(scene) * moving
        return lugre_force(lugre, replace(load, velocity=moving), base.dt, parts)

    return law


CHECK = Check(
    id="friction-force",
    phenomenon="none of the six: friction, thesis 4.3.3",
    formula="F_t = -b v_t, or -(sigma0 z + sigma1 z' + sigma2 v) with z' = v - sigma0 |v| z / g(v)",
    citation="thesis 4.3.3; Canudas de Wit et al. 1995",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    siblings={Sibling.WITHOUT: "the same path in the scene without the friction"},
    metric="force along the surface off that of the law",
    unit="N",
    judge=judge,
    effects=(VISCOUS_FRICTION, LUGRE),
    not_with=(FRICTION,),
)
