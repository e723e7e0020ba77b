"""Compiled look-ups in tables of IHIPs and normals: bilinear in the plane, trilinear in space.

A table is `nodes` (..., y, x, 2N), IHIP and outward unit normal interleaved; `cells` (..., y, x), one byte a cell; and
`frame` (N + 1,): the first node (m), and one over the cell's side (1/m). A byte of `cells` says how the cell between
its nodes is read:

    FREE         outside: no contact anywhere in it
    HELD         contact everywhere in it
    EDGE         the surface may pass: contact where the HIP is behind the plane of IHIP and normal
    + MARKED     the projection breaks in it: never interpolated
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.types import Array, ByteArray

FREE, HELD, EDGE, MARKED = 0, 1, 2, 4

OUT, TOUCHES, ASK = 0, 1, 2
"""Status of an answer: in free space, in contact, to be asked of the exact projection."""


@compiled
def look_up(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, ask: bool, x: float, y: float
) -> tuple[int, float, float, float, float]:
    """One HIP (m): (status, IHIP x, y, normal x, y). Free answers hold the HIP and a zero normal.

    A marked cell answers ASK with `ask`, else with the node that is nearest to the HIP: a surface point and its own
    normal, whatever the neighbours say. Off the grid is free, or, in a table that answers `everywhere`, treated as
    marked.
    """
    rows, columns = cells.shape
    a, b = (x - frame[0]) * frame[2], (y - frame[1]) * frame[2]
    kind, i, j = np.uint8(FREE), np.uint64(0), np.uint64(0)
    if 0.0 <= a <= columns and 0.0 <= b <= rows:
        # unsigned, so that no index is tested for counting from the end
        i, j = np.uint64(min(int(a), columns - 1)), np.uint64(min(int(b), rows - 1))
        kind = cells[j, i]
    elif everywhere and a == a and b == b:
        kind = np.uint8(HELD + MARKED)
        a, b = min(max(a, 0.0), float(columns)), min(max(b, 0.0), float(rows))
        i, j = np.uint64(min(int(a), columns - 1)), np.uint64(min(int(b), rows - 1))
    if kind == FREE:
        return OUT, x, y, 0.0, 0.0
    a, b = a - np.int64(i), b - np.int64(j)
    one = np.uint64(1)
    if kind < MARKED:
        low, low_right, high, high_right = nodes[j, i], nodes[j, i + one], nodes[j + one, i], nodes[j + one, i + one]
        w00, w10, w01, w11 = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
        px = w00 * low[0] + w10 * low_right[0] + w01 * high[0] + w11 * high_right[0]
        py = w00 * low[1] + w10 * low_right[1] + w01 * high[1] + w11 * high_right[1]
        nx = w00 * low[2] + w10 * low_right[2] + w01 * high[2] + w11 * high_right[2]
        ny = w00 * low[3] + w10 * low_right[3] + w01 * high[3] + w11 * high_right[3]
        size = 1.0 / math.sqrt(nx * nx + ny * ny)
        nx, ny = nx * size, ny * size
    elif ask:
        return ASK, x, y, 0.0, 0.0
    else:
        node = nodes[j + np.uint64(b > 0.5), i + np.uint64(a > 0.5)]
        px, py, nx, ny = node[0], node[1], node[2], node[3]
    if kind & EDGE and (x - px) * nx + (y - py) * ny >= 0.0:
        return OUT, x, y, 0.0, 0.0
    return TOUCHES, px, py, nx, ny


@compiled
def look_up_many(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, ask: bool, hips: Array
) -> tuple[Array, Array, ByteArray]:
    """`look_up` for each row of hips (n, 2): IHIPs (n, 2), normals (n, 2), status (n,)."""
    ihips, normals = np.empty_like(hips), np.empty_like(hips)
    status = np.empty(hips.shape[0], np.uint8)
    for k in range(hips.shape[0]):
        status[k], ihips[k, 0], ihips[k, 1], normals[k, 0], normals[k, 1] = look_up(
            nodes, cells, frame, everywhere, ask, hips[k, 0], hips[k, 1]
        )
    return ihips, normals, status


@compiled
def look_up_3d(
    nodes: Array, cells: ByteArray, frame: Array, everywhere: bool, hips: Array
) -> tuple[Array, Array, ByteArray]:
    """The same in space, for each row of hips (n, 3); marked cells answer with their nearest node."""
    layers, rows, columns = cells.shape
    ihips, normals = hips.copy(), np.zeros_like(hips)
    status = np.zeros(hips.shape[0], np.uint8)
    mean = np.empty(6)
    for m in range(hips.shape[0]):
        a = (hips[m, 0] - frame[0]) * frame[3]
        b = (hips[m, 1] - frame[1]) * frame[3]
        c = (hips[m, 2] - frame[2]) * frame[3]
        on = 0.0 <= a <= columns and 0.0 <= b <= rows and 0.0 <= c <= layers
        if not on:
            if not everywhere or a != a or b != b or c != c:
                continue
            a, b, c = min(max(a, 0.0), columns), min(max(b, 0.0), rows), min(max(c, 0.0), layers)
        i, j, k = min(int(a), columns - 1), min(int(b), rows - 1), min(int(c), layers - 1)
        kind = cells[k, j, i] if on else np.uint8(HELD + MARKED)
        if kind == FREE:
            continue
        a, b, c = a - i, b - j, c - k
        if kind < MARKED:
            mean[:] = 0.0
            for corner in range(8):
                p, q, r = corner & 1, (corner >> 1) & 1, corner >> 2
                weight = (a if p else 1.0 - a) * (b if q else 1.0 - b) * (c if r else 1.0 - c)
                for column in range(6):
                    mean[column] += weight * nodes[k + r, j + q, i + p, column]
            mean[3:] /= math.sqrt(mean[3] ** 2 + mean[4] ** 2 + mean[5] ** 2)
        else:
            mean[:] = nodes[k + int(c > 0.5), j + int(b > 0.5), i + int(a > 0.5)]
        side = 0.0
        for axis in range(3):
            side += (hips[m, axis] - mean[axis]) * mean[3 + axis]
        if kind & EDGE and side >= 0.0:
            continue
        status[m] = TOUCHES
        ihips[m], normals[m] = mean[:3], mean[3:]
    return ihips, normals, status
