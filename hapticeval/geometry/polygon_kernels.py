"""Compiled queries of a simple anticlockwise polygon: nearest point, side, first crossing.

Edge k runs from vertex k to vertex k + 1 (the last one back to vertex 0). The tree is one array (2 m, 6), m a power of
two:

- row 0 is not used, and row 1 is the whole outline;
- row i has the halves 2 i and 2 i + 1;
- row m + j is a leaf that holds the edges from j n // m up to (j + 1) n // m.

A row bounds its run of edges by a capsule: no point of the run is farther than the radius from the straight chord
between the run's ends.

    x, y of the chord's start; dx, dy to its end; 1 / (dx^2 + dy^2), or 0; radius

Capsules, not boxes: along a smooth outline a run of length l strays from its chord by order l^2, where the slack of a
box is of order l.

So a query looks into a bounded number of runs of each length, and its cost grows as log n.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.types import Array

EDGES_PER_LEAF = 8
EDGE_TREE_DEPTH = 128
TOUCH_SHARE, COORDINATE_ROUNDING = 1e-12, 2e-15
"""A point this close to an edge, in parts of the polygon's extent and of its distance from the origin, is on it.

The second is the rounding of coordinates and of a few sums of them: far from the origin it is the larger one.
"""


def build_tree(vertices: Array) -> Array:
    """Return the tree (2 m, 6) of capsules over the edges of vertices (n, 2), m: see the module's text for its rows."""
    n = vertices.shape[0]
    m = 1
    while m * 2 * EDGES_PER_LEAF <= n:
        m *= 2
    tree = np.zeros((2 * m, 6))
    level = m
    # level by level from the leaves up: the runs of a level stand in the rows from `level` on
    while level >= 1:
        stops = np.arange(level + 1) * n // level
        start, end = vertices[stops[:-1]], vertices[stops[1:] % n]
        chord = end - start
        length_squared = chord[:, 0] * chord[:, 0] + chord[:, 1] * chord[:, 1]
        # 0 for a run that closes on itself: its chord is a point
        inverse = np.divide(1.0, length_squared, out=np.zeros(level), where=length_squared > 0.0)
        # the run strays no farther from its chord than its vertices do, the last of them included
        run = np.repeat(np.arange(level), np.diff(stops))
        strays = _squares_from_chords(vertices - start[run], chord[run], inverse[run])
        farthest = np.maximum(np.maximum.reduceat(strays, stops[:-1]), _squares_from_chords(chord, chord, inverse))
        # the slack covers the rounding of chord distances, so that pruning never loses the nearest edge
        reach = np.abs(start[:, 0]) + np.abs(start[:, 1])
        radius = np.sqrt(farthest) * (1.0 + 1e-14) + 1e-15 * (reach + np.sqrt(length_squared))
        tree[level : 2 * level] = np.column_stack([start, chord, inverse, radius])
        level //= 2
    return tree


def _squares_from_chords(points: Array, chords: Array, inverse: Array) -> Array:
    """Return the squared distances (n,), m^2, of points (n, 2) from chords (n, 2), m, that begin at the origin.

    `inverse` (n,), 1/m^2, is one over a chord's squared length.
    """
    share = np.clip((points[:, 0] * chords[:, 0] + points[:, 1] * chords[:, 1]) * inverse, 0.0, 1.0)
    aside = points - share[:, np.newaxis] * chords
    return np.asarray(aside[:, 0] ** 2 + aside[:, 1] ** 2)


@compiled
def _chord_distance_squared(tree: Array, i: int, x: float, y: float) -> float:
    """Return the squared distance (m^2) of (x, y) from the chord of row i of the tree."""
    px, py = x - tree[i, 0], y - tree[i, 1]
    dx, dy = tree[i, 2], tree[i, 3]
    t = min(max((px * dx + py * dy) * tree[i, 4], 0.0), 1.0)
    qx, qy = px - t * dx, py - t * dy
    return float(qx * qx + qy * qy)


