"""Effects that have a law, shading and reliefs: what the scene's own effect makes of the answers without it.

The effect is put on what the renderer answers to the same path without it. Force and IHIP may each be late, by one
number of ticks in all of a run.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hapticeval.effects.catalogue import HEIGHT_MAP
from hapticeval.phenomena.decisions import LAG_TICKS
from hapticeval.phenomena.lag import believed_lag, between_ticks, delayed, lags_of_kinds
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import lengths_of
from hapticeval.recordings.recording import SINGLE
from hapticeval.types import Array


class Lags(NamedTuple):
    """How many ticks ago the HIP is that a channel answers, and the recorded IHIP that it is made of."""

    hip: float
    ihip: float


class Answers(NamedTuple):
    """What an effect makes of answers, IHIPs (n, N), m, and forces (n, N), N, and these answers without it."""

    ihip: Array
    force: Array
    bare_ihip: Array
    bare_force: Array


class EffectLaw:
    """An effect of a scene, put on the answers without it to the path of the recording `base`.

    `bare` has these answers. Where they are not known, a height map's are those of a spring to the nearest point, and a
    bump map's are forces along the normal, as large as what is recorded along the normals of the relief.
    """

    def __init__(self, effect: Any, base: Observed, bare: Observed | None) -> None:
        from hapticeval.simulation.answers import put_on_answers

        self.base, self.bare, self.raises = base, bare, effect.kind == HEIGHT_MAP
        self.rows = np.arange(len(base), dtype=np.int64)
        # A late renderer's queue is not filled before; nobody knows what comes after the last row.
        self.known_rows = slice(LAG_TICKS, None)
        self.rounding = base.rounding + SINGLE * float(np.max(np.abs(base.hip)))
        self._put_on = put_on_answers(effect, base.scene, len(base))

    def answers(self, lags: Lags, aside: Array | float = 0.0) -> Answers:
        """Return what is right in each row with these lags, for a hand and a tool that are `aside`, (N,), m.

        Raises `DomainError` where the effect is not defined.
        """
        base, bare = self.base, self.bare
        hips = delayed(base.hip, self.rows, lags.hip) + aside
        if self.raises:
            frame = base.boundary.closest_point(hips)
            presses = (frame.distance < 0.0) | base.scene.bilateral
            ihips = np.where(presses[:, np.newaxis], frame.foot, hips)
            forces = base.scene.stiffness * (ihips - hips) if bare is None else bare.force
        else:
            ihips = delayed((bare or base).ihip, self.rows, lags.ihip) + aside
            forces = self._forces_on(hips, ihips) if bare is None else bare.force
        return Answers(*self._put_on(hips, ihips, forces), ihips, forces)

    def _forces_on(self, hips: Array, ihips: Array) -> Array:
        """Return forces along the normals, (n, N), N, as large as what is recorded along the normals of the relief."""
        normals = self.base.boundary.closest_point(ihips).normal
        _, relief_normals = self._put_on(hips, ihips, normals)
        return np.asarray(np.sum(self.base.force * relief_normals, axis=1)[:, np.newaxis] * normals)

    def find_lags(self, channel: str) -> Lags:
        """Return the lags that explain nine tenths of what a channel is off without them; else none."""
        recorded = self.base.channels[channel]

        def misfit(hip: float, ihip: float) -> float:
            """Return the mean length, m or N, of what the law leaves of the channel with these lags (ticks)."""
            right = getattr(self.answers(Lags(hip, ihip)), channel)
            return float(lengths_of(recorded - right)[self.known_rows].mean())

        if channel == "force":
            return Lags(*lags_of_kinds(misfit, self.rounding * self.base.scene.stiffness))
        lag, _ = believed_lag(lambda lag: misfit(lag, lag), self.rounding)
        return Lags(lag, lag)

    def between_ticks(self, lags: Lags) -> bool:
        """Return whether a channel with these lags, or an answer without the effect, lies between two ticks.

        An answer that is late as a whole has no lag to the one without the effect, which is as late.
        """
        return between_ticks(*lags, *(() if self.bare is None else self.bare.lag))

    def steepness(self, channel: str, lags: Lags) -> Array:
        """Return how much a channel changes at the most, (n,), per metre by which the hand is elsewhere."""
        # of a force, the spring's own on top, which answers that are known do not show
        own = self.base.scene.stiffness if channel == "force" else 0.0
        step, right = self.base.rounding, getattr(self.answers(lags), channel)
        changes = [
            max_lengths(*(getattr(self.answers(lags, side * step * axis), channel) - right for side in (1.0, -1.0)))
            for axis in np.eye(right.shape[1])
        ]
        return np.asarray(own + lengths_of(np.transpose(changes)) / step)


def max_lengths(first: Array, second: Array) -> Array:
    """Return the larger length (n,) of two vectors (n, N), m or N, row by row."""
    return np.maximum(lengths_of(first), lengths_of(second))
