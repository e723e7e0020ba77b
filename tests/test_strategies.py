"""Public strategies: what is drawn is a hand's, reaches what it is for, can be pasted as it prints, and repeats."""

from __future__ import annotations

import itertools
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from hapticeval import Scene, make_model, strategies
from hapticeval.effects.viscous_friction import Viscosity
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.geometry.catalogue import MODELS
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.moves import LARGEST_ACCELERATION, LARGEST_SPEED, Move, Moves, Tremor
from hapticeval.strategies import (
    MESHES,
    PARTS,
    PLANE_MODELS,
    SURFACES,
    effects,
    examples,
    hand_paths,
    laps,
    meshes,
    plane_models,
    pushes,
    scenes,
    surfaces,
)

NAMES = {"Moves": Moves, "Move": Move, "Tremor": Tremor, "ExperimentTable": ExperimentTable, "make_model": make_model}
MODEL = {
    kind: make_model(kind) for kind in ("star", "cassinian", "ellipse", "line", "sphere", "torus", "l-block", "cube")
}
COUNT = 100


@pytest.mark.system
def test_examples_leave_nothing_in_the_folder(tmp_path):
    code = "from hapticeval import strategies as s; s.examples(s.plane_models(), 3)"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / ".hypothesis").mkdir()  # of somebody's own tests, whose caches are kept where they are
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    assert [file.name for file in tmp_path.iterdir()] == [".hypothesis"]


def test_the_public_names_stay_and_each_is_documented():
    documented = {
        *(
            "examples",
            "hand_paths",
            "laps",
            "meshes",
            "plane_models",
            "pushes",
            "scenes",
            "surfaces",
            "effects",
            "motions",
        ),
        *("MESHES", "PARTS", "PLANE_MODELS", "SURFACES"),
    }
    assert set(strategies.__all__) == documented
    assert all(callable(getattr(strategies, name)) for name in documented if name.islower())


@pytest.mark.parametrize("tremor", [False, True])
@pytest.mark.parametrize("kind", list(MODEL))
def test_paths_keep_to_what_a_hand_can_do_and_begin_in_free_space(kind, tremor):
    for moves in examples(hand_paths(MODEL[kind], tremor=tremor), 20, seed=5):
        hips = moves.path().sampled(1e-3)[1]
        velocity = np.diff(hips, axis=0) / 1e-3
        acceleration = np.diff(velocity, axis=0) / 1e-3
        assert np.linalg.norm(velocity, axis=1).max() <= LARGEST_SPEED
        assert np.linalg.norm(acceleration, axis=1).max() <= LARGEST_ACCELERATION
        assert MODEL[kind].boundary.signed_distance(hips[:1])[0] > 0.0
        steady = replace(moves, tremor=None).path().sampled(1e-3)[1]
        acceleration = np.diff(np.pad(steady, ((2, 2), (0, 0)), mode="edge"), n=2, axis=0)
        power = np.sum(np.abs(np.fft.rfft(acceleration, n=2**15, axis=0)) ** 2, axis=1)
        frequency = np.fft.rfftfreq(2**15, 1e-3)
        assert power[frequency > 10.0].sum() <= 1e-3 * power.sum()


def reached(moves, model):
    """Return which of the compositions a path contains, by where it leads and not by how it was drawn."""
    hips = moves.path().sampled(1e-3)[1]
    frame = model.boundary.closest_point(hips)
    inside = frame.distance < 0.0
    step = np.linalg.norm(np.diff(hips, axis=0), axis=1)
    foot = np.linalg.norm(np.diff(frame.foot, axis=0), axis=1)
    pressed = inside[1:] & inside[:-1]
    slides = np.where(pressed & (foot < 4.0 * step + 1e-9), foot, 0.0)
    found = {
        "approach": not inside[0] and inside.any(),
        "contact": inside.sum() > 10,
        "slide": slides.sum() > 0.05 * model.size,
        "rest": longest(pressed & (step == 0.0)) >= 90,
        "release": bool(np.any(inside) and np.any(~inside[int(np.argmax(inside)) :])),
        "medial-axis": bool(np.any(pressed & (foot > 20.0 * step + 1e-3 * model.size))),
    }
    edges = np.flatnonzero(np.diff(inside.astype(int)))
    stays = [(a + 1, b) for a, b in itertools.pairwise(edges) if inside[a + 1]]
    found["graze"] = any(
        -frame.distance[a : b + 1].min() < 5e-3 * model.size and np.linalg.norm(hips[b] - hips[a]) > 0.01 * model.size
        for a, b in stays
    )
    bend = np.linalg.eigvalsh(frame.shape).max(axis=1)
    found["focal-point"] = bool(np.any(inside & (1.0 + frame.distance * bend < 0.15)))
    for convex in (True, False):
        along = [c for c in model.boundary.corners if c.convex == convex]
        found["convex corner" if convex else "concave corner"] = any(passes(hips, c, model.size) for c in along)
    return found


