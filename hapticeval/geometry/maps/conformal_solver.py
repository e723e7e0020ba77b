"""The boundary correspondence of the conformal map to the disk, by an integral equation for the harmonic measure.

Let Θ be the boundary angle of the map f with f(c) = 0 and f'(c) > 0. Its mass on the boundary is the harmonic measure
seen from c: the charge on the boundary whose field outside is that of a unit charge at c. Equating the two fields'
normal components outside gives an equation of the second kind, whose kernel is the adjoint double layer,

    (1/2) Θ'(t) + (1/2π) ∫ Im(z'(t) / (z(t) - z(τ))) Θ'(τ) dτ = Im(z'(t) / (z(t) - c)),

solved by Nyström's method. Its unknown is a density that is positive and small where the boundary crowds, and so it is
found there with far more digits than if it were the difference of angles of order one.

The centre c is the conformal barycentre of the boundary's arc length: the one point from which the mean of exp(iΘ) over
the arc length is zero (Douady and Earle, Acta Math. 157, 1986). It minimises the relative entropy of the harmonic
measure seen from c to the arc length, so it balances the crowding of all parts of the boundary. It is defined by the
shape alone, without coordinates. A function that is convex along hyperbolic lines has one minimum: there is no tie to
break, as there is between the two lobes of a dumbbell for the pole of inaccessibility or the largest conformal radius.
So the centre moves with the shape under turns, mirror images, shifts and changes of size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from hapticeval.compiled import for_kernels
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.maps.conformal_kernels import matrix
from hapticeval.geometry.maps.conformal_nodes import Complex, Nodes, nodes_of, parameters_at
from hapticeval.types import Array, IntArray

FINE = 8
"""Steps of the table of boundary angles from one node to the next."""

ROUNDING = 4e-15
"""Error (rad) of a boundary angle in double precision; against the Cassinian's closed form it is about 2e-15."""

ARCS = 1024
"""Equal arcs of the boundary over which densities are averaged: at a corner the density itself is zero or infinite."""

NOISE = 100.0 * ROUNDING
"""Change (rad) of an arc's share of the circle that may be rounding: the arc is at the end of many sums."""

STEPS = 100
"""Newton steps to the centre after which it is where it is: ten are common."""

FARTHEST = 0.8
"""Longest step to the centre, on the disk: there the formula of the way back still has all digits it needs."""

SETTLED, SLOW = 1e-17, 1e-9
"""Step, as a share of the length, that is rounding; and that on the disk below which steps that do not halve are."""


class Correspondence(NamedTuple):
    """Where the boundary goes: a table of FINE steps from each node to the next, and the first again after one turn.

    `z` (n,) are the nodes, complex, m, relative to the `centre` (2,), m; `angles` (m + 1,), rad, never fall; `slopes`
    (m + 1,) are their derivatives by table step, `density` (n,) those at the nodes by node, and `lengths`
    (m + 1,), m, the arc lengths of the entries.
    """

    nodes: Nodes
    centre: Array
    z: Complex
    angles: Array
    slopes: Array
    density: Array
    lengths: Array


class System(NamedTuple):
    """The integral equation of a closed curve on its `nodes`: the `factors` of its matrix serve every centre.

    `lengths` (m + 1,), m, are the arc lengths of the entries of the tables of boundary angles.
    """

    curve: Curve
    nodes: Nodes
    factors: tuple[Array, IntArray]
    lengths: Array


def system_of(curve: Curve, n: int) -> System:
    """The integral equation on `n` nodes, its matrix factored."""
    nodes = nodes_of(curve, n)
    steps = np.arange(n * FINE) / FINE
    lengths = np.append(curve.arc_length(parameters_at(for_kernels(curve.pieces), n, nodes.per_piece, steps)), 0.0)
    lengths[1:][lengths[1:] <= lengths[0]] += curve.length  # the last half step of a graded curve is on its first piece
    return System(curve, nodes, lu_factor(matrix(nodes.anchors, nodes.offsets, nodes.steps)), lengths)


def correspondence(system: System, centre: Array) -> Correspondence:
    """The integral equation solved for the centre (2,), m."""
    nodes = system.nodes
    z = nodes.anchors - complex(*centre) + nodes.offsets
    density = lu_solve(system.factors, (nodes.steps / z).imag)
    return Correspondence(nodes, centre, z, *_integrated(density, z), density, system.lengths)


