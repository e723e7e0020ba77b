"""The minimum distance projection and its regulation schemes on solids."""

import math

import numpy as np
import pytest

from hapticeval.errors import RefusalError
from hapticeval.geometry.catalogue import ellipsoid, sphere, torus
from hapticeval.renderers import conformal, constraint, mapping, minimum_distance
from hapticeval.scene import Scene

MODELS = [sphere(), ellipsoid(), torus()]
every = pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)


def a_walk(n=2000, seed=1):
    """A smooth path in and out of every model."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 2.0 * math.pi, n)
    waves = [rng.normal(size=3) * np.sin(k * t[:, None] + rng.uniform(0.0, 6.0, 3)) for k in (1, 2, 3)]
    return 0.06 * np.sum(waves, axis=0)


@every
@pytest.mark.parametrize("bilateral", [False, True])
def test_it_is_the_nearest_point_of_the_surface(model, bilateral):
    hips = a_walk()
    renderer = minimum_distance(Scene(model=model, bilateral=bilateral))
    ihips, forces = renderer.run(hips, 1e-3)
    foot, _, distance, _ = model.surface.frame(hips)
    touches = bilateral | (distance < 0.0)
    assert 100 < np.count_nonzero(distance < 0.0) < 1900
    np.testing.assert_allclose(ihips[touches], foot[touches], atol=1e-16)
    np.testing.assert_array_equal(ihips[~touches], hips[~touches])
    np.testing.assert_array_equal(forces[~touches], 0.0)
    np.testing.assert_allclose(forces[touches], 1000.0 * (foot - hips)[touches], atol=1e-12)
    assert renderer.surface is model.surface
    assert renderer.resolution == renderer.standoff == 0.0


def test_pp_pd_on_the_sphere():
    # K_p = 1000 at 10 mm depth: 10 N outwards; inwards at 0.2 m/s against K_d = 5: 1 N more; along the surface nothing
    renderer = minimum_distance.variant(regulation="pp-pd")(Scene(model=sphere(), damping=5.0))
    renderer.reset(np.array([0.0, 0.09, 0.0]))
    ihip, force = renderer.step(np.array([0.0, 0.09, 0.0]), np.array([0.3, -0.2, 0.0]), 1e-3)
    np.testing.assert_allclose(ihip, [0.0, 0.1, 0.0], atol=1e-17)
    np.testing.assert_allclose(force, [0.0, 11.0, 0.0], atol=1e-12)


@every
@pytest.mark.parametrize(
    "factory",
    [
        constraint,
        constraint.variant(representation="curve"),
        mapping,
        conformal,
        minimum_distance.variant(representation="polygon"),
        minimum_distance.variant(representation="level-set"),
        minimum_distance.variant(representation="lut"),
    ],
)
def test_what_works_in_the_plane_only_refuses_solids(model, factory):
    with pytest.raises(RefusalError, match="surface in space"):
        factory(Scene(model=model))
