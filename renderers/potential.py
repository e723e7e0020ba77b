"""The force of a potential whose level curves keep the normals of the surface: what makes a continuous map passive.

The surface y_0(s), its outward unit normal n and its support distance h = n.(y_0 - c) about a centre c in the kernel
give the level curves (Combescure's transforms; in space the same)

    y_t(s) = c + A(t) (y_0(s) - c) - B(t) n(s)

The hand at y_t(s) has y_0(s) as IHIP and, with U = K t^2 / 2, the force F = K t / v n, where v = B' - A' h is the speed
at which the level curves go inwards.

It is -grad U, for n.dy_t/ds = 0 makes F.dx = -U'(t) dt. Here B = A b, with

    b(t) = t up to half of m, then with a derivative that falls to zero smoothly, from m on constant, 3/4 m
    A(t) = (H - t) / (H - b(t))

so that t is the depth n.(IHIP - HIP) wherever h = H. Up to the depth m / 2 the level curves are parallel curves, v = 1,
and F = K t is the nearest point's spring; deeper they are smaller copies of one another, and at t = H the point c.

A and B have continuous second derivatives. With m < 1 / kappa_max and m <= h_min the curves lie one inside the other
and cover the inside once (docs/continuous-and-passive.md). With m = 0 all are smaller copies of the surface.

`numbers` are H and m (m), and the centre (N,), m.

The centre is the point from which all of a model's surface is seen, that of its kernel.

The kernel of a closed model is what lies behind the tangent planes of all of its surface: the centres c with a support
distance h = n.(y - c) > 0 at every surface point y with outward unit normal n.

A model that has such a point is star-shaped about it: each ray from c meets the surface once.

The centre is the point of the kernel that makes the mean of log h over the surface largest: the analytic centre,
weighted by length, in space by area. The mean is strictly concave, so that there is one such point; it moves with the
model, and does not depend on how an edge or a face is divided.

`support`, H, is the geometric mean of h there: with a stiffness K H^2 / h^2 the mean of its logarithm over the surface
is that of K.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.bracket import step_within
from hapticeval.compiled import borrowing, compiled, for_kernels, inner
from hapticeval.errors import RefusalError
from hapticeval.geometry.boundary import Boundary
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.curve_kernels import NODES, WEIGHTS
from hapticeval.geometry.kernels import ARC, LINE, PIECE, evaluate_many
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.surface import Surface
from hapticeval.records import as_record, as_records, numbers_of, record_type
from hapticeval.types import Array, IntArray

POTENTIAL = record_type("support", "reach", centre=3)
"""The numbers of a potential: H and m (m), and the centre (m)."""


def potential_record(numbers: Sequence[float]) -> Array:
    """Return the numbers (5,) of a `POTENTIAL` from H, m and the centre (N,), m."""
    return numbers_of(POTENTIAL, support=numbers[0], reach=numbers[1], centre=numbers[2:])


PARALLEL, LAST = 0.5, 1.0
"""Shares of m up to which b is t, and from which it is constant, three quarters of m. A shorter blend keeps the curves
further from crossing, and makes the force fall with depth where h is large: by 0.5 K on a 2:1 ellipse for half of it.
"""

STEPS = 60
"""Most steps to the level of a point, between these two."""

LEVELS, BETWEEN = 1000, 1e-3
"""Levels at which the stiffness is sampled, over all depths and once more over the blend, and the share by which it may
be beyond between two: it changes by a factor of a few over either, and is smooth."""

LEVEL_ROUNDING = 2e-16
"""Share of H below which a change of the level is rounding."""


@inner
def level_values(potential: Any, t: float) -> tuple[float, float, float, float]:
    """Return A, b (m), and their derivatives A' (1/m) and b' at the level t (m): what a level curve is made of.

    `potential` is the record `POTENTIAL`.
    """
    support, reach = potential.support, potential.reach
    blend_begin, blend_end = PARALLEL * reach, LAST * reach
    if t <= blend_begin and reach > 0.0:  # parallel curves
        return 1.0, t, 0.0, 1.0
    span = blend_end - blend_begin
    if t >= blend_end or reach == 0.0:
        b, b_rate = blend_begin + 0.5 * span, 0.0
    else:
        # b' = 1 - 3 x^2 + 2 x^3 falls from 1 to 0 with zero slope at both ends; b is its integral
        x = (t - blend_begin) / span
        b = blend_begin + span * (x - x * x * x + 0.5 * x * x * x * x)
        b_rate = 1.0 - (3.0 - 2.0 * x) * x * x
    remaining = support - b
    # A = (H - t) / (H - b), and A' = ((H - t) b' - (H - b)) / (H - b)^2
    return (support - t) / remaining, b, ((support - t) * b_rate - remaining) / (remaining * remaining), b_rate


@borrowing
def level_at(potential: Any, depth_coordinate: float, h: float) -> float:
    """Return the level t (m) of a hand x whose IHIP has the normal n and the support distance h (m).

    `depth_coordinate` (m) is n.(x - c), and A (h - b) at the level of x; that falls with t at the rate v > 0.
    `potential` is the record `POTENTIAL`.
    """
    support, reach = potential.support, potential.reach
    if reach > 0.0 and h - depth_coordinate <= PARALLEL * reach:
        return float(h - depth_coordinate)
    # deeper than the blend b is constant, and t has a closed form
    low, high = PARALLEL * reach, LAST * reach
    a, b, _, _ = level_values(potential, high)
    if reach == 0.0 or depth_coordinate <= a * (h - b):
        return float(support - depth_coordinate / (h - b) * (support - b))
    # in the blend: Newton's method, kept between the bounds
    t: float = 0.5 * (low + high)
    for _ in range(STEPS):
        a, b, da, db = level_values(potential, t)
        excess = a * (h - b) - depth_coordinate
        if excess > 0.0:
            low = t
        else:
            high = t
        next_t = step_within(low, high, t + excess / (a * db - da * (h - b)))
        if abs(next_t - t) <= LEVEL_ROUNDING * support:
            return float(next_t)
        t = next_t
    return t


@inner
def stretch(potential: Any, t: float, h: float) -> float:
    """Return t / v (m), with v = b' A - A' (h - b): K times that is the force at the level t (m).

    h (m) is the support distance there; `potential` is the record `POTENTIAL`.
    """
    a, b, da, db = level_values(potential, t)
    return t / (a * db - da * (h - b))


def stiffness_range(numbers: Sequence[float], smallest: float, largest: float) -> tuple[float, float]:
    """Return between what shares of K the force over the depth lies, for support distances (m) between two.

    That share is (t / v) / d, with the depth d = h - A (h - b). Both v and d rise with h, so that at each level the
    share is least where h is largest.
    """
    data = potential_record(numbers)
    potential = as_record(data, POTENTIAL)
    support, reach = potential.support, potential.reach
    cuts = np.linspace(0.0, 1.0, LEVELS + 2)[1:-1]
    levels = np.concatenate([cuts * support, (PARALLEL + (LAST - PARALLEL) * cuts) * reach])
    softest, stiffest = (_shares(data, levels[levels > 0.0], h) for h in (largest, smallest))
    return min(1.0, softest.min()) * (1.0 - BETWEEN), max(1.0, stiffest.max()) * (1.0 + BETWEEN)


@compiled
def _shares(numbers: Array, levels: Array, h: float) -> Array:
    """Return the shares of K that the force over the depth is at levels (n,), m, where the support distance is h."""
    shares, potential = np.empty_like(levels), as_record(numbers, POTENTIAL)
    for i in range(levels.size):
        a, b, _, _ = level_values(potential, levels[i])
        shares[i] = stretch(potential, levels[i], h) / (h - a * (h - b))
    return shares


@borrowing
def stretch_at(potential: Any, hip: Array, ihip: Array, normal: Array) -> float:
    """Return the length (m) that K is to be multiplied by for the force on a hand at `hip` (N,), m.

    `ihip` (N,), m, and `normal` (N,) are its IHIP and the outward unit normal there; `potential` is the record
    `POTENTIAL`.
    """
    depth_coordinate, h = 0.0, 0.0
    for i in range(hip.shape[0]):
        depth_coordinate += normal[i] * (hip[i] - potential.centre[i])
        h += normal[i] * (ihip[i] - potential.centre[i])
    return stretch(potential, level_at(potential, depth_coordinate, h), h)


GRAZES = 1e-9
"""Least support distance, as a share of the largest: with less a ray runs along the surface, to rounding."""

SPREAD = 4096
"""Points on a smooth surface in space, or along a smooth curve at least."""

CENTRE_STEPS = 100
"""Most steps of Newton's method to the centre; it takes some ten."""


