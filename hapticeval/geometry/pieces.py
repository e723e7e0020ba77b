"""Builders of the rows that `kernels` walks: straight and circular pieces, strung by arc length."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hapticeval.geometry.kernels import ARC, COLUMNS, LINE
from hapticeval.types import Array


def closed_polyline(vertices: Array) -> Array:
    """LINE pieces through the vertices (n, 2) and back to the first: (n, COLUMNS)."""
    edges = np.roll(vertices, -1, axis=0) - vertices
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    ends = np.cumsum(lengths)
    pieces = np.zeros((vertices.shape[0], COLUMNS))
    pieces[:, 0] = LINE
    pieces[1:, 1] = ends[:-1]
    pieces[:, 2] = ends
    pieces[:, 3:5] = vertices
    pieces[:, 5:7] = edges / lengths[:, np.newaxis]
    return pieces


def line(start: Sequence[float], end: Sequence[float]) -> Array:
    """One LINE piece from a point to another, with u from 0."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = float(np.hypot(dx, dy))
    return np.array([LINE, 0.0, length, start[0], start[1], dx / length, dy / length, 0.0, 0.0])


def arc(centre: Sequence[float], radius: float, start: float, sweep: float) -> Array:
    """One ARC piece from angle `start` through `sweep` (rad, negative is clockwise), with u from 0."""
    length = abs(sweep) * radius
    return np.array([ARC, 0.0, length, centre[0], centre[1], radius, start, np.sign(sweep), 0.0])


def strung(rows: Sequence[Array]) -> Array:
    """Pieces put one after the other: u runs on from each into the next."""
    pieces = np.array(rows)
    ends = np.cumsum(pieces[:, 2])
    pieces[:, 2] = ends
    pieces[1:, 1] = ends[:-1]
    return pieces
