"""A hand that is led round a circle in space: square to its axis, over the same points lap after lap."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hapticeval.documents import convert
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import sphere
from hapticeval.stimulus.paths import Loop

HALF = {"start": [0.0, 0.0, 0.11], "centre": [0.0, 0.0, 0.09], "radius": 0.005, "laps": 2, "lap": 0.1, "approach": 0.1}

vectors = st.tuples(*[st.integers(-3, 3)] * 3)


@given(vectors, vectors)
def test_its_points_are_square_to_the_axis_and_as_far_from_the_centre(axis, away):
    centre = np.array(HALF["centre"])
    assume(np.linalg.norm(np.cross(axis, away)) > 0.0)
    start = (centre + 0.02 * np.array(away)).tolist()
    path = convert(HALF | {"axis": list(axis), "start": start}, Loop, "loop").path(sphere().boundary, FilePath())
    offset = path.points[1:-1] - centre
    np.testing.assert_allclose(offset @ np.array(axis), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), HALF["radius"], rtol=1e-12)
    np.testing.assert_array_equal(path.points[[0, -1]], [start, start])
    # Anticlockwise seen from where the axis points, and as often back.
    turned = np.cross(offset[:-1], offset[1:]) @ np.array(axis)
    half = turned.size // 2
    assert np.all(turned[:half] > 0.0)
    assert np.all(turned[half:] < 0.0)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"axis": [0.0, 1.0]},
        {"axis": [0.0, 0.0, 1.0]},
        {"axis": [0.0, 1.0, 0.0], "radius": 0.03},
        {"start": [0.0, 0.1], "centre": [0.0, 0.0], "axis": [0.0, 1.0]},
    ],
)
def test_a_circle_that_is_none_is_refused(refused, change):
    with refused(InputError):
        convert(HALF | change, Loop, "loop").path(sphere().boundary, FilePath())
