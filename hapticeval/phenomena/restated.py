"""The same contact stated otherwise gives the same answers, whatever the right answers are: how far two runs are apart.

Such metamorphic relations need no truth to compare with, and so apply to any renderer on any path: a mirror, another
order of the model's vertices, each step of the hand in two of half the time, and a second renderer of the kind beside.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from hapticeval.geometry.motion import scaling
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import (
    HAND_ROUNDING,
    NUDGE_SHARE,
    SAME_ANSWER,
    SAME_SIMULATED_ANSWER,
    STEEP_FACTOR,
)
from hapticeval.phenomena.sampling import believed_standoff, evidence_at, mm, resolution
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, compared, undecided
from hapticeval.recordings.recording import Recording
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray


def has_answer(run: Recording) -> BoolArray:
    """Return the rows (n,) in which there is anything to compare, by rounding too: an IHIP off the HIP, or a force.

    These need not be contact: see `sampling.touching`.
    """
    return np.asarray(np.any(run.ihip != run.hip, axis=1) | np.any(run.force != 0.0, axis=1))


def answers_apart(runs: Runs, other: Recording, scene: Scene, *, forces: bool = True) -> Array:
    """Return how far the answers of another run are apart from those of the base, row by row: (n,), m.

    IHIPs, and forces as lengths: by the stiffness, or, of a tool that moves by itself, by m / dt^2 where that is more.

    Such a tool's forces are means over a tick with the impulses of all events in it, and move its tool by so much.
    """
    base = runs.base
    distance = np.linalg.norm(base.ihip - other.ihip, axis=1)
    if forces:
        # A force F held for dt moves a mass m by F dt^2 / m: as a length it is F / (m / dt^2).
        event_stiffness = scene.mass / base.dt**2 if base.own_tool else 0.0
        distance = np.maximum(
            distance, np.linalg.norm(base.force - other.force, axis=1) / max(scene.stiffness, event_stiffness)
        )
    return np.asarray(distance)


def steepness(runs: Runs, reach: float, scene: Scene) -> Array:
    """Return by how much the answer changes, (n,), m, where the hand is off by up to `reach` (m) on its whole way.

    Along the axes and the diagonals, and at a quarter of the length: a renderer with memory may take another way from a
    tie on, and few nudges find every one. Needs the sibling `moved`.
    """
    steep = np.zeros(len(runs.base))
    for near in _nudged_runs(runs, reach, scene):
        # One nudge may miss the edge that another crosses: the largest change of all counts.
        steep = np.maximum(steep, answers_apart(runs, near, scene))
    # In a closed loop the hand is elsewhere from then on.
    return steep if runs.at_speed is None else np.maximum.accumulate(steep)


def apart_beside_ties(runs: Runs, apart_from: Callable[[Runs], Array], reach: float, scene: Scene) -> Array:
    """Return how far answers are, by `apart_from`, from the nearest ones of hands that are off by up to `reach`, m.

    `apart_from` compares the base run of what it is given with other runs: an array, m, of the shape that is returned.
    Where a way passes an edge nearer than that, it is a tie on which side: either answer is right, and no third. Needs
    the sibling `moved`.
    """
    apart = apart_from(runs)
    for near in _nudged_runs(runs, reach, scene):
        apart = np.minimum(apart, apart_from(replace(runs, base=near)))
    return apart


def _nudged_runs(runs: Runs, reach: float, scene: Scene) -> Iterator[Recording]:
    """Yield the runs with the hand off by `reach` (m) on its whole way, and by a quarter of that, if not refused."""
    assert runs.moved is not None
    identity = scaling(1.0, scene.model.dimension)
    for nudge in reach * _directions(scene.model.dimension):
        near = runs.moved(identity, tuple(nudge.tolist()))
        if near is not None:
            yield near


def _directions(dimension: int) -> Array:
    """Return unit vectors along the axes and the diagonals, and the same at a quarter of the length: (k, N)."""
    signs = np.array([sign for sign in itertools.product((-1.0, 0.0, 1.0), repeat=dimension) if any(sign)])
    units = signs / np.linalg.norm(signs, axis=1, keepdims=True)
    return np.vstack([units, NUDGE_SHARE * units])


NOBODY = "a recording shows one run only, and nobody can be asked for another"

check_of_relation = partial(
    Check,
    phenomenon="none of the six: a relation that every rigid contact keeps to",
    channels=("hip", "ihip", "force"),
    metric="change of the answer beside what is explained, as a share of the model's size",
    unit="1",
    level=Level.SHOULD,
)
"""Make the check of a relation, which compares answers: they are off by a share of the model's size."""


