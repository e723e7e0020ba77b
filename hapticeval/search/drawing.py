"""Which cases a search tries, and in which order: it depends on models, checks and seed, never on a clock."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from typing import Any

from hypothesis import strategies as st
from msgspec import to_builtins

from hapticeval.files import plain
from hapticeval.geometry.catalogue import make_model
from hapticeval.geometry.curve import as_curve
from hapticeval.geometry.model import Model
from hapticeval.phenomena.check import Check, Situation
from hapticeval.phenomena.registry import CHECKS, OF_EFFECTS
from hapticeval.runner.work import derived_seed
from hapticeval.stimulus.experiments import ExperimentTable
from hapticeval.stimulus.moves import Moves
from hapticeval.strategies import examples, hand_paths, laps, meshes, motions, plane_models, pushes, surfaces
from hapticeval.suite.case import Case

FIRST_MODELS: dict[int, tuple[dict[str, Any], ...]] = {
    2: (
        {"kind": "star"},
        {"kind": "ellipse", "ratio": 20.0, "size": 0.05},
        {"kind": "circle"},
        {"kind": "cassinian"},
        {"kind": "ellipse"},
        {"kind": "dumbbell"},
    ),
    3: ({"kind": "cube"}, {"kind": "sphere"}, {"kind": "l-block"}, {"kind": "icosphere"}, {"kind": "torus"}),
}
"""Models that are tried first, by dimension: with corners, and smooth; in space meshes and surfaces.

