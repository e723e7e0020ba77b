"""Where a hand in free space feels a contact, whatever the renderer reports, and where a rigid tool is held.

A contact begins at or inside the surface, and ends when the tool's way to the hand is open. What is felt elsewhere is
no contact of the model.
"""

from __future__ import annotations

import numpy as np

from hapticeval.geometry.boundary import Boundary, distance_between
from hapticeval.phenomena.decisions import FINEST_GRAIN, LAG_TICKS, MOST_FLIGHTS
from hapticeval.phenomena.lag import largest_in_lag
from hapticeval.phenomena.measures.closed_paths import running_sums
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import lengths_of
from hapticeval.recordings.channels import SIMULATED
from hapticeval.recordings.recording import runs_of
from hapticeval.types import Array, BoolArray, IntArray


def follow(boundary: Boundary, tool: Array, hand: Array, grain: float) -> Array | None:
    """Return where a rigid tool that follows the hand is held, (N,), m; None where it gets to the hand.

    From `tool` (N,), outside or on the surface, it flies straight to `hand` (N,). A surface that bars its way holds it:
    there it slides downhill in distance to the hand, until it rests at a local minimum or its way is open.

    It is placed to `grain` (m): neither a notch nor a plate thinner than that is seen.
    """
    rests = False
    for _ in range(MOST_FLIGHTS):
        barred = boundary.first_crossing(tool, hand, grain=grain)
        if barred is None:
            return None
        # Barred where it rests already: a local minimum of the distance to the hand.
        if rests and distance_between(barred, tool) <= grain:
            break
        tool, rests = boundary.descend(barred, hand, step=grain), True
    return tool


def find_felt_in_free_space(base: Observed) -> BoolArray:
    """Return where a hand in free space feels a contact, (n,): a force above the floor, or an IHIP away from the hand.

    The hand is farther outside than three ticks of its way and what the surface may lie off, and

    - its contact has begun there, and it has not come to the surface since; or
    - the way from an IHIP at the surface to it is open, and was so for more than three ticks.

    A simulated tool is coupled to the hand by forces, and these are felt in free space, too: an IHIP clear of the
    surface that trails the hand on its own path, or whose contact is over, is that of such a tool, and was while it
    came off the surface.
    """
    pushed = base.pushed_in_free_space.copy()
    if base.scene.bilateral or not {"ihip", "force"} <= base.channels.keys():
        return pushed
    lag_distance = _way_in_lag(base)
    allowed = lag_distance + base.across_allowed
    # Outside by the hand as it is, and as a sensor gave it to the renderer.
    distance = np.minimum(base.distance, base.as_sensed.distance)
    felt = (base.pressed | base.contact) & base.apart
    # Within three ticks of the hand's way the tool is with the hand.
    rows = np.flatnonzero(felt & (distance > allowed) & (lengths_of(base.ihip - base.hip) > allowed))
    if rows.size == 0:
        return pushed
    clear = base.boundary.signed_distance(base.ihip[rows]) > allowed[rows]
    trails = _trails(base, rows, clear, allowed)
    outside, is_open, barred = (np.zeros(len(base), dtype=bool) for _ in range(3))
    outside[rows[~trails]] = True
    grain = FINEST_GRAIN * base.scene.model.size
    for tick in rows[~clear].tolist():
        is_open[tick] = _is_way_open(base, tick, float(allowed[tick] + base.resolution), grain)
        barred[tick] = not is_open[tick]
    # A simulated tool that comes off the surface while the hand is outside is on its way to it.
    away, off_surface = (np.zeros(len(base), dtype=bool) for _ in range(2))
    away[rows], off_surface[rows[clear]] = True, True
    for begin, end in runs_of(away):
        if off_surface[end - 1]:
            is_open[begin:end] = False
    # What is late outlasts a contact by three ticks, or is three ahead of one.
    settled = largest_in_lag((barred | (felt & (distance <= 0.0))).astype(float)) > 0.0
    return pushed | (is_open & ~settled) | _begun_outside(base, felt, outside, distance > allowed, grain)


