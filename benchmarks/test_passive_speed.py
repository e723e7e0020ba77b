"""What a step of homothetic and combescure costs, as a ratio to minimum distance on the same model, in one run."""

import time
from functools import partial

import numpy as np
import pytest

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import cassinian, dumbbell, ellipse, ellipsoid, icosphere, sphere, star
from hapticeval.scene import Scene
from hapticeval.simulation.playback import answers_along

MODELS = {
    each.name: each
    for each in (cassinian(), ellipse(), dumbbell(neck=0.9), star(), ellipsoid(), sphere(), icosphere(5))
}
MOST = {"homothetic": 1.3, "combescure": 4.0}
STEPS = 20_000


def path(dimension):
    """A way through 40 random points, in and out of the model."""
    knots = np.random.default_rng(0).uniform(-0.07, 0.07, (40, dimension))
    share = np.linspace(0.0, 39.0, STEPS)
    return np.column_stack([np.interp(share, np.arange(40), column) for column in knots.T])


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
@pytest.mark.parametrize("name", MOST)
@pytest.mark.benchmark(group="20,000 steps in one run, beside minimum distance")
def test_run(benchmark, name, model):
    hips = path(model.dimension)
    scene = Scene(model=model)
    runs = [partial(answers_along, resolve(renderer)(scene)) for renderer in (name, "minimum-distance+transversal")]
    times = np.empty((15, 2))
    for row in times:
        for column, run in enumerate(runs):
            start = time.process_time()
            run(hips, 1e-3)
            row[column] = time.process_time() - start
    here, there = times[1:].min(axis=0)
    benchmark.extra_info["us a step"] = round(here / STEPS * 1e6, 4)
    benchmark.extra_info["times minimum distance"] = round(here / there, 3)
    assert benchmark.disabled or here <= MOST[name] * there
    benchmark(runs[0], hips, 1e-3)
