"""Closed forms against the golden numbers of the circle and the line, and against each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hapticeval.closed_forms import CLOSED_FORMS, SOLVED_LAWS, Gains, integrate_rates, polar_rates, transversal_motion
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import cassinian, circle, line, star
from hapticeval.scene import Scene

GAINS = Gains(500.0, 44.7, 0.0)
UNIT = {"stiffness": 500.0, "damping": 44.7, "mass": 1.0, "bilateral": True}
LINE = Scene(model=line(), **UNIT)
CIRCLE = Scene(model=circle(size=2.0), **UNIT)

# (r, theta, theta') on the unit circle from (1, 0) at 5 m/s along it, integrated in polar and Cartesian coordinates.
ORBITS = {
    "6.24": {
        0.5: (1.01038366961, 2.28837605467, 4.89775850843),
        1.0: (1.03659881413, 4.58213776035, 4.65316645949),
        2.0: (1.08555264719, 9.19127593966, 4.24295301785),
        5.0: (1.01047642935, 22.9808647686, 4.89685934056),
    },
    "6.25": {
        0.5: (1.00000247881, 0.111444857817, 9.82847598e-10),
        1.0: (1.00000000007, 0.111444857839, 1.932e-19),
        2.0: (1.0, 0.111444857839, 0.0),
        5.0: (1.0, 0.111444857839, 0.0),
    },
    "6.27": {
        0.5: (1.01838386010, 1.83829638290, 2.76900536881),
        1.0: (1.00974724552, 3.03451917324, 2.10908253071),
        2.0: (1.00512900582, 4.82991107636, 1.56418627201),
        5.0: (1.00214182429, 8.54344741409, 1.02485435896),
    },
    "6.26": {
        0.5: (1.04394916959, 2.32569936046, 4.58787205567),
        1.0: (1.04394748684, 4.61964211872, 4.58788684620),
        2.0: (1.04394748686, 9.20752896473, 4.58788684601),
        5.0: (1.04394748686, 22.9711895028, 4.58788684601),
    },
    "7.38": {t: (1.0, 5.0 * t, 5.0) for t in (0.5, 1.0, 2.0, 5.0)},
}


def orbit(name, time, *, position=(1.0, 0.0), velocity=(0.0, 5.0), scene=CIRCLE):
    return CLOSED_FORMS[name].motion(scene, np.array(position), np.array(velocity), np.asarray(time, dtype=float))


@pytest.mark.parametrize("name", ORBITS)
def test_orbits_have_the_golden_numbers(name):
    time = np.array([0.0, *ORBITS[name]])
    hip, velocity = orbit(name, time)
    r = np.linalg.norm(hip, axis=1)
    rate = (hip[:, 0] * velocity[:, 1] - hip[:, 1] * velocity[:, 0]) / r**2
    for row, (radius, angle, turning) in enumerate(ORBITS[name].values(), start=1):
        assert r[row] == pytest.approx(radius, abs=1e-11)
        np.testing.assert_allclose(hip[row], radius * np.array([np.cos(angle), np.sin(angle)]), atol=2e-10)
        assert rate[row] == pytest.approx(turning, abs=1e-10)


@pytest.mark.parametrize(
    ("name", "turning", "time"),
    [
        ("6.25", 2.5, 0.01543798),
        ("6.25", 0.5, 0.05131752),
        ("6.27", 2.5, 0.65461759),
        ("6.27", 1.0, 5.26574654),
    ],
)
def test_the_times_at_which_the_damped_schemes_have_slowed_down(name, turning, time):
    hip, velocity = orbit(name, [0.0, time])
    assert (hip[1, 0] * velocity[1, 1] - hip[1, 1] * velocity[1, 0]) / (hip[1] @ hip[1]) == pytest.approx(
        turning, abs=1e-6
    )


def test_undamped_it_swings_between_the_golden_radii_in_the_golden_period():
    period = 0.2647139356862292
    hip, velocity = orbit("6.24", [0.0, period / 2.0, period])
    np.testing.assert_allclose(np.linalg.norm(hip, axis=1), [1.0, 1.088173901269847, 1.0], atol=1e-12)
    assert np.arctan2(hip[2, 1], hip[2, 0]) == pytest.approx(1.2172446581277, abs=1e-12)
    assert np.linalg.norm(velocity[1]) / 1.088173901269847 == pytest.approx(4.22253631349, abs=1e-11)


def test_transversal_damping_leaves_the_golden_standing_radius():
    hip, velocity = orbit("6.26", [0.0, 5.0])
    assert np.linalg.norm(hip[1]) == pytest.approx(1.043947486858864, abs=1e-13)
    assert np.linalg.norm(velocity[1]) == pytest.approx(4.789512942882318, abs=1e-12)


def test_angular_momentum_decays_exactly_under_damping_of_all_motion():
    time = np.linspace(0.0, 0.3, 31)
    hip, velocity = orbit("6.25", time)
    momentum = hip[:, 0] * velocity[:, 1] - hip[:, 1] * velocity[:, 0]
    np.testing.assert_allclose(momentum, 5.0 * np.exp(-44.7 * time), atol=1e-12)


@pytest.mark.parametrize("name", ["6.24", "6.25", "6.26", "6.27", "7.38"])
def test_a_tenth_of_the_circle_at_a_tenth_of_the_speed_is_a_tenth_of_the_orbit(name):
    small = Scene(model=circle(size=0.2), **UNIT)
    time = np.linspace(0.0, 1.0, 5)
    tenth = orbit(name, time, position=(0.1, 0.0), velocity=(0.0, 0.5), scene=small)
    np.testing.assert_allclose(tenth.hip, 0.1 * orbit(name, time).hip, atol=1e-13)


def test_set_stabilisation_brings_the_tool_home_as_the_golden_numbers_say():
    found, _ = transversal_motion(GAINS, "set-stabilisation", 0.1, 0.0, np.array([0.05, 0.1, 0.2]))
    np.testing.assert_allclose(found, [0.069235893235141, 0.034567393786025, 0.0062344935637], atol=1e-14)


# (y1, y2, y2') from (-1, 0) at (3, 10); for (6.20) y1' in the last place.
LINES = {
    "6.19": [
        (0.1, -0.7, 0.3518449078757, -6.1727287645717),
        (0.5, 0.5, -0.43960172525948, 1.8371612815547),
        (1.0, 2.0, -0.16152385379027, -9.3249676851113),
    ],
    "6.21": [
        (0.1, -0.7, 0.10690700227652, -1.3220036231581),
        (0.5, 0.5, 6.8715367402718e-5, -1.4038703463303e-3),
        (1.0, 2.0, 1.8129603495158e-9, -3.9004890934e-8),
    ],
    "6.20": [
        (0.1, -0.93365418227185, 0.10690700227652, 0.034341947551517),
        (0.5, -0.93288590605346, 6.8715367402718e-5, 5.8971148e-10),
        (1.0, -0.93288590604027, 1.8129603495158e-9, 1.159e-19),
    ],
}
LINES["7.28"] = LINES["6.21"]


@pytest.mark.parametrize("name", LINES)
def test_motion_about_the_line_has_the_golden_numbers(name):
    time = np.array([0.0, *(row[0] for row in LINES[name])])
    hip, velocity = CLOSED_FORMS[name].motion(LINE, np.array([-1.0, 0.0]), np.array([3.0, 10.0]), time)
    for row, (_, y1, y2, last) in enumerate(LINES[name], start=1):
        np.testing.assert_allclose(hip[row], [y1, y2], atol=1e-13)
        if name == "6.20":
            assert velocity[row, 0] == pytest.approx(last, rel=1e-7)
        else:
            np.testing.assert_allclose(velocity[row], [3.0, last], atol=1e-12)


@pytest.mark.parametrize(("k", "d"), [(500.0, 44.7), (500.0, 2.0 * np.sqrt(500.0)), (500.0, 90.0), (500.0, 0.0)])
def test_the_transversal_formula_solves_its_equation_under_over_and_critically_damped(k, d):
    time = np.linspace(0.0, 0.4, 9)
    n, rate = transversal_motion(Gains(k, d, 0.0), "pp-pd", 0.03, -2.0, time)
    by_steps = integrate_rates(lambda t, y: (y[1], -k * y[0] - d * y[1]), (0.03, -2.0), time)
    np.testing.assert_allclose(np.array([n, rate]), by_steps, atol=1e-12)


@pytest.mark.parametrize("scheme", [scheme for scheme in SOLVED_LAWS if scheme != "pp-pd-c"])
def test_the_curve_s_own_frame_and_polar_coordinates_agree_on_a_circle(scheme):
    number = {"pp": "6.24", "pp-v": "6.25", "pp-pd": "6.26", "pp-d": "6.27", "set-stabilisation": "7.38"}[scheme]
    time = np.linspace(0.0, 0.5, 11)
    start = {"position": (0.9, 0.2), "velocity": (0.4, 3.0)}
    polar, framed = orbit(number, time, **start), orbit(f"{scheme}-on-curve", time, **start)
    np.testing.assert_allclose(framed.hip, polar.hip, atol=1e-11)
    np.testing.assert_allclose(framed.velocity, polar.velocity, atol=1e-10)


def cartesian(scheme, curve, k, d):
    """The same law without any coordinates of the curve: m y'' is the scheme's force as section 4.2 has it."""

    def rates(time, state):
        frame = curve.closest_point(state[np.newaxis, :2])
        normal, n, velocity = frame.normal[0], frame.distance[0], state[2:]
        across = normal * (normal @ velocity)
        foot_rate = np.linalg.solve(np.eye(2) + n * frame.shape[0], velocity - across)
        damped = {"pp": 0.0 * velocity, "pp-v": velocity, "pp-d": velocity - foot_rate}.get(scheme, across)
        given = (velocity @ frame.shape[0] @ velocity) * normal if scheme == "pp-pd-c" else 0.0
        return [*velocity, *(-k * n * normal - d * damped - given)]

    return rates


