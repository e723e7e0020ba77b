"""How finely the numbers of a recording are told, and what that makes of the columns that runs are compared in.

A number is known to the largest of these:

    the spacing of doubles at the column's size, `STEPS` times: each of a handful of operations costs half of one
    the spacing of single precision, where every number of the channel is one: that is what computed it
    the step of the lattice that the channel lies on, where it lies on one: an encoder's, a converter's
    the unit in the last place, where every number has so few digits: a text's

Positions are numbers of the size of the workspace, also where their difference is small. So a depth |IHIP - HIP| is as
fine as these, and a force K (IHIP - HIP) is no finer than K times that, whatever the spacing at its own size. A joint's
encoder reaches the HIP by the lever arm |dHIP| / |dq| that the run itself shows. With r_F and r_x (N and m, of one
coordinate) and N dimensions:

    magnitude   sqrt(N) r_F                    direction   sqrt(N) r_F / |F|, and the spacing at a turn
    depth       2 sqrt(N) r_x                  leaning     that, and what r_x turns the normal by: sqrt(N) kappa r_x
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hapticeval.recordings.grain import grain, single
from hapticeval.recordings.recording import Recording
from hapticeval.recordings.signal_faults import quantum
from hapticeval.types import Array

STEPS = 16.0
"""Spacings of the number that a projection, a spring, a norm and an interpolation may cost together."""


class Resolution(NamedTuple):
    """Below what differences of a coordinate say nothing: of positions, m, and of forces, N; `dimension` of them."""

    position: float
    force: float
    dimension: int

    def of(self, column: str, size: Array, curvature: Array | float = 0.0) -> Array:
        """That of a column of `alignment.COLUMNS`, (m,), where the force has a `size` (m,), N, and the surface a
        `curvature` (m,), 1/m; infinite where there is no force, whose direction nothing tells."""
        root = math.sqrt(self.dimension)
        turn = STEPS * float(np.spacing(2.0 * math.pi))
        with np.errstate(divide="ignore"):
            direction = turn + root * self.force / np.asarray(size)
        kinds: Mapping[str, Array] = {
            "magnitude": np.full(np.shape(size), root * self.force),
            "depth": np.full(np.shape(size), 2.0 * root * self.position),
            "direction": direction,
            "leaning": direction + root * self.position * np.abs(curvature),
        }
        return kinds[column]


def resolution(recording: Recording) -> Resolution:
    """What the numbers of a recording with HIP and force resolve."""
    keep = recording.measured
    places = [recording.channels[name][keep] for name in ("hip", "ihip") if name in recording.channels]
    position = max([_grain(values) for values in places] + [_encoder(recording, places[0], keep)])
    force = recording.force[keep]
    own = _grain(force)
    if len(places) == 2:
        depth = np.linalg.norm(places[1] - places[0], axis=1)
        pressed = (depth > position) & np.any(force != 0.0, axis=1)
        if pressed.any():
            own = max(own, 2.0 * position * float(np.median(np.linalg.norm(force[pressed], axis=1) / depth[pressed])))
    return Resolution(position, own, force.shape[1])


def _grain(values: Array) -> float:
    """The resolution of a channel (n, N) by its own numbers."""
    size = float(np.max(np.abs(values), initial=0.0))
    if size == 0.0:
        return 0.0
    # whole numbers and short decimals are exact in either precision, and no sign of one
    computed = max((single(column) for column in values.T if quantum(column) is None), default=0.0)
    return max(STEPS * max(computed, float(np.spacing(size))), *(grain(column) for column in values.T))


def _encoder(recording: Recording, hip: Array, keep: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> float:
    """What the quantum of the joints' encoders is at the HIP, m; 0 where there are none."""
    if "joint_position" not in recording.channels:
        return 0.0
    joints = recording.channels["joint_position"][keep]
    step = max((quantum(column) or 0.0 for column in joints.T), default=0.0)
    turned, moved = (np.linalg.norm(np.diff(each, axis=0), axis=1) for each in (joints, hip))
    some = turned > 0.0
    return step * float(np.median(moved[some] / turned[some])) if step > 0.0 and some.any() else 0.0
