"""Force magnitude: the force is as large as the scene's stiffness makes it at that depth, always and everywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from hapticeval.effects.effect import Stage
from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.decisions import (
    CAUSE_SHARE,
    FINE_GROUPS,
    GROUP_SAMPLES,
    LAG_TICKS,
    SINGLE_ROUNDINGS,
    SPIKE_SHARE,
    TELLING_SHARE,
    UNDECLARED_RANGE,
    WIDE_RANGE,
)
from hapticeval.phenomena.lag import delayed, find_lag
from hapticeval.phenomena.sampling import (
    above_force_floor,
    as_sensed,
    declares_force_only,
    evidence_at,
    hand_velocity,
    lacks_ihip,
    log_step,
    mm,
    rounding,
    standoff,
    touching,
)
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, undecided
from hapticeval.recordings.recording import SINGLE, Recording, backward_difference
from hapticeval.renderer import STIFFNESS_LIMITS, Spring
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class Measured:
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

    @property
    def excess(self) -> Array:
        """Return how far a share is from one, beyond what is allowed: (n,)."""
        return self.beyond((1.0, 1.0), self.allowed)

    def beyond(self, shares: tuple[float, float], allowed: Array) -> Array:
        """Return how far a share is outside of a least and a largest one, beyond what is `allowed` (n,): (n,).

        Both are shares of the scene's stiffness, N/m.
        """
        return np.asarray(np.maximum(np.maximum(self.low - shares[1], shares[0] - self.high), 0.0) - allowed)

    def rows(self, rows: BoolArray) -> Measured:
        """Return the samples of some `rows` (n,): stiffness as a share, depth in m."""
        return Measured(*(getattr(self, field.name)[rows] for field in fields(self)))


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure the stiffness at every tick in contact, and look for what explains its deviations."""
    base = as_sensed(runs.base)
    if not above_force_floor(base, scene).any():
        return undecided("no force above the floor: the tool never presses on the surface")
    declared = base.meta.get("spring")
    if lacks_ihip(base, scene):
        return _without_ihip(base, scene)
    level = Level.MUST if declared is not None and declared_range(base) is None else Level.SHOULD
    depths = np.linalg.norm(base.hip - base.ihip, axis=1)
    if not depths[above_force_floor(base, scene)].any():
        message = "a rigid contact: its force comes without a depth, and has no stiffness that could be measured"
        return Finding(Outcome.NOT_APPLICABLE, message, level=level)
    springs = tuple(Spring) if declared is None else (Spring(declared),)
    # Both laws where none is declared: along the error, and across the surface.
    measured = [_measure_stiffness(base, scene, spring) for spring in springs]
    # One who does not declare a law is measured by the one that fits better.
    finding = _finding(base, scene, min(measured, key=lambda stiffness: _misfit(stiffness, base)), level)
    if not declares_wide_range(base):
        return finding
    softest, stiffest = declared_range(base) or (1.0, 1.0)
    declares = (
        f"it declares a stiffness from {softest:.3g} to {stiffest:.3g} of the scene's, which asks next to nothing"
    )
    return replace(finding, message=f"{finding.message}; {declares}")


def declared_range(base: Recording) -> tuple[float, float] | None:
    """Return the least and largest stiffness that the renderer declares, as shares of the scene's; None without.

    A file may say more than a renderer may: it counts up to `STIFFNESS_LIMITS`.
    """
    softest = base.meta.get("stiffness_least")
    if softest is None:
        return None
    lowest, highest = STIFFNESS_LIMITS
    return max(float(softest), lowest), min(float(base.meta.get("stiffness_largest", highest)), highest)


def declares_wide_range(base: Recording) -> bool:
    """Return whether the declared stiffness varies by so much that it says next to nothing of the force's size."""
    softest, stiffest = declared_range(base) or (1.0, 1.0)
    return stiffest > WIDE_RANGE * softest


