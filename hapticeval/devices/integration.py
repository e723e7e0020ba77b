"""How a device moves between samples: the methods that integrate it, and the one that closed loops use.

All are explicit Runge-Kutta methods written in Nyström's form for q̈ = a(t, q, q̇):

    a_i = a(t + c_i h, q + c_i h q̇ + h² Σ ā_ij a_j, q̇ + h Σ a_ij a_j)
    q⁺ = q + h q̇ + h² Σ b̄_i a_i,    q̇⁺ = q̇ + h Σ b_i a_i

so that one compiled loop serves them all. A method for first-order systems has Ā = A² and b̄ = bᵀA.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticeval.types import Array


@dataclass(frozen=True, eq=False)
class Method:
    """An integration method: `a`, `abar` (s, s); `b`, `bbar`, `c` (s,); `e`, `ebar` (s,) give the error of a step.

    `order` is that of the solution; one with an error estimate (of `error_order`) chooses its own steps, and one
    without takes a number of equal ones a tick.
    """

    name: str
    order: int
    a: Array
    b: Array
    abar: Array
    bbar: Array
    e: Array
    ebar: Array
    error_order: int = 0

    @property
    def adaptive(self) -> bool:
        """Whether it estimates its own error."""
        return self.error_order > 0

    @property
    def table(self) -> Array:
        """What the kernels are given, (2 s + 5, s): A, Ā, and the rows b, b̄, c, e, ē."""
        rows = np.vstack([self.b, self.bbar, self.a.sum(axis=1), self.e, self.ebar])
        return np.ascontiguousarray(np.vstack([self.a, self.abar, rows]))


def runge_kutta(
    name: str, order: int, a: list[list[float]], b: list[float], lower: list[float] | None = None, error_order: int = 0
) -> Method:
    """A method for first-order systems, from the strictly lower rows of A, b, and the weights of its lower order."""
    size = len(b)
    full = np.zeros((size, size))  # the first row of an explicit method is zero
    for i, row in enumerate(a, start=1):
        full[i, : len(row)] = row
    weights = np.array(b)
    e = np.zeros(size) if lower is None else weights - np.array(lower)
    # in Nyström's form: Ā = A², b̄ = bᵀA, ē = eᵀA
    return Method(name, order, full, weights, full @ full, weights @ full, e, e @ full, error_order)


def euler() -> Method:
    """Explicit Euler: order 1."""
    return runge_kutta("euler", 1, [], [1.0])


def semi_implicit_euler() -> Method:
    """Semi-implicit Euler, order 1: the new position is had from the new velocity."""
    zero = np.zeros(1)  # b̄ = b = 1: q⁺ = q + h q̇ + h² a = q + h q̇⁺
    return Method("semi-implicit-euler", 1, np.zeros((1, 1)), np.ones(1), np.zeros((1, 1)), np.ones(1), zero, zero)


def rk4() -> Method:
    """The classical method of Runge and Kutta: order 4."""
    return runge_kutta("rk4", 4, [[0.5], [0.0, 0.5], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6])


def cash_karp() -> Method:
    """Cash and Karp's pair 5(4): six stages, error and all."""
    return runge_kutta(
        "cash-karp",
        5,
        [
            [1 / 5],
            [3 / 40, 9 / 40],
            [3 / 10, -9 / 10, 6 / 5],
            [-11 / 54, 5 / 2, -70 / 27, 35 / 27],
            [1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096],
        ],
        [37 / 378, 0.0, 250 / 621, 125 / 594, 0.0, 512 / 1771],
        [2825 / 27648, 0.0, 18575 / 48384, 13525 / 55296, 277 / 14336, 1 / 4],
        error_order=4,
    )


def dormand_prince() -> Method:
    """Dormand and Prince's pair 5(4): seven stages, the last one for the error."""
    b = [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]
    return runge_kutta(
        "dormand-prince",
        5,
        [
            [1 / 5],
            [3 / 40, 9 / 40],
            [44 / 45, -56 / 15, 32 / 9],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
            b,
        ],
        [*b, 0.0],
        [5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40],
        error_order=4,
    )


def verner() -> Method:
    """Verner's pair 6(5): eight stages."""
    return runge_kutta(
        "verner",
        6,
        [
            [1 / 6],
            [4 / 75, 16 / 75],
            [5 / 6, -8 / 3, 5 / 2],
            [-165 / 64, 55 / 6, -425 / 64, 85 / 96],
            [12 / 5, -8.0, 4015 / 612, -11 / 36, 88 / 255],
            [-8263 / 15000, 124 / 75, -643 / 680, -81 / 250, 2484 / 10625],
            [3501 / 1720, -300 / 43, 297275 / 52632, -319 / 2322, 24068 / 84065, 0.0, 3850 / 26703],
        ],
        [3 / 40, 0.0, 875 / 2244, 23 / 72, 264 / 1955, 0.0, 125 / 11592, 43 / 616],
        [13 / 160, 0.0, 2375 / 5984, 5 / 16, 12 / 85, 3 / 44, 0.0, 0.0],
        error_order=5,
    )


def dop853() -> Method:
    """Hairer's method of order 8, with its error estimate of order 5: twelve stages. The coefficients are scipy's."""
    from scipy.integrate import DOP853

    a, b = np.array(DOP853.A)[:12, :12], np.array(DOP853.B)
    e = np.array(DOP853.E5)[:12]
    return Method("dop853", 8, a, b, a @ a, b @ a, e, e @ a, error_order=5)


METHODS = {
    "euler": euler,
    "semi-implicit-euler": semi_implicit_euler,
    "rk4": rk4,
    "cash-karp": cash_karp,
    "dormand-prince": dormand_prince,
    "verner": verner,
    "dop853": dop853,
}
"""Name -> how to make it."""

DEFAULT = "cash-karp"
"""What closed loops integrate with: the motors' torque jumps at every tick, so that a last stage that is the next
step's first, as in Dormand and Prince's, is wasted."""

STEP_TOLERANCE = 1e-10
"""The error that closed loops allow a step, relative to the largest joint and the largest rate: a tenth of what they
promise for a tick, which may take several steps."""


def default_method() -> Method:
    """The method that closed loops use."""
    return METHODS[DEFAULT]()


def control(method: Method, *, tolerance: float = STEP_TOLERANCE, substeps: int = 1) -> Array:
    """Return the kernels' settings (3,) beside the table: tolerance or 0, exponent of the step size, equal steps."""
    if method.adaptive:
        # the error of a step of order p falls as h^(p + 1)
        return np.array([tolerance, -1.0 / (method.error_order + 1), 1.0])
    return np.array([0.0, 0.0, float(substeps)])