def balanced(system: System, start: Array) -> Correspondence:
    """The integral equation solved for the conformal barycentre of the arc length, looked for from `start` (2,), m.

    Newton's method on the disk, shortened until the relative entropy falls and the centre is inside. It ends where
    steps are rounding; or where they no longer shrink, on shapes that crowd so much that no map will come of it.
    """
    weights = np.abs(system.nodes.steps) / np.sum(np.abs(system.nodes.steps))
    tiny = SETTLED * system.curve.length
    found, last = correspondence(system, start), np.inf
    for _ in range(STEPS):
        circle = np.exp(1j * found.angles[:-1:FINE])
        first, second = np.sum(weights * circle), np.sum(weights * circle**2)
        w = (first + np.conj(first) * second) / (1.0 - abs(second) ** 2)
        w *= min(1.0, FARTHEST / max(abs(w), FARTHEST))
        while abs(w) > SLOW and np.sum(weights * np.log(np.abs(circle - w) ** 2 / (1.0 - abs(w) ** 2))) > 0.0:
            w *= 0.5
        if abs(w) < SLOW and abs(w) >= 0.5 * last:
            break
        harmonic = np.maximum(found.density, 0.0)
        seen = harmonic * circle / (circle - w)
        move = np.sum(seen * found.z) / np.sum(seen) - np.sum(harmonic * found.z) / np.sum(harmonic)
        while abs(move) > tiny and not system.curve.contains([_moved(found.centre, move)])[0]:
            move *= 0.5
        if abs(move) <= tiny:
            break
        found, last = correspondence(system, _moved(found.centre, move)), abs(w)
    return found


def _moved(point: Array, move: complex) -> Array:
    return np.asarray(point + np.array([move.real, move.imag]))


def _integrated(density: Array, z: Complex) -> tuple[Array, Array]:
    """The table of Θ and Θ' from Θ' at the nodes, by trigonometric interpolation.

    Where Θ' is as good as zero, at sharp tips, the waves of the rest do not cancel to it: there Θ rises between two
    nodes by no less than half of the smaller and no more than twice the larger of the Θ' at them, evenly. Θ is free
    by a constant. Im log((z - c) / f) is harmonic and zero at the centre where f' > 0: so is its mean by harmonic
    measure.
    """
    n = density.size
    modes = np.fft.rfft(density)
    modes[-1] *= 0.5
    waves = modes * n / (2j * np.pi * np.maximum(np.arange(modes.size), 1))
    waves[0] = waves[-1] = 0.0
    periodic = np.fft.irfft(waves, FINE * n) * FINE
    rises = (np.roll(periodic, -1) - periodic + modes[0].real / n / FINE).reshape(n, FINE)
    ends = np.maximum(np.stack([density, np.roll(density, -1)]), 0.0)
    bounded = np.clip(rises.sum(axis=1), 0.5 * ends.min(axis=0), 2.0 * ends.max(axis=0))
    mended = (bounded != rises.sum(axis=1)) | (rises.min(axis=1) < 0.0)
    rises[mended] = bounded[mended, np.newaxis] / FINE
    angles = np.concatenate([[0.0], np.cumsum(rises)])
    angles *= 2.0 * np.pi / angles[-1]
    angles += np.average(np.unwrap(np.angle(z)) - angles[:-1:FINE], weights=ends[0])
    rises = np.diff(angles)
    steepest = 3.0 * np.minimum(np.append(rises, rises[0]), np.insert(rises, 0, rises[-1]))
    slopes = np.fft.irfft(modes, FINE * n)
    # Fritsch and Carlson: no cubic between two entries turns back
    return angles, np.clip(np.append(slopes, slopes[0]), 0.0, steepest)


def change(coarse: Correspondence, fine: Correspondence) -> float:
    """By what share of themselves the densities change, at most, of arcs of 1/1024 of the boundary or more.

    `fine` has twice the nodes of `coarse`. Arcs that rounding alone may change so are left out.
    """
    first, whole = coarse.lengths[0], coarse.lengths[-1] - coarse.lengths[0]
    cuts = np.unique(np.searchsorted(coarse.lengths, first + whole * np.arange(1, ARCS) / ARCS))
    shift = FINE // 2 if coarse.nodes.per_piece else 0
    before, after = np.diff(coarse.angles[cuts]), np.diff(fine.angles[2 * cuts + shift])
    changes = np.abs(after - before)
    return float(np.max(np.where(changes > NOISE, changes / np.maximum(np.maximum(before, after), NOISE), 0.0)))