def _misfit(measured: Measured, base: Recording) -> tuple[float, bool, float, float]:
    """Rank how ill a law fits: beyond the declared range, with nothing clear, in more ticks, by a larger excess."""
    coarse = float(measured.beyond(declared_range(base) or UNDECLARED_RANGE, measured.allowed_in_lag).max(initial=0.0))
    clear = measured.rows(measured.allowed <= TELLING_SHARE)
    deviates = clear.excess > 0.0
    fine = float(deviates.mean()) if deviates.size else 0.0, float(clear.excess.max(initial=0.0))
    return max(coarse, 0.0), not deviates.size, *fine


def _measure_stiffness(base: Recording, scene: Scene, spring: Spring) -> Measured:
    """Measure the stiffness in each tick that calls for a force, and its ends over all lags that may explain it.

    `spring` says whether the law is along the error or across the surface.
    """
    pressing = _calls_for_force(base, scene)
    now = np.flatnonzero(pressing)
    last = len(base) - 1
    # (lags, n): the ticks within a lag of each, cut to the recording.
    window = np.clip(now + np.arange(-LAG_TICKS, LAG_TICKS + 1)[:, np.newaxis], 0, last)
    force, errors = base.force[now], _errors_within_lag(base, scene, now)
    shares = np.array([_stiffness_share(force, candidate, scene.stiffness, spring) for candidate in errors])
    along, depth = _depth_direction(force, errors[0], spring)
    # A spring that gives nothing has no direction of its own: what it should have given is along the error.
    silent = ~above_force_floor(base, scene)
    idle = silent[now]
    if idle.any():
        shares[:, idle] = [
            _stiffness_share(force[idle], candidate[idle], scene.stiffness, Spring.ERROR) for candidate in errors
        ]
        along[idle] = _depth_direction(force[idle], errors[0][idle], Spring.ERROR)[0]
        depth[idle] = _sure_depth(base, scene, spring)[window[:, idle]].min(axis=0)
    # Contact begins or ends within a lag, or the recording does, in which a late IHIP is then missing.
    begins = np.isnan(shares).any(axis=0) | ~pressing[window].all(axis=0) | (now > last - LAG_TICKS)
    # Where the contact begins or ends a force may be late, and is not larger than any depth within a lag explains.
    reach = np.max([np.linalg.norm(candidate, axis=1) for candidate in errors], axis=0)
    size = np.linalg.norm(force, axis=1)
    if spring is Spring.ERROR:  # what is across the error is another check's
        size = np.where(np.any(along != 0.0, axis=1), np.abs(np.sum(along * force, axis=1)), size)
    depth[begins] = reach[begins]
    # K_eff / K = |F| / (K e): as large as the largest depth within a lag makes it.
    explained = np.divide(size, scene.stiffness * reach, out=np.zeros_like(size), where=reach > 0.0)
    low, high = shares.min(axis=0), shares.max(axis=0)
    if "spring" not in base.meta:
        # A tool that stands off by s may be pulled from the surface or from where it stands: its depth is known to s.
        gap = standoff(base, scene)
        low *= np.divide(depth, depth + gap, out=np.ones_like(depth), where=depth > 0.0)
        # Where it may be on the surface, no share is known, and that of no force is no NaN.
        unknown = np.where(high < 0.0, -np.inf, np.inf)
        high = np.divide(high * depth, depth - gap, out=unknown, where=depth > gap)
    # There a force may be too large, and not too small.
    low[begins], high[begins] = explained[begins], np.inf
    velocity, sinking = hand_velocity(base), backward_difference(base.hip - base.ihip, base.time)
    speeds = np.maximum(np.linalg.norm(velocity, axis=1), np.linalg.norm(sinking, axis=1))
    speed, spreading = (np.abs(np.sum(along * rates, axis=1)) for rates in (velocity[now], sinking[now]))
    other_force = _undamped_other_force(base, scene, velocity, now, size, depth)
    # (K_d v + G) / (K d): the share that damper, curvature and rounding may make.
    with np.errstate(divide="ignore"):
        allowed, allowed_in_lag = (
            (scene.damping * rate + other_force) / (scene.stiffness * depth)
            for rate in (np.maximum(speed, spreading), speeds[window].max(axis=0))
        )
    ratio = np.where(begins, explained, shares[0])
    measured = Measured(
        now, ratio, low, high, allowed, allowed_in_lag, depth, np.sum(along * sinking[now], axis=1), begins
    )
    return measured.rows(depth > 0.0)


