"""Drawn paths on a dumbbell, where two renderers showed what hand-made paths had not."""

from __future__ import annotations

import numpy as np

from hapticeval.discovery import resolve
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite

CASE = load_suite("generated").case("dumbbell-hand")


def test_a_foot_across_the_neck_draws_no_hand_inwards():
    """At 11.721 s the hand is 1.3 mm above the tangent at the foot of `conformal`, on the fillet across the neck."""
    scene = CASE.build_scene()
    recording = judge(resolve("conformal"), "conformal", "generated", CASE).recording
    at = np.flatnonzero(np.any(recording.ihip != recording.hip, axis=1))
    normal = scene.model.boundary.closest_point(recording.ihip[at]).normal
    above = np.sum(normal * (recording.hip[at] - recording.ihip[at]), axis=1)
    assert above.max() > 1e-3
    assert np.sum(normal * recording.force[at], axis=1).min() >= 0.0
    assert not recording.force[at][above > 1e-9].any()
