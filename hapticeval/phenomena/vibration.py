"""A decaying sinusoid fitted to samples, and how well its decay and frequency are known."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hapticeval.phenomena.decisions import CONFIDENCE_WIDTHS, FIT_SAMPLES, SENSOR_NOISE
from hapticeval.types import Array


class Vibration(NamedTuple):
    """A fitted sinusoid: decay (1/s), frequency (Hz), what is open of each, and the residual as a share of the peak."""

    decay: float
    decay_open: float
    frequency: float
    frequency_open: float
    residual: float


def fit(values: Array, dt: float, decay: float, frequency: float) -> Vibration | None:
    """Fit e^(-Bt)(a cos wt + b sin wt) to `values` (n,), taken every `dt` s; None for too few.

    By least squares, from Prony's estimate and from the given numbers: the better of both. What is open is the half
    width of the interval that holds the true number with 99 per cent, by the covariance s^2 (J'J)^-1.
    """
    from scipy.optimize import least_squares

    peak = float(np.max(np.abs(values), initial=0.0))
    if values.size < FIT_SAMPLES or peak == 0.0:
        return None
    time, scaled = dt * np.arange(values.size), values / peak

    def both(parameters: Array) -> tuple[Array, Array]:
        """Return the model (n,), a share of the peak, and its derivative (n, 4) by a, b, B (1/s) and w (rad/s)."""
        a, b, rate, omega = parameters
        fading = np.exp(-rate * time)
        cosine, sine = fading * np.cos(omega * time), fading * np.sin(omega * time)
        wave = a * cosine + b * sine
        return wave, np.column_stack([cosine, sine, -time * wave, time * (b * cosine - a * sine)])

    def off(parameters: Array) -> Array:
        """Return the residuals (n,), as shares of the peak in N, of parameters (4,)."""
        return both(parameters)[0] - scaled

    def slopes(parameters: Array) -> Array:
        """Return the Jacobian (n, 4) of the residuals, as shares of the peak in N, at parameters (4,)."""
        return both(parameters)[1]

    best = None
    # Two starts, for a fit of a frequency has many local minima.
    for start in (prony(scaled, dt), (decay, 2.0 * math.pi * frequency)):
        if start is None:
            continue
        # The derivatives by a and b are the two waves: amplitudes by linear least squares.
        columns = slopes(np.array([0.0, 0.0, *start]))[:, :2]
        amplitudes = np.linalg.lstsq(columns, scaled, rcond=None)[0]
        begin = np.array([*amplitudes, *start])
        solution = least_squares(off, begin, jac=slopes, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if best is None or solution.cost < best.cost:
            best = solution
    assert best is not None
    # s^2 = sum of squares / (n - 4); the cost is half of the sum
    residual = math.sqrt(2.0 * best.cost / (values.size - 4))
    steep = slopes(best.x)
    size = np.linalg.norm(steep, axis=0)
    if not np.all(size > 0.0):
        return None
    # Square roots of the diagonal of s^2 (J'J)^-1, with columns scaled to unit length.
    spread = max(residual, SENSOR_NOISE) * np.sqrt(np.diag(np.linalg.pinv((steep / size).T @ (steep / size)))) / size
    turn = 2.0 * math.pi
    return Vibration(
        float(best.x[2]),
        CONFIDENCE_WIDTHS * float(spread[2]),
        abs(float(best.x[3])) / turn,
        CONFIDENCE_WIDTHS * float(spread[3]) / turn,
        residual,
    )


def prony(values: Array, dt: float) -> tuple[float, float] | None:
    """Estimate decay (1/s) and w (rad/s) of `values` (n,), taken every `dt` s, without a start; None where none rings.

    Prony's method: least squares of x[k+2] = p x[k+1] + q x[k], whose root is e^((-B + i w) dt).
    """
    columns = np.column_stack([values[1:-1], values[:-2]])
    p, q = np.linalg.lstsq(columns, values[2:], rcond=None)[0]
    # Complex root of x^2 = p x + q; a real one does not ring.
    root = complex(0.5 * p, math.sqrt(max(-q - 0.25 * p * p, 0.0)))
    if root.imag == 0.0:
        return None
    # ln(root) / dt = -B + i w
    return -math.log(abs(root)) / dt, math.atan2(root.imag, root.real) / dt
