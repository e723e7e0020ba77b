"""The search: what it finds is small, of the same kind, on disk, tried again, and the same for the same seed."""

from __future__ import annotations

import json
import time
from collections import Counter
from contextlib import nullcontext
from pathlib import Path

import msgspec
import numpy as np
import pytest

from hapticeval import cli, strategies
from hapticeval.commands.search import describe_search, draw_counterexample
from hapticeval.discovery import resolve
from hapticeval.errors import InputError
from hapticeval.geometry.catalogue import make_model
from hapticeval.pulse import compiling
from hapticeval.runner.judging import judge
from hapticeval.search import seeds, trial
from hapticeval.search.counterexample import line, list_counterexamples, notes, read_all, stored_counterexample, write
from hapticeval.search.drawing import FIRST_MODELS, draw_cases, judgeable, judges_paths
from hapticeval.search.hunt import Search
from hapticeval.search.seeds import Hunt, HuntResult, run_hunts
from hapticeval.search.shrink import size_of
from hapticeval.search.trial import RENDERER, Bench, Fault, Stopped
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.moves import Move, Moves
from hapticeval.suite.case import Case
from hapticeval.suite.reading import load_suite

JUMP = "continuous-contact"


def searched(renderer, checks, *, models=(), most=30, seed=0, over=lambda: False, known=()):
    """A search that no clock ends."""
    with Bench(renderer, seed, over) as bench:
        made = Search(bench, checks, seed, [make_model(each) for each in models], known, most)
        made.run()
    return made


@pytest.fixture(scope="module")
def jump():
    """What a search finds of the nearest-point projection's pop-through."""
    return searched("minimum-distance", [JUMP]).counterexamples[JUMP]


def test_a_pop_through_is_shrunk_to_a_move_of_less_than_three_millimetres(jump):
    moves = jump.case.trajectory
    assert len(moves.moves) <= 2
    assert moves.length <= 3e-3
    assert jump.complete
    assert jump.fault.kind == "major"


def test_its_coordinates_are_round_and_its_hand_starts_in_free_space(jump):
    moves = jump.case.trajectory
    points = np.array([moves.start, *(move.to for move in moves.moves)])
    assert np.allclose(points, np.round(points, 5), atol=1e-12)
    model = make_model(**jump.case.model)
    assert model.boundary.signed_distance(points[:1])[0] > 0.0


def test_a_bisection_places_the_jump_to_a_nanometre(jump):
    low, high, left = jump.pair
    assert np.linalg.norm(high - low) <= 1e-9
    assert left == pytest.approx(jump.fault.value, rel=0.05)
    assert "between HIPs" in notes(stored_counterexample(jump, "minimum-distance", 0))[0]


def test_one_line_says_what_breaks_on_how_small_a_path(jump):
    said = line(stored_counterexample(jump, "minimum-distance", 0))
    assert said.startswith("pop-through of ")
    assert " on a path of " in said
    assert said.endswith(f"after {jump.examples} examples")


def test_what_is_written_fails_without_hypothesis_in_the_same_way(jump, tmp_path):
    files = write(stored_counterexample(jump, "minimum-distance", 0), tmp_path)
    case = load_suite(str(files[0])).cases[0]
    judged = judge(resolve("minimum-distance"), "minimum-distance", "found", case)
    finding = judged.verdicts[0].finding
    assert finding.outcome == "fail"
    assert finding.message == jump.fault.message
    assert read_all(tmp_path)[0].case.trajectory == jump.case.trajectory


def test_folders_are_named_as_renderers_are_and_two_that_differ_by_case_have_one_each(jump, tmp_path):
    names = ("mine:Nearest", "mine:nearest", "mine:Nearest")
    places = [write(stored_counterexample(jump, name, 0), tmp_path)[0].parent.name for name in names]
    assert places[0] == places[2] == "mine-nearest"
    assert places[1].startswith("mine-nearest~")
    assert {each.renderer for each in read_all(tmp_path)} == set(names)


