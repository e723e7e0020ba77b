"""The projections by samples and bisection agree with the exact ones, which are computed another way."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.errors import RefusalError
from hapticeval.geometry.catalogue import cassinian, ellipse, line, star
from hapticeval.renderers import combescure, constraint, homothetic, minimum_distance
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play
from hapticeval.stimulus.experiments import build_path
from hapticeval.strategies.models import plane_models

FAMILIES = {
    "minimum-distance": minimum_distance,
    "constraint": constraint.variant(representation="curve"),
    "homothetic": homothetic,
    "combescure": combescure,
}
SLIDES = {
    "cassinian": (cassinian(size=0.2), {"kind": "scaled", "depth": 0.008, "from_angle": -40, "to_angle": 40}),
    "star": (star(size=0.2), {"kind": "corner", "corner": 1, "depth": 0.004, "before": 0.030, "after": 0.030}),
    "ellipse": (ellipse(ratio=2.0, size=0.2), {"kind": "scaled", "depth": 0.030, "from_angle": 10, "to_angle": 80}),
}
"""On the ellipse Combescure's level curves are no parallel ones any more: the hand is deep."""


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("model", SLIDES)
def test_a_hand_that_slides_is_led_to_the_same_places(name, model):
    shape, table = SLIDES[model]
    scene = Scene(model=shape)
    family = FAMILIES[name]
    path = build_path({**table, "duration": 0.4}, shape.boundary, None)
    exact, sampled = (play(made(scene), path, 1e-3) for made in (family, family.reference.with_knobs(samples=800)))
    assert np.any(np.linalg.norm(exact.force, axis=1) > 1.0), "in contact"
    np.testing.assert_allclose(sampled.ihip, exact.ihip, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(sampled.force, exact.force, rtol=1e-11, atol=1e-11)


@given(model=plane_models(), share=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)))
def test_the_nearest_of_the_samples_is_as_near_as_the_nearest_point(model, share):
    xmin, ymin, xmax, ymax = model.curve.bounds
    hip = np.array([0.5 * (xmin + xmax) + share[0] * (xmax - xmin), 0.5 * (ymin + ymax) + share[1] * (ymax - ymin)])
    scene = Scene(model=model)
    distances = []
    for factory in (minimum_distance, minimum_distance.reference.with_knobs(samples=400)):
        renderer = factory(scene)
        renderer.reset(hip)
        distances.append(float(np.linalg.norm(renderer.step(hip, np.zeros(2), 1e-3).ihip - hip)))
    assert distances[0] <= distances[1] + 1e-14 * model.size
    assert distances[1] == pytest.approx(distances[0], rel=1e-9, abs=1e-13 * model.size)


def test_a_line_without_end_is_not_sampled():
    with pytest.raises(RefusalError, match="only closed plane curves"):
        minimum_distance.reference(Scene(model=line()))
