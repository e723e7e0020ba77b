"""Line spectral frequencies: the form in which a filter's poles may be interpolated and stay inside the unit circle.

A monic polynomial A(z) = 1 + a_1 z^-1 + ... + a_p z^-p has all zeros inside the unit circle exactly where those of

    S(z) = A(z) + z^-(p+1) A(1/z)    and    D(z) = A(z) - z^-(p+1) A(1/z)

lie on it and take turns (Itakura 1975; Soong and Juang 1984). Their p angles between 0 and pi, in ascending order, are
its line spectral frequencies: the first, third, ... are of S. Ascending angles are a convex set: between any of them
lie none but ascending ones, so that a filter between stable ones is stable, which coefficients do not give.
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
    forth, back = np.append(a, 0.0), np.append(0.0, a[::-1])
    even, odd = forth + back, forth - back
    if order % 2 == 0:
        even, odd = np.polydiv(even, [1.0, 1.0])[0], np.polydiv(odd, [1.0, -1.0])[0]
    else:
        odd = np.polydiv(odd, [1.0, 0.0, -1.0])[0]
    angles = [np.angle(np.roots(each)) for each in (even, odd)]
    return np.sort(np.concatenate([each[each > 0.0] for each in angles]))


def stable(coefficients: Sequence[float] | Array) -> bool:
    """Return whether all zeros of A lie inside the unit circle, by Schur and Cohn's recursion, without its roots."""
    a = np.asarray(coefficients, dtype=np.float64)
    while a.size:
        last = float(a[-1])
        if not abs(last) < 1.0:
            return False
        a = (a[:-1] - last * a[-2::-1]) / (1.0 - last * last)
    return True


def coefficients_of(spectrum: Sequence[float]) -> Array:
    """Return the coefficients (a_1, ..., a_p) of ascending line spectral frequencies (p,), rad."""
    angles = np.asarray(spectrum, dtype=np.float64)
    parts = []
    for first in (0, 1):
        product = np.ones(1)
        for angle in angles[first::2]:
            product = np.convolve(product, [1.0, -2.0 * np.cos(angle), 1.0])
        parts.append(product)
    even, odd = parts
    if angles.size % 2 == 0:
        even, odd = np.convolve(even, [1.0, 1.0]), np.convolve(odd, [1.0, -1.0])
    else:
        odd = np.convolve(odd, [1.0, 0.0, -1.0])
    return np.asarray(0.5 * (even + odd)[1 : angles.size + 1])
