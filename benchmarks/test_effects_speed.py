"""What effects cost in closed loop on the robot at 1 kHz, and what a scene pays that does not call for them: nothing.

Times are of the loop alone, of this thread, the shortest of many, in turns: see `best`.
"""

import time
from dataclasses import replace

import numba
import numpy as np
import pytest

from hapticeval.compiled import specialised
from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import make_effect
from hapticeval.geometry.catalogue import make_model
from hapticeval.laws import law_value
from hapticeval.renderer import wrapped
from hapticeval.scene import Scene
from hapticeval.simulation import kernels
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import loop_of
from hapticeval.stimulus.stimulus import Experiment, Hand, Path

DT, SECONDS = 1e-3, 2.0
ROUNDS = 30
SURFACE = (
    {"kind": "stochastic-texture", "texture": "gritty", "mass": 0.05},
    {"kind": "friction", "mu_s": 0.5, "mu_k": 0.3},
    {"kind": "contact-transient", "material": "wood"},
)
"""A texture, friction and a transient."""

PLAIN = Scene(model=make_model("circle", size=0.1), device=Parallelogram2())
ALL = replace(PLAIN, effects=tuple(make_effect(entry) for entry in SURFACE))
TEXTURED = replace(PLAIN, effects=ALL.effects[:1])


def rubbing(seconds=SECONDS):
    """A hand that comes down on a circle, rubs along it to and fro, and leaves."""
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    points = np.column_stack([0.02 * np.sin(3.0 * turn), 0.07 - 0.024 * np.minimum(2.0 - 2.0 * np.cos(turn), 1.0)])
    grip = Hand(path=Path(np.linspace(0.0, seconds, turn.size), points), stiffness=300.0, damping=5.0)
    return Experiment(seconds, points[0], np.zeros(2), np.zeros(1), np.zeros((1, 2)), grip)


def loop_run(renderer, scene, experiment):
    """A closed loop that is ready: each call runs it from its start, and returns seconds and the forces."""
    law = wrapped(renderer).law
    value = law_value(law.function, law.data)
    run = specialised(kernels.run, value, law.data, loop_of(experiment, scene, DT))

    def once():
        loop = loop_of(experiment, scene, DT)
        renderer.reset(loop.out.measured_hip[0])
        began = time.thread_time()
        ticks, status, _number = run(value, law.data, loop)
        took = time.thread_time() - began
        assert (ticks, status) == (loop.out.hip.shape[0], kernels.DONE)
        return took, loop.out.force

    return once


def best(*runs, rounds=ROUNDS):
    """The shortest of some rounds of each, s, in turns."""
    return np.min([[run()[0] for run in runs] for _ in range(rounds)], axis=0)


@pytest.mark.benchmark(group="effects")
def test_a_scene_without_effects_is_as_fast_as_the_renderer_itself(benchmark):
    """Against what the renderer's factory makes, which knows of no effect; the allowed ratio is that of the noise."""
    factory = resolve("minimum-distance")
    bare, machinery = (
        loop_run(make(PLAIN), PLAIN, rubbing()) for make in (factory, lambda scene: make_renderer(factory, scene))
    )
    assert np.array_equal(bare()[1], machinery()[1])
    before, now = best(bare, machinery)
    benchmark.extra_info["ratio"] = round(now / before, 4)
    benchmark(machinery)
    assert benchmark.disabled or now <= 1.02 * before


@pytest.mark.benchmark(group="effects")
def test_texture_friction_and_a_transient_on_the_robot_run_a_hundred_times_real_time(benchmark):
    run, plain = (
        loop_run(make_renderer(resolve("minimum-distance"), scene), scene, rubbing()) for scene in (ALL, PLAIN)
    )
    forces = run()[1]
    assert np.abs(forces).max() > 1.0
    took, without = best(run, plain)
    benchmark.extra_info["times real time"] = round(SECONDS / took)
    benchmark.extra_info["ns a tick, with and without"] = [
        round(1e9 * DT * seconds / SECONDS) for seconds in (took, without)
    ]
    benchmark(run)
    assert benchmark.disabled or took < SECONDS / 100.0


@pytest.mark.benchmark(group="effects")
@pytest.mark.slow
def test_of_a_thousand_contacts_ten_are_textured_and_ten_are_paid_for(benchmark):
    """A contact is a scene of its own. What 10 of 1,000 add is 10 times what one adds, to the noise of all."""
    textured, plain = (
        loop_run(make_renderer(resolve("minimum-distance"), scene), scene, rubbing(0.2)) for scene in (TEXTURED, PLAIN)
    )
    with_, without = best(textured, plain, rounds=200)

    def contact(k, count):
        """The seconds of the k-th of 1,000 contacts, of which every 1,000 / `count`-th is textured."""
        return (textured if count and k % (1000 // count) == 0 else plain)()[0]

    rounds = [[[contact(k, count) for count in (0, 10, 1000)] for k in range(1000)] for _ in range(3)]
    none, ten, thousand = np.sum(np.min(rounds, axis=0), axis=0)
    benchmark.extra_info["none, 10, 1000 textured, ms"] = [round(1e3 * seconds, 2) for seconds in (none, ten, thousand)]
    benchmark.extra_info["a textured contact adds, us"] = round(1e6 * (with_ - without), 2)
    benchmark(textured)
    assert benchmark.disabled or ten - none < 0.01 * none + 0.02 * (thousand - none)


@pytest.mark.benchmark(group="effects")
def test_the_loop_of_a_combination_compiles_within_ten_seconds(benchmark):
    """Without any cache of its own; what it calls is compiled already, for other combinations call it too."""
    law = wrapped(make_renderer(resolve("minimum-distance"), ALL)).law
    value = law_value(law.function, law.data)
    argument_types = tuple(numba.typeof(argument) for argument in (value, law.data, loop_of(rubbing(), ALL, DT)))

    def compile_():
        numba.njit(error_model="numpy", _nrt=False)(kernels.run.py_func).compile(argument_types)

    began = time.process_time()
    benchmark.pedantic(compile_, rounds=1)
    assert benchmark.disabled or time.process_time() - began < 10.0