@compiled
def nearest_kernel(vertices: Array, tree: Array, x: float, y: float) -> tuple[int, float, float]:
    """Return the nearest point of the outline to (x, y), m: (edge, t along it in [0, 1), squared distance in m^2).

    `vertices` (n, 2), m, and `tree` (2 m, 6). The end of an edge is given as the start of the next, so t = 0 means a
    vertex.
    """
    n, m = vertices.shape[0], tree.shape[0] // 2
    nodes = np.empty(EDGE_TREE_DEPTH, np.int64)
    bounds = np.empty(EDGE_TREE_DEPTH)
    nodes[0], bounds[0] = 1, 0.0
    top = 1
    best_squared, best = np.inf, np.inf
    edge, along = 0, 0.0
    while top > 0:
        top -= 1
        i = nodes[top]
        limit = best + tree[i, 5]
        # no point of the run is nearer than its chord less its radius
        if bounds[top] > limit * limit:
            continue
        # down into the half with the nearer chord, the other put off unless it is too far
        while i < m:
            near_child, far_child = 2 * i, 2 * i + 1
            near_squared, far_squared = (
                _chord_distance_squared(tree, near_child, x, y),
                _chord_distance_squared(tree, far_child, x, y),
            )
            if far_squared < near_squared:
                near_child, far_child, near_squared, far_squared = far_child, near_child, far_squared, near_squared
            limit = best + tree[far_child, 5]
            if far_squared <= limit * limit:
                nodes[top], bounds[top] = far_child, far_squared
                top += 1
            limit = best + tree[near_child, 5]
            if near_squared > limit * limit:
                i = -1
                break
            i = near_child
        if i < 0:
            continue
        j = i - m
        for k in range(j * n // m, (j + 1) * n // m):
            next_vertex = k + 1 if k + 1 < n else 0
            ax, ay = vertices[k, 0], vertices[k, 1]
            dx, dy = vertices[next_vertex, 0] - ax, vertices[next_vertex, 1] - ay
            px, py = x - ax, y - ay
            dot, length_squared = px * dx + py * dy, dx * dx + dy * dy
            # before the start of the edge, past its end, or beside it
            if dot <= 0.0:
                t, distance_squared = 0.0, px * px + py * py
            elif dot >= length_squared:
                qx, qy = x - vertices[next_vertex, 0], y - vertices[next_vertex, 1]
                t, distance_squared = 1.0, qx * qx + qy * qy
            else:
                cross = px * dy - py * dx
                # the doubled area over the length is the distance: exact close to the edge
                t, distance_squared = dot / length_squared, cross / length_squared * cross
            if distance_squared < best_squared:
                best_squared, edge, along = distance_squared, k, t
                best = math.sqrt(best_squared)
    # the end of this edge is the start of the next
    if along >= 1.0:
        edge, along = (edge + 1 if edge + 1 < n else 0), 0.0
    return edge, along, best_squared


@compiled
def _doubled_area(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Return twice the area of the triangle a, b, (x, y): positive where the point is left of a to b."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@compiled
def side_kernel(vertices: Array, edge: int, along: float, x: float, y: float) -> float:
    """Return -1.0 inside, 1.0 outside or on the outline, of a point (x, y), m, whose nearest point is known.

    `vertices` (n, 2), m; the nearest point lies `along` an `edge` as `nearest_kernel` gives it. Where that is a vertex,
    the vertex alone decides: only points outside are nearest to a convex one.

    At one that turns by less than a right angle they lie on the side of its mean normal; so they do where rounding
    alone makes it nearest, and its turn is rounding.
    """
    n = vertices.shape[0]
    next_vertex = edge + 1 if edge + 1 < n else 0
    ax, ay, bx, by = vertices[edge, 0], vertices[edge, 1], vertices[next_vertex, 0], vertices[next_vertex, 1]
    if along == 0.0:
        before = edge - 1 if edge > 0 else n - 1
        px, py, qx, qy = ax - vertices[before, 0], ay - vertices[before, 1], bx - ax, by - ay
        # a turn below 90 degrees: the side of the mean of both unit tangents
        if px * qx + py * qy > 0.0:
            first, last = math.hypot(px, py), math.hypot(qx, qy)
            dx, dy = last * px + first * qx, last * py + first * qy
            return -1.0 if dx * (y - ay) - dy * (x - ax) > 0.0 else 1.0
        turn = px * qy - py * qx
        # a sharp corner: outside of a convex one, inside of a concave one
        if turn != 0.0 and (x != ax or y != ay):
            return 1.0 if turn > 0.0 else -1.0
    return -1.0 if _doubled_area(ax, ay, bx, by, x, y) > 0.0 else 1.0


@compiled
def _vertex_at(vertices: Array, k: int, reach: float, x: float, y: float) -> int:
    """Return the end of edge k that a point on it coincides with, within `reach` (m), or -1."""
    next_vertex = k + 1 if k + 1 < vertices.shape[0] else 0
    # the start first: of two vertices within reach it is the same one each time
    if math.hypot(x - vertices[k, 0], y - vertices[k, 1]) <= reach:
        return k
    if math.hypot(x - vertices[next_vertex, 0], y - vertices[next_vertex, 1]) <= reach:
        return next_vertex
    return -1


@compiled
def _edge_entered_at(vertices: Array, vertex: int, x1: float, y1: float) -> int:
    """Return the edge through which a segment that passes a vertex on its way to (x1, y1) goes inside there, or -1.

    At a convex vertex the inside is left of both edges, at a concave one left of either. Of the two the edge counts
    that the segment runs into more squarely.
    """
    n = vertices.shape[0]
    before = vertex - 1 if vertex > 0 else n - 1
    after = vertex + 1 if vertex + 1 < n else 0
    ax, ay = vertices[before, 0], vertices[before, 1]
    bx, by = vertices[vertex, 0], vertices[vertex, 1]
    cx, cy = vertices[after, 0], vertices[after, 1]
    # positive where the segment's end is left of the edge before, and of the one after
    first, second = _doubled_area(ax, ay, bx, by, x1, y1), _doubled_area(bx, by, cx, cy, x1, y1)
    convex = _doubled_area(ax, ay, bx, by, cx, cy) >= 0.0
    if (convex and min(first, second) <= 0.0) or max(first, second) <= 0.0:
        return -1
    return before if first * math.hypot(cx - bx, cy - by) > second * math.hypot(bx - ax, by - ay) else vertex


@compiled
def _passes_ahead(vertices: Array, vertex: int, touch: float, x: float, y: float, x1: float, y1: float) -> bool:
    """Whether a segment from (x, y) to (x1, y1) passes a vertex ahead of it within `touch`."""
    dx, dy = x1 - x, y1 - y
    length = math.hypot(dx, dy)
    px, py = vertices[vertex, 0] - x, vertices[vertex, 1] - y
    along = px * dx + py * dy
    # ahead by more than touch, before the end, and no farther aside than touch
    return bool(touch * length < along < length * length and abs(px * dy - py * dx) <= touch * length)


@compiled
def _entrance_after(vertices: Array, vertex: int, touch: float, x1: float, y1: float) -> tuple[int, int]:
    """Return the (edge, vertex) at which a segment that passes `vertex` goes inside, there or after edges along it.

    An edge that lies on the segment within `touch` is no crossing, but its end may be: at a concave vertex the segment
    runs on into the inside. (-1, -1) if it does not go inside.
    """
    n = vertices.shape[0]
    # along edges that lie on the segment, at most once round
    for _ in range(n):
        edge = _edge_entered_at(vertices, vertex, x1, y1)
        if edge >= 0:
            return edge, vertex
        after, before = (vertex + 1 if vertex + 1 < n else 0), (vertex - 1 if vertex > 0 else n - 1)
        x, y = vertices[vertex, 0], vertices[vertex, 1]
        if _passes_ahead(vertices, after, touch, x, y, x1, y1):
            vertex = after
        elif _passes_ahead(vertices, before, touch, x, y, x1, y1):
            vertex = before
        else:
            break
    return -1, -1


@compiled
def _share_along_edge(vertices: Array, k: int, x: float, y: float) -> float:
    """Return where along edge k, in [0, 1], a point on it is."""
    next_vertex = k + 1 if k + 1 < vertices.shape[0] else 0
    dx, dy = vertices[next_vertex, 0] - vertices[k, 0], vertices[next_vertex, 1] - vertices[k, 1]
    along = (x - vertices[k, 0]) * dx + (y - vertices[k, 1]) * dy
    return float(min(max(along / (dx * dx + dy * dy), 0.0), 1.0))


@compiled
def first_entry_kernel(
    vertices: Array, tree: Array, x0: float, y0: float, x1: float, y1: float
) -> tuple[int, float, float]:
    """Return where the segment from (x0, y0), outside or on the outline, to (x1, y1), m, first goes inside.

    As (edge, t along it in [0, 1], fraction of the segment in [0, 1]); edge -1 if it never does. `vertices` (n, 2), m,
    and `tree` (2 m, 6).

    - Each vertex counts as left or right of the segment's line by one and the same number for both of its edges, so
      that a segment through a vertex meets exactly one of them.
    - A start on the outline, to rounding, is decided by the edges there.
    - An end that is inside has been gone into, whatever rounding says.
    """
    length = math.hypot(x1 - x0, y1 - y0)
    if length == 0.0:
        return -1, 0.0, 0.0
    start, _, distance_squared = nearest_kernel(vertices, tree, x0, y0)
    distance = math.sqrt(distance_squared)
    # the tree's first row has the extent as its radius, and a point of the outline
    touch = TOUCH_SHARE * tree[1, 5] + COORDINATE_ROUNDING * (abs(tree[1, 0]) + abs(tree[1, 1]))
    # too far away to be reached
    if distance > length + touch:
        return -1, 0.0, 0.0
    on_outline = distance <= touch
    if on_outline:
        edge, t, fraction = _entered_from_outline(vertices, start, touch, x0, y0, x1, y1)
        if edge >= 0:
            return edge, t, fraction
    edge, t, fraction = _first_edge_crossed(vertices, tree, touch, on_outline, x0, y0, x1, y1)
    if edge >= 0:
        return edge, t, fraction
    # crossed nothing, by rounding, and yet the end is inside
    edge, along, distance_squared = nearest_kernel(vertices, tree, x1, y1)
    if distance_squared > touch * touch and side_kernel(vertices, edge, along, x1, y1) < 0.0:
        return edge, along, 1.0
    return -1, 0.0, 0.0


@compiled
def _entered_from_outline(
    vertices: Array, start: int, touch: float, x0: float, y0: float, x1: float, y1: float
) -> tuple[int, float, float]:
    """Return where a segment from a point of the edge `start` goes in: there, or at the end of an edge that it follows.

    As `first_entry_kernel` does; edge -1 if it goes in at neither: it may do so later. `vertices` (n, 2), m.
    """
    vertex = _vertex_at(vertices, start, touch, x0, y0)
    passes = vertex
    if vertex < 0:
        next_vertex = start + 1 if start + 1 < vertices.shape[0] else 0
        ax, ay, bx, by = vertices[start, 0], vertices[start, 1], vertices[next_vertex, 0], vertices[next_vertex, 1]
        # the segment's end lies on the inner side of the edge
        if _doubled_area(ax, ay, bx, by, x1, y1) > 0.0:
            return start, _share_along_edge(vertices, start, x0, y0), 0.0
        for end in (start, next_vertex):
            if _passes_ahead(vertices, end, touch, x0, y0, x1, y1):
                passes = end
    if passes < 0:
        return -1, 0.0, 0.0
    edge, entrance = _entrance_after(vertices, passes, touch, x1, y1)
    if edge < 0:
        return -1, 0.0, 0.0
    if entrance == vertex:
        return edge, _share_along_edge(vertices, edge, x0, y0), 0.0
    return edge, (0.0 if edge == entrance else 1.0), _fraction_at_vertex(vertices, entrance, x0, y0, x1, y1)


@compiled
def _fraction_at_vertex(vertices: Array, vertex: int, x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the fraction of the segment from (x0, y0) to (x1, y1), m, that is abreast of a vertex of (n, 2), m."""
    sx, sy = x1 - x0, y1 - y0
    length = math.hypot(sx, sy)
    along = (vertices[vertex, 0] - x0) * sx + (vertices[vertex, 1] - y0) * sy
    return float(along / (length * length))


@compiled
def _first_edge_crossed(
    vertices: Array, tree: Array, touch: float, on_outline: bool, x0: float, y0: float, x1: float, y1: float
) -> tuple[int, float, float]:
    """Return the first edge that the segment crosses inwards, by the tree: as `first_entry_kernel` does.

    `vertices` (n, 2), m, and `tree` (2 m, 6); the segment starts `on_outline`, to `touch` (m), or off it.
    """
    n, m = vertices.shape[0], tree.shape[0] // 2
    best, best_edge, best_t = np.inf, -1, 0.0
    nodes = np.empty(EDGE_TREE_DEPTH, np.int64)
    nodes[0] = 1
    top = 1
    while top > 0:
        top -= 1
        i = nodes[top]
        if _is_off_run(tree, i, touch, min(best, 1.0), x0, y0, x1, y1):
            continue
        if i < m:
            nodes[top], nodes[top + 1] = 2 * i, 2 * i + 1
            top += 2
            continue
        j = i - m
        for k in range(j * n // m, (j + 1) * n // m):
            edge, t, fraction = _crossing_of_edge(vertices, k, touch, on_outline, best, x0, y0, x1, y1)
            if edge >= 0:
                best, best_edge, best_t = fraction, edge, t
    return best_edge, best_t, (best if best_edge >= 0 else 0.0)


@compiled
def _is_off_run(tree: Array, i: int, touch: float, end: float, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Return whether the segment up to its fraction `end` cannot meet the run of edges in row i of `tree` (2 m, 6).

    A run lies within its capsule: its chord decides, widened by the radius and by `touch` (m).
    """
    sx, sy = x1 - x0, y1 - y0
    length = math.hypot(sx, sy)
    ax, ay = tree[i, 0], tree[i, 1]
    bx, by = ax + tree[i, 2], ay + tree[i, 3]
    slack = tree[i, 5] * length + touch * length
    a_side, b_side = _doubled_area(x0, y0, x1, y1, ax, ay), _doubled_area(x0, y0, x1, y1, bx, by)
    # all of the run on one side of the line
    if (a_side > slack and b_side > slack) or (a_side < -slack and b_side < -slack):
        return True
    a_along, b_along = (ax - x0) * sx + (ay - y0) * sy, (bx - x0) * sx + (by - y0) * sy
    # all of it behind the start
    if a_along < -slack and b_along < -slack:
        return True
    # all of it past the end
    last = length * length * end + slack
    return bool(a_along > last and b_along > last)


@compiled
def _crossing_of_edge(
    vertices: Array, k: int, touch: float, on_outline: bool, best: float, x0: float, y0: float, x1: float, y1: float
) -> tuple[int, float, float]:
    """Return where the segment crosses edge k inwards before its fraction `best`: as `first_entry_kernel` does.

    `vertices` (n, 2), m. The edge that is returned is another where it crosses at a vertex, and -1 where it does not.
    """
    next_vertex = k + 1 if k + 1 < vertices.shape[0] else 0
    ax, ay, bx, by = vertices[k, 0], vertices[k, 1], vertices[next_vertex, 0], vertices[next_vertex, 1]
    a_side, b_side = _doubled_area(x0, y0, x1, y1, ax, ay), _doubled_area(x0, y0, x1, y1, bx, by)
    # inwards an edge is crossed from its right to its left: a left of the segment, b right of it
    if not (a_side > 0.0 >= b_side):
        return -1, 0.0, 0.0
    before, after = _doubled_area(ax, ay, bx, by, x0, y0), _doubled_area(ax, ay, bx, by, x1, y1)
    # the start is right of the edge and the end left of it, or it is not crossed
    if before > 0.0 or after <= 0.0:
        return -1, 0.0, 0.0
    if on_outline and -before <= touch * math.hypot(bx - ax, by - ay):
        return -1, 0.0, 0.0  # it starts on this edge and was found not to go in
    fraction, t = before / (before - after), a_side / (a_side - b_side)
    if fraction >= best:
        return -1, 0.0, 0.0
    vertex = _vertex_at(vertices, k, touch, ax + t * (bx - ax), ay + t * (by - ay))
    if vertex < 0:
        return k, t, fraction
    edge, entrance = _entrance_after(vertices, vertex, touch, x1, y1)
    if edge < 0:
        return -1, 0.0, 0.0  # it only touches the vertex
    if entrance != vertex:
        fraction = _fraction_at_vertex(vertices, entrance, x0, y0, x1, y1)
        if fraction >= best:
            return -1, 0.0, 0.0
    # at a vertex: the start of the edge that goes in, or its end
    return edge, (0.0 if edge == entrance else 1.0), fraction


@compiled
def signed_distances(vertices: Array, tree: Array, points: Array) -> Array:
    """Return the signed distances (n,), m, negative inside, of points (n, 2), m, from the outline.

    `vertices` (v, 2), m, and `tree` (2 m, 6) are the outline's.
    """
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        edge, along, distance_squared = nearest_kernel(vertices, tree, points[i, 0], points[i, 1])
        out[i] = side_kernel(vertices, edge, along, points[i, 0], points[i, 1]) * math.sqrt(distance_squared)
    return out
