"""What a step of the constraint renderer costs: by the number of edges, and by representation."""

import time

import numpy as np
import pytest

from hapticeval.geometry.catalogue import cassinian, from_vertices
from hapticeval.renderers import constraint, minimum_distance
from hapticeval.scene import Scene
from hapticeval.simulation.playback import answers_along

EDGES = (80, 800, 8_000, 80_000)
STEPS = 20_000
EDGES_A_STEP = 0.3


def wheel(edges):
    """A regular polygon of 0.2 m, and a hand led round below its edges, as far in edges each step at every size."""
    turns = 2.0 * np.pi * np.arange(edges) / edges
    model = from_vertices(0.1 * np.column_stack([np.cos(turns), np.sin(turns)]))
    depth = 0.1 * (2.0 * np.pi / edges) * 0.1
    path = 2.0 * np.pi / edges * EDGES_A_STEP * np.arange(STEPS)
    hips = (0.1 * np.cos(np.pi / edges) - depth) * np.column_stack([np.cos(path), np.sin(path)])
    return model, hips


def best(*runs, rounds=20):
    """The shortest of some rounds of each, s, in turns: what the machine's other work disturbs least."""
    times = np.empty((rounds, len(runs)))
    for i in range(rounds):
        for j, run in enumerate(runs):
            start = time.perf_counter()
            run()
            times[i, j] = time.perf_counter() - start
    return times.min(axis=0)


@pytest.mark.parametrize("edges", EDGES)
@pytest.mark.benchmark(group="constraint on a polygon, 20,000 steps in one run")
def test_run(benchmark, edges):
    model, hips = wheel(edges)
    renderer = constraint(Scene(model=model))
    forces = answers_along(renderer, hips, 1e-3).force
    assert np.all(np.any(forces != 0.0, axis=1))
    fewest, path = wheel(EDGES[0])
    smallest = constraint(Scene(model=fewest))
    here, there = best(lambda: answers_along(renderer, hips, 1e-3), lambda: answers_along(smallest, path, 1e-3))
    benchmark.extra_info["us a step"] = round(here / STEPS * 1e6, 4)
    benchmark.extra_info[f"times {EDGES[0]} edges"] = round(here / there, 3)
    benchmark(answers_along, renderer, hips, 1e-3)


@pytest.mark.parametrize("edges", EDGES)
@pytest.mark.benchmark(group="constraint on a polygon, one step from Python")
def test_step(benchmark, edges):
    model, hips = wheel(edges)
    renderer = constraint(Scene(model=model))
    velocity = np.zeros(2)
    renderer.reset(hips[0])
    ticks = iter(np.tile(hips, (50, 1)))

    def step():
        return renderer.step(next(ticks), velocity, 1e-3)

    benchmark.pedantic(step, rounds=STEPS, warmup_rounds=100)


on_each_representation = pytest.mark.parametrize(
    ("base", "representation"),
    [
        pytest.param(base, representation, id=f"{representation}-{name}")
        for name, base in (("minimum-distance", minimum_distance), ("constraint", constraint))
        for representation in ("curve", "polygon", "level-set")
        if representation in base.representations  # the constraint projection has no level set
    ],
)


@on_each_representation
@pytest.mark.benchmark(group="a slide along the Cassinian, 20,000 steps in one run")
def test_slide(benchmark, base, representation):
    model = cassinian()
    u = np.linspace(0.0, 2.0 * np.pi, STEPS)
    hips = model.curve.position(u) - 2e-3 * model.curve.normal(u)
    renderer = base.variant(representation=representation)(Scene(model=model))
    answers_along(renderer, hips, 1e-3)
    benchmark.extra_info["us a step"] = round(best(lambda: answers_along(renderer, hips, 1e-3))[0] / STEPS * 1e6, 4)
    benchmark(answers_along, renderer, hips, 1e-3)


@on_each_representation
@pytest.mark.benchmark(group="building a renderer of the Cassinian anew")
def test_build(benchmark, base, representation):
    base.variant(representation=representation)(Scene(model=cassinian()))
    benchmark(lambda: base.variant(representation=representation)(Scene(model=cassinian())))
