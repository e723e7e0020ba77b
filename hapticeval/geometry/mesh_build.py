"""Compiled building of a mesh's tables (see `mesh_kernels`), and what is found on the way that makes it none."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled, inner
from hapticeval.geometry.mesh_kernels import (
    ACROSS_COLUMN,
    BOX_ROUNDING,
    CORNER_COLUMN,
    LEAF,
    NORMAL_COLUMN,
    PSEUDO,
    RUN,
    TRIANGLE_TREE_DEPTH,
    box_middle,
    corner_of,
    neighbour_of,
    normal_of,
    position_of,
    product_error,
    vertex_of,
)
from hapticeval.geometry.triples import Triple, cross, dot, minus, plus
from hapticeval.records import as_record, room_for
from hapticeval.types import Array, IntArray

SOUND, FLAT_TRIANGLE, OPEN, SHARED, FLIPPED, PINCHED, OTHER_PART, FOLDED = range(8)
"""What is wrong with a triangle: see `mesh_input`."""

THINNEST_TRIANGLE = 1e-13
"""Least height of a triangle over its longest edge: below, its corners lie on one line to rounding."""
LEAST_OPENING = 1e-12
"""Least angle (rad) between two triangles that share an edge: below, one is folded onto the other."""
RUN_NUMBERS = room_for(RUN)

LONGEST_DISC_RUN, LEAST_MEAN_NORMAL = 4096, 0.5
"""Triangles of the longest run that has a disc, and the least length of the mean of their normals: others are bent."""
SEPARATION_ROUNDING = 1e-14
"""Gap between two triangles, as a share of their extent, that is no rounding."""


def cut_triangles(vertices: Array, triangles: IntArray) -> tuple[Array, IntArray]:
    """Return vertices (w, 3), m, and triangles (6 t, 3) with each of (t, 3) cut into six unequal ones in its plane.

    Each edge is cut at three tenths from its earlier vertex of (v, 3), and the pieces fan out from a point inside.
    """
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    ends, edge_of = np.unique(edges, axis=0, return_inverse=True)
    first, second = vertices[ends[:, 0]], vertices[ends[:, 1]]
    on_edges = first + 0.3 * (second - first)
    inside = np.einsum("k,tkn->tn", np.array([0.5, 0.3, 0.2]), vertices[triangles])
    count = len(triangles)
    cuts = len(vertices) + edge_of.reshape(3, count).T
    # a, the cut of ab, b, the cut of bc, c, the cut of ca
    ring = np.stack([triangles, cuts], axis=2).reshape(count, 6)
    centre = np.repeat(len(vertices) + len(ends) + np.arange(count), 6).reshape(count, 6)
    cells = np.stack([ring, np.roll(ring, -1, axis=1), centre], axis=2).reshape(-1, 3)
    return np.concatenate([vertices, on_edges, inside]), cells


@inner
def _difference(a: float, b: float) -> tuple[float, float]:
    """Return a - b as the rounded difference and what that lost (Knuth's two-sum)."""
    high = a - b
    # -b as far as the sum took it in; what is missing of both is the error
    minus_b = high - a
    return high, (a - (high - minus_b)) - (b + minus_b)


@inner
def _difference_of_products(
    a: tuple[float, float], b: tuple[float, float], c: tuple[float, float], d: tuple[float, float]
) -> float:
    """Return a b - c d of numbers in two parts, to rounding even where the products nearly cancel."""
    first, second = a[0] * b[0], c[0] * d[0]
    rounded_off = product_error(a[0], b[0], first) - product_error(c[0], d[0], second)
    # the exact products and the cross terms of the second parts; what is left is below rounding
    return (first - second) + (rounded_off + (a[0] * b[1] + a[1] * b[0] - c[0] * d[1] - c[1] * d[0]))


@inner
def area_normal(a: Triple, b: Triple, c: Triple) -> Triple:
    """Return (b - a) x (c - a) (m^2) to rounding, for slivers too: the normal of a triangle, twice its area long."""
    x, y, z = _difference(b[0], a[0]), _difference(b[1], a[1]), _difference(b[2], a[2])
    u, v, w = _difference(c[0], a[0]), _difference(c[1], a[1]), _difference(c[2], a[2])
    return _difference_of_products(y, w, z, v), _difference_of_products(z, u, x, w), _difference_of_products(x, v, y, u)


@compiled
def join_neighbours(count: int, triangles: IntArray) -> tuple[IntArray, int, int, int]:
    """Return the neighbours (t, 3) of triangles (t, 3) over `count` vertices, and the first problem.

    Neighbour i lies across the edge from corner i to the next, and runs along it the other way. A problem is what is
    wrong (`SOUND` if nothing), the triangle and its corner.
    """
    t = triangles.shape[0]
    # the corners at each vertex, one vertex after the other: counted, added up, filled in
    starts = np.zeros(count + 1, np.int64)
    for k in range(t):
        for i in range(3):
            starts[triangles[k, i] + 1] += 1
    for row in range(count):
        starts[row + 1] += starts[row]
    # an entry is 3 k + i: corner i of triangle k
    filled, fan = starts[:-1].copy(), np.empty(3 * t, np.int32)
    for k in range(t):
        for i in range(3):
            row = triangles[k, i]
            fan[filled[row]] = 3 * k + i
            filled[row] += 1
    across = np.full((t, 3), -1)
    for k in range(t):
        for i in range(3):
            a, b = triangles[k, i], triangles[k, (i + 1) % 3]
            # triangles that run along this edge the same way, itself included, and the other way
            along_count, against_count = 0, 0
            for place in range(starts[a], starts[a + 1]):
                if triangles[fan[place] // 3, (fan[place] + 1) % 3] == b:
                    along_count += 1
            for place in range(starts[b], starts[b + 1]):
                if triangles[fan[place] // 3, (fan[place] + 1) % 3] == a:
                    against_count += 1
                    across[k, i] = fan[place] // 3
            if along_count + against_count > 2:
                return across, SHARED, k, i
            if along_count == 2:
                return across, FLIPPED, k, i
            if against_count == 0:
                return across, OPEN, k, i
    # once round each vertex over the edges: fewer triangles than have it are one of several fans
    for row in range(count):
        if starts[row + 1] == starts[row]:
            continue
        first = fan[starts[row]]
        k, i, met = first // 3, first % 3, 0
        while met <= starts[row + 1] - starts[row]:
            k = across[k, i]
            met += 1
            i = 0 if triangles[k, 0] == row else 1 if triangles[k, 1] == row else 2
            if k == first // 3:
                break
        if met < starts[row + 1] - starts[row]:
            return across, PINCHED, first // 3, first % 3
    return across, SOUND, -1, -1


@compiled
def other_component(across: IntArray) -> int:
    """Return a triangle that no way over edges joins to triangle 0, or -1; `across` (t, 3) are the neighbours."""
    t = across.shape[0]
    reached, queue = np.zeros(t, np.bool_), np.empty(t, np.int32)
    reached[0], queue[0] = True, 0
    count, done = 1, 0
    # breadth first from triangle 0
    while done < count:
        for i in range(3):
            neighbour = across[queue[done], i]
            if not reached[neighbour]:
                reached[neighbour], queue[count] = True, neighbour
                count += 1
        done += 1
    for k in range(t):
        if not reached[k]:
            return k
    return -1


@compiled
def volume(vertices: Array, triangles: IntArray) -> float:
    """Return the volume (m^3) that triangles (t, 3) over vertices (v, 3), m, enclose.

    It is positive where the corners run anticlockwise seen from outside.
    """
    total = 0.0
    # tetrahedra to one vertex, not to the origin of coordinates: no digits are lost far from it
    origin = position_of(vertices, triangles[0, 0])
    for k in range(triangles.shape[0]):
        a = minus(position_of(vertices, triangles[k, 0]), origin)
        b = minus(position_of(vertices, triangles[k, 1]), origin)
        total += dot(a, cross(b, minus(position_of(vertices, triangles[k, 2]), origin)))
    return total / 6.0


@inner
def _swap(keys: Array, order: IntArray, i: int, j: int) -> None:
    """Exchange two rows of the keys and of the order."""
    for axis in range(3):
        keys[i, axis], keys[j, axis] = keys[j, axis], keys[i, axis]
    order[i], order[j] = order[j], order[i]


@inner
def _partition(keys: Array, order: IntArray, low: int, high: int, middle: int, axis: int) -> None:
    """Put the rows from low up to high in such an order that none before `middle` has a larger key (Hoare)."""
    high -= 1
    while low < high:
        # Hoare's selection: only the part that holds `middle` is divided further
        pivot = keys[(low + high) // 2, axis]
        i, j = low, high
        while i <= j:
            while keys[i, axis] < pivot:
                i += 1
            while keys[j, axis] > pivot:
                j -= 1
            if i <= j:
                _swap(keys, order, i, j)
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@compiled
def leaf_order(vertices: Array, triangles: IntArray) -> IntArray:
    """Return the triangles (t,) in the order of a tree's leaves: halved along the longest side of their middles.

    `vertices` (v, 3), m, and `triangles` (t, 3) are those of the mesh.
    """
    n = triangles.shape[0]
    m = leaf_count(n)
    middles, order = np.empty((n, 3)), np.arange(n)
    for k in range(n):
        for axis in range(3):
            first, second = vertices[triangles[k, 0], axis], vertices[triangles[k, 1], axis]
            third = vertices[triangles[k, 2], axis]
            middles[k, axis] = 0.5 * (min(first, second, third) + max(first, second, third))
    level = 1
    while level < m:
        # runs of a level are cut where `build_tree` expects: at j n // level
        for j in range(level):
            low, high = j * n // level, (j + 1) * n // level
            longest, axis = -1.0, 0
            for candidate in range(3):
                lowest, highest = middles[low, candidate], middles[low, candidate]
                for k in range(low, high):
                    lowest, highest = min(lowest, middles[k, candidate]), max(highest, middles[k, candidate])
                if highest - lowest > longest:
                    longest, axis = highest - lowest, candidate
            _partition(middles, order, low, high, (2 * j + 1) * n // (2 * level), axis)
        level *= 2
    return order


@compiled
def leaf_count(n: int) -> int:
    """Return the number of leaves of a tree over n triangles."""
    m = 1
    # a power of two, with LEAF triangles or more in each
    while m * 2 * LEAF <= n:
        m *= 2
    return m


@compiled
def build_tables(
    positions: Array, triangles: IntArray, across: IntArray, order: IntArray
) -> tuple[Array, Array, int, int]:
    """Return `faces` (t, 9) and `vertices` (v, 6), see `mesh_kernels`, and the first problem: what, and which triangle.

    They are made of `positions` (p, 3), m, `triangles` (t, 3) and their neighbours `across` (t, 3), in the given
    `order` (t,). The triangle of a problem has the number that it has in `triangles`.
    """
    n = triangles.shape[0]
    faces, vertices = np.empty((n, 9)), np.zeros((positions.shape[0], 6))
    rank, row_of = np.empty(n, np.int32), np.full(positions.shape[0], -1, np.int32)
    for k in range(n):
        # where each triangle comes to stand
        rank[order[k]] = k
    used = 0
    for k in range(n):
        triangle = order[k]
        for i in range(3):
            vertex = triangles[triangle, i]
            # vertices in the order of their first use; those that no triangle has get no row
            if row_of[vertex] < 0:
                row_of[vertex] = used
                for axis in range(3):
                    vertices[used, axis] = positions[vertex, axis]
                used += 1
            faces[k, CORNER_COLUMN + i], faces[k, ACROSS_COLUMN + i] = row_of[vertex], rank[across[triangle, i]]
        a, b, c = (
            corner_of(faces, vertices, k, 0),
            corner_of(faces, vertices, k, 1),
            corner_of(faces, vertices, k, 2),
        )
        normal = area_normal(a, b, c)
        area = math.sqrt(dot(normal, normal))
        edges = (minus(b, a), minus(c, b), minus(a, c))
        lengths_squared = (dot(edges[0], edges[0]), dot(edges[1], edges[1]), dot(edges[2], edges[2]))
        # twice the area over the longest edge is the height of the triangle
        if not area > THINNEST_TRIANGLE * max(lengths_squared):
            return faces, vertices, FLAT_TRIANGLE, triangle
        for axis in range(3):
            faces[k, NORMAL_COLUMN + axis] = normal[axis] / area
        for i in range(3):
            # the angle at corner i, between its two edges: sin and cos of it times both lengths
            angle = math.atan2(area, -dot(edges[i], edges[(i + 2) % 3]))
            row = vertex_of(faces, k, i)
            for axis in range(3):
                vertices[row, PSEUDO + axis] += angle * faces[k, NORMAL_COLUMN + axis]
    for k in range(n):
        for i in range(3):
            normal_here, normal_across = normal_of(faces, k), normal_of(faces, neighbour_of(faces, k, i))
            total = plus(normal_here, 1.0, normal_across)
            # normals nearly opposite: their sum is as long as the angle between the triangles
            if dot(total, total) <= LEAST_OPENING * LEAST_OPENING:
                return faces, vertices, FOLDED, order[k]
    for row in range(used):
        # a unit pseudonormal of each vertex
        size = 0.0
        for axis in range(3):
            size = math.hypot(size, vertices[row, PSEUDO + axis])
        for axis in range(3):
            vertices[row, PSEUDO + axis] /= max(size, 1e-300)
    return faces, vertices[:used], SOUND, -1


@compiled
def build_tree(faces: Array, vertices: Array) -> Array:
    """Return the tree (2 m, 11) over triangles in the order of its leaves, see `mesh_kernels`: boxes and discs, m.

    `faces` (t, 9) and `vertices` (v, 6) are the tables of the mesh.
    """
    n = faces.shape[0]
    m = leaf_count(n)
    tree = np.zeros((2 * m, RUN_NUMBERS))
    # from the leaves up: a box holds those of its halves
    for i in range(2 * m - 1, 0, -1):
        for axis in range(3):
            if i < m:
                tree[i, axis] = min(tree[2 * i, axis], tree[2 * i + 1, axis])
                tree[i, 3 + axis] = max(tree[2 * i, 3 + axis], tree[2 * i + 1, 3 + axis])
                continue
            lowest, highest = math.inf, -math.inf
            for k in range((i - m) * n // m, (i - m + 1) * n // m):
                for corner in range(3):
                    coordinate = vertices[vertex_of(faces, k, corner), axis]
                    lowest, highest = min(lowest, coordinate), max(highest, coordinate)
            tree[i, axis], tree[i, 3 + axis] = lowest, highest
    # boxes are widened by the rounding of coordinates as large as these
    slack = 0.0
    for axis in range(3):
        slack = max(slack, abs(tree[1, axis]), abs(tree[1, 3 + axis]), tree[1, 3 + axis] - tree[1, axis])
    for i in range(1, 2 * m):
        for axis in range(3):
            tree[i, axis] -= BOX_ROUNDING * slack
            tree[i, 3 + axis] += BOX_ROUNDING * slack
    for i in range(1, 2 * m):
        _write_disc(faces, vertices, tree, i, BOX_ROUNDING * slack)
    return tree


@compiled
def _write_disc(faces: Array, vertices: Array, tree: Array, i: int, slack: float) -> None:
    """Write the disc of row i, square to the mean of the normals of its run, with `slack` (m) for rounding."""
    n, m = faces.shape[0], tree.shape[0] // 2
    # down to the leaves of this run, and so to its triangles
    first, last = i, i + 1
    while first < m:
        first, last = 2 * first, 2 * last
    begin, end = (first - m) * n // m, (last - m) * n // m
    run = as_record(tree, RUN, i)
    run.radius = run.half_thickness = math.inf
    # no disc, infinite: too many triangles to be flat, or too bent
    if end - begin > LONGEST_DISC_RUN:
        return
    mean = (0.0, 0.0, 0.0)
    for k in range(begin, end):
        mean = plus(mean, 1.0, normal_of(faces, k))
    size = math.sqrt(dot(mean, mean))
    if size < LEAST_MEAN_NORMAL * (end - begin):
        return
    mean, middle = (mean[0] / size, mean[1] / size, mean[2] / size), box_middle(tree, i)
    radius_squared, half_thickness = 0.0, 0.0
    for k in range(begin, end):
        for corner in range(3):
            q = minus(corner_of(faces, vertices, k, corner), middle)
            aside = cross(mean, q)
            radius_squared = max(radius_squared, dot(aside, aside))
            half_thickness = max(half_thickness, abs(dot(mean, q)))
    run.normal_x, run.normal_y, run.normal_z = mean
    run.radius, run.half_thickness = math.sqrt(radius_squared) + slack, half_thickness + slack


@inner
def _separates(axis: Triple, first: Array, second: Array, from_one: int) -> bool:
    """Whether two triangles (3, 3) lie on different sides of a plane of normal `axis`, by more than rounding.

    Of triangles that share a corner, which is the origin and the first row of both, one may touch the plane with more.
    """
    # rounding of the products goes with the axis's and the coordinates' sizes
    size = abs(axis[0]) + abs(axis[1]) + abs(axis[2])
    extent = 0.0
    low, high, below, above = math.inf, -math.inf, math.inf, -math.inf
    for row in range(from_one, 3):
        first_height = axis[0] * first[row, 0] + axis[1] * first[row, 1] + axis[2] * first[row, 2]
        second_height = axis[0] * second[row, 0] + axis[1] * second[row, 1] + axis[2] * second[row, 2]
        low, high = min(low, first_height), max(high, first_height)
        below, above = min(below, second_height), max(above, second_height)
        for i in range(3):
            extent = max(extent, abs(first[row, i]), abs(second[row, i]))
    gap = SEPARATION_ROUNDING * size * extent
    # nothing shared: a gap, to either side
    if from_one == 0:
        return bool(below - high > gap or low - above > gap)
    # with the shared corner in the plane, one triangle may touch it and the other not
    small_gap = 0.1 * gap
    return bool(
        (high <= small_gap and below > gap)
        or (high < -gap and below >= -small_gap)
        or (above <= small_gap and low > gap)
        or (above < -gap and low >= -small_gap)
    )


@inner
def _meet_as_neighbours(faces: Array, vertices: Array, j: int, k: int, first: Array, second: Array) -> bool:
    """Whether triangles j and k have nothing in common but the corner or the edge that they share, beyond rounding."""
    shared, first_corner, second_corner = 0, 0, 0
    for i in range(3):
        for h in range(3):
            if vertex_of(faces, j, i) == vertex_of(faces, k, h):
                shared, first_corner, second_corner = shared + 1, i, h
    # two shared corners: neighbours over an edge, which `FOLDED` has decided
    if shared > 1:
        return True
    # both triangles seen from the shared corner, which is exact then
    origin = corner_of(faces, vertices, j, first_corner)
    for i in range(3):
        a = minus(corner_of(faces, vertices, j, (first_corner + i) % 3), origin)
        b = minus(corner_of(faces, vertices, k, (second_corner + i) % 3), origin)
        for axis in range(3):
            first[i, axis], second[i, axis] = a[axis], b[axis]
    n, p = normal_of(faces, j), normal_of(faces, k)
    # separating axes of two triangles: both normals, then products of edges
    if _separates(n, first, second, shared) or _separates(p, first, second, shared):
        return True
    for i in range(3):
        e = (
            first[(i + 1) % 3, 0] - first[i, 0],
            first[(i + 1) % 3, 1] - first[i, 1],
            first[(i + 1) % 3, 2] - first[i, 2],
        )
        if _separates(cross(n, e), first, second, shared):
            return True
        for h in range(3):
            o = (h + 1) % 3
            f = (second[o, 0] - second[h, 0], second[o, 1] - second[h, 1], second[o, 2] - second[h, 2])
            if i == 0 and _separates(cross(p, f), first, second, shared):
                return True
            if _separates(cross(e, f), first, second, shared):
                return True
    return False


@compiled
def suspect_pairs(faces: Array, vertices: Array, tree: Array, begin: int, most_pairs: int) -> tuple[IntArray, int]:
    """Return pairs (up to `most_pairs`, 2) of triangles that may cross or touch, and where to go on.

    `faces` (t, 9), `vertices` (v, 6), m, and `tree` (2 m, 11) are the mesh. The first of each pair is triangle `begin`
    or a later one.

    Pairs that are not returned are separated by a plane, by more than rounding.
    """
    n, m = faces.shape[0], tree.shape[0] // 2
    pairs, count = np.empty((most_pairs, 2), np.int64), 0
    stack, first, second = np.empty(TRIANGLE_TREE_DEPTH, np.int64), np.empty((3, 3)), np.empty((3, 3))
    for j in range(begin, n):
        a, b, c = (
            corner_of(faces, vertices, j, 0),
            corner_of(faces, vertices, j, 1),
            corner_of(faces, vertices, j, 2),
        )
        xl, yl, zl = min(a[0], b[0], c[0]), min(a[1], b[1], c[1]), min(a[2], b[2], c[2])
        xh, yh, zh = max(a[0], b[0], c[0]), max(a[1], b[1], c[1]), max(a[2], b[2], c[2])
        stack[0] = 1
        top, before = 1, count
        while top > 0:
            top -= 1
            i = stack[top]
            # the boxes are apart
            if xl > tree[i, 3] or yl > tree[i, 4] or zl > tree[i, 5]:
                continue
            if xh < tree[i, 0] or yh < tree[i, 1] or zh < tree[i, 2]:
                continue
            # all triangles of this run come before j: their pairs have been looked at
            last = i
            while last < m:
                last = 2 * last + 1
            if (last - m + 1) * n // m <= j + 1:
                continue
            if i < m:
                stack[top], stack[top + 1] = 2 * i + 1, 2 * i
                top += 2
                continue
            for k in range(max((i - m) * n // m, j + 1), (i - m + 1) * n // m):
                if _meet_as_neighbours(faces, vertices, j, k, first, second):
                    continue
                # full: give back the pairs of whole triangles, and begin again with this one
                if count == most_pairs:
                    return (pairs[:before], j) if before > 0 else (pairs, j + 1)
                pairs[count, 0], pairs[count, 1] = j, k
                count += 1
    return pairs[:count], n
