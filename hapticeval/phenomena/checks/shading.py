"""Force shading (4.15): the force keeps its magnitude, turns without a jump, and gives the work of its closed form."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from hapticeval.effects.catalogue import SHADING
from hapticeval.phenomena.check import Check, Runs, not_alone, required, without_ihip
from hapticeval.phenomena.decisions import LAG_TICKS, OTHER_WEIGHTS, TELLING_SHARE
from hapticeval.phenomena.lag import beside_straight, largest_in_lag
from hapticeval.phenomena.measures.closed_paths import later_laps, running_sums
from hapticeval.phenomena.measures.effect_law import EffectLaw
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import unit_vectors, worst_row
from hapticeval.phenomena.verdict import Finding, compared, undecided
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


class ExpectedShading(NamedTuple):
    """What a recording is held against, tick by tick: the force (n, N), N, without shading, and that force shaded.

    `contact` (n,) is where both the recorded force and that without shading are above the floor; `rounding` (n,), N, is
    what single precision leaves open of a force, and a lag between ticks.
    """

    plain: Array
    force: Array
    contact: BoolArray
    rounding: Array


def expect_shading(runs: Runs, scene: Scene) -> ExpectedShading | Finding:
    """Return what the recorded force is held against, or why there is nothing."""
    base = runs.observed(scene)
    reason = not_alone(scene, SHADING, because="whose force is not turned")
    if reason is not None:
        return reason
    if base.lacks_ihip:
        return without_ihip(base)
    plain = Observed(required(runs.without)(SHADING), scene)
    contact = base.pressed & plain.pressed
    if not contact.any():
        return undecided("no force above the floor: the tool never presses on the surface")
    law = EffectLaw(scene.effect(SHADING), base, plain)
    lags = law.find_lags("force")
    force = law.answers(lags).force
    rounding = base.rounding_floor(np.maximum(base.force_size, plain.force_size), scene.stiffness)
    if any(lags):
        # At the ends a late answer is not known.
        contact[:LAG_TICKS] = contact[len(contact) - LAG_TICKS :] = False
    if law.between_ticks(lags):
        rounding = rounding + beside_straight(plain.force) + beside_straight(force)
    return ExpectedShading(plain.force, force, contact, rounding)


def angles(first: Array, second: Array) -> Array:
    """Return the angles (n,), rad, between vectors `first` and `second` (n, N).

    A right angle where one is zero, and zero where both are.
    """
    unit, other = unit_vectors(first), unit_vectors(second)
    # 2 atan2(|u - v|, |u + v|): exact for small angles, where acos is not.
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(unit - other, axis=1), np.linalg.norm(unit + other, axis=1)))


def judge_direction(runs: Runs, scene: Scene) -> Finding:
    """Compare how far the force turns from each tick to the next with how far the shaded normal does."""
    expected = expect_shading(runs, scene)
    if isinstance(expected, Finding):
        return expected
    base = runs.observed(scene)
    pressed = expected.contact[1:] & expected.contact[:-1]
    if not pressed.any():
        return undecided("no two ticks of contact in a row")
    # Turns from tick to tick, rad: as recorded, of the facets' normals, and of the shaded ones.
    turn, flat, smooth = (angles(force[1:], force[:-1]) for force in (base.force, expected.plain, expected.force))
    # Rounding of a force over its size is what it may turn by.
    open_ = np.divide(expected.rounding, base.force_size, where=expected.contact, out=np.zeros(len(base)))
    allowed = OTHER_WEIGHTS * largest_in_lag(np.where(pressed, smooth, 0.0)) + open_[1:] + open_[:-1]
    # Only where an unshaded force would turn by more does shading show.
    shows = pressed & (flat > allowed)
    if not shows.any():
        message = "the tool crosses no edge at which an unshaded force would turn farther: nothing to be smoothed"
        return undecided(message)
    excess = np.where(pressed, turn - allowed, -np.inf)
    worst = worst_row(excess if excess.max() > 0.0 else np.where(pressed, turn, -np.inf))
    evidence = {
        **base.evidence_at(worst + 1),
        "turns_without_rad": float(flat[pressed].max()),
        "edges_crossed": int(np.count_nonzero(shows)),
    }
    return compared(
        SHADING_DIRECTION.measured(turn[worst]),
        float(allowed[worst]),
        evidence,
        passes=(
            f"turns by {_degrees(turn[pressed].max())} between two ticks at the most, where it would by "
            f"{_degrees(flat[pressed].max())} without shading"
        ),
        fails=(
            f"the force jumps: it turns by {_degrees(turn[worst])} in the tick before t = {base.time[worst + 1]:.4g} "
            f"s, and shaded normals there by no more than {_degrees(allowed[worst])}"
        ),
    )


def _degrees(angle: float) -> str:
    return f"{np.degrees(angle):.3g} degrees"


def judge_magnitude(runs: Runs, scene: Scene) -> Finding:
    """Compare the force's magnitude with that without shading, at every tick."""
    expected = expect_shading(runs, scene)
    if isinstance(expected, Finding):
        return expected
    base = runs.observed(scene)
    size, plain = (np.linalg.norm(force, axis=1) for force in (base.force, expected.plain))
    difference = np.abs(size - plain)
    # Forces under the floor have no share to be told.
    share = difference / np.maximum(plain, base.force_floor)
    allowed = expected.rounding / np.maximum(plain, base.force_floor)
    clear = allowed <= TELLING_SHARE
    if not (clear & expected.contact).any():
        return undecided("rounding may make a tenth of the force throughout: its size cannot be measured")
    # In contact, and where a force is added without one.
    judged = clear & (expected.contact | (difference > base.force_floor))
    worst = worst_row(np.where(judged, share - allowed, -np.inf))
    evidence = {**base.evidence_at(worst), "force_N": float(size[worst]), "without_N": float(plain[worst])}
    return compared(
        SHADING_MAGNITUDE.measured(share[worst]),
        float(allowed[worst]),
        evidence,
        passes="the force is as large as without shading",
        fails=(
            f"the force is {size[worst]:.4g} N at t = {base.time[worst]:.4g} s, and {plain[worst]:.4g} "
            "N without shading: its normals are not of unit length"
        ),
    )


