"""Cassinians whose valleys are as narrow as the number format allows: nearest points against 40 digits, and cost."""

from __future__ import annotations

import time

import mpmath as mp
import numpy as np
import pytest

from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian
from hapticeval.geometry.curve import Curve
from hapticeval.types import Array

NARROW = [(4, 1e-9), (2, 1e-13), (3, 1e-6), (9, 1e-6)]
CURVES = {(lobes, above): cassinian(lobes=lobes, a_n=1.0 + above).curve for lobes, above in NARROW}

narrow = pytest.mark.parametrize(("lobes", "above"), NARROW)


@pytest.fixture(autouse=True)
def digits() -> object:
    with mp.workdps(40):
        yield


def exact(lobes: int, above: float, u: object) -> tuple[object, object]:
    """Position (m) by (4.1) in as many digits as are set; the curve's own a_n / a_d."""
    ratio = 1 + (mp.mpf(1.0 + above) - 1)
    sin, cos = mp.sin(lobes * u), mp.cos(lobes * u)
    r = mp.mpf(0.1) * ((cos + mp.sqrt(ratio - sin * sin)) / (1 + mp.sqrt(ratio))) ** (mp.mpf(1) / lobes)
    return r * mp.cos(u), r * mp.sin(u)


def off_the_surface(lobes: int, above: float, x: float, y: float) -> float:
    """Distance (m) of a point close to the curve |z^n - 1|^2 = a_n / a_d, by the value and the gradient there."""
    b = mp.sqrt(1 + (mp.mpf(1.0 + above) - 1))
    scale = (1 + b) ** (mp.mpf(1) / lobes) / mp.mpf(0.1)
    z = mp.mpc(x, y) * scale
    return float(abs(abs(z**lobes - 1) - b) / (lobes * abs(z) ** (lobes - 1) * scale))


def points(curve: Curve, count: int) -> Array:
    """Half of them anywhere, half close to the middle, where all valleys meet."""
    rng = np.random.default_rng(4)
    anywhere = rng.uniform(-0.11, 0.11, (count, 2))
    reach = float(np.min(np.hypot(*curve.position(np.linspace(0.0, 2.0 * np.pi, 2001)).T)))
    return np.vstack([anywhere, rng.uniform(-4.0, 4.0, (count, 2)) * reach])


def nearest_distance(lobes: int, above: float, curve: Curve, point: Array) -> float:
    """The global minimum of the distance: every minimum of a fine sampling by arc length, refined in 40 digits."""
    s = np.linspace(0.0, curve.length, 20_001)[:-1]
    us = curve.parameter(s)
    squares = np.sum((curve.position(us) - point) ** 2, axis=1)
    low = np.flatnonzero((squares <= np.roll(squares, 1)) & (squares <= np.roll(squares, -1)))
    low = low[np.sqrt(squares[low]) <= np.sqrt(squares.min()) + curve.length / 20_000]
    px, py = mp.mpf(float(point[0])), mp.mpf(float(point[1]))

    def distance(u: object) -> object:
        x, y = exact(lobes, above, u)
        return mp.hypot(x - px, y - py)

    best = mp.inf
    golden = (mp.sqrt(5) - 1) / 2
    for k in low:
        a, b = mp.mpf(float(us[k - 1])), mp.mpf(float(us[(k + 1) % us.size]))
        if k == 0:
            a -= 2 * mp.pi
        elif k == us.size - 1:
            b += 2 * mp.pi
        for _ in range(110):
            c, d = b - golden * (b - a), a + golden * (b - a)
            a, b = (a, d) if distance(c) < distance(d) else (c, b)
        best = min(best, distance((a + b) / 2))
    return float(best)


@narrow
def test_nearest_points_are_right_to_rounding(lobes: int, above: float) -> None:
    curve = CURVES[lobes, above]
    for point, found in zip(points(curve, 8), np.abs(curve.signed_distance(points(curve, 8))), strict=True):
        assert found == pytest.approx(nearest_distance(lobes, above, curve, point), abs=1e-16, rel=1e-15)


@narrow
def test_feet_lie_on_the_curve(lobes: int, above: float) -> None:
    curve = CURVES[lobes, above]
    feet = curve.position(curve.nearest(points(curve, 200)))
    assert max(off_the_surface(lobes, above, x, y) for x, y in feet) < 1e-16


@pytest.mark.parametrize(("lobes", "above"), [*NARROW, (1000, 1e-3)])
def test_no_query_takes_a_millisecond(lobes: int, above: float) -> None:
    curve = cassinian(lobes=lobes, a_n=1.0 + above).curve
    asked = points(curve, 150)
    curve.nearest(asked)
    fastest = np.inf
    for _ in range(3):
        before = time.thread_time()
        curve.nearest(asked)
        fastest = min(fastest, time.thread_time() - before)
    assert fastest / len(asked) < 1e-3


@pytest.mark.parametrize(("lobes", "above"), [(4, 1e-12), (4, 1e-10), (2, 5e-15), (1000, 1e-7)])
def test_valleys_too_narrow_for_the_parameter_are_refused(lobes: int, above: float) -> None:
    with pytest.raises(InputError, match="too narrow for the number format"):
        cassinian(lobes=lobes, a_n=1.0 + above)
