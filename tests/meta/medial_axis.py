"""Where a hand's path crosses the medial axis of a solid or a smooth surface, found by brute force.

Inside of a solid the nearest point is an orthogonal projection onto a face, a concave edge or a vertex, and goes over
continuously from each to its neighbours: it moves no farther than the hand, but where two features that are apart are
equally near. There it jumps by the distance between them, however finely the way is divided. The medial axis of a
sphere is its centre, of a torus the core circle, and of an ellipsoid with the axes a >= b > c a disc in the plane of
a and b. With x = X (1 - c^2 / a^2) and y = Y (1 - c^2 / b^2) the nearest points of (x, y, 0) are (X, Y, +-Z) on the
surface.

Nothing of the package's own closest points is used: every triangle is asked, and inside is what the triangles wind
round.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numba
import numpy as np

from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.surface import Surface
from hapticeval.types import Array, BoolArray

GRANTED_STEPS = 1.5
"""How many recent steps of the hand a contact point may move in a tick before it is looked at: half of three."""

LATE_TICKS = 3
"""Ticks by which an answer may be late: a step of the hand is recent for so long."""

OFF_CHORD = 2.5e-6
"""How far (m) a tick of 1 ms may lead off its chord, a dt^2 / 8 at 10 m/s^2, on both sides of a jump."""

ROUNDING = 1e-7
"""Jumps (m) up to this are none: a contact point moves by so much where the hand rests."""

FINEST_SHARE = 2.0**-24
"""Of a tick: where a jump is still there between places so near to each other, it stays."""


@dataclass(frozen=True)
class Crossing:
    """The worst jump of the nearest point on a path: its length, what is allowed there, both m, and its tick."""

    jump: float
    allowed: float
    tick: int

    @property
    def decided(self) -> bool:
        """Whether the chord of the hand's way within a tick tells which of the two is longer."""
        return self.jump == 0.0 or abs(self.jump - self.allowed) > OFF_CHORD


def allowed_jumps(hips: Array) -> Array:
    """Return how far, m, a contact point may move to each of `hips` (n, N): 1.5 times the recent step of the hand.

    That is the longest of the last four steps, or of an older one what e^(-1/3) in each tick beyond these leaves of it.
    """
    steps = np.linalg.norm(np.diff(hips, axis=0, prepend=hips[:1]), axis=1)
    allowed, fading = np.zeros(len(hips)), 0.0
    for tick in range(len(hips)):
        if tick >= LATE_TICKS:
            fading = max(fading * math.exp(-1.0 / LATE_TICKS), steps[tick - LATE_TICKS])
        allowed[tick] = GRANTED_STEPS * max(fading, steps[max(tick - LATE_TICKS, 0) : tick + 1].max())
    return allowed


def worst_crossing(boundary: Boundary, hips: Array) -> Crossing | None:
    """Return where the nearest point of a boundary jumps by the most of what is allowed on a path of `hips` (n, 3), m.

    None where no two places in a row are inside.
    """
    allowed = allowed_jumps(hips)
    if isinstance(boundary, Mesh):
        inside, jumps = _jumps_on_mesh(boundary, hips, allowed)
    else:
        assert isinstance(boundary, Surface)
        inside, jumps = _jumps_on_surface(boundary, hips)
    both = inside[1:] & inside[:-1]
    if not both.any():
        return None
    jumps[jumps <= ROUNDING] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = np.where(both & (jumps[1:] > 0.0), jumps[1:] / allowed[1:], 0.0)
    tick = int(np.argmax(excess)) + 1
    return Crossing(float(jumps[tick]), float(allowed[tick]), tick)


def _jumps_on_mesh(mesh: Mesh, hips: Array, allowed: Array) -> tuple[BoolArray, Array]:
    """Return which of `hips` (n, 3), m, are inside, and the largest jump, m, on the way to each: (n,) both."""
    corners = np.ascontiguousarray(mesh.vertices[mesh.triangles])
    feet, inside = _nearest_of_all(corners, np.ascontiguousarray(hips))
    moves = np.linalg.norm(np.diff(feet, axis=0, prepend=feet[:1]), axis=1)
    # Where the nearest points of a tick are no farther apart than they may be, nothing is asked.
    both, jumps = inside & np.roll(inside, 1), np.zeros(len(hips))
    for tick in (np.flatnonzero(both[1:] & (moves[1:] > allowed[1:])) + 1).tolist():
        jumps[tick] = _jump_that_stays(corners, (hips[tick - 1], hips[tick]), (feet[tick - 1], feet[tick]))
    return inside, jumps


def _jump_that_stays(corners: Array, hips: tuple[Array, Array], feet: tuple[Array, Array]) -> float:
    """Return the largest jump, m, that stays on the straight way between two `hips` (3,), m, with nearest `feet`."""
    largest, pending = 0.0, [(*hips, *feet, 1.0)]
    while pending:
        start, end, foot_at_start, foot_at_end, share = pending.pop()
        move, step = math.dist(foot_at_start, foot_at_end), math.dist(start, end)
        # No jump in it, or none that counts: the rest of the move is the hand's own step.
        if move <= max(step * (1.0 + 1e-6) + 1e-12, largest):
            continue
        if share <= FINEST_SHARE:
            largest = move
            continue
        middle = 0.5 * (start + end)
        foot = _nearest_of_all(corners, middle[np.newaxis])[0][0]
        pending += [(start, middle, foot_at_start, foot, 0.5 * share), (middle, end, foot, foot_at_end, 0.5 * share)]
    return largest


@numba.njit
def _dot(ax, ay, az, bx, by, bz):
    return ax * bx + ay * by + az * bz


