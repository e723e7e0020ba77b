"""The work of friction (4.3.3): the hand gets no energy, and puts in over a lap what the law of the friction takes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hapticeval.effects.catalogue import FRICTION, LUGRE, VISCOUS_FRICTION
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.decisions import BRISTLE_PARTS, LAP_WORK, SLIP_WORK, STEEPER_THAN_SPRING
from hapticeval.phenomena.measures.closed_paths import contact_spans, later_laps
from hapticeval.phenomena.measures.friction_check import FRICTIONS, HAND, check_of_friction
from hapticeval.phenomena.measures.lugre_force import lugre_force
from hapticeval.phenomena.measures.surface_force import SurfaceForce, along_surface, viscous_coefficient
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_of, worst_row
from hapticeval.phenomena.verdict import Finding, compared, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array


def judge_energy(runs: Runs, surface_force: SurfaceForce, scene: Scene) -> Finding:
    """Compare the work that the hand gets since free space with what holding the force may give."""
    base = runs.observed(scene)
    free = ~base.contact
    # Each begins with the last free row before a contact: there nothing is stored.
    spans = contact_spans(free)
    if not spans:
        return undecided("the hand never comes from free space: what is stored is not known")
    moved = np.diff(base.hip, axis=0)
    length = np.linalg.norm(moved, axis=1)
    damping = scene.damping + viscous_coefficient(scene)
    # Across the surface a law may be steeper than the scene's spring: of any that grows with the depth a force that is
    # held gives no more than its change times the way.
    across = np.max(
        [
            np.abs(np.sum(moved * unit_normals, axis=1))
            for unit_normals in (surface_force.unit_normals[:-1], surface_force.unit_normals[1:])
        ],
        axis=0,
    )
    change = np.abs(np.diff(surface_force.normal_force))
    steep = np.where(change > STEEPER_THAN_SPRING * scene.stiffness * across, change * across, 0.0)
    length_before = np.concatenate([[0.0], length[:-1]])
    strength = np.linalg.norm(base.force[:-1], axis=1)
    # K |dx|^2 / 2 for a spring held over a tick, and B |dx| |dx before| / dt for a damper
    allowed = 0.5 * scene.stiffness * length**2 + steep + damping / base.dt * length * length_before
    allowed += base.rounding_floor(strength, scene.stiffness) * length
    # F . dx of a force that is held from row to row, J
    gained = np.sum(base.force[:-1] * moved, axis=1)
    worst, gain, granted = None, 0.0, 0.0
    for begin, stop in spans:
        work, bound = np.cumsum(gained[begin:stop]), np.cumsum(allowed[begin:stop])
        # The tick up to which the hand has got most beyond what is granted.
        row = worst_row(work - bound)
        if worst is None or work[row] - bound[row] > gain - granted:
            worst = begin, begin + row + 1
            gain, granted = float(work[row]), float(bound[row])
    assert worst is not None
    span = f"from t = {base.time[worst[0]]:.4g} s to {base.time[worst[1]]:.4g} s"
    what = f"{1e3 * gain:.4g} mJ {span}, where holding the force for a tick may give {1e3 * granted:.4g} mJ"
    return compared(
        FRICTION_ENERGY.measured(gain),
        granted,
        {**base.evidence_at(worst[1]), "from_time": float(base.time[worst[0]])},
        passes=f"the hand gets no more than a held spring gives: {what}",
        fails=f"gives energy away: the hand gets {what}",
    )


FRICTION_ENERGY = check_of_friction(
    judge_energy,
    on_time=(HAND,),
    id="friction-energy",
    phenomenon="none of the six: friction takes energy, and gives none",
    formula="sum of F . dx <= K sum of |dx|^2 / 2 since free space, at every tick",
    citation="thesis 2.6, 4.3.3",
    metric="work that the hand has got since free space",
    unit="J",
    effects=(FRICTION, VISCOUS_FRICTION),
)


class _LapWork(NamedTuple):
    """The hand's `work` over the rows [start, stop] of a lap and that of the law, J: off by a share of `law_work`."""

    deviation: float
    allowed: float
    work: float
    law_work: float
    start: int
    stop: int


