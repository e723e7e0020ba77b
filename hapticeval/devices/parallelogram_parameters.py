"""What describes one parallelogram robot: Table A.1, and which equations are meant where the thesis leaves a choice."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import StrEnum

from hapticeval.errors import InputError
from hapticeval.geometry.validate import checked_number, checked_size


class Dynamics(StrEnum):
    """Which velocity terms the base's changing inertia d₀(x₂, x₃) makes.

    `lagrangian`: those of a rigid linkage, d₀ẍ₁ + ḋ₀ẋ₁ + b₁ẋ₁ = τ₁ and dᵢẍᵢ - ½ ∂ᵢd₀ ẋ₁² + bᵢẋᵢ = τᵢ, which conserve
    energy where there is no damping. `printed`: none, as in (2.26), which creates energy.
    """

    LAGRANGIAN = "lagrangian"
    PRINTED = "printed"


class BaseInertia(StrEnum):
    """How d₀ depends on x₃.

    `sin`: d₁ + d₂ sin² x₂ + d₃ sin² x₃ as in (2.27), the form that Table A.1's d₁ to d₃ were identified with, and
    therefore the default. `cos`: d₃ cos² x₃ instead, as the geometry of thin links has it; with the same d₁ that makes
    2.3 % more at home, so identify d₁ anew.
    """

    SIN = "sin"
    COS = "cos"


@dataclass(frozen=True, kw_only=True)
class ParallelogramParameters:
    """Table A.1: link lengths `l1`, `l4` (m), joint dampings `b1` to `b3` (N m s/rad), inertias `d1` to `d3` (kg m²).

    Raises `InputError` for a length or an inertia that is not positive, a damping that is negative, and for any of them
    that is not a finite number.
    """

    l1: float = 0.300
    l4: float = 0.346
    b1: float = 0.461
    b2: float = 0.105
    b3: float = 0.0336
    d1: float = 0.799
    d2: float = 0.204
    d3: float = 0.01825

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name.startswith("l"):
                value = checked_size(value, each.name)
            else:
                value = checked_number(each.name, value)
                unit, zero_allowed = ("N m s/rad", True) if each.name.startswith("b") else ("kg m²", False)
                if value < 0.0 or (value == 0.0 and not zero_allowed):
                    raise InputError(
                        f"{each.name} = {value!r} {unit}",
                        why="a joint cannot drive itself" if zero_allowed else "an inertia must be positive",
                    )
            object.__setattr__(self, each.name, value)