def compare_runs(
    check: Check,
    runs: Runs,
    scene: Scene,
    other: Recording | None,
    how: str,
    *,
    among: Callable[[Runs, Scene], BoolArray] | None = None,
) -> Finding:
    """Compare the base run with `other`, which is the same contact stated otherwise, in the words of `how`.

    Rows that `among` returns are exempt: those on a discontinuity.
    """
    base = runs.base
    if other is None:
        return Finding(Outcome.NOT_APPLICABLE, f"the model has no such form, or the renderer refuses it {how}")
    if not (has_answer(base) | has_answer(other)).any():
        return undecided("the hand never touches the model")
    change = answers_apart(runs, other, scene)
    # What restating a scene changes of the hand: a rounding of its coordinates.
    hand = HAND_ROUNDING * float(np.abs(base.hip).max())
    declared = max(resolution(recording, scene) + believed_standoff(recording, scene) for recording in (base, other))
    # A damper takes the velocity from hands that are off by rounding, a step of half a tick apart.
    damped = 2.0 * hand * scene.damping / (scene.stiffness * 0.5 * base.dt)
    allowed = np.full(len(base), hand + declared + damped)
    exempt = np.zeros(len(base), dtype=bool)
    if np.any(change > allowed + SAME_ANSWER * scene.model.size) and runs.moved is not None:
        # Only where something is off are nudged runs made: each costs a run of its own.
        allowed += STEEP_FACTOR * steepness(runs, hand + declared, scene)
        if among is not None:
            exempt = among(runs, scene)
    if base.own_tool:
        # A tool that moves by itself has events at instants that its renderer has to find.
        known = SAME_SIMULATED_ANSWER * scene.model.size
        allowed += known - SAME_ANSWER * scene.model.size
        if np.any(change > allowed + SAME_ANSWER * scene.model.size) and runs.moved is not None:
            # Two tools that are one to `known` may meet an edge on either side. Off by half of it, each is one still.
            change = apart_beside_ties(runs, lambda beside: answers_apart(beside, other, scene), 0.5 * known, scene)
    return relation_finding(check, base, scene, change, allowed, exempt, how)


def relation_finding(
    check: Check,
    base: Recording,
    scene: Scene,
    change: Array,
    allowed: Array,
    exempt: BoolArray,
    how: str,
) -> Finding:
    """Judge the `change` (n,), m, of answers beyond what is `allowed` (n,), m, in rows that are not `exempt` (n,)."""
    size = scene.model.size
    excess = np.where(exempt, 0.0, np.maximum(change - allowed, 0.0)) / size
    # Without an excess the largest change of a row that counts is shown.
    worst = int(np.argmax(excess if excess.max() > 0.0 else np.where(exempt, -np.inf, change)))
    return compared(
        Metric(check.metric, float(excess.max()), check.unit),
        SAME_ANSWER,
        {
            **evidence_at(base, worst),
            "off_m": float(change[worst]),
            "allowed_m": float(allowed[worst]),
            "rows_off": int(np.sum(excess > SAME_ANSWER)),
            "rows_exempt": int(exempt.sum()),
        },
        passes=f"the answers are the same {how}",
        fails=f"{how} the answer is off by {mm(change[worst])}, {change[worst] / size:.2g} of the model's size, "
        f"at {int(np.sum(excess > SAME_ANSWER))} of {len(base)} HIPs",
    )
