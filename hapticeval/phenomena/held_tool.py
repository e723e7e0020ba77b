"""Where a rigid tool goes that follows the hand outside of the solid: the witness of whether a contact may end.

The tool flies straight to the hand. A surface that bars its way holds it: there it slides downhill in distance to the
hand, until it rests at a local minimum or its way is open.
"""

from __future__ import annotations

from dataclasses import dataclass

from hapticeval.geometry.boundary import Boundary, apart
from hapticeval.types import Array

FLIGHTS = 16
"""Ways within one tick, each from where the slide before has ended; each brings the tool nearer to the hand."""


@dataclass(frozen=True, eq=False)
class HeldTool:
    """A rigid tool beside `boundary`, placed to `grain` (m): neither a notch nor a plate thinner than that is seen."""

    boundary: Boundary
    grain: float

    def follow(self, tool: Array, hand: Array) -> Array | None:
        """From `tool` (N,), outside or on the surface, to `hand` (N,): where it is held (N,), m, or None if nowhere."""
        rests = False
        for _ in range(FLIGHTS):
            barred = self.barred(tool, hand)
            if barred is None:
                return None
            if rests and apart(barred, tool) <= self.grain:
                break
            tool, rests = self.boundary.descend(barred, hand, step=self.grain), True
        return tool

    def barred(self, start: Array, end: Array) -> Array | None:
        """The surface point (N,) at which the straight way from `start` (N,) to `end` (N,) first goes inside, or None.

        A start on the surface, or inside by its rounding, is left where the next point of the way is outside.
        """
        return self.boundary.first_crossing(start, end, grain=self.grain)
