"""What a closed form says of itself as a formula is what it integrates."""

from __future__ import annotations

import re

import numpy as np
import pytest
import sympy
from sympy.parsing.sympy_parser import (
    convert_xor,
    implicit_multiplication,
    parse_expr,
    standard_transformations,
)

from hapticeval.closed_forms import CLOSED_FORMS, Gains, curve_rates, polar_rates, sliding_motion, transversal_motion
from hapticeval.geometry.catalogue import make_model

GAINS = Gains(k=500.0, d=44.7, b=3.0)
WORDS = {"θ′": "turn", "r′": "r1", "n′": "n1", "s′": "s1", "θ": "theta", "κ": "kappa", "²": "^2", "−": "-"}  # noqa: RUF001
RULES = (*standard_transformations, convert_xor, implicit_multiplication)


def right_hand_sides(name, values):
    """Left sides, and the values of the right sides, of a form's equations."""
    found = {}
    symbols = {each: sympy.Symbol(each) for each in values}
    for line in CLOSED_FORMS[name].formula:
        left, right = line.split(" = ")
        for shown, word in WORDS.items():
            right = right.replace(shown, word)
        expression = parse_expr(re.sub(r"\^2 *", "**2 ", right), local_dict=symbols, transformations=RULES)
        found[left] = float(expression.subs(values))
    return found


@pytest.mark.parametrize("name", [each for each, form in CLOSED_FORMS.items() if form.shape in ("circle", "sphere")])
def test_polar_equations_are_those_integrated(name):
    radius, state = 0.7, (0.9, 0.3, 0.2, 1.7)
    _, r2, _, theta2 = polar_rates(CLOSED_FORMS[name].scheme, GAINS, radius)(0.0, state)
    values = {**GAINS._asdict(), "R": radius, "r": state[0], "r1": state[1], "turn": state[3]}
    shown = right_hand_sides(name, values)
    assert shown["r″"] == pytest.approx(r2, rel=1e-12)
    assert shown["θ″"] == pytest.approx(theta2, rel=1e-12)


@pytest.mark.parametrize("name", [each for each, form in CLOSED_FORMS.items() if form.shape == "curve"])
def test_the_equations_on_a_curve_are_those_integrated(name):
    curve, scheme = make_model("cassinian").curve, CLOSED_FORMS[name].scheme
    n, n1, s, w = 0.004, 0.3, 0.11, 0.5
    kappa = float(curve.curvature(curve.parameter(s)))
    s1 = w / (1.0 + n * kappa)
    shown = right_hand_sides(name, {**GAINS._asdict(), "n": n, "n1": n1, "w": w, "kappa": kappa, "s1": s1})
    if scheme == "set-stabilisation":
        assert shown == pytest.approx({"n″": -GAINS.k * n - GAINS.d * n1, "s″": -GAINS.b * s1})
    else:
        _, n2, _, w1 = curve_rates(scheme, GAINS, curve)(0.0, (n, n1, s, w))
        assert shown == pytest.approx({"n″": n2, "w′": w1}, rel=1e-12)  # noqa: RUF001


@pytest.mark.parametrize("name", [each for each, form in CLOSED_FORMS.items() if form.shape == "line"])
def test_the_equations_on_a_line_have_the_solutions_given(name):
    scheme, step = CLOSED_FORMS[name].scheme, 1e-5
    time = 0.01 + step * np.array([-1.0, 0.0, 1.0])
    n, n1 = transversal_motion(GAINS, scheme, 0.02, 0.5, time)
    drag = {"6.20": GAINS.d, "7.28": GAINS.b}.get(name, 0.0)
    _, s1 = sliding_motion(drag, 0.4, time)
    shown = right_hand_sides(name, {**GAINS._asdict(), "n": n[1], "n1": n1[1], "s1": s1[1]})
    assert shown["n″"] == pytest.approx((n1[2] - n1[0]) / (2.0 * step), rel=1e-6)
    assert shown["s″"] == pytest.approx((s1[2] - s1[0]) / (2.0 * step), rel=1e-6)


def test_every_letter_of_a_formula_is_explained():
    for form in CLOSED_FORMS.values():
        used = set(re.findall(r"[a-zA-Zθκ]", " ".join(form.formula))) - set(Gains._fields)
        assert used
        assert used <= set(re.findall(r"\b[a-zA-Zθκ]\b", form.letters)), form.name