def judge_work(runs: Runs, surface_force: SurfaceForce, scene: Scene) -> Finding:
    """Compare the hand's work over each lap after the first with the work of the friction's law."""
    base = runs.observed(scene)
    spans = [
        (start, stop)
        for start, stop in later_laps(base.hip, scene.model.size)
        if surface_force.pressed[start : stop + 1].all()
    ]
    if not spans:
        return undecided("the hand goes round no closed lap twice in contact")
    moved = np.diff(base.hip, axis=0)
    # Work of the hand by the trapezoid: -F . dx
    mean = 0.5 * (base.force[1:] + base.force[:-1])
    put_in = -np.sum(mean * moved, axis=1)
    dissipated, doubt = dissipated_work(base, surface_force, moved)
    stored = stored_energy(base, surface_force)
    lap_works = []
    for start, stop in spans:
        law_work = float(dissipated[start:stop].sum())
        work = float(put_in[start:stop].sum() - (stored[stop] - stored[start]))
        # A lap in which nothing slips takes nothing, and has no share to be off by.
        if law_work >= SLIP_WORK:
            allowed = LAP_WORK + abs(float(doubt[start:stop].sum())) / law_work
            lap_works.append(_LapWork(abs(work - law_work) / law_work, allowed, work, law_work, start, stop))
    if not lap_works:
        return undecided("the tool does not slip in any closed lap")
    worst = worst_of(lap_works, lambda lap_work: lap_work.deviation - lap_work.allowed)
    what = (
        f"{1e3 * worst.work:.5g} mJ in a lap from t = {base.time[worst.start]:.4g} s to {base.time[worst.stop]:.4g} s, "
        f"where the friction takes {1e3 * worst.law_work:.5g} mJ"
    )
    return compared(
        FRICTION_WORK.measured(worst.deviation),
        worst.allowed,
        {
            **base.evidence_at(worst.stop),
            "from_time": float(base.time[worst.start]),
            "work_J": worst.work,
            "law_J": worst.law_work,
            "laps": len(lap_works),
        },
        passes=f"the hand puts in what the friction takes: {what}",
        fails=f"the hand does not put in what the friction takes: {what}",
    )


def dissipated_work(base: Observed, surface_force: SurfaceForce, moved: Array) -> tuple[Array, Array]:
    """Return the work that the laws take over each step `moved` (n, N), m, and its doubt: (n,) each, J."""
    scene = base.scene
    dissipated = np.zeros(len(moved))
    # What rounding, and a lag between two ticks, leave open of the force, over the way of tool and hand.
    travelled = np.linalg.norm(np.diff(base.ihip, axis=0), axis=1) + np.linalg.norm(moved, axis=1)
    doubt = surface_force.rounding[1:] * travelled
    friction, lugre = scene.effect(FRICTION), scene.effect(LUGRE)
    if friction is not None:
        slip = np.diff(base.ihip, axis=0)
        unit_normals, normal_force = surface_force.unit_normals[1:], surface_force.normal_force[1:]
        across = np.sum(slip * unit_normals, axis=1)
        along = np.linalg.norm(along_surface(slip, unit_normals), axis=1)
        # The law's force after the slip, times the slip: mu_k F_n |ds|, and F_n times what the foot moves across
        dissipated += normal_force * (friction.mu_k * along - across)
        # A law that is not the scene's spring: its difference does work on the slip, too.
        dissipated -= np.sum((scene.stiffness * (base.ihip - base.hip) - base.force)[1:] * slip, axis=1)
        # K ds . (ds - dx) / 2: the spring relaxes by ds while the hand moves on by dx.
        dissipated += 0.5 * scene.stiffness * np.sum(slip * (slip - moved), axis=1)
    # b v . dx, with the mean speed of the step
    dissipated += (
        0.5
        * viscous_coefficient(scene)
        * np.sum((surface_force.velocity[1:] + surface_force.velocity[:-1]) * moved, axis=1)
    )
    if lugre is not None:
        stepped, straight = (lugre_force(lugre, surface_force, base.dt, parts) for parts in (1, BRISTLE_PARTS))
        stepped_work, straight_work = (
            0.5 * np.sum((force[1:] + force[:-1]) * moved, axis=1) for force in (stepped, straight)
        )
        dissipated += straight_work
        doubt += straight_work - stepped_work
    return dissipated, doubt


def stored_energy(base: Observed, surface_force: SurfaceForce) -> Array:
    """Return the elastic energy of the spring between tool and hand at each tick, F^2 / (2 K): (n,), J."""
    scene = base.scene
    if scene.effect(FRICTION) is None:
        return np.zeros(len(base))
    # Of F_t the spring's: viscous friction takes, and stores nothing.
    pull = surface_force.tangential_force + viscous_coefficient(scene) * surface_force.velocity
    return np.asarray((surface_force.normal_force**2 + np.sum(pull**2, axis=1)) / (2.0 * scene.stiffness))


FRICTION_WORK = check_of_friction(
    judge_work,
    on_time=(HAND, (*HAND, "ihip"), (*HAND, "force")),
    damped=False,
    id="friction-work",
    phenomenon="none of the six: friction, thesis 4.3.3",
    formula="-sum of F . dx = sum of mu_k F_n |ds| + K ds.(ds - dx) / 2 over a lap; b v_t . dx; or that of LuGre's F_t",
    citation="thesis (4.20)",
    metric="work of the hand less that of the friction's law, as a share of it",
    effects=FRICTIONS,
)

CHECKS = (FRICTION_ENERGY, FRICTION_WORK)
