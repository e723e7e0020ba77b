"""The projections by samples of the boundary and bisection: what errors of the exact ones count from.

Nothing is shared with the projections but what a point of the curve is, what the level curves of `potential` are, and
the force of a projected hand. There is no search tree, no bound and no Newton's method: all samples are looked at, and
between two at which a function changes its sign its zero is bisected until no number lies between.

- Minimum distance (4.2): of all places where the distance stops falling the nearest.
- Constraint (4.3): that of these places to which the distance falls from the last one.
- Homothetic: where the boundary crosses the ray from the centre through the hand.
- Combescure's: the level is bisected until the hand, enlarged by 1 / A(t) about the centre, lies b(t) deep.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from hapticeval.compiled import borrowing, compiled
from hapticeval.errors import RefusalError
from hapticeval.geometry.kernels import PIECE, evaluate
from hapticeval.laws import LawData
from hapticeval.records import as_record, as_records, record_type
from hapticeval.renderers import level_curves
from hapticeval.renderers.family import SAMPLES_KNOB
from hapticeval.renderers.potential import PARALLEL, POTENTIAL, level_values, potential_record, stretch
from hapticeval.renderers.projective import Projection
from hapticeval.renderers.regulation import GRADIENT
from hapticeval.renderers.regulation_kernel import FIRST_OWN, GAINS, PAST, regulate, release
from hapticeval.scene import Scene
from hapticeval.types import Array

BOUNDARY_SAMPLE = record_type("piece", "u", place=2, tangent=2)
"""A row of `lookup`: a piece, the parameter, the point (m) and its derivative there. Ends of pieces are samples."""

TOOL = record_type("touches", "sample", base=PAST)
"""The `state` of the constraint: whether the tool is in contact, and the sample behind which it is."""

FOLLOWS = record_type("follows", base=GAINS)
"""The `params` of the nearest point: whether the last one is followed, as the constraint does."""


def nearest(scene: Scene, representation: str, *, samples: float = SAMPLES_KNOB.values[-1]) -> Projection:  # noqa: ARG001
    """Return the minimum distance projection (4.2) by so many samples. Raises `RefusalError` as `samples_of` does."""
    return _projection(scene, to_nearest, samples, own=[0.0], state=TOOL)


def god_object(scene: Scene, representation: str, *, samples: float = SAMPLES_KNOB.values[-1]) -> Projection:  # noqa: ARG001
    """Return the constraint projection (4.3) by so many samples; a contact begins at the nearest point.

    Raises `RefusalError` as `samples_of` does.
    """
    return _projection(scene, to_nearest, samples, own=[1.0], state=TOOL)


def homothetic(scene: Scene, representation: str, *, samples: float = SAMPLES_KNOB.values[-1]) -> Projection:  # noqa: ARG001
    """Return the homothetic projection by so many samples. Raises `RefusalError` as `samples_of` does."""
    return _along_levels(scene, level_curves.homothetic(scene, "curve"), samples)


def combescure(scene: Scene, representation: str, *, samples: float = SAMPLES_KNOB.values[-1]) -> Projection:  # noqa: ARG001
    """Return the Combescure projection by so many samples. Raises `RefusalError` as `samples_of` does."""
    return _along_levels(scene, level_curves.combescure(scene, "curve"), samples)


def _along_levels(scene: Scene, exact: Projection, samples: float) -> Projection:
    """Return a projection with the potential that the `exact` one has: the centre of a kernel has one definition."""
    return _projection(
        scene, to_level, samples, own=potential_record(exact.potential), potential=exact.potential,
        support_range=exact.support_range,
    )  # fmt: skip


def _projection(scene: Scene, law: Callable[..., Any], samples: float, **fields: Any) -> Projection:
    table = samples_of(scene, int(samples))
    return Projection(
        law, scene.model.curve, bilateral=scene.bilateral, pieces=scene.model.curve.pieces, lookup=table, **fields
    )


def samples_of(scene: Scene, count: int) -> Array:
    """Return about `count` rows (n, 6) of `BOUNDARY_SAMPLE`, at equal steps of each piece of the scene's curve.

    Raises `RefusalError` for a model in space or without end.
    """
    model = scene.model
    if model.dimension != 2 or not model.curve.closed:
        raise RefusalError(
            f"the boundary of model '{model.name}' is not sampled",
            why="only closed plane curves are",
            todo="count errors from the exact surface",
        )
    rows = []
    for number, piece in enumerate(as_records(model.curve.pieces, PIECE)):
        # An even number of steps, and at least two, so that a straight piece has a sample beside its ends.
        for u in np.linspace(piece.u0, piece.u1, 2 * max(count // (2 * len(model.curve.pieces)), 1) + 1):
            rows.append([number, u, *evaluate(model.curve.pieces[number], u)[:4]])
    return np.array(rows)


@compiled
def _descent_at(row: Array, x: float, y: float) -> float:
    """Return (p - y)·y' at a sample: positive where the distance of (x, y) from the curve falls onwards."""
    sample = as_record(row, BOUNDARY_SAMPLE)
    ex, ey = x - sample.place[0], y - sample.place[1]
    return float(ex * sample.tangent[0] + ey * sample.tangent[1])


