"""A part of a path once more in finer steps, as checks ask for where an answer jumps."""

from __future__ import annotations

import numpy as np

from hapticeval.recordings.recording import Recording
from hapticeval.renderer import AnyRenderer, WrappedRenderer, wrapped
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import reset_checked
from hapticeval.simulation.playback import Answers, Rows, Ticks, channels_of, lead_in_rows, lead_on
from hapticeval.types import Array

REST_PATIENCE = 32
"""Ticks after which a renderer that still moves under a hand at rest is not waited for."""


class Closeup:
    """A path that a renderer was led along, any part of which it can be led along again in finer steps.

    The renderer is led to that part from a reset, as it was before, tick by tick, and the part alone is refined.
    `recording` holds what it answered.

    - `rows` are those of the recording, and `before` what the renderer is asked from its reset up to them, of which the
      first `ahead` rows lead the hand in.
    - `dt` (s) is the path's own step, at which the hand rests.
    """

    def __init__(
        self, renderer: WrappedRenderer, recording: Recording, rows: Rows, before: Rows, *, dt: float, ahead: int
    ) -> None:
        self.recording = recording
        self._renderer, self._rows, self._before, self._dt, self._ahead = renderer, rows, before, dt, ahead

    @classmethod
    def of(cls, renderer: AnyRenderer, recording: Recording, scene: Scene) -> Closeup:
        """Return the close-up of a `recording` that `play` made of `renderer` in `scene`."""
        renderer, dt = wrapped(renderer), float(recording.meta["dt"])
        rows = Rows(recording.hip, recording.channel("velocity"), np.full(len(recording), dt))
        before = lead_in_rows(renderer, recording.hip, dt, scene)
        return cls(renderer, recording, rows, before, dt=dt, ahead=before.dt.size)

    def refined(self, first: int, last: int, factor: int, *, lag: int) -> Closeup:
        """Return a close-up of the path from row `first` to row `last` > `first`, each step in `factor` equal ones.

        The hand first rests at row `first`, at the path's own rate, until `lag` + 1 answers are the same: what a
        lagging proxy has to catch up with there belongs to the way before.

        Row 0 is the last of that rest, and row k `factor` is where row `first` + k was. Then the hand rests for `lag`
        fine ticks. Raises `RendererError` as `play` does.
        """
        before = self._before.followed_by(self._rows.part(0, first + 1))
        ticks = Ticks(0, self._ahead)
        reset_checked(self._renderer, before.hip[0])
        lead_on(self._renderer, before, ticks, from_reset=True)
        # fine ticks are counted on from that of the path
        ticks = Ticks(ticks.after(before.dt.size).first - 1)
        # the hand rests before the part, which then begins without lag, and after it, so that a lag shows
        rest, rest_answer = self._rest_at(self._rows.hip[first], ticks, lag)
        fine_rows = self._fine_rows(first, last, factor)
        fine_rows = fine_rows.followed_by(Rows.resting(fine_rows.hip[-1], float(fine_rows.dt[-1]), lag))
        fine_answers = lead_on(self._renderer, fine_rows, ticks)
        answers = Answers(*(np.concatenate(pair) for pair in zip(rest_answer, fine_answers, strict=True)))
        time = self.recording.time[first] + np.concatenate([[0.0], np.cumsum(fine_rows.dt)])
        rows = rest.part(-1, rest.dt.size).followed_by(fine_rows)
        channels = {"hip": rows.hip, **channels_of(answers), "velocity": rows.velocity}
        recording = Recording(time, channels, {**self.recording.meta, "dt": float(fine_rows.dt[-1])})
        before = before.followed_by(rest.part(0, -1))
        return Closeup(self._renderer, recording, rows, before, dt=self._dt, ahead=self._ahead)

    def _fine_rows(self, first: int, last: int, factor: int) -> Rows:
        """Return the rows from `first` to `last` with each step in `factor` equal ones, without row `first` itself."""
        share = np.tile(np.arange(1.0, factor + 1.0) / factor, last - first)[:, np.newaxis]
        start, end = (np.repeat(self._rows.hip[k : k + last - first], factor, axis=0) for k in (first, first + 1))
        dt = np.repeat(self._rows.dt[first + 1 : last + 1] / factor, factor)
        # where a step ends the HIP is the path's own, to the bit
        hip = np.where(share == 1.0, end, start + share * (end - start))
        return Rows(hip, (end - start) / (factor * dt)[:, np.newaxis], dt)

    def _rest_at(self, hip: Array, ticks: Ticks, lag: int) -> tuple[Rows, Answers]:
        """Lead the renderer through a rest at `hip` (N,), m: return its ticks, and the last answer, a single row."""
        tick = Rows.resting(hip, self._dt, 1)
        ihips: list[Array] = []
        for count in range(1, REST_PATIENCE + 1):
            answer = lead_on(self._renderer, tick, ticks)
            ihips.append(answer.ihip[0])
            # a proxy that lags by `lag` ticks has caught up when so many answers are the same
            if count > lag and all(np.array_equal(ihip, ihips[-1]) for ihip in ihips[-lag - 1 :]):
                break
        return Rows.resting(hip, self._dt, count), answer
