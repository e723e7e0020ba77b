"""Suites: what is installed, and what a file may get wrong."""

from __future__ import annotations

import re

import numpy as np
import pytest

from hapticeval.effects.encoder import Encoder
from hapticeval.effects.joint_friction import JointFriction
from hapticeval.effects.viscosity import viscosity_of
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.suite.installed import find_suites, suite_groups, suites_named
from hapticeval.suite.reading import load_suite

CASE = """
title = "mine"
[[case]]
name = "one"
title = "One"
model = { kind = "circle" }
checks = ["continuous-contact"]
trajectory = { kind = "points", points = [[0.12, 0.0], [0.08, 0.02]], duration = 1 }
"""


def load(tmp_path, text):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    return load_suite(str(file))


def test_the_thesis_suite_has_the_cases_of_chapter_6():
    suite = load_suite("thesis")
    names = {case.name for case in suite.cases}
    assert {
        "cassinian-shallow-slide",
        "cassinian-deep-slide",
        "star-concave-corner",
        "star-convex-corner",
        "ambiguous-push",
        "plane-press",
        "plane-impact",
        "line-constraint",
        "circle-constraint",
        "circle-slide",
    } <= names
    assert any(name.startswith("cassinian-depth-sweep-") for name in names)
    assert all(case.citation and case.shows for case in suite.cases)
    assert [case.name for case in suite.cases if not case.judged] == ["ambiguous-push"]
    assert "thesis" in find_suites()


def test_a_minimal_file_is_a_suite(tmp_path):
    suite = load(tmp_path, CASE)
    (case,) = suite.cases
    assert (suite.name, case.judged, case.depth_of) == ("mine", True, "model")
    path = case.build_stimulus(case.build_scene(), object())
    np.testing.assert_allclose(path.sampled(1.0)[1], [[0.12, 0.0], [0.08, 0.02]])


ROW = """
[[row]]
title = "Mine"
check = {check}
cases = {cases}
"""


def test_every_unilateral_case_that_is_installed_asks_for_the_contact_to_be_kept():
    for name in find_suites():
        for case in load_suite(name).cases:
            assert ("contact-kept" in case.checks) is not case.build_scene().bilateral, case.name


@pytest.mark.parametrize(
    ("check", "expected"), [('"memoryless"', ("memoryless",)), ('["continuous-contact", "memoryless"]', None)]
)
def test_a_row_takes_one_check_or_a_list(tmp_path, check, expected):
    more = CASE.replace('["continuous-contact"]', '["continuous-contact", "memoryless"]')
    (row,) = load(tmp_path, more + ROW.format(check=check, cases='["o*"]')).rows
    assert row.checks == (expected or ("continuous-contact", "memoryless"))


@pytest.mark.parametrize(
    ("check", "cases", "message"),
    [
        ('"memoryless"', '["one"]', "'memoryless' in 'one'"),
        ('["continuous-contact", "memoryless"]', '["one"]', "'memoryless' in '*'"),
        ('["continuous-contact", "memoryless"]', '["one", "two"]', "'continuous-contact' or 'memoryless' in 'two'"),
        ('["continuous-contact", "memorless"]', '["one"]', "memorless"),
        ("[]", '["one"]', "check"),
    ],
)
def test_a_row_without_cases_for_its_checks_is_refused(tmp_path, check, cases, message):
    with pytest.raises(InputError, match=re.escape(message)):
        load(tmp_path, CASE + ROW.format(check=check, cases=cases))


def test_unknown_suites_suggest_the_closest():
    with pytest.raises(UnknownNameError, match="did you mean thesis"):
        load_suite("thesys")


