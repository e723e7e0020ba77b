"""What effects cost: measured on scenes of the tests' own, and shown by the program."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_effect import ENTRY, Suction

from hapticeval.compiled import machine_code
from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import EFFECTS
from hapticeval.examples.studies.effects import main
from hapticeval.examples.studies.flags import answer_rows, flagged_law
from hapticeval.geometry.catalogue import make_model
from hapticeval.laws import law_value
from hapticeval.renderer import abilities_of
from hapticeval.scene import Scene
from hapticeval.simulation import kernels
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import loop_of
from hapticeval.stimulus.stimulus import Experiment
from hapticeval.study.effects_cost import read_costs

SUITE = """
title = "Pushed"
[[case]]
name = "plain"
title = "Nothing called for"
model = { kind = "circle" }
scene = { device = "parallelogram-2dof" }
checks = ["contact-normal-force"]
experiment = { duration = 0.05, position = [0.0, 0.0998] }
[[case]]
name = "sucked"
title = "Sucked and counted"
model = { kind = "circle" }
checks = ["contact-normal-force"]
experiment = { duration = 0.05, position = [0.0, 0.0998] }
[case.scene]
device = "parallelogram-2dof"
effects = [{ kind = "suction", force = 0.2 }, { kind = "encoder", step = 1e-4 }]
[[case]]
name = "led"
title = "Led along"
model = { kind = "circle" }
scene = { effects = [{ kind = "suction", force = 0.2 }] }
checks = ["contact-normal-force"]
trajectory = { kind = "points", duration = 0.1, points = [[0.0998, 0.0], [0.09, 0.02]] }
[[case]]
name = "sensed"
title = "Refused"
model = { kind = "circle" }
scene = { viscosity = 0.3 }
checks = ["contact-normal-force"]
trajectory = { kind = "points", duration = 0.1, points = [[0.0998, 0.0], [0.09, 0.02]] }
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(EFFECTS, Suction.kind, ENTRY)
    (tmp_path / "pushed.toml").write_text(SUITE)
    return tmp_path


@pytest.mark.system
@pytest.mark.parametrize("on", [True, False])
def test_an_engine_that_tests_flags_shows_what_is_on_and_nothing_else(on):
    scene = Scene(model=make_model("circle"), effects=(Suction(0.2),))
    renderer = make_renderer(resolve("minimum-distance"), scene)
    engine, flags = flagged_law(abilities_of(renderer).law.data)
    flags[:] = on
    hips = np.linspace([0.11, 0.0], [0.08, 0.02], 60)
    ihips, forces = np.zeros((2, 60, 2))
    renderer.reset(hips[0])
    assert answer_rows(
        law_value(engine.function, engine.data), engine.data, hips, 0 * hips, np.zeros(2), 1e-3, ihips, forces
    )
    expected = make_renderer(resolve("minimum-distance"), scene if on else replace(scene, effects=()))
    assert np.array_equal((ihips, forces), expected.run(hips, 1e-3))
    assert np.abs(forces).max() > 0.0


def test_code_is_counted_by_what_it_is_compiled_for():
    scene = Scene(model=make_model("circle"), device=Parallelogram2())
    trial = Experiment(0.05, np.array([0.0, 0.0998]), np.zeros(2), np.zeros(1), np.zeros((1, 2)))
    law = make_renderer(resolve("minimum-distance"), scene).law
    given = law_value(law.function, law.data), law.data, loop_of(trial, scene, 1e-3)
    code = machine_code(kernels.run, *given)
    assert len(code) > 10_000
    assert code == machine_code(kernels.run, *given)
    assert len(machine_code(kernels.sense, given[2], 0)) < len(code)


@pytest.mark.system
def test_the_command_shows_every_scene(here, capsys):
    assert main(["pushed.toml", "-o", "results"]) == 0
    out = capsys.readouterr().out
    lines = {line.split()[0]: line for line in out.splitlines() if line.startswith("pushed/")}
    assert "none" in lines["pushed/plain"]
    assert "sensors: encoder; answer: suction" in lines["pushed/sucked"]
    assert "the scene asks for 'viscosity'" in out
    document = read_costs(here / "results")
    plain, sucked, led, refused = document.scenes
    assert (plain.plain, plain.calls, plain.assembled, plain.ticks) == (None, [], {}, 51)
    assert (sucked.calls, sucked.assembled) == (["encoder", "suction"], {"answer": ["suction"], "sense": ["encoder"]})
    assert sucked.plain.code == plain.cost.code < sucked.cost.code
    assert (led.plain.code, led.cost.code > 0, led.ticks > 100) == (None, True, True)
    assert refused.cost is None
    assert document.ladder is None
    assert main(["pushed.toml", "-k", "plain", "-o", "results"]) == 0  # written again


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["efects"], "unknown suite 'efects'"),
        (["pushed.toml", "-r", "minimum-distence"], "minimum-distence"),
        (["pushed.toml", "-k", "nothing"], "nothing matches -k 'nothing'"),
    ],
)
def test_what_is_not_there_is_refused_by_name(here, capsys, arguments, words):
    assert main(arguments) in (2, 4)
    assert words in capsys.readouterr().err
