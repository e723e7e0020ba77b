"""What all checks use beside the recording: lengths and steps, the worst of several, a scene's tolerances, words."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from hapticeval.phenomena.decisions import FARTHEST_STANDOFF, FORCE_DEPTH, SINGLE_ROUNDINGS, TIE_SHARE
from hapticeval.quantity import format_number
from hapticeval.recordings.recording import DOUBLE, SINGLE
from hapticeval.scene import Scene
from hapticeval.types import Array

Candidate = TypeVar("Candidate")
"""One of several, of which a finding names the worst."""

LED = ("playback", "replay")
"""Sources of recordings in which the hand was led along a given path, whatever the force."""


def lengths_of(vectors: Array) -> Array:
    """Return the lengths (n,) of `vectors` (n, N), m or N, to the bit those of `np.linalg.norm`, five times as fast."""
    # column by column: numpy is slow along an axis of two or three numbers
    return np.asarray(np.sqrt(sum(np.square(vectors).T)))


def unit_vectors(vectors: Array) -> Array:
    """Return `vectors` (n, N), m or N, divided by their lengths; one of no length stays zero."""
    lengths = lengths_of(vectors)[:, np.newaxis]
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0))


def steps_to(points: Array) -> Array:
    """Return how far `points` (n, N), m, move to each row from the one before, and 0 to the first: (n,), m."""
    return lengths_of(np.diff(points, axis=0, prepend=points[:1]))


def worst_row(values: Array) -> int:
    """Return the row at which `values` (n,), of any unit, are the largest: the first of those that are so to 1e-9.

    A path that repeats itself, or is symmetric, has several worst places: another machine names the same of them. What
    is a difference of nearly equal numbers, or rounding alone, may yet differ by more.
    """
    largest = float(np.max(values))
    return int(np.argmax(values >= largest - TIE_SHARE * abs(largest) if math.isfinite(largest) else values))


def worst_of(candidates: Sequence[Candidate], badness: Callable[[Candidate], float]) -> Candidate:
    """Return the candidate whose `badness`, of any unit, is the largest: of equally bad ones as `worst_row` does."""
    return candidates[worst_row(np.array([badness(candidate) for candidate in candidates]))]


def farthest_standoff(scene: Scene) -> float:
    """Return how far off the model, m, an IHIP may be declared: a fiftieth of its size; beyond is another object."""
    return FARTHEST_STANDOFF * scene.model.size


def note_cut_standoff(standoff: float, scene: Scene) -> str:
    """Say that not all of a declared `standoff` (m) is believed; empty where it is."""
    farthest = farthest_standoff(scene)
    if standoff <= farthest:
        return ""
    return f"it declares a standoff of {mm(standoff)}, of which {mm(farthest)} count, a fiftieth of the model's size"


def rounding(scene: Scene) -> float:
    """Return how well single precision places two points of the model's size, m."""
    return SINGLE_ROUNDINGS * SINGLE * scene.model.size


def force_depth(scene: Scene) -> float:
    """Return the depth, m, under which nothing is judged: `FORCE_DEPTH` of the model's size."""
    return FORCE_DEPTH * scene.model.size


def force_floor(scene: Scene) -> float:
    """Return the force (N) below which no direction is judged: the spring's at `force_depth`."""
    return scene.stiffness * force_depth(scene)


def listed(point: Array) -> list[float]:
    """Return a point (N,) as a JSON value."""
    return [float(x) for x in point]


def digits_kept(change: float, size: float) -> float:
    """Return how many digits of a `size`, m, hold where answers change by so much, m: 16 at the most."""
    return -math.log10(max(change / size, DOUBLE))


def newtons(force: float, digits: int = 3) -> str:
    """Return the size of a force (N) to so many digits, for a message: "2.4 N", "12,000 N"."""
    return f"{format_number(force, digits)} N"


def mm(*lengths: float) -> str:
    """Return a length (m), or a point, in millimetres to three digits, for a message: "1.5 mm", "(80, 12) mm"."""
    numbers = ", ".join(format_number(1e3 * float(length), 3) for length in lengths)
    return f"{numbers} mm" if len(lengths) == 1 else f"({numbers}) mm"
