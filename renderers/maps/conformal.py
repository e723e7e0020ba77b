"""The conformal map of the inside of a curve to the unit disk: a global transformation for any genus-0 model (8.2.1).

Curve shortening flow sees a curve locally, and splits at necks. The map here comes from an integral equation that sees
the whole shape at once.

- It exists for every shape without holes, is one-to-one, meets smooth boundaries at right angles, and has one singular
  point for the projection, its centre.
- What it cannot escape is crowding: long necks and sharp tips shrink on the circle like powers or exponentials, until
  no digits are left.

Let Θ be the boundary angle of the map f with f(c) = 0 and f'(c) > 0. Its mass on the boundary is the harmonic measure
seen from c: the charge on the boundary whose field outside is that of a unit charge at c.

Equating the two fields' normal components outside gives an equation of the second kind, whose kernel is the adjoint
double layer,

    (1/2) Θ'(t) + (1/2π) ∫ Im(z'(t) / (z(t) - z(τ))) Θ'(τ) dτ = Im(z'(t) / (z(t) - c)),

solved by Nyström's method. Its unknown is a density that is positive and small where the boundary crowds, and so it is
found there with far more digits than if it were the difference of angles of order one.

The centre c is the conformal barycentre of the boundary's arc length: the one point from which the mean of exp(iΘ) over
the arc length is zero (Douady and Earle, Acta Math. 157, 1986).

- It minimises the relative entropy of the harmonic measure seen from c to the arc length, so it balances the crowding
  of all parts of the boundary.
- It is defined by the shape alone, without coordinates: it moves with the shape under turns, mirror images, shifts and
  changes of size.
- A function that is convex along hyperbolic lines has one minimum: there is no tie to break, as there is between the
  two lobes of a dumbbell for the pole of inaccessibility or the largest conformal radius.

The integral is sampled at equal steps of a smooth curve. At a corner the map behaves like a broken power of the
distance, which no rule of equal steps resolves.

So on a curve of pieces each one is run through by Kress's substitution of order GRADING_ORDER (SIAM J. Numer. Anal. 27,
1990), whose first derivatives vanish at both ends. In the new parameter the periodic trapezoidal rule converges fast.

Nodes crowd so close to a corner that their coordinates agree in most digits, and are kept as offsets from it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from hapticeval.compiled import for_kernels
from hapticeval.errors import InputError, RefusalError
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import ARC, ARC_PIECE, LINE_PIECE, PIECE, evaluate_many
from hapticeval.records import as_record, as_records
from hapticeval.renderers.maps import conformal_kernels as kernels
from hapticeval.renderers.maps.conformal_kernels import Complex
from hapticeval.types import Array, IntArray

NODES_IF_SMOOTH, NODES_PER_PIECE, MOST_NODES = 256, 16, 2560
"""Nodes of a smooth curve, or of one piece of several, to start from; and of a whole curve to stop at."""

DENSITY_TOLERANCE = 0.05
"""Change of any density by the last doubling at which doubling stops: what is left is far less, about its square."""

BLUR_SHARE = 0.01
"""Blur, as a share of the curve's extent, beyond which the map is refused."""

CENTRE_OUTLINE_POINTS = 513
"""Points of the outline inside which the search for the centre starts."""

DEEP_ENOUGH = 0.01
"""Depth of the outline's centroid, as a share of the greatest depth, from which on the search starts there."""

TABLE_STEPS = 8
"""Steps of the table of boundary angles from one node to the next."""

ANGLE_ERROR = 4e-15
"""Error (rad) of a boundary angle in double precision; against the Cassinian's closed form it is about 2e-15."""

EQUAL_ARCS = 1024
"""Equal arcs of the boundary over which densities are averaged: at a corner the density itself is zero or infinite."""

ARC_ROUNDING = 100.0 * ANGLE_ERROR
"""Change (rad) of an arc's share of the circle that may be rounding: the arc is at the end of many sums."""

MOST_CENTRE_STEPS = 100
"""Newton steps to the centre after which it is where it is: ten are common."""

