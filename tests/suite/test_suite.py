"""Suites: what is installed, what a file may say, and what it may get wrong."""

from __future__ import annotations

import numpy as np
import pytest
from honest import Spring

from hapticeval.effects.actuators import JointFriction
from hapticeval.effects.sensors import Encoder
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import circle
from hapticeval.recordings.hdf5 import write_recording
from hapticeval.recordings.recording import Recording
from hapticeval.stimulus.hard_places import HardPlaces
from hapticeval.suite import outline as outlines
from hapticeval.suite.outline import find_suites, outline, suite_groups, suites_named
from hapticeval.suite.reading import case_named, load_suite

POINTS = 'trajectory = { kind = "points", points = [[0.12, 0.0], [0.08, 0.02]], duration = 1 }'

CASE = f"""
title = "mine"
[[case]]
name = "one"
title = "One"
model = {{ kind = "circle" }}
checks = ["continuous-contact"]
{POINTS}
"""

ROW = """
[[row]]
title = "Mine"
check = {check}
cases = {cases}
"""

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

HAND = "{ points = [[0.1, 0.0], [0.2, 0.0]], duration = 0.1 }"


@pytest.fixture
def load(tmp_path):
    """Load a suite from its text, with some of it replaced."""

    def load(text, *replaced):
        for old, new in zip(replaced[::2], replaced[1::2], strict=True):
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "mine.toml").write_text(text)
        return load_suite(str(tmp_path / "mine.toml"))

    return load


def stimulus(case):
    return case.build_stimulus(case.build_scene(), None)


def test_the_thesis_suite_has_the_cases_of_chapter_6():
    cases = load_suite("thesis").cases
    names = {case.name for case in cases}
    assert {
        "cassinian-shallow-slide", "cassinian-deep-slide", "star-concave-corner", "star-convex-corner",
        "ambiguous-push", "plane-press", "plane-impact", "line-constraint", "circle-constraint", "circle-slide",
    } <= names  # fmt: skip
    assert any(name.startswith("cassinian-depth-sweep-") for name in names)
    assert all(case.citation and case.shows for case in cases)
    assert [case.name for case in cases if not case.judged] == ["ambiguous-push"]


def test_every_unilateral_case_that_is_installed_asks_for_the_contact_to_be_kept():
    for name in find_suites():
        for case in load_suite(name).cases:
            leaps = isinstance(case.trajectory, HardPlaces)  # a hand that leaps goes no way that could be barred
            assert ("contact-kept" in case.checks) is not (case.build_scene().bilateral or leaps), case.name


@pytest.mark.parametrize(
    ("names", "groups"),
    [
        (("hard-cases-loops", "hard-cases-places"), {"hard-cases": ("hard-cases-loops", "hard-cases-places")}),
        (("wall", "wall-low"), {}),
        (("walls-high", "wall-low"), {}),
    ],
)
def test_a_group_is_what_whole_words_have_in_common_unless_a_suite_has_that_name(monkeypatch, names, groups):
    monkeypatch.setattr(outlines, "find_suites", lambda: dict.fromkeys(names))
    assert outlines.suite_groups() == groups


def test_suites_and_cases_are_found_by_name_and_by_group(refused, tmp_path):
    assert suite_groups()["dynamics"] == tuple(name for name in find_suites() if name.startswith("dynamics-"))
    assert suites_named("dynamics") == suite_groups()["dynamics"]
    assert suites_named("thesis") == ("thesis",)
    assert suites_named("elsewhere/mine.toml") == ("elsewhere/mine.toml",)
    assert case_named("thesis/plane-press").name == "plane-press"
    for call in (
        lambda: load_suite("thesys"),
        lambda: suites_named("dynamic"),
        lambda: case_named("thesis/plane-pres"),
        lambda: case_named("plane-press"),
        lambda: load_suite(str(tmp_path / "none.toml")),
    ):
        with refused(InputError):
            call()


def test_a_minimal_file_is_a_suite(load):
    suite = load(CASE)
    (case,) = suite.cases
    assert (suite.name, case.judged, case.depth_of) == ("mine", True, "model")
    np.testing.assert_allclose(stimulus(case).sampled(1.0)[1], [[0.12, 0.0], [0.08, 0.02]])


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('title = "mine"', 'title = "mine'),
        ("[[case]]", "[[cases]]"),
        ('kind = "circle"', 'kind = "circel"'),
        ('kind = "circle"', "size = 1"),
        ('kind = "circle"', 'kind = "circle", size = -1'),
        ('kind = "circle"', 'kind = "circle", size = 1e300'),
        ('kind = "circle"', 'kind = "circle", colour = "red"'),
        ('kind = "points"', 'kind = "point"'),
        ("continuous-contact", "continous-contact"),
        ("duration = 1", "speed = 1"),
        ("duration = 1", "duration = 0"),
        ("duration = 1", "duration = -1"),
        ("[0.08, 0.02]", "[0.08, 0.02, 0.0, 0.0]"),
        ('checks = ["continuous-contact"]', "checks = []"),
        ('name = "one"', 'name = "One two"'),
        (POINTS, ""),
        (POINTS, f"{POINTS}\nexperiment = {{ duration = 1, position = [0, 0] }}"),
        (POINTS, f'{POINTS}\nsweep = [{{ label = "a", depth = 0.01 }}]'),
        (POINTS, 'trajectory = { kind = "arc", from_angle = 0, to_angle = 9, duration = 1 }'),
        ('title = "One"', 'title = "One"\nscene = { stiffness = -1.0 }'),
        ('title = "One"', 'title = "One"\nscene = { stifness = 1.0 }'),
        ('title = "One"', 'title = "One"\nscene = { stiffness = "high" }'),
        ('title = "One"', 'title = "One"\nscene = { restitution = 2.0 }'),
        ('title = "One"', 'title = "One"\npublished = { mine = { memoryless = "pass" } }'),
        ('title = "One"', 'title = "One"\npublished = { mine = { continuous-contact = "passs" } }'),
    ],
)
def test_what_a_file_gets_wrong_is_named(refused, load, old, new):
    with refused(InputError):
        load(CASE, old, new)


