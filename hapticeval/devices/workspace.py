"""Where a device can be: its functional configuration space (2.33), (2.39), and the workspace that is its image."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.devices.device import Device
from hapticeval.devices.limit import Limit
from hapticeval.devices.parallelogram import Parallelogram2, Parallelogram3
from hapticeval.errors import DomainError, InputError
from hapticeval.types import Array, BoolArray

if TYPE_CHECKING:
    from hapticeval.geometry.model import Model

SAMPLES = 2000
"""Points of a model's boundary that are tried: 0.3 mm apart on an outline of 600 mm."""


EDGES = ("elbow", "stop", "shoulder", "elbow", "stop")
"""Which limit each edge of (2.38) is, from the corner with the least angles on, anticlockwise."""


class Fit(NamedTuple):
    """Whether points lie in the functional workspace.

    `margin` (rad) is the smallest of the configurations' margins where they all do, minus infinity where one does not;
    `row` and `point` (m) name the point with that margin, or else the first that does not, and `why` says what keeps
    the device from it.
    """

    holds: bool
    margin: float
    row: int
    point: tuple[float, ...]
    why: str = ""


def limits(device: Device, joints: ArrayLike) -> tuple[Limit, ...]:
    """Joint limits and singularities as seen from `joints`; a device that declares none has none."""
    return device.limits(joints) if isinstance(device, Parallelogram2 | Parallelogram3) else ()


def checked_joints(device: Device, joints: ArrayLike) -> Array:
    """`joints` as (N,) float64.

    Raises `InputError` where they are not N finite numbers, and `DomainError` outside of the functional configuration
    space: it names the limit and by how much it is passed, where the device tells.
    """
    try:
        pose = np.array(joints, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"joints = {joints!r}", why="they must be numbers") from error
    if pose.shape != (device.dimension,):
        raise InputError(f"joints of the shape {pose.shape}", why=f"{device.name} has {device.dimension}")
    if not np.isfinite(pose).all():
        raise InputError(f"joints = ({', '.join(f'{x:g}' for x in pose)})", why="they must be finite")
    if isinstance(device, Parallelogram2 | Parallelogram3):
        device.check(pose)
    elif not device.margin(pose) > 0.0:
        raise DomainError(
            f"{device.name}: joints ({', '.join(f'{x:.6g}' for x in pose)}) are outside of the functional "
            "configuration space",
            why=f"their margin is {device.margin(pose):.6g}",
        )
    return pose


def inside(device: Device, joints: ArrayLike) -> BoolArray:
    """Which of the configurations (n, N) lie in the functional configuration space (Definition 2.4): (n,)."""
    return np.array([device.margin(pose) > 0.0 for pose in np.array(joints, dtype=np.float64)], dtype=bool)


def dexterous(device: Device, joints: ArrayLike) -> bool:
    """Whether a pose belongs to the dexterous workspace Q (2.7): within the joint limits, and J of full rank.

    It may lie beyond a singularity, in a part of Q that home has no way to: then it is not in the functional space.
    """
    seen = limits(device, joints)
    within = all(limit.distance > 0.0 for limit in seen if not limit.singular)
    return bool(
        within and np.linalg.matrix_rank(device.jacobian(np.array(joints, dtype=np.float64))) == device.dimension
    )


def nearest_limit(device: Device, joints: ArrayLike) -> Limit | None:
    """The joint limit that is nearest, None for a device without."""
    return min((each for each in limits(device, joints) if not each.singular), key=_distance, default=None)


def nearest_singularity(device: Device, joints: ArrayLike) -> float:
    """A distance (rad, Euclidean) within which no singularity lies; infinite for a device without.

    det J is zero where the linkage is stretched or folded, |x₂ - x₃| = π/2, always beyond the stop; and where the base
    turns, on its axis, see `Parallelogram3`.
    """
    if not isinstance(device, Parallelogram2 | Parallelogram3):
        return math.inf
    shoulder, elbow = np.array(joints, dtype=np.float64)[-2:]
    folded = abs(math.pi / 2.0 - abs(shoulder - elbow)) / math.sqrt(2.0)
    return min(float(folded), *(abs(each.distance) for each in limits(device, joints) if each.singular), math.inf)


def _distance(limit: Limit) -> float:
    return limit.distance


def holds(device: Device, model: Model | ArrayLike) -> Fit:
    """Whether a model's boundary, or points (n, N) in m, lies in the functional workspace (Assumption 7.1).

    A boundary is sampled at `SAMPLES` points. An unbounded one lies in no bounded workspace: of a line it is asked
    whether some of its points do. Raises `InputError` for a model or points of another dimension than the device's.
    """
    from hapticeval.geometry.curve import Curve
    from hapticeval.geometry.model import Model

    if not isinstance(model, Model):
        return _points_hold(device, model)
    if model.dimension != device.dimension:
        raise InputError(
            f"model '{model.name}' has {model.dimension} dimensions, and {device.name} {device.dimension}",
            why="a device feels models of its own space only",
        )
    boundary = model.boundary
    if not isinstance(boundary, Curve):
        return _points_hold(device, boundary.points(SAMPLES))
    points = boundary.outline(SAMPLES)
    if boundary.closed:
        return _points_hold(device, points)
    each = [_points_hold(device, point[None]) for point in points]
    index = max(range(len(each)), key=lambda i: each[i].margin)
    return each[index]._replace(row=index)