The medial axis of the sharp ellipse comes to a sixteenth of a millimetre of its surface, so that a path that crosses it
may be short.
"""

PATHS_PER_MODEL, PUSHES_PER_MODEL = 8, 4
"""How many paths and experiments are drawn on a model in each round, beside two laps round it."""

MODELS_PER_ROUND = 4
"""How many models are drawn in each round after the first, beside the fixed ones."""

VARIED_GAINS: dict[str, st.SearchStrategy[Any]] = {
    "stiffness": st.sampled_from([1000.0, 4000.0, 200.0]),
    "damping": st.sampled_from([0.0, 4.0, 20.0]),
    "mass": st.sampled_from([0.1, 0.3, 1.0]),
    "bilateral": st.booleans(),
}
"""What experiments vary of a scene."""


def judges_paths(check: Check) -> bool:
    """Whether a check can judge a hand that is led along a path, without a closed loop."""
    return not check.holds and Situation.PLAYBACK not in check.not_for


def judgeable() -> tuple[str, ...]:
    """Return the ids of the checks that a search asks where none is named.

    Not those that need a closed form or an experiment set up for them, which only a case can have; and not those of
    effects, since no scene that is drawn calls for one.
    """
    drawable = {name: check for name, check in CHECKS.items() if name not in OF_EFFECTS}
    return tuple(name for name, check in drawable.items() if not check.needs_closed_form and not check.holds)


def first_models(models: Sequence[Model], dimension: int = 2) -> tuple[Model, ...]:
    """Return the models that are tried in each round: those that are given, or `FIRST_MODELS` in that dimension."""
    return tuple(models) or tuple(make_model(**table) for table in FIRST_MODELS[dimension])


def draw_cases(
    models: Sequence[Model],
    checks: Sequence[str],
    seed: int,
    refused: Container[str] = (),
    *,
    dimension: int = 2,
    moving: bool = False,
    call: Callable[..., Any] = lambda function, *arguments: function(*arguments),
) -> Iterator[Case]:
    """Yield cases without end, round after round on each of the models.

    - `models`: if there are none, those of `FIRST_MODELS`, and drawn ones from the second round on.
    - `checks`: read anew each time, so that the caller may drop what has been found. Paths are for checks that a led
      hand can show, experiments for those that need a closed loop.
    - `refused`: tables, as text, of models that the renderer does not take: read anew each time, and left out.
    - `moving`: bodies slide and spin under the paths; in experiments they rest.
    - `call`: calls a function with its arguments. Drawing takes seconds, and may be done in another process.
    """
    fixed = [dict(model.table) for model in first_models(models, dimension)]
    round_number = 0
    while True:
        # The first round is on the fixed models alone, and is soon over; further ones add drawn models.
        drawn_models = [] if models or round_number == 0 else call(_draw_models, dimension, seed, round_number)
        for model_number, model in enumerate((*fixed, *drawn_models)):
            if repr(model) in refused:
                continue
            # Read anew for each model: a check that has failed meanwhile asks for no more paths.
            for_paths = [name for name in checks if judges_paths(CHECKS[name])]
            paths = call(_draw_paths, model, seed, round_number, model_number) if for_paths else []
            scenes = call(_draw_motions, model, len(paths), seed, round_number, model_number) if moving else []
            for number, moves in enumerate(paths):
                asked_checks = tuple(name for name in for_paths if name in checks)
                if asked_checks:
                    # two paths may share a motion: there are as many as differ
                    yield _case(
                        model, asked_checks, trajectory=moves, scene=scenes[number % len(scenes)] if scenes else {}
                    )
            # No check that is left asks for a closed loop.
            if all(judges_paths(CHECKS[name]) for name in checks):
                continue
            for scene, push in call(_draw_pushes, model, seed, round_number, model_number):
                asked_checks = tuple(name for name in checks if not judges_paths(CHECKS[name]))
                if asked_checks:
                    yield _case(model, asked_checks, experiment=push, scene=scene)
        round_number += 1


def _draw_models(dimension: int, seed: int, round_number: int) -> list[dict[str, Any]]:
    """Draw models of that dimension."""
    # In space four models of five are meshes, or about so.
    kinds = plane_models() if dimension == 2 else st.one_of(meshes(), surfaces())
    return [dict(model.table) for model in _seeded_examples(kinds, MODELS_PER_ROUND, seed, "models", round_number)]


def _draw_paths(table: dict[str, Any], seed: int, round_number: int, model_number: int) -> list[Moves]:
    """Draw paths on a model: of a plane one also laps, of which the simplest is drawn once."""
    model = make_model(**table)
    paths = _seeded_examples(hand_paths(model), PATHS_PER_MODEL, seed, "paths", round_number, model_number)
    curve = as_curve(model.boundary)
    if curve is not None and curve.closed:
        pointed = any(corner.convex for corner in curve.corners)
        # Going on past a corner takes a convex one.
        for past in (False, True) if pointed else (False,):
            # The first example of a strategy is its simplest in each draw: rounds after the first take the second.
            paths += _seeded_examples(
                laps(model, past=past), min(round_number, 1) + 1, seed, "laps", round_number, model_number
            )[-1:]
    return paths


def _draw_motions(
    table: dict[str, Any], count: int, seed: int, round_number: int, model_number: int
) -> list[dict[str, Any]]:
    """Draw up to `count` motions of a model, each as what it has of a scene."""
    drawn = _seeded_examples(motions(make_model(**table)), count, seed, "motions", round_number, model_number)
    return [{"motion": plain(to_builtins(motion), "motion")} for motion in drawn]


def _draw_pushes(
    table: dict[str, Any], seed: int, round_number: int, model_number: int
) -> list[tuple[dict[str, Any], ExperimentTable]]:
    """Draw experiments on a model, each with what it has of a scene."""
    model = make_model(**table)
    pushed = st.fixed_dictionaries(VARIED_GAINS).flatmap(
        lambda scene: st.tuples(st.just(scene), pushes(model, bilateral=scene["bilateral"]))
    )
    return _seeded_examples(pushed, PUSHES_PER_MODEL, seed, "pushes", round_number, model_number)


def _seeded_examples(strategy: st.SearchStrategy[Any], count: int, seed: int, *where: object) -> list[Any]:
    """Return examples drawn with a seed made of the search's and of the words `where`, which say what they are for."""
    return examples(strategy, count, seed=derived_seed(seed, *where))


def _case(table: dict[str, Any], checks: tuple[str, ...], **entries: Any) -> Case:
    return Case(
        name="drawn", title=f"Drawn on a model of kind '{table['kind']}'", model=table, checks=checks, **entries
    )