def judge_work(runs: Runs, scene: Scene) -> Finding:
    """Compare the work that shading adds once round a loop with that of interpolated unit normals."""
    reference = expect_shading(runs, scene)
    if isinstance(reference, Finding):
        return reference
    base = runs.observed(scene)
    loops = [rows for rows in later_laps(base.hip, scene.model.size) if reference.contact[slice(*rows)].any()]
    if not loops:
        return undecided("the hand goes round no closed loop twice: the work of a loop cannot be measured")
    # Running work of the recorded force, of the shaded one, and of the unshaded one.
    sums = [_running_work(base, force) for force in (base.force, reference.force, reference.plain)]
    measured, expected, plain = (
        np.array([sums_of_force[last] - sums_of_force[first] for first, last in loops]) for sums_of_force in sums
    )
    length = np.linalg.norm(np.diff(base.hip, axis=0), axis=1)
    rounding = running_sums(0.5 * (reference.rounding[1:] + reference.rounding[:-1]) * length)
    allowed = np.array([rounding[last] - rounding[first] for first, last in loops])
    difference = np.abs(measured - expected)
    worst, most_active = worst_row(difference - allowed), worst_row(np.abs(measured - plain))
    # What shading gives round the loop: by its closed form it need not be zero.
    added = float((measured - plain)[most_active])
    evidence = {
        **base.evidence_at(loops[worst][1]),
        "from_time": float(base.time[loops[worst][0]]),
        "work_J": float(measured[worst]),
        "work_of_unit_normals_J": float(expected[worst]),
        "shading_adds_J": added,
        "loops": len(loops),
    }
    where = f"round the loop that ends at t = {base.time[loops[worst][1]]:.4g} s"
    return compared(
        SHADING_WORK.measured(difference[worst]),
        float(allowed[worst]),
        evidence,
        passes=(
            f"shading is not passive: once round this loop it gives the hand {1e3 * abs(added):.4g} mJ, or takes as "
            "much the other way round"
            if abs(added) > float(allowed[most_active])
            else "shading does no work round this loop"
        ),
        fails=(
            f"{where} the hand gets {1e3 * measured[worst]:.4g} mJ, and shaded by unit normals it would "
            f"{1e3 * expected[worst]:.4g} mJ"
        ),
    )


def _running_work(base: Observed, force: Array) -> Array:
    """Return the work (n,), J, that a force (n, N), N, gives to the hand up to each tick, by the trapezoid."""
    return running_sums(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(base.hip, axis=0), axis=1))


check_of_shading = partial(
    Check,
    channels=("hip", "ihip", "force"),
    siblings={"without": "the same path in the scene without shading"},
    needs={
        "without": undecided("the force without shading is not known: the hand is not led along a path that we give")
    },
    effects=(SHADING,),
)
SHADING_DIRECTION = check_of_shading(
    id="shading-direction",
    phenomenon="none of the six: force shading, thesis 4.3.1",
    formula="angle(F[i], F[i+1]) <= 2 max over i +- 3 of angle(n_e[j], n_e[j+1]), n_e = unit(sum of a_i n_i)",
    citation="thesis (4.15)",
    metric="turn of the force from a tick to the next",
    unit="rad",
    judge=judge_direction,
)
SHADING_MAGNITUDE = check_of_shading(
    id="shading-magnitude",
    phenomenon="none of the six: force shading, thesis 4.3.1",
    formula="|F| = |F without shading| at every tick: |n_e| = 1",
    citation="thesis (4.15), renormalised",
    metric="force less that without shading, as a share of it",
    unit="",
    judge=judge_magnitude,
)
SHADING_WORK = check_of_shading(
    id="shading-work",
    phenomenon="none of the six: what force shading gives to the hand, thesis 4.3.1",
    formula="W = sum of F.dx once round = K (d2 - d1)(L/2) tan(theta/2) - K/2 (d2^2 - d1^2)(1 - cos theta), by path",
    citation="thesis 4.3.1, (4.15)",
    metric="work once round a loop less that of interpolated unit normals",
    unit="J",
    judge=judge_work,
)
CHECKS = (SHADING_DIRECTION, SHADING_MAGNITUDE, SHADING_WORK)
"""The checks of this module."""
