"""Viscosity of the surface: it brakes a tool that slides along it (7.18)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from hapticeval.effects.effect import Calling, Effect, number


@dataclass(frozen=True)
class Viscosity(Effect):
    """Brake the tool along the surface with b_d = `coefficient` (kg/s): renderers assign it to the sliding tool."""

    coefficient: float = number("kg/s", at=True)

    kind: ClassVar[str] = "viscosity"
    requirement: ClassVar[str] = "viscosity"
    meaning: ClassVar[str] = "the surface brakes the tool that slides along it (7.18)"
    keys: ClassVar[Mapping[str, str]] = {"viscosity": "coefficient"}
    words: ClassVar[str] = "viscosity {coefficient}"

    @property
    def off(self) -> bool:
        """Whether there is none."""
        return self.coefficient == 0.0


def viscosity_of(scene: Calling) -> float:
    """Return b_d of a scene's surface, kg/s; zero where the scene calls for none."""
    return sum((each.coefficient for each in scene.effects if isinstance(each, Viscosity)), 0.0)