@numba.njit
def _nearest_of_all(corners, points):
    """Return the nearest point (n, 3), m, of all triangles `corners` (t, 3, 3), and whether each of `points` is inside.

    The plane's point where it lies on the inner side of all three sides, else the nearest of the three sides. Inside is
    where the solid angles of all triangles (van Oosterom and Strackee) add up to 4 pi, and not to 0.
    """
    feet, inside = np.empty_like(points), np.empty(points.shape[0], np.bool_)
    for row in range(points.shape[0]):
        px, py, pz = points[row, 0], points[row, 1], points[row, 2]
        best, angle = np.inf, 0.0
        for k in range(corners.shape[0]):
            ax, ay, az = corners[k, 0, 0] - px, corners[k, 0, 1] - py, corners[k, 0, 2] - pz
            bx, by, bz = corners[k, 1, 0] - px, corners[k, 1, 1] - py, corners[k, 1, 2] - pz
            cx, cy, cz = corners[k, 2, 0] - px, corners[k, 2, 1] - py, corners[k, 2, 2] - pz
            nx = (by - ay) * (cz - az) - (bz - az) * (cy - ay)
            ny = (bz - az) * (cx - ax) - (bx - ax) * (cz - az)
            nz = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
            area = math.sqrt(_dot(nx, ny, nz, nx, ny, nz))
            nx, ny, nz = nx / area, ny / area, nz / area
            height = _dot(ax, ay, az, nx, ny, nz)
            # from the point to its foot in the plane
            fx, fy, fz = height * nx, height * ny, height * nz
            within = True
            for i in range(3):
                j = (i + 1) % 3
                sx, sy, sz = corners[k, i, 0] - px, corners[k, i, 1] - py, corners[k, i, 2] - pz
                wx, wy, wz = corners[k, j, 0] - px - sx, corners[k, j, 1] - py - sy, corners[k, j, 2] - pz - sz
                side = _dot(ny * wz - nz * wy, nz * wx - nx * wz, nx * wy - ny * wx, fx - sx, fy - sy, fz - sz)
                if side < 0.0:
                    within = False
                    share = -_dot(sx, sy, sz, wx, wy, wz) / _dot(wx, wy, wz, wx, wy, wz)
                    share = min(max(share, 0.0), 1.0)
                    ex, ey, ez = sx + share * wx, sy + share * wy, sz + share * wz
                    distance = math.sqrt(_dot(ex, ey, ez, ex, ey, ez))
                    if distance < best:
                        best = distance
                        feet[row, 0], feet[row, 1], feet[row, 2] = px + ex, py + ey, pz + ez
            if within and abs(height) < best:
                best = abs(height)
                feet[row, 0], feet[row, 1], feet[row, 2] = px + fx, py + fy, pz + fz
            la, lb, lc = (
                math.sqrt(_dot(ax, ay, az, ax, ay, az)),
                math.sqrt(_dot(bx, by, bz, bx, by, bz)),
                math.sqrt(_dot(cx, cy, cz, cx, cy, cz)),
            )
            below = (
                la * lb * lc
                + _dot(ax, ay, az, bx, by, bz) * lc
                + _dot(ax, ay, az, cx, cy, cz) * lb
                + _dot(bx, by, bz, cx, cy, cz) * la
            )
            angle += 2.0 * math.atan2(height * area, below)
        inside[row] = angle > 2.0 * math.pi
    return feet, inside


def _jumps_on_surface(surface: Surface, hips: Array) -> tuple[BoolArray, Array]:
    """Return which of `hips` (n, 3), m, are inside, and the jump, m, on the straight way to each: (n,) both."""
    jumps = np.zeros(len(hips))
    if surface.kind == "torus":
        major, minor = surface.reals
        inside = np.hypot(np.hypot(hips[:, 0], hips[:, 1]) - major, hips[:, 2]) < minor
        return inside, jumps
    axes = np.array([surface.reals[0]] * 3) if surface.kind == "sphere" else np.array(surface.reals)
    inside = np.sum((hips / axes) ** 2, axis=1) < 1.0
    order = np.argsort(axes)
    shortest, others = order[0], order[1:]
    if axes[others[0]] == axes[shortest]:
        return inside, jumps  # a line or a point, and no surface: a path misses it
    height = hips[:, shortest]
    for tick in (np.flatnonzero(height[1:] * height[:-1] < 0.0) + 1).tolist():
        share = height[tick - 1] / (height[tick - 1] - height[tick])
        place = hips[tick - 1] + share * (hips[tick] - hips[tick - 1])
        # (X / a)^2 + (Y / b)^2 of the two nearest points, and what is left for (Z / c)^2
        left = 1.0 - np.sum((place[others] / (1.0 - (axes[shortest] / axes[others]) ** 2) / axes[others]) ** 2)
        jumps[tick] = 2.0 * axes[shortest] * math.sqrt(max(left, 0.0))
    return inside, jumps


def least_distance_to_focus(surface: Surface, hips: Array) -> float:
    """Return how near, m, a path of `hips` (n, 3), m, comes to where a surface's nearest points are a whole circle.

    Infinite for what has no such point: the nearest point of a sphere's centre, or of a torus' core circle.
    """
    if surface.kind == "ellipsoid":
        return math.inf
    if surface.kind == "torus":
        flat = np.column_stack([np.hypot(hips[:, 0], hips[:, 1]) - surface.reals[0], hips[:, 2]])
    else:
        flat = hips
    nearest = math.inf
    for start, end in itertools.pairwise(flat):
        way = end - start
        squared = float(way @ way)
        share = min(max(-float(start @ way) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
        nearest = min(nearest, float(np.linalg.norm(start + share * way)))
    return nearest
