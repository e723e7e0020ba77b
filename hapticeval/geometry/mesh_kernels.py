"""Compiled queries of a closed triangle mesh: closest point and side, crossings of a segment, cones of normals.

A mesh is three tables; indices in them are whole numbers in float64. A row of `faces` (t, 9) is a triangle:

- the rows of its corners in `vertices`, anticlockwise seen from outside;
- the rows of its neighbours across the edges from the first corner to the second, from there to the third, and back;
- its outward unit normal.

A row of `vertices` (v, 6) is a position (m) and a unit pseudonormal: the mean of the normals of the triangles round it
by their angles there.

A row of `tree` (2 m, 11), m a power of two, is a `RUN`: it bounds a run of triangles by a box and a disc.

- row 0 is not used, and row 1 bounds all triangles;
- row i has the halves 2 i and 2 i + 1;
- row m + j is a leaf: the triangles from j t // m up to (j + 1) t // m.

The disc stands about the box's middle: its unit normal, its radius (m) and half of its thickness (m), infinite for long
runs.

- A box of a slanted patch is as thick as the patch is wide: as many as sqrt(t) of them may be no farther from a point
  away from the mesh than the closest triangle.
- A disc is as thick as the patch is bent.

Triangles lie in the order of the leaves, and vertices in that of their first use, so that neighbours share cache lines.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled, inner
from hapticeval.geometry.boundary import ClosestPoint
from hapticeval.geometry.kernels import check_finite
from hapticeval.geometry.triples import Triple, cross, dot, minus, plus, scaled
from hapticeval.records import as_record, record_type
from hapticeval.types import Array, IntArray

CORNER_COLUMN, ACROSS_COLUMN, NORMAL_COLUMN = 0, 3, 6
"""Columns of `faces`; NORMAL_COLUMN also where the pseudonormal of a row of `vertices` would follow: see `PSEUDO`."""
PSEUDO = 3

RUN = record_type(
    "low_x", "low_y", "low_z", "high_x", "high_y", "high_z", "normal_x", "normal_y", "normal_z", "radius",
    "half_thickness",
)  # fmt: skip
"""A run of triangles: the least and the largest x, y, z of its box (m), and its disc, see above."""

FACE, EDGE, VERTEX = 0, 1, 4
"""Features of a triangle: its inside, EDGE + i from corner i to the next, VERTEX + i."""

LEAF = 3
"""Fewest triangles in a leaf of a tree that has been divided; a leaf has less than twice as many."""
TRIANGLE_TREE_DEPTH = 64
BOX_ROUNDING = 2e-15
"""Rounding of a box and of the distances from its triangles, as a share of its coordinates and of the mesh's size."""
PRUNING_SLACK = 1.0 + 1e-14
"""How much farther than the best triangle a box may lie and still be looked into, squared: rounding."""
ONE_PLANE = 1e-18
"""Square of the angle (rad) between the normals of faces that count as one plane."""
ON_FEATURE = 1e-12
"""Distance from an edge or a vertex, as a share of its coordinates, at which the direction to it is rounding."""


@inner
def position_of(vertices: Array, row: int) -> Triple:
    """Return the position (m) of a vertex: the row of `vertices` (v, 6)."""
    return vertices[row, 0], vertices[row, 1], vertices[row, 2]


@inner
def vertex_of(faces: Array, k: int, i: int) -> int:
    """Return the row of `vertices` in which corner i of triangle k of `faces` (t, 9) is; lengths are in m."""
    return int(faces[k, CORNER_COLUMN + i])


@inner
def same_corner(faces: Array, k: int, i: int, j: int) -> int:
    """Return which corner of triangle j of `faces` (t, 9), m, is the vertex at corner i of triangle k: both have it."""
    row = faces[k, CORNER_COLUMN + i]
    return 0 if faces[j, CORNER_COLUMN] == row else 1 if faces[j, CORNER_COLUMN + 1] == row else 2


