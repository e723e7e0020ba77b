"""How fast the slope of the distance may bend along a curve: what keeps the slide from skipping a low barrier."""

from __future__ import annotations

import math

import numpy as np

from hapticeval.geometry.kernels import ARC, CASSINIAN, ELLIPSE, KIND, A, B, C, D
from hapticeval.types import Array

MARGIN = 1.1
"""A sampled maximum is raised by this much."""


def third_bounds(pieces: Array) -> Array:
    """(n, 2): for each piece, third_0 and third_1 with |g''| <= third_0 + third_1 |p - y| for every point p.

    g = (p - y)·y' gives g'' = (p - y)·y''' - 3 y'·y'', so they bound 3 |y'·y''| and |y'''|. Both are zero on
    straight pieces; with arc length as parameter y'·y'' = 0, and |y'''| is the square of an arc's curvature.
    """
    out = np.zeros((pieces.shape[0], 2))
    arcs = pieces[:, KIND] == ARC
    out[arcs, 1] = pieces[arcs, C] ** -2.0
    for i in np.flatnonzero(pieces[:, KIND] == ELLIPSE):
        a, b = pieces[i, A], pieces[i, B]
        out[i] = 1.5 * abs(a * a - b * b), max(a, b)
    for i in np.flatnonzero(pieces[:, KIND] == CASSINIAN):
        out[i] = _cassinian(pieces[i, A], pieces[i, B], pieces[i, D])
    return out


def _cassinian(scale: float, lobes: float, above: float) -> tuple[float, float]:
    """Sampled over one lobe, densely around the valley, where all derivatives peak as a_n / a_d falls to 1.

    With z = r exp(iu) and w = r'/r + i, the derivatives are z' = z w, z'' = z (w^2 + w') and
    z''' = z (w^3 + 3 w w' + w'').
    """
    ratio, sharpest = 1.0 + above, math.sqrt(above)
    near = np.geomspace(1e-3 * min(sharpest, 1.0), math.pi / 2.0, 4000)
    angle = np.concatenate([np.linspace(0.0, math.pi, 4001), math.pi / 2.0 - near, math.pi / 2.0 + near])
    sin, cos = np.sin(angle), np.cos(angle)
    root = np.sqrt(above + cos * cos)
    lift = np.where(cos > 0.0, cos + root, above / (root + np.abs(cos)))
    r = scale * (lift / (1.0 + math.sqrt(ratio))) ** (1.0 / lobes)
    w = -sin / root + 1j
    w1 = -lobes * ratio * cos / root**3
    w2 = lobes**2 * ratio * (sin / root**3 - 3.0 * sin * cos**2 / root**5)
    third = np.max(r * np.abs(w**3 + 3.0 * w * w1 + w2))
    mixed = np.max(3.0 * r * r * np.abs((np.conj(w) * (w * w + w1)).real))
    return MARGIN * float(mixed), MARGIN * float(third)
