"""The boundary prepared for the tool: how its joints turn, how fast it bends, and cells to find collisions with."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hapticeval.compiled import for_kernels
from hapticeval.geometry.curve import Curve
from hapticeval.geometry.curve_kernels import STRAIGHT, joint_turn
from hapticeval.geometry.kernels import ARC, KIND, LINE, U0, U1, UNBOUNDED, evaluate_many
from hapticeval.types import Array

CELL_TURN = 0.2
"""Most that the boundary turns within a cell (rad): few enough that it is a graph over the cell's chord."""

SEAM = 1e-9
"""How far (m) a cell reaches beyond its ends, so that no path slips through between two cells."""

TIP = 1e-15
"""The same at a convex corner, where nothing is there to be hit: only so far that rounding cannot let a tool that is
dropped straight onto the tip fall between the two faces."""

PIECE, UA, UB, OX, OY, EX, EY, SPAN, SLOPE_A, SLOPE_B, REACH_A, REACH_B, XMIN, XMAX, YMIN, YMAX = range(16)
CELLS = 16


class Terrain(NamedTuple):
    """`pieces` (n, 9) as in `kernels`; `joints` (n,), rad, how the boundary turns where piece i begins (positive
    convex); `paces` (n,), 1/m, how fast each piece changes with arc length; `cells` (m, 16), see the column names."""

    pieces: Array
    joints: Array
    paces: Array
    cells: Array


def terrain(curve: Curve) -> Terrain:
    """Prepare `curve` for the tool, once a scene."""
    pieces = for_kernels(curve.pieces)
    count = pieces.shape[0]
    joints = np.array([joint_turn(pieces, i) if curve.closed else 0.0 for i in range(count)])
    joints[np.abs(joints) <= STRAIGHT] = 0.0
    paces = np.zeros(count)
    rows = []
    for i in range(count):
        cuts, paces[i] = _cuts_and_pace(pieces[i])
        rows.append(_cells(pieces, i, cuts, joints[i] > 0.0, joints[(i + 1) % count] > 0.0))
    return Terrain(pieces, joints, paces, np.vstack(rows))


def _cuts_and_pace(piece: Array) -> tuple[Array, float]:
    """Parameters at which a piece is cut into cells, and the largest of |kappa| and |d kappa / ds|^(1/2)."""
    kind, start, end = piece[KIND], piece[U0], piece[U1]
    if kind in (LINE, UNBOUNDED):
        return np.array([start, end]), 0.0
    us = np.linspace(start, end, 4097)
    rows = evaluate_many(piece[np.newaxis], us)
    speed = np.hypot(rows[:, 2], rows[:, 3])
    turning = (rows[:, 2] * rows[:, 5] - rows[:, 3] * rows[:, 4]) / speed**2
    cells = math.ceil((end - start) * np.abs(turning).max() / CELL_TURN)
    bend = turning / speed
    change = 0.0 if kind == ARC else float(np.abs(np.gradient(bend, us) / speed).max())
    return np.linspace(start, end, max(cells, 2) + 1), max(float(np.abs(bend).max()), math.sqrt(change))


def _cells(pieces: Array, i: int, cuts: Array, convex_start: bool, convex_end: bool) -> Array:
    """Rows of cells on piece i between consecutive `cuts`."""
    cells = np.zeros((cuts.size - 1, CELLS))
    cells[:, PIECE] = i
    cells[:, UA], cells[:, UB] = cuts[:-1], cuts[1:]
    cells[:, REACH_A : REACH_B + 1] = SEAM
    if pieces[i, KIND] == UNBOUNDED:
        cells[:, OX : EY + 1] = pieces[i, 3:7]
        cells[:, UA], cells[:, SPAN] = 0.0, math.inf
        cells[:, REACH_A] = math.inf
        cells[:, [XMIN, YMIN]], cells[:, [XMAX, YMAX]] = -math.inf, math.inf
        return cells
    rows = evaluate_many(pieces[i : i + 1], cuts)
    chords = np.diff(rows[:, :2], axis=0)
    cells[:, SPAN] = np.hypot(chords[:, 0], chords[:, 1])
    ex, ey = (chords / cells[:, SPAN, np.newaxis]).T
    cells[:, OX : OY + 1] = rows[:-1, :2]
    cells[:, EX], cells[:, EY] = ex, ey
    if pieces[i, KIND] == LINE:
        cells[:, EX], cells[:, EY] = pieces[i, 5], pieces[i, 6]
    else:
        for column, ends in ((SLOPE_A, rows[:-1]), (SLOPE_B, rows[1:])):
            cells[:, column] = (ends[:, 2] * ey - ends[:, 3] * ex) / (ends[:, 2] * ex + ends[:, 3] * ey)
    # A graph whose slope stays within CELL_TURN of its chord's lies within half of that times its span.
    margin = (0.0 if pieces[i, KIND] == LINE else CELL_TURN) * cells[:, SPAN] + SEAM
    for low, high, axis in ((XMIN, XMAX, 0), (YMIN, YMAX, 1)):
        cells[:, low] = np.minimum(rows[:-1, axis], rows[1:, axis]) - margin
        cells[:, high] = np.maximum(rows[:-1, axis], rows[1:, axis]) + margin
    if convex_start:
        cells[0, REACH_A] = TIP
    if convex_end:
        cells[-1, REACH_B] = TIP
    return cells
