"""The smooth closed surfaces in space (thesis 7.4): nearest points, shape operators and their derivatives.

To compiled loops a surface is a row `reals` = (kind, three lengths in m):

| kind      | lengths                                         | about                                |
|-----------|-------------------------------------------------|--------------------------------------|
| SPHERE    | radius, -, -                                    | the origin                           |
| ELLIPSOID | semi-axes along x, y and z                      | the origin                           |
| TORUS     | radius of the core circle, radius of the tube, - | the z axis, the core circle in z = 0 |

Vectors are tuples of three numbers; a symmetric matrix is a tuple of its six, (xx, xy, xz, yy, yz, zz).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.compiled import compiled
from hapticeval.geometry.boundary import ClosestPoint, SurfaceInSpace, spread_over_sphere
from hapticeval.geometry.kernels import check_finite
from hapticeval.geometry.motion import Motion
from hapticeval.geometry.triples import Triple, dot, plus, triple_of
from hapticeval.geometry.validate import answer_by_kernel
from hapticeval.laws import FOOT, NORMAL, SHAPE, Closest, LawData, law_data
from hapticeval.records import as_record, numbers_of, record_type
from hapticeval.types import Array

SPHERE, ELLIPSOID, TORUS = 0.0, 1.0, 2.0
SURFACE = record_type("kind", lengths=3)
"""What `reals` holds: SPHERE, ELLIPSOID or TORUS, and the lengths (m) that a `Surface` of that kind has."""

Symmetric: TypeAlias = tuple[float, float, float, float, float, float]

MOST_ROOT_STEPS = 200
"""Most steps of the ellipsoid's root search: a bound on the loop, which ends by itself at rounding."""

ZERO_SHARE = 1e-150
"""Share of a semi-axis below which a coordinate counts as zero: its reciprocal's square is still a number."""


@compiled
def apply_matrix(w: Symmetric, v: Triple) -> Triple:
    """Return the symmetric matrix w times the vector v."""
    return (
        w[0] * v[0] + w[1] * v[1] + w[2] * v[2],
        w[1] * v[0] + w[3] * v[1] + w[4] * v[2],
        w[2] * v[0] + w[4] * v[1] + w[5] * v[2],
    )


@compiled
def closest_on_surface(reals: Array, y: Triple) -> tuple[Triple, Triple, float]:
    """Return the globally nearest surface point, the outward unit normal there, and the signed distance (m) of y.

    `reals` (4,) is the surface; y is a point (m); negative is inside. On the medial set, where several points
    are nearest, it is one of them, always the same: y = foot + distance normal holds.
    """
    surface = as_record(reals, SURFACE)
    if surface.kind == SPHERE:
        return _on_sphere(surface.lengths[0], y)
    if surface.kind == TORUS:
        return _on_torus(surface.lengths[0], surface.lengths[1], y)
    return _on_ellipsoid(reals, y)


@compiled
def _on_sphere(radius: float, y: Triple) -> tuple[Triple, Triple, float]:
    """Answer `closest_on_surface` for a sphere of `radius` (m)."""
    length = math.sqrt(dot(y, y))
    # at the centre every point is nearest: the pole is taken
    if length == 0.0:
        return (0.0, 0.0, radius), (0.0, 0.0, 1.0), -radius
    normal = (y[0] / length, y[1] / length, y[2] / length)
    return (radius * normal[0], radius * normal[1], radius * normal[2]), normal, length - radius


@compiled
def _on_torus(major: float, minor: float, y: Triple) -> tuple[Triple, Triple, float]:
    """Answer `closest_on_surface` for a torus: a tube of radius `minor` (m) about a circle of radius `major` (m)."""
    across = math.hypot(y[0], y[1])
    # e points from the axis to y; on the axis, where any direction will do, along x
    ex, ey = 1.0, 0.0
    if across > 0.0:
        ex, ey = y[0] / across, y[1] / across
    length = math.hypot(across - major, y[2])
    # the same about the core circle, for y on it
    cos, sin = 1.0, 0.0
    if length > 0.0:
        cos, sin = (across - major) / length, y[2] / length
    foot_radius = major + minor * cos
    return (foot_radius * ex, foot_radius * ey, minor * sin), (cos * ex, cos * ey, sin), length - minor


