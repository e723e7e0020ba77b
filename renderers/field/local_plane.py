"""The local plane: a slow loop finds a plane that stands for the surface, and a fast loop pushes against that.

Adachi, Y., Kumano, T., Ogino, K. (1995): Intermediate representation for stiff virtual objects, VRAIS 95. With
recovery: Mark, W. R., Randolph, S. C., Finch, M., Van Verth, J. M., Taylor, R. M. (1996): Adding force feedback to
graphics systems: issues and solutions, SIGGRAPH 96.

With h the hand, K the stiffness, f_s the rate of the slow loop:

1. At times k / f_s, the slow loop: y is the nearest point of the surface to the hand, n the outward normal there.
2. At each tick, the fast loop: d = n . (y - h), and F = K max(0, d) n.
3. With recovery, a new plane that the hand is under begins where it keeps the size of the force, lowered or lifted by
   o_0 = max(0, d_old) - d_new, and goes to its place: d <- d_new + o, o' = -o / T.
4. IHIP = h + max(0, d) n.

Step 3 is written as a decay in time, so that it is the same at any sampling time.

Predicted from the equations, before any run:

- continuous contact: fails on curves and edges. In each 1 / f_s the hand goes v / f_s past the plane, and at the next
  plane the IHIP jumps by about kappa d v / f_s along and kappa (v / f_s)^2 / 2 across. With recovery the second part
  goes, and the first, a turn of the normal at the depth d, stays. On straight faces both pass.
- contact normal force: fails on curves: the normal is older than three ticks at any rate under 333 Hz.
- broken contact: fails. The plane reaches past the edge for up to 1 / f_s.
- abrupt switch: fails, but for luck: the hand goes on under the old plane for up to v / f_s, and the force then turns
  in one tick at the place of the nearest point's switch, which for a spring is the bisector. Passes if v / f_s is
  small against the depth.
- impulsive collision, centripetal force: fail, as for every spring.
- force magnitude: the force is K times the error exactly; but a plane seen from afar lies wrong by kappa (v / f_s)^2 /
  2.
- contact kept: fails where the hand goes in before there is a plane to meet it, and past edges, with a force in free
  space.
- passivity: fails where the planes are late: each is held, so that the work around a closed lap has the lag 1 / (2
  f_s).

Measured on the suites `thesis` and `solids`, at 30, 60 and 100 Hz, and then with recovery:

- continuous contact: 5, 9 and 11 of 42 pass. In the sweep 15 mm under a lobe the step is 0.73, 0.37 and 0.22 mm, in
  proportion to 1 / f_s as predicted; over edges it is 6 to 7 mm at any rate. Recovery passes no case more, and at 100
  Hz two fewer, 9: what it shifts lies off the surface.
- contact normal force: 17, 17 and 19 of 39; on the shallow slide 1.1, 0.47 and 0.21 degrees. With recovery the same.
- broken contact: none of nine, 1.4 to 17 mm from the edge: the planes are those of the nearest point.
- abrupt switch: wrong about luck, the star's notch passes at each rate: one plane's n turns at once. Four of five
  fail, on solids with 0.75 to 2.1 depths.
- impulsive collision: fails. Centripetal force: fails, and at 30 Hz with recovery is undecided.
- force magnitude: passes in all 39, F is K times the error whatever the plane.
- contact kept: mostly wrong, 48 of 49 pass. The plate is missed at 60 and 100 Hz, by 19 mm, and met at 30 Hz, where
  the old plane still stands when the hand is through; there the corner of three faces lets go, by 3.9 mm.
- passivity: wrong. A late normal points back, along the way that the hand has come, and brakes: all pass but the loop
  under the star's tip at 100 Hz, 0.025 mJ.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.renderer import Declaration, Response, Spring
from hapticeval.renderers.law_renderer import checked_hand
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.scene import Scene

RECOVERY = "recovery"
EARLY = 1e-6
"""Share of a tick by which sums of ticks fall short of a time by rounding."""


class LocalPlane:
    """Answers by the plane that the slow loop found last; `rate` is f_s (Hz), `recovery_time` T (s)."""

    declares = Declaration(spring=Spring.ERROR)

    def __init__(self, scene: Scene, *, regulation: str, rate: float, recovery_time: float) -> None:
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness
        self.rate = rate
        self.recovery_time = recovery_time if regulation == RECOVERY else 0.0

    def reset(self, hip: Array) -> None:
        """Start a run: the slow loop looks at the first hand `hip` (N,), m."""
        self._point, self._normal = self._plane(checked_hand(hip))
        self._since, self._offset = 0.0, 0.0
        self._first = True

    def _plane(self, hip: Array) -> tuple[Array, Array]:
        """Return the nearest point y (N,), m, and the outward unit normal n (N,) there: step 1."""
        near = self.boundary.closest_point(hip[np.newaxis])
        return near.foot[0], near.normal[0]

    def _above(self, hip: Array) -> float:
        """Return how far the plane lies above the hand, d = n . (y - h), m."""
        return float(self._normal @ (self._point - hip))

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:  # noqa: ARG002 - the protocol's
        """One tick: `hip` (N,), m, and `dt`, s; IHIP (N,), m, and force (N,), N."""
        hip = checked_hand(hip)
        if not self._first:  # the first tick is at the time of the reset
            self._since += dt
            self._offset *= math.exp(-dt / self.recovery_time) if self.recovery_time > 0.0 else 0.0
        self._first = False
        if self._since >= 1.0 / self.rate - EARLY * dt:
            self._since = math.fmod(self._since, 1.0 / self.rate)
            if self._since > 1.0 / self.rate - EARLY * dt:
                self._since = 0.0
            old = max(0.0, self._above(hip) + self._offset)
            self._point, self._normal = self._plane(hip)
            new = self._above(hip)
            # o_0 = max(0, d_old) - d_new at this hand; a plane that the hand is outside of lets go at once
            self._offset = old - new if self.recovery_time > 0.0 and new > 0.0 else 0.0
        depth = self._above(hip) + self._offset
        if depth <= 0.0:
            return Response(hip, np.zeros_like(hip))
        ihip = hip + depth * self._normal
        return Response(ihip, self.stiffness * (ihip - hip))
