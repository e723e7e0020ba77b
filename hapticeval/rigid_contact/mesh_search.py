"""Where a tool that flies first meets a triangle mesh, and where one that slides first comes to an edge of its face.

A step's path lies in a box, and the mesh's tree tells which triangles come near it; what the path meets is a root in
time, between two times at which the height over a plane has different signs. No step is checked by its ends alone.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from hapticeval.bracket import MOST_GUESSES, guess_between, narrow_bracket
from hapticeval.compiled import compiled, inner
from hapticeval.geometry.mesh_kernels import FACE, VERTEX, corner_of, normal_of
from hapticeval.geometry.triples import Triple, cross, dot, minus, plus
from hapticeval.rigid_contact.force import ALIGNED_SHARE, OFF_CUBIC_SHARE, PLACE_REACH, SEAM_REACH
from hapticeval.rigid_contact.mesh_terrain import (
    MeshTerrain,
    edge_direction,
    feature_at,
    nearest_around,
    next_in_fan,
    turns_at_corner,
)
from hapticeval.rigid_contact.space import fly_in_space, force_in_space
from hapticeval.types import Array, IntArray

FALL_GAP = 1e-9
"""Share of a step after a fall through a plane, from where on the next is looked for."""

HEIGHT, CLIMB, LIFT = range(3)
"""What is watched along a path: the height over a plane (m), its rate (m/s) and the rate of that (m/s^2)."""


class ToolPath(NamedTuple):
    """A path of the tool under the operator's force: where it begins (m), how fast (m/s), when (s) in the stretch.

    It is a flight's where `contact_normal` is zero, or if that is a unit vector, that of a slide square to it.
    """

    p: Triple
    v: Triple
    tau: float
    contact_normal: Triple


@compiled
def follow(path: ToolPath, h: float, load: Any) -> tuple[Triple, Triple]:
    """Return position (m) and velocity (m/s) h seconds along a path, under a `LOAD`.

    Under a force that is the same on all axes but for a push, what lies along a plane moves as if alone: a slide is a
    flight whose part along the normal is left out.
    """
    p, v = fly_in_space(path.p, path.v, path.tau, h, load)
    # without what lies along the normal: p - (n.(p - p0)) n, and v - (n.v) n; in flight n is zero
    p = plus(p, -dot(minus(p, path.p), path.contact_normal), path.contact_normal)
    return p, plus(v, -dot(v, path.contact_normal), path.contact_normal)


@compiled
def _control_polygon(path: ToolPath, h: float, load: Any) -> tuple[Triple, Triple, Triple, Triple]:
    """Return the control polygon (m) of a path of h seconds: p0, p0 + v0 h / 3, p1 - v1 h / 3, p1."""
    p, v = follow(path, h, load)
    return path.p, plus(path.p, h / 3.0, path.v), plus(p, -h / 3.0, v), p


@compiled
def watch(what: int, normal: Triple, anchor: Triple, path: ToolPath, h: float, load: Any) -> float:
    """Return what is watched, h seconds along a path, over the plane with this unit normal through `anchor` (m)."""
    p, v = follow(path, h, load)
    if what == HEIGHT:
        return dot(normal, minus(p, anchor))
    if what == CLIMB:
        return dot(normal, v)
    # n.a = n.F / m, without the part of F that the contact takes
    force = force_in_space(load, path.tau + h, p, v)
    return float(dot(normal, plus(force, -dot(force, path.contact_normal), path.contact_normal)) / load.mass)


@compiled
def root_between(
    what: int, level: float, normal: Triple, anchor: Triple, path: ToolPath, low: float, high: float, load: Any
) -> float:
    """Return the time (s) at which what is watched passes -level, to rounding: it does between `low` and `high`."""
    a = watch(what, normal, anchor, path, low, load) + level
    b = watch(what, normal, anchor, path, high, load) + level
    positive, side_kept = a > 0.0, 0
    for i in range(MOST_GUESSES):
        middle = guess_between(low, high, a, b, i)
        if not low < middle < high:
            break
        f = watch(what, normal, anchor, path, middle, load) + level
        if f == 0.0:
            return middle
        low, high, a, b, side_kept = narrow_bracket(low, high, a, b, side_kept, middle, f, positive)
    return high


@compiled
def first_fall(normal: Triple, anchor: Triple, path: ToolPath, begin: float, h: float, skin: float, load: Any) -> float:
    """Return when the path first falls through a plane, from `begin` to h (s); infinite if it does not.

    A path that begins within `skin` (m) of this plane was on it: it falls where it leaves that, as its first crossing
    of the plane is rounding.
    """
    # The acceleration changes its sign once at the most within a step, and so the climb on either side of that bend.
    bend = h
    if watch(LIFT, normal, anchor, path, begin, load) * watch(LIFT, normal, anchor, path, h, load) < 0.0:
        bend = root_between(LIFT, 0.0, normal, anchor, path, begin, h, load)
    # where the climb changes its sign the height has an extremum: one before the bend, and one after it
    early = begin
    if watch(CLIMB, normal, anchor, path, begin, load) * watch(CLIMB, normal, anchor, path, bend, load) < 0.0:
        early = root_between(CLIMB, 0.0, normal, anchor, path, begin, bend, load)
    late = bend
    if bend < h and watch(CLIMB, normal, anchor, path, bend, load) * watch(CLIMB, normal, anchor, path, h, load) < 0.0:
        late = root_between(CLIMB, 0.0, normal, anchor, path, bend, h, load)
    cuts = (begin, early, bend, late, h)
    height = watch(HEIGHT, normal, anchor, path, begin, load)
    # between two cuts the height rises or falls
    for part in range(4):
        low, high = cuts[part], cuts[part + 1]
        if high <= low:
            continue
        end_height = watch(HEIGHT, normal, anchor, path, high, load)
        if height >= -skin and end_height < -skin:
            # deeper than that: it is surely inside
            time = root_between(HEIGHT, skin, normal, anchor, path, low, high, load)
            # it came from outside: back to where the height is zero
            if height > skin:
                time = root_between(HEIGHT, 0.0, normal, anchor, path, low, time, load)
            return time
        height = end_height
    return math.inf


@compiled
def _box_around(polygon: tuple[Triple, Triple, Triple, Triple]) -> tuple[Triple, Triple]:
    """Return the least and largest corner (m) of a box that holds the path with this control polygon."""
    start, out, back, end = polygon
    low = (
        min(start[0], end[0], out[0], back[0]),
        min(start[1], end[1], out[1], back[1]),
        min(start[2], end[2], out[2], back[2]),
    )
    high = (
        max(start[0], end[0], out[0], back[0]),
        max(start[1], end[1], out[1], back[1]),
        max(start[2], end[2], out[2], back[2]),
    )
    margin = OFF_CUBIC_SHARE * (high[0] - low[0] + high[1] - low[1] + high[2] - low[2]) + SEAM_REACH
    return plus(low, -margin, (1.0, 1.0, 1.0)), plus(high, margin, (1.0, 1.0, 1.0))


@compiled
def near_triangles(terrain: MeshTerrain, low: Triple, high: Triple, near: IntArray) -> tuple[int, float]:
    """Write the triangles whose leaves touch the box from `low` to `high` (m) into `near` (t,), and return how many.

    With them comes the room (m) around the box if there is none: no triangle is closer.
    """
    tree, n, m = terrain.tree, terrain.faces.shape[0], terrain.tree.shape[0] // 2
    count, room = 0, math.inf
    i = 1
    while i > 0:
        # the largest gap of the two boxes along an axis; negative where they overlap along all three
        gap = max(
            max(tree[i, 0] - high[0], low[0] - tree[i, 3]),
            max(tree[i, 1] - high[1], low[1] - tree[i, 4]),
            max(tree[i, 2] - high[2], low[2] - tree[i, 5]),
        )
        if gap > 0.0:
            room = min(room, gap)
        elif i < m:
            # down into the first half; the second is its sibling, which comes after
            i *= 2
            continue
        else:
            # leaf i - m: its run of triangles
            room = 0.0
            for k in range((i - m) * n // m, (i - m + 1) * n // m):
                near[count] = k
                count += 1
        # up out of second halves, then over to the sibling
        while i & 1:
            i >>= 1
        i = i + 1 if i > 0 else 0
    return count, room


@inner
def _lies_over(terrain: MeshTerrain, k: int, p: Triple) -> bool:
    """Whether a point (m) on the plane of triangle k lies on the triangle, within its reach beyond each concave edge.

    Where such an edge ends at a corner with a convex one, it does not reach past the corner, nor out of the solid.
    """
    for i in range(3):
        a, e = (
            corner_of(terrain.faces, terrain.vertices, k, i),
            edge_direction(terrain.faces, terrain.vertices, k, i),
        )
        # n x e points into the triangle
        inside = dot(cross(normal_of(terrain.faces, k), e), minus(p, a))
        if inside >= -terrain.tip_reach:
            continue
        # within a flat face the neighbour has the same plane: what is past this edge lies on that, or on no triangle
        if terrain.turns[k, i] >= 0.0 or inside < -SEAM_REACH:
            return False
        b = corner_of(terrain.faces, terrain.vertices, k, (i + 1) % 3)
        # past a: e.(p - a) < 0; past b: e.(p - b) > 0
        for corner, apex, past in ((i, a, -dot(e, minus(p, a))), ((i + 1) % 3, b, dot(e, minus(p, b)))):
            if turns_at_corner(terrain, k, corner)[1] > 0.0:
                # the neighbour may be narrow there: what is past this edge is then past the neighbour too
                height = nearest_around(terrain, k, VERTEX + corner, minus(p, apex))[0]
                if past > 0.0 or height > terrain.tip_reach:
                    return False
    return True


@compiled
def _grazes(terrain: MeshTerrain, k: int, p: Triple, v: Triple) -> bool:
    """Whether a tool at p (m) on the rim of triangle k, with velocity v (m/s), falls past it and into no solid.

    So does one that comes in over a convex edge along the other face: it falls through the plane of k, and lies beside
    k or on it by less than rounding. Put back onto that edge it would come to it again and again.
    """
    # on which side of a convex edge it is, rounding of coordinates does not tell
    feature, _ = feature_at(terrain, k, p, PLACE_REACH, terrain.tip_reach)
    rounding = ALIGNED_SHARE * math.sqrt(dot(v, v))
    if feature == FACE or dot(normal_of(terrain.faces, k), v) >= -rounding:
        return False
    return nearest_around(terrain, k, feature, v)[0] >= -rounding


@compiled
def _stays_on_one_side(
    normal: Triple, anchor: Triple, polygon: tuple[Triple, Triple, Triple, Triple], skin: float
) -> bool:
    """Return whether the path with this control polygon stays on one side of a plane through `anchor` (m), by `skin`.

    The plane's `normal` is a unit vector.
    """
    start, out, back, end = polygon
    heights = (
        dot(normal, minus(start, anchor)),
        dot(normal, minus(out, anchor)),
        dot(normal, minus(back, anchor)),
        dot(normal, minus(end, anchor)),
    )
    # by more than what the path may differ from the polygon
    spread = OFF_CUBIC_SHARE * (max(heights) - min(heights))
    return min(heights) > spread + skin or max(heights) < -spread - skin


@compiled
def first_entry(
    terrain: MeshTerrain, path: ToolPath, h: float, load: Any, free: Array, near: IntArray
) -> tuple[float, int, Triple]:
    """Return when a flight of h seconds first enters the solid, through which triangle, and where (m).

    The time is infinite if it stays outside. `free` (6,), m, is a box known to hold no triangle: it spares the search,
    and is renewed here. `near` (t,) is room for the triangles that come near.
    """
    polygon = _control_polygon(path, h, load)
    low, high = _box_around(polygon)
    if (
        low[0] > free[0] and low[1] > free[1] and low[2] > free[2]
        and high[0] < free[3] and high[1] < free[4] and high[2] < free[5]
    ):  # fmt: skip
        return math.inf, -1, path.p
    count, room = near_triangles(terrain, low, high, near)
    # the box grows by the room around it; with triangles near it becomes empty, so that no later step is in it
    for axis in range(3):
        free[axis] = low[axis] - (room if count == 0 else -math.inf)
        free[3 + axis] = high[axis] + (room if count == 0 else -math.inf)
    first, best, place = math.inf, -1, path.p
    for row in range(count):
        k = near[row]
        normal = normal_of(terrain.faces, k)
        anchor = (terrain.anchors[k, 0], terrain.anchors[k, 1], terrain.anchors[k, 2])
        if _stays_on_one_side(normal, anchor, polygon, load.skin):
            continue
        time = first_fall(normal, anchor, path, 0.0, h, load.skin, load)
        while time < first:
            p, v = follow(path, time, load)
            if _lies_over(terrain, k, p) and not _grazes(terrain, k, p, v):
                first, best, place = time, k, p
                break
            # beside the triangle: it may rise and fall again
            time = first_fall(normal, anchor, path, time + FALL_GAP * h, h, load.skin, load)
    return first, best, place


@compiled
def _leads_into_face(terrain: MeshTerrain, k: int, i: int, v: Triple) -> bool:
    """Whether a velocity v (m/s) along the flat face of triangle k leads from its corner i into that face."""
    apex = corner_of(terrain.faces, terrain.vertices, k, i)
    j, corner = k, i
    while dot(v, v) > 0.0:
        p = minus(corner_of(terrain.faces, terrain.vertices, j, (corner + 1) % 3), apex)
        q = minus(corner_of(terrain.faces, terrain.vertices, j, (corner + 2) % 3), apex)
        n = normal_of(terrain.faces, j)
        # between p and q, which bound a triangle of the face at the apex
        if terrain.facets[j] == terrain.facets[k] and dot(cross(n, p), v) >= 0.0 and dot(cross(q, n), v) >= 0.0:
            return True
        j, corner = next_in_fan(terrain, j, corner)
        if j == k:
            break
    return False


@compiled
def first_edge(
    terrain: MeshTerrain, k: int, path: ToolPath, h: float, load: Any, near: IntArray
) -> tuple[float, int, Triple]:
    """Return when a slide of h seconds on the flat face of triangle k first passes an edge of that face.

    With the time, infinite if it stays on the face, come the triangle of the face that has the edge, and where (m).
    `near` (t,) is room for the triangles that come near.
    """
    polygon = _control_polygon(path, h, load)
    low, high = _box_around(polygon)
    count, _ = near_triangles(terrain, low, high, near)
    first, best, place = math.inf, -1, path.p
    for row in range(count):
        j = near[row]
        if terrain.facets[j] != terrain.facets[k]:
            continue
        for i in range(3):
            # an edge inside of the face is none
            if terrain.turns[j, i] == 0.0:
                continue
            e = edge_direction(terrain.faces, terrain.vertices, j, i)
            # n x e points into the triangle: to pass the edge is to fall through the plane with that normal
            inward = cross(path.contact_normal, e)
            a = corner_of(terrain.faces, terrain.vertices, j, i)
            b = corner_of(terrain.faces, terrain.vertices, j, (i + 1) % 3)
            if _stays_on_one_side(inward, a, polygon, load.rounding):
                continue
            time = first_fall(inward, a, path, 0.0, h, load.rounding, load)
            while time < first:
                p, v = follow(path, time, load)
                past_a, past_b = -dot(minus(p, a), e), dot(minus(p, b), e)
                # past this edge, and not past its ends, where others meet
                if past_a <= PLACE_REACH and past_b <= PLACE_REACH:
                    # over its very end, by rounding, and on in the face: round a corner of more than half a turn
                    ends = past_a >= -PLACE_REACH or past_b >= -PLACE_REACH
                    if not (ends and _leads_into_face(terrain, j, i if past_a >= -PLACE_REACH else (i + 1) % 3, v)):
                        first, best, place = time, j, p
                        break
                time = first_fall(inward, a, path, time + FALL_GAP * h, h, load.rounding, load)
    return first, best, place
