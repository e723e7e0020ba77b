"""What a scene does not call for is not imported, not assembled and not run."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import made_up_effect
import numpy as np
import pytest
from leading import led
from made_up_effect import Suction
from numba.core.types import FunctionType

from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.discovery import resolve
from hapticeval.effects.catalogue import EFFECTS
from hapticeval.geometry.catalogue import make_model
from hapticeval.laws import LAW, LawData, law_value
from hapticeval.renderer import wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer, with_effects
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment

JUDGES = """
import sys
from hapticeval.discovery import resolve
from hapticeval.runner.judging import judge
from hapticeval.suite.reading import load_suite
case = next(each for each in load_suite({suite!r}).cases if each.name == {case!r})
found = judge(resolve({name!r}), {name!r}, {suite!r}, case)
assert found.verdicts
print(*sorted(each for each in sys.modules if each.startswith("hapticeval.effects.")))
"""


def imported(code):
    """Return the modules of effects that a process of its own has imported at the end, as it prints them."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {each.removeprefix("hapticeval.effects.") for each in done.stdout.split()}


@pytest.mark.parametrize("kind", EFFECTS)
def test_an_entry_leads_to_the_class_of_its_kind(kind):
    entry = EFFECTS[kind]
    assert entry.of.kind == kind
    fields = entry.of.__dataclass_fields__
    assert set(entry.short.values()) <= {*fields, ""}
    named = {name: key.rpartition(".")[2] for key, name in entry.short.items() if name}
    assert named == {name: field.metadata["short"] for name, field in fields.items() if field.metadata.get("short")}


@pytest.mark.system
@pytest.mark.parametrize(
    ("name", "suite", "case", "called"),
    [
        ("minimum-distance", "thesis", "circle-slide", set()),
        ("set-stabilisation", "dynamics-surfaces", "ellipsoid-off-robot", set()),
        (
            "minimum-distance",
            "dynamics-line",
            "line",
            {"sensors", "actuators"},
        ),
    ],
)
def test_a_process_imports_the_effects_that_its_suite_calls_for_and_no_other(name, suite, case, called):
    assert imported(JUDGES.format(name=name, suite=suite, case=case)) == {"catalogue", "effect"} | called


def experiment():
    """Push the robot along a circle for 50 ticks."""
    return Experiment(0.05, np.array([0.0, 0.0998]), np.zeros(2), np.array([0.0, 0.05]), np.array([[0.3, -1.0]] * 2))


@pytest.mark.parametrize("name", ["minimum-distance", "constraint", "minimum-distance@polygon", "set-stabilisation"])
def test_without_effects_the_renderer_is_the_one_that_its_factory_made(name):
    """So is its law, and what the kernel is given; the answers are the same bits."""
    scene = Scene(model=make_model("circle"), damping=5.0, device=Parallelogram2())
    base = wrapped(resolve(name)(scene))
    assert with_effects(base, scene) is base
    found = make_renderer(resolve(name), scene)
    assert type(found.renderer) is type(base.renderer)
    assert found.law.function is base.law.function
    assert type(found.law.data) is LawData
    assert law_value(found.law.function, found.law.data).type == FunctionType(LAW)
    plain, machinery = (simulate_closed_loop(each, experiment(), scene, 1e-3) for each in (base, found))
    for channel, values in plain.channels.items():
        assert np.array_equal(values, machinery.channels[channel]), channel
    hips = plain.hip.copy()
    assert np.array_equal(led(base, hips, 1e-3), led(found, hips, 1e-3))


def test_an_effect_that_is_called_for_and_does_nothing_changes_no_bit():
    scene = Scene(model=make_model("circle"), device=Parallelogram2())
    idle = replace(scene, effects=(Suction(1e-300),))
    runs = [
        simulate_closed_loop(make_renderer(resolve("minimum-distance"), each), experiment(), each, 1e-3)
        for each in (scene, idle)
    ]
    for channel, values in runs[0].channels.items():
        assert np.array_equal(values, runs[1].channels[channel]), channel


CODE = """
import hashlib, sys
sys.path.insert(0, {meta!r})
from dataclasses import replace
from hapticeval.compiled import machine_code
from hapticeval.laws import law_value
from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.discovery import resolve
from hapticeval.effects.sensors import Encoder
from hapticeval.geometry.catalogue import make_model
from hapticeval.renderer import wrapped
from hapticeval.simulation.answers import make_renderer
from hapticeval.scene import Scene
from hapticeval.simulation import kernels
from hapticeval.simulation.closed_loop import loop_of, simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment
from made_up_effect import Suction
import numpy as np
trial = Experiment(0.05, np.array([0.0, 0.0998]), np.zeros(2), np.array([0.0, 0.05]), np.array([[0.3, -1.0]] * 2))
plain = Scene(model=make_model("circle"), device=Parallelogram2())
affected = replace(plain, effects=(Encoder(1e-4), Suction(0.2)))
for scene in ({scenes}):
    law = wrapped(make_renderer(resolve("minimum-distance"), scene)).law
    code = machine_code(kernels.run, law_value(law.function, law.data), law.data, loop_of(trial, scene, 1e-3))
    if scene is plain:
        print(len(code), hashlib.sha256(code).hexdigest())
"""


@pytest.mark.slow
def test_the_machine_code_of_a_loop_without_effects_is_the_same_whatever_else_was_compiled(tmp_path):
    """In a cache that has seen no effect, and in one that has compiled a loop with effects before."""
    found = []
    for name, scenes in (("bare", "plain,"), ("after", "affected, plain")):
        code = CODE.format(meta=str(Path(made_up_effect.__file__).parent), scenes=scenes)
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / name)},
        )  # fmt: skip
        found.append(done.stdout.split())
    assert found[0] == found[1]
    assert int(found[0][0]) > 10_000
