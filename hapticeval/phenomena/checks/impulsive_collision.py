"""Impulsive collision (3.5)-(3.7): a new contact takes the normal momentum out of the tool at once."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.geometry.boundary import ClosestPoint
from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.decisions import IMPULSE_ROUNDING, SAME_FACE_COSINE, UNKNOWN_MOMENTUM, WINDOW_TICKS
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.verdict import Facts, Finding, compared, not_applicable, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge(runs: Runs, scene: Scene) -> Finding:
    """Compare the momentum along the normal that the first ticks of contact take out with (3.5)."""
    base = runs.observed(scene)
    struck = int(np.argmax(base.contact))
    end = struck + WINDOW_TICKS
    unsettled = _unsettled(base, struck)
    if unsettled is not None:
        return unsettled
    normal, along = _along_the_normal(base, struck)
    approach = -float(along[struck])
    # (3.5): (1 + c_r) m (v . n_e), N s
    required = (1.0 + scene.restitution) * scene.mass * approach
    impulses = _operator_impulses(base, normal)
    pushed = float(np.sum(impulses[struck:end]))
    # m dv along the normal, less what the operator has given in that time.
    removed = scene.mass * float(along[end] - along[struck]) - pushed
    window = base.boundary.closest_point(base.ihip[struck : end + 1])
    turning = _speed_by_turning(base, window, slice(struck, end + 1))
    # What the operator adds before the tool is met is part of what has to be taken out.
    before, inwards = operator_until_met(base, impulses, struck), np.maximum(-impulses, 0.0)
    slower, faster = ((1.0 + scene.restitution) * impulse for impulse in (before[1], -before[0]))
    if slower > UNKNOWN_MOMENTUM * required:
        return undecided("the operator may take most of the tool's momentum before it is met, within a tick")
    # A tool that stays in contact has the operator's push answered as well.
    answered = required + faster + float(np.sum(inwards[struck:end]))
    # Too little or too much of it, as a share of what (3.5) asks for.
    missing = max(required - slower - removed, removed - answered, 0.0) / required
    stopped = np.flatnonzero(along[struck:] >= 0.0)
    stopped_ms = 1e3 * float(base.time[struck + stopped[0]] - base.time[struck]) if stopped.size else None
    left = np.flatnonzero(~base.contact[struck:])
    # What (3.5) does not ask for, a spring that is pressed already may give.
    facts = Facts(
        impulse_wanted_Ns=required,
        impulse_in_window_Ns=removed,
        spring_impulse_Ns=_spring_impulse(base, normal, slice(struck, end)) if removed > required else None,
        stopped_after_ms=stopped_ms,
        pressed_until_left=_is_pressed(base, normal, slice(struck, struck + left[0])) if left.size else None,
    )
    evidence = {
        **base.evidence_at(struck),
        "approach_speed_m_s": approach,
        **facts.evidence,
        "peak_force_N": float(np.max(base.force[struck:] @ normal)),
    }
    message = f"{removed:.3g} N s of {required:.3g} N s are taken out within {WINDOW_TICKS} ticks"
    fails = f"{message}; the tool " + ("is not stopped" if stopped_ms is None else f"stops after {stopped_ms:.3g} ms")
    if left.size:
        leaving = float(along[struck + left[0]])
        evidence["apparent_restitution"] = leaving / approach
        evidence["impulse_over_contact_Ns"] = scene.mass * float(along[struck + left[0]] - along[struck])
        fails += f" and leaves with restitution {leaving / approach:.2f}"
        if leaving > approach:
            fails += f" (a spring's force that is held for a tick gives {_restitution_of_held_spring(base):.2f})"
    return compared(
        CHECK.measured(missing), turning / approach + IMPULSE_ROUNDING, evidence, passes=message, fails=fails
    )


def _along_the_normal(base: Observed, struck: int) -> tuple[Array, Array]:
    """Return the outward normal (N,) where the tool is met, and its velocity along that (n,), m/s."""
    normal = base.boundary.closest_point(base.ihip[struck : struck + 1]).normal[0]
    return normal, base.velocity @ normal


def _unsettled(base: Observed, struck: int) -> Finding | None:
    """Return why a recording has no collision to judge at the row `struck`, where a contact begins; else None."""
    end = struck + WINDOW_TICKS
    if base.open_loop_reason is not None:
        return undecided(base.open_loop_reason)
    if not base.contact.any():
        return undecided("the tool does not fly freely into the surface")
    if struck == 0:
        return not_applicable("the tool starts in contact, and does not fly into the surface")
    if end >= len(base):
        return undecided("the recording ends with the collision")
    normal, along = _along_the_normal(base, struck)
    # v . n_e at the sample before the contact acts, positive into the surface, m/s
    if along[struck] >= 0.0:
        return undecided("the tool does not move into the surface when it meets it")
    window = base.boundary.closest_point(base.ihip[struck : end + 1])
    if float(np.min(window.normal @ normal)) < SAME_FACE_COSINE or _meets_another_face(base, normal, struck, end):
        return not_applicable(f"the tool meets another part of the surface within {WINDOW_TICKS} ticks of contact")
    return None


def _meets_another_face(base: Observed, normal: Array, struck: int, end: int) -> bool:
    """Return whether a force in the window is normal to the surface within the tool's step, and not along `normal`.

    `normal` is (N,), of unit length. So it is in a notch, of whose end either face has the normal.
    """
    rows = np.arange(struck, end)
    size = np.linalg.norm(base.force[rows], axis=1)
    # Forces that lean from `normal` by more than the granted angle.
    rows = rows[(size > 0.0) & (base.force[rows] @ normal < SAME_FACE_COSINE * size)]
    if rows.size == 0:
        return False
    steps = np.linalg.norm(base.ihip[rows + 1] - base.ihip[rows], axis=1)
    angles = base.boundary.normal_cone(base.ihip[rows], steps)(base.force[rows])
    return bool(np.any(np.cos(angles) >= SAME_FACE_COSINE))


def _speed_by_turning(base: Observed, surface: ClosestPoint, rows: slice) -> float:
    """Return by how much (m/s) a turning normal alone may change the velocity along it in `rows`, from the first on.

    `surface` is where the tool is in each of them. By curvature over the window, or over a facet by the sliding speed
    times the turn of the normal.
    """
    velocity, first = base.velocity[rows], surface.normal[0]
    # <W v, v>: how fast the normal component changes for the turning normal alone, m/s^2
    bend = np.einsum("ni,nij,nj->n", velocity, surface.shape, velocity)
    turn = np.linalg.norm(surface.normal - first, axis=1)
    sliding_speed = np.linalg.norm(velocity - np.outer(velocity @ first, first), axis=1)
    turning = max(float(np.abs(bend).max()) * WINDOW_TICKS * base.dt, float(np.max(sliding_speed * turn)))
    if "operator_force" in base.channels:
        # The operator's force, too, has another normal part when the normal turns.
        push = np.linalg.norm(base.channels["operator_force"][rows][:-1], axis=1)
        turning += float(np.sum(push)) * base.dt * float(turn.max()) / base.scene.mass
    return turning


def _restitution_of_held_spring(base: Observed) -> float:
    """Return the restitution that a spring shows whose force is held for a tick T.

    It is late by T / 2: a damper of -K T / 2, over half a period pi sqrt(m / K).
    """
    return math.exp(0.25 * math.pi * base.dt * math.sqrt(base.scene.stiffness / base.scene.mass))


def _is_pressed(base: Observed, normal: Array, rows: slice) -> bool:
    """Return whether the force along `normal` (N,) in `rows` is at least that of the softest declared spring, K d."""
    softest, _ = base.stiffness_range or (1.0, 1.0)
    depths = (base.ihip[rows] - base.hip[rows]) @ normal
    least_force = softest * base.scene.stiffness * depths
    rounding = IMPULSE_ROUNDING * np.abs(least_force).max(initial=0.0)
    return bool(np.all(base.force[rows] @ normal >= least_force - rounding))


def _spring_impulse(base: Observed, normal: Array, rows: slice) -> float:
    """Return the impulse, N s, along a unit `normal` (N,), that the scene's spring and damper give in `rows`.

    J = sum of (K d + D max(-v_n, 0)) dt by the depths d in them, each held for a tick; K is the stiffest declared.

    A spring that is pressed by d0 when the contact counts begins at K d0 and not at zero, and one that turns the tool
    round within the window takes out more than m v_n.
    """
    _, stiffest = base.stiffness_range or (1.0, 1.0)
    depths = np.maximum((base.ihip[rows] - base.hip[rows]) @ normal, 0.0)
    inwards = np.maximum(-base.velocity[rows] @ normal, 0.0)
    return float(np.sum(stiffest * base.scene.stiffness * depths + base.scene.damping * inwards)) * base.dt


def _operator_impulses(recording: Observed, normal: Array) -> Array:
    """Return the operator's impulse along a unit `normal` (N,) in each tick, (n,), N s, outwards."""
    if "operator_force" not in recording.channels:
        return np.zeros(len(recording))
    return np.asarray(recording.channels["operator_force"] @ normal) * recording.dt