@compiled
def _on_ellipsoid(reals: Array, y: Triple) -> tuple[Triple, Triple, float]:
    """Return what `closest_on_surface` does, by the root of Eberly's secular equation.

    Eberly, "Distance from a point to an ellipsoid". With e the smallest semi-axis, r_i = (e_i / e)^2, q_i = r_i - 1 and
    z_i = y_i / e_i:

    - g > 0 is where the vector of r_i z_i / (q_i + g) has the norm 1;
    - the foot is p_i = r_i y_i / (q_i + g);
    - the signed distance is (g - 1) e^2 times the norm of (p_i / e_i^2).

    In terms of g, zero on the medial disc, nothing cancels near it.
    """
    a, b, c = triple_of(as_record(reals, SURFACE).lengths)
    e = min(a, b, c)
    rs = ((a / e) ** 2, (b / e) ** 2, (c / e) ** 2)
    qs = ((a - e) * (a + e) / e / e, (b - e) * (b + e) / e / e, (c - e) * (c + e) / e / e)
    zs = (abs(y[0]) / a, abs(y[1]) / b, abs(y[2]) / c)
    # where one term alone has the norm 1: no root lies below, and Newton on the concave 1 / norm - 1 climbs to it
    g = max(0.0, rs[0] * zs[0] - qs[0], rs[1] * zs[1] - qs[1], rs[2] * zs[2] - qs[2])
    inner = 0.0
    for i in range(3):
        if zs[i] > ZERO_SHARE and qs[i] > 0.0:
            inner += (rs[i] * zs[i] / qs[i]) ** 2
    # y lies on the medial disc, across the smallest semi-axis e: the root would be g = 0
    medial = g <= ZERO_SHARE and inner <= 1.0
    if not medial:
        for _ in range(MOST_ROOT_STEPS):
            norm_squared, slope = 0.0, 0.0
            for i in range(3):
                if zs[i] > ZERO_SHARE:
                    w = rs[i] * zs[i] / (qs[i] + g)
                    norm_squared += w * w
                    slope += w * w / (qs[i] + g)
            # Newton on 1 / norm - 1, whose derivative by g is slope / norm^3
            step = (math.sqrt(norm_squared) - 1.0) * norm_squared / slope
            g += step
            # it climbs from below: a step that is rounding, or back, is the end
            if not step > 1e-16 * g:
                break
    x0 = rs[0] * y[0] / (qs[0] + g) if zs[0] > ZERO_SHARE else 0.0
    x1 = rs[1] * y[1] / (qs[1] + g) if zs[1] > ZERO_SHARE else 0.0
    x2 = rs[2] * y[2] / (qs[2] + g) if zs[2] > ZERO_SHARE else 0.0
    if medial:
        # what the quadratic form leaves for the coordinate along e, on the side of y
        low = e * math.sqrt(max(0.0, 1.0 - inner))
        if c == e:
            x2 = math.copysign(low, y[2])
        elif b == e:
            x1 = math.copysign(low, y[1])
        else:
            x0 = math.copysign(low, y[0])
    xs = (x0, x1, x2)
    # outward normal: the gradient of sum (x_i / e_i)^2 / 2
    gradient = (xs[0] / a / a, xs[1] / b / b, xs[2] / c / c)
    size = math.sqrt(dot(gradient, gradient))
    return xs, (gradient[0] / size, gradient[1] / size, gradient[2] / size), (g - 1.0) * e * e * size


