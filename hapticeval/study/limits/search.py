"""The largest stiffness that stays stable, by bisection: on the loop's eigenvalues, and on the loop itself.

And a warning before a robot runs: the sampled loop cannot hold the scene's stiffness.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hapticeval.effects.sensors import VelocityFilter
from hapticeval.errors import DomainError, InputError, RefusalError, RunawayError
from hapticeval.renderer import RendererFactory
from hapticeval.scene import Scene
from hapticeval.simulation.answers import make_renderer
from hapticeval.simulation.closed_loop import simulate_closed_loop
from hapticeval.stimulus.stimulus import Experiment
from hapticeval.study.limits.loop import Gains, Place, SampledLoop, gains_of, robot_at
from hapticeval.types import Array

SOFTEST, STIFFEST = 1.0, 1e7  # N/m between which limits are looked for
LIMIT_HALVINGS = 40  # halvings: until rounding of the limit's own digits
RELEASE_OFFSET = 1e-5  # m off the surface at which the loop is let go: small, so that the device stays at its pose
NEAR_DISTANCE = (
    100.0 * RELEASE_OFFSET
)  # m from where it is let go: farther off is another place, with another pose and another limit
SETTLED_SHARE = 1e-7  # share of `RELEASE_OFFSET` below which what is left of it is rounding: the loop has settled
RUN_TICKS = 20_000  # of a run: a mode that grows by 1e-6 per tick grows by 2 per cent
WARNING_PLACES = 12  # points of the boundary that a warning tries: inertia at the hand varies over centimetres
STIFFNESS_ROUNDING = (
    1e-6  # share of the scene's stiffness below which a spring is rounding: gains are differences of forces
)


@dataclass(frozen=True)
class GainFamily:
    """A renderer's gains as a function of its stiffness K, offset + K slope, (3, N, N) each, as measured at `place`."""

    offset: Array
    slope: Array
    place: Place

    def at(self, stiffness: float) -> Gains:
        """Return the gains at a stiffness, N/m."""
        return Gains(*(self.offset + stiffness * self.slope))

    def facing(self, place: Place) -> GainFamily:
        """Return the same renderer's gains at another place, rotated with the normal."""
        turn = _rotation(self.place.normal, place.normal)
        return GainFamily(turn @ self.offset @ turn.T, turn @ self.slope @ turn.T, place)


def family_of(factory: RendererFactory, scene: Scene, place: Place) -> GainFamily:
    """Measure the gains of what `factory` makes as a function of its stiffness.

    Two stiffnesses far below the scene's give the line, a third one shows that it is one. Raises `InputError` for a
    renderer whose gains do not grow in proportion, or that has no `step`.
    """
    gains_by_share = []
    for share in (1.0 / 64.0, 1.0 / 32.0, 1.0 / 16.0):
        # Gains are the renderer's alone and need no robot; inside they are the same for one that cannot hold both ways.
        alone = replace(scene, device=None, stiffness=share * scene.stiffness, bilateral=True)
        try:
            renderer = make_renderer(factory, alone)
        except RefusalError:
            renderer = make_renderer(factory, replace(alone, bilateral=False))
        if not renderer.steps:
            raise InputError(
                "the renderer has physics of its own, and no gains to look for a limit of",
                todo="choose one that answers tick by tick, such as minimum-distance",
            )
        gains_by_share.append(np.array(gains_of(renderer, place, scene.sampling_time)))
    # The line through the first two: gains = offset + K slope.
    low, high = scene.stiffness / 64.0, scene.stiffness / 32.0
    slope = (gains_by_share[1] - gains_by_share[0]) / (high - low)
    family = GainFamily(gains_by_share[0] - low * slope, slope, place)
    # At a third stiffness the measured gains must lie on it, to a thousandth.
    for predicted, measured in zip(family.at(2.0 * high), gains_by_share[2], strict=True):
        if np.max(np.abs(predicted - measured)) > 1e-3 * max(np.max(np.abs(measured)), scene.damping, 1e-9):
            raise InputError(
                "the renderer's force does not grow in proportion to the scene's stiffness",
                why="a limit in terms of stiffness means nothing for it",
                todo="choose a regulation scheme with a linear spring",
            )
    return family


