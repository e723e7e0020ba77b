"""Force magnitude: the force is as large as the scene's stiffness makes it at that depth, always and everywhere."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from hapticeval.phenomena.check import Check, Runs
from hapticeval.phenomena.sampling import (
    LAG_TICKS,
    TELLS,
    above_force_floor,
    believed_standoff,
    evidence_at,
    hip_step,
    lacks_ihip,
    rounding,
    standoff,
    touching,
)
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, undecided
from hapticeval.recordings.recording import SINGLE, Recording, backward_difference
from hapticeval.renderer import Spring
from hapticeval.scene import Scene
from hapticeval.types import Array, BoolArray, IntArray

SPIKES = 0.1
"""Ticks that are off are spikes up to this share of all: more of them are what the renderer does as a rule."""

HALF = 0.5
"""Share of the deviation's spread, or of its variance, from which its cause is named."""

SOME = 8
"""Fewer samples make no median worth comparing; and into so many groups depths and times are divided."""


@dataclass(frozen=True)
class Measured:
    """The apparent stiffness, as a share of the scene's, at `ticks` (n,) of a recording.

    `ratio` is that of HIP and IHIP of the same tick; `low` and `high` are its ends over all that a lag may have done,
    and `allowed` what a damper, the way's curvature and rounding may add. `rate` is that of the depth, m/s.
    """

    ticks: IntArray
    ratio: Array
    low: Array
    high: Array
    allowed: Array
    depth: Array
    rate: Array

    @property
    def excess(self) -> Array:
        """How far a share is from one beyond what is allowed: (n,)."""
        return np.asarray(np.maximum(np.maximum(self.low - 1.0, 1.0 - self.high), 0.0) - self.allowed)

    @property
    def clear(self) -> Measured:
        """The samples where what is allowed is little."""
        return Measured(*(getattr(self, each.name)[self.allowed <= TELLS] for each in fields(self)))


def judge(runs: Runs, scene: Scene) -> Finding:
    """Measure the stiffness at every tick in contact, and look for what explains its deviations."""
    base = runs.base
    if not above_force_floor(base, scene).any():
        return undecided("no force above the floor: the tool never presses on the surface")
    declared = base.meta.get("spring")
    if lacks_ihip(base, scene):
        return replace(_without_ihip(base, scene), level=Level.SHOULD)
    level = Level.MUST if declared is not None else Level.SHOULD
    depths = np.linalg.norm(base.hip - base.ihip, axis=1)
    if not depths[above_force_floor(base, scene)].any():
        message = "a rigid contact: its force comes without a depth, and has no stiffness that could be measured"
        return Finding(Outcome.NOT_APPLICABLE, message, level=level)
    springs = tuple(Spring) if declared is None else (Spring(declared),)
    found = [_measure(base, scene, spring).clear for spring in springs]
    # One who does not declare a law is measured by the one that fits better.
    return replace(_finding(base, scene, min(found, key=_misfit)), level=level)


def _misfit(measured: Measured) -> tuple[bool, float, float]:
    off = measured.excess > 0.0
    return (not off.size, float(off.mean()) if off.size else 0.0, float(measured.excess.max(initial=0.0)))


