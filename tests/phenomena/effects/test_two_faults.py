"""Two faults of different size, the larger first or last, and answers that come late by a part of a tick."""

from __future__ import annotations

import numpy as np
import pytest
import struck_and_shaded
from made import FAIL, changed, found

from hapticeval.discovery import resolve
from hapticeval.effects.friction import Friction
from hapticeval.effects.reliefs import BumpMap, HeightMap
from hapticeval.effects.viscous_friction import ViscousFriction
from hapticeval.geometry.catalogue import make_model
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.lag import delayed
from hapticeval.phenomena.measures.closed_paths import laps
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.playback import play
from hapticeval.stimulus.stimulus import Path

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


def to_and_fro():
    """Aslant into a plane, and to and fro in it at speeds that change all the time."""
    time = DT * np.arange(1200)
    depth = np.where(time < 0.05, 1e-3 - 0.06 * time, -2e-3 - 5e-4 * np.sin(11.0 * (time - 0.05)))
    return Path(time, np.column_stack([0.01 * np.sin(4.0 * time) + 0.004 * np.sin(9.0 * time), depth]))


@pytest.mark.parametrize("lag", [0.4, 1.25, 2.6])
@pytest.mark.parametrize("names", [("force",), ("ihip",), ("force", "ihip")], ids=" ".join)
@pytest.mark.parametrize(
    ("effect", "checks"),
    [
        (ViscousFriction(4.0), ("friction-force", "friction-work")),
        (Friction(0.5, 0.3), ("friction-cone", "friction-sliding", "friction-break-away")),
        (BumpMap(wavelength=2e-3, amplitude=4e-5), ("texture-relief",)),
        (HeightMap(wavelength=2e-3, amplitude=4e-5), ("texture-relief",)),
        (None, ("contact-normal-force", "force-magnitude", "passivity", "contact-kept")),
    ],
    ids=["viscous", "dry", "bumps", "heights", "bare"],
)
def test_what_comes_between_two_ticks_is_judged_with_what_is_open_there(effect, checks, names, lag):
    """What each check allows and measures there stands in the table of what is measured."""
    scene = Scene(model=make_model("line"), effects=() if effect is None else (effect,))
    base, without = runs_of(scene, to_and_fro(), "" if effect is None else effect.kind)
    rows = np.arange(len(base))
    late = changed(base, **{name: delayed(base.channels[name], rows, lag) for name in names})
    for check in checks:
        assert found(check, Runs(late, without=without), scene).message