def eigenvalue_limit(loop: SampledLoop, family: GainFamily, *, steps: int = LIMIT_HALVINGS) -> float:
    """Find the stiffness (N/m) up to which all modes of the loop decay: 0 where none does, inf beyond `STIFFEST`."""
    return largest_stable(lambda stiffness: loop.growth(family.at(stiffness)) < 1.0, steps=steps)


def simulated_limit(factory: RendererFactory, scene: Scene, place: Place) -> float:
    """Find the same limit by running the sampled closed loop, let go `RELEASE_OFFSET` off the surface: does it settle?

    Effects that are not linear are left out: for encoders a limit cycle of a count is not an instability, motors that
    saturate bound one, and friction holds a loop at rest that would not stay there.

    Raises `RefusalError` for a renderer that does not hold from both sides: let go at the surface, its tool leaves, and
    shows nothing.
    """
    smooth = replace(scene, effects=tuple(effect for effect in scene.effects if effect.linear))
    return largest_stable(lambda stiffness: _settles(factory, smooth, place, stiffness), steps=14)


def finite_or_none(value: float) -> float | None:
    """Return the value for JSON, None for a number that is not finite."""
    return float(value) if np.isfinite(value) else None


def largest_stable(stable: Callable[[float], bool], *, steps: int = LIMIT_HALVINGS) -> float:
    """Find the end of the first range of stable stiffnesses (N/m), on a grid of half-decades and by halving."""
    # Two points a decade, from the softest: a loop may be stable again beyond, which is of no use.
    grid = np.geomspace(SOFTEST, STIFFEST, 15)
    verdicts = []
    for value in grid:
        verdicts.append(stable(float(value)))
        if len(verdicts) > 1 and verdicts[-2] and not verdicts[-1]:
            break
    # Unstable everywhere; stable everywhere; else the end lies between the last two of the grid.
    if not any(verdicts):
        return 0.0
    if verdicts[-1]:
        return float("inf")
    low, high = float(grid[len(verdicts) - 2]), float(grid[len(verdicts) - 1])
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _settles(factory: RendererFactory, scene: Scene, place: Place, stiffness: float) -> bool:
    """Return whether the distance from the surface is smaller at the end of a run than after its first tenth."""
    distance = _distance_after_release(factory, scene, place, stiffness)
    part = len(distance) // 10
    if part < 2:
        return False
    # Late against early, each over a tenth: an undamped loop keeps its size within the rounding of the two.
    early, late = (float(np.std(distance[rows])) for rows in (slice(part, 2 * part), slice(-part, None)))
    return late < max(early, SETTLED_SHARE * RELEASE_OFFSET)


def rests_after_release(factory: RendererFactory, scene: Scene, place: Place, count: float) -> float:
    """Find the stiffness (N/m) up to which the loop comes to rest with encoders and friction, let go as above.

    At rest means that the tool moves by less than a thousandth of `count` (m) in the last tenth of the run.
    """

    def rests(stiffness: float) -> bool:
        distance = _distance_after_release(factory, scene, place, stiffness)
        part = len(distance) // 10
        return part > 1 and float(np.ptp(distance[-part:])) < 1e-3 * count

    return largest_stable(rests, steps=10)


