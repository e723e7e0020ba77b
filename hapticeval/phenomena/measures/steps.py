"""Steps of the IHIP: how far it moves from sample to sample in contact, and how far it may.

A step may be as long as the hand has lately moved in so many ticks, and the standoff. It may be longer where it is

- a flight: a rigid tool without mass that is let go at an edge is at the hand at once, or at the next face in between.
  Its contact point is then on another face one sample later, and the contact has ended in between: no pop-through,
  which leads through the solid, and no slide, which stays in contact;
- one that a tool takes which slides on the edges or triangles that the renderer was given.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.geometry.boundary import Boundary, distance_between
from hapticeval.phenomena.decisions import DESCENT_SHARE, DETOUR_BOUNDS, FLIGHT_BOUNDS, LAG_TICKS
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_row
from hapticeval.types import Array


def step_bounds(recording: Observed, ticks: float, standoff: float) -> Array:
    """Return how far the IHIP may move to each sample, (n,), m: recent steps of so many `ticks`, and the standoff.

    Not less than rounding, which moves it where the hand rests.
    """
    return np.asarray(np.maximum(ticks * recording.recent_steps, recording.rounding) + standoff)


def allow_flights(recording: Observed, bounds: Array) -> Array:
    """Return `bounds` (n,), m, of the steps to each sample, raised where a step beyond its bound is a flight.

    From the worst one on, up to the first that is none: that one decides, whatever the shorter ones are.
    """
    steps, raised = recording.contact_steps, bounds.copy()
    suspects = np.flatnonzero(steps > bounds)
    for tick in suspects[np.argsort((bounds - steps)[suspects])].tolist():
        if not _is_flight(recording, recording.boundary, tick, float(bounds[tick])):
            break
        raised[tick] = steps[tick]
    return raised


def _is_flight(recording: Observed, boundary: Boundary, tick: int, bound: float) -> bool:
    """Return whether a tool near the last IHIP is let go and meets the surface where the IHIP of `tick` is.

    Near is within `bound` (m), off the surface by as much; it flies straight to where the hand is, or was up to three
    ticks ago. A face that it is pressed on bars its way at once.
    """
    before, now = recording.ihip[tick - 1], recording.ihip[tick]
    near = DETOUR_BOUNDS * bound
    # Of a shorter step both ends are near one place.
    if distance_between(before, now) <= FLIGHT_BOUNDS * bound:
        return False
    # Through the solid no tool flies, and most jumps lead there.
    if boundary.signed_distance(0.5 * (before + now)[np.newaxis])[0] < -bound:
        return False
    around = boundary.closest_point(np.vstack([before, boundary.around(before, bound)]))
    for hip in recording.hip[max(tick - LAG_TICKS, 0) : tick + 1]:
        for start in around.foot + bound * around.normal:
            met = boundary.first_crossing(start, hip, grain=DESCENT_SHARE * bound)
            if met is not None and distance_between(met, now) <= near < distance_between(met, before):
                return True
    return False


def bounds_with_flights(recording: Observed, ticks: float, standoff: float) -> Array:
    """Return the `step_bounds` (n,), m, and of a flight its length, wherever it ends."""
    return allow_flights(recording, step_bounds(recording, ticks, standoff))


def with_steps_of_pieces(base: Observed, bounds: Array, pieces: Boundary) -> Array:
    """Return `bounds` (n,), m, raised where a step is one that a tool takes which slides on the given pieces.

    Under a convex edge that turns by b, a hand at depth d makes a tool jump by d sin b, from the edge to where the next
    piece is nearest.

    The renderer's step may end anywhere on the way from its last IHIP to where such a tool gets to, for a hand up to
    three ticks old: off that way by as much as any step may be long, there and back.
    """
    steps, raised = base.contact_steps, bounds.copy()
    for tick in np.flatnonzero(steps > bounds):
        before, now = base.ihip[tick - 1], base.ihip[tick]
        # A late renderer slides to a hand of up to three ticks ago.
        for hip in base.hip[max(int(tick) - LAG_TICKS, 0) : tick + 1]:
            slid = pieces.descend(before, hip, step=DESCENT_SHARE * float(bounds[tick]))
            # |before now| + |now slid| - |before slid|: 0 on the straight way from the last IHIP to the slid tool.
            detour = steps[tick] + distance_between(now, slid) - distance_between(before, slid)
            if detour <= DETOUR_BOUNDS * bounds[tick]:
                raised[tick] = steps[tick]
                break
    return raised


def worst_step(recording: Observed, bounds: Array) -> tuple[float, int]:
    """Return the step in contact that is farthest above its bound of `bounds` (n,), m, and the tick at its end.

    Where no step is above, the longest one; 0 m at tick 0 where no two samples in a row are in contact.
    """
    steps = recording.contact_steps
    # How far above its bound; where there is no step in contact there is nothing to be above.
    above = np.where(steps > 0.0, steps - bounds, -math.inf)
    tick = worst_row(above)
    return (float(steps[tick]), tick) if above[tick] > 0.0 else largest_jump(recording)


def largest_jump(recording: Observed) -> tuple[float, int]:
    """Return the largest IHIP step between two samples in contact, m, and the tick at its end (0 if there is none)."""
    contact = recording.holding
    if not (contact[1:] & contact[:-1]).any():
        return 0.0, 0
    steps = recording.contact_steps
    tick = worst_row(steps[1:]) + 1
    return float(steps[tick]), tick
