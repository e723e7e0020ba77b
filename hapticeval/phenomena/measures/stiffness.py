"""The apparent stiffness of a force in every tick: how much there is of it, and how much of it is open."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from hapticeval.phenomena.decisions import FEWEST_FORCES, LAG_TICKS, TELLING_SHARE
from hapticeval.phenomena.lag import beside_straight, between_ticks, delayed, largest_in_lag
from hapticeval.phenomena.observed import Observed
from hapticeval.phenomena.sampling import lengths_of, unit_vectors
from hapticeval.recordings.quantization import numeric_step
from hapticeval.recordings.recording import backward_difference
from hapticeval.renderer import Spring
from hapticeval.types import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class ApparentStiffness:
    """The apparent stiffness, as a share of the scene's, at `ticks` (n,) of a recording; all arrays are (n,).

    - `ratio`: by HIP and IHIP of the same tick; `low` and `high` its ends over all that a lag may have done.
    - `allowed`: what a damper, the way's curvature and rounding may add; `allowed_in_lag` that with the largest speeds
      within a lag.
    - `depth`, m, and `rate`, m/s, at which it changes.
    - `begins`: where a lag reaches to before or behind the contact.
    """

    ticks: IntArray
    ratio: Array
    low: Array
    high: Array
    allowed: Array
    allowed_in_lag: Array
    depth: Array
    rate: Array
    begins: BoolArray

    def beyond(self, shares: tuple[float, float], allowed: Array) -> Array:
        """Return how far a share is outside of a least and a largest one, beyond what is `allowed` (n,): (n,).

        Both are shares of the scene's stiffness, N/m.
        """
        return np.asarray(np.maximum(np.maximum(self.low - shares[1], shares[0] - self.high), 0.0) - allowed)

    def rows(self, rows: BoolArray) -> ApparentStiffness:
        """Return the samples of some `rows` (n,): stiffness as a share, depth in m."""
        return ApparentStiffness(*(getattr(self, field.name)[rows] for field in fields(self)))


class PressedTicks(NamedTuple):
    """What is measured of the ticks that call for a force, whatever law their spring has.

    - `pressing` (rows,): which these are of all ticks, and `ticks` (n,) their numbers.
    - `errors`: HIP less IHIP, m, by all lags, see `_errors_within_lag`.
    - `unknown` (n,), N: what the curvature may add, see `_curvature_force`, and a lag between two ticks leaves open.
    """

    pressing: BoolArray
    ticks: IntArray
    errors: list[Array]
    unknown: Array


def find_pressed_ticks(base: Observed) -> PressedTicks:
    """Find the ticks that call for a force, the same for all laws."""
    pressing = _calls_for_force(base)
    ticks = np.flatnonzero(pressing)
    unknown = _curvature_force(base, base.velocity, ticks)
    for points, lag in ((base.hip, base.lag.force_hip), (base.ihip, base.lag.force_ihip)):
        # Between ticks it is not known where the renderer had them.
        if between_ticks(lag):
            unknown = unknown + base.scene.stiffness * beside_straight(points)[ticks]
    return PressedTicks(pressing, ticks, _errors_within_lag(base, ticks), unknown)


def measure_stiffness(base: Observed, pressed: PressedTicks, spring: Spring | None) -> ApparentStiffness:
    """Measure the stiffness in each tick that calls for a force, and its ends over all lags that may explain it.

    `spring` says whether the law is along the error or across the surface; None is for a force of any direction, of
    which the size alone counts.
    """
    scene = base.scene
    pressing, now, errors, unknown = pressed
    last = len(base) - 1
    # (lags, n): the ticks within a lag of each, cut to the recording.
    window = np.clip(now + np.arange(-LAG_TICKS, LAG_TICKS + 1)[:, np.newaxis], 0, last)
    force = base.force[now]
    shares = np.array([_stiffness_share(force, candidate, scene.stiffness, spring) for candidate in errors])
    along, depth = _depth_direction(force, errors[0], spring)
    # A spring that gives nothing has no direction of its own: what it should have given is along the error.
    silent = ~base.pressed
    idle = silent[now]
    if idle.any():
        shares[:, idle] = [
            _stiffness_share(force[idle], candidate[idle], scene.stiffness, Spring.ERROR) for candidate in errors
        ]
        along[idle] = _depth_direction(force[idle], errors[0][idle], Spring.ERROR)[0]
        depth[idle] = _sure_depth(base, spring)[window[:, idle]].min(axis=0)
    # Contact begins or ends within a lag, or the recording does, in which a late IHIP is then missing.
    begins = np.isnan(shares).any(axis=0) | ~pressing[window].all(axis=0) | (now > last - LAG_TICKS)
    # Where the contact begins or ends a force may be late, and is not larger than any depth within a lag explains.
    distances = np.linalg.norm(errors, axis=2)
    reach = distances.max(axis=0)
    size = np.linalg.norm(force, axis=1)
    if spring is Spring.ERROR:  # what is across the error is another check's
        size = np.where(np.any(along != 0.0, axis=1), np.abs(np.sum(along * force, axis=1)), size)
    depth[begins] = reach[begins]
    # K_eff / K = |F| / (K e): as large as the largest depth within a lag makes it.
    explained = np.divide(size, scene.stiffness * reach, out=np.zeros_like(size), where=reach > 0.0)
    other_force = _undamped_other_force(base, unknown, depth)
    # What is open is a share of the depth that the force answers: of a little one more than of that in the same tick.
    with np.errstate(divide="ignore", invalid="ignore"):
        more_open = other_force / scene.stiffness * np.maximum(1.0 / distances - 1.0 / depth, 0.0)
    low, high = (shares - more_open).min(axis=0), (shares + more_open).max(axis=0)
    if "spring" not in base.meta:
        # A tool that stands off by s may be pulled from the surface or from where it stands: its depth is known to s.
        gap = base.standoff
        low *= np.divide(depth, depth + gap, out=np.ones_like(depth), where=depth > 0.0)
        # Where it may be on the surface, no share is known, and that of no force is no NaN.
        no_share = np.where(high < 0.0, -np.inf, np.inf)
        high = np.divide(high * depth, depth - gap, out=no_share, where=depth > gap)
    # There a force may be too large, and not too small.
    low[begins], high[begins] = explained[begins], np.inf
    velocity, sinking = base.velocity, backward_difference(base.hip - base.ihip, base.time)
    speeds = np.maximum(np.linalg.norm(velocity, axis=1), np.linalg.norm(sinking, axis=1))
    speed, spreading = (np.abs(np.sum(along * rates, axis=1)) for rates in (velocity[now], sinking[now]))
    # (K_d v + G) / (K d): the share that damper, curvature and rounding may make.
    with np.errstate(divide="ignore", invalid="ignore"):
        damping: Array | float = scene.damping
        if damping > 0.0:
            surely_in, surely_out = _surely_moving(along, errors[0], velocity[window], sinking[window])
            clear = other_force / (scene.stiffness * depth)
            # A damper brakes: it adds to the force on the way in, and takes from it on the way out.
            speeds_up = (surely_in & (1.0 - high > clear)) | (surely_out & (low - 1.0 > clear))
            damping = np.where(speeds_up, 0.0, damping)
        allowed, allowed_in_lag = (
            (damping * rate + other_force) / (scene.stiffness * depth)
            for rate in (np.maximum(speed, spreading), speeds[window].max(axis=0))
        )
    ratio = np.where(begins, explained, shares[0])
    measured = ApparentStiffness(
        now, ratio, low, high, allowed, allowed_in_lag, depth, np.sum(along * sinking[now], axis=1), begins
    )
    return measured.rows(depth > 0.0)


def _surely_moving(along: Array, error: Array, velocity: Array, sinking: Array) -> tuple[BoolArray, BoolArray]:
    """Return where the depth grows, and where it shrinks, in all ticks of a lag, by hand and by error: (n,) each.

    `along` (n, N) is its direction up to sign, and `error` (n, N), m, points in. `velocity` and `sinking`, those of the
    hand and of the error, are (lags, n, N), m/s.
    """
    inwards = np.sign(np.sum(along * error, axis=1))[:, np.newaxis] * along
    rates = np.sum(inwards * np.concatenate([velocity, sinking]), axis=2)
    return np.all(rates > 0.0, axis=0), np.all(rates < 0.0, axis=0)


def _errors_within_lag(base: Observed, ticks: IntArray) -> list[Array]:
    """Return HIP less IHIP at some `ticks` (n,), each (n, N), m: of one tick first, then all that a lag may pair."""
    last = len(base) - 1
    errors = [base.hip[ticks] - base.ihip[ticks]]
    for lag in range(1, LAG_TICKS + 1):
        before, after = np.maximum(ticks - lag, 0), np.minimum(ticks + lag, last)
        # Late are the whole answer, the force alone, or the IHIP's record.
        errors += [base.hip[hip] - base.ihip[ihip] for hip, ihip in ((before, ticks), (before, before), (ticks, after))]
    # Where the depth has an extremum, those of whole ticks may all lie on one side of a lag's between them.
    late = base.lag
    errors.append(delayed(base.hip, ticks, late.force_hip) - delayed(base.ihip, ticks, late.force_ihip))
    return errors


def _undamped_other_force(base: Observed, unknown: Array, depths: Array) -> Array:
    """Return how much of the force of n ticks is open beside spring and damper, (n,), N: G of the bound.

    `unknown` (n,), N, is that of `PressedTicks`; `depths` are (n,), m. The rest is coarse or rounded numbers.
    """
    # What rounding leaves open of the difference of HIP and IHIP, m; a log gives both to half a step.
    position_rounding = base.rounding_floor(depths, 1.0) + 0.5 * base.log_step("hip", "ihip")
    return np.asarray(unknown + force_coarseness(base) + base.scene.stiffness * position_rounding)


def force_coarseness(base: Observed) -> float:
    """Return how coarse the force is, N: by half the step of a log, and by the declared resolution.

    That counts as far as the recorded forces look like one, and up to a twentieth of the largest: of a coarser one
    nothing could be told even there.
    """
    declared = float(base.meta.get("force_resolution", 0.0))
    if declared > 0.0:
        largest = 0.5 * TELLING_SHARE * float(base.force_size.max())
        declared = min(declared, largest, _seen_resolution(base, min(declared, largest)))
    return declared + 0.5 * base.log_step("force")


def _seen_resolution(base: Observed, largest: float) -> float:
    """Return the resolution that forces show, N: the coarsest of a quantum, a dead band, and a force that stands.

    - A quantum: the forces' components, or their sizes, lie on a lattice. Too few numbers contradict none: `largest`.
    - A dead band: no force comes at all up to a depth, within three ticks.
    - A force that stands until it would change by so much: the least of its changes, where it stands for a tick.
    """
    forces, columns = base.force[base.pressed], [*base.force[base.pressed].T, base.force_size[base.pressed]]
    if max((np.unique(column).size for column in columns), default=0) < FEWEST_FORCES:
        return largest
    *steps, of_size = (numeric_step(column) or 0.0 for column in columns)
    quantum = max(float(np.linalg.norm(steps)), of_size)
    depth = np.maximum(lengths_of(base.hip - base.ihip), np.maximum(-base.distance, 0.0))
    silent = np.where(base.pressed, 0.0, depth).max(initial=0.0)
    band = base.scene.stiffness * min(float(silent), float(largest_in_lag(depth)[base.pressed].min()))
    changes = lengths_of(np.diff(base.force, axis=0))[base.pressed[1:] & base.pressed[:-1]]
    stands = forces.size > 0 and bool(np.any(changes == 0.0)) and bool(np.any(changes > 0.0))
    return max(quantum, band, float(changes[changes > 0.0].min()) if stands else 0.0)


def _calls_for_force(base: Observed) -> BoolArray:
    """Return where a force is called for, (n,): in contact, but where no force is given to a hand outside the model."""
    pressing = base.contact.copy()
    silent = np.flatnonzero(pressing & ~base.pressed)
    if silent.size and not base.scene.bilateral:
        pressing[silent] = base.boundary.signed_distance(base.hip[silent]) < 0.0
    return pressing


def _sure_depth(base: Observed, spring: Spring | None) -> Array:
    """Return how deep the hand is by HIP and IHIP and by the model, whichever is less, (n,), m.

    A spring across the surface has nothing to give above the tangent, as beside a neck with the IHIP on its other side.
    """
    boundary, error = base.boundary, base.hip - base.ihip
    if spring is Spring.NORMAL:
        # Along the normal at the IHIP; nothing above its tangent plane.
        depth = np.maximum(-np.sum(boundary.closest_point(base.ihip).normal * error, axis=1), 0.0)
    else:
        depth = np.linalg.norm(error, axis=1)
    return np.asarray(np.minimum(depth, np.abs(base.distance)))


def _depth_direction(force: Array, error: Array, spring: Spring | None) -> tuple[Array, Array]:
    """Return the unit direction (n, N) in which depth is measured, and the depth (n,), m; zero where there is none.

    Along the error (n, N), m, or against the force (n, N), N, which is across the surface.
    """
    direction = -force if spring is Spring.NORMAL else error
    unit = unit_vectors(direction)
    return unit, np.abs(np.sum(unit * error, axis=1))


def _stiffness_share(force: Array, error: Array, stiffness: float, spring: Spring | None) -> Array:
    """Return the stiffness as a share of the scene's, (n,): -F.e / e^2, or F^2 / -F.e across the surface.

    For a force of any direction it is |F| / |e|, negative where it pulls. F is (n, N), N, and e = HIP - IHIP (n, N), m;
    not a number where there is nothing to divide by.
    """
    push = -np.sum(force * error, axis=1)
    numerator, denominator = push, np.sum(error**2, axis=1)
    if spring is Spring.NORMAL:
        numerator, denominator = np.sum(force**2, axis=1), push
    if spring is None:
        numerator = np.copysign(np.linalg.norm(force, axis=1) * np.linalg.norm(error, axis=1), push)
    share = np.full(push.size, np.nan)
    return np.asarray(np.divide(numerator, stiffness * denominator, out=share, where=denominator != 0.0))


def largest_other_force(base: Observed) -> Array:
    """Return how large a damper's force is at most, and the curvature's of one that declares no spring: (n,), N."""
    velocity = base.velocity
    sinking = backward_difference(base.hip - base.ihip, base.time)
    speed = np.maximum(np.linalg.norm(velocity, axis=1), np.linalg.norm(sinking, axis=1))
    return np.asarray(base.scene.damping * speed + _curvature_force(base, velocity, np.arange(len(base))))


def _curvature_force(base: Observed, velocity: Array, ticks: IntArray) -> Array:
    """Return m |kappa| v^2 of the way along the surface (3.8), (n,), N, at `ticks` (n,): what a law may add beside it.

    A declared spring adds nothing. v is the speed of the hand, or of the IHIP since the tick before or to the next,
    whichever is largest: where the curvature jumps, so does the IHIP's speed.
    """
    if "spring" in base.meta:
        return np.zeros(ticks.size)
    shape = base.boundary.closest_point(base.ihip[ticks]).shape
    largest = np.max(np.abs(np.linalg.eigvalsh(shape)), axis=1)
    sliding = backward_difference(base.ihip, base.time)
    after = np.minimum(ticks + 1, len(base) - 1)
    speeds = (np.linalg.norm(velocities, axis=1) for velocities in (velocity[ticks], sliding[ticks], sliding[after]))
    speed = np.max([*speeds], axis=0)
    return np.asarray(base.scene.mass * (largest * speed**2))
