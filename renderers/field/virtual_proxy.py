"""The virtual proxy: a ball that follows the hand and is stopped by what it touches.

Ruspini, D. C., Kolarov, K., Khatib, O. (1997): The haptic display of complex graphical environments, SIGGRAPH 97.

With p the ball's centre, r its radius, h the hand, K the stiffness:

1. Obstacles are all points closer to the surface than r. The hand leads the ball; the goal is g = h.
2. The ball goes straight for its goal, p <- p + t (g - p), up to the first t at which it touches.
3. Where it touches with unit normals n_i, the goal is the point closest to the hand that no contact bars:
   minimise |x - h|^2 with n_i . (x - p) >= 0, so that x - p = (h - p) + sum l_i n_i with at most three l_i > 0.
4. This goes on within the tick until the ball gets no further.
5. F = K (p - h), and p is the IHIP, which stands r off the surface.

Edges or triangles are what it touches: those of the model, or finer than 1e-5 of a smooth one.

Predicted from the equations, before any run:

- continuous contact: passes on convex models and in notches wider than 2 r. Under a curved surface it walks over facets
  as `constraint` does, so that deep in a lobe the ball runs from edge to edge: fails there.
- contact normal force: passes. The force leads from the hand to the centre of the ball, along the sum of the normals.
- broken contact: passes. The ball rolls round the edge, and is free once the hand is r past it: late by r at most.
- abrupt switch: fails. In a concave corner the ball rests, and the spring to it turns with the hand.
- impulsive collision: fails. It is a spring without a mass.
- centripetal force: not applicable to unilateral contacts at rest; fails on the circle, for it needs an error.
- force magnitude: passes, F is K times the error exactly. Standoff: r and the facets' chords.
- memoryless: fails where the model has a medial axis, since the ball remembers its side.

Measured on the suites `thesis` and `solids`, with r = 0.5 mm:

- continuous contact: not all was predicted. A hand that has slid past an edge by less than r is still in the ball's
  way, so that the ball rolls down the far face beside the hand, by the whole depth in one tick: 5.5 mm on the cube.
  The hand is outside then, by less than the declared r, and the contact counts as over. It fails at edges of more than
  90 degrees, which the hand passes inside of the solid, as `constraint` does. Right in lobes: 36 mm in the deep slide;
  but the five sweeps along the Cassinian pass, for 1e-5 of facets and a ball over them feel smooth, where `constraint`
  on 40 edges does not. On a ball of 20 mm the standoff is more than the fiftieth that checks believe.
- contact normal force: passes in all 39 cases. A first version touched the next triangle of a flat face at its edge,
  and was off by 0.05 degrees: an edge counts only where it is closest on both its faces.
- broken contact, abrupt switch, impulsive collision, force magnitude, memoryless: as predicted; an edge is let go of
  within r in nine of nine cases, and the switch in corners takes 0.76 to 2.1 depths.
- centripetal force: fails on `circle-slide`, 105 per cent from error; the held circle asks for both sides, and is
  refused.
- contact kept (49 of 49), passivity (six of six): pass, the plate in a tick too. Neither was predicted in a line.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.compiled import compiled, inner
from hapticeval.geometry.mesh_kernels import closest_in_cone
from hapticeval.geometry.triples import Triple, dot, plus, triple_of
from hapticeval.laws import LawData
from hapticeval.records import as_record, record_type, room_for
from hapticeval.renderers.field.facets import (
    FACET,
    OnFacets,
    away_from_facet,
    cubes_between,
    facet_grid,
    facets_of,
    listed_in,
)
from hapticeval.renderers.projective import once
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.scene import Scene

BALL_GAP = 1e-6
"""Share of the radius that is left between ball and obstacle."""
ALONG_FACET = -1e-9
"""Cosine of a direction to a normal above which the ball moves along the facet, but for rounding."""
MOST_STRETCHES = 64
"""Stretches of one tick at the most; each leads the ball closer to the hand."""
CONTACTS = 32
"""Facets that are touched at once at the most."""
BALL_ROUNDING, ON_FACET = 1e-12, 1e-6
"""Shares of the radius: what distances differ by for rounding, and how near to a facet a point lies on it."""
ARRIVED = 1e-9
"""Share of the way to the hand that is none."""

BALL_CONTACT = record_type("distance", "facet", "is_closest", base=record_type(normal=3, point=3))
"""A contact: unit normal, closest point (m), distance (m), facet, and 1 unless a nearer facet has that point too."""

CONTACT_NUMBERS = room_for(BALL_CONTACT)

BALL_PARAMS = record_type("stiffness", "radius")
"""The law's numbers: K (N/m) and r (m); then those of the grid of facets.