@inner
def corner_of(faces: Array, vertices: Array, k: int, i: int) -> Triple:
    """Return the position (m) of corner i of triangle k; `faces` (t, 9) and `vertices` (v, 6), m, are the mesh."""
    return position_of(vertices, vertex_of(faces, k, i))


@inner
def neighbour_of(faces: Array, k: int, i: int) -> int:
    """Return the triangle across the edge of triangle k that begins at its corner i; `faces` (t, 9), lengths in m."""
    return int(faces[k, ACROSS_COLUMN + i])


@inner
def pseudonormal_of(vertices: Array, row: int) -> Triple:
    """Return the pseudonormal, unit length, of the vertex in a row of `vertices` (v, 6), m."""
    return vertices[row, PSEUDO], vertices[row, PSEUDO + 1], vertices[row, PSEUDO + 2]


@inner
def normal_of(faces: Array, k: int) -> Triple:
    """Return the outward unit normal of triangle k of `faces` (t, 9); lengths are in m."""
    return faces[k, NORMAL_COLUMN], faces[k, NORMAL_COLUMN + 1], faces[k, NORMAL_COLUMN + 2]


@inner
def _on_segment(ap: Triple, bp: Triple, ab: Triple) -> tuple[float, float]:
    """Return the squared distance of a point from a segment, and where on it, in [0, 1], the closest point lies."""
    along, length_squared = dot(ap, ab), dot(ab, ab)
    # before the start and past the end the ends themselves are closest
    if along <= 0.0:
        return dot(ap, ap), 0.0
    if along >= length_squared:
        return dot(bp, bp), 1.0
    share = along / length_squared
    q = plus(ap, -share, ab)
    return dot(q, q), share


@inner
def distance_to_triangle(
    faces: Array, vertices: Array, k: int, p: Triple, limit_squared: float
) -> tuple[float, int, float]:
    """Return the squared distance (m^2) of p from triangle k, the feature that is closest, and where on that edge.

    `faces` (t, 9) and `vertices` (v, 6), m, are the mesh. The distance is infinite where the triangle's plane is
    farther away than `limit_squared`.

    Whether p lies over the triangle is decided by its normal, which is exact to rounding for any sliver, and the
    closest point of an edge by that edge alone: so errors are roundings of the coordinates, whatever the triangle's
    shape.
    """
    a, n = corner_of(faces, vertices, k, 0), normal_of(faces, k)
    ap = minus(p, a)
    height = dot(n, ap)
    best_squared = height * height
    if best_squared > limit_squared:
        return math.inf, FACE, 0.0
    b, c = corner_of(faces, vertices, k, 1), corner_of(faces, vertices, k, 2)
    ab, bc, ca = minus(b, a), minus(c, b), minus(a, c)
    bp, cp = minus(p, b), minus(p, c)
    # (n x edge) . (p - corner): negative outside of that edge
    first, second, third = dot(cross(n, ab), ap), dot(cross(n, bc), bp), dot(cross(n, ca), cp)
    if first >= 0.0 and second >= 0.0 and third >= 0.0:
        return best_squared, FACE, 0.0
    # outside: the closest of the edges that p lies outside of
    best_squared, feature, share = math.inf, FACE, 0.0
    if first < 0.0:
        best_squared, share = _on_segment(ap, bp, ab)
        feature = EDGE
    if second < 0.0:
        edge_squared, along = _on_segment(bp, cp, bc)
        if edge_squared < best_squared:
            best_squared, feature, share = edge_squared, EDGE + 1, along
    if third < 0.0:
        edge_squared, along = _on_segment(cp, ap, ca)
        if edge_squared < best_squared:
            best_squared, feature, share = edge_squared, EDGE + 2, along
    # an end of an edge is the vertex there
    if share == 0.0:
        return best_squared, feature - EDGE + VERTEX, 0.0
    if share == 1.0:
        return best_squared, VERTEX + (feature - EDGE + 1) % 3, 0.0
    return best_squared, feature, share


