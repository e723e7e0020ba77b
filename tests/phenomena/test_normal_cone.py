"""The cone of true normals against what the surface says directly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticeval.geometry.catalogue import cassinian, circle, dumbbell, line, star
from hapticeval.geometry.kernels import U0
from hapticeval.phenomena.normal_cone import NormalCone, angle_between, wrapped

CASSINIAN = cassinian().curve
CONE = NormalCone(CASSINIAN)


@given(u=st.floats(0.0, 6.283), reach=st.sampled_from([1e-5, 1e-3, 1e-2]), tilt=st.floats(-1.5, 1.5))
@settings(max_examples=200)
def test_a_direction_is_outside_by_its_tilt_less_the_surface_s_own_turn(u, reach, tilt):
    normal = CASSINIAN.normal(u)
    turned = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]]) @ normal
    deviation = CONE.deviation(np.atleast_2d(CASSINIAN.position(u)), turned[None], np.array([reach]))[0]
    s = CASSINIAN.arc_length(u)
    around = CASSINIAN.normal(CASSINIAN.parameter(np.linspace(s - reach, s + reach, 401)))
    exact = float(np.min(angle_between(around, turned)))
    if np.ptp(wrapped(np.arctan2(around[:, 1], around[:, 0]) - np.arctan2(normal[1], normal[0]))) > abs(tilt):
        exact = min(exact, deviation)  # between two samples of `around`
    # Between two of the 401 samples the surface turns by kappa ds at the most.
    assert deviation == pytest.approx(exact, abs=1e-5 + 38.3 * reach / 200)


DUMBBELLS = {neck: dumbbell(neck=neck).curve for neck in (0.1, 0.3, 0.5)}


@given(
    neck=st.sampled_from(sorted(DUMBBELLS)), k=st.integers(0, 7), off=st.floats(-1e-4, 1e-4), reach=st.floats(0, 1e-3)
)
@settings(max_examples=100)
def test_the_normal_of_the_point_itself_is_allowed_at_a_joint_of_arcs_too(neck, k, off, reach):
    """There the turning changes its sense, so that the normal has an extreme between any two samples."""
    curve = DUMBBELLS[neck]
    u = curve.parameter(curve.arc_length(curve.pieces[k, U0]) + off)
    at = np.atleast_2d(curve.position(u))
    deviation = NormalCone(curve).deviation(at, np.atleast_2d(curve.normal(u)), np.array([reach]))
    assert deviation[0] <= 1e-9


@given(k=st.integers(0, 9), share=st.floats(-0.5, 1.5))
def test_across_a_corner_every_direction_between_the_faces_normals_is_allowed(k, share):
    curve = star().curve
    corner = curve.corners[k]
    first = np.arctan2(corner.normal_pre[1], corner.normal_pre[0])
    angle = first + share * corner.turn
    direction = np.array([[np.cos(angle), np.sin(angle)]])
    deviation = NormalCone(curve).deviation(corner.position[None], direction, np.array([1e-5]))[0]
    outside = max(0.0, -share, share - 1.0) * abs(corner.turn)
    assert deviation == pytest.approx(outside, abs=1e-9)


def test_away_from_a_corner_only_the_face_s_normal_is_allowed():
    curve = star().curve
    corner = curve.corners[0]
    point = corner.position - 0.01 * corner.tangent_pre
    deviation = NormalCone(curve).deviation(point[None], corner.normal_post[None], np.array([1e-3]))[0]
    assert deviation == pytest.approx(corner.turn)


def test_the_plane_has_one_normal():
    cone, reach = NormalCone(line().curve), np.full(2, 1e-3)
    deviation = cone.deviation(np.array([[5.0, 0.0], [0.0, 0.0]]), np.array([[0.0, 2.0], [1.0, 1.0]]), reach)
    np.testing.assert_allclose(deviation, [0.0, np.pi / 4])


def test_the_seam_of_a_closed_curve_is_no_corner():
    curve = circle().curve
    points = curve.position(np.array([0.0, 1e-9, 2 * np.pi - 1e-9]))
    deviation = NormalCone(curve).deviation(points, points, np.full(3, 1e-4))
    np.testing.assert_allclose(deviation, 0.0, atol=1e-12)