def _distance_after_release(factory: RendererFactory, scene: Scene, place: Place, stiffness: float) -> Array:
    """Return the signed distance (n,), m, from the surface in a run that begins `RELEASE_OFFSET` off it.

    The run counts as long as the tool is near the place: the anisotropic inertia of a robot makes a slide of a swing
    that grows, and the tool may come to rest where a stiffer loop is stable. Empty where the loop ended before its
    time.
    """
    bilateral = replace(scene, stiffness=stiffness, bilateral=True)
    ended = np.empty(0)
    try:
        renderer = make_renderer(factory, bilateral)
    except RefusalError:
        raise
    except InputError:  # it refuses gains that it knows to be unstable
        return ended
    dt = scene.sampling_time
    still = np.zeros_like(place.point)
    start = Experiment(RUN_TICKS * dt, place.point + RELEASE_OFFSET * place.normal, still, np.zeros(1), still[None])
    try:
        run = simulate_closed_loop(renderer, start, bilateral, dt)
    except RunawayError:
        return ended
    if "ended" in run.meta:
        return ended
    # Up to the first tick at which the tool is another place's.
    far_rows = np.flatnonzero(np.linalg.norm(run.hip - place.point, axis=1) > NEAR_DISTANCE)
    return scene.model.boundary.signed_distance(run.hip[: far_rows[0] if far_rows.size else len(run)])


def _rotation(start: Array, end: Array) -> Array:
    """Return the rotation that takes a unit vector to another, or to its opposite, whichever is nearer.

    Gains are even in the normal: they do not tell a wall from its back.
    """
    end = end if start @ end >= 0.0 else -end
    middle = start + end
    # R = 1 - (a + b)(a + b)ᵀ / (1 + a·b) + 2 b aᵀ: the identity outside of the plane of a and b.
    return np.asarray(np.eye(start.size) - np.outer(middle, middle) / (1.0 + start @ end) + 2.0 * np.outer(end, start))


def describe_instability(factory: RendererFactory, scene: Scene, *, cutoff: float) -> str:
    """Describe where the loop with velocities of `cutoff` (Hz) is unstable without a hand; empty where it is stable.

    It goes by the eigenvalues at rest at points of the boundary, of the motion across the surface: that a tool slides
    off a convex one is not a matter of sampling.

    Empty too where they cannot decide: for a renderer whose gains do not grow with the stiffness, one without force,
    and one that breaks, which the run itself then reports.
    """
    boundary = scene.model.boundary
    sensed = scene.with_effects(VelocityFilter(cutoff))
    frame = boundary.closest_point(boundary.points(WARNING_PLACES))
    places = [Place(*row) for row in zip(frame.foot, frame.normal, strict=True)]
    try:
        family = _across_normal(family_of(factory, scene, places[0]))
    except Exception:
        return ""
    # The stiffness across the surface, N/m, for a hand whose last position is the present one.
    normal, gains = places[0].normal, family.at(scene.stiffness)
    spring = float(normal @ (gains.now + gains.before) @ normal)
    if not (np.isfinite(spring) and abs(spring) > STIFFNESS_ROUNDING * scene.stiffness):
        return ""
    if spring < 0.0:
        return "the renderer's force pulls the hand into the surface; see its sign"
    unstable = []
    for place in places:
        try:
            loop = SampledLoop(sensed, robot_at(scene.robot, place.point))
        except DomainError:  # the part of an endless surface that the robot does not reach
            continue
        facing = family.facing(place)
        if loop.growth(facing.at(scene.stiffness)) >= 1.0:
            unstable.append((eigenvalue_limit(loop, facing, steps=12), place))
    if not unstable:
        return ""
    # It names the place with the lowest limit.
    limit, place = min(unstable, key=lambda entry: entry[0])
    where = ", ".join(f"{1e3 * value:.4g}" for value in place.point)
    range_text = f"up to {limit:.4g} N/m; choose a lower --stiffness," if limit > 0.0 else "at no stiffness; choose"
    return (
        f"without a hand the sampled loop cannot hold {scene.stiffness:.4g} N/m: at ({where}) mm it is stable "
        f"{range_text} a faster --rate, or another --damping"
    )


def _across_normal(family: GainFamily) -> GainFamily:
    """Return the gains of the motion along the normal alone: along the surface they are zero."""
    across = np.outer(family.place.normal, family.place.normal)
    return replace(family, offset=across @ family.offset @ across, slope=across @ family.slope @ across)