@compiled
def shape_operator(reals: Array, p: Triple, normal: Triple) -> Symmetric:
    """Return the shape operator W (1/m) at the surface point p (m): symmetric, W normal = 0, positive where convex.

    `reals` (4,) is the surface. A foot that moves with velocity ṗ turns the normal by W ṗ.
    """
    x, y, z = normal
    surface = as_record(reals, SURFACE)
    if surface.kind == SPHERE:
        # W = (I - normal normal^T) / radius
        k = 1.0 / surface.lengths[0]
        return k * (1.0 - x * x), -k * x * y, -k * x * z, k * (1.0 - y * y), -k * y * z, k * (1.0 - z * z)
    if surface.kind == TORUS:
        major, minor = surface.lengths[0], surface.lengths[1]
        k = 1.0 / minor
        across = math.hypot(p[0], p[1])
        # unit tangent of the parallel
        ax, ay = -p[1] / across, p[0] / across
        # 1/minor on the whole tangent plane, less the difference of the two principal curvatures along the parallel
        curvature_drop = major / (minor * across)
        return (
            k * (1.0 - x * x) - curvature_drop * ax * ax,
            -k * x * y - curvature_drop * ax * ay,
            -k * x * z,
            k * (1.0 - y * y) - curvature_drop * ay * ay,
            -k * y * z,
            k * (1.0 - z * z),
        )
    # W = P H P / |grad|, with P = I - normal normal^T and H = diag(1 / e_i^2)
    d, s = _quadric_terms(reals, p)
    h = (d[0] * x, d[1] * y, d[2] * z)
    hn = dot(h, normal)
    return (
        (d[0] - 2.0 * x * h[0] + hn * x * x) / s,
        (-x * h[1] - h[0] * y + hn * x * y) / s,
        (-x * h[2] - h[0] * z + hn * x * z) / s,
        (d[1] - 2.0 * y * h[1] + hn * y * y) / s,
        (-y * h[2] - h[1] * z + hn * y * z) / s,
        (d[2] - 2.0 * z * h[2] + hn * z * z) / s,
    )


@compiled
def shape_operator_change(reals: Array, p: Triple, normal: Triple, v: Triple, w: Triple) -> Triple:
    """Return (∇_v W) w, by how much the shape operator W (1/m) changes along v, applied to w: 1/m^2 times both.

    `reals` (4,) is the surface; v and w are tangent at the point p (m). The covariant derivative is symmetric
    in v and w (Codazzi).
    """
    surface = as_record(reals, SURFACE)
    # a sphere bends alike everywhere
    if surface.kind == SPHERE:
        return 0.0, 0.0, 0.0
    if surface.kind == TORUS:
        major, minor = surface.lengths[0], surface.lengths[1]
        across = math.hypot(p[0], p[1])
        ex, ey, sin = p[0] / across, p[1] / across, normal[2]
        cos = normal[0] * ex + normal[1] * ey
        along = (-ey, ex, 0.0)
        up = (-sin * ex, -sin * ey, cos)
        factor = -major * sin / (minor * across * across)
        # parts along the parallel and up the meridian: W is cos / across there, and 1 / minor
        va, vu, wa, wu = dot(v, along), dot(v, up), dot(w, along), dot(w, up)
        return _combination(factor * (vu * wa + va * wu), along, factor * va * wa, up)
    d, s = _quadric_terms(reals, p)
    h = (d[0] * normal[0], d[1] * normal[1], d[2] * normal[2])
    e = plus(h, -dot(h, normal), normal)
    # tangential part of H normal, over |grad|: dot(e, v) is how fast log |grad| changes along v
    e = (e[0] / s, e[1] / s, e[2] / s)
    shape = shape_operator(reals, p, normal)
    wv, ww = apply_matrix(shape, v), apply_matrix(shape, w)
    total = plus(_combination(dot(e, w), wv, dot(wv, w), e), dot(e, v), ww)
    return -total[0], -total[1], -total[2]


@compiled
def _combination(f: float, a: Triple, g: float, b: Triple) -> Triple:
    """Return f a + g b."""
    return f * a[0] + g * b[0], f * a[1] + g * b[1], f * a[2] + g * b[2]


@compiled
def _quadric_terms(reals: Array, p: Triple) -> tuple[Triple, float]:
    """Return half the second derivatives of the ellipsoid's quadratic form, and half the length of its gradient at p.

    With the form sum (x_i / e_i)^2 these are 1 / e_i^2 and |(p_i / e_i^2)|.
    """
    a, b, c = triple_of(as_record(reals, SURFACE).lengths)
    d = (1.0 / a / a, 1.0 / b / b, 1.0 / c / c)
    # the gradient of sum (x_i / e_i)^2 / 2 at p
    g = (d[0] * p[0], d[1] * p[1], d[2] * p[2])
    return d, math.sqrt(dot(g, g))