def test_two_cases_of_one_name_are_refused(refused, load):
    with refused(InputError):
        load(CASE + CASE.split("\n", 2)[2])


@pytest.mark.parametrize(
    ("check", "cases", "expected"),
    [
        ('"memoryless"', '["o*"]', ("memoryless",)),
        ('["continuous-contact", "memoryless"]', '["o*"]', ("continuous-contact", "memoryless")),
        ('"reset-clears"', '["one"]', None),
        ('["continuous-contact", "reset-clears"]', '["one"]', None),
        ('["continuous-contact", "memoryless"]', '["one", "two"]', None),
        ('["continuous-contact", "memorless"]', '["one"]', None),
        ("[]", '["one"]', None),
    ],
)
def test_a_row_has_checks_and_cases_that_have_them(refused, load, check, cases, expected):
    text = CASE.replace('["continuous-contact"]', '["continuous-contact", "memoryless"]')
    text += ROW.format(check=check, cases=cases)
    if expected is not None:
        assert load(text).rows[0].checks == expected
        return
    with refused(InputError):
        load(text)


def test_a_sweep_makes_a_case_for_each_depth(load):
    swept = (
        'trajectory = { kind = "scaled", from_angle = 0, to_angle = 90, duration = 1 }\n'
        'sweep = [{ label = "a", depth = 0.01 }, { label = "b", depth = 0.02 }]'
    )
    cases = load(CASE, POINTS, swept).cases
    assert [(case.name, case.title) for case in cases] == [("one-a", "One: 10 mm"), ("one-b", "One: 20 mm")]
    for case, radius in zip(cases, (0.09, 0.08), strict=True):
        np.testing.assert_allclose(np.linalg.norm(stimulus(case).sampled(0.5)[1], axis=1), radius)


def test_hand_and_model_live_in_the_same_space(refused, load):
    flat = load(CASE, "[[0.12, 0.0], [0.08, 0.02]]", "[[0.12, 0.0, 0.0], [0.08, 0.02, 0.0]]").cases[0]
    with refused(InputError):
        stimulus(flat)
    deep = load(CASE, "circle", "sphere", "[[0.12, 0.0], [0.08, 0.02]]", "[[0.12, 0.0, 0.0], [0.08, 0.02, 0.01]]")
    deep.cases[0].check_stimulus()
    assert stimulus(deep.cases[0]).dimension == 3
    for given in (
        "experiment = { duration = 1, position = [0.1, 0.0] }",
        'trajectory = { kind = "arc", depth = 0.01, from_angle = 0, to_angle = 90, duration = 1 }',
    ):
        with refused(InputError):
            load(CASE, "circle", "sphere", POINTS, given).cases[0].check_stimulus()


def test_a_case_names_a_robot_its_inner_loop_and_a_hand(load):
    suite = load(ROBOT)
    case = suite.cases[0]
    case.check_stimulus()
    scene = case.build_scene()
    assert (suite.renderers, scene.robot.name) == (("set-stabilisation",), "parallelogram-2dof")
    assert (scene.inner_loop, scene.viscosity) == ("linearised", 0.2)
    hand = stimulus(case).hand
    assert (hand.stiffness, hand.damping) == (10.0, 1.0)
    np.testing.assert_allclose(hand.desired(np.array([0.05])), [[0.15, 0.0]])


def test_a_variant_is_the_case_in_another_scene_without_what_is_in_print(load):
    case, worn = load(ROBOT).cases
    assert (worn.name, worn.title, worn.shows, worn.judged) == ("one-worn", "One, worn", "Its joints rub.", False)
    scene = worn.build_scene()
    assert scene.effect(JointFriction).torque == 0.01
    assert scene.effect(Encoder).step == pytest.approx(2.0 * np.pi / 1000.0)
    assert scene.robot == case.build_scene().robot
    assert (case.closed_form, case.checks[-1]) == ({"set-stabilisation": "7.38"}, "closed-form")
    assert (worn.closed_form, worn.checks, worn.published) == ({}, ("output-invariance",), {})