def _measure(base: Recording, scene: Scene, spring: Spring) -> Measured:
    now = np.flatnonzero(touching(base, scene))
    force = base.force[now]
    errors = [base.hip[now] - base.ihip[now]]
    for lag in range(1, LAG_TICKS + 1):
        before, after = np.maximum(now - lag, 0), np.minimum(now + lag, len(base) - 1)
        errors += [base.hip[hip] - base.ihip[ihip] for hip, ihip in ((before, now), (before, before), (now, after))]
    shares = np.array([_share(force, each, scene.stiffness, spring) for each in errors])
    along, depth = _along(force, errors[0], spring)
    # A spring that gives nothing has no direction of its own: what it should have given is along the error. One across
    # the surface has nothing to give above the tangent, as beside a neck with the IHIP on its other side.
    granted = LAG_TICKS * hip_step(base, scene) + believed_standoff(base, scene)
    idle = ~above_force_floor(base, scene)[now] & (np.linalg.norm(errors[0], axis=1) > granted)
    if spring is Spring.NORMAL and idle.any():
        normal = scene.model.boundary.closest_point(base.ihip[now[idle]]).normal
        idle[idle] = np.sum(normal * errors[0][idle], axis=1) < -granted
    shares[:, idle] = [_share(force[idle], each[idle], scene.stiffness, Spring.ERROR) for each in errors]
    along[idle], depth[idle] = _along(force[idle], errors[0][idle], Spring.ERROR)
    velocity = _velocity(base)
    sinking = backward_difference(base.hip - base.ihip, base.time)[now]
    speed, spreading = (np.abs(np.sum(along * each, axis=1)) for each in (velocity[now], sinking))
    allowed = scene.damping * np.maximum(speed, spreading)
    if "spring" not in base.meta:
        allowed = allowed + scene.mass * _bending(base, scene, velocity, now)
    apart = 4.0 * SINGLE * (float(np.max(np.abs(base.hip))) + depth)
    with np.errstate(divide="ignore"):
        allowed = (allowed / scene.stiffness + apart) / depth
    open_ends = np.isnan(shares).any(axis=0)
    low, high = (np.where(open_ends, end, most(shares, axis=0)) for end, most in ((-np.inf, np.min), (np.inf, np.max)))
    return Measured(now, shares[0], low, high, allowed, depth, np.sum(along * sinking, axis=1))


def _velocity(base: Recording) -> Array:
    return base.velocity if "velocity" in base.channels else backward_difference(base.hip, base.time)


def _along(force: Array, error: Array, spring: Spring) -> tuple[Array, Array]:
    """Return the direction in which the depth is measured, (n, N), and the depth, (n,), m; zero where there is none."""
    direction = error if spring is Spring.ERROR else -force
    size = np.linalg.norm(direction, axis=1)
    unit = np.divide(direction, size[:, np.newaxis], out=np.zeros_like(direction), where=size[:, np.newaxis] > 0.0)
    return unit, np.abs(np.sum(unit * error, axis=1))


def _share(force: Array, error: Array, stiffness: float, spring: Spring) -> Array:
    """Return the stiffness as a share of the scene's, (n,): -F.e / e^2, or F^2 / -F.e across the surface."""
    push = -np.sum(force * error, axis=1)
    above, below = (push, np.sum(error**2, axis=1)) if spring is Spring.ERROR else (np.sum(force**2, axis=1), push)
    share = np.full(push.size, np.nan)
    return np.asarray(np.divide(above, stiffness * below, out=share, where=below != 0.0))


def _bending(base: Recording, scene: Scene, velocity: Array, ticks: IntArray) -> Array:
    """Return |kappa| v^2 of the way along the surface (3.8), (n,), m/s^2: by which a law that knows it may differ.

    With v the speed of the hand, or of the IHIP since the tick before or to the next, whichever is largest: where the
    curvature jumps, so does the IHIP's speed.
    """
    shape = scene.model.boundary.closest_point(base.ihip[ticks]).shape
    largest = np.max(np.abs(np.linalg.eigvalsh(shape)), axis=1)
    sliding = backward_difference(base.ihip, base.time)
    after = np.minimum(ticks + 1, len(base) - 1)
    speeds = (np.linalg.norm(each, axis=1) for each in (velocity[ticks], sliding[ticks], sliding[after]))
    speed = np.max([*speeds], axis=0)
    return np.asarray(largest * speed**2)


def _without_ihip(base: Recording, scene: Scene) -> Finding:
    """Judge a force without an IHIP against the depth of the HIP under the model, the least that any IHIP could have.

    A tool that lags behind is farther away, and makes a larger force of it: only one that is too soft is seen.
    """
    ticks = np.flatnonzero(above_force_floor(base, scene))
    depth = np.maximum(-scene.model.boundary.signed_distance(base.hip), 0.0)
    late = np.array([depth[np.maximum(ticks - lag, 0)] for lag in range(LAG_TICKS + 1)])
    size = np.linalg.norm(base.force[ticks], axis=1)
    shares = np.divide(size, scene.stiffness * late, out=np.full(late.shape, np.inf), where=late > 0.0)
    speed = np.linalg.norm(_velocity(base)[ticks], axis=1)
    with np.errstate(divide="ignore"):
        allowed = (scene.damping * speed / scene.stiffness + rounding(scene) + standoff(base, scene)) / late[0]
    high = shares.max(axis=0)
    rate = backward_difference(depth[:, np.newaxis], base.time)[ticks, 0]
    measured = Measured(ticks, shares[0], np.minimum(high, 1.0), high, allowed, late[0], rate).clear
    note = "no IHIP was given: measured against the depth of the HIP under the model"
    finding = _finding(base, scene, measured)
    if finding.outcome is Outcome.PASS:
        message = f"the force is nowhere too small for its depth; {note}, which does not show one that is too large"
        return replace(finding, outcome=Outcome.INCONCLUSIVE, message=message)
    return replace(finding, message=f"{finding.message} ({note})")