@compiled
def medial_reach(reals: Array, p: Triple, normal: Triple) -> tuple[float, float]:
    """Return how far (m) from the surface point p (m) the medial set lies: along the normal inwards, and outwards.

    `reals` (4,) is the surface. Up to there p is the one nearest point. The medial set of the torus is its
    core circle inside, its axis outside.
    """
    surface = as_record(reals, SURFACE)
    if surface.kind == SPHERE:
        return surface.lengths[0], math.inf
    if surface.kind == TORUS:
        across = math.hypot(p[0], p[1])
        cos = (normal[0] * p[0] + normal[1] * p[1]) / across
        # outwards only the inner half of the tube looks at the axis
        return surface.lengths[1], across / -cos if cos < 0.0 else math.inf
    # from g = 0 in `_on_ellipsoid`: the distance there is -e^2 |grad|
    e = min(surface.lengths[0], surface.lengths[1], surface.lengths[2])
    _, s = _quadric_terms(reals, p)
    return e * e * s, math.inf


@compiled
def signed_distances(reals: Array, points: Array) -> Array:
    """Return the signed distances (n,), m, of points (n, 3), m, from a surface `reals` (4,).

    Raises as `check_finite` does.
    """
    check_finite(points)
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        _, _, out[i] = closest_on_surface(reals, (points[i, 0], points[i, 1], points[i, 2]))
    return out


@compiled
def closest_points(reals: Array, points: Array) -> ClosestPoint:
    """Return the `ClosestPoint` of points (n, 3), m, on a surface `reals` (4,).

    Raises as `check_finite` does.
    """
    check_finite(points)
    n = points.shape[0]
    feet, normals, signed, shapes = np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty((n, 3, 3))
    for i in range(n):
        p, normal, signed[i] = closest_on_surface(reals, (points[i, 0], points[i, 1], points[i, 2]))
        w = shape_operator(reals, p, normal)
        for k in range(3):
            feet[i, k], normals[i, k] = p[k], normal[k]
            # W times each axis gives its columns, which are its rows
            unit = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
            shapes[i, k, 0], shapes[i, k, 1], shapes[i, k, 2] = apply_matrix(w, unit)
    return ClosestPoint(feet, normals, signed, shapes)


@compiled
def medial_reaches(reals: Array, feet: Array, normals: Array) -> Array:
    """Return `medial_reach` (n, 2), m, for each of feet (n, 3), m, with their unit normals (n, 3)."""
    out = np.empty((feet.shape[0], 2))
    for i in range(feet.shape[0]):
        p, normal = (feet[i, 0], feet[i, 1], feet[i, 2]), (normals[i, 0], normals[i, 1], normals[i, 2])
        out[i, 0], out[i, 1] = medial_reach(reals, p, normal)
    return out


def closest_of_surface(row: Array) -> Closest:
    """Return the compiled closest point of a surface, given its row (4,): lengths in m."""
    return Closest(closest_in_space, law_data(pieces=row[np.newaxis]))


@compiled
def closest_in_space(data: LawData, point: Array, frame: Array) -> float:
    """Answer `CLOSEST` for a point (3,), m, on a surface in space, into `frame` (k, 3); there is no arc length."""
    row = data.pieces[0]
    foot, normal, distance = closest_on_surface(row, (point[0], point[1], point[2]))
    for i in range(3):
        frame[FOOT, i], frame[NORMAL, i] = foot[i], normal[i]
    if frame.shape[0] > SHAPE:
        w = shape_operator(row, foot, normal)
        for i in range(3):
            unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
            frame[SHAPE + i, 0], frame[SHAPE + i, 1], frame[SHAPE + i, 2] = apply_matrix(w, unit)
    if frame.shape[0] > SHAPE + 3:
        for i in range(3):
            # the row of the arc length
            frame[SHAPE + 3, i] = np.nan
    return distance