def _errors_within_lag(base: Recording, scene: Scene, ticks: IntArray) -> list[Array]:
    """Return HIP less IHIP at some `ticks` (n,), each (n, N), m: of one tick first, then all that a lag may pair."""
    last = len(base) - 1
    errors = [base.hip[ticks] - base.ihip[ticks]]
    for lag in range(1, LAG_TICKS + 1):
        before, after = np.maximum(ticks - lag, 0), np.minimum(ticks + lag, last)
        # Late are the whole answer, the force alone, or the IHIP's record.
        errors += [base.hip[hip] - base.ihip[ihip] for hip, ihip in ((before, ticks), (before, before), (ticks, after))]
    # Where the depth has an extremum, those of whole ticks may all lie on one side of a lag's between them.
    late = find_lag(base, scene)
    errors.append(delayed(base.hip, ticks, late.force_hip) - delayed(base.ihip, ticks, late.force_ihip))
    return errors


def _undamped_other_force(
    base: Recording, scene: Scene, velocity: Array, ticks: IntArray, sizes: Array, depths: Array
) -> Array:
    """Return how much of the force at `ticks` (n,) is open beside spring and damper, (n,), N: G of the bound.

    `velocity` (rows, N), m/s, is the hand's at every tick; `sizes` (n,), N, and `depths` (n,), m, are the force's and
    the depths at `ticks`. A law may know the curvature where none is declared; the rest is coarse or rounded numbers.
    """
    bending = np.zeros(ticks.size)
    if "spring" not in base.meta:
        bending = scene.mass * _curvature_acceleration(base, scene, velocity, ticks)
    # What rounding leaves open of the difference of HIP and IHIP, m; a log gives both to half a step.
    position_rounding = SINGLE_ROUNDINGS * SINGLE * (float(np.max(np.abs(base.hip))) + depths)
    position_rounding += 0.5 * log_step(base, "hip", "ihip")
    return np.asarray(bending + _force_coarseness(base, sizes) + scene.stiffness * position_rounding)


def _force_coarseness(base: Recording, sizes: Array) -> float:
    """Return how coarse the force is, N: by half the step of a log, and by what is declared.

    That counts up to a twentieth of the largest of `sizes` (n,), N: of a coarser one nothing could be told even there.
    """
    declared = min(float(base.meta.get("force_resolution", 0.0)), 0.5 * TELLING_SHARE * float(sizes.max()))
    return declared + 0.5 * log_step(base, "force")


def _calls_for_force(base: Recording, scene: Scene) -> BoolArray:
    """Return where a force is called for, (n,): in contact, but where no force is given to a hand outside the model."""
    pressing = touching(base, scene)
    silent = np.flatnonzero(pressing & ~above_force_floor(base, scene))
    if silent.size and not scene.bilateral:
        pressing[silent] = scene.model.boundary.signed_distance(base.hip[silent]) < 0.0
    return pressing


def _sure_depth(base: Recording, scene: Scene, spring: Spring) -> Array:
    """Return how deep the hand is by HIP and IHIP and by the model, whichever is less, (n,), m.

    A spring across the surface has nothing to give above the tangent, as beside a neck with the IHIP on its other side.
    """
    boundary, error = scene.model.boundary, base.hip - base.ihip
    if spring is Spring.ERROR:
        depth = np.linalg.norm(error, axis=1)
    else:
        # Along the normal at the IHIP; nothing above its tangent plane.
        depth = np.maximum(-np.sum(boundary.closest_point(base.ihip).normal * error, axis=1), 0.0)
    return np.asarray(np.minimum(depth, np.abs(boundary.signed_distance(base.hip))))


