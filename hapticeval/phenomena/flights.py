"""Flights: a rigid tool without mass that is let go at an edge is at the hand at once, or at the next face in between.

Its contact point is then on another face one sample later, and the contact has ended in between: no pop-through, which
leads through the solid, and no slide, which stays in contact.
"""

from __future__ import annotations

import numpy as np

from hapticeval.geometry.boundary import Boundary, distance_between
from hapticeval.phenomena.decisions import DESCENT_SHARE, DETOUR_BOUNDS, FLIGHT_BOUNDS, LAG_TICKS
from hapticeval.phenomena.jumps import contact_steps
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array


def allow_flights(recording: Recording, scene: Scene, bounds: Array) -> Array:
    """Return `bounds` (n,), m, of the steps to each sample, raised where a step beyond its bound is a flight.

    From the worst one on, up to the first that is none: that one decides, whatever the shorter ones are.
    """
    steps, raised = contact_steps(recording, scene), bounds.copy()
    beyond = np.flatnonzero(steps > bounds)
    for tick in beyond[np.argsort((bounds - steps)[beyond])].tolist():
        if not _is_flight(recording, scene.model.boundary, tick, float(bounds[tick])):
            break
        raised[tick] = steps[tick]
    return raised


def _is_flight(recording: Recording, boundary: Boundary, tick: int, bound: float) -> bool:
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