def _way_in_lag(base: Observed) -> Array:
    """Return how far the hand goes in three ticks, before each or after it, whichever is farther: (n,), m."""
    along = running_sums(base.hip_steps)
    ticks = np.arange(along.size)
    before, after = np.maximum(ticks - LAG_TICKS, 0), np.minimum(ticks + LAG_TICKS, along.size - 1)
    return np.asarray(np.maximum(along - along[before], along[after] - along))


def _trails(base: Observed, rows: IntArray, clear: BoolArray, allowed: Array) -> BoolArray:
    """Return at which of `rows` (k,) the IHIP may be a free tool's, which the hand pulls along by a spring: (k,).

    Either it is `clear` (k,) of the surface, and where the hand has been in free space within a swing of the scene's
    mass on its spring, but for cut corners: within `allowed` (n,), m, or half of its distance from the hand. So far a
    tool that follows a path with a lag leaves it where the path turns round.

    Or its own inertia carries it: a hand that changes its velocity by dv is left by dv (m / K)^(1/2) at the most, and
    with the coupling's damper by next to nothing a swing later. What stays farther behind is held by something else.
    """
    # m x'' + K x = 0: the time in which its swing goes on by one radian, s
    radian = float(np.sqrt(base.scene.mass / base.scene.stiffness))
    # Sums of |dv|, m/s, from rest on: the run begins with a tool at rest, or with the hand.
    changes = np.diff(base.velocity, axis=0, prepend=np.zeros_like(base.velocity[:1]))
    velocity_changes = running_sums(lengths_of(changes))
    trails = np.zeros(rows.size, dtype=bool)
    for begin, end in runs_of(base.distance > 0.0):
        for row in np.flatnonzero((rows >= begin) & (rows < end)).tolist():
            tick = int(rows[row])
            since = int(np.searchsorted(base.time, base.time[tick] - 2.0 * np.pi * radian))
            from_path = np.linalg.norm(base.hip[max(begin, since) : tick + 1] - base.ihip[tick], axis=1)
            carried = radian * (velocity_changes[tick + 1] - velocity_changes[since])
            follows = clear[row] and from_path.min() <= max(allowed[tick], 0.5 * from_path[-1])
            trails[row] = follows or from_path[-1] <= carried
    return trails


def _is_way_open(base: Observed, tick: int, reach: float, grain: float) -> bool:
    """Return whether no solid bars the straight way to the hand from the IHIP of a tick, and all within `reach`, m."""
    boundary, tool, hand = base.boundary, base.ihip[tick], base.hip[tick]
    if boundary.signed_distance(tool[np.newaxis])[0] < 0.0:
        tool = boundary.closest_point(tool[np.newaxis]).foot[0]
    # A wall thinner than the grain holds a tool too: one of the faces at it is between it and the hand.
    is_at_surface = abs(boundary.signed_distance(tool[np.newaxis])[0]) <= base.rounding
    angle_outside = boundary.normal_cone(tool[np.newaxis], np.array([base.rounding]))
    held_at_surface = is_at_surface and angle_outside((tool - hand)[np.newaxis])[0] < 0.5 * np.pi
    if held_at_surface or boundary.first_crossing(tool, hand, grain=grain) is not None:
        return False
    return all(boundary.first_crossing(other, hand, grain=grain) is None for other in boundary.around(tool, reach))


def _begun_outside(base: Observed, felt: BoolArray, outside: BoolArray, clear: BoolArray, grain: float) -> BoolArray:
    """Return where a contact is felt, (n,), that has begun outside of the model, up to where the hand is at it.

    The hand is `clear` (n,) where it is farther from the model than it gets in three ticks.
    """
    begun = np.zeros(len(base), dtype=bool)
    for begin, end in runs_of(outside):
        # Back to where it began to be felt, but for gaps of three ticks.
        start = begin
        while start > 0 and felt[max(start - LAG_TICKS, 0) : start].any():
            start -= 1
        # One that was felt where the hand was at the model has begun there, and a recording of others may begin so.
        recorded_in_contact = start == 0 and base.meta.get("source") not in SIMULATED
        if recorded_in_contact or not clear[start:begin].all():
            continue
        for tick in range(begin, end):
            last = base.hip[max(tick - LAG_TICKS, 0)]
            if base.boundary.first_crossing(last, base.hip[tick], grain=grain) is not None:
                break
            begun[tick] = True
    return begun