def test_a_missing_file_is_said(tmp_path):
    with pytest.raises(InputError, match="no suite file"):
        load_suite(str(tmp_path / "none.toml"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('title = "mine"', 'title = "mine', "not TOML"),
        ("[[case]]", "[[cases]]", "unknown entry 'cases'.*did you mean case"),
        ('kind = "circle"', 'kind = "circel"', "case 'one'.*circel"),
        ('kind = "circle"', 'kind = "circle", size = -1', "case 'one'"),
        ('kind = "circle"', 'kind = "circle", size = 1e300', "case 'one'"),
        ('kind = "circle"', 'kind = "circle", colour = "red"', "case 'one'"),
        ("continuous-contact", "continous-contact", "case 'one'.*continous-contact"),
        ("duration = 1", "duration = 0", "case 'one'"),
        ("duration = 1", "speed = 1", "case 'one'.*speed"),
        ("duration = 1", "duration = -1", "case 'one'.*duration.*-1"),
        ('checks = ["continuous-contact"]', "checks = []", "case 'one'"),
        ('name = "one"', 'name = "One two"', "One two"),
        ('title = "One"', 'title = "One"\nscene = { stiffness = -1.0 }', "stiffness"),
        ('title = "One"', 'title = "One"\nscene = { stifness = 1.0 }', "stifness"),
        ('title = "One"', 'title = "One"\nscene = { restitution = 2.0 }', "restitution"),
    ],
)
def test_what_a_file_gets_wrong_is_named(tmp_path, old, new, message):
    assert old in CASE
    with pytest.raises(InputError, match=f"(?s){message}"):
        load(tmp_path, CASE.replace(old, new))


def test_two_cases_of_one_name_are_refused(tmp_path):
    with pytest.raises(InputError, match="two cases named 'one'"):
        load(tmp_path, CASE + CASE.split("\n", 2)[2])


def test_a_trajectory_in_3d_is_refused_on_a_plane_model(tmp_path):
    suite = load(tmp_path, CASE.replace("[[0.12, 0.0], [0.08, 0.02]]", "[[0.12, 0.0, 0.0], [0.08, 0.02, 0.0]]"))
    case = suite.cases[0]
    with pytest.raises(InputError, match="3D on a 2D model"):
        case.build_stimulus(case.build_scene(), object())


def test_a_sweep_makes_a_case_a_depth(tmp_path):
    text = CASE.replace(
        'trajectory = { kind = "points", points = [[0.12, 0.0], [0.08, 0.02]], duration = 1 }',
        'trajectory = { kind = "scaled", from_angle = 0, to_angle = 90, duration = 1 }\n'
        'sweep = [{ label = "a", depth = 0.01 }, { label = "b", depth = 0.02 }]',
    )
    cases = load(tmp_path, text).cases
    assert [case.name for case in cases] == ["one-a", "one-b"]
    radii = [
        np.linalg.norm(case.build_stimulus(case.build_scene(), object()).sampled(0.5)[1], axis=1) for case in cases
    ]
    np.testing.assert_allclose(radii[0], 0.09)
    np.testing.assert_allclose(radii[1], 0.08)


ROBOT = """
title = "mine"
renderers = ["set-stabilisation"]
[variant.worn]
title = "worn"
shows = "Its joints rub."
judged = false
scene = { imperfections = { friction = 0.01, encoder_counts = 1000 } }
[[case]]
name = "one"
title = "One"
model = { kind = "circle" }
checks = ["output-invariance", "closed-form"]
closed_form = { set-stabilisation = "7.38" }
variants = ["worn"]
scene = { bilateral = true, damping = 4.0, viscosity = 0.2, device = "parallelogram-2dof", inner_loop = "linearised" }
[case.published.set-stabilisation]
output-invariance = "pass"
[case.experiment]
duration = 0.1
position = [0.1, 0.0]
velocity = [0.0, 0.5]
force = [[0, 0.0, 0.0]]
hand = { stiffness = 10.0, damping = 1.0, path = { points = [[0.1, 0.0], [0.2, 0.0]], duration = 0.1 } }
"""


def test_a_case_names_a_robot_its_inner_loop_and_a_hand(tmp_path):
    suite = load(tmp_path, ROBOT)
    case = suite.cases[0]
    case.check_stimulus()
    scene = case.build_scene()
    assert (suite.renderers, scene.robot.name) == (("set-stabilisation",), "parallelogram-2dof")
    assert (scene.inner_loop, viscosity_of(scene)) == ("linearised", 0.2)
    hand = case.build_stimulus(scene, None).hand
    assert (hand.stiffness, hand.damping) == (10.0, 1.0)
    np.testing.assert_allclose(hand.desired(np.array([0.05])), [[0.15, 0.0]])