def _depth_direction(force: Array, error: Array, spring: Spring) -> tuple[Array, Array]:
    """Return the unit direction (n, N) in which depth is measured, and the depth (n,), m; zero where there is none.

    Along the error (n, N), m, or against the force (n, N), N, which is across the surface.
    """
    direction = error if spring is Spring.ERROR else -force
    size = np.linalg.norm(direction, axis=1)
    unit = np.divide(direction, size[:, np.newaxis], out=np.zeros_like(direction), where=size[:, np.newaxis] > 0.0)
    return unit, np.abs(np.sum(unit * error, axis=1))


def _stiffness_share(force: Array, error: Array, stiffness: float, spring: Spring) -> Array:
    """Return the stiffness as a share of the scene's, (n,): -F.e / e^2, or F^2 / -F.e across the surface.

    F is (n, N), N, and e = HIP - IHIP (n, N), m; not a number where there is nothing to divide by.
    """
    push = -np.sum(force * error, axis=1)
    numerator, denominator = push, np.sum(error**2, axis=1)
    if spring is not Spring.ERROR:
        numerator, denominator = np.sum(force**2, axis=1), push
    share = np.full(push.size, np.nan)
    return np.asarray(np.divide(numerator, stiffness * denominator, out=share, where=denominator != 0.0))


def largest_other_force(base: Recording, scene: Scene) -> Array:
    """Return how large a damper's force is at most, and the curvature's of one that declares no spring: (n,), N."""
    velocity = hand_velocity(base)
    sinking = backward_difference(base.hip - base.ihip, base.time)
    speed = np.maximum(np.linalg.norm(velocity, axis=1), np.linalg.norm(sinking, axis=1))
    bent = (
        np.zeros(len(base))
        if "spring" in base.meta
        else _curvature_acceleration(base, scene, velocity, np.arange(len(base)))
    )
    return np.asarray(scene.damping * speed + scene.mass * bent)


def _curvature_acceleration(base: Recording, scene: Scene, velocity: Array, ticks: IntArray) -> Array:
    """Return |kappa| v^2 of the way along the surface (3.8), (n,), m/s^2: what a law may add that knows it.

    With v the speed of the hand, or of the IHIP since the tick before or to the next, whichever is largest: where the
    curvature jumps, so does the IHIP's speed.
    """
    shape = scene.model.boundary.closest_point(base.ihip[ticks]).shape
    largest = np.max(np.abs(np.linalg.eigvalsh(shape)), axis=1)
    sliding = backward_difference(base.ihip, base.time)
    after = np.minimum(ticks + 1, len(base) - 1)
    speeds = (np.linalg.norm(velocities, axis=1) for velocities in (velocity[ticks], sliding[ticks], sliding[after]))
    speed = np.max([*speeds], axis=0)
    return np.asarray(largest * speed**2)


def _without_ihip(base: Recording, scene: Scene) -> Finding:
    """Judge a force without an IHIP against the depth of the HIP under the model, the least that any IHIP could have.

    A tool that lags behind is farther away, and makes a larger force of it: only one that is too soft is seen, unless
    it is declared that there is no tool.
    """
    depth, no_tool = np.maximum(-scene.model.boundary.signed_distance(base.hip), 0.0), declares_force_only(base)
    # A force-only renderer must give a force at every depth > 0, and not only where it gives one.
    ticks = np.flatnonzero(above_force_floor(base, scene) | (no_tool & (depth > 0.0)))
    # Depths (lags, n) that a late force may answer.
    late = np.array([depth[np.maximum(ticks - lag, 0)] for lag in range(LAG_TICKS + 1)])
    size = np.linalg.norm(base.force[ticks], axis=1)
    shares = np.divide(size, scene.stiffness * late, out=np.full(late.shape, np.inf), where=late > 0.0)
    speed = np.linalg.norm(hand_velocity(base)[ticks], axis=1)
    with np.errstate(divide="ignore"):
        other_depth = (scene.damping * speed + _force_coarseness(base, size)) / scene.stiffness
        allowed = (other_depth + rounding(scene) + 0.5 * log_step(base, "hip") + standoff(base, scene)) / late[0]
    high = shares.max(axis=0)
    rate = backward_difference(depth[:, np.newaxis], base.time)[ticks, 0]
    low, begins = shares.min(axis=0) if no_tool else np.minimum(high, 1.0), np.zeros(ticks.size, dtype=bool)
    measured = Measured(ticks, shares[0], low, high, allowed, allowed, late[0], rate, begins)
    note = "no IHIP was given: measured against the depth of the HIP under the model"
    finding = _finding(base, scene, measured.rows(late[0] > 0.0), Level.SHOULD)
    if finding.outcome is Outcome.PASS and not no_tool:
        message = f"the force is nowhere too small for its depth; {note}, which does not show one that is too large"
        return replace(finding, outcome=Outcome.INCONCLUSIVE, message=message)
    return replace(finding, message=f"{finding.message} ({note})")


