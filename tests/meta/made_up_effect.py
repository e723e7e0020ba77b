"""Effects of the surface that no catalogue knows, and their entries for tests that add them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.catalogue import Entry
from hapticeval.effects.effect import Alters, Calling, Effect, Part, Stage, number
from hapticeval.laws import NORMAL, ChangeData, Closest
from hapticeval.types import Array

CLOSEST_ROWS = 2
FADING = 2
"""Rows of the state of `Suction`: the closest point, rows `FOOT` and `NORMAL`, is scratch; what has faded is kept."""


@dataclass(frozen=True)
class Suction(Effect):
    """Pull the hand inwards with `force`, and less so from tick to tick; refuse beyond `deepest`."""

    force: float = number("N")
    deepest: float = number("m", default=1.0)

    kind: ClassVar[str] = "suction"
    stage: ClassVar[Stage] = Stage.ANSWER
    domain_exits: ClassVar[Mapping[int, str]] = {1: "no suction so deep inside"}

    def change(self, scene: Calling) -> Part:
        """Assemble the pull: `params` are force and depth; `state` begins unfaded, with room for the closest point."""
        return Part(
            suck, np.array([self.force, self.deepest]), state=np.ones((CLOSEST_ROWS + 1, scene.model.dimension))
        )


def suck(data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array) -> int:
    """Pull against the outward normal while the hand is inside, by a hundredth less each tick."""
    distance = closest.function(closest.data, hip, data.state[:CLOSEST_ROWS])  # writes the closest point there
    if distance < -data.params[1]:
        return 1
    if distance < 0.0:
        for i in range(hip.shape[0]):
            force[i] -= data.params[0] * data.state[FADING, 0] * data.state[NORMAL, i]
        data.state[FADING, 0] *= 0.99  # the next tick finds it so
    return 0


@dataclass(frozen=True)
class Magnet(Effect):
    """Pull the hand along the first axis with `force`, wherever it is: outside of contact too."""

    force: float = number("N")

    kind: ClassVar[str] = "magnet"
    stage: ClassVar[Stage] = Stage.ANSWER
    alters: ClassVar[frozenset[Alters]] = frozenset({Alters.FREE_SPACE})

    def change(self, scene: Calling) -> Part:
        """Assemble the pull: `params` is the force."""
        return Part(pull, np.array([self.force]))


def pull(data: ChangeData, closest: Closest, hip: Array, velocity: Array, dt: float, ihip: Array, force: Array) -> int:
    """Pull along the first axis."""
    force[0] -= data.params[0]
    return 0


ENTRY = Entry("made_up_effect:Suction", "the surface sucks")
MAGNET_ENTRY = Entry("made_up_effect:Magnet", "the surface draws the hand near")