def _finding(base: Recording, scene: Scene, measured: Measured) -> Finding:
    if measured.ticks.size == 0:
        return undecided(
            "a damper or the rounding of the numbers may make a tenth of the force or more throughout: "
            "its stiffness cannot be measured"
        )
    excess = measured.excess
    worst = int(np.argmax(excess))
    tick, share = int(measured.ticks[worst]), float(measured.ratio[worst])
    bound = float(measured.allowed[worst])
    low, median, high = (scene.stiffness * float(each) for each in np.percentile(measured.ratio, (5, 50, 95)))
    deepest = int(np.argmax(measured.depth))
    size, depth = float(np.linalg.norm(base.force[measured.ticks[deepest]])), float(measured.depth[deepest])
    evidence: dict[str, object] = {
        **evidence_at(base, tick),
        "apparent_stiffness_N_m": median,
        "stiffness_05_N_m": low,
        "stiffness_95_N_m": high,
        "samples": int(measured.ticks.size),
        "force_N": size,
        "depth_m": depth,
        "depth_asked_m": size / scene.stiffness,
    }
    at_deepest = (
        f"at the deepest {size:.3g} N at {1e3 * depth:.4g} mm, where K = {scene.stiffness:g} N/m asks for "
        f"{1e3 * size / scene.stiffness:.4g} mm"
    )
    if excess[worst] <= 0.0:
        # Within a lag's reach the ends of the share enclose one, wherever the present HIP alone would put it.
        metric = Metric(CHECK.metric, float(np.maximum(excess + measured.allowed, 0.0)[worst]), "")
        message = f"the force fits the depth, with an apparent stiffness of {median:.4g} N/m; {at_deepest}"
        return Finding(Outcome.PASS, message, metric, bound, evidence)
    pattern, numbers = _pattern(base, measured)
    message = (
        f"{pattern}: an apparent stiffness of {scene.stiffness * share:.4g} N/m at t = {base.time[tick]:.4g} s (tick "
        f"{tick}), of {median:.4g} in the median, and from {low:.4g} to {high:.4g} in nine tenths of the samples, for "
        f"the scene's {scene.stiffness:g}; {at_deepest}"
    )
    return Finding(Outcome.FAIL, message, Metric(CHECK.metric, abs(share - 1.0), ""), bound, evidence | numbers)


