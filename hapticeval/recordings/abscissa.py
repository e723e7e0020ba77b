"""What runs of different hands can be lined up by: polar angle, arc length of the model, or a phase channel (6.1.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hapticeval.errors import InputError
from hapticeval.geometry.curve import Curve
from hapticeval.recordings.recording import CHANNELS, Recording
from hapticeval.recordings.stretches import LAG, Stretch
from hapticeval.types import Array, BoolArray

QUARTER = 0.5 * math.pi
"""A HIP that turns further about the centre in one step passes too near to it for its angle to be followed."""

MOST_BENT = 0.99
"""Share of the radius of curvature beyond which the foot is no function of the HIP that anyone could follow."""
TINY = 1e-9
"""Metres below which a step of the foot is rounding."""


@dataclass(frozen=True)
class Abscissa:
    """Says where along its way each sample of a run is.

    `by` is "angle" (rad, of the HIP about `centre` (2,), m), "arc" (m, of the HIP's foot on `curve`) or a phase
    channel as CHANNEL:COLUMN, in that channel's unit. Raises `InputError` for another name, and for "arc" without a
    curve.
    """

    by: str
    centre: tuple[float, float] = (0.0, 0.0)
    curve: Curve | None = None

    def __post_init__(self) -> None:
        if self.by == "arc" and self.curve is None:
            raise InputError(
                "runs cannot be aligned by arc length",
                why="neither the recordings nor you say which model was touched",
                todo="give it with --model, or align --by angle",
            )
        if self.by not in ("angle", "arc"):
            channel, _, column = self.by.partition(":")
            if not channel or not column.isdigit():
                raise InputError(
                    f"runs cannot be aligned by '{self.by}'",
                    why="it is neither angle, nor arc, nor a channel with its column",
                    todo="write --by angle, --by arc, or a phase such as --by joint_position:0",
                )

    @property
    def unit(self) -> str:
        """The abscissa's unit."""
        known = CHANNELS.get(self.by.partition(":")[0])
        return {"angle": "rad", "arc": "m"}.get(self.by) or (known.unit if known is not None else "")

    @property
    def period(self) -> float | None:
        """Once round, in that unit; None where the way is open."""
        if self.by == "angle":
            return 2.0 * math.pi
        if self.by == "arc" and self.curve is not None and self.curve.closed:
            return self.curve.length
        return None

    def along(self, recording: Recording, stretch: Stretch, label: str) -> tuple[Array, BoolArray]:
        """Over a stretch: the abscissa, going on beyond a full turn, (n,), and where it leaps, (n - 1,).

        The foot of a HIP that crosses the medial axis leaps: it is then farther along than the HIP moved and was not
        in between. Raises `InputError`, naming the time, where the HIP passes the centre too closely to have an angle.
        """
        hip = recording.hip[stretch.rows]
        leaps = np.zeros(len(stretch) - 1, dtype=bool)
        if self.by == "angle":
            offset = hip[:, :2] - np.asarray(self.centre)
            raw = np.arctan2(offset[:, 1], offset[:, 0])
            turn = _wrapped(np.diff(raw), 2.0 * math.pi)
            steep = np.abs(turn) > QUARTER
            if steep.any() or not offset.any(axis=1).all():
                row = stretch.first + int(np.argmax(steep if steep.any() else ~offset.any(axis=1)))
                raise InputError(
                    f"{label}: the HIP passes the centre at t = {recording.time[row]:.6g} s (row {row})",
                    why="its angle about the centre cannot be followed there",
                    todo="choose another centre, or align --by arc",
                )
            return np.concatenate([[raw[0]], raw[0] + np.cumsum(turn)]), leaps
        if self.by == "arc":
            assert self.curve is not None
            raw = np.asarray(self.curve.arc_length(self.curve.nearest(hip)))
            step = np.diff(raw) if self.period is None else _wrapped(np.diff(raw), self.period)
            return np.concatenate([[raw[0]], raw[0] + np.cumsum(step)]), self._leaps(hip, step)
        channel, _, column = self.by.partition(":")
        values = recording.channels.get(channel)
        if values is not None and values.ndim == 1:
            values = values[:, np.newaxis]
        if values is None or int(column) >= values.shape[1]:
            raise InputError(
                f"{label} has no column {column} of '{channel}'",
                why="it is needed as the phase",
                todo=f"its channels are: {', '.join(recording.channels)}",
            )
        return np.array(values[stretch.rows][:, int(column)]), leaps

    def _leaps(self, hip: Array, step: Array) -> BoolArray:
        """Steps of the foot that three of the HIP's own, stretched by the curvature at the foot, do not account for.

        From depth d under a convex surface the foot moves by the HIP's step / (1 - kappa d).
        """
        assert self.curve is not None
        moved = np.linalg.norm(np.diff(hip, axis=0), axis=1)
        u = self.curve.nearest(hip)
        depth = np.maximum(-self.curve.signed_distance(hip), 0.0)
        bent = np.minimum(depth * np.maximum(np.asarray(self.curve.curvature(u)), 0.0), MOST_BENT)
        return np.asarray(np.abs(step) > LAG * moved / (1.0 - np.maximum(bent[1:], bent[:-1])) + TINY)


def _wrapped(value: Array, period: float) -> Array:
    """Brought into [-period / 2, period / 2)."""
    return np.asarray((value + 0.5 * period) % period - 0.5 * period)
