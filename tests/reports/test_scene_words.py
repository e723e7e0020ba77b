"""A scene in words: every number with its unit, and nothing of what the scene does not call for."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import pytest
from reports_synthetic import SCENE, run_document, synthetic_results

from hapticeval.effects.delay import Delay
from hapticeval.effects.encoder import Encoder
from hapticeval.effects.force_sensor import ForceSensor
from hapticeval.effects.joint_friction import JointFriction
from hapticeval.effects.saturation import Saturation
from hapticeval.effects.velocity_filter import VelocityFilter
from hapticeval.effects.viscosity import Viscosity
from hapticeval.reports import junit, markdown, render_html
from hapticeval.reports.scene_words import ended_words, figures_cited, robot_words, scene_words

ROBOT = {
    "device": {"kind": "parallelogram-3dof", "dynamics": "lagrangian", "base_inertia": "sin"},
    "inner_loop": "linearised",
}
ENDED = {"tick": 123, "time": 0.123, "what": "the arm left its <workspace>", "why": "x2 = 1.2 rad"}


def run(**scene):
    return {**run_document("lobe", "plain", "cassinian"), "scene": {**SCENE, **scene}}


def test_gains_have_their_units_and_what_is_zero_is_not_told():
    assert scene_words(run()) == "stiffness 1000 N/m, mass 0.1 kg, 1000 Hz, unilateral"
    assert "viscosity 0.3 kg/s" in scene_words(run(effects=[Viscosity(0.3).document()]))


def test_the_robot_in_space_says_which_dynamics_and_which_inertia():
    words = robot_words(run(**ROBOT))
    assert words == (
        "parallelogram-3dof, Lagrangian dynamics, d₀ with sin² x₃, inner loop by feedback linearisation (6.7); "
        "no imperfections"
    )
    printed = {**ROBOT, "device": {**ROBOT["device"], "dynamics": "printed", "base_inertia": "cos"}}
    assert "dynamics as printed (2.26), d₀ with cos² x₃" in robot_words(run(**printed))


def test_the_robot_in_the_plane_has_no_choice_of_dynamics():
    flat = {**ROBOT, "device": {**ROBOT["device"], "kind": "parallelogram-2dof"}}
    assert "dynamics" not in robot_words(run(**flat))
    assert "d₀" not in robot_words(run(**flat))


def test_playback_has_no_robot():
    assert robot_words(run()) == ""


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        (Encoder(2.0 * math.pi / 262144), "encoders of 2.397e-05 rad a count (262,144 counts a turn)"),
        (VelocityFilter(50.0), "velocity from differences, low-passed at 50 Hz"),
        (Delay(0.0005), "torques 0.5 ms late"),
        (Saturation(0.368), "motors saturate at 0.368 N m"),
        (JointFriction(0.02), "Coulomb friction of 0.02 N m in each joint"),
        (ForceSensor(step=0.01), "force sensor (quantum 0.01 N)"),
        (ForceSensor(), "force sensor, ideal"),
    ],
)
def test_each_effect_of_the_robot_in_words(effect, words):
    assert robot_words(run(**{**ROBOT, "effects": [effect.document()]})).endswith(f"; {words}")


def test_a_point_mass_has_metres_and_newtons_for_joints():
    mass = {"device": {"kind": "point-mass"}, "inner_loop": "static"}
    words = robot_words(run(**mass, effects=[Encoder(1e-5).document(), Saturation(2.0).document()]))
    assert words == "point-mass; encoders of 0.01 mm a count, motors saturate at 2 N"


@pytest.mark.parametrize(
    ("citation", "figures"),
    [
        ("6.3.3, Table 6.2, Figure 6.22; 7.3.2, (7.38), Figure 7.3", "Figures 6.22 and 7.3"),
        ("7.4.2, Figures 7.6 to 7.8", "Figures 7.6 to 7.8"),
        ("6.3.2, Table 6.1, Figure 6.19; 7.3.1, (7.28)", "Figure 6.19"),
        ("6.3.2, (6.17), Table 6.1", ""),
        (None, ""),
    ],
)
def test_figures_by_their_numbers(citation, figures):
    assert figures_cited({"citation": citation}) == figures


def test_a_run_that_ended_early_is_told_in_every_report():
    runs = [dict(each) for each in synthetic_results().runs]
    runs[0]["ended"] = ENDED
    results = synthetic_results(runs=runs)
    sentence = "ended early at t = 0.123 s, tick 123: the arm left its <workspace> (x2 = 1.2 rad)"
    assert ended_words(runs[0]) == sentence
    assert ended_words(runs[1]) == ""
    page = render_html(results, {})
    assert f"The run {sentence.replace('<', '&lt;').replace('>', '&gt;')}" in page
    assert "1 run ended early" in page
    assert f"- plain on synthetic/lobe {sentence.replace('<', '&lt;')}" in markdown(results)
    root = ET.fromstring(junit(results))
    given = root.find(".//testcase[@name='contact-normal-force [plain]']")
    assert sentence in given.find("failure").get("message")
