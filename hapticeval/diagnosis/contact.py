"""The contact that a hand's path asks for: what a force and a contact point are compared with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.signal import savgol_filter

from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.solids import prism
from hapticeval.types import Array, BoolArray

SMOOTHED_ROWS = 41
"""Rows over which parabolas give a noisy hand's velocity: 40 ms at 1 kHz, a tenth of a fast stroke; *chosen*."""

MOST_CORNERS = 20
"""Corners at most beside which a gain is sought; *chosen*."""

LEAP, LEAP_TICKS, MOST_LEAPING = 3.0, 3, 0.2
"""A force that changes by so many times K and the hand's step leaps; ticks on either side of it in which a log may be
there already, or not yet; and the share of rows beyond which leaps are no exception. *Chosen*."""

STILL = 1e-9
"""m a tick, or change of a unit normal: less is not motion."""


def unit_rows(vectors: Array) -> Array:
    """Return `vectors` (n, N) divided by their lengths; one of no length stays zero."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0))


def dot_rows(a: Array, b: Array) -> Array:
    """Return the scalar products (n,) of rows (n, N)."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def stretches_of(mask: BoolArray) -> Iterator[tuple[int, int]]:
    """Yield the row at which each stretch of true values of a `mask` (n,) begins, and the one after its end."""
    begins, ends = (np.flatnonzero(np.diff(np.pad(mask.astype(int), 1)) == change) for change in (1, -1))
    yield from zip(begins.tolist(), ends.tolist(), strict=True)


def lead_tool(boundary: Boundary, hips: Array) -> Array:
    """Return where a rigid tool is that follows a hand at `hips` (n, N), m: its contact points, else the hand, (n, N).

    On meshes, and on polygons as prisms of them, it is led tick by tick; on smooth models it is at the nearest point.
    """
    if isinstance(boundary, Curve) and boundary.straight and boundary.closed:
        outline = np.array([corner.position for corner in boundary.corners])
        across = 2.0 * float(np.ptp(outline, axis=0).max()) + 2.0 * float(np.abs(hips).max())
        mesh = Mesh(boundary.name, *prism(outline, across))
        return mesh.rigid_tool(np.pad(hips, ((0, 0), (0, 1))))[2][:, :2]
    if isinstance(boundary, Mesh):
        return boundary.rigid_tool(hips)[2]
    closest = boundary.closest_point(hips)
    return np.where(closest.distance[:, None] < 0.0, closest.foot, hips)