def _finding(base: Recording, scene: Scene, measured: Measured, level: Level) -> Finding:
    """Judge by the must first, over all samples, and then to what is allowed where that is little."""
    shares = declared_range(base) or UNDECLARED_RANGE
    outside = measured.beyond(shares, measured.allowed_in_lag)
    if any(effect.stage is Stage.ANSWER for effect in scene.effects):
        level = Level.SHOULD  # what is called for beside the spring changes the force by a law of its own
    elif outside.size and outside.max() > 0.0:
        worst = int(np.argmax(outside))
        # The bound, as a distance from one: the edge of the range that is left.
        edge = shares[1] - 1.0 if measured.low[worst] > shares[1] else 1.0 - shares[0]
        return replace(
            _failed_finding(base, scene, measured, outside, worst, edge + float(measured.allowed_in_lag[worst])),
            level=Level.MUST,
        )
    measured = measured.rows(measured.allowed <= TELLING_SHARE)
    if measured.begins.all():  # or there are none
        return undecided(
            "a damper, m kappa v^2 of the curvature or rounding may make a tenth of the force or more throughout: "
            "its stiffness cannot be measured"
        )
    excess = measured.excess
    worst = int(np.argmax(excess))
    bound = float(measured.allowed[worst])
    if excess[worst] > 0.0:
        return replace(_failed_finding(base, scene, measured, excess, worst, bound), level=level)
    # Within a lag's reach the ends of the share enclose one, wherever the present HIP alone would put it.
    metric = Metric(CHECK.metric, float(np.maximum(excess + measured.allowed, 0.0)[worst]), "")
    evidence = _evidence(base, scene, measured, worst)
    median = evidence["apparent_stiffness_N_m"]
    at_deepest = _describe_deepest(evidence, scene)
    message = f"the force fits the depth, with an apparent stiffness of {median:.4g} N/m; {at_deepest}"
    return Finding(Outcome.PASS, message, metric, bound, evidence, level)


def _evidence(base: Recording, scene: Scene, measured: Measured, worst: int) -> dict[str, Any]:
    """Return as evidence the spread of the apparent stiffness (N/m), and force and depth where it is deepest."""
    inner = measured.rows(~measured.begins) if not measured.begins.all() else measured
    low, median, high = (scene.stiffness * float(share) for share in np.percentile(inner.ratio, (5, 50, 95)))
    deepest = int(np.argmax(measured.depth))
    size, depth = float(np.linalg.norm(base.force[measured.ticks[deepest]])), float(measured.depth[deepest])
    return {
        **evidence_at(base, int(measured.ticks[worst])),
        "apparent_stiffness_N_m": median,
        "stiffness_05_N_m": low,
        "stiffness_95_N_m": high,
        "samples": int(measured.ticks.size),
        "force_N": size,
        "depth_m": depth,
        "depth_asked_m": size / scene.stiffness,
    }


def _describe_deepest(evidence: Mapping[str, Any], scene: Scene) -> str:
    return (
        f"at the deepest {evidence['force_N']:.3g} N at {mm(evidence['depth_m'])}, where K = {scene.stiffness:g} N/m "
        f"asks for {mm(evidence['depth_asked_m'])}"
    )


