"""Two faults of different size, the larger first or last, and answers that come late by a part of a tick."""

from __future__ import annotations

import numpy as np
import pytest
import struck_and_shaded
from made import FAIL, changed, found

from hapticeval.discovery import resolve
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.measures.closed_paths import laps
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play

DT = 1e-3


def runs_of(scene, path, kind):
    def run(chosen):
        return play(make_renderer(resolve("minimum-distance"), chosen), path, DT, scene=chosen)

    plain = run(scene.without(kind))
    return run(scene), lambda kind: plain


def shaded_laps():
    case = struck_and_shaded.CASES["facet-loop"]
    scene = case.build_scene()
    base, without = runs_of(scene, case.build_stimulus(scene, None), "shading")
    (first, period, _), *_ = laps(base.hip, scene.model.size)
    return base, without, scene, first + period, period


@pytest.mark.parametrize("shares", [(0.01, 0.03), (0.03, 0.01), (-0.03, 0.01), (0.01, -0.03)], ids=str)
def test_of_two_laps_the_one_with_the_larger_fault_is_named(shares):
    base, without, scene, first, period = shaded_laps()
    force = np.array(base.force)
    for lap, share in enumerate(shares):
        # A quarter of the lap, with another force each.
        begin = first + lap * period + period // 8
        force[begin : begin + period // 4] *= 1.0 + share
    runs, larger = Runs(changed(base, force=force), without=without), int(np.argmax(np.abs(shares)))
    magnitude, work = (found(check, runs, scene) for check in ("shading-magnitude", "shading-work"))
    found("shading-direction", runs, scene)
    begin = first + larger * period
    assert (magnitude.outcome, work.outcome) == (FAIL, FAIL)
    assert begin <= magnitude.evidence["tick"] < begin + period
    assert work.evidence["from_time"] == pytest.approx(begin * DT)


def test_a_lap_that_is_in_contact_in_part_is_judged_too():
    base, without, scene, first, period = shaded_laps()
    force = np.array(base.force)
    force[first + period + 5 : first + period + 25] = 0.0
    finding = found("shading-work", Runs(changed(base, force=force), without=without), scene)
    assert finding.evidence["loops"] == 2
    assert finding.outcome is FAIL
    assert finding.evidence["from_time"] == pytest.approx((first + period) * DT)