@compiled
def _settle(data: LawData, k: int, x: float, y: float) -> tuple[float, float, float, float]:
    """Return the point (m) between the samples k and k + 1 where the distance of (x, y) stops falling, and the normal.

    Where both samples are the ends of two pieces that is their common point, and the normal points from the hand to it,
    or the other way where the hand is outside.
    """
    lookup = data.lookup
    sample = as_record(lookup[k], BOUNDARY_SAMPLE)
    next_sample = as_record(lookup[(k + 1) % lookup.shape[0]], BOUNDARY_SAMPLE)
    if sample.piece != next_sample.piece or next_sample.u < sample.u:
        # The end of a piece, or of the curve: at a corner every direction between the two normals is one.
        ex, ey = x - sample.place[0], y - sample.place[1]
        nx, ny = _outward(sample.tangent[0], sample.tangent[1])
        mx, my = _outward(next_sample.tangent[0], next_sample.tangent[1])
        size = math.hypot(ex, ey)
        if size > 0.0 and abs(nx * my - ny * mx) > 1e-9:
            sign = 1.0 if ex * (nx + mx) + ey * (ny + my) > 0.0 else -1.0
            nx, ny = sign * ex / size, sign * ey / size
        return sample.place[0], sample.place[1], nx, ny
    return _bisect(data.pieces[int(sample.piece)], sample.u, next_sample.u, x, y, 0.0, 0.0)


@compiled
def _bisect(
    piece: Array, low: float, high: float, x: float, y: float, ex: float, ey: float
) -> tuple[float, float, float, float]:
    """Return the point (m) of a piece between two parameters, and its normal.

    It is where the distance of (x, y), m, stops falling; with a direction (ex, ey), where the ray along it is crossed.
    """
    while True:
        u = low + 0.5 * (high - low)
        px, py, dx, dy, _, _ = evaluate(piece, u)
        if not low < u < high:  # no number lies between
            nx, ny = _outward(dx, dy)
            return px, py, nx, ny
        if ex == 0.0 and ey == 0.0:
            onwards = (x - px) * dx + (y - py) * dy > 0.0
        else:
            onwards = not ex * (py - y) - ey * (px - x) > 0.0
        if onwards:
            low = u
        else:
            high = u


@compiled
def _outward(dx: float, dy: float) -> tuple[float, float]:
    """Return the outward unit normal of a boundary that runs anticlockwise along (dx, dy)."""
    size = math.hypot(dx, dy)
    return dy / size, -dx / size


@compiled
def _nearest_rest(data: LawData, x: float, y: float) -> int:
    """Return the sample behind which the boundary is nearest to (x, y), m."""
    count, best, nearest_distance = data.lookup.shape[0], 0, math.inf
    for k in range(count):
        if _descent_at(data.lookup[k], x, y) > 0.0 and not _descent_at(data.lookup[(k + 1) % count], x, y) > 0.0:
            px, py, _, _ = _settle(data, k, x, y)
            distance = math.hypot(x - px, y - py)
            if distance < nearest_distance:
                best, nearest_distance = k, distance
    return best


@compiled
def _rest_downhill(data: LawData, k: int, x: float, y: float) -> int:
    """Return the sample behind which the distance of (x, y), m, stops falling, from behind sample k on."""
    count = data.lookup.shape[0]
    for _ in range(count):
        if not _descent_at(data.lookup[k], x, y) > 0.0:
            k = (k - 1) % count
        elif _descent_at(data.lookup[(k + 1) % count], x, y) > 0.0:
            k = (k + 1) % count
        else:
            break
    return k


