"""The document of a study of effects, `effects.json`: what a scene calls for and what that costs. Reports read it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from hapticeval.files import read_json, write_json

EFFECTS_FILE = "effects.json"
FORMAT_VERSION = 1


class _DocumentPart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the document's objects."""


class Cost(_DocumentPart, frozen=True):
    """What a tick takes, s, and the code that makes it, bytes; None where it is Python's."""

    tick: float
    code: int | None


class SceneEntry(_DocumentPart, frozen=True):
    """One scene: the effects that it `calls` for, by kind, and what was assembled of them.

    `assembled` has the kinds by stage of a tick; those of no stage are the renderer's own. `plain` is the same scene
    without effects, None for one that calls for none. `problem` is why nothing was measured.
    """

    suite: str
    case: str
    renderer: str
    calls: list[str]
    assembled: dict[str, list[str]]
    ticks: int = 0
    cost: Cost | None = None
    plain: Cost | None = None
    problem: str | None = None


class Rung(_DocumentPart, frozen=True):
    """The first effects of a scene: what an answer takes, s, composed of them, and with all tested for at each tick."""

    kinds: list[str]
    composed: float
    tested: float


class Ladder(_DocumentPart, frozen=True):
    """The cost of an answer by the number of effects of the surface that a scene calls for."""

    suite: str
    case: str
    renderer: str
    rungs: list[Rung]


class EffectsDocument(_DocumentPart, frozen=True):
    """A study: every scene, and the ladder of the one that calls for most effects; None where none calls for two."""

    scenes: list[SceneEntry]
    ladder: Ladder | None
    rounds: int
    environment: dict[str, Any]
    machine: dict[str, Any]
    format_version: int = FORMAT_VERSION


def write_costs(directory: Path, document: EffectsDocument) -> Path:
    """Write the document into a folder; return its path. Raises `HapticevalError` where that fails."""
    return write_json(directory / EFFECTS_FILE, document)


def read_costs(directory: Path) -> EffectsDocument:
    """Read the document of a folder. Raises `InputError` as `read_json` does."""
    return read_json(directory / EFFECTS_FILE, EffectsDocument, version=FORMAT_VERSION, command="effects")
