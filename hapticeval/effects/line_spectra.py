"""Line spectral frequencies: the form in which a filter's poles may be interpolated and stay inside the unit circle.

A monic polynomial A(z) = 1 + a_1 z^-1 + ... + a_p z^-p has all zeros inside the unit circle exactly where those of

    S(z) = A(z) + z^-(p+1) A(1/z)    and    D(z) = A(z) - z^-(p+1) A(1/z)

lie on it and take turns (Itakura 1975; Soong and Juang 1984).

Their p angles between 0 and pi, in ascending order, are its line spectral frequencies: the first, third, ... are of S.
Ascending angles are a convex set: between any of them lie none but ascending ones, so that a filter between stable ones
is stable, which coefficients do not give.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hapticeval.errors import InputError
from hapticeval.types import Array


def line_spectrum(coefficients: Sequence[float] | Array) -> Array:
    """Return the line spectral frequencies (p,), rad, of coefficients (a_1, ..., a_p).

    Raises `InputError` unless all zeros of A lie inside the unit circle: of an autoregressive part they are the poles.
    """
    a = np.concatenate([[1.0], np.asarray(coefficients, dtype=np.float64)])
    order = a.size - 1
    if order == 0:
        return np.empty(0)
    if not stable(a[1:]):
        radius = float(np.abs(np.roots(a)).max()) if np.isfinite(a).all() else np.inf
        raise InputError(
            f"a filter of order {order} with a pole of radius {radius:.6g}",
            why="it is stable only with all poles inside the unit circle",
            todo="give coefficients of a stable filter",
        )
    # S and D of the module, without the zeros at z = 1 and -1 that they have beside the line spectrum
    padded, reversed_ = np.append(a, 0.0), np.append(0.0, a[::-1])
    sum_polynomial, difference_polynomial = padded + reversed_, padded - reversed_
    if order % 2 == 0:
        sum_polynomial, difference_polynomial = (
            np.polydiv(sum_polynomial, [1.0, 1.0])[0],
            np.polydiv(difference_polynomial, [1.0, -1.0])[0],
        )
    else:
        difference_polynomial = np.polydiv(difference_polynomial, [1.0, 0.0, -1.0])[0]
    angles_of = [np.angle(np.roots(polynomial)) for polynomial in (sum_polynomial, difference_polynomial)]
    # zeros come in conjugate pairs: one angle of each
    return np.sort(np.concatenate([root_angles[root_angles > 0.0] for root_angles in angles_of]))


def stable(coefficients: Sequence[float] | Array) -> bool:
    """Return whether a filter is stable: all zeros of A inside the unit circle, by Schur and Cohn's recursion.

    `coefficients` (p,) are a_1 to a_p. No roots are computed.
    """
    a = np.asarray(coefficients, dtype=np.float64)
    while a.size:
        # the last coefficient of each order is its reflection coefficient; then the polynomial of one order less
        reflection = float(a[-1])
        if not abs(reflection) < 1.0:
            return False
        a = (a[:-1] - reflection * a[-2::-1]) / (1.0 - reflection * reflection)
    return True


def coefficients_of(spectrum: Sequence[float]) -> Array:
    """Return the coefficients (a_1, ..., a_p) of ascending line spectral frequencies (p,), rad."""
    angles = np.asarray(spectrum, dtype=np.float64)
    parts = []
    for first in (0, 1):
        product = np.ones(1)
        for angle in angles[first::2]:  # a pair of zeros e^(+-i angle)
            product = np.convolve(product, [1.0, -2.0 * np.cos(angle), 1.0])
        parts.append(product)
    sum_polynomial, difference_polynomial = parts
    if angles.size % 2 == 0:
        sum_polynomial, difference_polynomial = (
            np.convolve(sum_polynomial, [1.0, 1.0]),
            np.convolve(difference_polynomial, [1.0, -1.0]),
        )
    else:
        difference_polynomial = np.convolve(difference_polynomial, [1.0, 0.0, -1.0])
    return np.asarray(0.5 * (sum_polynomial + difference_polynomial)[1 : angles.size + 1])