@borrowing
def to_nearest(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick to the nearest place (4.2), or downhill from the last one (4.3), of signature `LAW`.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    params, state, tool, x, y = data.params, data.state, as_record(data.state, TOOL), hip[0], hip[1]
    if as_record(params, FOLLOWS).follows != 0.0 and tool.touches != 0.0:
        k = _rest_downhill(data, int(tool.sample), x, y)
    else:
        k = _nearest_rest(data, x, y)
    px, py, nx, ny = _settle(data, k, x, y)
    is_held = as_record(params, GAINS).bilateral != 0.0 or (x - px) * nx + (y - py) * ny < 0.0
    tool.touches, tool.sample = 1.0 if is_held else 0.0, k
    if not is_held:
        return release(state, hip, ihip, force)
    ihip[0], ihip[1], tool.normal[0], tool.normal[1] = px, py, nx, ny
    return regulate(params, state, hip, velocity, 0.0, 0.0, dt, ihip, force)


@borrowing
def to_level(
    data: LawData, hip: Array, velocity: Array, push: Array, dt: float, ihip: Array, force: Array  # noqa: ARG001
) -> int:  # fmt: skip
    """One tick along the level curves of a potential, of signature `LAW`; without parallel ones out along the ray.

    `hip` (2,), m, and `velocity` (2,), m/s, are the hand's; `ihip` (2,), m, and `force` (2,), N, are written.
    """
    params, state, potential = data.params, data.state, as_record(data.params, POTENTIAL, FIRST_OWN)
    cx, cy = potential.centre[0], potential.centre[1]
    ex, ey = hip[0] - cx, hip[1] - cy
    if potential.reach > 0.0:
        px, py, nx, ny, t = _level_of(data, potential, ex, ey)
    else:
        px, py, nx, ny = _cross_ray(data, cx, cy, ex, ey)
        t = potential.support * (1.0 - math.hypot(ex, ey) / math.hypot(px - cx, py - cy))
    if as_record(params, GAINS).bilateral == 0.0 and not t > 0.0:
        return release(state, hip, ihip, force)
    normal = as_record(state, PAST).normal
    ihip[0], ihip[1], normal[0], normal[1] = px, py, nx, ny
    length = 0.0
    if as_record(params, GAINS).scheme == GRADIENT:
        length = stretch(potential, t, nx * (px - cx) + ny * (py - cy))
    return regulate(params, state, hip, velocity, 0.0, length, dt, ihip, force)


@compiled
def _level_of(data: LawData, potential: Any, ex: float, ey: float) -> tuple[float, float, float, float, float]:
    """Return point (m), normal and level t (m) of a hand that is (ex, ey), m, from the centre."""
    cx, cy = potential.centre[0], potential.centre[1]
    low, high = 0.0, potential.support
    px, py, nx, ny = _settle(data, _nearest_rest(data, cx + ex, cy + ey), cx + ex, cy + ey)
    depth = -(nx * (cx + ex - px) + ny * (cy + ey - py))
    if depth <= PARALLEL * potential.reach:
        return px, py, nx, ny, depth
    while True:
        t = low + 0.5 * (high - low)
        if not low < t < high:
            return px, py, nx, ny, t
        a, b, _, _ = level_values(potential, t)
        x, y = cx + ex / a, cy + ey / a
        px, py, nx, ny = _settle(data, _nearest_rest(data, x, y), x, y)
        if -(nx * (x - px) + ny * (y - py)) > b:
            low = t
        else:
            high = t


@compiled
def _cross_ray(data: LawData, cx: float, cy: float, ex: float, ey: float) -> tuple[float, float, float, float]:
    """Return the point (m) at which the ray from (cx, cy) along (ex, ey) crosses the boundary, and the normal there."""
    lookup = data.lookup
    for k in range(lookup.shape[0] - 1):
        sample, next_sample = as_record(lookup[k], BOUNDARY_SAMPLE), as_record(lookup[k + 1], BOUNDARY_SAMPLE)
        ax, ay = sample.place[0] - cx, sample.place[1] - cy
        bx, by = next_sample.place[0] - cx, next_sample.place[1] - cy
        is_ahead = ex * ax + ey * ay > 0.0 or ex * bx + ey * by > 0.0
        # e x (y - c) grows along the boundary, and is zero on the ray.
        crosses = not ex * ay - ey * ax > 0.0 and ex * by - ey * bx > 0.0
        if sample.piece == next_sample.piece and is_ahead and crosses:
            return _bisect(data.pieces[int(sample.piece)], sample.u, next_sample.u, cx, cy, ex, ey)
    # A hand at the centre has no ray.
    return cx, cy, 0.0, 0.0