@inner
def box_middle(tree: Array, i: int) -> Triple:
    """Return the middle (m) of box i of `tree` (2 m, 11)."""
    run = as_record(tree, RUN, i)
    return 0.5 * (run.low_x + run.high_x), 0.5 * (run.low_y + run.high_y), 0.5 * (run.low_z + run.high_z)


@inner
def _disc_distance_squared(tree: Array, i: int, p: Triple) -> float:
    """Return the squared distance (m^2) of p from the disc of row i: no triangle in it is closer."""
    # a disc is a flat cylinder: the excess over its half thickness, and over its radius aside
    run, q = as_record(tree, RUN, i), minus(p, box_middle(tree, i))
    n = (run.normal_x, run.normal_y, run.normal_z)
    aside = cross(n, q)
    height_excess = max(abs(dot(n, q)) - run.half_thickness, 0.0)
    aside_excess = max(math.sqrt(dot(aside, aside)) - run.radius, 0.0)
    return float(height_excess * height_excess + aside_excess * aside_excess)


@inner
def _run_distance_squared(tree: Array, i: int, p: Triple, limit: float) -> float:
    """Return a lower bound of the squared distance (m^2) of p from run i; beyond `limit` any bound that is."""
    box_squared = _box_distance_squared(tree, i, p)
    return box_squared if box_squared > limit else max(box_squared, _disc_distance_squared(tree, i, p))


@inner
def _box_distance_squared(tree: Array, i: int, p: Triple) -> float:
    """Return the squared distance (m^2) of p from the box of row i, 0 inside: no triangle in it is closer."""
    run = as_record(tree, RUN, i)
    x = max(max(run.low_x - p[0], p[0] - run.high_x), 0.0)
    y = max(max(run.low_y - p[1], p[1] - run.high_y), 0.0)
    z = max(max(run.low_z - p[2], p[2] - run.high_z), 0.0)
    return float(x * x + y * y + z * z)


