"""What a declared stiffness may vary with: place and depth, so that one HIP has one force by any way, in any tick.

Forces at the same HIP are compared between a run and the same led backwards, which comes from the other side and at
another time, and between a run and the same at twice the rate, whose ticks have other numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hapticeval.phenomena.check import Runs
from hapticeval.phenomena.decisions import LAG_STEPS, LAG_TICKS, TWO_FORCES_ROWS
from hapticeval.phenomena.lag import beside_straight, delayed, largest_in_lag
from hapticeval.phenomena.measures.stiffness import force_coarseness, largest_other_force
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import lengths_of, steps_to, worst_row
from hapticeval.types import IntArray


class TwoForces(NamedTuple):
    """Two forces, N, at the HIP of `tick`: the run's, and `other`, which came `how`; and what of it is explained."""

    tick: int
    size: float
    other: float
    how: str
    difference: float
    allowed: float

    @property
    def excess(self) -> float:
        """How far the forces differ beyond what is explained, N."""
        return self.difference - self.allowed


class _Pairs(NamedTuple):
    """Rows (k,) of a run and of an `other`, at which the hand is at one place; `lag_steps` is how many lags are tried.

    Where ticks have other numbers no lag between ticks is tried: it would make one of two that are apart.
    """

    rows: IntArray
    other: Observed
    other_rows: IntArray
    how: str
    lag_steps: int


def find_two_forces(runs: Runs, base: Observed) -> TwoForces | None:
    """Return the farthest two forces at one HIP of a path that nothing explains; None where one HIP has one force.

    Explained are one lag of up to three ticks, a damper, the curvature of one that declares no spring, coarse numbers,
    and IHIPs apart by as much. In a loop, where the hand cannot be led back, it is for `passivity` to say.
    """
    if runs.reverse is None:
        return None
    backwards = Observed(runs.reverse(), base.scene).as_sensed
    pairs = [_of_nearest(base, backwards, "on the way back")]
    if runs.refine is not None:
        finer = Observed(runs.refine(2), base.scene).as_sensed
        rows = np.arange(min(len(base), -(-len(finer) // 2)))
        pairs.append(_Pairs(rows, finer, 2 * rows, "at twice the rate", LAG_TICKS))
    return next((two for two in (_least_of_lags(base, pair) for pair in pairs) if two is not None), None)


def _of_nearest(base: Observed, other: Observed, how: str) -> _Pairs:
    """Pair each row with that of the `other` run whose HIP is nearest, within a HIP step."""
    from scipy.spatial import cKDTree

    distance, match = map(np.asarray, cKDTree(other.hip).query(base.hip))
    rows = np.flatnonzero(distance <= base.hip_step)
    return _Pairs(rows, other, match[rows], how, LAG_STEPS)


def _least_of_lags(base: Observed, pairs: _Pairs) -> TwoForces | None:
    """Return the two forces with the lag that makes least of them; None where with one of the lags there are none."""
    least: TwoForces | None = None
    for lag in np.linspace(0.0, LAG_TICKS, pairs.lag_steps + 1).tolist():
        two = _worst_with_lag(base, pairs, lag)
        if two is None:
            return None
        if least is None or two.excess < least.excess:
            least = two
    return least


def _worst_with_lag(base: Observed, pairs: _Pairs, lag: float) -> TwoForces | None:
    """Return the farthest two forces at one HIP, which come so many ticks after it; None of none."""
    other, late = pairs.other, math.ceil(lag)
    answered = (pairs.rows + late < len(base)) & (pairs.other_rows + late < len(other))
    rows, other_rows = pairs.rows[answered], pairs.other_rows[answered]
    pressed = base.pressed[rows + late] | other.pressed[other_rows + late]
    rows, other_rows = rows[pressed], other_rows[pressed]
    if rows.size == 0:
        return None
    # The answers to a HIP stand `lag` rows behind it, or the force's alone.
    force, other_force = delayed(base.force, rows, -lag), delayed(other.force, other_rows, -lag)
    ihips_apart = np.minimum(
        lengths_of(delayed(base.ihip, rows, -lag) - delayed(other.ihip, other_rows, -lag)),
        lengths_of(base.ihip[rows] - other.ihip[other_rows]),
    )
    # Another contact point is another place.
    same_place = ihips_apart <= base.position_tolerance + base.resolution
    if not same_place.any():
        return None
    rows, other_rows, ihips_apart = rows[same_place], other_rows[same_place], ihips_apart[same_place]
    force, other_force = force[same_place], other_force[same_place]
    difference = lengths_of(force - other_force)
    # The spring's force, by how hands and IHIPs are apart.
    apart = lengths_of(base.hip[rows] - other.hip[other_rows]) + ihips_apart
    allowed = base.scene.stiffness * _stiffest(base) * apart
    for run, ticks in ((base, rows), (other, other_rows)):
        # A lag is known to so much of a tick, and between ticks a force may lie off the straight line.
        step = LAG_TICKS / pairs.lag_steps * largest_in_lag(steps_to(run.hip))
        allowed += (run.scene.stiffness * _stiffest(run) * (step + run.rounding) + largest_other_force(run))[ticks]
        allowed += beside_straight(run.force)[ticks] if lag != late else 0.0
        allowed += force_coarseness(run)
    off = np.zeros(len(base))
    off[rows] = difference > allowed
    # So many of twice as many rows, one after the other.
    many = np.convolve(off, np.ones(2 * TWO_FORCES_ROWS), mode="same") >= TWO_FORCES_ROWS
    excess = np.where(many[rows], difference - allowed, -np.inf)
    worst = worst_row(excess)
    if not excess[worst] > 0.0:
        return None
    sizes = float(np.linalg.norm(force[worst])), float(np.linalg.norm(other_force[worst]))
    return TwoForces(int(rows[worst]), *sizes, pairs.how, float(difference[worst]), float(allowed[worst]))


def _stiffest(run: Observed) -> float:
    """Return the largest stiffness that a run shows in contact, as a share of the scene's, within what is declared."""
    depth = lengths_of(run.hip - run.ihip)
    deep = run.pressed & (depth > run.force_depth)
    shown = float((run.force_size[deep] / (run.scene.stiffness * depth[deep])).max(initial=1.0))
    return min(shown, (run.stiffness_range or (1.0, 1.0))[1])