SURFACE_KINDS = {"sphere": SPHERE, "ellipsoid": ELLIPSOID, "torus": TORUS}
"""For each kind its number in a `SURFACE`."""


@dataclass(frozen=True, eq=False)
class Surface(SurfaceInSpace):
    """A sphere, an ellipsoid or a torus about the origin; `reals` are its lengths (m). It is a `Boundary`.

    A sphere has its radius, an ellipsoid its semi-axes along x, y and z, and a torus, about the z axis, the radius of
    its core circle and that of its tube.

    The catalogue makes them, and refuses lengths that do not fit.
    """

    name: str
    kind: str
    reals: Sequence[float]

    @cached_property
    def row(self) -> Array:
        """What the kernels take: the numbers of a `SURFACE`."""
        return numbers_of(SURFACE, kind=SURFACE_KINDS[self.kind], lengths=self.reals)

    @cached_property
    def compiled_closest(self) -> Closest:
        """The closest point as compiled code, for what is composed into a step: see `closest_of`."""
        return closest_of_surface(self.row)

    def moved(self, motion: Motion) -> Surface | None:
        """Return the surface scaled, its own mirror image; None where it is turned or shifted: it is bound to axes."""
        # the kernels know surfaces about the origin and along the axes only
        if not motion.keeps_axes:
            return None
        return Surface(self.name, self.kind, tuple(motion.scale * length for length in self.reals))

    @property
    def bounds(self) -> tuple[float, ...]:
        """(xmin, ymin, zmin, xmax, ymax, zmax), m."""
        extents = tuple(self.reals)  # three semi-axes, or a sphere's one radius
        # the tube's outer equator in x and y, the tube alone in z
        if self.kind == "torus":
            extents = (extents[0] + extents[1], extents[0] + extents[1], extents[1])
        # a sphere's one radius counts for all three axes
        extents = extents * (3 // len(extents))
        return (*(-extent for extent in extents), *extents)

    def closest_point(self, points: ArrayLike) -> ClosestPoint:
        """Return the closest points, normals, distances and shapes of points (n, 3), m: one compiled call.

        See `Boundary.closest_point`.
        """
        return answer_by_kernel(closest_points, (self.row,), points, 3)

    def signed_distance(self, points: ArrayLike) -> Array:
        """Return the signed distances (n,), m, of points (n, 3), m, in one call: see `Boundary.signed_distance`."""
        return answer_by_kernel(signed_distances, (self.row,), points, 3)

    def medial_distance(self, points: ArrayLike) -> Array:
        """Return (n, 2), m: from the foot of each of points (n, 3), m, how far the medial set lies in- and outwards.

        Along the normal, infinite where there is none: between them each point of the normal has this foot, and I + nW
        is positive.
        """
        frame = self.closest_point(points)
        return medial_reaches(self.row, frame.foot, frame.normal)

    def points(self, n: int) -> Array:
        """See `Boundary.points`: evenly on the sphere and the torus; an ellipsoid's are the sphere's, stretched."""
        if self.kind != "torus":
            return np.asarray(spread_over_sphere(n) * np.array(self.reals))
        major, minor = self.reals
        # equal shares of area: a ring of the tube has an area that goes with its distance from the axis
        angle = _tube_angle((np.arange(n) + 0.5) / n, minor / major)
        # golden angles about the axis keep the points apart, as in `spread_over_sphere`
        axis_distance, azimuth = major + minor * np.cos(angle), np.arange(n) * (math.pi * (3.0 - math.sqrt(5.0)))
        return np.column_stack(
            [axis_distance * np.cos(azimuth), axis_distance * np.sin(azimuth), minor * np.sin(angle)]
        )


def _tube_angle(share: Array, ratio: float) -> Array:
    """Round the tube, the angle below which that share of the area lies: angle + ratio sin(angle) = 2 pi share."""
    target = 2.0 * math.pi * share
    low, high = np.zeros_like(target), np.full_like(target, 2.0 * math.pi)
    # bisection: the left side rises with the angle, as ratio < 1
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = middle + ratio * np.sin(middle) < target
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))
