"""Centripetal force (3.8): what bends the tool's path must not be paid for with position error."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hapticeval.closed_forms import Gains, transversal_motion
from hapticeval.geometry.boundary import ClosestPoint
from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import (
    BLOCK_TICKS,
    EXPLAINING_PUSH,
    FIT_SAMPLES,
    HOLD_TICKS,
    LAG_TICKS,
    LEAST_CENTRIPETAL,
    LONG_RUN_STARTS,
    PLACE_ROUNDING,
    REGRESSION_RANK,
    SLOWER_SPEEDS,
    STANDARD_ERRORS,
    START_DECAY,
    STIFFNESS_FACTOR,
    TELLING_SHARE,
)
from hapticeval.phenomena.measures.surface_motion import decay_rate
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import mm, worst_row
from hapticeval.phenomena.verdict import Facts, Finding, compared, not_applicable, undecided
from hapticeval.quantity import format_number
from hapticeval.recordings.recording import runs_of
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray


def judge(runs: Runs, scene: Scene) -> Finding:
    """Regress the surface error on what the missing centripetal force would cost, over all speeds."""
    from scipy.linalg import block_diag

    base = runs.observed(scene)
    unsettled = base.open_loop_reason
    if unsettled is not None:
        return undecided(unsettled)
    loose = _unheld_tick(base)
    if loose is not None:
        message = "the tool is not held: off a surface that holds from both sides there is no force on it"
        return undecided(message, evidence=base.evidence_at(loose))
    slower = SLOWER_SPEEDS if runs.at_speed is not None else ()
    # Slower runs tell v^2 from what else the error may grow with.
    everything = [base, *(Observed(runs.at_speed(factor), scene) for factor in slower if runs.at_speed is not None)]
    terms = [regression_terms(recording) for recording in everything]
    cost = np.concatenate([term.cost for term in terms])
    if cost.size < FIT_SAMPLES:
        return undecided("the tool hardly touches the surface")
    largest = float(np.max(np.abs(cost)))
    if largest <= LEAST_CENTRIPETAL:
        return not_applicable("the tool does not slide over a curved surface")
    error, push = (np.concatenate([getattr(term, name) for term in terms]) for name in ("error", "push"))
    # block_diag: each run rings with a phase of its own.
    share, deviation = fit_share(error, push, cost, block_diag(*(term.rings for term in terms)))
    # In the time that a force is held the normal turns by this angle, and so the force leans.
    bound = HOLD_TICKS * max(term.turning for term in terms) * base.dt
    ticks, tick = terms[0].ticks, int(np.argmax(base.contact))
    if ticks.size:
        tick = int(ticks[worst_row(np.abs(terms[0].cost))])
    evidence: dict[str, object] = {
        **base.evidence_at(tick),
        "centripetal_error_m": share * largest,
        "kappa_v2_m_over_K_m": largest,
        "standard_error": deviation,
        "speeds": [1.0, *slower],
    }
    at_zero = missing_at_zero_error(base)
    if at_zero is not None:
        evidence["force_missing_at_zero_error"] = at_zero
    evidence |= Facts(force_over_spring=force_off_spring(base)).evidence
    lacking = abs(at_zero or 0.0)
    value = max(abs(share), lacking)
    metric = CHECK.measured(value)
    # A share that is not told from its bound decides nothing, unless the force at zero error already does.
    unclear = not np.isfinite(deviation) or abs(abs(share) - bound) <= STANDARD_ERRORS * deviation
    if bound > TELLING_SHARE or (unclear and lacking <= bound):
        message = "too slow, or too much else going on, to separate the centripetal part of the error from the rest"
        return undecided(message, metric, bound, evidence)
    return compared(
        metric,
        bound,
        evidence,
        passes="the error does not grow with the square of speed",
        fails=f"{format_number(100 * value, 3)} per cent of the centripetal force comes from position error: "
        f"{mm(abs(share) * largest)} at the top speed",
    )


def _unheld_tick(recording: Observed) -> int | None:
    """Return the tick at which a tool on a bilateral constraint is farthest off it without a force; None where held.

    A spring gives K_p times the distance. A damper takes that away where the tool comes home slowly. So a missing force
    counts over more than a tenth of the run only, and beyond the distance that a late answer leaves.
    """
    scene = recording.scene
    if not scene.bilateral:
        return None
    distance = np.abs(recording.distance)
    free = (distance > recording.position_tolerance + recording.force_depth) & ~recording.pressed
    return worst_row(np.where(free, distance, 0.0)) if np.mean(free) > TELLING_SHARE else None


def force_off_spring(recording: Observed) -> float | None:
    """Return the force along the normal as a multiple of K_p times the depth, the median in contact, where it is off.

    That is, by a factor of two or more from the stiffness that a declared spring has; else None. What the scene's
    damping may add along the normal is taken off first: while the speed decays, so does the depth, and a damper along
    the error resists that.
    """
    scene = recording.scene
    if "spring" not in recording.meta or "force" not in recording.channels:
        return None
    softest, stiffest = recording.stiffness_range or (1.0, 1.0)
    frame = recording.nearest
    # Both ways from a surface that holds from both sides, and deep enough to tell a depth from its rounding.
    rows = recording.contact & (np.abs(frame.distance) > recording.force_depth)
    if not rows.any():
        return None
    normal, spring_force = frame.normal[rows], -scene.stiffness * frame.distance[rows]
    damper_force = scene.damping * np.abs(np.sum(recording.velocity[rows] * normal, axis=1))
    difference = np.sum(recording.force[rows] * normal, axis=1) - spring_force
    stiffness_ratio = float(np.median(1.0 + _reduce_by_doubt(difference, damper_force) / spring_force))
    is_off = not softest / STIFFNESS_FACTOR < stiffness_ratio < STIFFNESS_FACTOR * stiffest
    return stiffness_ratio if is_off else None


class RegressionTerms(NamedTuple):
    """The columns of the regression of one run, with a row for each of its `ticks` (n,); errors are (n,), m, outwards.

    - `error`: the distance from the surface; `push`: the part of it that the operator's push makes.
    - `cost`: the centripetal one, kappa v_t^2 m / K_p: what a spring pays that supplies (3.8) alone, as the assigned
      dynamics answer to it.
    - `rings`: how a spring without a damper rings, (n, 2) or (n, 0): see `_ringing_columns`.
    - `turning`: the largest |kappa| v_t, rad/s: the rate at which the normal turns.
    """

    ticks: IntArray
    error: Array
    push: Array
    cost: Array
    rings: Array
    turning: float


def regression_terms(recording: Observed) -> RegressionTerms:
    """Return the columns of the regression over the samples in contact, once the tool is under way."""
    scene = recording.scene
    frame = recording.nearest
    turning, speed2 = _normal_turning(frame, recording.velocity)
    push = np.zeros(len(recording))
    if "operator_force" in recording.channels:
        push = np.sum(recording.channels["operator_force"] * frame.normal, axis=1)
    # (3.8) and the push, both as the error that they make: what the spring alone would have to give.
    cost, share = (assigned_response(force, recording) for force in (speed2 * scene.mass, push))
    bearing = recording.contact
    judged = bearing
    if not scene.bilateral:
        # Inside and without force, as after a touch, nothing bends the path.
        bearing = bearing & recording.pressed
        judged = bearing & ~_after_strike(bearing)
    judged = judged & _under_way(recording, bearing)
    fastest = float(np.max(turning[judged], initial=0.0))
    rings = _ringing_columns(recording.time[judged], scene)
    return RegressionTerms(np.flatnonzero(judged), frame.distance[judged], share[judged], cost[judged], rings, fastest)


def _after_strike(bearing: BoolArray) -> BoolArray:
    """Return where a force that was not there begins, (n,), and as many ticks after that as an answer may lag.

    A tool that is struck flies at that sample yet: how far it is off the surface is a way that it has still to go.
    """
    struck = np.zeros_like(bearing)
    for first, _ in runs_of(bearing):
        if first > 0:
            struck[first : first + LAG_TICKS + 1] = True
    return struck


def _ringing_columns(time: Array, scene: Scene) -> Array:
    """Return cosine and sine of sqrt(K_p / m) t at each of `time` (n,), s: (n, 2); over less than a period (n, 0).

    A renderer that shows the scene's spring without its damper rings on, and not with what presses it.
    """
    turn = math.sqrt(scene.stiffness / scene.mass) * time
    rings = np.column_stack([np.cos(turn), np.sin(turn)])
    # Less than a period cannot be told from a constant and a slope.
    return rings if turn.size and turn[-1] - turn[0] >= 2.0 * np.pi else rings[:, :0]


def assigned_response(force: Array, recording: Observed) -> Array:
    """Return the error (n,), m, of m n'' + K_d n' + K_p n = F for an outward force F (n,), N, held between samples.

    It starts in equilibrium with the first. Undamped dynamics never come to an answer: then it is the static one.
    """
    scene = recording.scene
    if decay_rate(scene) == 0.0 or force.size < 2:
        return force / scene.stiffness
    gains, dt = Gains(scene.stiffness / scene.mass, scene.damping / scene.mass, 0.0), recording.dt
    # How a deflection dies out in one tick and in two gives the recursion that a held force is answered by.
    once, twice = transversal_motion(gains, "pp-pd", 1.0, 0.0, np.array([dt, 2.0 * dt]))[0]
    carried = transversal_motion(gains, "pp-pd", 0.0, 1.0, np.array([dt]))[1][0]
    back, further = -once - carried, math.exp(-gains.d * dt)
    first, second = (1.0 - once) / scene.stiffness, (1.0 - twice) / scene.stiffness
    second = second - first + back * first
    # The recursion with two memories, which begins at rest under the first force.
    now, then = np.linalg.solve([[1.0 + back, -1.0], [further, 1.0]], [first, second]) * force[0]
    answered = []
    for push in force.tolist():
        answered.append(now)
        now, then = then + push * first - now * back, push * second - now * further
    return np.array(answered)


def _under_way(recording: Observed, bearing: BoolArray) -> BoolArray:
    """Return which rows (n,) come after the start of the contact, when the assigned dynamics have died out.

    Before, the error has other causes. Of a run shorter than `LONG_RUN_STARTS` times that, all of it.
    """
    since = recording.time - recording.time[int(np.argmax(bearing))]
    rate = decay_rate(recording.scene)
    lasts = math.log(START_DECAY) / rate if rate > 0.0 else 0.0
    return np.asarray(since >= lasts if LONG_RUN_STARTS * lasts <= since[-1] else since >= 0.0)


def _normal_turning(frame: ClosestPoint, velocity: Array) -> tuple[Array, Array]:
    """Return |W v| (n,), rad/s, the rate at which the normal turns, and <W v, v> (n,), m/s^2: kappa v_t^2 in the plane.

    W is the shape operator (n, N, N), 1/m, and v (n, N), m/s.
    """
    turning = np.einsum("kij,kj->ki", frame.shape, velocity)
    return np.linalg.norm(turning, axis=1), np.asarray(np.sum(turning * velocity, axis=1))


def fit_share(error: Array, push: Array, cost: Array, rings: Array) -> tuple[float, float]:
    """Return a and its standard error in error = a cost + b push + c + what rings, by least squares.

    All columns are (n,), m; what rings (n, k). Samples of one oscillation are not independent, so that the degrees of
    freedom are counted in blocks of `BLOCK_TICKS`.
    """
    # error = a cost + c + ring columns [+ b push]; a is the share that is asked for.
    columns = [cost, np.ones_like(cost), *rings.T]
    # A push that varies by less than a millionth of the cost cannot explain it, and would spoil the rank.
    if np.ptp(push) > EXPLAINING_PUSH * np.max(np.abs(cost)):
        columns.append(push)
    design = np.column_stack(columns)
    solution, _, rank, _ = np.linalg.lstsq(design, error, rcond=REGRESSION_RANK)
    if rank < design.shape[1]:
        return float(solution[0]), float("inf")
    residual = error - design @ solution
    blocks = max(cost.size / BLOCK_TICKS - design.shape[1], 1.0)
    inverse = np.linalg.inv(design.T @ design / cost.size)
    # var(a) = s^2 (X'X)^-1 [a, a], with the freedom of the independent blocks.
    variance = float(np.mean(residual**2)) * float(inverse[0, 0]) / blocks
    return float(solution[0]), float(np.sqrt(max(variance, 0.0)))


def missing_at_zero_error(recording: Observed) -> float | None:
    """Return the share of m kappa v^2 that the force lacks at the start, if that lies on a bilateral constraint.

    There the position error is zero, so the force must be the centripetal one alone (3.8).

    - It is that of the sample, or of some time until the next one, where it is a mean.
    - The best of the first ticks counts, as many as a proxy may lag.
    - The operator pushes in one direction, of which the turning normal has another share in that time: by so much it
      may differ.
    """
    scene = recording.scene
    if not scene.bilateral or len(recording) < LAG_TICKS + 2:
        return None
    ticks = slice(0, LAG_TICKS + 2)
    frame = recording.boundary.closest_point(recording.hip[ticks])
    normal = frame.normal
    turning, speed2 = _normal_turning(frame, recording.velocity[ticks])
    required, push_doubt = scene.mass * speed2, np.zeros(len(normal))
    if abs(frame.distance[0]) > PLACE_ROUNDING * scene.model.size or not np.all(np.abs(required) > 0.0):
        return None
    outward_force = np.sum(recording.force[ticks] * normal, axis=1)
    if "operator_force" in recording.channels:
        push = recording.channels["operator_force"][ticks]
        outward_force += np.sum(push * normal, axis=1)
        push_doubt = HOLD_TICKS * recording.dt * turning * np.linalg.norm(push, axis=1)
    # The required force is inward: the value between two samples that the given one comes nearest to.
    nearest = np.clip(-outward_force[:-1], *np.sort([required[:-1], required[1:]], axis=0))
    if not np.all(np.abs(nearest) > 0.0):
        return None
    # 1 - |given| / |required|: 0 where all is given, 1 where nothing is.
    missing = _reduce_by_doubt(1.0 + outward_force[:-1] / nearest, push_doubt[:-1] / np.abs(nearest))
    return float(missing[np.argmin(np.abs(missing))])


def _reduce_by_doubt(values: Array, doubt: Array) -> Array:
    """Return `values` (n,), N or shares, less what is open of them, (n,): 0 where that is all."""
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - doubt, 0.0))


CHECK = Check(
    id="centripetal-force",
    phenomenon="Centripetal Force",
    formula="F_cen = m kappa v^2 (3.8); error = a kappa v^2 m / K_p + b F_o.n / K_p + c, and a = 0 where it is given",
    citation="thesis 3.2.3, (3.8); 6.3.3; Table 6.3 'accounts for centripetal acceleration'",
    channels=("hip", "force", "velocity"),
    reads_also=("ihip", "operator_force"),
    siblings={"at_speed": "the same experiment at 0.5 and 0.75 times the speed"},
    not_for={Situation.PLAYBACK: "a hand led along a given path needs no force to follow it"},
    needs_loop=True,
    metric="share of the centripetal force that position error has to supply",
    unit="",
    judge=judge,
)
