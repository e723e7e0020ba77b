"""The neighbourhood watch: the tool looks for the hand among the neighbours of the face that it is on, and no further.

Ho, C.-H., Basdogan, C., Srinivasan, M. A. (1999): Efficient point-based rendering techniques for haptic display of
virtual objects, Presence 8(5).

With h the hand and K the stiffness:

1. A contact begins where the hand's way from the last tick first goes through a face from outside.
2. In contact, the candidates are the face that the tool is on and those that share a corner with it.
3. The IHIP s is the nearest of their points to h; on another face, 2 is done again, as long as s comes nearer.
4. F = K (s - h).
5. The contact ends when h is outside of the face that s is on: n . (h - s) > 0.

Faces are edges or triangles: those of the model, or finer than 1e-5 of a smooth one. Vertices and edges are looked at
as parts of faces; where s lies on one, that face decides in 5 whose plane h is farthest from.

Predicted from the equations, before any run:

- continuous contact: a descent in distance, it stays in its local minimum, so that it crosses a medial axis without a
  jump as `constraint` does; but where that minimum ends it runs on to another, and deep in a lobe fails. At a convex
  edge of a solid it walks round as soon as a point behind the edge is nearer, which is never before the bisector:
  fails there.
- contact normal force: passes. F leads from h to its nearest point on the faces around, along their normals.
- broken contact: fails. Nothing bars the way round a sharp edge: past the bisector the force turns to the other face.
- abrupt switch: passes as the nearest point does inside a concave corner: no, it rests in the corner; fails.
- contact kept: passes on thick models; fails where a contact ends at one face with h still under another one, for the
  way from s to h is not looked at. Through the plate: passes, the first contact is found by the hand's way.
- impulsive collision, centripetal force: fail, as for every spring.
- force magnitude: passes, F is K times the error exactly.
- memoryless: fails where a lobe is crossed.

Measured on the suites `thesis` and `solids`:

- continuous contact: right at edges, 1.6 to 7.1 mm on nine solids and 17 mm at the star's tip, and in lobes, 41 mm.
  Wrong on smooth curves: facets of 1e-5 of the size are left by depth times their turn, 0.12 mm at a depth of 5 mm,
  and that is three times the bound.
- contact normal force, force magnitude: pass in all 39 cases, as predicted.
- broken contact: as predicted, nine of nine fail, 2 to 17 mm before the edge.
- abrupt switch: fails five of five, it rests in the corner.
- contact kept: wrong, 49 of 49 pass: on these paths no face lets go with the hand under another, the plate included.
- impulsive collision, centripetal force (102 per cent from error), memoryless (45 mm in the lobe): as predicted.
- passivity: six of six pass. It was not predicted; a descent in distance only gives energy up.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.geometry.triples import Triple, dot, plus, triple_of
from hapticeval.laws import LawData
from hapticeval.records import as_record, record_type, room_for
from hapticeval.renderers.field.facets import FACET, OnFacets, away_from_facet, facets_of
from hapticeval.renderers.projective import once
from hapticeval.types import Array, IntArray

if TYPE_CHECKING:
    from hapticeval.scene import Scene

SPRING_PARAMS = record_type("stiffness", "touch")
"""The law's numbers: K (N/m), and the distance (m) within which a point lies on a face."""
FACE_TOOL = record_type("touches", "face", hand=3)
"""The law's state: whether there is contact, on which face, and the last hand (3,), m."""
SAME_POINT_SHARE = 1e-9
"""Share of the model's size within which points are the same."""


class Neighbourhood(OnFacets):
    """The nearest point among the faces around the last one."""

    def __init__(self, scene: Scene) -> None:
        facets, _ = facets_of(scene)
        around = once(scene.model, "neighbourhood", lambda: neighbours(facets.cells))
        super().__init__(
            follow, scene, own=[SAME_POINT_SHARE * scene.model.size], state=room_for(FACE_TOOL), lookup=around
        )

    def reset(self, hip: Array) -> None:
        """Start a run with the hand at `hip` (N,), m: inside it starts at the nearest face."""
        super().reset(hip)
        data = self.law.data
        tool = as_record(data.state, FACE_TOOL)
        tool.hand[: hip.size] = hip
        tool.touches = float(self.surface.signed_distance(hip[np.newaxis])[0] < 0.0)
        tool.face = nearest_face(data.pieces, (tool.hand[0], tool.hand[1], tool.hand[2]))