@compiled
def nearest_triangle(
    faces: Array, vertices: Array, tree: Array, p: Triple, start: int
) -> tuple[int, int, float, float]:
    """Return the triangle closest to p (m), its feature, where on that edge, and the squared distance (m^2).

    `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) are the mesh. Of triangles that are equally close it is the
    first.

    `start` is a triangle to begin with, such as the closest one of a moment ago: it saves time, and the answer is the
    same for any.
    """
    n, m = faces.shape[0], tree.shape[0] // 2
    best = start
    best_squared, feature, share = distance_to_triangle(faces, vertices, best, p, math.inf)
    stack = np.empty((TRIANGLE_TREE_DEPTH, 2))
    i, top = 1, 0
    while True:
        # down into the nearer half, with the other on the stack, as long as either may be closer
        while 0 < i < m:
            near_child, far_child = 2 * i, 2 * i + 1
            limit = best_squared * PRUNING_SLACK
            near_squared, far_squared = (
                _run_distance_squared(tree, near_child, p, limit),
                _run_distance_squared(tree, far_child, p, limit),
            )
            if far_squared < near_squared:
                near_child, far_child, near_squared, far_squared = far_child, near_child, far_squared, near_squared
            if far_squared <= limit:
                stack[top, 0], stack[top, 1] = far_child, far_squared
                top += 1
            i = near_child if near_squared <= limit else 0
        # a leaf: measure its triangles
        if i > 0:
            j = i - m
            for k in range(j * n // m, (j + 1) * n // m):
                squared, other, along = distance_to_triangle(faces, vertices, k, p, best_squared)
                if squared < best_squared or (squared == best_squared and k < best):
                    best_squared, best, feature, share = squared, k, other, along
        i = 0
        # back to the last half put off, but for those that are by now too far
        while top > 0 and i == 0:
            top -= 1
            if stack[top, 1] <= best_squared * PRUNING_SLACK:
                i = int(stack[top, 0])
        if i == 0:
            return best, feature, share, best_squared


@compiled
def closest_on_mesh(
    faces: Array, vertices: Array, tree: Array, p: Triple, start: int
) -> tuple[int, Triple, Triple, float]:
    """Return the closest triangle, the foot (m) on it, the outward unit normal there, and the signed distance (m) of p.

    `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) are the mesh; the search begins at triangle `start`.

    The side is that of the pseudonormal of the feature (Baerentzen and Aanaes 2005), which is right for any closed
    mesh. On an edge or a vertex the normal is the direction between p and the foot, or where these coincide the
    pseudonormal.
    """
    k, feature, share, distance_squared = nearest_triangle(faces, vertices, tree, p, start)
    n, a = normal_of(faces, k), corner_of(faces, vertices, k, 0)
    if feature == FACE:
        height = dot(n, minus(p, a))
        foot = plus(p, -height, n)
        # the foot once more onto the plane: far from the face the first has lost digits
        return k, plus(foot, -dot(n, minus(foot, a)), n), n, height
    if feature < VERTEX:
        i = feature - EDGE
        a, b = corner_of(faces, vertices, k, i), corner_of(faces, vertices, k, (i + 1) % 3)
        ab = minus(b, a)
        foot, q = plus(a, share, ab), plus(minus(p, a), -share, ab)
    else:
        foot = corner_of(faces, vertices, k, feature - VERTEX)
        q = minus(p, foot)
    side, normal = side_and_normal(faces, vertices, k, feature, foot, q)
    return k, foot, normal, side * math.sqrt(distance_squared)


@compiled
def closest_feature(faces: Array, vertices: Array, tree: Array, p: Triple, start: int) -> tuple[int, int, Triple]:
    """Return the triangle closest to p (m), the feature of it, and the foot (m); tables as in `nearest_triangle`.

    These are `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11).
    """
    k, feature, _, _ = nearest_triangle(faces, vertices, tree, p, start)
    k, foot, _, _ = closest_on_mesh(faces, vertices, tree, p, k)
    return k, feature, foot


@compiled
def side_and_normal(
    faces: Array, vertices: Array, k: int, feature: int, foot: Triple, q: Triple
) -> tuple[float, Triple]:
    """Return the side of a feature of triangle k on which foot + q (m) lies, -1 inside or 1, and the normal there.

    `faces` (t, 9) and `vertices` (v, 6) are the mesh.
    """
    n = normal_of(faces, k)
    if feature == FACE:
        return (-1.0 if dot(n, q) < 0.0 else 1.0), n
    if feature < VERTEX:
        # an edge's pseudonormal is the mean of both normals, a vertex's is in the table
        mean = plus(n, 1.0, normal_of(faces, neighbour_of(faces, k, feature - EDGE)))
        mean = scaled(1.0 / math.sqrt(dot(mean, mean)), mean)
    else:
        row = vertex_of(faces, k, feature - VERTEX)
        mean = pseudonormal_of(vertices, row)
    side = -1.0 if dot(mean, q) < 0.0 else 1.0
    bent = minus(mean, n)
    # faces of one plane: an inner edge is no edge
    if dot(bent, bent) <= ONE_PLANE:
        return side, n
    length = math.sqrt(dot(q, q))
    # beside the feature: the direction to p, turned outwards
    if length > ON_FEATURE * (abs(foot[0]) + abs(foot[1]) + abs(foot[2])):
        return side, scaled(side / length, q)
    return side, mean


@compiled
def closest_points(faces: Array, vertices: Array, tree: Array, points: Array) -> ClosestPoint:
    """Return the `ClosestPoint` of points (n, 3), m: faces and edges have no shape. Raises as `check_finite` does.

    `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) are the mesh.
    """
    check_finite(points)
    n, k = points.shape[0], 0
    feet, normals, signed, shapes = np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.zeros((n, 3, 3))
    for row in range(n):
        # each search begins where the last ended: paths move little from tick to tick
        k, foot, normal, signed[row] = closest_on_mesh(
            faces, vertices, tree, (points[row, 0], points[row, 1], points[row, 2]), k
        )
        for i in range(3):
            feet[row, i], normals[row, i] = foot[i], normal[i]
    return ClosestPoint(feet, normals, signed, shapes)


@compiled
def signed_distances(faces: Array, vertices: Array, tree: Array, points: Array) -> Array:
    """Return the signed distances (n,), m, of points (n, 3), m. Raises as `check_finite` does.

    `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) are the mesh.
    """
    check_finite(points)
    out, k = np.empty(points.shape[0]), 0
    for row in range(points.shape[0]):
        k, _, _, out[row] = closest_on_mesh(faces, vertices, tree, (points[row, 0], points[row, 1], points[row, 2]), k)
    return out


@inner
def product_error(a: float, b: float, product: float) -> float:
    """Return what the rounded product a b lost (Dekker 1971): a b is exactly `product` and this."""
    # 2^27 + 1 splits a double in two halves whose products are exact
    high = 134217729.0 * a
    a1 = high - (high - a)
    a2 = a - a1
    high = 134217729.0 * b
    b1 = high - (high - b)
    b2 = b - b1
    return ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2


@inner
def _signed_area(x1: float, y1: float, x2: float, y2: float) -> tuple[float, int]:
    """Return x1 y2 - x2 y1 and its sign: on which side the line between two points passes the origin.

    The sign is exact, and 0 only if the points are one. Where the number is zero the line counts as passing an origin
    that is shifted by (d, d^2) for a d below all numbers.

    So a line and the same line backwards always have opposite signs.
    """
    first, second = x1 * y2, x2 * y1
    area = first - second
    # the rounded products agree: what they lost decides
    if area == 0.0:
        area = product_error(x1, y2, first) - product_error(x2, y1, second)
    sign = area
    # exactly on the origin: shift that by (d, d^2), whose first order is d (y1 - y2)
    if sign == 0.0:
        sign = y1 - y2
        if sign == 0.0:
            sign = x2 - x1
    return area, 1 if sign > 0.0 else -1 if sign < 0.0 else 0


@inner
def _misses_box(tree: Array, i: int, middle: Triple, half: Triple, pad: float) -> bool:
    """Whether a segment misses box i widened by `pad` (m), by separating axes.

    The segment is given by its `middle` and by half the way along it, `half`.
    """
    # half sides of the box, and the segment's middle seen from the box's
    hx, hy, hz = 0.5 * (tree[i, 3] - tree[i, 0]), 0.5 * (tree[i, 4] - tree[i, 1]), 0.5 * (tree[i, 5] - tree[i, 2])
    x, y, z = middle[0] - tree[i, 0] - hx, middle[1] - tree[i, 1] - hy, middle[2] - tree[i, 2] - hz
    hx, hy, hz = hx + pad, hy + pad, hz + pad
    ax, ay, az = abs(half[0]), abs(half[1]), abs(half[2])
    # separated by a face of the box
    if abs(x) > hx + ax or abs(y) > hy + ay or abs(z) > hz + az:
        return True
    # separated by a plane along the segment and an edge of the box
    return bool(
        abs(y * half[2] - z * half[1]) > hy * az + hz * ay
        or abs(z * half[0] - x * half[2]) > hz * ax + hx * az
        or abs(x * half[1] - y * half[0]) > hx * ay + hy * ax
    )


@compiled
def first_triangle_hit(
    faces: Array, vertices: Array, tree: Array, start: Triple, direction: Triple, low: float, high: float
) -> tuple[int, float]:
    """Return the first triangle through which the line start + s direction goes for s in [low, high], and s.

    `faces` (t, 9), `vertices` (v, 6), m, and `tree` (2 m, 11) are the mesh. (-1, high) if there is none.

    Woop, Benthin and Wald's watertight test (2013): each vertex is projected along the line once and for all, and on
    which side an edge passes the line has one exact answer for both triangles that share it.

    So no line slips through between triangles, and each goes as often in as out.
    """
    n, m = faces.shape[0], tree.shape[0] // 2
    # the axis along which the line runs fastest becomes z; the others keep their sense
    kz = 0
    if abs(direction[1]) > abs(direction[kz]):
        kz = 1
    if abs(direction[2]) > abs(direction[kz]):
        kz = 2
    kx, ky = (kz + 1) % 3, (kz + 2) % 3
    # a line that runs towards -z sees x and y the other way round
    if direction[kz] < 0.0:
        kx, ky = ky, kx
    # shear: x - sx z and y - sy z are zero on the whole line
    sx, sy, sz = direction[kx] / direction[kz], direction[ky] / direction[kz], 1.0 / direction[kz]
    reach = 0.0
    for i in range(3):
        reach = max(reach, abs(tree[1, i] - start[i]), abs(tree[1, 3 + i] - start[i]))
        reach = max(reach, 0.5 * abs(start[i]), abs(direction[i]) * max(abs(low), abs(high)))
    # rounding of the sheared coordinates, by which boxes are widened
    pad = 1e-14 * reach
    best, first = -1, high
    stack = np.empty(TRIANGLE_TREE_DEPTH, np.int64)
    stack[0] = 1
    top = 1
    while top > 0:
        top -= 1
        i = stack[top]
        middle, half = plus(start, 0.5 * (low + first), direction), scaled(0.5 * (first - low), direction)
        if _misses_box(tree, i, middle, half, pad):
            continue
        if i < m:
            ahead = 0.0
            for axis in range(3):
                # twice the middles of both halves: the one that comes first along the line is looked into first
                first_sum = tree[2 * i, axis] + tree[2 * i, 3 + axis]
                second_sum = tree[2 * i + 1, axis] + tree[2 * i + 1, 3 + axis]
                ahead += direction[axis] * (second_sum - first_sum)
            stack[top], stack[top + 1] = (2 * i + 1, 2 * i) if ahead > 0.0 else (2 * i, 2 * i + 1)
            top += 2
            continue
        j = i - m
        for k in range(j * n // m, (j + 1) * n // m):
            # the origin of the sheared plane is the line: a triangle is hit where it holds it
            a = minus(corner_of(faces, vertices, k, 0), start)
            b = minus(corner_of(faces, vertices, k, 1), start)
            c = minus(corner_of(faces, vertices, k, 2), start)
            ax, ay, bx, by = a[kx] - sx * a[kz], a[ky] - sy * a[kz], b[kx] - sx * b[kz], b[ky] - sy * b[kz]
            u, side = _signed_area(bx, by, ax, ay)
            cx, cy = c[kx] - sx * c[kz], c[ky] - sy * c[kz]
            v, other = _signed_area(cx, cy, bx, by)
            # all three edges pass the line on one side, or it is missed
            if other != side:
                continue
            w, other = _signed_area(ax, ay, cx, cy)
            if other != side or side == 0:
                continue
            # barycentric coordinates u, v, w of the point that is hit, times the sheared area
            total = u + v + w
            s = sz * a[kz]
            # an area of zero: the triangle is seen edge on, and its first corner's depth will do
            if total != 0.0:
                s = sz * ((v * a[kz] + w * b[kz] + u * c[kz]) / total)
            if low <= s <= high and (s < first or best < 0 or (s == first and k < best)):
                best, first = k, s
    return best, first


@compiled
def first_entry(
    faces: Array, vertices: Array, tree: Array, start: Triple, end: Triple, touch: float, k: int
) -> tuple[bool, int, Triple, float]:
    """Return where the segment from start to end (m) first goes inside: whether it does, triangle, foot (m), share.

    `faces` (t, 9), `vertices` (v, 6) and `tree` (2 m, 11) are the mesh. If it never does, the triangle is one close to
    the start. The search begins at triangle `k`.

    To be inside means by more than `touch` (m): so a start on the mesh to rounding counts by where the segment goes,
    and what only grazes an edge or a face is passed.

    Between two of its crossings with the mesh, which may be several in one vertex, it is inside as a whole or not at
    all.
    """
    direction = minus(end, start)
    length = math.sqrt(dot(direction, direction))
    k, foot, _, depth = closest_on_mesh(faces, vertices, tree, start, k)
    # too far away to be reached
    if length == 0.0 or depth > length + touch:
        return False, k, foot, 0.0
    # it begins inside
    if depth < -touch:
        return True, k, foot, 0.0
    begin, low, rounding = 0.0, -touch / length, touch / length
    outside = depth > touch
    while True:
        hit, s = first_triangle_hit(faces, vertices, tree, start, direction, low, 1.0)
        # depths at quarters of the stretch up to the next crossing tell on which side it is
        for quarter in (2, 1, 3, 4):
            if outside or (quarter == 4 and hit >= 0):
                break
            _, _, _, depth = closest_on_mesh(
                faces, vertices, tree, plus(start, begin + 0.25 * quarter * (s - begin), direction), k
            )
            if depth < -touch:
                k, foot, _, _ = closest_on_mesh(faces, vertices, tree, plus(start, begin, direction), k)
                return True, k, foot, begin
        if hit < 0:
            return False, k, foot, 0.0
        # go on past this crossing, by more than its rounding
        k, begin, low, outside = hit, max(s, 0.0), s + rounding, False


@compiled
def normals_in_reach(faces: Array, vertices: Array, tree: Array, points: Array, reach: Array) -> tuple[IntArray, Array]:
    """Return the normals of the triangles within `reach` (n,), m, along the mesh from the feet of points (n, 3), m.

    As (n + 1,) starts and all normals (total, 3), one after the other, each direction once. `faces` (t, 9), `vertices`
    (v, 6) and `tree` (2 m, 11) are the mesh.
    """
    n = points.shape[0]
    visited_for, queue = np.full(faces.shape[0], -1), np.empty(faces.shape[0], np.int64)
    starts, normals, k, total = np.zeros(n + 1, np.int64), np.empty((4 * n + 16, 3)), 0, 0
    for row in range(n):
        k, foot, _, _ = closest_on_mesh(faces, vertices, tree, (points[row, 0], points[row, 1], points[row, 2]), k)
        limit = reach[row] + ON_FEATURE * (abs(foot[0]) + abs(foot[1]) + abs(foot[2]))
        # breadth first over neighbours that come within reach of the foot
        queue[0], visited_for[k] = k, row
        count, done = 1, 0
        while done < count:
            face = queue[done]
            done += 1
            normal = normal_of(faces, face)
            # a direction that is there already is not added again
            for other in range(starts[row], total):
                bent = minus(normal, (normals[other, 0], normals[other, 1], normals[other, 2]))
                if dot(bent, bent) <= ONE_PLANE:
                    break
            else:
                if total == normals.shape[0]:
                    # the table is full: double it
                    larger = np.empty((2 * total, 3))
                    larger[:total] = normals
                    normals = larger
                normals[total, 0], normals[total, 1], normals[total, 2] = normal
                total += 1
            for i in range(3):
                neighbour = neighbour_of(faces, face, i)
                if (
                    visited_for[neighbour] != row
                    and distance_to_triangle(faces, vertices, neighbour, foot, math.inf)[0] <= limit * limit
                ):
                    queue[count], visited_for[neighbour] = neighbour, row
                    count += 1
        starts[row + 1] = total
    return starts, normals[:total].copy()


@compiled
def closest_in_cone(normals: Array, first: int, last: int, d: Triple) -> Triple:
    """Return the point of the cone that rows first to last of unit `normals` (k, 3) span which is closest to d.

    d is a vector in any unit, such as N or m, and so is the answer.

    Each round adds the direction that leads closest to the rest, and keeps of it and the up to two before it those
    whose cone comes closest: no more than three carry a vector in space. The rest shrinks with each round.
    """
    limit = 1e-15 * math.sqrt(dot(d, d))
    carriers = np.zeros((3, 3))
    count, best = 0, (0.0, 0.0, 0.0)
    for _ in range(4 * (last - first) + 8):
        residual = minus(d, best)
        steepest, chosen = limit, -1
        for k in range(first, last):
            along = normals[k, 0] * residual[0] + normals[k, 1] * residual[1] + normals[k, 2] * residual[2]
            if along > steepest:
                steepest, chosen = along, k
        # no direction leads closer: the optimality condition of the nearest point of a cone
        if chosen < 0:
            break
        new = (normals[chosen, 0], normals[chosen, 1], normals[chosen, 2])
        residual_squared = dot(residual, residual)
        along = max(dot(new, d), 0.0)
        # the new direction alone
        closest, count_kept, which = scaled(along, new), 1, 0
        residual = minus(d, closest)
        least_squared = dot(residual, residual)
        # the new direction with one of those before: the foot of d on their plane, if between them
        for other in range(count):
            side = (carriers[other, 0], carriers[other, 1], carriers[other, 2])
            across = cross(new, side)
            across_squared = dot(across, across)
            # (anti)parallel: no plane
            if across_squared <= 1e-30:
                continue
            flat = plus(d, -dot(across, d) / across_squared, across)
            if dot(cross(flat, side), across) < 0.0 or dot(cross(new, flat), across) < 0.0:
                continue
            residual = minus(d, flat)
            if dot(residual, residual) < least_squared:
                least_squared, closest, count_kept, which = dot(residual, residual), flat, 2, other
        # all three: if d lies within their cone it is its own closest point
        if count == 2:
            one = (carriers[0, 0], carriers[0, 1], carriers[0, 2])
            two = (carriers[1, 0], carriers[1, 1], carriers[1, 2])
            volume = dot(new, cross(one, two))
            sense = 1.0 if volume > 0.0 else -1.0
            # Cramer's rule: the parts of d along each of the three, up to the volume
            shares = (
                sense * dot(d, cross(one, two)),
                sense * dot(d, cross(two, new)),
                sense * dot(d, cross(new, one)),
            )
            if volume != 0.0 and min(shares) >= 0.0:
                return d
        # rounding: it gets no closer
        if least_squared >= residual_squared:
            break
        if count_kept == 2:
            for axis in range(3):
                carriers[0, axis] = carriers[which, axis]
        for axis in range(3):
            carriers[count_kept - 1, axis] = new[axis]
        count, best = count_kept, closest
    return best


@compiled
def angles_outside_cones(starts: IntArray, normals: Array, directions: Array) -> Array:
    """Return the angles (n,), rad, by which directions (n, 3) leave the cones that `normals_in_reach` gives; 0 inside.

    `starts` (n + 1,) and `normals` (total, 3) are these. Beyond a right angle from all of a cone the closest of its
    directions is one of the normals that span it.
    """
    out = np.zeros(directions.shape[0])
    for row in range(directions.shape[0]):
        d = (directions[row, 0], directions[row, 1], directions[row, 2])
        inside = closest_in_cone(normals, starts[row], starts[row + 1], d)
        # within a right angle: the angle to the closest direction of the cone
        if dot(inside, inside) > 0.0:
            across = cross(inside, d)
            out[row] = math.atan2(math.sqrt(dot(across, across)), dot(inside, d))
            continue
        largest_cosine = -math.inf
        for k in range(starts[row], starts[row + 1]):
            largest_cosine = max(largest_cosine, normals[k, 0] * d[0] + normals[k, 1] * d[1] + normals[k, 2] * d[2])
        length = math.sqrt(dot(d, d))
        out[row] = math.acos(max(largest_cosine / length, -1.0)) if length > 0.0 else 0.0
    return out