def require(device: Device, model: Model | ArrayLike) -> None:
    """Raise `DomainError` where `holds` says no, naming the model and the first point that cannot be reached."""
    fit = holds(device, model)
    if not fit.holds:
        name = getattr(model, "name", "")
        what = f"model '{name}'" if name else "the set of points"
        raise DomainError(
            f"{what} does not lie in the functional workspace of {device.name} (Assumption 7.1)",
            why=f"point {fit.row}, ({', '.join(f'{y:.6g}' for y in fit.point)}) m: {fit.why}",
            todo="make the model smaller, or choose another device",
        )


def _points_hold(device: Device, points: ArrayLike) -> Fit:
    array = np.array(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != device.dimension or not len(array):
        raise InputError(
            f"points of the shape {array.shape}", why=f"{device.name} moves in {device.dimension} dimensions"
        )
    least, index = math.inf, 0
    for i, point in enumerate(array):
        try:
            margin = device.margin(device.joints(point))
        except DomainError as error:
            return Fit(False, -math.inf, i, tuple(point.tolist()), error.why or error.what)
        if margin < least:
            least, index = margin, i
    return Fit(True, least, index, tuple(array[index].tolist()))


def lattice(device: Device, *, step: float = 0.2, clearance: float = 0.0) -> Array:
    """Configurations (n, N) on a lattice of `step` rad through home that have a margin of more than `clearance` rad.

    Of a device without limits it is home alone.
    """
    if not isinstance(device, Parallelogram2 | Parallelogram3):
        return np.zeros((1, device.dimension))
    base, low, high = _box()
    bounds = [(-base, base), (low[0], high[0]), (low[1], high[1])][-device.dimension :]
    axes = [step * np.arange(math.ceil(least / step), math.floor(most / step) + 1) for least, most in bounds]
    poses = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, device.dimension)
    return np.array([pose for pose in poses if device.margin(pose) > clearance])


def section(device: Device, n: int = 400) -> Array:
    """The outline of the functional workspace in the linkage's plane, closed, about `n` points (m), (k, 2).

    The plane is (y₁, y₂) with the base locked, and (y₁, y₃) at x₁ = 0 with the base turning: the workspace is what this
    sweeps as the base turns within its limits. Raises `InputError` for a device that is nowhere bounded.
    """
    if not isinstance(device, Parallelogram2 | Parallelogram3):
        raise InputError(f"the workspace of {device.name} has no outline", why="it is all of space")
    outline = np.concatenate([points[:-1] for _, points in edges(device, n)])
    return outline if isinstance(device, Parallelogram2) else _right_of(outline, -device.constants.l4)


def edges(device: Device, n: int = 400) -> tuple[tuple[str, Array], ...]:
    """The five edges of what the linkage reaches, in the plane of `section`: the limit's name, and n / 5 points (m).

    A limit's name is `shoulder`, `elbow` or `stop`. With the base turning, a part lies beyond its axis. None for a
    device without limits.
    """
    if not isinstance(device, Parallelogram2 | Parallelogram3):
        return ()
    ends = corners()
    flat = Parallelogram2(device.constants)
    found = []
    for name, here, there in zip(EDGES, ends, np.roll(ends, -1, axis=0), strict=True):
        joints = np.linspace(here, there, max(2, n // len(ends)) + 1)
        found.append((name, np.array([flat.position(pose) for pose in joints])))
    return tuple(found)


def size(device: Device, n: int = 20_000) -> float:
    """Area (m²) or volume (m³) of the functional workspace, of the outline with about `n` points; infinite where it is
    all of space. The volume is Pappus's: the angle that the base turns by times the first moment of the section.
    """
    if not isinstance(device, Parallelogram2 | Parallelogram3):
        return math.inf
    x, y = section(device, n).T
    across, up = np.roll(x, -1), np.roll(y, -1)
    crossed = x * up - across * y
    if isinstance(device, Parallelogram2):
        return abs(float(crossed.sum())) / 2.0
    x, across = x + device.constants.l4, across + device.constants.l4
    crossed = x * up - across * y
    return 2.0 * _box()[0] * abs(float(((x + across) * crossed).sum())) / 6.0


def _box() -> tuple[float, tuple[float, float], tuple[float, float]]:
    """The base's limit, and the least and the greatest pair of linkage angles."""
    ends = corners()
    low, high = ends.min(axis=0), ends.max(axis=0)
    from hapticeval.devices.parallelogram_kernels import BASE_LIMIT

    return BASE_LIMIT, (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def corners() -> Array:
    """The corners of (2.38) in the plane of the linkage's joints, (5, 2), rad: the bound x₁ > -2.4 is never met.

    In the order of `EDGES`.
    """
    from hapticeval.devices import parallelogram_kernels as kernels

    low, high, stop, end = kernels.ELBOW_LOW, kernels.ELBOW_HIGH, kernels.STOP, kernels.SHOULDER_LIMIT
    return np.array([(low - stop, low), (low + stop, low), (end, end - stop), (end, high), (high - stop, high)])


def _right_of(outline: Array, axis: float) -> Array:
    """The part of a closed outline with first coordinates above `axis`, closed along it: one piece."""
    kept: list[Array] = []
    for here, there in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if here[0] > axis:
            kept.append(here)
        if (here[0] > axis) != (there[0] > axis):
            kept.append(here + (axis - here[0]) / (there[0] - here[0]) * (there - here))
    return np.array(kept)
