"""Joint torques of set stabilisation derived by sympy from the definitions: (2.14), (2.35), (2.36), (7.5), (7.11).

Nothing here knows the law in curve coordinates that the package evaluates.
"""

from functools import cache

import sympy

from hapticeval.devices.parallelogram import ParallelogramParameters

STATE = sympy.symbols("x1:5")
GAIN_P, GAIN_D = 500.0, 44.7
TABLE = ParallelogramParameters()
FIELD = sympy.Matrix([STATE[2], STATE[3], -TABLE.b2 * STATE[2] / TABLE.d2, -TABLE.b3 * STATE[3] / TABLE.d3])
INPUT = sympy.Matrix([[0, 0], [0, 0], [1 / TABLE.d2, 0], [0, 1 / TABLE.d3]])
OUTPUT = sympy.Matrix(
    [
        TABLE.l4 * sympy.cos(STATE[1]) - TABLE.l1 * sympy.sin(STATE[0]) - TABLE.l4,
        TABLE.l4 * sympy.sin(STATE[1]) + TABLE.l1 * sympy.cos(STATE[0]) - TABLE.l1,
    ]
)
"""(2.36)."""


def along_field(function):
    """L_f of a column of functions of the state."""
    return function.jacobian(STATE) * FIELD


def linearising(virtual, wanted):
    """(7.11), u = (L_g L_f α)^-1 (-L_f^2 α + v), with v as `wanted` makes it of α and L_f α."""
    rate = along_field(virtual)
    decoupling = rate.jacobian(STATE) * INPUT
    return decoupling.LUsolve(wanted(virtual, rate) - along_field(rate))


@cache
def by_feedback_linearisation():
    """(6.7) for the output itself and any v: (6.17)."""
    v = sympy.symbols("v1 v2")
    return sympy.lambdify([*STATE, *v], linearising(OUTPUT, lambda *_: sympy.Matrix(v)), cse=True)


def transversal(virtual, rate):
    """(7.14) with its signs, and a free tangential coordinate."""
    return sympy.Matrix([-GAIN_P * virtual[0] - GAIN_D * rate[0], 0])


@cache
def on_the_line():
    """(7.29): s = y2, and y1 along it."""
    return sympy.lambdify(STATE, linearising(sympy.Matrix([OUTPUT[1], OUTPUT[0]]), transversal), cse=True)


@cache
def on_the_circle(radius):
    """s = |y| - r_c and the angle (7.30)."""
    virtual = sympy.Matrix([sympy.sqrt(OUTPUT.dot(OUTPUT)) - radius, sympy.atan2(OUTPUT[1], OUTPUT[0])])
    return sympy.lambdify(STATE, linearising(virtual, transversal), cse=True)


def cassinian_torque(lobes=4, ratio=2, size=0.2):
    """The torque on the Cassinian as expressions of the state and of the foot's parameter u.

    The virtual output (n, s) is given by y = c(u) + n ν(u) and ds/du = |c'(u)|, so its second derivative is found from
    that of y: ÿ = L_f^2 h + L_g L_f h τ on one side, the chain rule twice on the other.
    """
    u, n, du, dn = sympy.symbols("u n du dn")
    root = sympy.sqrt(ratio - sympy.sin(lobes * u) ** 2)
    radius = sympy.Rational(size / 2).limit_denominator(1000) * (
        (sympy.cos(lobes * u) + root) / (1 + sympy.sqrt(ratio))
    ) ** sympy.Rational(1, lobes)
    curve = sympy.Matrix([radius * sympy.cos(u), radius * sympy.sin(u)])
    tangent = curve.diff(u)
    speed = sympy.sqrt(tangent.dot(tangent))
    normal = sympy.Matrix([tangent[1], -tangent[0]]) / speed
    place = curve + n * normal
    chart = place.jacobian([n, u])
    # s'' = 0 means u'' = -(d speed / du) u'^2 / speed
    second = sympy.Matrix([-GAIN_P * n - GAIN_D * dn, -speed.diff(u) * du**2 / speed])
    turned = (chart * sympy.Matrix([dn, du])).jacobian([n, u]) * sympy.Matrix([dn, du])
    acceleration = turned + chart * second
    rate = along_field(OUTPUT)
    torque = (rate.jacobian(STATE) * INPUT).LUsolve(acceleration - along_field(rate))
    velocity = chart.LUsolve(rate)
    depth = (OUTPUT - curve).dot(normal)
    return torque.subs({dn: velocity[0], du: velocity[1]}).subs(n, depth), u


@cache
def on_the_cassinian():
    """The torque as a function of the state and the foot's u, by lambdify with cse, in plain Python floats."""
    torque, u = cassinian_torque()
    return sympy.lambdify([*STATE, u], list(torque), modules="math", cse=True)
