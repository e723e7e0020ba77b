"""The curve shortening flow of a model by points on its front (thesis 5.2.1): what the flow on a grid is compared with.

The front is a polygon of nodes at equal distances, which moves inwards by (5.14), and lines start at its nodes. Both go
without a grid, so nothing is shared with `flow` but the velocity function. Errors fall with the square of the distance.

A node goes by v n + w t: the tangential speed w keeps the nodes at equal distances and moves no point of the front.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.compiled import compiled
from hapticeval.errors import RefusalError
from hapticeval.geometry.model import Model
from hapticeval.kernel_cache import shared_arrays
from hapticeval.renderers.maps.flow import Flow, line_starts
from hapticeval.renderers.maps.flow_kernels import ARCTAN_VELOCITY, velocity
from hapticeval.types import Array

DIFFUSION_SHARE = 0.2
"""Time step as a share of ds^2 / D: beyond 3/8 an explicit step with differences of fourth order is not stable."""

LEVELS_PER_NODE = 0.2
"""Levels that are recorded, as a share of the nodes."""

LAST_SHARE = 0.05
"""Share of the model's length at which the front is followed no further."""

FEWEST_NODES = 200
"""Nodes below which no node is left out any more."""


def track_front(model: Model, nodes: int) -> Flow:
    """Return the flow of a model inwards with the velocity (5.14), by so many `nodes` of its front; kept on disk.

    Raises `RefusalError` for a model that is unbounded or has corners.
    """
    if not model.curve.closed or model.curve.corners:
        raise RefusalError(
            f"the front of model '{model.name}' cannot be followed by points",
            why="that takes a closed curve with a curvature at each point",
            todo="use the flow on a grid",
        )
    u = line_starts(model, nodes)
    front = np.ascontiguousarray(model.curve.position(u))
    # All that comes from other modules is part of the name: what was made of something else is not taken for it.
    name = u.tobytes() + front.tobytes() + repr(nodes).encode()
    arrays = dict(shared_arrays(__name__, name, lambda: _recorded_levels(u, front, nodes)))
    cell = float(arrays.pop("cell"))
    return Flow(**arrays, cell=cell)


def _recorded_levels(u: Array, front: Array, nodes: int) -> dict[str, Array]:
    """Run the flow of a `front` (n, 2), m, with lines that start at `u` (n,); return the fields of its `Flow`."""
    front, lines = front.copy(), np.arange(u.size, dtype=np.float64)
    start = _length_and_area(front)
    count, time, level = int(LEVELS_PER_NODE * nodes), 0.0, 1
    times, sizes, points = [0.0], [start], [front.copy()]
    while sizes[-1][0] > LAST_SHARE * start[0]:
        # the next level has so much of the area
        area = start[1] * (1.0 - level / count) ** 2
        time += advance_to(front, lines, area)
        times.append(time)
        sizes.append(_length_and_area(front))
        points.append(_points_on(front, lines))
        level += 1
        # a front of half the length is as well resolved by half the nodes
        if front.shape[0] >= 2 * FEWEST_NODES and sizes[-1][0] * nodes < 0.5 * start[0] * front.shape[0]:
            front, lines = np.ascontiguousarray(front[::2]), 0.5 * lines
    lengths, areas = np.array(sizes).T
    return {
        "points": np.array(points), "u": u, "times": np.array(times), "lengths": lengths, "areas": areas,
        "cell": np.array(start[0] / nodes),
    }  # fmt: skip


def _length_and_area(front: Array) -> tuple[float, float]:
    """Return the length (m) and the area (m^2) of a closed polygon (n, 2), m."""
    after = np.roll(front, -1, axis=0)
    cross = front[:, 0] * after[:, 1] - front[:, 1] * after[:, 0]
    return float(np.sum(np.linalg.norm(after - front, axis=1))), 0.5 * float(np.sum(cross))


def _points_on(front: Array, lines: Array) -> Array:
    """Return the points (k, 2), m, of a front (n, 2), m, at places `lines` (k,) in nodes."""
    before = np.floor(lines)
    share, k = (lines - before)[:, np.newaxis], before.astype(np.int64) % front.shape[0]
    return np.asarray((1.0 - share) * front[k] + share * front[(k + 1) % front.shape[0]])


@compiled
def advance_to(front: Array, lines: Array, area: float) -> float:
    """Carry a front (n, 2), m, and `lines` (k,), in nodes along it, until it holds `area` (m^2); return the time, m.

    Nodes are at equal distances, and stay so.
    """
    n, time = front.shape[0], 0.0
    speed, kappa, size, along = np.empty(n), np.empty(n), np.empty(n), np.empty(n + 1)
    tangent = np.empty((n, 2))
    while True:
        length, enclosed = 0.0, 0.0
        for i in range(n):
            a, b, c, d = (i - 2) % n, (i - 1) % n, (i + 1) % n, (i + 2) % n
            # central differences of fourth order over the number of the node
            dx = (front[a, 0] - 8.0 * front[b, 0] + 8.0 * front[c, 0] - front[d, 0]) / 12.0
            dy = (front[a, 1] - 8.0 * front[b, 1] + 8.0 * front[c, 1] - front[d, 1]) / 12.0
            ddx = (-front[a, 0] + 16.0 * front[b, 0] - 30.0 * front[i, 0] + 16.0 * front[c, 0] - front[d, 0]) / 12.0
            ddy = (-front[a, 1] + 16.0 * front[b, 1] - 30.0 * front[i, 1] + 16.0 * front[c, 1] - front[d, 1]) / 12.0
            size[i] = math.hypot(dx, dy)
            tangent[i, 0], tangent[i, 1] = dx / size[i], dy / size[i]
            kappa[i] = (dx * ddy - dy * ddx) / size[i] ** 3
            length += size[i]
            enclosed += 0.5 * (front[i, 0] * front[c, 1] - front[i, 1] * front[c, 0])
        average = 2.0 * math.pi / length
        # the area falls by the sum of v ds
        falls, shrinks = 0.0, 0.0
        for i in range(n):
            speed[i] = velocity(ARCTAN_VELOCITY, average, kappa[i])
            falls += speed[i] * size[i]
            shrinks += kappa[i] * speed[i] * size[i]
        if enclosed <= area:
            return time
        # D = dv/dkappa is 1 / (pi kappa_avg) at the most, and the last step ends at the area
        dt = min(DIFFUSION_SHARE * (length / n) ** 2 * math.pi * average, (enclosed - area) / falls + 1e-18)
        # w' = kappa v less its mean, over the arc
        along[0] = 0.0
        for i in range(n):
            c = (i + 1) % n
            before = (kappa[i] * speed[i] - shrinks / length) * size[i]
            after = (kappa[c] * speed[c] - shrinks / length) * size[c]
            along[i + 1] = along[i] + 0.5 * (before + after)
        for k in range(lines.shape[0]):
            # a line goes along the normal: the nodes pass it by
            place = lines[k] % n
            i = int(place)
            share = place - i
            lines[k] -= dt * ((1.0 - share) * along[i] + share * along[i + 1]) * n / length
        for i in range(n):
            front[i, 0] += dt * (along[i] * tangent[i, 0] - speed[i] * tangent[i, 1])
            front[i, 1] += dt * (along[i] * tangent[i, 1] + speed[i] * tangent[i, 0])
        time += dt