def _failed_finding(
    base: Recording, scene: Scene, measured: Measured, excess: Array, worst: int, bound: float
) -> Finding:
    tick, share = int(measured.ticks[worst]), float(measured.ratio[worst])
    evidence = _evidence(base, scene, measured, worst)
    pattern, numbers = _describe_pattern(base, scene, measured, excess > 0.0)
    low, median, high = (evidence[name] for name in ("stiffness_05_N_m", "apparent_stiffness_N_m", "stiffness_95_N_m"))
    force, depth = float(np.linalg.norm(base.force[tick])), float(measured.depth[worst])
    message = (
        f"{pattern}: an apparent stiffness of {scene.stiffness * share:.4g} N/m at t = {base.time[tick]:.4g} s (tick "
        f"{tick}: {force:.3g} N at {mm(depth)}), of {median:.4g} in the median, and from {low:.4g} to {high:.4g} in "
        f"nine tenths of the samples, for the scene's {scene.stiffness:g}; {_describe_deepest(evidence, scene)}"
    )
    return Finding(Outcome.FAIL, message, Metric(CHECK.metric, abs(share - 1.0), ""), bound, evidence | numbers)


def _describe_pattern(
    base: Recording, scene: Scene, measured: Measured, deviates: BoolArray
) -> tuple[str, dict[str, Any]]:
    """Return what the deviations go with, in words, and the numbers that show it."""
    ticks, numbers = measured.ticks[deviates], {"share_off": float(deviates.mean())}
    if measured.begins[deviates].all():
        largest = float(np.linalg.norm(base.force[ticks], axis=1).max())
        return f"a kick where the contact begins or ends: up to {largest:.3g} N", numbers | {"kicks": ticks.size}
    inner = measured.rows(~measured.begins)
    deviates = deviates[~measured.begins]
    constant = _low_pass_constant(base, scene, inner.ticks)
    if constant is not None:
        filtered = f"it comes late, as behind a low-pass filter of {1e3 * constant:.3g} ms"
        return filtered, numbers | {"low_pass_ms": 1e3 * constant}
    # The plainest cause first: a missing force, then what goes with direction, depth, time or place.
    quiet = _describe_missing_force(base, scene, inner, deviates)
    if quiet is not None:
        return quiet, numbers
    middle = float(np.median(inner.ratio))
    # The same everywhere: the spread is small beside the deviation.
    uniform = np.max(np.abs(inner.ratio - middle)) <= CAUSE_SHARE * abs(middle - 1.0)
    medians, explained = _explain_by_causes(base, inner, GROUP_SAMPLES)
    if max(explained.values()) < CAUSE_SHARE and inner.ticks.size >= FINE_GROUPS * GROUP_SAMPLES:
        explained = _explain_by_causes(base, inner, FINE_GROUPS)[1]
    # Rounded, so that of causes that explain alike the first counts.
    cause = max(explained, key=lambda name: round(explained[name], 2))
    if deviates.mean() <= SPIKE_SHARE and (uniform or explained[cause] < CAUSE_SHARE):
        return _describe_rare(base, inner.ticks[deviates]), numbers | {"spikes": ticks.size}
    numbers |= {f"share_{key}": share for key, share in medians.items()}
    if uniform and middle < 0.0:
        return f"it pulls where it should push, {abs(middle):.3g} times as hard", numbers
    if uniform:
        percent = abs(1e2 * (middle - 1.0))
        return f"{'stiffer' if middle > 1.0 else 'softer'} throughout, by {percent:.3g} per cent", numbers
    if explained[cause] < CAUSE_SHARE:
        return "it scatters", numbers
    if cause in ("time", "place") and abs(explained["time"] - explained["place"]) <= TELLING_SHARE:
        along_path = "it changes along the way, with time or with the place, which this path does not tell apart"
        return f"{along_path} ({_describe_extremes(base, inner)})", numbers
    if cause == "place":
        return f"it depends on the place ({_describe_extremes(base, inner)})", numbers
    first_side, second_side, verb = {
        "direction": ("inwards", "outwards", "depends on the"),
        "depth": ("shallow", "deep", "depends on the"),
        "time": ("first", "last", "drifts with"),
    }[cause]
    first, second = medians[first_side], medians[second_side]
    return (
        f"it {verb} {cause} ({first:.3g} of the scene's stiffness {SIDES[first_side]}, {second:.3g} "
        f"{SIDES[second_side]})",
        numbers,
    )