class NoKernelError(RefusalError):
    """No point sees all of the model's surface, or the centre that was given does not; `position` (m) is one place."""

    def __init__(self, what: str, *, why: str, todo: str, position: Array) -> None:
        super().__init__(what, why=why, todo=todo)
        self.position = tuple(float(coordinate) for coordinate in position)


@dataclass(frozen=True, eq=False)
class Centre:
    """A point (N,), m, of the kernel, and the support distances (m) of the surface from it.

    `support` is their geometric mean over the surface, `smallest` and `largest` the extremes.
    """

    point: Array
    support: float
    smallest: float
    largest: float

    @property
    def support_range(self) -> tuple[float, float]:
        """The least and the largest of them."""
        return self.smallest, self.largest


@dataclass(frozen=True, eq=False)
class Sampled:
    """Points (k, N), m, of a boundary with outward unit normals (k, N), and the share of the surface each stands for.

    A flat face or edge is one of them: its support distance is the same all over it.
    """

    points: Array
    normals: Array
    shares: Array

    def supports(self, centre: Array) -> Array:
        """Return the support distances h = n.(y - c) (k,), m, of the surface about a centre c (N,), m."""
        return np.asarray(np.sum(self.normals * (self.points - centre), axis=1))


def sampled(boundary: Boundary) -> Sampled:
    """Return a closed boundary as points with normals and shares of its length or area, a polygon or mesh exactly."""
    if isinstance(boundary, Mesh):
        corners = boundary.vertices[boundary.triangles]
        normals_by_area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return _weighted(corners.mean(axis=1), boundary.normals, np.linalg.norm(normals_by_area, axis=1))
    if isinstance(boundary, Curve):
        us, lengths = _curve_samples(boundary)
        return _weighted(boundary.position(us), boundary.normal(us), lengths)
    if isinstance(boundary, Surface) and boundary.kind != "torus":
        return _ellipsoid(np.resize(boundary.reals, 3))
    points = boundary.points(SPREAD)
    return _weighted(points, boundary.closest_point(points).normal, np.ones(SPREAD))