def test_a_variant_is_the_case_in_another_scene_without_what_is_in_print(tmp_path):
    case, worn = load(tmp_path, ROBOT).cases
    assert (worn.name, worn.title, worn.shows, worn.judged) == ("one-worn", "One, worn", "Its joints rub.", False)
    scene = worn.build_scene()
    assert scene.effect(JointFriction).torque == 0.01
    assert scene.effect(Encoder).step == pytest.approx(2.0 * np.pi / 1000.0)
    assert scene.robot == case.build_scene().robot
    assert (case.closed_form, case.checks[-1]) == ({"set-stabilisation": "7.38"}, "closed-form")
    assert (worn.closed_form, worn.checks, worn.published) == ({}, ("output-invariance",), {})


@pytest.mark.parametrize(
    ("device", "kind"), [("{ kind = 'point-mass', mass = 0.5 }", "point-mass"), ("'point-mass'", "point-mass")]
)
def test_a_point_mass_has_the_tool_s_mass_where_it_gives_none(tmp_path, device, kind):
    text = ROBOT.replace('"parallelogram-2dof"', device).replace(", encoder_counts = 1000", "")
    robot = load(tmp_path, text).cases[0].build_scene().robot
    assert (robot.name, robot.dimension, robot.mass) == (kind, 2, 0.5 if "mass =" in device else 0.1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"parallelogram-2dof"', '"paralelogram-2dof"', "unknown device 'paralelogram-2dof'.*parallelogram-2dof"),
        ('"parallelogram-2dof"', '"parallelogram-3dof"', "moves in 3D, and model 'circle' is in 2D"),
        ('"parallelogram-2dof"', '{ kind = "parallelogram-2dof", arm = 1.0 }', "arm"),
        ('"parallelogram-2dof"', '"point-mass"', "encoder_counts = 1000 for a point mass.*encoder_step"),
        ('"linearised"', '"linearized"', "inner_loop"),
        ("viscosity = 0.2", "viscosity = -0.2", "case 'one'.*viscosity"),
        ("friction = 0.01", "friction = -0.01", "case 'one-worn'.*friction"),
        ("friction = 0.01", "frictoin = 0.01", "case 'one-worn'.*frictoin.*friction"),
        ("encoder_counts = 1000", "encoder_counts = 1000, encoder_step = 0.1", "both encoder_counts and encoder_step"),
        ('"7.38"', '"7.83"', "unknown closed form '7.83'.*7.38"),
        ('variants = ["worn"]', 'variants = ["wron"]', "unknown variant 'wron'.*worn"),
        ("stiffness = 10.0, damping", "stifness = 10.0, damping", "hand"),
    ],
)
def test_what_a_robot_s_case_gets_wrong_is_named_when_it_is_read(tmp_path, old, new, message):
    assert old in ROBOT
    with pytest.raises(InputError, match=f"(?s)mine.toml:.*{message}"):
        load(tmp_path, ROBOT.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('{ kind = "circle" }', '{ kind = "circle", size = 0.8 }', "does not lie in the functional workspace.*7.1"),
        ("position = [0.1, 0.0]", "position = [0.6, 0.0]", "is outside of the functional workspace"),
        ('"7.38"', '"6.21"', "6.21 is about a line, and the model is 'circle'.*7.38"),
        ("force = [[0, 0.0, 0.0]]", "force = [[0, 0.0, 0.0], [1, 0.0, 0.0, 1.0]]", "rows of force differ"),
        ("force = [[0, 0.0, 0.0]]", 'force_file = "none.csv"', "no force file .*none.csv"),
        ("force = [[0, 0.0, 0.0]]", 'force = [[0, 0.0, 0.0]]\nforce_file = "none.csv"', "both force and force_file"),
        ("stiffness = 10.0", "stiffness = -10.0", "hand's stiffness"),
        ("[0.2, 0.0]]", "[0.2, 0.0, 0.0]]", "points of the hand's path differ"),
        (
            "path = { points = [[0.1, 0.0], [0.2, 0.0]], duration = 0.1 }",
            'path = { file = "none.csv" }',
            "no trajectory file .*none.csv",
        ),
        (
            "path = { points = [[0.1, 0.0], [0.2, 0.0]]",
            "path = { points = [[0.1, 0.0, 0.0], [0.2, 0.0, 0.0]]",
            "hand's path is in 3D",
        ),
    ],
)
def test_what_no_robot_could_do_is_named_before_a_run(tmp_path, old, new, message):
    assert old in ROBOT
    case = load(tmp_path, ROBOT.replace(old, new)).cases[0]
    with pytest.raises(InputError, match=f"(?s)case 'one'.*{message}"):
        case.check_stimulus()


