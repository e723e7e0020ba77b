"""The causes that lie in places.

Where a log has the hand may be in another unit, with other axes, off, turned or scaled; a contact point (IHIP) may be
late, filtered, held, at a depth, kept too long, or let go.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hapticeval.diagnosis.causes import LEAST_DELAY, MOST_DELAY, Cause, late, signed_axes, text, vector
from hapticeval.diagnosis.contact import RightContact, dot_rows, right_contact
from hapticeval.diagnosis.fits import delayed, fit_delay, fit_delay_within, fit_hold, fit_low_pass, power
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
        """Return the forces (n, N), N, that a hand at `moved` (n, N), m, leaves."""
        at = right_contact(boundary, contact.time[rows], moved, np.zeros_like(moved), stiffness=contact.stiffness)
        return np.asarray(felt - at.force)

    def cause(kind: str, words: str, moved: Array, cost: float, **numbers: object) -> Cause:
        """Return the cause that puts the hand at `moved` (n, N), m, with what it leaves of all rows, N^2."""
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
        """Return the numbers (k,), mm, % or degrees, with which `moved_by` leaves least, from the best of `starts`."""

        def left(numbers: Array) -> Array:
            """Return what numbers (k,) leave, (n N,), N."""
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
        """Return the hand (n, N), m, turned by a rotation vector (3,) in degrees, or by one angle (1,) in the plane."""
        full = degrees if dimension == 3 else np.array([0.0, 0.0, degrees[0]])
        return np.asarray(hip @ Rotation.from_rotvec(full, degrees=True).as_matrix()[:dimension, :dimension].T)

    starts = [start * axis if dimension == 3 else np.array([start]) for axis in axes for start in STARTS_DEGREES]
    degrees = fitted(turned, starts)
    angle = float(np.linalg.norm(degrees))
    words = f"the frame of the positions is turned by {text(angle)} degrees"
    yield cause("position rotation", words, turned(degrees), 1.0 if dimension == 2 else 3.0, degrees=angle)


def tool_causes(ihip: Array, contact: RightContact) -> Iterator[Cause]:
    """Yield causes for contact points `ihip` (n, N), m, that are not those of the `contact`."""
    hand, point, step = contact.hip, contact.point, contact.step
    right, apart = power(ihip - point), np.any(ihip != hand, axis=1)
    off = np.sum((ihip - point) ** 2, axis=1)
    start = hand[0]
    max_ticks = int(min(MOST_DELAY / step, len(hand) // 3))
    fit = fit_delay(ihip - start, point - start, max_ticks=max_ticks, early=False, free_gain=False)
    if fit.ticks > LEAST_DELAY:
        yield _lag(fit.ticks, step, fit.left)
        # What came before the first row is not known: those rows are left out, where they are few.
        full_ticks = round(fit.ticks)
        if 0 < full_ticks < len(hand) // 20:
            yield _lag(full_ticks, step, power((ihip - delayed(point, full_ticks))[full_ticks:]), 1.3)
    # Late in contact alone: in free space the tool is at the hand of now.
    for rows in (contact.touches, apart):
        ticks = fit_delay_within(ihip - start, point - start, rows, max_ticks=max_ticks)
        if ticks:
            for touching in (contact.touches, apart):
                model = np.where(touching[:, None], delayed(point, ticks), hand)
                yield _lag(ticks, step, power(ihip - model))
    touching = apart & contact.touches
    if np.count_nonzero(touching) > 5:
        offset = float(np.mean(dot_rows(ihip - point, contact.normal)[touching]))
        reach_inside = contact.depth + offset
        model = np.where((reach_inside > 0.0)[:, None], hand + reach_inside[:, None] * contact.normal, hand)
        side = "outside" if offset > 0.0 else "inside"
        words = f"the contact point lies {text(1e3 * abs(offset))} mm {side} the model"
        yield Cause("offset", words, power(ihip - model), 1.0, {"metres": offset})
    hold = fit_hold(ihip, point)
    if hold is not None:
        ticks, model = hold
        words = f"the contact point is renewed every {ticks} ticks alone"
        yield Cause("hold", words, power(ihip - model), 1.0, {"ticks": ticks})
    fit_filter = fit_low_pass(ihip - start, point - start, exact=True)
    if fit_filter.share < 0.9999:
        constant = step * (1.0 - fit_filter.share) / fit_filter.share
        words = f"the contact point is low-passed, with a time constant of {text(1e3 * constant)} ms"
        yield Cause("low-pass", words, fit_filter.left, 1.0, {"seconds": constant})
    apart_in_free_space, lost_in_contact = apart & ~contact.touches, ~apart & contact.touches
    if apart_in_free_space.any():
        reach = float(np.sqrt(off[apart_in_free_space].max()))
        words = f"the contact point is up to {text(1e3 * reach)} mm off the hand in free space"
        yield Cause("residue", words, right - float(off[apart_in_free_space].sum()), 3.0, {"metres": reach})
    leaving = lost_in_contact & (contact.normal_speed > 0.0)
    if leaving.any():
        depth = float(contact.depth[leaving].max())
        words = f"the tool lets go on the way out, {text(1e3 * depth)} mm below the surface"
        yield Cause("early release", words, right - float(off[leaving].sum()), 2.0, {"metres": depth})
    if lost_in_contact.any():
        depth, seconds = float(contact.depth[lost_in_contact].max()), float(np.count_nonzero(lost_in_contact)) * step
        words = f"the contact is lost for {text(1e3 * seconds)} ms, up to {text(1e3 * depth)} mm inside the model"
        yield Cause("contact lost", words, right - float(off[lost_in_contact].sum()), 2.5, {"metres": depth})


def _lag(ticks: float, step: float, left: float, cost: float = 1.0) -> Cause:
    words = f"the contact point comes {late(ticks, step)}"
    return Cause("lag", words, left, cost, {"ticks": float(ticks), "seconds": ticks * step})
