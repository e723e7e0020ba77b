"""Compiled look-ups in a quadtree: a level a step, so O(log n) in the number of leaves along a side."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.renderers.lut_kernels import ASK, EDGE, MARKED, OUT, TOUCHES
from hapticeval.types import Array, ByteArray, IntArray


@compiled
def descend(
    links: IntArray,
    corners: IntArray,
    kinds: ByteArray,
    nodes: Array,
    frame: Array,
    levels: int,
    everywhere: bool,
    ask: bool,
    x: float,
    y: float,
) -> tuple[int, float, float, float, float]:
    """One HIP, with the arrays of a `Tree` and its frame as in `lut_kernels`: answers as `lut_kernels.look_up` does."""
    count = 1 << levels
    a, b = (x - frame[0]) * frame[2], (y - frame[1]) * frame[2]
    on = 0.0 <= a <= count and 0.0 <= b <= count
    if not on:
        if not everywhere or a != a or b != b:
            return OUT, x, y, 0.0, 0.0
        a, b = min(max(a, 0.0), float(count)), min(max(b, 0.0), float(count))
    i, j = min(int(a), count - 1), min(int(b), count - 1)
    link, left = links[0], levels
    while link >= 0:
        left -= 1
        link = links[link + ((i >> left) & 1) + 2 * ((j >> left) & 1)]
    if link == -1:
        return OUT, x, y, 0.0, 0.0
    leaf = -2 - link
    kind = kinds[leaf]
    a = (a - ((i >> left) << left)) / (1 << left)
    b = (b - ((j >> left) << left)) / (1 << left)
    if on and kind < MARKED:
        p, q = np.uint64(corners[leaf, 0]), np.uint64(corners[leaf, 1])
        r, s = np.uint64(corners[leaf, 2]), np.uint64(corners[leaf, 3])
        w00, w10, w01, w11 = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
        px = w00 * nodes[p, 0] + w10 * nodes[q, 0] + w01 * nodes[r, 0] + w11 * nodes[s, 0]
        py = w00 * nodes[p, 1] + w10 * nodes[q, 1] + w01 * nodes[r, 1] + w11 * nodes[s, 1]
        nx = w00 * nodes[p, 2] + w10 * nodes[q, 2] + w01 * nodes[r, 2] + w11 * nodes[s, 2]
        ny = w00 * nodes[p, 3] + w10 * nodes[q, 3] + w01 * nodes[r, 3] + w11 * nodes[s, 3]
        size = 1.0 / math.sqrt(nx * nx + ny * ny)
        nx, ny = nx * size, ny * size
    elif ask:
        return ASK, x, y, 0.0, 0.0
    else:
        p = np.uint64(corners[leaf, int(a > 0.5) + 2 * int(b > 0.5)])
        px, py, nx, ny = nodes[p, 0], nodes[p, 1], nodes[p, 2], nodes[p, 3]
    if kind & EDGE and (x - px) * nx + (y - py) * ny >= 0.0:
        return OUT, x, y, 0.0, 0.0
    return TOUCHES, px, py, nx, ny


@compiled
def descend_many(
    links: IntArray,
    corners: IntArray,
    kinds: ByteArray,
    nodes: Array,
    frame: Array,
    levels: int,
    everywhere: bool,
    ask: bool,
    hips: Array,
) -> tuple[Array, Array, ByteArray]:
    """`descend` for each row of hips (n, 2): IHIPs (n, 2), normals (n, 2), status (n,)."""
    ihips, normals = np.empty_like(hips), np.empty_like(hips)
    status = np.empty(hips.shape[0], np.uint8)
    for k in range(hips.shape[0]):
        status[k], ihips[k, 0], ihips[k, 1], normals[k, 0], normals[k, 1] = descend(
            links, corners, kinds, nodes, frame, levels, everywhere, ask, hips[k, 0], hips[k, 1]
        )
    return ihips, normals, status
