"""A part of a path once more in finer steps, as checks ask for where an answer jumps."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from functools import partial

import numpy as np

from hapticeval.recordings.recording import Recording
from hapticeval.renderer import Answers, Renderer
from hapticeval.scene import Scene
from hapticeval.simulation.checked_calls import reported_contact, reset_checked, step_checked
from hapticeval.simulation.playback import Rows, channels_of, lead_in_rows, lead_on
from hapticeval.types import Array

REST_PATIENCE = 32
"""Ticks after which a renderer that still moves under a hand at rest is not waited for."""

MOST_COPIES = 16
"""Copies of a renderer that are kept of one path, for it may be large: spread over all of it, so that none is far."""

PROOF_TICKS = 8
"""Ticks over which two copies of a renderer have to answer alike, one after the other."""


@dataclass
class _Original:
    """The renderer that is looked at, and whether copies of it can stand for it."""

    renderer: Renderer
    dt: float
    shared: tuple[object, ...]
    ahead: int
    can_be_copied: bool = True
    copies_proved: bool = False

    def copy(self, renderer: Renderer) -> Renderer | None:
        """A copy that has the shared objects in common with `renderer`; None where it cannot be copied."""
        if not self.can_be_copied:
            return None
        try:
            return deepcopy(renderer, {id(shared_object): shared_object for shared_object in self.shared})
        except Exception:  # a foreign object may refuse in any way; it is then led to the place anew
            self.can_be_copied = False
            return None


class Closeup:
    """A path that a renderer was led along, any part of which it can be led along again in finer steps.

    The renderer gets to that part as it did before, tick by tick, and the part alone is refined: from a copy of the
    renderer where it can be copied, else by leading it there anew from its reset. `recording` holds what it answered.
    """

    def __init__(self, recording: Recording, rows: Rows, before: Rows, original: _Original) -> None:
        self.recording = recording
        self._rows = rows
        self._before = before
        self._original = original
        self._kept_copies: dict[int, Renderer] = {}

    @classmethod
    def of(cls, renderer: Renderer, recording: Recording, scene: Scene) -> Closeup:
        """Return the close-up of a `recording` that `play` made of `renderer` in `scene`.

        The renderer's copies have the scene in common with it.
        """
        dt = float(recording.meta["dt"])
        rows = Rows(recording.hip, recording.channel("velocity"), np.full(len(recording), dt))
        before = lead_in_rows(renderer, recording.hip, dt, scene)
        shared = (scene, scene.model, scene.model.boundary)
        return cls(recording, rows, before, _Original(renderer, dt, shared, before.dt.size))

    def refined(self, first: int, last: int, factor: int, *, lag: int) -> Closeup:
        """Return a close-up of the path from row `first` to row `last` > `first`, each step in `factor` equal ones.

        The hand first rests at row `first`, at the path's own rate, until `lag` + 1 answers are the same: what a
        lagging proxy has to catch up with there belongs to the way before.

        Row 0 is the last of that rest, and row k `factor` is where row `first` + k was. Then the hand rests for `lag`
        fine ticks. Raises `RendererError` as `play` does.
        """
        renderer = self._renderer_after(first)
        tick = self._tick(first)
        # the hand rests before the part, which then begins without lag, and after it, so that a lag shows
        rest_rows, rest_answer = self._rest_at(renderer, first, lag)
        copy = self._original.copy(renderer)
        share = np.tile(np.arange(1.0, factor + 1.0) / factor, last - first)[:, np.newaxis]
        start, end = (np.repeat(self._rows.hip[k : k + last - first], factor, axis=0) for k in (first, first + 1))
        dt = np.repeat(self._rows.dt[first + 1 : last + 1] / factor, factor)
        # where a step ends the HIP is the path's own, to the bit
        hip = np.where(share == 1.0, end, start + share * (end - start))
        fine_rows = Rows(hip, (end - start) / (factor * dt)[:, np.newaxis], dt)
        fine_rows = fine_rows.followed_by(Rows.resting(hip[-1], float(dt[-1]), lag))
        fine_answers = lead_on(
            renderer,
            fine_rows,
            tick,
            lambda: self._rows_since_reset(first + 1).followed_by(rest_rows),
            ahead=self._original.ahead,
        )
        answers = Answers(*(np.concatenate(pair) for pair in zip(rest_answer, fine_answers, strict=True)))
        time = self.recording.time[first] + np.concatenate([[0.0], np.cumsum(fine_rows.dt)])
        rows = rest_rows.part(-1, rest_rows.dt.size).followed_by(fine_rows)
        channels = {"hip": rows.hip, **channels_of(answers), "velocity": rows.velocity}
        recording = Recording(time, channels, {**self.recording.meta, "dt": float(dt[-1])})
        before = self._rows_since_reset(first + 1).followed_by(rest_rows.part(0, -1))
        closeup = Closeup(recording, rows, before, self._original)
        if copy is not None:
            closeup._kept_copies[0] = copy
        return closeup

    def _rows_since_reset(self, count: int) -> Rows:
        """What the renderer has been asked before row `count` of the path."""
        return self._before.followed_by(self._rows.part(0, count))

    def _tick(self, row: int) -> int:
        """As errors count it, from where the path begins."""
        return self._before.dt.size - self._original.ahead + row

    def _rest_at(self, renderer: Renderer, row: int, lag: int) -> tuple[Rows, Answers]:
        """The ticks of a rest at `row`, and the last answer, a single row."""
        rows = Rows.resting(self._rows.hip[row], self._original.dt, REST_PATIENCE)
        answers: list[tuple[Array, Array]] = []
        for _ in range(REST_PATIENCE):
            hip, velocity = rows.hip[0], rows.velocity[0]
            answers.append(step_checked(renderer, self._tick(row), hip, velocity, self._original.dt, may_refuse=False))
            same_answers = [np.array_equal(ihip, answers[-1][0]) for ihip, _ in answers[-lag - 1 :]]
            # a proxy that lags by `lag` ticks has caught up when so many answers are the same
            if len(same_answers) > lag and all(same_answers):
                break
        ihip, force = answers[-1]
        last = Answers(ihip[np.newaxis], force[np.newaxis], np.array([reported_contact(renderer)]))
        return rows.part(0, len(answers)), last

    def _renderer_after(self, row: int) -> Renderer:
        """The renderer as it was after `row`, to be led on from there."""
        renderer_copy = self._copy_after(row) if self._original.can_be_copied else None
        # The copy that is kept stays where it is: another one is led on.
        copy = None if renderer_copy is None else self._original.copy(renderer_copy)
        if copy is not None:
            return copy
        # it cannot be copied: led from its reset again
        renderer = self._original.renderer
        rows = self._rows_since_reset(row + 1)
        reset_checked(renderer, rows.hip[0])
        lead_on(renderer, rows, -self._original.ahead, partial(rows.part, 0, 0))
        return renderer

    def _copy_after(self, row: int) -> Renderer | None:
        """A copy of the renderer as it was after `row`, which is not to be led on itself; None where there is none."""
        if row in self._kept_copies:
            return self._kept_copies[row]
        original = self._original
        # from the last copy before the row, or from a reset
        nearest = max((copied_row for copied_row in self._kept_copies if copied_row < row), default=-1)
        if nearest >= 0:
            renderer = original.copy(self._kept_copies[nearest])
        else:
            reset_checked(original.renderer, self._rows_since_reset(1).hip[0])
            lead_on(original.renderer, self._before, -original.ahead, partial(self._before.part, 0, 0))
            renderer = original.renderer
        if renderer is None:
            return None
        lead_on(
            renderer,
            self._rows.part(nearest + 1, row + 1),
            self._tick(nearest + 1),
            lambda: self._rows_since_reset(nearest + 1),
            ahead=original.ahead,
        )
        copy = original.copy(renderer) if nearest < 0 else renderer
        if copy is not None and self._proves_copies(copy, row + 1):
            self._kept_copies[row] = copy
            if len(self._kept_copies) > MOST_COPIES:
                # the copy whose neighbours are closest together is the one that is missed least
                rows = sorted(self._kept_copies)
                del self._kept_copies[
                    min(zip(rows, rows[1:], rows[2:], strict=False), key=lambda three: three[2] - three[0])[1]
                ]
            return copy
        return None

    def _proves_copies(self, renderer: Renderer, row: int) -> bool:
        """Whether copies are independent: of a handle to a state elsewhere a copy is the same state once more.

        Two copies are led along the same rows from `row` on one after the other, and must give the same answers to the
        bit.
        """
        original = self._original
        if not original.copies_proved:
            rows, tick = self._rows.part(row, row + PROOF_TICKS), self._tick(row)
            answers = []
            for _ in range(2):
                copy = original.copy(renderer)
                if copy is None:
                    return False
                answers.append(lead_on(copy, rows, tick, lambda: self._rows_since_reset(row), ahead=original.ahead))
            original.can_be_copied = original.copies_proved = all(
                map(np.array_equal, *(answer[:2] for answer in answers))
            )
        return original.can_be_copied