LONGEST_NEWTON_STEP = 0.8
"""Longest step to the centre, on the disk: there the formula of the way back still has all digits it needs."""

MOVE_ROUNDING, DISK_ROUNDING = 1e-17, 1e-9
"""Step, as a share of the length, that is rounding; and that on the disk below which steps that do not halve are."""


class CrowdingError(RefusalError):
    """Distant parts of the boundary crowd on the circle, so close that double precision cannot tell them apart.

    `crowding` is the ratio of the largest to the smallest density, or the largest that can be told; `blur` (m) the
    length of boundary that falls together at `place` (2,), m.
    """

    def __init__(self, name: str, crowding: float, blur: float, place: Array) -> None:
        self.crowding, self.blur, self.place = crowding, blur, place
        self.position: tuple[float, ...] | None = (float(place[0]), float(place[1]))
        super().__init__(
            f"the conformal map of '{name}' crowds by {crowding:.2g}: {blur * 1e3:.3g} mm of the boundary at "
            f"({place[0]:.4g}, {place[1]:.4g}) m fall together on the circle",
            why=f"angles are known to {ANGLE_ERROR:g} rad in double precision; behind a long neck, in the ends of a "
            "long body and in sharp tips the boundary takes less",
            todo="use minimum-distance or constraint; or shorten the body, widen the neck or blunt the tip",
        )


@dataclass(frozen=True, eq=False)
class ConformalMap:
    """The conformal map f of a curve's inside to the unit disk with f(centre) = 0 and f'(centre) > 0.

    - `nodes` is how many there are on the boundary.
    - `error` is the share by which boundary densities changed from half as many: a bound on what is left.
    - `crowding` is the ratio of the largest to the smallest boundary density |f'|, each averaged over 1/1024 of the
      length.
    - `blur` (m) is the greatest length of boundary that rounding makes one, and `blurred_at` (2,), m, where.

    Made by `conformal_map`.
    """

    curve: Curve
    centre: Array
    nodes: int
    error: float
    crowding: float
    blur: float
    blurred_at: Array
    tables: kernels.DiskTables = field(repr=False)

    def to_angle(self, points: Array) -> Array:
        """Return the arguments of f (n,), rad, of points (n, 2), m, inside the curve."""
        return kernels.map_to_angles(self.tables, for_kernels(points))

    def surface(self, angles: Array) -> Array:
        """Return the curve's parameters u (n,) at boundary angles (n,), rad: the boundary correspondence, inverted."""
        return kernels.boundary_parameters(self.tables, angles)


