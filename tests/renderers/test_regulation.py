"""Table 4.1, (5.21) with its signs corrected, and the square-root scheme."""

import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.records import numbers_of
from hapticeval.renderers.regulation import REGULATIONS
from hapticeval.renderers.regulation_kernel import PAST, REFERENCE_DEPTH, REFERENCE_RATE, gains_of, regulate

NUMBER = st.floats(-10.0, 10.0).map(lambda x: round(x, 6))
VECTOR = st.tuples(NUMBER, NUMBER)
GAIN = st.floats(0.0, 1e4)


def force_of(name, k, d, e, n, v, r, *, bilateral=True):
    """The force of a scheme by its kernel, where the error was e - r one second before."""
    size, dt = len(e), 1.0
    scene = SimpleNamespace(stiffness=k, damping=d, mass=1.0, bilateral=bilateral)
    state, force = numbers_of(PAST, in_contact=1.0, error=np.subtract(e, r), normal=n), np.empty(size)
    e, v = np.array(e, dtype=float), np.array(v, dtype=float)
    regulate(gains_of(REGULATIONS[name], scene), state, e, v, 0.0, 0.0, dt, np.zeros(size), force)
    return tuple(force)


names = ("pp", "pp-v", "pp-d", "pp-pd", "square-root", "transversal")
pp, pp_v, pp_d, pp_pd, square_root, transversal = (partial(force_of, name) for name in names)


def unit(angle):
    return math.cos(angle), math.sin(angle)


@given(GAIN, GAIN, VECTOR, st.floats(0.0, 6.3), VECTOR, VECTOR)
def test_laws_of_table_4_1_by_components(k, d, e, angle, v, r):
    n = unit(angle)
    along = n[0] * v[0] + n[1] * v[1]
    expected = {
        pp: [-k * e[i] for i in (0, 1)],
        pp_v: [-k * e[i] - d * v[i] for i in (0, 1)],
        pp_d: [-k * e[i] - d * r[i] for i in (0, 1)],
        pp_pd: [-k * e[i] - d * along * n[i] for i in (0, 1)],
    }
    for law, force in expected.items():
        np.testing.assert_allclose(law(k, d, e, n, v, r), force, rtol=1e-12, atol=1e-9)


@given(GAIN, GAIN, st.floats(-1.0, 1.0), st.floats(0.0, 6.3), VECTOR)
def test_transversal_equals_pp_pd_where_the_projection_is_straight_and_normal(k, d, depth, angle, v):
    n = unit(angle)
    e = (-depth * n[0], -depth * n[1])
    both = [law(k, d, e, n, v, (0.0, 0.0)) for law in (transversal, pp_pd)]
    np.testing.assert_allclose(*both, rtol=1e-9, atol=1e-9)


@given(GAIN, GAIN, VECTOR, st.floats(0.0, 6.3), VECTOR)
def test_transversal_does_not_depend_on_the_sign_of_the_normal(k, d, e, angle, v):
    n = unit(angle)
    flipped = (-n[0], -n[1])
    assert transversal(k, d, e, n, v, (0.0, 0.0)) == transversal(k, d, e, flipped, v, (0.0, 0.0))


def test_transversal_on_a_shaded_normal():
    n = (-0.277350098113, 0.960768922831)
    force = transversal(1000.0, 0.0, (0.0, -1e-3), n, (0.0, 0.0), (0.0, 0.0))
    np.testing.assert_allclose(force, (-0.266469355011, 0.923076923077), atol=1e-11)


def test_transversal_pushes_out_and_resists():
    force = transversal(1000.0, 10.0, (0.0, -1e-3), (0.0, 1.0), (0.0, -0.1), (0.0, 0.0))
    np.testing.assert_allclose(force, (0.0, 2.0))


def test_transversal_never_pulls_to_a_surface_that_only_pushes():
    """A slanted projection may have its foot across a neck, and the hand above the tangent there."""
    above = (1000.0, 0.0, (0.02, 1e-3), (0.0, 1.0), (0.0, 0.0), (0.0, 0.0))
    np.testing.assert_allclose(transversal(*above, bilateral=False), (0.0, 0.0))
    np.testing.assert_allclose(transversal(*above), (0.0, -1.0))


@given(st.floats(1.0, 1e4), st.floats(0.0, 100.0), st.floats(0.0, 6.3))
def test_square_root_gives_the_linear_force_at_its_reference(k, d, angle):
    n = unit(angle)
    e = (-REFERENCE_DEPTH * n[0], -REFERENCE_DEPTH * n[1])
    r = (-REFERENCE_RATE * n[0], -REFERENCE_RATE * n[1])
    linear = pp_d(k, d, e, n, (0.0, 0.0), r)
    np.testing.assert_allclose(square_root(k, d, e, n, (0.0, 0.0), r), linear, rtol=1e-9, atol=1e-9)


def test_square_root_grows_with_the_root_and_is_odd_in_the_rate():
    def at(depth, rate):
        return square_root(1000.0, 10.0, (0.0, -depth), (0.0, 1.0), (0.0, 0.0), (0.0, -rate))[1]

    assert at(4e-3, 0.0) == pytest.approx(2.0 * at(1e-3, 0.0))
    assert at(1e-3, 0.4) - at(1e-3, 0.0) == pytest.approx(2.0 * (at(1e-3, 0.1) - at(1e-3, 0.0)))
    assert at(1e-3, -0.1) - at(1e-3, 0.0) == pytest.approx(-(at(1e-3, 0.1) - at(1e-3, 0.0)))
    assert at(0.0, 0.0) == 0.0


def test_laws_take_three_dimensions():
    e, n, v, r = (0.0, 0.0, -1e-3), (0.0, 0.0, 1.0), (0.1, 0.2, -0.3), (0.0, 0.0, -0.3)
    np.testing.assert_allclose(pp_pd(1000.0, 1.0, e, n, v, r), (0.0, 0.0, 1.3))
    np.testing.assert_allclose(transversal(1000.0, 1.0, e, n, v, r), (0.0, 0.0, 1.3))
    np.testing.assert_allclose(pp_v(1000.0, 1.0, e, n, v, r), (-0.1, -0.2, 1.3))
