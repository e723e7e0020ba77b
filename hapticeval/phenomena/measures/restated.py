"""How far the answers of two runs of one contact are apart, and how much of that nudges of the hand explain."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from hapticeval.geometry.motion import scaling
from hapticeval.phenomena.check import Runs, required
from hapticeval.phenomena.decisions import NUDGE_SHARE
from hapticeval.phenomena.measures.stiffness import force_coarseness
from hapticeval.phenomena.observed import Observed
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


def has_answer(run: Observed) -> BoolArray:
    """Return the rows (n,) in which there is anything to compare, by rounding too: an IHIP off the HIP, or a force.

    These need not be contact: see `Observed.contact`.
    """
    return np.asarray(np.any(run.ihip != run.hip, axis=1) | np.any(run.force != 0.0, axis=1))


def declared_lengths(runs: Iterable[Observed]) -> float:
    """Return the largest resolution and standoff, m, that the runs declare, as far as they are believed."""
    return max(run.resolution + run.believed_standoff for run in runs)


def answers_apart(base: Observed, other: Observed, *, forces: bool = True) -> Array:
    """Return how far the answers of another run are apart from those of the base, row by row: (n,), m.

    IHIPs, and forces as lengths: by the stiffness, or, of a tool that moves by itself, by m / dt^2 where that is more.

    Such a tool's forces are means over a tick with the impulses of all events in it, and move its tool by so much.
    Either force may be off by the resolution that is declared of it.
    """
    scene = base.scene
    distance = np.linalg.norm(base.ihip - other.ihip, axis=1)
    if forces:
        # A force F held for dt moves a mass m by F dt^2 / m: as a length it is F / (m / dt^2).
        event_stiffness = scene.mass / base.dt**2 if base.own_tool else 0.0
        # Forces that were turned back lie on no lattice any more.
        coarse = 2.0 * max(force_coarseness(run) for run in (base, other))
        apart = np.maximum(np.linalg.norm(base.force - other.force, axis=1) - coarse, 0.0)
        distance = np.maximum(distance, apart / max(scene.stiffness, event_stiffness))
    return np.asarray(distance)


def steepness(runs: Runs, reach: float, scene: Scene) -> Array:
    """Return by how much the answer changes, (n,), m, where the hand is off by up to `reach` (m) on its whole way.

    Along the axes and the diagonals, and at a quarter of the length: a renderer with memory may take another way from a
    tie on, and few nudges find every one. Needs the sibling `moved`.
    """
    steep = np.zeros(len(runs.base))
    for near in _nudged_runs(runs, reach, scene):
        # One nudge may miss the edge that another crosses: the largest change of all counts.
        steep = np.maximum(steep, answers_apart(runs.observed(scene), near))
    # In a closed loop the hand is elsewhere from then on.
    return steep if runs.at_speed is None else np.maximum.accumulate(steep)


def apart_beside_ties(runs: Runs, apart_from: Callable[[Observed], Array], reach: float, scene: Scene) -> Array:
    """Return how far answers are, by `apart_from`, from the nearest ones of hands that are off by up to `reach`, m.

    `apart_from` compares a run with others: (n,) or, of k others, (k, n), m, as is returned.
    Where a way passes an edge nearer than that, it is a tie on which side: either answer is right, and no third. Needs
    the sibling `moved`.
    """
    apart = apart_from(runs.observed(scene))
    for near in _nudged_runs(runs, reach, scene):
        apart = np.minimum(apart, apart_from(near))
    return apart


def _nudged_runs(runs: Runs, reach: float, scene: Scene) -> Iterator[Observed]:
    """Yield the runs with the hand off by `reach` (m) on its whole way, and by a quarter of that, if not refused."""
    identity = scaling(1.0, scene.model.dimension)
    for nudge in reach * nudge_directions(scene.model.dimension):
        near = required(runs.moved)(identity, tuple(nudge.tolist()))
        if near is not None:
            yield Observed(near, scene)


def nudge_directions(dimension: int) -> Array:
    """Return unit vectors along the axes and the diagonals, and the same at a quarter of the length: (k, N)."""
    signs = np.array([sign for sign in itertools.product((-1.0, 0.0, 1.0), repeat=dimension) if any(sign)])
    units = signs / np.linalg.norm(signs, axis=1, keepdims=True)
    return np.vstack([units, NUDGE_SHARE * units])
