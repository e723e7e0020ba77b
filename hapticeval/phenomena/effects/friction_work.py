"""Work of friction: what the hand puts into a closed lap is what the friction's law takes from the tool's slips."""

from __future__ import annotations

import math
from operator import mul
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.effects.catalogue import FRICTION, LUGRE, VISCOUS_FRICTION
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import BRISTLE_PARTS, LAP_WORK, SLIP_WORK
from hapticeval.phenomena.effects.friction_load import (
    HAND,
    Load,
    judge_with_lag,
    load_of,
    reason_not_judged,
    viscous_coefficient,
)
from hapticeval.phenomena.passivity import laps
from hapticeval.phenomena.sampling import evidence_at
from hapticeval.phenomena.verdict import Finding, Metric, Outcome, compared, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.effects.lugre import LuGre


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the hand's work over each lap after the first with the work of the friction's law."""
    base = runs.base
    reason = reason_not_judged(base, scene)
    if reason is not None:
        return reason
    if scene.damping > 0.0:
        return Finding(Outcome.NOT_APPLICABLE, f"a damper of {scene.damping:g} N s/m takes energy too")
    late = (HAND, (*HAND, "ihip"), (*HAND, "force"))
    return judge_with_lag(base, lambda recording: _judge(recording, scene), late)


def _judge(base: Recording, scene: Scene) -> Finding:
    load = load_of(base, scene)
    spans = [
        (first + lap * period, first + (lap + 1) * period)
        for first, period, number in laps(base.hip, scene.model.size)
        for lap in range(1, number)
        if first + (lap + 1) * period < len(base)
    ]
    spans = [(start, stop) for start, stop in spans if load.pressed[start : stop + 1].all()]
    if not spans:
        return undecided("the hand goes round no closed lap twice in contact")
    moved = np.diff(base.hip, axis=0)
    # Work of the hand by the trapezoid: -F . dx
    mean = 0.5 * (base.force[1:] + base.force[:-1])
    put_in = -np.sum(mean * moved, axis=1)
    dissipated, doubt = _dissipated_work(base, load, scene, moved)
    stored = _stored_energy(base, load, scene)
    lap_works = []
    for start, stop in spans:
        law = float(dissipated[start:stop].sum())
        work = float(put_in[start:stop].sum() - (stored[stop] - stored[start]))
        # A lap in which nothing slips takes nothing, and has no share to be off by.
        if law >= SLIP_WORK:
            allowed = LAP_WORK + abs(float(doubt[start:stop].sum())) / law
            lap_works.append((abs(work - law) / law, allowed, work, law, start, stop))
    if not lap_works:
        return undecided("the tool does not slip in any closed lap")
    deviation, allowed, work, law, start, stop = max(lap_works, key=lambda lap_work: lap_work[0] - lap_work[1])
    what = (
        f"{1e3 * work:.5g} mJ in a lap from t = {base.time[start]:.4g} s to {base.time[stop]:.4g} s, where the "
        f"friction takes {1e3 * law:.5g} mJ"
    )
    return compared(
        Metric(CHECK.metric, deviation, ""),
        allowed,
        {
            **evidence_at(base, stop),
            "from_time": float(base.time[start]),
            "work_J": work,
            "law_J": law,
            "laps": len(lap_works),
        },
        passes=f"the hand puts in what the friction takes: {what}",
        fails=f"the hand does not put in what the friction takes: {what}",
    )


def _dissipated_work(base: Recording, load: Load, scene: Scene, moved: Array) -> tuple[Array, Array]:
    """Return the work (n - 1,), J, that the laws take over each step `moved` (n - 1, N), m, and its doubt."""
    dissipated, doubt = np.zeros((2, len(moved)))
    friction, lugre = scene.effect(FRICTION), scene.effect(LUGRE)
    if friction is not None:
        slip = np.diff(base.ihip, axis=0)
        after = load.normals[1:]
        across = np.sum(slip * after, axis=1)
        along = np.linalg.norm(slip - across[:, np.newaxis] * after, axis=1)
        normal = load.normal[1:]
        # The law's force after the slip, times the slip: mu_k F_n |ds|, and F_n times what the foot moves across
        dissipated += normal * (friction.mu_k * along - across)
        # A law that is not the scene's spring: its difference does work on the slip, too.
        dissipated -= np.sum((scene.stiffness * (base.ihip - base.hip) - base.force)[1:] * slip, axis=1)
        # K ds . (ds - dx) / 2: the spring relaxes by ds while the hand moves on by dx.
        dissipated += 0.5 * scene.stiffness * np.sum(slip * (slip - moved), axis=1)
    # b v . dx, with the mean speed of the step
    dissipated += 0.5 * viscous_coefficient(scene) * np.sum((load.velocity[1:] + load.velocity[:-1]) * moved, axis=1)
    if lugre is not None:
        stepped, straight = (lugre_force(lugre, load, base.dt, parts) for parts in (1, BRISTLE_PARTS))
        work = [0.5 * np.sum((force[1:] + force[:-1]) * moved, axis=1) for force in (stepped, straight)]
        dissipated += work[1]
        doubt += work[1] - work[0]
    return dissipated, doubt


def _stored_energy(base: Recording, load: Load, scene: Scene) -> Array:
    """Return what a tool that lags behind the hand stores at each tick, F^2 / (2 K): (n,), J."""
    if scene.effect(FRICTION) is None:
        return np.zeros(len(base))
    pull = load.tangential + viscous_coefficient(scene) * load.velocity
    return np.asarray((load.normal**2 + np.sum(pull**2, axis=1)) / (2.0 * scene.stiffness))


def lugre_force(law: LuGre, load: Load, dt: float, parts: int) -> Array:
    """Return -F_t of LuGre friction at each tick, (n, N), N, for a speed that is held over each of `parts` of a tick.

    With one part that is the speed of the tick, else it goes straight from the last to that of the tick.

    The bristles' deflection z (m) obeys z' = v - sigma0 |v| z / g(v), and F_t = -(sigma0 z + sigma1 z' + sigma2 v):
    Canudas de Wit et al. 1995. `dt` is in s.
    """
    now, pressed = load.velocity, load.normal > 0.0
    press = np.where(pressed, load.normal, 1.0)
    before = np.concatenate([now[:1], now[:-1]])
    # Over a tick z becomes a z + b.
    grow, add = np.ones((len(now), 1)), np.zeros_like(now)
    for part in range(parts):
        velocity = now if parts == 1 else before + (part + 0.5) / parts * (now - before)
        speed = np.linalg.norm(velocity, axis=1)[:, np.newaxis]
        # Steady deflection g(v) / sigma0, where g grows with the press, and how z nears it over a part of a tick.
        bend = press[:, np.newaxis] * law.limit(speed) / law.stiffness
        decay = np.exp(-speed * dt / (parts * bend))
        settled = np.divide(bend * velocity, speed, out=np.zeros_like(velocity), where=speed > 0.0)
        grow, add = grow * decay, settled + (add - settled) * decay
    # The bristles turn with the surface, and keep their length, but for what the press does not hold.
    tiny, longest = np.finfo(float).tiny, (law.mu_s / law.stiffness * press).tolist()
    free, bends, size = [0.0] * now.shape[1], [], 0.0
    bent = free
    rows = zip(pressed.tolist(), load.normals.tolist(), grow[:, 0].tolist(), add.tolist(), longest, strict=True)
    for touches, normal, shrinks, added, holds in rows:
        # The part of z along the normal goes; what is left in the tangent plane is stretched back to its length.
        lifted = sum(map(mul, bent, normal))
        laid = [along - lifted * across for along, across in zip(bent, normal, strict=True)]
        share = shrinks * min(size, holds) / max(math.hypot(*laid), tiny)
        bent = [share * along + new for along, new in zip(laid, added, strict=True)] if touches else free
        size = math.hypot(*bent)
        bends.append(bent)
    z = np.array(bends)
    speed = np.linalg.norm(now, axis=1)[:, np.newaxis]
    # z' = v - sigma0 |v| z / g(v)
    rate = now - law.stiffness * speed / (press[:, np.newaxis] * law.limit(speed)) * z
    # sigma0 z + sigma1 z' + sigma2 v
    force = law.stiffness * z + law.damping_at(speed) * rate + law.viscosity * now
    return np.where(pressed[:, np.newaxis], force, 0.0)


CHECK = Check(
    id="friction-work",
    phenomenon="none of the six: friction, thesis 4.3.3",
    formula="-sum of F . dx = sum of mu_k F_n |ds| + K ds.(ds - dx) / 2 over a lap; b v_t . dx; or that of LuGre's F_t",
    citation="thesis (4.20)",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    metric="work of the hand less that of the friction's law, as a share of it",
    unit="",
    judge=judge,
    effects=(FRICTION, VISCOUS_FRICTION, LUGRE),
)
