"""What happens at corners (section 3.2.1): broken contact over a convex one, an abrupt switch in a concave one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.effects.catalogue import FRICTION
from hapticeval.geometry.boundary import Boundary, Corner
from hapticeval.phenomena.check import Check, Runs, Situation
from hapticeval.phenomena.sampling import (
    NO_IHIP,
    above_force_floor,
    evidence_at,
    hip_step,
    hip_steps,
    lacks_ihip,
    listed,
    mm,
    position_tolerance,
)
from hapticeval.phenomena.verdict import Finding, Metric, compared, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray

NEAR = 0.05
"""Share of the corner's turn within which a direction counts as a face's: far above rounding, far below a switch."""

HELD = 0.5
"""Share of the usual force on the first face below which the force is not kept any more."""


@dataclass(frozen=True)
class Crossing:
    """A corner with its faces in the order of travel.

    `normal_pre`, `normal_post` (2,): outward unit normals; `ahead` (2,): unit direction of travel along the first
    face; `turn` rad, unsigned. The recording is near the corner from tick `first` up to, not including, `end`, and no
    other corner is.
    """

    corner: Corner
    normal_pre: Array
    normal_post: Array
    ahead: Array
    turn: float
    first: int
    end: int


def find_crossing(recording: Recording, boundary: Boundary, strong: BoolArray, *, convex: bool) -> Crossing | None:
    """Find the corner of the wanted kind that the HIP comes closest to, and its stay there; None if there is none.

    Near means nearer than half of the way to the next corner. The face that the tool comes from is the one whose
    normal the first force above the floor has in that stay; None also if there is no force.
    """
    wanted = [corner for corner in boundary.corners if corner.convex == convex]
    if not wanted or not strong.any():
        return None
    distances = [np.linalg.norm(recording.hip - corner.position, axis=1) for corner in wanted]
    nearest = int(np.argmin([distance.min() for distance in distances]))
    corner, distance = wanted[nearest], distances[nearest]
    closest = int(np.argmin(distance))
    away = np.flatnonzero(distance > 0.5 * _to_next(boundary, corner))
    start = int(away[away < closest].max(initial=-1)) + 1
    end = int(away[away > closest].min(initial=len(recording)))
    pressed = np.flatnonzero(strong[start:end])
    if pressed.size == 0:
        return None
    first = start + int(pressed[0])
    pre, post = corner.normal_pre, corner.normal_post
    force, turn = recording.force[first : first + 1], abs(corner.turn)
    if angle_between(force, pre)[0] <= angle_between(force, post)[0]:
        return Crossing(corner, pre, post, corner.tangent_pre, turn, first, end)
    return Crossing(corner, post, pre, -corner.tangent_post, turn, first, end)


def _to_next(boundary: Boundary, corner: Corner) -> float:
    """Return the arc length from a corner to the nearest other one, m; once round where it is the only one."""
    gaps = [abs(other.s - corner.s) for other in boundary.corners if other is not corner]
    return min((min(gap, boundary.girth - gap) for gap in gaps), default=boundary.girth)


def angle_between(vectors: Array, direction: Array) -> Array:
    """Return the unsigned angle of each of `vectors` (n, 2) to `direction` (2,), rad; zero vectors give zero."""
    cross = vectors[:, 0] * direction[1] - vectors[:, 1] * direction[0]
    return np.asarray(np.abs(np.arctan2(cross, vectors @ direction)))


def judge_broken_contact(runs: Runs, scene: Scene) -> Finding:
    """Measure how far from the corner, before or after it, the force stops being what a rigid corner gives."""
    base = runs.base
    strong = above_force_floor(base, scene)
    crossing = find_crossing(base, scene.model.boundary, strong, convex=True)
    if crossing is None:
        return undecided("no force is felt near a convex corner")
    along = (base.hip - crossing.corner.position) @ crossing.ahead
    first, end = crossing.first, crossing.end
    past = np.flatnonzero(along[first:end] > 0.0)
    if along[first] >= 0.0 or past.size == 0:
        return undecided("the HIP does not travel from the first face past the corner")
    crossed = first + int(past[0])
    strength = np.linalg.norm(base.force, axis=1)
    usual = float(np.median(strength[first:crossed]))
    first_face = strong & (angle_between(base.force, crossing.normal_pre) <= NEAR * crossing.turn)
    early_ticks = first + np.flatnonzero(~(first_face & (strength >= HELD * usual))[first:crossed])
    early = -float(along[early_ticks[0]]) if early_ticks.size else 0.0
    after = strong[crossed:end]
    gone = int(np.argmax(~after)) if not after.all() else after.size
    # Past the corner no force may remain, and none may come back from the face that was left.
    wrong = first_face[crossed:end] | (np.arange(after.size) < gone)
    late = float(np.max(along[crossed:end], where=wrong, initial=0.0))
    too_early = early >= late
    tick = int(early_ticks[0]) if too_early and early_ticks.size else min(crossed + gone, len(base) - 1)
    return compared(
        Metric(BROKEN_CONTACT.metric, max(early, late), "m"),
        position_tolerance(base, scene),
        {
            **evidence_at(base, tick),
            "corner": listed(crossing.corner.position),
            "lost_before_corner_m": early,
            "remains_after_corner_m": late,
            "ticks_to_zero_after_corner": gone,
            "force_pre_N": usual,
        },
        passes=f"the force keeps n_pre to the corner and is zero {gone} tick(s) after it",
        fails=f"the force is lost, or leaves n_pre, {mm(early)} before the corner"
        if too_early
        else f"a force remains up to {mm(late)} past the corner",
    )


def judge_abrupt_switch(runs: Runs, scene: Scene) -> Finding:
    """Measure the HIP travel from where the force leaves n_pre for the first time to where it keeps to n_post."""
    base = runs.base
    if lacks_ihip(base, scene):
        return undecided(NO_IHIP)
    strong = above_force_floor(base, scene)
    crossing = find_crossing(base, scene.model.boundary, strong, convex=False)
    if crossing is None:
        return undecided("no force is felt near a concave corner")
    pressed = crossing.first + np.flatnonzero(strong[crossing.first : crossing.end])
    pre, post = (
        angle_between(base.force[pressed], normal) <= NEAR * crossing.turn
        for normal in (crossing.normal_pre, crossing.normal_post)
    )
    if not pre[0] or not post[-1]:
        return undecided("the force does not go from the first face's normal to the second's")
    left = int(pressed[np.argmin(pre) - 1])
    reached = int(pressed[post.size - int(np.argmin(post[::-1]))])
    takes = float(base.time[reached] - base.time[left])
    travel = float(np.sum(hip_steps(base)[left:reached]))
    depths = np.linalg.norm(base.hip - base.ihip, axis=1)
    depth = max(float(np.median(depths[pressed[pressed <= left]])), hip_step(base, scene))
    return compared(
        Metric(ABRUPT_SWITCH.metric, travel / depth, "depths"),
        position_tolerance(base, scene) / depth,
        {
            **evidence_at(base, reached),
            "corner": listed(crossing.corner.position),
            "switch_starts_s": float(base.time[left]),
            "switch_takes_s": takes,
            "travel_m": travel,
            "depth_m": depth,
            "turn_deg": float(np.degrees(crossing.turn)),
        },
        passes=f"the force switches within {mm(travel)} of HIP travel",
        fails=f"the force turns over {mm(travel)} of HIP travel ({travel / depth:.3g} depths, {takes:.3g} s): "
        "the corner is rounded",
    )


BROKEN_CONTACT = Check(
    id="broken-contact",
    phenomenon="Broken Contact",
    asks="Sliding over a convex corner: does the force keep its direction up to the corner and vanish there at once?",
    formula="F = |F| n_pre for (HIP - corner) . t_pre < 0, then F = 0",
    citation="thesis 3.2.1, Figure 3.4; Figures 6.10, 6.11",
    channels=("hip", "force"),
    reads_also=("ihip",),
    not_for={Situation.NO_CONVEX_CORNER: "the model has no convex corner"},
    not_with=(FRICTION,),
    metric="distance from the corner at which n_pre is lost or force remains",
    unit="m",
    bound=(
        "3 HIP steps + standoff: a sampled renderer learns of the corner at the next sample, may lag by three, and "
        "cannot know the corner better than its own surface does. A force within 5 per cent of the corner's turn, and "
        "of at least half the usual size on the first face, counts as kept; past the corner every force counts until "
        "the first zero, and every one along n_pre thereafter."
    ),
    judge=judge_broken_contact,
)

ABRUPT_SWITCH = Check(
    id="abrupt-switch",
    phenomenon="Abrupt Switch",
    asks="Sliding into a concave corner: does the force turn from one face's normal to the other's at one HIP?",
    formula="travel of the HIP while n_e turns from n_pre to n_post, in penetration depths; 0 for rigid contact",
    citation="thesis 3.2.1, Figure 3.5; Figures 6.6, 6.7, 6.9",
    channels=("hip", "ihip", "force"),
    not_for={Situation.NO_CONCAVE_CORNER: "the model has no concave corner"},
    not_with=(FRICTION,),
    metric="HIP travel of the switch in penetration depths",
    unit="depths",
    bound=(
        "(3 HIP steps + standoff) / depth: between two samples the turn cannot be seen, and a corner is known no "
        "better than the renderer's own surface. Resting on the corner while the HIP goes round it turns the force "
        "over an arc as long as the corner's turn (rad) times the depth, whatever the depth. The switch lasts from "
        "where the force first leaves n_pre, by more than 5 per cent of the turn, to where it is within 5 per cent of "
        "n_post for good."
    ),
    judge=judge_abrupt_switch,
)