def _pattern(base: Recording, measured: Measured) -> tuple[str, dict[str, object]]:
    """Return what the deviations go with, in words, and the numbers that show it."""
    ratio, off, time = measured.ratio, measured.excess > 0.0, base.time[measured.ticks]
    early, late = np.quantile(time, (0.1, 0.9))
    shallow, deep = np.quantile(measured.depth, (0.1, 0.9))
    inwards, outwards = measured.rate > 0.0, measured.rate < 0.0
    causes = {
        "direction": (np.sign(measured.rate), inwards, outwards, "on the way in", "on the way out"),
        "depth": (measured.depth, measured.depth <= shallow, measured.depth >= deep, "at little depth", "deep inside"),
        "time": (time, time <= early, time >= late, "at first", "in the end"),
    }
    medians = {name: (_median(ratio, one), _median(ratio, other)) for name, (_, one, other, *_) in causes.items()}
    shares: dict[str, object] = {"share_off": float(off.mean())}
    middle = float(np.median(ratio))
    uniform = max(abs(ratio - middle)) <= HALF * abs(middle - 1.0)
    explained = {
        name: _explained(ratio, causes[name][0]) if np.isfinite(one - other) else 0.0
        for name, (one, other) in medians.items()
    }
    cause = max(explained, key=lambda name: round(explained[name], 2))
    if off.mean() <= SPIKES and (uniform or explained[cause] < HALF):
        ticks = measured.ticks[off]
        gaps = np.diff(ticks)
        regular = gaps.size > 1 and gaps.mean() > 1.0 and np.ptp(gaps) <= TELLS * gaps.mean()
        every = f", every {round(gaps.mean())} ticks" if regular else ""
        return f"spikes: {ticks.size} tick{'s' if ticks.size > 1 else ''} off{every}", shares | {"spikes": ticks.size}
    keys = ("inwards", "outwards", "shallow", "deep", "first", "last")
    shares |= {f"share_{key}": share for key, share in zip(keys, sum(medians.values(), ()), strict=True)}
    if uniform:
        percent = abs(1e2 * (middle - 1.0))
        return f"{'stiffer' if middle > 1.0 else 'softer'} throughout, by {percent:.3g} per cent", shares
    if explained[cause] >= HALF:
        (one, other), (*_, here, there) = medians[cause], causes[cause]
        verb = "drifts with" if cause == "time" else "depends on the"
        return f"it {verb} {cause} ({one:.3g} of the scene's stiffness {here}, {other:.3g} {there})", shares
    return "it scatters", shares


def _explained(ratio: Array, by: Array) -> float:
    """Return the share of the variance of the ranks of `ratio` (n,) that groups of `by` (n,) explain, 0 to 1.

    Groups are the values of `by`, or eighths of the samples where there are more than that many. Ranks, for a ratio may
    be of any size where the depth is next to nothing.
    """
    ranks = np.unique(np.round(ratio, 6), return_inverse=True)[1]
    values, group = np.unique(by, return_inverse=True)
    if values.size > SOME:
        edges = np.quantile(by, np.linspace(0.0, 1.0, SOME + 1)[1:-1])
        group = np.searchsorted(edges, by)
    count = np.maximum(np.bincount(group), 1)
    means = np.bincount(group, ranks) / count
    whole = float(np.var(ranks))
    return float(np.var(means[group])) / whole if whole > 0.0 else 0.0


def _median(ratio: Array, where: BoolArray) -> float:
    return float(np.median(ratio[where])) if int(where.sum()) >= SOME else float("nan")


CHECK = Check(
    id="force-magnitude",
    phenomenon="none of the six: the regulation scheme's stiffness, (4.6) and (6.1)",
    asks="Is the force as large as the scene's stiffness asks for at that depth, in all directions and at all times?",
    formula="K = -F.e / e^2 with e = HIP - IHIP; along the normal, K = F^2 / (-F.e); K = K_p at every tick in contact",
    citation="thesis 4.2, (4.8), (5.21), (6.1)",
    channels=("hip", "ihip", "force"),
    reads_also=("velocity",),
    metric="apparent stiffness less the scene's, as a share of it",
    unit="",
    bound=(
        "Of a linear spring the force is K_p times the depth exactly, so that nothing is allowed but what is known to "
        "come on top, as a share of K_p times the depth d: a damper's K_d v, with v the speed along the direction in "
        "which the depth is measured, of the hand or of the error, whichever is larger; m kappa v^2 of the way along "
        "the surface (3.8), by HIP or IHIP, for a renderer that declares no spring; and single precision, 4 * 2^-23 "
        "(size of the coordinates / d + 1). Of HIPs and IHIPs up to three ticks apart, or both as late, any may "
        "belong to a force: K_p has to lie within what they span. Ticks where more than a tenth is allowed are not "
        "judged, nor those where a lag reaches to before the contact. A renderer may declare along what it is a "
        "spring (`Declaration`): then the level is must. Another is measured along the error or across the surface, "
        "as it fits better, and the level is should: a law that is not proportional, as the square root's, or one "
        "that knows the curvature, is no fault, but is not the scene's K_p either. A force without an IHIP is held "
        "against the depth under the model, which an honest tool's distance is never less than: too soft fails, the "
        "rest is not decided. A failure names what explains at least half of the deviation's variance: the direction, "
        "the depth or the time; else whether single ticks are off (spikes)."
    ),
    judge=judge,
    level=Level.SHOULD,
)