def neighbours(cells: IntArray) -> Array:
    """Return the faces that share a corner with each of (c, N) faces, a row a face, filled up with -1."""
    from scipy.sparse import coo_array

    faces = np.repeat(np.arange(len(cells)), cells.shape[1])
    has = coo_array((np.ones(cells.size), (faces, cells.ravel()))).tocsr()
    shares = (has @ has.T).tocsr()
    counts = np.diff(shares.indptr)
    table = np.full((len(cells), int(counts.max())), -1.0)
    table[np.arange(table.shape[1]) < counts[:, np.newaxis]] = shares.indices
    return np.sort(table, axis=1)[:, ::-1].copy()


@compiled
def nearest_face(facets: Array, p: Triple) -> int:
    """Return the face (its row of `facets` (c, 16), m) that is nearest to p (m)."""
    best, smallest = 0, math.inf
    for k in range(facets.shape[0]):
        distance, _ = away_from_facet(facets, k, p)
        if distance < smallest:
            best, smallest = k, distance
    return best


@compiled
def entered(facets: Array, touch: float, start: Triple, end: Triple) -> int:
    """Return which of `facets` (c, 16) the way from start to end, m, first goes through inwards, -1 if none: step 1."""
    motion = plus(end, -1.0, start)
    reach = math.sqrt(dot(motion, motion)) + touch
    best, first = -1, math.inf
    for k in range(facets.shape[0]):
        facet = as_record(facets, FACET, k)
        apart = plus(triple_of(facet.middle), -1.0, start)
        if dot(apart, apart) > (facet.reach + reach) * (facet.reach + reach):
            continue  # all of the facet is farther away than the hand moves
        n = triple_of(facet.normal)
        # heights above the facet's plane: at the start, and what is lost on the way
        above = -dot(n, plus(triple_of(facet.a), -1.0, start))
        falls = -dot(n, motion)
        if above < -touch or falls <= 0.0 or above - falls >= 0.0:
            continue
        t = max(above, 0.0) / falls  # n . (start + t motion - corner) = 0
        off, _ = away_from_facet(facets, k, plus(start, t, motion))
        if off <= touch and t < first:
            best, first = k, t
    return best


@compiled
def watched(facets: Array, around: Array, face: int, h: Triple) -> int:
    """Return which of `facets` (c, 16) h's nearest point is on, m, from `face` over its neighbours: steps 2 and 3."""
    smallest, _ = away_from_facet(facets, face, h)
    while True:
        best = face
        for k in around[face]:
            if k < 0.0:
                break
            distance, _ = away_from_facet(facets, int(k), h)
            if distance < smallest:
                best, smallest = int(k), distance
        if best == face:
            return face
        face = best


@compiled
def follow(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick of the neighbourhood's renderer, of signature `LAW`: the steps of the module.

    `hip` (N,), m, is the hand's; `ihip` (N,), m, and `force` (N,), N, are written. Returns 0: it never refuses.
    """
    facets, gains, tool = data.pieces, as_record(data.params, SPRING_PARAMS), as_record(data.state, FACE_TOOL)
    h = (hip[0], hip[1], hip[2] if hip.shape[0] == 3 else 0.0)
    if tool.touches == 0.0:
        face = entered(facets, gains.touch, triple_of(tool.hand), h)  # step 1
        if face >= 0:
            tool.touches, tool.face = 1.0, face
    tool.hand[0], tool.hand[1], tool.hand[2] = h
    distance, direction = 0.0, (0.0, 0.0, 0.0)
    if tool.touches == 1.0:
        face = watched(facets, data.lookup, int(tool.face), h)  # steps 2 and 3
        distance, direction = away_from_facet(facets, face, h)
        outside = 0.0
        for k in data.lookup[face]:  # step 5: of the faces that s is on, the one whose plane h is farthest from
            if k < 0.0:
                break
            off, _ = away_from_facet(facets, int(k), plus(h, -distance, direction))
            height = distance * dot(direction, triple_of(as_record(facets, FACET, int(k)).normal))
            if off <= gains.touch and abs(height) > abs(outside):
                outside = height
        tool.face = face
        if outside > 0.0:
            tool.touches, distance = 0.0, 0.0
    for i in range(hip.shape[0]):
        ihip[i] = hip[i] - distance * direction[i]
        force[i] = gains.stiffness * (ihip[i] - hip[i])  # step 4
    return 0
