"""The closed loop's equations of motion, each beside the formula that is printed of it (thesis Tables 6.1 and 6.2).

In the formulas k, d and b are `Gains`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.types import Array

Formula = tuple[str, str]
"""The equations of motion across the surface and along it, as people write them."""

RELATIVE, ABSOLUTE = 3e-14, 1e-16
"""Tolerances of the integration (DOP853) where no formula solves the equations."""


class Gains(NamedTuple):
    """Per unit mass of the tool, as Tables 6.1 and 6.2 have them: `k` = K_p / m (1/s^2), `d` = K_d / m and `b` =
    b_d / m (1/s)."""

    k: float
    d: float
    b: float


def drag(scheme: str, gains: Gains) -> float:
    """The rate (1/s) at which the speed along a straight surface decays."""
    return {"pp-v": gains.d, "set-stabilisation": gains.b}.get(scheme, 0.0)


def sliding(drag: float, speed: float, time: Array) -> tuple[Array, Array]:
    """s(t) and its rate for s'' = -drag s', s(0) = 0."""
    if drag == 0.0:
        return speed * time, np.full_like(time, speed)
    return -speed / drag * np.expm1(-drag * time), speed * np.exp(-drag * time)


def transversal(gains: Gains, scheme: str, start: float, rate: float, time: Array) -> tuple[Array, Array]:
    """n(t) and its rate for n'' = -k n - d n' (7.28), (7.38); d counts for nothing under PP (6.19)."""
    d = 0.0 if scheme == "pp" else gains.d
    half = 0.5 * d
    root = np.sqrt(complex(half * half - gains.k))
    if abs(root) < 1e-6 * math.sqrt(gains.k):
        slope = rate + half * start
        decay = np.exp(-half * time)
        return decay * (start + slope * time), decay * (slope - half * (start + slope * time))
    fast, slow = -half - root, -half + root
    p, q = (rate - fast * start) / (slow - fast), (slow * start - rate) / (slow - fast)
    grown, faded = p * np.exp(slow * time), q * np.exp(fast * time)
    return np.real(grown + faded), np.real(slow * grown + fast * faded)


LINE_LETTERS = "n is the distance from the line, s the way along it."


def line_formula(scheme: str) -> Formula:
    """`sliding` with the scheme's `drag`, and `transversal`, as a formula."""
    along = {"pp-v": "−d s′", "set-stabilisation": "−b s′"}.get(scheme, "0")  # noqa: RUF001
    return f"s″ = {along}", f"n″ = −k n{_damping(scheme, 'n')}"  # noqa: RUF001


def polar_rates(scheme: str, gains: Gains, radius: float) -> Callable[[float, Array], Sequence[float]]:
    """d/dt (r, r', theta, theta'): (6.24) PP, (6.25) PP+V, (6.26) PP+PD, (6.27) PP+D, (7.38) set stabilisation.

    PP+PD with the centripetal force added has (6.26) less (r theta')^2 / r_c.
    """
    k, d, b = gains

    def rates(time: float, state: Array) -> Sequence[float]:  # noqa: ARG001 - the integrator's
        r, r_rate, _, rate = state
        if scheme == "set-stabilisation":
            return r_rate, -k * (r - radius) - d * r_rate, rate, -b * rate
        damping = 0.0 if scheme == "pp" else d * r_rate
        drag = {"pp-v": d * r, "pp-d": d * (r - radius)}.get(scheme, 0.0)
        given = (r * rate) ** 2 / radius if scheme == "pp-pd-c" else 0.0
        return r_rate, -k * (r - radius) + r * rate**2 - given - damping, rate, -(2.0 * r_rate + drag) * rate / r

    return rates


POLAR_LETTERS = "r is the distance from the centre, R the {shape}'s radius, θ the {angle}."


def polar_formula(scheme: str) -> Formula:
    """`polar_rates` as a formula: (6.24) to (6.27), (7.38)."""
    if scheme == "set-stabilisation":
        return "r″ = −k (r − R) − d r′", "θ″ = −b θ′"  # noqa: RUF001
    drag = {"pp-v": "(2 r′ + d r)", "pp-d": "(2 r′ + d (r − R))"}.get(scheme, "2 r′")  # noqa: RUF001
    given = " − (r θ′)² / R" if scheme == "pp-pd-c" else ""  # noqa: RUF001
    return f"r″ = −k (r − R) + r θ′²{given}{_damping(scheme, 'r')}", f"θ″ = −{drag} θ′ / r"  # noqa: RUF001


def curve_rates(scheme: str, gains: Gains, curve: Curve) -> Callable[[float, Array], Sequence[float]]:
    """d/dt (n, n', s, w) of a projective scheme on any smooth curve, w = (1 + n kappa) s' being the tool's own speed.

    n'' = kappa (1 + n kappa) s'^2 - k n - d n' and (1 + n kappa) s'' + 2 kappa n' s' + n kappa_s s'^2 = the scheme's
    tangential acceleration. In w the second reads w' = that - kappa n' s', free of the curvature's slope.
    """
    k, d, _ = gains

    def rates(time: float, state: Array) -> Sequence[float]:  # noqa: ARG001 - the integrator's
        n, n_rate, s, w = state
        kappa = float(curve.curvature(curve.parameter(s)))
        rate = w / (1.0 + n * kappa)
        damping = 0.0 if scheme == "pp" else d * n_rate
        drag = {"pp-v": d * w, "pp-d": d * n * kappa * rate}.get(scheme, 0.0)
        given = kappa * w * w if scheme == "pp-pd-c" else 0.0
        return n_rate, kappa * w * rate - given - k * n - damping, rate, -kappa * n_rate * rate - drag

    return rates


CURVE_LETTERS = (
    "n is the distance from the curve, s the arc length of its foot, κ the curvature there, and w = (1 + n κ) s′ the "  # noqa: RUF001
    "tool's speed along the curve."
)


def curve_formula(scheme: str) -> Formula:
    """`curve_rates` as a formula; of set stabilisation `transversal` and `sliding`, a law of s and not of w."""
    if scheme == "set-stabilisation":
        return "n″ = −k n − d n′", "s″ = −b s′"  # noqa: RUF001
    drag = {"pp-v": " − d w", "pp-d": " − d n κ s′"}.get(scheme, "")  # noqa: RUF001
    given = " − κ w²" if scheme == "pp-pd-c" else ""  # noqa: RUF001
    return f"n″ = κ w s′{given} − k n{_damping(scheme, 'n')}", f"w′ = −κ n′ s′{drag}"  # noqa: RUF001


def _damping(scheme: str, across: str) -> str:
    return "" if scheme == "pp" else f" − d {across}′"  # noqa: RUF001


def integrated(rates: Callable[[float, Array], Sequence[float]], start: Sequence[float], time: Array) -> Array:
    """The states (k, n) at `time` (n,), by DOP853 at its tightest tolerance. Raises `InputError` where it cannot."""
    from scipy.integrate import solve_ivp

    if time.size < 2:
        return np.tile(np.array(start, dtype=np.float64)[:, np.newaxis], (1, time.size))
    found = solve_ivp(rates, (time[0], time[-1]), start, method="DOP853", t_eval=time, rtol=RELATIVE, atol=ABSOLUTE)
    if not found.success:
        raise InputError("the closed form cannot be integrated", why=str(found.message))
    return np.asarray(found.y, dtype=np.float64)
