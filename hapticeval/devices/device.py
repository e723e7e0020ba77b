"""What a device is: joints that a controller drives, an end-effector that the hand holds, and where they may be.

Where it can be is its functional configuration space, (2.33) and (2.39); `fit_in_workspace` asks whether a model lies
in the image of that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from hapticeval.errors import DomainError, InputError, in_m
from hapticeval.types import Array

if TYPE_CHECKING:
    from hapticeval.geometry.model import Model


class CompiledDevice(NamedTuple):
    """A device's kernels, made by `compiled`, of the signatures of the same names in `hapticeval.laws`."""

    kinematics: Callable[..., Any]
    dynamics: Callable[..., Any]
    margin: Callable[..., Any]


class Limit(NamedTuple):
    """A limit of a device's functional configuration space, as seen from one pose.

    `distance` (rad) to a joint limit or a singularity is positive inside, negative beyond. `what` names it; `text`
    describes where the pose is with respect to it; `singular` marks a singularity.
    """

    what: str
    distance: float
    text: str
    singular: bool = False

    @classmethod
    def between(cls, what: str, value: float, low: float, high: float, *, scale: float = 1.0) -> Limit:
        """Make the limit of an angle between `low` and `high`; `scale` makes joint-space distance of its excess."""
        # the nearer of both ends, and how far the value is inside of it
        slack, end = min((value - low, low), (high - value, high))
        side = "within" if slack > 0.0 else "beyond" if slack < 0.0 else "from, that is on,"
        text = f"{what} = {_angle(value)} is {_angle(abs(slack))} {side} its limit of {_angle(end)}"
        return cls(what, slack * scale, text)

    @classmethod
    def singularity(cls, what: str, metres: float, distance: float) -> Limit:
        """Make the limit of a singular set that the hand is `metres` and the joints `distance` (rad) away from."""
        side = "short of" if metres > 0.0 else "past" if metres < 0.0 else "from, that is on,"
        text = f"the hand is {abs(metres):.6g} m {side} {what} (a singularity; {_angle(abs(distance))} of the joints)"
        return cls(what, distance, text, True)


def _angle(value: float) -> str:
    value = round(value, 12) + 0.0  # rounding errors of an inverse are no angle, and nor is minus zero
    return f"{value:.6g} rad ({math.degrees(value):.4g} degrees)"


@runtime_checkable
class Device(Protocol):
    """A robot with as many joints as outputs (thesis 2.5.2, Assumption 2.2): N = 2 or 3.

    Joint coordinates are rad, and m for the point mass, whose joints are its position.
    """

    @property
    def name(self) -> str:
        """As in suites: `point-mass`, `parallelogram-2dof`, `parallelogram-3dof`."""

    @property
    def dimension(self) -> int:
        """N."""

    @property
    def turning(self) -> bool:
        """Whether its joints turn: joints are then in rad and torques in N m, else in m and N."""

    @property
    def parameters(self) -> Array:
        """What the kernels are given: (k,), writable."""

    @property
    def kernels(self) -> CompiledDevice:
        """The same device for compiled loops."""

    def position(self, joints: Array) -> Array:
        """Return where the hand is at `joints` (N,), rad or m: w of (2.3), (N,), m."""

    def joints(self, position: Array) -> Array:
        """Return the joints (N,), rad or m, with which the hand is at `position` (N,), m.

        Raises `DomainError` for a position outside the functional workspace.
        """

    def jacobian(self, joints: Array) -> Array:
        """Return how the hand moves with the `joints` (N,): J = dw/dq (2.4), (N, N), m per rad or per m."""

    def inertia(self, joints: Array) -> Array:
        """Return the inertia M(q) at `joints` (N,): (N, N), kg m² or kg."""

    def bias(self, joints: Array, rates: Array) -> Array:
        """Return the torques that keep `rates` (N,) at `joints` (N,): C(q, q̇) q̇ + b q̇ + g, (N,), N m or N.

        With them M q̈ + bias = τ.
        """

    def limits(self, joints: Array) -> tuple[Limit, ...]:
        """Return what bounds the functional configuration space (Definition 2.4), as seen from `joints` (N,), rad or m.

        Empty if nothing does.
        """

    def margin(self, joints: Array) -> float:
        """Return how far inside the functional configuration space `joints` (N,) are, rad: zero on its edge.

        That is the smallest distance of `limits`, negative beyond one; infinite for the point mass.
        """


def checked_vector(device: Device, values: ArrayLike, what: str = "joints", *, finite: bool = True) -> Array:
    """Return what a caller gave for a device's joints or position as a new float64 array (N,), rad or m.

    `what` names it in messages. Raises `InputError` where `values` are not N numbers, or not finite unless they may be.
    """
    try:
        vector = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} = {values!r}", why="they must be numbers") from error
    n = device.dimension
    if vector.shape != (n,):
        raise InputError(f"{what} of the shape {vector.shape}", why=f"{device.name} has {n}: ({n},)")
    if finite and not np.isfinite(vector).all():
        raise InputError(f"{what} = ({', '.join(f'{x:g}' for x in vector)})", why="they must be finite")
    return vector


