"""The causes that lie in where a log has the hand: in another unit, with other axes, off, turned or scaled."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hapticeval.diagnosis.causes import Cause, signed_axes, text, vector
from hapticeval.diagnosis.contact import RightContact, right_contact
from hapticeval.diagnosis.fits import power
from hapticeval.geometry.boundary import Boundary
from hapticeval.types import Array

POSITION_UNITS: Mapping[str, float] = {
    "mm for m": 1e3,
    "cm for m": 1e2,
    "inch for m": 1.0 / 0.0254,
    "m for mm": 1e-3,
    "mm for inch": 25.4,
    "inch for mm": 1.0 / 25.4,
}
"""What positions are multiplied by where one unit is given for another."""

PLACED_ROWS = 400
"""Rows at which another place of the hand is tried, evenly spread; *chosen*."""

STARTS_DEGREES = (-20.0, 20.0)
"""Angles about each axis from which a turned frame is sought; *chosen*."""

MOST_FIT_TRIALS = 12
"""Steps of a fit from one start: one that converges takes five; *chosen*."""


def placement_causes(contact: RightContact, force: Array, boundary: Boundary) -> Iterator[Cause]:
    """Yield where else the hand would have to be for a measured `force` (n, N), N, to be the one that is asked.

    What each leaves counts for all rows, as tried at `PLACED_ROWS` of them.
    """
    rows = np.linspace(0, len(force) - 1, min(PLACED_ROWS, len(force))).astype(int)
    hip, felt, dimension = contact.hip[rows], force[rows], force.shape[1]
    all_rows = len(force) / len(rows)

    def residual(moved: Array) -> Array:
        at = right_contact(boundary, contact.time[rows], moved, np.zeros_like(moved), stiffness=contact.stiffness)
        return np.asarray(felt - at.force)

    def cause(kind: str, words: str, moved: Array, cost: float, **numbers: object) -> Cause:
        return Cause(kind, words, all_rows * power(residual(moved)), cost, numbers)

    for name, factor in POSITION_UNITS.items():
        words = f"the unit of the positions is wrong ({name})"
        yield cause("position unit", words, hip / factor, 0.5, factor=factor)
    for matrix in signed_axes(dimension)[1:]:
        yield cause(
            "position axes",
            "axes of the positions are swapped or mirrored",
            hip @ matrix.T,
            1.0,
            matrix=matrix.tolist(),
        )

    def fitted(moved_by: Callable[[Array], Array], starts: list[Array]) -> Array:
        """Return the numbers with which `moved_by` leaves least, from the best of several starts."""

        def left(numbers: Array) -> Array:
            return residual(moved_by(numbers)).ravel()

        fits = [least_squares(left, start, max_nfev=MOST_FIT_TRIALS) for start in starts]
        return np.asarray(min(fits, key=lambda fit: fit.cost).x)

    # In mm, percent and degrees: numbers of the size of one.
    shift = fitted(lambda numbers: hip + 1e-3 * numbers, [np.zeros(dimension)])
    words = f"the positions are off by {vector(-shift)} mm"
    yield cause("position offset", words, hip + 1e-3 * shift, float(dimension), metres=(-1e-3 * shift).tolist())
    (percent,) = fitted(lambda numbers: hip * (1.0 + 0.01 * numbers), [np.zeros(1)])
    scale = 1.0 / (1.0 + 0.01 * float(percent))
    yield cause(
        "position scale", f"the positions are {text(scale)} times what they should be", hip / scale, 1.0, scale=scale
    )
    axes = [np.eye(3)[axis] for axis in ((2,) if dimension == 2 else range(3))]

    def turned(degrees: Array) -> Array:
        full = degrees if dimension == 3 else np.array([0.0, 0.0, degrees[0]])
        return np.asarray(hip @ Rotation.from_rotvec(full, degrees=True).as_matrix()[:dimension, :dimension].T)

    starts = [start * axis if dimension == 3 else np.array([start]) for axis in axes for start in STARTS_DEGREES]
    degrees = fitted(turned, starts)
    angle = float(np.linalg.norm(degrees))
    words = f"the frame of the positions is turned by {text(angle)} degrees"
    yield cause("position rotation", words, turned(degrees), 1.0 if dimension == 2 else 3.0, degrees=angle)