def test_forces_are_read_from_a_file(tmp_path):
    (tmp_path / "pulses.csv").write_text("t,fx,fy\n0,0,0\n0.05,1,-2\n0.1,0,0\n")
    text = ROBOT.replace("force = [[0, 0.0, 0.0]]", 'force_file = "pulses.csv"')
    case = load(tmp_path, text).cases[0]
    experiment = case.build_stimulus(case.build_scene(), None)
    np.testing.assert_allclose(experiment.operator_force(np.array([0.025, 0.05])), [[0.5, -1.0], [1.0, -2.0]])
    (tmp_path / "pulses.csv").write_text("t,fx,fy\n0,0,0\n0.05,much,-2\n")
    with pytest.raises(InputError, match=r"pulses.csv, row 1, column fx: 'much' is not a number"):
        case.build_stimulus(case.build_scene(), None)


def test_a_hand_draws_along_the_path_of_a_recording(tmp_path):
    time = np.linspace(3.0, 3.1, 51)
    hips = np.column_stack([0.1 - 0.2 * (time - 3.0), 0.1 * (time - 3.0)])
    write_recording(tmp_path / "drawn.h5", Recording(time, {"hip": hips}))
    text = ROBOT.replace("{ points = [[0.1, 0.0], [0.2, 0.0]], duration = 0.1 }", '{ file = "drawn.h5" }')
    case = load(tmp_path, text).cases[0]
    experiment = case.build_stimulus(case.build_scene(), None)
    np.testing.assert_allclose(experiment.hand.desired(time - 3.0), hips, atol=1e-15)


SPACE = """
title = "mine"
[[case]]
name = "one"
title = "One"
model = { kind = "sphere" }
checks = ["continuous-contact"]
"""


def test_a_model_in_space_takes_a_hand_in_space(tmp_path):
    points = 'trajectory = { kind = "points", points = [[0.12, 0.0, 0.0], [0.08, 0.02, 0.01]], duration = 1 }\n'
    case = load(tmp_path, SPACE + points).cases[0]
    case.check_stimulus()
    assert case.build_stimulus(case.build_scene(), None).dimension == 3
    flat = load(tmp_path, SPACE + "experiment = { duration = 1, position = [0.1, 0.0] }\n").cases[0]
    with pytest.raises(InputError, match="led in 2D on a 3D model"):
        flat.check_stimulus()
    built = 'trajectory = { kind = "arc", depth = 0.01, from_angle = 0, to_angle = 90, duration = 1 }\n'
    with pytest.raises(InputError, match="'arc' is built on a plane curve"):
        load(tmp_path, SPACE + built).cases[0].check_stimulus()


def test_a_name_that_begins_several_suites_is_all_of_them():
    assert suite_groups()["dynamics"] == tuple(name for name in find_suites() if name.startswith("dynamics-"))
    assert suites_named("dynamics") == suite_groups()["dynamics"]
    assert suites_named("thesis") == ("thesis",)
    assert suites_named("elsewhere/mine.toml") == ("elsewhere/mine.toml",)
    with pytest.raises(UnknownNameError, match="did you mean dynamics"):
        suites_named("dynamic")


def test_a_misspelt_entry_is_told_its_likeliest_meaning(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        'title = "t"\n[[case]]\nname = "c"\ntitle = "t"\nmodel = { kind = "circle" }\nchecks = ["memoryless"]\n'
        "scene = { stifness = 3.0 }\n"
        'trajectory = { kind = "scaled", depth = 0.001, from_angle = 0, to_angle = 9, duration = 1 }\n'
    )
    with pytest.raises(InputError) as caught:
        load_suite(str(file))
    assert "stifness" in caught.value.what
    assert caught.value.todo == "did you mean stiffness?"