def longest(flags):
    """The number of true values in the longest run of them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def passes(hips, corner, size):
    """Whether the hand goes past a corner, under one of its faces before it, and not far from it."""
    near = np.linalg.norm(hips - corner.position, axis=1) < 0.1 * size
    for ahead, normal in ((corner.tangent_pre, corner.normal_pre), (-corner.tangent_post, corner.normal_post)):
        along, under = (hips - corner.position) @ ahead, -(hips - corner.position) @ normal
        over = near[1:] & near[:-1] & (along[:-1] <= 0.0) & (along[1:] > 0.0) & (under[1:] > 0.0)
        if np.any(over):
            return True
    return False


@pytest.mark.parametrize(
    ("kind", "lacks"),
    [
        ("star", {"focal-point"}),  # flat faces have no centre of curvature
        ("cassinian", {"convex corner", "concave corner"}),
        ("ellipse", {"convex corner", "concave corner"}),
    ],
)
def test_each_composition_is_reached_in_a_twentieth_of_the_examples(kind, lacks):
    counts = dict.fromkeys(reached(examples(hand_paths(MODEL[kind]), 1)[0], MODEL[kind]), 0)
    for moves in examples(hand_paths(MODEL[kind]), COUNT, seed=1):
        for what, there in reached(moves, MODEL[kind]).items():
            counts[what] += there
    rare = {what: count for what, count in counts.items() if count < COUNT / 20}
    assert set(rare) == lacks, counts


@pytest.mark.parametrize(("kind", "past"), [("star", False), ("star", True), ("dumbbell", False), ("cassinian", False)])
def test_a_lap_leads_twice_along_the_whole_outline_and_to_each_corner(kind, past):
    model = make_model(kind)
    curve = model.curve
    for moves in examples(laps(model, past=past), 6, seed=1):
        hips = moves.path().sampled(1e-2)[1]
        way = hips[round(100.0 * sum(move.seconds for move in moves.moves[:3])) :]
        s = curve.arc_length(curve.nearest(way if past else way[curve.contains(way)]))
        steps = (np.diff(s) + 0.5 * curve.length) % curve.length - 0.5 * curve.length
        assert abs(steps.sum()) > 1.85 * curve.length
        deepest = 0.01 * model.size
        for corner in curve.corners:
            assert np.min(np.linalg.norm(hips - corner.position, axis=1)) < 2.0 * deepest
            if past and corner.convex:
                out = corner.tangent_pre - corner.tangent_post
                assert np.max((hips - corner.position) @ out) > deepest
        assert eval(repr(moves), NAMES) == moves


@pytest.mark.parametrize("kind", ["sphere", "line"])
def test_there_is_no_lap_without_a_closed_outline(refused, kind):
    with refused(InputError):
        laps(make_model(kind))


@pytest.mark.parametrize("part", PARTS)
def test_a_part_can_be_asked_for_alone(part):
    found = examples(hand_paths(MODEL["cube" if part == "vertex" else "star"], parts=[part], most_parts=1), 10)
    assert all(moves.length > 0.0 for moves in found)


@settings(max_examples=30)
@given(hand_paths(MODEL["cassinian"], tremor=True))
def test_a_hand_path_prints_as_what_makes_it(moves):
    assert eval(repr(moves), NAMES) == moves


@settings(max_examples=30)
@given(st.data(), plane_models())
def test_models_and_pushes_print_as_what_makes_them(data, model):
    assert eval(repr(model), NAMES).table == model.table
    push = data.draw(pushes(model))
    assert eval(repr(push), NAMES) == push


@pytest.mark.parametrize("kind", list(MESHES))
def test_meshes_of_each_kind_are_sound_print_as_what_makes_them_and_can_be_touched(kind):
    drawn = examples(meshes(kinds=[kind]), 6, seed=2)
    assert len({str(model.table) for model in drawn}) >= 3
    for model in drawn:
        assert 0.01 < model.size < 0.8
        assert model.dimension == 3
        assert model.boundary.signed_distance(model.boundary.points(50)) == pytest.approx(np.zeros(50), abs=1e-12)
    model = drawn[-1]
    assert eval(repr(model), NAMES).table == model.table
    (moves,) = examples(hand_paths(model, most_parts=1), 1)
    assert len(moves.start) == 3
    assert eval(repr(moves), NAMES) == moves


def touched_together(moves, model):
    """Whether the hand is under two faces, and under three, of those that meet at an edge and at a vertex beside it."""
    hips = moves.path().sampled(1e-3)[1]
    low = 0.5 * model.size

    def under(*normals):
        """Whether it is, at some time, less than a fifth of the size under each of the box's sides."""
        depths = [low - hips @ normal for normal in normals]
        return bool(np.any(np.all([(depth > 0.0) & (depth < 0.2 * model.size) for depth in depths], axis=0)))

    axes = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    pairs = [pair for pair in itertools.combinations(axes, 2) if pair[0] @ pair[1] == 0.0]
    triples = [t for t in itertools.combinations(axes, 3) if all(a @ b == 0.0 for a, b in itertools.combinations(t, 2))]
    return any(under(*pair) for pair in pairs), any(under(*triple) for triple in triples)


