"""Jumps of the IHIP: where a recording has any, and which of them stay when their place is looked at in finer steps.

1. `suspect_stretches` finds the ticks at which the IHIP moves farther than its bound.
2. `_JumpSearch` runs each stretch again in 4, 4 and then up to 64 parts of a tick. `_leads_the_same_way` makes sure
   that the finer run follows the coarse one, before it is trusted.
3. `_judge_scales` reads off how the IHIP's spread falls with the HIP's step h: where it does not fall the jump STAYS;
   where it falls as h^a with a small a the place is STEEP; else it is continuous.
4. A renderer may compute in single precision. Below what that resolves of the coordinates its rounding looks like a
   jump, and a true jump may look smeared: there the whole sequence of scales decides.

A step of the IHIP counts where the surface is `holding` a contact point at both its ends; whether there is any contact,
be it only a late force, is what `touching` says.

A step may be as long as the hand has lately moved in so many ticks, and the standoff. It may be longer where it is

- a flight: a rigid tool without mass that is let go at an edge is at the hand at once, or at the next face in between.
  Its contact point is then on another face one sample later, and the contact has ended in between: no pop-through,
  which leads through the solid, and no slide, which stays in contact;
- one that a tool takes which slides on the edges or triangles that the renderer was given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from hapticeval.geometry.boundary import Boundary, distance_between
from hapticeval.phenomena.check import Refinable
from hapticeval.phenomena.decisions import (
    COARSER_THAN_DOUBLE,
    DESCENT_SHARE,
    DETOUR_BOUNDS,
    FEW_PARTS,
    FLIGHT_BOUNDS,
    FOLLOWING_TICKS,
    JUMP_SPREAD_SHARE,
    LAG_TICKS,
    LEAST_EXPONENT,
    LIMIT_SHARE,
    LOOKS_BELOW_SINGLE,
    MANY_PARTS,
    ROWS_OF_A_LOOK,
    SMOOTH_EXPONENT,
    TICKS_AFTER_JUMP,
    TICKS_AROUND,
    TICKS_BEFORE_JUMP,
)
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import worst_row
from hapticeval.recordings.recording import single_rounding
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray


def step_bounds(recording: Observed, ticks: float, standoff: float) -> Array:
    """Return how far the IHIP may move to each sample, (n,), m: recent steps of so many `ticks`, and the standoff.

    Not less than rounding, which moves it where the hand rests.
    """
    return np.asarray(np.maximum(ticks * recording.recent_steps, recording.rounding) + standoff)


def allow_flights(recording: Observed, bounds: Array) -> Array:
    """Return `bounds` (n,), m, of the steps to each sample, raised where a step beyond its bound is a flight.

    From the worst one on, up to the first that is none: that one decides, whatever the shorter ones are.
    """
    steps, raised = recording.contact_steps, bounds.copy()
    suspects = np.flatnonzero(steps > bounds)
    for tick in suspects[np.argsort((bounds - steps)[suspects])].tolist():
        if not _is_flight(recording, recording.boundary, tick, float(bounds[tick])):
            break
        raised[tick] = steps[tick]
    return raised


def _is_flight(recording: Observed, boundary: Boundary, tick: int, bound: float) -> bool:
    """Return whether a tool near the last IHIP is let go and meets the surface where the IHIP of `tick` is.

    Near is within `bound` (m), off the surface by as much; it flies straight to where the hand is, or was up to three
    ticks ago. A face that it is pressed on bars its way at once.
    """
    before, now = recording.ihip[tick - 1], recording.ihip[tick]
    near = DETOUR_BOUNDS * bound
    # Both ends of a shorter step are near one place.
    if distance_between(before, now) <= FLIGHT_BOUNDS * bound:
        return False
    # Through the solid no tool flies, and most jumps lead there.
    if boundary.signed_distance(0.5 * (before + now)[np.newaxis])[0] < -bound:
        return False
    around = boundary.closest_point(np.vstack([before, boundary.around(before, bound)]))
    for hip in recording.hip[max(tick - LAG_TICKS, 0) : tick + 1]:
        for start in around.foot + bound * around.normal:
            met = boundary.first_crossing(start, hip, grain=DESCENT_SHARE * bound)
            if met is not None and distance_between(met, now) <= near < distance_between(met, before):
                return True
    return False


def bounds_with_flights(recording: Observed, ticks: float, standoff: float) -> Array:
    """Return the `step_bounds` (n,), m, and of a flight its length, wherever it ends."""
    return allow_flights(recording, step_bounds(recording, ticks, standoff))


def with_steps_of_pieces(base: Observed, bounds: Array, pieces: Boundary) -> Array:
    """Return `bounds` (n,), m, raised where a step is one that a tool takes which slides on the given pieces.

    Under a convex edge that turns by b, a hand at depth d makes a tool jump by d sin b, from the edge to where the next
    piece is nearest.

    The renderer's step may end anywhere on the way from its last IHIP to where such a tool gets to, for a hand up to
    three ticks old: off that way by as much as any step may be long, there and back.
    """
    steps, raised = base.contact_steps, bounds.copy()
    for tick in np.flatnonzero(steps > bounds):
        before, now = base.ihip[tick - 1], base.ihip[tick]
        # A late renderer slides to a hand of up to three ticks ago.
        for hip in base.hip[max(int(tick) - LAG_TICKS, 0) : tick + 1]:
            slid = pieces.descend(before, hip, step=DESCENT_SHARE * float(bounds[tick]))
            # |before now| + |now slid| - |before slid|: 0 on the straight way from the last IHIP to the slid tool.
            detour = steps[tick] + distance_between(now, slid) - distance_between(before, slid)
            if detour <= DETOUR_BOUNDS * bounds[tick]:
                raised[tick] = steps[tick]
                break
    return raised


def worst_step(recording: Observed, bounds: Array) -> tuple[float, int]:
    """Return the step in contact that is farthest above its bound of `bounds` (n,), m, and the tick at its end.

    Where no step is above, the longest one; 0 m at tick 0 where no two samples in a row are in contact.
    """
    steps = recording.contact_steps
    # How far above its bound; where there is no step in contact there is nothing to be above.
    above = np.where(steps > 0.0, steps - bounds, -math.inf)
    tick = worst_row(above)
    return (float(steps[tick]), tick) if above[tick] > 0.0 else largest_jump(recording)


def largest_jump(recording: Observed) -> tuple[float, int]:
    """Return the largest IHIP step between two samples in contact, m, and the tick at its end (0 if there is none)."""
    contact = recording.holding
    if not (contact[1:] & contact[:-1]).any():
        return 0.0, 0
    steps = recording.contact_steps
    tick = worst_row(steps[1:]) + 1
    return float(steps[tick]), tick


class Remains(StrEnum):
    """What finer steps leave of a jump: it stays, is only steep, or cannot be told."""

    STAYS = "stays"
    STEEP = "steep"
    UNRESOLVED = "unresolved"


@dataclass(frozen=True)
class Scale:
    """A place at one sampling: `halvings` of the recorded step; the longest IHIP step there, m; and its `spread`, m.

    The spread is the largest distance between IHIPs around that step: it depends less on where the samples fall.
    `hip_step`, m, is the longest of the HIP there.

    `follows_hand` where the IHIP moves with each step of the hand, and not with the rounding of its coordinates only.
    """

    halvings: float
    jump: float
    spread: float
    hip_step: float
    follows_hand: bool


@dataclass(frozen=True)
class RoughPlace:
    """A place where finer steps do not take the IHIP's steps below the bound: the step left, m, and its `kind`.

    `slope` is the exponent a of spread ~ h^a over the HIP step h: 1 is Lipschitz, 0 a jump. `tick` is the recording's.
    """

    kind: Remains
    tick: int
    remaining: float
    slope: float
    scales: tuple[Scale, ...]


def lets_go(recording: Observed, rows: slice, depth: float) -> int | None:
    """Return the first tick of some rows, after contact was had there, without it and the HIP over `depth` m inside."""
    contact = recording.contact[rows]
    lost_rows = np.flatnonzero(np.logical_or.accumulate(contact) & ~contact)
    if lost_rows.size == 0:
        return None
    inside = lost_rows[recording.boundary.signed_distance(recording.hip[rows][lost_rows]) < -depth]
    return (rows.start or 0) + int(inside[0]) if inside.size else None


def aitken(coarse: float, middle: float, fine: float) -> float:
    """Return the limit of a sequence limit + c r^k, within [0, fine]; `fine` where it does not approach any.

    By Aitken's delta-squared process, of three values whose scale shrinks by one factor each time.
    """
    # limit = (x0 x2 - x1^2) / (x0 + x2 - 2 x1)
    curvature = coarse + fine - 2.0 * middle
    if curvature <= 0.0:
        return fine
    return min(max((coarse * fine - middle * middle) / curvature, 0.0), fine)


def jump_at_rate(factor: int, path: Refinable, scene: Scene, tick: int) -> float:
    """Return the largest IHIP step, m, of the way by `tick` when all of it is sampled `factor` times as fast."""
    first, last = max(tick - TICKS_BEFORE_JUMP, 0), min(tick + TICKS_AFTER_JUMP, len(path.recording) - 1)
    return largest_jump(Observed(path.refined(first, last, factor, lag=LAG_TICKS).recording, scene))[0]


def look_closer(path: Refinable, base: Observed, *, bounds: Array, standoff: float) -> RoughPlace | None:
    """Return the first place, largest steps first, that finer steps leave above its bound of `bounds` (n,), m; or None.

    `base` is the path's recording, and `standoff` (m) is how far the rendered surface may lie off the model. A place
    that is steep is the answer only where no other stays or is unresolved.
    """
    search = _JumpSearch(base, standoff)
    place = search.first_place_in(_Look(path, base, bounds, lambda row: row, resolved_step=search.resolved_step))
    if place is None:
        return None
    # A proxy that lags moves later than the hand that made it.
    tick = min(place.tick, len(base) - 1)
    near = slice(tick, tick + LAG_TICKS + 1)
    # The step that is too long: one that may be longer, as a flight, is not this place.
    return replace(place, tick=tick + worst_row((base.contact_steps - bounds)[near]))


class _Look:
    """A part of the path in finer steps than the look before has it; the first is the recording itself.

    - `path` can run any part of its recording, which is `run`, again in finer steps.
    - `bounds` (n,), m, are what its IHIP `steps` (n,), m, may be. In finer steps the bound of a place stays the
      recording's.
    - `tick` returns the recording's tick that ends the step in which a row lies.
    - `scales`: how the place looked in the looks before.
    - `stretches`: first and last row of what is suspect in it, the worst first.
    """

    def __init__(
        self,
        path: Refinable,
        run: Observed,
        bounds: Array,
        tick: Callable[[int], int],
        scales: tuple[Scale, ...] = (),
        *,
        resolved_step: float,
    ) -> None:
        self.path, self.run, self.bounds, self.tick, self.scales = path, run, bounds, tick, scales
        self.steps = run.contact_steps
        # Below single precision even a true jump may look smeared: from here on all scales of a place decide.
        self.below_single = bool(scales) and scales[-1].hip_step < 2.0 * resolved_step
        longest = ROWS_OF_A_LOOK // (FEW_PARTS if len(scales) < 2 else MANY_PARTS)
        self.stretches = suspect_stretches(self.steps, bounds, longest)

    def is_settled_by(self, place: RoughPlace | None) -> bool:
        """Return whether no more stretches are to be looked into after one in which finer steps leave `place`."""
        # Below single precision one stretch is enough; above it one that is steep may yet be outdone.
        return self.below_single or (place is not None and place.kind is not Remains.STEEP)


class _JumpSearch:
    """The search for a jump that stays, in ever finer looks: each is into a stretch of the one before it."""

    def __init__(self, base: Observed, standoff: float) -> None:
        # m, what single precision resolves of the whole path's coordinates: those of a place may be near to 0.
        self.resolved_step = single_rounding(base.hip)
        self.tolerance = standoff + self.resolved_step

    def first_place_in(self, look: _Look) -> RoughPlace | None:
        """Return what finer steps leave of a look's steps above their bounds; None where nothing is left."""
        first_steep: RoughPlace | None = None
        for first, last in look.stretches:
            place_or_look = self._look_into(look, first, last)
            place = self.first_place_in(place_or_look) if isinstance(place_or_look, _Look) else place_or_look
            if look.is_settled_by(place):
                return place
            first_steep = first_steep or place
        # No stretch is left that could decide.
        return self._judge_worst(look) if look.below_single else first_steep

    def _look_into(self, look: _Look, first: int, last: int) -> RoughPlace | _Look | None:
        """Return what is left of a stretch of steps above their bounds, or the finer look that has to tell."""
        worst = first + worst_row((look.steps - look.bounds)[first : last + 1])
        scales = self._scales_with(look, worst)
        # The scale says how much finer the next look may be before coordinates are too coarse for it.
        hip_step = scales[-1].hip_step
        factor = _sub_steps(len(look.scales), hip_step, self.resolved_step)
        if hip_step == 0.0:
            # No way of the hand to divide: in time alone it is divided where the run is refined as a whole.
            kind = Remains.STAYS if look.scales else Remains.UNRESOLVED
            return RoughPlace(kind, look.tick(worst), scales[-1].jump, 0.0, scales)
        # Looked at below single precision often enough, or double precision ends: it is judged by its scales.
        often_enough = sum(scale.hip_step < self.resolved_step for scale in scales) == LOOKS_BELOW_SINGLE
        if often_enough or hip_step / factor < COARSER_THAN_DOUBLE * self.resolved_step:
            return _judge_scales(scales, look.tick(worst), float(look.bounds[worst]), self.resolved_step)
        # Begun early enough for a late proxy to have the state that it had.
        begin = max(first - 1 - LAG_TICKS, 0)
        finer = look.path.refined(begin, last, factor, lag=LAG_TICKS)
        above, part = look.steps > look.bounds, (first, last, begin)
        finer_run = Observed(finer.recording, look.run.scene)
        if not _leads_the_same_way(look.run, finer_run, above, part, self.tolerance):
            return RoughPlace(Remains.UNRESOLVED, look.tick(worst), scales[-1].jump, math.nan, scales)
        # The row of the coarse look that ends the step in which each fine row lies.
        rows = begin + np.ceil(np.arange(len(finer_run)) / factor).astype(np.intp)
        bounds = look.bounds[np.minimum(rows, last)]

        def tick(row: int) -> int:
            return look.tick(begin + math.ceil(row / factor))

        return _Look(finer, finer_run, bounds, tick, scales, resolved_step=self.resolved_step)

    def _judge_worst(self, look: _Look) -> RoughPlace | None:
        """Judge the largest step of a look below single precision in which none is above its bound."""
        worst = worst_row(look.steps)
        scales = self._scales_with(look, worst)
        return _judge_scales(scales, look.tick(worst), float(look.bounds[worst]), self.resolved_step)

    def _scales_with(self, look: _Look, row: int) -> tuple[Scale, ...]:
        """Return the scales that were seen before with that of a row of this look."""
        scale = _measure_scale(look.run, look.steps, row, look.scales)
        return (*look.scales, scale)


