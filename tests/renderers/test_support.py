"""What a scene asks of a renderer and what a renderer supports: what is missing is refused once, before the run."""

from dataclasses import replace

import numpy as np
import pytest
from honest import Spring as Nearest
from msgspec import structs

from hapticeval import RefusalError, Scene
from hapticeval.cli import main
from hapticeval.discovery import own_renderers, resolve
from hapticeval.effects.catalogue import EFFECTS
from hapticeval.effects.effect import Stage
from hapticeval.effects.sensors import ForceSensor
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import RendererError, UnknownNameError
from hapticeval.geometry.catalogue import circle, sphere
from hapticeval.phenomena.verdict import Outcome
from hapticeval.recordings.recording import Recording
from hapticeval.runner.judging import judge
from hapticeval.runner.results import read_results
from hapticeval.scene import requirements
from hapticeval.simulation.answers import make_renderer
from hapticeval.stimulus.motions import Spin
from hapticeval.study.limits.loop import Place
from hapticeval.study.limits.search import family_of, simulated_limit
from hapticeval.suite.reading import load_suite

PLAIN = Scene(model=circle())
SENSED = replace(PLAIN, effects=(ForceSensor(),))
ASKING = {
    "plane": PLAIN,
    "space": Scene(model=sphere()),
    "bilateral": replace(PLAIN, bilateral=True),
    "viscosity": replace(PLAIN, effects=(Viscosity(0.3),)),
    "force-sensor": SENSED,
    "moving": replace(PLAIN, motion=Spin(rate=1.0)),
}
"""Requirement: a scene that asks for it."""


class Feels(Nearest):
    def observe_force(self, push):
        pass


def declaring(*names):
    return type("Declaring", (Nearest,), {"supports": names})


def test_a_scene_asks_a_renderer_for_all_but_what_is_put_on_its_answers():
    answers = {kind for kind, entry in EFFECTS.items() if entry.of.stage is Stage.ANSWER}
    assert set(requirements()) - answers == set(ASKING)


@pytest.mark.parametrize("name", ASKING)
def test_a_scene_asks_for_what_it_calls_for_and_no_more(name):
    names = set(ASKING[name].requirements)
    assert names == {name, "space" if name == "space" else "plane"}


@pytest.mark.parametrize("name", ["bilateral", "viscosity", "force-sensor"])
def test_what_is_not_declared_is_refused_by_name_and_what_is_declared_is_not(refused, name):
    with refused(RefusalError) as caught:
        make_renderer(Nearest, ASKING[name])
    assert f'supports = {{"{name}"}}' in caught.value.todo
    assert isinstance(make_renderer(declaring(name), ASKING[name]).renderer, Nearest)


def test_all_that_is_missing_is_named_at_once(refused):
    scene = replace(SENSED.with_effects(Viscosity(0.1)), bilateral=True)
    with refused(RefusalError):
        make_renderer(Nearest, scene)
    with refused(RefusalError) as caught:
        make_renderer(declaring("bilateral"), replace(PLAIN, bilateral=True, effects=(Viscosity(0.1),)))
    assert "'bilateral'" not in caught.value.what


def test_a_renderer_that_declares_no_dimension_is_given_both_and_one_that_does_no_other(refused):
    for scene in (PLAIN, ASKING["space"]):
        make_renderer(Nearest, scene)
        make_renderer(declaring("bilateral"), scene)
    make_renderer(declaring("space"), ASKING["space"])
    with refused(RefusalError):
        make_renderer(declaring("space"), PLAIN)
    with refused(RefusalError):
        make_renderer(lambda scene: Nearest(scene) if scene.model.curve else None, ASKING["space"])


def test_a_factory_that_declares_is_refused_before_it_builds_anything(refused):
    def make(scene):
        raise AssertionError

    make.supports = {"plane"}
    with refused(RefusalError):
        make_renderer(make, ASKING["bilateral"])


def test_what_it_makes_may_declare_by_a_property(refused):
    class Depends(Nearest):
        @property
        def supports(self):
            return ["bilateral"]

    make_renderer(Depends, ASKING["bilateral"])
    make_renderer(lambda scene: Depends(scene), ASKING["bilateral"])
    with refused(RefusalError):
        make_renderer(Depends, ASKING["viscosity"])


def test_a_renderer_that_feels_needs_not_declare_the_sensor():
    make_renderer(Feels, SENSED)
    make_renderer(lambda scene: Feels(scene), SENSED)


@pytest.mark.parametrize(
    ("supports", "error"),
    [
        ("bilateral", RendererError),
        (7, RendererError),
        ([3], RendererError),
        (["bilatral"], UnknownNameError),
    ],
)
def test_a_wrong_declaration_is_an_error(refused, supports, error):
    with refused(error):
        make_renderer(lambda scene: type("Wrong", (Nearest,), {"supports": supports})(scene), PLAIN)


ATTRIBUTES = ("surface", "standoff", "declares", "supports", "law", "observe_force", "diagnostics", "rendered_as")


@pytest.mark.parametrize("name", ATTRIBUTES)
def test_an_attribute_that_raises_or_is_of_another_kind_is_an_error_of_the_renderer(refused, name):
    def fails(self):
        raise KeyError(name)

    for wrong in (property(fails), 1 if name == "rendered_as" else "wrong"):
        with refused(RendererError):
            make_renderer(lambda scene, wrong=wrong: type("Wrong", (Nearest,), {name: wrong})(scene), PLAIN)