@pytest.mark.system
def test_the_same_seed_gives_the_same_bytes_and_knows_nothing_of_time(jump, tmp_path):
    again = searched("minimum-distance", [JUMP]).counterexamples[JUMP]
    files = [
        write(stored_counterexample(each, "minimum-distance", 0), tmp_path / str(at))
        for at, each in enumerate((jump, again))
    ]
    for each in files:
        each += draw_counterexample(stored_counterexample(jump, "minimum-distance", 0), each[0], lambda: False)
    for one, other in zip(*files, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_what_is_known_is_tried_first(jump):
    made = searched("minimum-distance", [JUMP], known=[(jump.case, jump.examples)])
    assert made.tried == 0
    assert made.counterexamples[JUMP].case.trajectory == jump.case.trajectory
    assert made.counterexamples[JUMP].examples == jump.examples


def test_a_search_that_is_stopped_keeps_the_smallest_so_far():
    counts = {"left": 10**9}

    def report(text):
        counts["left"] = 40  # polls and trials from the first failure on

    def over():
        counts["left"] -= 1
        return counts["left"] < 0

    with Bench("minimum-distance", 0, over) as bench:

        class Counted:
            aside, call_in_case = bench.aside, bench.call_in_case

            def __call__(self, case):
                if over():
                    raise Stopped
                return bench(case)

        made = Search(Counted(), [JUMP], 0, report=report)
        made.run()
    assert not made.finished
    assert not made.counterexamples[JUMP].complete
    assert "the time was over" in " ".join(
        notes(stored_counterexample(made.counterexamples[JUMP], "minimum-distance", 0))
    )


def test_cases_come_in_the_same_order_whatever_checks_are_found_meanwhile():
    left = list(judgeable())
    cases = draw_cases([], left, 0)
    first = [next(cases) for _ in range(12)]
    left[:] = [JUMP]
    assert next(cases).checks == (JUMP,)
    whole = draw_cases([], list(judgeable()), 0)
    assert [case.trajectory for case in first] == [next(whole).trajectory for _ in range(12)]


def test_checks_of_a_closed_loop_get_experiments():
    looped = [name for name in judgeable() if name in ("impulsive-collision", "centripetal-force")]
    cases = draw_cases([], looped, 0)
    assert all(next(cases).experiment is not None for _ in range(10))
    from hapticeval.phenomena.registry import CHECKS

    assert not any(judges_paths(CHECKS[name]) for name in looped)
    assert judges_paths(CHECKS["passivity"])


def test_the_impulse_that_a_spring_does_not_take_out_is_found():
    made = searched("minimum-distance", ["impulsive-collision"])
    found = made.counterexamples["impulsive-collision"]
    assert found.case.experiment.duration <= 0.05
    assert len(found.case.experiment.force or []) <= 1


@pytest.mark.system
@pytest.mark.parametrize(("name", "kind"), [("Raises", "ZeroDivisionError"), ("Dies", "dies"), ("Hangs", "hangs")])
def test_a_renderer_that_breaks_is_a_counterexample_and_shrinks(mine, monkeypatch, name, kind):
    monkeypatch.setattr(trial, "FIRST_SILENCE", 6.0)
    monkeypatch.setattr(trial, "SILENCE", 0.5)
    for name_ in ("TRIALS_PER_TURN", "MOST_TRIALS"):
        monkeypatch.setattr(f"hapticeval.search.hunt.{name_}", 12)
    found = searched(f"mine:{name}", ["contact-kept"]).counterexamples[RENDERER]
    assert kind in found.fault.kind
    assert len(found.case.trajectory.moves) <= 2
    if name == "Hangs":
        sleeps = (mine / "mine.py").read_text().splitlines().index("        time.sleep(3600)") + 1
        said = f"it is in mine.py, line {sleeps}, in bad: time.sleep(3600); on a path of"
        made = stored_counterexample(found, "mine:Hangs", 0)
        assert said in line(made)
        assert said in write(made, mine)[0].read_text()


def test_a_renderer_that_goes_on_answering_is_slow_and_does_not_hang(mine, monkeypatch):
    for name in ("FIRST_SILENCE", "SILENCE"):
        monkeypatch.setattr(trial, name, 1.0)
    searched("mine:Nearest", ["reset-clears"], models=["circle"], most=1)  # so that nothing is to be compiled
    begun = time.monotonic()
    made = searched("mine:Slow", ["reset-clears"], models=["circle"], most=1)
    assert time.monotonic() - begun > 1.0
    assert made.tried == 1
    assert not made.counterexamples


def silence(renderer, seed, how, seconds=1.0):
    """Be silent for some seconds, while code is compiled or while it is not."""
    with compiling() if how == "compiling" else nullcontext():
        time.sleep(seconds)
    return how


def test_no_renderer_is_blamed_for_the_time_that_its_case_is_compiled(mine, monkeypatch):
    for name in ("FIRST_SILENCE", "SILENCE"):
        monkeypatch.setattr(trial, name, 0.5)
    case = next(draw_cases((), [JUMP], 0))
    with Bench("mine:Nearest", 0, lambda: False) as bench:
        assert bench.call_in_case(case, silence, "compiling") == "compiling"
        assert bench.call_in_case(case, silence, "hanging") is None


@pytest.mark.system
def test_a_renderer_that_prepares_its_model_anew_does_not_hang(mine, monkeypatch):
    """Its first case on a model may take longer, and later ones twice as long as that."""
    monkeypatch.setattr(trial, "FIRST_SILENCE", 6.0)
    monkeypatch.setattr(trial, "SILENCE", 0.5)
    case = next(draw_cases((), [JUMP], 0))
    with Bench("mine:Nearest", 0, lambda: False) as bench:
        assert bench.call_in_case(case, silence, "preparing", 2.0) == "preparing"
        assert bench.call_in_case(case, silence, "preparing", 2.5) == "preparing"
        assert bench.call_in_case(case, silence, "hanging", 30.0) is None


def stopped_after(polls):
    """What a search asks whether its time is over: true from so many times on."""
    left = iter(range(polls))
    return lambda: next(left, None) is None


def never(*_):
    """Draw for an hour."""
    time.sleep(3600)


def test_the_end_of_the_time_ends_the_drawing_of_cases(monkeypatch):
    monkeypatch.setattr("hapticeval.search.drawing._draw_paths", never)
    made = searched("ideal", [JUMP], over=stopped_after(3))
    assert (made.finished, made.tried) == (False, 0)


def test_the_end_of_the_time_ends_a_case_that_is_slow(mine, monkeypatch):
    monkeypatch.setattr(trial, "TOLD_SILENCE", 0.0)
    looks = stopped_after(3)  # the first one after the last answer sees no silence yet
    made = searched("mine:Hangs", ["contact-kept"], over=lambda: (mine / "hangs").exists() and looks())
    assert not made.finished
    assert "given no answer for" in made.silence
    assert "mine.py, line" in made.silence


def test_the_last_lines_say_what_the_end_of_the_time_has_cut_short(jump):
    hunt = Hunt("minimum-distance", [JUMP, "seams"], [], [], 8.0, None)
    cut_short = msgspec.structs.replace(stored_counterexample(jump, "minimum-distance", 0), complete=False)
    outcome = HuntResult([cut_short], Counter(), 1, 9, None, False, "the renderer had given no answer for 3 s")
    assert describe_search(hunt, outcome, 8.1).splitlines() == [
        "1 example drawn, 9 tried in 8.1 s; the time was over",
        "at the end the renderer had given no answer for 3 s",
        "not shrunk to the end; search again, or give more --seconds: continuous-contact",
        "no example decides: seams",
    ]
    assert "4.0 s; interrupted" in describe_search(hunt, outcome, 4.0)


def test_the_end_of_their_time_ends_the_drawing_of_pictures(jump, mine, tmp_path):
    made = stored_counterexample(jump, "minimum-distance", 0)
    assert draw_counterexample(made, tmp_path / "a.toml", stopped_after(0)) is None
    replace = msgspec.structs.replace
    deep = replace(made.trajectory, moves=(replace(made.trajectory.moves[0], to=[0.0, 0.0]),))
    hangs = replace(made, renderer="mine:Hangs", trajectory=deep)
    assert draw_counterexample(hangs, tmp_path / "a.toml", stopped_after(1)) is None


def test_pictures_that_were_not_drawn_are_named(mine, monkeypatch, capsys):
    monkeypatch.setattr("hapticeval.commands.search.PICTURE_SECONDS", -1.0)
    asked = ("--check", "reset-clears", "--model", "circle", "--examples", 1, "-o", mine / "found")
    assert run("-r", "mine:Keeps", *asked) == 1
    assert "no picture, for its time was over, of: reset-clears" in capsys.readouterr().out


def few_shrinks(monkeypatch):
    for name in ("TRIALS_PER_TURN", "MOST_TRIALS"):
        monkeypatch.setattr(f"hapticeval.search.hunt.{name}", 4)


@pytest.mark.system
def test_a_renderer_that_is_wrong_on_the_second_lap_alone_is_found_on_the_first_model(mine, monkeypatch):
    few_shrinks(monkeypatch)
    made = searched("mine:SecondLap", ["force-magnitude"], models=["star"], most=10)
    assert made.counterexamples["force-magnitude"].examples <= 10


def test_a_counterexample_on_a_drawn_mesh_has_it_in_a_file(mine, monkeypatch):
    few_shrinks(monkeypatch)
    (hull,) = strategies.examples(strategies.meshes(kinds=["hull"]), 1)
    with Bench("mine:Keeps", 0, lambda: False) as bench:
        made = Search(bench, ["reset-clears"], 0, [hull], most_examples=2)
        made.run()
    files = write(stored_counterexample(made.counterexamples["reset-clears"], "mine:Keeps", 0), mine / "found")
    assert "vertices" not in files[0].read_text()
    case = load_suite(str(files[0])).cases[0]
    assert case.model["file"].endswith("reset-clears.ply")
    assert np.array_equal(case.build_scene().model.boundary.triangles.shape, hull.boundary.triangles.shape)
    judged = judge(resolve("mine:Keeps"), "mine:Keeps", "found", case)
    assert judged.verdicts[0].finding.message == made.counterexamples["reset-clears"].fault.message


def test_cases_in_space_are_on_surfaces_and_meshes():
    cases = draw_cases([], [JUMP], 0, dimension=3)
    kinds = list(dict.fromkeys(next(cases).model["kind"] for _ in range(8 * (len(FIRST_MODELS[3]) + 1))))
    assert kinds[: len(FIRST_MODELS[3])] == [each["kind"] for each in FIRST_MODELS[3]]
    assert len(next(cases).trajectory.start) == 3


def test_what_a_renderer_declares_says_where_it_is_searched(mine, capsys):
    asked = ("--check", "reset-clears", "--examples", 1, "-o", mine / "none")
    assert run("-r", "mine:InSpace", *asked) == 0
    assert run("-r", "mine:InPlane", *asked) == 0
    assert "no failure" in capsys.readouterr().out
    assert run("-r", "mine:InPlane", *asked, "--dimension", 3) == 2
    assert "refuses every model that was tried: the scene asks for 'space'" in capsys.readouterr().out
    assert run("-r", "mine:InPlane", *asked, "--dimension", 3, "--model", "star") == 2


def test_a_renderer_that_refuses_every_model_is_not_said_to_pass(mine):
    made = searched("mine:Refuses", [JUMP], most=8)
    assert made.refused == "no model is good enough"
    assert made.counterexamples == {}


def test_faults_are_the_same_by_check_and_kind():
    one = Fault(JUMP, "mini", "a")
    assert one.same(Fault(JUMP, "mini", "b", 1.0))
    assert not one.same(Fault(JUMP, "major", "a"))


def run(*arguments):
    return cli.main(["search", *map(str, arguments)])


@pytest.mark.system
def test_the_command_writes_tells_and_replays(mine, capsys, monkeypatch):
    few_shrinks(monkeypatch)
    out = mine / "found"
    assert run("-r", "mine:Nearest", "--check", JUMP, "--model", "star", "--examples", 8, "-o", out) == 1
    said = capsys.readouterr().out
    assert "mine:Nearest: pop-through of" in said
    place = next(out.glob("*/continuous-contact.toml")).parent
    (shown,) = list_counterexamples(out)
    assert shown.line in said
    assert (shown.suite, shown.picture) == (place / "continuous-contact.toml", place / "continuous-contact.svg")
    assert list_counterexamples(mine / "nothing") == []
    assert {file.suffix for file in place.iterdir()} == {".toml", ".csv", ".json", ".svg", ".png"}
    assert run("--replay", out, "-r", "mine:Nearest", "-r", "ideal") == 1
    rows = capsys.readouterr().out
    assert "STILL FAILS" in rows
    assert "FIXED" in rows
    assert run("--replay", out, "-r", "ideal") == 0
    assert run("--replay", out) == 2, "a file never names code to run"
    assert cli.main(["run", str(place / "continuous-contact.toml"), "-r", "mine:Nearest", "-o", str(mine / "r")]) == 1


@pytest.mark.system
def test_several_seeds_find_the_smallest_that_any_of_them_finds(mine, capsys, monkeypatch):
    few_shrinks(monkeypatch)
    search = seeds.run_hunt

    def run_hunt(hunt, seed):
        part = search(hunt, seed)
        (counterexample,) = part.counterexamples
        (mine / f"size-{seed}").write_text(repr(size_of(counterexample.case)))  # a process of its own may run this
        return part

    monkeypatch.setattr(seeds, "run_hunt", run_hunt)
    asked = ["-r", "mine:Nearest", "--check", JUMP, "--model", "star", "--examples", 4]
    assert run(*asked, "--seed", 5, "--seeds", 3, "-o", mine / "all") == 1
    said = capsys.readouterr()
    assert all(f"mine:Nearest, seed {seed}: " in said.err for seed in (5, 6, 7))
    sizes = [float((mine / f"size-{seed}").read_text()) for seed in (5, 6, 7)]
    assert len(set(sizes)) > 1
    assert [size_of(counterexample.case) for counterexample in read_all(mine / "all")] == [min(sizes)]


def came_of(renderers, numbers, report, interrupted=lambda: False):
    asked = [Hunt(f"mine:{name}", [JUMP], [{"kind": "circle"}], [], 60.0, 1) for name in renderers]
    options = {"workers": 1, "scheduler": None, "interrupted": interrupted}
    return run_hunts(asked, numbers, **options, progress=lambda *_: None, report=report)


@pytest.mark.system
def test_an_error_of_one_seed_costs_nothing_of_the_others(mine, monkeypatch):
    search, said = seeds.run_hunt, []

    def run_hunt(hunt, seed):
        if seed == 1:
            raise ValueError("no such seed")
        return search(hunt, seed)

    monkeypatch.setattr(seeds, "run_hunt", run_hunt)
    found = list(came_of(["Nearest", "Mirrored"], [0, 1, 2], said.append))
    assert [(hunt.renderer, ended) for hunt, _, ended in found] == [("mine:Nearest", 2), ("mine:Mirrored", 2)]
    assert all(made.tried == 2 for _, made, _ in found)
    wrong = [text for text in said if ", seed 1: ValueError: no such seed" in text]
    assert len(said) == 6
    assert len(wrong) == 2
    assert "Traceback" in wrong[0]


def test_what_came_of_a_renderer_is_there_before_the_next_one_has_ended(mine):
    said = []
    found = came_of(["Nearest", "Mirrored"], [0, 1], said.append)
    assert next(found)[0].renderer == "mine:Nearest"
    assert len(said) == 2
    found.close()


@pytest.mark.system
def test_what_has_ended_before_an_interrupt_is_kept(mine):
    said = []
    found = list(came_of(["Nearest", "Mirrored"], [0, 1], said.append, lambda: len(said) >= 3))
    assert [ended for _, _, ended in found] == [2, 1]


@pytest.mark.system
def test_exit_codes(mine, capsys):
    assert run("-r", "ideal", "--check", JUMP, "--model", "circle", "--examples", 2, "-o", mine / "none") == 0
    assert "no failure, in so many examples, of: continuous-contact (" in capsys.readouterr().out
    assert run("-r", "mine:Refuses", "--check", JUMP, "--examples", 2, "-o", mine / "none") == 2
    assert run("-r", "mine:Raises", "--check", JUMP, "--examples", 2, "-o", mine / "broke") == 3
    assert run("--replay", mine / "broke", "-r", "mine:Raises") == 3
    assert run("--check", JUMP) == 2
    assert run("-r", "ideal", "--check", "continuos-contact") == 2
    assert run("-r", "ideal", "--check", "closed-form") == 2
    assert run("-r", "ideal", "--check", "friction-cone") == 2
    assert run("--replay", mine / "nothing") == 2
    assert run("-r", "ideal", "--seconds", 0) == 2


def test_a_file_that_is_none_of_ours_is_refused_by_name(refused, tmp_path):
    (tmp_path / "a.toml").write_text("")
    (tmp_path / "a.json").write_text(json.dumps({"renderer": "x"}))
    with refused(InputError):
        read_all(Path(tmp_path))


LED = {"start": [0.0, 0.11, 0.0], "moves": [{"to": [0.0, 0.08, 0.0], "seconds": 0.5}]}
MESH = {"kind": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "triangles": [[0, 2, 1]]}
STORED = {
    "renderer": "constraint",
    "fault": {"check": "continuous-contact", "kind": "major", "message": "", "value": 0.01, "unit": "m", "time": 0.1},
    "model": MESH,
    "checks": ["continuous-contact"],
    "trajectory": LED,
    "examples": 3,
    "seed": 1,
    "complete": True,
}


@pytest.mark.parametrize(
    "edit",
    [
        {"trajectory": None},
        {"experiment": {"duration": 1.0, "position": [0.0, 0.0]}},
        {"model": {}},
        {"model": MESH | {"vertices": 0}},
        {"model": MESH | {"triangles": [[0, 1]]}},
        {"jump": [[], [], 0.01]},
        {"jump": [[0.0, 0.0], [0.0], 0.01]},
    ],
)
def test_an_edited_file_is_refused_by_name(refused, tmp_path, edit):
    (tmp_path / "a.toml").write_text("")
    stored = STORED | {"fault": STORED["fault"] | {"level": "must"}}
    (tmp_path / "a.json").write_text(json.dumps(stored))
    assert read_all(tmp_path)
    (tmp_path / "a.json").write_text(json.dumps(stored | edit))
    with refused(InputError):
        read_all(tmp_path)


def test_a_move_of_ages_is_refused(refused):
    moves = Moves(start=[0.0, 0.0], moves=(Move(to=[0.0, 1.0], seconds=1e300),))
    with refused(InputError):
        moves.path()


MUTANTS = {
    "Ticks": "time-subdivision",
    "Keeps": "reset-clears",
    "Mirrored": "contact-normal-force",
    "Stale": "time-subdivision",
}
"""Faults of one per cent, of one tick, of one sign: the check that finds each, among others."""


@pytest.mark.system
@pytest.mark.parametrize("name", MUTANTS)
def test_a_small_fault_is_found_within_a_few_examples(mine, monkeypatch, name):
    few_shrinks(monkeypatch)
    made = searched(f"mine:{name}", [MUTANTS[name]], models=["circle"], most=2)
    assert set(made.counterexamples) == {MUTANTS[name]}


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTANTS)
def test_the_command_finds_a_small_fault_in_a_minute(mine, name):
    assert run("-r", f"mine:{name}", "--seconds", 60, "-o", mine / "found") == 1
    found = {each.fault.check for each in read_all(mine / "found")}
    assert MUTANTS[name] in found


