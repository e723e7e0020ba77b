"""The cone of true normals against what the surface says directly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import cassinian, circle, line, star
from hapticeval.phenomena.normal_cone import SAMPLES, NormalCone, angle_between, wrapped

CASSINIAN = cassinian().curve
CONES = {reach: NormalCone(CASSINIAN, reach) for reach in (1e-5, 1e-3, 1e-2)}


@given(u=st.floats(0.0, 6.283), reach=st.sampled_from(sorted(CONES)), tilt=st.floats(-1.5, 1.5))
@settings(max_examples=200)
def test_a_direction_is_outside_by_its_tilt_less_the_surface_s_own_turn(u, reach, tilt):
    cone = CONES[reach]
    normal = CASSINIAN.normal(u)
    turned = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]]) @ normal
    deviation = cone.deviation(np.atleast_2d(CASSINIAN.position(u)), turned[None])[0]
    s = CASSINIAN.arc_length(u)
    around = CASSINIAN.normal(CASSINIAN.parameter(np.linspace(s - reach, s + reach, 401)))
    exact = float(np.min(angle_between(around, turned)))
    if np.ptp(wrapped(np.arctan2(around[:, 1], around[:, 0]) - np.arctan2(normal[1], normal[0]))) > abs(tilt):
        exact = min(exact, deviation)  # between two samples of `around`
    # The window is rounded up by at most two grid cells, over which the surface turns by kappa ds.
    slack = 38.3 * 3.0 * max(CASSINIAN.length / SAMPLES, reach / 2)
    assert deviation <= exact + 1e-5
    assert deviation >= exact - slack


@given(k=st.integers(0, 9), share=st.floats(-0.5, 1.5))
def test_across_a_corner_every_direction_between_the_faces_normals_is_allowed(k, share):
    curve = star().curve
    corner = curve.corners[k]
    first = np.arctan2(corner.normal_pre[1], corner.normal_pre[0])
    angle = first + share * corner.turn
    direction = np.array([[np.cos(angle), np.sin(angle)]])
    deviation = NormalCone(curve, 1e-5).deviation(corner.position[None], direction)[0]
    outside = max(0.0, -share, share - 1.0) * abs(corner.turn)
    assert deviation == pytest.approx(outside, abs=1e-9)


def test_away_from_a_corner_only_the_face_s_normal_is_allowed():
    curve = star().curve
    corner = curve.corners[0]
    point = corner.position - 0.01 * corner.tangent_pre
    deviation = NormalCone(curve, 1e-3).deviation(point[None], corner.normal_post[None])[0]
    assert deviation == pytest.approx(corner.turn)


def test_the_plane_has_one_normal():
    cone = NormalCone(line().curve, 1e-3)
    deviation = cone.deviation(np.array([[5.0, 0.0], [0.0, 0.0]]), np.array([[0.0, 2.0], [1.0, 1.0]]))
    np.testing.assert_allclose(deviation, [0.0, np.pi / 4])


def test_the_seam_of_a_closed_curve_is_no_corner():
    curve = circle().curve
    points = curve.position(np.array([0.0, 1e-9, 2 * np.pi - 1e-9]))
    deviation = NormalCone(curve, 1e-4).deviation(points, points)
    np.testing.assert_allclose(deviation, 0.0, atol=1e-12)
