"""The work of the force on the hand, summed up along a recording, and what bounds its error."""

from __future__ import annotations

import numpy as np

from hapticeval.phenomena.sampling import touching
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array


class SampledWork:
    """Running sums of the work in a recording at `factor` times the base rate: (n,), J, at each row of the base run.

    - `smooth`: the work by the trapezoid, and `error` what bounds that it is off by.
    - `held`: the work of a force that is held from row to row.
    - `crossed`: the work without its sign.
    - `path` (m): the length of the hand's path, and `effort` that times the force.
    - `free`: where nothing touches.
    """

    def __init__(self, recording: Recording, factor: int, scene: Scene) -> None:
        force, moved = recording.force, np.diff(recording.hip, axis=0)
        length = np.linalg.norm(moved, axis=1)
        mean = np.sum(0.5 * (force[1:] + force[:-1]) * moved, axis=1)
        # By this a trapezoid of two ticks differs: the whole of a jump of the force, and of second order elsewhere.
        bend = np.zeros_like(moved)
        bend[1:] = np.diff(force, n=2, axis=0)
        self.free = ~touching(recording, scene)[::factor]
        self.smooth, self.held, self.error, self.crossed, self.path, self.effort = (
            running_sums(steps)[::factor]
            for steps in (
                mean,
                np.sum(force[:-1] * moved, axis=1),
                0.5 * np.abs(np.sum(bend * moved, axis=1)),
                np.abs(mean),
                length,
                np.linalg.norm(force[:-1], axis=1) * length,
            )
        )


def running_sums(steps: Array) -> Array:
    """Return the running sums of `steps` (n,), as J, from 0 at the first row: (n + 1,)."""
    return np.concatenate([[0.0], np.cumsum(steps)])
