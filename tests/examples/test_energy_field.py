"""The curl of a force over the inside, and the loop that gains most: of a field of known curl, and of renderers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.examples.studies.energy_field import LOOP_POINTS, energy_field, work_round, works_at, worst_loop
from hapticeval.geometry.catalogue import cassinian, circle, ellipse, star
from hapticeval.scene import Scene


class Vortex:
    """F = a r^2 (-y, x): its curl is 4 a r^2."""

    def reset(self, hip):
        pass

    def step(self, hip, velocity, dt):
        return hip, 5e4 * (hip @ hip) * hip[::-1] * (-1.0, 1.0)


def test_the_curl_of_a_vortex_and_the_work_of_its_loops(refused):
    curve = circle().curve
    field = energy_field(Vortex(), curve, cell=2e-3)
    inside = ~np.isnan(field.curl)
    r2 = np.sum(field.centres**2, axis=-1)
    # the mean of 4 a r^2 over a cell of side e is 4 a (r^2 + e^2 / 6)
    np.testing.assert_allclose(field.curl[inside], 2e5 * (r2[inside] + 4e-6 / 6.0), rtol=1e-9)
    found = worst_loop(Vortex(), field, 0.01)
    r2 = float(np.hypot(*found.centre)) ** 2
    assert found.work == pytest.approx(2e5 * math.pi * 1e-4 * (r2 + 0.5e-4), rel=1e-6)
    scanned = works_at(field, 0.01)
    assert found.work == pytest.approx(float(np.nanmax(scanned)), rel=0.02)
    assert math.sqrt(r2) == pytest.approx(0.1 - 0.01, abs=6e-3)
    with refused(InputError):
        worst_loop(Vortex(), field, 0.01, depths=(0.2, 0.3))


@pytest.mark.system
@pytest.mark.parametrize("model", [cassinian(), ellipse(), star()], ids=lambda model: model.name)
@pytest.mark.parametrize("name", ["conformal", "minimum-distance", "homothetic", "combescure"])
def test_which_renderers_have_a_loop_that_gains(name, model):
    """By tens of mJ and more where the map is no gradient; else within the trapezoid's error.

    Where the force jumps, at corners and at the medial axis, that is half of a step times the jump, of up to twice
    the force, at each of up to eight crossings.
    """
    renderer = resolve(name)(Scene(model=model))
    loop = worst_loop(renderer, energy_field(renderer, model.curve, cell=2e-3), 4e-3, depths=(0.0, 0.03))
    if name == "conformal" and model.name != "star":
        assert abs(loop.work) > 0.05
        assert work_round(renderer, loop.centre, 2e-3).work == pytest.approx(loop.work / 4.0, rel=0.4)
    else:
        jumps = model.name == "star" or name == "minimum-distance"
        step = math.tau * loop.radius / LOOP_POINTS
        assert abs(loop.work) < (8.0 * step * 1000.0 * 0.035 if jumps else 1e-7)
