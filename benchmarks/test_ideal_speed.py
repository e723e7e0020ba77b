"""The ideal rigid contact on meshes of 80 to 81,920 triangles, warm: how much faster than real time, in CPU seconds.

`extra_info` holds that, the events, and the cost of a step beside that of the same step on the coarsest mesh. Away from
events the cost must not depend on the number of triangles; led over the surface, the tool meets an edge each time that
the mesh has one.
"""

import time
from functools import cache

import numpy as np
import pytest

from hapticeval.geometry.catalogue import make_model
from hapticeval.rigid_contact import ideal
from hapticeval.scene import Scene
from hapticeval.stimulus.stimulus import Path

SUBDIVISIONS, DT, SECONDS = (1, 3, 6), 1e-3, 5.0
RADII = {"away": 0.12, "near": 0.1005, "led": 0.09}
"""Radius (m) of the hand's circle round a sphere of 0.1 m: far from it, half a millimetre off it, and inside."""
REAL_TIMES, MOST_GROWTH = 50.0, 1.5
cost: dict[tuple[str, int], float] = {}


@cache
def contact(subdivisions: int):
    return ideal(Scene(model=make_model("icosphere", subdivisions=subdivisions, size=0.2), mass=0.1))


@pytest.mark.parametrize("subdivisions", SUBDIVISIONS)
@pytest.mark.parametrize("where", RADII)
def test_ideal_on_icospheres(benchmark, where, subdivisions):
    benchmark.group = f"ideal contact, {where}"
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    points = RADII[where] * np.column_stack([np.cos(turn), np.sin(turn), np.full(turn.size, 0.1)])
    path = Path(SECONDS * turn / turn[-1], points)
    seconds = []

    def play():
        began = time.process_time()
        recording = contact(subdivisions).simulate(path, DT)
        seconds.append(time.process_time() - began)
        return recording

    recording = benchmark.pedantic(play, rounds=5, warmup_rounds=1)
    cost[where, subdivisions] = min(seconds) / len(recording)
    growth = cost[where, subdivisions] / cost.get((where, SUBDIVISIONS[0]), cost[where, subdivisions])
    benchmark.extra_info["times real time"] = SECONDS / min(seconds)
    benchmark.extra_info["events"] = len(recording.meta["events"])
    benchmark.extra_info["cost of a step beside the coarsest mesh's"] = growth
    assert benchmark.disabled or SECONDS / min(seconds) > REAL_TIMES
    assert benchmark.disabled or where == "led" or growth < MOST_GROWTH
