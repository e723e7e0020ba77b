"""Relations that need no truth: answers in a mirror, in other ticks, in another order of vertices, beside others."""

from __future__ import annotations

import honest
import numpy as np
import pytest
from made import found, recorded
from outsiders import case

from hapticeval.discovery import resolve
from hapticeval.geometry.catalogue import line
from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.registry import OWN_CHECKS
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import OWN_TOOL, Recording
from hapticeval.runner.judging import judge
from hapticeval.scene import Scene
from hapticeval.simulation.playback import play

IDS = ("mirror-image", "vertex-order", "time-subdivision", "two-at-once")
CHECKS = [OWN_CHECKS[name] for name in IDS]
OUTLINE = [[-0.08, -0.05], [0.09, -0.06], [0.03, 0.0], [0.1, 0.05], [-0.02, 0.09]]
MODELS = (
    {"kind": "star"},
    {"kind": "polygon", "vertices": OUTLINE},
    {"kind": "dumbbell"},
    {"kind": "cassinian"},
    {"kind": "sphere"},
    {"kind": "l-block"},
)
off_by = pytest.mark.parametrize(("off", "expected"), [(0.0, Outcome.PASS), (1e-9, Outcome.FAIL), (2e-5, Outcome.FAIL)])


DRAWN = {"kind": "generated", "seed": 3, "examples": 2, "parts": ["slide"], "most": 1}


def findings(make, model, trajectory=DRAWN, checks=IDS, **more):
    judged = judge(make, "r", "s", case("c", model, checks, trajectory=trajectory, **more))
    assert judged.error is None
    return {verdict.check: verdict.finding for verdict in judged.verdicts}


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model["kind"])
@pytest.mark.parametrize("name", ["minimum-distance", "constraint", "set-stabilisation", "conformal", "ideal"])
def test_our_renderers_keep_every_relation_to_twelve_digits(name, model):
    found = findings(resolve(name), model)
    assert {finding.outcome for finding in found.values()} <= {Outcome.PASS, Outcome.NOT_APPLICABLE}, found
    for finding in found.values():
        assert finding.metric is None or finding.metric.value <= 1e-12


@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_a_damper_is_allowed_for(damping):
    found = findings(resolve("minimum-distance+pp-pd"), {"kind": "star"}, scene={"damping": damping})
    assert found["time-subdivision"].outcome is Outcome.PASS


@pytest.mark.parametrize("ticks", [1, 2, 3])
def test_an_answer_that_comes_late_in_ticks_is_named_so(ticks):
    finding = findings(honest.factory(f"late-{ticks}", honest.Spring), {"kind": "star"})["time-subdivision"]
    assert finding.outcome is Outcome.FAIL
    assert finding.evidence["ticks_late"] == ticks


def test_a_recording_and_a_scene_with_effects_are_not_asked():
    made = case("c", {"kind": "star"}, IDS, trajectory=DRAWN)
    scene = made.build_scene()
    renderer = resolve("minimum-distance")(scene)
    run = play(renderer, made.build_stimulus(scene, renderer), scene.sampling_time)
    assert {check(Runs(run), scene).outcome for check in CHECKS} == {Outcome.NOT_APPLICABLE}
    rubbing = {"effects": [{"kind": "friction", "mu_s": 0.5, "mu_k": 0.3}]}
    found = findings(resolve("minimum-distance"), {"kind": "star"}, scene=rubbing)["time-subdivision"]
    assert found.outcome is Outcome.NOT_APPLICABLE
    assert "friction" in found.message


def test_a_hand_that_never_touches_is_not_judged():
    far = {"kind": "points", "points": [[0.3, 0.0], [0.4, 0.0]], "duration": 0.01}
    found = findings(resolve("constraint"), {"kind": "star"}, far)
    assert {finding.outcome for finding in found.values()} == {Outcome.NOT_APPLICABLE}


def test_a_renderer_that_takes_one_model_alone_is_asked_beside_one_on_the_same():
    class Only(honest.Spring):
        def __init__(self, scene: Scene) -> None:
            from hapticeval.errors import RefusalError

            if not np.isclose(scene.model.size, 0.19, atol=0.02):
                raise RefusalError("the star of 200 mm only")
            super().__init__(scene)

    assert findings(Only, {"kind": "star"})["two-at-once"].outcome is Outcome.PASS


def straight_at_an_edge(model, way, check, off, where):
    """What `check` finds of `ideal`, led along `way` (2, 3), m; its answers are `off` (3,), m, on models `where`."""

    class OffElsewhere:
        supports = frozenset({"space"})

        def __init__(self, scene: Scene) -> None:
            self.ideal, self.off = resolve("ideal")(scene), np.array(off) * where(scene.model)

        def simulate(self, stimulus, dt):
            run = self.ideal.simulate(stimulus, dt)
            place = run.hip + self.off
            return Recording(run.time, dict(run.channels) | {"hip": place, "ihip": place}, run.meta)

    start, end = way
    path = {"kind": "moves", "start": start, "moves": [{"to": end, "seconds": 0.401}]}
    return findings(OffElsewhere, model, path, (check,))[check]