def conformal_map(curve: Curve, *, nodes: int | None = None) -> ConformalMap:
    """Return the conformal map of a closed curve's inside, its centre the conformal barycentre of the arc length.

    The `nodes` on the boundary are doubled until densities change by less than a twentieth of themselves, or are as
    many as given (rounded down to a multiple of four on each piece).

    Given numbers are used even where they resolve little; `error` and `blur` then show it.

    Raises `CrowdingError` where double precision is exhausted, `RefusalError` for outlines of more detail than 2560
    nodes resolve and for an unbounded curve, and `InputError` for numbers of nodes that are no use.
    """
    if not curve.closed:
        raise RefusalError(f"curve '{curve.name}' is unbounded", why="its inside is a half-plane and not a disk")
    counts = _node_counts(curve, nodes)
    start = _search_start(curve)
    # each number of nodes is judged against half as many
    coarse = factored_system(curve, counts[0] // 2)
    for n in counts:
        fine = factored_system(curve, n)
        fine_map = balance_centre(fine, start)
        # both maps about the same centre, or they would differ by more than their errors
        best = _map_with_measures(curve, solve_correspondence(coarse, fine_map.centre), fine_map)
        if best.error <= DENSITY_TOLERANCE:
            break
        coarse = fine
    resolved = best.error <= DENSITY_TOLERANCE
    xmin, ymin, xmax, ymax = curve.bounds
    # crowding is told only of a map that is resolved, or that nobody asked for by number
    if best.blur > BLUR_SHARE * max(xmax - xmin, ymax - ymin) and (resolved or nodes is None):
        raise CrowdingError(curve.name, best.crowding, best.blur, best.blurred_at)
    if not resolved and nodes is None:
        raise RefusalError(
            f"the conformal map of '{curve.name}' is not resolved by {best.nodes} boundary nodes",
            why=f"the last doubling changed boundary densities by {best.error:.2g} of themselves",
            todo="simplify the outline, or use the minimum-distance or constraint renderer",
        )
    return best


def _map_with_measures(curve: Curve, coarse: Correspondence, fine: Correspondence) -> ConformalMap:
    """Return the map on the nodes of `fine`, with what is to be said of it; `coarse` is on half as many nodes."""
    angles, lengths = fine.angles, fine.lengths
    # in units of the largest radius no square overflows
    scale = float(np.max(np.abs(fine.z)))
    parts = (fine.z / scale, fine.nodes.steps / scale, np.exp(1j * angles[:-1:TABLE_STEPS]))
    disk = kernels.DiskTables(
        np.ascontiguousarray(np.column_stack([part for values in parts for part in (values.real, values.imag)])),
        angles,
        fine.slopes,
        for_kernels(curve.pieces),
        fine.nodes.per_piece,
        TABLE_STEPS,
        float(fine.centre[0]),
        float(fine.centre[1]),
        scale,
    )
    # three turns in a row: an arc or an interval may lie across the start
    turns = np.concatenate([angles[:-1] - 2.0 * np.pi, angles, angles[1:] + 2.0 * np.pi])
    along = np.concatenate([lengths[:-1] - curve.length, lengths, lengths[1:] + curve.length])
    cuts = curve.length * np.arange(EQUAL_ARCS + 1) / EQUAL_ARCS
    # each arc's harmonic measure (rad): its share of the circle
    masses = np.diff(np.interp(cuts, along, turns))
    # the boundary that angles of +- ANGLE_ERROR about each entry cover
    blurs = np.interp(angles + ANGLE_ERROR, turns, along) - np.interp(angles - ANGLE_ERROR, turns, along)
    widest = int(np.argmax(blurs))
    return ConformalMap(
        curve=curve,
        centre=fine.centre,
        nodes=fine.z.size,
        error=density_change(coarse, fine),
        crowding=float(np.max(masses) / max(np.min(masses), ANGLE_ERROR)),
        blur=float(blurs[widest]),
        blurred_at=curve.position(curve.parameter(lengths[widest])),
        tables=disk,
    )


def _search_start(curve: Curve) -> Array:
    """Return a point (2,), m, well inside, from which the centre is looked for.

    It is the outline's centroid, or where that is hardly inside the deepest point.
    """
    from shapely import Polygon
    from shapely.ops import polylabel

    # about a point of the outline: far from the origin the search would stop at the rounding of coordinates
    outline = curve.outline(CENTRE_OUTLINE_POINTS)
    polygon = Polygon(outline - outline[0])
    xmin, ymin, xmax, ymax = curve.bounds
    # pole of inaccessibility, to 5 % of the smaller extent
    deepest = polylabel(polygon, 0.05 * min(xmax - xmin, ymax - ymin))
    candidates = outline[0] + np.array([[point.x, point.y] for point in (polygon.exterior.centroid, deepest)])
    depths = -curve.signed_distance(candidates)
    if depths[1] <= 0.0:
        raise RefusalError(
            f"the conformal map of '{curve.name}' has no centre to start from",
            why=f"the body is too thin for an outline of {CENTRE_OUTLINE_POINTS} points",
            todo="simplify the outline, or use the minimum-distance or constraint renderer",
        )
    return np.asarray(candidates[0] if depths[0] > DEEP_ENOUGH * depths[1] else candidates[1])


def _node_counts(curve: Curve, nodes: int | None) -> list[int]:
    """Return the numbers of nodes to try, each twice the one before."""
    pieces, fewest = (
        (1, NODES_IF_SMOOTH) if is_smooth(curve) else (curve.pieces.shape[0], NODES_PER_PIECE * curve.pieces.shape[0])
    )
    if nodes is not None:
        # a multiple of four on each piece: half as many are even too
        count = int(nodes) // (4 * pieces) * (4 * pieces)
        if not 8 * pieces <= count <= 2 * MOST_NODES:
            raise InputError(
                f"nodes = {nodes!r} on the boundary of '{curve.name}'",
                why=f"there must be from {8 * pieces} to {2 * MOST_NODES}, the same on each of its {pieces} pieces",
            )
        return [count]
    if fewest > MOST_NODES:
        raise RefusalError(
            f"curve '{curve.name}' has {pieces} pieces",
            why=f"the conformal map takes at least {NODES_PER_PIECE} boundary nodes on each, and at most "
            f"{MOST_NODES} in all",
            todo="simplify the outline, or use the minimum-distance or constraint renderer",
        )
    return [fewest * 2**k for k in range(int(np.log2(MOST_NODES / fewest)) + 1)]


class Nodes(NamedTuple):
    """Boundary nodes at the integers of a parameter t that runs over `n` once around.

    `anchors` + `offsets` (n,) are the positions and `steps` (n,) their derivatives by t, complex, m.

    `per_piece` is the number of nodes on each piece of a graded curve, whose first node lies half a step after its
    start. It is zero on a smooth curve, whose first node lies at the start.
    """

    anchors: Complex
    offsets: Complex
    steps: Complex
    per_piece: int


def is_smooth(curve: Curve) -> bool:
    """Whether a closed curve is one piece without a corner where its end meets its start."""
    return bool(curve.pieces.shape[0] == 1 and not curve.corners)


def boundary_nodes(curve: Curve, n: int) -> Nodes:
    """Return `n` nodes on a closed curve; on one of pieces n is a multiple of their number."""
    pieces = for_kernels(curve.pieces)
    # equal steps of the parameter, derivatives by step
    if is_smooth(curve):
        start, end = curve.u_range
        rows = evaluate_many(pieces, start + (end - start) * np.arange(n) / n)
        positions, derivatives = rows[:, 0] + 1j * rows[:, 1], rows[:, 2] + 1j * rows[:, 3]
        slopes: Complex = np.asarray(derivatives * ((end - start) / n), dtype=complex)
        return Nodes(np.zeros(n, dtype=complex), positions, slopes, 0)
    # nodes of one piece; the first and the last lie half a step from its ends
    per = n // pieces.shape[0]
    after, before, slope = np.array([kernels.grading_substitution((i + 0.5) / per) for i in range(per)]).T
    # the first half of a piece's nodes are kept as offsets from its start, the rest from its end
    early = np.arange(per) < per // 2
    starts = evaluate_many(pieces, for_kernels(as_records(pieces, PIECE).u0))
    joints = starts[:, 0] + 1j * starts[:, 1]
    anchors, offsets, steps = [], [], []
    for k, row in enumerate(pieces):
        piece = as_record(row, PIECE)
        length = piece.u1 - piece.u0
        signed = np.where(early, after, -before) * length
        if piece.kind == ARC:
            arc = as_record(row, ARC_PIECE)
            radius, sense = arc.radius, arc.sense
            # the angle on the arc of the joint that the node is kept from
            ends = arc.angle + sense * np.where(early, 0.0, length / radius)
            swept = sense * signed / radius
            # r e^(ia) (e^(ib) - 1), with cos b - 1 = -2 sin^2(b / 2): exact for short offsets
            offset = radius * np.exp(1j * ends) * (1j * np.sin(swept) - 2.0 * np.sin(swept / 2.0) ** 2)
            tangent = 1j * sense * np.exp(1j * (ends + swept))
        else:
            line = as_record(row, LINE_PIECE)
            tangent = np.full(per, complex(line.dx, line.dy))
            offset = signed * tangent
        anchors.append(np.where(early, joints[k], joints[(k + 1) % joints.size]))
        offsets.append(offset)
        # dz/dt by the chain rule: `slope` is the substitution's
        steps.append(tangent * (slope * length / per))
    return Nodes(np.concatenate(anchors), np.concatenate(offsets), np.concatenate(steps), per)


class Correspondence(NamedTuple):
    """Where the boundary goes: a table of TABLE_STEPS steps from node to node, and the first again after one turn.

    - `z` (n,): the nodes, complex, m, relative to the `centre` (2,), m;
    - `angles` (m + 1,), rad: never fall;
    - `slopes` (m + 1,): their derivatives by table step, and `density` (n,) those at the nodes by node;
    - `lengths` (m + 1,), m: the arc lengths of the entries.
    """

    nodes: Nodes
    centre: Array
    z: Complex
    angles: Array
    slopes: Array
    density: Array
    lengths: Array


class FactoredSystem(NamedTuple):
    """The integral equation of a closed curve on its `nodes`: the `factors` of its matrix serve every centre.

    `lengths` (m + 1,), m, are the arc lengths of the entries of the tables of boundary angles.
    """

    curve: Curve
    nodes: Nodes
    factors: tuple[Array, IntArray]
    lengths: Array


def factored_system(curve: Curve, n: int) -> FactoredSystem:
    """Return the integral equation on `n` nodes, its matrix factored."""
    nodes = boundary_nodes(curve, n)
    steps = np.arange(n * TABLE_STEPS) / TABLE_STEPS
    lengths = np.append(
        curve.arc_length(kernels.parameters_at(for_kernels(curve.pieces), n, nodes.per_piece, steps)), 0.0
    )
    lengths[1:][lengths[1:] <= lengths[0]] += curve.length  # the last half step of a graded curve is on its first piece
    return FactoredSystem(
        curve, nodes, lu_factor(kernels.double_layer_matrix(nodes.anchors, nodes.offsets, nodes.steps)), lengths
    )


def solve_correspondence(system: FactoredSystem, centre: Array) -> Correspondence:
    """Return the integral equation solved for the centre (2,), m: the boundary's angles (rad) about it."""
    nodes = system.nodes
    z = nodes.anchors - complex(*centre) + nodes.offsets
    # the right-hand side of the equation: Im(z' / (z - c)), z relative to c
    density = lu_solve(system.factors, (nodes.steps / z).imag)
    return Correspondence(nodes, centre, z, *_integrate_density(density, z), density, system.lengths)


def balance_centre(system: FactoredSystem, start: Array) -> Correspondence:
    """Return the integral equation solved for the conformal barycentre of the arc length.

    It is looked for from `start` (2,), m, by Newton's method on the disk, shortened until the relative entropy falls
    and the centre is inside.

    It ends where steps are rounding; or where they no longer shrink, on shapes that crowd so much that no map will come
    of it.
    """
    # each node's share of the arc length
    weights = np.abs(system.nodes.steps) / np.sum(np.abs(system.nodes.steps))
    least_move = MOVE_ROUNDING * system.curve.length
    current, last = solve_correspondence(system, start), np.inf
    for _ in range(MOST_CENTRE_STEPS):
        circle = np.exp(1j * current.angles[:-1:TABLE_STEPS])
        # first and second moment of the boundary's images: the first is zero at the barycentre
        first, second = np.sum(weights * circle), np.sum(weights * circle**2)
        # Newton for the Moebius map (z - w) / (1 - conj(w) z) that makes the first moment zero
        w = (first + np.conj(first) * second) / (1.0 - abs(second) ** 2)
        w *= min(1.0, LONGEST_NEWTON_STEP / max(abs(w), LONGEST_NEWTON_STEP))
        # the relative entropy must fall, or the step is too long
        while abs(w) > DISK_ROUNDING and np.sum(weights * np.log(np.abs(circle - w) ** 2 / (1.0 - abs(w) ** 2))) > 0.0:
            w *= 0.5
        # small steps that do not halve: rounding
        if abs(w) < DISK_ROUNDING and abs(w) >= 0.5 * last:
            break
        harmonic = np.maximum(current.density, 0.0)
        weighted = harmonic * circle / (circle - w)
        # where the map's inverse takes w, by Cauchy's formula over the nodes
        move = np.sum(weighted * current.z) / np.sum(weighted) - np.sum(harmonic * current.z) / np.sum(harmonic)
        # a centre outside would have no map
        while abs(move) > least_move and not system.curve.contains([_shifted(current.centre, move)])[0]:
            move *= 0.5
        if abs(move) <= least_move:
            break
        current, last = solve_correspondence(system, _shifted(current.centre, move)), abs(w)
    return current


def _shifted(point: Array, move: complex) -> Array:
    """Return a point (2,), m, moved by a complex number."""
    return np.asarray(point + np.array([move.real, move.imag]))


def _integrate_density(density: Array, z: Complex) -> tuple[Array, Array]:
    """Return the table of Θ and Θ' from Θ' at the nodes, by trigonometric interpolation.

    Where Θ' is as good as zero, at sharp tips, the waves of the rest do not cancel to it.

    There Θ rises between two nodes by no less than half of the smaller and no more than twice the larger of the Θ' at
    them, evenly.

    Θ is free by a constant. Im log((z - c) / f) is harmonic and zero at the centre where f' > 0: so is its mean by
    harmonic measure.
    """
    n = density.size
    modes = np.fft.rfft(density)
    # the highest wave of an even number of nodes counts half
    modes[-1] *= 0.5
    # integrated: each wave over i times its wave number; the mean is added as a straight rise
    waves = modes * n / (2j * np.pi * np.maximum(np.arange(modes.size), 1))
    waves[0] = waves[-1] = 0.0
    periodic = np.fft.irfft(waves, TABLE_STEPS * n) * TABLE_STEPS
    # by how much the angle grows from entry to entry of the table
    rises = (np.roll(periodic, -1) - periodic + modes[0].real / n / TABLE_STEPS).reshape(n, TABLE_STEPS)
    # the densities at both ends of each step from node to node
    ends = np.maximum(np.stack([density, np.roll(density, -1)]), 0.0)
    # the rise between two nodes, within its bounds
    bounded = np.clip(rises.sum(axis=1), 0.5 * ends.min(axis=0), 2.0 * ends.max(axis=0))
    mended = (bounded != rises.sum(axis=1)) | (rises.min(axis=1) < 0.0)
    rises[mended] = bounded[mended, np.newaxis] / TABLE_STEPS
    angles = np.concatenate([[0.0], np.cumsum(rises)])
    # one turn in all
    angles *= 2.0 * np.pi / angles[-1]
    # the free constant: the mean of arg z - angle by harmonic measure is zero
    angles += np.average(np.unwrap(np.angle(z)) - angles[:-1:TABLE_STEPS], weights=ends[0])
    rises = np.diff(angles)
    steepest = 3.0 * np.minimum(np.append(rises, rises[0]), np.insert(rises, 0, rises[-1]))
    slopes = np.fft.irfft(modes, TABLE_STEPS * n)
    # Fritsch and Carlson: no cubic between two entries turns back
    return angles, np.clip(np.append(slopes, slopes[0]), 0.0, steepest)


def density_change(coarse: Correspondence, fine: Correspondence) -> float:
    """Return by what share of themselves densities change at most from a coarse solution to a fine one.

    Densities are means over arcs of 1/1024 of the boundary, or more. `fine` has twice the nodes of `coarse`. Arcs that
    rounding alone may change so are left out.
    """
    first, length = coarse.lengths[0], coarse.lengths[-1] - coarse.lengths[0]
    # entries of the coarse table that bound arcs of equal length
    cuts = np.unique(np.searchsorted(coarse.lengths, first + length * np.arange(1, EQUAL_ARCS) / EQUAL_ARCS))
    # on a graded curve the first of twice as many nodes lies a quarter of a coarse step earlier
    shift = TABLE_STEPS // 2 if coarse.nodes.per_piece else 0
    before, after = np.diff(coarse.angles[cuts]), np.diff(fine.angles[2 * cuts + shift])
    changes = np.abs(after - before)
    return float(
        np.max(np.where(changes > ARC_ROUNDING, changes / np.maximum(np.maximum(before, after), ARC_ROUNDING), 0.0))
    )