def _ellipsoid(axes: Array) -> Sampled:
    """Return an ellipsoid: Gauss's rule along its longest axis, and equal steps round it, whichever axis that is."""
    heights, angles = np.meshgrid(
        NODES, (np.arange(4 * NODES.size) + 0.5) * (2.0 * np.pi / (4 * NODES.size)), indexing="ij"
    )
    radii = np.sqrt(1.0 - heights * heights)
    directions = np.empty((heights.size, 3))
    shortest, middle, longest = np.argsort(axes, kind="stable")
    directions[:, shortest], directions[:, middle] = (radii * np.cos(angles)).ravel(), (radii * np.sin(angles)).ravel()
    directions[:, longest] = heights.ravel()
    normals = directions / axes
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    # The ends of the axes, where the support distance is least and largest, stand for no area.
    ends = np.vstack([np.eye(3), -np.eye(3)])
    # an area of the sphere is stretched in the ratio of 1 / h
    areas = np.concatenate([np.repeat(WEIGHTS, 4 * NODES.size) * size[:, 0], np.zeros(len(ends))])
    return _weighted(np.vstack([directions * axes, ends * axes]), np.vstack([normals / size, ends]), areas)


def _weighted(points: Array, normals: Array, sizes: Array) -> Sampled:
    return Sampled(points, normals, sizes / sizes.sum())


