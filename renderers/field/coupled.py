"""Virtual coupling: the hand holds a simulated tool by a spring and a damper, and the tool meets the surface.

Colgate, J. E., Stanley, M. C., Brown, J. M. (1995): Issues in the haptic display of tool use, IROS 95.

With h, h' the hand and its velocity, x, v the tool's, m its mass, K and B the coupling, k and b the contact's spring
and damper, phi the signed distance of the tool and n the surface's normal at its nearest point:

1. m v' = K (h - x) + B (h' - v) + F_c
2. F_c = max(0, -k phi - b v . n) n where phi < 0, and zero elsewhere: it never pulls.
3. A tick is semi-implicit: springs as they were at its start, dampers at the new v, then x <- x + dt v.
4. F = K (x - h) + B (v - h') on the hand, and the IHIP is x.

K is the scene's stiffness and m its mass. B and b damp both springs critically: B = 2 (K m)^(1/2), b = 2 (k m)^(1/2).
The knob is k / K: the tool sinks in by K / (K + k) of the hand's depth.

Predicted from the equations, before any run:

- continuous contact: the tool moves on a continuous path, so it never jumps; but it lies inside by d K / (K + k) with
  no standoff that would say so, and fails for that. It also lags by 2 (m / K)^(1/2) = 20 ms, more than three ticks.
- contact kept: fails in free space, where the tool trails the hand by B / K times a change of speed and the hand feels
  m times the acceleration; also at thin plates, where the nearest face changes sides.
- contact normal force: fails in motion: the force has the tool's inertia and the coupling's lag in it, along the
  surface too.
- broken contact: fails. The tool swings past the edge, and the force dies out over 20 ms.
- abrupt switch: fails: the tool turns the corner with its lag.
- impulsive collision: fails. The tool's momentum is m v, and the hand gets it over 20 ms through the coupling.
- centripetal force: not asked along paths; the scene's constraint holds from both sides, and this one does not.
- force magnitude: fails by a factor, K k / (K + k) at rest is within it: 0.91 K; the damper's part in motion is not.
- memoryless: fails. A tool has a place and a velocity.
- passivity: passes. All parts are springs, dampers and a mass.

Measured on the suites `thesis` and `solids`, with k = 10 K:

- continuous contact: fails 42 of 42; on the shallow slide the tool lies 0.073 mm inside, at 15 mm 1.37 mm: the depth /
  11 as predicted.
- contact kept: 44 of 49 pass, for that the hand feels the tool in free space is left to contact normal force. It
  fails at the plate, 13 mm behind it at the end, and at tips of 30 and 60 degrees, whose thin end it is pushed out of.
- contact normal force: 3 of 39 pass. Where a path starts at its full speed the hand feels the tool's inertia, up to
  180 degrees off.
- broken contact, abrupt switch: fail, nine of nine and five of five; the star's tip is passed by 1.6 mm.
- impulsive collision: fails, 55 per cent of the impulse are missing after four ticks, less than of the other springs,
  93, since the contact's is ten times as stiff.
- centripetal force: wrong, the circle that only pushes asks it, and it fails: hand and tool weigh twice the scene's
  mass, and it leaves the circle. The held one is refused.
- force magnitude: fails 39 of 39, though at rest it is 0.91 K: the damper answers the start of a path with 20 times K.
- memoryless: fails four of four. Passivity: passes six of six, as predicted. A first version took the hand's place at
  the end of the tick and the tool's at its beginning, and gave 6 mJ at 1 ms.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.renderer import Response
from hapticeval.renderers.law_renderer import checked_hand
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.scene import Scene


class Coupled:
    """A point tool of the scene's mass on the scene's spring; `ratio` is k / K."""

    contact = False
    """After a step: whether the surface pushed the tool."""

    def __init__(self, scene: Scene, *, ratio: float) -> None:
        self.boundary, self.mass = scene.model.boundary, scene.mass
        self.stiffness, self.contact_stiffness = scene.stiffness, ratio * scene.stiffness
        self.damping, self.contact_damping = (
            2.0 * math.sqrt(stiffness * self.mass) for stiffness in (self.stiffness, self.contact_stiffness)
        )

    def reset(self, hip: Array) -> None:
        """Start a run with the tool at the hand `hip` (N,), m, or where that is inside, on the surface.

        It moves with the hand then: the first step, at the same time, says how fast.
        """
        hip = checked_hand(hip)
        near = self.boundary.closest_point(hip[np.newaxis])
        self._tool = near.foot[0] if near.distance[0] < 0.0 else hip
        self._velocity: Array | None = None
        self._hand = hip.copy()
        self.contact = False

    def step(self, hip: Array, velocity: Array, dt: float) -> Response:
        """One tick: `hip` (N,), m, its `velocity` (N,), m/s, and `dt`, s; IHIP (N,), m, and force (N,), N."""
        hip = checked_hand(hip)
        if self._velocity is None:  # no time has passed since the reset
            self._velocity = np.array(velocity, dtype=np.float64)
            return Response(self._tool, self.stiffness * (self._tool - hip))
        near = self.boundary.closest_point(self._tool[np.newaxis])
        phi, normal = float(near.distance[0]), near.normal[0]
        pull = self.stiffness * (self._hand - self._tool) + self.damping * velocity
        self._hand = hip.copy()
        # step 3, (m + dt B) v+ = m v + dt (K (h - x) + B h'), without contact
        inertia = self.mass + dt * self.damping
        moved = (self.mass * self._velocity + dt * pull) / inertia
        self.contact = False
        if phi < 0.0:
            # step 2 with b at the new v: v+ = moved + dt f n / inertia, f = -k phi - b v+ . n
            across = float(normal @ moved)
            push = (-self.contact_stiffness * phi - self.contact_damping * across) / (
                1.0 + dt * self.contact_damping / inertia
            )
            if push > 0.0:
                self.contact = True
                moved = moved + dt * push / inertia * normal
        self._velocity = moved
        self._tool = self._tool + dt * moved
        force = self.stiffness * (self._tool - hip) + self.damping * (moved - velocity)
        return Response(self._tool, force)
