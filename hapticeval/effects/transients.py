"""What begins with a contact (thesis 4.3.4): the pulse of a collision (4.21), a ringing, or a measured pulse."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hapticeval.devices.parallelogram import Parallelogram
from hapticeval.devices.point_mass import PointMass
from hapticeval.effects.effect import Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError, UnknownNameError
from hapticeval.files import file_below
from hapticeval.quantity import format_quantity
from hapticeval.types import Array


@dataclass(frozen=True)
class ContactImpulse(Effect):
    """Add (1 + c_r) v m_n along the normal in the tick in which a contact begins, once a contact.

    v is the speed of the approach along the normal, c_r the scene's restitution, and m_n = 1 / (n' J M⁻¹ J' n) the mass
    that the scene's device shows there, which is the tool's where the scene has none.

    A force above `cap` (N) is not given: what it holds back goes into the ticks that follow, as long as the contact
    lasts.
    """

    cap: float = number("N", finite=False, default=math.inf)

    kind: ClassVar[str] = "contact-impulse"
    stage: ClassVar[Stage] = Stage.ANSWER
    domain_exits: ClassVar[Mapping[int, str]] = {
        1: "a contact begins where the device does not reach: it has no inertia"
    }
    linear: ClassVar[bool] = False

    def fits(self, scene: Calling) -> None:
        """Refuse a contact that never begins, and a device whose inertia is not known to compiled code."""
        refuse_bilateral(self, scene)
        if not isinstance(scene.robot, PointMass | Parallelogram):
            raise InputError(
                f"a contact-impulse on a {scene.robot.name}",
                why="its inertia at a place is not known",
                todo="use a point mass or a parallelogram",
            )

    def change(self, scene: Calling) -> Part:
        """Assemble the blow: `params` are the cap, 1 + c_r and the device's."""
        from hapticeval.effects.transient_kernels import STATE, give_impulse

        params = [self.cap, 1.0 + scene.restitution, *scene.robot.parameters]
        return Part(give_impulse, np.array(params), state=np.zeros((STATE, scene.model.dimension)))

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe it with its cap."""
        return f"contact impulses{capped(self.cap)}"


def capped(cap: float) -> str:
    """Return the words with which messages add a cap (N) on the force; none for an infinite one."""
    return "" if math.isinf(cap) else f" of at most {format_quantity(cap, 'N')}"


def refuse_bilateral(effect: Effect, scene: Calling) -> None:
    """Raise `InputError` where the surface holds the tool from both sides: no contact begins there."""
    if scene.bilateral:
        raise InputError(
            f"a {effect.kind} on a bilateral constraint",
            why="the tool is held on the surface always, so that no contact begins",
            todo="leave out the effect, or bilateral",
        )


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


UNEVEN_STEP_SHARE = 1e-6
"""Share of its step by which the time base of a pulse may be uneven."""


@dataclass(frozen=True)
class RecordedImpulse(Effect):
    """Add a `pulse` of forces (N), a sample each `step` s, along the normal from the tick on in which a contact begins.

    Once a contact, whatever the speed of the approach. At the pulse's own sampling time it is replayed to the bit; at
    another one each tick gives its mean over the tick, so that the impulse is kept.

    A force above `cap` (N) is not given: what it holds back goes into the ticks that follow. It ends with the contact.

    A suite's table may name a `file` below its folder instead: a table with the columns t (s) and f (N), or a recording
    in our format, of whose forces the share along their sum is taken.
    """

    pulse: tuple[float, ...]
    step: float = number("s")
    cap: float = number("N", finite=False, default=math.inf)

    kind: ClassVar[str] = "recorded-impulse"
    stage: ClassVar[Stage] = Stage.ANSWER
    linear: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            pulse = np.array(self.pulse, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError("the pulse of a recorded-impulse is not a row of numbers", why=str(error)) from error
        if pulse.ndim != 1 or not pulse.any():
            raise InputError(
                f"the pulse of a recorded-impulse has {'no samples' if pulse.size == 0 else 'no force in it'}",
                why="there is nothing to replay",
                todo="give a pulse of forces (N)",
            )
        if not np.isfinite(pulse).all():
            row = int(np.argmin(np.isfinite(pulse)))
            raise InputError(f"sample {row} of a recorded-impulse is {pulse[row]!r} N", why="it must be finite")
        object.__setattr__(self, "pulse", tuple(pulse.tolist()))

    @classmethod
    def read(cls, numbers: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
        """Return the numbers of a table, with the pulse of the `file` that it names."""
        if "file" not in numbers:
            return numbers
        if "pulse" in numbers or "step" in numbers:
            raise InputError("a recorded-impulse with a file, and a pulse or a step", todo="give one or the other")
        pulse, step = read_pulse(file_below(folder, str(numbers["file"])))
        other_numbers = {name: value for name, value in numbers.items() if name != "file"}
        return {"pulse": pulse.tolist(), "step": step, **other_numbers}

    def fits(self, scene: Calling) -> None:
        """Refuse a contact that never begins."""
        refuse_bilateral(self, scene)

    def change(self, scene: Calling) -> Part:
        """Assemble the replay: `params` are the cap and the step, `samples` the pulse and its sums."""
        from hapticeval.effects.transient_kernels import STATE, replay

        # the zero is what a tick after the pulse's end gets
        pulse = np.array([*self.pulse, 0.0])
        sums = np.concatenate([[0.0], np.cumsum(pulse[:-1])])
        params = np.array([self.cap, self.step])
        return Part(replay, params, np.vstack([pulse, sums]), np.zeros((STATE, scene.model.dimension)))

    def active(self, damping: float) -> str | None:  # noqa: ARG002 - as every effect
        """Return why it gives energy away: to a hand that moves with the pulse."""
        return "a pulse that is replayed pushes the hand whatever it does"

    def describe(self, *, turning: bool) -> str:  # noqa: ARG002 - as every effect
        """Describe the pulse by its length and impulse."""
        duration, impulse = format_quantity(1e3 * len(self.pulse) * self.step, "ms"), math.fsum(self.pulse) * self.step
        return f"recorded impulses ({duration}, {format_quantity(1e3 * impulse, 'mN s')}){capped(self.cap)}"


def read_pulse(file: Path) -> tuple[Array, float]:
    """Read a measured pulse from a table or a recording: its forces (n,), N, and its sampling time, s.

    Raises `InputError`, naming file and row, for a file without them, of fewer than two rows, and for times that are
    not even.
    """
    if file.suffix == ".h5":
        from hapticeval.recordings.hdf5 import read_recording

        recording = read_recording(file, channels=["force"])
        # a recording's force is a vector: its part along the sum of all is the pulse
        total = recording.force.sum(axis=0)
        size = float(np.linalg.norm(total))
        time, force = recording.time, recording.force @ (total / size if size > 0.0 else total)
    else:
        from hapticeval.recordings.formats import read_table

        table = read_table(file)
        time, force = (np.asarray(table[name], dtype=np.float64) for name in ("t", "f"))
    if time.size < 2 or time.size != force.size:
        raise InputError(f"{file} has {time.size} times and {force.size} forces", why="a pulse needs two rows or more")
    steps = np.diff(time)
    step = float(time[-1] - time[0]) / (time.size - 1)
    uneven = ~(np.abs(steps - step) <= UNEVEN_STEP_SHARE * step)
    if not step > 0.0 or uneven.any():
        row = int(np.argmax(uneven)) + 1
        raise InputError(
            f"{file}: row {row} comes {steps[row - 1]:.6g} s after the one before, and rows are {step:.6g} s apart",
            why="a pulse is replayed sample by sample: its times must be even",
            todo="resample it, or cut the pulse out where they are",
        )
    return np.asarray(force), step