def _curve_samples(curve: Curve) -> tuple[Array, Array]:
    """Return parameters of a closed curve and the length (m) that each stands for: Gauss's rule, one for an edge."""
    us, lengths = [], []
    for piece in as_records(curve.pieces, PIECE):
        if piece.kind == LINE:
            us.append(np.array([0.5 * (piece.u0 + piece.u1)]))
            lengths.append(np.array([piece.u1 - piece.u0]))
            continue
        cuts = np.linspace(piece.u0, piece.u1, SPREAD // NODES.size + 1)
        if piece.kind != ARC:
            # the rows of the table are dense where the curve bends
            cuts = np.unique(np.concatenate([cuts, curve.samples[:, 0]]))
        half = 0.5 * np.diff(cuts)[:, np.newaxis]
        nodes = 0.5 * (cuts[1:] + cuts[:-1])[:, np.newaxis] + half * NODES
        speeds = (
            1.0
            if piece.kind == ARC
            else np.linalg.norm(evaluate_many(for_kernels(curve.pieces), nodes.ravel())[:, 2:4], axis=1)
        )
        us.append(nodes.ravel())
        lengths.append((half * WEIGHTS).ravel() * speeds)
    return np.concatenate(us), np.concatenate(lengths)


def centre_of(boundary: Boundary, name: str, centre: ArrayLike | None = None) -> Centre:
    """Return the centre of the kernel of a model's boundary, or the given `centre` (N,), m, if it is in the kernel.

    `name` is that of the model. Raises `RefusalError` for an open curve, and `NoKernelError` for a model without a
    kernel, with two places that cannot see each other, and for a centre outside the kernel, with a ray that meets the
    boundary more than once.
    """
    if not boundary.closed:
        raise RefusalError(
            f"model '{name}' is open",
            why="a ray from a centre inside has to meet the surface, and an open curve bounds no inside",
            todo="choose a closed model, or a renderer that needs no centre, such as minimum-distance",
        )
    surface = sampled(boundary)
    if centre is not None:
        return _checked_centre(boundary, surface, name, np.asarray(centre, dtype=np.float64))
    return _analytic_centre(surface, _inside_kernel(surface, name))


def _with_supports(surface: Sampled, point: Array) -> Centre:
    supports = surface.supports(point)
    mean = math.exp(float(np.sum(surface.shares * np.log(supports))))
    return Centre(point, mean, float(supports.min()), float(supports.max()))


def _inside_kernel(surface: Sampled, name: str) -> Array:
    """Return a point of the kernel: the mean of the surface's points, or that of the largest least support distance."""
    # most models see themselves from the mean of their surface: no optimisation is needed
    start = np.asarray(surface.shares @ surface.points)
    supports = surface.supports(start)
    if supports.min() > GRAZES * supports.max():
        return start
    # in the size of the model, for the solver's tolerances are absolute
    size = float(np.ptp(surface.points, axis=0).max())
    offsets = (surface.points - start) / size
    # maximise r with n.c + r <= n.y for all faces: r is then the least support distance
    rows = np.column_stack([surface.normals, np.ones(len(offsets))])
    from scipy.optimize import linprog

    solution = linprog(
        np.append(np.zeros(start.size), -1.0),
        A_ub=rows,
        b_ub=np.sum(surface.normals * offsets, axis=1),
        bounds=[(None, None)] * rows.shape[1],
        method="highs",
    )
    assert solution.x is not None, "the faces of a closed surface bound the least support distance"
    point = start + size * solution.x[:-1]
    supports = surface.supports(point)
    if supports.min() > GRAZES * supports.max():
        return np.asarray(point)
    # the faces whose constraints are active at the optimum: their multipliers are the weights of `_mutually_hidden`
    bounding = np.flatnonzero(-solution.ineqlin.marginals > 1e-9)
    first, second = _mutually_hidden(surface, bounding)
    others = [_in_metres(surface.points[index]) for index in bounding if index not in (first, second)]
    raise NoKernelError(
        f"model '{name}' has no kernel: no point sees all of its surface",
        why=f"{_in_metres(surface.points[first])} and {_in_metres(surface.points[second])} cannot see each other, "
        f"and no point sees {' and '.join(['these', *others]) if others else 'both'}",
        todo="choose a model that is star-shaped, or a renderer that needs no centre, such as minimum-distance",
        position=surface.points[first],
    )


def _mutually_hidden(surface: Sampled, bounding: IntArray) -> tuple[int, int]:
    """Return two places of a surface without kernel that cannot see each other: the line between them leads outside.

    Those that carry the optimum have weights m > 0 with sum m n = 0 and sum m n.y <= 0. So for each y_j of them sum_k
    m_k n_k.(y_j - y_k) >= 0, and unless all its terms vanish one is positive: from y_k the way to y_j leads outside.
    """
    points, normals = surface.points[bounding], surface.normals[bounding]
    differences = points[np.newaxis] - points[:, np.newaxis]
    length = np.maximum(np.linalg.norm(differences, axis=2), np.finfo(float).tiny)
    outwards = np.einsum("ki,kji->kj", normals, differences) / length
    first, second = np.unravel_index(int(np.argmax(outwards)), outwards.shape)
    return int(bounding[first]), int(bounding[second])


def _analytic_centre(surface: Sampled, point: Array) -> Centre:
    """Return the analytic centre, by Newton's method on the mean of log h from a point inside the kernel."""
    value = -math.inf
    for _ in range(CENTRE_STEPS):
        supports = surface.supports(point)
        value = float(np.sum(surface.shares * np.log(supports)))
        # minus the second derivative is rows^T rows: by its root, for of a thin plate itself loses all digits
        roots = np.sqrt(surface.shares)
        rows = surface.normals * (roots / supports)[:, np.newaxis]
        step = np.linalg.lstsq(rows, -roots, rcond=None)[0]
        gain = float(np.sum((rows @ step) ** 2))
        # halve the step until it stays inside the kernel and gains a tenth of what it promises (Armijo)
        share = 1.0
        while share > 1e-9:
            trial = point + share * step
            trial_supports = surface.supports(trial)
            if (
                trial_supports.min() > 0.0
                and np.sum(surface.shares * np.log(trial_supports)) >= value + 0.1 * share * gain - 1e-15
            ):
                break
            share *= 0.5
        else:
            break
        point = trial
        if gain <= 1e-28:
            break
    return _with_supports(surface, point)


def _checked_centre(boundary: Boundary, surface: Sampled, name: str, centre: Array) -> Centre:
    """Return a given centre with its support distances. Raises `NoKernelError` where the kernel does not hold it."""
    if centre.shape != (boundary.dimension,) or not np.isfinite(centre).all():
        raise RefusalError(
            f"the centre {np.asarray(centre).tolist()} for model '{name}'",
            why=f"it must be {boundary.dimension} finite numbers, m",
        )
    supports = surface.supports(centre)
    worst = int(np.argmin(supports))
    if supports[worst] > GRAZES * supports.max():
        return _with_supports(surface, centre)
    hidden = surface.points[worst]
    if not float(boundary.signed_distance(centre[np.newaxis])[0]) < 0.0:
        why = "it is not inside the model"
    else:
        size = float(np.ptp(surface.points, axis=0).max())
        other = boundary.first_crossing(hidden, centre, grain=1e-4 * size)
        also = f", and at {_in_metres(other)} too" if other is not None else " without going through it"
        why = (
            f"the ray from it to {_in_metres(hidden)} meets the boundary there{also}: one surface point must answer a "
            "ray"
        )
    raise NoKernelError(
        f"the centre {_in_metres(centre)} is outside the kernel of model '{name}'",
        why=why,
        todo="leave the centre out: the centre of the kernel is then looked for",
        position=hidden,
    )


def _in_metres(point: Array) -> str:
    return f"({', '.join(f'{x:.4g}' for x in point)}) m"
