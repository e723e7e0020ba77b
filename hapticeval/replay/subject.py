"""What is replayed: a recording, and the scene that it was made in, from the recording itself or as given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any

from hapticeval.effects.catalogue import read_effects, short_forms
from hapticeval.errors import InputError, UnknownNameError, at
from hapticeval.files import file_stem
from hapticeval.phenomena.registry import CHECKS
from hapticeval.recordings.provenance import LINE_MODEL, before_the_wall, model_of, scene_of
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.suite.case import Case
from hapticeval.suite.reading import case_named

REPLAY_SUITE = "replay"
"""The suite that a replay's verdicts belong to."""

STRUCTURED_ENTRIES = ("device", "inner_loop", "effects", "model", "motion")
"""Entries of a scene that cannot be given as key=value."""

SCENE_ENTRIES = (*(field.name for field in fields(Scene) if field.name != "model"), *short_forms())
"""Entries of a scene beside its model."""

KEY_VALUE_DEFAULTS = {
    **{field.name: field.default for field in fields(Scene) if field.name not in STRUCTURED_ENTRIES},
    **{name: 0.0 for name, is_number in short_forms().items() if is_number},
}


@dataclass(frozen=True)
class ReplayCase:
    """A recording from `file` with the case that its renderers are judged in."""

    file: str
    recording: Recording
    case: Case


def make_replay_case(
    file: Path,
    recording: Recording,
    *,
    model: Mapping[str, Any] | None = None,
    suite_case: str | None = None,
    scene: Sequence[str] = (),
    unsaid: Mapping[str, str] | None = None,
) -> ReplayCase:
    """The case of a replay: model, scene and checks.

    Each comes from what is given (`model` as a suite has it; `suite_case` as SUITE/CASE; `scene` as key=value), else
    from the recording's meta. The checks are the case's, or all. A run in one dimension is placed before the model
    `line`, see `before_the_wall`.

    Raises `InputError`

    - where neither says the model or the stiffness, naming all that lacks, with `unsaid`: what else does, and how to
      give it;
    - for a key that a scene does not have;
    - where model and recording differ in dimension.
    """
    # A case of a suite gives model, scene and checks together.
    template = None if suite_case is None else case_named(suite_case)
    entries = {key: value for key, value in scene_of(recording).items() if key in SCENE_ENTRIES}
    if template is not None:
        entries = dict(template.scene)
    # What the user gives overrides what the recording or the case says.
    chosen = {**entries, **dict(_entry(text) for text in scene)}
    chosen.setdefault("sampling_time", float(recording.dt))
    touched = model or (model_of(recording) if template is None else template.model)
    missing = {}
    # All that lacks is named at once, with the option that gives it.
    if "stiffness" not in chosen and template is None:
        missing["the stiffness of its scene"] = "--scene stiffness=1000"
    if touched is None:
        missing["which model was touched"] = "--model circle:size=0.2"
    if missing or unsaid:
        raise _not_said(file, missing, unsaid or {})
    assert touched is not None
    replay_case = Case(
        name=file_stem(file.stem),
        title=f"Replay of {file.name}",
        shows="The hand path of a recording, sample by sample, through other renderers.",
        model=dict(touched),
        scene=chosen,
        checks=template.checks if template is not None else _checks(recording, chosen),
        folder=file.parent,
    )
    # Errors of the scene name the recording that it is of.
    with at(file.name):
        built = replay_case.build_scene()
    # One degree of freedom is placed in the plane, before the wall that the model is.
    if recording.hip.shape[1] == 1 and built.model.name == LINE_MODEL:
        recording = before_the_wall(recording)
    if built.model.dimension != recording.hip.shape[1]:
        raise InputError(
            f"{file.name} is in {recording.hip.shape[1]}D, its model in {built.model.dimension}D",
            why="hand and model must live in the same space",
            todo="give the wall: --model line" if recording.hip.shape[1] == 1 else "give another model with --model",
        )
    return ReplayCase(file.name, recording, replay_case)


def _not_said(file: Path, scene: Mapping[str, str], others: Mapping[str, str]) -> InputError:
    """All that a replay needs and a recording does not say, at once."""
    names = [*scene, *others]
    advice = f"give {'it' if len(names) == 1 else 'them'}: {' '.join([*scene.values(), *others.values()])}"
    case = ", or a case with the same model and scene: --suite-case SUITE/CASE" if scene else ""
    return InputError(
        f"{file.name} does not say {' and '.join([', '.join(names[:-1]), names[-1]] if names[1:] else names)}",
        why="renderers and checks need the model and the gain (N/m), and nothing is guessed"
        if scene
        else "nothing of it is guessed",
        todo=advice + case,
    )


def _checks(recording: Recording, scene: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the checks of the recording's meta, or all that the scene allows."""
    names = recording.meta.get("checks")
    if isinstance(names, list | tuple) and names and all(name in CHECKS for name in names):
        return tuple(names)
    bilateral, (_, effects) = scene.get("bilateral", False), read_effects(scene)
    # Without a list of its own a recording is judged by every check that its scene allows.
    kinds = {effect.kind for effect in effects}
    return tuple(
        name
        for name, check in CHECKS.items()
        if (bilateral or not check.holds) and (not check.effects or not kinds.isdisjoint(check.effects))
    )


def _entry(text: str) -> tuple[str, Any]:
    """Return an entry of a scene from key=value. Raises `InputError` for another key, and for no number."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if key not in KEY_VALUE_DEFAULTS:
        raise UnknownNameError("entry of a scene", key, KEY_VALUE_DEFAULTS)
    default = KEY_VALUE_DEFAULTS[key]
    # bool before float: "true" is not a number, and 1 no truth value.
    if isinstance(default, bool):
        if value.lower() in ("true", "false"):
            return key, value.lower() == "true"
        raise InputError(f"--scene {text}", why=f"{key} is true or false", todo=f"write --scene {key}=true")
    try:
        number = float(value)
    except ValueError:
        raise InputError(
            f"--scene {text}",
            why="it is not key=number" if equals else "it has no value",
            todo=f"write --scene {key}={1.0 if default is MISSING else default:g} in SI units",
        ) from None
    return key, number
