"""Recorded impulse: when a contact begins a measured pulse is replayed (thesis 4.3.4)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from hapticeval.effects.contact_impulse import capped, refuse_bilateral
from hapticeval.effects.effect import Calling, Effect, Part, Stage, number
from hapticeval.errors import InputError
from hapticeval.files import file_below
from hapticeval.quantity import format_quantity
from hapticeval.types import Array

EVEN = 1e-6
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
            raise InputError("the pulse of a recorded-impulse is no row of numbers", why=str(error)) from error
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
    uneven = ~(np.abs(steps - step) <= EVEN * step)
    if not step > 0.0 or uneven.any():
        row = int(np.argmax(uneven)) + 1
        raise InputError(
            f"{file}: row {row} comes {steps[row - 1]:.6g} s after the one before, and rows are {step:.6g} s apart",
            why="a pulse is replayed sample by sample: its times must be even",
            todo="resample it, or cut the pulse out where they are",
        )
    return np.asarray(force), step