@off_by
def test_a_rigid_tool_that_flies_straight_at_an_edge_may_go_to_either_side_and_nowhere_else(off, expected):
    """On one mesh it slides down a face of the prism, on the one that is cut it rests on the other: 20 um apart.

    Which it is rounding of 4e-17 m decides. A tool that is off along the edge as well, by 1 nm of 200 mm, is no tie's.
    """
    finding = straight_at_an_edge(
        {"kind": "cylinder", "size": 0.2, "length": 0.05, "sides": 6},
        [[-0.05, -0.096603, 0.0], [-0.05, -0.086594, 0.0]],
        "seams",
        [0.0, 0.0, off],
        where=lambda model: len(model.boundary.triangles) > 100,  # the mesh that is cut
    )
    assert finding.outcome is expected, finding


@off_by
def test_with_the_scene_moved_a_tool_that_flies_straight_at_a_rim_may_go_to_either_side_and_nowhere_else(off, expected):
    """It slides in over the end of the prism, and where that is turned and shifted up its side: 6 um apart.

    The tool comes to the rim within 1e-16 m; `off` (m) is across the way to either.
    """
    finding = straight_at_an_edge(
        {"kind": "cylinder", "size": 0.05, "length": 0.05, "sides": 3},
        [[-0.0142678, 0.0, -0.0267678], [-0.0124986, 0.0, -0.0249986]],
        "numerical-stability",
        [0.0, off, 0.0],
        where=lambda model: np.abs(model.boundary.bounds).max() > 1.2 * model.size,  # the scene that is moved
    )
    assert finding.outcome is expected, finding


def pressed(ihip=0.0, **more):
    """A press of 2 mm on a plane, its IHIPs off by `ihip` (m)."""
    rest = np.zeros((20, 2))
    return recorded(rest - [0.0, 2e-3], rest + np.array([ihip, 0.0]), np.tile([0.0, 2.0], (20, 1)), **more)


@pytest.mark.parametrize("damping", [0.0, 1e4])
@pytest.mark.parametrize("resolution", [0.0, 1e-4])
@pytest.mark.parametrize(("share", "expected"), [(0.99, Outcome.PASS), (1.01, Outcome.FAIL)])
def test_a_restated_scene_is_granted_rounding_of_the_hand_its_damper_and_what_is_declared(
    damping, resolution, share, expected
):
    """Four roundings of 2 mm, 2 K_d / (K dt / 2) of them by the damper, and a trillionth of the model."""
    scene = Scene(model=line(), stiffness=1000.0, damping=damping)
    hand = 4.0 * 2.0**-52 * 2e-3
    allowed = hand * (1.0 + 2.0 * damping / (1000.0 * 5e-4)) + resolution + 1e-12 * scene.model.size
    base, other = (pressed(off, meta={"resolution": resolution}) for off in (0.0, share * allowed))
    runs = Runs(base, reordered=lambda: other)
    assert found("vertex-order", runs, scene).outcome is expected


@pytest.mark.parametrize(("own", "share"), [(False, 1e-12), (True, 1e-9)])
@pytest.mark.parametrize(("times", "expected"), [(0.99, Outcome.PASS), (1.01, Outcome.FAIL)])
def test_only_a_tool_that_moves_by_itself_is_known_to_a_billionth_of_the_model(own, share, times, expected):
    """A closed loop has no `subdivided` either, and its renderer answers tick by tick: a trillionth."""
    scene = Scene(model=line(), stiffness=1000.0)
    hand = 4.0 * 2.0**-52 * 2e-3
    allowed = hand + share * scene.model.size
    base, other = (pressed(off, meta={OWN_TOOL: True} if own else {}) for off in (0.0, times * allowed))
    assert found("vertex-order", Runs(base, reordered=lambda: other), scene).outcome is expected


@pytest.mark.parametrize("damping", [0.0, 100.0])
@pytest.mark.parametrize(("share", "expected"), [(0.99, Outcome.PASS), (1.01, Outcome.FAIL)])
def test_beside_another_renderer_single_precision_of_the_answer_is_granted(damping, share, expected):
    """Four roundings of the model and of the hand, twice that over a tick by the damper, and four of the force."""
    scene = Scene(model=line(), stiffness=1000.0, damping=damping)
    single = 4.0 * 2.0**-23
    step = single * (scene.model.size + 2e-3)
    allowed = (1.0 + 2.0 * damping / (1000.0 * 1e-3)) * step + single * 2.0 / 1000.0 + 1e-12 * scene.model.size
    runs = Runs(pressed(), in_turns=lambda: pressed(share * allowed))
    assert found("two-at-once", runs, scene).outcome is expected