def _low_pass_constant(base: Recording, scene: Scene, ticks: IntArray) -> float | None:
    """Return the time constant T (s) of a low-pass filter F + T F' = s behind which the force is the spring's s.

    By least squares over `ticks` (n,). None where that leaves more than a tenth of |s - F|^2, and without an IHIP.
    """
    if "ihip" not in base.channels:
        return None
    ticks = ticks[np.isin(ticks - 1, ticks)]
    missing = scene.stiffness * (base.ihip[ticks] - base.hip[ticks]) - base.force[ticks]
    change = (base.force[ticks] - base.force[ticks - 1]) / base.dt
    power, common = float(np.sum(change**2)), float(np.sum(missing * change))
    # |s - F - T F'|^2 at the T that makes it least is |s - F|^2 less common^2 / power.
    if common <= 0.0 or common**2 < (1.0 - TELLING_SHARE) * power * float(np.sum(missing**2)):
        return None
    return common / power


SIDES = {
    "inwards": "on the way in",
    "outwards": "on the way out",
    "shallow": "at little depth",
    "deep": "deep inside",
    "first": "at first",
    "last": "in the end",
}
"""Words for the samples of which medians are compared."""


def _explain_by_causes(base: Recording, measured: Measured, count: int) -> tuple[dict[str, float], dict[str, float]]:
    """Return medians of the stiffness on both sides of what it may go with, and the share that each explains.

    Depths, times and places are divided into `count` groups.
    """
    time = base.time[measured.ticks]
    # First and last, shallowest and deepest tenth of the samples.
    early, late = np.quantile(time, (0.1, 0.9))
    shallow, deep = np.quantile(measured.depth, (0.1, 0.9))
    sides = {
        "inwards": measured.rate > 0.0,
        "outwards": measured.rate < 0.0,
        "shallow": measured.depth <= shallow,
        "deep": measured.depth >= deep,
        "first": time <= early,
        "last": time >= late,
    }
    medians = {name: _median(measured.ratio, rows) for name, rows in sides.items()}
    groups = {
        "direction": np.sign(measured.rate).astype(int)
        if np.isfinite(medians["inwards"] - medians["outwards"])
        else None,
        "depth": _rank_groups(measured.depth, count),
        "time": _rank_groups(time, count),
        "place": _place_groups(base.ihip[measured.ticks], count) if "ihip" in base.channels else None,
    }
    explained = {
        name: 0.0 if group is None else _explained_share(measured.ratio, group) for name, group in groups.items()
    }
    return medians, explained


def _describe_missing_force(base: Recording, scene: Scene, measured: Measured, deviates: BoolArray) -> str | None:
    """Return words for a force that is missing: up to a depth, or for stretches of time; None where it is there."""
    # A force that is small with its depth, and larger than the spring's, is not missing.
    silent = ~above_force_floor(base, scene)[measured.ticks] & (measured.ratio < 1.0)
    if not (silent & deviates).any():
        return None
    depths = measured.depth
    if "ihip" in base.channels and base.apart.any():
        depths = np.linalg.norm(base.hip - base.ihip, axis=1)[measured.ticks]
    depth = float(depths[silent].max())
    # All that is silent is shallower than all that is not: a dead band.
    if depth <= float(depths[~silent].min(initial=np.inf)):
        gives = f"{scene.stiffness * depth:.3g} N"
        return f"a dead band: no force up to a depth of {mm(depth)}, where the spring gives {gives}"
    if np.mean(silent[deviates]) < CAUSE_SHARE:
        return None
    ticks = measured.ticks[silent]
    longest, others_note = _longest_run(ticks)
    return f"no force {_describe_stretch(base, longest)}{others_note}"


