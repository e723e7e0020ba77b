"""dκ/ds of every kind of piece: against sympy, finite differences, and the thesis's numbers."""

import numpy as np
import pytest
import sympy

from hapticeval.compiled import for_kernels
from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, ellipse, line
from hapticeval.geometry.kernels import curvature_rate, piece_of

MODELS = {
    "cassinian": cassinian(),
    "three lobes": cassinian(lobes=3, a_n=1.2),
    "ellipse": ellipse(ratio=3.0),
    "circle": circle(),
    "dumbbell": dumbbell(),
}


def rates(curve, us):
    pieces = for_kernels(curve.pieces)
    return np.array([curvature_rate(pieces[piece_of(pieces, u)], u) for u in us])


def symbolic(x, y, u):
    dx, dy = sympy.diff(x, u), sympy.diff(y, u)
    speed = sympy.sqrt(dx**2 + dy**2)
    bend = (dx * sympy.diff(dy, u) - dy * sympy.diff(dx, u)) / speed**3
    return sympy.lambdify(u, sympy.diff(bend, u) / speed, modules="mpmath")


@pytest.mark.parametrize(("lobes", "ratio"), [(4, 2), (3, sympy.Rational(6, 5)), (5, 40)])
def test_the_cassinian_against_sympy(lobes, ratio):
    u = sympy.Symbol("u")
    root = sympy.sqrt(ratio - sympy.sin(lobes * u) ** 2)
    radius = ((sympy.cos(lobes * u) + root) / (1 + sympy.sqrt(ratio))) ** sympy.Rational(1, lobes) / 10
    exact = symbolic(radius * sympy.cos(u), radius * sympy.sin(u), u)
    curve = cassinian(lobes=lobes, a_n=float(ratio)).curve
    us = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, 40)
    expected = np.array([float(exact(each)) for each in us])
    np.testing.assert_allclose(rates(curve, us), expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


def test_the_ellipse_against_sympy():
    u = sympy.Symbol("u")
    exact = symbolic(sympy.cos(u) / 10, sympy.sin(u) / 30, u)
    us = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, 40)
    expected = np.array([float(exact(each)) for each in us])
    np.testing.assert_allclose(rates(ellipse(ratio=3.0).curve, us), expected, rtol=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_it_is_what_curvature_changes_by(name):
    curve = MODELS[name].curve
    start, end = curve.u_range
    us = np.linspace(start, end, 101)[1:-1] + 1e-3 * (end - start)
    joints = np.append(curve.pieces[:, 1], end)
    us = us[np.min(np.abs(us[:, None] - joints), axis=1) > 1e-4]
    step = 1e-5 * (end - start)
    before, after = us - step, us + step
    measured = (curve.curvature(after) - curve.curvature(before)) / (curve.arc_length(after) - curve.arc_length(before))
    found = rates(curve, us)
    np.testing.assert_allclose(found, measured, rtol=1e-5, atol=1e-5 * np.abs(found).max() + 1e-6)


def test_the_cassinian_is_symmetric_about_tips_and_valleys():
    curve = cassinian(size=2.0).curve
    np.testing.assert_allclose(rates(curve, np.arange(8) * np.pi / 4.0), 0.0, atol=1e-11)
    second = (rates(curve, [1e-5])[0] - rates(curve, [0.0])[0]) / 1e-5
    assert second == pytest.approx(-42.4264068712, rel=1e-6)
    valley = np.pi / 4.0
    speed = float(curve.arc_length(valley + 1e-5) - curve.arc_length(valley - 1e-5)) / 2e-5
    second = (rates(curve, [valley + 1e-5])[0] - rates(curve, [valley - 1e-5])[0]) / (2e-5 * speed)
    assert second == pytest.approx(159.14748525, rel=1e-6)


def test_a_line_has_none():
    assert rates(line().curve, [-3.0, 0.0, 2.0]).tolist() == [0.0, 0.0, 0.0]