@dataclass(frozen=True, eq=False)
class RightContact:
    """A rigid, frictionless contact along a hand's path: F = K (p - h) - K_d v_n n, thesis (4.6), (4.8).

    - `time` (n,), s; `hip` h and `velocity` v (n, N), m and m/s; `point` p (n, N), m: on the surface, else the hand;
    - `normal` n (n, N): outward at p, from the hand to p where the two are apart;
    - `depth` (n,), m: of the hand below p; negative outside, where it is the distance to the model;
    - `touches` (n,): where p is off the hand; `force` (n, N), N; `stiffness` K in N/m.
    """

    time: Array
    hip: Array
    velocity: Array
    point: Array
    normal: Array
    depth: Array
    touches: BoolArray
    force: Array
    stiffness: float

    @property
    def step(self) -> float:
        """The sampling time, s."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    @cached_property
    def normal_speed(self) -> Array:
        """The hand's speed outwards, (n,), m/s."""
        return dot_rows(self.velocity, self.normal)

    @cached_property
    def point_velocity(self) -> Array:
        """The contact point's velocity over the tick before each row, (n, N), m/s; in the first row the hand's."""
        steps = np.diff(self.point, axis=0) / np.diff(self.time)[:, None]
        return np.concatenate([self.velocity[:1], steps])

    @cached_property
    def slide(self) -> Array:
        """The hand's velocity along the surface, (n, N), m/s; zero in free space."""
        return np.asarray((self.velocity - self.normal_speed[:, None] * self.normal) * self.touches[:, None])

    @cached_property
    def told(self) -> BoolArray:
        """Where a log tells the contact, (n,): not beside a leap of the force, over an edge or near a medial axis.

        There a step of the hand's encoder decides on which face the tool is, or when it leaves.
        """
        steps = np.linalg.norm(np.diff(self.hip, axis=0, prepend=self.hip[:1]), axis=1)
        force_steps = np.linalg.norm(np.diff(self.force, axis=0, prepend=self.force[:1]), axis=1)
        smallest = steps[steps > STILL].min(initial=float(steps.max()))
        leaps = force_steps > LEAP * self.stiffness * (steps + smallest)
        near_leap = binary_dilation(leaps, np.ones(2 * LEAP_TICKS + 1, dtype=np.bool_))
        # A path that leaps all the time tells what it does.
        return np.asarray(~near_leap if np.mean(near_leap) < MOST_LEAPING else np.ones(len(steps), dtype=bool))

    @cached_property
    def cornered(self) -> BoolArray:
        """Where two faces hold the point, (n,): it rests while the hand goes on along it, or has and will again."""
        point_steps = np.linalg.norm(np.diff(self.point, axis=0, prepend=self.point[:1]), axis=1)
        turns = np.linalg.norm(np.diff(self.normal, axis=0, prepend=self.normal[:1]), axis=1)
        rests = self.touches & (point_steps < STILL)
        cornered = rests & (turns > STILL)
        # The tick in which it came there, and those in which the hand rests, too.
        for first, end in stretches_of(rests):
            cornered[max(first - 1, 0) : end] |= cornered[first:end].any()
        return np.asarray(cornered & self.touches)

    @cached_property
    def beside_corner(self) -> Array:
        """How far the point is from where two faces hold it, (n,), m; infinite where they never do."""
        places = np.unique(np.round(self.point[self.cornered], 9), axis=0)[:MOST_CORNERS]
        away = [np.linalg.norm(self.point - place, axis=1) for place in places]
        return np.min(away, axis=0) if away else np.full(len(self.time), np.inf)


def right_contact(
    boundary: Boundary | None,
    time: Array,
    hip: Array,
    velocity: Array | None = None,
    *,
    stiffness: float,
    damping: float = 0.0,
    points: Array | None = None,
) -> RightContact:
    """Return the contact that a hand at `hip` (n, N), m, at `time` (n,), s, should have with `boundary`.

    `points` (n, N), m, are contact points to compare with; without them a rigid tool is led along the path. A contact
    with given points may have no known `boundary`: nothing is then known outside of it. Without a `velocity` (n, N),
    m/s, it is fitted to the hand, as encoders ask for.
    """
    if velocity is None:
        rows = min(SMOOTHED_ROWS, 2 * (len(hip) // 4) + 1)
        velocity = np.zeros_like(hip)
        if rows > 2:
            step = float((time[-1] - time[0]) / (len(time) - 1))
            velocity = savgol_filter(hip, rows, 2, deriv=1, delta=step, axis=0)
    if boundary is None:
        assert points is not None, "a tool is led on a boundary"
        point, normal_outside, distance = points, np.zeros_like(hip), np.zeros(len(hip))
    else:
        closest = boundary.closest_point(hip)
        point = lead_tool(boundary, hip) if points is None else points
        normal_outside, distance = closest.normal, closest.distance
    reach = point - hip
    inside = np.linalg.norm(reach, axis=1)
    touches = inside > 1e-12
    normal = np.where(touches[:, None], unit_rows(reach), normal_outside)
    depth = np.where(touches, inside, np.minimum(-distance, 0.0))
    damper = np.where(touches, damping * dot_rows(velocity, normal), 0.0)
    force = stiffness * reach - damper[:, None] * normal
    return RightContact(time, hip, velocity, point, normal, depth, touches, force, stiffness)
