"""Effects of the surface that no catalogue knows, and their entries for tests that add them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hapticeval.effects.catalogue import Entry
from hapticeval.effects.effect import Alters, Effect, Part, Stage, number


@dataclass(frozen=True)
class Suction(Effect):
    """Pull the hand inwards with `force`, and less so from tick to tick; refuse beyond `deepest`."""

    force: float = number("N")
    deepest: float = number("m", default=1.0)

    kind: ClassVar[str] = "suction"
    stage: ClassVar[Stage] = Stage.ANSWER
    domain_exits: ClassVar[dict[int, str]] = {1: "no suction so deep inside"}

    def change(self, scene):
        return Part(suck, np.array([self.force, self.deepest]), state=np.ones((3, scene.model.dimension)))


def suck(data, closest, hip, velocity, dt, ihip, force):
    distance = closest.function(closest.data, hip, data.state[:2])
    if distance < -data.params[1]:
        return 1
    if distance < 0.0:
        for i in range(hip.shape[0]):
            force[i] -= data.params[0] * data.state[2, 0] * data.state[1, i]
        data.state[2, 0] *= 0.99
    return 0


@dataclass(frozen=True)
class Magnet(Effect):
    """Pull the hand along the first axis with `force`, wherever it is: outside of contact too."""

    force: float = number("N")

    kind: ClassVar[str] = "magnet"
    stage: ClassVar[Stage] = Stage.ANSWER
    alters: ClassVar[frozenset[Alters]] = frozenset({Alters.FREE_SPACE})

    def change(self, scene):
        return Part(pull, np.array([self.force]))


def pull(data, closest, hip, velocity, dt, ihip, force):
    force[0] -= data.params[0]
    return 0


ENTRY = Entry("made_up_effect:Suction", "the surface sucks")
MAGNET_ENTRY = Entry("made_up_effect:Magnet", "the surface draws the hand near")