def operator_until_met(recording: Observed, impulses: Array, struck: int) -> tuple[float, float]:
    """Return the least and the largest impulse (N s, outwards) of the operator between sample `struck` and the contact.

    A rigid tool is met within the tick after it: before, the operator pushes as in the tick before, and as the change
    to that one goes on. What penetrates is met already.
    """
    if not np.array_equal(recording.ihip[struck], recording.hip[struck]):
        return 0.0, 0.0
    # The last two ticks give the push and its change; zero where it is met at once.
    last = impulses[max(struck - 2, 0) : struck]
    change = float(np.ptp(last))
    around = (float(last[-1]) - change, float(last[-1]) + change, 0.0)
    return min(around), max(around)


CHECK = Check(
    id="impulsive-collision",
    phenomenon="Impulsive Collision Force",
    formula="p_post - p_pre = -(1 + c_r) m (v . n_e) n_e  (3.5), and (3.6) with the sign and factor of (3.5)",
    citation="thesis 3.2.2, (3.5)-(3.7)",
    channels=("hip", "ihip", "force", "velocity"),
    reads_also=("operator_force",),
    not_for={Situation.PLAYBACK: "a hand led along a given path has no momentum to lose"},
    needs_loop=True,
    metric="share of the impulse of (3.5) missing after four ticks",
    unit="",
    judge=judge,
)