@pytest.mark.parametrize(("device", "mass"), [("{ kind = 'point-mass', mass = 0.5 }", 0.5), ("'point-mass'", 0.1)])
def test_a_point_mass_has_the_tool_s_mass_where_it_gives_none(load, device, mass):
    robot = load(ROBOT, '"parallelogram-2dof"', device, ", encoder_counts = 1000", "").cases[0].build_scene().robot
    assert (robot.name, robot.dimension, robot.mass) == ("point-mass", 2, mass)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"parallelogram-2dof"', '"paralelogram-2dof"'),
        ('"parallelogram-2dof"', '"parallelogram-3dof"'),
        ('"parallelogram-2dof"', '{ kind = "parallelogram-2dof", arm = 1.0 }'),
        ('"parallelogram-2dof"', '"point-mass"'),
        ('"linearised"', '"linearized"'),
        ("viscosity = 0.2", "viscosity = -0.2"),
        ("friction = 0.01", "friction = -0.01"),
        ("friction = 0.01", "frictoin = 0.01"),
        ("encoder_counts = 1000", "encoder_counts = 1000, encoder_step = 0.1"),
        ('"7.38"', '"7.83"'),
        ('variants = ["worn"]', 'variants = ["wron"]'),
        ("stiffness = 10.0, damping", "stifness = 10.0, damping"),
        (HAND, "{ duration = 1.0 }"),
    ],
)
def test_what_a_robot_s_case_gets_wrong_is_named_when_it_is_read(refused, load, old, new):
    with refused(InputError):
        load(ROBOT, old, new)


FORCE = "force = [[0, 0.0, 0.0]]"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('{ kind = "circle" }', '{ kind = "circle", size = 0.8 }'),
        ("position = [0.1, 0.0]", "position = [0.6, 0.0]"),
        ('"7.38"', '"6.21"'),
        (FORCE, "force = [[0, 0.0, 0.0], [1, 0.0, 0.0, 1.0]]"),
        (FORCE, 'force_file = "none.csv"'),
        (FORCE, f'{FORCE}\nforce_file = "none.csv"'),
        ("stiffness = 10.0", "stiffness = -10.0"),
        ("[0.2, 0.0]]", "[0.2, 0.0, 0.0]]"),
        (HAND, '{ file = "none.csv" }'),
        ("[[0.1, 0.0], [0.2, 0.0]]", "[[0.1, 0.0, 0.0], [0.2, 0.0, 0.0]]"),
    ],
)
def test_what_no_robot_could_do_is_named_before_a_run(refused, load, old, new):
    case = load(ROBOT, old, new).cases[0]
    with refused(InputError):
        case.check_stimulus()


def test_forces_and_hand_paths_are_read_from_files(refused, load, tmp_path):
    pulses = tmp_path / "pulses.csv"
    pulses.write_text("t,fx,fy\n0,0,0\n0.05,1,-2\n0.1,0,0\n")
    time = np.linspace(3.0, 3.1, 51)
    hips = np.column_stack([0.1 - 0.2 * (time - 3.0), 0.1 * (time - 3.0)])
    write_recording(tmp_path / "drawn.h5", Recording(time, {"hip": hips}))
    case = load(ROBOT, FORCE, 'force_file = "pulses.csv"', HAND, '{ file = "drawn.h5" }').cases[0]
    experiment = stimulus(case)
    np.testing.assert_allclose(experiment.operator_force(np.array([0.025, 0.05])), [[0.5, -1.0], [1.0, -2.0]])
    np.testing.assert_allclose(experiment.hand.desired(time - 3.0), hips, atol=1e-15)
    pulses.write_text("t,fx,fy\n0,0,0\n0.05,much,-2\n")
    with refused(InputError):
        stimulus(case)


@pytest.mark.parametrize("name", find_suites())
def test_an_outline_is_what_the_suite_has(name):
    suite, read = load_suite(name), outline(find_suites()[name])
    assert (read.title, read.citation) == (suite.title, suite.citation)
    assert [(*heading, judged) for heading, judged in read.cases] == [
        (case.name, case.title, case.judged) for case in suite.cases
    ]


@pytest.mark.parametrize(("counts_from", "depth"), [("model", 1e-3), ("representation", 11e-3)])
def test_depths_count_from_the_surface_that_the_case_names_once_there_is_a_renderer(load, counts_from, depth):
    """The renderer's circle lies 10 mm under the model's."""
    arc = 'trajectory = { kind = "arc", depth = 0.001, from_angle = 0, to_angle = 90, duration = 1 }'
    (case,) = load(CASE.replace(POINTS, f'depth_of = "{counts_from}"\n{arc}')).cases
    scene = case.build_scene()
    renderer = Spring(scene)
    renderer.surface = circle(0.18).boundary
    for asked, expected in ((renderer, depth), (None, 1e-3)):
        hips = case.build_stimulus(scene, asked).sampled(1e-3)[1]
        np.testing.assert_allclose(0.1 - np.linalg.norm(hips, axis=1), expected, atol=1e-6)