def checked_joints(device: Device, joints: ArrayLike) -> Array:
    """Return `joints` as a float64 array (N,), rad or m, if they lie in the functional configuration space.

    Raises `InputError` where they are not N finite numbers, and `DomainError` outside or on the edge, which is open
    (Definition 2.4): it names the limit, and by how much it is passed, in rad and degrees.
    """
    vector = checked_vector(device, joints)
    if device.margin(vector) > 0.0:
        return vector
    # the limit that is passed by most is the one to name
    worst = min(device.limits(vector), key=lambda limit: limit.distance, default=None)
    if worst is not None and worst.distance <= 0.0:
        raise DomainError(
            f"{device.name}: joints ({', '.join(f'{x:.6g}' for x in vector)}) rad are outside of the functional "
            "configuration space",
            why=worst.text,
            todo="start elsewhere, or keep the hand further from there",
        )
    return vector


def apparent_mass(device: Device, position: Array, normal: Array) -> float:
    """Return the mass (kg) that a blow along `normal` (N,), a unit vector, meets at `position` (N,), m.

    That is 1 / (n' J M⁻¹ J' n), of (4.21) with J_n = n' J. Raises `DomainError` where the device does not reach.
    """
    joints = device.joints(position)
    joint_normal = device.jacobian(joints).T @ normal
    return 1.0 / float(joint_normal @ np.linalg.solve(device.inertia(joints), joint_normal))


def heaviest_mass(device: Device, position: Array) -> float:
    """Return the largest mass (kg) that a device shows in any direction at `position` (N,), m.

    One over the least eigenvalue of J M⁻¹ J'. Raises `DomainError` where the device does not reach.
    """
    joints = device.joints(position)
    jacobian = device.jacobian(joints)
    return 1.0 / float(np.linalg.eigvalsh(jacobian @ np.linalg.solve(device.inertia(joints), jacobian.T))[0])


BOUNDARY_POINTS = 2000
"""Points of a model's boundary that are tried: 0.3 mm apart on an outline of 600 mm."""


class Fit(NamedTuple):
    """Whether points lie in the functional workspace.

    `margin` (rad) is the smallest of the configurations' margins where they all do, minus infinity where one does not;
    `row` and `point` (m) name the point with that margin, or else the first that does not, and `why` describes what
    keeps the device from it.
    """

    holds: bool
    margin: float
    row: int
    point: tuple[float, ...]
    why: str = ""


def fit_in_workspace(device: Device, model: Model | ArrayLike) -> Fit:
    """Return whether a model's boundary, or points (n, N), m, lie in the functional workspace (Assumption 7.1).

    A boundary is sampled at `BOUNDARY_POINTS` points. An unbounded line needs one point in it. Raises `InputError` for
    a model or points of another dimension than the device's.
    """
    from hapticeval.geometry.model import Model

    if not isinstance(model, Model):
        return _points_hold(device, model)
    if model.dimension != device.dimension:
        raise InputError(
            f"model '{model.name}' has {model.dimension} dimensions, and {device.name} {device.dimension}",
            why="a device feels models of its own space only",
        )
    points = model.boundary.points(BOUNDARY_POINTS)
    if model.boundary.closed:
        return _points_hold(device, points)
    # of an unbounded line: the point with the largest margin
    fits = [_points_hold(device, point[None]) for point in points]
    index = max(range(len(fits)), key=lambda i: fits[i].margin)
    return fits[index]._replace(row=index)


def require_in_workspace(device: Device, model: Model | ArrayLike) -> None:
    """Raise `DomainError`, naming model and point, where a model or points (n, N), m, do not lie in the workspace."""
    fit = fit_in_workspace(device, model)
    if not fit.holds:
        name = getattr(model, "name", "")
        what = f"model '{name}'" if name else "the set of points"
        raise DomainError(
            f"{what} does not lie in the functional workspace of {device.name} (Assumption 7.1)",
            why=f"point {fit.row}, {in_m(fit.point)}: {fit.why}",
            todo="make the model smaller, or choose another device",
        )


def _points_hold(device: Device, points: ArrayLike) -> Fit:
    array = np.array(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != device.dimension or not len(array):
        raise InputError(
            f"points of the shape {array.shape}", why=f"{device.name} moves in {device.dimension} dimensions"
        )
    smallest_margin, index = math.inf, 0
    for i, point in enumerate(array):
        try:  # out of reach, or within it but beyond a limit
            margin = device.margin(device.joints(point))
        except DomainError as error:
            return Fit(False, -math.inf, i, tuple(point.tolist()), error.why or error.what)
        if margin < smallest_margin:
            smallest_margin, index = margin, i
    return Fit(True, smallest_margin, index, tuple(array[index].tolist()))
