"""A library led along a path, beside a loop in C over the same ticks: what it costs to be asked from here.

`extra_info` holds the ratio of both in one run, and the nanoseconds of a tick more. On a ball of 5,120 triangles, where
a tick takes 20 us, a path may take `ALLOWED` times as long. A tick among the 12 triangles of a cube takes 10 to 30 ns
in C, which is less than it takes to note what is asked: there only the difference says something.
"""

import ctypes
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from hapticeval.adapters.library import HEADER
from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import make_model
from hapticeval.recordings.recording import path_velocities
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import Rows, Ticks, lead_on

ALLOWED = 1.1
DT = 1e-3
EXAMPLES = Path(__file__).parents[1] / "examples"
LOOP = """
#include "hapticeval.h"
void bare(void *self, uint32_t n, uint32_t size, const double *h, const double *v, double dt, double *s, double *f) {
  for (uint32_t k = 0; k < n * size; k += size) hr_step(self, h + k, v + k, dt, s + k, f + k);
}
"""


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    """The examples, each with a loop over its own step."""
    folder = tmp_path_factory.mktemp("libraries")
    found = {}
    for name, compiler, source in (("penalty", "cc", "c/penalty.c"), ("god_object", "c++", "cpp/god_object.cpp")):
        if shutil.which(compiler) is None:
            pytest.skip(f"no {compiler}")
        code, found[name] = folder / Path(source).name, folder / f"lib{name}.so"
        code.write_text((EXAMPLES / source).read_text() + (LOOP if compiler == "cc" else f'extern "C" {{{LOOP}}}'))
        flags = ["-O2", "-shared", "-fPIC", f"-I{HEADER.parent}", "-o", str(found[name]), str(code), "-lm"]
        subprocess.run([compiler, *flags], check=True)
    return found


@pytest.mark.parametrize(("kind", "count"), [("sphere", 2_000), ("cube", 20_000)])
@pytest.mark.parametrize("name", ["penalty", "god_object"])
@pytest.mark.benchmark(group="a library along a path, beside a loop in C")
def test_led(benchmark, libraries, name, kind, count):
    renderer = make_renderer(resolve(f"lib:{libraries[name]}"), Scene(model=make_model(kind)))
    turn = np.linspace(0.0, 2.0 * np.pi, count)
    round_about = [0.09 * np.cos(turn), 0.09 * np.sin(turn), 0.01 * np.sin(3.0 * turn)]
    on_a_face = [np.full(count, 0.095), 0.08 * np.sin(turn), 0.08 * np.cos(turn)]
    hips = np.column_stack(round_about if kind == "sphere" else on_a_face)
    rows = Rows(hips, path_velocities(hips, DT), np.full(count, DT))
    own, out = renderer.renderer._self, np.zeros((2, *hips.shape))
    loop, address = ctypes.CDLL(str(libraries[name])).bare, ctypes.c_void_p
    loop.argtypes = [address, ctypes.c_uint32, ctypes.c_uint32, address, address, ctypes.c_double, address, address]
    loop.restype = None

    def bare():
        renderer.reset(hips[0])
        places = (array.ctypes.data for array in (hips, rows.velocity))
        loop(own, count, hips.shape[1], *places, DT, *(answer.ctypes.data for answer in out))
        return out

    def led():
        renderer.reset(hips[0])
        return lead_on(renderer, rows, Ticks(0))[:2]

    assert np.array_equal(bare(), led())
    times = np.empty((20, 2))
    for row in times:
        for column, run in enumerate((bare, led)):
            begun = time.thread_time()
            run()
            row[column] = time.thread_time() - begun
    in_c, here = times.min(axis=0)
    benchmark.extra_info["times the loop in C"] = round(here / in_c, 3)
    benchmark.extra_info["ns a tick more"] = round((here - in_c) / count * 1e9, 1)
    assert benchmark.disabled or kind == "cube" or here <= ALLOWED * in_c
    benchmark(led)