STRUCK = (
    Case(
        name="bounces-off-an-ellipse",
        title="A tool that meets an ellipse three times",
        model={"kind": "ellipse", "ratio": 2.0, "size": 0.2},
        checks=("centripetal-force",),
        scene={"stiffness": 1000.0, "mass": 1.0, "damping": 4.0, "bilateral": False},
        experiment=ExperimentTable(
            duration=0.25,
            position=[-0.100831, 0.00779],
            velocity=[0.5154, 0.2659],
            force=[[0.0, 0.9598, -0.2808], [0.125, 6.1798, -0.2455]],
        ),
    ),
    Case(
        name="bounces-off-a-circle",
        title="A tool that meets a circle twice",
        model={"kind": "circle", "size": 0.2},
        checks=("centripetal-force",),
        scene={"mass": 0.3, "damping": 20.0, "bilateral": False, "stiffness": 4000.0},
        experiment=ExperimentTable(
            duration=0.1,
            position=[-0.092871, 0.040645],
            velocity=[0.4673, 0.3195],
            force=[[0.0, -0.6014, -1.3742]],
        ),
    ),
)
"""Cases that a search has drawn, and in which a check has called the ideal contact wrong."""


@pytest.mark.parametrize("case", STRUCK, ids=lambda case: case.name)
def test_the_ideal_contact_is_not_called_wrong_where_it_once_was(case):
    judged = judge(resolve("ideal"), "ideal", "search", case)
    assert [verdict.check for verdict in judged.verdicts if verdict.outcome in ("fail", "error")] == []


def test_a_projection_is_memoryless_on_the_medial_axis_too():
    """Where HIPs a last place apart have feet 29 mm apart, the way back has to hold the same HIPs to the last place."""
    case = Case(
        name="on-the-axis",
        title="Onto the axis of a dumbbell's disc",
        model={"kind": "dumbbell", "neck": 0.5, "size": 0.2},
        checks=("memoryless",),
        trajectory=Moves(
            start=[0.051, 0.037],
            moves=(
                Move(to=[0.062, 0.0], seconds=0.772, even=True),
                Move(to=[0.063, 0.001], seconds=0.028, even=True),
            ),
        ),
    )
    (verdict,) = judge(resolve("minimum-distance"), "minimum-distance", "search", case).verdicts
    assert verdict.outcome == "pass"