def test_abilities_are_read_once():
    class Counts(Nearest):
        read = 0

        @property
        def standoff(self):
            Counts.read += 1
            return 1e-3 * Counts.read

    made = make_renderer(Counts, PLAIN)
    assert [made.standoff for _ in range(3)] == [1e-3] * 3
    assert Counts.read == 1


SUPPORTED = {
    "ideal": {"plane", "space", "bilateral", "force-sensor", "moving"},
    "conformal": {"plane", "bilateral", "force-sensor", "moving"},
    "mapping": {"plane", "bilateral", "force-sensor", "moving"},
    "constraint": {"plane", "bilateral", "force-sensor", "moving"},
    "minimum-distance": {"plane", "space", "bilateral", "force-sensor", "moving"},
    "minimum-distance@polygon": {"plane", "bilateral", "force-sensor", "moving"},
    "homothetic": {"plane", "space", "bilateral", "force-sensor", "moving"},
    "homothetic@polygon": {"plane", "bilateral", "force-sensor", "moving"},
    "combescure": {"plane", "space", "bilateral", "force-sensor", "moving"},
    "set-stabilisation": set(ASKING),
}


@pytest.mark.parametrize("name", SUPPORTED)
@pytest.mark.parametrize("asked", ASKING)
def test_the_renderers_that_come_along_work_where_they_declare_and_are_refused_elsewhere(name, asked):
    scene = replace(ASKING[asked], damping=5.0)
    if asked in SUPPORTED[name]:
        made = make_renderer(resolve(name), scene)
        hip = np.array([0.095, 0.0, 0.0][: scene.model.dimension])
        if made.steps:
            made.reset(hip)
            assert np.linalg.norm(made.step(hip, 0.0 * hip, 1e-3)[1]) > 0.0
    else:
        with pytest.raises(RefusalError):
            make_renderer(resolve(name), scene)


def test_every_renderer_that_comes_along_declares():
    assert set(own_renderers()) <= set(SUPPORTED)


def test_the_ideal_contact_is_not_asked_for_a_viscosity_that_it_does_not_have():
    case = next(case for case in load_suite("dynamics-circle").cases if case.name == "circle")
    case = structs.replace(
        case, scene={**case.scene, "viscosity": 0.3}, closed_form={}, checks=("tangential-dynamics",)
    )
    found = judge(resolve("ideal"), "ideal", "dynamics-circle", case)
    assert [verdict.outcome for verdict in found.verdicts] == [Outcome.NOT_APPLICABLE]
    assert "'viscosity'" in found.verdicts[0].finding.message
    assert found.refusal is not None


def test_a_renderer_with_physics_of_its_own_is_asked_no_more_than_it_declares():
    class Whole:
        def __init__(self, scene):
            pass

        def simulate(self, stimulus, dt):
            return Recording(np.arange(2.0), {})

    make_renderer(Whole, PLAIN)
    with pytest.raises(RefusalError):
        make_renderer(Whole, ASKING["bilateral"])


def test_limits_take_the_gains_of_a_unilateral_renderer_and_do_not_let_it_go(refused):
    place = Place(np.array([0.1, 0.0]), np.array([1.0, 0.0]))
    gains = family_of(Nearest, PLAIN, place).at(700.0)
    assert gains.now[0, 0] == pytest.approx(700.0, rel=1e-3)
    with refused(RefusalError):
        simulated_limit(Nearest, PLAIN, place)


SUITE = """
title = "Both"
[[case]]
name = "led"
title = "Led under a circle"
model = { kind = "circle" }
checks = ["contact-normal-force", "memoryless"]
trajectory = { kind = "scaled", depth = 0.002, from_angle = 0, to_angle = 20, duration = 0.2 }
[[case]]
name = "held"
title = "Held on a circle"
model = { kind = "circle" }
scene = { stiffness = 50.0, damping = 4.47, bilateral = true }
checks = ["centripetal-force", "contact-normal-force"]
experiment = { duration = 0.2, position = [0.1, 0.0], velocity = [0.0, 0.5] }
"""


def test_what_does_not_apply_stops_no_gate(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "both.toml").write_text(SUITE)
    (tmp_path / "plainly.py").write_text(
        "from hapticeval import Response\n"
        "class Nearest:\n"
        "    def __init__(self, scene):\n"
        "        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness\n"
        "    def reset(self, hip):\n"
        "        pass\n"
        "    def step(self, hip, velocity, dt):\n"
        "        at = self.boundary.closest_point([hip])\n"
        "        ihip = at.foot[0] if at.distance[0] < 0 else hip\n"
        "        return Response(ihip, self.stiffness * (ihip - hip))\n"
    )
    assert main(["run", "both.toml", "-r", "plainly:Nearest", "--no-report", "-o", "out"]) == 0
    results = read_results(tmp_path / "out")
    assert results.complete
    assert (results.ran, results.planned) == (4, 4)
    found = {(each.case, each.check): each for each in results.verdicts}
    assert {each.outcome for (case, _), each in found.items() if case == "led"} == {"pass"}
    held = [each for (case, _), each in found.items() if case == "held"]
    assert {each.outcome for each in held} == {"not-applicable"}
    assert all("'bilateral'" in each.message and each.as_expected for each in held)
    assert "fail" not in capsys.readouterr().out.split("verdicts")[0].split()