@pytest.mark.parametrize("scheme", [scheme for scheme in SOLVED_LAWS if scheme != "set-stabilisation"])
def test_on_the_cassinian_they_solve_the_force_laws_themselves(scheme):
    model = cassinian(size=2.0)
    scene = Scene(model=model, **UNIT)
    time = np.linspace(0.0, 0.4, 9)
    position, velocity = np.array([1.02, 0.05]), np.array([0.3, 2.0])
    form = CLOSED_FORMS[f"{scheme}-on-curve"].motion(scene, position, velocity, time)
    plain = integrate_rates(cartesian(scheme, model.curve, 500.0, 44.7), (*position, *velocity), time)
    np.testing.assert_allclose(form.hip, plain[:2].T, atol=1e-10)
    np.testing.assert_allclose(form.velocity, plain[2:].T, atol=1e-9)


@example(angle=1.6319836437287203e-11, offset=0.25, across=0.0, along=0.0)
@given(angle=st.floats(0.0, 6.28), offset=st.floats(-0.2, 0.3), across=st.floats(-2.0, 2.0), along=st.floats(-3.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_a_closed_form_starts_where_it_is_told_with_the_speed_it_is_told(angle, offset, across, along):
    model = cassinian(size=2.0)
    scene = Scene(model=model, **UNIT, effects=(Viscosity(0.5),))
    u = np.array([angle])
    normal, tangent = model.curve.normal(u)[0], model.curve.tangent(u)[0]
    position = model.curve.position(u)[0] + 0.3 * offset * normal
    velocity = across * normal + along * tangent
    for scheme in SOLVED_LAWS:
        motion = CLOSED_FORMS[f"{scheme}-on-curve"].motion(scene, position, velocity, np.array([0.0, 1e-6]))
        np.testing.assert_allclose(motion.hip[0], position, atol=1e-12)
        np.testing.assert_allclose(motion.velocity[0], velocity, atol=1e-11)


def test_viscosity_slows_the_sliding_and_nothing_else():
    scene = Scene(model=circle(size=2.0), **UNIT, effects=(Viscosity(0.7),))
    time = np.linspace(0.0, 2.0, 5)
    viscous, free = orbit("7.38", time, position=(1.1, 0.0), scene=scene), orbit("7.38", time, position=(1.1, 0.0))
    np.testing.assert_allclose(np.linalg.norm(viscous.hip, axis=1), np.linalg.norm(free.hip, axis=1), atol=1e-14)
    angle = np.unwrap(np.arctan2(viscous.hip[:, 1], viscous.hip[:, 0]))
    np.testing.assert_allclose(angle, 5.0 / 1.1 / 0.7 * (1.0 - np.exp(-0.7 * time)), atol=1e-12)


def test_polar_rates_are_those_of_table_6_2():
    r, r_rate, rate = 1.2, -0.3, 4.0
    state = np.array([r, r_rate, 0.7, rate])
    found = {scheme: polar_rates(scheme, GAINS, 1.0)(0.0, state)[1::2] for scheme in SOLVED_LAWS}
    spring = -500.0 * (r - 1.0)
    assert found["pp"] == pytest.approx((spring + r * rate**2, -2.0 * r_rate * rate / r))
    assert found["pp-v"] == pytest.approx((spring + r * rate**2 - 44.7 * r_rate, -(2.0 * r_rate + 44.7 * r) * rate / r))
    assert found["pp-pd"] == pytest.approx((spring + r * rate**2 - 44.7 * r_rate, -2.0 * r_rate * rate / r))
    assert found["pp-d"] == pytest.approx(
        (spring + r * rate**2 - 44.7 * r_rate, -(2.0 * r_rate + 44.7 * (r - 1.0)) * rate / r)
    )
    assert found["pp-pd-c"] == pytest.approx((found["pp-pd"][0] - (r * rate) ** 2, found["pp-pd"][1]))
    assert found["set-stabilisation"] == pytest.approx((spring - 44.7 * r_rate, 0.0))


@pytest.mark.parametrize(
    ("name", "scene"),
    [
        ("6.24", LINE),
        ("6.19", CIRCLE),
        ("pp-on-curve", Scene(model=star(), bilateral=True)),
        ("7.38", Scene(model=circle())),
    ],
)
def test_a_scene_that_a_form_is_not_about_is_refused(refused, name, scene):
    with refused(InputError):
        CLOSED_FORMS[name].check(scene)
