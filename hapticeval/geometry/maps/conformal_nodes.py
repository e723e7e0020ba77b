"""Where a boundary integral is sampled: at equal steps of a smooth curve, or graded towards the joints of pieces.

At a corner the conformal map behaves like a broken power of the distance, which no rule of equal steps resolves. On a
curve of pieces each piece is therefore run through by Kress's substitution of order GRADING (SIAM J. Numer. Anal. 27,
1990), whose first derivatives vanish at both ends: in the new parameter the periodic trapezoidal rule converges fast.
Nodes crowd so close to a corner that their coordinates agree in most digits, and are kept as offsets from it.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hapticeval.compiled import compiled, for_kernels
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.kernels import ARC, KIND, U0, U1, C, D, E, evaluate_many
from hapticeval.types import Array

Complex: TypeAlias = NDArray[np.complex128]

GRADING = 8
"""Order of the substitution: of 4, 6, 8 and 10 it left stars and squares of 40 to 120 nodes a piece the least error."""


class Nodes(NamedTuple):
    """Boundary nodes at the integers of a parameter t that runs over `n` once around.

    `anchors` + `offsets` (n,) are the positions and `steps` (n,) their derivatives by t, complex, m. `per_piece` is
    the number of nodes on each piece of a graded curve, whose first node lies half a step after its start; it is
    zero on a smooth curve, whose first node lies at the start.
    """

    anchors: Complex
    offsets: Complex
    steps: Complex
    per_piece: int


def smooth(curve: Curve) -> bool:
    """Whether a closed curve is one piece without a corner where its end meets its start."""
    return bool(curve.pieces.shape[0] == 1 and not curve.corners)


def nodes_of(curve: Curve, n: int) -> Nodes:
    """`n` nodes on a closed curve; on one of pieces n is a multiple of their number."""
    pieces = for_kernels(curve.pieces)
    if smooth(curve):
        start, end = curve.u_range
        rows = evaluate_many(pieces, start + (end - start) * np.arange(n) / n)
        positions, derivatives = rows[:, 0] + 1j * rows[:, 1], rows[:, 2] + 1j * rows[:, 3]
        slopes: Complex = np.asarray(derivatives * ((end - start) / n), dtype=complex)
        return Nodes(np.zeros(n, dtype=complex), positions, slopes, 0)
    per = n // pieces.shape[0]
    after, before, slope = np.array([graded((i + 0.5) / per) for i in range(per)]).T
    early = np.arange(per) < per // 2
    starts = evaluate_many(pieces, for_kernels(pieces[:, U0]))
    joints = starts[:, 0] + 1j * starts[:, 1]
    anchors, offsets, steps = [], [], []
    for k, row in enumerate(pieces):
        length = row[U1] - row[U0]
        signed = np.where(early, after, -before) * length
        if row[KIND] == ARC:
            radius, turn = row[C], row[E]
            ends = row[D] + turn * np.where(early, 0.0, length / radius)
            swept = turn * signed / radius
            offset = radius * np.exp(1j * ends) * (1j * np.sin(swept) - 2.0 * np.sin(swept / 2.0) ** 2)
            tangent = 1j * turn * np.exp(1j * (ends + swept))
        else:
            tangent = np.full(per, complex(row[C], row[D]))
            offset = signed * tangent
        anchors.append(np.where(early, joints[k], joints[(k + 1) % joints.size]))
        offsets.append(offset)
        steps.append(tangent * (slope * length / per))
    return Nodes(np.concatenate(anchors), np.concatenate(offsets), np.concatenate(steps), per)


@compiled
def graded(s: float) -> tuple[float, float, float]:
    """Kress's substitution w of [0, 1] onto itself: w, 1 - w without cancellation, and w'."""
    r, q = 1.0 - s, 0.5 - 1.0 / GRADING
    first = s * (2.0 / GRADING + q * (6.0 - 12.0 * s + 8.0 * s * s))
    last = r * (2.0 / GRADING + q * (6.0 - 12.0 * r + 8.0 * r * r))
    rise = 2.0 / GRADING + 6.0 * q * (1.0 - 2.0 * s) ** 2
    total = first**GRADING + last**GRADING
    slope = GRADING * rise * (first * last) ** (GRADING - 1) / (total * total)
    return first**GRADING / total, last**GRADING / total, slope


@compiled
def parameter_at(pieces: Array, n: int, per_piece: int, t: float) -> float:
    """The curve's u at the parameter t of its nodes, inside the curve's range."""
    start, end = pieces[0, U0], pieces[pieces.shape[0] - 1, U1]
    if per_piece == 0:
        share = t / n
        u = start + (end - start) * (share - np.floor(share))
        return float(u if u < end else start)
    place = (t + 0.5) / per_piece
    place -= pieces.shape[0] * np.floor(place / pieces.shape[0])
    k = min(int(place), pieces.shape[0] - 1)
    after, before, _ = graded(place - k)
    low, high = pieces[k, U0], pieces[k, U1]
    u = low + (high - low) * after if after < 0.5 else high - (high - low) * before
    return float(u if u < end else start)


@compiled
def parameters_at(pieces: Array, n: int, per_piece: int, places: Array) -> Array:
    """`parameter_at` for each of the places (m,)."""
    out = np.empty(places.shape[0])
    for i in range(out.shape[0]):
        out[i] = parameter_at(pieces, n, per_piece, places[i])
    return out
