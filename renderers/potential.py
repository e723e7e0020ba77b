"""The force of a potential whose level curves keep the normals of the surface: what makes a continuous map passive.

The surface y_0(s), its outward unit normal n and its support distance h = n.(y_0 - c) about a centre c in the kernel
give the level curves (Combescure's transforms; in space the same)

    y_t(s) = c + A(t) (y_0(s) - c) - B(t) n(s)

The hand at y_t(s) has y_0(s) as IHIP and, with U = K t^2 / 2, the force F = K t / v n, where v = B' - A' h is the speed
at which the level curves go inwards.

It is -grad U, for n.dy_t/ds = 0 makes F.dx = -U'(t) dt. Here B = A b, with

    b(t) = t up to half of m, then with a derivative that falls to zero smoothly, from m on constant, 3/4 m
    A(t) = (H - t) / (H - b(t))

so that t is the depth n.(IHIP - HIP) wherever h = H. Up to the depth m / 2 the level curves are parallel curves, v = 1,
and F = K t is the nearest point's spring; deeper they are smaller copies of one another, and at t = H the point c.

A and B have continuous second derivatives. With m < 1 / kappa_max and m <= h_min the curves lie one inside the other
and cover the inside once (docs/continuous-and-passive.md). With m = 0 all are smaller copies of the surface.

`numbers` are H and m (m), and the centre (N,), m.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hapticeval.compiled import borrowing, compiled, inner
from hapticeval.types import Array

SUPPORT, REACH, CENTRE = range(3)
"""Where H, m and the centre are in the numbers of a potential."""

PARALLEL, LAST = 0.5, 1.0
"""Shares of m up to which b is t, and from which it is constant, three quarters of m. A shorter blend keeps the curves
further from crossing, and makes the force fall with depth where h is large: by 0.5 K on a 2:1 ellipse for half of it.
"""

STEPS = 60
"""Most steps to the level of a point, between these two."""

LEVELS, BETWEEN = 1000, 1e-3
"""Levels at which the stiffness is sampled, over all depths and once more over the blend, and the share by which it may
be beyond between two: it changes by a factor of a few over either, and is smooth."""

ROUNDING = 2e-16
"""Share of H below which a change of the level is rounding."""


@inner
def level_values(numbers: Array, first: int, t: float) -> tuple[float, float, float, float]:
    """Return A, b (m), and their derivatives A' (1/m) and b' at the level t (m): what a level curve is made of.

    `numbers` (n,), m, hold H, m and the centre from `first` on.
    """
    support, reach = numbers[first + SUPPORT], numbers[first + REACH]
    blend_begin, blend_end = PARALLEL * reach, LAST * reach
    if t <= blend_begin and reach > 0.0:  # parallel curves
        return 1.0, t, 0.0, 1.0
    span = blend_end - blend_begin
    if t >= blend_end or reach == 0.0:
        b, b_rate = blend_begin + 0.5 * span, 0.0
    else:
        # b' = 1 - 3 x^2 + 2 x^3 falls from 1 to 0 with zero slope at both ends; b is its integral
        x = (t - blend_begin) / span
        b = blend_begin + span * (x - x * x * x + 0.5 * x * x * x * x)
        b_rate = 1.0 - (3.0 - 2.0 * x) * x * x
    remaining = support - b
    # A = (H - t) / (H - b), and A' = ((H - t) b' - (H - b)) / (H - b)^2
    return (support - t) / remaining, b, ((support - t) * b_rate - remaining) / (remaining * remaining), b_rate


@borrowing
def level_at(numbers: Array, first: int, depth_coordinate: float, h: float) -> float:
    """Return the level t (m) of a hand x whose IHIP has the normal n and the support distance h (m).

    `depth_coordinate` (m) is n.(x - c), and A (h - b) at the level of x; that falls with t at the rate v > 0.
    `numbers` (n,), m, hold H, m and the centre from `first` on.
    """
    support, reach = numbers[first + SUPPORT], numbers[first + REACH]
    if reach > 0.0 and h - depth_coordinate <= PARALLEL * reach:
        return float(h - depth_coordinate)
    # deeper than the blend b is constant, and t has a closed form
    low, high = PARALLEL * reach, LAST * reach
    a, b, _, _ = level_values(numbers, first, high)
    if reach == 0.0 or depth_coordinate <= a * (h - b):
        return float(support - depth_coordinate / (h - b) * (support - b))
    # in the blend: Newton's method, kept between the bounds
    t: float = 0.5 * (low + high)
    for _ in range(STEPS):
        a, b, da, db = level_values(numbers, first, t)
        excess = a * (h - b) - depth_coordinate
        if excess > 0.0:
            low = t
        else:
            high = t
        next_t = t + excess / (a * db - da * (h - b))
        if not low <= next_t <= high:
            next_t = 0.5 * (low + high)
        if abs(next_t - t) <= ROUNDING * support:
            return float(next_t)
        t = next_t
    return t


@inner
def stretch(numbers: Array, first: int, t: float, h: float) -> float:
    """Return t / v (m), with v = b' A - A' (h - b): K times that is the force at the level t (m).

    h (m) is the support distance there; `numbers` (n,), m, hold H, m and the centre from `first` on.
    """
    a, b, da, db = level_values(numbers, first, t)
    return t / (a * db - da * (h - b))


def stiffness_range(numbers: Sequence[float], smallest: float, largest: float) -> tuple[float, float]:
    """Return between what shares of K the force over the depth lies, for support distances (m) between two.

    That share is (t / v) / d, with the depth d = h - A (h - b). Both v and d rise with h, so that at each level the
    share is least where h is largest.
    """
    data = np.asarray(numbers, dtype=np.float64)
    support, reach = data[SUPPORT], data[REACH]
    cuts = np.linspace(0.0, 1.0, LEVELS + 2)[1:-1]
    levels = np.concatenate([cuts * support, (PARALLEL + (LAST - PARALLEL) * cuts) * reach])
    softest, stiffest = (_shares(data, levels[levels > 0.0], h) for h in (largest, smallest))
    return min(1.0, softest.min()) * (1.0 - BETWEEN), max(1.0, stiffest.max()) * (1.0 + BETWEEN)


@compiled
def _shares(numbers: Array, levels: Array, h: float) -> Array:
    """Return the shares of K that the force over the depth is at levels (n,), m, where the support distance is h."""
    shares = np.empty_like(levels)
    for i in range(levels.size):
        a, b, _, _ = level_values(numbers, 0, levels[i])
        shares[i] = stretch(numbers, 0, levels[i], h) / (h - a * (h - b))
    return shares


@borrowing
def stretch_at(numbers: Array, first: int, hip: Array, ihip: Array, normal: Array) -> float:
    """Return the length (m) that K is to be multiplied by for the force on a hand at `hip` (N,), m.

    `ihip` (N,), m, and `normal` (N,) are its IHIP and the outward unit normal there; `numbers` (n,), m, hold H, m and
    the centre from `first` on.
    """
    depth_coordinate, h = 0.0, 0.0
    for i in range(hip.shape[0]):
        depth_coordinate += normal[i] * (hip[i] - numbers[first + CENTRE + i])
        h += normal[i] * (ihip[i] - numbers[first + CENTRE + i])
    return stretch(numbers, first, level_at(numbers, first, depth_coordinate, h), h)