def test_in_space_edges_and_vertices_are_visited_and_in_a_notch_both_faces_are_touched():
    cube, block = MODEL["cube"], MODEL["l-block"]
    on_cube = [touched_together(moves, cube) for moves in examples(hand_paths(cube), COUNT, seed=1)]
    assert sum(pair for pair, _ in on_cube) > COUNT / 5
    assert sum(triple for _, triple in on_cube) > COUNT / 10
    # The notch of the L: its legs are 40 mm thick, and its inner faces look along x and y.
    inner = 0.04 - 0.5 * block.size
    in_notch = 0
    for moves in examples(hand_paths(block), COUNT, seed=1):
        depth = inner - moves.path().sampled(1e-3)[1][:, :2]
        in_notch += bool(np.any(np.all((depth > 0.0) & (depth < 0.02), axis=1)))
    assert in_notch > COUNT / 10


@pytest.mark.parametrize("kind", list(SURFACES))
def test_surfaces_of_each_kind_are_sound_and_print_as_what_makes_them(kind):
    drawn = examples(surfaces(kinds=[kind]), 10, seed=2)
    assert len({str(model.table) for model in drawn}) >= 3
    for model in drawn:
        assert 0.01 < model.size < 0.8
        assert model.boundary.signed_distance(model.boundary.points(50)) == pytest.approx(np.zeros(50), abs=1e-12)
        assert eval(repr(model), NAMES).table == model.table


@pytest.mark.parametrize("kind", list(PLANE_MODELS))
def test_models_of_each_kind_are_sound_and_centimetres_in_size(kind):
    drawn = examples(plane_models(kinds=[kind]), 15, seed=2)
    assert len({str(model.table) for model in drawn}) >= 4
    for model in drawn:
        assert 0.01 < model.size < 0.8
        assert model.table["kind"] in MODELS
        assert model.boundary.signed_distance(model.boundary.points(50)) == pytest.approx(np.zeros(50), abs=1e-12)


@pytest.mark.parametrize("bilateral", [False, True])
@pytest.mark.parametrize("kind", ["star", "cassinian", "sphere"])
def test_pushes_start_where_they_may(kind, bilateral):
    for push in examples(pushes(MODEL[kind], bilateral=bilateral), 20):
        start = push.experiment(None).position
        off = MODEL[kind].boundary.signed_distance(start[np.newaxis])[0]
        assert off == pytest.approx(0.0, abs=1e-9) if bilateral else off > -1e-9


@settings(max_examples=20)
@given(scenes(called=st.tuples(effects("viscosity", coefficient=st.sampled_from([0.1, 1.0])))))
def test_scenes_have_the_effects_that_are_called_for(scene):
    assert isinstance(scene, Scene)
    assert scene.effect(Viscosity).coefficient in (0.1, 1.0)


@pytest.mark.system
def test_the_examples_of_a_seed_are_the_same_whatever_is_loaded(tmp_path):
    """In processes of their own: nothing that the tests have set takes part."""
    script = (
        "from hapticeval import make_model\n"
        "from hapticeval.strategies import *\n"
        "print(examples(plane_models(), 5, seed=4))\n"
        "for seed in (4, 5): print(examples(hand_paths(make_model('star')), 5, seed=seed))\n"
    )
    (tmp_path / "mine.py").write_text("HERE = (" + ", ".join(f"{k}, {k}.5" for k in range(1, 4000, 7)) + ")\n")
    answers = []
    for before in ("", "import mine\n"):
        done = subprocess.run(
            [sys.executable, "-c", before + script], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        answers.append(done.stdout.splitlines())
    assert answers[0] == answers[1]
    assert answers[0][1] != answers[0][2], "another seed gives other examples"


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: hand_paths("star"),
        lambda: hand_paths(MODEL["star"], parts="slide"),
        lambda: hand_paths(MODEL["star"], parts=[]),
        lambda: hand_paths(MODEL["star"], most_parts=0),
        lambda: hand_paths(MODEL["star"], most_parts=True),
        lambda: hand_paths(MODEL["cassinian"], parts=["corner"]),
        lambda: pushes(None),
        lambda: plane_models(kinds=[]),
        lambda: plane_models(kinds="star"),
        lambda: meshes(kinds=[]),
        lambda: scenes(models=MODEL["star"]),
        lambda: examples(st.none(), 0),
    ],
)
def test_arguments_that_mean_nothing_are_refused_at_once(wrong):
    with pytest.raises(InputError):
        wrong()


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: hand_paths(MODEL["star"], parts=["slide", "silde"]),
        lambda: plane_models(kinds=["stars"]),
        lambda: meshes(kinds=["cubes"]),
        lambda: effects("viscocity"),
    ],
)
def test_names_that_are_not_known_get_the_closest(refused, wrong):
    with refused(UnknownNameError):
        wrong()