Its state is the centre (3,), m, at z = 0 in the plane.
"""


GRID_AT = room_for(BALL_PARAMS)
"""Where the grid's numbers begin among the law's."""


class VirtualProxy(OnFacets):
    """A ball of `radius` (m), its centre the IHIP."""

    def __init__(self, scene: Scene, *, radius: float) -> None:
        _, rows = facets_of(scene)
        near = once(scene.model, ("facet grid", radius), lambda: facet_grid(rows, radius * (1.0 + 4.0 * BALL_GAP)))
        super().__init__(
            follow,
            scene,
            own=[radius, *near.grid],
            state=3,
            standoff=radius * (1.0 + 2.0 * BALL_GAP),
            tree=near.cubes,
            lookup=near.facets,
        )
        self._reach = radius * (1.0 + BALL_GAP)

    def reset(self, hip: Array) -> None:
        """Start a run with the ball at the hand `hip` (N,), m, or where that is too close, r off the nearest point."""
        super().reset(hip)
        near = self.surface.closest_point(hip[np.newaxis])
        centre = hip if near.distance[0] >= self._reach else near.foot[0] + self._reach * near.normal[0]
        self.law.data.state[: hip.size] = centre


@compiled
def first_touch(data: LawData, radius: float, p: Triple, d: Triple) -> float:
    """Return the share t of the way d from p, m, after which a ball of a `radius` (m) first touches a facet: 1 if none.

    The distance f(t) from a facet, which is convex, is a convex function. Newton's steps from the left never pass its
    first root f(t) = r, and where f rises there is none: nothing is tunnelled through.
    """
    grid, first_share = data.params[GRID_AT:], 1.0
    x0, x1, y0, y1, z0, z1 = cubes_between(grid, p, plus(p, 1.0, d))
    for z in range(z0, z1 + 1):
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                start, end = listed_in(grid, data.tree, x, y, z)
                for entry in range(start, end):
                    first_share = touch_of(data.pieces, int(data.lookup[entry, 0]), radius, p, d, first_share)
    return first_share


@inner
def touch_of(facets: Array, k: int, radius: float, p: Triple, d: Triple, first_share: float) -> float:
    """Return the share of the way d from p, m, after which the ball touches facet k, or `first_share` if that is less.

    `facets` (c, 16) and `radius` are in m.
    """
    length = math.sqrt(dot(d, d))
    facet = as_record(facets, FACET, k)
    apart = plus(triple_of(facet.middle), -1.0, p)
    reach = facet.reach + radius * (1.0 + 2.0 * BALL_GAP) + first_share * length
    if dot(apart, apart) > reach * reach:
        return first_share
    t = 0.0
    for _ in range(MOST_STRETCHES):
        distance, n = away_from_facet(facets, k, plus(p, t, d))
        slope = dot(n, d)
        if slope >= ALONG_FACET * length or t >= first_share:
            break
        clearance = distance - radius * (1.0 + BALL_GAP)
        if clearance <= 0.01 * radius * BALL_GAP:
            return t
        t -= clearance / slope  # Newton: f(t) + f'(t) dt = r
    return first_share


@compiled
def touched(data: LawData, radius: float, p: Triple, contacts: Array) -> int:
    """Write what a ball of a `radius` (m) touches at p (m) to `contacts` (k, CONTACT_NUMBERS), a `BALL_CONTACT` a row.

    Returns k.

    A closest point on an edge counts where it is closest on the facet beyond the edge, too: across a flat edge nothing
    is felt.
    """
    facets, grid = data.pieces, data.params[GRID_AT:]
    count, kept_count = 0, 0
    x, last_x, y, last_y, z, last_z = cubes_between(grid, p, p)
    if x > last_x or y > last_y or z > last_z:  # outside the grid nothing is near
        return 0
    start, end = listed_in(grid, data.tree, x, y, z)
    for entry in range(start, end):
        k = int(data.lookup[entry, 0])
        facet = as_record(facets, FACET, k)
        apart = plus(triple_of(facet.middle), -1.0, p)
        reach = facet.reach + radius * (1.0 + 2.0 * BALL_GAP)
        if dot(apart, apart) > reach * reach:
            continue
        distance, n = away_from_facet(facets, k, p)
        if distance <= radius * (1.0 + 2.0 * BALL_GAP) and count < CONTACTS:
            contact = as_record(contacts, BALL_CONTACT, count)
            for axis in range(3):
                contact.normal[axis], contact.point[axis] = n[axis], p[axis] - distance * n[axis]
            contact.distance, contact.facet = distance, k
            count += 1
    # a contact whose closest point lies on a facet that is nearer is felt as that one alone
    for i in range(count):
        contact, is_closest = as_record(contacts, BALL_CONTACT, i), True
        for j in range(count):
            other = as_record(contacts, BALL_CONTACT, j)
            if other.distance < contact.distance - BALL_ROUNDING * radius:
                off, _ = away_from_facet(facets, int(other.facet), triple_of(contact.point))
                is_closest = is_closest and off > ON_FACET * radius
        contact.is_closest = 1.0 if is_closest else 0.0
    for i in range(count):
        if as_record(contacts, BALL_CONTACT, i).is_closest == 1.0:
            contacts[kept_count] = contacts[i]
            kept_count += 1
    return kept_count


@compiled
def follow(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the virtual proxy, of signature `LAW`: steps 1 to 5 of the module.

    `hip` (N,), m, is the hand's; `ihip` (N,), m, and `force` (N,), N, are written. Returns 0: it never refuses.
    """
    gains, state = as_record(data.params, BALL_PARAMS), data.state
    radius = gains.radius
    h = (hip[0], hip[1], hip[2] if hip.shape[0] == 3 else 0.0)
    p = (state[0], state[1], state[2])
    contacts = np.empty((CONTACTS, CONTACT_NUMBERS))
    for _ in range(MOST_STRETCHES):
        count = touched(data, radius, p, contacts)
        for i in range(count):  # keep 1.5 gaps, so that a stop at one gap is something new
            contact = as_record(contacts, BALL_CONTACT, i)
            lift = max(radius * (1.0 + 1.5 * BALL_GAP) - contact.distance, 0.0)
            p = plus(p, lift, triple_of(contact.normal))
        wish = plus(h, -1.0, p)
        length = math.sqrt(dot(wish, wish))
        if length == 0.0:
            break
        # step 3: x - p = (h - p) + sum l_i n_i, and the sum is what of p - h lies in the cone of the normals
        d = plus(wish, 1.0, closest_in_cone(contacts, 0, count, (-wish[0], -wish[1], -wish[2])))
        size = math.sqrt(dot(d, d))
        if size <= ARRIVED * length:
            break
        # step 2: to the goal, or up to what is in the way
        t = first_touch(data, radius, p, d)
        p = h if t == 1.0 and d == wish else plus(p, t, d)
    state[0], state[1], state[2] = p
    for i in range(hip.shape[0]):
        ihip[i] = p[i]
        force[i] = gains.stiffness * (p[i] - hip[i])  # step 5
    return 0