def _describe_rare(base: Recording, ticks: IntArray) -> str:
    """Return words for few ticks that are off: spikes, where none lasts for longer than a lag, else a stretch."""
    longest, others_note = _longest_run(ticks)
    if longest.size > LAG_TICKS:
        return f"off {_describe_stretch(base, longest)}{others_note}"
    gaps = np.diff(ticks)
    # Every so many ticks: the gaps differ by a tenth of their mean at the most.
    regular = gaps.size > 1 and gaps.mean() > 1.0 and np.ptp(gaps) <= TELLING_SHARE * gaps.mean()
    period = f", every {round(gaps.mean())} ticks" if regular else ""
    return f"spikes: {ticks.size} tick{'s' if ticks.size > 1 else ''} off{period}"


def _longest_run(ticks: IntArray) -> tuple[IntArray, str]:
    """Return the longest run of consecutive ticks, and words for that there are others."""
    stretches = np.split(ticks, np.flatnonzero(np.diff(ticks) > 1) + 1)
    others = f", the longest of {len(stretches)} such stretches" if len(stretches) > 1 else ""
    return max(stretches, key=len), others


def _describe_stretch(base: Recording, ticks: IntArray) -> str:
    plural = "s" if ticks.size > 1 else ""
    return (
        f"for {ticks.size} tick{plural} from t = {base.time[ticks[0]]:.4g} s to {base.time[ticks[-1]]:.4g} s, with the "
        f"hand round {mm(*base.hip[ticks].mean(axis=0))}"
    )


def _describe_extremes(base: Recording, measured: Measured) -> str:
    """Return words for where the stiffness is least and where it is largest."""
    group = _place_groups(base.ihip[measured.ticks], GROUP_SAMPLES)
    medians = [float(np.median(measured.ratio[group == number])) for number in range(group.max() + 1)]
    words = []
    for number in (int(np.argmin(medians)), int(np.argmax(medians))):
        rows = measured.ticks[group == number]
        words.append(f"{medians[number]:.3g} of the scene's stiffness round {mm(*base.ihip[rows].mean(axis=0))}")
    return ", ".join(words)


def _rank_groups(values: Array, count: int) -> IntArray:
    """Return the group, of so many, of each value (n,): as many values in each, equal ones in one."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return np.searchsorted(edges, values)


def _place_groups(points: Array, count: int) -> IntArray:
    """Return the group, of up to so many, of each point (n, N): the longest is halved across until there are enough."""
    group = np.zeros(len(points), dtype=np.int64)
    for number in range(1, count):
        spans = [float(np.ptp(points[group == other], axis=0).max()) for other in range(number)]
        if max(spans) == 0.0:
            break
        rows = np.flatnonzero(group == int(np.argmax(spans)))
        along = points[rows, int(np.argmax(np.ptp(points[rows], axis=0)))]
        # The longest group is cut in the middle of its longest side.
        group[rows[along > 0.5 * (along.min() + along.max())]] = number
    return group


def _explained_share(ratio: Array, group: IntArray) -> float:
    """Return the share of the variance of the ranks of `ratio` (n,) that groups (n,) explain, 0 to 1.

    Ranks, for a ratio may be of any size where the depth is next to nothing.
    """
    # 1 - (variance within the groups) / (variance of all), of ranks
    ranks = np.unique(np.round(ratio, 6), return_inverse=True)[1]
    group = np.unique(group, return_inverse=True)[1]
    count = np.bincount(group)
    means = np.bincount(group, ranks) / count
    variance = float(np.var(ranks))
    return float(np.var(means[group])) / variance if variance > 0.0 else 0.0


def _median(ratio: Array, where: BoolArray) -> float:
    return float(np.median(ratio[where])) if int(where.sum()) >= GROUP_SAMPLES else float("nan")


CHECK = Check(
    id="force-magnitude",
    phenomenon="none of the six: the regulation scheme's stiffness, (4.6) and (6.1)",
    formula="K = -F.e / e^2 with e = HIP - IHIP; along the normal, K = F^2 / (-F.e); K = K_p at every tick in contact",
    citation="thesis 4.2, (4.8), (5.21), (6.1)",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity", "measured_hip", "measured_velocity"),
    metric="apparent stiffness less the scene's, as a share of it",
    unit="",
    judge=judge,
    level=Level.SHOULD,
)
