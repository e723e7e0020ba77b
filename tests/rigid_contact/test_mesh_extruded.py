"""Extruded, a plane case is a case in space: the ideal contact moves there as in the plane, and freely along z."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hapticeval.geometry import solids
from hapticeval.geometry.mesh import Mesh
from hapticeval.geometry.model import Model
from hapticeval.rigid_contact import ideal
from hapticeval.stimulus.stimulus import Experiment, Hand, Path
from hapticeval.suite.reading import load_suite

PACE = 0.02
"""Speed along z, m/s."""

LENGTH, HALF_PLANE = 20.0, 3.0
"""Length of an extruded model, and half the side of the square that stands for a half-plane, m."""


def outline_of(model):
    """The corners of a plane model of straight edges; None where it has others."""
    curve = model.curve
    if curve.closed:
        return model.polygon().vertices if curve.straight else None
    start, end = curve.position(np.array([-HALF_PLANE, HALF_PLANE]))
    inward = -2.0 * HALF_PLANE * curve.normal(0.0)
    return np.array([start, end, end + inward, start + inward])


STARTS_INSIDE = ("star-tip", "star-tip-robot")
"""Cases of renderers that let the hand in: the ideal contact refuses them in the plane already."""


def straight_cases():
    """The unilateral cases with a plane model of straight edges, and their suite."""
    for suite in ("thesis", "generated", "dynamics-unilateral", "hard-cases-loops"):
        for case in load_suite(suite).cases:
            scene = case.build_scene()
            if scene.model.dimension == 3 or scene.bilateral or outline_of(scene.model) is None:
                continue
            if case.name not in STARTS_INSIDE:
                yield pytest.param(case, id=f"{suite}-{case.name}")


def extruded(scene, stimulus, turn, shift):
    """The scene and its stimulus in space, along z at PACE, then turned and shifted."""

    def lifted(points, heights):
        return np.column_stack([points, np.broadcast_to(heights, len(points))]) @ turn.T

    def lifted_path(path):
        return Path(path.time, lifted(path.points, PACE * (path.time - path.time[0])) + shift)

    vertices, triangles = solids.prism(outline_of(scene.model), LENGTH)
    model = Model("extruded", {}, Mesh("extruded", vertices @ turn.T + shift, triangles))
    scene = replace(scene, model=model, device=None)
    if isinstance(stimulus, Path):
        return scene, lifted_path(stimulus)
    hand = stimulus.hand
    if hand is not None:
        hand = Hand(path=lifted_path(hand.path), stiffness=hand.stiffness, damping=hand.damping)
    position, velocity = lifted(stimulus.position[np.newaxis], 0.0)[0], lifted(stimulus.velocity[np.newaxis], PACE)[0]
    forces = lifted(stimulus.force, 0.0)
    return scene, Experiment(stimulus.duration, position + shift, velocity, stimulus.force_time, forces, hand)


MOTIONS = {
    "as-it-is": (np.eye(3), np.zeros(3)),
    "moved": (Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix(), np.array([0.1, -0.2, 0.3])),
}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("case", list(straight_cases()))
def test_a_plane_case_extruded_moves_as_in_the_plane(case, motion):
    scene = case.build_scene()
    plane = ideal(scene)
    stimulus = case.build_stimulus(scene, plane)
    flat = plane.simulate(stimulus, scene.sampling_time)
    turn, shift = MOTIONS[motion]
    in_space, stimulus_in_space = extruded(scene, stimulus, turn, shift)
    recording = ideal(in_space).simulate(stimulus_in_space, scene.sampling_time)
    place, force = (recording.hip - shift) @ turn, recording.force @ turn
    np.testing.assert_allclose(place[:, :2], flat.hip, rtol=0.0, atol=1e-9 * scene.model.size)
    np.testing.assert_allclose(force[:, :2], flat.force, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(force[:, 2], 0.0, atol=1e-9)
    # free along z: no force, a start with the motion itself; a spring that starts at rest, or stops, draws it later
    is_free = not isinstance(stimulus, Path) and stimulus.hand is None
    if is_free or (isinstance(stimulus, Path) and scene.model.curve.signed_distance(stimulus.points[:1])[0] > 0.0):
        np.testing.assert_allclose(place[:, 2], PACE * recording.time, rtol=0.0, atol=1e-9 * scene.model.size)
