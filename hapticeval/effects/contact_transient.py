"""Contact transient: when a contact begins the surface rings as a struck material does, a decaying sinusoid."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from hapticeval.effects.contact_impulse import capped, refuse_bilateral
from hapticeval.effects.effect import Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.quantity import format_quantity


class Material(NamedTuple):
    """How a struck material rings: amplitude L (N s/m), decay B (1/s), frequency (Hz)."""

    amplitude: float
    decay: float
    frequency: float


MATERIALS = {
    "rubber": Material(116.7, 60.0, 18.0),
    "wood": Material(150.0, 80.0, 30.0),
    "aluminium": Material(300.0, 90.0, 100.0),
}
"""Examples: of the size of what is measured with a stylus that taps such materials, and no measurement of ours."""


@dataclass(frozen=True)
class ContactTransient(Effect):
    """Add F = L v e^(-Bt) sin(2 pi f t) along the normal from the tick on in which a contact begins, once a contact.

    v is the speed of the approach along the normal. `amplitude` L (N s/m), `decay` B (1/s) and `frequency` f (Hz) are
    given, or a `material` of `MATERIALS`.

    Each tick holds the mean of F over it, so that the impulse is F's own, L v w / (B^2 + w^2). A force above `cap` (N)
    is not given: what it holds back goes into the ticks that follow. The ringing ends with the contact.
    """

    amplitude: float | None = number("N s/m", default=None)
    decay: float | None = number("1/s", default=None)
    frequency: float | None = number("Hz", default=None)
    material: str | None = field(default=None, compare=False)
    cap: float = number("N", finite=False, default=math.inf)

    kind: ClassVar[str] = "contact-transient"
    stage: ClassVar[Stage] = Stage.ANSWER
    linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        own_numbers = (self.amplitude, self.decay, self.frequency)
        if self.material is not None:
            # copies carry the numbers of their material, and these are no contradiction
            if self.material not in MATERIALS:
                raise UnknownNameError("material", str(self.material), MATERIALS)
            of_material = MATERIALS[self.material]
            if own_numbers not in ((None, None, None), of_material):
                raise InputError(
                    f"a contact-transient of {self.material}, and numbers of its own",
                    why="a material is an amplitude, a decay and a frequency",
                    todo="give one or the other",
                )
            for name, value in of_material._asdict().items():
                object.__setattr__(self, name, value)
        elif None in own_numbers:
            raise InputError(
                "a contact-transient without amplitude, decay or frequency",
                why="a decaying sinusoid needs all three",
                todo=f"give them, or a material: {', '.join(MATERIALS)}",
            )
        if isinstance(self.decay, int | float) and not self.decay > 0.0:
            raise InputError(
                f"{self.named('decay')} = {self.decay!r} 1/s",
                why="it must be positive: what does not decay is unstable",
                todo="give a positive decay",
            )
        super().__post_init__()

    def fits(self, scene: Calling) -> None:
        """Refuse a frequency that the ticks cannot show, and a contact that never begins."""
        refuse_bilateral(self, scene)
        assert self.frequency is not None
        highest = 0.5 / scene.sampling_time
        if not self.frequency < highest:
            raise InputError(
                f"{self.named('frequency')} = {self.frequency!r} Hz at {1e3 * scene.sampling_time:g} ms a tick",
                why=f"ticks show frequencies below {highest:g} Hz (Nyquist): a higher one would come as another",
                todo="lower it, or sample faster",
            )

    def change(self, scene: Calling) -> Part:
        """Assemble the ringing: `params` are the cap, L, B and w."""
        from hapticeval.effects.transient_kernels import STATE, ring

        assert self.amplitude is not None
        assert self.decay is not None
        assert self.frequency is not None
        params = [self.cap, self.amplitude, self.decay, 2.0 * math.pi * self.frequency]
        return Part(ring, np.array(params), state=np.zeros((STATE, scene.model.dimension)))

    def active(self, damping: float) -> str | None:  # noqa: ARG002 - as every effect
        """Return why it gives energy away: to a hand that moves with the ringing."""
        return "a surface that rings pushes the hand whatever it does"

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe how it rings."""
        numbers = ((self.amplitude, "N s/m"), (self.decay, "1/s"), (self.frequency, "Hz"))
        numbers_with_units = ", ".join(format_quantity(value, unit) for value, unit in numbers if value is not None)
        return f"contact transients ({numbers_with_units}){capped(self.cap)}"