def _sub_steps(depth: int, hip_step: float, resolved_step: float) -> int:
    """Return into how many sub-steps the next look divides a step, of which the HIP takes `hip_step`, m.

    `FEW_PARTS` twice, then as many as end at `resolved_step`, m, and below that `MANY_PARTS` at a time.
    """
    if depth < 2:
        return FEW_PARTS
    # A power of two, so that HIPs of coarser looks are met to the bit.
    room = hip_step / resolved_step
    return MANY_PARTS if room < 2.0 or room > MANY_PARTS else 2 ** int(math.log2(room))


def suspect_stretches(steps: Array, bounds: Array, longest: int) -> Iterator[tuple[int, int]]:
    """Yield first and last row of stretches, of at most `longest` rows, whose steps (n,), m, are above their bounds.

    The one with the largest step comes first. Steps a few ticks apart are one stretch, for a proxy may move in every
    third tick only.
    """
    above = steps > bounds
    high = np.flatnonzero(above)
    gaps = np.flatnonzero(np.diff(high) > 2 * LAG_TICKS) + 1
    pending = [(int(rows[0]), int(rows[-1])) for rows in np.split(high, gaps) if rows.size]
    while pending:
        # The stretch with the largest step is taken first, and of equal ones the first of the path.
        pending.sort()
        first, last = pending.pop(worst_row(np.array([steps[begin : end + 1].max() for begin, end in pending])))
        worst = first + worst_row(steps[first : last + 1])
        # So many rows around the worst, within the stretch; what is left on either side waits.
        begin = max(first, min(worst - longest // 2, last + 1 - longest))
        end = min(last, begin + longest - 1)
        yield begin, end
        remainders = (first, begin - 1), (end + 1, last)
        pending += [(start, stop) for start, stop in remainders if above[start : stop + 1].any()]


def _measure_scale(recording: Observed, steps: Array, row: int, before: tuple[Scale, ...]) -> Scale:
    """Measure the jump, the spread and the HIP step (m) around a row whose IHIP steps are `steps` (n,), m."""
    near = slice(max(row - TICKS_AROUND, 0), row + TICKS_AROUND)
    # The spread is the diameter of the IHIPs in contact around the row.
    points = recording.ihip[near][recording.contact[near]]
    spread = float(np.max(np.linalg.norm(points[:, np.newaxis] - points[np.newaxis], axis=2), initial=0.0))
    hip_step = float(np.max(np.linalg.norm(np.diff(recording.hip[near], axis=0), axis=1)))
    surroundings = slice(max(row - FOLLOWING_TICKS, 0), row + FOLLOWING_TICKS)
    # Follows: of the steps in which the hand is led, the IHIP moves in more than half.
    led = np.any(np.diff(recording.hip[surroundings], axis=0) != 0.0, axis=1)
    moved = np.any(np.diff(recording.ihip[surroundings], axis=0) != 0.0, axis=1)
    halvings = math.log2(before[0].hip_step / hip_step) if before and hip_step > 0.0 else 0.0
    return Scale(halvings, float(steps[row]), spread, hip_step, bool(2 * np.sum(moved[led]) > np.sum(led)))


def _leads_the_same_way(
    coarse: Observed,
    fine: Observed,
    above: BoolArray,
    part: tuple[int, int, int],
    tolerance: float,
) -> bool:
    """Return whether the finer steps lead, in contact, by where the coarse ones went, and so stand for them.

    They have to pass by both ends of each step `above` its bound (n,),

    - at most as much earlier as the lag that is granted;
    - as close as a step of the hand, what the tool may lie off (the `tolerance`, m), and their own length: a tool with
      a memory may meet an edge by a step later.

    A way without two samples in contact in a row has no step at all, and stands for none.
    """
    first, last, begin = part
    # The closer look has `factor` rows a step, and the granted lag behind.
    factor = (len(fine) - 1 - LAG_TICKS) // (last - begin)
    hip_step = float(np.max(np.linalg.norm(np.diff(coarse.hip[begin : last + 1], axis=0), axis=1)))
    depth = LAG_TICKS * hip_step + tolerance
    if coarse.contact[begin : last + 1].all() and lets_go(fine, slice(None), depth) is not None:
        return False
    contact = fine.contact
    if not (contact[1:] & contact[:-1]).any():
        return False
    lengths = fine.contact_steps
    rows = first + np.flatnonzero(above[first : last + 1])
    return _passes_by(coarse.ihip, fine.ihip, contact, lengths, rows, begin, factor, hip_step + tolerance)


def _passes_by(
    coarse: Array, fine: Array, contact: BoolArray, lengths: Array, rows: IntArray, begin: int, factor: int,
    allowed: float,
) -> bool:  # fmt: skip
    """Return whether the IHIPs `fine` (f, N), m, pass in contact by both ends of each `coarse` step to `rows`.

    `coarse` is (n, N), m; its row `begin` + k is the fine row k `factor`. They pass within `allowed` (m), and the
    longest of their `lengths` (f,), m, there.
    """
    for row in rows.tolist():
        # Fine rows from the granted lag before the step's begin to as many ticks behind its end.
        near = slice((max(row - 1 - LAG_TICKS, begin) - begin) * factor, (row - begin) * factor + LAG_TICKS + 1)
        passed = fine[near][contact[near]]
        within = allowed + lengths[near].max(initial=0.0)
        for end in coarse[row - 1 : row + 1]:
            # |fine - coarse|, the least over these rows
            if np.linalg.norm(passed - end, axis=1).min(initial=math.inf) > within:
                return False
    return True


def _judge_scales(scales: tuple[Scale, ...], tick: int, bound: float, resolved_step: float) -> RoughPlace | None:
    """Tell a jump, a steep map, or None for a continuous one, by how the spread falls from scale to scale.

    A Hoelder map of exponent a has a spread c h^a at any scale, down to what single precision resolves and below. In
    this order:

    - A jump keeps its spread below single precision.
    - What shrinks less than any such map, and becomes smooth only there, is a rounded jump where it rises over less HIP
      travel than coordinates resolve; where it takes more, it is steep and continuous.
    - A jump's spread may tend to a limit above the bound: spread = limit + c r^k (Aitken).
    - Of the others, what shrinks as fast as a map with the least exponent is continuous, and what does not is steep.

    A scale below single precision at which the IHIP does not follow the hand shows the steps of rounding, which every
    map has: it is left out.
    """
    last = scales[-1]
    # The finest scale that single precision still resolves.
    finest = max((k for k, scale in enumerate(scales) if scale.hip_step >= resolved_step), default=0)
    finest_resolved = scales[finest]
    slope = _spread_exponent(scales[0], finest_resolved)
    if last is not finest_resolved and last.spread >= JUMP_SPREAD_SHARE * finest_resolved.spread:
        return RoughPlace(Remains.STAYS, tick, last.jump, slope, scales)
    below = [scale for scale in scales[finest + 1 :] if scale.follows_hand]
    *coarser, finer = finest_resolved, *below
    becomes_smooth = bool(coarser) and _spread_exponent(coarser[-1], finer) > SMOOTH_EXPONENT
    if slope < LEAST_EXPONENT and becomes_smooth:
        # HIP travel over which the spread rises at the slope of the finest step.
        rise = math.inf if finer.jump == 0.0 else finest_resolved.spread * finer.hip_step / finer.jump
        return RoughPlace(Remains.STAYS, tick, finest_resolved.jump, slope, scales) if rise < resolved_step else None
    # Three spreads in a row: their limit by Aitken, where they shrink at a steady ratio.
    if len(below) == LOOKS_BELOW_SINGLE:
        coarse, middle, fine = [finest_resolved, *below][-3:]
        limit = aitken(coarse.spread, middle.spread, fine.spread)
        if limit > max(bound, LIMIT_SHARE * fine.spread):
            return RoughPlace(Remains.STAYS, tick, limit, slope, scales)
    if slope >= LEAST_EXPONENT:
        return None
    return RoughPlace(Remains.STEEP, tick, last.jump, slope, scales)


def _spread_exponent(coarse: Scale, fine: Scale) -> float:
    """Return the exponent by which the spread falls with the HIP step; infinite where none is left, 0 of one."""
    if fine.spread == 0.0:
        return math.inf
    return math.log2(coarse.spread / fine.spread) / (fine.halvings - coarse.halvings) if fine is not coarse else 0.0
