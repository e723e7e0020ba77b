"""Viscosity of the surface: it brakes a tool that slides along it (7.18)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hapticeval.effects.effect import Effect, number


@dataclass(frozen=True)
class Viscosity(Effect):
    """Brake the tool along the surface with b_d = `coefficient` (kg/s): renderers assign it to the sliding tool."""

    coefficient: float = number("kg/s", at=True)

    kind: ClassVar[str] = "viscosity"
    words: ClassVar[str] = "viscosity {coefficient}"

    @property
    def off(self) -> bool:
        """Whether its coefficient is zero: it then changes nothing."""
        return self.coefficient == 0.0
