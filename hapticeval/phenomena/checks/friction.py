"""Friction (4.3.3): the tool sticks in its cone, breaks away at its edge, and slides braked by the force of its law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hapticeval.effects.catalogue import FRICTION, LUGRE
from hapticeval.effects.effect import Alters, Stage
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.decisions import (
    BETWEEN_CONES,
    BRISTLE_PARTS,
    CREEP_SPEED,
    LAG_TICKS,
    LENGTH_ROUNDING,
    SHARE_ROUNDING,
    SLIDING_TICKS,
    STICKING_SHARE,
    STICKING_TIME,
    TELLING_SHARE,
)
from hapticeval.phenomena.lag import believed_lag, beside_straight, between_ticks, delayed, largest_in_lag
from hapticeval.phenomena.measures.friction_check import HAND, LAWS_OF_SPEED, check_of_friction
from hapticeval.phenomena.measures.lugre_force import lugre_force
from hapticeval.phenomena.measures.surface_force import SurfaceForce, along_surface, ihip_rounding, viscous_coefficient
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import listed, steps_to, worst_row
from hapticeval.phenomena.verdict import Finding, compared, undecided
from hapticeval.recordings.recording import runs_of
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray


def judge_cone(runs: Runs, surface_force: SurfaceForce, scene: Scene) -> Finding:
    """Compare |F_t| with mu_s F_n at every tick."""
    base, friction = runs.observed(scene), scene.effect(FRICTION)
    # |F_t| less what the scene's dampers and rounding may make of it.
    least_tangential = surface_force.tangential_size - surface_force.open_force
    limit = friction.mu_s * np.maximum(surface_force.normal_force, 0.0)
    if np.any(least_tangential > limit * (1.0 + LENGTH_ROUNDING)):
        # What leaves the cone may be a facet's lean.
        least_tangential = np.maximum(least_tangential - surface_force.leaning, 0.0)
    # |F_t| / (mu_s F_n); infinite where nothing presses the tool
    shares = np.divide(least_tangential, limit, out=np.where(least_tangential > 0.0, np.inf, 0.0), where=limit > 0.0)
    worst = worst_row(shares)
    share = float(shares[worst])
    # A force that hardly leans shows nothing of the friction.
    if share < TELLING_SHARE:
        return undecided("the tool is hardly pulled along the surface: less than a tenth of what the friction holds")
    return compared(
        FRICTION_CONE.measured(share),
        1.0 + LENGTH_ROUNDING,
        {
            **base.evidence_at(worst),
            "normal_N": float(surface_force.normal_force[worst]),
            "tangential_N": float(surface_force.tangential_size[worst]),
        },
        passes=f"the force stays in the cone of mu_s = {friction.mu_s:g}, and fills it to {share:.4g}",
        fails=(
            f"leaves the cone: {surface_force.tangential_size[worst]:.4g} N along the surface at "
            f"t = {base.time[worst]:.4g} s, where mu_s = {friction.mu_s:g} holds "
            f"{limit[worst]:.4g} N of {surface_force.normal_force[worst]:.4g} N across it"
        ),
    )


FRICTION_CONE = check_of_friction(
    judge_cone,
    on_time=((*HAND, "ihip"), ("force",)),
    id="friction-cone",
    phenomenon="none of the six: static friction, thesis 4.3.3",
    formula="|F_t| <= mu_s F_n at every tick, with F_n = n.F at the IHIP and F_t = F - F_n n",
    citation="thesis (4.17)-(4.19), Figure 4.9",
    metric="force along the surface as a share of mu_s times that across it",
)


def judge_break_away(runs: Runs, surface_force: SurfaceForce, scene: Scene) -> Finding:
    """Compare the force along the surface with mu_s F_n (4.18) where a tool that stuck begins to slide."""
    base, friction = runs.observed(scene), scene.effect(FRICTION)
    # A tool that slides sticks again at the share `stick` of the kinetic cone, and may slide above that: below it, and
    # below what any friction holds, it has surely stuck. `slips` are the ticks in which it then begins to slide.
    slips = break_away_ticks(base, surface_force, min(STICKING_SHARE, friction.stick) * friction.mu_k)
    # 1 on the edge of the static cone (4.18)
    share = surface_force.share_of_cone(friction.mu_s)
    # In the tick before, of a channel that is late too, the hand was a step less far, or two where that is between two.
    feet = base.nearest.foot
    step = largest_in_lag(np.maximum(steps_to(base.hip), steps_to(feet)), earlier=1)
    # How much the normal force, N, changes in a tick near it.
    normal_force = surface_force.normal_force
    normal_change = largest_in_lag(np.abs(np.diff(normal_force, prepend=normal_force[:1])), earlier=1)
    holds = friction.mu_s * normal_force[slips - 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        # 2 K |dx| + mu_s |dF_n| and rounding: what the force may have lacked in the tick before.
        open_force = 2.0 * scene.stiffness * step[slips] + friction.mu_s * normal_change[slips]
        open_force += surface_force.open_force[slips - 1]
        allowed = open_force / holds
    # Known to a tenth, or to half of what lies between the static and the kinetic cone.
    clear = allowed <= max(TELLING_SHARE, BETWEEN_CONES * (1.0 - friction.mu_k / friction.mu_s))
    if not clear.any():
        return undecided(
            "the tool nowhere begins to slide, after it has stuck, while the hand moves and presses evenly"
        )
    shortfall = 1.0 - largest_in_lag(share, earlier=1)[slips]
    worst = worst_row(np.where(clear, shortfall - allowed, -np.inf))
    tick = int(slips[worst])
    reached = (1.0 - float(shortfall[worst])) * friction.mu_s
    return compared(
        FRICTION_BREAK_AWAY.measured(max(float(shortfall[worst]), 0.0)),
        float(allowed[worst]),
        {**base.evidence_at(tick), "reached": reached, "slips": int(np.count_nonzero(clear))},
        passes=(
            f"a tool that sticks is held up to mu_s = {friction.mu_s:g}: it slides from {reached:.3g} times the force "
            "across the surface on"
        ),
        fails=(
            f"a tool that sticks is let go too early: it slides at t = {base.time[tick]:.4g} s, and the "
            f"force along the surface has reached {reached:.3g} times that across it, where mu_s = {friction.mu_s:g}"
        ),
    )


def break_away_ticks(base: Observed, surface_force: SurfaceForce, surely: float) -> IntArray:
    """Return the ticks in which a tool that has stuck begins to slide, away from corners.

    It has stuck when it rested for longer than the granted lag, and was pulled by less than the share `surely` of F_n.
    """
    rounding = ihip_rounding(base)
    length = steps_to(base.ihip)
    pressed = surface_force.normal_force > 0.0
    # What is not a contact ends a rest as well as a motion does; so does the beginning of the recording.
    moves = (length > rounding) | ~pressed | ~np.append(False, pressed[:-1])
    sticks = surface_force.surely_within(surely)
    # At a corner the tool may change its face: there a step is not a slip.
    near = _by_a_corner(base, length + rounding)
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


FRICTION_BREAK_AWAY = check_of_friction(
    judge_break_away,
    id="friction-break-away",
    phenomenon="none of the six: static friction, thesis 4.3.3",
    formula="|F_t| >= mu_s F_n - 2 K |dx| - mu_s |dF_n| in the tick before a tool that sticks begins to slide",
    citation="thesis (4.18), (4.19), Figure 4.9",
    metric="what the force along the surface lacks of mu_s F_n when the tool begins to slide, as a share of it",
)


class _Creep(NamedTuple):
    """How far, m, and how fast, m/s, the tool moves at most over the rows [first, stop), `seconds` long, that stick."""

    speed: float
    first: int
    stop: int
    distance: float
    seconds: float


def judge_sticking(runs: Runs, surface_force: SurfaceForce, scene: Scene) -> Finding:
    """Measure how far the IHIP moves while the force along the surface is small."""
    base, friction = runs.observed(scene), scene.effect(FRICTION)
    pulled = surface_force.share_of_cone(friction.mu_k)
    sticks = surface_force.surely_within(STICKING_SHARE * friction.mu_k)
    creeps = []
    for first, stop in runs_of(sticks):
        seconds = float(base.time[stop - 1] - base.time[first])
        # Long enough to tell creep from bending, and pulled hard enough to creep.
        if seconds >= STICKING_TIME and float(np.median(pulled[first:stop])) >= TELLING_SHARE:
            distance = float(np.linalg.norm(base.ihip[first:stop] - base.ihip[first], axis=1).max())
            creeps.append(_Creep(distance / seconds, first, stop, distance, seconds))
    if not creeps:
        return undecided(
            f"the tool is nowhere held for {STICKING_TIME:g} s by a tenth to {STICKING_SHARE:g} of what the friction "
            "holds"
        )
    worst = max(creeps)
    share = float(np.median(pulled[worst.first : worst.stop]))
    what = (
        f"{1e6 * worst.distance:.3g} um in {worst.seconds:.4g} s at {share:.2f} of the kinetic cone, "
        f"from t = {base.time[worst.first]:.4g} s"
    )
    return compared(
        FRICTION_STICKING.measured(worst.speed),
        CREEP_SPEED,
        {
            **base.evidence_at(worst.first),
            "to_time": float(base.time[worst.stop - 1]),
            "to_ihip": listed(base.ihip[worst.stop - 1]),
            "drift_m": worst.distance,
            "share": share,
        },
        passes=f"a tool that sticks stays: {what}",
        fails=f"a tool that should stick creeps: {what}",
    )


STICKING_FORMULA = (
    f"|ihip(t) - ihip(t0)| <= {1e7 * CREEP_SPEED:g} um in 10 s while |F_t| <= {STICKING_SHARE:g} mu_k F_n"
)
FRICTION_STICKING = check_of_friction(
    judge_sticking,
    id="friction-sticking",
    phenomenon="none of the six: static friction, thesis 4.3.3",
    formula=STICKING_FORMULA,
    citation="thesis (4.18), (4.19)",
    metric="how fast the IHIP creeps while it is held",
    unit="m/s",
)


def judge_sliding(runs: Runs, surface_force: SurfaceForce, scene: Scene) -> Finding:
    """Compare F_t at every tick in which the IHIP moves with mu_k F_n against that motion (4.20)."""
    base = runs.observed(scene)
    friction = scene.effect(FRICTION)
    # The slip ds of a tick, along the surface.
    step = along_surface(np.diff(base.ihip, axis=0, prepend=base.ihip[:1]), surface_force.unit_normals)
    length = np.linalg.norm(step, axis=1)
    # (4.20): F_t = -mu_k F_n ds / |ds|
    braking = friction.mu_k * surface_force.normal_force
    shape = base.boundary.closest_point(base.ihip).shape
    bend, twist = _curvature(shape)
    rounding = ihip_rounding(base)
    # How far, m, the HIP may lie from the IHIP along the surface: the slip and the spring's length.
    reach = length + (surface_force.tangential_size + surface_force.normal_force) / scene.stiffness
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        against_motion = braking[:, np.newaxis] * step / length[:, np.newaxis]
        deviation = np.linalg.norm(surface_force.tangential_force + against_motion, axis=1) / braking
        # The tangent plane turns by curvature times that way; of first order only where it twists.
        turned = twist * reach + (bend * reach) ** 2
        allowed = surface_force.open_force / braking + turned + rounding / length + SHARE_ROUNDING
    # In the first tick of a contact the way is that of a free tool; one of less than `rounding` allows any force.
    slides = np.roll(surface_force.pressed, 1) & (braking > 0.0) & (allowed <= TELLING_SHARE)
    slides[0] = False
    # A slip over a corner has two directions.
    slides &= ~_by_a_corner(base, length + rounding)
    ticks = np.flatnonzero(slides)
    if ticks.size < SLIDING_TICKS:
        return undecided(f"the tool slides in {ticks.size} ticks only, away from corners")
    if np.any(deviation[ticks] > allowed[ticks]):
        # What is off may be a facet's lean.
        allowed[ticks] += surface_force.leaning[ticks] / braking[ticks]
    worst = int(ticks[worst_row((deviation - allowed)[ticks])])
    if deviation[worst] <= allowed[worst] and allowed[worst] > TELLING_SHARE:
        return undecided("facets of the declared resolution may turn the force by a tenth of the friction or more")
    # The force against the motion, N, for the message.
    against = -float(np.sum(surface_force.tangential_force[worst] * step[worst])) / float(length[worst])
    comparison = f"{against:.4g} N against its motion, where mu_k = {friction.mu_k:g} makes {braking[worst]:.4g} N"
    return compared(
        FRICTION_SLIDING.measured(deviation[worst]),
        float(allowed[worst]),
        {
            **base.evidence_at(worst),
            "against_N": against,
            "asked_N": float(braking[worst]),
            "normal_N": float(surface_force.normal_force[worst]),
            "ticks": int(ticks.size),
        },
        passes=f"a tool that slides is braked by mu_k F_n in {ticks.size} ticks; at the worst {comparison}",
        fails=f"a tool that slides at t = {base.time[worst]:.4g} s feels {comparison}",
    )


def _curvature(shape: Array) -> tuple[Array, Array]:
    """Return the largest curvatures (n,), 1/m, of operators (n, N, N), and half of what the principal ones differ by.

    In the plane there is but one, and no way aside.
    """
    largest = np.abs(np.linalg.eigvalsh(shape)).max(axis=1)
    if shape.shape[1] == 2:
        return largest, np.zeros_like(largest)
    # (k1 - k2)^2 = 2 tr(W^2) - tr(W)^2
    difference_squared = 2.0 * np.sum(shape**2, axis=(1, 2)) - np.trace(shape, axis1=1, axis2=2) ** 2
    return largest, 0.5 * np.sqrt(np.maximum(difference_squared, 0.0))


FRICTION_SLIDING = check_of_friction(
    judge_sliding,
    on_time=((*HAND, "ihip"), ("force",)),
    id="friction-sliding",
    phenomenon="none of the six: kinetic friction, thesis 4.3.3",
    formula="F_t = -mu_k F_n ds/|ds| at every tick in which the IHIP moves by ds along the surface",
    citation="thesis (4.20), Figure 4.9",
    metric="what F_t is off mu_k F_n against the motion, as a share of it",
)


def _by_a_corner(base: Observed, within: Array) -> BoolArray:
    """Return where the IHIP is `within` so far (n,), m, of a corner: (n,)."""
    near = np.zeros(len(base), dtype=bool)
    for corner in base.boundary.corners:
        near |= np.linalg.norm(base.ihip - corner.position, axis=1) <= within
    return near


def judge_force(runs: Runs, surface_force: SurfaceForce, scene: Scene) -> Finding:
    """Compare the force along the surface with that of the law at every tick in contact."""
    base = runs.observed(scene)
    if any(effect.stage is Stage.SENSE for effect in scene.effects):
        return undecided("the renderer answers the speed that its sensors show, and not the hand's")
    (kind,) = (effect.kind for effect in scene.effects if effect.kind in LAWS_OF_SPEED)
    tangential_force = surface_force.tangential_force
    if runs.without is not None:
        plain = runs.without(kind).force
        # What the renderer itself gives along the surface, without the friction, is not the law's.
        tangential_force = tangential_force - along_surface(plain, surface_force.unit_normals)
    # What the queue of a late renderer begins with is not of the law.
    judged = surface_force.pressed & (np.arange(len(base)) >= LAG_TICKS)
    law_force = _law_force(base, surface_force)
    straight = law_force(0.0, BRISTLE_PARTS)
    strength = np.linalg.norm(straight, axis=1)
    # Dampers are not asked here but for the law itself; what sampling leaves open of that is the difference between a
    # speed that is held over a tick and one that goes straight.
    doubt = surface_force.rounding + np.linalg.norm(law_force(0.0, 1) - straight, axis=1)
    if not (judged & (doubt <= TELLING_SHARE * strength)).any():
        return undecided("the law's force is nowhere ten times what sampling and rounding leave open of it")

    def best_lag(parts: int) -> tuple[float, float]:
        """Return the lag that explains what is off, and the misfit with it."""
        return believed_lag(
            lambda lag: float(np.linalg.norm((tangential_force + law_force(lag, parts))[judged], axis=1).mean()),
            float(doubt[judged].mean()),
        )

    # The lag of whichever of the two fits better.
    lag = min(best_lag(1), best_lag(BRISTLE_PARTS), key=lambda lag_and_misfit: lag_and_misfit[1])[0]
    if lag:
        stepped, straight = law_force(lag, 1), law_force(lag, BRISTLE_PARTS)
        doubt = surface_force.rounding + np.linalg.norm(stepped - straight, axis=1)
        # Between ticks it is not known which value the renderer had.
        if between_ticks(lag):
            doubt += beside_straight(straight)
    # The speed of a tick may be taken as held since the last, or as going there straight.
    deviation = np.linalg.norm(tangential_force + straight, axis=1)
    worst = worst_row(np.where(judged, deviation - doubt, -np.inf))
    what = (
        f"at t = {base.time[worst]:.4g} s it is {deviation[worst]:.3g} N off the {strength[worst]:.3g} "
        f"N that the {kind} makes of {1e3 * np.linalg.norm(surface_force.velocity[worst]):.3g} mm/s"
    )
    return compared(
        FRICTION_FORCE.measured(deviation[worst]),
        float(doubt[worst]),
        {**base.evidence_at(worst), "law_N": float(strength[worst]), "lag_ticks": float(lag)},
        passes=f"the force along the surface is that of the {kind} in every tick",
        fails=f"the force along the surface is another than the law's: {what}",
    )


def _law_force(base: Observed, surface_force: SurfaceForce) -> Callable[[float, int], Array]:
    """Return -F_t of the law (n, N), N, as a function of a lag in ticks and the parts of a tick: see `lugre_force`."""
    lugre = base.scene.effect(LUGRE)
    rows = np.arange(len(base), dtype=np.int64)

    def at_lag(lag: float, parts: int) -> Array:
        velocity = delayed(surface_force.velocity, rows, lag) if lag else surface_force.velocity
        if lugre is None:
            return viscous_coefficient(base.scene) * velocity
        return lugre_force(lugre, replace(surface_force, velocity=velocity), base.dt, parts)

    return at_lag


FRICTION_FORCE = check_of_friction(
    judge_force,
    damped=False,
    id="friction-force",
    phenomenon="none of the six: friction, thesis 4.3.3",
    formula="F_t = -b v_t, or -(sigma0 z + sigma1 z' + sigma2 v) with z' = v - sigma0 |v| z / g(v)",
    citation="thesis 4.3.3; Canudas de Wit et al. 1995",
    siblings={"without": "the same path in the scene without the friction"},
    metric="force along the surface off that of the law",
    unit="N",
    effects=LAWS_OF_SPEED,
    not_with=(Alters.FREE_SPACE, Alters.CONTACT_POINT),
)

CHECKS = (FRICTION_CONE, FRICTION_BREAK_AWAY, FRICTION_STICKING, FRICTION_SLIDING, FRICTION_FORCE)
