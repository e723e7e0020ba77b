"""The constraint projection (4.3): the tool slides on the surface after the hand, and never passes through it.

Zilles and Salisbury's god-object, or proxy. In free space a straight motion of the hand that goes inside starts the
contact where it does. In contact the tool slides downhill in distance, over as many pieces as one tick needs, rests in
concave corners, and is released where the hand is outside the half-plane of the face that it is on, or, at a convex
corner, of the next one: without that test a tool would walk round a 60 degree tip. A released tool flies straight to
the hand, and what it runs into on the way is a new contact.
"""

from __future__ import annotations

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.renderers.outline import LEAVES, Boundary, Outline, at, entered, frame, nearest_on, slide
from hapticeval.renderers.projection import Projected
from hapticeval.types import Array, BoolArray

TOUCHES, PIECE, AT, HIP_X, HIP_Y = range(5)
FLIGHTS = 64
"""Releases within one tick after which the side of the hand decides; each brings the tool closer to it."""


class ConstraintProjection:
    """The constraint projection on a polygon or a curve.

    A run that starts with the hand inside starts in contact at the nearest surface point. With `bilateral` the tool
    is never released: it follows the same local minimum of the distance with the hand on either side.
    """

    def __init__(self, outline: Outline, *, bilateral: bool) -> None:
        self.surface = outline.surface
        self.resolution = outline.resolution
        self.standoff = outline.standoff
        self._boundary = outline.boundary
        self._bilateral = bilateral
        self._memory = np.zeros(5)

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (2,), m."""
        x, y = float(hip[0]), float(hip[1])
        piece, u, _, side = nearest_on(self._boundary, x, y)
        self._memory[:] = float(self._bilateral or side < 0.0), piece, u, x, y

    def project(self, hip: Array) -> Projected:
        """One tick, from the last IHIP, or from the last HIP in free space."""
        x, y = hip.tolist()
        return Projected(*_follow(self._boundary, self._memory, self._bilateral, x, y))

    def trace(self, hips: Array) -> tuple[Array, Array, BoolArray]:
        """A tick a row of `hips` (n, 2): IHIPs, normals and contact."""
        return _trace(self._boundary, self._memory, self._bilateral, hips)


@compiled
def _follow(
    b: Boundary, memory: Array, bilateral: bool, x: float, y: float
) -> tuple[tuple[float, float], tuple[float, float], bool]:
    touches, piece, u = memory[TOUCHES] != 0.0, int(memory[PIECE]), memory[AT]
    status = LEAVES
    if touches:
        status, piece, u = slide(b.pieces, b.joints, b.third, b.closed, not bilateral, piece, u, x, y)
    if status == LEAVES:
        touches, piece, u = _fly(b, touches, piece, u, memory[HIP_X], memory[HIP_Y], x, y)
    memory[TOUCHES], memory[PIECE], memory[AT] = 1.0 if touches else 0.0, piece, u
    memory[HIP_X], memory[HIP_Y] = x, y
    if not touches:
        return (x, y), (0.0, 0.0), False
    px, py, nx, ny = frame(b.pieces, b.joints, b.closed, piece, u, x, y)
    return (px, py), (nx, ny), True


@compiled
def _fly(
    b: Boundary, released: bool, piece: int, u: float, hip_x: float, hip_y: float, x: float, y: float
) -> tuple[bool, int, float]:
    """Straight to the hand at (x, y), from (piece, u) if `released` there, else from the last HIP.

    Whether the tool runs into something on the way, and the (piece, u) at which it then comes to rest.
    """
    x0, y0 = hip_x, hip_y
    for _flight in range(FLIGHTS):
        if released:
            x0, y0, _, _, _, _ = at(b.pieces, piece, u)
        touches, piece, u = entered(b, x0, y0, x, y, released)
        if not touches:
            return False, piece, u
        status, piece, u = slide(b.pieces, b.joints, b.third, b.closed, True, piece, u, x, y)
        if status != LEAVES:
            return True, piece, u
        released = True
    piece, u, _, side = nearest_on(b, x, y)
    return side < 0.0, piece, u


@compiled
def _trace(b: Boundary, memory: Array, bilateral: bool, hips: Array) -> tuple[Array, Array, BoolArray]:
    """`_follow` for each row, with the memory and the arrays of its common case held in local variables."""
    ihips, normals = np.empty_like(hips), np.empty_like(hips)
    contact = np.empty(hips.shape[0], np.bool_)
    pieces, joints, third, closed = b.pieces, b.joints, b.third, b.closed
    touches, piece, u = memory[TOUCHES] != 0.0, int(memory[PIECE]), memory[AT]
    hip_x, hip_y = memory[HIP_X], memory[HIP_Y]
    for i in range(hips.shape[0]):
        x, y = hips[i, 0], hips[i, 1]
        status = LEAVES
        if touches:
            status, piece, u = slide(pieces, joints, third, closed, not bilateral, piece, u, x, y)
        if status == LEAVES:
            touches, piece, u = _fly(b, touches, piece, u, hip_x, hip_y, x, y)
        hip_x, hip_y = x, y
        contact[i] = touches
        if touches:
            px, py, nx, ny = frame(pieces, joints, closed, piece, u, x, y)
            ihips[i, 0], ihips[i, 1], normals[i, 0], normals[i, 1] = px, py, nx, ny
        else:
            ihips[i, 0], ihips[i, 1], normals[i, 0], normals[i, 1] = x, y, 0.0, 0.0
    memory[TOUCHES], memory[PIECE], memory[AT] = 1.0 if touches else 0.0, piece, u
    memory[HIP_X], memory[HIP_Y] = hip_x, hip_y
    return ihips, normals, contact
